"""Closed forms beside uncertain plants and poses: deltas and values, frequencies of curves, modes
that are followed, scaled bounds, words on what grows."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import beamchain as bc
from beamchain.control.instability import sentences
from beamchain.control.scheduled import ScheduledPlant, in_one_order, reduced_alike
from beamchain.craft.modal_form import ModalForm
from beamchain.engine.normal_modes import NormalModes
from beamchain.robust.least_margins import ALL, LeastMargin, WorstMargins
from beamchain.robust.lft import Lft
from beamchain.robust.uncertain_plant import UncertainPlant
from formulas import follow_modes, power_sum, structured_bound
from robust_doors import Reach


# -- deltas and values -----------------------------------------------------------------------------
def uncertain(of=UncertainPlant):
    """Three quantities of two deltas: `a` alone, `b` and `c` together."""
    made = of.__new__(of)
    made.quantities = tuple(
        SimpleNamespace(name=name, nominal=nominal, reach=reach, unit="kg", key=key)
        for name, nominal, reach, key in (
            ("b", 10.0, 2.0, "pair"), ("a", 5.0, 0.5, "a"), ("c", -4.0, 1.0, "pair"),
        )
    )  # fmt: skip
    made._group = np.array([0, 1, 0])
    made._of = np.array([0, 2, 2, 1])
    made.blocks = (made._block(0), made._block(1))
    made.found = []
    return made


def test_the_bound_of_a_search_is_asked_for_in_its_time():
    made, asked = uncertain(), []
    made._gain_search = lambda *given: asked.append(given) or "search"
    made._bound = lambda found, grid, seconds: f"bound of {found} at {grid} in {seconds} s"
    found = made.bound("law", "in", "out", [1.0], samples=7, seed=5, seconds=3.0)
    assert found == "bound of search at [1.] in 3.0 s"
    assert asked == [("law", "in", "out", 7, 5)]


def test_values_of_deltas_and_deltas_of_values():
    made = uncertain()
    assert [block.name for block in made.blocks] == ["pair", "a"]
    assert [block.repetitions for block in made.blocks] == [3, 1]
    assert made.blocks[0].quantities == ("b", "c")
    assert made.blocks[0].nominal.tolist() == [10.0, -4.0]
    assert made.values([0.5, -0.2]) == pytest.approx({"b": 11.0, "a": 4.9, "c": -3.5})
    assert made.percent(np.array([0.5, -0.2])) == {"b": 50.0, "a": -20.0, "c": 50.0}
    found = made._deltas({"b": 9.0, "c": -3.4})
    assert found == pytest.approx([-0.5, 0.0, 0.6])
    assert made._deltas([0.5, -0.2]).tolist() == [0.5, -0.2, 0.5]
    assert made._block_deltas({"b": 9.0, "c": -3.4}) == pytest.approx([-0.5, 0.0])


@pytest.mark.parametrize(
    ("stable", "gain", "climbed"), [(True, 2.1, True), (True, 1.9, False), (False, 2.1, False)]
)
def test_a_bound_is_close_at_the_worst_sample_the_nominal_one_and_corners(
    stable, gain, climbed, monkeypatch
):
    """Where its programs find a worse sample than the search, that is where to climb from."""
    asked, climbs = [], []

    def bounder(loops, blocks, samples, omega, seconds):
        asked.append((loops, samples, omega, seconds))
        return SimpleNamespace(bound=lambda: "bound", best=(np.array([0.5, 0.6]), gain))

    monkeypatch.setattr("beamchain.robust.uncertain_plant.Bounder", bounder)
    monkeypatch.setattr("beamchain.robust.uncertain_plant.frequencies", lambda _, grid: 2.0 * grid)
    search = SimpleNamespace(
        loop=SimpleNamespace(controller=bc.spec.Controller(loop=())),
        worst=lambda _: np.array([0.3, -0.4]),
        sizes=np.array([2.0]),
        stable=stable,
        climb=lambda figure, start: climbs.append((figure, start.tolist())),
    )
    assert uncertain()._bound(search, np.array([1.0, 2.0]), 9.0) == "bound"
    ((loops, samples, omega, seconds),) = asked
    assert (loops, omega.tolist(), seconds) == (search.loop, [2.0, 4.0], 9.0)
    assert samples[:2].tolist() == [[0.3, -0.4], [0.0, 0.0]]
    assert set(samples[2:].ravel()) == {-1.0, 1.0}
    assert climbs == ([(0, [0.5, 0.6])] if climbed else [])


def test_a_file_holds_the_plant_with_its_blocks(tmp_path):
    made = uncertain(Lft)
    system = np.diag([-1.0, -2.0]), np.ones((2, 5)), 2.0 * np.ones((6, 2)), np.zeros((6, 5))
    made._system, made._states = system, ["mode", "mode_rate"]
    made._names = (["w1", "w2", "w3", "w4", "push"], ["z1", "z2", "z3", "z4", "turn", "rate"])
    made.units = (["N m"], ["rad", "rad/s"])
    found = json.loads(made.write(tmp_path / "plant.json").read_text())
    assert [np.array(found[name]).tolist() for name in "ABCD"] == [part.tolist() for part in system]
    assert {name: found[name] for name in found if name not in "ABCD"} == {
        "Ts": 0.0,
        "InputName": made._names[0],
        "OutputName": made._names[1],
        "StateName": ["mode", "mode_rate"],
        "InputUnit": ["N m"],
        "OutputUnit": ["rad", "rad/s"],
        "BlockName": ["pair", "a"],
        "BlockRepetitions": [3, 1],
        "QuantityName": ["b", "a", "c"],
        "QuantityUnit": ["kg"] * 3,
        "QuantityBlock": [1, 2, 1],
        "Nominal": [10.0, 5.0, -4.0],
        "Reach": [2.0, 0.5, 1.0],
    }


@pytest.mark.parametrize(
    ("damped", "read", "said"),
    [
        (lambda a, b: 2.0 - 0.3 * a - 0.5 * b, lambda a, b: 4.0, ""),
        (lambda a, b: 2.0 - 0.3 * a - 0.5 * b, lambda a, b: 4.0 + a, "'rate' depends on a "),
        (lambda a, b: 2.0 - 0.3 * a - 0.5 * b, lambda a, b: 4.0 + b, "'rate' depends on b "),
        (lambda a, b: 2.0 - 0.3 * a - 0.5 * b**2, lambda a, b: 4.0, "'angle' depends on b "),
        (lambda a, b: 2.0 - 0.3 * a - 0.5 * b - a * b, lambda a, b: 4.0, "act together"),
    ],
)
def test_a_sample_is_proved_against_the_model_with_its_values(damped, read, said):
    """x' = u - k x, k = 2 - 0.3 a - 0.5 b by two channels; x and 4 x are seen."""
    made = Lft.__new__(Lft)
    made.quantities = tuple(SimpleNamespace(name=name) for name in "ab")
    made.blocks, made._group, made._of = ("a", "b"), np.array([0, 1]), np.array([0, 1])
    craft = SimpleNamespace(
        modes=SimpleNamespace(frequency=np.array([1.0, 5.0])), signals=([], ["angle", "rate"])
    )
    made._source = SimpleNamespace(craft=craft)

    def again(deltas):
        a, b = deltas
        system = (
            np.array([[-damped(a, b)]]), np.ones((1, 1)), np.array([[1.0], [read(a, b)]]),
            np.zeros((2, 1)),
        )  # fmt: skip
        return SimpleNamespace(linear=SimpleNamespace(first_order=lambda: system))

    made._again = again
    outputs = np.array([[0.3], [0.5], [1.0], [4.0]])
    system = np.array([[-2.0]]), np.ones((1, 3)), outputs, np.zeros((4, 3))
    if not said:
        made._prove(system)
        return
    with pytest.raises(bc.InputError, match=said):
        made._prove(system)


