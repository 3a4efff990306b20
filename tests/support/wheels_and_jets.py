"""A spacecraft with wheels, jets and sensors that lie askew, on which signals are combined; and
responses of its plants."""

import numpy as np

import beamchain as bc
from plant_truth import number, quat, turned

ASKEW = turned(0.7, -0.4, 1.1)
TILT = turned(0.2, 0.5, -0.3)
# wheels 1 and 2 lie in the plane xz; the third has a gear that turns it the other way, the fourth
# hangs on a bracket that is welded to the bus
CRAFT = f"""<mujoco><compiler angle="radian"/>
<option timestep="0.01" gravity="0 0 0" integrator="implicitfast"/>
<worldbody><body name="bus"><freejoint/>
<inertial pos="0.1 -0.05 0.02" mass="300" fullinertia="90 80 70 3 -2 1"/>
<site name="mount" pos="0.5 0 0"/>
<site name="straight" pos="0.1 0.3 0.2"/>
<site name="askew" pos="0.1 0.3 0.2" quat="{quat(ASKEW)}"/>
<site name="px" pos="1.1 -0.05 0.02"/><site name="nx" pos="-0.9 -0.05 0.02"/>
<site name="py" pos="0.1 0.95 0.02"/><site name="ny" pos="0.1 -1.05 0.02"/>
<site name="pz" pos="0.1 -0.05 1.02"/><site name="nz" pos="0.1 -0.05 -0.98"/>
<body name="r1"><joint name="j1" axis="1 0 0"/><inertial pos="0 0 0" mass="3"
 diaginertia="0.03 0.02 0.02"/></body>
<body name="r2" quat="{quat(TILT)}"><joint name="j2" axis="{number(TILT.T[:, 2])}"/>
<inertial pos="0 0 0" mass="3" diaginertia="0.03 0.03 0.03"/></body>
<body name="r3"><joint name="j3" axis="0 1 0"/><inertial pos="0 0 0" mass="3"
 diaginertia="0.02 0.03 0.02"/></body>
<body name="bracket" quat="{quat(TILT)}"><body name="r4"><joint name="j4" axis="1 1 1"/>
<inertial pos="0 0 0" mass="3" diaginertia="0.03 0.03 0.03"/></body></body>
<body name="r5"><joint name="j5" axis="1 0 0"/><inertial pos="0 0 0" mass="1"
 diaginertia="0.01 0.01 0.01"/></body>
<body name="yoke" pos="0 0.6 0"><joint name="drive" axis="0 1 0" stiffness="2000" damping="5"/>
<joint name="second" axis="1 0 0" stiffness="3000" damping="5"/>
<inertial pos="0 0.2 0" mass="9" diaginertia="2 1 2"/><site name="far" pos="0 0.4 0"/></body>
<body name="slider"><joint name="slide" type="slide" stiffness="900" damping="3"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
</body></worldbody>
<actuator><motor name="w1" joint="j1"/><motor name="w2" joint="j2"/>
<motor name="w3" joint="j3" gear="-2"/><general name="w4" joint="j4" gainprm="0.5"/>
<motor name="t_px" site="px" gear="0 1 0 0 0 0"/><motor name="t_nx" site="nx" gear="0 1 0 0 0 0"/>
<motor name="t_py" site="py" gear="0 0 1 0 0 0"/><motor name="t_ny" site="ny" gear="0 0 1 0 0 0"/>
<motor name="t_pz" site="pz" gear="1 0 0 0 0 0"/><motor name="t_nz" site="nz" gear="1 0 0 0 0 0"/>
<motor name="rod" site="askew" gear="0 0 0 0 0 3"/>
<motor name="outboard" site="far" gear="1 0 0 0 0 0"/>
<motor name="between" site="px" refsite="far" gear="1 0 0 0 0 0"/>
<motor name="pusher" joint="slide"/><motor name="turner" joint="drive"/>
<position name="servo" joint="j5" kp="5"/><velocity name="speed" joint="j5" kv="5"/>
<intvelocity name="held" joint="j5" kp="3" actrange="-1 1"/></actuator>
<sensor><gyro name="gyro" site="straight"/><gyro name="gyro_askew" site="askew"/>
<accelerometer name="acc" site="straight"/><accelerometer name="acc_askew" site="askew"/>
<velocimeter name="vel" site="straight"/><velocimeter name="vel_askew" site="askew"/>
<magnetometer name="mag" site="straight"/><magnetometer name="mag_askew" site="askew"/>
<framequat name="star" objtype="site" objname="askew"/>
<framequat name="inertia_axes" objtype="body" objname="bus"/>
<framequat name="seen" objtype="site" objname="askew" reftype="body" refname="world"/>
<framelinvel name="world_vel" objtype="site" objname="straight"/>
<frameangvel name="world_rate" objtype="site" objname="straight"/>
<jointpos name="drive_angle" joint="drive"/><jointpos name="second_angle" joint="second"/></sensor>
<keyframe>
<key name="turned" qpos="0 0 0 {quat(turned(0.4, -1.0, 0.6))} 0 0 0 0 0 0 0 0"/></keyframe>
</mujoco>"""
WHEELS = ["w1", "w2", "w3", "w4"]
INPUTS = {"torque": bc.allocate(WHEELS), "push": {"force:bus": 2.0}}
OUTPUTS = {"attitude": bc.align("star"), "rate": bc.align("gyro_askew")}
S = np.geomspace(0.05, 30.0, 40) * (0.01 + 1j)


def array():
    """Of its place `mount`: two modes in one plane."""
    return bc.Spec(
        name="boom",
        segment=(
            bc.Segment(
                length=8.0, section=bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
            ),
        ),
        modes=bc.Modes(xy=2),
        damping=bc.Damping(ratio=0.003),
        fit=bc.spec.FitOptions(springs="modes"),
    )


def off(found, true):
    """Largest difference of responses `(p, m, k)`, of every output beside its largest."""
    return float(np.max(np.abs(found - true).max((1, 2)) / np.abs(true).max((1, 2))))


def response(plant):
    return np.asarray(plant(S, squeeze=False))
