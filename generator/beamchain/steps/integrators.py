"""What one step of MuJoCo's integrators makes of an oscillation,
and the mass and damping that make it exact.

A mode `m q'' + c q' + k q = 0` sits on a tendon or on a joint;
MuJoCo treats their springs and dampers differently.

Theory: docs/theory.md, section 5.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from beamchain.checks import one_of
from beamchain.engine.linearise import runge_kutta_change
from beamchain.ports.motions import Array, system_matrix

Complex = NDArray[np.complex128]

PHASE = 2.6  #: [rad] per step, to which semi-implicit integrators slow faster modes
NEVER = float("inf")
AT_REST = 1e-5  # slower than this share of the fastest pole: rigid motion
REAL = 1e-6  # imaginary part, relative, below which a root is real
LEAST = 1e-9  # root over the largest one: below it, none
ROUNDING = 1e-9  # of a matrix whose diagonal is one


class Scheme(NamedTuple):
    """What an integrator does with springs and dampers;
    the damping of joints is implicit in all but RK4."""

    exact: bool  #: modes on tendons can be made exact in time (the armature needed is not negative)
    phase: float  #: [rad] per step beyond which modes are slowed
    implicit_damping: bool  #: of tendons
    #: armature over `h^2 k` with which a spring is stable by itself, whatever hangs on it
    limit: float = 1.0 / 4.0
    #: armature over `h d` that makes up for the instant at which the damper of a tendon acts
    lag: float = -1.0 / 2.0
    implicit_springs: bool = False  #: those of tendons for the force of the position alone


#: By MuJoCo's name.
SCHEMES = {
    "Euler": Scheme(exact=True, phase=PHASE, implicit_damping=False, lag=1.0 / 2.0),
    "implicit": Scheme(exact=True, phase=PHASE, implicit_damping=True),
    "implicitfast": Scheme(exact=True, phase=PHASE, implicit_damping=True),
    "discrete": Scheme(exact=False, phase=NEVER, implicit_damping=True, implicit_springs=True),
    # its own limit is sqrt(8) = 2.828
    "RK4": Scheme(exact=False, phase=2.0, implicit_damping=False, limit=1.0 / 8.0, lag=0.0),
}
INTEGRATORS = tuple(SCHEMES)


class Timed(NamedTuple):
    """Modes as they are written for a step; every field has the modes' shape."""

    mass: Array  #: `m'` in units of the modal mass; the tendon's armature is `m' - 1`
    damping: Array  #: `c'` of the tendon [1/s]
    slowed: NDArray[np.bool_]  #: faster than the phase limit
    #: a negative armature would be needed; the mass is 1 and the pole only near
    clamped: NDArray[np.bool_]


def continuous_poles(frequency: ArrayLike, ratio: ArrayLike = 0.0) -> tuple[Complex, Complex]:
    """Both poles `s` [1/s] of modes at `w` [rad/s]; the first has the positive imaginary part,
    or is the slower.

    Example:
        >>> continuous_poles(2.0)[0]
        np.complex128(2j)
    """
    w, zeta = np.broadcast_arrays(
        np.asarray(frequency, dtype=np.float64), np.asarray(ratio, dtype=np.float64)
    )
    root = np.sqrt((zeta**2 - 1.0).astype(np.complex128))
    return w * (root - zeta), w * (-root - zeta)


def apparent_pole(pole: ArrayLike, timestep: float) -> tuple[Array, Array]:
    """Frequency [rad/s] and damping ratio that a pole `z` of the step shows: `s = log(z)/h`."""
    s = np.log(np.asarray(pole, dtype=np.complex128)) / timestep
    w = np.abs(s)
    return w, -s.real / np.where(w > 0.0, w, 1.0)


def polynomial(s: NDArray[Any]) -> Complex:
    """RK4's `exp(s)` of poles times the step."""
    return np.asarray(
        1.0 + s * (1.0 + s / 2.0 * (1.0 + s / 3.0 * (1.0 + s / 4.0))), dtype=np.complex128
    )


