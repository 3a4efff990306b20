"""`bc.margins`: closed forms, own evaluations of det(1 + L), and MuJoCo with the loop closed.

Tolerances: CLOSED, of closed forms: roots and extrema are polished to 1e-10 and computed in double
precision. SINGULAR, of det(1 + L) at a margin relative to its size without it: the same roots seen
through the plant's resonances. LIMIT, of the gain on both sides of a margin in a run: within it a
marginal motion grows or decays visibly in the time of a run.
"""

import re
import sys
from importlib.resources import files

import control
import mpmath
import mujoco
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import minimize

import beamchain as bc
from command import call
from loops import asked

CLOSED = 1e-7
SINGULAR = 1e-6
LIMIT = 0.01
STEP = 0.01
SLOW = 0.25
CRAFT = """<mujoco model="craft"><option gravity="0 0 0" timestep="0.01"/><worldbody>
<body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/><site name="mount" pos="0.5 0 0.3"/>
</body></worldbody></mujoco>"""
BOOM = bc.Spec(
    name="boom",
    modes=bc.Modes(xy=2, xz=1),
    damping=bc.Damping(ratio=0.005),
    segment=(
        bc.Segment(
            length=8.0,
            section=bc.Equivalent(
                bending_stiffness_xy=2e3,
                bending_stiffness_xz=5e3,
                linear_mass=4.0,
                polar_inertia=0.1,
            ),
        ),
    ),
)
AXES = "yz"
LAG = control.tf([900.0, 80.0], np.polymul([0.05, 1.0], [0.03, 1.0]))
SAMPLED = control.c2d(control.tf([200.0, 20.0], [0.3, 1.0]), SLOW, method="tustin")


@pytest.fixture(scope="module")
def embedded():
    return bc.embed(CRAFT, {"mount": BOOM})


@pytest.fixture(scope="module")
def plant(embedded):
    return bc.plant(embedded, ["torque:bus"], ["attitude"])


@pytest.fixture(scope="module")
def stepped(embedded):
    return bc.plant(embedded, ["torque:bus"], ["attitude"], discrete=STEP)


def named(system, axis="z"):
    """A system as a state space with the plant's names."""
    space = control.ss(system)
    return control.ss(
        space.A,
        space.B,
        space.C,
        space.D,
        space.dt,
        inputs=[f"attitude_{axis}"],
        outputs=[f"torque_{axis}"],
    )


def each(system):
    return {(f"torque_{axis}", f"attitude_{axis}"): system for axis in AXES}


# -- closed forms ----------------------------------------------------------------------------------
def test_three_poles_have_their_closed_form():
    """L = k/(s (s + 1) (0.1 s + 1)): -180 degrees at sqrt(10), where 1/|L| = 11/k."""
    found = bc.margins(
        control.ss(control.tf([1.0], [1.0, 1.0, 0.0])), control.tf([2.0], [0.1, 1.0])
    )
    (loop,) = found.loops
    np.testing.assert_allclose(loop.gain, 5.5, rtol=CLOSED)
    np.testing.assert_allclose(loop.gain_db, 20.0 * np.log10(5.5), rtol=CLOSED)
    np.testing.assert_allclose(loop.gain_frequency, np.sqrt(10.0), rtol=CLOSED)
    assert loop.lowest_gain == 0.0
    w = loop.phase_frequency  # |L| = 1 there
    np.testing.assert_allclose(w**2 * (w**2 + 1.0) * (0.01 * w**2 + 1.0), 4.0, rtol=CLOSED)
    phase = 90.0 - np.degrees(np.arctan(w) + np.arctan(0.1 * w))
    np.testing.assert_allclose(loop.phase, phase, rtol=CLOSED)
    np.testing.assert_allclose(loop.delay, np.radians(phase) / w, rtol=CLOSED)


def test_two_poles_have_their_peaks():
    """L = k/(s (s + a)): T = w0^2/(s^2 + 2 z w0 s + w0^2), with its textbook peak; one loop alone
    has the same disk margin as all at once."""
    k, a = 4.0, 1.0
    ratio = a / (2.0 * np.sqrt(k))
    found = bc.margins(control.ss(control.tf([1.0], [1.0, a, 0.0])), control.tf([k], [1.0]))
    peak = 1.0 / (2.0 * ratio * np.sqrt(1.0 - ratio**2))
    np.testing.assert_allclose(found.peak_complementary.value, peak, rtol=CLOSED)
    resonance = np.sqrt(k * (1.0 - 2.0 * ratio**2))
    np.testing.assert_allclose(found.peak_complementary.frequency, resonance, rtol=1e-3)
    (loop,) = found.loops
    assert loop.gain == np.inf
    np.testing.assert_allclose(found.all_at_once.value, loop.disk, rtol=CLOSED)
    np.testing.assert_allclose(found.peak_sensitivity.value, 1.0 / loop.modulus, rtol=CLOSED)
    # the modulus by a dense grid of its own
    s = 1j * np.linspace(0.5, 6.0, 400001)
    np.testing.assert_allclose(loop.modulus, np.abs(1.0 + k / (s * (s + a))).min(), rtol=1e-8)
    loops = k / (s * (s + a))
    np.testing.assert_allclose(
        loop.disk, 2.0 / np.abs((1.0 - loops) / (1.0 + loops)).max(), rtol=1e-8
    )


def test_a_dead_time_is_exact():
    """L = k exp(-s T)/s rings at pi/(2 T) when k = pi/(2 T)."""
    k, delay = 2.0, 0.3
    loop = bc.spec.Loop(input="u", output="y", numerator=(k,), denominator=(1.0,), delay=delay)
    integrator = control.ss(0.0, 1.0, 1.0, 0.0, inputs=["u"], outputs=["y"])
    found = bc.margins(integrator, bc.spec.Controller(loop=(loop,))).loops[0]
    np.testing.assert_allclose(found.gain, np.pi / (2.0 * delay * k), rtol=CLOSED)
    np.testing.assert_allclose(found.phase, 90.0 - np.degrees(k * delay), rtol=CLOSED)
    np.testing.assert_allclose(found.delay, np.pi / (2.0 * k) - delay, rtol=CLOSED)


@pytest.mark.parametrize("factor", [0.999, 1.001])
@pytest.mark.parametrize("delay", [0.1, 20.0])
def test_stability_with_long_dead_times_is_that_of_the_dead_time(delay, factor):
    """k exp(-s T)/(s + 1) is stable until |L| = 1 at a phase of -180 degrees, at w with
    w T + atan(w) = pi, k = sqrt(1 + w^2), however long T is; a Pade approximation of order 6 alone
    is not."""
    w = 0.0
    low, high = 0.0, np.pi / delay
    for _ in range(200):
        w = (low + high) / 2.0
        low, high = (w, high) if w * delay + np.arctan(w) < np.pi else (low, w)
    k = factor * float(np.hypot(1.0, w))
    loop = bc.spec.Loop(input="u", output="y", numerator=(k,), denominator=(1.0,), delay=delay)
    lag = control.ss(-1.0, 1.0, 1.0, 0.0, inputs=["u"], outputs=["y"])
    found = bc.margins(lag, bc.spec.Controller(loop=(loop,)))
    assert found.stable == (factor < 1.0)
    if found.stable:
        np.testing.assert_allclose(found.loops[0].gain, 1.0 / factor, rtol=CLOSED)


