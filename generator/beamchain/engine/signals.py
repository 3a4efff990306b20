"""Inputs and outputs of a linear model by name: actuators, torques, forces, wrenches;
sensors, attitude, rate, motions."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from beamchain.checks import unknown
from beamchain.engine.library import mujoco
from beamchain.engine.operating_point import OperatingPoint, base_body
from beamchain.errors import InputError
from beamchain.ports.motions import Array

AXES = ("x", "y", "z")
DYNAMICS = ("NONE", "INTEGRATOR", "FILTER", "FILTEREXACT")  # of actuators, those that are linear
NOT_SMOOTH = (
    "TOUCH RANGEFINDER JOINTLIMITPOS JOINTLIMITVEL JOINTLIMITFRC TENDONLIMITPOS TENDONLIMITVEL "
    "TENDONLIMITFRC GEOMDIST GEOMNORMAL GEOMFROMTO INSIDESITE CONTACT TACTILE CLOCK USER PLUGIN "
    "E_POTENTIAL E_KINETIC"
)
QUATERNIONS = ("FRAMEQUAT", "BALLQUAT")
AT_SITES = ("ACCELEROMETER", "VELOCIMETER", "GYRO", "FORCE", "TORQUE", "MAGNETOMETER")
OF_BALLS = ("BALLQUAT", "BALLANGVEL")
OF_CHAINS = (
    "FORCE",
    "TORQUE",
    "SUBTREECOM",
    "SUBTREELINVEL",
    "SUBTREEANGMOM",
    "TENDONPOS",
    "TENDONVEL",
)
UNITS = {
    "rad": "JOINTPOS FRAMEQUAT BALLQUAT",
    "rad/s": "GYRO JOINTVEL BALLANGVEL FRAMEANGVEL",
    "rad/s^2": "FRAMEANGACC",
    "m": "FRAMEPOS SUBTREECOM",
    "m/s": "VELOCIMETER FRAMELINVEL SUBTREELINVEL",
    "m/s^2": "ACCELEROMETER FRAMELINACC",
    "N": "FORCE",
    "N m": "TORQUE ACTUATORFRC JOINTACTFRC",
    "N m s": "SUBTREEANGMOM",
    "T": "MAGNETOMETER",
}
Reader = Callable[["mujoco.MjData"], Array]  # of outputs


@dataclass(frozen=True, eq=False)
class Input:
    """One input: the control of an actuator by its number, a part of a wrench on a body, or several
    of them together.

    `wrench` `(6,)`: force and torque at the body's mass centre in world axes, as in `xfrc_applied`;
    None: an actuator. `centre`: the force acts at the mass centre, wherever that is. `parts`: what
    a combination drives, each with its weight; it has nothing of its own.
    """

    label: str
    unit: str
    actuator: int = -1
    body: int = 0
    wrench: Array | None = None
    centre: bool = False
    parts: "tuple[tuple[float, Input], ...]" = ()

    @property
    def simple(self) -> "list[tuple[float, Input]]":
        """What it drives, each with its weight; no combinations among them."""
        if not self.parts:
            return [(1.0, self)]
        return [
            (weight * deep, signal) for weight, part in self.parts for deep, signal in part.simple
        ]

    def apply(self, data: "mujoco.MjData", value: float) -> None:
        """Add to the input, all others untouched."""
        for weight, signal in self.simple:
            if signal.wrench is None:
                data.ctrl[signal.actuator] += weight * value
            else:
                data.xfrc_applied[signal.body] += weight * value * signal.wrench


@dataclass(frozen=True, eq=False)
class Output:
    """One or more outputs, read from data that `mj_forward` has seen, as many numbers as labels;
    only their slopes count.

    `local`: what is read does not depend on what hangs on the craft, given the craft's own motion.
    """

    labels: tuple[str, ...]
    units: tuple[str, ...]
    read: Reader
    local: bool = True


def base(model: "mujoco.MjModel") -> int:
    """The body whose attitude counts: of the bodies that move by themselves,
    the one that carries most."""
    tops = Counter(base_body(model, int(model.dof_bodyid[i])) for i in range(model.nv))
    if not tops:
        raise InputError(
            "the model has no degree of freedom; give the spacecraft's body a <freejoint/>."
        )
    return tops.most_common(1)[0][0]


def usual_inputs(model: "mujoco.MjModel") -> list[str]:
    """All actuators, a torque on the base where there is none."""
    name = model.body(base(model)).name
    if not actuator_names(model) and not name:
        raise InputError(
            "the spacecraft's base body has no name, by which a torque on it could be asked for; "
            'write <body name="bus">.'
        )
    return actuator_names(model) or [f"torque:{name}"]


def named_inputs(
    model: "mujoco.MjModel", data: "mujoco.MjData", name: str
) -> tuple[str, list[Input]]:
    """The place and the inputs of a name, `data` at the point."""
    kind, _, place = name.partition(":")
    if kind in ("torque", "force", "wrench") and place:
        return place, _wrench_inputs(model, data, kind, place)
    actuators = actuator_names(model)
    if name not in actuators:
        raise unknown(
            "actuator of inputs",
            name,
            actuators,
            "Or give torque:BODY, force:BODY, wrench:SITE.",
        )
    number = actuators.index(name)
    if int(model.actuator_dyntype[number]) not in [
        int(getattr(mujoco.mjtDyn, f"mjDYN_{d}")) for d in DYNAMICS
    ]:
        raise InputError(
            f"actuator {name!r} of inputs has an activation that is not linear; only "
            "dyntype none, integrator, filter and filterexact are; leave it out, or change "
            "its dyntype."
        )
    return name, [Input(name, _unit(model, number), number)]


def _wrench_inputs(
    model: "mujoco.MjModel", data: "mujoco.MjData", kind: str, place: str
) -> list[Input]:
    """The inputs of `"torque:BODY"`, `"force:BODY"` or `"wrench:SITE"`."""
    what = "site" if kind == "wrench" else "body"
    number = number_of(model, what, place, f"{what} of inputs {kind!r}")
    if what == "site":
        body = int(model.site_bodyid[number])
        axes = data.site_xmat[number].reshape(3, 3)
        arm = data.site_xpos[number] - data.xipos[body]
    else:
        body = number
        axes = data.xmat[number].reshape(3, 3)
        arm = np.zeros(3)
    if not model.body_weldid[body]:
        raise InputError(f"inputs: {kind}:{place} pushes what does not move; name another body.")
    out: list[Input] = []
    if kind != "torque":
        for axis, line in zip(AXES, axes.T, strict=True):
            moment = np.asarray(np.cross(arm, line), dtype=np.float64)
            wrench = np.concatenate([line, moment])
            centre = kind == "force"
            out.append(Input(f"force_{axis}", "N", body=body, wrench=wrench, centre=centre))
    if kind != "force":
        for axis, line in zip(AXES, axes.T, strict=True):
            wrench = np.concatenate([np.zeros(3), line])
            out.append(Input(f"torque_{axis}", "N m", body=body, wrench=wrench))
    return out


def named_output(point: OperatingPoint, data: "mujoco.MjData", name: str) -> tuple[str, Output]:
    """The place and the output of a name, `data` at the point."""
    model = point.model
    kind, _, place = name.partition(":")
    if name == "attitude":
        return place, _attitude(data, base(model))
    if name == "rate":
        return place, _rate(base(model))
    if kind == "motion" and place:
        return place, _motion(data, number_of(model, "site", place, "site of outputs 'motion'"))
    cure = "Or give attitude, rate, motion:SITE."
    return place, _sensor(point, data, number_of(model, "sensor", name, "sensor of outputs", cure))


def sensor_axes(model: "mujoco.MjModel", data: "mujoco.MjData", number: int) -> Array | None:
    """`(3, 3)` in the columns the axes in world axes that a sensor of three numbers, or of a
    quaternion, is told in; None where it has no three axes."""
    kind = _kind(model, number)
    if kind not in QUATERNIONS and int(model.sensor_dim[number]) != 3:
        return None
    where = int(model.sensor_objid[number])
    if kind in AT_SITES:
        return data.site_xmat[where].reshape(3, 3).copy()
    if kind in OF_BALLS:
        return data.xmat[int(model.jnt_bodyid[where])].reshape(3, 3).copy()
    if kind == "FRAMEQUAT":
        return _frame(data, int(model.sensor_objtype[number]), where)
    reference = int(model.sensor_refid[number])
    if reference >= 0:
        return _frame(data, int(model.sensor_reftype[number]), reference)
    return np.eye(3)


def _frame(data: "mujoco.MjData", kind: int, number: int) -> Array:
    """Axes of a body, geom, site or camera, in the columns."""
    frames: dict[int, Array] = {
        int(mujoco.mjtObj.mjOBJ_BODY): data.ximat,
        int(mujoco.mjtObj.mjOBJ_XBODY): data.xmat,
        int(mujoco.mjtObj.mjOBJ_GEOM): data.geom_xmat,
        int(mujoco.mjtObj.mjOBJ_SITE): data.site_xmat,
        int(mujoco.mjtObj.mjOBJ_CAMERA): data.cam_xmat,
    }
    return frames[kind][number].reshape(3, 3).copy()


def control_names(labels: Sequence[str]) -> list[str]:
    """Labels as python-control takes them for signals, all different:
    a point would stand between system and signal."""
    out: list[str] = []
    taken = {label for label in labels if "." not in label}
    for label in labels:
        name = label.replace(".", "_")
        while "." in label and name in taken:
            name += "_"
        taken.add(name)
        out.append(name)
    return out


def actuator_names(model: "mujoco.MjModel") -> list[str]:
    """Names of the actuators, numbers where they have none."""
    return [str(model.actuator(i).name) or f"actuator {i}" for i in range(model.nu)]


def _unit(model: "mujoco.MjModel", number: int) -> str:
    """Unit of an actuator's control: of a force, or of the set point of a servo;
    empty where MuJoCo does not say."""
    kind = int(model.actuator_trntype[number])
    gain = model.actuator_gainprm[number, 0]
    stiffness = model.actuator_biasprm[number, 1]
    damping = model.actuator_biasprm[number, 2]
    target = int(model.actuator_trnid[number, 0])
    gear = model.actuator_gear[number]
    if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
        turns = model.jnt_type[target] in (
            int(mujoco.mjtJoint.mjJNT_HINGE),
            int(mujoco.mjtJoint.mjJNT_BALL),
        )
        straight = model.jnt_type[target] == int(mujoco.mjtJoint.mjJNT_SLIDE)
    else:
        straight, turns = (
            kind == int(mujoco.mjtTrn.mjTRN_SITE) and not gear[part].any()
            for part in (slice(3, 6), slice(3))
        )
    if straight == turns or int(model.actuator_dyntype[number]) == int(
        mujoco.mjtDyn.mjDYN_INTEGRATOR
    ):
        return ""
    if int(model.actuator_biastype[number]) == int(mujoco.mjtBias.mjBIAS_NONE):
        return "" if gain != 1.0 else "N m" if turns else "N"
    unit = "rad" if turns else "m"
    if stiffness == -gain != 0.0:
        return unit
    return f"{unit}/s" if stiffness == 0.0 and damping == -gain != 0.0 else ""


def number_of(model: "mujoco.MjModel", kind: str, name: str, field: str, cure: str = "") -> int:
    """Number of a body, site or sensor; `field` is what asks for it."""
    count = {"body": model.nbody, "site": model.nsite, "sensor": model.nsensor}[kind]
    names = [str(getattr(model, kind)(i).name) for i in range(count)]
    if name not in names or not name:
        raise unknown(field, name, names, cure)
    return names.index(name)


# What is read stands in functions of the module, so that plants can be pickled.
def _small_turn(axes: Array, now: Array) -> Array:
    """The small rotation vector from `axes` to `now`, in `axes`; its slope at none is exact."""
    turn = axes.T @ now
    twice = [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    return np.array(twice) / 2.0


def _read_attitude(axes: Array, body: int, data: "mujoco.MjData") -> Array:
    return _small_turn(axes, data.xmat[body].reshape(3, 3))


def _read_rate(body: int, data: "mujoco.MjData") -> Array:
    return np.asarray(data.xmat[body].reshape(3, 3).T @ data.cvel[body][:3], dtype=np.float64)


def _read_motion(start: Array, axes: Array, site: int, data: "mujoco.MjData") -> Array:
    displacement = axes.T @ (data.site_xpos[site] - start)
    return np.append(displacement, _small_turn(axes, data.site_xmat[site].reshape(3, 3)))


def _read_sensor(part: slice, start: Array, data: "mujoco.MjData") -> Array:
    return np.asarray(data.sensordata[part] - start, dtype=np.float64)


def _read_quaternion(part: slice, start: Array, data: "mujoco.MjData") -> Array:
    out = np.zeros(3)
    mujoco.mju_subQuat(out, data.sensordata[part], start)
    return out


def _attitude(data: "mujoco.MjData", body: int) -> Output:
    axes = data.xmat[body].reshape(3, 3).copy()
    return Output(
        tuple(f"attitude_{axis}" for axis in AXES),
        ("rad",) * 3,
        partial(_read_attitude, axes, body),
    )


def _rate(body: int) -> Output:
    return Output(tuple(f"rate_{axis}" for axis in AXES), ("rad/s",) * 3, partial(_read_rate, body))


def _motion(data: "mujoco.MjData", site: int) -> Output:
    start = data.site_xpos[site].copy()
    axes = data.site_xmat[site].reshape(3, 3).copy()
    labels = tuple(f"{part}_{axis}" for part in ("displacement", "rotation") for axis in AXES)
    return Output(labels, ("m",) * 3 + ("rad",) * 3, partial(_read_motion, start, axes, site))


def _kind(model: "mujoco.MjModel", number: int) -> str:
    """Type of a sensor in MuJoCo's words, `mjSENS_` left off."""
    kinds = {
        int(getattr(mujoco.mjtSensor, k)): k[7:]
        for k in dir(mujoco.mjtSensor)
        if k.startswith("mjSENS_")
    }
    return kinds[int(model.sensor_type[number])]


