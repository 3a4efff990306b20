"""Closed forms beside state spaces: feedback, states that take no part, samples, forms of
controllers, modal gains."""

import math
from types import SimpleNamespace

import control
import mujoco
import numpy as np
import pytest
from scipy.linalg import block_diag, expm

import beamchain as bc
from beamchain.control.feedback import Signals, feedback
from beamchain.control.realisation import Plant
from beamchain.control.systems import (
    close_feedback,
    close_loop,
    linking,
    response,
    size_at_rest,
    standing_still,
    subsystem,
    taking_part,
    touched,
    with_deltas,
)
from beamchain.craft.modal_form import ModalForm
from formulas import (
    growth_of_poles,
    limited_by_modes_above,
    limiting_modes,
    realise_controller,
    realise_fraction,
    response_of_loop,
    sampled_system,
    with_held_input,
    zero_pole_product,
)

RANDOM = np.random.default_rng(41)


def system(states, outputs, inputs):
    a = RANDOM.normal(size=(states, states)) - 2.0 * np.eye(states)
    shapes = (states, inputs), (outputs, states), (outputs, inputs)
    return (a, *(0.4 * RANDOM.normal(size=shape) for shape in shapes))


ONE, OTHER = system(3, 3, 4), system(2, 2, 2)
S = np.array([0.3 + 0.9j, -0.1 + 2.0j])


def value(of, s):
    a, b, c, d = of
    return c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d


def test_responses_and_feedback_of_a_system():
    gain = RANDOM.normal(size=(4, 3))
    closed = close_feedback(ONE, gain)
    found = response(closed, S)
    for k, s in enumerate(S):
        np.testing.assert_allclose(response(ONE, S)[k], value(ONE, s))
        open_loop = value(ONE, s)
        wanted = np.linalg.solve(np.eye(3) - open_loop @ gain, open_loop)
        np.testing.assert_allclose(found[k], wanted)
    many = np.linspace(0.1, 3.0, 201) * 1j
    np.testing.assert_allclose(response(ONE, many)[150], value(ONE, many[150]))


def test_deltas_on_the_first_signals():
    deltas = np.array([0.7, -0.4])
    found = with_deltas(ONE, deltas)
    for s in S:
        m, delta = value(ONE, s), np.diag(deltas)
        inner = np.linalg.solve(np.eye(2) - m[:2, :2] @ delta, m[:2, 2:])
        np.testing.assert_allclose(value(found, s), m[2:, 2:] + m[2:, :2] @ delta @ inner)


def test_a_controller_around_some_of_the_signals():
    """From outputs 2 and 0 to inputs 1 and 3; its own signals stand behind."""
    found = close_loop(ONE, OTHER, [2, 0], [1, 3])
    for s in S:
        g, k = value(ONE, s), value(OTHER, s)
        # y = G (u - E k (F y + v)), z = K (F y + v)
        pick, put = np.eye(3)[[2, 0]], np.eye(4)[:, [1, 3]]
        inner = np.linalg.inv(np.eye(3) + g @ put @ k @ pick)
        y = np.hstack([inner @ g, -inner @ g @ put @ k])
        z = k @ (pick @ y + np.hstack([np.zeros((2, 4)), np.eye(2)]))
        np.testing.assert_allclose(value(found, s), np.vstack([y, z]))


def test_states_that_link_an_input_to_an_output():
    """0 -> 1 -> 2, 3 is driven and not seen, 4 seen and not driven."""
    a = np.zeros((5, 5), dtype=bool)
    a[1, 0] = a[2, 1] = a[3, 0] = a[2, 4] = True
    driven, seen = np.eye(5, dtype=bool)[0], np.eye(5, dtype=bool)[2]
    assert taking_part(a, driven, seen) == [0, 1, 2]
    for size, kept in ((1e-10, [0, 1, 2]), (1e-12, [])):
        whole = a.astype(float) - np.eye(5)
        b = np.array([[size, 0, 0, 1.0, 0]]).T
        assert linking((whole, b, seen[None].astype(float), np.zeros((1, 1)))) == kept
        c = np.array([[0, 0, size, 0, 1.0]])
        b = np.array([[1.0, 0, 0, 0, 0]]).T
        assert linking((whole, b, c, np.zeros((1, 1)))) == kept
    for size, kept in ((1e-13, [0, 1, 2]), (1e-15, [])):
        whole = a.astype(float) - np.eye(5)
        whole[1, 0] = size
        b = np.array([[1.0, 0, 0, 0, 0]]).T
        assert linking((whole, b, seen[None].astype(float), np.zeros((1, 1)))) == kept


