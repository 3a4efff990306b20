"""Closed forms beside the formulas of port models and of their comparison."""

import numpy as np
import pytest

from beamchain import PortModel, compare
from formulas import (
    CoupledPort,
    Shapes,
    as_compared,
    body_mass_matrix,
    first_moment,
    free_peaks,
    joined,
    maximum_of,
    peak_clusters,
)

ROUNDED = 1e-12


def two_modes(frequencies, rows):
    return PortModel(np.eye(2), np.array(frequencies), 0.1 * np.array(rows))


def test_modes_are_matched_by_direction_where_frequencies_are_near():
    # as they stand: 0.05 twice; crossed: ln 1.02 twice, which is less; ln 1.06 twice is more
    for apart, matches in ((1.02, [[0, 1], [1, 0]]), (1.06, [[0, 0], [1, 1]])):
        a = two_modes([1.0, apart], [[1.0, 0.0], [0.0, 1.0]])
        b = two_modes([1.0, apart], [[0.0, 1.0], [1.0, 0.0]])
        assert compare(a, b).matches.tolist() == matches


def test_in_band_error_of_a_rigid_model_is_worst_on_the_light_hub():
    # below the resonance D > m, so that the error is |D - m| / |m_hub + D| at the band's end,
    # with the 0.5 % that modes without damping get; hubs have 0.1, 1 and 10 times the mass
    mass, moment, w, band = 4.0, 1.2, 3.0, 1.5
    exact = PortModel(np.array([[mass]]), np.array([w]), np.array([[moment]]))
    felt = moment**2 * band**2 / (w**2 - band**2 + 2j * 0.005 * w * band)
    wanted = abs(felt) / abs(0.1 * mass + mass + felt)
    got = compare(exact.truncated(0), exact, bandwidth=band).accelerance_in_band
    assert got == pytest.approx(wanted, rel=1e-9)


def test_modes_of_a_damping_matrix_get_the_damping_that_they_lack():
    w = np.array([2.0, 5.0])
    model = CoupledPort(np.eye(1), w, np.array([[0.3], [0.2]]), np.diag([0.0, 0.4]))
    assert as_compared(model, 0.005).rates == pytest.approx(np.diag([0.02, 0.4]), rel=ROUNDED)


def test_points_about_a_peak_go_from_its_width_to_half_its_frequency():
    points = peak_clusters(np.array([[2.0, 0.01]]), 10.0)
    for offset in (0.001, 0.01, 0.02, 0.022, 0.5):
        for side in (1.0 + offset, 1.0 - offset):
            assert np.min(np.abs(points - 2.0 * side)) < ROUNDED
    assert np.sort(np.abs(points / 2.0 - 1.0))[-1] == pytest.approx(0.5)


def test_a_crest_is_followed_to_the_last_gap_before_its_neighbour():
    # two rounds, each of sixths: 1/6 is highest in the first, 4/36 in the second
    def curve(x):
        return 20.0 / (1.0 + ((x - 1 / 9) / 0.02) ** 2) + np.clip(0.9 - 0.9 * np.abs(x - 1), 0, 1)

    known = np.array([0.0, 1.0, 2.0])
    assert maximum_of(curve, known, curve(known)) == pytest.approx(20.0 + 0.1, rel=ROUNDED)


THREE = PortModel(
    np.array([[2.0]]),
    np.array([1.0, 5.0, 8.0]),
    np.array([[0.9], [0.5], [0.4]]),
    damping=np.array([0.01, 0.02, 0.04]),
    tip=np.array([[1.5], [-1.0], [0.7]]),
)


def test_modes_gathered_keep_their_static_flexibility():
    plain = PortModel(THREE.rigid_mass, THREE.frequencies, THREE.participation, THREE.damping)
    got = plain.condensed(2.0)
    assert got.frequencies == pytest.approx([1.0, 2.0], rel=ROUNDED)
    assert abs(got.participation[1, 0]) == pytest.approx(
        2.0 * np.hypot(0.5 / 5.0, 0.4 / 8.0), rel=ROUNDED
    )
    assert got.damping == pytest.approx([0.01, 0.03], rel=ROUNDED)
    assert THREE.condensed(2.0) is THREE  # two modes for two motions


def test_an_attachment_mode_is_the_static_shape_of_the_modes_left_out():
    got = THREE.attached(1, [0])
    q = np.array([-1.0 / 25.0, 0.7 / 64.0])  # tip load over W^2
    w = np.sqrt(np.sum(np.array([25.0, 64.0]) * q**2) / np.sum(q**2))
    assert got.frequencies == pytest.approx([1.0, w], rel=ROUNDED)
    size = np.sqrt(np.sum(q**2))
    moments = [0.9, abs(q @ [0.5, 0.4]) / size]
    assert np.abs(got.participation[:, 0]) == pytest.approx(moments, rel=ROUNDED)
    assert np.abs(got.tip[:, 0]) == pytest.approx([1.5, abs(q @ [-1.0, 0.7]) / size], rel=ROUNDED)


