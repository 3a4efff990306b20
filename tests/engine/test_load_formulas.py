"""Closed forms beside a load that does not change: what is felt, how far a pendulum sags, and its
stiffness there."""

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

import beamchain as bc
from formulas import (
    Loading,
    check_pushes,
    key_number,
    linear_at,
    load_at,
    loaded_linear,
    loading_at,
    offset_cautions,
    push_of_actuators,
    rest_point,
    still_copy,
)

G = np.array([0.3, -2.0, -9.0])


def loading(**more):
    given = {"gravity": G, "ctrl": np.zeros(1), "act": np.zeros(0), "field": G, "free": None}
    return Loading(**{**given, "pushed": np.zeros((0, 0)), **more})


def test_a_base_that_is_free_takes_its_axes_along():
    matrix = np.arange(81.0).reshape(9, 9)
    held = loading().in_own_axes(matrix)
    assert held == pytest.approx((matrix + matrix.T) / 2.0)
    wanted = np.array(matrix)
    wanted[:, 1:7] = 0.0
    assert np.array_equal(loading(free=1).in_own_axes(matrix), wanted)
    felt = np.array([1.0, 2.0, -2.0])
    assert loading(free=1, field=felt).acceleration == pytest.approx(G - felt)


def test_a_load_in_words():
    felt = np.array([1.0, 2.0, -2.0])
    assert loading(free=0, field=felt).words == "under a thrust that accelerates it by 3 m/s^2"
    assert loading(field=felt).words == "under 3 m/s^2 of gravity"
    both = loading(field=felt, ctrl=np.array([0.0, 2.0])).words
    assert both == "under 3 m/s^2 of gravity and the ctrl of its keyframe"
    assert loading(field=1e-13 * felt, ctrl=np.ones(1)).words == "under the ctrl of its keyframe"


# a free craft with a thruster that is turned in it, and a motor whose force depends on its joint
CRAFT = """<mujoco><option gravity="0 0 -3"/><worldbody><body name="bus" pos="1 2 3">
<freejoint/><inertial pos=".1 .2 -.1" mass="20" diaginertia="4 5 6"/><site name="jet"
pos=".4 .1 0" euler="0 30 0"/><body name="link" pos=".5 0 0"><joint name="hinge" axis="0 1 0"
range="-100 100"/><inertial pos="0 0 -2" mass="3" diaginertia=".3 .3 .4"/><site name="far"/>
</body></body></worldbody><actuator><motor name="jet" site="jet" gear="0 0 2 0 0 0"/>
<position name="servo" joint="hinge" kp="7"/><general name="lag" site="jet" gear="1 0 0 0 0 0"
dyntype="filter" dynprm="1"/><motor name="far" site="far" gear="0 0 1 0 0 0"/></actuator>
<keyframe><key name="burn" qpos="1 2 3 1 0 0 0 .4" ctrl="5 0 0 0" act="1.5"/>
<key name="coast" qpos="1 2 3 1 0 0 0 .4"/><key name="turn" ctrl="0 2 0 0"/>
<key name="pushed" ctrl="0 0 0 4"/><key name="lag" ctrl="0 0 3 0"/><key name="left" act="1.5"/>
</keyframe></mujoco>"""


def craft():
    return mujoco.MjModel.from_xml_string(CRAFT)


def test_a_thrust_is_felt_against_its_acceleration():
    """5 times 2 N along z of the jet and 1.5 N along its x; gravity falls with the craft."""
    model = craft()
    z = np.array([np.sin(np.radians(30.0)), 0.0, np.cos(np.radians(30.0))])
    x = np.array([z[2], 0.0, -z[0]])
    found = loading_at(model, still_copy(model), 0, 1, 23.0)
    thrust = 10.0 * z + 1.5 * x
    assert found.field == pytest.approx(-thrust / 23.0, abs=1e-12)
    assert found.free == 0
    assert found.gravity == pytest.approx([0.0, 0.0, -3.0])
    assert found.acceleration == pytest.approx([0.0, 0.0, -3.0] + thrust / 23.0)
    assert (found.ctrl.tolist(), found.act.tolist()) == ([5.0, 0.0, 0.0, 0.0], [1.5])
    # turned by a small rotation w in its own axes the force in the world turns along
    turned = np.column_stack([np.cross(np.eye(3)[k], thrust) for k in range(3)])
    assert found.pushed[:3, 3:6] == pytest.approx(-turned, abs=1e-9)
    assert np.abs(found.pushed[3:]).max() < 1e-9
    left = loading_at(model, still_copy(model), 5, 1, 23.0)
    assert left.field == pytest.approx(-1.5 * x / 23.0, abs=1e-12)
    assert left.pushed[0, 4] == pytest.approx(-1.5 * x[2], abs=1e-9)
    assert loading_at(model, still_copy(model), 1, 1, 23.0) is None
    assert loading_at(model, still_copy(model), None, 1, 23.0) is None


