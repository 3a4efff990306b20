"""In-band errors of appendages of which some or all modes are hardly damped, or not at all.

docs/theory.md, section 6: they count with a ratio of 1e-5 where damping is stated, and with 0.5 %
where none is. The truth is the series of a uniform bar in torsion, clamped at its root.
"""

import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc

LENGTH = 6.0  # m
STIFFNESS = 150.0  # N m^2
POLAR = 0.12  # kg m
HUB = 4.0  # kg m^2 about x
BANDWIDTH = 30.0  # rad/s: the second mode of hub and bar lies below
SERIES = 150  # modes of the truth
RATIO = 0.02  # of the first mode; none of the others is damped
LEAST = 1e-5
STEP = 1e-3  # s: RK4 moves a pole by (w h)^4 / 120, at 30 rad/s a thousandth of the least ratio
SERIES_ERROR = 0.01  # relative: what the package's modes above 25 times the band leave


def bar(modes):
    """Cantilever frequencies [rad/s] of so many modes, and rows L of their participation."""
    wave = (np.arange(1, modes + 1) - 0.5) * np.pi
    frequencies = wave * np.sqrt(STIFFNESS / POLAR) / LENGTH
    return frequencies, np.sqrt(2.0 * POLAR * LENGTH) / wave


def accelerance(omega, modes, ratios):
    """Hub and bar about x, the bar with so many of its modes [1/(kg m^2)]."""
    frequencies, rows = bar(modes)
    s = 1j * omega[:, None]
    share = s**2 / (s**2 + 2.0 * ratios[:modes] * frequencies * s + frequencies**2)
    return 1.0 / (HUB + POLAR * LENGTH - share @ rows**2)


def peaks(modes):
    """Frequencies of hub and bar together [rad/s]."""
    frequencies, rows = bar(modes)
    mass = np.eye(modes + 1)
    mass[0, 0], mass[0, 1:], mass[1:, 0] = HUB + POLAR * LENGTH, rows, rows
    squares = eigh(np.diag([0.0, *frequencies**2]), mass, eigvals_only=True)
    return np.sqrt(squares[1:])


def true_error(modes, ratios):
    """The in-band error of so many modes, on points that resolve every peak."""
    about = np.concatenate([peaks(modes), peaks(SERIES)])
    close = about[about < 1.2 * BANDWIDTH, None] * (1.0 + LEAST * np.linspace(-30.0, 30.0, 601))
    omega = np.union1d(np.linspace(1e-3, BANDWIDTH, 3001), close.ravel())
    omega = omega[omega <= BANDWIDTH]
    exact = accelerance(omega, SERIES, ratios)
    size = np.maximum(np.abs(exact), 1.0 / (HUB + POLAR * LENGTH))
    return np.max(np.abs(accelerance(omega, modes, ratios) - exact) / size)


def fitted(modes, damping, timestep=None):
    section = bc.Equivalent(
        bending_stiffness_xy=2e4,
        torsion_stiffness=STIFFNESS,
        linear_mass=3.0,
        polar_inertia=POLAR,
    )
    return bc.fit(
        bc.Beam(segments=(bc.Segment(length=LENGTH, section=section),)),
        modes={"xy": 0, "xz": 0, "torsion": modes, "axial": 0},
        hub=bc.Hub(mass=200.0, inertia=(HUB, 300.0, 300.0)),
        target="clamped",
        damping=damping,
        scene=bc.Scene(
            bandwidth=BANDWIDTH,
            axes=("x",),
            tolerance=1e-2,
            integrator="RK4",
            timestep=timestep,
        ),
    )


@pytest.mark.slow
@pytest.mark.parametrize("modes", [1, 3])
def test_a_mode_without_damping_counts_with_the_least_ratio(modes):
    ratios = np.where(np.arange(SERIES) == 0, RATIO, LEAST)
    result = fitted(modes, {"torsion": [RATIO, 0.0]})
    assert result.in_band_error == pytest.approx(true_error(modes, ratios), rel=SERIES_ERROR)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [None, 1e-6, 1e-4])
def test_narrow_peaks_are_compared_at_one_ratio_with_and_without_a_step(ratio):
    compared = 0.005 if ratio is None else max(ratio, LEAST)
    truth = true_error(3, np.full(SERIES, compared))
    result = fitted(3, ratio, timestep=STEP)
    assert result.in_band_error == pytest.approx(truth, rel=SERIES_ERROR)
    assert result.sampled_error == pytest.approx(truth, rel=2.0 * SERIES_ERROR)
    said = [w for w in result.warnings if w.code == "least-damping"]
    assert len(said) == (ratio is not None and ratio < LEAST)
