"""Closed forms beside closed loops and dead times: poles, grids, counts, delays between samples."""

from types import SimpleNamespace

import control
import numpy as np
import pytest

import beamchain as bc
from beamchain.control.closed_loop import ClosedLoop, Names, closed_around, counted
from beamchain.control.feedback import Feedback, Signals, feedback
from formulas import (
    check_algebraic_loop,
    step_of_plant,
    turn_along,
    unstable_count,
)

RANDOM = np.random.default_rng(11)


def system(states, outputs, inputs, random=RANDOM):
    a = random.normal(size=(states, states)) - 1.5 * np.eye(states)
    parts = random.normal(size=(states, inputs)), random.normal(size=(outputs, states))
    return a, *parts, 0.3 * random.normal(size=(outputs, inputs))


PLANT, LAW = system(3, 2, 2), system(2, 2, 2)


def value(of, s):
    a, b, c, d = of
    s = np.atleast_1d(s)[:, None, None]
    return c @ np.linalg.solve(s * np.eye(len(a)) - a, np.broadcast_to(b, (len(s), *b.shape))) + d


def closed_loop(plant=PLANT, law=LAW, delay=0.0, **given):
    fed = Feedback(
        rows=[0, 1],
        columns=[0, 1],
        realise=lambda order: law if not delay or not order else delayed(law, delay, order),
        response=lambda s: value(law, s) * np.exp(-delay * s)[:, None, None],
        step=given.get("step", 0.0),
        delays=(delay,) * len(law[3]),
    )
    names = tuple("abcdef"[: len(plant[0])])
    inputs = ("u", "v")[: plant[3].shape[1]]
    return ClosedLoop(plant, law, fed, inputs, ((),), names, (), **{"step": 0.0, **given})


def delayed(law, delay, order):
    """One loop in front of a Pade approximation."""
    pade = control.ss(control.tf(*control.pade(delay, order)))
    whole = control.series(control.ss(*law), pade)
    return tuple(np.asarray(part) for part in (whole.A, whole.B, whole.C, whole.D))


def test_poles_of_a_closed_loop_are_where_one_plus_the_loop_is_singular():
    loops, gain = np.array([0.7, 1.6]), 1.9
    closed = closed_loop()
    poles = np.linalg.eigvals(closed.closed(gain, loops))
    assert poles.size == 5
    for s in poles:
        loop = gain * loops[:, None] * value(LAW, s)[0] @ value(PLANT, s)[0]
        assert abs(np.linalg.det(np.eye(2) + loop)) < 1e-9
    np.testing.assert_allclose(
        np.linalg.eigvals(closed.closed(1.0, np.ones(2))), closed.eigenvalues
    )
    opened = np.sort_complex(np.linalg.eigvals(closed.closed(0.0, np.ones(2))))
    apart = np.concatenate([np.linalg.eigvals(PLANT[0]), np.linalg.eigvals(LAW[0])])
    np.testing.assert_allclose(opened, np.sort_complex(apart))
    np.testing.assert_allclose(np.sort_complex(closed.open_poles), np.sort_complex(apart))
    w = np.array([0.3, 2.0])
    np.testing.assert_allclose(closed.open_loop(w), value(LAW, 1j * w) @ value(PLANT, 1j * w))
    np.testing.assert_allclose(closed.limit, LAW[3] @ PLANT[3])
    assert closed.top == pytest.approx(np.abs(closed.eigenvalues).max())


def test_a_sampled_loop_has_its_poles_in_the_logarithm():
    closed = closed_loop(step=0.4)
    poles = np.array([-0.3 + 0.8j, -2.0 - 3.0j, -1.0])
    np.testing.assert_allclose(closed.to_s(np.exp(0.4 * poles)), poles)
    np.testing.assert_allclose(closed.to_point(np.array([0.7])), np.exp(0.28j))
    assert closed.top == pytest.approx(np.pi / 0.4)
    assert closed.limit is None
    assert closed.to_s(np.zeros(1))[0].real < -1e3
    assert closed_loop().to_s(poles) is poles
    assert closed_loop().to_point(np.array([0.7])) == 0.7j


def test_loops_without_direct_parts_and_late_ones_have_no_limit():
    strictly = (*LAW[:3], 0.0 * LAW[3])
    assert closed_loop(law=strictly).limit is None
    assert closed_loop(delay=0.1).limit is None