@pytest.mark.parametrize(("inputs", "outputs"), [(1e6, 1e-6), (1e-6, 1e6)])
def test_units_of_signals_do_not_change_what_they_link(inputs, outputs):
    """A state that is driven, or seen, by 1e-10 of the largest, and one by 1e-12."""
    for size, kept in ((1e-10, [0, 1]), (1e-12, [1])):
        for b, c in (([size, 1.0], [1.0, 1.0]), ([1.0, 1.0], [size, 1.0])):
            whole = -np.eye(2), inputs * np.array([b]).T, outputs * np.array([c]), np.zeros((1, 1))
            assert linking(whole) == kept
    # a chain, whose elements of A are compared within their row
    for size, kept in ((1e-13, [0, 1]), (1e-15, [])):
        a = inputs * np.array([[-1.0, 0.0], [size, -1.0]])
        assert linking((a, np.eye(2)[:, :1], np.eye(2)[1:], np.zeros((1, 1)))) == kept


@pytest.mark.parametrize("spread", [1.0, 1e5, 1e-5])
def test_what_stands_still_is_found_in_any_units_of_the_states(spread):
    """A moves nothing along (1, 1/2, 2), and C does not see it."""
    still, units = np.array([1.0, 0.5, 2.0]), np.array([1.0, spread, 1.0 / spread])
    away = np.eye(3) - np.outer(still, still) / (still @ still)
    a = away @ np.diag([-1.0, -2.0, -3.0]) @ away
    c = np.array([[1.0, 2.0, -1.0]])
    a, seen = units[:, None] * a / units, c @ away / units
    found = standing_still(a, seen)
    assert found.shape == (3, 1)
    np.testing.assert_allclose(found[:, 0] / found[0, 0], still * units, rtol=1e-6)
    assert standing_still(a, np.array([[1.0, 0.5, 2.0]]) / units).shape == (3, 0)


def test_some_of_the_signals_and_their_states():
    apart = tuple(block_diag(*same) for same in zip(ONE, OTHER, strict=True))
    a, b, c, d = subsystem(apart, [3, 4], [5, 4])
    assert a.shape == (2, 2)
    for s in S:
        np.testing.assert_allclose(value((a, b, c, d), s), value(OTHER, s)[:, ::-1])


@pytest.mark.parametrize("rest", [0.0, 1.0])
def test_motion_at_rest_that_nothing_touches_is_left_out(rest):
    """Two free positions of which the sum is seen, and a mode."""
    a = np.zeros((6, 6))
    a[0, 1] = a[2, 3] = 1.0
    a[4:, 4:] = [[0.0, 1.0], [-9.0, -0.6]]
    b = np.array([[0, 1.0, 0, 2.0, 0, 0.5]]).T
    c = np.array([[1.0, 0, 0, 0, 0.7, 0.0]])  # the second position is not seen
    turned = np.eye(6)
    turned[0, 2], turned[1, 3] = 0.5, 0.5
    whole = (
        turned @ a @ np.linalg.inv(turned) + rest * np.eye(6),
        turned @ b,
        None,
        np.zeros((1, 1)),
    )
    whole = (whole[0], whole[1], c @ np.linalg.inv(turned), whole[3])
    found, keep = touched(whole, rest)
    assert len(keep) == 4
    assert found[0].shape == (4, 4)
    for s in S:
        np.testing.assert_allclose(value(found, s + rest), value(whole, s + rest), rtol=1e-8)


