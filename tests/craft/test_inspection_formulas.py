"""Closed forms beside what is said of any model: its modes and what moves in them, its step, films
of it, and where its appendages stand."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.craft.mode_names import strain_holders, strain_shares
from beamchain.craft.source import linear_omissions
from beamchain.steps.retime import retime
from formulas import (
    AppendageRequest,
    far_mount,
    fit_all,
    holders_of_shape,
    inspect_model,
    internal_stiffness,
    mount,
    moving_modes,
    names_of_models,
    points_inward,
    reach,
    spans_of_motion,
    strain_words,
    turn,
)
from specs import spec_of

# -- inspections -----------------------------------------------------------------------------------
MODEL = """<mujoco model="three"><option timestep="0.05" integrator="Euler" gravity="0 0 0"/>
<worldbody>
<body><joint name="left" type="slide" stiffness="16" damping="1.6"/>
<inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/></body>
<body pos="9 0 0"><joint type="slide" axis="0 1 0"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
<body><joint name="turns" stiffness="45" damping="{damper}"/>
<inertial pos="0 0 0" mass="3" diaginertia="3 3 5"/></body></body>
<body pos="0 9 0"><joint name="pulled"/><inertial pos="0 0 0" mass="1" diaginertia="2 2 3"/></body>
<body pos="0 0 9"><inertial pos="0 0 0" mass="7" diaginertia="1 1 1"/></body></worldbody>
<tendon><fixed name="rope" stiffness="12" damping="0.6" armature="0.5"><joint joint="pulled"
coef="2"/></fixed></tendon></mujoco>"""


@pytest.mark.parametrize("damper", [0.3, 40.0])
def test_inspection_of_a_model(damper):
    """2 rad/s at 0.1; 3 rad/s of k = 45 and I = 5, which 40 N m s overdamp; and a rope of
    k = 12 x 4 on I = 3 + 0.5 x 4, of 0.6 x 4 / 2 / 5 / w."""
    found = inspect_model(MODEL.format(damper=damper))
    w = np.sqrt(48.0 / 5.0)
    wanted = {2.0: 0.1, w: 2.4 / (2.0 * 5.0 * w)}
    if damper < 30.0:
        wanted[3.0] = damper / (2.0 * 5.0 * 3.0)
    order = sorted(wanted)
    assert found.frequencies == pytest.approx(order)
    assert found.damping == pytest.approx([wanted[key] for key in order])
    assert found.has_overdamped == (damper > 30.0)
    holders = {2.0: "left", w: "pulled", 3.0: "turns"}
    for key, shares in zip(order, found.moving, strict=True):
        assert shares.pop((holders[key], "spring")) == pytest.approx(1.0)
        assert sum(shares.values()) == pytest.approx(0.0, abs=1e-12)
    assert found.springs == [("left", 16.0, 1.6), ("turns", 45.0, damper)]
    assert found.tendons == [("rope", 12.0, 0.6, 0.5)]
    assert (found.name, found.bodies, found.joints, found.dofs) == ("three", 5, 4, 4)
    assert found.mass == pytest.approx(17.0)
    assert [each.mass for each in found.composite] == pytest.approx([4.0, 5.0, 1.0])
    assert (found.integrator, found.timestep) == ("Euler", 0.05)
    assert found.shown == found.made_for == []


def test_a_mode_that_a_damper_moves_keeps_the_name_of_what_bends():
    """A damper of 1e4 N m s locks the drive of the arm: 4 rad/s held where it was 5 free, beside
    a wing of 4.9 rad/s."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint damping="1e4" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="1" diaginertia="9 9 9"/><body>
        <joint name="arm_hinge1_xz" axis="0 0 1" stiffness="256"/>
        <inertial pos="0 0 0" mass="2" diaginertia="16 16 16"/></body></body>
        <body><joint name="wing_hinge1_xy" axis="0 0 1" stiffness="96.04"/>
        <inertial pos="0 0 0" mass="2" diaginertia="4 4 4"/></body></worldbody></mujoco>"""
    )
    found = inspect_model(model)
    assert found.frequencies == pytest.approx([4.0, 4.9], rel=1e-4)
    assert [max(shares, key=shares.get) for shares in found.moving] == [
        ("arm", "xz"),
        ("wing", "xy"),
    ]


def test_modes_of_a_timed_file_are_those_of_the_structure():
    """16 N m/rad between 8 and 4 kg m^2; timing adds inertia at the tendon."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.3" gravity="0 0 0"/><worldbody><body><freejoint/>
        <inertial pos="0 0 0" mass="5" diaginertia="7 7 8"/><body><joint name="arm_hinge1_xy"/>
        <inertial pos="0 0 0" mass="2" diaginertia="3 3 4"/></body></body></worldbody><tendon>
        <fixed name="arm_mode1_xy" stiffness="4"><joint joint="arm_hinge1_xy" coef="2"/>
        </fixed></tendon></mujoco>"""
    )
    retime(model, 0.3, "Euler")
    assert model.tendon_armature[0] > 0.01
    found = inspect_model(model)
    assert found.frequencies == pytest.approx([np.sqrt(6.0)], rel=1e-9)
    assert found.moving == [{("arm", "xy"): pytest.approx(1.0)}]
    assert len(found.made_for) == len(found.shown) == 1


def test_shares_of_rows_in_the_energy_of_modes():
    rows = np.array([[1.0, 2.0], [0.0, 3.0], [0.5, 0.0]])
    shapes = np.array([[2.0, 0.0], [0.5, 0.0]])
    found = strain_shares(rows, shapes)
    # 3, 1.5 and 1; of a mode that strains nothing none
    assert found[:, 0] == pytest.approx(np.array([9.0, 2.25, 1.0]) / 12.25)
    assert found[:, 1].tolist() == [0.0, 0.0, 0.0]


def test_words_for_shares_of_the_strain_energy():
    """Modes of a port together, from a tenth on, the largest first."""
    names = ["a_mode1_xy", "b_mode1_xz", "a_filler2_xy", "drive", "c_mode1_torsion", "d_mode1_xy"]
    share = np.array([0.2, 0.34, 0.17, 0.1, 0.05, 0.14])
    parts = strain_holders(names, share)
    assert parts["a", "xy"] == pytest.approx(0.37)
    assert strain_words(parts) == "a 37 % and d 14 %, bending xy; b 34 %, bending xz"
    parts["drive", "spring"] = 0.12
    assert strain_words(parts).endswith("b 34 %, bending xz; drive 12 %, spring")


@pytest.mark.parametrize(("step", "stable"), [(0.99, True), (1.01, False)])
def test_whether_a_file_is_stable_at_its_own_step(tmp_path, step, stable):
    """Undamped Euler up to 2 / w = 1 s."""
    path = tmp_path / "rod.xml"
    path.write_text(
        f'<mujoco model="rod"><option timestep="{step}"/><worldbody><body><joint type="slide" '
        'stiffness="16"/><inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/></body></worldbody>'
        "</mujoco>"
    )
    found = bc.stability(path)
    words = f"with Euler at {step:g} s"
    if stable:
        assert found.own_step == f"rod: stable as it is, {words}; Euler is stable up to 1 s."
        assert found.warnings == []
    else:
        assert found.own_step == f"rod: unstable as it is, {words}; take a step below 1 s."
        assert [each.code for each in found.warnings] == ["unstable-step"]
        assert f"{step:g} s, is beyond Euler's limit of 1 s" in str(found.warnings[0])


# -- what holds a mode -----------------------------------------------------------------------------
HELD = """<mujoco><worldbody><body><joint name="a" stiffness="5"/><geom size="1"/>
<body><joint name="b"/><geom size="1"/></body></body></worldbody>
<tendon><fixed stiffness="12"><joint joint="b" coef="2"/></fixed></tendon></mujoco>"""


@pytest.mark.parametrize(
    ("servo", "words"),
    [(0.0, "springs"), (1.4, "springs"), (1.6, "springs and servos"), (900.0, "servos")],
)
def test_springs_of_joints_and_tendons_or_servos_hold_a_shape(servo, words):
    """5 x 2^2 + 12 x (2 x 0.9)^2 = 58.88 in springs; a tenth of the larger is named."""
    pose = SimpleNamespace(
        bare_model=mujoco.MjModel.from_xml_string(HELD),
        bare=SimpleNamespace(stiffness=np.diag([5.0 + servo, 48.0])),
    )
    assert holders_of_shape(pose, np.array([2.0, 0.9])) == words


def test_motions_of_little_energy_are_still():
    """Two modes of one cluster span what is above a ten-thousandth of their kinetic energy."""
    motion = np.zeros((4, 3))
    motion[0, 0], motion[1, 1], motion[2, 2] = 0.0101, 0.0099, 0.5
    found = spans_of_motion(motion, np.array([0, 0, 1]))
    assert [span.shape for span in found] == [(4, 1), (4, 1)]
    assert np.abs(found[0][:, 0]) == pytest.approx([1.0, 0.0, 0.0, 0.0])
    assert np.abs(found[1][:, 0]) == pytest.approx([0.0, 0.0, 1.0, 0.0])


# -- films -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(("extent", "times"), [(1.0, 1.0), (1.0, 3.0), (100.0, 1.0)])
def test_a_film_shows_one_oscillation(extent, times):
    """A twentieth of the size, or a turn of 0.4 rad where that is less, times what is asked for."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><statistic extent="{extent}"/><worldbody><body name="bus"><freejoint/>
        <geom size="0.3" mass="9"/><body name="rod" pos="0.3 0 0"><joint axis="0 0 1"
        stiffness="8"/><geom type="capsule" fromto="0 0 0 2 0 0" size="0.05" mass="1"/></body>
        </body></worldbody></mujoco>"""
    )
    (found,) = moving_modes(model, 1, 8, times)
    assert found.positions.shape == (8, 8)
    quarter = found.positions[2]
    shape = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, shape, 1.0, found.rest, quarter)
    moves, turns = reach(model, found.rest, shape), turn(model, found.rest, shape)
    assert min(moves / (0.05 * extent), turns / 0.4) <= times * (1.0 + 1e-9)
    at_limit = max(moves / (0.05 * extent), turns / 0.4)
    assert at_limit == pytest.approx(times, rel=1e-2)
    assert found.swing == pytest.approx(moves, rel=1e-2)
    for k in range(8):
        here = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, here, 1.0, found.rest, found.positions[k])
        np.testing.assert_allclose(here, np.sin(np.pi * k / 4.0) * shape, atol=1e-9)
    with pytest.raises(bc.InputError, match="has 1 coupled modes"):
        moving_modes(model, 2, 8)


# -- where appendages stand ------------------------------------------------------------------------
TREES = """<mujoco><worldbody><body name="bus"><freejoint/>
<inertial pos="2 0.5 0" mass="3" diaginertia="1 1 1"/>
<body name="part" pos="0 1 0"><inertial pos="4 -1.5 0" mass="1" diaginertia="1 1 1"/></body>
<body name="load" pos="0 9 9"><inertial pos="0 0 0" mass="50" diaginertia="1 1 1"/></body></body>
<body name="other" pos="-9 0 0"><freejoint/>
<inertial pos="0 0 0" mass="70" diaginertia="1 1 1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("origin", "length", "inward"),
    [
        ((0.0, 0.25, 0.0), 2.51, True),  # the centre of the two that count is (2.5, 0.25, 0)
        ((0.0, 0.25, 0.0), 2.49, False),
        ((3.0, 0.25, 0.0), 9.0, False),  # it runs away from it
        ((2.494, 0.25, 0.0), 5.0, True),  # more than a thousandth of its length
        ((2.496, 0.25, 0.0), 5.0, False),
        ((0.5, 0.25, 0.99), 5.0, True),  # passes closer than half of what is ahead
        ((0.5, 0.25, 1.01), 5.0, False),
        ((0.5, 1.24, 0.0), 5.0, True),
        ((0.5, 1.26, 0.0), 5.0, False),
    ],
)
def test_an_appendage_through_the_centre_of_mass_points_inward(origin, length, inward):
    model = mujoco.MjModel.from_xml_string(TREES)
    place = SimpleNamespace(body=1, origin=np.array(origin), axes=np.eye(3))
    body = SimpleNamespace(spec=SimpleNamespace(is_beam=True, imported=None), length=length)
    loads = {"mount": (SimpleNamespace(bodies=(3,)),)}
    assert points_inward(model, place, body, loads) is inward
    on_load = SimpleNamespace(body=3, origin=np.array(origin), axes=np.eye(3))
    assert not points_inward(model, on_load, body, loads)
    body.spec.is_beam = False
    assert not points_inward(model, place, body, loads)


