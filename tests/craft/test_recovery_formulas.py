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
    History,
    Inside,
    Kept,
    OutputMatrices,
    RecoveredBody,
    Recovery,
    RootMotion,
    Shapes,
    appendage_at,
    check_same_modes,
    crossed,
    delivered_outputs,
    drives_of_modes,
    histories_of_values,
    participation_of_tendon,
    recovered_beam,
    recovered_delivery,
    rigid_load,
    root_of,
    run_of_data,
    section_outputs,
    sections_at,
    stations_of,
    tip_displacement,
    turn_into_modes,
    values_of_outputs,
    wrenches_on_points,
)

RNG = np.random.default_rng(9)


def root(count=2, carried=0):
    one = RNG.standard_normal((count, 6))
    return RootMotion(
        one, *(RNG.standard_normal((count, 3)) for _ in range(2)), np.zeros((count, 6)),
        RNG.standard_normal((count, carried, 6)),
    )  # fmt: skip


def drives(moved, carried=None):
    """`(t, 15 + 6 c)`: acceleration against free fall, products of the spin, wrenches on points."""
    felt = moved.acceleration - np.hstack([moved.gravity, np.zeros((len(moved.gravity), 3))])
    products = [np.outer(spin, spin).ravel() for spin in moved.spin]
    wrenches = np.zeros((len(felt), 0)) if carried is None else carried.reshape(len(felt), -1)
    return np.hstack([felt, products, wrenches])


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
    found = np.einsum("sid,td->tsi", rigid_load(beam, stations, ()), drives(moved))
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
    per_drive = rigid_load(beam_of(4.0).fit.spec.beam, stations, places)[:, :, 15:]
    found = np.einsum("sid,td->tsi", per_drive, carried.reshape(2, 12))
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
    found = wrenches_on_points(moved, ["b", "a", "b"], ["a", "b", "c"])
    np.testing.assert_allclose(found[:, 0], moved.carried[:, 1])
    np.testing.assert_allclose(found[:, 1], moved.carried[:, 0] + moved.carried[:, 2])
    assert np.all(found[:, 2] == 0.0)


COLUMNS = {"xy": [1, 5], "xz": [2, 4], "torsion": [3], "axial": [0]}


@pytest.mark.parametrize("port", ["xy", "xz", "torsion", "axial"])
def test_what_drives_a_mode_is_what_moves_its_masses(port):
    """Of point masses on the axis: -m u (a + turn x r + w x (w x r)) of each, and what pulls at
    points that move with the mode. Where they turn, w x (w x r) acts along the axis alone."""
    columns, n = COLUMNS[port], 3
    x, mass = np.array([0.7, 1.9, 3.2]), np.array([2.0, 0.5, 1.1])
    moved_by_mode = RNG.standard_normal((n, 3))  # of each mass, in or about the port's own axis
    along_port = np.array([1.0, -1.0]) if port == "xz" else np.ones(len(columns))
    tip = RNG.standard_normal((n, 3 * len(columns)))
    participation = np.column_stack(
        [moved_by_mode @ mass, *([moved_by_mode @ (mass * x)] if len(columns) == 2 else [])]
    )
    shapes = Shapes(
        x, np.sqrt(mass), np.zeros(3), moved_by_mode * np.sqrt(mass), bending=len(columns) == 2
    )
    mass_at_root = 99.0 * np.eye(len(columns))
    model = bc.PortModel(
        mass_at_root, np.arange(1.0, n + 1), participation, tip=tip, shapes=shapes, points=(9, 5, 4)
    )
    # a model may turn a mode about
    signs = np.sign(np.sum(model.participation * participation, axis=1))
    moved, carried = root(), RNG.standard_normal((2, 2, 6))
    found = drives(moved, carried) @ drives_of_modes(model, port, [4, 5]).T * signs
    for t in range(2):
        felt, turn, w = moved.acceleration[t, :3], moved.acceleration[t, 3:], moved.spin[t]
        felt = felt - moved.gravity[t]
        wanted = np.zeros(n)
        for i in range(3):
            r = np.array([x[i], 0.0, 0.0])
            point = np.append(felt + np.cross(turn, r) + np.cross(w, np.cross(w, r)), turn)
            wanted -= mass[i] * moved_by_mode[:, i] * point[columns[0]]
        for k, point in enumerate((2, 1)):
            own = tip.reshape(n, 3, len(columns))[:, point] * along_port
            wanted += own @ carried[t, k, columns]
        np.testing.assert_allclose(found[t], wanted, atol=1e-12)


