"""What one step of MuJoCo's integrators makes of an oscillation,
and the mass and damping that make it exact.

A mode `m q'' + c q' + k q = 0` sits on a tendon or on a joint;
MuJoCo treats their springs and dampers differently.

Theory: docs/theory.md, section 5.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from beamchain.checks import one_of
from beamchain.engine.linearise import runge_kutta_change
from beamchain.ports.motions import Array

Complex = NDArray[np.complex128]

PHASE = 2.6  #: [rad] per step, to which semi-implicit integrators slow faster modes
NEVER = float("inf")


class Scheme(NamedTuple):
    """What an integrator does with springs and dampers;
    the damping of joints is implicit in all but RK4."""

    exact: bool  #: modes on tendons can be made exact in time (the armature needed is not negative)
    phase: float  #: [rad] per step beyond which modes are slowed
    implicit_damping: bool  #: of tendons
    implicit_springs: bool = False  #: those of tendons for the force of the position alone


#: By MuJoCo's name.
SCHEMES = {
    "Euler": Scheme(exact=True, phase=PHASE, implicit_damping=False),
    "implicit": Scheme(exact=True, phase=PHASE, implicit_damping=True),
    "implicitfast": Scheme(exact=True, phase=PHASE, implicit_damping=True),
    "discrete": Scheme(exact=False, phase=NEVER, implicit_damping=True, implicit_springs=True),
    "RK4": Scheme(exact=False, phase=2.0, implicit_damping=False),  # its own limit is 2.828
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


def step_matrices(
    integrator: str,
    stiffness: Array,
    implicit: Array,
    explicit: Array,
    timestep: float,
    *,
    mass: Array | None = None,
    springs: Array | float = 0.0,
    held: Array | float = 0.0,
) -> tuple[Array, Array]:
    """One step of `M y'' + D y' + K y = f` less the unit matrix, `(2 n, 2 n)` over the states
    (y, h y'), and what a force on each y that is held over the step adds, `(2 n, n)`.

        y+ = y + h v+
        v+ = (M + h D_i + h^2 (S - H))^-1 (M - h D_e) v + h (M + h D_i + h^2 S)^-1 (f - K y)

    Of RK4 the exponential to fourth order.

    Args:
        integrator: MuJoCo's name.
        stiffness: `(n, n)` K.
        implicit, explicit: `(n, n)` D_i and D_e, the dampers as the integrator takes them.
        timestep: h [s].
        mass: `(n, n)` M; the unit matrix where left out.
        springs: `(n, n)` S, springs that are implicit.
        held: `(n, n)` H, those of them that are implicit for the force of the position alone.
    """
    h = float(timestep)
    n = stiffness.shape[0]
    eye = np.eye(n)
    mass = eye if mass is None else mass
    damping = implicit + explicit
    if integrator == "RK4":
        moved = np.linalg.solve(mass, np.hstack([-(h**2) * stiffness, -h * damping, h**2 * eye]))
        flow = np.zeros((3 * n, 3 * n))
        flow[:n, n : 2 * n] = eye
        flow[n : 2 * n] = moved
        change = runge_kutta_change(flow)[: 2 * n]
        return change[:, : 2 * n], change[:, 2 * n :]
    left = mass + h * implicit + h**2 * springs
    drag = h * damping + h**2 * (springs - held)
    solved = np.linalg.solve(left, np.hstack([h**2 * stiffness, drag, h**2 * eye]))
    pull, lost, push = np.split(solved, 3, axis=1)
    if np.any(held):
        lost = np.linalg.solve(left - h**2 * held, drag)
    difference = np.block([[-pull, eye - lost], [-pull, -lost]])
    drive = np.vstack([push, push])
    return np.asarray(difference, dtype=np.float64), np.asarray(drive, dtype=np.float64)


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
    or the larger modulus if real.

    `tendon`: the damping sits on a tendon, not on a joint; `sprung`: so does the spring.
    """
    one_of("integrator", integrator, INTEGRATORS)
    scheme = SCHEMES[integrator]
    h = float(timestep)
    m, c, k = np.broadcast_arrays(
        *(np.asarray(v, dtype=np.float64) for v in (mass, damping, stiffness))
    )
    if integrator == "RK4":
        s = (-c + np.sqrt((c**2 - 4.0 * m * k).astype(np.complex128))) / (2.0 * m) * h
        z = polynomial(s)
        twin = polynomial(-c / m * h - s)
        return np.where(np.abs(twin) > np.abs(z) * (1.0 + 1e-12), twin, z)
    spring = h**2 * k * scheme.implicit_springs
    if scheme.implicit_damping or not tendon:
        held = m + h * c
        a = m / (held + spring * (not sprung))
        b = h**2 * k / (held + spring)
    else:
        a, b = 1.0 - h * c / m, h**2 * k / m
    half = (1.0 + a - b) / 2.0
    # half^2 - a without the loss at small steps
    square = ((1.0 - a) ** 2 + b**2 - 2.0 * b * (1.0 + a)) / 4.0
    root = np.sqrt(square.astype(np.complex128))
    return np.where((square > 0.0) & (half < 0.0), half - root, half + root)


def largest_angle(integrator: str, ratio: float = 0.0, *, tendon: bool = False) -> float:
    """Largest stable `w h` of a mode; infinity for "discrete"."""
    one_of("integrator", integrator, INTEGRATORS)
    if integrator == "discrete":
        return NEVER
    if integrator == "RK4":
        return runge_kutta_limit(complex(-ratio, np.sqrt(1.0 - ratio**2)))
    root = 2.0 * np.sqrt(1.0 + ratio**2)
    return float(root - 2.0 * ratio if integrator == "Euler" and tendon else root + 2.0 * ratio)


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
    if integrator == "RK4":
        return timestep**2 * stiffness / 8.0 + timestep * damping / 2.0
    return timestep**2 * stiffness / 4.0


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
