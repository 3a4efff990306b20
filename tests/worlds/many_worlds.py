"""Spacecraft that worlds are made of: two booms and a wheel, and hinges that latch."""

from functools import cache

import beamchain as bc

CRAFT = """<mujoco><option timestep="0.25" gravity="0 0 0" {}/><worldbody><body name="bus">
<freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 100 120"/><site name="mount" pos="0.5 0 0"/>
<site name="left" pos="0 0.5 0"
 xyaxes="0 1 0 -1 0 0"/><body pos="0 0 0.2"><joint name="wheel" axis="0 0 1"/>
 <inertial pos="0 0 0" mass="4"
 diaginertia="0.02 0.02 0.04"/></body></body></worldbody><actuator>
 <motor name="x" site="mount" gear="0 0 0 1 0 0"/>
<motor name="z" site="left" gear="0 0 0 0 0 1"/><motor name="wheel" joint="wheel"/></actuator>
<sensor><gyro name="gyro" site="mount"/><framepos name="place" objtype="site" objname="left"/>
</sensor></mujoco>"""
UNFOLDS = """<mujoco><option timestep="0.012" gravity="0 0 0" integrator="{}"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="60" diaginertia="9 10 11"/>
<body pos=".5 0 0"><joint name="one" axis="0 1 0" stiffness="2" springref="-30" range="0 100"/>
<inertial pos=".4 0 0" mass="3" diaginertia=".09 .16 .25"/>
<body pos=".8 0 0"><joint name="two" axis="0 1 0" stiffness="1" springref="40" range="-190 0"
 damping=".02" frictionloss="0.001"/><inertial pos=".4 0 0" mass="3" diaginertia=".09 .16 .25"/>
</body></body></body></worldbody>
<actuator><motor name="one" joint="one"/></actuator>
<keyframe><key qpos="0 0 0 1 0 0 0 1.5 -3" qvel="0 0 0 .02 .05 -.03 0 0"/></keyframe></mujoco>"""


@cache
def flexible(option: str = "", **given: object) -> bc.Embedded:
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    spec = bc.Spec(
        segment=(bc.Segment(length=8.0, section=section),), damping=bc.Damping(ratio=0.01)
    )
    return bc.embed(
        CRAFT.format(option), {"mount": spec, "left": spec.replace(name="other")}, **given
    )