def test_directions_in_which_nothing_moves():
    a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 2.0, -1.0]])
    none = np.zeros((1, 3))
    still = standing_still(a, none)
    assert still.shape == (3, 1)
    np.testing.assert_allclose(np.abs(still[:, 0] / still[0, 0]), [1.0, 0.0, 0.0], atol=1e-12)
    assert standing_still(a, np.array([[1.0, 0.0, 0.0]])).shape == (3, 0)
    assert standing_still(a - np.eye(3), none).shape == (3, 0)
    # what couples by rounding alone is scaled by more than a whole number holds
    assert standing_still(np.array([[0.0, 1.0], [1e-40, -1.0]]), np.zeros((1, 2))).shape == (2, 1)
    # never more than there are poles at zero: below 1e-7 of the fastest
    for pole, count in ((1e-6, 0), (1e-8, 0), (0.0, 1)):
        assert standing_still(np.diag([pole, -1.0]), np.zeros((1, 2))).shape == (2, count)


def test_poles_at_rest_and_those_that_grow():
    """1e-7 of the plant's fastest, or of the closed loop's, or a hundredth of its slowest."""
    closed = np.array([-2.0, -30.0, 1e-13])
    assert size_at_rest(np.array([-5.0, 0.1]), closed, 30.0) == pytest.approx(5e-7)
    assert size_at_rest(np.array([-5e3, 0.1]), closed, 30.0) == pytest.approx(3e-6)
    slow = np.array([-1e-5, -30.0])
    assert size_at_rest(np.array([-5e3, 0.1]), slow, 30.0) == pytest.approx(1e-7)
    poles = np.array([0.5, -0.5j, 1e-8, -3.0 + 4.0j])
    found = growth_of_poles(poles, 1e-7, 100.0)
    assert found[0] == pytest.approx(0.5 / (1e-9 * 0.5 + 1e-10) - 1.0)
    assert found[1:3].tolist() == [-1.0, -1.0]
    assert found[3] == pytest.approx(-3.0 / (5e-9 + 1e-10) - 1.0)


# -- samples ---------------------------------------------------------------------------------------
def test_a_plant_at_the_samples_of_a_controller():
    a, b, _, _ = ONE
    at_once = sampled_system(ONE, 0.0, 0.0)
    assert np.array_equal(at_once[0], np.eye(3))
    assert not at_once[1].any()
    held = sampled_system(ONE, 0.0, 0.3)
    inverse = np.linalg.inv(a)
    np.testing.assert_allclose(held[0], expm(0.3 * a))
    np.testing.assert_allclose(held[1], inverse @ (expm(0.3 * a) - np.eye(3)) @ b)
    every = sampled_system(sampled_system(ONE, 0.0, 0.1), 0.1, 0.3)
    for one, other in zip(every, held, strict=True):
        np.testing.assert_allclose(one, other)
    for step in (0.25, 0.05, 0.3 * (1.0 + 3e-9)):
        with pytest.raises(bc.InputError, match="no multiple"):
            sampled_system(held, 0.1, step)
    sampled_system(held, 0.1, 0.3 * (1.0 + 3e-10))


def test_a_step_fed_with_the_mean_of_this_and_the_last_input():
    """Two states, one input, and an output that shows half of both inputs at once."""
    a, b = np.array([[0.9, 0.1], [-0.2, 0.8]]), np.array([[0.3], [1.0]])
    c, d = np.array([[1.0, -0.5]]), np.array([[0.4]])
    held = with_held_input((a, b, c, d))
    x, before, state = np.zeros(2), 0.0, np.zeros(3)
    for u in (1.0, -0.5, 2.0, 0.0):
        mean = (u + before) / 2.0
        assert held[2] @ state + held[3] @ [u] == pytest.approx(c @ x + d[0] * mean, rel=1e-12)
        state = held[0] @ state + held[1] @ [u]
        x, before = a @ x + b[:, 0] * mean, u