def test_the_least_of_a_kind_is_over_inputs_one_at_a_time():
    rows = [
        LeastMargin(at, kind, "", 1.0, worst, 1.0, {}, None, {})
        for at, kind, worst in (
            ("u", "disk", 0.7), ("v", "disk", 0.6), ("u", "phase", 40.0), ("v", "phase", -30.0),
            (ALL, "disk", 0.5),
        )
    ]  # fmt: skip
    found = WorstMargins(tuple(rows), True, {})
    assert found.least() is rows[1]
    assert found.least("phase") is rows[3]
    assert found.all_at_once is rows[4]
    with pytest.raises(bc.InputError, match="'gain'.*phase"):
        found.least("gain")
    with pytest.raises(bc.InputError) as refused:
        WorstMargins((rows[2], rows[4]), True, {}).least("gain")
    assert "disk" not in str(refused.value)


@pytest.mark.parametrize(
    ("value", "kept"), [(12.00005, True), (12.0001, False), (7.99997, True), (7.9999, False)]
)
def test_values_outside_their_range_are_refused_beyond_what_tables_print(value, kept):
    made = uncertain(Lft)
    if kept:
        assert abs(made._deltas({"b": value})[0]) == 1.0
    else:
        with pytest.raises(bc.InputError, match="outside its range, 8 to 12"):
            made._deltas({"b": value})


