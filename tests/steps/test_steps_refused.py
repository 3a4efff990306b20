"""Time steps, latches and runs that cannot be are refused by one sentence that names the argument,
its value and the cure; that nothing is changed by it stands beside each. No tolerances: sentences
only."""

import mujoco
import pytest

import beamchain as bc
from arrays import tube
from beamchain.steps.deployment import hinge_stages, simulate_run
from command import call
from refused import check_refused

NAN = float("nan")
HINGE = """<mujoco><worldbody><body><joint name="h" axis="0 0 1" stiffness="3"/>
<inertial mass="1" pos=".5 0 0" diaginertia=".1 .1 .1"/></body></worldbody>{}</mujoco>"""
MODE = """<tendon><fixed name="{}_mode1" stiffness="5" {}><joint joint="h" coef="{}"/></fixed>
</tendon>"""
FREE, HELD = 'limited="false"', 'limited="true" range="-1 1"'
# two panels, the first folded between stops of 200 degrees
FOLDED = """<mujoco><option gravity="0 0 0"/><worldbody><body><freejoint/>
<inertial pos="0 0 0" mass="60" diaginertia="9 10 11"/><body name="panel1" pos="0.5 0 0">
<joint name="a" axis="0 1 0" stiffness="0.8" springref="-60" range="-200 200"/>
<inertial pos="0.4 0 0" mass="3" diaginertia="0.09 0.16 0.25"/><body name="panel2" pos="0.8 0 0">
<joint name="b" axis="0 1 0" stiffness="0.8" springref="60" range="-200 200"/>
<inertial pos="0.4 0 0" mass="3" diaginertia="0.09 0.16 0.25"/></body></body></body></worldbody>
<keyframe><key name="folded" qpos="0 0 0 1 0 0 0 1.5707963 -3.0"/></keyframe></mujoco>"""
DRIVEN = """<mujoco><option gravity="0 0 0" timestep="0.01" integrator="Euler"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="60" diaginertia="20 22 24"/>
<body name="yoke" pos="0.5 0 0"><joint {} axis="0 0 1" stiffness="900" damping="3" armature="0.01"/>
<inertial pos="0.2 0 0" mass="2" diaginertia="0.05 0.05 0.05"/><site name="mount"/></body></body>
</worldbody></mujoco>"""
STIFF = bc.Equivalent(bending_stiffness_xy=1e6, linear_mass=3.0)
BOOM = bc.Spec(
    segment=(bc.Segment(length=4.0, section=STIFF),), fit=bc.spec.FitOptions(springs="modes")
)


def hinged(tendon="", timestep=0.1, integrator=None):
    model = mujoco.MjModel.from_xml_string(HINGE.format(tendon))
    bc.retime(model, timestep, integrator)


def folded():
    model = mujoco.MjModel.from_xml_string(FOLDED)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


def latched(joint="a", angle=0.0, stiffness=400.0, damping=2.0, **more):
    model, data = folded()
    place = more.pop("model", model), more.pop("data", data)
    bc.latch(*place, joint, angle=angle, stiffness=stiffness, damping=damping, **more)


def latched_twice():
    model, data = folded()
    bc.latch(model, data, "b", angle=-3.0)
    bc.latch(model, data, "b")


def turning_without_hub():
    scene = bc.Scene(bandwidth=2.0, tolerance=1e-3, timestep=0.05, integrator="auto", rates=RATES)
    bc.fit(tube(), scene=scene)