def test_a_step_of_rk4_takes_its_input_at_once():
    """2 x'' + 0.6 x' + 18 x = 5 u by the series of the exponential to the fourth order."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0" integrator="RK4"/><worldbody><body name="bus">
        <joint name="j" type="slide" stiffness="18" damping="0.6"/>
        <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody>
        <actuator><motor name="push" joint="j" gear="5"/></actuator>
        <sensor><jointpos name="place" joint="j"/></sensor></mujoco>"""
    )
    h = 0.2
    found = bc.plant(model, inputs=["push"], outputs=["place"], discrete=h)
    flow = np.array([[0.0, 1.0, 0.0], [-9.0, -0.3, 2.5], [0.0, 0.0, 0.0]])
    whole = sum(np.linalg.matrix_power(h * flow, k) / math.factorial(k) for k in range(5))
    a, b = whole[:2, :2], whole[:2, 2:]
    for z in np.exp(h * np.array([0.4j, 2.8j, 9.0j])):
        wanted = (np.linalg.solve(z * np.eye(2) - a, b))[0, 0]
        assert found(z) == pytest.approx(wanted, rel=1e-5)


# -- controllers -----------------------------------------------------------------------------------
LOOP = bc.spec.Loop(
    input="u",
    output="y",
    numerator=[0.0, 3.0, 5.0],
    denominator=[2.0, 1.0, 4.0],
    delay=0.2,
    actuator=bc.spec.Filter(numerator=[1.0], denominator=[0.3, 1.0]),
    sensor=bc.spec.Filter(numerator=[0.1, 1.0], denominator=[0.05, 1.0]),
)


def loop_at(s, delay=0.2):
    parts = (3.0 * s + 5.0) / (2.0 * s**2 + s + 4.0), 1.0 / (0.3 * s + 1.0)
    return parts[0] * parts[1] * (0.1 * s + 1.0) / (0.05 * s + 1.0) * np.exp(-s * delay)


def test_a_loop_with_all_its_parts():
    np.testing.assert_allclose(response_of_loop(LOOP, S), loop_at(S))
    for order in (0, 3):
        states = realise_controller(bc.spec.Controller(loop=(LOOP,)), order)
        top, bottom = control.pade(0.2, order)
        for s in S:
            wanted = loop_at(s, 0.0) * np.polyval(top, s) / np.polyval(bottom, s)
            np.testing.assert_allclose(value(states, s), wanted, rtol=1e-9)
    undamped = bc.spec.Filter(numerator=[1.0], denominator=[1.0, 0.0, 4.0])
    beside = 1.0 / ((2j * (1.0 + 1e-9)) ** 2 + 4.0)
    found = undamped.response(np.array([2j, 3j]))
    np.testing.assert_allclose(found, [beside, -0.2], rtol=1e-5)


@pytest.mark.parametrize(
    ("top", "bottom"),
    [
        ([3.0], [4.0]),
        ([1.0, 2.0, 5.0], [2.0, 7.0, 9.0]),
        ([5.0], [2.0, 0, 7]),
        # balanced by factors that no whole number holds
        ([1e-12, 1e30, 1e12], [1e-30, 1e-30, 1.0, 1e12, 1e-30]),
    ],
)
def test_fractions_as_states(top, bottom):
    top, bottom = np.array(top), np.array(bottom)
    states = realise_fraction(top, bottom)
    for s in S:
        np.testing.assert_allclose(value(states, s), np.polyval(top, s) / np.polyval(bottom, s))


@pytest.mark.parametrize("delay", [2e-4, 3.0, 4e3])
def test_states_of_a_dead_time_are_as_large_as_what_goes_in_and_comes_out(delay):
    """Rows and columns of [A, B; C, 0] are alike, to the power of two that scales them."""
    top, bottom = control.pade(delay, 4)
    a, b, c, d = realise_fraction(np.array(top), np.array(bottom))
    whole = np.abs(np.block([[a, b], [c, 0.0 * d]]))
    np.fill_diagonal(whole, 0.0)
    ratio = whole.sum(axis=0) / whole.sum(axis=1)
    assert np.all((ratio > 1.0 / 4.0) & (ratio < 4.0))
    s = 0.7j / delay
    wanted = np.polyval(top, s) / np.polyval(bottom, s)
    assert value((a, b, c, d), s)[0, 0] == pytest.approx(wanted)


@pytest.mark.parametrize("size", [0.99e-30, 1.01e-30])
def test_coefficients_and_dead_times_that_are_nothing(size):
    def made(**given):
        words = {"numerator": [1.0, size], "denominator": [1.0, 1.0]} | given
        return bc.spec.Loop(input="u", output="y", **words)

    if size < 1e-30:
        with pytest.raises(bc.InputError, match=r"numerator\[1\]"):
            made()
        with pytest.raises(bc.InputError, match="delay"):
            made(numerator=[1.0], delay=0.99e-9)
    else:
        assert made(delay=1.01e-9).delay == 1.01e-9


