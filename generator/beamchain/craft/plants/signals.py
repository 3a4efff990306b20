"""Inputs and outputs of a plant by name: actuators, torques, forces, wrenches; sensors, attitude, rate, motions."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamchain.checks import unknown
from beamchain.craft.error import base_body
from beamchain.craft.plants.operating_point import OperatingPoint
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.ports.motions import Array

Names = Sequence[str] | None  # of signals; None: the usual ones
AXES = ("x", "y", "z")
DYNAMICS = ("NONE", "INTEGRATOR", "FILTER", "FILTEREXACT")  # of actuators, those that are linear
NOT_SMOOTH = (
    "TOUCH RANGEFINDER JOINTLIMITPOS JOINTLIMITVEL JOINTLIMITFRC TENDONLIMITPOS TENDONLIMITVEL TENDONLIMITFRC GEOMDIST "
    "GEOMNORMAL GEOMFROMTO INSIDESITE CONTACT TACTILE CLOCK USER PLUGIN E_POTENTIAL E_KINETIC"
)
QUATERNIONS = ("FRAMEQUAT", "BALLQUAT")
OF_CHAINS = ("FORCE", "TORQUE", "SUBTREECOM", "SUBTREELINVEL", "SUBTREEANGMOM", "TENDONPOS", "TENDONVEL")
UNITS = {
    "rad": "JOINTPOS FRAMEQUAT BALLQUAT", "rad/s": "GYRO JOINTVEL BALLANGVEL FRAMEANGVEL", "rad/s^2": "FRAMEANGACC",
    "m": "FRAMEPOS SUBTREECOM", "m/s": "VELOCIMETER FRAMELINVEL SUBTREELINVEL", "m/s^2": "ACCELEROMETER FRAMELINACC",
    "N": "FORCE", "N m": "TORQUE ACTUATORFRC JOINTACTFRC", "N m s": "SUBTREEANGMOM", "T": "MAGNETOMETER",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Input:
    """One input: the control of an actuator by its number, or a part of a wrench on a body.

    `wrench` `(6,)`: force and torque at the body's mass centre in world axes, as in `xfrc_applied`; None: an actuator.
    `centre`: the force acts at the mass centre, wherever that is.
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
    """One or more outputs, read from data that `mj_forward` has seen, as many numbers as labels; only their slopes count.

    `local`: what is read does not depend on what hangs on the craft, given the craft's own motion.
    """

    labels: tuple[str, ...]
    units: tuple[str, ...]
    read: "Callable[[mujoco.MjData], Array]"
    local: bool = True


def base(model: "mujoco.MjModel") -> int:
    """The body whose attitude counts: of the bodies that move by themselves, the one that carries most."""
    tops = Counter(base_body(model, int(model.dof_bodyid[i])) for i in range(model.nv))
    if not tops:
        raise InputError("the model has no degree of freedom; give the spacecraft's body a <freejoint/>.")
    return tops.most_common(1)[0][0]


