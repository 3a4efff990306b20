"""Plants at the samples of a controller: inputs held from sample to sample, exactly."""

import numpy as np
from scipy.linalg import expm

from beamchain.control.systems import System
from beamchain.errors import InputError

WHOLE = 1e-9  # relative, by which one step may miss a multiple of another


def sampled(system: System, plant_step: float, step: float) -> System:
    """A plant as a controller sees it that samples its outputs and holds its inputs every `step`.

    Args:
        system: A, B, C, D of the plant.
        plant_step: of the plant [s]; 0: continuous.
        step: of the controller [s]; 0: both are continuous.

    Raises:
        InputError: the plant is sampled, and the controller's step is no multiple of its step.
    """
    if not step:
        return system
    if not plant_step:
        return _held(system, step)
    count = round(step / plant_step)
    if count < 1 or abs(step / plant_step - count) > WHOLE * count:
        raise InputError(
            f"controller: its step of {step:g} s is no multiple of the plant's, {plant_step:g} s; "
            "sample the controller at a multiple, or make the plant without discrete, whose "
            "samples are exact at any step."
        )
    return _lifted(system, count)


def _held(system: System, step: float) -> System:
    """A continuous plant at the samples: `exp([A B; 0 0] h) = [A_h B_h; 0 1]`."""
    a, b, c, d = system
    n, m = b.shape
    whole = np.zeros((n + m, n + m))
    whole[:n, :n] = a * step
    whole[:n, n:] = b * step
    both = np.asarray(expm(whole), dtype=np.float64)
    return both[:n, :n], both[:n, n:], c, d


def _lifted(system: System, count: int) -> System:
    """A sampled plant at every `count`-th sample, its input held between:
    `A^n`, `(1 + A + ... + A^(n-1)) B`."""
    a, b, c, d = system
    power = np.eye(a.shape[0])
    driven = np.zeros_like(b)
    for _ in range(count):
        driven = a @ driven + b
        power = a @ power
    return power, driven, c, d