def test_what_actuators_do_by_themselves_is_no_push():
    """A servo pulls back without ctrl too."""
    model = craft()
    still = still_copy(model)
    qpos = np.array(model.qpos0)
    qpos[7] = 0.4
    ctrl = np.array([0.0, 2.0, 0.0, 0.0])
    found = push_of_actuators(still, mujoco.MjData(still), ctrl, np.zeros(1), qpos)
    assert found == pytest.approx([0.0] * 6 + [14.0], abs=1e-12)


def test_a_craft_that_is_held_feels_its_gravity():
    model = pendulum()
    found = loading_at(model, still_copy(model), None, 1, 2.0)
    assert found.free is None
    assert found.field == pytest.approx(np.array(model.opt.gravity))
    assert np.abs(found.pushed).max() == 0.0
    model.opt.gravity[:] = 0.0
    assert loading_at(model, still_copy(model), None, 1, 2.0) is None


def test_a_pose_without_a_load_is_refused():
    model = craft()
    assert load_at(model, "burn", 1, 23.0).free == 0
    assert load_at(model, 0, 1, 23.0).free == 0
    for at, where in (("coast", "at 'coast'"), (1, "at 1"), (None, "in the pose of rest")):
        with pytest.raises(bc.InputError, match=f"nothing acts on the spacecraft {where}"):
            load_at(model, at, 1, 23.0)
    assert [key_number(model, at) for at in ("turn", 3, np.int64(1), None, "none", True)] == [
        2,
        3,
        1,
        None,
        None,
        None,
    ]


def test_a_constant_force_goes_where_the_exact_craft_knows():
    model = craft()
    link = model.body("link").id
    for key in (0, 1, 2, 4):
        check_pushes(model, key, [link], "key")
    check_pushes(model, 3, [], "key")
    with pytest.raises(bc.InputError, match="'far' pushes with ctrl = 4 on what an appendage"):
        check_pushes(model, 3, [link], "key")


@pytest.mark.parametrize(("part", "told"), [(0.98, False), (1.02, True)])
def test_a_thrust_beside_the_centre_by_a_thousandth_of_the_gyration_is_told(part, told):
    """Two bodies, 1 m of arm for the second: the centre is where the first moments balance."""
    # inertia about the centre: 4, 5 + m, 6 + m with m = 20 5 / 25 0.5^2; r^2 = trace / 2 / mass
    reduced = 4.0 * 0.25
    gyration = np.sqrt((15.0 + 0.3 + 2.0 * reduced) / 2.0 / 25.0)
    y = part * 1e-3 * gyration
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body name="bus" pos="1 2 3" euler="20 30 40"><freejoint/>
        <inertial pos="0 .37 0" mass="20" diaginertia="4 5 6"/>
        <site name="jet" pos=".7 {0.37 + y:.17g} 0"/>
        <body pos=".5 .37 0"><joint name="hinge" axis="0 1 0"/><inertial pos="0 0 0" mass="5"
        diaginertia=".1 .1 .1"/></body></body></worldbody><actuator><motor site="jet"
        gear="4 0 0 0 0 0"/></actuator><keyframe><key ctrl="3"/><key/></keyframe></mujoco>"""
    )
    found = offset_cautions(model, 0, 1, np.array(model.qpos0), "burn")
    assert [one.code for one in found] == ["thrust-offset"] * told
    if told:
        assert f"passes {y * 1e3:.3g} mm beside" in found[0]
        assert f"{12.0 * y:.3g} N m" in found[0]
    assert offset_cautions(model, 1, 1, np.array(model.qpos0), "coast") == []
    assert offset_cautions(model, 0, 2, np.array(model.qpos0), "burn") == []


def test_a_jet_s_own_torque_passes_its_force_beside_the_centre():
    """Across the force it moves the line of action, along it it does not."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="bus" pos="1 2 3" euler="20 30 40"><freejoint/>
        <inertial pos=".3 0 0" mass="20" diaginertia="4 5 6"/><site name="jet" pos=".7 0 0"/>
        </body></worldbody><actuator><motor site="jet" gear="4 0 0 9 .2 0"/></actuator>
        <keyframe><key ctrl="3"/></keyframe></mujoco>"""
    )
    (found,) = offset_cautions(model, 0, 1, np.array(model.qpos0), "burn")
    assert "passes 50 mm beside the centre of mass: 0.6 N m" in found


# -- the sag ---------------------------------------------------------------------------------------
def pendulum(stiffness=30.0, ctrl=0.0):
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 -9"/><worldbody><body><joint name="hinge" axis="0 1 0"
        stiffness="{stiffness}"/><inertial pos="2 0 0" mass="1.5" diaginertia=".1 .2 .3"/></body>
        </worldbody><actuator><motor joint="hinge" gear="2"/></actuator>
        <keyframe><key ctrl="{ctrl}"/></keyframe></mujoco>"""
    )


