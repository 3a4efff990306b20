"""A control engineer's craft of 1,990 kg: two arrays on servo drives, a boom, four wheels in a
pyramid, a star tracker and a gyro that are mounted askew.

`write` writes its files, `embedded` embeds it; `EngineerTruth` assembles it in numpy from finite
elements and knows no package, as `Truth` of `plant_truth` does.
"""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import beamchain as bc
from plant_truth import LEFT, RIGHT, Truth, array, boom, number, quat, tube, turned
from random_appendages import toml

#: degrees of the drives `north` and `south`
POSES = ((45.0, 45.0), (45.0, -45.0), (0.0, 90.0))
WHEELS = ("rw1", "rw2", "rw3", "rw4")  # their motors; the joints are wheel1 to wheel4
SPIN = (310.0, -180.0, 240.0, -95.0)  # rad/s in the keyframe `turning`
STAR = (np.array([0.7, -0.4, 0.9]), turned(0.9, -0.5, 0.35))  # place and axes of the star tracker
IMU = (np.array([0.1, 0.25, -0.2]), turned(-0.3, 0.2, 1.4))
SERVO = {"kp": 9000.0, "kv": 60.0}
TILT = np.radians(35.0)  # of the wheels' axes out of the plane xy


def _wheels():
    azimuth = np.radians([40.0, 130.0, 220.0, 310.0])
    return {
        f"wheel{k + 1}": {
            "at": (0.35 * np.cos(a), 0.35 * np.sin(a), -0.6),
            "axis": (np.cos(TILT) * np.cos(a), np.cos(TILT) * np.sin(a), np.sin(TILT)),
            "mass": 9.0,
            "inertia": (0.11, 0.065),
            "rate": 0.0,
        }
        for k, a in enumerate(azimuth)
    }


def _drive(side, turn):
    return {
        "at": (0.15, 0.95 * side, 0.2),
        "turn": turn,
        "mass": 11.0,
        "inertia": (0.9, 0.6, 0.6),
        "stiffness": SERVO["kp"],
        "damping": SERVO["kv"],
    }


def _panel(length, mass):
    return {
        "length": length,
        "section": {
            "shape": "equivalent",
            "bending_stiffness_xy": 3e5,
            "bending_stiffness_xz": 9e3,
            "torsion_stiffness": 4e3,
            "linear_mass": mass,
            "polar_inertia": 3.1,
        },
    }


def _array(name, drive, mass):
    out = array(name, drive, (0.15, 0.02, 0.05), ratio=0.004)
    out["spec"]["segment"] = [tube(1.3, 0.08, 0.003), _panel(6.5, mass)]
    return out


def _boom():
    out = boom("boom", (-0.8, 0.1, 0.3), turned(0.1, np.pi + 0.2, 0.0), ratio=0.003)
    out["spec"]["segment"] = [tube(7.0, 0.07, 0.002)]
    out["spec"]["lump"] = [{"x": 7.0, "mass": 14.0, "inertia": [0.3, 0.3, 0.3]}]
    return out


def _hub():
    full = np.array([[1240.0, 18.0, -25.0], [18.0, 990.0, 12.0], [-25.0, 12.0, 1330.0]])
    return {"mass": 1795.0, "com": np.array([0.03, -0.02, 0.05]), "inertia": full}


#: in the words of `plant_truth`: `hub` is the body `bus`
CRAFT = {
    "hub": _hub(),
    "unit": IMU,
    "wheels": _wheels(),
    "drives": {"north": _drive(1.0, LEFT), "south": _drive(-1.0, RIGHT)},
    "appendages": {
        "north_panel": _array("north_array", "north", 8.5),
        "south_panel": _array("south_array", "south", 9.5),
        "boom_mount": _boom(),
    },
}


def angles(north, south):
    """The drives' angles [rad] from degrees, as `pose` takes them."""
    return {"north": np.radians(north), "south": np.radians(south)}