def test_a_sampled_loop_ends_at_half_the_rate():
    """k/(z - 0.5) leaves the circle at z = -1 when k = 1.5."""
    lag = control.ss(0.5, 1.0, 1.0, 0.0, 0.1)
    found = bc.margins(lag, control.tf([0.6], [1.0], 0.1))
    np.testing.assert_allclose(found.loops[0].gain, 2.5, rtol=CLOSED)
    np.testing.assert_allclose(found.loops[0].gain_frequency, np.pi / 0.1, rtol=CLOSED)
    assert found.timestep == 0.1
    assert any("at the samples" in note for note in found.table.notes)


def test_a_gain_that_must_not_fall_at_rest():
    """2/(s - 1) needs half of its gain, at zero frequency."""
    found = bc.margins(control.ss(1.0, 1.0, 1.0, 0.0), control.tf([2.0], [1.0]))
    assert found.stable
    np.testing.assert_allclose(found.loops[0].lowest_gain, 0.5, rtol=CLOSED)
    assert found.loops[0].lowest_gain_frequency == 0.0


# -- direct parts ----------------------------------------------------------------------------------
def direct(d):
    """1/(s + 1) + d."""
    return control.ss([[-1.0]], [[1.0]], [[1.0]], [[d]])


def test_infinite_frequency_counts_with_a_direct_part():
    """k L = k 0.3 (1/(s + 1) - 2) has its pole at -(1 - 0.3 k)/(1 - 0.6 k), which passes infinity
    at k = 1/0.6. |1 + L| is least at infinite frequency, 0.4, where S = 2.5, T = -1.5 and
    |S - T|/2 = 2."""
    found = bc.margins(direct(-2.0), control.tf([0.3], [1]))
    (loop,) = found.loops
    np.testing.assert_allclose(loop.gain, 1.0 / 0.6, rtol=CLOSED)
    assert not bc.margins(direct(-2.0), control.tf([0.3 * 1.001 / 0.6], [1])).stable
    for value, expected in (
        (loop.modulus, 0.4),
        (loop.disk, 0.5),
        (found.all_at_once.value, 0.5),
        (found.peak_sensitivity.value, 2.5),
        (found.peak_complementary.value, 1.5),
    ):
        np.testing.assert_allclose(value, expected, rtol=CLOSED)
    at = (loop.gain_frequency, loop.modulus_frequency, loop.disk_frequency)
    assert at == (np.inf,) * 3
    np.testing.assert_allclose(
        bc.margins(direct(2.0), control.tf([0.3], [1])).loops[0].disk, 8.0, rtol=CLOSED
    )
    # k L = k (1/(s + 1) + 2): above 1 at any frequency, the shortest dead time turns it to -1
    far = bc.margins(direct(2.0), control.tf([1.0], [1])).loops[0]
    assert (far.gain, far.delay) == (np.inf, 0.0)


def test_infinite_frequency_counts_with_the_other_loops_closed():
    """S at infinite frequency is the inverse of 1 + D K alone."""
    d = np.array([[-0.4, 0.3], [0.2, -0.5]])
    plant = control.ss(-np.eye(2), 0.01 * np.eye(2), np.eye(2), d)
    found = bc.margins(plant, control.ss([], [], [], np.eye(2)))
    s = np.linalg.inv(np.eye(2) + d)
    np.testing.assert_allclose(found.peak_sensitivity.value, np.linalg.norm(s, 2), rtol=CLOSED)
    for i, loop in enumerate(found.loops):
        # 1 + k L_ii = 0, the determinant with one row of D times k
        one, other = d[i, i], d[1 - i, 1 - i]
        k = -(1.0 + other) / (one * (1.0 + other) - d[0, 1] * d[1, 0])
        np.testing.assert_allclose(loop.gain, k, rtol=CLOSED)
        assert loop.gain_frequency == np.inf


def test_a_loop_that_has_no_solution_on_its_way_is_told():
    """1 - 1.2 k = 0 at k = 1/1.2, where the pole comes back from infinity; at 1 it is +2."""
    (one,) = bc.margins(direct(-2.0), control.tf([0.6], [1])).instabilities
    np.testing.assert_allclose(one.pole, 2.0, rtol=CLOSED)
    np.testing.assert_allclose(one.gain, 1.0 / 1.2, rtol=CLOSED)
    np.testing.assert_allclose(one.alone["u[0]"], 1.0 / 1.2, rtol=CLOSED)
    assert one.crossing == np.inf
    assert one.as_dict()["crossing"] is None
    assert "at 0.833 of the gains of all loops" in one.sentence
    with pytest.raises(bc.InputError, match="algebraic loop"):
        bc.margins(direct(-2.0), control.tf([0.5], [1]))


def test_poles_are_followed_past_gains_without_a_closed_loop():
    """-1 - k/(1 - 2 k), with no closed loop at the gain of a step."""
    from beamchain.control.pole_paths import crossing, follow, pole_of

    def matrix(gain):
        return np.array([[-1.0 - 0.7 * gain / (1.0 - 2.0 * gain)]])

    one = np.ones(1, dtype=complex)
    end = pole_of(matrix, 1.0, -0.3 + 0j, one)
    met = next(pole.gain for pole in follow(matrix, end, 0.0).poles if pole.gain < 0.3)

    def closed(gain):
        if gain in (met, 0.5):
            raise np.linalg.LinAlgError
        return matrix(gain)

    poles = follow(closed, end, 0.0).poles
    np.testing.assert_allclose(poles[-1].value, -1.0, rtol=1e-6)  # at the smallest gain
    gain, ending = crossing(closed, poles[::-1], lambda poles: (poles.real + 0.5) / 1e-9 - 1.0)
    np.testing.assert_allclose(gain, 0.5, atol=1e-6)
    assert not np.isfinite(ending)


def test_the_direction_of_a_pole_is_found_where_rounding_makes_its_matrix_singular():
    """The left eigenvector of [[1, 3], [0, -2]] at 1 is (1, 1)/sqrt(2), whichever of the numbers
    next to 1 the pole is taken for: at one of them the matrix less what is taken is singular."""
    from beamchain.control.pole_paths import pole_of

    matrix = np.array([[1.0, 3.0], [0.0, -2.0]])
    for k in range(-100, 100):
        left = pole_of(lambda _: matrix, 1.0, 1.0 + k * 2.0**-53 + 0j, np.array([1.0 + 0j, 0])).left
        np.testing.assert_allclose(np.abs(left), np.sqrt(0.5), rtol=1e-12)


