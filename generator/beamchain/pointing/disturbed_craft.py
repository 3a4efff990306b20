"""A craft with what disturbs it for inputs: wrenches of wheels, set points and torques of drives,
random inputs, thermal loads; linear in the speed of each wheel."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamchain import Linear
from beamchain.checks import unknown
from beamchain.errors import InputError
from beamchain.pointing.jitter_sources import (
    Disturbances,
    NoiseDisturbance,
    Source,
    StepperDisturbance,
    ThermalSnap,
    WheelDisturbance,
)
from beamchain.pointing.wheel_sweep import SpinningSystem
from beamchain.toolkit import (
    AXES,
    HINGE,
    Appendage,
    Array,
    Input,
    LinearCraft,
    OperatingPoint,
    OutputNames,
    Pose,
    Rates,
    Signal,
    actuator_names,
    craft_with_signals,
    inputs_of,
    motion,
    mujoco,
    operating_point,
    outputs_of,
    tip_displacement,
)

LINEAR = 1e-6  # relative error of what is linear in a wheel's speed; slopes have 1e-9
SET_POINTS = ("rad", "m")  # units of the set points of position servos


@dataclass(frozen=True, eq=False)
class DisturbedCraft:
    """A craft, linear at an operating point, with the inputs of all sources.

    Args:
        craft: all sources' inputs are its inputs.
        drives: numbers of the inputs of every source, in their order.
        turning: the same linear model with one wheel faster by `faster` [rad/s], per wheel.
        faster: by wheel.
    """

    craft: LinearCraft
    drives: tuple[tuple[int, ...], ...]
    turning: dict[str, Linear]
    faster: dict[str, float]

    def of_source(self, number: int) -> LinearCraft:
        """The craft with the inputs of one source alone."""
        return self._driven_by(self.craft, number)

    def of_wheel(self, number: int, joint: str, speed: float) -> LinearCraft:
        """The craft with the inputs of a wheel alone, which turns at a speed [rad/s]."""
        return self._driven_by(self._at_speed(joint, speed), number)

    def _driven_by(self, craft: LinearCraft, number: int) -> LinearCraft:
        outputs = range(len(craft.linear.outputs.signals))
        return replace(craft, linear=craft.linear.picked(self.drives[number], outputs))

    def _at_speed(self, joint: str, speed: float) -> LinearCraft:
        share = (speed - self._speed(joint)) / self.faster[joint]
        linear = _extrapolated(self.craft.linear, self.turning[joint], share)
        dof = self._dof(joint)
        point = self.craft.point
        qvel = point.qvel.copy()
        qvel[dof] = speed
        return replace(self.craft, linear=linear, point=point._replace(qvel=qvel))

    def spinning(self, number: int, joint: str) -> SpinningSystem:
        """The craft in modal coordinates with a wheel's speed left open, its inputs alone."""
        modes = self.craft.modes
        from_modal, to_modal = modes.transformation(len(self.craft.linear.activations.names))
        still = self.of_wheel(number, joint, 0.0).linear.first_order()
        faster = self.of_wheel(number, joint, self.faster[joint]).linear.first_order()
        a, b, c, d = still
        by_speed = (
            to_modal @ (faster[0] - a) @ from_modal / self.faster[joint],
            (faster[2] - c) @ from_modal / self.faster[joint],
        )
        system = to_modal @ a @ from_modal, to_modal @ b, c @ from_modal, d
        return SpinningSystem(system, by_speed)

    def _dof(self, joint: str) -> int:
        return _dof_of(self.craft.point.model, joint)

    def _speed(self, joint: str) -> float:
        return float(self.craft.point.qvel[self._dof(joint)])


def disturbed_craft(
    model: "mujoco.MjModel",
    disturbances: Disturbances,
    outputs: OutputNames,
    pose: Pose,
    rates: Rates,
    appendages: Sequence[Appendage] = (),
) -> DisturbedCraft:
    """A compiled model with the inputs of all sources; arguments as of `pointing`.

    `appendages`: those of the model that are known, for the displacement of their tips.

    Raises:
        InputError: a joint, signal or appendage that is not there, or a wheel that is not balanced.
    """
    point = operating_point(model, pose, rates)
    seen = outputs_of(point, outputs)
    inputs: list[Input] = []
    forces: list[tuple[Signal, Array]] = []
    drives: list[tuple[int, ...]] = []
    pushing: dict[int, StepperDisturbance | ThermalSnap] = {}
    for number, (_, source) in enumerate(disturbances.named):
        acting = _inputs(point, source)
        drives.append(tuple(range(len(inputs), len(inputs) + len(acting))))
        inputs += acting
        if not acting:
            assert isinstance(source, StepperDisturbance | ThermalSnap)
            pushing[number] = source
    craft = craft_with_signals(point, inputs, seen)
    for number, source in pushing.items():
        drives[number] = (len(inputs) + len(forces),)
        forces.append(
            _joint_force(point, source)
            if isinstance(source, StepperDisturbance)
            else _thermal_force(craft, source, appendages)
        )
    whole = replace(craft, linear=_with_forces(craft.linear, forces))
    turning: dict[str, Linear] = {}
    faster: dict[str, float] = {}
    for wheel in disturbances.wheel:
        dof = _dof_of(point.model, wheel.joint)
        far = max(wheel.speeds, key=abs)
        base = float(point.qvel[dof])
        faster[wheel.joint] = far
        ends: list[Linear] = []
        for share in (1.0, 0.5):
            speeds = {**(rates or {}), wheel.joint: base + share * faster[wheel.joint]}
            there = _turning_point(model, pose, speeds, wheel.joint)
            ends.append(craft_with_signals(there, inputs, outputs_of(there, outputs)).linear)
        _check_linear(wheel.joint, craft.linear, *ends)
        turning[wheel.joint] = _with_forces(ends[0], forces)
    return DisturbedCraft(whole, tuple(drives), turning, faster)


