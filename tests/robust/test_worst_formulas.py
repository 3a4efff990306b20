"""Closed forms beside the gains and margins of uncertain loops: a body on a spring and a damper,
both uncertain, under a PD controller with a dead time."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure as Picture

import beamchain as bc
from beamchain.robust.least_margins import Extremum
from beamchain.robust.uncertain_plant import UncertainPlant
from formulas import balanced_bounds, structured_bound
from robust_doors import (
    Figure,
    Search,
    UncertainLoop,
    drawn_figure,
    plot_steps,
    plot_worst,
    worst_figure,
    worst_table,
)

MASS, SPRING, DAMPER = 2.0, 18.0, 0.5
SOFTER, WEAKER = 0.3, 0.5  # relative uncertainty
P, D, DELAY = 6.0, 2.0, 0.04
# x'' = (u - k x - d v - w1 - w2) / m;  z1 = 0.3 k x, z2 = 0.5 d v
SYSTEM = (
    np.array([[0.0, 1.0], [-SPRING / MASS, -DAMPER / MASS]]),
    np.array([[0.0, 0.0, 0.0], [-1.0, -1.0, 1.0]]) / MASS,
    np.array([[SOFTER * SPRING, 0.0], [0.0, WEAKER * DAMPER], [1.0, 0.0]]),
    np.zeros((3, 3)),
)
CONTROLLER = bc.spec.Controller(
    loop=(
        bc.spec.Loop(
            input="torque", output="angle", numerator=[D, P], denominator=[0.05, 1.0], delay=DELAY
        ),
    )
)
DELTAS = np.array([-0.4, 0.7])


def plant_at(deltas, s):
    k, d = SPRING * (1.0 + SOFTER * deltas[0]), DAMPER * (1.0 + WEAKER * deltas[1])
    return 1.0 / (MASS * s**2 + d * s + k)


def law_at(s):
    return (D * s + P) / (0.05 * s + 1.0) * np.exp(-DELAY * s)


def closed_at(deltas, omega):
    """From a torque on the body to its angle."""
    s = 1j * omega
    return plant_at(deltas, s) / (1.0 + law_at(s) * plant_at(deltas, s))


def middle_at(deltas, omega):
    """E = S - 1/2."""
    s = 1j * omega
    return 1.0 / (1.0 + law_at(s) * plant_at(deltas, s)) - 0.5


def loops():
    return UncertainLoop(SYSTEM, [0, 1], ["torque"], ["angle"], CONTROLLER, ("torque", "angle"))


def quotient(function, deltas, k, size=1e-6):
    change = size * np.eye(2)[k]
    return (function(deltas + change) - function(deltas - change)) / (2.0 * size)


def test_gain_of_a_sample_its_slopes_and_its_peak():
    made, omega = loops(), np.array([0.5, 3.0, 9.0])
    assert made.gain(DELTAS, omega) == pytest.approx(np.abs(closed_at(DELTAS, omega)), rel=1e-9)
    for w in omega:
        slope = made.slope(0, DELTAS, w)
        for k in range(2):
            wanted = quotient(lambda at, w=w: np.log(np.abs(closed_at(at, w))), DELTAS, k)
            assert slope[k] == pytest.approx(wanted, rel=1e-6)
    fine = np.linspace(0.1, 8.0, 100_001)
    sizes = np.abs(closed_at(DELTAS, fine))
    found = made.reach(DELTAS)
    assert found.stable
    assert found.sizes == pytest.approx([sizes.max()], rel=1e-6)
    assert found.omega == pytest.approx([fine[sizes.argmax()]], abs=1e-2)


def test_a_gain_without_resonance_is_largest_at_rest():
    """1 / (s + 2) under a gain of 3: 1 / 5."""
    plant = tuple(np.array([[value]]) for value in (-2.0, 1.0, 1.0, 0.0))
    law = bc.spec.Controller(
        loop=(bc.spec.Loop(input="u", output="y", numerator=[3.0], denominator=[1.0]),)
    )
    found = UncertainLoop(plant, [], ["u"], ["y"], law, ("u", "y")).reach(np.zeros(0))
    assert found.sizes == pytest.approx([0.2], rel=1e-5)
    assert found.omega < 0.02


def test_the_worst_sample_is_the_worst_of_a_grid():
    fine = np.linspace(0.1, 8.0, 4001)
    sides = np.linspace(-1.0, 1.0, 9)
    every = {at: np.abs(closed_at(np.array(at), fine)).max() for at in product(sides, sides)}
    search = Search(loops())
    search.run([DELTAS, np.zeros(2)])
    assert search.sizes == pytest.approx([max(every.values())], rel=1e-5)
    assert tuple(search.worst(0)) == pytest.approx(max(every, key=every.get))


def test_a_start_is_felt_for_as_long_as_the_slowest_pole_needs():
    """One pole after the other of a loop without a dead time, by its exponentials."""
    without = bc.spec.Controller(
        loop=(
            bc.spec.Loop(input="torque", output="angle", numerator=[D, P], denominator=[0.05, 1.0]),
        )
    )
    made = UncertainLoop(SYSTEM, [0, 1], ["torque"], ["angle"], without, ("torque", "angle"))
    k, d = SPRING * (1.0 + SOFTER * DELTAS[0]), DAMPER * (1.0 + WEAKER * DELTAS[1])
    top = np.poly1d([0.05, 1.0])
    bottom = np.poly1d([MASS, d, k]) * top + np.poly1d([D, P])
    poles = bottom.roots
    omega, share = 2.0, 1e-3
    left = np.abs(top(poles) / bottom.deriv()(poles) / (1j * omega - poles))
    gain = abs(top(1j * omega) / bottom(1j * omega))
    time = made.settling(DELTAS, omega, share)
    assert left @ np.exp(poles.real * time) == pytest.approx(share * gain, rel=1e-6)
    assert made.settling(DELTAS, omega, 1e3) == 0.0


def test_margins_of_a_sample_reach_as_far_as_the_sensitivity_does():
    made = UncertainLoop(SYSTEM, [0, 1], ["torque"], ["angle"], CONTROLLER)
    fine = np.geomspace(0.05, 500.0, 400_001)
    e = middle_at(DELTAS, fine)

    def crossings(turned):
        at = np.flatnonzero(turned[:-1].imag * turned[1:].imag <= 0.0)
        return turned[at].real

    wanted = {
        None: np.abs(e).max(),
        1.0: crossings(e).max(),
        -1.0: crossings(-e).max(),
        1j: np.abs(crossings(e / 1j)).max(),
    }
    sizes, omega = made.reach(DELTAS)
    for (port, ray), size in zip(made.figures, sizes, strict=True):
        assert port == 0
        assert size == pytest.approx(max(wanted[ray], 0.0), rel=1e-3, abs=1e-6), ray
    for figure in range(len(made.figures)):
        if not np.isfinite(omega[figure]) or sizes[figure] < 0.1:
            continue
        slope = made.slope(figure, DELTAS, omega[figure])
        for k in range(2):
            by_reach = quotient(
                lambda at, f=figure: np.log(made.reach(at).sizes[f]), DELTAS, k, 1e-2
            )
            assert slope[k] == pytest.approx(by_reach, rel=5e-3, abs=1e-4)


# L = 1.02 / (s + 1 + 0.3 delta), which lags, and 1.02 (1 + 0.01 delta) s / (s + 1), which leads
LAGS = np.array([[-1.0]]), np.array([[-1.0, 1.0]]), np.array([[0.3], [1.0]]), np.zeros((2, 2))
LEADS = (
    np.array([[-1.0]]), np.array([[0.0, 1.0]]), np.array([[-0.01], [-1.0]]),
    np.array([[0.0, 0.01], [1.0, 1.0]]),
)  # fmt: skip


@pytest.mark.parametrize(
    ("plant", "cosine", "omega"),
    [
        (LAGS, lambda delta: (1.0 + 0.3 * delta) / 1.02, np.sqrt(1.02**2 - 1.0)),
        (LEADS, lambda delta: 1.0 / (1.02 * (1.0 + 0.01 * delta)), 1.0 / np.sqrt(1.02**2 - 1.0)),
    ],
)
def test_a_large_phase_margin_has_the_slope_of_a_small_reach(plant, cosine, omega):
    """L is of size one at a small angle t, and E there j tan(t / 2) / 2, or minus that."""
    law = bc.spec.Controller(
        loop=(bc.spec.Loop(input="u", output="y", numerator=[1.02], denominator=[1.0]),)
    )
    made = UncertainLoop(plant, [0], ["u"], ["y"], law)

    def reach(delta):
        return np.tan(np.arccos(cosine(delta)) / 2.0) / 2.0

    at = made.figures.index(Figure(0, 1j))
    assert reach(0.0) < 0.1
    assert made.reach(np.zeros(1)).sizes[at] == pytest.approx(reach(0.0), rel=1e-3)
    wanted = (np.log(reach(1e-6)) - np.log(reach(-1e-6))) / 2e-6
    assert made.slope(at, np.zeros(1), omega) == pytest.approx([wanted], rel=1e-5)


def test_of_unstable_samples_one_is_found():
    """x' = 2 delta x + u under a gain of 1: it grows beyond delta = 1/2."""
    plant = np.zeros((1, 1)), np.array([[1.0, 1.0]]), np.array([[2.0], [1.0]]), np.zeros((2, 2))
    law = bc.spec.Controller(
        loop=(bc.spec.Loop(input="u", output="y", numerator=[1.0], denominator=[1.0]),)
    )
    made = UncertainLoop(plant, [0], ["u"], ["y"], law)
    search = Search(made)
    search.run([np.zeros(1), np.array([0.4]), np.array([0.6])])
    assert not search.stable
    (found,) = search.found()
    assert found[0] > 0.5
    a, b, c, d = plant
    grows = a + b[:, :1] * found @ c[:1], b[:, 1:], c[1:], d[1:, 1:]
    assert not made.margins(grows).stable