# -- undamped poles --------------------------------------------------------------------------------
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_gains_have_no_limit_at_undamped_poles_and_zeros(turn):
    """A body that carries an undamped mode, lead at the actuator: every gain is stable, though the
    phase jumps by 180 degrees where the response is infinite and where it is zero."""
    w = 3.0
    turned = np.kron(np.eye(2), [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag([0.0, w**2]), np.zeros((2, 2))]])
    b, c = np.array([[0.0], [0.0], [1.0], [0.6]]), np.array([[1.0, 0.6, 0.0, 0.0]])
    plant = control.ss(turned @ a @ turned.T, turned @ b, c @ turned.T, 0.0)
    found = bc.margins(plant, control.tf([2.0, 1.0], [0.05, 1.0]))
    (loop,) = found.loops
    assert found.stable
    assert (loop.lowest_gain, loop.gain) == (0.0, np.inf)
    assert loop.lowest_gain_db == -np.inf


# -- det(1 + L), evaluated here --------------------------------------------------------------------
def transfer(plant, system, w, factors):
    """det(1 + K G) of the loops on `AXES` at w, each gain times a factor."""
    s = 1j * w
    g = plant.C @ np.linalg.solve(s * np.eye(plant.nstates) - plant.A, plant.B) + plant.D
    k = np.polyval(system.num[0][0], s) / np.polyval(system.den[0][0], s)
    rows = [list(plant.output_labels).index(f"attitude_{axis}") for axis in AXES]
    columns = [list(plant.input_labels).index(f"torque_{axis}") for axis in AXES]
    return np.linalg.det(np.eye(2) + np.diag(factors) * k @ g[np.ix_(rows, columns)])


@pytest.mark.parametrize("form", ["mapping of zpk", "whole matrix", "matrix by its labels"])
@pytest.mark.slow
def test_every_form_of_a_controller_is_the_same_at_its_margins(form, plant):
    if form == "mapping of zpk":
        zeros, poles = (np.asarray(v) for v in (LAG.zeros(), LAG.poles()))
        controller = each(control.zpk(zeros, poles, 6e5))
    elif form == "matrix by its labels":
        both = control.append(control.ss(LAG), control.ss(LAG))
        ends = {"outputs": ["torque_z", "torque_y"], "inputs": ["attitude_z", "attitude_y"]}
        controller = control.ss(both.A, both.B, both.C, both.D, **ends)
    else:
        num = [[[0.0]] * 3 for _ in range(3)]
        den = [[[1.0]] * 3 for _ in range(3)]
        for i in (1, 2):
            num[i][i], den[i][i] = LAG.num[0][0], LAG.den[0][0]
        controller = control.tf(num, den)
    found = bc.margins(plant, controller)
    assert found.stable
    loops = sorted(found.loops, key=lambda loop: loop.input)
    assert [loop.input for loop in loops] == ["torque_y", "torque_z"]
    for i, loop in enumerate(loops):
        at = [np.where(np.arange(2) == i, f, 1.0) for f in (loop.gain, 1.0)]
        parts = [abs(transfer(plant, LAG, loop.gain_frequency, f)) for f in at]
        assert parts[0] < SINGULAR * parts[1]
        turned = np.exp(-1j * np.radians(loop.phase))
        at = np.where(np.arange(2) == i, turned, 1.0)
        assert abs(transfer(plant, LAG, loop.phase_frequency, at)) < SINGULAR
        d = loop.disk / 2.0  # some factor on the disk's rim is singular at its frequency
        edge = d * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 20001))
        rim = [
            abs(transfer(plant, LAG, loop.disk_frequency, np.where(np.arange(2) == i, f, 1.0)))
            for f in (1.0 + edge[::40]) / (1.0 - edge[::40])
        ]
        assert min(rim) < 0.02


