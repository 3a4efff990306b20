"""Closed forms beside the errors of single sources: random inputs, drives, snaps."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.ndimage import maximum_filter1d, minimum_filter1d

import beamchain as bc
from beamchain import pointing
from formulas import ModalForm
from pointing_doors import (
    ModalResponse,
    contributions_along_their_sum,
    named_shares,
    nodes_of_density,
    noise_error,
    periodic_of_harmonics,
    snap_error,
    snap_times,
    stepper_error,
    stepper_harmonics,
)

WINDOW = 0.8


def modal_form(modes, b, c, d, frequencies, damping):
    """Oscillators and nothing else."""
    count = len(modes)
    a = np.zeros((2 * count, 2 * count))
    for i, (w, ratio) in enumerate(zip(frequencies, damping, strict=True)):
        a[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, 1.0], [-(w**2), -2.0 * ratio * w]]
    names = tuple(word for mode in modes for word in (mode, f"{mode}_rate"))
    units, weight = ("",) * 2 * count, np.ones(2 * count)
    return ModalForm(a, np.array(b), np.array(c), np.array(d), names, units, weight, (0, 0))


W, RATIO = (6.0, 11.0), (0.05, 0.08)
B2 = [[0.1, 0.0], [1.0, -0.4], [0.0, 0.2], [0.7, 1.3]]
C2 = [[1.0, 0.05, -0.6, 0.0], [0.4, 0.0, 2.0, 0.1]]
D2 = [[0.01, 0.0], [0.0, -0.02]]


def craft_of(form, modes):
    """What a source alone drives, whichever is asked for."""
    craft = SimpleNamespace(form=lambda: form, mode_names=modes)
    return SimpleNamespace(of_source=lambda _: craft)


def one_input():
    return modal_form(("one", "two"), [[0.1], [1.0], [0.0], [0.7]], C2, [[0.01], [-0.02]], W, RATIO)


def in_modes(form, omega, drive):
    """`(k, outputs)` of one, of two and of the rest."""
    s = 1j * np.asarray(omega)
    parts = []
    for at in (slice(0, 2), slice(2, 4)):
        inverse = np.linalg.inv(s[:, None, None] * np.eye(2) - form.a[at, at])
        parts.append(np.einsum("oi,kij,j->ko", form.c[:, at], inverse, form.b[at] @ drive))
    return [*parts, np.tile(form.d @ drive, (s.size, 1)).astype(complex)]


def kept(x):
    """sin(x) / x."""
    return np.sin(x) / x


# -- random inputs ---------------------------------------------------------------------------------
def test_variances_of_a_random_input_are_integrals_of_its_density():
    """sigma^2 is the integral of |G|^2 S df, for two signals that are not correlated."""
    form = modal_form(("one", "two"), B2, C2, D2, W, RATIO)
    noise = pointing.NoiseDisturbance(
        input="wrench", frequency=(0.3, 1.2, 4.0), density=(2e-3, 5e-3, 1e-4)
    )
    found = noise_error(craft_of(form, ("one", "two")), 0, "psd", noise, WINDOW)
    f = np.unique(np.append(np.linspace(0.3, 4.0, 3001), 1.2))
    omega = 2.0 * np.pi * f
    first = 2e-3 * (f / 0.3) ** (np.log(5.0 / 2.0) / np.log(4.0))
    second = 5e-3 * (f / 1.2) ** (np.log(1e-4 / 5e-3) / np.log(4.0 / 1.2))
    density = np.where(f <= 1.2, first, second)
    deviation = 1.0 - kept(omega * WINDOW / 2.0) ** 2
    variance, windowed, shares = np.zeros(2), np.zeros(2), np.zeros((3, 2))
    for drive in np.eye(2):
        parts = in_modes(form, omega, drive)
        total = sum(parts)
        variance += np.trapezoid(density[:, None] * np.abs(total) ** 2, f, axis=0)
        windowed += np.trapezoid((density * deviation)[:, None] * np.abs(total) ** 2, f, axis=0)
        shares += [
            np.trapezoid(density[:, None] * (part * total.conj()).real, f, axis=0) for part in parts
        ]
    assert found.ape.rms == pytest.approx(np.sqrt(variance), rel=1e-5)
    assert found.rpe.rms == pytest.approx(np.sqrt(windowed), rel=1e-5)
    assert found.ape.peak == pytest.approx(3.0 * np.sqrt(variance), rel=1e-5)
    assert found.rpe.peak == pytest.approx(3.0 * np.sqrt(windowed), rel=1e-5)
    for output, named in enumerate(found.shares):
        wanted = shares[:, output] / variance[output]
        of = dict(zip(("one", "two", "rigid motion"), wanted, strict=True))
        assert named == pytest.approx(of, rel=1e-4)
        sizes = [abs(share) for share in named.values()]
        assert sizes == sorted(sizes, reverse=True)
    assert found.speed is None


def test_an_undamped_mode_inside_a_density_has_no_variance():
    """Nor one whose ratio is below 1e-6; beyond the density's end it is static."""
    for ratio, top, refused in ((0.0, 1.0, True), (0.9e-6, 1.0, True), (0.0, 0.9, False)):
        form = modal_form(("one",), [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], (6.0,), (ratio,))
        noise = pointing.NoiseDisturbance(input="force", frequency=(0.2, top), density=(1e-3, 1e-3))
        craft = craft_of(form, ("one",))
        if refused:
            with pytest.raises(bc.InputError, match=r"psd.*'one' \(6 rad/s\)"):
                noise_error(craft, 0, "psd", noise, WINDOW)
        else:
            end = 2.0 * np.pi * top
            area = quad(lambda w: 1e-3 / (36.0 - w**2) ** 2 / (2 * np.pi), 0.4 * np.pi, end)[0]
            found = noise_error(craft, 0, "psd", noise, WINDOW)
            assert found.ape.rms == pytest.approx(np.sqrt(area), rel=1e-6)


