"""Step limits of a model: where each integrator blows up, and which step gives 1 % and 0.1 % of the first frequency.

Theory: docs/theory.md, sections 5 and 6.
"""

from dataclasses import dataclass

import numpy as np

from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.steps.integrators import INTEGRATORS
from beamchain.steps.one_step import LinearModel, Poles

AT_REST = 1e-5  # of the fastest pole: what is slower is rigid motion, at rounding level for a free joint
ERRORS = (1e-2, 1e-3)  # of the lowest frequency, for which the step is stated
UNDAMPED = 1e-10  # ratios below it are rounding


@dataclass(frozen=True)
class StepLimits:
    """Step limits of a model.

    Args:
        omega_max: fastest coupled frequency, or rate of an overdamped mode [rad/s].
        ratio: its damping ratio; 1 where it is overdamped.
        largest_step: per integrator [s]; infinity: no limit.
        accuracy: per integrator, steps for 1 % and 0.1 % error of the slowest frequency [s]; empty where none rings.
    """

    omega_max: float
    ratio: float
    largest_step: dict[str, float]
    accuracy: dict[str, tuple[float, float]]


def step_limits(model: LinearModel) -> StepLimits:
    """Step limits from one step's own matrices, overdamped modes included.

    Raises:
        EngineError: the model falls over by itself; no step is stable.
    """
    poles = model.poles()
    moving = poles[np.abs(poles) > AT_REST * float(np.max(np.abs(poles), initial=0.0))]
    if moving.size == 0:
        return StepLimits(0.0, 0.0, dict.fromkeys(INTEGRATORS, float("inf")), {})
    fastest = moving[np.argmax(np.abs(moving))]
    ratio = max(0.0, float(-fastest.real / abs(fastest)))
    limits = {name: model.largest_step(name) for name in INTEGRATORS}
    accuracy: dict[str, tuple[float, float]] = {}
    ringing = oscillating(poles)
    if ringing.size:
        for name in INTEGRATORS:
            one, tenth = (model.step_for_error(name, complex(ringing[0]), e, limits[name]) for e in ERRORS)
            accuracy[name] = one, tenth
    return StepLimits(float(abs(fastest)), 0.0 if ratio < UNDAMPED else ratio, limits, accuracy)


def oscillating(poles: Poles) -> Poles:
    """Poles with positive imaginary part, slowest first, rigid motion left out [1/s]."""
    ringing = poles[poles.imag > AT_REST * float(np.max(np.abs(poles), initial=0.0))]
    return ringing[np.argsort(np.abs(ringing))]


def oscillations(poles: Poles) -> tuple[Array, Array]:
    """Frequencies `(n,)` [rad/s], ascending, and damping ratios of what oscillates among continuous poles [1/s]."""
    ringing = oscillating(poles)
    ratios = np.clip(-ringing.real / np.abs(ringing), 0.0, None)
    return np.abs(ringing), np.where(ratios < UNDAMPED, 0.0, ratios)


def coupled_limits(model: PortModel, hub: Array | None, *, tendon: bool, sprung: bool = False) -> StepLimits:
    """Step limits of a port model on a hub `(m, m)`, or alone.

    Args:
        model: the appendage.
        hub: mass matrix about the port; None: nothing but the appendage.
        tendon: the damping sits on tendons, which Euler integrates explicitly.
        sprung: so do the springs, which "discrete" takes otherwise.
    """
    stiffness, damping = normalised(model if hub is None else model.with_hub(hub))
    nothing = np.zeros_like(damping)
    springs = (nothing, stiffness) if sprung else (stiffness, None)
    return step_limits(LinearModel(stiffness, damping, nothing if tendon else damping, *springs))


def normalised(model: PortModel) -> tuple[Array, Array]:
    """Stiffness and damping `(n, n)` of a free port model in coordinates with a unit mass matrix: both symmetric."""
    compliance = np.eye(model.modes) + model.participation @ model.gains @ model.participation.T
    values, vectors = np.linalg.eigh((compliance + compliance.T) / 2.0)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    spring, damper = model.frequencies[:, None] ** 2, (2.0 * model.damping * model.frequencies)[:, None]
    return root.T @ (spring * root), root.T @ (damper * root)