@pytest.mark.parametrize(
    ("real", "growing"), [(0.1, 1), (-0.1, 0), (2.1e-9, 1), (0.9e-9, 0), (-1e-9, 0)]
)
def test_what_grows_beside_rounding_is_unstable(real, growing):
    """A damping ratio of 1e-9 and 1e-12 of the fastest are rounding."""
    a = np.diag([-1.0, -1.0, 0.0])
    a[:2, :2] = [[real, 1.0], [-1.0, real]]
    a[2, 2] = -1.0
    plant = (a, np.ones((3, 1)), np.zeros((1, 3)), np.zeros((1, 1)))
    law = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1)))
    closed = closed_loop(plant, law)
    assert closed.growing.size == 2 * growing
    assert closed.stable == (not growing)
    assert closed_loop(plant, law, count=0).stable
    assert not closed_loop(plant, law, count=2).stable


@pytest.mark.parametrize(
    ("pole", "omega", "found"),
    [
        (4j, 4.0, True),
        (4j, 4.0 * (1.0 + 2e-8), False),
        (4j, 4.0 * (1.0 + 0.9e-8), True),
        (-5e-8 + 4j, 4.0, False),
        (-3e-8 + 4j, 4.0, True),
    ],
)
def test_an_undamped_pole_at_a_frequency(pole, omega, found):
    closed = SimpleNamespace(open_poles=np.array([-1.0, pole, pole.conjugate()]))
    assert ClosedLoop.undamped(closed, omega) == found


@pytest.mark.parametrize("step", [0.0, 0.05])
def test_a_grid_spans_the_poles_and_resolves_them(step):
    """From a hundredth of the slowest to ten times the fastest, or pi / T."""
    near = np.array([-3.0, 0.0, 2.0])
    slow, mode, fast = -0.5, -0.04 + 4.0j, -20.0 + 8.0j
    closed = SimpleNamespace(
        eigenvalues=np.array([slow, mode, mode.conjugate()]),
        open_poles=np.array([fast, fast.conjugate(), 1e-9]),
        to_s=lambda poles: poles,
        step=step,
        rest=1e-3,
        top=abs(fast),
    )
    found = ClosedLoop.frequencies(closed, 7, near)
    high = np.pi / step if step else 10.0 * abs(fast)
    low = 0.005
    wide = np.geomspace(low, high, int(7 * np.log10(high / low)) + 2)
    fine = []
    for pole, ratio in ((slow, 0.02), (mode, 0.04 / abs(mode)), (fast, 0.02)):
        fine.append(abs(pole) * (1.0 + ratio * near))
    wanted = np.unique(np.concatenate([wide, *fine]))
    np.testing.assert_allclose(found, wanted[(wanted >= low) & (wanted <= high * (1 + 1e-9))])
    assert found[-1] == high
    closed.eigenvalues, closed.open_poles = np.zeros(0), np.zeros(1)
    alone = ClosedLoop.frequencies(closed, 7, near)
    assert (alone[0], alone[-1]) == pytest.approx((0.01, min(10.0, high)))


@pytest.mark.parametrize(("dt", "step"), [(0.25, 0.25), (0.0, 0.0), (None, 0.0)])
def test_steps_of_plants(dt, step):
    assert step_of_plant(SimpleNamespace(dt=dt)) == step
    with pytest.raises(bc.InputError, match="dt = True"):
        step_of_plant(SimpleNamespace(dt=True))


@pytest.mark.parametrize(("k", "refused"), [(-0.5, True), (-0.5 + 1e-6, False), (0.5, False)])
def test_algebraic_loops_without_a_solution_are_refused(k, refused):
    """1 + K G at infinity, for G = [[2, 3], [0, 0]]."""
    plant = (None, None, None, np.array([[2.0, 3.0], [0.0, 0.0]]))
    law = (None, None, None, np.array([[k, 0.0], [0.0, 1.0]]))
    if refused:
        with pytest.raises(bc.InputError, match="algebraic loop"):
            check_algebraic_loop(plant, law)
    else:
        check_algebraic_loop(plant, law)


