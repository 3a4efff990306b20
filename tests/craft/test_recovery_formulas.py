"""Closed forms beside loads and motions recovered inside an appendage: sums over points of a beam,
cross products written out, and runs whose extremes are known."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.craft.recovered_body import SAME
from formulas import (
    Body,
    Coordinates,
    History,
    Kept,
    Recovery,
    RootMotion,
    acceleration_of_sections,
    appendage_at,
    attachment_turn,
    beam_body,
    carried_load,
    check_same_modes,
    felt_by_modes,
    imported_body,
    load_of_modes_left_out,
    participation_of_tendon,
    place_of,
    recover_inside,
    recovery_of_beam,
    recovery_of_imported,
    rigid_load,
    root_factors,
    run_of_data,
    sections_at,
    stations_of,
    tip_displacement,
    wrench_on_ports,
)

RNG = np.random.default_rng(9)


def root(count=2, carried=0):
    one = RNG.standard_normal((count, 6))
    return RootMotion(
        one, *(RNG.standard_normal((count, 3)) for _ in range(2)), np.zeros((count, 6)),
        RNG.standard_normal((count, carried, 6)),
    )  # fmt: skip


# -- loads -----------------------------------------------------------------------------------------
LUMPS = ((1.3, 2.0, (0.3, 0.4, 0.5)), (2.5, 3.0, (0.2, 0.6, 0.5)), (4.0, 1.5, (0.1, 0.2, 0.25)))


def test_load_of_a_rigid_beam_is_newton_s_and_euler_s():
    """Of lumps on the axis: -m (a - g) of each, -(J a + w x J w), and their arms; the beam itself
    is as light as air."""
    section = bc.Equivalent(bending_stiffness_xy=900.0, linear_mass=1e-12)
    beam = bc.Beam(
        segments=[bc.Segment(length=4.0, section=section)],
        lumps=[bc.Lump(x=x, mass=m, inertia=j) for x, m, j in LUMPS],
    )
    moved = root()
    stations = np.array([0.0, 1.3, 2.0, 3.9])
    found = rigid_load(beam, moved, stations)
    for t in range(2):
        a, turn = moved.acceleration[t, :3] - moved.gravity[t], moved.acceleration[t, 3:]
        w = moved.spin[t]
        for s, station in enumerate(stations):
            wanted = np.zeros(6)
            for x, mass, inertia in LUMPS:
                if x <= station:
                    continue
                place = np.array([x, 0.0, 0.0])
                force = -mass * (a + np.cross(turn, place) + np.cross(w, np.cross(w, place)))
                own = np.diag(inertia)
                moment = -(own @ turn + np.cross(w, own @ w))
                arm = np.array([x - station, 0.0, 0.0])
                wanted += np.append(force, moment + np.cross(arm, force))
            np.testing.assert_allclose(found[t, s], wanted, rtol=1e-9, atol=1e-9)


def test_wrenches_on_points_load_what_lies_before_them():
    """A point at the station itself is not beyond it."""
    carried, places = RNG.standard_normal((2, 2, 6)), (2.0, 3.5)
    stations = np.array([0.0, 1.9, 2.0, 3.0, 3.5, 3.6])
    found = carried_load(stations, places, carried)
    for t in range(2):
        for s, station in enumerate(stations):
            wanted = np.zeros(6)
            for c, x in enumerate(places):
                if station < x:
                    force, moment = carried[t, c, :3], carried[t, c, 3:]
                    arm = np.array([x - station, 0.0, 0.0])
                    wanted += np.append(force, moment + np.cross(arm, force))
            np.testing.assert_allclose(found[t, s], wanted, atol=1e-14)


def test_several_bodies_may_stand_on_a_port():
    moved = root(carried=3)
    found = wrench_on_ports(moved, SimpleNamespace(ports=(1, 0, 1)), 3)
    np.testing.assert_allclose(found[:, 0], moved.carried[:, 1])
    np.testing.assert_allclose(found[:, 1], moved.carried[:, 0] + moved.carried[:, 2])
    assert np.all(found[:, 2] == 0.0)


COLUMNS = {"xy": [1, 5], "xz": [2, 4], "torsion": [3], "axial": [0]}


@pytest.mark.parametrize("port", ["xy", "xz", "torsion", "axial"])
def test_load_of_modes_left_out_is_that_of_all_less_the_kept(port):
    """Each kept mode's part, tau f - L a, is taken off; the motions are those of static shapes."""
    columns = COLUMNS[port]
    m, driven = len(columns), len(columns) + (port == "axial")
    inside = SimpleNamespace(
        drive=RNG.standard_normal((2, driven)),
        drive_carried=RNG.standard_normal((2, 2 * m)),
        momentum=RNG.standard_normal((2, 3, m)),
        left_out=RNG.standard_normal((3, m, driven)),
        left_out_carried=RNG.standard_normal((3, m, 2 * m)),
    )
    felt, spin = RNG.standard_normal((4, 6)), RNG.standard_normal((4, 3))
    carried = RNG.standard_normal((4, 2, 6))
    load, shift = load_of_modes_left_out(port, inside, felt, spin, carried)
    # along or about the motion of a port, xz turns about -y
    sign = np.array([1.0, -1.0]) if port == "xz" else np.ones(m)
    for t in range(4):
        a = felt[t, columns] * sign
        if port == "axial":
            a = np.append(a, -(spin[t, 1] ** 2) - spin[t, 2] ** 2)
        f = (carried[t][:, columns] * sign).ravel()
        for s in range(3):
            taken = sum(
                (inside.drive_carried[k] @ f - inside.drive[k] @ a) * inside.momentum[k, s]
                for k in range(2)
            )
            np.testing.assert_allclose(load[t, s], -taken, atol=1e-12)
            moved = inside.left_out[s] @ a + inside.left_out_carried[s] @ f
            np.testing.assert_allclose(shift[t, s], moved, atol=1e-12)


