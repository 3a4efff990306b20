"""Closed forms beside the limits of a step and the choice of the cheapest."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import brentq

from beamchain import PortModel
from beamchain.errors import EngineError
from formulas import (
    LinearModel,
    choose_step,
    coupled_limits,
    oscillating,
    oscillations,
    step_limits,
    unit_mass_of_port,
)

EVERY = ("Euler", "implicit", "implicitfast", "discrete", "RK4")
W, RATIO = np.array([5.0, 24.0]), np.array([0.0, 0.2])


def model(w=W, ratio=RATIO, **changed):
    """A rigid motion beside modes, all dampers on joints, all springs implicit in discrete."""
    stiffness = np.diag([0.0, *w**2])
    damping = np.diag([0.0, *(2.0 * ratio * w)])
    given = {"euler_damping": damping, "discrete_stiffness": stiffness} | changed
    return LinearModel(stiffness, damping, **given)


def series(x):
    return 1.0 + x + x**2 / 2.0 + x**3 / 6.0 + x**4 / 24.0


def test_rates_that_an_overdamped_mode_shows():
    """s^2 + 5 s + 4: implicit damping d of h = 0.1 is v' = (v - h k x) / (1 + h d)."""
    stiffness, damping = np.array([[4.0]]), np.array([[5.0]])
    made = LinearModel(stiffness, damping, damping, stiffness)
    drag = 1.0 + 0.1 * 5.0
    rate = np.array([-0.1 * 4.0 / drag, 1.0 / drag])
    z = np.linalg.eigvals([[1.0 + 0.1 * rate[0], 0.1 * rate[1]], rate])
    shown = np.sort(np.log(z.real) / 0.1)
    for wanted, order in (([-4.0, -1.0], [0, 1]), ([-1.0, -4.0], [1, 0])):
        found = made.shown("Euler", 0.1, np.array(wanted) + 0j)
        assert found == pytest.approx(shown[order], rel=1e-9)


def test_limits_of_a_rigid_motion_and_two_modes():
    found = step_limits(model())
    assert found.omega_max == pytest.approx(24.0)
    assert found.ratio == pytest.approx(0.2)
    # 4 + 4 ratio x - x^2 = 0 where dampers are implicit
    semi = 2.0 * (np.sqrt(1.04) + 0.2) / 24.0
    pole = 24.0 * complex(-0.2, np.sqrt(0.96))
    explicit = brentq(lambda h: abs(series(h * pole)) - 1.0, 0.08, 0.2)
    # the undamped mode: |exp(i x) to fourth order| = 1 at sqrt(8)
    explicit = min(explicit, np.sqrt(8.0) / 5.0)
    for name in EVERY:
        wanted = {"discrete": np.inf, "RK4": explicit}.get(name, semi)
        assert found.largest_step[name] == pytest.approx(wanted, rel=1e-8)
    for error, step in zip((1e-2, 1e-3), found.accuracy["Euler"], strict=True):
        # 2 asin(x / 2) is shown of x
        x = brentq(lambda x, e=error: 2.0 * np.arcsin(x / 2.0) / x - 1.0 - e, 1e-3, 2.0)
        assert step == pytest.approx(min(x / 5.0, semi), rel=1e-6)
        assert found.accuracy["implicitfast"] == found.accuracy["Euler"]
        x = brentq(lambda x, e=error: abs(np.log(series(1j * x))) / x - 1.0 + e, 0.1, 1.6)
        number = (1e-2, 1e-3).index(error)
        assert found.accuracy["RK4"][number] == pytest.approx(min(x / 5.0, explicit), rel=1e-6)


@pytest.mark.parametrize("unit", [1e-5, 1e4])
def test_limits_scale_with_the_unit_of_time(unit):
    """RK4 turns the undamped mode by sqrt(8), the discrete one grows at no step."""
    found = step_limits(model(unit * W))
    semi = 2.0 * (np.sqrt(1.04) + 0.2) / 24.0 / unit
    assert found.omega_max == pytest.approx(24.0 * unit)
    for name, limit in (("Euler", semi), ("implicit", semi), ("discrete", np.inf)):
        assert found.largest_step[name] == pytest.approx(limit, rel=1e-8)
    pole = 24.0 * complex(-0.2, np.sqrt(0.96))
    damped = brentq(lambda h: abs(series(h * pole)) - 1.0, 0.08, 0.2)
    assert found.largest_step["RK4"] == pytest.approx(damped / unit, rel=1e-8)


