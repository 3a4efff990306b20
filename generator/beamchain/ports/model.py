"""The port: the dynamics of a structure at its root, in the form that the whole package uses.

A beam, a hinge chain, imported finite-element modes and a linearised MuJoCo model all become a `PortModel`.

Theory: docs/theory.md, section 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamchain.errors import InputError, RealisationError
from beamchain.ports.motions import Array, locked, square_root

if TYPE_CHECKING:
    import control

NORMAL = 1e-7  # part of an attachment mode outside the normal modes below which it is one of them
RESIDUAL_NOISE = 1e-14  # of the rigid mass: less residual mass is none
LOADED = 8  # models with different hubs that are kept
SINGULAR = 1e-15  # of a motion not in the others already: below, it is rounding
DAMPING_NOISE = -1e-6  # a measured ratio may be this far below zero by rounding


@dataclass(frozen=True, eq=False)
class Shapes:
    """Mode shapes where an appendage has mass, at `x` `(r,)` [m]: `values` `(n, r)` is motion times a square root.

    `moved`, `turned` `(r,)`: those roots of mass and rotary inertia; in a scalar port `moved` only.
    """

    x: Array
    moved: Array
    turned: Array
    values: Array
    bending: bool

    def momenta(self, hinges: Array) -> Array:
        """`(n, h)`: each mode's motion in the unit motion of hinges `(h,)` [m]."""
        reach = self.x[:, None] - hinges[None, :]
        behind = reach > 0.0
        arms = np.where(behind, reach, 0.0) if self.bending else behind
        return self.values @ (self.moved[:, None] * arms + self.turned[:, None] * behind)

    def combined(self, modes: Array) -> "Shapes":
        """Those of combinations `(k, n)` of the modes."""
        return Shapes(self.x, self.moved, self.turned, modes @ self.values, self.bending)