# -- all loops at once -----------------------------------------------------------------------------
def coupled(count):
    """A stable plant whose loops are coupled, and a controller: lags with a matrix between."""
    rng = np.random.default_rng(count)
    mix = np.eye(count) + 0.5 * rng.standard_normal((count, count))
    modes = [
        control.ss([[0.0, 1.0], [-w * w, -0.1 * w]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
        for w in np.linspace(1.0, 2.0, count)
    ]
    both = modes[0]
    for mode in modes[1:]:
        both = control.append(both, mode)
    plant = control.ss(both.A, both.B @ mix, both.C, np.zeros((count, count)))
    return plant, 0.5 * np.linalg.inv(mix).T


def loops_at(plant, gain, w):
    s = 1j * np.atleast_1d(w)
    eye = np.eye(plant.nstates)
    return np.array([gain @ plant.C @ np.linalg.solve(v * eye - plant.A, plant.B) for v in s])


@pytest.mark.slow
def test_the_margin_of_all_loops_is_where_a_perturbation_destabilises():
    """Up to three channels the bound is mu: at its frequency there are factors in a disk larger by
    a thousandth that make det(1 + F L) zero, and none inside."""
    count = 3
    plant, gain = coupled(count)
    k = control.ss([], [], [], gain)
    found = bc.margins(plant, k)
    assert found.stable
    margin, w = found.all_at_once
    assert margin <= min(loop.disk for loop in found.loops) * (1.0 + CLOSED)
    loop = loops_at(plant, gain, w)[0]
    sensitivity = np.linalg.inv(np.eye(count) + loop)
    middle = sensitivity - np.eye(count) / 2.0

    def radius(angles):
        """Largest eigenvalue of (S - T)/2 times a diagonal of unit numbers, with its minus."""
        return -np.abs(np.linalg.eigvals(middle * np.exp(1j * angles))).max()

    rng = np.random.default_rng(1)
    best = min(
        (
            minimize(
                radius,
                rng.uniform(0.0, 2.0 * np.pi, count),
                method="Nelder-Mead",
                options={"xatol": 1e-9, "fatol": 1e-13},
            )
            for _ in range(8)
        ),
        key=lambda one: one.fun,
    )
    np.testing.assert_allclose(-best.fun, 1.0 / margin, rtol=1e-3)
    values, vectors = np.linalg.eig(middle * np.exp(1j * best.x))
    largest = values[np.argmax(np.abs(values))]
    delta = np.exp(1j * best.x) / largest  # 1 - M Delta is singular
    assert np.abs(delta).max() < 1.001 * margin
    factors = (1.0 + delta / 2.0) / (1.0 - delta / 2.0)
    assert abs(np.linalg.det(np.eye(count) + np.diag(factors) @ loop)) < 1e-8
    assert vectors.shape == (count, count)


@pytest.mark.slow
def test_no_factors_in_the_disk_destabilise():
    """Real factors of gain and dead-beat phases inside the disk: det(1 + F L) is never zero along
    the axis, and the closed loop of every real draw is stable."""
    count = 4
    plant, gain = coupled(count)
    found = bc.margins(plant, control.ss([], [], [], gain))
    inside = 0.999 * found.all_at_once.value / 2.0
    rng = np.random.default_rng(count)
    w = np.geomspace(0.05, 20.0, 400)
    loop = loops_at(plant, gain, w)
    turns = []
    for _ in range(100):
        d = inside * np.exp(2j * np.pi * rng.uniform(size=count))
        factors = (1.0 + d) / (1.0 - d)
        values = np.linalg.det(np.eye(count) + factors[:, None] * loop)
        turns.append(np.sum(np.angle(values[1:] / values[:-1])))
        real = ((1.0 + d.real) / (1.0 - d.real))[:, None] * gain
        poles = np.linalg.eigvals(plant.A - plant.B @ real @ plant.C)
        assert poles.real.max() < 0.0
    base = np.linalg.det(np.eye(count) + loop)
    nominal = np.sum(np.angle(base[1:] / base[:-1]))
    # no zero crosses the axis between the nominal loop and a draw, so that no draw turns once more
    assert np.all(np.abs(np.array(turns) - nominal) < np.pi)


def test_the_bound_is_that_of_slycot():
    slycot = pytest.importorskip("slycot")
    from beamchain.control.mu import bound

    rng = np.random.default_rng(4)
    for n in (2, 3, 5):
        m = rng.standard_normal((n, n)) + 1j * rng.standard_normal((n, n))
        true = slycot.ab13md(m, np.ones(n, dtype=int), np.full(n, 2))[0]
        np.testing.assert_allclose(bound(m), true, rtol=1e-3)


# -- sampled ---------------------------------------------------------------------------------------
def test_a_slow_controller_sees_the_plant_held_over_its_step(plant, stepped):
    """The lifted plant's own loops, stepped sample by sample here, are singular at the margins."""
    for one, fine in ((plant, 0.0), (stepped, STEP)):
        found = bc.margins(one, {("torque_z", "attitude_z"): SAMPLED})
        assert found.stable
        assert found.timestep == SLOW
        column = list(one.input_labels).index("torque_z")
        row = list(one.output_labels).index("attitude_z")
        b, c = one.B[:, [column]], one.C[[row]]
        if fine:
            # every column of the lifted plant by running it: state and input, 25 steps held
            power, driven = np.eye(one.nstates), np.zeros_like(b)
            for _ in range(round(SLOW / fine)):
                power, driven = one.A @ power, one.A @ driven + b
        else:
            n = one.nstates
            both = expm(SLOW * np.block([[one.A, b], [np.zeros((1, n + 1))]]))
            power, driven = both[:n, :n], both[:n, n:]
        (loop,) = found.loops
        for w, factor in (
            (loop.gain_frequency, loop.gain),
            (loop.phase_frequency, np.exp(-1j * np.radians(loop.phase))),
        ):
            z = np.exp(1j * w * SLOW)
            g = c @ np.linalg.solve(z * np.eye(one.nstates) - power, driven) + one.D[row, column]
            k = np.polyval(SAMPLED.num[0][0], z) / np.polyval(SAMPLED.den[0][0], z)
            assert abs(1.0 + factor * k * g[0, 0]) < SINGULAR


@pytest.mark.parametrize("frequency", [6.0, 8.0, 19.0])
def test_a_dead_time_between_samples_turns_a_mode_beyond_half_the_rate_at_its_own_frequency(
    frequency,
):
    """Hub and mode under a torque one sample late, pi/T = 7.85 rad/s, the mode coupled at 10, 13.3
    and 31.7 rad/s: with a fractional dead time f the torque of the sample before acts over f, that
    of this one over the rest. The loop is stable up to the stated dead time, and no longer."""
    inertia, ratio, share, step, kp, kd = 100.0, 0.003, 8.0, 0.4, 4.0, 60.0
    inverse = np.linalg.inv([[inertia, share], [share, 1.0]])
    a = np.zeros((5, 5))
    a[:2, 2:4] = np.eye(2)
    a[2:4, 1], a[2:4, 3] = -(frequency**2) * inverse[:, 1], -2 * ratio * frequency * inverse[:, 1]
    a[2:4, 4] = inverse[:, 0]  # the fifth state is the torque that is held
    c = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    plant = control.ss(a[:4, :4], a[:4, 4:], c, 0.0)
    late = [control.tf([k], [1.0, 0.0], step) for k in (kp, kd)]
    found = bc.margins(plant, {("u[0]", "y[0]"): late[0], ("u[0]", "y[1]"): late[1]})

    def radius(delay):
        whole = int(delay // step)
        free, rest = expm(a * step), expm(a * (step - delay + whole * step))
        count = whole + 2
        matrix = np.zeros((4 + count, 4 + count))  # torques of the last samples behind the states
        matrix[:4, :4] = free[:4, :4]
        matrix[:4, 4 + whole] = rest[:4, 4]
        matrix[:4, 5 + whole] = free[:4, 4] - rest[:4, 4]
        matrix[4, :4] = -kp * c[0] - kd * c[1]
        matrix[5:, 4:-1] = np.eye(count - 1)
        return np.abs(np.linalg.eigvals(matrix)).max()

    delay = found.loops[0].delay
    assert all(radius(part * delay) < 1.0 for part in np.linspace(0.0, 0.999, 200))
    assert radius(1.001 * delay) > 1.0


# -- MuJoCo with the loop closed -------------------------------------------------------------------
def attitude_z(data):
    """Rotation about z [rad], of a small one."""
    return 2.0 * data.qpos[6]


class Stepped:
    """A system from attitude to torque, stepped by the trapezoidal rule."""

    def __init__(self, system, h):
        space = control.ss(system)
        n = space.nstates
        left = np.eye(n) - h / 2.0 * space.A
        self.a = np.linalg.solve(left, np.eye(n) + h / 2.0 * space.A)
        self.b = np.linalg.solve(left, h / 2.0 * space.B[:, 0])
        self.c, self.d = space.C[0], space.D[0, 0]
        self.x = np.zeros(n)
        self.before = 0.0

    def __call__(self, y):
        self.x = self.a @ self.x + self.b * (y + self.before)
        self.before = y
        return float(self.c @ self.x + self.d * y)


def continuous_run(model, system, duration):
    """Attitude of a run under RK4 after a kick; the torque of the middle of each step is
    extrapolated, so that holding it delays nothing."""
    h = model.opt.timestep
    data = mujoco.MjData(model)
    data.qvel[5] = 1e-5
    controller, last, seen = Stepped(system, h), 0.0, []
    for _ in range(round(duration / h)):
        torque = -controller(attitude_z(data))
        data.qfrc_applied[5] = 1.5 * torque - 0.5 * last
        last = torque
        seen.append(attitude_z(data))
        mujoco.mj_step(model, data)
    return np.array(seen)


def sampled_run(model, system, duration):
    """Attitude at the controller's samples: it holds its torque over 25 steps, and each step of a
    model that is exact in time gets the mean of its torque and the one before."""
    space = control.ss(system)
    data = mujoco.MjData(model)
    held = bc.HeldInput()
    data.qvel[5] = 1e-5
    x, torque, seen = np.zeros(space.nstates), 0.0, []
    every = round(SLOW / model.opt.timestep)
    for k in range(round(duration / model.opt.timestep)):
        if k % every == 0:
            y = attitude_z(data)
            seen.append(y)
            torque = -float(space.C[0] @ x + space.D[0, 0] * y)
            x = space.A @ x + space.B[:, 0] * y
        data.qfrc_applied[5] = held(np.array([torque]))[0]
        mujoco.mj_step(model, data)
    return np.array(seen)


def growth(seen):
    """Of the amplitude from the third to the last quarter of a run."""
    third, last = np.array_split(seen, 4)[2:]
    return float(np.ptp(last) / np.ptp(third))


@pytest.mark.slow
def test_mujoco_rings_at_the_gain_margin(embedded, plant):
    (loop,) = bc.margins(plant, {("torque_z", "attitude_z"): LAG}).loops
    model = embedded.untimed
    model.opt.timestep = 2e-3
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for factor in (1.0 - LIMIT, 1.0 + LIMIT):
        change = growth(continuous_run(model, factor * loop.gain * LAG, 60.0))
        sys.stdout.write(f"{factor:g} of the gain margin: amplitude times {change:.4g}\n")
        assert (change > 1.0) == (factor > 1.0)


@pytest.mark.slow
def test_mujoco_rings_at_the_gain_margin_of_a_slow_controller(embedded, stepped):
    """4 Hz on the plant of 100 Hz that MuJoCo runs."""
    (loop,) = bc.margins(stepped, {("torque_z", "attitude_z"): SAMPLED}).loops
    model = embedded.model
    assert model.opt.timestep == STEP
    for factor in (1.0 - LIMIT, 1.0 + LIMIT):
        change = growth(sampled_run(model, factor * loop.gain * SAMPLED, 400.0))
        sys.stdout.write(f"{factor:g} of the gain margin: amplitude times {change:.4g}\n")
        assert (change > 1.0) == (factor > 1.0)


# -- slow growth -----------------------------------------------------------------------------------
SERVOED = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="140" diaginertia="60 45 80"/>
<body name="yoke"><joint name="drive" axis="1 0 0"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.02 0.02 0.02"/></body></body></worldbody>
<actuator><position joint="drive" kp="4000" kv="{kv}"/></actuator></mujoco>"""


def servoed(kv, kp, kd, ki):
    """Growth [1/s] of bus and drive, from the roots in 30 digits of
    det [[J s^2 + kd s + kp + ki/s, J_y s^2], [J_y s^2, J_y s^2 + kv s + 4000]]."""
    j, yoke = 60.02, 0.02
    law = [kd, kp, ki] if ki else [kd, kp]  # with an integral, times s
    whole = np.polymul([j, *law], [yoke, kv, 4000.0])
    whole[0] -= yoke**2
    with mpmath.workdps(30):
        roots = mpmath.polyroots([mpmath.mpf(one) for one in whole], maxsteps=500, extraprec=300)
        return float(max(root.real for root in roots))


@pytest.mark.parametrize(
    ("kv", "gains"),
    [
        (1e4, (60.0, 300.0, -0.06)),
        (2000.0, (-2e-5, 0.05, 0.0)),
        (1e4, (0.06, 5.0, 6e-5)),
        (2000.0, (2e-5, 0.05, 0.0)),
    ],
)
@pytest.mark.slow
def test_slow_growth_beside_a_fast_servo_is_unstable(kv, gains):
    """The servo's fastest pole, some kv/0.02, is 1e6 to 1e9 times as fast as what grows."""
    kp, kd, ki = gains
    plant = bc.plant(
        mujoco.MjModel.from_xml_string(SERVOED.format(kv=kv)),
        ["torque:bus"],
        ["attitude", "rate"],
    )
    found = bc.margins(
        plant,
        {
            ("torque_x", "attitude_x"): control.tf([kp, ki], [1.0, 0.0]) if ki else kp,
            ("torque_x", "rate_x"): kd,
        },
    )
    expected = servoed(kv, kp, kd, ki)
    assert found.stable == (expected < 0.0)
    if not found.stable:
        grown = max(one.pole.real for one in found.instabilities)
        np.testing.assert_allclose(grown, expected, rtol=1e-5)


@pytest.mark.parametrize("step", [0.0, 0.01])
@pytest.mark.parametrize("integral", [-1e-14, 1e-14])
def test_slow_loops_beside_a_fast_mode_are_judged_by_their_integral(integral, step):
    """kd s^2 + kp s + ki on two bodies with a mode of 2,000 rad/s, one of them under no loop. At
    1e-4 rad/s the mode follows the body, and the characteristic polynomial begins with ki: below
    zero it has a root that grows (of z: it is below zero at z = 1)."""
    w, ratio, coupling = 2000.0, 0.005, 0.3
    mass = np.array([[1.0, 0.0, coupling], [0.0, 1.0, 0.0], [coupling, 0.0, 1.0]])
    inverse = np.linalg.inv(mass)
    a = np.zeros((6, 6))
    a[:3, 3:] = np.eye(3)
    a[3:, 2], a[3:, 5] = -(w**2) * inverse[:, 2], -2.0 * ratio * w * inverse[:, 2]
    b = np.vstack([np.zeros((3, 2)), inverse[:, :2]])
    c = np.kron(np.eye(2), np.eye(3))[[0, 1, 3, 4]]
    plant = control.ss(a, b, c, 0.0)
    integrator = control.tf([integral * step], [1.0, -1.0], step)
    if not step:
        integrator = control.tf([integral], [1.0, 0.0])
    slow = 1e-4
    controller = {("u[0]", "y[0]"): slow**2 + integrator, ("u[0]", "y[2]"): 1.4 * slow}
    found = bc.margins(plant, controller)
    assert found.stable == (integral > 0.0)
    assert any(abs(pole) < 0.1 * slow for pole in found.poles)


# -- why it is unstable ----------------------------------------------------------------------------
def closed_poles(plant, factors):
    """Poles with the loops of `AXES` closed at factors of `LAG`, by python-control."""
    space = control.ss(LAG)
    both = control.append(*(f * space for f in factors))
    pick = plant[[f"attitude_{axis}" for axis in AXES], [f"torque_{axis}" for axis in AXES]]
    return control.feedback(pick, both).poles()


@pytest.mark.slow
def test_the_loop_to_blame_is_named(plant):
    hot = 2.0 * bc.margins(plant, each(LAG)).loops[1].gain
    factors = np.array([1.0, hot])
    loops = {(f"torque_{a}", f"attitude_{a}"): f * LAG for a, f in zip(AXES, factors, strict=True)}
    found = bc.margins(plant, loops)
    assert not found.stable
    (one,) = found.instabilities
    # the pole, against python-control
    poles = closed_poles(plant, factors)
    growing = poles[(poles.real > 1e-6) & (poles.imag >= 0.0)]
    np.testing.assert_allclose([one.pole], growing, rtol=1e-6)
    np.testing.assert_allclose(one.hertz * 2.0 * np.pi, abs(growing[0]), rtol=1e-6)
    np.testing.assert_allclose(one.time_constant, 1.0 / growing[0].real, rtol=1e-4)
    assert one.damping_ratio < 0.0
    # alone, and from which gain: the margin says half of it
    assert list(one.alone) == ["torque_z"]
    np.testing.assert_allclose(one.alone["torque_z"], 0.5, rtol=1e-6)
    np.testing.assert_allclose(
        one.crossing, bc.margins(plant, each(LAG)).loops[1].gain_frequency, rtol=1e-6
    )
    assert one.stable_without == ("torque_z",)
    for factor, grows in ((0.999, False), (1.001, True)):
        poles = closed_poles(plant, factor * one.gain * factors)
        assert (poles.real.max() > 1e-7) == grows
    assert "torque_z alone makes it so, at gains above 0.5 " in one.sentence
    assert [loop.causes for loop in found.loops] == [False, True]
    assert all(np.isnan(loop.gain) for loop in found.loops)
    rows = {row[0]: row[2] for row in found.table.rows}
    assert rows["torque_z"] == "UNSTABLE"
    assert rows["torque_y"] == "unstable because of other loops"
    assert one.sentence in found.table.notes
    printed = str(found.table).splitlines()
    assert one.sentence in printed
    [line] = [line for line in printed if "unstable because of other loops" in line]
    assert "torque_y" in line
    assert "torque_z" not in line
    assert one.sentence in found._repr_html_()


def followed_back(plant, system, gain, pole):
    """Where a pole comes from, over 2,000 even steps back to 1e-4 of the gain, each time the
    nearest; of rotation about z alone, which nothing else couples with."""
    turning = [i for i, name in enumerate(plant.state_names) if "xy" in name or "_z" in name]
    a = plant.A[np.ix_(turning, turning)]
    b = plant.B[np.ix_(turning, [2])]
    c = plant.C[np.ix_([2], turning)]
    k = control.ss(system)
    for factor in gain * np.linspace(1.0, 1e-4, 2000):
        poles = np.linalg.eigvals(np.block([[a, -factor * b @ k.C], [k.B @ c, k.A]]))
        pole = poles[np.argmin(np.abs(poles - pole))]
    return pole


def test_a_mode_that_a_slow_controller_drives_is_named(plant):
    """Two lags of 0.3 s turn the torque on a bending mode against it."""
    slow = control.tf([60.0, 6.0], np.polymul([0.3, 1.0], [0.3, 1.0]))
    gain = 12.0
    found = bc.margins(plant, {("torque_z", "attitude_z"): gain * slow})
    (one,) = found.instabilities
    start = followed_back(plant, slow, gain, one.pole)
    assert one.kind == "mode"
    number = plant.modes.index(one.origin)
    np.testing.assert_allclose(abs(start), plant.frequency[number], rtol=1e-3)
    assert one.sentence.startswith(f"UNSTABLE: {one.origin} (")


@pytest.mark.slow
def test_rigid_motion_that_fast_lags_destabilise_is_named(plant):
    """The pair comes from the real axis, where a pole of rigid motion meets one of the lags, at
    -20 and -33 rad/s."""
    gain = 2.0 * bc.margins(plant, {("torque_z", "attitude_z"): LAG}).loops[0].gain
    (one,) = bc.margins(plant, {("torque_z", "attitude_z"): gain * LAG}).instabilities
    start = followed_back(plant, LAG, gain, one.pole)
    assert abs(start) < 0.1 or abs(start + 20.0) < 0.5
    assert (one.origin, one.kind) == ("rigid motion attitude_z with the controller", "several")


def test_a_wrong_sign_grows_from_rigid_motion(plant):
    found = bc.margins(plant, {("torque_z", "attitude_z"): -LAG})
    one = found.instabilities[0]
    assert (one.origin, one.kind, one.gain) == ("attitude_z", "rigid", 0.0)
    assert "without oscillation" in one.sentence
    assert "at any part of its gain" in one.sentence


@pytest.mark.slow
def test_wrong_signs_on_a_symmetric_satellite_are_those_of_each_axis():
    """Two equal arrays opposite each other couple no axes: `J s^2 = k K(s)` has a positive root at
    any gain k, whose motion is that of its own axis, though the lag is fast beside it."""
    shipped = files("beamchain") / "examples"
    arrays = dict.fromkeys(("left", "right"), shipped / "array.toml")
    satellite = bc.plant(bc.embed(shipped / "satellite.xml", arrays), ["torque:bus"], ["attitude"])
    loops = {
        (f"torque_{axis}", f"attitude_{axis}"): -inertia * control.tf([0.42, 0.09], [0.05, 1.0])
        for axis, inertia in zip("xyz", (140.0, 120.0, 150.0), strict=True)
    }
    found = [one for one in bc.margins(satellite, loops).instabilities if one.kind == "rigid"]
    assert sorted((one.origin, *one.alone, *one.alone.values()) for one in found) == [
        (f"attitude_{axis}", f"torque_{axis}", 0.0) for axis in "xyz"
    ]


def two_axes(*lags):
    """Two double integrators, each with `(kd s + kp)/((a s + 1)(b s + 1))`."""
    two = np.eye(2)
    plant = control.ss(
        np.kron(two, [[0.0, 1.0], [0.0, 0.0]]),
        np.kron(two, [[0.0], [1.0]]),
        np.kron(two, [[1.0, 0.0]]),
        0.0,
    )
    loops = {
        (f"u[{i}]", f"y[{i}]"): control.tf([kd, kp], np.polymul([a, 1.0], [b, 1.0]))
        for i, (kp, kd, a, b) in enumerate(lags)
    }
    return bc.margins(plant, loops).instabilities


@pytest.mark.parametrize(
    "lags",
    [
        [(0.652, 0.984, 0.718, 0.668), (0.716, 0.669, 0.279, 0.674)],
        [(0.973, 0.550, 0.465, 0.683), (0.738, 0.942, 0.689, 0.579)],
        [(0.317, 0.405, 0.266, 0.991), (0.363, 0.606, 0.911, 0.606)],
        [(0.787, 0.312, 0.424, 0.383), (0.631, 0.843, 0.383, 0.926)],
        [(0.928, 0.270, 0.251, 0.865), (0.695, 0.813, 0.492, 0.673)],
    ],
)
def test_poles_that_pass_each_other_keep_their_crossings(lags):
    """Of a b s^4 + (a + b) s^3 + s^2 + k kd s + k kp, by Routh, w^2 = k kd/(a + b) on the axis and
    k = (kd/(a + b) - kp) (a + b)^2/(a b kd^2); not above zero: it grows from the smallest gain on.
    """
    expected = {}
    for i, (kp, kd, a, b) in enumerate(lags):
        k = max(0.0, (kd / (a + b) - kp) * (a + b) ** 2 / (a * b * kd**2))
        if k < 1.0:
            expected[f"u[{i}]"] = k, np.sqrt(k * kd / (a + b))
    found = two_axes(*lags)
    assert len(found) == len(expected)
    for one in found:
        ((name, alone),) = one.alone.items()
        k, crossing = expected.pop(name)
        np.testing.assert_allclose([one.gain, alone], k, rtol=1e-5, atol=1e-12)
        np.testing.assert_allclose(one.crossing, crossing, rtol=1e-5, atol=1e-12)


def three_axes(inertias, gains, delay=0.0):
    """Three rigid axes `1/(J s^2)` and PD loops of a bandwidth in proportion to their inertia, with
    a lag each; plant and the loops of every axis."""
    j = np.asarray(inertias)
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [np.zeros((3, 6))]])
    plant = control.ss(
        a, np.vstack([np.zeros((3, 3)), np.diag(1.0 / j)]), np.eye(3, 6), np.zeros((3, 3))
    )
    dead = control.tf(*control.pade(delay, 4)) if delay else control.tf(1.0, 1.0)
    lag = control.tf([0.5, 0.05], np.polymul([1.0, 1.0], [0.4, 1.0]))
    return plant, [gain * inertia * lag * dead for gain, inertia in zip(gains, j, strict=True)]


@pytest.mark.parametrize(
    ("inertias", "spread", "delay"),
    [
        ((100.0, 100.0, 100.0), 0.0, 0.0),
        ((100.0, 120.0, 150.0), 1e-6, 0.0),
        ((100.0, 100.0, 100.0), 1e-6, 3.0),
        ((100.0, 120.0, 150.0), 0.02, 3.0),
    ],
)
@pytest.mark.slow
def test_axes_of_one_design_are_blamed_for_their_own_poles(inertias, spread, delay):
    """Each loop alone, by python-control, says how many poles of its own grow and where."""
    gains = 30.0 * (1.0 + spread * np.array([0.0, 1.0, -0.7]))
    plant, loops = three_axes(inertias, gains, delay)
    found = bc.margins(plant, {(f"u[{i}]", f"y[{i}]"): loops[i] for i in range(3)})
    assert not found.stable
    for i in range(3):
        poles = control.feedback(plant[i, i], control.ss(loops[i])).poles()
        growing = poles[(poles.real > 1e-6) & (poles.imag >= 0.0)]
        assert growing.size
        own = [one for one in found.instabilities if f"u[{i}]" in one.alone]
        assert all(list(one.alone) == one_name(i) for one in own)
        assert all(list(one.stable_without) == one_name(i) for one in own)
        np.testing.assert_allclose(
            np.sort_complex([one.pole for one in own]), np.sort_complex(growing), rtol=1e-5
        )
        for one in own:
            words = f"the loop u[{i}] alone makes it so, at "
            assert words in one.sentence
            # rigid motion of this axis, or its controller's own poles
            named = set(re.findall(r"x\[(\d)\]", one.origin))
            assert named <= {str(i), str(i + 3)}, one.sentence
            for factor, grows in ((0.99, False), (1.01, True)):
                k = factor * one.alone[f"u[{i}]"]
                if k > 0.0:
                    poles = control.feedback(plant[i, i], k * control.ss(loops[i])).poles()
                    at = np.abs(poles - 1j * one.crossing).min()
                    near = poles[np.abs(poles - 1j * one.crossing) == at]
                    assert (near.real.max() > 0.0) == grows
    assert sum(len(one.alone) for one in found.instabilities) == len(found.instabilities)


def one_name(i):
    return [f"u[{i}]"]


def test_wrong_signs_are_asked_for_once_and_first():
    plant, loops = three_axes((100.0, 100.0, 100.0), (1.0, 1.0, 1.0))
    found = bc.margins(plant, {(f"u[{i}]", f"y[{i}]"): -loops[i] for i in range(3)})
    assert "the sign of the numerators on u[0], u[1] and u[2]" in found.reasons[0]
    assert len(found.reasons) == 1 + len(found.instabilities)
    assert sum("sign" in said for said in found.reasons) == 1
    assert found.table.notes[0] == found.reasons[0]
    right = bc.margins(plant, {(f"u[{i}]", f"y[{i}]"): 30.0 * loops[i] for i in range(3)})
    assert not any("sign" in said for said in right.reasons)


def test_one_mode_that_several_loops_drive_is_said_once():
    """Two loops on one oscillator, each of which makes it grow alone: its damping, 0.1, less 0.2
    and less 0.4 of gain."""
    plant = control.ss(
        [[0.0, 1.0], [-4.0, -0.1]], [[0.0, 0.0], [1.0, 1.0]], [[0.0, 1.0], [0.0, 1.0]], 0.0
    )
    (one,) = bc.margins(plant, {("u[0]", "y[0]"): -0.2, ("u[1]", "y[1]"): -0.2}).instabilities
    assert "u[0], u[1] alone makes it so, at gains above 0.5 " in one.sentence
    (one,) = bc.margins(plant, {("u[0]", "y[0]"): -0.2, ("u[1]", "y[1]"): -0.4}).instabilities
    assert "u[0] (at gains above 0.5 of" in one.sentence
    assert "u[1] (at gains above 0.25 of" in one.sentence


def test_what_no_loop_does_alone():
    """Two channels that are stable alone at any gain, and not together: L = [0 k; k 0]/(s + 1),
    whose poles are -1 +- k."""
    plant = control.ss(-np.eye(2), np.eye(2), [[0.0, 1.0], [1.0, 0.0]], np.zeros((2, 2)))
    found = bc.margins(plant, control.ss([], [], [], [[-2.0, 0.0], [0.0, -2.0]]))
    (one,) = found.instabilities
    np.testing.assert_allclose(one.pole, 1.0, rtol=1e-9)
    np.testing.assert_allclose(one.gain, 0.5, rtol=1e-6)  # it crosses at rest, seen to 1e-7
    assert dict(one.alone) == {}
    assert one.stable_without == ("u[0]", "u[1]")
    assert "no loop alone makes it so" in one.sentence
    assert "at gains above 0.5 of" in one.sentence


def many_modes(number, count):
    """A body with `count` lightly damped modes, pushed and looked at about three axes in one place,
    but with one mode seen about z with the wrong sign."""
    rng = np.random.default_rng(3)
    w = np.sort(np.exp(rng.uniform(np.log(0.5), np.log(60.0), count)))
    shapes = rng.standard_normal((count, 3)) * 0.25
    shapes[number] = 0.05, 0.05, 0.5
    seen = shapes.copy()
    seen[number, 2] *= -1.0
    n = 3 + count
    stiffness = np.diag([0.0] * 3 + [*w**2])
    damping = np.diag([0.0] * 3 + [*(2.0 * 0.003 * w)])
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    b = np.vstack([np.zeros((n, 3)), np.eye(3), shapes])
    c = np.hstack([np.eye(3), seen.T, np.zeros((3, n))])
    return control.ss(a, b, c, 0.0)


@pytest.mark.slow
def test_of_many_modes_the_one_to_blame_is_named():
    number = 4
    plant = many_modes(number, 9)
    n = plant.nstates // 2
    system = control.tf([9.0, 2.0], [0.004, 1.0])
    loops = {(f"u[{i}]", f"y[{i}]"): factor * system for i, factor in enumerate((0.1, 0.1, 1.0))}
    (one,) = bc.margins(plant, loops).instabilities
    assert one.origin in {f"x[{3 + number}]", f"x[{n + 3 + number}]"}
    assert list(one.alone) == ["u[2]"]
    assert one.stable_without == ("u[2]",)

    def growing(*factors):
        space = control.ss(system)
        poles = control.feedback(plant, control.append(*(f * space for f in factors))).poles()
        return poles[(poles.real > 1e-7) & (poles.imag > 0.0)]

    np.testing.assert_allclose([one.pole], growing(0.1, 0.1, 1.0), rtol=1e-8)
    for factor, count in ((0.999, 0), (1.001, 1)):
        k = factor * one.gain
        assert growing(0.1 * k, 0.1 * k, k).size == count
        assert growing(0.0, 0.0, factor * one.alone["u[2]"]).size == count


def test_what_nothing_controls_is_no_instability(plant):
    """Attitude about x and y drifts, and takes no part; in other coordinates too."""
    single = {("torque_z", "attitude_z"): LAG}
    assert bc.margins(plant, single).stable
    rng = np.random.default_rng(0)
    turn = np.linalg.qr(rng.standard_normal((plant.nstates, plant.nstates)))[0]
    same = control.ss(
        turn @ plant.A @ turn.T,
        turn @ plant.B,
        plant.C @ turn.T,
        plant.D,
        inputs=plant.input_labels,
        outputs=plant.output_labels,
    )
    found = [bc.margins(one, single) for one in (plant, same)]
    assert found[1].stable
    np.testing.assert_allclose(found[0].loops[0].gain, found[1].loops[0].gain, rtol=1e-6)


# -- several poses, JSON ---------------------------------------------------------------------------
@pytest.mark.slow
def test_poses_give_one_result_each():
    turning = CRAFT.replace(
        '<site name="mount" pos="0.5 0 0.3"/>',
        '<body name="yoke" pos="0.5 0 0.3"><joint name="drive" axis="1 0 0" stiffness="1e5" '
        'damping="100"/><inertial pos="0 0 0" mass="4" diaginertia="0.2 0.2 0.2"/>'
        '<site name="mount"/></body>',
    )
    made = bc.embed(turning, {"mount": BOOM.replace(modes=1)})
    scheduled = bc.plant(made, ["torque:bus"], ["attitude"], pose={"drive": [0.0, np.pi / 2.0]})
    found = bc.margins(scheduled, each(LAG))
    assert [one.pose for one in found] == ["drive 0°", "drive 90°"]
    # turned by 90 degrees the bending planes change places: the least margins are not the same
    assert abs(found[0].loops[0].gain / found[1].loops[0].gain - 1.0) > 1e-2
    for one, single in zip(found, scheduled.plants, strict=True):
        np.testing.assert_allclose(one.loops[1].gain, bc.margins(single, each(LAG)).loops[1].gain)


def test_the_record_holds_the_figures(plant):
    found = bc.margins(plant, each(LAG))
    record = found.as_dict()
    assert record["all_at_once"]["value"] == found.all_at_once.value
    assert record["loops"][0]["gain_db"] == 20.0 * np.log10(found.loops[0].gain)
    assert record["loops"][0]["lowest_gain_db"] is None
    assert record["instabilities"] == []
    head, row = found.table.head, found.table.rows[0]
    gain = f"{found.loops[0].gain_db:.3g} ({found.loops[0].gain_frequency:.3g})"
    assert row[head.index("gain, dB (at rad/s)")] == gain
    assert "peak of S (at rad/s)" in found._repr_html_()


@pytest.mark.slow
def test_the_command_says_why(embedded, tmp_path):
    """Of two loops the one with the wrong sign is to blame."""
    model = embedded.write(tmp_path / "flexible.xml")[-1]
    loops = [
        {
            "input": f"torque_{axis}",
            "output": f"attitude_{axis}",
            "numerator": [sign * 900.0, sign * 80.0],
            "denominator": [0.05, 1.0],
        }
        for axis, sign in zip(AXES, (1.0, -1.0), strict=True)
    ]
    answer = asked(model, loops, "--from", "torque:bus", "--to", "attitude")
    assert answer.status == 3
    right, wrong = answer.record["margins"][0]
    assert (right["causes"], right["instabilities"]) == (False, [])
    assert wrong["causes"]
    said = wrong["instabilities"][0]
    assert (said["origin"], said["kind"], said["alone"]) == (
        "attitude_z",
        "rigid",
        {"torque_z": 0.0},
    )
    (closed,) = answer.record["closed_loops"]
    assert closed["stable"] is False
    assert closed["instabilities"][0] == said


# -- mistakes in files and on the command line -----------------------------------------------------
LOOP_TEXT = """[[loop]]
input = "torque_z"
output = "attitude_z"
numerator = [80.0]
denominator = [0.05, 1.0]
"""


def test_continuous_loops_of_a_file_on_a_sampled_plant_are_told(stepped, embedded, tmp_path):
    """A file cannot be sampled: on the command line the option is left out."""
    path = tmp_path / "loops.toml"
    path.write_text(LOOP_TEXT)
    model = embedded.write(tmp_path / "flexible.xml")[-1]
    words = ["plant", model, "--controller", path, "--discrete", STEP, "-o", tmp_path / "p.npz"]
    told = call(*words)
    assert told.status == 2
    said = " ".join(told.err.split())
    assert "leave --discrete out" in said
    assert "bc.margins" in said
    assert not (tmp_path / "p.npz").exists()
