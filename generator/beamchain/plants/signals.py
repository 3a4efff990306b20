"""Inputs and outputs of a plant by name: actuators, torques, forces, wrenches; sensors, attitude, rates, motions."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from beamchain.craft.error import base_body
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.plants.operating_point import OperatingPoint, unknown
from beamchain.ports.motions import Array

AXES = ("x", "y", "z")
DYNAMICS = ("NONE", "INTEGRATOR", "FILTER", "FILTEREXACT")  # of actuators, those that are linear
NOT_SMOOTH = (
    "TOUCH", "RANGEFINDER", "JOINTLIMITPOS", "JOINTLIMITVEL", "JOINTLIMITFRC", "TENDONLIMITPOS", "TENDONLIMITVEL",
    "TENDONLIMITFRC", "GEOMDIST", "GEOMNORMAL", "GEOMFROMTO", "INSIDESITE", "CONTACT", "TACTILE", "CLOCK", "USER", "PLUGIN",
    "E_POTENTIAL", "E_KINETIC",
)  # fmt: skip
QUATERNIONS = ("FRAMEQUAT", "BALLQUAT")
OF_CHAINS = ("FORCE", "TORQUE", "SUBTREECOM", "SUBTREELINVEL", "SUBTREEANGMOM", "TENDONPOS", "TENDONVEL")
UNITS = {
    "ACCELEROMETER": "m/s^2", "VELOCIMETER": "m/s", "GYRO": "rad/s", "FORCE": "N", "TORQUE": "N m", "MAGNETOMETER": "T",
    "JOINTPOS": "rad", "JOINTVEL": "rad/s", "ACTUATORFRC": "N m", "JOINTACTFRC": "N m", "BALLANGVEL": "rad/s",
    "FRAMEPOS": "m", "FRAMELINVEL": "m/s", "FRAMEANGVEL": "rad/s", "FRAMELINACC": "m/s^2", "FRAMEANGACC": "rad/s^2",
    "SUBTREECOM": "m", "SUBTREELINVEL": "m/s", "SUBTREEANGMOM": "N m s", "FRAMEQUAT": "rad", "BALLQUAT": "rad",
}  # fmt: skip
WRENCH = [("force", "N"), ("torque", "N m")]


@dataclass(frozen=True, eq=False)
class Input:
    """One input: an actuator's control, or a part of a wrench on a body.

    Args:
        label, unit: of the signal.
        actuator: its number; -1: a wrench.
        body: that the wrench acts on.
        wrench: `(6,)` force and torque at the body's mass centre in world axes, as in `xfrc_applied`.
    """

    label: str
    unit: str
    actuator: int = -1
    body: int = 0
    wrench: Array | None = None

    def apply(self, data: "mujoco.MjData", value: float) -> None:
        """Set the input, all others untouched."""
        if self.actuator >= 0:
            data.ctrl[self.actuator] = value
        else:
            data.xfrc_applied[self.body] = value * np.asarray(self.wrench)


@dataclass(frozen=True, eq=False)
class Output:
    """One or more outputs: labels, units, and how they are read from data that `mj_forward` has seen.

    Args:
        labels, units: of the signals.
        read: from data, as many numbers as labels; only its slope counts.
        local: what is read does not depend on the bodies that hang on the craft, given the craft's own motion.
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


def named(model: "mujoco.MjModel", kind: str, name: str, field: str, cure: str = "") -> int:
    """Number of a body, site, actuator or sensor."""
    found = int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))
    if found < 0:
        count = {"body": model.nbody, "site": model.nsite, "actuator": model.nu, "sensor": model.nsensor}[kind]
        raise unknown(field, name, [getattr(model, kind)(i).name for i in range(count)], cure)
    return found


def inputs_of(point: OperatingPoint, names: Sequence[str] | None) -> list[Input]:
    """The inputs that `names` ask for; all actuators where left out, a torque on the base where there is none.

    Raises:
        InputError: no such actuator, body or site; an actuator whose activation is not linear.
    """
    model, data = point.model, point.data()
    if names is None:
        names = [model.actuator(i).name or f"actuator {i}" for i in range(model.nu)]
        names = names or [f"torque:{model.body(base(model)).name}"]
    groups: list[tuple[str, list[Input]]] = []
    for name in _listed("inputs", names):
        kind, _, place = name.partition(":")
        if kind in ("torque", "force", "wrench") and place:
            what = "site" if kind == "wrench" else "body"
            i = named(model, what, place, f"{what} of inputs {kind!r}")
            body = int(model.site_bodyid[i]) if what == "site" else i
            axes = (data.site_xmat if what == "site" else data.xmat)[i].reshape(3, 3)
            arm = (data.site_xpos[i] if what == "site" else data.xipos[i]) - data.xipos[body]
            mine = [
                Input(
                    f"{part}_{axis}", unit, body=body,
                    wrench=np.concatenate([(part == "force") * line, line if part == "torque" else np.cross(arm, line)]),
                )
                for part, unit in WRENCH if kind in (part, "wrench") for axis, line in zip(AXES, axes.T, strict=True)
            ]  # fmt: skip
        else:
            cure = "Or give torque:BODY, force:BODY, wrench:SITE."
            at = names.index(name) if name.startswith("actuator ") else -1
            number = at if at >= 0 else named(model, "actuator", name, "actuator of inputs", cure)
            kinds = [f"mjDYN_{word}" for word in DYNAMICS]
            if int(model.actuator_dyntype[number]) not in [int(getattr(mujoco.mjtDyn, kind)) for kind in kinds]:
                raise InputError(
                    f"actuator {name!r} of inputs has an activation that is not linear; only dyntype none, integrator, filter "
                    "and filterexact are; leave it out, or change its dyntype."
                )
            mine, place = [Input(name, "", actuator=number)], name
        groups.append((place, mine))
    _distinct("inputs", names)
    said = Counter(i.label for _, mine in groups for i in mine)
    return [
        Input(f"{i.label}_{place}" if said[i.label] > 1 else i.label, i.unit, i.actuator, i.body, i.wrench)
        for place, mine in groups
        for i in mine
    ]