@pytest.mark.parametrize(("off", "refused"), [(3e-5, True), (3e-4, False)])
def test_an_algebraic_loop_is_singular_beside_its_largest_entry(off, refused):
    """The determinant is `off`, and the least singular value 1e-4 of that."""
    through = np.array([[1.0, 1e4], [1e-4, 1.0 + off]])
    plant, law = (None, None, None, np.eye(2)), (None, None, None, through - np.eye(2))
    if refused:
        with pytest.raises(bc.InputError, match="algebraic loop"):
            check_algebraic_loop(plant, law)
    else:
        check_algebraic_loop(plant, law)


@pytest.mark.parametrize(("delay", "count"), [(1.5, 0), (1.7, 2), (7.8, 2), (8.0, 4), (14.2, 6)])
def test_growing_poles_of_an_integrator_with_a_dead_time(delay, count):
    """exp(-s T) / s: a pair more from T = pi/2 + 2 pi n on."""
    plant = (np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    law = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1)))
    closed = closed_loop(plant, law, delay)
    closed.__dict__["omega"] = np.geomspace(1e-3, 50.0, 500)
    assert unstable_count(closed) == count


@pytest.mark.parametrize(("delay", "count"), [(0.6, 0), (0.7, 2), (3.6, 2), (3.8, 4)])
def test_growing_poles_of_a_rigid_body_under_a_late_law(delay, count):
    """(1 + 2 s) exp(-s T) / s^2 is of size one at w^2 = 2 + sqrt(5), and a pair grows from
    T = (arctan(2 w) + 2 pi n) / w on: 0.647, 3.70, ..."""
    plant = (np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 2.0]]),
             np.zeros((1, 1)))  # fmt: skip
    law = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1)))
    closed = closed_loop(plant, law, delay)
    closed.__dict__["omega"] = np.geomspace(1e-2, 50.0, 100)
    assert unstable_count(closed) == count


@pytest.mark.parametrize("size", [0.9, 0.1])
def test_a_loop_that_does_not_end_has_no_count(size):
    """A dead time with a direct part: at infinite frequency it turns for ever."""
    plant = (-np.eye(1), 0.0 * np.ones((1, 1)), np.ones((1, 1)), size * np.ones((1, 1)))
    law = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1)))
    closed = closed_loop(plant, law, 0.3)
    closed.__dict__["omega"] = np.geomspace(1e-2, 10.0, 100)
    assert unstable_count(closed) == (None if size > 0.2 else 0)


@pytest.mark.parametrize(
    ("first", "last", "count"),
    [
        (1e-3, 4.7, 0),  # 0.21 at the end of the grid: it is counted farther on
        (1e-6, 50.0, 0),  # from far below the crossover on
        (1e-6, 5.1e-4, 0),  # to ten thousand times the end
        (1e-6, 4.9e-4, None),  # and no farther
    ],
)
def test_a_count_goes_on_until_the_loop_is_at_rest(first, last, count):
    """exp(-1.5 s) / s is 0.2 at 5 rad/s."""
    plant = (np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    law = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1)))
    closed = closed_loop(plant, law, 1.5)
    closed.__dict__["omega"] = np.geomspace(first, last, 100)
    assert unstable_count(closed) == count


@pytest.mark.parametrize(("delay", "count"), [(0.3, 0), (2.0, 2), (4.5, 2), (5.0, 0)])
def test_an_undamped_mode_counts_by_what_a_small_loop_does_to_it(delay, count):
    """0.02 exp(-s T) s / (s^2 + 1) moves the pole j by -0.01 exp(-j T)."""
    plant = (
        np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[0.0, 1.0]]),
        np.zeros((1, 1)),
    )  # fmt: skip
    law = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.full((1, 1), 0.02))
    closed = closed_loop(plant, law, delay)
    closed.__dict__["omega"] = np.geomspace(1e-2, 50.0, 100)
    assert unstable_count(closed) == count


@pytest.mark.parametrize(("delay", "count"), [(0.3, 0), (2.0, 2)])
def test_a_mode_that_grows_slowly_counts_as_one_of_the_open_loop(delay, count):
    """0.1 exp(-s T) s / (s^2 - 0.02 s + 1) moves the pole 0.01 + j by -0.05 exp(-j T)."""
    plant = (
        np.array([[0.0, 1.0], [-1.0, 0.02]]), np.array([[0.0], [1.0]]), np.array([[0.0, 1.0]]),
        np.zeros((1, 1)),
    )  # fmt: skip
    law = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.full((1, 1), 0.1))
    closed = closed_loop(plant, law, delay)
    closed.__dict__["omega"] = np.geomspace(1e-2, 50.0, 100)
    assert unstable_count(closed) == count