@pytest.mark.parametrize(("mass", "refused"), [(0.9e-10, True), (1.1e-10, False)])
def test_what_carries_an_appendage_has_mass_beside_what_that_carries(mass, refused):
    """1e-12 of the 100 kg of a hand on its end."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body name="tray"><freejoint/><inertial pos="0 0 0" mass="{mass}"
        diaginertia="1e-10 1e-10 1e-10"/><site name="m"/><body name="hand" pos="3 0 0">
        <inertial pos="0 0 0" mass="100" diaginertia="1 1 1"/></body></body></worldbody></mujoco>"""
    )
    section = {"shape": "equivalent", "bending_stiffness_xy": 900.0, "linear_mass": 1.0}
    boom = {"name": "boom", "segment": [{"length": 3.0, "section": section}]}
    spec = spec_of({**boom, "port": [{"name": "end", "x": 3.0}]})
    wanted = {"m": AppendageRequest(spec, "b_", {"end": ("hand",)})}

    class Fits(SimpleNamespace):
        def candidate(self, *_):
            raise NotImplementedError  # only where there is a hub

    said = (bc.InputError, "has no mass beside") if refused else (NotImplementedError, None)
    with pytest.raises(said[0], match=said[1]):
        fit_all(model, {"m": mount(model, "m", "site", "m")}, wanted, 9, Fits(held={}, ready={}))


