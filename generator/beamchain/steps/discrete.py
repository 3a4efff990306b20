"""What one step of each integrator makes of a mode, and the mass and damping that make it exact.

A mode in modal coordinates, `q'' + 2 zeta w q' + w^2 q = f`, is written with a mass `m'`, a damping `c'` and the
stiffness `k = w^2` that it really has (so that its static response stays what it was). On a tendon whose length is the
modal coordinate, `m' - 1` is the tendon's armature and `c'` its damping. With `x = w h` one step of length `h` obeys
`z^2 - (1 + a - b) z + a = 0`, where

    Euler                   a = 1 - h c'/m'          b = h^2 k/m'              tendon damping is explicit
    implicit, implicitfast  a = m'/(m' + h c')       b = h^2 k/(m' + h c')     tendon damping is implicit
    discrete                a = m'/(m' + h c')       b = h^2 k/(m' + h c' + h^2 k)

(measured through `mjd_transitionFD`; "discrete" treats a tendon's spring so, a joint's otherwise). The exact motion under
an input held over the step has the poles `exp(s h)`, whose product is `r^2` and whose sum is `2 r cos(theta)` with
`r = exp(-zeta x)`, `theta = x sqrt(1 - zeta^2)`. Hence with `b = 1 + r^2 - 2 r cos(theta)` and `a = r^2`

    Euler         m' = x^2/(1 + r^2 - 2 r cos(theta))     c' = m' (1 - r^2)/h
    implicit      m' = r^2 times Euler's                  c' = Euler's

and undamped `m' = x^2/(4 sin^2(x/2)) = 1 + x^2/12 + x^4/240 + ...`, the mass of Fox and Goodwin. What is left is the half
step between an input held over the step and an impulse at its start: the zeros are right for the mean of this and the
previous input (`beamchain.steps.inputs.HeldInput`).

A mode that turns by more than `PHASE` in a step is *slowed*: its poles are those of a mode that turns by `PHASE`, its
stiffness is its own. So every step is stable. RK4 would need a mass below 1 to be exact, which MuJoCo refuses; only modes
beyond its own phase limit are changed.

Everything here is plain numpy, takes arrays of any one shape, and knows nothing of MuJoCo.

Theory: docs/theory.md, section 5.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from beamchain.checks import one_of
from beamchain.ports.motions import Array

Complex = NDArray[np.complex128]

PHASE = 2.6  #: [rad] phase per step at which faster modes are held by the semi-implicit integrators; below pi
RK4_PHASE = 2.0  #: [rad] the same for RK4, whose own limit is 2.828


@dataclass(frozen=True)
class Scheme:
    """An integrator of MuJoCo, as far as a tendon's spring and damper feel it.

    Args:
        name: MuJoCo's name.
        exact: modes can be made exact in time (the armature needed is not negative).
        phase: [rad] phase per step beyond which modes are slowed; infinity: never.
        implicit_damping: tendon damping is treated implicitly.
    """

    name: str
    exact: bool
    phase: float
    implicit_damping: bool


SCHEMES = {
    s.name: s
    for s in (
        Scheme("Euler", exact=True, phase=PHASE, implicit_damping=False),
        Scheme("implicit", exact=True, phase=PHASE, implicit_damping=True),
        Scheme("implicitfast", exact=True, phase=PHASE, implicit_damping=True),
        Scheme("discrete", exact=False, phase=float("inf"), implicit_damping=True),
        Scheme("RK4", exact=False, phase=RK4_PHASE, implicit_damping=False),
    )
}


class Timed(NamedTuple):
    """Modes as they are written for a step; every field has the modes' shape.

    Args:
        mass: `m'` in units of the modal mass; the tendon's armature is `m' - 1`.
        damping: `c'`, the tendon's damping [1/s].
        slowed: the mode turns faster than the phase limit and was slowed to it.
        clamped: a negative armature would be needed; the mass is 1 and the pole is only near.
    """

    mass: Array
    damping: Array
    slowed: NDArray[np.bool_]
    clamped: NDArray[np.bool_]


def continuous_poles(frequency: ArrayLike, ratio: ArrayLike = 0.0) -> tuple[Complex, Complex]:
    """Both poles `s` of `q'' + 2 zeta w q' + w^2 q = 0` [1/s]; the first has the positive imaginary part.

    Overdamped modes (`ratio > 1`) have two real poles, the slower one first.

    Args:
        frequency: `w` [rad/s].
        ratio: `zeta`.

    Example:
        >>> continuous_poles(2.0)[0]
        np.complex128(2j)
    """
    w, zeta = np.broadcast_arrays(np.asarray(frequency, dtype=np.float64), np.asarray(ratio, dtype=np.float64))
    root = np.sqrt((zeta**2 - 1.0).astype(np.complex128))  # i sqrt(1 - zeta^2) below 1
    return w * (root - zeta), w * (-root - zeta)


def wanted_pole(frequency: ArrayLike, ratio: ArrayLike, timestep: float) -> Complex:
    """`exp(s h)`: the exact pole of one step, the one in the upper half plane.

    Args:
        frequency: `w` [rad/s].
        ratio: `zeta`.
        timestep: `h` [s].
    """
    return np.exp(continuous_poles(frequency, ratio)[0] * timestep)


def seen(pole: ArrayLike, timestep: float) -> tuple[Array, Array]:
    """`(frequency [rad/s], damping ratio)` that a pole `z` of the step looks like from outside: `s = log(z)/h`.

    Args:
        pole: `z`.
        timestep: `h` [s].
    """
    s = np.log(np.asarray(pole, dtype=np.complex128)) / timestep
    w = np.abs(s)
    return w, -s.real / np.where(w > 0.0, w, 1.0)


def step_sums(first: Complex, second: Complex, timestep: float) -> tuple[Array, Array]:
    """`(a, b)` of `z^2 - (1 + a - b) z + a = 0` whose roots are `exp(s1 h)` and `exp(s2 h)`.

    `a = z1 z2` and `b = (1 - z1)(1 - z2)`; both factors through `expm1`, so that nothing is lost at small steps.

    Args:
        first: `s1` [1/s], a mode's pole.
        second: `s2`, its conjugate (or the other real one).
        timestep: `h` [s].
    """
    a = np.exp((first + second) * timestep)
    b = np.expm1(first * timestep) * np.expm1(second * timestep)
    return np.real(a), np.real(b)


def placed(
    integrator: str,
    stiffness: ArrayLike,
    first: ArrayLike,
    second: ArrayLike,
    timestep: float,
    *,
    phase: float | None = None,
    damping: ArrayLike | None = None,
) -> Timed:
    """Mass and damping with which a step of `integrator` has the poles `exp(s h)` and the mode its own static response.

    Where `|s| h` of the faster pole exceeds the phase limit, both poles are scaled back to it. Under implicit and
    implicitfast the mass may come out below 1 (for `zeta > x/12`); it is then 1, and the damping the one that comes
    nearest: the residual of `z^2 - (1 + a - b) z + a` at the wanted pole, linear in `1/(1 + h c')`, is least.

    Args:
        integrator: MuJoCo's name.
        stiffness: `k` per unit modal mass [1/s^2].
        first: pole `s` of the mode [1/s]; need not belong to `stiffness` alone (modes coupled by damping).
        second: the other one.
        timestep: `h` [s].
        phase: [rad] limit of the phase per step; the scheme's own where left out.
        damping: of the untouched mode [1/s]; `-(s1 + s2)` where left out.

    Returns:
        For RK4 and "discrete": the modes as they are, RK4's beyond the limit slowed, `m' = (x/phase)^2`.
    """
    one_of("integrator", integrator, tuple(SCHEMES))
    scheme, h = SCHEMES[integrator], float(timestep)
    limit = scheme.phase if phase is None else float(phase)
    k, s1, s2 = np.broadcast_arrays(
        np.asarray(stiffness, dtype=np.float64),
        np.asarray(first, dtype=np.complex128),
        np.asarray(second, dtype=np.complex128),
    )
    own = -np.real(s1 + s2) if damping is None else np.broadcast_to(np.asarray(damping, dtype=np.float64), k.shape)
    turn = np.maximum(np.abs(s1), np.abs(s2)) * h
    slowed = turn > limit
    none = np.zeros(k.shape, dtype=np.bool_)
    if not scheme.exact:
        factor = np.where(slowed, turn / limit, 1.0)
        return Timed(factor**2, own * factor, slowed, none)
    back = np.where(slowed, limit / np.maximum(turn, 1e-300), 1.0)
    a, b = step_sums(s1 * back, s2 * back, h)
    mass = h**2 * k / b
    drag = -mass * np.expm1(np.real(s1 + s2) * back * h) / h
    if scheme.implicit_damping:
        mass = a * mass
    clamped = mass < 1.0 - 1e-12
    if scheme.implicit_damping and np.any(clamped):
        z = np.exp(s1 * back * h)
        slope = z * (1.0 - h**2 * k) - 1.0  # residual: z^2 - z - a slope
        keep = np.real(np.conj(slope) * (z**2 - z)) / np.abs(slope) ** 2
        drag = np.where(clamped, (1.0 / np.clip(keep, 1e-6, 1.0) - 1.0) / h, drag)
    return Timed(np.maximum(mass, 1.0), np.maximum(drag, 0.0) + 0.0, slowed, clamped)


def timed(
    integrator: str, frequency: ArrayLike, ratio: ArrayLike, timestep: float, *, phase: float | None = None
) -> Timed:
    """Mass and damping that make modes of given frequency and ratio exact for a step; see `placed`.

    Args:
        integrator: MuJoCo's name.
        frequency: `w` [rad/s].
        ratio: `zeta`.
        timestep: `h` [s].
        phase: [rad] limit of the phase per step; the scheme's own where left out.

    Example:
        >>> timed("Euler", 2.0, 0.0, 0.5).mass  # 1/(4 sin^2(1/2))
        array(1.08768...)
    """
    w, zeta = np.broadcast_arrays(np.asarray(frequency, dtype=np.float64), np.asarray(ratio, dtype=np.float64))
    first, second = continuous_poles(w, zeta)
    return placed(integrator, w**2, first, second, timestep, phase=phase, damping=2.0 * zeta * w)


def hinge_armature(stiffness: ArrayLike, timestep: float) -> Array:
    """`k h^2/12`: armature on spring hinges that makes Euler's step right to fourth order, without any tendon.

    The mass matrix becomes `M + h^2 K/12`, so that every coupled mode has `m' = 1 + x^2/12`, whatever the hub: the pole is
    off by `x^4/480` and the step stable to `x < sqrt(6)`.

    Args:
        stiffness: of the hinges' springs [N m/rad] ([N/m] for slides).
        timestep: `h` [s].
    """
    return np.asarray(stiffness, dtype=np.float64) * timestep**2 / 12.0


def step_pole(integrator: str, mass: ArrayLike, damping: ArrayLike, stiffness: ArrayLike, timestep: float) -> Complex:
    """Pole `z` of one step of `m q'' + c q' + k q = 0` on a tendon: upper half plane, or the larger modulus if real.

    For a mode written for another step or integrator this is what it does instead; its error is that of
    `seen(z, h)` against the mode's own frequency and ratio.

    Args:
        integrator: MuJoCo's name.
        mass: `m`; any unit that goes with the others, per unit modal mass say.
        damping: `c`.
        stiffness: `k`.
        timestep: `h` [s].
    """
    one_of("integrator", integrator, tuple(SCHEMES))
    h = float(timestep)
    m, c, k = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (mass, damping, stiffness)))
    if integrator == "RK4":
        s = (-c + np.sqrt((c**2 - 4.0 * m * k).astype(np.complex128))) / (2.0 * m) * h
        other = -c / m * h - s

        def polynomial(v: NDArray[Any]) -> Complex:
            return np.asarray(1.0 + v * (1.0 + v / 2.0 * (1.0 + v / 3.0 * (1.0 + v / 4.0))), dtype=np.complex128)

        z, twin = polynomial(s), polynomial(other)
        return np.where(np.abs(twin) > np.abs(z) * (1.0 + 1e-12), twin, z)
    if integrator == "Euler":
        a, b = 1.0 - h * c / m, h**2 * k / m
    else:
        a = m / (m + h * c)
        b = h**2 * k / (m + h * c + (h**2 * k if integrator == "discrete" else 0.0))
    half = (1.0 + a - b) / 2.0
    square = ((1.0 - a) ** 2 + b**2 - 2.0 * b * (1.0 + a)) / 4.0  # half^2 - a without the loss at small steps
    root = np.sqrt(square.astype(np.complex128))
    return np.where((square > 0.0) & (half < 0.0), half - root, half + root)


def frequency_at(frequency: ArrayLike, made_for: float, timestep: float) -> Array:
    """Frequency [rad/s] that an undamped mode written for the step `made_for` shows at another step under Euler.

    `sin(W h/2) = (h/h0) sin(w h0/2)`; for small steps `W/w - 1 = w^2 (h^2 - h0^2)/24`. NaN where the step is unstable.

    Args:
        frequency: `w` [rad/s].
        made_for: `h0` [s]; 0: written as it is.
        timestep: `h` [s]; 0: the limit of ever finer steps.
    """
    w = np.asarray(frequency, dtype=np.float64)
    rate = w if made_for == 0.0 else 2.0 * np.sin(np.minimum(w * made_for, PHASE) / 2.0) / made_for
    if timestep == 0.0:
        return rate + 0.0
    with np.errstate(invalid="ignore"):
        return 2.0 * np.arcsin(rate * timestep / 2.0) / timestep


def start_rate(position: ArrayLike, rate: ArrayLike, frequency: ArrayLike, ratio: ArrayLike, timestep: float) -> Array:
    """The rate to start a mode with, so that all later positions are the exact ones: its mean over the step before.

    The semi-implicit step leaves in `qvel` the mean rate over the step just taken, `(q(t) - q(t - h))/h`. A state given at
    t = 0 must be told likewise: the mode is followed back by one step, undriven. Undamped this is
    `(q0 (1 - cos x) + v0 sin x/w)/h`; at rest in both it stays at rest. Rigid motion (w = 0) keeps its rate.

    Args:
        position: `q0`, modal displacement.
        rate: `v0`, its true rate at that moment [1/s].
        frequency: `w` [rad/s]; of a slowed mode the slowed one, `PHASE/h`.
        ratio: `zeta`.
        timestep: `h` [s].

    Example:
        >>> start_rate(1.0, 0.0, 0.1, 0.0, 1.0)  # released at its largest displacement: it was on its way out
        array(0.00499583...)
    """
    q, v = np.asarray(position, dtype=np.float64), np.asarray(rate, dtype=np.float64)
    w, zeta = np.asarray(frequency, dtype=np.float64), np.asarray(ratio, dtype=np.float64)
    h, x = float(timestep), np.asarray(frequency, dtype=np.float64) * timestep
    y = x * np.sqrt((1.0 - zeta**2).astype(np.complex128))
    small = np.abs(y) < 1e-6
    sinc = np.real(np.where(small, 1.0 - y**2 / 6.0, np.sin(y) / np.where(small, 1.0, y)))
    grown = np.exp(zeta * x)
    # q(-h) = exp(zeta x) (q0 cos y - h (v0 + zeta w q0) sin(y)/y)
    gone = 2.0 * np.real(np.sin(y / 2.0) ** 2)  # 1 - cos y
    return (q * (gone * grown - np.expm1(zeta * x)) + grown * h * (v + zeta * w * q) * sinc) / h


def runge_kutta_limit(pole: complex) -> float:
    """Largest step [s] at which the classical Runge-Kutta polynomial does not let a continuous pole [1/s] grow."""
    size = abs(pole)
    direction = pole / size if pole.real < 0.0 else 1j  # a pole right of the axis by rounding counts as undamped

    def excess(x: float) -> float:
        s = x * direction
        return abs(1.0 + s * (1.0 + s / 2.0 * (1.0 + s / 3.0 * (1.0 + s / 4.0)))) - 1.0

    grid = np.linspace(0.5, 4.0, 351)
    over = np.flatnonzero(np.array([excess(float(x)) for x in grid]) > 1e-12)
    first = int(over[0])
    return float(brentq(excess, float(grid[first - 1]), float(grid[first]), xtol=1e-14)) / size
