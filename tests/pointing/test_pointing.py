"""Pointing budgets against closed forms: a mode under a harmonic sweep, whirl, noise through an
oscillator, a staircase, a load that rises exponentially; and the rules by which sources add up.

The craft are so small that their equations stand here.
"""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar

import beamchain as bc
from beamchain import pointing

CLOSED = 1e-6  # of a peak against its closed form, as demanded
EXACT = 1e-9  # of a response at a given speed
INTEGRAL = 1e-7  # of a variance: intervals of ten nodes
SAMPLED = 1e-4  # of what is read off samples of a period or a run, both here and there

# two bodies on one axis, a spring between them, a wheel beside the axis
HUB, PANEL, SPRING, DAMPING = 12.0, 3.0, 300.0, 0.4
WHEEL, ARM = 2.0, 0.3  # its mass [kg] and distance from the axis [m]
ONE_MODE = f"""<mujoco><worldbody><body name="hub"><joint name="turn" axis="0 0 1"/>
<inertial pos="0 0 0" mass="9" diaginertia="{HUB} {HUB} {HUB}"/>
<body name="wheel" pos="{ARM} 0 0"><joint name="spin" axis="0 0 1"/>
<inertial pos="0 0 0" mass="{WHEEL}" diaginertia="0.01 0.01 0.02"/></body>
<body name="panel"><joint name="arm_hinge1_xy" axis="0 0 1" stiffness="{SPRING}"
damping="{DAMPING}"/><inertial pos="0 0 0" mass="1" diaginertia="{PANEL} {PANEL} {PANEL}"/>
<site name="arm_tip" pos="2 0 0"/></body></body></worldbody></mujoco>"""
J1 = HUB + WHEEL * ARM**2

# a wheel on a mount that rocks about x and y
MOUNT, ACROSS, ALONG = 0.4, 0.03, 0.05
ROCK, ROCK_DAMPING = 900.0, 0.12
WHIRL = f"""<mujoco><worldbody><body name="mount"><joint name="x" axis="1 0 0" stiffness="{ROCK}"
damping="{ROCK_DAMPING}"/><joint name="y" axis="0 1 0" stiffness="{ROCK}"
damping="{ROCK_DAMPING}"/><inertial pos="0 0 0" mass="1" diaginertia="{MOUNT} {MOUNT} {MOUNT}"/>
<body name="wheel"><joint name="spin" axis="0 0 1"/>
<inertial pos="0 0 0" mass="2" diaginertia="{ACROSS} {ACROSS} {ALONG}"/></body></body></worldbody>
<sensor><jointpos name="rock_x" joint="x"/><jointpos name="rock_y" joint="y"/></sensor></mujoco>"""

# one oscillator
INERTIA, K, C = 2.0, 50.0, 0.1
OMEGA = np.sqrt(K / INERTIA)
OSCILLATOR = f"""<mujoco><worldbody><body name="hub"><joint name="turn" axis="0 0 1"
stiffness="{K}" damping="{C}"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 {INERTIA}"/></body>
</worldbody></mujoco>"""


def z_only(**sources):
    """Disturbances, and the one output of these craft."""
    return pointing.Disturbances(**sources), ["attitude"]


def hub_angle(omega):
    """Angle of the hub per torque on it, two inertias with a spring between them."""
    s = 1j * omega
    spring = DAMPING * s + SPRING
    return (PANEL * s**2 + spring) / (s**2 * (J1 * PANEL * s**2 + (J1 + PANEL) * spring))


