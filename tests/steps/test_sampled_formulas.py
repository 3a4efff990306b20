"""Sampled responses beside the matrices of a step, exact and as an integrator takes it."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

import beamchain as bc
from formulas import (
    Activations,
    Exact,
    Inputs,
    Motion,
    Outputs,
    Signal,
    exact_response,
    judged_part,
    off_by,
    peaks_of_poles,
    represents,
    sampled_error,
    step_response,
)

H = 0.07
RANDOM = np.random.default_rng(7)
# y of unit mass: one motion that is free, one that dampers hold, and two on springs; q = shapes y
SHAPES = RANDOM.normal(size=(4, 4)) + 2.0 * np.eye(4)
W = np.array([0.0, 0.0, 6.0, 17.0])
DAMPING = np.zeros((4, 4))
DAMPING[1:, 1:] = np.diag([1.5, 0.2, 0.5]) + 0.1
ROWS = RANDOM.normal(size=(2, 4))
LACKING = np.linalg.inv(SHAPES).T @ (np.diag([0.0, 0.2, 0.3, 0.4]) + 0.05) @ np.linalg.inv(SHAPES)


def exact(w=W, damping=DAMPING):
    back = np.linalg.inv(SHAPES)
    modes = SimpleNamespace(
        frequency=w[2:],
        shapes=SHAPES[:, 2:],
        rigid=SHAPES[:, :2] @ np.array([[2.0, 0.3], [0.5, 1.4]]),
    )
    made = SimpleNamespace(
        outputs=SimpleNamespace(acceleration=ROWS),
        modes=lambda: modes,
        mass=back.T @ back,
        damping=back.T @ damping @ back,
    )
    made.asked = []
    made.shapes_up_to = lambda top, own: made.asked.append((top, own)) or np.eye(4)
    made.in_coordinates = lambda shapes, names: made
    return made


def held(w=W, damping=DAMPING, h=H):
    """Matrices of states (y, y') over a step for forces that are held."""
    flow = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.diag(w**2), -damping]])
    whole = np.zeros((12, 12))
    whole[:8, :8] = flow
    whole[4:8, 8:] = np.eye(4)
    whole = expm(h * whole)
    return whole[:8, :8], whole[:8, 8:]


def accelerance(z, over, drive, h=H):
    """Positions seen per force at z, times 2 (z - 1)^2 / (h^2 (z + 1))."""
    seen = ROWS @ SHAPES
    states = np.linalg.solve(z * np.eye(8) - over, drive @ seen.T)
    return 2.0 * (z - 1.0) ** 2 / (h**2 * (z + 1.0)) * seen @ states[:4]


PLACES = np.exp(1j * H * np.array([0.5, 5.9, 11.0, 17.3, 30.0]))


def test_the_exact_response_is_that_of_the_step_s_exponential():
    found = exact_response(exact(), H)
    wanted = [accelerance(z, *held()) for z in PLACES]
    assert found.at(PLACES - 1.0) == pytest.approx(np.array(wanted), rel=1e-9)
    over, drive = held()
    values, vectors = np.linalg.eig(over)
    into = np.linalg.inv(vectors) @ drive @ (ROWS @ SHAPES).T
    out = ROWS @ SHAPES @ vectors[:4]
    for pole, peak in zip(found.poles, found.peaks, strict=True):
        k = np.argmin(np.abs(values - np.exp(pole * H)))
        z = values[k]
        assert z == pytest.approx(np.exp(pole * H), rel=1e-8)
        size = np.linalg.norm(np.outer(out[:, k], into[k])) * 2.0 * abs(z - 1.0) ** 2
        wanted = size / H**2 / abs(z + 1.0) / (1.0 - abs(z))
        assert peak == pytest.approx(wanted, rel=1e-8)
    assert found.lost.tolist() == [0.0] * 5


@pytest.mark.parametrize("fast", [False, True])
def test_damping_that_poles_lack_moves_them_to_the_left(fast):
    h = 0.3 if fast else H  # 17 rad/s turn by more than half a turn
    found = exact_response(exact(), h, LACKING)

    def poles(more):
        damping = DAMPING + more * SHAPES.T @ LACKING @ SHAPES
        flow = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.diag(W**2), -damping]])
        # without the free motion
        keep = [1, 2, 3, 5, 6, 7]
        return np.linalg.eigvals(flow[np.ix_(keep, keep)])

    for pole, lost in zip(found.poles, found.lost, strict=True):
        plain = pole + lost * (abs(pole.imag) * h > np.pi)
        low, high = (at[np.argmin(np.abs(at - plain))] for at in (poles(-1e-5), poles(1e-5)))
        assert poles(0.0)[np.argmin(np.abs(poles(0.0) - plain))] == pytest.approx(plain)
        assert lost == pytest.approx(-(high - low).real / 2e-5, rel=1e-5)
    assert np.any(np.abs(found.poles.imag) * h > np.pi) == fast


