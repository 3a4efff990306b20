"""Step limits of a linear model: stability and accuracy per integrator,
and the cheapest step for a scene.

Theory: docs/theory.md, sections 5 and 6.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, linear_sum_assignment

from beamchain.checks import one_of
from beamchain.engine.library import one_thread
from beamchain.errors import EngineError
from beamchain.ports.compare import (
    DEFAULT_RATIO,
    LEAST_RATIO,
    band_grid,
    largest_norm_ratio,
    peak_clusters,
    spectral_norm,
    spectral_norms,
    with_damping,
)
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, system_matrix
from beamchain.steps.integrators import (
    AT_REST,
    INTEGRATORS,
    Complex,
    StepMap,
    pole_of_mode,
    step_pole,
)

MOST_CONFIRMED = 40  # times a step is shortened until the poles of the whole step confirm it
CONFIRMED = 0.98  # by as much
ERRORS = (1e-2, 1e-3)  # of the lowest frequency, for which the step is stated
UNDAMPED = 1e-10  # ratios below it are rounding
MARGIN = 0.8  # of the stability limit
NEARLY = 0.99  # ratio that an overdamped mode is given: it has no frequency to keep

#: Cost of a step against Euler's, measured on hub and 3 links
#: (`tests/benchmarks/fit_time.py` prints them).
RELATIVE_COST = {"Euler": 1.0, "implicitfast": 1.1, "implicit": 2.0, "discrete": 1.15, "RK4": 3.8}


class StepLimits(NamedTuple):
    """Step limits of a model."""

    omega_max: float  #: fastest coupled frequency, or rate of an overdamped mode [rad/s]
    ratio: float  #: its damping ratio; 1 where it is overdamped
    largest_step: dict[str, float]  #: per integrator [s]; infinity: no limit
    #: per integrator, steps [s] for the `ERRORS`; empty where nothing rings
    accuracy: dict[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A linear model in units of its own mass matrix, all matrices `(nv, nv)`."""

    stiffness: Array  # M^-1 K [1/s^2]
    damping: Array  # M^-1 D, all of it [1/s]
    # the share of the damping that Euler integrates implicitly (that of joints)
    euler_damping: Array
    discrete_stiffness: Array  # the share of the stiffness that "discrete" integrates implicitly
    # that of fixed tendons, implicit there for the force of the position alone
    discrete_tendons: Array | float = 0.0
    preload: str = ""  # what pulls at the rest pose, as a sentence; empty: nothing

    def poles(self) -> Complex:
        """`(2 nv,)` poles of the continuous system [1/s]."""
        return np.linalg.eigvals(system_matrix(self.stiffness, self.damping)).astype(np.complex128)

    def stepped(self, integrator: str, timestep: float | Array = 1.0) -> StepMap:
        """Its step [s]."""
        one_of("integrator", integrator, INTEGRATORS)
        implicit = self.euler_damping if integrator == "Euler" else self.damping
        held = springs = np.zeros_like(self.stiffness)
        if integrator == "discrete":
            held = held + self.discrete_tendons
            springs = held + self.discrete_stiffness
        return StepMap(
            integrator,
            self.stiffness,
            implicit,
            self.damping - implicit,
            timestep,
            mass=np.eye(len(self.stiffness)),
            springs=springs,
            held=held,
        )

    def step(self, integrator: str, timestep: float) -> Array:
        """`(2 nv, 2 nv)` one step in the states (q, h v), so that all entries are pure numbers."""
        change, _ = self.stepped(integrator, timestep).matrices()
        return np.eye(len(change)) + change

    def largest_step(self, integrator: str) -> float:
        """Largest stable step [s]; infinity where there is none."""
        poles = self.poles()
        fastest = float(np.max(np.abs(poles), initial=0.0))
        if np.any(poles.real > AT_REST * fastest):
            raise EngineError(
                self.preload
                or "the model is unstable about its rest pose at any step (a pole at "
                f"{np.max(poles.real):.3g} 1/s): a spring or damper is negative, or gravity "
                "tips it over; linearise it about a stable pose."
            )
        return self.stepped(integrator).largest_step()

    def step_for_error(self, integrator: str, pole: complex, error: float, limit: float) -> float:
        """Largest step [s], up to `limit`, below which the simulated frequency of a mode keeps
        within a relative `error`.

        The step of that mode alone, at `pole` [1/s] above the real axis, proposes it;
        the whole model's confirms it.
        """
        limit = min(limit, 3.0 / abs(pole))
        shown = self._frequency(integrator, pole)

        def miss(h: ArrayLike) -> Array:
            return np.abs(shown(np.asarray(h, dtype=np.float64)) / abs(pole) - 1.0) - error

        steps = limit * np.geomspace(1e-4, 1.0, 400)
        over = np.flatnonzero(miss(steps) > 0.0)
        step = limit
        if over.size:
            low = float(steps[max(over[0] - 1, 0)])
            high = float(steps[over[0]])
            step = (
                float(brentq(lambda h: float(miss(h)), low, high, rtol=1e-10))
                if low < high
                else low
            )
        for _ in range(MOST_CONFIRMED):
            found = abs(complex(self.shown(integrator, step, np.array([pole]))[0]))
            if abs(found / abs(pole) - 1.0) <= error * (1.0 + 1e-6):
                break
            step *= CONFIRMED
        return step

    @cached_property
    def _shapes(self) -> tuple[Complex, Complex, Complex]:
        """Squares `(nv,)` of the undamped frequencies, shapes `(nv, nv)` and their inverse."""
        values, shapes = np.linalg.eig(self.stiffness)
        parts = values, shapes, np.linalg.inv(shapes)
        values, shapes, inverse = (np.asarray(part, dtype=np.complex128) for part in parts)
        return values, shapes, inverse

    def _frequency(self, integrator: str, pole: complex) -> Callable[[Array], Array]:
        """What steps [s], any shape, show of the mode at `pole`, alone: `|log(z)| / h` [1/s]."""
        values, shapes, inverse = self._shapes
        k = int(np.argmin(np.abs(values - abs(pole) ** 2)))
        x, y = shapes[:, k], inverse[k]  # y x = 1
        whole = self.stepped(integrator)
        implicit, explicit, springs, held = (
            float(np.real(y @ part @ x))
            for part in (whole.implicit, whole.explicit, whole.springs, whole.held)
        )
        # the mode's damping, as the pole has it
        own = max(-2.0 * pole.real, 0.0)
        total = implicit + explicit
        share = min(max(implicit / total, 0.0), 1.0) if total > 1e-12 * abs(pole) else 1.0

        def frequency(h: Array) -> Array:
            square, late, early, of_step, of_position, unit = np.array(
                [abs(pole) ** 2, own * share, own * (1.0 - share), springs, held, 1.0]
            ).reshape(-1, 1, 1)
            step = StepMap(
                integrator, square, late, early, h[..., None, None], unit, of_step, of_position
            )
            return np.abs(np.log1p(pole_of_mode(step))) / h

        return frequency

    def shown(self, integrator: str, timestep: float, wanted: Complex) -> Complex:
        """`(k,)` `log(z) / h` [1/s] that the simulation shows for `wanted` poles `(k,)`."""
        z = np.linalg.eigvals(self.step(integrator, timestep)).astype(np.complex128)
        s = np.log(z[np.abs(z) > 1e-14]) / timestep
        s = s[s.imag >= -1e-9 * np.abs(s)]
        cost = np.abs(np.log(np.maximum(np.abs(s[None, :]), 1e-300) / np.abs(wanted)[:, None]))
        rows, columns = linear_sum_assignment(cost)
        out = np.full(wanted.size, np.nan + 0j)
        out[rows] = s[columns]
        return out


