"""Closed forms beside the formulas of port models and of their comparison."""

import numpy as np
import pytest
from scipy.linalg import eigh

from beamchain import Beam, Equivalent, InputError, PortModel, Segment, compare
from beamchain.ports.motions import mean_mass
from formulas import (
    Shapes,
    band_grid,
    body_mass_matrix,
    compared_ratios,
    first_moment,
    free_peaks,
    grid_of,
    joined,
    largest_norm_ratio,
    maximum_of,
    norm_ratios,
    peak_clusters,
    peaks_at,
    peaks_of,
    relative_error,
    small_inverse,
    spectral_norms,
    unresolved_peaks,
    with_damping,
)

ROUNDED = 1e-12


def two_modes(frequencies, rows):
    return PortModel(np.eye(2), np.array(frequencies), 0.1 * np.array(rows))


def test_modes_are_matched_by_direction_where_frequencies_are_near():
    # as they stand: 0.05 twice; crossed: ln 1.05 twice, which is less; ln 1.052 twice is more
    for apart, matches in ((1.05, [[0, 1], [1, 0]]), (1.052, [[0, 0], [1, 1]])):
        a = two_modes([1.0, apart], [[1.0, 0.0], [0.0, 1.0]])
        b = two_modes([1.0, apart], [[0.0, 1.0], [1.0, 0.0]])
        assert compare(a, b).matches.tolist() == matches


def test_a_mode_that_moves_slightly_alike_is_matched_before_one_that_does_not():
    a = two_modes([1.0], [[1.0, 0.0]])
    b = two_modes([1.0, 1.0], [[0.0, 1.0], [0.05, 1.0]])
    assert compare(a, b).matches.tolist() == [[0, 1]]


@pytest.mark.parametrize(
    ("frequencies", "words"),
    [([], "rigid"), ([2.0], "1 modes: 2 rad/s"), ([1.0, 2.0, 3.0, 4.0], "4 modes: 1, 2, 3, ...")],
)
@pytest.mark.parametrize(("motions", "plural"), [(1, "1 motion,"), (3, "3 motions,")])
def test_a_model_shows_its_first_three_modes(frequencies, words, motions, plural):
    rows = np.zeros((len(frequencies), motions))
    model = PortModel(np.eye(motions), np.array(frequencies), rows)
    assert repr(model).startswith(f"<PortModel, {plural} {words}")


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
    w = np.array([2.0, 5.0, 6.0])  # none, 4 %, and half of the least ratio, 1e-5
    rates = np.diag([0.0, 0.4, 6e-5])
    rates[0, 1] = rates[1, 0] = 1e-3
    rows = np.array([[0.3], [0.2], [0.1]])
    model = PortModel(np.eye(1), w, rows, rates / np.sqrt(np.outer(w, w)) / 2.0)
    rates[np.diag_indices(3)] = [0.02, 0.4, 12e-5]
    assert with_damping(model, 0.005).damping_matrix == pytest.approx(rates, rel=ROUNDED)


def test_points_about_a_peak_go_from_its_width_to_half_its_frequency():
    points = peak_clusters(np.array([[2.0, 0.01]]), 10.0)
    for offset in (0.001, 0.01, 0.02, 0.022, 0.5):
        for side in (1.0 + offset, 1.0 - offset):
            assert np.min(np.abs(points - 2.0 * side)) < ROUNDED
    assert np.sort(np.abs(points / 2.0 - 1.0))[-1] == pytest.approx(0.5)


@pytest.mark.parametrize("place", [1 / 9, 17 / 9])
def test_a_crest_is_followed_to_the_last_gap_before_its_neighbour(place):
    # two rounds, each of sixths: 1/6 is highest in the first, 4/36 in the second
    def curve(x):
        return 20.0 / (1.0 + ((x - place) / 0.02) ** 2) + np.clip(0.9 - 0.9 * np.abs(x - 1), 0, 1)

    known = np.arange(4.0)
    assert maximum_of(curve, known, curve(known)) == pytest.approx(20.0 + 0.1, rel=ROUNDED)