@pytest.mark.parametrize(
    ("radius", "away", "far"), [(0.1, 19.9, False), (0.1, 20.1, True), (2.0, 199, 0), (2.0, 201, 1)]
)
def test_a_place_in_other_units_is_far_away(radius, away, far):
    """Beyond 20 m and 100 radii of gyration from the centre of mass."""
    inertia = 9.0 * radius**2
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="1 2 3" mass="9"
        diaginertia="{0.6 * inertia} {0.7 * inertia} {inertia}"/></body></worldbody></mujoco>"""
    )
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    place = SimpleNamespace(body=1, origin=np.array([1.0, 2.0, 3.0]) + away * direction)
    found = list(far_mount(model, "mount", place))
    assert [each.code for each in found] == ["far-mount"] * bool(far)
    if far:
        assert f"stands {away:.4g} m" in str(found[0])
        assert f"gyration is {radius:.3g} m" in str(found[0])


# -- linear crafts ---------------------------------------------------------------------------------
def test_a_load_does_nothing_to_a_free_base():
    """Rows of its six motions are left out, and the rest is made symmetric."""
    given = np.arange(81.0).reshape(9, 9) ** 1.5
    left = given.copy()
    left[2:8] = 0.0
    found = internal_stiffness(given, SimpleNamespace(free=2))
    np.testing.assert_allclose(found, (left + left.T) / 2.0)
    found = internal_stiffness(given, SimpleNamespace(free=None))
    np.testing.assert_allclose(found, (given + given.T) / 2.0)


def test_modes_are_named_after_the_port_that_they_move_most():
    """By participation over the root of the inertia."""
    mass = np.diag([4.0, 4.0, 4.0, 0.04, 1.0, 1.0])
    rows = np.array(
        [
            [0.1, 1.0, 0.0, 0.04, 0.0, 0.3],  # 0.5 in y, 0.2 about x
            [0.1, 1.0, 0.0, 0.14, 0.0, 0.3],  # 0.7 about x
            [1.3, 1.0, 0.0, 0.0, 0.0, 0.3],  # 0.65 in x
            [0.0, 1.0, 0.9, 0.0, 0.6, 0.3],  # 0.6 about y
            [0.0, 0.2, 0.0, 0.0, 0.0, 0.4],  # 0.4 about z
        ]
    )
    model = bc.PortModel(mass, np.arange(1.0, 6.0), 0.4 * rows)
    assert names_of_models("arm_", model) == [
        "arm_mode1_xy",
        "arm_mode1_torsion",
        "arm_mode1_axial",
        "arm_mode1_xz",
        "arm_mode2_xy",
    ]


def test_soft_springs_are_listed_and_slack_ones_are_not():
    soft = MODEL.format(damper=0.3).replace('stiffness="12"', 'stiffness="0.012"')
    assert inspect_model(soft).tendons == [("rope", 0.012, 0.6, 0.5)]
    assert inspect_model(soft.replace('stiffness="0.012"', "")).tendons == []
    soft = soft.replace('stiffness="16"', 'stiffness="0.016"').replace('stiffness="45"', "")
    assert inspect_model(soft).springs == [("left", 0.016, 1.6)]


@pytest.mark.parametrize(
    ("option", "codes"),
    [
        ('gravity="0 0 0"', []),
        ('gravity="0 0 -1e-3"', ["gravity"]),
        ('gravity="0 0 0" density="0.01"', ["medium"]),
        ('gravity="0 0 0" viscosity="1e-5"', ["medium"]),
    ],
)
def test_any_gravity_or_medium_is_left_out_of_a_plant(option, codes):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><option {option}/></mujoco>")
    assert [each.code for each in linear_omissions(model)] == codes
