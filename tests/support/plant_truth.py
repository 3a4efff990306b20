"""Whole spacecraft assembled by hand: hub, wheels, drives, and appendages in finite elements.
`Truth` knows no package.

A craft is a dict; `text` writes it as MJCF for MuJoCo, `Truth` assembles `M q'' + C q' + K q` in
numpy. Freedoms: six of the hub (in its own axes), one per wheel, one per drive, then the cantilever
modes of the appendages.
"""

import contextlib
import tempfile
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import beamchain as bc
import finite_elements as fe
from random_appendages import toml
from solver import Craft, Frame, Modes

EYE = np.eye(3)


def number(values):
    return " ".join(repr(float(v)) for v in np.atleast_1d(values))


def quat(turn):
    return number(Rotation.from_matrix(turn).as_quat()[[3, 0, 1, 2]])


def along(axis):
    """A frame with z along an axis."""
    z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    x = np.cross(z, [0.3, 0.9, -0.4])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def text(craft, step=0.01, angles=None):
    """MJCF of the bare craft: hub `hub`, wheels' motors by their names, drives' too, sensors,
    keyframe `run`."""
    hub, motors, bodies = craft["hub"], [], []
    for name, wheel in craft.get("wheels", {}).items():
        j, t = wheel["inertia"]
        motors.append(
            f'<motor name="{name}_motor" joint="{name}" gear="{number(wheel.get("gear", 1.0))}"/>'
        )
        bodies.append(
            f'<body name="{name}" pos="{number(wheel["at"])}" '
            f'quat="{quat(along(wheel["axis"]))}"><joint name="{name}" axis="0 0 1" '
            f'damping="{number(wheel.get("damping", 0.0))}"/><inertial pos="0 0 0" '
            f'mass="{number(wheel["mass"])}" diaginertia="{number([t, t, j])}"/></body>'
        )
    for name, drive in craft.get("drives", {}).items():
        motors.append(f'<motor name="{name}_motor" joint="{name}"/>')
        sites = "".join(
            f'<site name="{n}" pos="{number(a["at"])}" quat="{quat(a["turn"])}"/>'
            for n, a in craft["appendages"].items()
            if a.get("on") == name
        )
        bodies.append(
            f'<body name="{name}_rotor" pos="{number(drive["at"])}" '
            f'quat="{quat(drive["turn"])}"><joint name="{name}" axis="1 0 0" '
            f'damping="{number(drive.get("damping", 0.0))}" '
            f'stiffness="{number(drive.get("stiffness", 0.0))}"/><inertial pos="0 0 0" '
            f'mass="{number(drive["mass"])}" '
            f'diaginertia="{number(drive["inertia"])}"/>{sites}</body>'
        )
    sites = "".join(
        f'<site name="{n}" pos="{number(a["at"])}" quat="{quat(a["turn"])}"/>'
        for n, a in craft["appendages"].items()
        if a.get("on") is None
    )
    full = hub["inertia"]
    inertia = number([full[0, 0], full[1, 1], full[2, 2], full[0, 1], full[0, 2], full[1, 2]])
    wheels = list(craft.get("wheels", {}).values())
    drives = list(craft.get("drives", {}))
    qvel = number([0.0] * 6 + [w.get("rate", 0.0) for w in wheels] + [0.0] * len(drives))
    place = number(
        [0.0, 0.0, 0.0, *Rotation.from_matrix(craft.get("attitude", EYE)).as_quat()[[3, 0, 1, 2]]]
    )
    qpos = place + "".join(
        f" {number((angles or {}).get(n, 0.0))}" for n in [*craft.get("wheels", {}), *drives]
    )
    joints = "".join(f'<jointpos name="{n}_angle" joint="{n}"/>' for n in drives)
    joints += "".join(f'<jointvel name="{n}_rate" joint="{n}"/>' for n in craft.get("wheels", {}))
    return f"""<mujoco model="craft"><compiler angle="radian"/>
<option timestep="{step!r}" gravity="0 0 0" integrator="Euler"><flag contact="disable"/></option>
<worldbody><body name="hub" quat="{quat(craft.get("attitude", EYE))}"><freejoint name="free"/>
<inertial pos="{number(hub["com"])}" mass="{number(hub["mass"])}" fullinertia="{inertia}"/>
<site name="unit" pos="{number(craft["unit"][0])}"
quat="{quat(craft["unit"][1])}"/>{sites}{"".join(bodies)}</body></worldbody>
<actuator>{"".join(motors)}</actuator>
<sensor><gyro name="gyro" site="unit"/><accelerometer name="accelerometer" site="unit"/>
<framequat name="star" objtype="site" objname="unit"/>{joints}</sensor>
<keyframe><key name="run" qpos="{qpos}" qvel="{qvel}"/></keyframe></mujoco>"""