@pytest.mark.parametrize("place", [1.0 / 6.0, 17.0 / 6.0])
def test_crests_at_both_ends_of_the_points_are_followed(place):
    def curve(x):
        return np.where(np.abs(x - place) < 1e-9, 2.0, np.abs(x - 1.5) ** 2 / 3.0)

    known = np.arange(4.0)
    values = curve(known) * (np.abs(known - place) < 1.0)  # of one end alone
    assert maximum_of(curve, known, values) == 2.0


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


def test_modes_gathered_keep_the_flexibility_of_two_motions_and_of_the_tip_between_them():
    random = np.random.default_rng(7)
    w = np.array([1.0, 3.0, 5.0, 6.0, 8.0, 9.0])
    rows, tip = 0.2 * random.normal(size=(6, 2)), random.normal(size=(6, 1))
    full = PortModel(np.diag([4.0, 9.0]), w, rows, damping=np.arange(1.0, 7.0) / 1e3, tip=tip)
    got = full.condensed(4.0)
    assert got.frequencies == pytest.approx([1.0, 3.0, 4.0, 4.0, 4.0])
    both, gathered = (
        np.hstack([full.participation, full.tip]),
        np.hstack([got.participation, got.tip]),
    )
    assert gathered[:2] == pytest.approx(both[:2])
    wanted = (both[2:].T / w[2:] ** 2) @ both[2:]
    assert gathered[2:].T @ gathered[2:] / 16.0 == pytest.approx(wanted, rel=1e-9)
    assert got.damping == pytest.approx([1e-3, 2e-3, 4.5e-3, 4.5e-3, 4.5e-3])
    # five motions and points, for four modes above: nothing is gathered
    more = full.replaced(tip=random.normal(size=(6, 3)))
    assert more.condensed(4.0) is more


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
    cross = d12 / np.sqrt(w1 * w2) / 2.0
    ratios = np.array([[d11 / w1 / 2.0, cross], [cross, d22 / w2 / 2.0]])
    model = PortModel(np.array([[1.5]]), np.array([w1, w2]), np.array([[l1], [-l2]]), ratios)
    l2 = -l2  # a negative participation turns the mode's sign and that of the coupling
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


def test_the_mean_mass_is_that_of_three_directions():
    assert mean_mass(np.diag([2.0, 3.0, 7.0, 11.0, 13.0, 17.0]) + 0.5) == pytest.approx(4.5)


def test_a_free_mode_has_the_modal_mass_that_the_root_leaves_it():
    # (1 - l^2 / m) q'' + d q' + w^2 q = 0
    mass, moment, w, d = 4.0, 1.2, 3.0, 0.24
    ratio = np.array([[d / w / 2.0]])
    model = PortModel(np.array([[mass]]), np.array([w]), np.array([[moment]]), ratio)
    left = 1.0 - moment**2 / mass
    frequency = w / np.sqrt(left)
    found = free_peaks(model)
    assert found == pytest.approx(np.array([[frequency, d / (2.0 * left * frequency)]]), rel=1e-9)


@pytest.mark.parametrize("unit", [1e-8, 1.0, 1e8])
def test_free_modes_scale_with_the_unit_of_time_and_those_without_mass_are_none(unit):
    frequencies, moments = unit * np.array([3.0, 5.0]), np.array([[1.2, 0.3], [0.4, 0.9]])
    mass = np.array([[4.0, 0.7], [0.7, 1.5]])
    left = np.eye(2) - moments @ np.linalg.solve(mass, moments.T)
    wanted = eigh(np.diag(frequencies**2), left, eigvals_only=True)
    found = PortModel(mass, frequencies, moments).free_frequencies
    assert found == pytest.approx(np.sqrt(wanted), rel=1e-9)
    # one that carries all of the mass stands still against it
    whole = PortModel(np.array([[1.44]]), frequencies[:1], np.array([[1.2]]))
    assert whole.free_frequencies.size == 0


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
    (got,) = shapes.momenta(np.array([0.0, 1.0, 2.95]))
    arms = ((1.0, 3.0), (None, 2.0), (None, 0.05))  # a mass at the hinge is not behind it
    for found, reach in zip(got, arms, strict=True):
        wanted = sum(
            v * (m * (arm if bending else 1.0) + t)
            for v, m, t, arm in zip(value, moved, turned, reach, strict=True)
            if arm is not None
        )
        assert found == pytest.approx(wanted, rel=ROUNDED)


