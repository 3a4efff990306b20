"""In-band errors of appendages of which some modes are damped and others are not.

docs/theory.md, section 6: modes without damping count with a ratio of 0.5 %. The truth is the
series of a uniform bar in torsion, clamped at its root.
"""

import numpy as np
import pytest

import beamchain as bc

LENGTH = 6.0  # m
STIFFNESS = 150.0  # N m^2
POLAR = 0.12  # kg m
HUB = 4.0  # kg m^2 about x
BANDWIDTH = 30.0  # rad/s: the second mode of hub and bar lies below
SERIES = 400  # modes of the truth
RATIO = 0.02  # of the first mode; none of the others is damped
SERIES_ERROR = 0.01  # relative: what the package's modes above 25 times the band leave


def accelerance(omega, modes):
    """Hub and bar about x, the bar with so many of its modes [1/(kg m^2)]."""
    wave = (np.arange(1, modes + 1) - 0.5) * np.pi
    frequencies = wave * np.sqrt(STIFFNESS / POLAR) / LENGTH
    effective = 2.0 * POLAR * LENGTH / wave**2
    ratios = np.where(np.arange(modes) == 0, RATIO, 0.005)
    s = 1j * omega[:, None]
    share = s**2 / (s**2 + 2.0 * ratios * frequencies * s + frequencies**2)
    return 1.0 / (HUB + POLAR * LENGTH - share @ effective)


@pytest.mark.slow
@pytest.mark.parametrize("modes", [1, 2, 3])
def test_a_mode_without_damping_counts_with_half_a_percent(modes):
    section = bc.Equivalent(
        bending_stiffness_xy=2e4,
        torsion_stiffness=STIFFNESS,
        linear_mass=3.0,
        polar_inertia=POLAR,
    )
    result = bc.fit(
        bc.Beam(segments=(bc.Segment(length=LENGTH, section=section),)),
        modes={"xy": 0, "xz": 0, "torsion": modes, "axial": 0},
        hub=bc.Hub(mass=200.0, inertia=(HUB, 300.0, 300.0)),
        target="clamped",
        damping={"torsion": [RATIO, 0.0]},
        scene=bc.Scene(bandwidth=BANDWIDTH, axes=("x",), tolerance=1e-2),
    )
    omega = np.linspace(1e-3, BANDWIDTH, 300_001)
    exact = accelerance(omega, SERIES)
    size = np.maximum(np.abs(exact), 1.0 / (HUB + POLAR * LENGTH))
    error = np.max(np.abs(accelerance(omega, modes) - exact) / size)
    assert result.in_band_error == pytest.approx(error, rel=SERIES_ERROR)