RATES = (0.5, -0.3, 0.4)
REFUSED = {
    "integrator": (
        lambda: hinged(MODE.format("part", FREE, 1), integrator="leapfrog"),
        ("'leapfrog'",),
    ),
    "no modes": (hinged, ("no modal tendons",)),
    "limited modes": (lambda: hinged(MODE.format("drive", HELD, 2)), ("no modal tendons",)),
    "step": (lambda: hinged(MODE.format("drive", FREE, 1), -0.1), ("timestep = -0.1",)),
    "auto without rates": (
        lambda: bc.Scene(integrator="auto", timestep=0.1),
        ("rates is not given",),
    ),
    "auto without a step": (
        lambda: bc.Scene(integrator="auto", rates=(0.1, 0.0, 0.0)),
        ("timestep is not given",),
    ),
    "rates nan": (lambda: bc.Scene(rates=(0.1, NAN, 0.0)), ("rates[1]",)),
    "auto without a hub": (turning_without_hub, ("root.hub",)),
    "hinge": (lambda: latched("nobody"), ("hinge = 'nobody' is unknown",)),
    "angle nan": (lambda: latched(angle=NAN), ("angle",)),
    "angle beyond": (
        lambda: latched(angle=4.0),
        ("angle = 4 rad", "beyond the stops of hinge 'a'"),
    ),
    "stiffness": (lambda: latched(stiffness=0.0), ("stiffness",)),
    "damping": (lambda: latched(damping=-1.0), ("damping",)),
    "armature": (lambda: latched(armature=-1.0), ("armature",)),
    "impact": (lambda: latched(impact=2), ("impact",)),
    "no model": (lambda: latched(model=None), ("model",)),
    "data of another model": (
        lambda: latched(data=mujoco.MjData(mujoco.MjModel.from_xml_string("<mujoco/>"))),
        ("made for another model",),
    ),
    "free hinge": (lambda: bc.unlatch(*folded(), "b"), ("hinge 'b' is not latched",)),
    "latched hinge": (latched_twice, ("hinge 'b' is latched already",)),
    "hinges to latch": (
        lambda: hinge_stages(folded()[0], ["hinge*"]),
        ("--latch = 'hinge*' is unknown", "choose from a, b"),
    ),
    "a hinge twice": (lambda: hinge_stages(folded()[0], ["a", "?"]), ("--latch names 'a' twice",)),
    "keyframe": (
        lambda: simulate_run(folded()[0], "open", 1.0, 5),
        ("--pose = 'open' is unknown", "folded"),
    ),
}
UNTIMED = {
    "joint without a name": ("", ("give it a name",)),
    "joint with friction": ('name="drive" frictionloss="0.1"', ("'drive'", "has friction")),
}


@pytest.mark.parametrize("case", REFUSED)
def test_steps_and_latches_that_cannot_be_are_refused(case):
    check_refused(REFUSED[case][0], bc.InputError, REFUSED[case][1])


@pytest.mark.parametrize("case", UNTIMED)
@pytest.mark.slow
def test_joints_that_cannot_be_timed_are_refused(case, tmp_path):
    joint, words = UNTIMED[case]
    bc.embed(DRIVEN.format(joint), {"mount": BOOM}).write(tmp_path / "flexible.xml")
    out = tmp_path / "timed.xml"
    more = ("--timestep", 0.01, "--retime-joints", "-o", out)
    answer = call("retime", tmp_path / "flexible.xml", *more)
    assert answer.status == 2
    assert all(word in answer.err for word in words)
    assert not out.exists()


def test_a_tree_on_a_base_that_is_fixed_in_the_world_has_nothing_to_be_judged_by():
    """0.25 kg m^2 over 0.5^2 of the tendon is a mass of 1, and more with what the link carries."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0"/><worldbody><body>
        <inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/><body><joint name="h" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="2" diaginertia="0.3 0.3 0.25"/><body pos="0.4 0 0">
        <inertial pos="0 0 0" mass="0.5" diaginertia="0.02 0.02 0.03"/></body></body></body>
        </worldbody><tendon><fixed name="arm_mode1_xy" stiffness="9" damping="0.1">
        <joint joint="h" coef="0.5"/></fixed></tendon></mujoco>"""
    )
    with pytest.raises(bc.InputError, match="fixed in the world"):
        bc.retime(model, 0.05)
    assert model.tendon_armature[0] == 0.0
