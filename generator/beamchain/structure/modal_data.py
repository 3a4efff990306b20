"""Modes from any program: cantilever frequencies, participation, rigid mass about the port."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag
from scipy.sparse.csgraph import connected_components

from beamchain.checks import finite_array
from beamchain.errors import InputError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array, locked, offset_matrix
from beamchain.structure.mass_line import (
    MassLine,
    MassPiece,
    default_length,
    mass_line_of_pieces,
    spread_mass,
)
from beamchain.structure.settle_modes import (
    MOTIONS,
    PRINTED,
    ROUNDING,
    near_groups,
    settle_rigid_mass,
    turn_into_planes,
)

SLIGHT = 1e-9  # part of a mode or of the rigid mass in a port that is rounding
LARGEST = 1e50  # of any number given, so that products of several stay finite
EXACT = 1e-13  # relative precision of numbers that were not printed


class FurtherPoint(NamedTuple):
    """A point beside the root that stays free.

    Args:
        name: of the point.
        place: `(3,)` from the root [m].
        motion: `(n, 6)` of the point in each mass-normalised mode.

    Example:
        >>> import beamchain as bc
        >>> import numpy as np
        >>> bc.spec.FurtherPoint("mast", np.array([1.6, 0.0, 0.0]), np.zeros((3, 6))).name
        'mast'
    """

    name: str
    place: Array
    motion: Array


@dataclass(frozen=True, eq=False, repr=False)
class ModalData:
    """Modes of an appendage held at its port, in SI, appendage axes, about the port.

    Args:
        rigid_mass: `(6, 6)` of the frozen appendage about the port, motions (x, y, z, rotations).
        frequencies: `(n,)` with the port held [rad/s].
        participation: `(n, 6)` rows `L_k = R^T M phi_k` of the mass-normalised modes.
        damping: `(n,)` ratios; zeros where left out.
        tip: `(n, 6)` motion of the tip in each mass-normalised mode, where known.
        length: root to tip [m], where known.
        pieces, points: the mass distribution along x, where known; see `MassLine`.
        precision: relative, of the printed numbers.
        source: origin of the data.
        steps: changes made to the numbers, in order.
        printed: the numbers are as printed; False once the effects of rounding have been removed.
        uncertain: what the file says is not known exactly of the modes,
            as [uncertain] of a specification would.
        origin: `(n, N)` each mode in terms of what the file holds: its N modes by ascending
            frequency, or the N inner freedoms of its matrices; left out where they are the same.
        further: points beside the root whose motion is known, such as ports of a superelement.

    Raises:
        InputError: shapes disagree, a number is not finite, or the numbers contradict each other.

    Example:
        >>> import beamchain as bc
        >>> import numpy as np
        >>> mass = np.diag([30.0, 30.0, 30.0, 20.0, 600.0, 600.0])
        >>> mass[1, 5] = mass[5, 1] = 120.0
        >>> mass[2, 4] = mass[4, 2] = -120.0
        >>> row = np.array([[0.0, 4.0, 0.0, 0.0, 0.0, 23.0]])
        >>> data = bc.ModalData(rigid_mass=mass, frequencies=np.array([1.3]), participation=row)
        >>> data.modes
        1
    """

    rigid_mass: Array
    frequencies: Array
    participation: Array
    damping: Array = field(default_factory=lambda: np.zeros(0))
    tip: Array | None = None
    length: float | None = None
    pieces: tuple[MassPiece, ...] = ()
    points: Array = field(default_factory=lambda: np.zeros((0, 5)))
    precision: float = EXACT
    source: str = "modes"
    steps: tuple[str, ...] = ()
    printed: bool = True
    uncertain: Mapping[str, Any] = field(default_factory=dict[str, Any])
    origin: Array | None = None
    further: tuple[FurtherPoint, ...] = ()

    def __repr__(self) -> str:
        first = ", ".join(f"{w:.6g}" for w in self.frequencies[:3])
        more = ", ..." if self.frequencies.size > 3 else ""
        return (
            f"<ModalData {self.source!r}, {self.rigid_mass[0, 0]:.6g} kg, "
            f"{self.frequencies.size} modes: {first}{more} rad/s>"
        )

    def __post_init__(self) -> None:
        arrays = self._arrays()
        self._check_shapes(arrays)
        self._check_numbers(arrays | {"points": self.points})
        self._check_frequencies(arrays["frequencies"])
        order = np.argsort(arrays["frequencies"], kind="stable")
        by_mode = {name: values[order] for name, values in arrays.items() if name != "mass"}
        further = tuple(
            point._replace(place=locked(point.place), motion=locked(point.motion[order]))
            for point in self.further
        )
        self._check_rigid_mass(arrays["mass"])
        mass, steps = self._settled_mass(arrays["mass"], by_mode["participation"])
        for name, values in {**by_mode, "rigid_mass": mass, "points": self.points}.items():
            object.__setattr__(self, name, locked(values))
        for name, value in {
            "pieces": tuple(self.pieces),
            "steps": (*self.steps, *steps),
            "printed": False,
            "further": further,
        }.items():
            object.__setattr__(self, name, value)

    def _arrays(self) -> dict[str, Array]:
        """The arrays that were given, as copies; "tip" where there is one."""
        given = {
            "mass": self.rigid_mass,
            "frequencies": self.frequencies,
            "participation": self.participation,
            "damping": self.damping,
        }
        if np.size(self.damping) == 0:
            given["damping"] = np.zeros(np.size(self.frequencies))
        if self.tip is not None:
            given["tip"] = self.tip
        if self.origin is not None:
            given["origin"] = self.origin
        return {name: np.array(values, dtype=np.float64) for name, values in given.items()}

    def _check_shapes(self, arrays: Mapping[str, Array]) -> None:
        """Six motions, and one row per mode; a print has a mode at least."""
        shapes = {name: values.shape for name, values in arrays.items()}
        n = arrays["frequencies"].size
        wanted = {"mass": (6, 6), "frequencies": (n,), "participation": (n, 6), "damping": (n,)}
        if any(shapes[name] != shape for name, shape in wanted.items()):
            raise InputError(
                f"{self.source}: the sizes do not fit: mass {shapes['mass']}, frequencies "
                f"{shapes['frequencies']}, participation {shapes['participation']}, damping "
                f"{shapes['damping']}; give mass (6, 6) and for n "
                "modes n frequencies, participation 6 x n and one damping ratio each."
            )
        if n == 0 and self.printed:
            raise InputError(
                f"{self.source}: there is no mode; export the cantilever modes of the structure."
            )
        if shapes.get("tip", (n, 6)) != (n, 6):
            raise InputError(
                f"{self.source}: tip has the shape {shapes['tip']}; give the six motions of the "
                "tip per mode."
            )

    def _check_numbers(self, arrays: Mapping[str, Array]) -> None:
        """Finite numbers whose products stay finite."""
        for name, values in arrays.items():
            if not np.all(np.isfinite(values)):
                raise InputError(
                    f"{self.source}: {name} holds a value that is not a finite number; export the "
                    "modes again."
                )
            largest = float(np.max(np.abs(values), initial=0.0))
            if largest > LARGEST:
                raise InputError(
                    f"{self.source}: {name} holds {largest:.3g}; numbers up to {LARGEST:g} are "
                    "taken: is a unit or an exponent wrong?"
                )

    def _check_frequencies(self, frequencies: Array) -> None:
        """Cantilever modes have no rigid motion."""
        if np.any(frequencies <= 0.0):
            raise InputError(
                f"{self.source}: mode {int(np.argmin(frequencies)) + 1} has the frequency "
                f"{float(frequencies.min()):.4g}: the structure was not held at its port; clamp "
                "the port (SPC) and compute the modes again."
            )

    def _check_rigid_mass(self, mass: Array) -> None:
        """Positive masses, no negative inertia, and symmetry to the precision of the print."""
        diagonal = np.diag(mass)
        if np.any(diagonal[:3] <= 0.0) or np.any(diagonal < 0.0):
            raise InputError(
                f"{self.source}: the rigid mass matrix has the diagonal {diagonal.tolist()}; "
                "masses must be positive."
            )
        scale = np.sqrt(diagonal)
        asymmetry = np.abs(mass - mass.T)
        excess = asymmetry - max(self.tolerance, 1e-6) * np.outer(scale, scale)
        if np.any(excess > 0.0):
            i, j = np.unravel_index(int(np.argmax(excess)), (6, 6))
            raise InputError(
                f"{self.source}: the rigid mass matrix is not symmetric ({MOTIONS[i]}, "
                f"{MOTIONS[j]}: {mass[i, j]:.6g} and {mass[j, i]:.6g}); give it about one point, "
                "the port."
            )

    def _settled_mass(self, mass: Array, participation: Array) -> tuple[Array, list[str]]:
        """The rigid mass whose residual is nowhere negative, and the step that says so."""
        precision = self.precision if self.printed else 0.0
        try:
            settled, change = settle_rigid_mass((mass + mass.T) / 2.0, participation, precision)
        except InputError as error:
            raise InputError(f"{self.source}: {error}") from None
        if change <= 10.0 * EXACT:
            return settled, []
        return settled, [
            f"rigid mass moved by {change:.1e} relative, within the printed precision of "
            f"{self.precision:.0e}, so that the residual mass is nowhere negative"
        ]

    # -- sizes and checks --------------------------------------------------------------------------
    @property
    def modes(self) -> int:
        """Number of modes."""
        return self.frequencies.size

    @property
    def tolerance(self) -> float:
        """Relative size below which a number that should be zero, or two that should be equal,
        differ by rounding."""
        return max(2.0 * self.precision, min(ROUNDING * self.precision, PRINTED))

    @property
    def scale(self) -> Array:
        """`(6,)` square roots of the rigid masses; 1 where there is none."""
        diagonal = np.diag(self.rigid_mass)
        return np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))

    @property
    def live(self) -> list[int]:
        """Motions in which the appendage has any inertia."""
        return [i for i in range(6) if self.rigid_mass[i, i] > 0.0]

    @cached_property
    def shares(self) -> Array:
        """`(n, 4)` share of each port in each mode's participation,
        every motion scaled by its rigid mass."""
        squares = (self.participation / self.scale) ** 2
        columns = [squares @ np.sum(PORT_MOTION[port] ** 2, axis=1) for port in PORTS]
        by_port = np.column_stack(columns)
        return by_port / np.clip(by_port.sum(axis=1, keepdims=True), 1e-300, None)

    @property
    def effective_mass_fractions(self) -> Array:
        """`(n, 6)` effective mass of each mode in the six motions of the port, over the rigid
        mass."""
        return (self.participation / self.scale) ** 2

    @cached_property
    def belongs(self) -> tuple[str, ...]:
        """Port of each mode: where its participation is largest."""
        return tuple(PORTS[i] for i in np.argmax(self.shares, axis=1))

    @property
    def labels(self) -> tuple[str, ...]:
        """Port of each mode that moves a single one, else ""."""
        several = np.count_nonzero(self.parts > 0.0, axis=1) > 1
        return tuple(
            "" if couples else port for port, couples in zip(self.belongs, several, strict=True)
        )

    @property
    def leaks(self) -> Array:
        """`(n,)` part of each mode's participation that lies outside its port, 0 to 1."""
        outside = 1.0 - np.max(self.shares, axis=1)
        leaks = np.sqrt(np.clip(outside, 0.0, 1.0))
        return np.where(leaks < max(self.tolerance, 1e-12), 0.0, leaks)

    @property
    def parts(self) -> Array:
        """`(n, 4)` part of each port in each mode's participation,
        0 where only rounding moves it."""
        parts = np.sqrt(self.shares)
        return np.where(parts < max(self.tolerance, SLIGHT), 0.0, parts)

    @cached_property
    def blocks(self) -> tuple[tuple[str, ...], ...]:
        """Ports with inertia, those that modes or the rigid mass couple together."""
        parts = self.parts
        linked = (parts.T @ parts) > 0.0
        scaled_mass = np.abs(self.rigid_mass / np.outer(self.scale, self.scale))
        coupled = scaled_mass > max(self.tolerance, SLIGHT)
        motions = {port: np.abs(PORT_MOTION[port]) for port in PORTS}
        for i, a in enumerate(PORTS):
            for j, b in enumerate(PORTS):
                between = motions[a].T @ coupled @ motions[b]
                linked[i, j] |= bool(np.any(between > 0.0))
        count, numbers = connected_components(linked, directed=False)
        live = np.diag(self.rigid_mass) > 0.0
        blocks = (tuple(PORTS[i] for i in np.flatnonzero(numbers == k)) for k in range(count))
        return tuple(
            block for block in blocks if any(np.any(motions[port][live]) for port in block)
        )

    @cached_property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """The blocks that a mode moves."""
        moved = np.any(self.parts > 0.0, axis=0)
        return tuple(
            block for block in self.blocks if any(moved[PORTS.index(port)] for port in block)
        )

    # -- port models -------------------------------------------------------------------------------
    def space(self) -> PortModel:
        """The port model with all six motions (those without inertia left out; see `live`)."""
        live = self.live
        tip = None if self.tip is None else self.tip[:, :2]
        return PortModel(
            self.rigid_mass[np.ix_(live, live)],
            frequencies=self.frequencies,
            participation=self.participation[:, live],
            damping=self.damping,
            tip=tip,
            labels=self.labels,
        )

    def port(self, port: str, *, own: bool = False) -> PortModel:
        """The port model of one port, all other motions of the root held.

        Args:
            port: "xy", "xz", "torsion" or "axial".
            own: only the modes that belong there.
        """
        motion = PORT_MOTION[port]
        if own:
            pick = np.array([mode_port == port for mode_port in self.belongs])
        else:
            share = self.shares[:, PORTS.index(port)]
            pick = share > max(self.tolerance, EXACT) ** 2
        rows = self.participation[pick] @ motion
        mass = motion.T @ self.rigid_mass @ motion
        mass, _ = settle_rigid_mass(mass, rows, min(self.precision, PRINTED / ROUNDING))
        return PortModel(
            mass,
            frequencies=self.frequencies[pick],
            participation=rows,
            damping=self.damping[pick],
            tip=None if self.tip is None else self.tip[pick] @ motion,
        )

    # -- made from this one ------------------------------------------------------------------------
    def scaled(self, length: float, mass: float) -> "ModalData":
        """The data in SI, given the file's units.

        Args:
            length: metres per unit of length of the file.
            mass: kilograms per unit of mass.
        """
        if length == 1.0 and mass == 1.0:
            return self
        # units of the six motions, of the four densities of a piece, of the columns of a point
        motion_units = np.array([1.0, 1.0, 1.0, length, length, length])
        density_units = np.array([1 / length, length, length, length])
        inertia = mass * length**2
        point_units = np.array([length, mass, inertia, inertia, inertia])
        pieces = [
            MassPiece(
                start=piece.start * length,
                length=piece.length * length,
                densities=piece.densities * mass * density_units,
            )
            for piece in self.pieces
        ]
        step = f"units: 1 length unit = {length:g} m, 1 mass unit = {mass:g} kg"
        return replace(
            self,
            rigid_mass=self.rigid_mass * mass * np.outer(motion_units, motion_units),
            participation=self.participation * np.sqrt(mass) * motion_units,
            tip=None if self.tip is None else self.tip / np.sqrt(mass) / motion_units,
            length=None if self.length is None else self.length * length,
            points=self.points * point_units,
            pieces=tuple(pieces),
            further=self._further(
                place=lambda place: place * length,
                motion=lambda motion: motion / np.sqrt(mass) / motion_units,
            ),
            steps=(*self.steps, step),
        )

    def _further(
        self,
        *,
        place: Callable[[Array], Array] = lambda place: place,
        motion: Callable[[Array], Array],
    ) -> tuple[FurtherPoint, ...]:
        """The further points in other units or axes, or of other modes."""
        return tuple(
            FurtherPoint(point.name, place(point.place), motion(point.motion))
            for point in self.further
        )

    def moved(self, reference: ArrayLike, axes: ArrayLike | None = None) -> "ModalData":
        """The data about another point, in other axes.

        Args:
            reference: `(3,)` the port, from the present point, in the present axes and units.
            axes: `(3, 3)` rows: appendage x, y, z in the present axes.

        Raises:
            InputError: the axes are not orthonormal and right-handed.
        """
        r = finite_array("reference", reference, (3,))
        turn = np.eye(3) if axes is None else finite_array("axes", axes, (3, 3))
        if np.max(np.abs(turn @ turn.T - np.eye(3))) > 1e-6 or np.linalg.det(turn) < 0.0:
            raise InputError(
                f"axes = {turn.tolist()} are not three perpendicular unit vectors, right-handed; "
                "give appendage x, y, z as rows, each of length 1, with z = x cross y."
            )
        # six printed digits of a direction are not exactly orthonormal
        left, _, right = np.linalg.svd(turn)
        turn = left @ right
        if not np.any(r) and np.array_equal(turn, np.eye(3)):
            return self
        tip_turn = block_diag(turn, turn)
        # motion of the present point per motion of the new one, in the new axes
        motion = offset_matrix(-r) @ tip_turn.T
        step = f"port at {_words(r)} of the file"
        if not np.array_equal(turn, np.eye(3)):
            step += f", axes {'; '.join(_words(row) for row in turn)}"
        return replace(
            self,
            rigid_mass=motion.T @ self.rigid_mass @ motion,
            participation=self.participation @ motion,
            tip=None if self.tip is None else self.tip @ tip_turn.T,
            pieces=(),
            points=np.zeros((0, 5)),
            further=self._further(
                place=lambda place: turn @ (place - r),
                motion=lambda motion: motion @ tip_turn.T,
            ),
            steps=(*self.steps, step),
        )

    def selected(self, modes: Sequence[int]) -> "ModalData":
        """Only some modes, numbered from 1 in the order of their frequencies.

        Raises:
            InputError: a number is given twice or lies beyond the last mode.
        """
        self.check_numbers(modes)
        numbers = sorted(modes)
        step = f"modes {', '.join(str(k) for k in numbers)} of {self.modes} taken"
        return replace(self._with_modes([k - 1 for k in numbers]), steps=(*self.steps, step))

    def check_numbers(self, modes: Sequence[int]) -> None:
        """The modes of these numbers are there, each asked for once."""
        for k in modes:
            if not 1 <= k <= self.modes:
                raise InputError(
                    f"modes: {k} is not in the file, which holds modes 1 to {self.modes}; choose "
                    "among them."
                )
        if len(set(modes)) != len(modes) or not modes:
            raise InputError(
                f"modes = {list(modes)!r} must name at least one mode, and each only once."
            )

    def frozen(self) -> "ModalData":
        """The data without modes: a rigid appendage."""
        return self._with_modes([])

    def _with_modes(self, modes: Sequence[int]) -> "ModalData":
        pick = np.array(modes, dtype=np.int64)
        return replace(
            self,
            frequencies=self.frequencies[pick],
            participation=self.participation[pick],
            damping=self.damping[pick],
            tip=None if self.tip is None else self.tip[pick],
            origin=self.in_file[pick],
            further=self._further(motion=lambda motion: motion[pick]),
        )

    @property
    def in_file(self) -> Array:
        """`(n, N)` each mode in terms of the modes of the file, or of its inner freedoms."""
        return np.eye(self.modes) if self.origin is None else self.origin

    def untangled(self) -> "ModalData":
        """The data with modes of equal frequency, whose directions are arbitrary,
        rotated into the bending planes."""
        groups = near_groups(self.frequencies, max(self.tolerance, 1e-9))
        turn, changed = turn_into_planes(self.participation, self.scale, groups)
        if not changed:
            return self
        groups_text = ", ".join("/".join(str(k + 1) for k in group) for group in changed)
        step = f"modes {groups_text} of equal frequency turned into the planes"
        return replace(
            self,
            frequencies=np.sqrt((turn**2) @ self.frequencies**2),
            participation=turn @ self.participation,
            tip=None if self.tip is None else turn @ self.tip,
            origin=turn @ self.in_file,
            further=self._further(motion=lambda motion: turn @ motion),
            steps=(*self.steps, step),
        )

    @property
    def states_line(self) -> bool:
        """Whether the file says how the mass lies along x."""
        return self.length is not None and (bool(self.pieces) or self.points.size > 0)

    def line(self, power: int = 0) -> MassLine:
        """Mass distribution along x: that of the file,
        otherwise the simplest that the rigid mass allows.

        Args:
            power: of x with which mass grows from the root; see `spread_mass`.

        Raises:
            InputError: the mass cannot be distributed over the length.
        """
        length = default_length(self.rigid_mass) if self.length is None else self.length
        if self.states_line and self.length is not None and power == 0:
            return mass_line_of_pieces(
                length,
                self.rigid_mass,
                pieces=self.pieces,
                points=self.points,
            )
        return spread_mass(self.rigid_mass, length, power)


def _words(values: Array) -> str:
    return "(" + ", ".join(f"{v:.6g}" for v in values) + ")"
