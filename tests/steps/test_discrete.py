"""One step of a mode, per integrator: what `bc.retime` writes into the tendon of an oscillator
alone, against the exact motion.

Every mode stands on a slide of 1 kg of its own, held by the world, so that nothing couples it; its
armature and damping are read from the compiled model, and its poles come from the step written out
by hand, which MuJoCo's own step is held against.
"""

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

import beamchain as bc
from mechanics import INTEGRATORS, first, mass_matrix, step_matrix
from modal_crafts import craft

ANGLES = np.array([1e-4, 1e-2, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 2.5])
RATIOS = (0.0, 0.001, 0.005, 0.02, 0.1, 0.5, 1.0, 1.5)
PHASE = 2.6  # rad per step to which faster modes are slowed: docs/time.md
SEMI_IMPLICIT = ["Euler", "implicit", "implicitfast"]
DIFFERENCED = 1e-9  # of a step's matrix: MuJoCo's centred differences
LARGE = 1e-2  # their perturbation; the oscillators are linear


def oscillators(frequency, ratio, timestep):
    """A model of independent modes [rad/s], each a sprung tendon on a slide of 1 kg."""
    bodies = tendons = ""
    for i, w in enumerate(np.atleast_1d(frequency)):
        bodies += (
            f'<body><joint name="slide{i}" type="slide" axis="1 0 0"/>'
            '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
        )
        tendons += (
            f'<fixed name="part{i}_mode1_xy" limited="false" stiffness="{float(w**2)!r}" '
            f'damping="{float(2.0 * ratio * w)!r}"><joint joint="slide{i}" coef="1"/></fixed>'
        )
    text = (
        '<mujoco><option gravity="0 0 0" '
        f'timestep="{float(timestep)!r}"/><worldbody>{bodies}</worldbody>'
    )
    return mujoco.MjModel.from_xml_string(f"{text}<tendon>{tendons}</tendon></mujoco>")


class Timed:
    """Modes made exact in time: mass `m'` `(n,)` in units of the modal mass, damping `c'` [1/s],
    and what was said of them."""

    def __init__(self, integrator, frequency, ratio, timestep):
        self.model = oscillators(frequency, ratio, timestep)
        self.model.opt.integrator = INTEGRATORS[integrator]
        done = bc.retime(self.model, timestep, integrator)
        self.mass = 1.0 + np.array(self.model.tendon_armature)
        self.damping = first(self.model.tendon_damping).copy()
        self.slowed = np.array([mode.slowed for mode in done.modes])
        self.clamped = np.array([mode.clamped for mode in done.modes])
        assert done.phase == (2.0 if integrator == "RK4" else PHASE)  # none was lowered


def continuous_pole(frequency, ratio):
    """The pole [1/s] with the positive imaginary part, or the slower of two real ones."""
    return np.asarray(frequency) * (np.sqrt(complex(ratio**2 - 1.0)) - ratio)


def wanted_pole(frequency, ratio, h):
    return np.exp(continuous_pole(frequency, ratio) * h)


def step_by_hand(integrator, m, c, k, h):
    """The (2, 2) map of (q, v) of one step, written out as the integrators take it;
    spring and damper on a tendon."""
    if integrator == "RK4":
        f = np.array([[0.0, 1.0], [-k / m, -c / m]]) * h
        return np.eye(2) + f + f @ f / 2 + f @ f @ f / 6 + f @ f @ f @ f / 24
    if integrator == "Euler":
        pull, keep = h * k / m, 1 - h * c / m
    elif integrator == "discrete":
        pull = h * k / (m + h * c + h**2 * k)
        keep = m / (m + h * c)
    else:
        pull = h * k / (m + h * c)
        keep = m / (m + h * c)
    return np.array([[1 - h * pull, h * keep], [-pull, keep]])