@dataclass(frozen=True, eq=False)
class StepMap:
    """The step of `M y'' + (D_i + D_e) y' + K y = f` by one of MuJoCo's integrators,

        y+ = y + h v+
        v+ = (M + h D_i + h^2 (S - H))^-1 (M - h D_e) v + h (M + h D_i + h^2 S)^-1 (f - K y)

    of RK4 the exponential to fourth order. All matrices are `(..., n, n)`.

    Args:
        integrator: MuJoCo's name.
        stiffness: K.
        implicit, explicit: D_i and D_e, the dampers as the integrator takes them.
        timestep: h [s], a number or `(..., 1, 1)`.
        mass: M.
        springs: S, springs that are implicit.
        held: H, those of them that are implicit for the force of the position alone.
    """

    integrator: str
    stiffness: Array
    implicit: Array
    explicit: Array
    timestep: float | Array
    mass: Array
    springs: Array | float = 0.0
    held: Array | float = 0.0

    def matrices(self) -> tuple[Array, Array]:
        """The step less the unit matrix, `(..., 2 n, 2 n)` over the states (y, h y'), and what a
        force on each y that is held over the step adds, `(..., 2 n, n)`."""
        pull, lost, push = self.shares()
        n = pull.shape[-1]
        eye = np.broadcast_to(np.eye(n), pull.shape)
        if self.integrator == "RK4":
            zeros = np.zeros_like(pull)
            flow = np.block([[zeros, eye, zeros], [-pull, -lost, push], [zeros] * 3])
            change = runge_kutta_change(flow)[..., : 2 * n, :]
            return change[..., : 2 * n], change[..., 2 * n :]
        return np.block([[-pull, eye - lost], [-pull, -lost]]), np.block([[push], [push]])

    def shares(self) -> tuple[Array, Array, Array]:
        """`(..., n, n)` pull, lost and push of `h v+ = h v - pull y - lost h v + push f`, of RK4
        those of `h^2 y'' = -pull y - lost h y' + push f`."""
        h = self.timestep
        damping = self.implicit + self.explicit + h * (self.springs - self.held)
        left = self.mass
        if self.integrator != "RK4":
            left = left + h * self.implicit + h**2 * self.springs
        push = h**2 * _inverse(left)
        position = _inverse(left - h**2 * self.held) * h if np.any(self.held) else push / h
        return push @ self.stiffness, position @ damping, push

    @property
    def growth(self) -> Array:
        """`(...)` the largest |z| of the step."""
        change, _ = self.matrices()
        return np.asarray(np.max(np.abs(1.0 + np.linalg.eigvals(change)), axis=-1))

    def dynamic(self, step: Complex) -> NDArray[np.complex128]:
        """P `(k, n, n)` of `step_factors` at z - 1 `(k,)`."""
        spring, implicit, explicit = step_factors(self.integrator, step, self.timestep)
        dynamic = self.mass + self.stiffness * spring[:, None, None]
        dynamic = dynamic + self.implicit * implicit[:, None, None]
        return dynamic + self.explicit * explicit[:, None, None]

    def slope(self, step: Complex, shapes: Complex) -> Complex:
        """`P'(z) y` `(n, k)` of modes y `(n, k)` at z - 1 `(k,)`, P as of `step_factors`; not of
        RK4.

            P' = -(D_i + D_e) h/(z - 1)^2 - K h^2 (z + 1)/(z - 1)^3
        """
        explicit = self.timestep / step
        damped = (self.implicit + self.explicit) @ shapes
        sprung = self.stiffness @ shapes
        return -explicit * (damped + explicit * (step + 2.0) * sprung) / step

    def largest_step(self) -> float:
        """Largest stable step, whatever `timestep` is [s]; infinity where there is none.

        There a pole is -1: `4 P(-1) y = (4 M + 2 h (D_i - D_e) + h^2 (2 S - K)) y = 0`. RK4's
        poles leave the unit circle elsewhere.
        """
        nothing = np.zeros_like(self.mass)
        lightness = _inverse(self.mass)
        stiffness, implicit, explicit, springs, held = (
            lightness @ (nothing + part)
            for part in (self.stiffness, self.implicit, self.explicit, self.springs, self.held)
        )
        if self.integrator == "RK4":
            poles = np.linalg.eigvals(system_matrix(stiffness, implicit + explicit))
            size = np.abs(poles)
            moving = poles[(size > AT_REST * np.max(size, initial=0.0)) & (poles.imag >= 0.0)]
            return min((runge_kutta_limit(pole) for pole in moving), default=NEVER)
        spring, damper = (2.0 * springs - stiffness) / 4.0, (implicit - explicit) / 2.0
        if np.any(held):  # + 2 h^2 H w,  (M + h D_i + h^2 (S - H)) w = (M - h D_e) y
            spring = np.block([[spring, held / 2.0], [spring, springs - held / 2.0]])
            damper = np.block([[damper, nothing], [damper + explicit, implicit]])
        inverse = np.linalg.eigvals(system_matrix(spring, damper))
        size = np.abs(inverse)
        is_real = (np.abs(inverse.imag) <= REAL * size) & (
            inverse.real > LEAST * np.max(size, initial=0.0)
        )
        return 1.0 / float(np.max(inverse.real[is_real])) if np.any(is_real) else NEVER


