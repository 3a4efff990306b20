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
        step: of the controller [s].

    Raises:
        InputError: the plant is sampled, and the controller's step is no multiple of its step.
    """
    a, b, c, d = system
    n, m = b.shape
    whole = np.zeros((n + m, n + m))
    whole[:n, :n], whole[:n, n:] = a, b
    if plant_step:
        count = round(step / plant_step)
        if count < 1 or abs(step / plant_step - count) > WHOLE * count:
            raise InputError(
                f"controller: its step of {step:g} s is no multiple of the plant's, "
                f"{plant_step:g} s; sample the controller at a multiple, or make the plant without "
                "discrete, whose samples are exact at any step."
            )
        # [A B; 0 1]^k = [A^k (1 + A + ... + A^(k-1)) B; 0 1]
        whole[n:, n:] = np.eye(m)
        held = np.linalg.matrix_power(whole, count)
    else:
        # exp([A B; 0 0] h) = [A_h B_h; 0 1]
        held = np.asarray(expm(whole * step), dtype=np.float64)
    return held[:n, :n], held[:n, n:], c, d
