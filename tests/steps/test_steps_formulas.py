"""Closed forms beside the formulas of a time step."""

import numpy as np
import pytest

from formulas import PlanarChain, condensed_mass, driven, run_of_turn, step_pole

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


STIFF, ARM, AT, WEIGHT = 20.0, 0.6, 0.4, 1.5  # one point mass beyond one hinge


def one_link():
    pair = np.array([0.0, WEIGHT])
    return PlanarChain(
        hinges=np.array([AT]),
        stiffness=np.array([[STIFF]]),
        armature=np.zeros((1, 1)),
        mass=pair,
        com=np.array([0.0, AT + ARM]),
        inertia=np.zeros(2),
        along=np.zeros(2),
    )


@pytest.mark.parametrize("flap", [True, False])
def test_a_spinning_point_on_a_hinge_is_stiffened_by_its_pull(flap):
    # w^2 = k / (m a^2) + W^2 (R + x) / a out of the plane of the spin, less W^2 in it
    spin, radius = 3.0, 0.25
    square = STIFF / (WEIGHT * ARM**2) + spin**2 * ((radius + AT + ARM) / ARM - (not flap))
    got = one_link().frequencies(spin, radius, flap=flap)
    assert got == pytest.approx([np.sqrt(square)], rel=1e-12)


def test_a_root_that_is_pushed_along_x_softens_a_point_on_a_hinge():
    # w^2 = (k - m a_x a) / (m a^2) falls to 0.99^2 of its value
    pushed = STIFF * (1.0 - 0.99**2) / (WEIGHT * ARM)
    assert one_link().axial() == pytest.approx(pushed, rel=1e-9)


def test_a_hub_that_turns_evenly_spins_its_root_and_pulls_it_inwards():
    spin, spacing, out = 0.7, 0.01, 0.5
    time = spacing * np.arange(5)
    motion = np.zeros((5, 6))
    motion[:, 5] = spin * time
    run = driven(motion, spacing, np.array([0.0, out, 0.0]))
    assert run.spin == pytest.approx(spin, rel=1e-9)
    assert run.acceleration["xy"] == pytest.approx(spin**2 * out, rel=1e-9)
    # a run that speeds up: the root at x is carried along y
    turned = run_of_turn(spin, 0.2, 2, (out, 0.0, 0.0))
    assert turned.spin == pytest.approx(spin)
    assert turned.acceleration["xy"] == pytest.approx(0.2 * out, rel=1e-12)
    assert turned.slew["xy"] == pytest.approx(0.2, rel=1e-12)


def test_mass_seen_by_two_tendons_is_the_inverse_of_their_flexibility():
    # of masses 2 and 3, tendons along the sum and the second alone: M = B^T C B
    rows = np.array([[1.0, 1.0], [0.0, 1.0]])
    seen, motion = condensed_mass(np.diag([2.0, 3.0]), rows)
    assert rows.T @ seen @ rows == pytest.approx(np.diag([2.0, 3.0]), rel=1e-12, abs=1e-12)
    assert rows @ motion == pytest.approx(np.eye(2), abs=1e-12)