def step_factors(
    integrator: str, step: Complex, timestep: float | Array
) -> tuple[Complex, Complex, Complex]:
    """Of stiffness, implicit and explicit damping in the equation of a free step at z - 1,

        P(z) y = 0,   P = M + K h^2 z/(z - 1)^2 + D_i h z/(z - 1) + D_e h/(z - 1)

    without implicit springs; of RK4 `P = M + K/s^2 + D/s`, `s = log(z)/h`.
    """
    if integrator == "RK4":
        rate = np.asarray(timestep / np.log1p(step), dtype=np.complex128)
        return rate**2, rate, rate
    explicit = timestep / step
    implicit = explicit * (1.0 + step)
    return explicit * implicit, implicit, explicit


def _inverse(matrix: Array) -> Array:
    inverse = 1.0 / matrix if matrix.shape[-1] == 1 else np.linalg.inv(matrix)
    return np.asarray(inverse, dtype=np.float64)


def map_modes(
    integrator: str,
    mass: ArrayLike,
    damping: ArrayLike,
    stiffness: ArrayLike,
    timestep: float,
    *,
    tendon: bool = True,
    sprung: bool = True,
) -> StepMap:
    """The step of modes `m q'' + c q' + k q = 0`, each alone.

    `tendon`: the damping sits on a tendon, not on a joint; `sprung`: so does the spring.
    """
    one_of("integrator", integrator, INTEGRATORS)
    scheme = SCHEMES[integrator]
    m, c, k = (
        values[..., None, None]
        for values in np.broadcast_arrays(
            *(np.asarray(v, dtype=np.float64) for v in (mass, damping, stiffness))
        )
    )
    implicit = c * (scheme.implicit_damping or not tendon)
    springs = k * scheme.implicit_springs
    return StepMap(
        integrator,
        k,
        implicit,
        c - implicit,
        float(timestep),
        mass=m,
        springs=springs,
        held=springs * sprung,
    )


def step_pole(
    integrator: str,
    mass: ArrayLike,
    damping: ArrayLike,
    stiffness: ArrayLike,
    timestep: float,
    *,
    tendon: bool = True,
    sprung: bool = True,
) -> Complex:
    """Pole `z` of one step of `m q'' + c q' + k q = 0`: upper half plane,
    or the larger modulus if real; `tendon`, `sprung` as of `map_modes`."""
    modes = map_modes(integrator, mass, damping, stiffness, timestep, tendon=tendon, sprung=sprung)
    return 1.0 + pole_of_mode(modes)


