"""The mode that pays most, of candidates whose errors stand in a table; how appendages grow, and
which modes go again."""

from dataclasses import dataclass, field, replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from formulas import best_mode, grow, prune


class Table:
    """A judge with known errors: `least` where the error is highest now, `whole` in the band."""

    def __init__(self, least, whole):
        self.least, self.whole, self.tried = least, whole, []

    def floor(self, models):
        assert models == ["one", "two"]
        return lambda others: self.least[tuple(others)]

    def of_models(self, models, tolerance):
        assert tolerance == 1e-3
        self.tried.append(tuple(models))
        return self.whole[tuple(models)]


def searched(least, whole, most, newest):
    """What is found, and what was tried."""
    keys = {(0, "xy"): ("ONE", "two"), (0, "xz"): ("One", "two"), (1, "xy"): ("one", "TWO")}
    judge = Table(
        dict(zip(keys.values(), least, strict=True)), dict(zip(keys.values(), whole, strict=True))
    )
    offers = {
        key: SimpleNamespace(model=models[key[0]], newest=w)
        for (key, models), w in zip(keys.items(), newest, strict=True)
    }
    return best_mode(judge, ["one", "two"], offers, most, 1e-3), judge.tried


@pytest.mark.parametrize(
    ("least", "whole", "found", "tries"),
    [
        ((0.3, 0.1, 0.5), (0.4, 0.2, 0.6), (0, "xz"), 1),  # the others stand at 0.3 and more
        ((0.3, 0.1, 0.2), (0.35, 0.4, 0.25), (1, "xy"), 2),
        ((0.3, 0.3, 0.3), (0.3, 0.3, 0.3), (1, "xy"), 3),  # the slowest of equal ones
        ((0.3, 0.95, 0.95), (0.95, 0.99, 0.99), None, 1),  # none leaves 0.9 or less
        ((0.95, 0.95, 0.95), (0.0, 0.0, 0.0), None, 0),
        # the error is no smaller than at any frequency, whatever a coarser grid says
        ((0.3, 0.4, 0.6), (0.1, 0.2, 0.2), (0, "xy"), 1),
    ],
)
def test_the_mode_is_found_that_leaves_the_least_error(least, whole, found, tries):
    got, tried = searched(least, whole, 0.9, (5.0, 4.0, 3.0))
    assert got == found
    assert len(tried) == tries


# -- growing ---------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Boom:
    """Of so many modes, which is all that its model is."""

    at: str
    modes: int = 1

    @property
    def model(self):
        return self.modes

    newest = 1.0

    @property
    def added(self):
        return f"mode {self.modes} of {self.at}"

    def offers(self, band):
        assert band == 7.0
        return {"xy": Boom(self.at, self.modes + 1)}

    def part(self, offer):
        return f"part {offer}"

    def without(self, part):
        assert part == "part xy"
        return self.at, self.modes


def grown(error, alone, most=9, barred=(), tolerance=0.21):
    """Modes of two booms, and the steps that led to them; `alone`: what the lack of each costs."""

    def pose(factor):
        return SimpleNamespace(
            band=7.0,
            of_models=lambda models, tolerance=None: factor * error(*models),
            floor=lambda models: lambda others: 0.0,
            of_exchange=lambda i, left: factor * alone["ab".index(left[0])],
        )

    poses = {"rest": pose(0.5), "folded": pose(1.0)}
    booms, steps = grow(
        poses,
        [Boom("a"), Boom("b")],
        tolerance,
        lambda i, longer: i not in barred and longer.modes <= most,
    )
    return [boom.modes for boom in booms], steps


def whose(steps):
    return ["ab"[step.number] for step in steps]


def test_appendages_grow_by_the_mode_that_leaves_the_least_error_in_the_worst_pose():
    """2^-m + 0.6 2^-n: 0.8, 0.55, 0.4, 0.275, 0.2."""

    def error(m, n):
        return 0.5**m + 0.6 * 0.5**n

    modes, steps = grown(error, ())
    assert (modes, whose(steps)) == ([3, 3], ["a", "b", "a", "b"])
    assert [step.added for step in steps] == [
        "mode 2 of a",
        "mode 2 of b",
        "mode 3 of a",
        "mode 3 of b",
    ]
    assert [(step.before, step.after) for step in steps] == [
        pytest.approx(pair) for pair in ((0.8, 0.55), (0.55, 0.4), (0.4, 0.275), (0.275, 0.2))
    ]

    def short(*given, **more):
        modes, steps = grown(error, *given, **more)
        return modes, whose(steps)

    assert short((), tolerance=0.3) == ([3, 2], ["a", "b", "a"])
    assert short((), tolerance=0.9) == ([1, 1], [])
    assert short((0.0, 0.0), most=2) == ([2, 2], ["a", "b"])
    assert short((0.0, 0.0), barred=[0], tolerance=0.6) == ([1, 3], ["b"] * 2)