SIGNALS = Signals(["u", "v", "w"], ["x", "y"], ["u", "v", "w"], ["x", "y"])


def test_loops_of_one_input_add_up_and_those_of_several_stand_side_by_side():
    one = bc.spec.Loop(input="w", output="y", numerator=[2.0], denominator=[1.0, 3.0], delay=0.1)
    loops = (
        one,
        LOOP,
        bc.spec.Loop(input="w", output="x", numerator=[0.5], denominator=[1.0, 1.0]),
    )
    made = feedback(bc.spec.Controller(loop=loops), SIGNALS)
    assert (made.rows, made.columns) == ([1, 0], [2, 0])
    assert made.delays == (0.1, 0.2)
    assert made.delayed
    assert made.step == 0.0
    for k, s in enumerate(S):
        wanted = np.array([[2.0 / (s + 3.0) * np.exp(-0.1 * s), 0.5 / (s + 1.0)], [loop_at(s), 0]])
        np.testing.assert_allclose(made.response(S)[k], wanted)
    undelayed = made.realise(0)
    for s in S:
        wanted = np.array([[2.0 / (s + 3.0), 0.5 / (s + 1.0)], [loop_at(s, 0.0), 0.0]])
        np.testing.assert_allclose(value(undelayed, s), wanted)
    assert made.measured(undelayed) == [[1, 0], [1]]


def test_systems_of_python_control_in_a_mapping_and_as_one():
    first, second = control.tf([2.0], [1.0, 3.0]), control.tf([1.0, 0.0], [1.0, 4.0])
    made = feedback({("w", "y"): first, ("u", "x"): second, ("w", "x"): 0.7}, SIGNALS)
    assert (made.rows, made.columns, made.step) == ([1, 0], [2, 0], 0.0)
    for k, s in enumerate(S):
        wanted = np.array([[2.0 / (s + 3.0), 0.7], [0.0, s / (s + 4.0)]])
        np.testing.assert_allclose(made.response(S)[k], wanted)
    matrix = control.combine_tf([[first, 0.7], [0.0, second], [0.0, 0.0]])
    whole = feedback(matrix, SIGNALS)
    assert (whole.rows, whole.columns) == ([0, 1], [0, 1])
    for k, s in enumerate(S):
        wanted = np.array([[2.0 / (s + 3.0), 0.7], [0.0, s / (s + 4.0)]])
        np.testing.assert_allclose(whole.response(S)[k], wanted, atol=1e-12)
    assert feedback({("u", "x"): 2.0}, SIGNALS).step is None
    for rational in (made, whole):
        assert rational.delays == (0.0, 0.0)
        assert not rational.delayed


def test_a_loop_that_gives_nothing_stands_beside_one_that_does():
    made = feedback({("u", "x"): control.tf([0.0], [1.0, 1.0]), ("v", "y"): 2.0}, SIGNALS)
    np.testing.assert_array_equal(made.response(S), np.broadcast_to(np.diag([0.0, 2.0]), (2, 2, 2)))
    assert [part.shape for part in made.realise(0)] == [(0, 0), (0, 2), (2, 0), (2, 2)]
    assert made.step is None


def test_outputs_that_an_input_is_fed_from_go_through_any_number_of_states():
    """x1 <- y, x2 <- x1, ..., x6 <- x5; u sees x6, v sees x0, which w drives."""
    a = np.zeros((7, 7))
    a[np.arange(2, 7), np.arange(1, 6)] = -0.05
    b, c = np.zeros((7, 2)), np.zeros((3, 7))
    b[1, 0], b[0, 1] = 0.03, -0.01
    c[0, 6], c[1, 0] = 0.02, -0.04
    d = np.zeros((3, 2))
    d[2, 0], d[1, 1] = -0.05, 0.01
    made = feedback(control.ss(a, b, c, d, inputs=["y", "x"], outputs=["u", "v", "w"]), SIGNALS)
    assert made.measured((a, b, c, d)) == [[1], [0], [1]]