def step_limits(model: LinearModel) -> StepLimits:
    """Step limits from one step's own matrices, overdamped modes included."""
    poles = model.poles()
    moving = poles[np.abs(poles) > AT_REST * float(np.max(np.abs(poles), initial=0.0))]
    if moving.size == 0:
        return StepLimits(0.0, 0.0, dict.fromkeys(INTEGRATORS, float("inf")), {})
    fastest = moving[np.argmax(np.abs(moving))]
    ratio = max(0.0, float(-fastest.real / abs(fastest)))
    limits = {name: model.largest_step(name) for name in INTEGRATORS}
    accuracy: dict[str, tuple[float, float]] = {}
    ringing = oscillating(poles)
    for name in INTEGRATORS if ringing.size else ():
        one, tenth = (
            model.step_for_error(name, complex(ringing[0]), e, limits[name]) for e in ERRORS
        )
        accuracy[name] = one, tenth
    return StepLimits(float(abs(fastest)), 0.0 if ratio < UNDAMPED else ratio, limits, accuracy)


def oscillating(poles: Complex) -> Complex:
    """Poles with positive imaginary part, slowest first, rigid motion left out [1/s]."""
    ringing = poles[poles.imag > AT_REST * float(np.max(np.abs(poles), initial=0.0))]
    return ringing[np.argsort(np.abs(ringing))]


def oscillations(poles: Complex) -> tuple[Array, Array]:
    """Frequencies `(n,)` [rad/s], ascending, and damping ratios of what oscillates."""
    ringing = oscillating(poles)
    ratios = np.clip(-ringing.real / np.abs(ringing), 0.0, None)
    return np.abs(ringing), np.where(ratios < UNDAMPED, 0.0, ratios)


def coupled_limits(
    model: PortModel, hub: Array | None, *, tendon: bool, sprung: bool = False
) -> StepLimits:
    """Step limits of a port model on a hub `(m, m)`; `tendon`, `sprung`: see `step_pole`."""
    stiffness, damping = normalise(model if hub is None else model.with_hub(hub))
    nothing = np.zeros_like(damping)
    springs = (nothing, stiffness) if sprung else (stiffness, 0.0)
    return step_limits(LinearModel(stiffness, damping, nothing if tendon else damping, *springs))