@pytest.mark.parametrize(("low", "refused"), [(0.99, True), (1.1, False)])
def test_a_density_begins_at_its_lowest_frequency(low, refused):
    """An undamped mode at 1 Hz, just inside of it or below it, where it gives 1 / (w^2 - x^2)."""
    w = 2.0 * np.pi
    form = modal_form(("one",), [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], (w,), (0.0,))
    noise = pointing.NoiseDisturbance(input="force", frequency=(low, 2.0), density=(1e-3, 1e-3))
    craft = craft_of(form, ("one",))
    if refused:
        with pytest.raises(bc.InputError, match="psd"):
            noise_error(craft, 0, "psd", noise, WINDOW)
        return
    area = quad(lambda f: 1e-3 / (w**2 - (w * f) ** 2) ** 2, low, 2.0)[0]
    found = noise_error(craft, 0, "psd", noise, WINDOW)
    assert found.ape.rms == pytest.approx([np.sqrt(area)], rel=1e-6)


def test_an_undamped_mode_that_a_zero_hides_is_no_hindrance():
    """Two of one frequency, driven against each other."""
    b = [[0.0], [1.0], [0.0], [-1.0]]
    form = modal_form(("one", "two"), b, [[1.0, 0, 1.0, 0]], [[0.5]], (6.0, 6.0), (0.0, 0.0))
    noise = pointing.NoiseDisturbance(input="force", frequency=(0.2, 2.0), density=(1e-3, 1e-3))
    found = noise_error(craft_of(form, ("one", "two")), 0, "psd", noise, WINDOW)
    assert found.ape.rms == pytest.approx([0.5 * np.sqrt(1.8e-3)], rel=1e-9)


@pytest.mark.parametrize(("low", "high"), [(1.0, 5.99), (6.01, 9.0)])
def test_integrals_end_where_a_density_does(low, high):
    """Just beside a resonance, to which the intervals draw together."""
    noise = SimpleNamespace(frequency=(low / (2.0 * np.pi), high / (2.0 * np.pi)))
    omega, weights = nodes_of_density(np.array([-0.01 + 6j, -0.01 - 6j]), noise, 3.0)
    assert low < omega.min() < omega.max() < high
    wanted = 100.0 * (np.arctan(100.0 * (high - 6.0)) - np.arctan(100.0 * (low - 6.0)))
    assert weights @ (1.0 / ((omega - 6.0) ** 2 + 1e-4)) == pytest.approx(wanted, rel=1e-9)
    window = 1.0 - kept(omega * 1.5) ** 2
    assert weights @ window == pytest.approx(
        quad(lambda x: 1.0 - kept(1.5 * x) ** 2, low, high)[0], rel=1e-12
    )


def test_integrals_resolve_the_lobes_of_a_long_window():
    """Far apart from any resonance: sin^2(15 x)/(15 x)^2 turns 15 times."""
    noise = SimpleNamespace(frequency=(1.0 / (2.0 * np.pi), 9.0 / (2.0 * np.pi)))
    omega, weights = nodes_of_density(np.zeros(0, dtype=complex), noise, 30.0)
    x = np.linspace(1.0, 9.0, 40_001)
    wanted = np.trapezoid(np.cos(30.0 * x) / x**2, x)
    assert weights @ (np.cos(30.0 * omega) / omega**2) == pytest.approx(wanted, rel=1e-4)


