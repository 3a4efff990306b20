"""Closed forms beside the formulas of a time step."""

import numpy as np
import pytest

from formulas import step_pole

M, C, K, H = 1.3, 0.4, 50.0, 0.02
N = M + H * C  # with the damping taken at the end of the step


@pytest.mark.parametrize(
    ("integrator", "tendon", "sprung", "keep", "pull"),
    [
        # v' = keep v - pull q / h, q' = q + h v'
        ("Euler", True, True, 1.0 - H * C / M, H**2 * K / M),
        ("Euler", False, True, M / N, H**2 * K / N),
        ("implicitfast", True, True, M / N, H**2 * K / N),
        # m (v' - v) / h = -c v' - k (q + h v') for a spring of a joint
        ("discrete", False, False, M / (N + H**2 * K), H**2 * K / (N + H**2 * K)),
        # that of a tendon: the force of the position alone is divided by the larger mass
        ("discrete", True, True, M / N, H**2 * K / (N + H**2 * K)),
    ],
)
def test_pole_of_a_step_is_its_matrix_s(integrator, tendon, sprung, keep, pull):
    step = np.array([[1.0 - pull, H * keep], [-pull / H, keep]])
    pole = step_pole(integrator, M, C, K, H, tendon=tendon, sprung=sprung)
    wanted = np.linalg.eigvals(step)
    assert complex(pole) == pytest.approx(wanted[np.argmax(wanted.imag)], rel=1e-12)