def step(integrator, w=W, damping=DAMPING, h=H):
    """Its matrices over (y, h y')."""
    if integrator == "RK4":
        flow = np.block([[np.zeros((4, 4)), np.eye(4)], [-(h**2) * np.diag(w**2), -h * damping]])
        powers = [np.linalg.matrix_power(flow, n) for n in range(4)]
        mean = powers[0] + powers[1] / 2.0 + powers[2] / 6.0 + powers[3] / 24.0
        return flow @ mean, h**2 * mean[:, 4:]
    left = np.linalg.inv(np.eye(4) + h * damping)
    pull = h**2 * left @ np.diag(w**2)
    lost = np.eye(4) - left
    change = np.block([[-pull, left], [-pull, -lost]])
    return change, h**2 * np.vstack([left, left])


def motion(integrator, w=W, damping=DAMPING, h=H):
    return Motion(
        SHAPES, w**2, damping, damping, 1, h, integrator, *step(integrator, w, damping, h)
    )


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_the_response_of_a_step_is_that_of_its_matrices(integrator):
    found = step_response(motion(integrator), ROWS)
    change, drive = step(integrator)
    for z, got in zip(PLACES, found.at(PLACES - 1.0), strict=True):
        # the mean of this and the last force; positions are those after the step
        mean = 1.0 if integrator == "RK4" else (z + 1.0) / (2.0 * z)
        wanted = accelerance(z, np.eye(8) + change, drive) * mean
        assert got == pytest.approx(wanted, rel=1e-9)
    z = np.linalg.eigvals(np.eye(8) + change)
    moving = z[np.abs(z - 1.0) > 1e-6]
    assert len(found.poles) == 6
    for pole in moving:
        assert np.min(np.abs(np.exp(found.poles * H) - pole)) < 1e-9
    assert np.all(found.peaks == np.inf)


@pytest.mark.parametrize(("band", "lacks"), [(25.0, 0.0), (25.0, 1.0), (60.0, 0.0)])
def test_the_sampled_error_is_the_largest_over_the_band(band, lacks):
    true = exact()
    compared = exact()
    compared.damping = true.damping + lacks * LACKING
    scale, frozen = np.array([[1.3, 0.8], [0.8, 0.6]]), 5.0
    found = sampled_error(
        Exact(true, compared, band, 2), motion("implicitfast"), ROWS, scale=scale, frozen=frozen
    )
    assert true.asked == [(1000.0 * band, 2)]
    values = exact_response(true, H, lacks * LACKING)
    ringing = values.poles.imag > 0.0
    places, lost = values.poles[ringing].imag, values.lost[ringing]
    change, drive = step("implicitfast")
    over = held()

    def error(omega):
        near = np.argmin(np.abs(omega - places))
        z = np.exp((1j + lost[near] / places[near]) * omega * H)
        exactly = accelerance(z, *over) * scale
        ours = accelerance(z, np.eye(8) + change, drive) * (z + 1.0) / (2.0 * z) * scale
        size = max(np.linalg.norm(exactly, 2), frozen)
        return np.linalg.norm(ours - exactly, 2) / size

    top = min(band, 2.6 / H)
    grid = np.linspace(0.0, top, 161)[1:]
    curve = [error(omega) for omega in grid]
    assert found.error >= max(curve) * (1.0 - 1e-9)
    assert found.error == pytest.approx(error(found.frequency), rel=1e-7)
    k = int(np.argmax(curve))
    assert abs(found.frequency - grid[k]) <= 2.1 * (grid[1] - grid[0])
    near = found.frequency * (1.0 + 1e-3 * np.linspace(-1.0, 1.0, 41))
    assert found.error >= max(error(omega) for omega in near[near <= top]) * (1.0 - 1e-6)


def test_the_sampled_error_is_the_same_in_any_unit_of_time():
    found = []
    for unit in (1.0, 1e-3, 80.0):
        w, damping, h = unit * W, unit * DAMPING, H / unit
        true, compared = exact(w, damping), exact(w, damping)
        compared.damping = true.damping + unit * LACKING
        at_samples = Exact(true, compared, unit * 25.0, 2)
        slow = motion("implicitfast", w, damping, h)
        one = sampled_error(at_samples, slow, ROWS, scale=np.eye(2) + 0.3, frozen=5.0)
        found.append((one.error, one.frequency / unit))
    assert found[1] == pytest.approx(found[0], rel=1e-6)
    assert found[2] == pytest.approx(found[0], rel=1e-6)