def step_pole(integrator, m, c, k, h):
    """Its pole in the upper half plane, or the larger one if both are real; `z - 1` is solved for,
    to keep small steps' digits.

    Semi-implicit: `u^2 + (p + r) u + p = 0` with `p = h^2 k / n`, `r = h c / n`;
    `n = m` (Euler) or `m + h c`.
    """
    m, c, k = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (m, c, k)))
    if integrator == "RK4":
        out = [
            np.linalg.eigvals(step_by_hand("RK4", *one, h))
            for one in zip(m.ravel(), c.ravel(), k.ravel(), strict=True)
        ]
        return np.array([z[np.argmax(np.abs(z))] for z in out]).reshape(m.shape)
    n = m if integrator == "Euler" else m + h * c
    p, r = h**2 * k / n, h * c / n
    root = np.sqrt(((p + r) ** 2 / 4.0 - p).astype(complex))
    half = 1.0 - (p + r) / 2.0
    return np.where((root.imag == 0.0) & (half < 0.0), half - root, half + root)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("ratio", [0.0, 0.01, 0.3])
def test_the_step_written_out_is_mujocos(integrator, ratio):
    h = 0.3
    w = np.array([0.05, 0.4, 1.1, 1.9]) / h
    model = oscillators(w, ratio, h)
    model.tendon_armature[:] = 0.7
    model.opt.integrator = INTEGRATORS[integrator]
    a = step_matrix(model, LARGE)
    n = w.size
    for i in range(n):
        want = step_by_hand(integrator, 1.7, 2.0 * ratio * w[i], w[i] ** 2, h)
        np.testing.assert_allclose(a[np.ix_([i, n + i], [i, n + i])], want, atol=DIFFERENCED)
        if integrator != "discrete":
            z = np.linalg.eigvals(want)
            z = z[np.argmax(z.imag)] if np.any(np.abs(z.imag) > 1e-12) else z[np.argmax(np.abs(z))]
            assert abs(step_pole(integrator, 1.7, 2.0 * ratio * w[i], w[i] ** 2, h) - z) < 1e-13


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("h", [1.0, 0.02])
def test_euler_is_exact_at_every_ratio(ratio, h):
    w = ANGLES / h
    got = Timed("Euler", w, ratio, h)
    fast = np.abs(w * (np.sqrt(complex(ratio**2 - 1.0)) + ratio)) * h < PHASE  # of the faster pole
    z = step_pole("Euler", got.mass, got.damping, w**2, h)
    loss = 1e-7 if ratio == 1.0 else 1e-14  # a double pole moves by the root of the rounding
    assert np.max(np.abs(z - wanted_pole(w, ratio, h))[fast]) < loss
    assert np.all(got.mass >= 1.0)
    assert np.all(got.slowed == ~fast)
    assert not np.any(got.clamped)


def test_undamped_mass_is_fox_and_goodwins():
    got = Timed("Euler", ANGLES, 0.0, 1.0).mass
    assert np.allclose(got, ANGLES**2 / (4 * np.sin(ANGLES / 2) ** 2), rtol=1e-13)
    small = ANGLES[:4]
    assert np.allclose(got[:4] - 1, small**2 / 12 + small**4 / 240, rtol=2e-4, atol=1e-15)
    assert np.array_equal(got, Timed("implicitfast", ANGLES, 0.0, 1.0).mass)


@pytest.mark.parametrize("ratio", [0.001, 0.01, 0.05, 0.1])
def test_implicit_is_exact_above_the_clamp_and_near_below(ratio):
    x = np.linspace(0.01, 2.5, 250)
    got = Timed("implicitfast", x, ratio, 1.0)
    z = step_pole("implicitfast", got.mass, got.damping, x**2, 1.0)
    want = wanted_pole(x, ratio, 1.0)
    error = np.abs(z - want) / x
    assert np.max(error[~got.clamped]) < 1e-13
    edge = x[got.clamped].max()
    assert edge == pytest.approx(12 * ratio, rel=0.25, abs=0.02)  # zeta > x/12
    plain = step_pole("implicitfast", 1.0, 2 * ratio * x, x**2, 1.0)
    assert np.all(error[got.clamped] <= 1.0001 * (np.abs(plain - want) / x)[got.clamped])
    assert np.max(error) < 2.0 * ratio**2


def test_slowed_modes_turn_by_the_limit_and_keep_their_static_response():
    x = np.array([2.7, 5.0, 41.0, 1e4])
    for integrator in ("Euler", "implicitfast"):
        for ratio in (0.0, 0.01, 0.1):
            got = Timed(integrator, x, ratio, 1.0)
            assert np.all(got.slowed)
            assert np.array_equal(first(got.model.tendon_stiffness), x**2)
            z = step_pole(integrator, got.mass, got.damping, x**2, 1.0)
            assert np.max(np.abs(z - wanted_pole(PHASE, ratio, 1.0))) < 1e-12
    assert Timed("Euler", 5.0, 0.0, 1.0).mass[0] == pytest.approx(
        25.0 / (4 * np.sin(1.3) ** 2), rel=1e-14
    )