@pytest.mark.parametrize(("tolerance", "count"), [(0.4041, 2), (0.4039, 3)])
def test_1_01_times_the_error_keeps_the_tolerance(tolerance, count):
    """It is 0.4 after two steps."""
    _, steps = grown(lambda m, n: 0.5**m + 0.6 * 0.5**n, (), tolerance=tolerance)
    assert len(steps) == count


@pytest.mark.parametrize(
    ("alone", "modes"),
    [((0.06, 0.02), [3, 1]), ((0.04, 0.02), [1, 1]), ((0.07, 0.08), [3, 9])],
)
def test_where_no_mode_pays_that_grows_whose_lack_alone_costs_most(alone, modes):
    """Of a only the third mode helps; less than a twentieth of the error is not its cause."""
    found, steps = grown(lambda m, n: 0.1 if m > 2 else 1.0, alone)
    assert found == modes
    assert whose(steps) == ["b"] * (modes[1] - 1) + ["a"] * (modes[0] - 1)


@pytest.mark.parametrize(("alone", "modes"), [(0.22, [3, 1]), (0.2, [1, 1])])
def test_what_alone_costs_more_than_the_tolerance_is_mended_however_large_the_error(alone, modes):
    """0.21, where a twentieth of the error is 0.45."""
    found, _ = grown(lambda m, n: 0.1 if m > 2 else 9.0, (alone, 0.02))
    assert found == modes


def test_what_a_lack_costs_is_asked_anew_where_a_mode_was_added():
    """A lack costs as much as there are modes missing to five, so that both grow in turns; the
    sixth mode pays."""
    asked = []

    def of_exchange(i, left):
        asked.append(left)
        return 5.0 - left[1] - 0.1 * i

    judge = SimpleNamespace(
        band=7.0,
        of_models=lambda models, tolerance=None: 0.1 if sum(models) > 5 else 1.0,
        floor=lambda models: lambda others: 0.0,
        of_exchange=of_exchange,
    )
    booms, steps = grow({"rest": judge}, [Boom("a"), Boom("b")], 0.2, lambda i, longer: True)
    assert [boom.modes for boom in booms] == [4, 2]
    assert whose(steps) == ["a", "b", "a", "a"]
    assert asked == [("a", 1), ("b", 1), ("a", 2), ("b", 2)]


# -- modes that are not needed ---------------------------------------------------------------------
@dataclass(frozen=True)
class Ported:
    """Of so many modes in each of several ports."""

    counts: dict
    most: dict = field(default_factory=lambda: {"xy": 9, "xz": 9})
    typed: tuple = ()
    added: str = ""
    newest: float = 0.0

    @property
    def model(self):
        return tuple(self.counts.values())

    def offers(self, band):
        del band
        return {
            port: replace(
                self,
                counts={**self.counts, port: count + 1},
                added=f"{port} {count + 1}",
                newest=count + 1.0,
            )
            for port, count in self.counts.items()
            if port not in self.typed and count < self.most[port]
        }

    def part(self, port):
        return port

    def without(self, port):
        """The number of modes of a port; those of the others are all there."""
        return tuple(self.counts[p] if p == port else most for p, most in self.most.items())

    def droppable(self, band, least):
        assert band == 7.0
        assert least
        return tuple(port for port in self.counts if port not in self.typed)

    def dropping(self, port, least):
        if self.counts[port] <= least[port]:
            return None
        return replace(self, counts={**self.counts, port: self.counts[port] - 1})


def judge(error):
    """By the numbers of modes of all ports."""
    return SimpleNamespace(
        band=7.0,
        of_models=lambda models, tolerance=None: error(*models[0]),
        of_exchange=lambda i, left: error(*left),
        floor=lambda models: lambda others: 0.0,
    )


def pruned(errors, counts, least=(0, 0), otherwise=5.0, tolerance=1.0, typed=()):
    item = Ported(dict(zip(("xy", "xz"), counts, strict=True)), typed=typed)
    least = dict(zip(("xy", "xz"), least, strict=True))
    table = judge(lambda *at: errors.get(at, otherwise))
    return prune(table, item, least, tolerance).model