def test_what_drifts_is_held_by_no_loop():
    """Two bodies at rates of their own, one of which a loop holds."""
    plant = np.zeros((2, 2)), np.eye(2), np.eye(2), np.zeros((2, 2))
    law = bc.spec.Controller(
        loop=(bc.spec.Loop(input="u", output="x", numerator=[1.0], denominator=[1.0]),)
    )
    for ends, held in ((("u", "x"), True), (("v", "y"), False)):
        given = plant, [], ["u", "v"], ["x", "y"], law, ends
        if held:
            UncertainLoop(*given).check_gain()
            assert UncertainLoop(*given).poles == pytest.approx([-1.0])
        else:
            with pytest.raises(bc.InputError, match="not stable"):
                UncertainLoop(*given).check_gain()


@pytest.mark.parametrize("slow", [1.0, 0.01])
def test_undamped_poles_are_allowed_where_that_is_said(slow):
    """9 + 7 = 4^2, in any unit of time: a disk margin may be asked of it, a gain not."""
    plant = (
        np.array([[0.0, slow], [-9.0 * slow, 0.0]]), np.array([[0.0], [slow]]),
        np.array([[1.0, 0.0]]), np.zeros((1, 1)),
    )  # fmt: skip
    law = bc.spec.Controller(
        loop=(bc.spec.Loop(input="u", output="y", numerator=[7.0], denominator=[1.0]),)
    )
    given = plant, [], ["u"], ["y"], law, ("u", "y")
    made = UncertainLoop(*given)
    assert np.abs(made.poles) == pytest.approx([4.0 * slow] * 2)
    with pytest.raises(bc.InputError, match="not stable"):
        made.check_gain()