def test_sections_accelerate_as_points_of_a_turning_frame():
    moved, stations = root(), np.array([0.5, 2.0])
    factors = RNG.standard_normal((2, 6, 3))
    modes = SimpleNamespace(
        rates=RNG.standard_normal((2, 3)), accelerations=RNG.standard_normal((2, 3))
    )
    found = acceleration_of_sections(moved, stations, factors, modes)
    for t in range(2):
        w, turn = moved.spin[t], moved.acceleration[t, 3:]
        for s, x in enumerate(stations):
            place = np.array([x, 0.0, 0.0])
            speed, bend = np.split(factors[s] @ modes.rates[t], 2)
            along, about = np.split(factors[s] @ modes.accelerations[t], 2)
            linear = moved.acceleration[t, :3] + np.cross(turn, place)
            linear += np.cross(w, np.cross(w, place)) + 2.0 * np.cross(w, speed) + along
            np.testing.assert_allclose(found[t, s, :3], linear, atol=1e-12)
            np.testing.assert_allclose(
                found[t, s, 3:], turn + np.cross(w, bend) + about, atol=1e-12
            )


def test_modes_feel_the_root_against_free_fall_and_what_a_spin_adds():
    """A point at x e_x is accelerated by a - g + x (turn x e_x + w (w e_x) - w^2 e_x)."""
    moved = root()
    found = felt_by_modes(moved)
    for t in range(2):
        w, turn = moved.spin[t], moved.acceleration[t, 3:]
        np.testing.assert_allclose(found[t, :3], moved.acceleration[t, :3] - moved.gravity[t])
        ahead = np.array([1.0, 0.0, 0.0])
        whole = np.cross(turn, ahead) + np.cross(w, np.cross(w, ahead))
        across = np.cross(found[t, 3:], ahead)
        np.testing.assert_allclose(across[1:], whole[1:], atol=1e-14)
        assert found[t, 3] == turn[0]


def test_load_on_the_root_per_unit_of_a_mode():
    """L W^2, with the sign that the shapes of the whole beam have."""
    ports = {
        port: SimpleNamespace(
            frequencies=RNG.uniform(1.0, 9.0, 2),
            drive=RNG.standard_normal((2, len(columns) + (port == "axial"))),
        )
        for port, columns in COLUMNS.items()
    }
    signs = {port: np.array([[1.0], [-1.0]]) for port in ports}
    target = {
        port: SimpleNamespace(participation=signs[port] * 0.9 * one.drive[:, : len(COLUMNS[port])])
        for port, one in ports.items()
    }
    columns = {port: slice(2 * i, 2 * i + 2) for i, port in enumerate(ports)}
    modes = SimpleNamespace(names=tuple("abcdefgh"), columns=columns)
    appendage = SimpleNamespace(fit=SimpleNamespace(target=target))
    found = root_factors(appendage, SimpleNamespace(ports=ports), modes)
    for port, one in ports.items():
        turned = np.array([1.0, -1.0]) if port == "xz" else np.ones(len(COLUMNS[port]))
        for k in range(2):
            wanted = np.zeros(6)
            drive = one.drive[k, : len(COLUMNS[port])]
            wanted[COLUMNS[port]] = 0.9 * drive * turned * one.frequencies[k] ** 2
            np.testing.assert_allclose(found[:, columns[port]][:, k], wanted, atol=1e-12)