def outputs_of(s, k, n, d, **more):
    """Random output matrices."""
    return OutputMatrices(
        **{
            "quantities": (),
            "frequencies": RNG.uniform(1.0, 9.0, n),
            "drives": RNG.standard_normal((n, d)),
            "modes": RNG.standard_normal((s, k, n)),
            "accelerations": RNG.standard_normal((s, k, n)),
            "root": RNG.standard_normal((s, k, 6)),
            "spin": RNG.standard_normal((s, k, 3, 3 + n)),
            "static": RNG.standard_normal((s, k, d)),
            **more,
        }
    )


def run_in_modes(moved, n, **more):
    """A run in coordinates of n modes."""
    arrays = {name: RNG.standard_normal((len(moved.spin), n)) for name in ("qpos", "qvel", "qacc")}
    return SimpleNamespace(**{**arrays, "roots": (moved,), **more})


@pytest.mark.parametrize("static", [True, False])
def test_values_are_sums_over_the_motion(static):
    """Row by row; of the modes left out the whole less each kept mode, `eta = D d / W^2`."""
    moved, carried = root(), RNG.standard_normal((2, 1, 6))
    given = outputs_of(2, 3, 4, 21)
    modal = run_in_modes(moved, 4)
    found = values_of_outputs(given, modal, carried, static=static)
    driven = drives(moved, carried)
    for t in range(2):
        others = np.append(moved.spin[t], modal.qvel[t])
        yielded = given.drives @ driven[t] / given.frequencies**2
        for s in range(2):
            for k in range(3):
                wanted = given.modes[s, k] @ modal.qpos[t]
                wanted += given.accelerations[s, k] @ modal.qacc[t]
                wanted += given.root[s, k] @ moved.acceleration[t]
                wanted += sum(moved.spin[t, j] * given.spin[s, k, j] @ others for j in range(3))
                if static:
                    wanted += given.static[s, k] @ driven[t] - given.modes[s, k] @ yielded
                assert found[t, s, k] == pytest.approx(wanted, rel=1e-12)


def test_both_halves_are_crossed():
    motion, w, v = RNG.standard_normal((2, 6, 4)), RNG.standard_normal(3), RNG.standard_normal(4)
    found = np.einsum("sijm,j,m->si", crossed(motion), w, v)
    for s in range(2):
        linear, about = np.split(motion[s] @ v, 2)
        wanted = [*np.cross(w, linear), *np.cross(w, about)]
        np.testing.assert_allclose(found[s], wanted, atol=1e-14)


def inside_of(frequencies, stations, points=0):
    """Random modes of a port at stations."""
    n, d = len(frequencies), 15 + 6 * points
    return Inside(
        np.array(frequencies),
        RNG.standard_normal((n, d)),
        *RNG.standard_normal((2, stations, 6, n)),
        RNG.standard_normal((stations, 6, d)),
    )