@pytest.mark.parametrize(
    ("deltas", "kept"),
    [
        ([1.0, -1.0], True),
        ([1.0 + 0.9e-10, 0.0], True),
        ([1.0 + 2e-10, 0.0], False),
        ([1.0], False),
    ],
)
def test_deltas_are_between_minus_one_and_one(deltas, kept):
    made = uncertain(Lft)
    if kept:
        assert made._deltas(deltas).shape == (3,)
    else:
        with pytest.raises(bc.InputError, match="2 blocks"):
            made._deltas(deltas)


# -- frequencies of curves -------------------------------------------------------------------------
def test_curves_draw_together_about_light_resonances():
    poles = np.array([-0.2 + 4.0j, -0.2 - 4.0j, -3.0 + 3.0j, -8.0])
    near = np.array([0.05, 3.9, 4.0, 4.1, 90.0])
    closed = SimpleNamespace(eigenvalues=poles, to_s=lambda s: s, frequencies=lambda *_: near)

    def curves(worst, *omega):
        reaches = [Reach(np.ones(1), np.array([w])) for w in (*omega, worst)]
        search = SimpleNamespace(
            loop=SimpleNamespace(closed=lambda _: closed),
            tried=range(len(reaches)),
            reach=lambda k: reaches[k],
            worst=lambda _: len(reaches) - 1,
        )
        return uncertain()._curves(search)

    # from 0.3 of the lowest peak to 1.5 of the highest resonance or the worst one
    found = curves(5.0, 0.3)
    assert found == pytest.approx([0.09, 3.9, 4.0, 4.1, 7.5])
    lower = curves(0.2, 0.3)
    assert (lower[0], lower[-1]) == pytest.approx((0.06, 1.5 * np.hypot(0.2, 4.0)))


# -- poses -----------------------------------------------------------------------------------------
def test_modes_are_followed_from_pose_to_pose():
    """Two modes of unit mass that change places and turn by 90 degrees in all."""

    def at(angle, mass=1.0):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        order = [0, 1] if angle < 0.7 else [1, 0]
        frequency = np.array([1.0 + angle, 2.4 - angle])[order]
        sign = 1.0 if angle < 1.2 else -1.0
        return NormalModes(
            np.zeros((2, 0)), (), sign * turn[:, order] / np.sqrt(mass), frequency, mass * np.eye(2)
        )

    asked = []

    def between(share):
        asked.append(share)
        return at(share * np.pi / 2.0, 1.0 + share)

    for length, most in ((1.5, np.inf), (0.015, 0)):
        asked.clear()
        way = SimpleNamespace(length=length, at=lambda share: share)
        found = follow_modes(way, between, at(0.0), at(np.pi / 2.0, 2.0), (0.0, 1.0))
        assert len(asked) <= most
        if length > 1.0:
            assert found.frequency == pytest.approx([1.0 + np.pi / 2.0, 2.4 - np.pi / 2.0])
            wanted = np.array([[0.0, -1.0], [1.0, 0.0]]) / np.sqrt(2.0)
            np.testing.assert_allclose(found.shapes, wanted, atol=1e-12)
            assert np.diff(np.sort([0.0, *asked, 1.0])).max() * length <= 0.1
        else:  # too short to look between: alike by the overlap alone
            assert found.frequency == pytest.approx([2.4 - np.pi / 2.0, 1.0 + np.pi / 2.0])