@dataclass(frozen=True, eq=False, repr=False)
class PortModel:
    """An elastic structure seen from its root: rigid mass, cantilever modes, damping.

    `D(s) = M - s^2 sum_k L_k L_k^T / (s^2 + 2 zeta_k W_k s + W_k^2)` is the wrench the root needs per unit
    acceleration; `W(s) = D(s)^-1` is the accelerance. `m` is the number of motions of the port: 2 in a bending plane
    (displacement, rotation), 1 in torsion or axial motion, 6 in space.

    Source: P. P. Belonozhko (2008), equations (13)-(16) (equality of `W` at the root is his dynamic equivalence);
    D. Alazard, F. Sanfedino, the TITOP model, for the cantilever form.

    Args:
        rigid_mass: `(m, m)` mass matrix of the frozen structure about the port, `D(0)` [kg, kg m, kg m^2].
        frequencies: `(n,)` cantilever frequencies (port held), ascending [rad/s].
        participation: `(n, m)` rows `L_k` of the mass-normalised cantilever modes.
        damping: `(n,)` damping ratios of the cantilever modes; default: zero.
        tip: `(n, m)` or more columns: tip motion in each mass-normalised cantilever mode, where known, then that of
            further points.
        shapes: the modes along the appendage, where known.

    Raises:
        InputError: shapes disagree, a number is not finite, or the residual mass is not positive semidefinite.

    Example:
        >>> import beamchain as bc
        >>> import numpy as np
        >>> model = bc.PortModel(rigid_mass=np.array([[4.0]]), frequencies=np.array([2.0]), participation=np.array([[1.5]]))
        >>> model.residual_mass
        array([[1.75]])
        >>> model.free_frequencies.round(4)
        array([3.0237])
    """

    rigid_mass: Array
    frequencies: Array
    participation: Array
    damping: Array = field(default_factory=lambda: np.zeros(0))
    tip: Array | None = None
    shapes: Shapes | None = None

    def __repr__(self) -> str:
        few = ", ".join(f"{w:.6g}" for w in self.frequencies[:3]) + (", ..." if self.modes > 3 else "")
        held = f"{self.modes} modes: {few} rad/s" if self.modes else "rigid"
        size = self.rigid_mass.shape[0]
        return f"<PortModel, {size} motion{'s' if size > 1 else ''}, {held}>"

    def __post_init__(self) -> None:
        mass = locked(self.rigid_mass)
        frequencies = locked(self.frequencies)
        n, m = frequencies.size, mass.shape[0] if mass.ndim == 2 else -1
        participation = np.array(self.participation, dtype=np.float64).reshape(n, -1 if n else max(m, 0))
        damping = np.zeros(n) if np.size(self.damping) == 0 else np.array(self.damping, dtype=np.float64)
        if frequencies.ndim != 1 or mass.shape != (m, m) or participation.shape != (n, m) or damping.shape != (n,):
            raise InputError(
                f"a port model needs rigid_mass (m, m), frequencies (n,), participation (n, m), damping (n,); got "
                f"{mass.shape}, {frequencies.shape}, {participation.shape}, {damping.shape}."
            )
        given = {"rigid_mass": mass, "frequencies": frequencies, "participation": participation, "damping": damping}
        for name, values in given.items():
            if not np.all(np.isfinite(values)):
                raise InputError(f"{name} holds a value that is not finite; give finite numbers only.")
        if np.any(damping < DAMPING_NOISE):
            raise InputError(f"damping = {damping.tolist()} holds a negative ratio; give zero or more.")
        size = np.sqrt(np.clip(np.diag(mass), 0.0, None))
        if np.any(np.diag(mass) <= 0.0):
            raise InputError(
                f"rigid_mass has the diagonal {np.diag(mass).tolist()}; masses and inertias must be positive."
            )
        if np.any(np.abs(mass - mass.T) > 1e-6 * np.outer(size, size)):
            raise InputError("rigid_mass is not symmetric; give the mass matrix about one point, the port.")
        if np.any(frequencies <= 0.0) or np.any(np.diff(frequencies) < 0.0):
            raise InputError(f"frequencies = {frequencies.tolist()} must be positive and ascending.")
        tip = None if self.tip is None else np.array(self.tip, dtype=np.float64)
        if n:  # a mode's sign makes its first participation that is not noise positive
            weight = np.abs(participation) / np.sqrt(np.diag(mass))
            leading = np.argmax(weight > 1e-9 * np.maximum(weight.max(axis=1), 1e-300)[:, None], axis=1)
            signs = np.where(participation[np.arange(n), leading] < 0.0, -1.0, 1.0)[:, None]
            participation = participation * signs
            tip = None if tip is None else tip * signs
            if self.shapes is not None and np.any(signs < 0.0):
                object.__setattr__(self, "shapes", self.shapes.combined(np.diag(signs[:, 0])))
        given |= {"participation": locked(participation), "damping": locked(damping)}
        for name, values in {**given, "tip": None if tip is None else locked(tip)}.items():
            object.__setattr__(self, name, values)
        scale = np.sqrt(np.clip(np.diag(mass), 1e-300, None))
        smallest = float(np.linalg.eigvalsh(self.residual_mass / np.outer(scale, scale))[0])
        if not smallest > -1e-9:
            raise InputError(
                f"the residual mass (rigid mass minus effective masses) has eigenvalue {smallest:.3e} relative to the "
                "rigid mass, which is negative: check the reference point, the units and the rigid mass."
            )

    # -- sizes ---------------------------------------------------------------------------------------------------
    @property
    def modes(self) -> int:
        """Number of flexible modes."""
        return self.frequencies.size

    @property
    def motions(self) -> int:
        """Number of motions of the port, `m`."""
        return self.rigid_mass.shape[0]

    # -- mass ----------------------------------------------------------------------------------------------------
    @property
    def effective_mass(self) -> Array:
        """`(n, m, m)` effective masses `L_k L_k^T`."""
        return self.participation[:, :, None] * self.participation[:, None, :]

    @property
    def residual_mass(self) -> Array:
        """`(m, m)` rigid mass minus the effective masses: the mass at the root at infinite frequency."""
        return self.rigid_mass - self.participation.T @ self.participation

    @property
    def gains(self) -> Array:
        """`(m, m)` accelerance at infinite frequency, the paper's gains `k`."""
        return np.asarray(np.linalg.inv(self.residual_mass), dtype=np.float64)

    # -- free modes ----------------------------------------------------------------------------------------------
    def _rows(self) -> tuple[Array, Array]:
        """Weighted motion rows: rigid `(n+m, m)` and elastic `(n+m, n)`."""
        scale = np.sqrt(np.diag(self.rigid_mass))
        scaled = self.residual_mass / np.outer(scale, scale)
        if np.linalg.eigvalsh(scaled)[0] < RESIDUAL_NOISE:  # a direction without residual mass shall be one exactly
            root = square_root(scaled, RESIDUAL_NOISE) * scale
        else:
            root = square_root(self.residual_mass)
        rigid = np.vstack([self.participation, root])
        elastic = np.vstack([np.diag(1.0 / self.frequencies), np.zeros((self.motions, self.modes))])
        return rigid, elastic

    @cached_property
    def _free(self) -> tuple[Array, Array, Array, Array]:
        """Free frequencies, port values, singular vectors, rigid port values `P0`."""
        rigid, elastic = self._rows()
        q, r = np.linalg.qr(rigid)
        along = q.T @ elastic
        _, s, vt = np.linalg.svd(elastic - q @ along, full_matrices=False)
        finite = s > 1e-13 * np.max(1.0 / self.frequencies, initial=0.0)  # a singular residual sends a mode to infinity
        s, v = s[finite], vt[finite].T
        if np.any(np.abs(np.diag(r)) <= SINGULAR * np.linalg.norm(r, axis=0)):
            raise RealisationError(
                f"the rigid mass matrix (diagonal {', '.join(f'{v:.3g}' for v in np.diag(self.rigid_mass))}) is singular "
                "in double precision: one mass or inertia is too far above all others; check their sizes and units."
            )
        values = -np.linalg.solve(r, along @ v) / s
        return locked(1.0 / s), locked(values.T), locked(v), locked(np.linalg.inv(r))

    @property
    def free_frequencies(self) -> Array:
        """`(n,)` free frequencies, the poles of `W` [rad/s]."""
        return self._free[0]

    @property
    def free_damping(self) -> Array:
        """`(n,)` damping ratios of the free modes, where damping does not couple them."""
        frequencies, _, shares, _ = self._free
        return np.asarray(frequencies * ((self.damping / self.frequencies) @ shares**2), dtype=np.float64)

    @property
    def free_port_values(self) -> Array:
        """`(n, m)` port motion in each mass-normalised free mode."""
        return self._free[1]

    @property
    def rigid_port_values(self) -> Array:
        """`(m, m)` port motion in the rigid modes: column i is mode i; `P0 P0^T = M^-1`."""
        return self._free[3]

    # -- responses -----------------------------------------------------------------------------------------------
    def D(self, omega: ArrayLike) -> NDArray[np.complex128]:  # noqa: N802 (the field's letter)
        """Dynamic mass `(m, m, k)`: wrench per unit acceleration at `omega` `(k,)` [rad/s]."""
        s = 1j * np.atleast_1d(np.asarray(omega, dtype=np.float64))
        w = self.frequencies[:, None]
        weight = s**2 / (s**2 + 2.0 * self.damping[:, None] * w * s + w**2)
        m, effective = self.motions, self.effective_mass.reshape(self.modes, self.motions**2)
        # real times complex as real products, which is what takes the time where modes are many
        parts = effective.T @ np.ascontiguousarray(weight, dtype=np.complex128).view(np.float64)
        flexible = parts.view(np.complex128).reshape(m, m, s.size)
        return self.rigid_mass.astype(np.complex128)[:, :, None] - flexible

    def W(self, omega: ArrayLike) -> NDArray[np.complex128]:  # noqa: N802
        """Accelerance `(m, m, k)`: acceleration per unit wrench at `omega` `(k,)` [rad/s]."""
        if np.any(self.damping > 0.0) or self.free_frequencies.size < self.modes:  # a massless root follows its spring
            inverse = np.linalg.inv(np.moveaxis(self.D(omega), -1, 0))
            return np.moveaxis(np.asarray(inverse, dtype=np.complex128), 0, -1)
        frequency = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        weight = -(frequency**2) / (self.free_frequencies[:, None] ** 2 - frequency**2)
        m, p, p0 = self.motions, self.free_port_values, self.rigid_port_values
        outer = (p[:, :, None] * p[:, None, :]).reshape(p.shape[0], m * m)
        return ((p0 @ p0.T)[:, :, None] + (outer.T @ weight).reshape(m, m, -1)).astype(np.complex128)

    def zeros(self, output: int = 0, input: int = 0) -> NDArray[np.complex128]:
        """`(n,)` zeros of one entry of `W` as frequencies: `W_ij` carries the factors `s^2 + zero^2`.

        Args:
            output: row of `W`: 0 displacement, 1 rotation in a plane.
            input: column of `W`: 0 force, 1 moment in a plane.

        Source: Belonozhko (2008), equation (15), the `n_1`, `n_2`.
        """
        gain = self.gains[output, input]
        residues = self.free_port_values[:, output] * self.free_port_values[:, input]
        w2 = self.free_frequencies**2
        squares = np.linalg.eigvals(np.diag(w2) - np.outer(np.ones(w2.size), residues * w2) / gain)
        squares = squares[np.argsort(squares.real)].astype(np.complex128)
        if output == input:  # all real, the low ones better from the inverse, which keeps their digits
            static = np.sum(self.rigid_port_values[output] ** 2)
            slow = 1.0 / np.linalg.eigvals(np.diag(1.0 / w2) + np.outer(1.0 / w2, residues) / static)
            squares[: w2.size // 2] = slow[np.argsort(slow.real)][: w2.size // 2]
        return np.sqrt(squares)

    def to_control(self) -> "control.StateSpace":
        """The accelerance as `control.StateSpace`, 2n states, exact.

        States: modal coordinates of the held appendage and their rates; inputs: wrench; outputs: acceleration.
        """
        import control

        a, b, c, d = self.state_space()
        return cast("control.StateSpace", control.ss(a, b, c, d))

    def state_space(self) -> tuple[Array, Array, Array, Array]:
        """The matrices of `to_control`: A `(2n, 2n)`, B `(2n, m)`, C `(m, 2n)`, D `(m, m)`."""
        n, m = self.modes, self.motions
        gain = self.gains
        spring = np.hstack([np.diag(self.frequencies**2), np.diag(2.0 * self.damping * self.frequencies)])
        c = gain @ self.participation.T @ spring
        a = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), -spring - self.participation @ c])
        b = np.vstack([np.zeros((n, m)), -self.participation @ gain])
        return a, b, c, gain

    # -- made from this one --------------------------------------------------------------------------------------
    def with_hub(self, hub_mass: ArrayLike) -> "PortModel":
        """The same with a rigid hub, `hub_mass` `(m, m)` [kg, kg m, kg m^2], on its port: free modes are the coupled modes."""
        hub = np.asarray(hub_mass, dtype=np.float64)
        if hub.shape != self.rigid_mass.shape:
            raise InputError(f"hub_mass has shape {hub.shape}, but the port needs {self.rigid_mass.shape}.")
        key = hub.tobytes()
        if key not in self._loaded:
            if len(self._loaded) >= LOADED:
                self._loaded.clear()
            self._loaded[key] = self.replaced(rigid_mass=self.rigid_mass + hub)
        return self._loaded[key]

    @cached_property
    def _loaded(self) -> "dict[bytes, PortModel]":
        """Models with a hub that were made already: their modes are dear."""
        return {}

    def last_on_hub(self, hub_mass: ArrayLike) -> float:
        """Last coupled frequency on a rigid hub, `hub_mass` `(m, m)`; 0 without any [rad/s]."""
        return float(np.max(self.with_hub(hub_mass).free_frequencies, initial=0.0))

    def truncated(self, modes: int) -> "PortModel":
        """Only the first `modes` cantilever modes; the rigid mass stays."""
        if not 0 <= modes <= self.modes:
            raise InputError(f"modes = {modes} must lie between 0 and {self.modes}, the number this model has.")
        return self.picked(range(modes))

    def picked(self, modes: Sequence[int]) -> "PortModel":
        """Only some cantilever modes, numbers from 0 ascending; the rigid mass stays."""
        pick = np.array(modes, dtype=np.int64)
        return self.replaced(
            frequencies=self.frequencies[pick], participation=self.participation[pick], damping=self.damping[pick],
            tip=None if self.tip is None else self.tip[pick],
            shapes=None if self.shapes is None else self.shapes.combined(np.eye(self.modes)[pick]),
        )  # fmt: skip

    def condensed(self, above: float) -> "PortModel":
        """The modes above a frequency [rad/s] gathered into as many as the port has motions, with their static flexibility."""
        low = self.frequencies <= above
        if np.sum(~low) <= self.motions:
            return self
        high = self.participation[~low] / self.frequencies[~low, None] * above
        values, vectors = np.linalg.eigh(high.T @ high)
        keep = values > 1e-14 * values.max()
        rows = np.sqrt(values[keep])[:, None] * vectors.T[keep]
        damping = np.full(rows.shape[0], float(np.mean(self.damping[~low])))
        return PortModel(
            self.rigid_mass,
            np.concatenate([self.frequencies[low], np.full(rows.shape[0], above)]),
            np.vstack([self.participation[low], rows]),
            np.concatenate([self.damping[low], damping]),
        )

    def reduced(self, modes: int, hub_mass: ArrayLike) -> "PortModel":
        """Galerkin reduction on the first `modes` modes with `hub_mass` `(m, m)` on the port, zeros for the free target.

        Damping is left out: it belongs to the cantilever modes of the full model.
        """
        if modes == 0:
            return self.truncated(0)
        if not 0 < modes <= self.modes:
            raise InputError(f"modes = {modes} must lie between 0 and {self.modes}, the number this model has.")
        return self._projected(self.with_hub(hub_mass)._free[2][:, :modes])

    def for_target(self, target: str, modes: int, hub_mass: Array | None = None) -> "PortModel":
        """The lowest `modes` for a `target`: cantilever ("clamped"), or with nothing ("free") or `hub_mass` ("hub") attached."""
        if target == "clamped":
            return self.truncated(modes)
        attached = np.zeros_like(self.rigid_mass) if target == "free" else hub_mass
        assert attached is not None
        return self.reduced(modes, attached)

    def _projected(self, basis: Array) -> "PortModel":
        """Galerkin reduction on an orthonormal `basis` `(n, k)` of scaled modes."""
        rigid, elastic = self._rows()
        u, s, wt = np.linalg.svd(elastic @ basis, full_matrices=False)
        modes = (basis @ wt.T / s).T / self.frequencies  # (k, n): in terms of this model's mass-normalised modes
        return PortModel(
            self.rigid_mass, 1.0 / s, u.T @ rigid, tip=None if self.tip is None else modes @ self.tip,
            shapes=None if self.shapes is None else self.shapes.combined(modes),
        )  # fmt: skip

    def attached(self, modes: int, columns: Sequence[int]) -> "PortModel":
        """The first `modes` modes and the static response to a unit load at the points of some columns of `tip`.

        The static flexibility of those points is then exact (attachment modes; R. R. Craig, Structural Dynamics, 1981).
        """
        assert self.tip is not None
        loads = self.tip[:, list(columns)] / self.frequencies[:, None]
        sizes = np.linalg.norm(loads, axis=0)
        loads = np.where(sizes > 0.0, loads, 0.0) / np.where(sizes > 0.0, sizes, 1.0)
        loads[:modes] = 0.0  # what the normal modes do not carry already
        u, s, _ = np.linalg.svd(loads, full_matrices=False)
        return self._projected(np.column_stack([np.eye(self.modes)[:, :modes], u[:, s > NORMAL]]))

    def replaced(self, **changes: Any) -> "PortModel":
        """A copy with some fields changed, `changes` by name."""
        names = ("rigid_mass", "frequencies", "participation", "damping", "tip", "shapes")
        return PortModel(**{name: changes.get(name, getattr(self, name)) for name in names})