# -- wheels ----------------------------------------------------------------------------------------
def test_one_mode_under_a_harmonic_sweep():
    static, orders = 2e-6, (1.0, 2.82)
    wheel = pointing.WheelDisturbance(
        joint="spin",
        speeds=(2.0, 30.0),
        static=static,
        harmonic=(pointing.WheelHarmonic(order=orders[1], radial_force=3e-7, radial_torque=1e-7),),
    )
    budget = pointing.budget(ONE_MODE, *z_only(wheel=(wheel,)), window=0.7)
    curve = budget.sources[0].curve

    def peak(speed):
        # a radial torque has no component about this axis
        return (speed**2 * ARM) * (
            static * abs(hub_angle(speed)) + 3e-7 * abs(hub_angle(orders[1] * speed))
        )

    assert np.allclose(curve.ape_peak[:, 2], peak(curve.speed), rtol=EXACT, atol=0.0)
    resonance = np.sqrt(SPRING * (1.0 / J1 + 1.0 / PANEL))
    top = max(
        -minimize_scalar(
            lambda w: -peak(w),
            bounds=(0.98 * w, 1.02 * w),
            method="bounded",
            options={"xatol": 1e-9},
        ).fun
        for w in (resonance, resonance / orders[1])
    )
    assert abs(budget.ape.peak[2] / top - 1.0) < CLOSED
    assert abs(budget.sources[0].speed[2] / resonance - 1.0) < 0.01
    assert budget.worst[2].mode == "arm_mode1_xy"
    assert budget.ape.peak[0] < EXACT * top


@pytest.mark.parametrize("ratio", [1e-5, 1e-3])
def test_a_narrow_resonance_is_not_missed(ratio):
    """Between two speeds, far from both."""
    resonance = np.sqrt(SPRING * (1.0 / J1 + 1.0 / PANEL))
    damping = 2.0 * ratio * SPRING / resonance
    wheel = pointing.WheelDisturbance(joint="spin", speeds=(0.5, 700.0), static=1e-6, count=2)
    craft = ONE_MODE.replace(f'damping="{DAMPING}"', f'damping="{damping:.17g}"')
    budget = pointing.budget(craft, *z_only(wheel=(wheel,)))

    def size(w):
        spring = 1j * damping * w + SPRING
        below = -(w**2) * (-J1 * PANEL * w**2 + (J1 + PANEL) * spring)
        return 1e-6 * ARM * w**2 * abs((spring - PANEL * w**2) / below)

    near = resonance * (1.0 + ratio * np.linspace(-0.02, 0.02, 2001))
    assert abs(budget.ape.peak[2] / size(near).max() - 1.0) < CLOSED


def test_a_run_in_mujoco_measures_every_order_at_the_worst_speed():
    """A wheel that turns backwards, two orders, a mode damped to a fifth."""
    damping = 10.0
    wheel = pointing.WheelDisturbance(
        joint="spin",
        speeds=(-14.0, -9.0),
        static=2e-6,
        harmonic=(pointing.WheelHarmonic(order=1.6, radial_force=3e-7),),
    )
    craft = ONE_MODE.replace(f'damping="{DAMPING}"', f'damping="{damping}"')
    budget = pointing.budget(craft, *z_only(wheel=(wheel,)))
    run = budget.simulate()
    assert (run.source, run.output, run.speed) == (
        "wheel spin",
        "attitude_z",
        budget["wheel spin"].speed[2],
    )
    s = 1j * np.array([1.0, 1.6]) * abs(run.speed)
    spring = damping * s + SPRING
    angle = (PANEL * s**2 + spring) / (s**2 * (J1 * PANEL * s**2 + (J1 + PANEL) * spring))
    wanted = run.speed**2 * ARM * np.array([2e-6, 3e-7]) * np.abs(angle)
    stated, found = np.transpose(run.orders)
    np.testing.assert_allclose(stated, wanted, rtol=EXACT)
    np.testing.assert_allclose(found, wanted, rtol=5e-3)  # exp(-5) of the start is left
    assert run.stated == budget.ape.peak[2]
    np.testing.assert_allclose([run.stated, run.simulated], [wanted.sum(), sum(found)], rtol=CLOSED)
    assert run.times[0] > 5.0 * 2.0 / (damping * (1.0 / J1 + 1.0 / PANEL))