@pytest.mark.parametrize(("power", "radius"), [(3, 2.0), (3, 0.5), (-2, 2.0)])
def test_the_turn_of_a_function_counts_what_is_inside(power, radius):
    around = radius * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 5))
    found = turn_along(lambda s: (s - 0.3) ** power / (s + 1.0), around.astype(complex))
    inside = power - (1 if radius > 1.0 else 0)
    assert found == pytest.approx(2.0 * np.pi * inside)


@pytest.mark.parametrize(("delay", "growing"), [(1.5, 0), (8.0, 4)])
def test_pade_approximations_have_as_many_growing_poles_as_the_dead_time(delay, growing):
    integrator = (np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    law = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1)))
    closed = closed_loop(integrator, law, delay)
    closed.__dict__["omega"] = np.geomspace(1e-3, 50.0, 500)
    found = counted(closed)
    assert found.count == found.growing.size == growing
    assert counted(closed_loop()).count is None


def test_a_loop_around_a_plant_has_the_states_that_link_what_it_reads_and_drives():
    """Four states of which the third is not driven, and a rigid motion that is not seen."""
    a = np.diag([-1.0, -2.0, -3.0, 0.0])
    b = np.array([[1.0, 0, 2.0], [0.5, 0, 0], [0, 7.0, 0], [0, 0, 1.0]])
    c = np.array([[0, 0, 1.0, 0], [1.0, 2.0, 3.0, 0]])
    d = np.array([[0.1, 0, 0], [0.2, 0, 0.3]])
    signals = Signals(["u", "v", "w"], ["x", "y"], ["u", "v", "w"], ["x", "y"])
    names = Names(signals, ("a", "b", "c", "d"), ("a",))
    laws = {("w", "y"): control.tf([2.0], [1.0, 4.0]), ("u", "y"): 0.5}
    found = closed_around((a, b, c, d), feedback(laws, signals), names)
    assert (found.inputs, found.measured) == (("w", "u"), (("y",), ("y",)))
    assert (found.states, found.modes, found.step, found.held) == (("a", "b"), ("a",), 0.0, None)
    for s in (0.3 + 1.0j, 2.0j):
        plant = value((a, b, c, d), s)[0]
        np.testing.assert_allclose(value(found.plant, s)[0], plant[[1]][:, [2, 0]])
        np.testing.assert_allclose(value(found.controller, s)[0], [[2.0 / (s + 4.0)], [0.5]])
    sampled = {("w", "y"): control.tf([2.0], [1.0, -0.4], 0.3)}
    late = closed_around((a, b, c, d), feedback(sampled, signals), names)
    assert (late.step, late.inputs) == (0.3, ("w",))
    np.testing.assert_allclose(late.held[0], [[-1.0]])
    np.testing.assert_allclose(late.plant[0], [[np.exp(-0.3)]])
    np.testing.assert_allclose(late.plant[1], [[2.0 * (1.0 - np.exp(-0.3))]])


@pytest.mark.parametrize("step", [0.0, 0.1])
def test_motion_at_rest_that_a_loop_does_not_touch_is_no_part_of_it(step):
    """Two that the input drives together and the output sees together: one moves."""
    a = np.eye(2) if step else np.zeros((2, 2))
    plant = (a, np.array([[1.0], [2.0]]), np.array([[1.0, 0.5]]), np.zeros((1, 1)))
    signals = Signals(["u"], ["y"], ["u"], ["y"])
    fed = feedback({("u", "y"): control.tf([1.0], [1.0, 0.5], step)}, signals)
    found = closed_around(plant, fed, Names(signals, ("a", "b"), ()), step)
    assert len(found.states) == 1
    z = 0.4 + 0.3j
    np.testing.assert_allclose(value(found.plant, z), value(plant, z))
    assert (found.step, found.held) == (step, None)


def test_poles_at_z_zero_are_left_out():
    """z = 0.5 is fed back with the gain 0.5."""
    plant = control.ss([[0.5]], [[1.0]], [[1.0]], 0.0, 0.1)
    assert bc.margins(plant, control.ss([], [], [], 0.5)).poles.size == 0
    (pole,) = bc.margins(plant, control.ss([], [], [], 0.3)).poles
    assert pole == pytest.approx(np.log(0.2) / 0.1)