def test_limits_of_what_does_not_ring_or_move():
    found = step_limits(model(ratio=np.array([1.5, 1.2])))
    fast = 24.0 * (1.2 + np.sqrt(0.44))
    assert found.omega_max == pytest.approx(fast)
    assert found.ratio == 1.0
    assert found.accuracy == {}
    assert found.largest_step["RK4"] == pytest.approx(2.785293563405282 / fast)
    nothing = step_limits(model(np.zeros(2)))
    assert nothing == (0.0, 0.0, dict.fromkeys(EVERY, np.inf), {})


@pytest.mark.parametrize(("ratio", "stated"), [(5e-11, 0.0), (3e-9, 3e-9)])
def test_a_ratio_of_rounding_is_none(ratio, stated):
    w = np.array([2.0])
    damping = np.diag(2.0 * ratio * w)
    made = LinearModel(np.diag(w**2), damping, damping, np.diag(w**2))
    assert step_limits(made).ratio == pytest.approx(stated, rel=1e-3, abs=1e-20)
    frequencies, ratios = oscillations(np.array([2j - 2.0 * ratio, -2j - 2.0 * ratio]))
    assert frequencies == pytest.approx([2.0])
    assert ratios == pytest.approx([stated], rel=1e-6, abs=1e-20)


def test_what_oscillates_of_many_poles():
    poles = np.array([-3 + 4j, -3 - 4j, 0.1 + 2j, -7.0, 0.9e-4j, 1.1e-4j, -6 + 8j, 0.0])
    found = [1.1e-4j, 0.1 + 2j, -3 + 4j, -6 + 8j]
    assert oscillating(poles).tolist() == found
    frequencies, ratios = oscillations(poles)
    assert frequencies == pytest.approx(np.abs(found))
    assert ratios == pytest.approx([0.0, 0.0, 0.6, 0.6])


@pytest.mark.parametrize("rate", [0.9e-5, 1.2e-5])
def test_a_pole_that_grows_has_no_step(rate):
    # s^2 - 2 rate s + 1 beside 0.3
    damping = np.diag([-2.0 * rate, 0.0])
    grows = LinearModel(np.diag([1.0, 0.09]), damping, damping, np.zeros((2, 2)), preload="Pulled.")
    if rate > 1e-5:
        with pytest.raises(EngineError, match=r"^Pulled\.$"):
            grows.largest_step("Euler")
    else:
        assert grows.largest_step("implicit") == pytest.approx(2.0, rel=1e-4)


def test_the_largest_discrete_step_of_springs_of_tendons_beside_others():
    """The velocity is divided by a mass without the springs of tendons, the position's force by one
    with them, and part of the stiffness is in neither."""
    tendons = np.array([[4.0, 2.0], [2.0, 1.0]])
    joints, rest = np.diag([0.0, 3.0]), np.array([[60.0, -9.0], [-9.0, 40.0]])
    whole, damping = tendons + joints + rest, np.array([[0.3, 0.1], [0.1, 0.2]])

    def growth(h):
        left = np.eye(2) + h * damping + h**2 * joints
        pull = h**2 * np.linalg.solve(left + h**2 * tendons, whole)
        keep = np.linalg.inv(left)
        z = np.linalg.eigvals(np.block([[np.eye(2) - pull, keep], [-pull, keep]]))
        return np.max(np.abs(z)) - 1.0

    found = LinearModel(whole, damping, damping, joints, tendons).largest_step("discrete")
    assert found == pytest.approx(brentq(growth, 0.2, 0.4), rel=1e-9)
    assert all(growth(share * found) < 0.0 for share in (0.1, 0.3, 0.6, 0.9, 0.99))


# -- of coupled modes ------------------------------------------------------------------------------
def coupled(damped=1.0):
    """Three modes in coordinates that are not orthogonal, their dampers shared out."""
    mix = np.array([[1.0, 0.4, -0.2], [0.3, 1.2, 0.1], [-0.5, 0.2, 0.9]])
    back = np.linalg.inv(mix)
    stiffness = mix @ np.diag([30.0, 95.0, 260.0]) @ back
    damping = damped * mix @ np.diag([0.3, 0.9, 2.0]) @ back
    return LinearModel(
        stiffness, damping, 0.4 * damping, 0.3 * stiffness, discrete_tendons=0.25 * stiffness
    )