def mjcf(step=0.01):
    """Text of the bare craft: body `bus`, motors `rw1` to `rw4`, servos `north_servo` and
    `south_servo`, sensors `star` (framequat), `gyro` and `accelerometer`, sites `north_panel`,
    `south_panel` and `boom_mount` for its appendages.

    Keyframes: `noon` (45, 45), `crossed` (45, -45), `edge` (0, 90) degrees, and `turning`,
    the second with wheels at speed.
    """
    hub = CRAFT["hub"]
    full = hub["inertia"]
    inertia = number([full[0, 0], full[1, 1], full[2, 2], full[0, 1], full[0, 2], full[1, 2]])
    bodies = []
    for name, wheel in CRAFT["wheels"].items():
        spin, across = wheel["inertia"]
        bodies.append(
            f'<body name="{name}" pos="{number(wheel["at"])}">'
            f'<joint name="{name}" axis="{number(wheel["axis"])}"/>'
            f'<inertial pos="0 0 0" quat="{quat(_onto(wheel["axis"]))}" mass="{wheel["mass"]!r}" '
            f'diaginertia="{number([across, across, spin])}"/></body>'
        )
    for name, drive in CRAFT["drives"].items():
        mount = CRAFT["appendages"][f"{name}_panel"]
        bodies.append(
            f'<body name="{name}_yoke" pos="{number(drive["at"])}" quat="{quat(drive["turn"])}">'
            f'<joint name="{name}" axis="1 0 0" range="-3.2 3.2"/>'
            f'<inertial pos="0 0 0" mass="{drive["mass"]!r}" '
            f'diaginertia="{number(drive["inertia"])}"/>'
            f'<site name="{name}_panel" pos="{number(mount["at"])}" '
            f'quat="{quat(mount["turn"])}"/></body>'
        )
    mount = CRAFT["appendages"]["boom_mount"]
    sites = {"star_head": STAR, "imu": IMU, "boom_mount": (mount["at"], mount["turn"])}
    places = "".join(
        f'<site name="{name}" pos="{number(at)}" quat="{quat(turn)}"/>'
        for name, (at, turn) in sites.items()
    )
    motors = "".join(
        f'<motor name="{motor}" joint="{joint}" ctrlrange="-0.2 0.2"/>'
        for motor, joint in zip(WHEELS, CRAFT["wheels"], strict=True)
    )
    servos = "".join(
        f'<position name="{name}_servo" joint="{name}" kp="{SERVO["kp"]!r}" kv="{SERVO["kv"]!r}"/>'
        for name in CRAFT["drives"]
    )
    keys = "".join(
        f'<key name="{name}" qpos="0 0 0 1 0 0 0 0 0 0 0 {number(np.radians(pose))}" '
        f'qvel="0 0 0 0 0 0 {number(spin)} 0 0"/>'
        for name, pose, spin in (
            *((n, p, (0.0,) * 4) for n, p in zip(("noon", "crossed", "edge"), POSES, strict=True)),
            ("turning", POSES[1], SPIN),
        )
    )
    return f"""<mujoco model="engineer"><compiler angle="radian"/>
<option timestep="{step!r}" gravity="0 0 0" integrator="implicitfast">
<flag contact="disable"/></option>
<worldbody><body name="bus"><freejoint name="free"/>
<inertial pos="{number(hub["com"])}" mass="{hub["mass"]!r}" fullinertia="{inertia}"/>
{places}{"".join(bodies)}</body></worldbody>
<actuator>{motors}{servos}</actuator>
<sensor><framequat name="star" objtype="site" objname="star_head"/><gyro name="gyro" site="imu"/>
<accelerometer name="accelerometer" site="imu"/></sensor>
<keyframe>{keys}</keyframe></mujoco>"""


def _onto(axis):
    """A turn of z onto an axis."""
    z = np.asarray(axis) / np.linalg.norm(axis)
    return Rotation.align_vectors([z], [[0.0, 0.0, 1.0]])[0].as_matrix()


def specs():
    """The appendages' specifications as TOML text, by the site where each goes."""
    return {place: toml(a["spec"]) for place, a in CRAFT["appendages"].items()}


def write(folder, step=0.01):
    """Write `craft.xml` and a specification per site; their paths, as `bc.embed` takes them."""
    folder = Path(folder)
    (folder / "craft.xml").write_text(mjcf(step))
    places = {}
    for place, text in specs().items():
        places[place] = folder / f"{place}.toml"
        places[place].write_text(text)
    return folder / "craft.xml", places


@cache
def embedded(step=0.01):
    """The craft with its appendages, as the package embeds them."""
    with tempfile.TemporaryDirectory() as folder:
        return bc.embed(*write(folder, step))


def kept(appendage):
    """Modes that an appendage keeps, by port."""
    return appendage["spec"]["modes"]


class EngineerTruth(Truth):
    """The craft in finite elements at angles of its drives [degrees], under the MJCF's names.

    Args:
        pose: of `north` and `south`.
        counts: modes of an appendage by port, as `kept`.
        turning: the wheels at the speeds of the keyframe `turning`.
    """

    def __init__(self, pose, counts=kept, *, turning=False):
        spins = SPIN if turning else (0.0,) * 4
        wheels = {
            name: {**wheel, "rate": rate}
            for (name, wheel), rate in zip(CRAFT["wheels"].items(), spins, strict=True)
        }
        super().__init__({**CRAFT, "wheels": wheels}, counts, angles(*pose))

    def inputs(self, names):
        """Columns of actuators and of `torque:bus`, three of `allocated`: the torque on the bus
        that the wheels share by the least squares of their own torques."""
        columns = []
        for name in names:
            if name == "torque:bus":
                columns.append(self.hub[3:].T)
            elif name == "allocated":
                # torque of a motor about its axis turns the bus the other way
                on_bus = -np.array([wheel["axis"] for wheel in CRAFT["wheels"].values()]).T
                shares = on_bus.T @ np.linalg.inv(on_bus @ on_bus.T)
                columns.append(self.inputs(WHEELS) @ shares)
            elif name in WHEELS:
                columns.append(np.eye(self.size)[:, [6 + WHEELS.index(name)]])
            else:  # a servo's set point pulls through its stiffness
                joint = 6 + self.names.index(name.removesuffix("_servo"))
                columns.append(SERVO["kp"] * np.eye(self.size)[:, [joint]])
        return np.hstack(columns)

    def outputs(self, names, s):
        """Rows of `attitude` and `rate` of the bus, and of its sensors in their own axes."""
        star = self.seen(*STAR)
        imu = self.seen(*IMU)
        rows = {
            "attitude": self.hub[3:],
            "rate": s * self.hub[3:],
            "star": star[3:],
            "gyro": s * imu[3:],
            "accelerometer": s**2 * imu[:3],
        }
        return np.vstack([rows[name] for name in names])

    def poles(self):
        """Poles above the real axis whose frequency is not that of a rigid motion."""
        poles = np.linalg.eigvals(self.system()[0])
        poles = poles[(poles.imag > 0.0) & (np.abs(poles) > 1e-2)]
        return poles[np.argsort(np.abs(poles))]