# -- modal coordinates -----------------------------------------------------------------------------
def test_amplitudes_follow_from_the_force_of_the_tendons():
    """W^2 eta = T K b q, with the stiffness that the model has for those of its tendons."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="a"/><geom size="1"/><body><joint name="b"/>
        <geom size="1"/></body></body></worldbody><tendon><fixed name="arm_mode2" stiffness="35">
        <joint joint="a" coef="1"/></fixed></tendon></mujoco>"""
    )
    rows, turn = RNG.standard_normal((2, 2)), RNG.standard_normal((2, 2))
    w = np.array([3.0, 5.5])
    at, dofs = np.array([4, 1]), np.array([2, 0])
    made = Coordinates(
        ("one", "two"), rows, np.array([9.5, 31.0]), ("arm_mode1", "arm_mode2"), at, dofs, turn, w
    )
    qpos, rates = RNG.standard_normal((3, 5)), RNG.standard_normal((3, 4))
    for t in range(3):
        force = np.array([9.5, 35.0]) * (rows @ qpos[t, at])
        assert made.amplitudes(model, qpos)[t] == pytest.approx(turn @ force / w**2)
        assert made.rates(rates)[t] == pytest.approx(turn @ rows @ rates[t, dofs])


# -- what is given ---------------------------------------------------------------------------------
MODEL = mujoco.MjModel.from_xml_string(
    """<mujoco><option timestep="0.25"/><worldbody><body><joint/><joint/><geom size="1"/></body>
    <body mocap="true"><geom size="1"/></body></worldbody>
    <actuator><general joint="" dyntype="filter"/></actuator></mujoco>""".replace(
        "<joint/><joint/>", '<joint name="j"/><joint axis="1 0 0"/>'
    ).replace('joint=""', 'joint="j"')
)
SHAPES = {
    "qpos": (2,), "qvel": (2,), "qacc": (2,), "ctrl": (1,), "act": (1,), "qfrc_applied": (2,),
    "xfrc_applied": (3, 6), "mocap_pos": (1, 3), "mocap_quat": (1, 4),
}  # fmt: skip


def test_arrays_of_data_have_the_shapes_of_the_model():
    """Without times they are a step apart."""
    arrays = {name: RNG.standard_normal((3, *shape)) for name, shape in SHAPES.items()}
    run = run_of_data(MODEL, arrays)
    assert run.time == pytest.approx([0.0, 0.25, 0.5])
    for name, values in arrays.items():
        np.testing.assert_array_equal(run.arrays[name], values)
    assert run_of_data(MODEL, {**arrays, "time": [1.0, 2.0, 4.0]}).time.tolist() == [1.0, 2.0, 4.0]
    for name, shape in SHAPES.items():
        for wrong in ((3, *shape[:-1], shape[-1] + 1), (4, *shape)):
            if name == "qpos" and wrong[0] == 4:
                continue
            with pytest.raises(bc.InputError, match=name):
                run_of_data(MODEL, {**arrays, name: np.zeros(wrong)})
    assert len(run_of_data(MODEL, {"qpos": np.zeros((1, 2))}).time) == 1
    with pytest.raises(bc.InputError, match="no instant"):
        run_of_data(MODEL, {"qpos": np.zeros((0, 2))})


def beam_of(length, **more):
    beam = bc.Beam(
        segments=[
            bc.Segment(
                length=length,
                section=bc.Rectangle(width_y=0.04, width_z=0.02),
                material=bc.Material(youngs_modulus=7e10, density=2700.0),
            )
        ]
    )
    spec = SimpleNamespace(beam=beam)
    return SimpleNamespace(at="mount", fit=SimpleNamespace(space=None, spec=spec), **more)


def test_stations_lie_on_the_beam():
    held = beam_of(4.0)
    assert stations_of(held, None) == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0])
    assert stations_of(held, 1.5) == pytest.approx([1.5])
    assert stations_of(held, [0.0, 4.0]) == pytest.approx([0.0, 4.0])
    assert stations_of(held, [4.0 * (1.0 + 1e-13)]) == [4.0]
    assert stations_of(held, np.linspace(0.0, 4.0, 1000)).size == 1000
    for wrong in ([-1e-3], [4.001], [], np.linspace(0.0, 4.0, 1001)):
        with pytest.raises(bc.InputError):
            stations_of(held, wrong)
    imported = SimpleNamespace(at="mount", fit=SimpleNamespace(space="modes"))
    assert stations_of(imported, None).size == 0
    with pytest.raises(bc.InputError):
        stations_of(imported, [1.0])