def inputs_of(point: OperatingPoint, names: Names) -> list[Input]:
    """The inputs that `names` ask for; all actuators where left out, a torque on the base where there is none."""
    model, data = point.model, point.data()
    actuators = actuator_names(model)
    groups: list[tuple[str, list[Input]]] = []
    usual = actuators or [f"torque:{model.body(base(model)).name}"] if names is None else names
    for name in _listed("inputs", usual):
        kind, _, place = name.partition(":")
        if kind in ("torque", "force", "wrench") and place:
            what = "site" if kind == "wrench" else "body"
            i = _named(model, what, place, f"{what} of inputs {kind!r}")
            body = int(model.site_bodyid[i]) if what == "site" else i
            axes = (data.site_xmat if what == "site" else data.xmat)[i].reshape(3, 3)
            arm = (data.site_xpos[i] if what == "site" else data.xipos[i]) - data.xipos[body]
            mine = list[Input]()
            for part in ("force", "torque") if kind == "wrench" else (kind,):
                for axis, line in zip(AXES, axes.T, strict=True):
                    wrench = [line, np.cross(arm, line)] if part == "force" else [np.zeros(3), line]
                    unit = "N" if part == "force" else "N m"
                    mine.append(Input(f"{part}_{axis}", unit, -1, body, np.concatenate(wrench), kind == "force"))
        else:
            if name not in actuators:
                raise unknown("actuator of inputs", name, actuators, "Or give torque:BODY, force:BODY, wrench:SITE.")
            number = actuators.index(name)
            if int(model.actuator_dyntype[number]) not in [int(getattr(mujoco.mjtDyn, f"mjDYN_{d}")) for d in DYNAMICS]:
                raise InputError(
                    f"actuator {name!r} of inputs has an activation that is not linear; only dyntype none, integrator, filter "
                    "and filterexact are; leave it out, or change its dyntype."
                )
            mine, place = [Input(name, _unit(model, number), number)], name
        groups.append((place, mine))
    said = Counter(i.label for _, mine in groups for i in mine)
    return [
        replace(i, label=f"{i.label}_{place}" if said[i.label] > 1 else i.label) for place, mine in groups for i in mine
    ]


def outputs_of(point: OperatingPoint, names: Names) -> list[Output]:
    """The outputs that `names` ask for; attitude and rate of the base where left out."""
    model, data = point.model, point.data()
    hub, out = base(model), list[tuple[str, Output]]()
    for name in _listed("outputs", ["attitude", "rate"] if names is None else names):
        kind, _, place = name.partition(":")
        if name in ("attitude", "rate"):
            one = _attitude(data, hub) if name == "attitude" else _rate(hub)
        elif kind == "motion" and place:
            one = _motion(data, _named(model, "site", place, "site of outputs 'motion'"))
        else:
            number = _named(model, "sensor", name, "sensor of outputs", "Or give attitude, rate, motion:SITE.")
            one = _sensor(point, data, number)
        out.append((place, one))
    said = Counter(label for _, one in out for label in one.labels)
    return [
        replace(one, labels=tuple(f"{label}_{place}" if said[label] > 1 and place else label for label in one.labels))
        for place, one in out
    ]


def actuator_names(model: "mujoco.MjModel") -> list[str]:
    """Names of the actuators, numbers where they have none."""
    return [str(model.actuator(i).name) or f"actuator {i}" for i in range(model.nu)]


def _unit(model: "mujoco.MjModel", number: int) -> str:
    """Unit of an actuator's control: of a force, or of the set point of a servo; empty where MuJoCo does not say."""
    kinds, (gain, *_), (_, stiffness, damping, *_) = (
        model.actuator_trntype, model.actuator_gainprm[number], model.actuator_biasprm[number],
    )  # fmt: skip
    kind, target, gear = int(kinds[number]), int(model.actuator_trnid[number, 0]), model.actuator_gear[number]
    if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
        turns = model.jnt_type[target] in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_BALL))
        straight = model.jnt_type[target] == int(mujoco.mjtJoint.mjJNT_SLIDE)
    else:
        straight, turns = (
            kind == int(mujoco.mjtTrn.mjTRN_SITE) and not gear[part].any() for part in (slice(3, 6), slice(3))
        )
    if straight == turns or int(model.actuator_dyntype[number]) == int(mujoco.mjtDyn.mjDYN_INTEGRATOR):
        return ""
    if int(model.actuator_biastype[number]) == int(mujoco.mjtBias.mjBIAS_NONE):
        return "" if gain != 1.0 else "N m" if turns else "N"
    unit = "rad" if turns else "m"
    return unit if stiffness == -gain != 0.0 else f"{unit}/s" if stiffness == 0.0 and damping == -gain != 0.0 else ""


