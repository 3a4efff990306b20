"""Inputs and outputs of a linear model by name: actuators, torques, forces, wrenches;
sensors, attitude, rate, motions."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from beamchain.checks import list_of_names, unknown
from beamchain.engine.library import mujoco
from beamchain.engine.operating_point import OperatingPoint, base_body
from beamchain.errors import InputError
from beamchain.ports.motions import Array

Names = Sequence[str] | None  # of signals; None: the usual ones
AXES = ("x", "y", "z")
DYNAMICS = ("NONE", "INTEGRATOR", "FILTER", "FILTEREXACT")  # of actuators, those that are linear
NOT_SMOOTH = (
    "TOUCH RANGEFINDER JOINTLIMITPOS JOINTLIMITVEL JOINTLIMITFRC TENDONLIMITPOS TENDONLIMITVEL "
    "TENDONLIMITFRC GEOMDIST GEOMNORMAL GEOMFROMTO INSIDESITE CONTACT TACTILE CLOCK USER PLUGIN "
    "E_POTENTIAL E_KINETIC"
)
QUATERNIONS = ("FRAMEQUAT", "BALLQUAT")
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


@dataclass(frozen=True, eq=False)
class Input:
    """One input: the control of an actuator by its number, or a part of a wrench on a body.

    `wrench` `(6,)`: force and torque at the body's mass centre in world axes, as in `xfrc_applied`;
    None: an actuator. `centre`: the force acts at the mass centre, wherever that is.
    """

    label: str
    unit: str
    actuator: int = -1
    body: int = 0
    wrench: Array | None = None
    centre: bool = False

    def apply(self, data: "mujoco.MjData", value: float) -> None:
        """Add to the input, all others untouched."""
        if self.wrench is None:
            data.ctrl[self.actuator] += value
        else:
            data.xfrc_applied[self.body] += value * self.wrench


@dataclass(frozen=True, eq=False)
class Output:
    """One or more outputs, read from data that `mj_forward` has seen, as many numbers as labels;
    only their slopes count.

    `local`: what is read does not depend on what hangs on the craft, given the craft's own motion.
    """

    labels: tuple[str, ...]
    units: tuple[str, ...]
    read: "Callable[[mujoco.MjData], Array]"
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


def inputs_of(point: OperatingPoint, names: Names) -> list[Input]:
    """The inputs that `names` ask for; all actuators where left out,
    a torque on the base where there is none."""
    model = point.model
    data = point.data()
    actuators = actuator_names(model)
    groups: list[tuple[str, list[Input]]] = []
    usual = actuators or [f"torque:{model.body(base(model)).name}"] if names is None else names
    for name in _checked_names("inputs", usual):
        kind, _, place = name.partition(":")
        if kind in ("torque", "force", "wrench") and place:
            group = _wrench_inputs(model, data, kind, place)
        else:
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
            group = [Input(name, _unit(model, number), number)]
            place = name
        groups.append((place, group))
    uses = Counter(signal.label for _, group in groups for signal in group)
    return [
        replace(signal, label=f"{signal.label}_{place}" if uses[signal.label] > 1 else signal.label)
        for place, group in groups
        for signal in group
    ]


def _wrench_inputs(
    model: "mujoco.MjModel", data: "mujoco.MjData", kind: str, place: str
) -> list[Input]:
    """The inputs of `"torque:BODY"`, `"force:BODY"` or `"wrench:SITE"`."""
    what = "site" if kind == "wrench" else "body"
    number = _number_of(model, what, place, f"{what} of inputs {kind!r}")
    if what == "site":
        body = int(model.site_bodyid[number])
        axes = data.site_xmat[number].reshape(3, 3)
        arm = data.site_xpos[number] - data.xipos[body]
    else:
        body = number
        axes = data.xmat[number].reshape(3, 3)
        arm = np.zeros(3)
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


def outputs_of(point: OperatingPoint, names: Names) -> list[Output]:
    """The outputs that `names` ask for; attitude and rate of the base where left out."""
    model = point.model
    data = point.data()
    hub = base(model)
    out = list[tuple[str, Output]]()
    for name in _checked_names("outputs", ["attitude", "rate"] if names is None else names):
        kind, _, place = name.partition(":")
        if name == "attitude":
            output = _attitude(data, hub)
        elif name == "rate":
            output = _rate(hub)
        elif kind == "motion" and place:
            output = _motion(data, _number_of(model, "site", place, "site of outputs 'motion'"))
        else:
            cure = "Or give attitude, rate, motion:SITE."
            output = _sensor(
                point, data, _number_of(model, "sensor", name, "sensor of outputs", cure)
            )
        out.append((place, output))
    uses = Counter(label for _, output in out for label in output.labels)
    return [
        replace(
            output,
            labels=tuple(
                f"{label}_{place}" if uses[label] > 1 and place else label
                for label in output.labels
            ),
        )
        for place, output in out
    ]


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


def _number_of(model: "mujoco.MjModel", kind: str, name: str, field: str, cure: str = "") -> int:
    count = {"body": model.nbody, "site": model.nsite, "sensor": model.nsensor}[kind]
    names = [str(getattr(model, kind)(i).name) for i in range(count)]
    if name not in names or not name:
        raise unknown(field, name, names, cure)
    return names.index(name)


def _checked_names(field: str, names: Sequence[str]) -> list[str]:
    names = list_of_names(field, names)
    if not names:
        raise InputError(f'{field} is empty; write {field}=["..."].')
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise InputError(f"{field} names {twice[0]!r} twice; name each signal once.")
    return names


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


def _sensor(point: OperatingPoint, data: "mujoco.MjData", number: int) -> Output:
    model = point.model
    name = str(model.sensor(number).name)
    kinds = {
        int(getattr(mujoco.mjtSensor, k)): k[7:]
        for k in dir(mujoco.mjtSensor)
        if k.startswith("mjSENS_")
    }
    kind = kinds[int(model.sensor_type[number])]
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