def test_the_only_appendage_needs_no_name():
    one, other = SimpleNamespace(at="left"), SimpleNamespace(at="right")
    assert appendage_at([one], None) is one
    assert appendage_at([one, other], "right") is other
    for place in (None, "up"):
        with pytest.raises(bc.InputError, match="choose from left, right|left"):
            appendage_at([one, other], place)


# -- extremes --------------------------------------------------------------------------------------
def recovered():
    """Loads of two modes at two stations: bending about z by the first, about y by the second, and
    a pull that neither makes."""
    time = np.array([0.0, 1.0, 2.0])
    amplitudes = np.array([[1.0, 0.5], [-2.0, 1.5], [0.1, 0.2]])
    accelerations = -amplitudes[::-1]
    x = np.array([0.0, 1.0])
    factors = np.zeros((2, 6, 2))
    factors[:, 5, 0], factors[:, 4, 1] = (30.0, 20.0), (14.0, 7.0)
    load = np.einsum("sin,tn->tsi", factors, amplitudes)
    load[2, :, 0] = 9e4
    beam = beam_of(4.0).fit.spec.beam
    axes = ("x", "y", "z")
    histories = {
        "force": History(
            "force", axes, ("N",) * 3, load[..., :3], factors[:, :3], "amplitudes", "rest", x
        ),
        "moment": History(
            "moment", axes, ("N m",) * 3, load[..., 3:], factors[:, 3:], "amplitudes", "rest", x
        ),
        "felt": History(
            "felt", ("",), ("m/s^2",), accelerations[:, None, :1] * 3.0 + 1.0,
            np.array([[[3.0, 0.0]]]), "accelerations", "root", np.zeros(0),
        ),
    }  # fmt: skip
    return Recovery(
        "mount", time, x, ("one", "two"), amplitudes, accelerations, histories, True,
        sections_at(beam, x),
    )  # fmt: skip


def test_extremes_say_when_and_which_mode():
    found = {(row.quantity, row.x): row for row in recovered().extremes}
    row = found["moment z", 1.0]
    assert tuple(row[3:]) == (-40.0, 1.0, "one", 20.0, 0.0, "one")
    row = found["moment y", 0.0]
    assert tuple(row[3:]) == (pytest.approx(2.8), 2.0, "two", pytest.approx(21.0), 1.0, "two")
    row = found["force x", 0.0]
    assert tuple(row[3:]) == (0.0, 0.0, "nothing", 9e4, 2.0, "rest")
    # 3 a + 1 of a = -0.1, 2, -1: the mode has -3 of -2, 6 of 7
    row = found["felt", None]
    assert tuple(row[1:]) == ("m/s^2", None, -2.0, 2.0, "one", 7.0, 1.0, "one")


def test_stress_is_largest_in_the_corner_that_both_moments_pull():
    """N / A + |M_z| y / I_z + |M_y| z / I_y; of what the largest comes from."""
    made = recovered()
    area, second_z, second_y = 8e-4, 0.02 * 0.04**3 / 12.0, 0.04 * 0.02**3 / 12.0
    bends = [
        [(mz * 0.02 / second_z, my * 0.01 / second_y) for mz, my in ((30.0 * a, 14.0 * b),
         (20.0 * a, 7.0 * b))]
        for a, b in ((1.0, 0.5), (2.0, 1.5), (0.1, 0.2))
    ]  # fmt: skip
    pull = np.array([0.0, 0.0, 9e4 / area])
    both = np.sum(bends, axis=2)
    np.testing.assert_allclose(made.stress[..., 0], pull[:, None] + both)
    np.testing.assert_allclose(made.stress[..., 1], pull[:, None] - both)
    rows = [row for row in made.extremes if row.quantity == "stress"]
    assert [row.x for row in rows] == [0.0, 1.0]
    for s, row in enumerate(rows):
        assert row.unit == "N/m^2"
        assert row.smallest == pytest.approx(-both[1, s])
        assert row.largest == pytest.approx(pull[2] + both[2, s])
        assert (row.smallest_at, row.largest_at) == (1.0, 2.0)
        first, second = bends[1][s]
        assert row.smallest_from == ("one" if first > second else "two")
        assert row.largest_from == "modes left out"


