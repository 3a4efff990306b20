"""A spacecraft of joints and keyframes, for plants in several poses."""

# a drive, a second one behind it, a mast on a slide, a wheel; the wall is met on the way from one
# pose to another only
CRAFT = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/>
<worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 80 70"/>
<geom name="wall" type="sphere" size="0.1" pos="0.5 0.8 0" mass="0"/>
<body name="yoke" pos="0.5 0 0"><joint name="drive" axis="0 0 1" range="-2 2" stiffness="8000"/>
<inertial pos="0.2 0 0" mass="5" diaginertia="1 1 1"/>
<body name="knuckle" pos="0.4 0 0"><joint name="turn" axis="1 0 0" stiffness="6000"/>
<geom name="arm" type="sphere" size="0.1" pos="0.4 0 0" mass="0"/>
<inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/><site name="mount"/></body></body>
<body name="mast"><joint name="reach" type="slide" axis="0 0 1" range="-1 1" stiffness="900"/>
<inertial pos="0 0 0.5" mass="20" diaginertia="2 2 0.1"/></body>
<body name="rotor"><joint name="wheel" axis="0 0 1"/>
<inertial pos="0 0 0" mass="5" diaginertia="0.02 0.02 0.03"/></body></body></worldbody>
<actuator><motor name="spin" joint="wheel"/></actuator>
<keyframe><key name="drive" qpos="0 0 0 1 0 0 0 0.5 0.2 0.1 0"/>
<key qpos="0 0 0 1 0 0 0 0 0.3 0 700"/>
<key name="fast" qpos="0 0 0 1 0 0 0 0.5 0.2 0.1 0" qvel="0 0 0 0 0 0 0 0 0 90"/>
</keyframe></mujoco>"""