def pole_of_mode(mode: StepMap) -> Complex:
    """`z - 1` of steps of single modes, `(..., 1, 1)`: upper half plane, or the larger modulus."""
    pull, lost, _ = (share[..., 0, 0] for share in mode.shares())
    is_rk4 = mode.integrator == "RK4"
    # (z - 1)^2 + (pull + lost) (z - 1) + pull = 0, of RK4 s^2 + lost s + pull = 0
    half = -(lost if is_rk4 else pull + lost) / 2.0
    square = half**2 - pull
    root = np.sqrt(square.astype(np.complex128))
    if not is_rk4:
        step = half + np.where((square > 0.0) & (half < -1.0), -root, root)
    else:
        first, second = polynomial(half + root), polynomial(half - root)
        is_twin = np.abs(second) > np.abs(first) * (1.0 + 1e-12)
        step = np.where(is_twin, second, first) - 1.0
    return np.asarray(step, dtype=np.complex128)


def spare_armature(
    integrator: str, armature: Array | float, stiffness: Array, damping: Array, timestep: float
) -> Array:
    """What is left of the armature of tendons beyond that with which they are stable by themselves,

        g = a - lag h d - limit h^2 k

    A craft is stable in a pose while `C + diag(g) > 0`, C the condensed mass of the tendons'
    lengths: that is `P(-1)`. Of RK4 without dampers.
    """
    scheme = SCHEMES[integrator]
    needed = scheme.lag * timestep * damping + scheme.limit * timestep**2 * stiffness
    return np.asarray(armature - needed, dtype=np.float64)


def is_stable(mass: Array, spare: Array) -> NDArray[np.bool_]:
    """`(k,)`: whether `C + diag(g) >= 0` of condensed masses `(n, n)` or `(k, n, n)` and the spare
    armatures `(k, n)` of many draws."""
    size = 1.0 / np.sqrt(np.diagonal(mass, axis1=-2, axis2=-1) + np.abs(spare))
    whole = mass + spare[:, :, None] * np.eye(mass.shape[-1])
    lowest = np.linalg.eigvalsh(whole * size[:, :, None] * size[:, None, :])[:, 0]
    return np.asarray(lowest >= -ROUNDING)


def runge_kutta_limit(pole: complex) -> float:
    """Largest step [s] at which RK4 does not let a continuous pole [1/s] grow."""
    size = abs(pole)
    # a pole right of the axis by rounding counts as undamped
    direction = pole / size if pole.real < 0.0 else 1j

    def excess(x: Any) -> Any:
        return np.abs(polynomial(x * direction)) - 1.0

    grid = np.linspace(0.5, 4.0, 351)
    first = int(np.flatnonzero(excess(grid) > 1e-12)[0])
    return float(brentq(excess, float(grid[first - 1]), float(grid[first]), xtol=1e-14)) / size


def place_poles(
    integrator: str,
    stiffness: ArrayLike,
    first: ArrayLike,
    second: ArrayLike,
    timestep: float,
    *,
    phase: ArrayLike | None = None,
    damping: ArrayLike | None = None,
) -> Timed:
    """Mass and damping with which a step has the poles `exp(s h)` and each mode its
    own static response.

    Beyond the phase limit both poles are scaled back to it. A clamped mode gets the damping with
    which the residual of the step's characteristic equation at the wanted pole is least. Under RK4
    and "discrete" the modes stay, RK4's beyond the limit are slowed.

    `stiffness` per unit modal mass [1/s^2]; `first`, `second`: poles [1/s], which need not belong
    to it alone; `phase` [rad]: limit per step, the scheme's own where left out; `damping` of the
    untouched mode [1/s], `-(s1 + s2)` where left out.
    """
    one_of("integrator", integrator, INTEGRATORS)
    scheme = SCHEMES[integrator]
    h = float(timestep)
    limit = np.asarray(scheme.phase if phase is None else phase, dtype=np.float64)
    s1 = np.asarray(first, dtype=np.complex128)
    s2 = np.asarray(second, dtype=np.complex128)
    k, s1, s2 = np.broadcast_arrays(np.asarray(stiffness, dtype=np.float64), s1, s2)
    turn = np.maximum(np.abs(s1), np.abs(s2)) * h
    slowed = turn > limit
    if not scheme.exact:
        own = (
            -np.real(s1 + s2)
            if damping is None
            else np.broadcast_to(np.asarray(damping, dtype=np.float64), k.shape)
        )
        factor = np.where(slowed, turn / limit, 1.0)
        return Timed(factor**2, own * factor, slowed, np.zeros(k.shape, dtype=np.bool_))
    back = np.where(slowed, limit / np.maximum(turn, 1e-300), 1.0) * h
    # z^2 - (1 + a - b) z + a = 0 with a = z1 z2, b = (1 - z1)(1 - z2)
    total = np.real((s1 + s2) * back)
    mass = h**2 * k / np.real(np.expm1(s1 * back) * np.expm1(s2 * back))
    drag = -mass * np.expm1(total) / h
    if scheme.implicit_damping:
        mass = np.exp(total) * mass
    clamped = mass < 1.0 - 1e-12
    if scheme.implicit_damping and np.any(clamped):
        z = np.exp(s1 * back)
        slope = z * (1.0 - h**2 * k) - 1.0  # residual: z^2 - z - a slope
        keep = np.real(np.conj(slope) * (z**2 - z)) / np.abs(slope) ** 2
        drag = np.where(clamped, (1.0 / np.clip(keep, 1e-6, 1.0) - 1.0) / h, drag)
    return Timed(np.maximum(mass, 1.0), np.maximum(drag, 0.0) + 0.0, slowed, clamped)