# -- histories -------------------------------------------------------------------------------------
def test_loads_and_motions_of_the_modes_of_a_beam_by_force_and_moment():
    """One mode of xy and one of torsion at two stations, of a root that stands still."""
    inside = {
        port: SimpleNamespace(
            frequencies=np.array([w]),
            momentum=RNG.standard_normal((1, 2, len(COLUMNS[port]))),
            motion=RNG.standard_normal((1, 2, len(COLUMNS[port]))),
            drive=RNG.standard_normal((1, len(COLUMNS[port]))),
        )
        for port, w in (("xy", 3.0), ("torsion", 7.0))
    }
    target = {port: SimpleNamespace(participation=one.drive) for port, one in inside.items()}
    held = beam_of(4.0)
    held.fit.spec.further = {}
    held.fit.target = target
    still, none = np.zeros((3, 6)), np.zeros((3, 3))
    motion = SimpleNamespace(roots=(RootMotion(still, none, none, still, np.zeros((3, 0, 6))),))
    amplitudes, accelerations = RNG.standard_normal((2, 3, 2))
    modes = SimpleNamespace(
        names=("one", "two"),
        columns={"xy": slice(0, 1), "torsion": slice(1, 2)},
        amplitudes=amplitudes,
        rates=np.zeros((3, 2)),
        accelerations=accelerations,
    )
    found = recovery_of_beam(
        held,
        SimpleNamespace(ports=()),
        SimpleNamespace(ports=inside),
        SimpleNamespace(time=np.arange(3.0)),
        motion,
        modes,
        stations=np.array([0.5, 2.0]),
        static=False,
    ).histories
    bends, twists = inside["xy"], inside["torsion"]
    wanted = {
        "root force": [(1, 0, 9.0 * bends.drive[0, 0])],
        "root moment": [(2, 0, 9.0 * bends.drive[0, 1]), (0, 1, 49.0 * twists.drive[0, 0])],
        "force": [(1, 0, 9.0 * bends.momentum[0, :, 0])],
        "moment": [
            (2, 0, 9.0 * bends.momentum[0, :, 1]), (0, 1, 49.0 * twists.momentum[0, :, 0]),
        ],
        "displacement": [(1, 0, bends.motion[0, :, 0])],
        "rotation": [(2, 0, bends.motion[0, :, 1]), (0, 1, twists.motion[0, :, 0])],
    }  # fmt: skip
    wanted["acceleration"], wanted["angular acceleration"] = (
        wanted["displacement"], wanted["rotation"],
    )  # fmt: skip
    for name, entries in wanted.items():
        factors = np.zeros((1 if "root" in name else 2, 3, 2))
        for axis, mode, values in entries:
            factors[:, axis, mode] = values
        one = found[name]
        np.testing.assert_allclose(one.factors, factors, atol=1e-12, err_msg=name)
        if "root" not in name:
            by = accelerations if "acceleration" in name else amplitudes
            np.testing.assert_allclose(
                one.values, np.einsum("sin,tn->tsi", factors, by), atol=1e-12, err_msg=name
            )
        assert len(one.units) == len(one.parts) == 3


def test_a_mode_takes_part_by_the_masses_that_its_tendon_moves():
    """Two tendons over two hinges, as soft as those of a slow body; a third is over another, and a
    fourth is none."""
    both, other = (("one", "xy"), ("two", "xy")), (("three", "xy"),)
    shapes = np.array([[0.8, -0.3], [0.4, 1.1]])  # of the hinges, by mode
    rows = np.linalg.inv(shapes)

    def tendon(stiffness, freedoms, row):
        return SimpleNamespace(stiffness=stiffness, freedoms=freedoms, coefficients=row)

    tendons = (
        tendon(0.0, both, rows[0]), tendon(0.03, both, rows[0]), tendon(50.0, other, [1.0]),
        tendon(0.07, both, rows[1]),
    )  # fmt: skip
    rigid, elastic = RNG.standard_normal((9, 6)), RNG.standard_normal((9, 2))
    chain = SimpleNamespace(tendons=tendons, rows=lambda freedoms: (rigid, elastic))
    for k, one in enumerate((tendons[1], tendons[3])):
        wanted = rigid.T @ (elastic[:, 0] * shapes[0, k] + elastic[:, 1] * shapes[1, k])
        np.testing.assert_allclose(participation_of_tendon(chain, one), wanted, atol=1e-12)