def test_sections_accelerate_as_points_of_a_turning_frame():
    moved, stations = root(), np.array([0.5, 2.0])
    ports = [inside_of([2.0, 3.0], 2), inside_of([7.0], 2)]
    given = section_outputs(beam_of(4.0).fit.spec.beam, ports, stations, ())
    modal = run_in_modes(moved, 3)
    found = values_of_outputs(given, modal, np.zeros((2, 0, 6)), static=True)[:, :, 12:]
    factors = np.concatenate([inside.motion for inside in ports], axis=2)
    for t in range(2):
        w, turn = moved.spin[t], moved.acceleration[t, 3:]
        for s, x in enumerate(stations):
            place = np.array([x, 0.0, 0.0])
            speed, bend = np.split(factors[s] @ modal.qvel[t], 2)
            along, about = np.split(factors[s] @ modal.qacc[t], 2)
            linear = moved.acceleration[t, :3] + np.cross(turn, place)
            linear += np.cross(w, np.cross(w, place)) + 2.0 * np.cross(w, speed) + along
            np.testing.assert_allclose(found[t, s, :3], linear, atol=1e-12)
            np.testing.assert_allclose(
                found[t, s, 3:], turn + np.cross(w, bend) + about, atol=1e-12
            )


# -- modal coordinates -----------------------------------------------------------------------------
def test_amplitudes_follow_from_the_force_of_the_tendons():
    """W^2 eta = T K b q, with the stiffness that the model has for those of its tendons."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><freejoint/><geom size="1"/><body>
        <joint name="arm_hinge1_xy"/><geom size="1"/><body><joint name="arm_hinge2_xy"/>
        <geom size="1"/></body></body></body></worldbody>
        <tendon><fixed name="arm_mode2_xy" stiffness="35">
        <joint joint="arm_hinge1_xy" coef="1"/></fixed></tendon></mujoco>"""
    )
    rows, turn = RNG.standard_normal((2, 2)), RNG.standard_normal((2, 2))
    w = np.array([3.0, 5.5])
    freedoms = ((0, "xy"), (1, "xy"))
    tendons = tuple(
        SimpleNamespace(label=f"mode{k + 1}_xy", stiffness=k_, freedoms=of, coefficients=row)
        for k, (k_, of, row) in enumerate(
            ((9.5, freedoms, rows[0]), (31.0, freedoms[::-1], rows[1, ::-1]))
        )
    )
    body = RecoveredBody(tendons, turn, SimpleNamespace(frequencies=w))
    arm = SimpleNamespace(prefix="arm_", spec=SimpleNamespace(name="boom"))
    coordinates = body.coordinates(model, arm)
    qpos, qvel, qacc = (RNG.standard_normal((3, size)) for size in (9, 8, 8))
    motion = SimpleNamespace(qpos=qpos, qvel=qvel, qacc=qacc, roots="roots")
    found = coordinates.along(motion)
    for t in range(3):
        force = np.array([9.5, 35.0]) * (rows @ qpos[t, 7:])
        assert found.qpos[t] == pytest.approx(turn @ force / w**2)
        assert found.qvel[t] == pytest.approx(turn @ rows @ qvel[t, 6:])
        assert found.qacc[t] == pytest.approx(turn @ rows @ qacc[t, 6:])
    assert found.roots == "roots"


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
        assert row.largest_from == "rest"


