"""Closed forms beside upper bounds: multipliers and what they prove, programs, parts of ranges."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from beamchain.robust.multipliers import ComplexSystem, Delta, Multipliers
from complex_systems import complex_system, gains_of, gaussian, hermitian, value
from robust_doors import (
    balanced_channels,
    basis_of_hermitian,
    between_ends,
    blocks_of_deltas,
    from_real_symmetric,
    moments_of_delta,
    positive_block,
    proof_over,
    real_symmetric,
    solve_program,
    zero_crossings,
)

SYSTEM = complex_system(4, 3, 5)
D = hermitian(1, 2, 0.2) + 2.0 * np.eye(2)
G = hermitian(2, 2, 0.3)
PROVING = Multipliers(D, G)


def certificate(n, g, d=D, more=G):
    """diag(D, g) - N^H diag(D, 1) N - j (G N - N^H G)."""
    size = len(d)
    top, y, of_g = (np.zeros((size + 1, size + 1), complex) for _ in range(3))
    top[:size, :size] = y[:size, :size] = d
    top[size, size], y[size, size] = g, 1.0
    of_g[:size, :size] = more
    return top - n.conj().T @ y @ n - 1j * (of_g @ n - n.conj().T @ of_g)


def test_a_complex_system_at_frequencies_and_at_infinity():
    omega = np.array([-0.7, 2.0, np.inf])
    found = SYSTEM.at(omega)
    for k in range(2):
        np.testing.assert_allclose(found[k], value(SYSTEM, omega[k]))
    np.testing.assert_allclose(found[2], SYSTEM.d)


def test_the_least_g_leaves_the_certificate_singular_and_no_less_than_positive():
    omega = np.array([-1.0, 0.4, 3.0])
    n = SYSTEM.at(omega)
    for each, g in zip(n, PROVING.needed(n), strict=True):
        assert np.linalg.eigvalsh(certificate(each, g)).min() == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.eigvalsh(certificate(each, 1.01 * g)).min() > 0.0
    assert np.isinf(Multipliers(-D, G).needed(n)).all()
    alone = Multipliers(D, G).needed(4.0 * n)
    assert np.isfinite(alone).tolist() == [
        np.linalg.eigvalsh(certificate(4.0 * each, 0.0)[:2, :2]).min() > 0.0 for each in n
    ]


def test_zeros_of_the_certificate_are_among_the_crossings():
    omega = np.linspace(-6.0, 6.0, 601)
    needed = PROVING.needed(SYSTEM.at(omega))
    for share in (0.2, 0.4, 0.6, 0.8):
        g = float(needed.min() + share * (needed.max() - needed.min()))
        crossed = np.flatnonzero((needed[1:] > g) != (needed[:-1] > g))
        assert crossed.size >= 1
        found = zero_crossings(SYSTEM, PROVING, g, 0.31)
        for k in crossed:
            part = (g - needed[k]) / (needed[k + 1] - needed[k])
            at = omega[k] + part * (omega[k + 1] - omega[k])
            assert np.abs(found - at).min() < 1e-3


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.5), (0.3, 0.32), (1.0, np.inf), (-3.0, 3.0)])
def test_what_multipliers_prove_is_the_most_that_is_needed(low, high):
    top = high if np.isfinite(high) else 300.0
    omega = np.append(np.linspace(low, top, 400), np.geomspace(max(low, 0.01), top, 300))
    needed = np.append(PROVING.needed(SYSTEM.at(omega)), PROVING.needed(SYSTEM.d[None]))
    if np.isfinite(high):
        needed[-1] = 0.0
    assert np.isfinite(needed).all()
    found = proof_over(SYSTEM, PROVING, low, high)
    assert found.g == pytest.approx(needed.max(), rel=1e-4)
    assert found.g >= needed.max()
    at = PROVING.needed(SYSTEM.at(np.array([found.omega])))[0]
    assert at == pytest.approx(found.g, rel=1e-3)


def test_without_a_certificate_nothing_is_proved():
    assert proof_over(SYSTEM, Multipliers(-D, G), 0.0, 1.0).g == np.inf


def test_frequencies_are_looked_at_between_all_neighbours():
    assert between_ends(np.array([1.0, 3.0, 4.0])).tolist() == [1.0, 2.0, 3.0, 3.5, 4.0]
    # ten times the last end
    wanted = [2.0, 3.0, 4.0, 22.0, 40.0, np.inf]
    assert between_ends(np.array([2.0, 4.0, np.inf])).tolist() == wanted
    assert between_ends(np.array([2.0, np.inf])).tolist() == [2.0, 11.0, 20.0, np.inf]


def test_channels_in_balance_are_driven_as_much_as_they_drive():
    omega, gain = np.array([0.2, 1.1]), 7.0
    a, b, c, d = complex_system(3, 4, 9)
    d[:3, 3], b[:, 3], c[3] = 0.3 * d[:3, 3], 50.0 * b[:, 3], 4.0 * c[3]
    system = ComplexSystem(a, b, c, d)
    before = system.at(omega)
    found = balanced_channels(system, omega, gain)
    n = np.abs(found.at(omega)).max(axis=0)
    assert n[:3, 3] == pytest.approx(n[3, :3])
    np.testing.assert_allclose(found.at(omega)[:, 3, 3], before[:, 3, 3] / gain)
    for i, j in product(range(3), repeat=2):  # similar: products around a ring stay
        np.testing.assert_allclose(
            found.at(omega)[:, i, j] * found.at(omega)[:, j, i], before[:, i, j] * before[:, j, i]
        )


@pytest.mark.parametrize("unknown", [0, 1])
def test_a_channel_that_is_not_looked_for_is_in_balance_with_those_before(unknown):
    """The last is driven by the others alone (0), or is unknown (1)."""
    rows = np.array(
        [[0.2, 0.7, 9.0, 3.0], [0.5, 0.1, 2.0, 4.0], [0.3, 0.02, 0.1, 0.0], [8.0, 0.4, 0.0, 2.0]]
    )
    if unknown:
        rows[2, 3] = rows[3, 2] = 1e-3
    none = np.zeros((0, 0), complex)
    system = ComplexSystem(none, np.zeros((0, 4)), np.zeros((4, 0)), rows.astype(complex))
    n = np.abs(balanced_channels(system, np.array([1.0]), 2.0, unknown).d)
    assert n[:2, 3] == pytest.approx(n[3, :2])
    others = [0, 1, 3]
    assert n[others, 2].max() == pytest.approx(n[2, others].max())
    assert n[3, 3] == 1.0


def test_blocks_stand_one_behind_the_other():
    deltas = [Delta(2, real=True), Delta(1, real=False), Delta(3, real=True)]
    assert blocks_of_deltas(deltas) == [
        (slice(0, 2), True),
        (slice(2, 3), False),
        (slice(3, 6), True),
    ]


def test_a_basis_of_hermitian_matrices():
    found = basis_of_hermitian(slice(1, 3), 4)
    assert found.shape == (4, 4, 4)
    np.testing.assert_allclose(found, np.conj(np.swapaxes(found, 1, 2)))
    of_block = found[:, 1:3, 1:3].reshape(4, 4)
    assert np.linalg.matrix_rank(of_block) == 4
    assert np.abs(found).sum() == pytest.approx(np.abs(of_block).sum())
    np.testing.assert_allclose(found[0][1, 1], 1.0)
    np.testing.assert_allclose(found[1][1:3, 1:3], [[0, 0.5], [0.5, 0]])
    np.testing.assert_allclose(np.abs(found[2][1:3, 1:3]), [[0, 0.5], [0.5, 0]])


def test_hermitian_matrices_as_real_ones_and_back():
    h, v = hermitian(4, 3), gaussian(np.random.default_rng(6), 3)
    real = real_symmetric(h)
    np.testing.assert_allclose(real, real.T)
    both = np.concatenate([v.real, v.imag])
    assert both @ real @ both == pytest.approx((v.conj() @ h @ v).real)
    np.testing.assert_allclose(from_real_symmetric(real), 2.0 * h)
    uneven = np.arange(16.0).reshape(4, 4)
    found = from_real_symmetric(uneven)
    np.testing.assert_allclose(found.real, uneven[:2, :2] + uneven[2:, 2:])
    np.testing.assert_allclose(found.imag, uneven[2:, :2] - uneven[:2, 2:])


class Asked(np.ndarray):
    """A matrix that says of itself what is asked for."""

    def __rshift__(self, least):
        return np.asarray(self), least


def test_a_block_of_d_is_positive_by_a_little_more_than_nothing():
    """Its second block, two rows after one, as a real symmetric matrix."""
    basis = np.concatenate([basis_of_hermitian(slice(0, 1), 3), basis_of_hermitian(slice(1, 3), 3)])
    weights = np.array([9.0, 2.0, 0.8, -0.6, 3.0])
    arrays = SimpleNamespace(reshape=lambda *given, order: np.reshape(*given, order).view(Asked))
    found, least = positive_block(arrays, basis, slice(1, 3), weights)
    wanted = np.tensordot(weights, basis, 1)[1:, 1:]
    assert least == 0
    assert np.linalg.matrix_rank(wanted) == 2
    np.testing.assert_allclose(
        found, np.block([[wanted.real, -wanted.imag], [wanted.imag, wanted.real]]), atol=1e-5
    )
    assert np.linalg.eigvalsh(found).max() < np.linalg.eigvalsh(wanted).max()


def test_mean_and_variance_of_a_delta_in_the_worst_case():
    """x = [w, d] of two deltas: w = delta z, and z = N_z x."""
    random, d = np.random.default_rng(7), np.diag([2.0, 3.0])
    n, worst = gaussian(random, 2, 3, 3), []
    zz = ww = wz = worth = 0.0
    for at, delta in zip(n, (0.3, -0.8), strict=True):
        # w of both channels from z = N [w, d], and a third that is anything
        w = delta * np.linalg.solve(np.eye(2) - delta * at[:2, :2], at[:2, 2])
        x = np.append(w, 1.0)
        worst.append(np.outer(x, x.conj()))
        z = at[:2] @ x
        zz, ww, wz = zz + np.vdot(z, z).real, ww + np.vdot(w, w).real, wz + np.vdot(z, w).real
        worth += (z.conj() @ d @ z).real
    mean, unsure = moments_of_delta(slice(0, 2), n, worst, d.astype(complex))
    assert mean == pytest.approx(wz / zz)
    assert unsure == pytest.approx((ww / zz - (wz / zz) ** 2) * worth)
    assert -0.8 < mean < 0.3
    assert unsure > 0.0
    none = moments_of_delta(slice(0, 2), 0.0 * n, worst, d.astype(complex))
    assert none == (0.0, 0.0)


@pytest.mark.parametrize("kind", ["one", "twice", "two"])
def test_a_program_finds_the_worst_gain_of_few_deltas(kind):
    pytest.importorskip("cvxpy")
    repetitions = {"one": [1], "twice": [2], "two": [1, 1]}[kind]
    channels = sum(repetitions)
    random = np.random.default_rng(12)
    n = 0.3 * gaussian(random, channels + 1, channels + 1)
    if kind == "two":  # a bound of two is the worst where nothing is negative
        n = np.abs(n) + 0j
    deltas = [Delta(count, real=True) for count in repetitions]
    found = solve_program(n[None], deltas)
    sides = np.linspace(-1.0, 1.0, 21)
    samples = [np.repeat(each, repetitions) for each in product(sides, repeat=len(deltas))]
    gains = [gains_of(n, sample) for sample in samples]
    assert max(gains) <= np.sqrt(found.g) * (1.0 + 1e-4)
    assert np.sqrt(found.g) == pytest.approx(max(gains), rel=2e-2)
    worst = samples[int(np.argmax(gains))]
    ends = np.cumsum([0, *repetitions])[:-1]
    np.testing.assert_allclose(found.likely, worst[ends], atol=0.11)
    assert found.multipliers.needed(n[None])[0] == pytest.approx(found.g, rel=1e-3)
    several = solve_program(np.array([0.5 * n, n]), deltas)
    assert several.g == pytest.approx(found.g, rel=1e-2)


def test_a_program_for_a_complex_delta():
    """|d| + |b c| / (1 - |a|), with all phases in line."""
    pytest.importorskip("cvxpy")
    n = np.array([[0.4j, 0.8], [0.5, -0.3j]])
    found = solve_program(n[None], [Delta(1, real=False)])
    assert np.sqrt(found.g) == pytest.approx(0.3 + 0.4 / 0.6, rel=1e-3)
    assert np.abs(found.multipliers.g).max() == 0.0