@pytest.mark.slow
def test_rms_and_window_of_harmonics():
    window = 0.7
    wheel = pointing.WheelDisturbance(
        joint="spin",
        speeds=(7.0, 7.0),
        static=2e-6,
        harmonic=(pointing.WheelHarmonic(order=2.5, radial_force=3e-7),),
    )
    budget = pointing.budget(ONE_MODE, *z_only(wheel=(wheel,)), window=window)
    omega = np.array([7.0, 17.5])
    size = 7.0**2 * ARM * np.array([2e-6, 3e-7]) * np.abs(hub_angle(omega))
    # by brute force: every instant of every window of a long record of both sines
    phase = np.linspace(0.0, 2.0 * np.pi, 721)
    inside = np.linspace(-window / 2.0, window / 2.0, 2001)
    squares, largest = 0.0, 0.0
    for w, a in zip(omega, size, strict=True):
        values = a * np.cos(phase[:, None] + w * inside)
        mean = np.trapezoid(values, inside, axis=1) / window
        deviation = values - mean[:, None]
        squares += np.mean(np.trapezoid(deviation[:-1] ** 2, inside, axis=1)) / window
        largest += np.abs(deviation).max()
    assert np.allclose(budget.ape.rms[2], np.sqrt((size**2).sum() / 2.0), rtol=EXACT)
    assert np.allclose(budget.rpe.rms[2], np.sqrt(squares), rtol=SAMPLED)
    assert np.allclose(budget.rpe.peak[2], largest, rtol=SAMPLED)


def test_axial_force_acts_along_the_axis():
    tilted = ONE_MODE.replace('name="spin" axis="0 0 1"', 'name="spin" axis="0 1 0"').replace(
        'diaginertia="0.01 0.01 0.02"', 'diaginertia="0.01 0.02 0.01"'
    )
    harmonic = pointing.WheelHarmonic(order=1.0, axial_force=1e-6)
    wheel = pointing.WheelDisturbance(joint="spin", speeds=(9.0, 9.0), harmonic=(harmonic,))
    budget = pointing.budget(tilted, *z_only(wheel=(wheel,)))
    # the wheel's moment of inertia across is the hub's now
    s = 9.0j
    spring = DAMPING * s + SPRING
    j1 = J1 + 0.01
    angle = (PANEL * s**2 + spring) / (s**2 * (j1 * PANEL * s**2 + (j1 + PANEL) * spring))
    assert np.allclose(budget.ape.peak[2], 1e-6 * 81.0 * ARM * abs(angle), rtol=EXACT)


def whirl(order, speed, torque):
    """`x + j y` of the mount under a torque that turns: A z'' + (c - j C Omega) z' + k z."""
    across = MOUNT + ACROSS
    omega = order * speed
    return (
        torque
        * speed**2
        / (ROCK - across * omega**2 + 1j * ROCK_DAMPING * omega + ALONG * speed * omega)
    )


@pytest.mark.parametrize(("order", "direction"), [(1.0, 1.0), (2.0, 1.0), (0.6, -1.0)])
def test_whirl_moves_resonances_with_the_speed(order, direction):
    torque = 3e-7
    harmonic = pointing.WheelHarmonic(order=order, radial_torque=torque)
    speeds = (1.0, 200.0) if direction > 0.0 else (-200.0, -1.0)
    wheel = pointing.WheelDisturbance(joint="spin", speeds=speeds, harmonic=(harmonic,), count=50)
    budget = pointing.budget(WHIRL, pointing.Disturbances(wheel=(wheel,)), ["rock_x", "rock_y"])
    curve = budget.sources[0].curve
    expected = np.abs(whirl(order, np.abs(curve.speed), torque))
    for output in (0, 1):
        assert np.allclose(curve.ape_peak[:, output], expected, rtol=1e-8, atol=0.0)
    resonance = np.sqrt(ROCK / (order**2 * (MOUNT + ACROSS) - order * ALONG))
    top = -minimize_scalar(
        lambda w: -abs(whirl(order, w, torque)),
        bounds=(0.99 * resonance, 1.01 * resonance),
        method="bounded",
        options={"xatol": 1e-10},
    ).fun
    assert abs(budget.ape.peak[0] / top - 1.0) < CLOSED
    assert np.sign(budget.sources[0].speed[0]) == direction
    # without gyroscopic moments the resonance would be elsewhere, by several half widths
    still = np.sqrt(ROCK / (order**2 * (MOUNT + ACROSS)))
    half_width = ROCK_DAMPING / (2.0 * (MOUNT + ACROSS)) / order
    assert abs(still - resonance) > 5.0 * half_width


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_run_in_mujoco_whirls_with_its_wheel(direction):
    """The mount is stiffer against what turns with the wheel than against what turns the other
    way, at 40 rad/s by an eighth of what is left of its stiffness."""
    damping, speed = 3.0, 40.0
    craft = WHIRL.replace(f'damping="{ROCK_DAMPING}"', f'damping="{damping}"')
    speeds = (direction * speed, direction * speed)
    wheel = pointing.WheelDisturbance(joint="spin", speeds=speeds, dynamic=1e-6)
    budget = pointing.budget(craft, pointing.Disturbances(wheel=(wheel,)), ["rock_x", "rock_y"])
    run = budget.simulate()
    across = MOUNT + ACROSS
    left = ROCK - (across - ALONG) * speed**2 + 1j * damping * speed
    assert (run.speed, run.output[:-1]) == (direction * speed, "rock_")
    np.testing.assert_allclose(run.stated, 1e-6 * speed**2 / abs(left), rtol=1e-8)
    np.testing.assert_allclose(run.simulated, run.stated, rtol=0.01)