@pytest.mark.parametrize("bound", [True, False])
def test_what_no_value_lets_a_disk_margin_fall_below_is_one_over_its_bound(monkeypatch, bound):
    """Stated are the least of the margins at all values that were found: here 40 and -30 degrees,
    which is less, and gains that may fall to 0.2 and 0.4, which is more."""

    def margins(_, deltas):
        nominal = not np.any(deltas)
        loop = SimpleNamespace(
            input="torque",
            **{name: first if nominal else second for name, first, second in (
                ("disk", 0.9, 0.7), ("disk_frequency", 3.0, 4.0), ("gain", 3.0, 3.5),
                ("gain_frequency", 5.0, 6.0), ("lowest_gain", 0.2, 0.4),
                ("lowest_gain_frequency", 1.0, 2.0), ("phase", 40.0, -30.0),
                ("phase_frequency", 7.0, 8.0),
            )},
        )  # fmt: skip
        at_once = Extremum(0.5, 9.0) if nominal else Extremum(0.6, 10.0)
        return SimpleNamespace(stable=True, loops=[loop], all_at_once=at_once)

    made = UncertainPlant.__new__(UncertainPlant)

    made._system, made._group, made._of = SYSTEM, np.array([0, 1]), np.array([0, 1])
    made.inputs, made.outputs = ["torque"], ["angle"]
    made.quantities = tuple(
        SimpleNamespace(name=name, nominal=nominal, reach=share * nominal, unit="", key=name)
        for name, nominal, share in (("k", SPRING, SOFTER), ("d", DAMPER, WEAKER))
    )
    made.blocks = (made._block(0), made._block(1))
    made.drawn_deltas = lambda *_: np.zeros((0, 2))
    made.found, made._margins = [], margins
    monkeypatch.setattr(Search, "found", lambda _: [DELTAS])
    monkeypatch.setattr(Search, "run", lambda search, starts: search.reach(DELTAS))
    made._bound = lambda *_: SimpleNamespace(gain=2.5)
    found = made.worst_margins(CONTROLLER, bound=bound)
    assert [(row.nominal, row.worst, row.frequency) for row in found] == [
        (0.9, 0.7, 4.0), (3.0, 3.0, 5.0), (0.2, 0.4, 2.0), (40.0, -30.0, 8.0), (0.5, 0.5, 9.0),
    ]  # fmt: skip
    assert [row.proved for row in found] == [0.4 if bound else None] + [None] * 4
    assert found[0].values == pytest.approx(made.values(DELTAS))
    assert found[1].values == pytest.approx({"k": SPRING, "d": DAMPER})