@pytest.mark.parametrize("integrator", EVERY)
@pytest.mark.parametrize("number", [0, 1, 2])
def test_the_step_of_an_error_is_that_of_its_mode(integrator, number):
    made = coupled()
    square, drag = (30.0, 95.0, 260.0)[number], (0.3, 0.9, 2.0)[number]
    pole = complex(-drag / 2.0, np.sqrt(square - drag**2 / 4.0))

    def off(h):
        if integrator == "RK4":
            return abs(np.log(series(h * pole)) / h / pole) - 1.0
        late = 0.4 * drag if integrator == "Euler" else drag
        spring, held = (0.55, 0.25) if integrator == "discrete" else (0.0, 0.0)
        left = 1.0 + h * late
        pull = h**2 * square / (left + h**2 * spring * square)
        keep = (1.0 - h * (drag - late)) / (left + h**2 * (spring - held) * square)
        z = np.linalg.eigvals(np.array([[1.0 - pull, keep], [-pull, keep]]))
        return abs(np.log(z[np.argmax(z.imag)])) / h / abs(pole) - 1.0

    for error in (3e-2, 1e-3):
        found = made.step_for_error(integrator, pole, error, 0.5)
        assert abs(off(found)) == pytest.approx(error, rel=1e-5)
        assert abs(off(0.99 * found)) < error
    assert made.step_for_error(integrator, pole, 1e-3, 0.0005) == pytest.approx(0.0005)
    assert made.step_for_error(integrator, pole, 50.0, 9.0) == pytest.approx(3.0 / abs(pole))
    # two of three that are asked for, the faster first
    h = 0.01
    (value,) = made.shown(integrator, h, np.array([pole]))
    assert abs(value) / abs(pole) - 1.0 == pytest.approx(off(h), abs=1e-9)
    wanted = np.sqrt([260.0, 30.0]) * 1j
    assert np.abs(made.shown(integrator, h, wanted)) == pytest.approx(np.abs(wanted), rel=0.05)


def test_where_dampers_couple_modes_the_step_is_shortened_until_all_of_it_confirms():
    stiffness = np.diag([30.0, 80.0])
    damping = 2.0 * np.array([[1.0, 0.9], [0.9, 1.0]])
    made = LinearModel(stiffness, damping, 0.0 * damping, 0.0 * damping)
    pole = min(made.poles(), key=lambda p: abs(p) if p.imag > 0.0 else np.inf)
    h = made.step_for_error("Euler", complex(pole), 1e-2, 0.3)

    def off(h):
        pull, keep = h**2 * stiffness, np.eye(2) - h * damping
        z = np.linalg.eigvals(np.block([[np.eye(2) - pull, keep], [-pull, keep]]))
        return np.min(np.abs(np.abs(np.log(z)) / h / abs(pole) - 1.0))

    # by 2 %, several times
    assert off(h) <= 1e-2 < off(h / 0.98)
    assert off(h / 0.98**3) > 1e-2


# -- of a port -------------------------------------------------------------------------------------
def port(damping=(0.01, 0.02)):
    """Two modes seen by six motions, on a hub."""
    random = np.random.default_rng(3)
    rows = random.normal(size=(2, 6))
    rigid = rows.T @ rows + np.diag([9.0, 8.0, 7.0, 6.0, 5.0, 4.0])
    return PortModel(rigid, np.array([3.0, 11.0]), rows, damping=np.array(damping))


HUB = np.diag([10.0, 11.0, 12.0, 3.0, 4.0, 5.0]) + 0.4


def free_modes(made, mass):
    """Poles of (1 - L M^-1 L^T) q'' + 2 zeta w q' + w^2 q = 0, and motion of the port in each."""
    rows = made.participation
    left = np.eye(2) - rows @ np.linalg.solve(mass, rows.T)
    inverse = np.linalg.inv(np.linalg.cholesky(left))
    squares, turn = np.linalg.eigh(inverse @ np.diag(made.frequencies**2) @ inverse.T)
    shapes = inverse.T @ turn
    drag = shapes.T @ np.diag(2.0 * made.damping * made.frequencies) @ shapes
    return np.sqrt(squares), drag, -(np.linalg.solve(mass, rows.T) @ shapes).T


def test_two_modes_of_a_free_port_in_units_of_their_own_mass():
    made = port()
    stiffness, damping = unit_mass_of_port(made)
    w, drag, _ = free_modes(made, made.rigid_mass)
    squares, turn = np.linalg.eigh(stiffness)
    assert squares == pytest.approx(w**2)
    assert np.diag(turn.T @ damping @ turn) == pytest.approx(np.diag(drag))