def test_an_appendage_carries_what_stands_on_its_port():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="bus"><geom size="1"/><body name="arm_link1">
        <joint name="a"/><geom size="1"/><site name="arm_elbow"/><body name="arm_link2">
        <joint name="b"/><geom size="1"/><site name="arm_end"/>
        <body name="hand_link1"><geom size="1"/></body></body>
        <body name="camera"><geom size="1"/></body></body></body></worldbody></mujoco>"""
    )
    spec = SimpleNamespace(further={"elbow": 1.0, "end": 2.0})
    fit = SimpleNamespace(spec=spec, chain=SimpleNamespace(links=(None, None)))
    arm = SimpleNamespace(at="mount", prefix="arm_", carries={"elbow": ("camera",)}, fit=fit)
    hand = SimpleNamespace(at="mount:end", prefix="hand_")
    found = place_of(model, arm, [arm, hand])
    at = {name: model.body(name).id for name in ("arm_link1", "hand_link1", "camera")}
    assert found.root.body == at["arm_link1"]
    carried = dict(zip(found.root.carried, found.ports, strict=True))
    assert carried == {
        (at["hand_link1"], model.site("arm_end").id): 1,
        (at["camera"], model.site("arm_elbow").id): 0,
    }


def with_tendon(frequency, coefficients, **more):
    """An appendage of two hinges in xy with one mode, and a model that has it beside others."""
    freedoms = ((0, "xy"), (1, "xy"))
    tendon = SimpleNamespace(
        label="mode1_xy",
        stiffness=frequency**2,
        freedoms=freedoms,
        coefficients=coefficients,
        is_mode=True,
    )
    spec = SimpleNamespace(name="arm", further={}, **more)
    fit = SimpleNamespace(chain=SimpleNamespace(tendons=(tendon,)), spec=spec)
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><freejoint/><geom size="1"/><body>
        <joint name="arm_hinge1_xy"/><geom size="1"/><body><joint name="arm_hinge2_xy"/>
        <geom size="1"/></body></body></body></worldbody></mujoco>"""
    )
    made = SimpleNamespace(at="mount", prefix="arm_", rigid=False, spec=spec, fit=fit)
    return model, made, fit


@pytest.mark.parametrize("length", [4.0, 40.0])
def test_the_tip_of_a_beam_moves_with_its_mode(length):
    """A cantilever, whose tip moves by 2 / sqrt(m) in its first mode."""
    beam = beam_of(length).fit.spec.beam
    mass, stiff = 0.04 * 0.02 * 2700.0, 7e10 * 0.02 * 0.04**3 / 12.0
    wave = 1.8751040687 / length
    frequency = wave**2 * np.sqrt(stiff / mass)
    model, made, fit = with_tendon(frequency, [0.3, -0.8], beam=beam, root=bc.spec.Root())
    tip = 2.0 / np.sqrt(length * mass)
    fit.target = {
        "xy": SimpleNamespace(
            modes=1, frequencies=np.array([frequency]), tip=np.array([[tip, 1.3765 * tip / length]])
        )
    }
    fit.body, fit.kept = Body(fit.spec, {}), Kept("clamped", {"xy": 1})
    found = tip_displacement(model, made, "xy")
    assert found == pytest.approx([0.0] * 6 + [0.3 * tip, -0.8 * tip], rel=1e-9)


@pytest.mark.parametrize("rigid", [False, True])
def test_shapes_of_a_beam_are_those_of_four_modes_more_than_twice_the_kept(rigid, monkeypatch):
    asked = []

    def inside(beam, port, count, reduced, stations, further):
        asked.append((beam, port, count, stations, further))

    module = "beamchain.craft.recovered_body"
    monkeypatch.setattr(f"{module}.inside_beam", inside)
    spec = SimpleNamespace(beam="beam", further={"b": 2.0, "a": 1.0})
    chain = SimpleNamespace(tendons=[SimpleNamespace(label="mode1_xy", stiffness=2.0)])
    kept = Kept("clamped", {"xy": 3, "torsion": 1})
    fit = SimpleNamespace(spec=spec, body=None, kept=kept, chain=chain)
    made = SimpleNamespace(fit=fit, rigid=rigid)
    found = beam_body(None, made, "stations")
    assert (found.coordinates, found.ports) == ({}, {})
    counts = dict.fromkeys(COLUMNS, 4) | ({} if rigid else {"xy": 10, "torsion": 6})
    assert sorted(asked) == sorted(
        ("beam", port, count, "stations", (2.0, 1.0)) for port, count in counts.items()
    )


