"""Which integrator and step a scene can afford: the largest step that is stable and keeps the tolerance.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.threads import one_thread
from beamchain.ports.compare import NARROWEST, band_grid, clusters, damped, largest, spectral_norms
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.steps.integrators import INTEGRATORS, step_pole
from beamchain.steps.limits import coupled_limits, normalised

MARGIN = 0.8  # of the stability limit
NEARLY = 0.99  # ratio that an overdamped mode is given: it has no frequency to keep

#: Cost of a step against Euler's, measured on hub and 3 links (`tests/benchmarks/fit_time.py` prints them).
RELATIVE_COST = {"Euler": 1.0, "implicitfast": 1.1, "implicit": 2.0, "discrete": 1.15, "RK4": 3.8}


@dataclass(frozen=True)
class StepChoice:
    """One integrator: its largest step [s], the bound, "tolerance" or "stability", and its relative cost."""

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
) -> tuple[StepChoice, ...]:
    """Every integrator's largest step for a model with six motions on a hub `(6, 6)`, cheapest first.

    The in-band error up to `bandwidth` [rad/s] of the response with the poles moved as the step moves them stays below
    `tolerance`; `keep`: hub motions that count; `tendon`, `sprung`: as of `integrators.step_pole`.
    """
    coupled = damped(model).with_hub(hub_mass)
    w, p = coupled.free_frequencies, coupled.free_port_values[:, keep]
    if w.size == 0:
        return ()
    ratios = _coupled_ratios(coupled)
    s = np.sqrt(np.diag(coupled.rigid_mass))[list(keep)]
    grid = band_grid([coupled], bandwidth)
    rigid = (coupled.rigid_port_values @ coupled.rigid_port_values.T)[np.ix_(keep, keep)] * np.outer(s, s)
    stable = coupled_limits(coupled, None, tendon=tendon, sprung=sprung).largest_step
    frozen = float(np.linalg.norm(rigid, 2))
    known = rigid + _flexible(grid, w, ratios, p, s)
    below = np.maximum(spectral_norms(known), frozen)
    out: list[StepChoice] = []
    for name in INTEGRATORS:
        limit = MARGIN * min(stable[name], 3.0 / float(w[0]))

        def over(h: float, name: str = name) -> bool:
            x = w * h
            z = step_pole(name, 1.0, 2.0 * ratios * x, x**2, 1.0, tendon=tendon, sprung=sprung)
            pole = np.log(z) / h
            moved, lost = np.abs(pole), -pole.real / np.maximum(np.abs(pole), 1e-300)
            new = clusters(np.column_stack([moved, lost]), bandwidth)
            if new.size:
                ours, exact = (rigid + _flexible(new, *poles, p, s) for poles in ((moved, lost), (w, ratios)))
                if largest(ours - exact, np.maximum(spectral_norms(exact), frozen)) > tolerance:
                    return True
            return largest(rigid + _flexible(grid, moved, lost, p, s) - known, below) > tolerance

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
    return tuple(
        sorted((StepChoice(c.integrator, c.step, c.bound, c.cost / cheapest) for c in out), key=lambda c: c.cost)
    )


def _flexible(omega: Array, w: Array, ratios: Array, p: Array, s: Array) -> NDArray[np.complex128]:
    """`(f, m, m)` flexible part of the scaled accelerance."""
    x, ratios = 1j * omega[:, None], np.maximum(ratios, NARROWEST)
    weight = x**2 / (x**2 + 2.0 * ratios * w * x + w**2)
    rows = p * s
    outer = (rows[:, :, None] * rows[:, None, :]).reshape(len(rows), -1)
    return np.asarray(weight @ outer, dtype=np.complex128).reshape(-1, rows.shape[1], rows.shape[1])


def _coupled_ratios(coupled: PortModel) -> Array:
    """Damping ratios of the free modes, below 1, in order of frequency."""
    stiffness, damping = normalised(coupled)
    squares, shapes = np.linalg.eigh(stiffness)
    ratios = np.einsum("ik,ij,jk->k", shapes, damping, shapes) / (2.0 * np.sqrt(np.maximum(squares, 1e-300)))
    return np.clip(ratios[-coupled.free_frequencies.size :], 0.0, NEARLY)
