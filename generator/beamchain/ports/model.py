"""The port: the dynamics of a structure at its root, in the form that the whole package uses.

A beam, a hinge chain, imported finite-element modes and a linearised MuJoCo model all
become a `PortModel`.

Theory: docs/theory.md, section 1.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamchain.checks import as_array, finite_array, one_of
from beamchain.errors import InputError, RealisationError
from beamchain.import_lock import importing
from beamchain.ports.motions import PORT_MOTION, PORTS, Array, locked, square_root
from beamchain.ports.rows import Rows

if TYPE_CHECKING:
    import control

NORMAL = 1e-7  # part of an attachment mode outside the normal modes below which it is one of them
RESIDUAL_NOISE = 1e-14  # of the rigid mass: less residual mass is none
LOADED = 8  # models with different hubs that are kept
SINGULAR = 1e-15  # of a motion outside the others: below, the part is rounding
DAMPING_NOISE = -1e-6  # a measured ratio may be this far below zero by rounding


@dataclass(frozen=True, eq=False)
class Shapes:
    """Mode shapes where an appendage has mass, at `x` `(r,)` [m]:
    `values` `(n, r)` is motion times a square root.

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
        momentum = self.moved[:, None] * arms + self.turned[:, None] * behind
        return self.values @ momentum

    def combined(self, modes: Array) -> "Shapes":
        """The shapes of combinations `(k, n)` of the modes."""
        return Shapes(self.x, self.moved, self.turned, modes @ self.values, self.bending)


def _check_shapes(mass: Array, frequencies: Array, participation: Array, damping: Array) -> None:
    n = frequencies.size
    m = mass.shape[0] if mass.ndim == 2 else -1
    if (
        frequencies.ndim != 1
        or mass.shape != (m, m)
        or participation.shape != (n, m)
        or damping.shape not in {(n,), (n, n)}
    ):
        raise InputError(
            "a port model needs rigid_mass (m, m), frequencies (n,), participation (n, m), "
            f"damping (n,) or (n, n); got {mass.shape}, {frequencies.shape}, "
            f"{participation.shape}, {damping.shape}."
        )


def _check_finite(arrays: Mapping[str, Array]) -> None:
    for name, values in arrays.items():
        if not np.all(np.isfinite(values)):
            raise InputError(f"{name} holds a value that is not finite; give finite numbers only.")


def _check_damping(damping: Array) -> None:
    ratios = np.linalg.eigvalsh(damping) if damping.ndim == 2 else damping
    if np.any(ratios < DAMPING_NOISE):
        raise InputError(f"damping = {damping.tolist()} holds a negative ratio; give zero or more.")


def _check_rigid_mass(mass: Array) -> None:
    """Positive masses and inertias, and symmetry."""
    diagonal = np.diag(mass)
    if np.any(diagonal <= 0.0):
        raise InputError(
            f"rigid_mass has the diagonal {diagonal.tolist()}; masses and inertias must "
            "be positive."
        )
    scale = np.sqrt(diagonal)
    if np.any(np.abs(mass - mass.T) > 1e-6 * np.outer(scale, scale)):
        raise InputError(
            "rigid_mass is not symmetric; give the mass matrix about one point, the port."
        )


def _check_frequencies(frequencies: Array) -> None:
    if np.any(frequencies <= 0.0) or np.any(np.diff(frequencies) < 0.0):
        raise InputError(f"frequencies = {frequencies.tolist()} must be positive and ascending.")


def _check_labels(labels: Sequence[str], modes: int) -> None:
    """One per mode or none, each a port's name or empty."""
    known = ("", *PORTS)
    unknown = [label for label in labels if label not in known]
    if unknown or len(labels) not in (0, modes):
        raise InputError(
            f"labels = {labels!r:.80} must name a port ({', '.join(PORTS)}, or '' for several) for "
            f"each of the {modes} modes, or be empty."
        )


def _check_residual_mass(residual: Array, mass: Array) -> None:
    """The modes take no more than the rigid mass."""
    scale = np.sqrt(np.diag(mass))
    smallest = float(np.linalg.eigvalsh(residual / np.outer(scale, scale))[0])
    if not smallest > -1e-9:
        raise InputError(
            "the residual mass (rigid mass minus effective masses) has eigenvalue "
            f"{smallest:.3e} relative to the rigid mass, which is negative: check the "
            "reference point, the units and the rigid mass."
        )