def test_modes_that_are_not_needed_go_again():
    errors = {(2, 2): 0.8, (1, 2): 0.9, (1, 1): 0.95, (0, 1): 2.0, (1, 0): 2.0}
    assert pruned(errors, (2, 2)) == (1, 1)
    # 1.01 times the error keeps the tolerance
    assert pruned({**errors, (1, 1): 0.98}, (2, 2)) == (1, 1)
    assert pruned({**errors, (1, 1): 0.995}, (2, 2)) == (1, 2)
    # but not those that are needed, though the way down is easy and there is no way up again
    falling = {(3, 3): 0.9, (2, 3): 4.0, (1, 3): 0.5, (0, 3): 0.4, (3, 2): 4.5, (3, 1): 0.2}
    assert pruned(falling, (3, 3), otherwise=7.0) == (3, 3)


def test_where_the_tolerance_is_missed_modes_go_that_do_not_lower_the_error():
    errors = {(1, 2): 2.0, (0, 2): 1.9, (0, 1): 2.1, (0, 3): 2.0, (1, 1): 2.0}
    assert pruned(errors, (1, 2)) == (0, 2)
    errors = {(2, 2): 2.0, (1, 2): 2.0, (0, 2): 2.01, (1, 1): 2.0, (1, 0): 2.01}
    assert pruned(errors, (2, 2)) == (1, 1)
    # one that brings the tolerance is taken out though the error falls by that
    assert pruned({(2, 0): 2.0, (1, 0): 0.5, (0, 0): 0.9}, (2, 0)) == (0, 0)


@pytest.mark.parametrize(
    ("least", "typed", "wanted"),
    [((0, 0), (), (0, 0)), ((2, 1), (), (2, 1)), ((0, 0), ("xy",), (3, 0)), ((3, 3), (), (3, 3))],
)
def test_the_least_is_kept_though_fewer_would_do(least, typed, wanted):
    assert pruned({}, (3, 3), least, otherwise=0.5, typed=typed) == wanted


# -- every count tried -----------------------------------------------------------------------------
THREE = ("xy", "xz", "torsion")
COUNTED = {"xy": 4, "xz": 3, "torsion": 3}
EVERY = list(product(*(range(COUNTED[p] + 1) for p in THREE)))


def error_of(counts, size, fall, joined):
    left = [size[p] * fall[p] ** counts[p] * (counts[p] < COUNTED[p]) for p in THREE]
    return max(left) + joined * left[0] * left[1]


def chosen(table, tolerance, least=(0, 0, 0)):
    """Counts that are grown from the `least` and pruned, by a table of errors."""
    start = dict(zip(THREE, least, strict=True))
    known = judge(lambda *at: table[at])
    item = Ported(start, most=COUNTED)
    (found,), _ = grow({"hub": known}, [item], tolerance, lambda i, longer: True)
    return prune(known, found, start, tolerance).model


def drawn(seed):
    random = np.random.default_rng(seed)
    size = dict(zip(THREE, random.uniform(0.3, 2.0, 3), strict=True))
    fall = dict(zip(THREE, random.uniform(0.05, 0.6, 3), strict=True))
    return {
        counts: error_of(dict(zip(THREE, counts, strict=True)), size, fall, 0.3) for counts in EVERY
    }


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("tolerance", [0.6, 0.06, 0.006])
def test_the_choice_is_the_fewest_modes_of_all_counts(seed, tolerance):
    table = drawn(seed)
    kept = {counts: e for counts, e in table.items() if 1.01 * e <= tolerance}
    fewest = min(kept, key=lambda counts: (sum(counts), kept[counts]))
    found = chosen(table, tolerance)
    assert sum(found) == sum(fewest)
    assert found == fewest


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("tolerance", [0.3, 0.03, 1e-4])
@pytest.mark.parametrize("least", [(0, 0, 0), (1, 0, 2)])
def test_no_mode_of_the_choice_can_go(seed, tolerance, least):
    """Errors that fall with every mode, but each by a draw of its own that depends on all the
    others."""
    random = np.random.default_rng(seed)
    table = {}
    for counts in EVERY:
        fewer = [
            table[tuple(c - (k == p) for p, c in enumerate(counts))] for k in range(3) if counts[k]
        ]
        table[counts] = min(fewer, default=3.0) * float(random.uniform(0.2, 1.0))
    found = chosen(table, tolerance, least)
    assert all(np.array(found) >= least)
    for k in range(3):
        if found[k] > least[k]:
            less = table[tuple(c - (k == p) for p, c in enumerate(found))]
            assert 1.01 * less > tolerance
            assert less > table[found]