# -- the comparison --------------------------------------------------------------------------------
def test_a_comparison_is_relative_to_the_reference_s_motions():
    """Each motion over the root of its mass; modes may point the other way."""
    a = PortModel(np.array([[4.4, 0.3], [0.3, 9.0]]), np.array([2.1]), np.array([[1.0, 0.9]]))
    b = PortModel(np.array([[4.0, 0.0], [0.0, 9.0]]), np.array([2.0]), np.array([[1.2, 0.3]]))
    found = compare(a, b)
    assert found.frequency_errors == pytest.approx([0.05], rel=ROUNDED)
    assert found.frequency == pytest.approx(0.05, rel=ROUNDED)
    wanted = np.hypot(0.1, 0.2) / np.hypot(0.6, 0.1)
    assert found.participation_errors == pytest.approx([wanted], rel=ROUNDED)
    assert found.mass_error == pytest.approx(0.1, rel=ROUNDED)
    assert found.accelerance_in_band is None
    # modes that move their root by little have the same sign too
    light = PortModel(b.rigid_mass, b.frequencies, np.array([[0.2, 0.3]]))
    assert compare(light, light).participation == 0.0
    slower = compare(b, a)
    assert slower.frequency == pytest.approx(0.1 / 2.1, rel=ROUNDED)
    # 1e-9 of the mass is none, so that the sign is that of the second motion
    turned = PortModel(b.rigid_mass, b.frequencies, np.array([[1e-10, 0.3]]))
    other = PortModel(b.rigid_mass, b.frequencies, np.array([[-0.3, 0.3]]))
    assert compare(other, turned).participation == pytest.approx(
        np.hypot(0.15, 0.0) / 0.1, rel=1e-6
    )


@pytest.mark.parametrize("size", [1, 2, 3])
def test_inverses_and_norms_of_small_matrices(size):
    random = np.random.default_rng(size)
    matrices = random.normal(size=(5, size, size)) + 1j * random.normal(size=(5, size, size))
    matrices[2] *= 10.0
    matrices[3] *= 1e-3
    assert small_inverse(matrices) == pytest.approx(np.linalg.inv(matrices), rel=1e-9)
    norms = np.array([np.linalg.svd(one, compute_uv=False)[0] for one in matrices])
    assert spectral_norms(matrices) == pytest.approx(norms, rel=ROUNDED)
    over = np.array([1.0, 2.0, 4.0, 0.5, 3.0])
    found = norm_ratios(matrices, over)
    assert found.max() == pytest.approx((norms / over).max(), rel=ROUNDED)
    assert largest_norm_ratio(matrices, over) == pytest.approx((norms / over).max(), rel=ROUNDED)
    near = found > 0.0
    assert found[near] == pytest.approx((norms / over)[near], rel=ROUNDED)
    if size < 3:
        assert near.all()


def test_norms_that_cannot_be_the_largest_are_left_out():
    """`|A|_F / sqrt(3)` of the largest, 3, is the least that a norm can be beside it."""
    matrices = np.array([np.diag([3.0, 0.0, 0.0]), np.diag([1.8, 0.0, 0.0]), np.eye(3)]) + 0j
    assert norm_ratios(matrices, np.ones(3)).tolist() == [3.0, 1.8, 1.0]
    matrices[1] = np.diag([1.7, 0.0, 0.0])
    assert norm_ratios(matrices, np.ones(3)).tolist() == [3.0, 0.0, 1.0]
    # what they are divided by counts
    both = np.array([np.diag([3.0, 3.0, 3.0]), np.diag([1.0, 0.0, 0.0])]) + 0j
    assert norm_ratios(both, np.array([4.0, 1.0])).tolist() == [0.75, 1.0]
    assert norm_ratios(both[:0], np.zeros(0)).tolist() == []  # where no frequency is high


def test_an_error_is_over_the_larger_of_the_exact_and_of_the_rigid_response():
    exact = np.array([[[2.0]], [[0.5]]]) + 0j
    found = relative_error(exact * 1.1, exact, 1.5)
    assert found == pytest.approx([0.1, 0.05 / 1.5], rel=ROUNDED)