def _turning_point(model: "mujoco.MjModel", pose: Pose, rates: Rates, joint: str) -> OperatingPoint:
    """The operating point with a wheel at a speed, which the point at rest allows but for it."""
    try:
        return operating_point(model, pose, rates)
    except InputError:
        raise InputError(
            f"wheel.joint = {joint!r} is no balanced wheel, for the craft's mass changes as it "
            "turns; put the rotor's mass centre and principal axis on its hinge, and state its "
            "imbalance by static and dynamic."
        ) from None


def _inputs(point: OperatingPoint, source: Source) -> list[Input]:
    """The inputs of a source; none where it pushes joints otherwise."""
    if isinstance(source, WheelDisturbance):
        return wheel_inputs(point, source.joint)
    if isinstance(source, NoiseDisturbance):
        return _noise_inputs(point, source)
    if isinstance(source, StepperDisturbance) and source.torque is None:
        return _servo(point, source.joint)
    return []


def wheel_inputs(point: OperatingPoint, joint: str) -> list[Input]:
    """Forces and torques on a wheel, at its mass centre: two normal to its axis, a quarter of a
    turn apart, and one along it."""
    model = point.model
    number = _joint_number(model, "wheel.joint", joint)
    if int(model.jnt_type[number]) != int(mujoco.mjtJoint.mjJNT_HINGE):
        raise InputError(
            f"wheel.joint = {joint!r} is no hinge; give the hinge that a wheel turns on."
        )
    data = point.data()
    body = int(model.jnt_bodyid[number])
    axis = np.array(data.xaxis[number])
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    arm = data.subtree_com[body] - data.xipos[body]
    axes = (first, np.cross(axis, first), axis)
    out: list[Input] = []
    for name, line in zip(AXES, axes, strict=True):
        wrench = np.concatenate([line, np.cross(arm, line)])
        out.append(Input(f"{joint}_force_{name}", "N", body=body, wrench=wrench))
    for name, line in zip(AXES, axes, strict=True):
        wrench = np.concatenate([np.zeros(3), line])
        out.append(Input(f"{joint}_torque_{name}", "N m", body=body, wrench=wrench))
    return out


def _noise_inputs(point: OperatingPoint, source: NoiseDisturbance) -> list[Input]:
    """The signals of a random input that act."""
    inputs = inputs_of(point, [source.input])
    by_label = {signal.label: signal for signal in inputs}
    for label in source.signals:
        if label not in by_label:
            raise unknown(f"signals of psd {source.input!r}", label, by_label)
    inputs = [by_label[label] for label in source.signals] or inputs
    if len({signal.unit for signal in inputs}) > 1:
        raise InputError(
            f"psd of {source.input!r}: its signals have different units, and one density cannot "
            f'hold for all; name those that act, signals = ["{inputs[0].label}"].'
        )
    return inputs


def _servo(point: OperatingPoint, joint: str) -> list[Input]:
    """The set point of the position servo on a joint; none where there is none."""
    model = point.model
    number = _joint_number(model, "stepper.joint", joint)
    of_joint = [
        name
        for i, name in enumerate(actuator_names(model))
        if int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_JOINT)
        and int(model.actuator_trnid[i, 0]) == number
    ]
    servos = [signal for name in of_joint for signal in inputs_of(point, [name])]
    return [signal for signal in servos if signal.unit in SET_POINTS][:1]


def _joint_force(point: OperatingPoint, source: StepperDisturbance) -> tuple[Signal, Array]:
    """Torque between the two bodies of a drive: per unit, or of its spring per step."""
    model = point.model
    number = _joint_number(model, "stepper.joint", source.joint)
    dof = int(model.jnt_dofadr[number])
    force = np.zeros(model.nv)
    force[dof] = 1.0
    if source.torque is None:
        force[dof] = float(model.jnt_stiffness[number])
        if not force[dof] > 0.0:
            raise InputError(
                f"stepper {source.joint!r} has neither a position servo nor a spring through which "
                "its set point would act; give torque and width instead of step."
            )
    return Signal(f"{source.joint}_torque", "N m"), force