def test_dynamic_mass_of_coupled_damping_is_that_of_its_two_equations():
    # q1'' + d11 q1' + d12 q2' + w1^2 q1 = -l1 a, by Cramer's rule
    (w1, w2), (l1, l2), (d11, d12, d22), w = (2.0, 5.0), (0.3, 0.2), (0.1, 0.05, 0.4), 2.5
    model = CoupledPort(
        np.array([[1.5]]),
        np.array([w1, w2]),
        np.array([[l1], [l2]]),
        np.array([[d11, d12], [d12, d22]]),
    )
    s = 1j * w
    one, both, two = s**2 + s * d11 + w1**2, s * d12, s**2 + s * d22 + w2**2
    whole = one * two - both**2
    q1, q2 = (-l1 * two + l2 * both) / whole, (-l2 * one + l1 * both) / whole
    felt = 1.5 + s**2 * (l1 * q1 + l2 * q2)
    assert model.D(np.array([w]))[0, 0, 0] == pytest.approx(felt, rel=ROUNDED)


def test_energy_of_a_body_is_that_of_its_points():
    random = np.random.default_rng(2)
    mass, at = random.uniform(1.0, 2.0, 9), random.normal(size=(9, 3))
    centre = mass @ at / mass.sum()
    arms = at - centre
    inertia = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(mass, arms, strict=True))
    matrix = body_mass_matrix(mass.sum(), centre, inertia)
    for velocity, rate in random.normal(size=(4, 2, 3)):
        energy = mass @ np.sum((velocity + np.cross(rate, at)) ** 2, axis=1)
        both = np.concatenate([velocity, rate])
        assert both @ matrix @ both == pytest.approx(energy, rel=ROUNDED)
    assert first_moment(matrix) == pytest.approx(mass @ at, rel=ROUNDED)


def test_a_free_mode_has_the_modal_mass_that_the_root_leaves_it():
    # (1 - l^2 / m) q'' + d q' + w^2 q = 0
    mass, moment, w, d = 4.0, 1.2, 3.0, 0.24
    model = PortModel(np.array([[mass]]), np.array([w]), np.array([[moment]]))
    left = 1.0 - moment**2 / mass
    frequency = w / np.sqrt(left)
    found = free_peaks(model, np.array([[d]]))
    assert found == pytest.approx(np.array([[frequency, d / (2.0 * left * frequency)]]), rel=1e-9)


def test_parts_that_do_not_couple_become_one_model_in_space():
    bending = PortModel(
        np.diag([2.0, 1.0]),
        np.array([3.0]),
        np.array([[0.4, 0.2]]),
        np.array([0.01]),
        tip=np.array([[0.7, 0.1, 0.8, 0.2]]),  # two points, each moved and turned
    )
    twist = PortModel(
        np.array([[0.5]]),
        np.array([2.0]),
        np.array([[0.3]]),
        np.array([0.02]),
        tip=np.array([[1.0, 0.5]]),
    )
    motions = [np.eye(6)[:, [1, 5]], np.eye(6)[:, [3]]]
    both = joined([bending, twist], motions, np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0]))
    assert both.frequencies.tolist() == [2.0, 3.0]
    assert both.damping.tolist() == [0.02, 0.01]
    assert both.participation.tolist() == [[0, 0, 0, 0.3, 0, 0], [0, 0.4, 0, 0, 0, 0.2]]
    assert both.tip is not None
    assert both.tip.tolist() == [
        [0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0.5, 0, 0],
        [0, 0.7, 0, 0, 0, 0.1, 0, 0.8, 0, 0, 0, 0.2],
    ]


@pytest.mark.parametrize("bending", [True, False])
def test_momentum_of_a_mode_in_the_turn_of_a_hinge_is_that_of_what_lies_behind(bending):
    x, value, moved, turned = (
        np.array(v) for v in ((1.0, 3.0), (0.4, 0.9), (0.5, 0.7), (0.2, 0.3))
    )
    shapes = Shapes(x, moved, turned, value[None], bending)
    (got,) = shapes.momenta(np.array([0.0, 1.0, 2.0]))
    arms = ((1.0, 3.0), (None, 2.0), (None, 1.0))  # a mass at the hinge is not behind it
    for found, reach in zip(got, arms, strict=True):
        wanted = sum(
            v * (m * (arm if bending else 1.0) + t)
            for v, m, t, arm in zip(value, moved, turned, reach, strict=True)
            if arm is not None
        )
        assert found == pytest.approx(wanted, rel=ROUNDED)