def test_a_wheel_is_swept_while_another_turns():
    """A second wheel at a steady speed bears the moments that it has at that speed."""
    twin = WHIRL.replace(
        "</body></body></worldbody>",
        '</body><body name="other"><joint name="idle" axis="0 0 1"/><inertial pos="0 0 0" mass="2" '
        f'diaginertia="{ACROSS} {ACROSS} {ALONG}"/></body></body></worldbody>',
    )
    wheel = pointing.WheelDisturbance(joint="spin", speeds=(30.0, 30.0), dynamic=1e-6)
    for idle in (0.0, 80.0, -80.0):
        budget = pointing.budget(
            twin,
            pointing.Disturbances(wheel=(wheel,)),
            ["rock_x"],
            rates={"idle": idle, "spin": 7.0},
        )
        across = MOUNT + 2.0 * ACROSS
        stiffness = ROCK - across * 900.0 + 1j * ROCK_DAMPING * 30.0 + ALONG * (30.0 + idle) * 30.0
        assert np.allclose(budget.ape.peak[0], 1e-6 * 900.0 / abs(stiffness), rtol=1e-8)


def test_shares_of_modes_are_their_partial_fractions():
    wheel = pointing.WheelDisturbance(joint="spin", speeds=(5.0, 5.0), static=1e-6)
    shares = pointing.budget(ONE_MODE, *z_only(wheel=(wheel,))).sources[0].shares[2]
    # rigid motion has 1/((J1 + J2) s^2), the mode the rest
    whole = hub_angle(5.0)
    rigid = 1.0 / ((J1 + PANEL) * (5.0j) ** 2)
    assert np.isclose(shares["rigid motion"], (rigid / whole).real, rtol=1e-8)
    assert np.isclose(shares["arm_mode1_xy"], (1.0 - rigid / whole).real, rtol=1e-8)


# -- random inputs ---------------------------------------------------------------------------------
def gain(omega):
    return 1.0 / abs(K - INERTIA * omega**2 + 1j * C * omega)


def test_white_noise_through_an_oscillator():
    density = 4e-6
    noise = pointing.NoiseDisturbance(
        input="torque:hub", frequency=(1e-8, 1e4), density=(density, density), signals=("torque_z",)
    )
    window = 0.9
    budget = pointing.budget(OSCILLATOR, *z_only(psd=(noise,)), window=window)
    variance = density / (4.0 * C * K)
    assert np.isclose(budget.ape.rms[2] ** 2, variance, rtol=INTEGRAL)
    assert np.isclose(budget.ape.peak[2], 3.0 * np.sqrt(variance), rtol=INTEGRAL)
    # what the mean over the window keeps, by the autocorrelation
    zeta = C / (2.0 * np.sqrt(K * INERTIA))
    damped = OMEGA * np.sqrt(1.0 - zeta**2)

    def correlation(t):
        ring = np.cos(damped * t) + zeta / np.sqrt(1.0 - zeta**2) * np.sin(damped * t)
        return np.exp(-zeta * OMEGA * t) * ring

    kept = quad(lambda t: (window - t) * correlation(t), 0.0, window)[0] * 2.0 / window**2
    assert np.isclose(budget.rpe.rms[2] ** 2, variance * (1.0 - kept), rtol=1e-6)