def _leading_signs(participation: Array, mass: Array) -> Array:
    """`(n,)` signs that make each mode's first participation beyond noise positive."""
    n = len(participation)
    if n == 0:
        return np.ones(0)
    weight = np.abs(participation) / np.sqrt(np.diag(mass))
    noise = 1e-9 * np.maximum(weight.max(axis=1), 1e-300)
    leading = np.argmax(weight > noise[:, None], axis=1)
    return np.where(participation[np.arange(n), leading] < 0.0, -1.0, 1.0)


class _FreeModes(NamedTuple):
    """Modes of a structure whose root is free."""

    frequencies: Array  # (n,) [rad/s]
    port_values: Array  # (n, m) port motion in each mass-normalised mode
    shares: Array  # (modes held, n) each free mode in terms of W q, orthonormal columns
    rigid_port_values: Array  # (m, m) `P0`


@dataclass(frozen=True, eq=False, repr=False)
class PortModel:
    """An elastic structure seen from its root: rigid mass, cantilever modes, damping.

    `D(s) = M - s^2 sum_k L_k L_k^T / (s^2 + 2 zeta_k W_k s + W_k^2)` is the wrench the root needs
    per unit acceleration; `W(s) = D(s)^-1` is the accelerance. `m` is the number of motions of the
    port: 2 in a bending plane (displacement, rotation), 1 in torsion or axial motion, 6 in space.

    Source: P. P. Belonozhko (2008), equations (13)-(16) (equality of `W` at the root is his dynamic
    equivalence); D. Alazard, F. Sanfedino, the TITOP model, for the cantilever form.

    Args:
        rigid_mass: `(m, m)` mass matrix of the frozen structure about the port,
            `D(0)` [kg, kg m, kg m^2].
        frequencies: `(n,)` cantilever frequencies (port held), ascending [rad/s].
        participation: `(n, m)` rows `L_k` of the mass-normalised cantilever modes.
        damping: `(n,)` damping ratios of the cantilever modes, or `(n, n)` where dampers couple
            them: `Z` with the damping matrix `2 W^1/2 Z W^1/2`, the ratios on its diagonal;
            default: zero.
        tip: `(n, m)` or more columns: tip motion in each mass-normalised cantilever mode, where
            known, then that of further points.
        points: x of the tip and of the further points [m], where known.
        shapes: the modes along the appendage, where known.
        labels: `(n,)` the port that each mode moves, "xy", "xz", "torsion" or "axial", or "" for
            one that moves several; empty: not known.

    Raises:
        InputError: shapes disagree, a number is not finite,
            or the residual mass is not positive semidefinite.

    Example:
        >>> import beamchain as bc
        >>> import numpy as np
        >>> model = bc.PortModel(
        ...     rigid_mass=np.array([[4.0]]),
        ...     frequencies=np.array([2.0]),
        ...     participation=np.array([[1.5]]),
        ... )
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
    labels: tuple[str, ...] = ()
    points: tuple[float, ...] = ()

    @classmethod
    def from_rows(
        cls,
        rows: Rows,
        *,
        rigid_mass: Array | None = None,
        shapes: Callable[[Array], Shapes] | None = None,
        points: Sequence[float] = (),
    ) -> "PortModel":
        """The port model of a structure that is known by its motion rows.

        Args:
            rows: its damping, where it has any, becomes `damping` `(n, n)`, its points `tip`.
            rigid_mass: `(m, m)` where it is not that of the rows.
            shapes: makes the shapes from the modes' weighted motion `(n, r)`.
            points: x of its points [m].

        Example:
            >>> import beamchain as bc
            >>> import numpy as np
            >>> # a point of 4 kg on the end of a spring of 16 N/m, and nothing else
            >>> rows = Rows(np.array([[2.0]]), np.array([[2.0]]), springs=np.array([[4.0]]))
            >>> model = bc.PortModel.from_rows(rows)
            >>> model.frequencies, model.rigid_mass
            (array([2.]), array([[4.]]))
        """
        modes = rows.normal_modes()
        coordinates = modes.coordinates
        damping = np.zeros(0)
        if rows.damping is not None:
            roots = np.sqrt(modes.frequencies)
            damping = coordinates.T @ rows.damping @ coordinates / np.outer(roots, roots) / 2.0
        return cls(
            rows.rigid.T @ rows.rigid if rigid_mass is None else rigid_mass,
            frequencies=modes.frequencies,
            participation=modes.participation,
            damping=damping,
            tip=None if rows.points is None else (rows.points @ coordinates).T,
            shapes=None if shapes is None else shapes(modes.momenta.T),
            points=tuple(points),
        )

    def __repr__(self) -> str:
        first = ", ".join(f"{w:.6g}" for w in self.frequencies[:3])
        more = ", ..." if self.modes > 3 else ""
        modes = f"{self.modes} modes: {first}{more} rad/s" if self.modes else "rigid"
        size = self.rigid_mass.shape[0]
        return f"<PortModel, {size} motion{'s' if size > 1 else ''}, {modes}>"

    def __post_init__(self) -> None:
        mass = as_array("rigid_mass", self.rigid_mass)
        frequencies = as_array("frequencies", self.frequencies)
        n = frequencies.size
        m = mass.shape[0] if mass.ndim == 2 else 0
        participation = as_array("participation", self.participation)
        if participation.size == n * m:
            participation = participation.reshape(n, m)
        damping = np.zeros(n) if np.size(self.damping) == 0 else as_array("damping", self.damping)
        _check_shapes(mass, frequencies, participation, damping)
        arrays = {
            "rigid_mass": mass,
            "frequencies": frequencies,
            "participation": participation,
            "damping": damping,
        }
        _check_finite(arrays)
        _check_damping(damping)
        _check_rigid_mass(mass)
        _check_frequencies(frequencies)
        signs = _leading_signs(participation, mass)
        arrays["participation"] = participation * signs[:, None]
        if damping.ndim == 2:
            arrays["damping"] = damping * np.outer(signs, signs)
        if self.tip is not None:
            arrays["tip"] = np.array(self.tip, dtype=np.float64) * signs[:, None]
        for name, values in arrays.items():
            object.__setattr__(self, name, locked(values))
        if self.shapes is not None and np.any(signs < 0.0):
            object.__setattr__(self, "shapes", self.shapes.combined(np.diag(signs)))
        _check_labels(self.labels, n)
        _check_residual_mass(self.residual_mass, mass)

    # -- sizes -------------------------------------------------------------------------------------
    @property
    def modes(self) -> int:
        """Number of flexible modes."""
        return self.frequencies.size

    @property
    def motions(self) -> int:
        """Number of motions of the port, `m`."""
        return self.rigid_mass.shape[0]

    # -- mass --------------------------------------------------------------------------------------
    @property
    def effective_mass(self) -> Array:
        """`(n, m, m)` effective masses `L_k L_k^T`."""
        return self.participation[:, :, None] * self.participation[:, None, :]

    @property
    def residual_mass(self) -> Array:
        """`(m, m)` rigid mass minus the effective masses:
        the mass at the root at infinite frequency."""
        return self.rigid_mass - self.participation.T @ self.participation

    @property
    def gains(self) -> Array:
        """`(m, m)` accelerance at infinite frequency, the paper's gains `k`."""
        return np.asarray(np.linalg.inv(self.residual_mass), dtype=np.float64)

    # -- damping -----------------------------------------------------------------------------------
    @property
    def ratios(self) -> Array:
        """`(n,)` damping ratios of the cantilever modes."""
        return np.diag(self.damping) if self.damping.ndim == 2 else self.damping

    @property
    def damping_matrix(self) -> Array:
        """`(n, n)` damping matrix of the mass-normalised cantilever modes [1/s]."""
        if self.damping.ndim == 1:
            return np.diag(2.0 * self.damping * self.frequencies)
        roots = np.sqrt(self.frequencies)
        return 2.0 * self.damping * np.outer(roots, roots)

    def with_ratios(self, ratios: Array) -> "PortModel":
        """The same with damping ratios `(n,)`; dampers that couple modes stay."""
        if self.damping.ndim == 1:
            return self.replaced(damping=ratios)
        return self.replaced(damping=self.damping + np.diag(ratios - self.ratios))

    # -- free modes --------------------------------------------------------------------------------
    def _rows(self) -> tuple[Array, Array]:
        """Mass-weighted motion rows: rigid `(n+m, m)` and elastic `(n+m, n)`, per unit `W q`.

        Their products are the mass matrix of `M x'' + L^T q'' ...`: with `R^T R = M - L^T L`,
        `rigid^T rigid = M`, `rigid^T elastic = L^T / W` and `elastic^T elastic = 1 / W^2`.
        """
        scale = np.sqrt(np.diag(self.rigid_mass))
        scaled = self.residual_mass / np.outer(scale, scale)
        # a direction without residual mass shall have exactly none
        if np.linalg.eigvalsh(scaled)[0] < RESIDUAL_NOISE:
            root = square_root(scaled, RESIDUAL_NOISE) * scale
        else:
            root = square_root(self.residual_mass)
        rigid = np.vstack([self.participation, root])
        elastic = np.vstack([np.diag(1.0 / self.frequencies), np.zeros((self.motions, self.modes))])
        return rigid, elastic

    @cached_property
    def _free(self) -> _FreeModes:
        """The modes with the root free: what elastic motion remains beside rigid motion.

        With `rigid = Q R` the singular values of `(I - Q Q^T) elastic` are `1 / frequency`; the
        root moves by `-R^-1 Q^T elastic v` in the mode `v`.
        """
        rigid, elastic = self._rows()
        q, r = np.linalg.qr(rigid)
        along = q.T @ elastic
        _, s, vt = np.linalg.svd(elastic - q @ along, full_matrices=False)
        # a singular residual sends a mode to infinity
        finite = s > 1e-13 / np.min(self.frequencies, initial=np.inf)
        s = s[finite]
        v = vt[finite].T
        if np.any(np.abs(np.diag(r)) <= SINGULAR * np.linalg.norm(r, axis=0)):
            raise RealisationError(
                "the rigid mass matrix (diagonal "
                f"{', '.join(f'{v:.3g}' for v in np.diag(self.rigid_mass))}) is singular in double "
                "precision: a motion of the root moves no mass, as about a body that is a point, "
                "or one mass or inertia is too far above all others; state root.hub, or check "
                "sizes and units."
            )
        values = -np.linalg.solve(r, along @ v) / s
        return _FreeModes(
            frequencies=locked(1.0 / s),
            port_values=locked(values.T),
            shares=locked(v),
            rigid_port_values=locked(np.linalg.inv(r)),
        )

    @property
    def free_frequencies(self) -> Array:
        """`(n,)` free frequencies, the poles of `W` [rad/s]."""
        return self._free.frequencies

    @property
    def free_damping(self) -> Array:
        """`(n,)` damping ratios of the free modes, where damping does not couple them."""
        # zeta_free = w_free sum_k zeta_k v_k^2 / W_k
        ratios = (self.ratios / self.frequencies) @ self._free.shares**2
        return np.asarray(self._free.frequencies * ratios, dtype=np.float64)

    @property
    def free_port_values(self) -> Array:
        """`(n, m)` port motion in each mass-normalised free mode."""
        return self._free.port_values

    @property
    def rigid_port_values(self) -> Array:
        """`(m, m)` port motion in the rigid modes: column i is mode i; `P0 P0^T = M^-1`."""
        return self._free.rigid_port_values

    # -- responses ---------------------------------------------------------------------------------
    def D(self, omega: ArrayLike) -> NDArray[np.complex128]:  # noqa: N802 (the field's letter)
        """Dynamic mass `(m, m, k)`: wrench per unit acceleration at `omega` `(k,)` [rad/s]."""
        frequency = np.atleast_1d(finite_array("omega", omega, (), (None,), unit="rad/s"))
        flexible = flexible_mass(self, self.participation, frequency)
        return self.rigid_mass.astype(np.complex128)[:, :, None] - flexible

    def W(self, omega: ArrayLike) -> NDArray[np.complex128]:  # noqa: N802
        """Accelerance `(m, m, k)`: acceleration per unit wrench at `omega` `(k,)` [rad/s]."""
        # a massless root follows its spring
        if np.any(self.damping > 0.0) or self.free_frequencies.size < self.modes:
            inverse = np.linalg.inv(np.moveaxis(self.D(omega), -1, 0))
            return np.moveaxis(np.asarray(inverse, dtype=np.complex128), 0, -1)
        # W = P0 P0^T - omega^2 sum_k p_k p_k^T / (w_k^2 - omega^2) over the free modes
        frequency = np.atleast_1d(finite_array("omega", omega, (), (None,), unit="rad/s"))
        weight = -(frequency**2) / (self.free_frequencies[:, None] ** 2 - frequency**2)
        m = self.motions
        p = self.free_port_values
        p0 = self.rigid_port_values
        outer = (p[:, :, None] * p[:, None, :]).reshape(p.shape[0], m * m)
        rigid = (p0 @ p0.T)[:, :, None]
        elastic = (outer.T @ weight).reshape(m, m, -1)
        return (rigid + elastic).astype(np.complex128)

    def zeros(self, output: int = 0, input: int = 0) -> NDArray[np.complex128]:
        """`(n,)` zeros of one entry of `W` as frequencies:
        `W_ij` carries the factors `s^2 + zero^2`.

        Args:
            output: row of `W`: 0 displacement, 1 rotation in a plane.
            input: column of `W`: 0 force, 1 moment in a plane.

        Source: Belonozhko (2008), equation (15), the `n_1`, `n_2`.
        """
        # W_ij = gain + sum_k c_k w_k^2 / (w_k^2 - omega^2) with residues c_k is zero where omega^2
        # is an eigenvalue of diag(w^2) - 1 (c w^2)^T / gain
        gain = self.gains[output, input]
        residues = self.free_port_values[:, output] * self.free_port_values[:, input]
        w2 = self.free_frequencies**2
        squares = np.linalg.eigvals(np.diag(w2) - np.outer(np.ones(w2.size), residues * w2) / gain)
        squares = squares[np.argsort(squares.real)].astype(np.complex128)
        if output == input:
            # all are real; the inverse, diag(1 / w^2) + (1 / w^2) c^T / static, keeps the digits
            # of the low ones
            static = np.sum(self.rigid_port_values[output] ** 2)
            inverse = np.diag(1.0 / w2) + np.outer(1.0 / w2, residues) / static
            slow = 1.0 / np.linalg.eigvals(inverse)
            half = w2.size // 2
            squares[:half] = slow[np.argsort(slow.real)][:half]
        return np.sqrt(squares)

    def to_control(self) -> "control.StateSpace":
        """The accelerance as `control.StateSpace`, 2n states, exact.

        States: modal coordinates of the held appendage and their rates; inputs: wrench;
        outputs: acceleration.
        """
        with importing:
            import control

        a, b, c, d = self.state_space()
        return cast("control.StateSpace", control.ss(a, b, c, d))

    def state_space(self) -> tuple[Array, Array, Array, Array]:
        """The matrices of `to_control`: A `(2n, 2n)`, B `(2n, m)`, C `(m, 2n)`, D `(m, m)`.

        Of `q'' + 2 zeta W q' + W^2 q = -L x''` and the wrench `f = M x'' + L^T q''` follows, with
        the residual mass `M_r` and the states `z = (q, q')`:
        `x'' = M_r^-1 (f + L^T spring z)` and `q'' = -spring z - L x''`.
        """
        n = self.modes
        gain = self.gains
        stiffness = np.diag(self.frequencies**2)
        spring = np.hstack([stiffness, self.damping_matrix])
        c = gain @ self.participation.T @ spring
        rates = np.hstack([np.zeros((n, n)), np.eye(n)])
        accelerations = -spring - self.participation @ c
        a = np.vstack([rates, accelerations])
        b = np.vstack([np.zeros((n, self.motions)), -self.participation @ gain])
        return a, b, c, gain

    # -- made from this one ------------------------------------------------------------------------
    def with_hub(self, hub_mass: ArrayLike) -> "PortModel":
        """The same with a rigid hub, `hub_mass` `(m, m)` [kg, kg m, kg m^2], on its port: free
        modes are the coupled modes."""
        hub = finite_array("hub_mass", hub_mass, self.rigid_mass.shape)
        key = hub.tobytes()
        loaded = self._loaded.get(key)
        if loaded is None:
            loaded = self.replaced(rigid_mass=self.rigid_mass + hub)
            if len(self._loaded) >= LOADED:
                self._loaded.clear()
            self._loaded[key] = loaded
        return loaded

    @cached_property
    def _loaded(self) -> "dict[bytes, PortModel]":
        """Models with a hub that were made already: their modes are dear."""
        return {}

    def last_on_hub(self, hub_mass: ArrayLike) -> float:
        """Last coupled frequency on a rigid hub, `hub_mass` `(m, m)`; 0 without any [rad/s]."""
        return float(np.max(self.with_hub(hub_mass).free_frequencies, initial=0.0))

    def truncated(self, modes: int) -> "PortModel":
        """Only the first `modes` cantilever modes; the rigid mass stays."""
        if not isinstance(modes, Integral) or not 0 <= modes <= self.modes:
            raise InputError(
                f"modes = {modes!r:.60} must lie between 0 and {self.modes}, the number this model "
                "has."
            )
        return self.picked(range(int(modes)))

    def picked(self, modes: Sequence[int]) -> "PortModel":
        """Only some cantilever modes, numbers from 0 ascending; the rigid mass stays."""
        numbers = finite_array("modes", modes, (None,))
        if np.any((numbers < 0) | (numbers >= self.modes) | (numbers % 1.0 != 0.0)):
            raise InputError(
                f"modes = {modes!r:.60} must be whole numbers from 0 to {self.modes - 1}."
            )
        pick = numbers.astype(np.int64)
        return self.replaced(
            frequencies=self.frequencies[pick],
            participation=self.participation[pick],
            damping=self.damping[np.ix_(*[pick] * self.damping.ndim)],
            tip=None if self.tip is None else self.tip[pick],
            shapes=None if self.shapes is None else self.shapes.combined(np.eye(self.modes)[pick]),
            labels=tuple(self.labels[k] for k in pick) if self.labels else (),
        )

    def in_motions(self, motion: ArrayLike) -> "PortModel":
        """The same in other motions of its root, the remaining ones held.

        Args:
            motion: `(m, k)` motion of this model's root per unit of each new motion.
        """
        columns = finite_array("motion", motion, (self.motions, None))
        return self.replaced(
            rigid_mass=columns.T @ self.rigid_mass @ columns,
            participation=self.participation @ columns,
            tip=None,
            points=(),
        )

    def port(self, port: str) -> "PortModel":
        """The view of one port of a model in six motions, the other motions of the root held: the
        modes that are labelled so, and those without a label that move the port.

        Args:
            port: "xy", "xz", "torsion" or "axial".

        Example:
            >>> import beamchain as bc
            >>> import numpy as np
            >>> model = bc.PortModel(
            ...     rigid_mass=np.diag([9.0, 9.0, 9.0, 1.0, 48.0, 48.0]),
            ...     frequencies=np.array([2.0, 3.0]),
            ...     participation=np.array([[0, 2.0, 0, 0, 0, 5.0], [0, 0, 0, 0.5, 0, 0]]),
            ...     labels=("xy", "torsion"),
            ... )
            >>> model.port("torsion")
            <PortModel, 1 motion, 1 modes: 3 rad/s>
        """
        one_of("port", port, PORTS)
        motion = PORT_MOTION[port]
        if self.motions != len(motion):
            raise InputError(
                f"a view of {port} needs a model in six motions; this one has {self.motions}."
            )
        labels = self.labels or ("",) * self.modes
        moves = np.any(self.participation @ motion != 0.0, axis=1)
        modes = [k for k, label in enumerate(labels) if label == port or (not label and moves[k])]
        return self.picked(modes).in_motions(motion)

    def condensed(self, above: float) -> "PortModel":
        """The modes above a frequency [rad/s] gathered into as many as the port has motions,
        with their static flexibility, that of the tip and of further points included."""
        low = self.frequencies <= above
        rows = self.participation if self.tip is None else np.hstack([self.participation, self.tip])
        if np.sum(~low) <= rows.shape[1]:
            return self
        # modes l at one frequency w with sum_k l_k l_k^T / w^2 = sum_high L_k L_k^T / W_k^2
        high = rows[~low] / self.frequencies[~low, None] * above
        values, vectors = np.linalg.eigh(high.T @ high)
        keep = values > 1e-14 * values.max()
        gathered = np.sqrt(values[keep])[:, None] * vectors.T[keep]
        count = gathered.shape[0]
        damping = np.full(count, float(np.mean(self.damping[~low])))
        return PortModel(
            self.rigid_mass,
            frequencies=np.concatenate([self.frequencies[low], np.full(count, above)]),
            participation=np.vstack([self.participation[low], gathered[:, : self.motions]]),
            damping=np.concatenate([self.damping[low], damping]),
            tip=None
            if self.tip is None
            else np.vstack([self.tip[low], gathered[:, self.motions :]]),
            points=self.points,
        )

    def reduced(self, modes: int, hub_mass: ArrayLike) -> "PortModel":
        """Galerkin reduction on the first `modes` modes with `hub_mass` `(m, m)` on the port,
        zeros for the free target.

        Damping is left out: it belongs to the cantilever modes of the full model.
        """
        if modes == 0:
            return self.truncated(0)
        if not 0 < modes <= self.modes:
            raise InputError(
                f"modes = {modes} must lie between 0 and {self.modes}, the number this model has."
            )
        return self._projection(self.with_hub(hub_mass)._free.shares[:, :modes])

    def for_target(self, target: str, modes: int, hub_mass: Array | None = None) -> "PortModel":
        """The lowest `modes` for a `target`: cantilever ("clamped"), or with nothing ("free") or
        `hub_mass` ("hub") attached."""
        if target == "clamped":
            return self.truncated(modes)
        attached = np.zeros_like(self.rigid_mass) if target == "free" else hub_mass
        assert attached is not None
        return self.reduced(modes, attached)

    def _projection(self, basis: Array) -> "PortModel":
        """Galerkin reduction on an orthonormal `basis` `(n, k)` of `W q`."""
        rigid, elastic = self._rows()
        points = None if self.tip is None else (self.tip.T / self.frequencies) @ basis
        shapes = self.shapes
        return PortModel.from_rows(
            Rows(rigid, elastic @ basis, points=points),
            rigid_mass=self.rigid_mass,
            # the first rows are in terms of this model's mass-normalised modes
            shapes=shapes and (lambda momenta: shapes.combined(momenta[:, : self.modes])),
            points=self.points,
        )

    def point_columns(self, points: Sequence[float]) -> list[int]:
        """Columns of `tip` in which some of its points, x [m], have their motions."""
        m = self.motions
        places = {x: m * k for k, x in enumerate(self.points)}
        return [places[x] + i for x in points for i in range(m)]

    def point_motion(self, points: Sequence[float]) -> Array:
        """`(n, k, m)` motion of some of its points, x [m], in each mode."""
        assert self.tip is not None
        motion = self.tip[:, self.point_columns(points)]
        return motion.reshape(self.modes, len(points), self.motions)

    def attached(self, modes: int, columns: Sequence[int]) -> "PortModel":
        """The first `modes` modes and the static response to a unit load at the points of
        some columns of `tip`.

        The static flexibility of those points is then exact (attachment modes; R. R. Craig,
        Structural Dynamics, 1981).
        """
        assert self.tip is not None
        responses = self.tip[:, list(columns)] / self.frequencies[:, None]
        sizes = np.linalg.norm(responses, axis=0)
        responses = responses / np.where(sizes > 0.0, sizes, 1.0)
        responses[:modes] = 0.0  # the normal modes carry this part already
        u, s, _ = np.linalg.svd(responses, full_matrices=False)
        normal = np.eye(self.modes)[:, :modes]
        attachment = u[:, s > NORMAL]
        return self._projection(np.column_stack([normal, attachment]))

    def replaced(self, **changes: Any) -> "PortModel":
        """A copy with some fields changed, `changes` by name."""
        names = (
            "rigid_mass",
            "frequencies",
            "participation",
            "damping",
            "tip",
            "shapes",
            "labels",
            "points",
        )
        return PortModel(**{name: changes.get(name, getattr(self, name)) for name in names})


def flexible_mass(model: PortModel, rows: Array, omega: Array) -> NDArray[np.complex128]:
    """`(r, r, k)` `R^T H R` of rows R `(n, r)` of a model's modes, with H the accelerations of
    these by forces on them, at `omega` `(k,)` [rad/s]."""
    s = 1j * omega
    n, r = rows.shape
    if model.damping.ndim == 2:
        # H = (s^2 I + s C + W^2)^-1 s^2
        inner = np.diag(model.frequencies**2) + s[:, None, None] * model.damping_matrix
        inner = inner + (s**2)[:, None, None] * np.eye(n)
        coupled = rows.T @ np.linalg.solve(inner, (s**2)[:, None, None] * rows)
        return np.moveaxis(coupled, 0, -1)
    w = model.frequencies[:, None]
    weight = s**2 / (s**2 + 2.0 * model.damping[:, None] * w * s + w**2)  # H
    products = (rows[:, :, None] * rows[:, None, :]).reshape(n, r**2)
    # a real times a complex matrix, as a product of real ones: many modes take time here
    parts = np.ascontiguousarray(weight, dtype=np.complex128).view(np.float64)
    return (products.T @ parts).view(np.complex128).reshape(r, r, s.size)