def _thermal_force(
    craft: LinearCraft, source: ThermalSnap, appendages: Sequence[Appendage]
) -> tuple[Signal, Array]:
    """`(nv,)` load that holds the final deformation of an appendage."""
    model = craft.point.model
    name = source.appendage.removesuffix("_")
    hinges: dict[str, list[tuple[int, str]]] = {}
    for dof, joint in enumerate(model.dof_jntid):
        if match := HINGE.fullmatch(str(model.joint(int(joint)).name)):
            hinges.setdefault(match[1], []).append((dof, match[2]))
    if name not in hinges:
        raise unknown("snap.appendage", source.appendage, [f"{known}_" for known in hinges])
    signal = Signal(f"{name}_thermal_{source.port}", "")
    if source.moment is not None:
        those = [dof for dof, port in hinges[name] if port == source.port]
        if not those:
            raise InputError(
                f"snap of {source.appendage!r}: the appendage has no hinge in port "
                f"{source.port!r}; choose a port that it bends in."
            )
        force = np.zeros(model.nv)
        force[those] = source.moment
        return signal, force
    mode = f"{name}_mode{source.mode}_{source.port}"
    if mode not in craft.names:
        known = [word for word in craft.names if word.startswith(f"{name}_mode")]
        raise unknown("mode of snap", mode, known)
    load = craft.rows[craft.names.index(mode)]
    dofs = [dof for dof, _ in hinges[name]]
    shape = np.zeros(model.nv)
    # the appendage alone, its root held: K q = f
    shape[dofs] = np.linalg.solve(craft.linear.stiffness[np.ix_(dofs, dofs)], load[dofs])
    beams = [a for a in appendages if a.prefix == f"{name}_" and a.fit.space is None]
    if beams:
        moved = abs(float(tip_displacement(model, beams[0], source.port) @ shape))
    else:
        moved = float(np.linalg.norm(_site_motion(craft.point, name) @ shape))
    assert source.displacement is not None
    return signal, load * (source.displacement / moved)


def _site_motion(point: OperatingPoint, appendage: str) -> Array:
    """`(3, nv)` displacement of the site at an appendage's tip."""
    model = point.model
    site = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"{appendage}_tip"))
    if site < 0:
        raise InputError(
            f"snap of {appendage!r}: the model has no site {f'{appendage}_tip'!r} whose "
            "displacement is meant; embed the appendage with scene.tip = true, or give moment "
            "[N m] instead."
        )
    data = point.data()
    body = int(model.site_bodyid[site])
    return motion(model, data, body, data.site_xpos[site], np.eye(3))[:3]


def _with_forces(linear: Linear, forces: Sequence[tuple[Signal, Array]]) -> Linear:
    """The same with further inputs, generalised forces `(nv,)` each."""
    if not forces:
        return linear
    count = len(forces)
    columns = np.array([force for _, force in forces]).T
    signals = tuple(signal for signal, _ in forces)
    of_inputs = linear.inputs
    wider = ((0, 0), (0, count))
    return replace(
        linear,
        inputs=of_inputs._replace(
            signals=(*of_inputs.signals, *signals), force=np.hstack([of_inputs.force, columns])
        ),
        outputs=linear.outputs._replace(feedthrough=np.pad(linear.outputs.feedthrough, wider)),
        activations=linear.activations._replace(feed=np.pad(linear.activations.feed, wider)),
    )


def _extrapolated(first: Linear, second: Linear, share: float) -> Linear:
    """The linear model at a share of the way from one speed to another."""
    return replace(
        first,
        damping=first.damping + share * (second.damping - first.damping),
        outputs=first.outputs._replace(
            position=first.outputs.position
            + share * (second.outputs.position - first.outputs.position),
            rate=first.outputs.rate + share * (second.outputs.rate - first.outputs.rate),
        ),
    )


def _check_linear(joint: str, still: Linear, fast: Linear, middle: Linear) -> None:
    """Refuse outputs that are not linear in a wheel's speed."""
    between = _extrapolated(still, fast, 0.5)
    found = np.hstack([between.outputs.position, between.outputs.rate])
    wanted = np.hstack([middle.outputs.position, middle.outputs.rate])
    size = np.abs(np.hstack([wanted, middle.outputs.acceleration])).max(axis=1)
    bad = np.abs(found - wanted).max(axis=1) > LINEAR * size
    if np.any(bad):
        output = still.outputs.signals[int(np.argmax(bad))].name
        raise InputError(
            f"output {output!r} does not grow in proportion to the speed of wheel {joint!r}; "
            "leave it out of outputs."
        )


def _joint_number(model: "mujoco.MjModel", field: str, name: str) -> int:
    names = [str(model.joint(j).name) for j in range(model.njnt) if int(model.jnt_type[j]) >= 2]
    if name not in names:
        raise unknown(field, name, names)
    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name))


def _dof_of(model: "mujoco.MjModel", joint: str) -> int:
    return int(model.jnt_dofadr[_joint_number(model, "wheel.joint", joint)])
