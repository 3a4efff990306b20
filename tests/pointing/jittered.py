"""A hub with a wheel and a sprung panel, which disturbances shake."""

DAMPED = """<mujoco><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="9" diaginertia="12 12 12"/>
<body name="wheel" pos="0.3 0 0"><joint name="spin" axis="0 0 1"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.02"/></body>
<body name="lopsided"><joint name="lopsided" axis="0 0 1"/>
<inertial pos="0.1 0 0" mass="0.1" diaginertia="0.01 0.01 0.02"/></body>
<body name="panel"><joint name="arm_hinge1_xy" axis="0 0 1" stiffness="300" damping="0.4"/>
<inertial pos="0 0 0" mass="1" diaginertia="3 3 3"/><site name="arm_tip" pos="2 0 0"/></body></body>
</worldbody></mujoco>"""
UNDAMPED = DAMPED.replace('damping="0.4"', "")
UNSTABLE = DAMPED.replace('damping="0.4"', 'damping="0"').replace(
    "</worldbody>",
    '</worldbody><actuator><general joint="arm_hinge1_xy" biastype="affine" biasprm="0 0 1"/>'
    "</actuator>",
)
WHEEL = {"joint": "spin", "speeds": (2.0, 30.0), "static": 2e-6}