def _sensor(point: OperatingPoint, data: "mujoco.MjData", number: int) -> Output:
    model = point.model
    name = str(model.sensor(number).name)
    kind = _kind(model, number)
    first = model.sensor_adr[number]
    size = int(model.sensor_dim[number])
    part = slice(first, first + size)
    cutoff = float(model.sensor_cutoff[number])
    start = data.sensordata[part].copy()
    why = f"a {kind.lower()} sensor has none" if kind in NOT_SMOOTH.split() else ""
    if not why and cutoff > 0.0 and np.any(np.abs(start) >= cutoff):
        why = f"it is at its cutoff, {cutoff:g}"
    if why:
        raise InputError(
            f"sensor {name!r} of outputs has no linear part here: {why}; leave it out of outputs."
        )
    model.sensor_cutoff[number] = 0.0  # of a copy
    unit = next((unit for unit, those in UNITS.items() if kind in those.split()), "")
    if (
        kind in ("JOINTPOS", "JOINTVEL")
        and int(model.jnt_type[int(model.sensor_objid[number])]) == 2
    ):
        unit = unit.replace("rad", "m")

    read = partial(_read_quaternion if kind in QUATERNIONS else _read_sensor, part, start)
    count = 3 if kind in QUATERNIONS else size
    labels = (
        [f"{name}_{AXES[i] if count == 3 else i}" for i in range(count)] if count > 1 else [name]
    )
    return Output(tuple(labels), (unit,) * count, read, kind not in OF_CHAINS)