def test_damping_at_which_models_are_compared():
    ratios = np.array([0.0, 0.9e-9, 1.1e-9, 0.9e-5, 1.1e-5, 0.3])
    assert compared_ratios(ratios, 0.02).tolist() == [0.02, 0.02, 1e-5, 1e-5, 1.1e-5, 0.3]
    model = two_modes([1.0, 2.0], np.eye(2)).replaced(damping=np.array([1e-5, 0.1]))
    assert with_damping(model, 0.02) is model
    assert with_damping(two_modes([1.0, 2.0], np.eye(2))).damping.tolist() == [0.005, 0.005]


def test_peaks_that_the_points_of_known_ones_do_not_resolve():
    known = np.array([[2.0, 0.1], [5.0, 0.02]])
    for peak, ratio, new in (
        (2.0 * (1.0 + 0.049 * 0.1), 0.1, False),
        (2.0 * (1.0 - 0.051 * 0.1), 0.1, True),
        (2.0 * (1.0 + 0.049 * 0.07), 0.07, False),  # narrower by less than 1.5
        (2.0, 0.066, True),
        (2.0 * (1.0 + 0.051 * 0.07), 0.07, True),  # near by the narrower of both
        (5.0 * (1.0 + 0.049 * 0.02), 0.3, False),
        (5.0 * (1.0 + 0.051 * 0.02), 0.3, True),
    ):
        found = unresolved_peaks(np.array([[peak, ratio]]), known)
        assert len(found) == new
    assert unresolved_peaks(known, np.zeros((0, 2))) is known


def test_damped_poles_as_frequencies_and_ratios():
    poles = np.array([-0.3 + 0.4j, -0.3 - 0.4j, -2.0, 0.0, 0.1 + 0.2j])
    assert peaks_at(poles) == pytest.approx(
        np.array([[0.5, 0.6], [2.0, 1.0], [np.hypot(0.1, 0.2), 0.0]])
    )


@pytest.mark.parametrize("ratios", [(0.01, 0.015), (0.01, 0.021), (0.09, 0.11), (0.2, 0.3)])
def test_peaks_of_a_model_are_those_on_its_hub_and_those_held(ratios):
    """Of `[[M + H, L^T], [L, 1]]`; ratios that are alike and small do not couple the free modes."""
    w, rows = np.array([2.0, 5.0]), np.array([[0.8], [0.5]])
    model = PortModel(np.array([[2.0]]), w, rows, np.array(ratios))
    mass = np.eye(2) - rows @ rows.T / 3.0
    free = eigh(np.diag(w**2), mass)
    rates = np.diag(2.0 * np.array(ratios) * w)
    if max(ratios) <= min(0.1, 2.0 * min(ratios)):
        own = np.diag(free[1].T @ rates @ free[1])
        wanted = np.column_stack([np.sqrt(free[0]), own / 2.0 / np.sqrt(free[0])])
    else:
        inverse = np.linalg.inv(mass)
        system = np.block(
            [[np.zeros((2, 2)), np.eye(2)], [-inverse @ np.diag(w**2), -inverse @ rates]]
        )
        poles = np.linalg.eigvals(system)
        poles = poles[poles.imag > 0.0]
        wanted = np.column_stack([np.abs(poles), -poles.real / np.abs(poles)])
    found = peaks_of(model, np.array([[1.0]]))
    held = np.column_stack([w, ratios])
    assert found[2:] == pytest.approx(held)
    assert found[np.argsort(found[:2, 0])] == pytest.approx(wanted[np.argsort(wanted[:, 0])])
    coupled = PortModel(np.array([[2.0]]), w, rows, np.diag(ratios))
    same = peaks_of(coupled, np.array([[1.0]]))
    assert np.sort(same[2:], axis=0) == pytest.approx(held)


@pytest.mark.parametrize(
    ("peak", "inside"),
    [(12.9, True), (13.1, False), (1.1e-5, True), (0.9e-5, False)],
)
def test_peaks_from_next_to_nothing_to_somewhat_above_the_band_count(peak, inside):
    points = peak_clusters(np.array([[peak, 0.3]]), 10.0)
    assert bool(points.size) == inside
    assert np.all((points > 0.0) & (points <= 10.0))