@pytest.mark.parametrize(("factor", "kept"), [(1.0 + 0.9e-9, True), (1.0 + 1.1e-9, False)])
def test_loops_of_one_step(factor, kept):
    loops = {
        ("u", "x"): control.tf([1.0], [1.0, -0.5], 0.1),
        ("v", "y"): control.tf([1.0], [1.0, -0.4], 0.1 * factor),
    }
    if kept:
        assert feedback(loops, SIGNALS).step == 0.1
    else:
        with pytest.raises(bc.InputError, match="give all loops one step"):
            feedback(loops, SIGNALS)


# -- modal gains -----------------------------------------------------------------------------------
def source_of(signals, step=None, exact=None, errors=(None, None)):
    """What a plant is made of: `exact` gives the form of the craft with all modes, and their
    names."""

    def craft(omega):
        form, names = exact(omega)
        return SimpleNamespace(form=lambda: SimpleNamespace(minimal=lambda: form), mode_names=names)

    own = SimpleNamespace(signals=signals)
    return SimpleNamespace(step=step or None, craft=own, exact=craft, step_errors=lambda: errors)


def oscillators(step):
    w, ratio = np.array([3.0, 8.0]), np.array([0.02, 0.1])
    a = block_diag(*([[0.0, 1.0], [-(x**2), -2.0 * r * x]] for x, r in zip(w, ratio, strict=True)))
    b, c = np.array([[0.1, 1.0, 0.0, 0.7]]).T, np.array([[1.0, 0.2, 0.4, 0.0]])
    whole = (a, b, c, np.zeros((1, 1)))
    if step:
        whole = sampled_by_hand(whole, step)
    names = ("one", "one_rate", "two", "two_rate")
    form = ModalForm(*whole, names, ("",) * 4, np.ones(4), (0, 0))
    signals = (["torque"], ["angle"], ["N m"], ["rad"])
    return Plant(form, signals, ["one", "two"], source=source_of(signals, step)), (a, b, c), form


def sampled_by_hand(whole, step):
    a, b, c, d = whole
    held = np.linalg.solve(a, (expm(step * a) - np.eye(4)) @ b)
    return expm(step * a), held, c, d


@pytest.mark.parametrize("step", [0.0, 1e-3])
def test_frequencies_dampings_and_gains_of_modes(step):
    """Numerators over s^2 + 2 zeta w s + w^2, at s = j w; of fine samples nearly the same."""
    plant, (a, b, c), _ = oscillators(step)
    assert plant.frequency == pytest.approx([3.0, 8.0])
    assert plant.damping_ratio == pytest.approx([0.02, 0.1])
    for k, w in enumerate((3.0, 8.0)):
        at = slice(2 * k, 2 * k + 2)
        s, block = 1j * w, a[at, at]
        part = c[:, at] @ np.linalg.solve(s * np.eye(2) - block, b[at])
        wanted = abs(part[0, 0] * np.linalg.det(s * np.eye(2) - block))
        assert plant.gain[k, 0, 0] == pytest.approx(wanted, rel=1e-4 if step else 1e-12)


def test_gains_of_a_plant_whose_states_hold_its_inputs():
    """x' = A x + B (u + p)/2, p' = u: over the size of its polynomial at s = j w a gain is the
    size of the mode's share of the response at z = exp(j w h)."""
    _, (a, b, c), _ = oscillators(0.0)
    step = 0.3
    over, drive, _, _ = sampled_by_hand((a, b, c, None), step)
    whole = np.zeros((5, 5))
    whole[:4, :4], whole[:4, 4:] = over, drive / 2.0
    names = ("one", "one_rate", "two", "two_rate", "held")
    into, seen = np.vstack([drive / 2.0, [[1.0]]]), np.hstack([c, [[0.0]]])
    form = ModalForm(whole, into, seen, np.zeros((1, 1)), names, ("",) * 5, np.ones(5), (0, 0))
    signals = (["torque"], ["angle"], ["N m"], ["rad"])
    plant = Plant(form, signals, ["one", "two"], source=source_of(signals, step))
    for k, (w, ratio) in enumerate(((3.0, 0.02), (8.0, 0.1))):
        assert plant.frequency[k] == pytest.approx(w)
        at = slice(2 * k, 2 * k + 2)
        z = np.exp(1j * w * step)
        acting = drive[at] * (1.0 + 1.0 / z) / 2.0
        share = abs((c[:, at] @ np.linalg.solve(z * np.eye(2) - over[at, at], acting))[0, 0])
        polynomial = abs((1j * w) ** 2 + 2.0 * ratio * w * (1j * w) + w**2)
        assert plant.gain[k, 0, 0] == pytest.approx(share * polynomial, rel=1e-10)
    assert plant.time_error is None
    assert plant.sampled_error is None