def _named(model: "mujoco.MjModel", kind: str, name: str, field: str, cure: str = "") -> int:
    count = {"body": model.nbody, "site": model.nsite, "sensor": model.nsensor}[kind]
    names = [str(getattr(model, kind)(i).name) for i in range(count)]
    if name not in names or not name:
        raise unknown(field, name, names, cure)
    return names.index(name)


def _listed(field: str, names: Sequence[str]) -> list[str]:
    if isinstance(names, str) or not all(isinstance(name, str) for name in names) or not names:
        raise InputError(f'{field} = {names!r:.60} must be a list of names; write {field}=["..."].')
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise InputError(f"{field} names {twice[0]!r} twice; name each signal once.")
    return list(names)


def _turn(axes: Array, now: "Callable[[mujoco.MjData], Array]") -> "Callable[[mujoco.MjData], Array]":
    """Reads the small rotation vector from `axes`, in them; its slope at none is exact."""

    def read(data: "mujoco.MjData") -> Array:
        turn = axes.T @ now(data)
        return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2.0

    return read


def _attitude(data: "mujoco.MjData", body: int) -> Output:
    turn = _turn(data.xmat[body].reshape(3, 3).copy(), lambda data: data.xmat[body].reshape(3, 3))
    return Output(tuple(f"attitude_{axis}" for axis in AXES), ("rad",) * 3, turn)


def _rate(body: int) -> Output:
    def read(data: "mujoco.MjData") -> Array:
        return np.asarray(data.xmat[body].reshape(3, 3).T @ data.cvel[body][:3], dtype=np.float64)

    return Output(tuple(f"rate_{axis}" for axis in AXES), ("rad/s",) * 3, read)


def _motion(data: "mujoco.MjData", site: int) -> Output:
    start, axes = data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()
    turn = _turn(axes, lambda data: data.site_xmat[site].reshape(3, 3))
    labels = tuple(f"{part}_{axis}" for part in ("displacement", "rotation") for axis in AXES)
    units = ("m",) * 3 + ("rad",) * 3
    return Output(labels, units, lambda data: np.append(axes.T @ (data.site_xpos[site] - start), turn(data)))


def _sensor(point: OperatingPoint, data: "mujoco.MjData", number: int) -> Output:
    model, name = point.model, str(point.model.sensor(number).name)
    kinds = {int(getattr(mujoco.mjtSensor, k)): k[7:] for k in dir(mujoco.mjtSensor) if k.startswith("mjSENS_")}
    kind, first, size = kinds[int(model.sensor_type[number])], model.sensor_adr[number], int(model.sensor_dim[number])
    mine, cutoff = slice(first, first + size), float(model.sensor_cutoff[number])
    start = data.sensordata[mine].copy()
    why = f"a {kind.lower()} sensor has none" if kind in NOT_SMOOTH.split() else ""
    if not why and cutoff > 0.0 and np.any(np.abs(start) >= cutoff):
        why = f"it is at its cutoff, {cutoff:g}"
    if why:
        raise InputError(f"sensor {name!r} of outputs has no linear part here: {why}; leave it out of outputs.")
    model.sensor_cutoff[number] = 0.0  # of a copy
    unit = next((unit for unit, those in UNITS.items() if kind in those.split()), "")
    if kind in ("JOINTPOS", "JOINTVEL") and int(model.jnt_type[int(model.sensor_objid[number])]) == 2:
        unit = unit.replace("rad", "m")

    def read(data: "mujoco.MjData") -> Array:
        if kind not in QUATERNIONS:
            return data.sensordata[mine] - start
        out = np.zeros(3)
        mujoco.mju_subQuat(out, data.sensordata[mine], start)
        return out

    count = 3 if kind in QUATERNIONS else size
    labels = [f"{name}_{AXES[i] if count == 3 else i}" for i in range(count)] if count > 1 else [name]
    return Output(tuple(labels), (unit,) * count, read, kind not in OF_CHAINS)