class Truth:
    """The craft in numpy at angles of its drives; appendages with all modes in `counts`,
    the rest of their mass rigid."""

    def __init__(self, craft, counts, angles=None):
        wheels, drives = craft.get("wheels", {}), craft.get("drives", {})
        self.craft, self.names = craft, [*wheels, *drives]
        whole = Craft()
        whole.body(whole.base, craft["hub"]["mass"], craft["hub"]["com"], craft["hub"]["inertia"])
        for wheel in wheels.values():
            whole.wheel(
                whole.base.at(wheel["at"], along(wheel["axis"])),
                (0.0, 0.0, 1.0),
                wheel["mass"],
                *wheel["inertia"],
                wheel.get("rate", 0.0),
                wheel.get("damping", 0.0),
            )
        frames = {None: whole.base}
        for name, drive in drives.items():
            held = {key: drive.get(key, 0.0) for key in ("stiffness", "damping")}
            frames[name] = whole.hinge(
                whole.base.at(drive["at"], drive["turn"]),
                (1.0, 0.0, 0.0),
                (angles or {}).get(name, 0.0),
                **held,
            )
            whole.body(frames[name], drive["mass"], inertia=drive["inertia"])
        for a in craft["appendages"].values():
            root = frames[a.get("on")].at(a["at"], a["turn"])
            whole.modes(root, self.modes(a["spec"], counts(a)))
        self.m, self.c, self.k = whole.matrices()
        self.size, self.hub = whole.size, whole.wide(np.eye(6))

    @staticmethod
    def modes(spec, counts):
        ports = []
        for name, count in counts.items():
            with contextlib.suppress(ValueError):  # rigid there
                ports.append(fe.port(spec, name, count))
        rows = np.vstack([p.participation @ fe.into_space(p.port).T for p in ports])
        w, ratio = np.concatenate([p.frequencies for p in ports]), spec.get("damping", {})
        return Modes(w, ratio.get("ratio", 0.0), rows, fe.rigid_mass(spec), 0.0 * rows, 0.0)

    def seen(self, place, turn):
        """`(6, size)` motion of a frame on the hub in its own axes."""
        return Frame(self.hub, np.zeros(3), EYE).at(place, turn).own

    def inputs(self, names):
        columns = []
        for name in names:
            if name == "torque:hub":
                columns.append(self.hub[3:].T)
            elif name == "force:hub":
                columns.append(self.seen(self.craft["hub"]["com"], EYE)[:3].T)
            elif name == "wrench:unit":
                columns.append(self.seen(*self.craft["unit"]).T)
            else:
                joint = name.removesuffix("_motor")
                gear = self.craft.get("wheels", {}).get(joint, {}).get("gear", 1.0)
                columns.append(gear * np.eye(self.size)[:, [6 + self.names.index(joint)]])
        return np.hstack(columns)

    def outputs(self, names, s):
        rows = []
        unit = self.seen(*self.craft["unit"])
        for name in names:
            if name in ("attitude", "rate"):
                rows.append(self.hub[3:] * (s if name == "rate" else 1.0))
            elif name == "motion:unit":
                rows.append(unit)
            elif name == "gyro":
                rows.append(s * unit[3:])
            elif name == "star":
                rows.append(unit[3:])
            elif name == "accelerometer":
                rows.append(s**2 * unit[:3])
            else:
                joint, kind = name.rsplit("_", 1)
                rows.append(
                    np.eye(self.size)[[6 + self.names.index(joint)]]
                    * (s if kind == "rate" else 1.0)
                )
        return np.vstack(rows)

    def transfer(self, s, inputs, outputs):
        """`(outputs, inputs, k)` at complex frequencies."""
        b = self.inputs(inputs)
        return np.stack(
            [
                self.outputs(outputs, v) @ np.linalg.solve(v**2 * self.m + v * self.c + self.k, b)
                for v in s
            ],
            -1,
        )

    def system(self):
        """A and the inverse mass, over (q, q')."""
        n = self.size
        inverse = np.linalg.inv(self.m)
        return np.block(
            [[np.zeros((n, n)), np.eye(n)], [-inverse @ self.k, -inverse @ self.c]]
        ), inverse


