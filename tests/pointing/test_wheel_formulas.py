"""Closed forms beside a wheel's disturbance: its orders, its sweep over speeds, its worst one."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import beamchain as bc
from beamchain import pointing
from beamchain.pointing.wheel_sweep import Order, SpeedCurve, SpinningSystem, joined, largest
from formulas import ModalForm
from pointing_doors import WheelSweep, branches, high_places, wheel_error, wheel_orders

WINDOW = 0.7
RANDOM = np.random.default_rng(8)
MODES = (("one", 4.0, 0.03), ("two", 9.0, 0.05))


def modes_at_rest():
    a = np.zeros((4, 4))
    for i, (_, w, ratio) in enumerate(MODES):
        a[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, 1.0], [-(w**2), -2.0 * ratio * w]]
    return a


A0 = modes_at_rest()
A1 = np.zeros((4, 4))
A1[1, 3], A1[3, 1] = 0.2, -0.15  # gyroscopic, and not quite
B = RANDOM.normal(size=(4, 3))
C0, C1 = RANDOM.normal(size=(2, 4)), 0.1 * RANDOM.normal(size=(2, 4))
D = 0.01 * RANDOM.normal(size=(2, 3))
SYSTEM = SpinningSystem((A0, B, C0, D), (A1, C1))
PATTERNS = [
    RANDOM.normal(size=(3, 2)) + 1j * RANDOM.normal(size=(3, 2)),
    RANDOM.normal(size=(3, 1)) + 1j * RANDOM.normal(size=(3, 1)),
]
ORDERS = [Order(1.0, PATTERNS[0]), Order(2.5, PATTERNS[1])]


def responses_at(speed, direction, orders=ORDERS):
    """Per order `(outputs, p)`: the craft as it is at that speed."""
    a, c = A0 + direction * speed * A1, C0 + direction * speed * C1
    out = []
    for order, patterns in orders:
        s = 1j * order * speed
        acting = patterns if direction > 0 else patterns.conj()
        out.append(speed**2 * (c @ np.linalg.solve(s * np.eye(4) - a, B) + D) @ acting)
    return out


def deviation(omega):
    """Of cos(phi + omega t) from its mean over a window about 0, in the worst phase."""
    t = np.linspace(0.0, WINDOW / 2.0, 4001)
    mean = np.sin(omega * WINDOW / 2.0) / (omega * WINDOW / 2.0)
    return np.abs(np.exp(1j * omega * t) - mean).max(), 1.0 - mean**2


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_sweep_is_the_craft_at_every_speed(direction):
    sweep = WheelSweep(SYSTEM, ORDERS, direction, WINDOW)
    speeds = np.array([1.3, 3.6, 8.0])
    curve, sizes = sweep.curve(speeds), sweep.amplitudes(speeds)
    assert curve.speed == pytest.approx(direction * speeds)
    for k, speed in enumerate(speeds):
        wanted = responses_at(speed, direction)
        size = np.array([np.abs(each).sum(axis=1) for each in wanted])
        np.testing.assert_allclose(sizes[:, k], size, rtol=1e-10)
        shares, variances = zip(*(deviation(order * speed) for order in (1.0, 2.5)), strict=True)
        assert curve.ape_peak[k] == pytest.approx(size.sum(axis=0))
        assert curve.ape_rms[k] == pytest.approx(np.sqrt((size**2).sum(axis=0) / 2.0))
        assert curve.rpe_peak[k] == pytest.approx(shares @ size, rel=1e-6)
        assert curve.rpe_rms[k] == pytest.approx(np.sqrt(variances @ size**2 / 2.0))


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_orders_cross_whirling_modes(direction):
    """At s = j h Omega the speed is s / (j h): det(s - A0 - s A1 / (j h)) = 0."""
    sweep = WheelSweep(SYSTEM, ORDERS, direction, WINDOW)
    found = sweep.crossings(0.1, 20.0)
    assert len(found) == 4
    for one in found:
        real = -one.damping * one.frequency
        s = real + 1j * np.sqrt(one.frequency**2 - real**2)
        assert one.speed == pytest.approx(s.imag / one.order)
        pencil = s * np.eye(4) - A0 - direction * s / (1j * one.order) * A1
        assert abs(np.linalg.det(pencil)) < 1e-9 * 81.0 * 16.0


def test_a_grid_draws_together_around_resonances():
    sweep = WheelSweep(SYSTEM, ORDERS[:1], 1.0, WINDOW)
    (one,) = sweep.crossings(3.0, 5.0)
    near = one.speed * (1.0 + one.damping * np.sinh(np.linspace(-6.0, 6.0, 37)))
    wanted = np.union1d(np.linspace(3.0, 5.0, 7), near)
    np.testing.assert_allclose(sweep.grid(3.0, 5.0, 7), wanted[(wanted >= 3.0) & (wanted <= 5.0)])
    assert sweep.grid(3.0, 3.0, 1).tolist() == [3.0]


def test_slow_poles_are_rigid_motion_and_none_are_crossed():
    fast = np.array([[0.0, 1.0, 0, 0], [-1e4, -1.0, 0, 0], [0, 0, 0, 1.0], [0, 0, -1e-10, 0]])
    for size, count in ((0.5, 1), (2.0, 2)):  # around 1e-6 of the fastest pole, 100
        fast[3, 2] = -((size * 1e-4) ** 2)
        system = SpinningSystem((fast, B, C0, D), (np.zeros((4, 4)), C1))
        assert len(WheelSweep(system, ORDERS[:1], 1.0, WINDOW).crossings(0.0, 1e3)) == count


@pytest.mark.parametrize("index", ["ape_peak", "rpe_peak", "rpe_rms", "ape_rms"])
def test_the_top_of_a_resonance_is_found_between_samples(index):
    sweep = WheelSweep(SYSTEM, ORDERS, -1.0, WINDOW)
    curve = sweep.resolved_curve(1.0, 4.5, 8)
    assert np.all(np.diff(curve.speed) > 0.0)

    def of(speed, output):
        wanted = responses_at(speed, -1.0)
        size = np.array([np.abs(each).sum(axis=1) for each in wanted])[:, output]
        shares, variances = zip(*(deviation(order * speed) for order in (1.0, 2.5)), strict=True)
        return {
            "ape_peak": size.sum(),
            "ape_rms": np.sqrt(size @ size / 2.0),
            "rpe_peak": size @ shares,
            "rpe_rms": np.sqrt(size**2 @ variances / 2.0),
        }[index]

    for output in range(2):
        values = getattr(curve, index)[:, output]
        at = -curve.speed[values.argmax()]
        best = minimize_scalar(
            lambda x, o=output: -of(x, o), bounds=(at - 0.03, at + 0.03), options={"xatol": 1e-7}
        )
        assert values.max() == pytest.approx(-best.fun, rel=1e-6)


def test_high_places_are_tops_within_a_twentieth_of_the_highest():
    assert high_places(np.array([0.94, 0.2, 1.0, 0.5, 0.96, 0.3, 0.97])) == [2, 6, 4]
    assert high_places(np.array([0.96, 0.2, 1.0, 1.0])) == [2, 3, 0]
    many = np.tile([1.0, 0.0], 9) - 0.001 * np.arange(18.0)
    assert high_places(many) == [0, 2, 4, 6, 8, 10]


def curve_of(speeds, *sizes):
    columns = [np.array(size, dtype=float) for size in sizes]
    return SpeedCurve(np.array(speeds, dtype=float), *columns)


def test_curves_join_by_speed_and_the_largest_stands_at_the_worst():
    one = curve_of([2, 4], [[1, 0], [9, 8]], [[5, 1], [3, 2]], [[0, 1], [2, 3]], [[4, 5], [6, 7]])
    two = curve_of([-1, 4, 3], *([[[0, 0], [7, 7], [1, 30]]] * 4))
    whole = joined([one, two])
    assert whole.speed.tolist() == [-1.0, 2.0, 3.0, 4.0]
    assert whole.ape_peak.tolist() == [[0, 0], [5, 1], [1, 30], [3, 2]]
    ape, rpe, speed = largest(whole)
    assert (ape.rms.tolist(), ape.peak.tolist()) == ([9, 30], [5, 30])
    assert (rpe.rms.tolist(), rpe.peak.tolist()) == ([2, 30], [6, 30])
    assert speed.tolist() == [2.0, 3.0]


# -- what a wheel does -----------------------------------------------------------------------------
def test_a_force_that_turns_is_a_quarter_of_a_turn_late_on_the_second_axis():
    cage = pointing.WheelHarmonic(order=2.8, radial_force=3e-8, axial_force=4e-8)
    wheel = pointing.WheelDisturbance(
        joint="rw", speeds=(1.0, 9.0), static=7e-7, dynamic=2e-8, harmonic=(cage,)
    )
    first, second = wheel_orders(wheel)
    turn = np.exp(1j * 0.6)
    imbalance = (first.patterns * turn).real
    assert first.order == 1.0
    assert imbalance[:, 0] == pytest.approx(7e-7 * np.array([np.cos(0.6), np.sin(0.6), 0, 0, 0, 0]))
    assert imbalance[:, 1] == pytest.approx(2e-8 * np.array([0, 0, 0, np.cos(0.6), np.sin(0.6), 0]))
    assert second.order == 2.8
    assert (
        pytest.approx(np.array([[3e-8, -3e-8j, 0, 0, 0, 0], [0, 0, 4e-8, 0, 0, 0]]))
        == second.patterns.T
    )


@pytest.mark.parametrize(
    ("speeds", "wanted"),
    [
        ((10.0, 400.0), [(1.0, 10.0, 400.0)]),
        ((-30.0, 400.0), [(1.0, 0.04, 400.0), (-1.0, 0.04, 30.0)]),
        ((-400.0, 20.0), [(1.0, 0.04, 20.0), (-1.0, 0.04, 400.0)]),
        ((-400.0, -10.0), [(-1.0, 10.0, 400.0)]),
        ((0.0, 400.0), [(1.0, 0.04, 400.0)]),
    ],
)
def test_a_range_of_speeds_in_each_direction(speeds, wanted):
    assert branches(SimpleNamespace(speeds=speeds)) == [pytest.approx(one) for one in wanted]


def craft_that_spins(a0, a1, b, c, d, modes):
    """Six inputs of a wheel; `of_wheel` has the numbers of a real one."""
    names = tuple(word for mode in modes for word in (mode, f"{mode}_rate"))

    def of_wheel(_, __, speed):
        form = ModalForm(
            a0 + speed * a1, b, c, d, names, ("",) * len(names), np.ones(len(names)), (0, 0)
        )
        return SimpleNamespace(form=lambda: form, mode_names=modes)

    system = SpinningSystem((a0, b, c, d), (a1, np.zeros_like(c)))
    return SimpleNamespace(spinning=lambda *_: system, of_wheel=of_wheel)


@pytest.mark.parametrize("speeds", [(3.0, 4.6), (-4.6, -3.0), (3.7, 3.7), (0.05, 0.06)])
def test_the_error_of_a_wheel_and_the_modes_it_comes_from(speeds):
    b = np.random.default_rng(3).normal(size=(4, 6))
    d = 0.02 * np.random.default_rng(4).normal(size=(2, 6))
    cage = pointing.WheelHarmonic(order=2.5, radial_force=3.0, axial_force=4.0)
    wheel = pointing.WheelDisturbance(
        joint="rw", speeds=speeds, static=0.7, dynamic=0.2, harmonic=(cage,), count=5
    )
    found = wheel_error(craft_that_spins(A0, A1, b, C0, d, ("one", "two")), 0, "rw", wheel, WINDOW)
    for output in range(2):
        speed = found.speed[output]
        sign = np.sign(speed)
        a, total, shares = A0 + speed * A1, 0.0, np.zeros(3)
        turning = np.array([1.0, -1j * sign, 0.0])
        acting = [(1.0, 0.7, 0), (1.0, 0.2, 3), (2.5, 3.0, 0)]
        patterns = [(h, np.pad(size * turning, (at, 3 - at))) for h, size, at in acting]
        patterns.append((2.5, 4.0 * np.eye(6)[2]))
        for order, pattern in patterns:
            states = np.linalg.solve(1j * order * abs(speed) * np.eye(4) - a, b @ pattern)
            parts = [C0[output, at] @ states[at] for at in (slice(0, 2), slice(2, 4))]
            parts = speed**2 * np.array([*parts, d[output] @ pattern])
            total += abs(parts.sum())
            shares += (parts * np.conj(parts.sum())).real / abs(parts.sum())
        assert found.ape.peak[output] == pytest.approx(total)
        of = dict(zip(("one", "two", "rigid motion"), shares / total, strict=True))
        assert found.shares[output] == pytest.approx(of)
    resonates = speeds[0] < 4.0 * np.sign(speeds[0]) < speeds[1]
    assert (found.curve.speed.size > 5) == resonates
    assert np.all((found.curve.speed >= speeds[0]) & (found.curve.speed <= speeds[1]))


@pytest.mark.parametrize(
    ("speeds", "ratio", "driven", "refused"),
    [
        ((3.0, 5.0), 0.0, 1.0, True),
        ((-5.0, -3.0), 0.0, 1.0, True),
        ((4.1, 5.0), 0.0, 1.0, False),
        ((3.0, 5.0), 1.1e-6, 1.0, False),
        ((3.0, 5.0), 0.9e-6, 1.0, True),
        ((3.0, 5.0), 0.0, 0.0, False),
    ],
)
def test_an_undamped_mode_is_driven_without_limit(speeds, ratio, driven, refused):
    a = np.array([[0.0, 1.0, 0, 0], [-16.0, -8.0 * ratio, 0, 0], [0, 0, 0, 1], [0, 0, -81, -0.9]])
    b = np.zeros((4, 6))
    b[1, 0], b[3, 0], b[1, 2] = driven, 1.0, 1e-3 * (1.0 - driven)
    whole = craft_that_spins(a, np.zeros((4, 4)), b, C0[:, :4], 0.0 * D @ np.eye(3, 6), MODES_NAMES)
    wheel = pointing.WheelDisturbance(joint="rw", speeds=speeds, static=0.7)
    if refused:
        speed = 4.0 * np.sign(speeds[0])
        words = rf"rw: at {speed:g} rad/s its order 1 drives 'one' \(4 rad/s\)"
        with pytest.raises(bc.InputError, match=words):
            wheel_error(whole, 0, "rw", wheel, WINDOW)
    else:
        assert np.isfinite(wheel_error(whole, 0, "rw", wheel, WINDOW).ape.peak).all()


MODES_NAMES = ("one", "two")