@pytest.mark.parametrize(("length", "middles"), [(0.099, 0), (0.101, 1), (0.25, 3)])
def test_poses_between_are_no_farther_apart_than_a_tenth(length, middles):
    modes = NormalModes(np.zeros((2, 0)), (), np.eye(2), np.array([1.0, 2.0]), np.eye(2))
    asked = []
    way = SimpleNamespace(length=length, at=lambda share: share)
    follow_modes(way, lambda share: asked.append(share) or modes, modes, modes, (0.0, 1.0))
    assert len(asked) == middles
    assert sorted(asked) == [k / (middles + 1.0) for k in range(1, middles + 1)]


@pytest.mark.parametrize(("overlap", "looked"), [(0.94, True), (0.955, False)])
def test_modes_that_are_unlike_are_looked_at_between(overlap, looked):
    """Their overlap squared is below 0.9."""
    turn = np.array([[overlap, -np.sqrt(1.0 - overlap**2)], [np.sqrt(1.0 - overlap**2), overlap]])
    first = NormalModes(np.zeros((2, 0)), (), np.eye(2), np.array([1.0, 2.0]), np.eye(2))
    last = NormalModes(np.zeros((2, 0)), (), turn, np.array([1.0, 2.0]), np.eye(2))
    asked = []
    way = SimpleNamespace(length=0.05, at=lambda share: share)
    follow_modes(way, lambda share: asked.append(share) or last, first, last, (0.0, 1.0))
    assert bool(asked) == looked


def form_of(names, b, c):
    n = len(names)
    a = np.diag(np.arange(1.0, n + 1.0))
    return ModalForm(a, np.array(b)[:, None], np.array(c)[None], np.zeros((1, 1)), names,
                     ("",) * n, np.ones(n), (0, 0))  # fmt: skip


def test_forms_in_one_order_and_with_the_states_that_any_needs():
    one, other = (
        form_of(("x", "y", "z"), [1, 0, 1], [1, 1, 0]),
        form_of(("z", "x", "y"), [0, 1, 1], [0, 1, 0]),
    )
    first, second = in_one_order([one, other])
    assert first.names == second.names == ("x", "y", "z")
    assert np.diag(second.a).tolist() == [2.0, 3.0, 1.0]
    assert in_one_order([one, form_of(("x", "y"), [1, 1], [1, 1])]) is None
    kept = reduced_alike([first, second])
    assert [form.names for form in kept] == [("x",), ("x",)]
    more = form_of(("x", "y", "z"), [0, 1, 0], [0, 1, 0])
    assert [form.names for form in reduced_alike([first, more])] == [("x", "y")] * 2