def without_load(model):
    return linear_at(rest_point(still_copy(model)))


@pytest.mark.parametrize("ctrl", [0.0, 3.0])
def test_a_pendulum_sags_until_its_spring_holds_it(ctrl):
    """k a = m g l cos a + 2 u, and the slope k + m g l sin a."""
    model = pendulum(ctrl=ctrl)
    load = loading_at(model, still_copy(model), 0, 1, 1.5)
    weight = 1.5 * 9.0 * 2.0
    sag = brentq(lambda a: 30.0 * a - weight * np.cos(a) - 2.0 * ctrl, 0.0, 2.0, xtol=1e-14)
    assert sag > 0.5
    still = still_copy(model)
    found = loaded_linear(without_load(model), still, np.array(model.qpos0), [0], load)
    assert found.stiffness[0, 0] == pytest.approx(30.0 + weight * np.sin(sag), rel=1e-9)
    assert found.mass[0, 0] == pytest.approx(0.2 + 6.0)
    # a joint of the craft itself stays where it is
    held = loaded_linear(without_load(model), still, np.array(model.qpos0), [], load)
    assert held.stiffness[0, 0] == pytest.approx(30.0, rel=1e-9)


def test_a_free_craft_sags_in_the_field_of_its_own_acceleration():
    """A constant thrust on a heavy hub along x; the arm stands along y."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 -4"/><worldbody><body name="hub"><freejoint/><inertial
        pos="0 0 0" mass="50" diaginertia="9 9 9"/><site name="jet"/><body pos="0 .5 0"><joint
        name="hinge" axis="0 0 1" stiffness="20"/><inertial pos="0 2 0" mass="3"
        diaginertia=".1 .1 .1"/></body></body></worldbody><actuator><motor site="jet"
        gear="1 0 0 0 0 0"/></actuator><keyframe><key ctrl="106"/></keyframe></mujoco>"""
    )
    still = still_copy(model)
    load = loading_at(model, still, 0, 1, 53.0)
    assert load.pushed[1, 5] == pytest.approx(-106.0, rel=1e-9)
    found = loaded_linear(without_load(model), still, np.array(model.qpos0), [6], load)
    # felt: 2 m/s^2 to -x, so that the arm turns by a about +z: k a = m g l cos a
    weight = 3.0 * 2.0 * 2.0
    sag = brentq(lambda a: 20.0 * a - weight * np.cos(a), 0.0, 1.0, xtol=1e-14)
    assert found.stiffness[6, 6] == pytest.approx(20.0 + weight * np.sin(sag), rel=1e-8)
    assert np.abs(found.stiffness[:, :6]).max() == 0.0
    arm = np.array([-2.0 * np.sin(sag), 0.5 + 2.0 * np.cos(sag)])
    assert found.mass[5, 5] == pytest.approx(9.0 + 0.1 + 3.0 * arm @ arm, rel=1e-9)