def test_points_of_a_wide_and_of_a_narrow_peak():
    """Tenths of the ratio up to twice it, then in equal ratios from 2.2 ratios on."""
    points = peak_clusters(np.array([[2.0, 0.4]]), 100.0)
    offsets = np.sort(points[points >= 2.0] / 2.0 - 1.0)
    assert offsets[:21] == pytest.approx(0.4 * np.arange(0.0, 2.05, 0.1), abs=ROUNDED)
    assert offsets[21:] == pytest.approx(0.88 * (1.2 / 0.88) ** (np.arange(4) / 3.0))
    narrow = peak_clusters(np.array([[2.0, 1e-7]]), 100.0)
    offsets = np.sort(narrow[narrow > 2.0] / 2.0 - 1.0)
    assert offsets[0] == pytest.approx(1e-6, rel=1e-6)  # a tenth of the least ratio, 1e-5
    far = offsets[20:]
    count = int(np.log(0.25 / 1e-5) / 0.14)
    assert far == pytest.approx(2.2e-5 * (0.5 / 2.2e-5) ** (np.arange(count) / (count - 1.0)))


def test_a_grid_has_four_hundred_points_and_those_of_its_peaks():
    plain = np.linspace(0.025, 10.0, 400)
    assert grid_of([], 10.0) == pytest.approx(plain)
    first, second = np.array([[2.0, 0.01]]), np.array([[2.0 + 1e-5, 0.01], [7.0, 0.02]])
    found = grid_of([first, second], 10.0)
    wanted = [plain, *(peak_clusters(p, 10.0) for p in (first, second[1:]))]
    assert found == pytest.approx(np.unique(np.concatenate(wanted)))
    model = PortModel(np.array([[2.0]]), np.array([3.0]), np.array([[1.0]]), np.array([0.02]))
    found = band_grid([model], 10.0)
    # held at 3, free at 3 sqrt(2)
    for peak, width in ((3.0, 0.02), (3.0 * np.sqrt(2.0), 0.02 * np.sqrt(2.0))):
        near = found[np.abs(found / peak - 1.0) <= 2.0 * width]
        assert np.max(np.diff(near)) <= 0.1 * width * peak * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("most", "followed"),
    # between 0.8 of the tolerance and the tolerance over 1.01 its points leave it open
    [(0.79, False), (0.81, True), (0.98, True), (0.995, False), (1.5, False)],
)
def test_a_maximum_is_followed_where_the_points_leave_the_tolerance_open(most, followed):
    def curve(x):
        return most * (1.0 + 0.1 * np.clip(1.0 - np.abs(x - 7.0 / 6.0) / 0.1, 0.0, 1.0))

    known = np.array([2.0, 0.0, 1.0])  # in any order
    values = np.array([0.1, 0.2, most])
    found = maximum_of(curve, known, values, tolerance=1.0)
    assert (found > most) == followed
    assert maximum_of(curve, known, values) > most


@pytest.mark.parametrize(("second", "followed"), [(0.69, False), (0.71, True)])
def test_crests_from_seven_tenths_of_the_largest_are_followed(second, followed):
    def curve(x):
        return np.where(np.abs(x - 3.5) < 0.2, 2.0, 0.0)

    known = np.arange(5.0)
    values = np.array([0.0, 1.0, 0.0, second, 0.0])
    assert (maximum_of(curve, known, values) == 2.0) == followed
    assert maximum_of(curve, known[:2], np.zeros(2)) == 0.0
    assert maximum_of(curve, known[:0], np.zeros(0)) == 0.0