# -- drives ----------------------------------------------------------------------------------------
STAIRCASE = pointing.StepperDisturbance(joint="drive", step=0.3, rate=1.7)
PULSES = pointing.StepperDisturbance(joint="drive", torque=0.6, rate=1.7, width=0.11)


def test_harmonics_of_a_drive_are_those_of_its_motion():
    """Of a staircase less its slope, and of pulses less their mean."""
    n = np.arange(1.0, 5.0)
    t = (np.arange(20_000) + 0.5) / 20_000 / 1.7
    turns = np.exp(-2j * np.pi * 1.7 * np.outer(n, t))
    behind = 0.3 * (0.5 - 1.7 * t)
    assert stepper_harmonics(STAIRCASE, n) == pytest.approx(2.0 * turns @ behind / t.size, rel=1e-3)
    pulse = np.where(t < 0.11, 0.6, 0.0)
    assert stepper_harmonics(PULSES, n) == pytest.approx(2.0 * turns @ pulse / t.size, rel=1e-3)


@pytest.mark.parametrize("source", [STAIRCASE, PULSES], ids=["staircase", "pulses"])
@pytest.mark.parametrize("window", [0.8, 0.1, 6e-4])
def test_the_error_of_a_drive_is_the_sum_of_its_harmonics(source, window, monkeypatch):
    monkeypatch.setattr("beamchain.pointing.source_errors.SAMPLES", (2**11, 2**14))
    form = one_input()
    found = stepper_error(craft_of(form, ("one", "two")), 0, "drive", source, window)
    n = np.arange(1.0, 257.0)
    omega = 2.0 * np.pi * 1.7 * n
    if source is STAIRCASE:
        load = -1j * 0.3 / (np.pi * n)
    else:
        start = np.exp(-1j * omega * 0.11)
        load = 2.0 * 1.7 * 0.6 * (1.0 - start) / (1j * omega)
    parts = [part * load[:, None] for part in in_modes(form, omega, np.ones(1))]
    total = sum(parts)
    mean = kept(omega * window / 2.0)
    power = np.abs(total) ** 2 / 2.0
    assert found.ape.rms == pytest.approx(np.sqrt(power.sum(axis=0)), rel=1e-9)
    deviating = ((1.0 - mean**2)[:, None] * power).sum(axis=0)
    assert found.rpe.rms == pytest.approx(np.sqrt(deviating), rel=1e-6)
    for output, named in enumerate(found.shares):
        of = [(part * total.conj()).real[:, output].sum() for part in parts]
        of = dict(zip(("one", "two", "rigid motion"), of / np.sum(of), strict=True))
        assert named == pytest.approx(of, rel=1e-9)
    samples = 4096

    def period(amplitudes):
        spectrum = np.zeros((samples // 2 + 1, 2), dtype=complex)
        spectrum[1:257] = amplitudes * samples / 2.0
        return np.fft.irfft(spectrum, axis=0)

    values, means = period(total), period(total * mean[:, None])
    assert found.ape.peak == pytest.approx(np.abs(values).max(axis=0), rel=4e-3)
    reach = round(window * 1.7 * samples / 2.0)
    if reach > 9:  # of all instants of the window about each
        size = min(2 * reach + 1, samples)
        above = maximum_filter1d(values, size, axis=0, mode="wrap") - means
        below = means - minimum_filter1d(values, size, axis=0, mode="wrap")
        wanted = np.maximum(above, below).max(axis=0)
    else:
        wanted = np.abs(period(1j * omega[:, None] * total)).max(axis=0) * window / 2.0
    assert found.rpe.peak == pytest.approx(wanted, rel=1e-2)


@pytest.mark.parametrize(("fastest", "count"), [(1.0, 256), (260.0, 487), (20_000.0, 1000)])
def test_harmonics_go_on_far_beyond_the_craft_s_modes(fastest, count, monkeypatch):
    """Twenty times its highest frequency, 256 at least and here 1000 at most: of a staircase that
    is seen as it is, rms^2 = sum of (theta/(pi n))^2 / 2."""
    monkeypatch.setattr("beamchain.pointing.source_errors.HARMONICS", (256, 1000))
    form = modal_form(("one",), [[0.0], [1e-30]], [[1e-30, 0.0]], [[1.0]], (fastest,), (0.1,))
    found = stepper_error(craft_of(form, ("one",)), 0, "drive", STAIRCASE, 0.5)
    n = np.arange(1.0, count + 1.0)
    wanted = 0.3 / np.pi * np.sqrt(np.sum(1.0 / n**2) / 2.0)
    assert found.ape.rms == pytest.approx(wanted, rel=1e-10)
    assert found.shares[0]["rigid motion"] == pytest.approx(1.0)


@pytest.mark.parametrize("samples", [8, 16])
def test_a_period_of_harmonics(samples):
    amplitudes = np.array([[1.0 - 2.0j, 0.3], [0.5j, -0.7 + 0.1j], [0.2, 0.4j]])
    t = np.arange(samples) / samples
    wanted = sum(
        np.real(amplitudes[k][None] * np.exp(2j * np.pi * (k + 1) * t)[:, None]) for k in range(3)
    )
    np.testing.assert_allclose(periodic_of_harmonics(amplitudes, samples), wanted, atol=1e-14)


# -- snaps -----------------------------------------------------------------------------------------
def risen(w, ratio, tau, t):
    """x'' + 2 r w x' + w^2 x = 1 - exp(-t / tau), from rest, and its slope."""
    p = w * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
    q = -1.0 / tau
    g = 1.0 / (q**2 + 2.0 * ratio * w * q + w**2)
    # particular 1/w^2 - g exp(q t), and A exp(p t) + cc that starts from rest
    x0, v0 = g - 1.0 / w**2, g * q
    big = (v0 - p.conjugate() * x0) / (p - p.conjugate())
    x = 1.0 / w**2 - g * np.exp(q * t) + 2.0 * (big * np.exp(p * t)).real
    return x, -g * q * np.exp(q * t) + 2.0 * (big * p * np.exp(p * t)).real


@pytest.mark.parametrize("window", [2.0, 0.3, 30.0, 1e-3])
def test_the_error_of_a_snap_is_that_of_its_modes(window, monkeypatch):
    monkeypatch.setattr("beamchain.pointing.source_errors.MOST_SAMPLES", 6000)
    tau, drive = 0.06, (1.0, 0.7)
    b = [[0.0], [1.0], [0.0], [0.7]]
    form = modal_form(("one", "two"), b, C2, [[1e-3], [-2e-3]], (20.0, 50.0), (0.1, 0.05))
    snap = pointing.ThermalSnap(appendage="array_", time_constant=tau, moment=1.0)
    found = snap_error(craft_of(form, ("one", "two")), 0, "snap", snap, window)
    dt = 5e-4
    t = dt * np.arange(14_001)
    parts = [np.outer(1.0 - np.exp(-t / tau), form.d[:, 0])]
    for k, (w, ratio) in enumerate(((20.0, 0.1), (50.0, 0.05))):
        x, v = risen(w, ratio, tau, t)
        c = form.c[:, 2 * k : 2 * k + 2]
        parts.append(drive[k] * (np.outer(x, c[:, 0]) + np.outer(v, c[:, 1])))
    parts = np.array([*parts[1:], parts[0]])
    values = parts.sum(axis=0)
    top = np.abs(values).argmax(axis=0)
    assert found.ape.peak == pytest.approx([abs(values[top[o], o]) for o in range(2)], rel=1e-4)
    for output, named in enumerate(found.shares):
        wanted = parts[:, top[output], output] / values[top[output], output]
        of = dict(zip(("one", "two", "rigid motion"), wanted, strict=True))
        assert named == pytest.approx(of, rel=2e-2, abs=1e-3)
    # the mean over every window, at rest before and settled after
    reach = round(window / 2.0 / dt)
    padded = np.pad(values, ((2 * reach, 0), (0, 0)))
    padded = np.pad(padded, ((0, 2 * reach), (0, 0)), mode="edge")
    total = np.vstack([np.zeros(2), np.cumsum((padded[1:] + padded[:-1]) / 2.0, axis=0)])
    middle = np.arange(reach, len(padded) - reach)
    means = (total[middle + reach] - total[middle - reach]) / (2.0 * reach)
    above = maximum_filter1d(padded, 2 * reach + 1, axis=0)[middle] - means
    below = means - minimum_filter1d(padded, 2 * reach + 1, axis=0)[middle]
    wanted = np.maximum(above, below).max(axis=0)
    assert found.rpe.peak == pytest.approx(wanted, rel=5e-2 if window < 2e-3 else 1e-2)
    assert np.isnan(found.ape.rms).all()
    assert np.isnan(found.rpe.rms).all()


def test_a_snap_that_is_seen_as_it_is_deviates_most_as_it_begins():
    """1 - exp(-t / tau), which ends at 1: in the window from its start on, the mean is
    1 - (tau / w) (1 - exp(-w / tau))."""
    form = modal_form(("one",), [[0.0], [1.0]], [[0.0, 0.0]], [[1.0]], (9.0,), (0.1,))
    snap = pointing.ThermalSnap(appendage="array_", time_constant=0.5, moment=1.0)
    found = snap_error(craft_of(form, ("one",)), 0, "snap", snap, 2.0)
    assert found.ape.peak == pytest.approx([1.0], rel=1e-4)
    assert found.rpe.peak == pytest.approx([1.0 - (1.0 - np.exp(-4.0)) / 4.0], rel=1e-2)


LONG = 5.0 + 20.0 * np.pi


@pytest.mark.parametrize(
    ("frequencies", "tau", "window", "spacing", "length"),
    [
        # twenty periods of the slowest mode and ten time constants; forty samples of the shortest
        ((2.0, 5.0), 3.0, 100.0, np.pi / 100.0, 30.0 + 120.0 * np.pi),
        # forty of the time constant
        ((2.0, 5.0), 0.1, 100.0, 0.1 / 40.0, 1.0 + 20.0 * np.pi),
        # 400 of the window
        ((2.0, 5.0), 0.5, 1.0, 1.0 / 400.0, 5.0 + 20.0 * np.pi),
        # a quarter of the window
        ((2.0, 5.0), 3.0, 4000.0, np.pi / 100.0, 1000.0),
        # 200000 samples at most
        ((2.0, 5.0), 0.5, 1e-4, LONG / 200_000, LONG),
        # of which half a window is a whole number, where it is two of them or longer
        ((2.0, 5.0), 0.5, 2.1 * LONG / 200_000, LONG / 200_000, LONG),
        ((2.0, 5.0), 0.5, 1.9 * LONG / 200_000, LONG / 200_000, LONG),
        # what shows rings with 1e-5 of the largest static motion, 1 / 4: 1 / w^3 over tau
        ((2.0, 100.0), 0.3, 400.0, np.pi / 50.0 / 40.0, 100.0),
        ((2.0, 120.0), 0.3, 400.0, 0.3 / 40.0, 100.0),
        ((2.0, 120.0), 4.0, 4000.0, np.pi / 40.0, 1000.0),
    ],
)
def test_samples_of_a_snap_resolve_what_shows(frequencies, tau, window, spacing, length):
    b, c = [[0], [1.0], [0], [1.0]], [[1.0, 0, 1.0, 0]]
    form = modal_form(("one", "two"), b, c, [[0.0]], frequencies, (0.1, 0.1))
    times = snap_times(ModalResponse(form, ("one", "two")), tau, window)
    if window >= 2.0 * spacing:  # half a window is a whole number of them
        spacing = window / 2.0 / np.ceil(window / 2.0 / spacing * (1.0 - 1e-12))
    assert times.size == np.ceil(length / spacing * (1.0 - 1e-12)) + 1
    np.testing.assert_allclose(times, spacing * np.arange(times.size), rtol=1e-9)


# -- shares and names ------------------------------------------------------------------------------
def test_contributions_along_their_sum_add_up_to_its_size():
    parts = np.array([3.0 + 1.0j, 1.0 + 2.0j, 0.0])  # 4 + 3j, of size 5
    assert contributions_along_their_sum(parts) == pytest.approx([3.0, 2.0, 0.0])
    assert contributions_along_their_sum(0.0 * parts) == pytest.approx(np.zeros(3))


def test_shares_stand_by_size_and_those_of_nothing_are_left_out():
    names = ("a", "b", "c", "d")
    found = named_shares(names, np.array([1.0, 0.0, -3.0, 4.0]))
    assert list(found.items()) == [("d", 2.0), ("c", -1.5), ("a", 0.5)]
    assert named_shares(names, np.zeros(4)) == {}


def test_the_mode_at_a_frequency_is_the_nearest():
    form = modal_form(("one", "two", "rigid_x"), np.ones((6, 1)), np.ones((1, 6)), [[0.0]],
                      (6.0, 11.0, 8.4), (0.3, 0.6, 0.1))  # fmt: skip
    response = ModalResponse(form, ("one", "two"))
    assert response.oscillator_near(8.4) == "one"
    assert response.oscillator_near(8.6) == "two"
    rigid = modal_form(("rigid_x",), [[1], [0]], [[1, 0]], [[0]], (6,), (0.1,))
    assert ModalResponse(rigid, ()).oscillator_near(1.0) == "a mode"