@pytest.mark.parametrize("step", [0.0, 0.05])
def test_what_leaving_a_mode_out_costs_in_every_channel(step):
    """|G - G_exact| / |G_exact|; of a channel that is none beside the largest, times 1e-12."""
    _, (a, b, c), every = oscillators(0.0)
    first = tuple(part[:2] if part is b else part[:, :2] for part in (b, c))
    kept = (a[:2, :2], *first, np.zeros((1, 1)))
    if step:
        held = np.linalg.solve(kept[0], (expm(step * kept[0]) - np.eye(2)) @ kept[1])
        kept = (expm(step * kept[0]), held, *kept[2:])
    asked = []

    def beyond(omega):
        asked.append(omega)
        return every, ["one", "two"]

    form = ModalForm(*kept, ("one", "one_rate"), ("",) * 2, np.ones(2), (0, 0))
    signals = (["torque"], ["angle"], ["N m"], ["rad"])
    source = source_of(signals, step, beyond, ("worst", 0.25))
    plant = Plant(form, signals, ["one"], source=source)
    omega = np.array([1.0, 7.0, 4.0])
    found = plant.truncation(omega)
    for k, w in enumerate(omega):
        true = value((a, b, c, np.zeros((1, 1))), 1j * w)
        ours = value(kept, np.exp(1j * w * step) if step else 1j * w)
        assert found[0, 0, k] == pytest.approx(abs((ours - true) / true)[0, 0])
    assert asked == [7.0]
    assert plant.exact.modes == ("one", "two")
    assert asked[1] == pytest.approx(3.0)
    assert (plant.time_error, plant.sampled_error) == ("worst", 0.25)
    assert plant.record()["Ts"] == step
    plant.truncation(0.05)
    assert asked[2] == 0.05
    assert (plant.input_names, plant.input_units) == (("torque",), ("N m",))
    assert (plant.output_names, plant.output_units) == (("angle",), ("rad",))
    with pytest.raises(bc.InputError, match="exact"):
        _ = plant.exact.exact


def test_a_channel_that_is_none_is_compared_with_the_largest():
    """1e-12 of it, at the same frequency."""

    def form(quiet):
        c = np.array([[1.0, 0.0], [quiet, 0.0]])
        a, b = np.array([[0.0, 1.0], [-9.0, -0.6]]), np.array([[0.0], [1.0]])
        names = ("m", "m_rate")
        return ModalForm(a, b, c, np.zeros((2, 1)), names, ("",) * 2, np.ones(2), (0, 0))

    signals = (["u"], ["x", "y"], [""], ["", ""])
    source = source_of(signals, exact=lambda _: (form(1e-15), ["m"]))
    found = Plant(form(3e-12), signals, ["m"], source=source).truncation([1.0, 5.0])
    assert found[0, 0] == pytest.approx([0.0, 0.0])
    assert found[1, 0] == pytest.approx([2.999, 2.999])


def test_products_of_zeros_and_poles_of_a_step():
    """prod (z - z_i) / (s - s_i), and its limit at a pole itself."""
    s, step = 0.2 + 1.5j, 0.3
    of = np.array([-0.1 + 1.4j, -0.1 - 1.4j])
    z, poles = np.exp(s * step), np.exp(of * step)
    wanted = np.prod((z - poles) / (s - of))
    assert zero_pole_product(poles, z, step) == pytest.approx(wanted)
    assert zero_pole_product(np.array([z]), z, step) == pytest.approx(step * z)