def outputs_of(point: OperatingPoint, names: Sequence[str] | None) -> list[Output]:
    """The outputs that `names` ask for; attitude and rate of the base where left out.

    Raises:
        InputError: no such sensor or site; a sensor that has no linear part.
    """
    model, data = point.model, point.data()
    out: list[tuple[str, Output]] = []
    for name in _listed("outputs", ["attitude", "rate"] if names is None else names):
        kind, _, place = name.partition(":")
        if name == "attitude":
            one = _attitude(base(model), data.xmat[base(model)].reshape(3, 3).copy())
        elif name == "rate":
            one = _rate(base(model))
        elif kind == "motion" and place:
            site = named(model, "site", place, "site of outputs 'motion'")
            one = _motion(site, data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy())
        else:
            cure = "Or give attitude, rate, motion:SITE."
            one, place = _sensor(point, data, named(model, "sensor", name, "sensor of outputs", cure)), name
        out.append((place, one))
    _distinct("outputs", ["attitude", "rate"] if names is None else names)
    said = Counter(label for _, one in out for label in one.labels)
    return [
        Output(
            tuple(f"{label}_{place}" if said[label] > 1 and place else label for label in one.labels), one.units, one.read,
            one.local,
        )
        for place, one in out
    ]  # fmt: skip


def _listed(field: str, names: Sequence[str]) -> list[str]:
    if isinstance(names, str) or not all(isinstance(name, str) for name in names) or not names:
        raise InputError(f'{field} = {names!r:.60} must be a list of names; write {field}=["..."].')
    return list(names)


def _distinct(field: str, names: Sequence[str]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise InputError(f"{field} names {twice[0]!r} twice; name each signal once.")


def _small(turn: Array) -> Array:
    """Rotation vector of a small rotation matrix; its slope at none is exact."""
    return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2.0


def _attitude(body: int, axes: Array) -> Output:
    labels = tuple(f"attitude_{axis}" for axis in AXES)
    return Output(labels, ("rad",) * 3, lambda data: _small(axes.T @ data.xmat[body].reshape(3, 3)))


def _rate(body: int) -> Output:
    labels = tuple(f"rate_{axis}" for axis in AXES)
    return Output(labels, ("rad/s",) * 3, lambda data: data.xmat[body].reshape(3, 3).T @ data.cvel[body][:3])


def _motion(site: int, start: Array, axes: Array) -> Output:
    def read(data: "mujoco.MjData") -> Array:
        turn = _small(axes.T @ data.site_xmat[site].reshape(3, 3))
        return np.concatenate([axes.T @ (data.site_xpos[site] - start), turn])

    labels = tuple(f"{part}_{axis}" for part in ("displacement", "rotation") for axis in AXES)
    return Output(labels, ("m",) * 3 + ("rad",) * 3, read)


def _sensor(point: OperatingPoint, data: "mujoco.MjData", number: int) -> Output:
    model, name = point.model, str(point.model.sensor(number).name)
    kind = next(
        (k.removeprefix("mjSENS_") for k in dir(mujoco.mjtSensor) if k.startswith("mjSENS_")
         and int(getattr(mujoco.mjtSensor, k)) == int(model.sensor_type[number])), "",
    )  # fmt: skip
    first, size = int(model.sensor_adr[number]), int(model.sensor_dim[number])
    start, cutoff = data.sensordata[first : first + size].copy(), float(model.sensor_cutoff[number])
    why = f"a {kind.lower()} sensor has none" if kind in NOT_SMOOTH else ""
    if not why and cutoff > 0.0 and np.any(np.abs(start) >= cutoff):
        why = f"it is at its cutoff, {cutoff:g}"
    if why:
        raise InputError(f"sensor {name!r} of outputs has no linear part here: {why}; leave it out of outputs.")
    model.sensor_cutoff[number] = 0.0  # of a copy
    unit = UNITS.get(kind, "")
    if kind in ("JOINTPOS", "JOINTVEL") and int(model.jnt_type[int(model.sensor_objid[number])]) == 2:
        unit = unit.replace("rad", "m")
    if kind in QUATERNIONS:
        size = 3

        def read(data: "mujoco.MjData") -> Array:
            out = np.zeros(3)
            mujoco.mju_subQuat(out, data.sensordata[first : first + 4], start)
            return out
    else:

        def read(data: "mujoco.MjData") -> Array:
            return data.sensordata[first : first + size] - start

    suffixes = AXES if size == 3 else tuple(str(i) for i in range(size))
    labels = (name,) if size == 1 else tuple(f"{name}_{suffix}" for suffix in suffixes)
    return Output(labels, (unit,) * size, read, kind not in OF_CHAINS)