def time_modes(
    integrator: str,
    frequency: ArrayLike,
    ratio: ArrayLike,
    timestep: float,
    *,
    phase: ArrayLike | None = None,
) -> Timed:
    """`placed` for modes at `w` [rad/s] with damping ratios.

    Example:
        >>> timed("Euler", 2.0, 0.0, 0.5).mass  # 1/(4 sin^2(1/2))
        array(1.08768...)
    """
    w, zeta = np.broadcast_arrays(
        np.asarray(frequency, dtype=np.float64), np.asarray(ratio, dtype=np.float64)
    )
    return place_poles(
        integrator, w**2, *continuous_poles(w, zeta), timestep, phase=phase, damping=2.0 * zeta * w
    )


def hinge_armature(stiffness: ArrayLike, timestep: float) -> Array:
    """`k h^2/12` for hinge springs [N m/rad]: Euler's step is right to fourth order."""
    return np.asarray(stiffness, dtype=np.float64) * timestep**2 / 12.0


def stable_armature(integrator: str, timestep: float, stiffness: float, damping: float) -> float:
    """Inertia with which a spring of a joint is stable at the step by itself, whatever hangs on
    either side [kg m^2, kg].

    Bodies of appendages are stable by themselves at their limit, so that a spring between them has
    no room: it needs h^2 k/4, of RK4 h^2 k/8. RK4 takes dampers explicitly, whose limit is 2.79.
    """
    dampers = timestep * damping / 2.0 if integrator == "RK4" else 0.0
    return SCHEMES[integrator].limit * timestep**2 * stiffness + dampers


def start_rate(
    position: ArrayLike, rate: ArrayLike, frequency: ArrayLike, ratio: ArrayLike, timestep: float
) -> Array:
    """The rate to start a mode with, so that all later positions are the exact ones:
    its mean over the step before.

    Example:
        >>> start_rate(
        ...     1.0, 0.0, 0.1, 0.0, 1.0
        ... )  # released at its largest displacement: it was on its way out
        array(0.00499583...)
    """
    q = np.asarray(position, dtype=np.float64)
    v = np.asarray(rate, dtype=np.float64)
    w = np.asarray(frequency, dtype=np.float64)
    zeta = np.asarray(ratio, dtype=np.float64)
    h = float(timestep)
    x = w * timestep
    y = x * np.sqrt((1.0 - zeta**2).astype(np.complex128))
    small = np.abs(y) < 1e-6
    sinc = np.real(np.where(small, 1.0 - y**2 / 6.0, np.sin(y) / np.where(small, 1.0, y)))
    grown = np.exp(zeta * x)
    # q(-h) = exp(zeta x) (q0 cos y - h (v0 + zeta w q0) sin(y)/y)
    gone = 2.0 * np.real(np.sin(y / 2.0) ** 2)  # 1 - cos y
    return (q * (gone * grown - np.expm1(zeta * x)) + grown * h * (v + zeta * w * q) * sinc) / h