@pytest.mark.parametrize(("before", "after"), [(14, 15), (15, 16), (16, 1), (17, 1)])
def test_beams_at_their_stations_are_kept_for_the_next_call(before, after, monkeypatch):
    """Sixteen; one that is known is not made again."""
    made = []
    replaced = {
        "appendage_at": lambda appendages, _: appendages[0],
        "place_of": lambda *_: SimpleNamespace(root="root"),
        "_rows_of": lambda *_: None,
        "_stations": lambda *_: np.array([0.5]),
        "run_of": lambda *_: "run",
        "_moved_by": lambda _: ("moved", []),
        "motion_of": lambda *_: "motion",
        "beam_body": lambda *_: made.append(1) or SimpleNamespace(coordinates="coordinates"),
        "_modes_in": lambda *_: "modes",
        "_of_beam": lambda *given, **_: given[2],
    }
    for name, other in replaced.items():
        monkeypatch.setattr(f"beamchain.craft.recovery.{name}", other)
    arm = SimpleNamespace(
        at="arm", spec=SimpleNamespace(slosh=None), fit=SimpleNamespace(space=None)
    )
    known = {("arm", bytes([k])): None for k in range(before)}

    def found():
        return recover_inside(
            None, [arm], None, place="arm", x=None, static=True, rows=None, known=known
        )

    first = found()
    assert len(known) == after
    assert found() is first
    assert made == [1]


@pytest.mark.parametrize("part", [-1.1, -0.9, 0.9, 1.1])
def test_modes_that_are_found_again_are_those_of_the_file(part):
    kept, made = np.array([2.0, 40.0]), SimpleNamespace(at="mount")
    found = kept * [1.0, 1.0 + part * SAME]
    if abs(part) < 1.0:
        check_same_modes(made, found, kept)
    else:
        with pytest.raises(bc.InputError, match="not those of its specification any more"):
            check_same_modes(made, found, kept)
    with pytest.raises(bc.InputError, match="not those of its specification any more"):
        check_same_modes(made, kept[:1], kept)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_slow_imported_mode_is_told_by_its_tendon(sign):
    """Of 0.2 rad/s; a second one, of 5 rad/s, is left out: L / w^2 of it is static."""
    model, made, fit = with_tendon(0.2, [0.3, -0.8])
    (soft,) = fit.chain.tendons
    soft.label = "mode1"
    filler = SimpleNamespace(
        label="filler", stiffness=30.0, freedoms=soft.freedoms, coefficients=[0.5, 0.9],
        is_mode=False,
    )  # fmt: skip
    rows = RNG.uniform(0.1, 0.3, (2, 6))
    shapes = np.linalg.inv([soft.coefficients, filler.coefficients])
    # masses of unit rows of which the hinges move as the mode does
    elastic = RNG.standard_normal((6, 2))
    rigid = np.linalg.lstsq((elastic @ shapes[:, :1]).T, sign * rows[:1], rcond=None)[0]
    fit.chain = SimpleNamespace(tendons=(soft, filler), rows=lambda _: (rigid, elastic))
    fit.kept_for = "clamped"
    data = bc.ModalData(
        rigid_mass=np.diag([9.0] * 6), frequencies=np.array([0.2, 5.0]), participation=rows
    )
    fit.space = SimpleNamespace(data=data, numbers=(1,))
    found = imported_body(model, made)
    np.testing.assert_allclose(found.kept, [[sign, 0.0]], atol=1e-12)
    np.testing.assert_allclose(found.static, [np.zeros(6), -rows[1] / 25.0], atol=1e-12)
    assert found.coordinates.frequencies == pytest.approx([0.2])
    np.testing.assert_allclose(found.coordinates.rows, [[0.3, -0.8]])
    assert found.coordinates.dofs.tolist() == [6, 7]