# -- the mode that limits a figure -----------------------------------------------------------------
def limited_at(omega, frequency, ratio, gain, names, step=0.0):
    gain = np.array(gain, dtype=float)
    plant = SimpleNamespace(
        modes=tuple(names),
        frequency=np.array(frequency),
        damping_ratio=np.array(ratio),
        gain=gain.reshape(len(names), -1, 1),
        output_names=["angle", "rate"],
        input_names=["torque"],
    )
    outputs = ("angle", "rate")[: plant.gain.shape[1]]
    loop = SimpleNamespace(outputs=outputs, input="torque", limited={"gain": omega})
    return limiting_modes(plant, loop, step).get("gain")


@pytest.mark.parametrize(("beside", "name"), [(1.85, "at"), (1.95, "beside")])
def test_the_mode_that_answers_most_limits_a_figure(beside, name):
    """1 / (2 0.05 10 10) = 0.1 of a mode at 10 rad/s, 1.9 / (10^2 - 9^2) of one at 9, undamped."""
    found = limited_at(10.0, [10.0, 9.0], [0.05, 0.0], [1.0, beside], ["at", "beside"])
    assert found == name


@pytest.mark.parametrize(("mode", "near"), [(8.1, True), (7.9, False), (11.9, True), (12.1, False)])
def test_a_mode_within_a_fifth_of_a_figure_may_limit_it(mode, near):
    found = limited_at(10.0, [mode], [0.01], [1.0], ["mode"])
    assert found == ("mode" if near else None)


@pytest.mark.parametrize(("size", "shown"), [(0.011, True), (0.009, False)])
def test_modes_show_beside_the_largest_of_the_appendages_in_any_output(size, shown):
    """In the second output; a wheel's own mode is as large as it likes, all gains are small."""
    gains = 1e-6 * np.array([[500.0, 900.0], [1.0, 1.0], [0.0001, size]])
    names = ["wheel", "boom_mode1_xy", "boom_mode2_xy"]
    found = limited_at(10.0, [3.0, 1.0, 10.0], [0.01] * 3, gains, names)
    assert found == ("boom_mode2_xy" if shown else None)


@pytest.mark.parametrize("turns", [0, 1, 2])
def test_samples_show_a_fast_mode_as_a_slow_one(turns):
    """3 rad/s and 5 or 10 more or less, sampled every 2 pi / 5 s: 2 rad/s."""
    for frequency in (5.0 * turns + 2.0, 5.0 * turns + 3.0):
        assert limited_at(2.0, [frequency], [0.01], [1.0], ["m"], 2.0 * np.pi / 5.0) == "m"
        assert limited_at(3.0, [frequency], [0.01], [1.0], ["m"], 2.0 * np.pi / 5.0) is None


# -- what stands above the modes kept --------------------------------------------------------------
@pytest.mark.parametrize(
    ("gain_at", "told"), [(8.39, False), (8.41, True), (np.inf, False), (np.nan, False)]
)
def test_margins_above_the_highest_mode_that_a_loop_shows(gain_at, told):
    """A twentieth above it; modes with less than a hundredth of the largest gain are not shown."""
    plant = SimpleNamespace(
        modes=("boom_mode1_xy", "boom_mode2_xy", "boom_mode3_xy"),
        frequency=np.array([2.0, 8.0, 50.0]),
        gain=np.array([1.0, 0.011, 0.009])[:, None, None],
        output_names=["angle"],
        input_names=["torque"],
    )
    loop = SimpleNamespace(
        name="torque from angle", outputs=("angle",), input="torque", gain=np.inf, phase=30.0,
        modulus=0.5, disk=np.nan, gain_frequency=gain_at, phase_frequency=1.0,
        modulus_frequency=8.1, disk_frequency=np.inf,
    )  # fmt: skip
    found = limited_by_modes_above(plant, [loop])
    assert len(found) == told
    if told:
        assert "gain margin (at 8.41 rad/s) above" in found[0]
        assert "(8 rad/s)" in found[0]
    loop.gain = 3.0
    loop.gain_frequency = np.inf
    assert "gain margin (at inf rad/s)" in limited_by_modes_above(plant, [loop])[0]