def test_on_a_light_hub_they_turn_by_the_lower_limit():
    made = craft([("seed", 3, 0.0)], 0.1, 0.03)
    h = 20.0 / made.frequencies()[-1]
    model = made.model(h)
    done = bc.retime(model, h)
    assert done.phase < PHASE
    slowed = [mode.slowed for mode in done.modes]
    assert any(slowed)
    z = step_pole(
        "Euler",
        1.0 + model.tendon_armature,
        first(model.tendon_damping),
        first(model.tendon_stiffness),
        h,
    )
    assert np.max(np.abs(z - wanted_pole(done.phase, 0.0, 1.0))[slowed]) < 1e-12


def test_rk4_leaves_what_it_can_and_slows_the_rest():
    x = np.array([0.5, 1.9, 2.1, 8.0, 100.0])
    got = Timed("RK4", x, 0.02, 1.0)
    assert np.allclose(got.mass, [1.0, 1.0, 1.05**2, 16.0, 2500.0])
    assert np.array_equal(got.slowed, [False, False, True, True, True])
    for ratio in (0.0, 0.1, 0.7, 1.0, 3.0):
        model = oscillators(x, ratio, 1.0)
        bc.retime(model, 1.0, "RK4")
        z = step_pole("RK4", 1.0 + model.tendon_armature, first(model.tendon_damping), x**2, 1.0)
        assert np.all(np.abs(z) <= 1.0)


def test_discrete_is_left_alone():
    if "discrete" not in INTEGRATORS:
        pytest.skip("this MuJoCo has no `discrete` integrator")
    model = oscillators(ANGLES, 0.01, 1.0)
    done = bc.retime(model, 1.0, "discrete")
    assert np.array_equal(model.tendon_armature, np.zeros(ANGLES.size))
    assert np.allclose(first(model.tendon_damping), 0.02 * ANGLES)
    assert not any(mode.slowed for mode in done.modes)


@pytest.mark.parametrize("x", [0.1, 0.3, 0.5])
def test_the_armature_of_a_sprung_hinge_is_fourth_order(x):
    """A file made for its step with springs on its hinges: a chain of one hinge,
    whose mode turns by x in a step."""
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    beam = bc.Beam(segments=(bc.Segment(length=8.0, section=section),))
    w = bc.fit(beam, modes={"xy": 1}).target["xy"].frequencies[0]
    scene = bc.Scene(timestep=x / w, integrator="Euler")
    options = bc.spec.FitOptions(springs="hinges")
    model = mujoco.MjModel.from_xml_string(
        bc.fit(beam, modes={"xy": 1}, options=options, scene=scene).to_mjcf()
    )
    assert (model.nv, model.ntendon) == (1, 0)
    (k,), (more,) = first(model.jnt_stiffness), model.dof_armature
    own = mass_matrix(model)[0, 0] - more
    assert np.sqrt(k / own) == pytest.approx(w, rel=1e-9)
    assert more == pytest.approx(k * (x / w) ** 2 / 12.0, rel=1e-12)
    z = step_pole("Euler", own + more, 0.0, k, x / w)
    assert abs(abs(np.log(z)) / x - 1) == pytest.approx(x**4 / 480, rel=0.05)
    root6 = np.sqrt(6.0)
    for turn, stable in ((0.999 * root6, True), (1.001 * root6, False)):
        z = step_pole("Euler", 1 + turn**2 / 12, 0.0, turn**2, 1.0)
        assert bool(abs(z) <= 1 + 1e-12) is stable