def test_rows_over_imported_modes_are_in_the_units_of_their_file(monkeypatch):
    """mm and t: a coordinate of unit energy is 1e-3 sqrt(1e3) of one in SI. One row follows the
    amplitudes, another, of a point, the accelerations and w x (w x r)."""
    kept, static = RNG.standard_normal((2, 3)), RNG.standard_normal((3, 6))
    frequencies, participation = np.array([2.0, 5.0]), RNG.standard_normal((3, 6))
    in_file = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    amplitudes, accelerations = RNG.standard_normal((2, 4, 2))
    coordinates = SimpleNamespace(
        labels=("mode1", "mode4"),
        frequencies=frequencies,
        amplitudes=lambda _, qpos: amplitudes,
        rates=lambda values: values,
    )
    body = SimpleNamespace(coordinates=coordinates, kept=kept, static=static)
    monkeypatch.setattr("beamchain.craft.recovery.imported_body", lambda *_: body)
    given = bc.spec.RecoveryRows(
        names=("hinge", "eye"),
        modes=[RNG.standard_normal(3), np.zeros(3)],
        accelerations=[np.zeros(3), RNG.standard_normal(3)],
        root=[np.zeros(6), RNG.standard_normal(6)],
        points=[np.zeros(3), [0.4, -1.2, 0.7]],
        units=("N m", "m/s^2"),
    )
    moved = root(4)
    motion = SimpleNamespace(
        roots=(moved,), qpos=amplitudes, qvel=0.0 * amplitudes, qacc=accelerations
    )
    space = SimpleNamespace(
        data=SimpleNamespace(in_file=in_file, participation=participation),
        in_file={"mode1": 2, "mode4": 7}.get,
    )
    imported = SimpleNamespace(units=SimpleNamespace(si=(1e-3, 1e3)))
    fit = SimpleNamespace(spec=SimpleNamespace(imported=imported), space=space, kept_for="clamped")
    made = SimpleNamespace(at="mount", fit=fit)
    run = SimpleNamespace(time=np.arange(4.0))
    found = recovery_of_imported(None, made, run, motion, rows=given, static=True)
    assert found.in_file == (2, 7)
    # one unit of the file's coordinate is so many of those in SI
    size = 1.0 / (1e-3 * np.sqrt(1e3))
    felt = moved.acceleration - np.hstack([moved.gravity, np.zeros((4, 3))])
    hinge = size * (amplitudes @ kept + felt @ static.T) @ np.array(given.modes[0])
    np.testing.assert_allclose(found.rows[:, 0], hinge, rtol=1e-12)
    eye = size * accelerations @ kept @ np.array(given.accelerations[1])
    eye += moved.acceleration @ np.array(given.root[1])
    for t, spin in enumerate(moved.spin):
        eye[t] += given.root[1][:3] @ np.cross(spin, np.cross(spin, given.points[1]))
    np.testing.assert_allclose(found.rows[:, 1], eye, rtol=1e-12)
    histories = found.histories
    follows = {name: (histories[name].follows, histories[name].rest) for name in given.names}
    assert follows == {
        "hinge": ("amplitudes", "modes left out"),
        "eye": ("accelerations", "motion of the root"),
    }
    np.testing.assert_allclose(histories["eye"].values[:, 0, 0], eye)
    wanted = size * kept @ np.array(given.modes[0])
    np.testing.assert_allclose(histories["hinge"].factors, wanted[None, None])
    wanted = (kept @ in_file.T @ participation).T * frequencies**2
    np.testing.assert_allclose(histories["root force"].factors, wanted[None, :3])
    np.testing.assert_allclose(histories["root moment"].factors, wanted[None, 3:])
    less = recovery_of_imported(None, made, run, motion, rows=given, static=False).rows[:, 0]
    np.testing.assert_allclose(less, size * amplitudes @ kept @ np.array(given.modes[0]))


def test_combined_tendons_of_loads_are_turned_into_their_modes(monkeypatch):
    """Two ports that bend: behind one mode stand two tendons, by whose motion of the ports they are
    combinations of the attachment modes."""
    coefficients, tip = RNG.standard_normal((3, 3)), RNG.standard_normal((3, 8))
    turn = np.linalg.qr(RNG.standard_normal((2, 2)))[0]
    moved = RNG.standard_normal((4, 3))  # of the tendons' own coordinates
    moved[:, 1:] = tip[1:, [2, 3, 6, 7]].T @ turn
    rows = dict(zip((1.5, 2.5), np.split(moved @ coefficients, 2), strict=True))
    monkeypatch.setattr(
        "beamchain.craft.recovered_body.port_rows", lambda _chain, _freedoms, _motion, x: rows[x]
    )
    monkeypatch.setattr("beamchain.craft.recovered_body.further_columns", lambda _: [1, 3])
    tendons = [
        SimpleNamespace(stiffness=4.0, label=f"mode{k}_xy", coefficients=row)
        for k, row in enumerate(coefficients)
    ]
    wrong = SimpleNamespace(stiffness=4.0, label="mode1_xz", coefficients=np.ones(3))
    limp = SimpleNamespace(stiffness=0.0, label="mode4_xy", coefficients=np.ones(3))
    chain = SimpleNamespace(tendons=[limp, *tendons, wrong], freedoms=lambda _: [])
    target = {"xy": SimpleNamespace(modes=3, tip=tip, motions=2)}
    spec = SimpleNamespace(further={"mid": 1.5, "end": 2.5})
    made = SimpleNamespace(fit=SimpleNamespace(target=target, spec=spec))
    np.testing.assert_allclose(attachment_turn(made, chain, "xy", 1), turn, atol=1e-12)