def error(found, true):
    """Largest difference of two `(p, m, k)` responses, channel by channel; what is nothing beside
    its row and column is not asked."""
    size = np.abs(true)
    rows = size.max(1, keepdims=True)
    columns = size.max(0, keepdims=True)
    top = size.max((0, 1), keepdims=True)
    return float(np.max(np.abs(found - true) / np.maximum(size, 1e-3 * rows * columns / top)))


# -- craft -----------------------------------------------------------------------------------------
def tube(length, diameter=0.05, wall=0.002, density=1600.0, young=7e10):
    return {
        "length": length,
        "section": {"shape": "tube", "outer_diameter": diameter, "wall": wall},
        "material": {"youngs_modulus": young, "density": density, "poissons_ratio": 0.3},
    }


def panel(length, xy=6e4, xz=900.0, torsion=600.0):
    return {
        "length": length,
        "section": {
            "shape": "equivalent",
            "bending_stiffness_xy": xy,
            "bending_stiffness_xz": xz,
            "torsion_stiffness": torsion,
            "linear_mass": 4.0,
            "polar_inertia": 1.2,
        },
    }


def spec(name, segments, modes, ratio=0.005, **more):
    return {
        "name": name,
        "segment": segments,
        "damping": {"ratio": ratio},
        "root": {"target": "clamped"},
        "modes": modes,
        **more,
    }


def turned(*vector):
    return Rotation.from_rotvec(vector).as_matrix()


LEFT = turned(0.0, 0.0, np.pi / 2)
RIGHT = turned(0.0, 0.0, -np.pi / 2)
PYRAMID = {
    f"wheel{i + 1}": {
        "at": (0.2 * a, 0.2 * b, -0.3),
        "axis": (a, b, 1.0),
        "mass": 5.0,
        "inertia": (0.05, 0.03),
        "rate": rate,
    }
    for i, ((a, b), rate) in enumerate(
        zip(product((1, -1), repeat=2), (400.0, 250.0, -120.0, 310.0), strict=True)
    )
}
ARRAY = {"xy": 2, "xz": 3, "torsion": 2}
BOOM = {"xy": 3, "xz": 3}


def hub(mass=400.0, com=(0.01, 0.02, -0.03), inertia=(180.0, 150.0, 120.0), skew=1.0):
    full = np.diag(inertia) + skew * np.array([[0.0, 1.5, -2.0], [1.5, 0.0, 0.7], [-2.0, 0.7, 0.0]])
    return {"mass": mass, "com": np.array(com), "inertia": full}


def array(name, on, at=(0.1, 0.0, 0.0), turn=EYE, **more):
    return {
        "spec": spec(name, [tube(1.0), panel(4.0)], ARRAY, **more),
        "on": on,
        "at": at,
        "turn": turn,
    }


def boom(name, at, turn, on=None, lump=1.0, **more):
    lumps = [{"x": 5.0, "mass": lump, "inertia": [0.02, 0.02, 0.02]}]
    return {
        "spec": spec(name, [tube(5.0, 0.04, 0.001)], BOOM, lump=lumps, **more),
        "on": on,
        "at": at,
        "turn": turn,
    }


UNIT = (np.array([0.3, -0.2, 0.4]), turned(0.3, -0.2, 0.5))

