"""A servo with a force range is warned of where it goes on switching between its limits once it has
saturated, and nowhere else.

Truth: the embedded arm stepped by plain MuJoCo after a command that saturates its servo.
"""

from importlib.resources import files

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.steps.saturation import servos_that_chatter
from command import call

ARM = """<mujoco><option timestep="0.005" gravity="0 0 0" integrator="implicitfast"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="400" diaginertia="80 100 120"/>
<site name="shoulder" pos="0.5 0 0"/>
<body name="elbow" pos="6.5 0 0"><joint name="elbow" axis="0 0 1" {joint}/>
<inertial pos="0 0 0" mass="4" diaginertia="0.02 0.02 0.02"/><site name="forearm"/>
<body name="hand" pos="5 0 0"><inertial pos="0 0 0" mass="20" diaginertia="0.5 0.5 0.5"/></body>
</body></body></worldbody>
<actuator><position name="turn" joint="elbow" {servo}/></actuator>
<keyframe><key name="bent" qpos="0 0 0 1 0 0 0 1.0471976" ctrl="{ctrl}"/></keyframe></mujoco>"""
FORCE = 'forcerange="-100 100"'
BENT = 1.0471976


@pytest.mark.slow
@pytest.mark.parametrize(
    ("joint", "servo", "gear", "chatters"),
    [
        ('actuatorfrcrange="-100 100"', 'kp="9000" kv="4000"', 1.0, True),
        ("", 'kp="2250" kv="1000" gear="2" forcerange="-50 50"', 2.0, True),
        ('damping="4000"', f'kp="9000" {FORCE}', 1.0, False),
    ],
)
def test_what_is_warned_of_chatters(tmp_path, joint, servo, gear, chatters):
    arm = ARM.format(joint=joint, servo=servo, ctrl=gear * BENT)
    shipped = files("beamchain") / "examples"
    places = {"shoulder": shipped / "upper.toml", "forearm": shipped / "fore.toml"}
    made = bc.embed(arm, places, retime=True)
    said = [w for w in made.warnings if getattr(w, "code", "") == "servo-saturates"]
    assert len(said) == chatters
    assert not chatters or ("'elbow'" in said[0] and 'damping="4000"' in said[0])
    made.write(tmp_path / "flexible.xml")
    found = call("inspect", tmp_path / "flexible.xml", "--json").record["warnings"]
    assert ("servo-saturates" in {one["code"] for one in found}) == chatters
    assert saturated(tmp_path / "flexible.xml", gear) == (1.0 if chatters else 0.0)


def saturated(path, gear) -> float:
    """Share of the steps of the last of ten seconds in which the torque is at a limit, after the
    command steps by 0.05 rad."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    torque = []
    while data.time < 10.0:
        data.ctrl[:] = gear * (BENT + 0.05 * (data.time > 1.0))
        mujoco.mj_step(model, data)
        torque.append(float(data.qfrc_actuator[model.joint("elbow").dofadr[0]]))
    last = np.abs(torque[-round(1.0 / model.opt.timestep) :])
    return float(np.mean(last > 99.9))


TWO = """<mujoco><option timestep="{step}" gravity="0 0 0" integrator="implicitfast"/><worldbody>
<body><joint name="one" axis="0 0 1" {one}/><inertial pos="0 0 0" mass="1" diaginertia="2 2 2"/>
</body><body pos="9 0 0"><joint name="two" axis="0 0 1" {two}/>
<inertial pos="0 0 0" mass="1" diaginertia="5 5 5"/></body></worldbody>
<actuator><position name="first" joint="one" kp="9" kv="40" gear="3"/>
<position name="second" joint="two" kp="9" kv="100"/></actuator></mujoco>"""
RANGE = 'actuatorfrcrange="-1 1"'


@pytest.mark.parametrize(("one", "two"), [(RANGE, ""), ("", RANGE), (RANGE, RANGE), ("", "")])
def test_a_servo_whose_joint_has_a_range_chatters_from_2_i_by_kv_on(one, two):
    """kv counts by the square of the gear: 360 N m s/rad on 2 kg m^2, 100 on 5."""
    limits = {"first": 2.0 * 2.0 / 360.0, "second": 2.0 * 5.0 / 100.0}
    for share in (0.98, 1.02):
        for name, limit in limits.items():
            text = TWO.format(step=share * limit, one=one, two=two)
            said = list(servos_that_chatter(mujoco.MjModel.from_xml_string(text)))
            there = {"first": bool(one), "second": bool(two)}
            wanted = [n for n, at in limits.items() if there[n] and share * limit > at]
            assert [each.split("'")[1] for each in said] == wanted, name
