"""Modes somebody else computed: cantilever frequencies, participation and rigid mass about the port, from any program."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import connected_components

from beamchain.errors import InputError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array, locked
from beamchain.structure.mass_line import MassLine, MassPiece, default_length, of_line, spread
from beamchain.structure.planes import MOTIONS, PRINTED, ROUNDING, into_planes, near_groups, settled

SLIGHT = 1e-9  # part of a mode or of the rigid mass in a port that is rounding
EXACT = 1e-13  # relative precision of numbers that were not printed


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
        pieces, points: the mass distribution along x, where known; see `SpreadMass`.
        precision: relative, of the printed numbers.
        source: origin of the data.
        steps: changes made to the numbers, in order.
        printed: the numbers are as printed; False once the effects of rounding have been removed.
        uncertain: what the file says is not known exactly of the modes, as [uncertain] of a specification would.

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

    def __repr__(self) -> str:
        few = ", ".join(f"{w:.6g}" for w in self.frequencies[:3]) + (", ..." if self.frequencies.size > 3 else "")
        return (
            f"<ModalData {self.source!r}, {self.rigid_mass[0, 0]:.6g} kg, {self.frequencies.size} modes: {few} rad/s>"
        )

    def __post_init__(self) -> None:
        mass, w = np.array(self.rigid_mass, dtype=np.float64), np.array(self.frequencies, dtype=np.float64)
        n = w.size
        rows = np.array(self.participation, dtype=np.float64)
        damping = np.zeros(n) if np.size(self.damping) == 0 else np.array(self.damping, dtype=np.float64)
        if mass.shape != (6, 6) or rows.shape != (n, 6) or damping.shape != (n,) or w.shape != (n,):
            raise InputError(
                f"{self.source}: the sizes do not fit: mass {mass.shape}, frequencies {w.shape}, participation "
                f"{rows.shape}, damping {damping.shape}; give mass (6, 6) and for n modes n frequencies, participation "
                "6 x n and one damping ratio each."
            )
        if n == 0 and self.printed:
            raise InputError(f"{self.source}: there is no mode; export the cantilever modes of the structure.")
        tip = None if self.tip is None else np.array(self.tip, dtype=np.float64)
        if tip is not None and tip.shape != (n, 6):
            raise InputError(f"{self.source}: tip has the shape {tip.shape}; give the six motions of the tip per mode.")
        given = {"mass": mass, "frequencies": w, "participation": rows, "damping": damping, "points": self.points}
        for name, values in given.items() if tip is None else {**given, "tip": tip}.items():
            if not np.all(np.isfinite(values)):
                raise InputError(
                    f"{self.source}: {name} holds a value that is not a finite number; export the modes again."
                )
        if np.any(w <= 0.0):
            raise InputError(
                f"{self.source}: mode {int(np.argmin(w)) + 1} has the frequency {float(w.min()):.4g}: the structure "
                "was not held at its port; clamp the port (SPC) and compute the modes again."
            )
        order = np.argsort(w, kind="stable")
        w, rows, damping = w[order], rows[order], damping[order]
        tip = None if tip is None else tip[order]
        size = np.sqrt(np.clip(np.diag(mass), 0.0, None))
        if np.any(np.diag(mass)[:3] <= 0.0) or np.any(np.diag(mass) < 0.0):
            raise InputError(
                f"{self.source}: the rigid mass matrix has the diagonal {np.diag(mass).tolist()}; masses must be "
                "positive."
            )
        worst = np.abs(mass - mass.T) - max(self.tolerance, 1e-6) * np.outer(size, size)
        if np.any(worst > 0.0):
            i, j = np.unravel_index(int(np.argmax(worst)), (6, 6))
            raise InputError(
                f"{self.source}: the rigid mass matrix is not symmetric ({MOTIONS[i]}, {MOTIONS[j]}: {mass[i, j]:.6g} "
                f"and {mass[j, i]:.6g}); give it about one point, the port."
            )
        try:
            mass, change = settled((mass + mass.T) / 2.0, rows, self.precision if self.printed else 0.0)
        except InputError as error:
            raise InputError(f"{self.source}: {error}") from None
        steps = list(self.steps)
        if change > 10.0 * EXACT:
            steps.append(
                f"rigid mass moved by {change:.1e} relative, within the printed precision of {self.precision:.0e}, so "
                "that the residual mass is nowhere negative"
            )
        for name, value in {
            "rigid_mass": locked(mass), "frequencies": locked(w), "participation": locked(rows),
            "damping": locked(damping), "tip": None if tip is None else locked(tip),
            "points": locked(self.points), "pieces": tuple(self.pieces), "steps": tuple(steps), "printed": False,
        }.items():  # fmt: skip
            object.__setattr__(self, name, value)

    # -- sizes and checks ------------------------------------------------------------------------------------------
    @property
    def modes(self) -> int:
        """Number of modes."""
        return self.frequencies.size

    @property
    def tolerance(self) -> float:
        """Relative size below which a number that should be zero, or two that should be equal, differ by rounding."""
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

    @property
    def shares(self) -> Array:
        """`(n, 4)` share of each port in each mode's participation, every motion scaled by its rigid mass."""
        rows = (self.participation / self.scale) ** 2
        out = np.column_stack([rows @ np.sum(PORT_MOTION[port] ** 2, axis=1) for port in PORTS])
        return out / np.clip(out.sum(axis=1, keepdims=True), 1e-300, None)

    @property
    def belongs(self) -> tuple[str, ...]:
        """Port of each mode: where its participation is largest."""
        return tuple(PORTS[i] for i in np.argmax(self.shares, axis=1))

    @property
    def leaks(self) -> Array:
        """`(n,)` part of each mode's participation that lies outside its port, 0 to 1."""
        out = np.sqrt(np.clip(1.0 - np.max(self.shares, axis=1), 0.0, 1.0))
        return np.where(out < max(self.tolerance, 1e-12), 0.0, out)

    @property
    def parts(self) -> Array:
        """`(n, 4)` part of each port in each mode's participation, 0 where only rounding moves it."""
        out = np.sqrt(self.shares)
        return np.where(out < max(self.tolerance, SLIGHT), 0.0, out)

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Ports that modes or the rigid mass couple, those that a mode moves."""
        parts = self.parts
        linked = (parts.T @ parts) > 0.0
        across = np.abs(self.rigid_mass / np.outer(self.scale, self.scale)) > max(self.tolerance, SLIGHT)
        for i, a in enumerate(PORTS):
            for j, b in enumerate(PORTS):
                linked[i, j] |= bool(np.any((np.abs(PORT_MOTION[a]).T @ across @ np.abs(PORT_MOTION[b])) > 0.0))
        count, owner = connected_components(linked, directed=False)
        groups = [np.flatnonzero(owner == k).tolist() for k in range(count)]
        return tuple(tuple(PORTS[i] for i in group) for group in groups if np.any(parts[:, group] > 0.0))

    # -- port models -----------------------------------------------------------------------------------------------
    def space(self) -> PortModel:
        """The port model with all six motions (those without inertia left out; see `live`)."""
        live = self.live
        tip = None if self.tip is None else self.tip[:, :2]
        return PortModel(
            self.rigid_mass[np.ix_(live, live)], self.frequencies, self.participation[:, live], self.damping, tip
        )

    def port(self, port: str, *, own: bool = False) -> PortModel:
        """The port model of one port, all other motions of the root held.

        Args:
            port: "xy", "xz", "torsion" or "axial".
            own: only the modes that belong there.
        """
        motion = PORT_MOTION[port]
        share = self.shares[:, PORTS.index(port)]
        pick = np.array([b == port for b in self.belongs]) if own else share > max(self.tolerance, EXACT) ** 2
        rows = self.participation[pick] @ motion
        mass, _ = settled(motion.T @ self.rigid_mass @ motion, rows, min(self.precision, PRINTED / ROUNDING))
        tip = None if self.tip is None else self.tip[pick] @ motion
        return PortModel(mass, self.frequencies[pick], rows, self.damping[pick], tip)

    # -- made from this one ----------------------------------------------------------------------------------------
    def scaled(self, length: float, mass: float) -> "ModalData":
        """The data in SI, given the file's units.

        Args:
            length: metres per unit of length of the file.
            mass: kilograms per unit of mass.
        """
        if length == 1.0 and mass == 1.0:
            return self
        turn = np.array([1.0, 1.0, 1.0, length, length, length])
        per_length = np.array([1 / length, length, length, length])
        pieces = [MassPiece(p.start * length, p.length * length, p.densities * mass * per_length) for p in self.pieces]
        return replace(
            self,
            rigid_mass=self.rigid_mass * mass * np.outer(turn, turn),
            participation=self.participation * np.sqrt(mass) * turn,
            tip=None if self.tip is None else self.tip / np.sqrt(mass) / turn,
            length=None if self.length is None else self.length * length,
            points=self.points * np.array([length, mass, *([mass * length**2] * 3)]),
            pieces=tuple(pieces),
            steps=(*self.steps, f"units: 1 length unit = {length:g} m, 1 mass unit = {mass:g} kg"),
        )

    def moved(self, reference: ArrayLike, axes: ArrayLike | None = None) -> "ModalData":
        """The data about another point, in other axes.

        Args:
            reference: `(3,)` the port, from the present point, in the present axes and units.
            axes: `(3, 3)` rows: appendage x, y, z in the present axes.

        Raises:
            InputError: the axes are not orthonormal and right-handed.
        """
        r = np.asarray(reference, dtype=np.float64)
        turn = np.eye(3) if axes is None else np.asarray(axes, dtype=np.float64)
        if np.max(np.abs(turn @ turn.T - np.eye(3))) > 1e-6 or np.linalg.det(turn) < 0.0:
            raise InputError(
                f"axes = {turn.tolist()} are not three perpendicular unit vectors, right-handed; give appendage x, y, "
                "z as rows, each of length 1, with z = x cross y."
            )
        left, _, right = np.linalg.svd(turn)  # six printed digits of a direction are not exactly orthonormal
        turn = left @ right
        if not np.any(r) and np.array_equal(turn, np.eye(3)):
            return self
        x, y, z = r
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        motion = np.block([[turn.T, cross @ turn.T], [np.zeros((3, 3)), turn.T]])
        both = np.block([[turn, np.zeros((3, 3))], [np.zeros((3, 3)), turn]])
        words = f"port at {_words(r)} of the file"
        if not np.array_equal(turn, np.eye(3)):
            words += f", axes {'; '.join(_words(row) for row in turn)}"
        return replace(
            self,
            rigid_mass=motion.T @ self.rigid_mass @ motion,
            participation=self.participation @ motion,
            tip=None if self.tip is None else self.tip @ both.T,
            pieces=(),
            points=np.zeros((0, 5)),
            steps=(*self.steps, words),
        )

    def selected(self, modes: Sequence[int]) -> "ModalData":
        """Only some modes, numbered from 1 in the order of their frequencies.

        Raises:
            InputError: a number is given twice or lies beyond the last mode.
        """
        for k in modes:
            if not 1 <= k <= self.modes:
                raise InputError(
                    f"modes: {k} is not in the file, which holds modes 1 to {self.modes}; choose among them."
                )
        if len(set(modes)) != len(modes) or not modes:
            raise InputError(f"modes = {list(modes)!r} must name at least one mode, and each only once.")
        said = f"modes {', '.join(str(k) for k in sorted(modes))} of {self.modes} taken"
        return replace(self._picked([k - 1 for k in sorted(modes)]), steps=(*self.steps, said))

    def frozen(self) -> "ModalData":
        """The data without modes: a rigid appendage."""
        return self._picked([])

    def _picked(self, modes: Sequence[int]) -> "ModalData":
        pick = np.array(modes, dtype=np.int64)
        return replace(
            self, frequencies=self.frequencies[pick], participation=self.participation[pick],
            damping=self.damping[pick], tip=None if self.tip is None else self.tip[pick],
        )  # fmt: skip

    def untangled(self) -> "ModalData":
        """The data with modes of equal frequency, whose directions are arbitrary, rotated into the bending planes."""
        groups = near_groups(self.frequencies, max(self.tolerance, 1e-9))
        turn, changed = into_planes(self.participation, self.scale, groups)
        if not changed:
            return self
        words = ", ".join("/".join(str(k + 1) for k in group) for group in changed)
        return replace(
            self, frequencies=np.sqrt((turn**2) @ self.frequencies**2), participation=turn @ self.participation,
            tip=None if self.tip is None else turn @ self.tip,
            steps=(*self.steps, f"modes {words} of equal frequency turned into the planes"),
        )  # fmt: skip

    def line(self, power: int = 0) -> MassLine:
        """Mass distribution along x: that of the file, otherwise the simplest that the rigid mass allows.

        Args:
            power: of x with which mass grows from the root; see `spread`.

        Raises:
            InputError: the mass cannot be distributed over the length.
        """
        length = default_length(self.rigid_mass) if self.length is None else self.length
        stiffness: dict[str, float] = {}
        for port in PORTS:
            own = [float(w) for w, b in zip(self.frequencies, self.belongs, strict=True) if b == port]
            if own:  # of the uniform beam or bar with that first frequency
                i = int(np.argmax(PORT_MOTION[port][:, 0]))
                factor = length**3 / 12.36 if port in ("xy", "xz") else (2.0 / np.pi) ** 2 * length
                stiffness[port] = own[0] ** 2 * max(float(self.rigid_mass[i, i]), 1e-30) * factor
        if self.length is not None and (self.pieces or self.points.size) and power == 0:
            return of_line(length, self.rigid_mass, self.pieces, self.points, stiffness)
        return spread(self.rigid_mass, length, stiffness, power)


def _words(values: Array) -> str:
    return "(" + ", ".join(f"{v:.6g}" for v in values) + ")"