# -- port models that are refused ------------------------------------------------------------------
def made(**more):
    rigid = np.array([[4.0, 1.0], [1.0, 9.0]])
    given = {"rigid_mass": rigid, "frequencies": [2.0, 2.0], "participation": np.eye(2) * 0.5}
    return PortModel(**{**given, **more})


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({}, None),
        ({"frequencies": [2.0, 1.999]}, "ascending"),
        ({"frequencies": [0.0, 2.0]}, "positive and ascending"),
        ({"frequencies": [1e-9, 2.0]}, None),
        ({"damping": [-0.9e-6, 0.1]}, None),
        ({"damping": [-1.1e-6, 0.1]}, "negative ratio"),
        ({"damping": [[0.1, -0.05], [-0.05, 0.1]]}, None),
        ({"damping": [[0.1, 0.2], [0.2, 0.1]]}, "negative ratio"),
        # asymmetry up to 1e-6 of the roots of both masses, 6
        ({"rigid_mass": [[4.0, 1.0], [1.0 + 5.9e-6, 9.0]]}, None),
        ({"rigid_mass": [[4.0, 1.0], [1.0 - 6.1e-6, 9.0]]}, "not symmetric"),
        ({"rigid_mass": [[4.0, 1.0], [1.0, 0.0]]}, "must be positive"),
        # a residual below zero by 1e-9 of the mass
        ({"participation": [[2.0 * np.sqrt(1.0 + 0.9e-9), 0.5], [0.0, 0.0]]}, None),
        ({"participation": [[2.0 * np.sqrt(1.0 + 1.1e-9), 0.5], [0.0, 0.0]]}, "residual mass"),
        ({"labels": ("xy",)}, "labels"),
        ({"labels": ("xy", "")}, None),
        ({"participation": np.eye(2)[:1]}, "a port model needs"),
        ({"damping": [0.1]}, "a port model needs"),
        ({"frequencies": [np.nan, 2.0]}, "not finite"),
    ],
)
def test_port_models_that_nothing_has_are_refused(more, says):
    if says is None:
        assert made(**more).modes == 2
    else:
        with pytest.raises(InputError, match=says):
            made(**more)


@pytest.mark.parametrize(("part", "sign"), [(-1.1e-9, -1.0), (-0.9e-9, 1.0)])
def test_the_first_participation_beyond_noise_is_positive(part, sign):
    """1e-9 of the largest, each over the root of its mass: 2 and 3."""
    rows = np.array([[part * 2.0 * 0.1, 0.3], [-0.2, 0.1]])
    shapes = Shapes(np.ones(3), np.ones(3), np.ones(3), np.arange(1.0, 7.0).reshape(2, 3), True)
    found = made(participation=rows, tip=np.eye(2), shapes=shapes)
    assert found.shapes.values.tolist() == [[sign * v for v in (1, 2, 3)], [-4, -5, -6]]
    assert found.participation == pytest.approx(rows * np.array([[sign], [-1.0]]))
    assert found.tip.tolist() == [[sign, 0.0], [0.0, -1.0]]


def test_modes_picked_and_reduced_are_counted():
    assert made().picked([1]).frequencies.tolist() == [2.0]
    for wrong in ([2], [-1], [0.5]):
        with pytest.raises(InputError):
            made().picked(wrong)
    for wrong in (3, -1):
        with pytest.raises(InputError):
            made().truncated(wrong)
        with pytest.raises(InputError):
            made().reduced(wrong, np.zeros((2, 2)))
    # for a target: held, free, or on a hub
    for target, hub in (
        ("clamped", None),
        ("free", np.zeros((2, 2))),
        ("hub", np.diag([5.0, 7.0])),
    ):
        found = made().for_target(target, 1, np.diag([5.0, 7.0]))
        if hub is None:
            assert found.frequencies.tolist() == [2.0]
        else:
            mass = np.eye(2) - 0.25 * np.linalg.inv(made().rigid_mass + hub)
            lowest = np.sqrt(eigh(4.0 * np.eye(2), mass, eigvals_only=True)[0])
            assert found.with_hub(hub).free_frequencies == pytest.approx([lowest])
    assert made().truncated(2).modes == made().reduced(2, np.zeros((2, 2))).modes == 2


def test_free_damping_is_that_of_the_free_shapes():
    """Of two modes on one motion; each free mode by itself."""
    w, rows, ratios = np.array([2.0, 5.0]), np.array([[0.8], [0.5]]), np.array([0.01, 0.03])
    model = PortModel(np.array([[2.0]]), w, rows, ratios)
    squares, shapes = eigh(np.diag(w**2), np.eye(2) - rows @ rows.T / 2.0)
    own = np.diag(shapes.T @ np.diag(2.0 * ratios * w) @ shapes)
    assert model.free_damping == pytest.approx(own / 2.0 / np.sqrt(squares), rel=1e-9)