@pytest.mark.parametrize("tendon", [True, False])
@pytest.mark.parametrize("sprung", [True, False])
def test_limits_of_a_port_on_a_hub(tendon, sprung):
    rows = np.zeros((1, 6))
    rows[0, 1] = 1.2
    made = PortModel(np.eye(6) * 4.0, np.array([3.0]), rows, damping=np.array([0.3]))
    for hub, mass in ((HUB, HUB + np.eye(6) * 4.0), (None, np.eye(6) * 4.0)):
        left = 1.0 - 1.44 * np.linalg.inv(mass)[1, 1]
        w, drag = 3.0 / np.sqrt(left), 1.8 / left
        found = coupled_limits(made, hub, tendon=tendon, sprung=sprung)
        assert found.omega_max == pytest.approx(w)
        assert found.ratio == pytest.approx(drag / 2.0 / w)
        sign = -1.0 if tendon else 1.0
        # 4 + 2 sign c h - k h^2 = 0
        root = np.sqrt(drag**2 + 4.0 * w**2)
        assert found.largest_step["Euler"] == pytest.approx((root + sign * drag) / w**2)
        assert found.largest_step["implicit"] == pytest.approx((root + drag) / w**2)
        h = found.accuracy["discrete"][0]
        kept = 1.0 / (1.0 + h * drag + h**2 * w**2 * (not sprung))
        pull = h**2 * w**2 / (1.0 + h * drag + h**2 * w**2)
        z = np.linalg.eigvals(np.array([[1.0 - pull, kept], [-pull, kept]]))
        off = abs(np.log(z[np.argmax(z.imag)])) / h / w - 1.0
        assert abs(off) == pytest.approx(1e-2, rel=1e-4)


@pytest.mark.parametrize(("tendon", "band", "tolerance"), [(True, 9.0, 0.02), (False, 2.0, 1e-5)])
def test_the_chosen_step_keeps_the_response_within_the_tolerance(tendon, band, tolerance):
    made, keep = port(), (1, 5)
    mass = made.rigid_mass + HUB
    w, drag, motion = free_modes(made, mass)
    ratios = np.diag(drag) / (2.0 * w)
    scale = np.sqrt(np.diag(mass))[list(keep)]
    rows = motion[:, keep] * scale
    rigid = np.linalg.inv(mass)[np.ix_(keep, keep)] * np.outer(scale, scale)
    omega = np.sort(
        np.concatenate([np.linspace(0.05, band, 400), w[0] * np.linspace(0.95, 1.05, 400)])
    )

    omega = omega[omega <= band]

    def response(w, ratios):
        s = 1j * omega[:, None]
        weight = s**2 / (s**2 + 2.0 * ratios * w * s + w**2)
        return rigid + np.einsum("fk,ki,kj->fij", weight, rows, rows)

    exact = response(w, ratios)
    size = np.maximum(np.linalg.norm(exact, 2, axis=(1, 2)), np.linalg.norm(rigid, 2))

    def error(name, h):
        c, k = 2.0 * ratios * w, w**2
        if name == "RK4":
            s = np.log(series(h * w * (-ratios + 1j * np.sqrt(1.0 - ratios**2)))) / h
        else:
            late = tendon and name == "Euler"
            a = 1.0 - h * c if late else 1.0 / (1.0 + h * c)
            b = h**2 * k * (1.0 if late else a)
            if name == "discrete":
                a = b = 1.0 / (1.0 + h * c + h**2 * k)
                b = h**2 * k * b
            half = (1.0 + a - b) / 2.0
            s = np.log(half + 1j * np.sqrt(a - half**2)) / h
        moved = response(np.abs(s), -s.real / np.abs(s))
        return np.max(np.linalg.norm(moved - exact, 2, axis=(1, 2)) / size)

    found = choose_step(made, HUB, keep, band, tolerance, tendon=tendon)
    costs = {"Euler": 1.0, "implicitfast": 1.1, "implicit": 2.0, "discrete": 1.15, "RK4": 3.8}
    assert {one.integrator for one in found} == set(EVERY)
    cheapest = min(costs[one.integrator] / one.step for one in found)
    for one in found:
        assert one.bound == "tolerance"
        assert error(one.integrator, one.step / 1.01) <= tolerance * 1.001
        assert error(one.integrator, one.step * 1.012) > tolerance * 0.999
        assert one.cost == pytest.approx(costs[one.integrator] / one.step / cheapest)
    assert [one.cost for one in found] == sorted(one.cost for one in found)
    for one in choose_step(made, HUB, keep, band, 1e9, tendon=tendon):
        stable = coupled_limits(made, HUB, tendon=tendon).largest_step[one.integrator]
        assert one.bound == "stability"
        assert one.step == pytest.approx(0.8 * min(stable, 3.0 / w[0]))


def test_a_rigid_port_needs_no_step():
    rigid = PortModel(block_diag(np.eye(3), np.eye(3)), np.zeros(0), np.zeros((0, 6)))
    assert choose_step(rigid, HUB, (0, 1), 5.0, 0.01) == ()