def test_a_density_is_straight_in_logarithms():
    noise = pointing.NoiseDisturbance(
        input="torque:hub", frequency=(0.1, 0.5, 7.0), density=(1e-6, 8e-6, 2e-9)
    )
    budget = pointing.budget(OSCILLATOR, *z_only(psd=(noise,)))

    def power(f):
        first = 1e-6 * (f / 0.1) ** (np.log(8.0) / np.log(5.0))
        second = 8e-6 * (f / 0.5) ** (np.log(2e-9 / 8e-6) / np.log(14.0))
        return (first if f < 0.5 else second) * gain(2.0 * np.pi * f) ** 2

    points = [0.5, *(OMEGA / (2.0 * np.pi) * np.array([0.97, 1.0, 1.03]))]
    expected = quad(power, 0.1, 7.0, points=points, limit=400, epsabs=0.0, epsrel=1e-10)[0]
    assert np.isclose(budget.ape.rms[2] ** 2, expected, rtol=INTEGRAL)


# -- stepping drives -------------------------------------------------------------------------------
STEP, RATE = 1e-3, 3.1


def periodic_truth(load, slope, breaks):
    """A period of the oscillator's steady motion under a torque that is linear between breaks:
    `load` and `slope` at the beginning of each piece."""
    a = np.array([[0.0, 1.0], [-K / INERTIA, -C / INERTIA]])
    both = np.zeros((4, 4))  # over (x, x', torque, slope)
    both[:2, :2] = a
    both[1, 2] = 1.0 / INERTIA
    both[2, 3] = 1.0
    whole, forced = np.eye(2), np.zeros(2)
    for i, length in enumerate(np.diff(breaks)):
        step = expm(both * length)
        forced = step[:2, :2] @ forced + step[:2, 2:] @ [load[i], slope[i]]
        whole = step[:2, :2] @ whole
    state = np.linalg.solve(np.eye(2) - whole, forced)
    out = []
    for i, length in enumerate(np.diff(breaks)):
        count = round(length * RATE * 40_000)
        step = expm(both * length / count)
        now = np.concatenate([state, [load[i], slope[i]]])
        for _ in range(count):
            out.append(now[0])
            now = step @ now
        state = now[:2]
    return np.array(out)