def test_figures_of_poses_stand_by_mode():
    def plant(modes, frequency):
        return SimpleNamespace(
            modes=modes,
            frequency=np.array(frequency),
            gain=np.array(frequency)[:, None, None] * np.array([[1.0, -2.0]]),
        )

    plants = (plant(("a", "b"), [1.0, 2.0]), plant(("c", "a"), [3.0, 4.0]))
    values = np.array([[0.1, 0.5], [0.2, 1.0]])
    made = ScheduledPlant(plants, ("p", "q"), ("slide", "drive"), ("m", "rad"), values, "drive")
    assert made.modes == ("a", "b", "c")
    np.testing.assert_array_equal(made.frequency, [[1.0, 2.0, np.nan], [4.0, np.nan, 3.0]])
    assert made.gain[1, :, 0, 1].tolist() == [-8.0, 0.0, -6.0]
    assert made.grid[1] == "degrees"
    np.testing.assert_allclose(made.grid[0], np.degrees([0.5, 1.0]))
    slide = ScheduledPlant(plants, ("p", "q"), ("slide", "drive"), ("m", "rad"), values, "slide")
    assert (slide.grid[0].tolist(), slide.grid[1]) == ([0.1, 0.2], "m")
    assert ScheduledPlant(plants, ("p", "q"), (), (), values).grid is None


# -- scaled bounds ---------------------------------------------------------------------------------
def test_the_sum_that_stands_for_the_largest_singular_value_and_its_slope():
    random = np.random.default_rng(13)
    m = random.normal(size=(4, 4)) + 1j * random.normal(size=(4, 4))
    logs = np.array([0.4, -0.7, 0.2])

    def wanted(at):
        d = np.exp(np.append(0.0, at))
        sigma = np.linalg.svd(m * d[:, None] / d, compute_uv=False)
        return np.log(np.sum(sigma**6.0)) / 6.0

    value, slope = power_sum(logs, m, 6.0)
    assert value == pytest.approx(wanted(logs))
    steps = 1e-6 * np.eye(3)
    assert slope == pytest.approx([(wanted(logs + h) - wanted(logs - h)) / 2e-6 for h in steps])
    assert structured_bound(np.zeros((3, 3))) == 0.0
    assert structured_bound(np.array([[3.0 - 4.0j]])) == 5.0


# -- words -----------------------------------------------------------------------------------------
def growing(pole=0.3 + 4.0j, gain=0.5, crossing=4.0, alone=(), without=()):
    return bc.results.Instability(
        pole, "m1", "mode", gain, crossing, dict(alone), tuple(without), 0.0
    )


def test_who_is_to_blame_in_words():
    one = growing(alone={"u": 0.123})
    assert one.sentence.endswith(
        "the loop u alone makes it so, at gains above 0.12 of the nominal."
    )
    both = growing(alone={"u": 0.5, "v": 0.5})
    assert "each of the loops u, v alone makes it so, at gains above 0.5" in both.sentence
    apart = growing(alone={"u": 0.5, "v": 0.0})
    assert (
        "u (at gains above 0.5 of the nominal), v (at any part of its gain) alone" in apart.sentence
    )
    none = growing(without=("u", "v"))
    assert "no loop alone makes it so, all together do, at gains above 0.5" in none.sentence
    assert none.sentence.endswith("and not without u or v.")
    assert none.causes == ("u", "v")
    assert growing().causes == ()
    endless = growing(crossing=np.inf, gain=0.25)
    assert (
        "at 0.25 of the gains of all loops their direct parts have no solution" in endless.finding
    )
    assert endless.as_dict()["crossing"] is None
    assert "no solution" not in one.finding
    assert one.as_dict()["crossing"] == 4.0


def test_several_poles_ask_for_the_sign_once_and_first():
    pushed = [growing(0.3 + 0j, 0.0, 0.0, {name: 0.0}) for name in "vuw"]
    assert sentences(pushed[:1]) == [pushed[0].sentence]
    assert pushed[0].sentence.endswith("is the sign of the numerators right?")
    question, *others = sentences([*pushed, growing()])
    assert question.startswith("Is the sign of the numerators on u, v and w right? 3 poles grow")
    assert len(others) == 4
    assert others[0] == f"{pushed[0].finding}."
    two = sentences(pushed[:2])[0]
    assert "on u and v right? 2 poles" in two
    whole = sentences([growing(0.3 + 0j, 0.0)] * 2)[0]
    assert whole.startswith("Is the sign of the numerators right?")