def test_a_model_in_other_motions_of_its_root():
    turn = np.array([[1.0, 2.0], [0.0, 1.0]])
    found = made().in_motions(turn)
    assert found.rigid_mass == pytest.approx(turn.T @ made().rigid_mass @ turn)
    assert found.participation == pytest.approx(0.5 * turn)


def test_a_coupled_port_seen_in_some_motions_with_a_hub():
    rates = np.array([[0.1, 0.05], [0.05, 0.4]])
    model = made().replaced(damping=rates)
    motions = np.array([[1.0], [2.0]])
    seen = model.with_hub(np.diag([10.0, 20.0])).in_motions(motions)
    whole = model.D(np.array([1.7]))[:, :, 0] + np.diag([10.0, 20.0])
    assert seen.D(np.array([1.7]))[:, :, 0] == pytest.approx(motions.T @ whole @ motions)


def test_attachments_that_normal_modes_carry_are_none():
    """A part of 1e-7 outside the normal modes is one of them."""
    for part, count in ((1.1e-7, 2), (0.9e-7, 1)):
        model = PortModel(
            np.array([[2.0]]),
            np.array([1.0, 1.0]),
            np.array([[0.9], [0.5]]),
            tip=np.array([[1.0], [part]]),
        )
        assert model.attached(1, [0]).modes == count


def test_an_attachment_is_one_however_little_its_point_moves():
    tip = np.array([[0.3], [0.8], [-0.5]])
    for size in (1e-9, 1.0, 1e9):
        model = PortModel(
            np.array([[2.0]]), np.array([1.0, 2.0, 3.0]), np.full((3, 1), 0.3), tip=size * tip
        )
        found = model.attached(1, [0])
        assert found.modes == 2
        # its static flexibility is that of all modes
        wanted = size**2 * np.sum((tip[:, 0] / [1.0, 2.0, 3.0]) ** 2)
        assert np.sum((found.tip[:, 0] / found.frequencies) ** 2) == pytest.approx(wanted)


def test_a_point_that_does_not_move_has_no_attachment():
    """Its column of the tip is zero, and no static shape is added for it."""
    still = PortModel(np.eye(1), np.array([1.0, 2.0, 3.0]), np.zeros((3, 1)), tip=np.eye(3)[:, [2]])
    tip = np.column_stack([still.tip, np.zeros(3)])
    both = PortModel(np.eye(1), np.array([1.0, 2.0, 3.0]), np.zeros((3, 1)), tip=tip)
    assert both.attached(1, [0, 1]).frequencies.tolist() == pytest.approx([1.0, 3.0])
    assert both.attached(1, [1]).frequencies.tolist() == [1.0]


def test_in_band_error_of_a_plane_is_that_of_its_definition():
    # docs/theory.md, section 6, on 20,000 even points, with the 0.5 % of modes without damping
    section = Equivalent(linear_mass=1.0, bending_stiffness_xy=1.0)
    full = Beam(segments=[Segment(length=1.0, section=section)]).port("xy", 10)
    hub, band = 2.0 * full.rigid_mass, 30.0
    size = np.sqrt(np.diag(hub + full.rigid_mass))
    damped = full.replaced(damping=np.full(full.modes, 0.005))
    omega = np.linspace(0.0, band, 20_001)[1:]

    def moved(model):
        return np.linalg.inv(hub + np.moveaxis(model.D(omega), -1, 0)) * np.outer(size, size)

    def norm(matrices):
        return np.linalg.norm(matrices, 2, axis=(1, 2))

    exact, rigid = moved(damped), moved(damped.truncated(0))
    for modes, there in ((1, 1.95), (2, 0.1545)):
        difference = norm(moved(damped.truncated(modes)) - exact)
        error = np.max(difference / np.maximum(norm(exact), norm(rigid)))
        assert error == pytest.approx(there, rel=2e-3)
        got = compare(full.truncated(modes), full, hub_mass=hub, bandwidth=band)
        assert got.accelerance_in_band == pytest.approx(error, rel=1e-3)