def test_corners_to_which_slopes_point_are_the_worst_of_all_corners():
    """Four bodies side by side on springs of their own, which are uncertain: of all corners, those
    at which E reaches farthest, in size and along both axes, either way."""
    squares, ratios = np.array([2.0, 9.0, 17.0, 30.0]), np.array([0.2, 0.3, 0.5, 0.9])
    gains, ranges = np.array([1.0, 0.7, 0.9, 1.4]), np.array([0.3, 0.4, 0.3, 0.2])
    a = np.zeros((8, 8))
    a[:4, 4:], a[4:, :4], a[4:, 4:] = np.eye(4), -np.diag(squares), -np.diag(ratios)
    b, c = np.zeros((8, 5)), np.zeros((5, 8))
    b[4:, :4], b[4:, 4] = -np.eye(4), 1.0
    c[:4, :4], c[4, :4] = np.diag(ranges * squares), gains
    made = UncertainLoop(
        (a, b, c, np.zeros((5, 5))), [0, 1, 2, 3], ["torque"], ["angle"], CONTROLLER
    )
    s = 1j * np.geomspace(0.1, 50.0, 1500)

    def reached(deltas):
        springs = (squares * (1.0 + ranges * deltas))[:, None]
        plant = gains @ (1.0 / (s**2 + ratios[:, None] * s + springs))
        e = 1.0 / (1.0 + law_at(s) * plant) - 0.5
        return np.array([np.abs(e).max(), *((e * way).real.max() for way in (1, -1, 1j, -1j))])

    every = np.max([reached(np.array(at)) for at in product((-1.0, 1.0), repeat=4)], axis=0)
    corners = made.corners()
    assert all(set(np.abs(deltas)) <= {0.0, 1.0} for deltas in corners)
    found = np.max([reached(deltas) for deltas in corners], axis=0)
    assert found[every > 0.5] == pytest.approx(every[every > 0.5], rel=1e-3)
    assert np.sum(every > 0.5) >= 4


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_bound_of_a_matrix_of_rank_one_is_the_sum_of_its_diagonal_s_sizes(size):
    """mu of u v^H is sum |u_i v_i|, and scaling reaches it."""
    random = np.random.default_rng(size)
    u, v = random.normal(size=(2, size)) + 1j * random.normal(size=(2, size))
    scale = 10.0 ** random.uniform(-2.0, 2.0, size)
    m = np.outer(scale * u, v.conj() / scale)
    wanted = np.sum(np.abs(u * v))
    assert structured_bound(m) == pytest.approx(wanted, rel=1e-5)
    assert balanced_bounds(m[None])[0] == pytest.approx(wanted, rel=1e-3)