def normalise(model: PortModel) -> tuple[Array, Array]:
    """Stiffness and damping `(n, n)` of a free port model, its mass matrix the unit one."""
    compliance = np.eye(model.modes) + model.participation @ model.gains @ model.participation.T
    values, vectors = np.linalg.eigh((compliance + compliance.T) / 2.0)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    spring = model.frequencies[:, None] ** 2
    return root.T @ (spring * root), root.T @ model.damping_matrix @ root


@dataclass(frozen=True)
class StepChoice:
    """One integrator: its largest step [s], the bound, "tolerance" or "stability",
    and its relative cost."""

    integrator: str
    step: float
    bound: str
    cost: float


@one_thread()
def choose_step(
    model: PortModel,
    hub_mass: Array,
    keep: Sequence[int],
    bandwidth: float,
    tolerance: float,
    *,
    tendon: bool = False,
    sprung: bool = False,
    undamped: float = DEFAULT_RATIO,
) -> tuple[StepChoice, ...]:
    """Every integrator's largest step for a model with six motions on a hub `(6, 6)`,
    cheapest first.

    The in-band error up to `bandwidth` [rad/s] of the response with the poles moved as the step
    moves them stays below `tolerance`; `keep`: hub motions that count; `tendon`, `sprung`: as of
    `integrators.step_pole`; `undamped`: as of `ports.compare.compared_ratios`.
    """
    coupled = with_damping(model, undamped).with_hub(hub_mass)
    w = coupled.free_frequencies
    p = coupled.free_port_values[:, keep]
    if w.size == 0:
        return ()
    ratios = _coupled_ratios(coupled)
    s = np.sqrt(np.diag(coupled.rigid_mass))[list(keep)]
    grid = band_grid([coupled], bandwidth)
    rigid = (coupled.rigid_port_values @ coupled.rigid_port_values.T)[
        np.ix_(keep, keep)
    ] * np.outer(s, s)
    stable = coupled_limits(coupled, None, tendon=tendon, sprung=sprung).largest_step
    frozen = spectral_norm(rigid)
    known = rigid + _flexible(grid, w, ratios, p, s)
    below = np.maximum(spectral_norms(known), frozen)
    out: list[StepChoice] = []
    for name in INTEGRATORS:
        limit = MARGIN * min(stable[name], 3.0 / float(w[0]))

        def over(h: float, name: str = name) -> bool:
            x = w * h
            z = step_pole(name, 1.0, 2.0 * ratios * x, x**2, 1.0, tendon=tendon, sprung=sprung)
            pole = np.log(z) / h
            moved = np.abs(pole)
            lost = -pole.real / np.maximum(np.abs(pole), 1e-300)
            new = peak_clusters(np.column_stack([moved, lost]), bandwidth)
            if new.size:
                ours, exact = (
                    rigid + _flexible(new, *poles, p, s) for poles in ((moved, lost), (w, ratios))
                )
                size = np.maximum(spectral_norms(exact), frozen)
                if largest_norm_ratio(ours - exact, size) > tolerance:
                    return True
            difference = rigid + _flexible(grid, moved, lost, p, s) - known
            return largest_norm_ratio(difference, below) > tolerance

        bound, step = "stability", limit
        if over(limit):
            bound = "tolerance"
            low, high = 1e-6 * limit, limit
            for _ in range(11):  # to 1 %
                middle = float(np.sqrt(low * high))
                low, high = (low, middle) if over(middle) else (middle, high)
            step = low
        out.append(StepChoice(name, step, bound, RELATIVE_COST[name] / step))
    cheapest = min(c.cost for c in out)
    return tuple(sorted((replace(c, cost=c.cost / cheapest) for c in out), key=lambda c: c.cost))


def _flexible(omega: Array, w: Array, ratios: Array, p: Array, s: Array) -> Complex:
    """`(f, m, m)` flexible part of the scaled accelerance."""
    x, ratios = 1j * omega[:, None], np.maximum(ratios, LEAST_RATIO)
    weight = x**2 / (x**2 + 2.0 * ratios * w * x + w**2)
    rows = p * s
    outer = (rows[:, :, None] * rows[:, None, :]).reshape(len(rows), -1)
    return np.asarray(weight @ outer, dtype=np.complex128).reshape(-1, rows.shape[1], rows.shape[1])


def _coupled_ratios(coupled: PortModel) -> Array:
    """Damping ratios of the free modes, below 1, in order of frequency."""
    stiffness, damping = normalise(coupled)
    squares, shapes = np.linalg.eigh(stiffness)
    ratios = np.einsum("ik,ij,jk->k", shapes, damping, shapes) / (
        2.0 * np.sqrt(np.maximum(squares, 1e-300))
    )
    return np.clip(ratios[-coupled.free_frequencies.size :], 0.0, NEARLY)