CRAFTS = {
    "four wheels, two drives with arrays, a boom": {
        "hub": hub(),
        "unit": UNIT,
        "wheels": PYRAMID,
        "drives": {
            "left_drive": {
                "at": (0.0, 0.6, 0.1),
                "turn": LEFT,
                "mass": 4.0,
                "inertia": (0.3, 0.2, 0.2),
            },
            "right_drive": {
                "at": (0.0, -0.6, 0.1),
                "turn": RIGHT,
                "mass": 4.0,
                "inertia": (0.3, 0.2, 0.2),
            },
        },
        "appendages": {
            "left": array("left_array", "left_drive"),
            "right": array("right_array", "right_drive"),
            "top": boom("boom", (0.0, 0.0, 0.7), turned(0.0, -np.pi / 2, 0.0)),
        },
    },
    "one undamped boom": {
        # its planes do not couple
        "hub": hub(60.0, (0.0, 0.0, 0.0), (20.0, 25.0, 30.0), 0.0),
        "unit": UNIT,
        "appendages": {"mount": boom("boom", (0.4, 0.0, 0.0), EYE, ratio=0.0)},
    },
    "a tilted bus with two booms": {
        "hub": hub(200.0, (0.05, -0.1, 0.08)),
        "unit": UNIT,
        "attitude": turned(0.4, -1.1, 0.7),
        "wheels": {
            "bias": {
                "at": (0.1, 0.0, 0.2),
                "axis": (0.2, 1.0, -0.1),
                "mass": 8.0,
                "inertia": (0.2, 0.12),
                "rate": 500.0,
                "gear": 0.2,
            }
        },
        "appendages": {
            "up": boom("mast", (0.1, 0.2, 0.6), turned(0.2, -1.4, 0.1)),
            "down": boom("rod", (-0.2, 0.0, -0.6), turned(0.0, 1.3, 0.4), lump=3.0, ratio=0.01),
        },
    },
    "a sprung drive and worn bearings": {
        "hub": hub(900.0),
        "unit": UNIT,
        "wheels": {
            "spin": {
                "at": (0.0, 0.1, 0.0),
                "axis": (1.0, 0.1, 0.0),
                "mass": 6.0,
                "inertia": (0.07, 0.04),
                "rate": -300.0,
                "damping": 2e-3,
            }
        },
        "drives": {
            "drive": {
                "at": (0.0, 0.9, 0.0),
                "turn": LEFT,
                "mass": 8.0,
                "inertia": (0.4, 0.3, 0.3),
                "stiffness": 4000.0,
                "damping": 40.0,
            }
        },
        "appendages": {"panel": array("array", "drive", (0.4, 0.0, 0.0))},
    },
    "a boom on a damped drive": {
        "hub": hub(100.0, (0.0, 0.1, 0.0), (40.0, 50.0, 60.0)),
        "unit": UNIT,
        "wheels": {
            f"w{i}": {
                "at": (0.0, 0.0, 0.1 * i),
                "axis": axis,
                "mass": 3.0,
                "inertia": (0.02, 0.012),
                "rate": 200.0 * i,
            }
            for i, axis in enumerate(((1, 0, 0), (0, 1, 0), (0, 0, 1)))
        },
        "drives": {
            "drive": {
                "at": (0.5, 0.0, 0.0),
                "turn": turned(0.1, 0.2, 0.3),
                "mass": 2.0,
                "inertia": (0.1, 0.1, 0.1),
                "damping": 3.0,
            }
        },
        "appendages": {"arm": boom("arm", (0.1, 0.0, 0.1), turned(0.0, -0.8, 0.0), on="drive")},
    },
}


# -- what the tests share --------------------------------------------------------------------------
@cache
def embedded(name, step=0.01, retime=None):
    """The craft with its appendages as the package embeds them."""
    craft = CRAFTS[name]
    with tempfile.TemporaryDirectory() as folder:
        for place, a in craft["appendages"].items():
            (Path(folder) / f"{place}.toml").write_text(toml(a["spec"]))
        (Path(folder) / "craft.xml").write_text(text(craft, step))
        return bc.embed(
            Path(folder) / "craft.xml",
            {n: Path(folder) / f"{n}.toml" for n in craft["appendages"]},
            retime=retime,
        )


def motors(craft):
    return [f"{name}_motor" for name in [*craft.get("wheels", {}), *craft.get("drives", {})]]


def wheel_rates(craft):
    return {name: wheel.get("rate", 0.0) for name, wheel in craft.get("wheels", {}).items()}


def kept(appendage):
    return appendage["spec"]["modes"]


def band(craft):
    """Lowest of the last kept frequencies of the appendages [rad/s]."""
    return min(Truth.modes(a["spec"], kept(a))[0].max() for a in craft["appendages"].values())