def test_bound_of_a_matrix_without_its_diagonal():
    """Two channels in a ring: mu is the root of the product."""
    m = np.array([[0.0, 8.0j], [0.5, 0.0]])
    assert structured_bound(m) == pytest.approx(2.0, rel=1e-6)
    assert balanced_bounds(np.array([m, 3.0 * m])) == pytest.approx([2.0, 6.0], rel=1e-3)


# -- tables and pictures ---------------------------------------------------------------------------
def drawn(**more):
    omega = np.array([0.5, 2.0, 8.0])
    given = {
        "omega": omega, "worst": omega**2, "nominal": omega, "bound": None, "frequency": 2.0,
        "simulated": 4.1, "input": "torque", "output": "angle", "unit": "rad per N m",
        "drawn": np.array([3.0, np.inf, 1.0, 2.0]), "gain": 5.0,
    }  # fmt: skip
    return SimpleNamespace(**given | more)


def test_worst_cases_are_told_by_their_poses_where_there_are_several():
    """A bound stands before the unit, where there is one."""
    one = drawn(stable=True, pose="rest")
    bounded = drawn(stable=False, pose="folded", bound=SimpleNamespace(gain=7.0), drawn=())
    columns = [(each.name, list(each.values)) for each in worst_table([one]).columns]
    assert columns == [
        ("disturbance → output", ["torque → angle"]),
        ("worst sample, predicted", [5.0]),
        ("worst sample, MuJoCo", [4.1]),
        ("at", [2.0]),
        ("worst of the draws", [np.inf]),
        ("unit", ["rad per N m"]),
    ]
    columns = {each.name: list(each.values) for each in worst_table([one, bounded]).columns}
    assert list(columns)[-2:] == ["no value exceeds", "unit"]
    assert columns["no value exceeds"] == [np.inf, 7.0]
    assert columns["disturbance → output"] == ["rest: torque → angle", "folded: torque → angle"]
    assert columns["worst sample, predicted"] == [5.0, np.inf]


def test_peak_gains_of_draws_rise_to_the_share_that_is_stable():
    """Of four draws one is unstable; the worst sample's is a line across."""
    (ax,) = drawn_figure([drawn(), drawn(gain=np.inf, drawn=np.array([7.0]))]).axes
    draws, worst, other = ax.get_lines()
    assert draws.get_xydata().tolist() == [[1.0, 0.25], [2.0, 0.5], [3.0, 0.75]]
    assert list(worst.get_xdata()) == [5.0, 5.0]
    assert other.get_xydata().tolist() == [[7.0, 1.0]]


def test_worst_cases_stand_one_below_the_other():
    figure = worst_figure([drawn(), drawn(simulated=np.nan)])
    first, second = figure.axes
    top, bottom = (ax.get_position().y0 for ax in (first, second))
    assert top > bottom
    assert figure.get_size_inches()[1] == pytest.approx(2.0 * worst_figure([drawn()]).
                                                        get_size_inches()[1])  # fmt: skip
    worst, nominal, peak = first.get_lines()
    assert worst.get_ydata().tolist() == [0.25, 4.0, 64.0]
    assert nominal.get_ydata().tolist() == [0.5, 2.0, 8.0]
    assert peak.get_xydata().tolist() == [[2.0, 4.1]]
    assert len(second.get_lines()) == 2


def test_a_worst_case_stands_alone_where_no_picture_is_given():
    ax = plot_worst(drawn())
    assert ax.figure.axes == [ax]
    assert [line.get_ydata().tolist() for line in ax.get_lines()] == [
        [0.25, 4.0, 64.0],
        [0.5, 2.0, 8.0],
        [4.1],
    ]


def test_a_bound_is_drawn_as_steps_within_the_picture():
    ax = Picture().add_subplot()
    ax.set_xlim(0.5, 4.0)
    edges, gains = np.array([0.0, 1.0, 2.0, np.inf]), np.array([3.0, np.inf, 6.0])
    plot_steps(SimpleNamespace(edges=edges, gains=gains), ax)
    (steps,) = ax.patches
    values, ends, _ = steps.get_data()
    assert ends.tolist() == [0.5, 1.0, 2.0, 4.0]
    assert values[[0, 2]].tolist() == [3.0, 6.0]
    assert np.isnan(values[1])
    assert ax.get_xlim() == (0.5, 4.0)