# -- histories -------------------------------------------------------------------------------------
def test_loads_and_motions_of_the_modes_of_a_beam_by_force_and_moment():
    """`P W^2` and `u` of each mode, at two stations, of a root that stands still; on the root
    `L W^2`."""
    stations = np.array([0.5, 2.0])
    ports = [inside_of([3.0], 2), inside_of([7.0], 2)]
    given = section_outputs(beam_of(4.0).fit.spec.beam, ports, stations, ())
    still, none = np.zeros((3, 6)), np.zeros((3, 3))
    moved = RootMotion(still, none, none, RNG.standard_normal((3, 6)), np.zeros((3, 0, 6)))
    modal = run_in_modes(moved, 2, qvel=np.zeros((3, 2)))
    values = values_of_outputs(given, modal, np.zeros((3, 0, 6)), static=False)
    found = histories_of_values(given, values, moved.load, stations)
    loads = np.concatenate([9.0 * ports[0].momentum, 49.0 * ports[1].momentum], axis=2)
    motions = np.concatenate([inside.motion for inside in ports], axis=2)
    wanted = {
        "force": (loads[:, :3], modal.qpos), "moment": (loads[:, 3:], modal.qpos),
        "displacement": (motions[:, :3], modal.qpos), "rotation": (motions[:, 3:], modal.qpos),
        "acceleration": (motions[:, :3], modal.qacc),
        "angular acceleration": (motions[:, 3:], modal.qacc),
    }  # fmt: skip
    for name, (factors, by) in wanted.items():
        one = found[name]
        np.testing.assert_allclose(one.factors, factors, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(one.values, np.einsum("sin,tn->tsi", factors, by), atol=1e-12)
        assert one.x is stations
    on_root = -np.array([9.0, 49.0]) * np.vstack([inside.drives[0, :6] for inside in ports]).T
    for name, part in (("root force", slice(3)), ("root moment", slice(3, 6))):
        np.testing.assert_allclose(found[name].factors, on_root[None, part], atol=1e-12)
        np.testing.assert_array_equal(found[name].values[:, 0], moved.load[:, part])
        assert found[name].x.size == 0
    assert list(found) == ["root force", "root moment", *wanted]
    assert {len(one.units) for one in found.values()} == {3}
    follows = {name: (one.follows, one.rest) for name, one in found.items()}
    assert follows["moment"] == follows["displacement"] == ("amplitudes", "modes left out")
    assert follows["acceleration"] == ("accelerations", "motion of the root")
    assert follows["root force"] == ("amplitudes", "rigid motion and modes left out")


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
    found = root_of(model, arm, [arm, hand])
    at = {name: model.body(name).id for name in ("arm_link1", "hand_link1", "camera")}
    assert found.body == at["arm_link1"]
    assert set(found.carried) == {
        (at["hand_link1"], model.site("arm_end").id),
        (at["camera"], model.site("arm_elbow").id),
    }


class Same(SimpleNamespace):
    """Equal to itself alone."""

    __hash__ = object.__hash__
    __eq__ = object.__eq__


def with_tendon(frequency, coefficients, **more):
    """An appendage of two hinges in xy with one mode, and a model that has it beside others."""
    freedoms = ((0, "xy"), (1, "xy"))
    tendon = SimpleNamespace(
        label="mode1_xy",
        stiffness=frequency**2,
        freedoms=freedoms,
        coefficients=np.array(coefficients),
        is_mode=True,
    )
    spec = SimpleNamespace(name="arm", further={}, **more)
    fit = SimpleNamespace(chain=SimpleNamespace(tendons=(tendon,)), spec=spec)
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><freejoint/><geom size="1"/><body>
        <joint name="arm_hinge1_xy"/><geom size="1"/><body><joint name="arm_hinge2_xy"/>
        <geom size="1"/></body></body></body></worldbody></mujoco>"""
    )
    made = Same(at="mount", prefix="arm_", rigid=False, spec=spec, fit=fit)
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
    fit.kept, fit.body = Kept("clamped", {"xy": 1}), Body(fit.spec, {})
    found = tip_displacement(model, made, "xy")
    assert found == pytest.approx([0.0] * 6 + [0.3 * tip, -0.8 * tip], rel=1e-9)


@pytest.mark.parametrize("rigid", [False, True])
def test_shapes_of_a_beam_are_those_of_four_modes_more_than_twice_the_kept(rigid, monkeypatch):
    """Known for the next call at the same stations."""
    asked = []

    def inside(beam, port, count, reduced, stations, further):
        asked.append((beam, port, count, stations.tolist(), further))
        return port

    def outputs(beam, ports, stations, further):
        assert (beam, ports) == ("beam", list(COLUMNS))
        return SimpleNamespace(frequencies=np.zeros(0) if rigid else np.array([1.0, 2.0, 3.0, 9.0]))

    module = "beamchain.craft.recovered_body"
    monkeypatch.setattr(f"{module}.inside_beam", inside)
    monkeypatch.setattr(f"{module}.section_outputs", outputs)
    spec = SimpleNamespace(beam="beam", further={"b": 2.0, "a": 1.0})
    labels = ["mode1_torsion", "mode3_xy", "mode2_xy", "mode1_xy", "mode4_xy"]
    chain = SimpleNamespace(tendons=[SimpleNamespace(label=w, stiffness=2.0) for w in labels])
    target = {
        port: SimpleNamespace(modes=len(w), frequencies=np.array(w))
        for port, w in (("torsion", [9.0]), ("xy", [1.0, 2.0, 3.0]))
    }
    kept = Kept("clamped", {"torsion": 1, "xy": 3})
    fit = SimpleNamespace(spec=spec, body=None, kept=kept, chain=chain, target=target)
    made = Same(fit=fit, rigid=rigid)
    found = recovered_beam(made, (0.5, 2.0))
    kept = [] if rigid else ["mode1_xy", "mode2_xy", "mode3_xy", "mode1_torsion"]
    assert [tendon.label for tendon in found.tendons] == kept
    np.testing.assert_array_equal(found.turn, np.eye(len(kept)))
    counts = dict.fromkeys(COLUMNS, 4) | ({} if rigid else {"xy": 10, "torsion": 6})
    assert sorted(asked) == sorted(
        ("beam", port, count, [0.5, 2.0], (2.0, 1.0)) for port, count in counts.items()
    )
    assert recovered_beam(made, (0.5, 2.0)) is found
    assert recovered_beam(made, (0.5,)) is not found
    assert len(asked) == 8


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
    fit.space = SimpleNamespace(data=data, numbers=(1,), in_file={"mode1": 1}.get)
    fit.spec.imported = SimpleNamespace(units=SimpleNamespace(si=(1.0, 1.0)))
    each = bc.spec.RecoveryRows(names=("first", "second"), modes=np.eye(2))
    found = recovered_delivery(made, each)
    np.testing.assert_allclose(found.outputs.modes, [[[sign], [0.0]]], atol=1e-12)
    np.testing.assert_allclose(found.outputs.drives[:, :6], -sign * rows[:1], atol=1e-12)
    still = np.zeros((2, 15))
    still[1, :6] = -rows[1] / 25.0
    np.testing.assert_allclose(found.outputs.left_out, [still], atol=1e-12)
    assert found.outputs.frequencies == pytest.approx([0.2])
    rates = found.coordinates(model, made).rates
    np.testing.assert_allclose(rates, [[0.0] * 6 + [0.3, -0.8]])


def test_rows_over_imported_modes_are_in_the_units_of_their_file():
    """mm and t: a coordinate of unit energy is 1e-3 sqrt(1e3) of one in SI. One row follows the
    amplitudes, another, of a point, the accelerations and w x (w x r). The kept modes are
    combinations of three, which the file has over freedoms that mix them."""
    kept, participation = RNG.standard_normal((2, 3)), RNG.standard_normal((3, 6))
    every = np.array([2.0, 5.0, 11.0])
    in_file = RNG.standard_normal((3, 3))
    given = bc.spec.RecoveryRows(
        names=("hinge", "eye"),
        modes=[RNG.standard_normal(3), np.zeros(3)],
        accelerations=[np.zeros(3), RNG.standard_normal(3)],
        root=[np.zeros(6), RNG.standard_normal(6)],
        points=[np.zeros(3), [0.4, -1.2, 0.7]],
        units=("N m", "m/s^2"),
    )
    data = SimpleNamespace(in_file=in_file, participation=participation, frequencies=every)
    frequencies = np.array([2.0, 7.0])
    moved = root(4)
    modal = run_in_modes(moved, 2)
    outputs = delivered_outputs(data, kept, frequencies, given, (1e-3, 1e3))
    values = values_of_outputs(outputs, modal, np.zeros((4, 0, 6)), static=True)
    # one unit of the file's coordinate is so many of those in SI
    size = 1.0 / (1e-3 * np.sqrt(1e3))
    felt = moved.acceleration - np.hstack([moved.gravity, np.zeros((4, 3))])
    moment = size * in_file @ np.array(given.modes[0])  # of each of the three modes
    # W^2 eta = -L a, of all less of the kept
    hinge = modal.qpos @ kept @ moment - felt @ (participation.T / every**2) @ moment
    hinge += felt @ ((kept @ participation).T / frequencies**2) @ kept @ moment
    np.testing.assert_allclose(values[:, 0, 0], hinge, rtol=1e-11)
    eye = size * modal.qacc @ kept @ in_file @ np.array(given.accelerations[1])
    eye += moved.acceleration @ np.array(given.root[1])
    for t, spin in enumerate(moved.spin):
        eye[t] += given.root[1][:3] @ np.cross(spin, np.cross(spin, given.points[1]))
    np.testing.assert_allclose(values[:, 0, 1], eye, rtol=1e-12)
    histories = histories_of_values(outputs, values, moved.load, np.zeros(0))
    follows = {name: (histories[name].follows, histories[name].rest) for name in given.names}
    assert follows == {
        "hinge": ("amplitudes", "modes left out"),
        "eye": ("accelerations", "motion of the root"),
    }
    assert [histories[name].units for name in given.names] == [("N m",), ("m/s^2",)]
    np.testing.assert_allclose(histories["eye"].values[:, 0, 0], eye)
    np.testing.assert_allclose(histories["hinge"].factors, (kept @ moment)[None, None])
    wanted = (kept @ participation).T * frequencies**2
    np.testing.assert_allclose(histories["root force"].factors, wanted[None, :3])
    np.testing.assert_allclose(histories["root moment"].factors, wanted[None, 3:])
    less = values_of_outputs(outputs, modal, np.zeros((4, 0, 6)), static=False)[:, 0]
    np.testing.assert_allclose(less[:, 0], modal.qpos @ kept @ moment)
    np.testing.assert_allclose(less[:, 1], eye)


def test_without_rows_a_delivery_is_known_at_its_root():
    data = bc.ModalData(
        rigid_mass=np.diag([9.0] * 6),
        frequencies=np.array([2.0, 5.0]),
        participation=RNG.uniform(0.1, 0.3, (2, 6)),
    )
    outputs = delivered_outputs(data, np.eye(2)[:1], np.array([2.0]), None, (1.0, 1.0))
    moved = root(4)
    values = values_of_outputs(outputs, run_in_modes(moved, 1), np.zeros((4, 0, 6)), static=True)
    found = histories_of_values(outputs, values, moved.load, np.zeros(0))
    assert list(found) == ["root force", "root moment"]
    wanted = 4.0 * data.participation[0]
    np.testing.assert_allclose(found["root force"].factors, wanted[None, :3, None])


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
    tendons = [
        SimpleNamespace(stiffness=4.0, label=f"mode{k}_xy", coefficients=row)
        for k, row in enumerate(coefficients)
    ]
    wrong = SimpleNamespace(stiffness=4.0, label="mode1_xz", coefficients=np.ones(3))
    limp = SimpleNamespace(stiffness=0.0, label="mode4_xy", coefficients=np.ones(3))
    chain = SimpleNamespace(tendons=[limp, *tendons, wrong], freedoms=lambda _: [])
    places = (9.0, 1.5, 2.0, 2.5)
    whole = bc.PortModel(np.eye(2), np.arange(1.0, 4.0), np.zeros((3, 2)), tip=tip, points=places)
    target = {"xy": whole}
    spec = SimpleNamespace(further={"mid": 1.5, "end": 2.5})
    made = SimpleNamespace(target=target, spec=spec)
    found = turn_into_modes(made, chain, "xy", 1)
    np.testing.assert_allclose(found[1:, 1:], turn, atol=1e-12)
    assert found[0].tolist() == found[:, 0].tolist() == [1.0, 0.0, 0.0]
    np.testing.assert_array_equal(turn_into_modes(made, chain, "xy", 3), np.eye(3))
