"""`Linear`: `M q'' + D q' + K q = B u` of a MuJoCo model at an operating point, with names.

The mass matrix is MuJoCo's own. The other matrices are slopes by differences of five points: what
is linear or cubic in the perturbation (springs, dampers, gyroscopic moments) comes out to rounding,
small rotations to 1e-13. `mjd_transitionFD` (`engine/linearise.py`) is the proof.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from beamchain.engine.combinations import InputNames, OutputNames, inputs_of, outputs_of
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import check_freedoms, compile_model, dense_mass
from beamchain.engine.normal_modes import NormalModes, normal_modes
from beamchain.engine.operating_point import OperatingPoint, Pose, Rates, operating_point
from beamchain.engine.signals import Input, Output, actuator_names
from beamchain.ports.model import PortModel, flexible_mass
from beamchain.ports.motions import Array, locked

POSITION = 1e-3  # perturbation of positions [m, rad]
RATE = 1.0  # of rates, accelerations, activations and inputs, in which forces are linear
DEPENDENT = 1e-7  # relative singular value below which a static shape is made of others
# places of the five points in units of the perturbation, and their weights; the middle one has none
STENCIL = ((1.0, 8.0 / 12.0), (-1.0, -8.0 / 12.0), (2.0, -1.0 / 12.0), (-2.0, 1.0 / 12.0))


class Signal(NamedTuple):
    """Name and unit of an input, an output or a coordinate."""

    name: str
    unit: str


def _six(first: str, unit: str, second: str, other: str) -> tuple[Signal, ...]:
    """Names along x, y, z and about them."""
    along = (Signal(f"{first}_{axis}", unit) for axis in "xyz")
    return (*along, *(Signal(f"{second}_{axis}", other) for axis in "xyz"))


WRENCH = _six("force", "N", "torque", "N m")
ACCELERATION = _six("acceleration", "m/s^2", "angular_acceleration", "rad/s^2")
FREE = _six("position", "m", "attitude", "rad")


class Inputs(NamedTuple):
    """Inputs u and what they push.

    Args:
        signals: name and unit of each.
        force: `(nv, m)` B, generalised force per unit.
    """

    signals: tuple[Signal, ...]
    force: Array


class Outputs(NamedTuple):
    """Outputs `y = Y0 q + Y1 q' + Y2 q'' + Yu u` (and what activations add).

    Args:
        signals: name and unit of each.
        position, rate, acceleration: `(p, nv)` Y0, Y1, Y2.
        feedthrough: `(p, m)` Yu.
    """

    signals: tuple[Signal, ...]
    position: Array
    rate: Array
    acceleration: Array
    feedthrough: Array


class Attachment(NamedTuple):
    """Where an appendage acts on a craft.

    Args:
        rows: `(6 + 6 l, n)` B: the motion of its root, in its axes, and the wrenches on those l of
            its ports that carry something, by the craft's n coordinates.
        points: x of these ports [m].
    """

    rows: Array
    points: tuple[float, ...] = ()

    def block(self, model: PortModel, omega: Array) -> NDArray[np.complex128]:
        """`(k, 6 + 6 l, 6 + 6 l)` Y: the appendage adds `B^T Y B` to the craft's dynamic mass.

        With L the participation of its modes, tau their motion of the ports and H the accelerations
        of these by forces on them:

            Y = [[D, L^T H tau], [tau^T H L, -tau^T H tau]]
              = diag(M, 0) - [L, -tau]^T H [L, -tau]
        """
        pushed = np.hstack([model.participation, -port_motion(model, self.points)])
        rigid = np.zeros((pushed.shape[1], pushed.shape[1], 1))
        rigid[:6, :6, 0] = model.rigid_mass
        return np.moveaxis(rigid - flexible_mass(model, pushed, omega), -1, 0)


class PortLoads(NamedTuple):
    """What ports of appendages carry: six coordinates p for every port that carries something,
    behind the craft's own q, its motion against the root of its appendage in the axes of the root.

    Args:
        roots: `(6, nv + 6 l)` motion of every appendage's root by (q, p), in its axes.
        mass: `(nv + 6 l, nv + 6 l)` of the craft's bodies that ports move, zero in q alone.
        ports: number of the appendage and x of the point [m], per port.
    """

    roots: tuple[Array, ...]
    mass: Array
    ports: tuple[tuple[int, float], ...]

    def shapes(self, models: Sequence[PortModel]) -> Array:
        """`(6 l, modes)` motion of the ports in the modes of all appendages."""
        ends = np.cumsum([0, *(model.modes for model in models)])
        out = np.zeros((6 * len(self.ports), int(ends[-1])))
        for row, (number, point) in enumerate(self.ports):
            columns = slice(int(ends[number]), int(ends[number + 1]))
            out[6 * row : 6 * row + 6, columns] = port_motion(models[number], (point,)).T
        return out

    def by_modes(self, models: Sequence[PortModel]) -> Array:
        """`(nv + 6 l, nv + modes)` (q, p) by (q, modes of all appendages)."""
        nv = self.mass.shape[0] - 6 * len(self.ports)
        return block_diag(np.eye(nv), self.shapes(models))

    def added_to(self, dynamic: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """`(k, nv + 12 l, nv + 12 l)` dynamic mass of the craft by (q, p, lambda), without its
        appendages; `dynamic` `(k, nv, nv)`: by q."""
        nv = dynamic.shape[1]
        size = self.mass.shape[0]
        rows = size - nv
        out = np.zeros((len(dynamic), size + rows, size + rows), dtype=np.complex128)
        out[:, :nv, :nv] = dynamic
        out[:, :size, :size] += self.mass
        out[:, nv:size, size:] = out[:, size:, nv:size] = np.eye(rows)
        return out


class Activations(NamedTuple):
    """States of actuators, `a' = L a + E u`.

    Args:
        names: of the actuators, once per state.
        force: `(nv, na)` F, generalised force per unit.
        rate, feed: `(na, na)` L and `(na, m)` E.
        seen: `(p, na)` Ya, what outputs read of them.
    """

    names: tuple[str, ...]
    force: Array
    rate: Array
    feed: Array
    seen: Array


@dataclass(frozen=True, eq=False, repr=False)
class Linear:
    """A linear model `M q'' + D q' + K q = F a + B u` about an operating point.

    M is MuJoCo's own, D, K and the rest are exact to rounding. `bc.linearise`, through
    `mjd_transitionFD`, is the independent way to the same system.

    Args:
        mass, damping, stiffness: `(nv, nv)` M, D, K; D holds the gyroscopic moments of wheels.
        coordinates: name and unit of each q.
        inputs: B, with names and units.
        outputs: what is read of q, its rates and accelerations, with names and units.
        activations: states a of actuators; most have none.

    Example:
        >>> import beamchain as bc
        >>> oscillator = '''<mujoco><worldbody><body><joint name="slide" type="slide"
        ... stiffness="16" damping="2"/><inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/>
        ... </body></worldbody><actuator><motor name="push" joint="slide"/></actuator>
        ... <sensor><jointpos name="travel" joint="slide"/></sensor></mujoco>'''
        >>> linear = bc.Linear.of(oscillator, inputs=["push"], outputs=["travel"])
        >>> [
        ...     float(m[0, 0])
        ...     for m in (linear.mass, linear.damping.round(9), linear.stiffness.round(9))
        ... ]
        [4.0, 2.0, 16.0]
        >>> linear.modes().frequency.round(9)
        array([2.])
        >>> linear.inputs.signals
        (Signal(name='push', unit='N'),)
    """

    mass: Array
    damping: Array
    stiffness: Array
    coordinates: tuple[Signal, ...]
    inputs: Inputs
    outputs: Outputs
    activations: Activations

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "stiffness"):
            object.__setattr__(self, name, locked(getattr(self, name)))

    @classmethod
    @one_thread()
    def of(
        cls,
        source: "mujoco.MjModel | str | Path",
        inputs: InputNames = (),
        outputs: OutputNames = (),
        pose: Pose = None,
        *,
        rates: Rates = None,
    ) -> "Linear":
        """A MuJoCo model, linear at an operating point, in free fall.

        Gravity, medium, contacts, constraints and limits of actuators are left out, and what holds
        the pose is taken as in balance, as in `bc.plant`.

        Args:
            source: a compiled model, MJCF text, or a path.
            inputs, outputs: as for `bc.plant`; none where left out.
            pose: name or number of a keyframe, `qpos`, or `{joint: angle}` [rad]; the pose of rest
                where left out.
            rates: `{joint: rad/s}` of wheels; those of the keyframe where left out.

        Raises:
            InputError: an unknown name, a sensor without a linear part, a pose in contact or out
                of range, a body that moves in `pose` and is not a balanced wheel.
            EngineError: the model does not compile, or has no degree of freedom.
        """
        model = compile_model(source)
        check_freedoms(model)
        point = operating_point(model, pose, rates)
        driven = inputs_of(point, inputs) if inputs is None or len(inputs) else []
        seen = outputs_of(point, outputs) if outputs is None or len(outputs) else []
        return linear_at(point, driven, seen)

    def __repr__(self) -> str:
        return (
            f"<Linear, {len(self.coordinates)} coordinates, {len(self.inputs.signals)} inputs, "
            f"{len(self.outputs.signals)} outputs>"
        )

    def modes(self) -> NormalModes:
        """Rigid motions and undamped normal modes."""
        return normal_modes(self.mass, self.stiffness)

    def first_order(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C, D over the states (q, q', a)."""
        nv, na = self.activations.force.shape
        states = 2 * nv + na
        inputs = self.inputs.force.shape[1]
        forces = np.hstack(
            [-self.stiffness, -self.damping, self.activations.force, self.inputs.force]
        )
        accelerations = np.asarray(np.linalg.solve(self.mass, forces), dtype=np.float64)
        a = np.zeros((states, states))
        a[:nv, nv : 2 * nv] = np.eye(nv)
        a[nv : 2 * nv] = accelerations[:, :states]
        a[2 * nv :, 2 * nv :] = self.activations.rate
        b = np.vstack([np.zeros((nv, inputs)), accelerations[:, states:], self.activations.feed])
        seen = np.hstack(
            [
                self.outputs.position,
                self.outputs.rate,
                self.activations.seen,
                self.outputs.feedthrough,
            ]
        )
        seen = seen + self.outputs.acceleration @ accelerations
        return a, b, seen[:, :states], seen[:, states:]

    def response(
        self,
        omega: Array,
        models: Sequence[PortModel] = (),
        roots: Sequence[Array] = (),
        carrying: PortLoads | None = None,
    ) -> NDArray[np.complex128]:
        """`(p, m, k)` frequency response of the outputs to the inputs, as in python-control.

        Args:
            omega: `(k,)` [rad/s], above zero.
            models, roots: appendages in six motions, and the motion `(6, nv)` of each root in its
                axes; all their modes take part, and none is a coordinate.
            carrying: what their ports carry; the roots are then its own.
        """
        omega = np.asarray(omega, dtype=np.float64)
        s = np.asarray(1j * omega[:, None, None], dtype=np.complex128)
        dynamic = dynamic_mass(self, omega, models, roots, carrying)
        activations = self.activations
        force = np.broadcast_to(self.inputs.force, (s.size, *self.inputs.force.shape))
        seen = self.outputs.feedthrough
        if activations.names:
            lag = np.linalg.solve(
                s * np.eye(len(activations.names)) - activations.rate, activations.feed
            )
            force = force + activations.force @ lag
            seen = seen + activations.seen @ lag
        rows = self.outputs.acceleration + self.outputs.rate / s + self.outputs.position / s**2
        extra = dynamic.shape[1] - self.mass.shape[0]
        force = np.pad(force, ((0, 0), (0, extra), (0, 0)))
        rows = np.pad(rows, ((0, 0), (0, 0), (0, extra)))
        return np.moveaxis(rows @ np.linalg.solve(dynamic, force) + seen, 0, -1)

    def on_body(self, motion: Array) -> "Linear":
        """The same with a wrench on a body for inputs and the body's acceleration for outputs:
        its response is the accelerance.

        `motion` `(6, nv)`: of the body, in the axes that the wrench has; or `(6 b, nv)` of several.
        """
        na = self.activations.force.shape[1]
        rows = motion.shape[0]
        nothing = np.zeros_like(motion)
        return replace(
            self,
            inputs=Inputs(WRENCH * (rows // 6), motion.T),
            outputs=Outputs(
                ACCELERATION * (rows // 6),
                position=nothing,
                rate=nothing,
                acceleration=motion,
                feedthrough=np.zeros((rows, rows)),
            ),
            activations=self.activations._replace(
                feed=np.zeros((na, rows)), seen=np.zeros((rows, na))
            ),
        )

    def picked(self, inputs: Sequence[int], outputs: Sequence[int]) -> "Linear":
        """The same with some of its inputs and outputs, by their numbers."""
        columns = list(inputs)
        rows = list(outputs)
        of_inputs = self.inputs
        of_outputs = self.outputs
        return replace(
            self,
            inputs=Inputs(
                tuple(of_inputs.signals[i] for i in columns), of_inputs.force[:, columns]
            ),
            outputs=Outputs(
                tuple(of_outputs.signals[i] for i in rows),
                position=of_outputs.position[rows],
                rate=of_outputs.rate[rows],
                acceleration=of_outputs.acceleration[rows],
                feedthrough=of_outputs.feedthrough[np.ix_(rows, columns)],
            ),
            activations=self.activations._replace(
                feed=self.activations.feed[:, columns], seen=self.activations.seen[rows]
            ),
        )

    def in_coordinates(self, motion: Array, coordinates: Sequence[Signal]) -> "Linear":
        """The same in other coordinates x, of which its own are `q = motion @ x`.

        Args:
            motion: `(nv, n)`.
            coordinates: name and unit of each x.
        """
        outputs = self.outputs
        return replace(
            self,
            mass=motion.T @ self.mass @ motion,
            damping=motion.T @ self.damping @ motion,
            stiffness=motion.T @ self.stiffness @ motion,
            coordinates=tuple(coordinates),
            inputs=self.inputs._replace(force=motion.T @ self.inputs.force),
            outputs=outputs._replace(
                position=outputs.position @ motion,
                rate=outputs.rate @ motion,
                acceleration=outputs.acceleration @ motion,
            ),
            activations=self.activations._replace(force=motion.T @ self.activations.force),
        )

    def shapes_up_to(self, above: float, own: int = 0) -> Array:
        """`(nv, n)` fewer coordinates: its rigid motions, its normal modes up to a frequency, and
        the static shapes, under its inputs, of what its outputs see, and under the dampers of its
        own coordinates, of all modes beyond.

        The modes are those of the whole, so that none in question moves. The static response to the
        inputs, and what they and the outputs have to do with the modes up to there, stays exact
        (attachment modes; R. R. Craig, Structural Dynamics, 1981).

        Args:
            above: the frequency [rad/s].
            own: how many of the first coordinates are not modes, with ratios of their own.
        """
        modes = self.modes()
        low = modes.frequency <= above
        # in coordinates w q, in which the stiffness is one
        beyond = modes.shapes[:, ~low] / modes.frequency[~low]
        loads = np.hstack([self.inputs.force, self.outputs.acceleration.T, self.damping[:, :own]])
        responses = beyond.T @ loads
        sizes = np.linalg.norm(responses, axis=0)
        responses = responses[:, sizes > 0.0] / sizes[sizes > 0.0]
        attachment, strength, _ = np.linalg.svd(responses, full_matrices=False)
        static = beyond @ attachment[:, strength > DEPENDENT]
        motion = np.hstack([modes.rigid, modes.shapes[:, low], static])
        return motion if motion.shape[1] < self.mass.shape[0] else np.eye(self.mass.shape[0])

    def with_appendages(
        self,
        models: Sequence[PortModel],
        roots: Sequence[Array],
        carrying: PortLoads | None = None,
    ) -> "Linear":
        """The same with appendages on it, their modal coordinates behind its own.

            M = [[M + sum J^T M_rigid J, J^T L^T], [L J, 1]],   K = diag(K, W^2)

        Args:
            models: in six motions.
            roots: `(6, nv)` motion J of each root, in its axes.
            carrying: what their ports carry; the roots are then its own.
        """
        nv = self.mass.shape[0]
        extra = sum(model.modes for model in models)
        mass = block_diag(self.mass, np.eye(extra))
        if carrying is not None:
            to_ports = carrying.by_modes(models)
            mass += to_ports.T @ carrying.mass @ to_ports
            roots = [root @ to_ports for root in carrying.roots]
        for model, root, modes in zip(models, roots, _slices(nv, models), strict=True):
            motion = _wider(root, nv + extra - root.shape[1])
            pushed = model.participation @ motion
            mass += motion.T @ model.rigid_mass @ motion
            mass[modes] += pushed
            mass[:, modes] += pushed.T
        squares = [model.frequencies**2 for model in models]
        damping = [2.0 * model.damping * model.frequencies for model in models]
        outputs = self.outputs
        return Linear(
            mass,
            block_diag(self.damping, np.diag(np.concatenate([np.zeros(0), *damping]))),
            block_diag(self.stiffness, np.diag(np.concatenate([np.zeros(0), *squares]))),
            (*self.coordinates, *(Signal(f"mode {k + 1}", "") for k in range(extra))),
            self.inputs._replace(force=_taller(self.inputs.force, extra)),
            outputs._replace(
                position=_wider(outputs.position, extra),
                rate=_wider(outputs.rate, extra),
                acceleration=_wider(outputs.acceleration, extra),
            ),
            self.activations._replace(force=_taller(self.activations.force, extra)),
        )


def rigid_body(mass: Array) -> Linear:
    """A free rigid body with a mass matrix `(6, 6)`, pushed and looked at in its six motions."""
    nothing = np.zeros((6, 6))
    none = np.zeros((6, 0))
    empty = np.zeros((0, 0))
    free = Linear(
        mass,
        damping=nothing,
        stiffness=nothing,
        coordinates=FREE,
        inputs=Inputs((), none),
        outputs=Outputs((), none.T, none.T, none.T, empty),
        activations=Activations((), none, empty, empty, empty),
    )
    return free.on_body(np.eye(6))


def _slices(start: int, models: Sequence[PortModel]) -> list[slice]:
    """Places of the modes of each model, one after the other."""
    ends = start + np.cumsum([0, *(model.modes for model in models)])
    return [slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]


def dynamic_mass(
    craft: Linear,
    omega: Array,
    models: Sequence[PortModel],
    roots: Sequence[Array],
    carrying: PortLoads | None,
) -> NDArray[np.complex128]:
    """`(k, nv, nv)` force per acceleration of a craft with appendages, as in `Linear.response`.

    Where ports carry something, `(k, nv + 12 l, nv + 12 l)` over (u, lambda): u = (q, p), lambda
    the wrenches on the ports, Z the motion of a root by u, A the dynamic mass of all else:

        [[A + sum Z^T D Z, E + Z^T L^T H tau], [.^T, -tau^T H tau]] (u'', lambda) = (f, 0)
    """
    s = np.asarray(1j * omega[:, None, None], dtype=np.complex128)
    dynamic = craft.mass + craft.damping / s + craft.stiffness / s**2
    if carrying is not None:
        dynamic = carrying.added_to(dynamic)
    for model, at in zip(models, attachments(roots, carrying), strict=True):
        dynamic = dynamic + at.rows.T @ at.block(model, omega) @ at.rows
    return dynamic


def attachments(roots: Sequence[Array], carrying: PortLoads | None) -> list[Attachment]:
    """Where appendages act: at their `roots`; by (q, p, lambda) where ports carry something."""
    if carrying is None:
        return [Attachment(root) for root in roots]
    size = carrying.mass.shape[0]
    count = 6 * len(carrying.ports)
    wrenches = np.eye(count, size + count, size).reshape(-1, 6, size + count)
    out: list[Attachment] = []
    for number, root in enumerate(carrying.roots):
        loaded = [i for i, (owner, _) in enumerate(carrying.ports) if owner == number]
        points = tuple(carrying.ports[i][1] for i in loaded)
        out.append(Attachment(np.vstack([_wider(root, count), *wrenches[loaded]]), points))
    return out


def port_motion(model: PortModel, points: Sequence[float]) -> Array:
    """`(n, 6 l)` motion of points of an appendage, x [m], in its modes."""
    if not points or model.modes == 0:  # nothing is there, or it is rigid
        return np.zeros((model.modes, 6 * len(points)))
    return model.point_motion(points).reshape(model.modes, -1)


def _taller(matrix: Array, extra: int) -> Array:
    return np.pad(matrix, ((0, extra), (0, 0)))


def _wider(matrix: Array, extra: int) -> Array:
    return np.pad(matrix, ((0, 0), (0, extra)))


def slopes(function: "Callable[[int, float], Array]", size: int, step: float) -> Array:
    """`(n, size)` slope of a vector by each of `size` perturbations, by five points."""
    columns = [
        sum(weight / step * function(i, place * step) for place, weight in STENCIL)
        for i in range(size)
    ]
    return np.array(columns).T.astype(np.float64) if columns else np.zeros((0, 0))


def linear_at(
    point: OperatingPoint, inputs: Sequence[Input] = (), outputs: Sequence[Output] = ()
) -> Linear:
    """A model, linear at an operating point.

    Of a still model (`still_copy`): gravity and constraints would be in its slopes.
    """
    model = point.model
    probe = _Probe(point, inputs, outputs)
    mass = dense_mass(model, probe.data)
    wrenches = [_generalised_force(model, probe.data, signal) for signal in inputs]
    of_position = probe.slopes(probe.move, model.nv, POSITION)
    probe.hold_position()
    of_rate = probe.slopes(probe.speed_up, model.nv, RATE)
    of_activation = probe.slopes(probe.activate, model.na, RATE)
    of_input = probe.slopes(probe.drive, len(inputs), RATE)
    stiffness = -of_position.force
    # slopes of springs and dampers are symmetric; gyroscopic moments are not
    damping = -of_rate.force
    return Linear(
        mass=mass,
        damping=(damping + damping.T) / 2.0 + of_rate.bias,
        stiffness=(stiffness + stiffness.T) / 2.0,
        coordinates=coordinate_names(model),
        inputs=Inputs(
            signals=tuple(Signal(signal.label, signal.unit) for signal in inputs),
            force=of_input.force + np.array(wrenches).reshape(len(inputs), model.nv).T,
        ),
        outputs=Outputs(
            signals=tuple(
                Signal(label, unit)
                for output in outputs
                for label, unit in zip(output.labels, output.units, strict=True)
            ),
            position=of_position.outputs,
            rate=of_rate.outputs,
            acceleration=probe.slopes(probe.accelerate, model.nv, RATE).outputs
            if outputs
            else np.zeros((0, model.nv)),
            feedthrough=of_input.outputs,
        ),
        activations=Activations(
            names=activation_names(model),
            force=of_activation.force,
            rate=of_activation.activations,
            feed=of_input.activations,
            seen=of_activation.outputs,
        ),
    )


class _Slopes(NamedTuple):
    """Slopes by k perturbations: `(nv, k)` of passive and actuator forces and of bias forces,
    `(na, k)` of the rates of activations, `(p, k)` of outputs."""

    force: Array
    bias: Array
    activations: Array
    outputs: Array


class _Probe:
    """Evaluates a model in perturbed states about an operating point."""

    def __init__(
        self, point: OperatingPoint, inputs: Sequence[Input], outputs: Sequence[Output]
    ) -> None:
        self.data: mujoco.MjData = point.data()
        self._point = point
        self._inputs = inputs
        self._outputs = outputs
        self._units: Array = np.eye(point.model.nv)

    def slopes(
        self, perturbed: "Callable[[int, float], Array]", count: int, step: float
    ) -> _Slopes:
        """Slopes by `count` perturbations."""
        nv = self._point.model.nv
        na = self._point.model.na
        rows = 2 * nv + na + sum(len(output.labels) for output in self._outputs)
        table = slopes(perturbed, count, step).reshape(rows, count)
        return _Slopes(*np.split(table, [nv, 2 * nv, 2 * nv + na]))

    def hold_position(self) -> None:
        """Let MuJoCo see the positions of the operating point, for perturbations of all else."""
        self._reset()
        mujoco.mj_fwdPosition(self._point.model, self.data)

    def move(self, i: int, by: float) -> Array:
        """With one position perturbed."""
        self._reset()
        mujoco.mj_integratePos(self._point.model, self.data.qpos, self._units[i], by)
        mujoco.mj_fwdPosition(self._point.model, self.data)
        return self._values()

    def speed_up(self, i: int, by: float) -> Array:
        """With one rate perturbed."""
        self._reset()
        self.data.qvel[i] += by
        return self._values()

    def activate(self, i: int, by: float) -> Array:
        """With one activation perturbed."""
        self._reset()
        self.data.act[i] = by
        return self._values()

    def drive(self, i: int, by: float) -> Array:
        """With one input perturbed."""
        self._reset()
        self._inputs[i].apply(self.data, by)
        return self._values()

    def accelerate(self, i: int, by: float) -> Array:
        """With an acceleration of one degree of freedom."""
        self._reset()
        return self._values(by * self._units[i])

    def _reset(self) -> None:
        self.data.qpos[:] = self._point.qpos
        self.data.qvel[:] = self._point.qvel
        self.data.act[:] = 0.0
        self.data.ctrl[:] = 0.0
        self.data.xfrc_applied[:] = 0.0

    def _values(self, acceleration: "Array | float" = 0.0) -> Array:
        """Forces, bias forces, rates of activations and outputs, one after the other.

        MuJoCo has seen the positions; only what outputs read is computed for them.
        """
        model = self._point.model
        data = self.data
        if self._outputs:
            mujoco.mj_sensorPos(model, data)
        mujoco.mj_fwdVelocity(model, data)
        if self._outputs:
            mujoco.mj_subtreeVel(model, data)
            mujoco.mj_sensorVel(model, data)
        mujoco.mj_fwdActuation(model, data)
        if self._outputs:
            data.qacc[:] = acceleration
            mujoco.mj_rnePostConstraint(model, data)
            mujoco.mj_sensorAcc(model, data)
        force = data.qfrc_passive + data.qfrc_actuator
        read = [output.read(data) for output in self._outputs]
        return np.concatenate([force, data.qfrc_bias, data.act_dot, *read])


def _generalised_force(model: "mujoco.MjModel", data: "mujoco.MjData", signal: Input) -> Array:
    """`(nv,)` generalised force of wrenches; zero for actuators, whose force MuJoCo gives."""
    out = np.zeros(model.nv)
    for weight, part in signal.simple:
        if part.wrench is not None:
            force, torque = weight * part.wrench[:3], weight * part.wrench[3:]
            mujoco.mj_applyFT(model, data, force, torque, data.xipos[part.body], part.body, out)
    return out


def coordinate_names(model: "mujoco.MjModel") -> tuple[Signal, ...]:
    """Name and unit of every degree of freedom."""
    out: list[Signal] = []
    several = int(np.sum(model.jnt_type == 0)) > 1
    for j in range(model.njnt):
        kind = int(model.jnt_type[j])
        name = str(model.joint(j).name) or f"joint {j}"
        if kind == 0:
            body = f"{model.body(int(model.jnt_bodyid[j])).name}_" if several else ""
            out += [Signal(f"{body}{name}", unit) for name, unit in FREE]
        elif kind == 1:
            out += [Signal(f"{name}_{axis}", "rad") for axis in "xyz"]
        else:
            out.append(Signal(name, "m" if kind == 2 else "rad"))
    return tuple(out)


def activation_names(model: "mujoco.MjModel") -> tuple[str, ...]:
    """Names of the actuators with a state, once per state."""
    names = actuator_names(model)
    return tuple(names[i] for i in range(model.nu) for _ in range(int(model.actuator_actnum[i])))