@pytest.mark.parametrize("made_for", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("h", [0.1, 0.5, 1.0, 1.02])
def test_error_at_another_step(made_for, h):
    w = 0.8
    mass = Timed("Euler", w, 0.0, made_for).mass[0] if made_for else 1.0
    shown = abs(np.log(step_pole("Euler", mass, 0.0, w**2, h))) / h
    # sin(W h/2) = (h/h0) sin(w h0/2)
    rate = 2 * np.sin(w * made_for / 2) / made_for if made_for else w
    assert shown == pytest.approx(2 * np.arcsin(rate * h / 2) / h, rel=1e-12)
    assert shown / w - 1 == pytest.approx(w**2 * (h**2 - made_for**2) / 24, rel=0.1, abs=1e-12)


def test_a_file_with_slowed_modes_is_unstable_just_above_its_step():
    mass = Timed("Euler", 7.0, 0.0, 1.0).mass[0]
    assert abs(step_pole("Euler", mass, 0.0, 49.0, 1.037)) == pytest.approx(1.0, abs=1e-9)
    assert abs(step_pole("Euler", mass, 0.0, 49.0, 1.039)) > 1.01


@pytest.mark.parametrize(
    ("x", "ratio"), [(x, z) for z in (0.0, 0.005, 0.1) for x in (1e-9, 0.05, 0.6, 2.1)]
)
def test_a_mode_started_with_the_mean_rate_is_exact_at_every_sample(x, ratio):
    h, w = 0.25, x / 0.25
    got = Timed("Euler", w, ratio, h)
    step = step_by_hand("Euler", got.mass[0], got.damping[0], w**2, h)
    exact = expm(np.array([[0.0, 1.0], [-(w**2), -2 * ratio * w]]) * h)
    q0 = 0.7
    v0 = -0.4 * max(w, 1e-3)
    started = bc.start_velocity(got.model, np.array([q0]), np.array([v0]))[0]
    state = np.array([q0, started])
    truth = np.array([q0, v0])
    for _ in range(40):
        before = truth[0]
        state, truth = step @ state, exact @ truth
        assert state[0] == pytest.approx(truth[0], abs=3e-12)
        assert state[1] * h == pytest.approx(truth[0] - before, abs=3e-12)
    if ratio == 0.0 and x > 1e-3:
        assert started == pytest.approx((q0 * (1 - np.cos(x)) + v0 * np.sin(x) / w) / h)


def test_with_the_true_rate_the_error_is_a_tenth_of_the_amplitude():
    x, h = 0.79, 1.0
    got = Timed("Euler", x, 0.0, h)
    step = step_by_hand("Euler", got.mass[0], 0.0, x**2, h)
    state = np.array([1.0, 0.0])
    worst = 0.0
    for k in range(1, 60):
        state = step @ state
        worst = max(worst, abs(state[0] - np.cos(k * x)))
    assert 0.05 < worst < 0.5


def test_all_samples_exact_with_the_averaged_input():
    rng = np.random.default_rng(3)
    w = np.array([0.3, 2.0, 9.0])
    h = 0.25
    got = Timed("Euler", w, 0.0, h)
    assert not np.any(got.slowed)
    q = np.zeros(3)
    v = np.zeros(3)
    truth = np.zeros((3, 2))
    held = bc.HeldInput()
    torque = rng.normal(size=300)
    for u in torque:
        mean = held(u)
        v = v + h / got.mass * (mean - w**2 * q)
        q = q + h * v
        turned = np.stack([np.cos(w * h), np.sin(w * h)], axis=1)
        offset = truth[:, 0] - u / w**2
        truth = np.stack(
            [
                offset * turned[:, 0] + truth[:, 1] / w * turned[:, 1] + u / w**2,
                -offset * w * turned[:, 1] + truth[:, 1] * turned[:, 0],
            ],
            axis=1,
        )
        assert np.max(np.abs(q - truth[:, 0]) * w) < 1e-11


def test_held_input():
    held = bc.HeldInput()
    assert [float(held(u)) for u in (2.0, 2.0, 0.0, 0.0)] == [1.0, 2.0, 1.0, 0.0]
    held.reset()
    assert held(2.0) == 1.0
    started = bc.HeldInput(before=[1.0, 3.0])
    assert np.array_equal(started([3.0, 3.0]), [2.0, 3.0])
    started.reset()
    assert np.array_equal(started([1.0, 3.0]), [1.0, 3.0])
    mine = np.zeros(2)
    held = bc.HeldInput()
    held(mine)
    mine[:] = 9.0  # the caller's array may be used again
    assert np.array_equal(held(np.zeros(2)), [0.0, 0.0])