def by_brute_force(values, window):
    """APE and RPE, rms and peak, of samples of a period."""
    n = values.size
    half = round(window * RATE * n / 2.0)
    long = np.tile(values, 2 * (half // n) + 3)
    total = np.concatenate([[0.0], np.cumsum((long[1:] + long[:-1]) / 2.0)])
    start = n * (half // n + 1)
    middle = np.arange(start, start + n)
    mean = (total[middle + half] - total[middle - half]) / (2 * half)
    largest, squares = 0.0, 0.0
    for shift in np.linspace(-half, half, 401).astype(int):
        off = long[middle + shift] - mean
        largest = max(largest, np.abs(off).max())
        squares += np.mean(off**2) / 401
    return np.sqrt(np.mean(values**2)), np.abs(values).max(), np.sqrt(squares), largest


@pytest.mark.parametrize("window", [0.05, 0.6])
def test_a_staircase_through_a_spring(window):
    drive = pointing.StepperDisturbance(joint="turn", step=STEP, rate=RATE)
    budget = pointing.budget(OSCILLATOR, *z_only(stepper=(drive,)), window=window)
    values = periodic_truth([K * STEP / 2.0], [-K * STEP * RATE], [0.0, 1.0 / RATE])
    rms, peak, rpe_rms, rpe_peak = by_brute_force(values, window)
    assert np.isclose(budget.ape.rms[2], rms, rtol=1e-7)
    assert np.isclose(budget.ape.peak[2], peak, rtol=CLOSED)
    assert np.isclose(budget.rpe.rms[2], rpe_rms, rtol=1e-2)  # by 401 instants of a window
    assert np.isclose(budget.rpe.peak[2], rpe_peak, rtol=5e-3)


def test_a_position_servo_takes_the_place_of_the_spring():
    servo = OSCILLATOR.replace(
        "</worldbody>",
        f'</worldbody><actuator><position name="sada" joint="turn" kp="{K}"/></actuator>',
    ).replace(f'stiffness="{K}"', "")
    drive = pointing.StepperDisturbance(joint="turn", step=STEP, rate=RATE)
    ours = pointing.budget(servo, *z_only(stepper=(drive,)))
    other = pointing.budget(OSCILLATOR, *z_only(stepper=(drive,)))
    assert np.allclose(ours.ape.peak, other.ape.peak, rtol=1e-9, atol=1e-18)


def test_pulses_of_torque():
    torque, width = 0.02, 0.08
    drive = pointing.StepperDisturbance(joint="turn", torque=torque, width=width, rate=RATE)
    budget = pointing.budget(OSCILLATOR, *z_only(stepper=(drive,)), window=0.6)
    mean = torque * width * RATE
    values = periodic_truth([torque - mean, -mean], [0.0, 0.0], [0.0, width, 1.0 / RATE])
    rms, peak, _, rpe_peak = by_brute_force(values, 0.6)
    assert np.isclose(budget.ape.rms[2], rms, rtol=SAMPLED)
    assert np.isclose(budget.ape.peak[2], peak, rtol=CLOSED)
    assert np.isclose(budget.rpe.peak[2], rpe_peak, rtol=5e-3)


# -- thermal snap ----------------------------------------------------------------------------------
def snap_angle(t, moment, tau):
    """Angle of the hub under a moment `M (1 - exp(-t/tau))` in the hinge, in closed form."""
    reduced = J1 * PANEL / (J1 + PANEL)
    w2, decay = SPRING / reduced, DAMPING / (2.0 * reduced)
    damped = np.sqrt(w2 - decay**2)
    q = -1.0 / tau
    # y'' + 2 d y' + w^2 y = m (1 - exp(q t)): steady, with q, and ringing
    m = moment / reduced
    with_q = -m / (q**2 + 2.0 * decay * q + w2)
    cosine = -(m / w2 + with_q)
    sine = (decay * cosine - q * with_q) / damped
    ringing = np.exp(-decay * t) * (cosine * np.cos(damped * t) + sine * np.sin(damped * t))
    return -PANEL / (J1 + PANEL) * (m / w2 + with_q * np.exp(q * t) + ringing)


@pytest.mark.parametrize("tau", [0.02, 0.5, 6.0])
@pytest.mark.slow
def test_a_load_that_rises_exponentially(tau):
    moment, window = 0.2, 0.4
    snap = pointing.ThermalSnap(appendage="arm_", moment=moment, time_constant=tau)
    budget = pointing.budget(ONE_MODE, *z_only(snap=(snap,)), window=window)
    t = np.linspace(0.0, 8.0 * tau + 10.0, 400_001)
    values = snap_angle(t, moment, tau)
    assert np.isclose(budget.ape.peak[2], np.abs(values).max(), rtol=CLOSED)
    assert np.isnan(budget.ape.rms[2])
    half = round(window / (t[1] - t[0]) / 2.0)
    long = np.concatenate([np.zeros(2 * half), values])
    total = np.concatenate([[0.0], np.cumsum((long[1:] + long[:-1]) / 2.0)])
    middle = np.arange(half, long.size - half)
    mean = (total[middle + half] - total[middle - half]) / (2 * half)
    largest = max(
        np.abs(long[middle + shift] - mean).max()
        for shift in np.linspace(-half, half, 41).astype(int)
    )
    assert np.isclose(budget.rpe.peak[2], largest, rtol=5.0 * SAMPLED)


def test_the_displacement_of_the_tip_is_that_of_the_load():
    displacement = pointing.ThermalSnap(appendage="arm_", displacement=0.01, time_constant=0.5)
    moment = pointing.ThermalSnap(appendage="arm_", moment=SPRING * 0.01 / 2.0, time_constant=0.5)
    one, other = (
        pointing.budget(ONE_MODE, *z_only(snap=(snap,))).ape.peak for snap in (displacement, moment)
    )
    assert np.allclose(one, other, rtol=1e-9, atol=1e-15)


TIP_MASS, LONG, BEND, PER_LENGTH = 0.5, 5.0, 900.0, 1.1
BUS = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="140" diaginertia="60 45 80"/><site name="mount" pos=".5 0 0"/></body>
</worldbody></mujoco>"""


def turned_by_the_first_mode(displacement):
    """Angle of a free bus at rest with a beam bent in its first mode, in closed form: neither
    momentum nor angular momentum has changed."""

    def end_force(b):  # of a cantilever with a body at its tip
        ratio = TIP_MASS / PER_LENGTH / LONG
        return (
            1
            + np.cos(b) * np.cosh(b)
            + ratio * b * (np.cos(b) * np.sinh(b) - np.sin(b) * np.cosh(b))
        )

    b = brentq(end_force, 0.5, 2.5)
    part = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))

    def shape(x):
        z = b * x / LONG
        return np.cosh(z) - np.cos(z) - part * (np.sinh(z) - np.sin(z))

    def over_mass(f):
        return PER_LENGTH * quad(f, 0.0, LONG)[0] + TIP_MASS * f(LONG)

    def reach(x):
        return 0.5 + x

    bent = displacement / shape(LONG)
    first = over_mass(reach)
    mass = np.array([[140 + over_mass(lambda _: 1.0), first], [first, 80]])
    mass[1, 1] += over_mass(lambda x: reach(x) ** 2)
    moved = [over_mass(shape), over_mass(lambda x: reach(x) * shape(x))]
    return -bent * np.linalg.solve(mass, moved)[1]


@pytest.mark.slow
def test_the_displacement_is_that_of_the_beams_tip_with_three_modes_kept(tmp_path):
    snap = pointing.ThermalSnap(appendage="boom_", displacement=2e-3, time_constant=60.0)
    section = bc.Equivalent(bending_stiffness_xy=BEND, linear_mass=PER_LENGTH)
    boom = bc.Spec(
        name="boom",
        segment=(bc.Segment(length=LONG, section=section),),
        lump=(bc.Lump(x=LONG, mass=TIP_MASS),),
        damping=bc.Damping(ratio=0.005),
        modes=bc.Modes(xy=3, xz=0),
    )
    file = bc.embed(BUS, {"mount": boom}, retime=False).write(tmp_path / "flexible.xml")[-1]
    peak = pointing.budget(file, *z_only(snap=(snap,))).ape.peak[2]
    assert peak == pytest.approx(abs(turned_by_the_first_mode(2e-3)), rel=1e-4)


# -- all together ----------------------------------------------------------------------------------
@pytest.mark.slow
def test_sources_add_up():
    wheel = pointing.WheelDisturbance(joint="spin", speeds=(5.0, 9.0), static=1e-5)
    noise = pointing.NoiseDisturbance(
        input="torque:hub", frequency=(1.0, 5.0), density=(1e-8, 1e-8)
    )
    snap = pointing.ThermalSnap(appendage="arm_", moment=1e-3, time_constant=0.5)
    budget = pointing.budget(
        ONE_MODE,
        pointing.Disturbances(wheel=(wheel,), psd=(noise, noise), snap=(snap,)),
        window=0.2,
    )
    names = [source.name for source in budget.sources]
    assert names == ["wheel spin", "psd torque:hub 1", "psd torque:hub 2", "snap arm_"]
    peaks = [source.ape.peak[2] for source in budget.sources]
    rms = [source.ape.rms[2] for source in budget.sources]
    assert np.isclose(budget.ape.rms[2], np.sqrt(rms[0] ** 2 + 2.0 * rms[1] ** 2))
    assert np.isclose(budget.ape.peak[2], peaks[0] + 3.0 * np.sqrt(2.0) * rms[1] + peaks[3])
    rows = budget.table.records()
    assert [row["source"] for row in rows[-3:]] == ["all"] * 3
    assert rows[-1]["ape_peak"] == budget.ape.peak[2]
    assert budget.as_dict()["budget"] == rows
    assert "Pointing budget" in budget._repr_html_()
    assert len(budget.plot().lines) == 2  # the curve and the dot at its top