@pytest.mark.parametrize(("turns", "shown", "frozen"), [(1, 8.03, 2e6), (2, 2.4 / H, 4e7)])
def test_a_mode_faster_than_the_samples_is_looked_for_where_they_show_it(turns, shown, frozen):
    # 2 pi / h - 8.03 shows as 8.03, with a peak too narrow for a grid
    fast = turns * 2.0 * np.pi / H - shown
    w, damping = np.array([0.0, 0.0, 6.0, fast]), DAMPING.copy()
    damping[:, 2:] = damping[2:] = 0.0
    damping[2:, 2:] = np.diag([1e-3, 1e-6])
    whole = exact(w, damping)
    slow = motion("implicitfast")
    at_samples = Exact(whole, whole, 1.5 * shown, 2)
    found = sampled_error(at_samples, slow, ROWS, scale=np.ones((2, 2)), frozen=frozen)
    change, drive = step("implicitfast")
    over = held(w, damping)

    def error(omega):
        z = np.exp(1j * omega * H)
        exactly = accelerance(z, *over)
        ours = accelerance(z, np.eye(8) + change, drive) * (z + 1.0) / (2.0 * z)
        return np.linalg.norm(ours - exactly, 2) / frozen

    near = max(error(omega) for omega in shown + np.linspace(-1e-6, 1e-6, 41))
    assert found.frequency == pytest.approx(shown, abs=1e-6)
    assert found.error >= near * (1.0 - 1e-9)
    assert found.error == pytest.approx(error(found.frequency), rel=1e-6)


def test_a_strong_damper_moves_what_is_far_beyond_the_band():
    """A joint held by a damper alone, behind which a beam is fast: what is left of its modes yields
    to the damper. Truth: `M + D/s + K/s^2`, for a step that is next to nothing."""
    count, h = 12, 1e-7
    w = 40.0 * np.arange(1.0, count + 1.0) ** 2
    rows = 1.0 / np.sqrt(np.arange(2.0, count + 2.0))
    mass = np.eye(count + 2)
    mass[0, 0], mass[1, 1], mass[0, 1], mass[1, 0] = 9.0, 6.0, 3.0, 3.0
    mass[1, 2:] = mass[2:, 1] = 0.9 * rows
    mass[0, 2:] = mass[2:, 0] = 0.8 * rows * (-1.0) ** np.arange(count)
    stiffness = np.diag([0.0, 500.0, *w**2])
    damping = np.diag([0.0, 80.0, *(0.01 * w)])
    one = np.eye(count + 2)[:1]
    whole = bc.Linear(
        mass,
        damping,
        stiffness,
        tuple(Signal(f"q{k}", "") for k in range(count + 2)),
        Inputs((Signal("f", "N"),), one.T),
        Outputs((Signal("a", ""),), 0.0 * one, 0.0 * one, one, np.zeros((1, 1))),
        Activations(
            (), np.zeros((count + 2, 0)), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
        ),
    )
    found = Exact(whole, whole, 0.1, 2).at_step(h)  # 100 rad/s: one mode of the beam is below
    for omega in (2.0, 7.0, 11.0):
        s = 1j * omega
        wanted = np.linalg.inv(mass + damping / s + stiffness / s**2)[0, 0]
        at = found.at(np.array([np.expm1(s * h)]))[0, 0, 0]
        assert at == pytest.approx(wanted, rel=1e-9)  # without the damper's shape 4e-8 to 1e-5


def test_peaks_of_poles_above_the_axis():
    poles = np.array([-0.3 + 0.4j, -0.3 - 0.4j, -2.0 + 0j, 0.6 + 0.8j, 0j])
    found = peaks_of_poles(poles, lambda omega: 0.1 * omega)
    assert found == pytest.approx(np.array([[0.5, 0.65], [2.0, 1.2], [1.0, 0.1]]))


def test_a_step_that_grows_is_off_without_bound():
    grows = motion("implicitfast", np.array([0.0, 0.0, 6.0, 200.0]), 0.0 * DAMPING)
    whole = Exact(exact(), exact(), 9.0, 2)
    found = sampled_error(whole, grows, ROWS, scale=np.ones((2, 2)), frozen=1.0)
    assert found == (type(found))(np.inf, 0.0)
    assert off_by(found.error) == "without bound, since the step is unstable"
    assert off_by(0.01234) == "by 1.23e-02"


def test_a_step_is_judged_up_to_its_fastest_phase():
    assert represents(0.26, 10.0)
    assert not represents(0.2601, 10.0)
    assert judged_part(0.26, 10.0) == ""
    # 0.9995 times 2.6 / 40
    assert judged_part(0.13, 40.0) == (
        ", judged up to 20 rad/s: a band up to 40 rad/s needs a step of 0.06497 s or less"
    )
