"""The mode that pays most, of candidates whose errors stand in a table, and how appendages grow."""

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from formulas import appendages_grown, best_mode

OMEGA = "omega"
EXACT = "exact"


class Table:
    """A pose with known errors: `least` where the error is highest now, `whole` in the band."""

    def __init__(self, least, whole):
        self.least, self.whole, self.tried = least, whole, []

    def tops(self, models):
        assert models == ["one", "two"]
        return OMEGA, EXACT

    def error_at(self, models, omega, exact):
        assert (omega, exact) == (OMEGA, EXACT)
        return self.least[tuple(models)]

    def of_models(self, models, tolerance):
        assert tolerance == 1e-3
        self.tried.append(tuple(models))
        return self.whole[tuple(models)]


def searched(least, whole, most, newest):
    """What is found, and what was tried."""
    keys = {(0, "xy"): ("ONE", "two"), (0, "xz"): ("One", "two"), (1, "xy"): ("one", "TWO")}
    pose = Table(
        dict(zip(keys.values(), least, strict=True)), dict(zip(keys.values(), whole, strict=True))
    )
    further = {
        key: SimpleNamespace(model=models[key[0]], newest=w)
        for (key, models), w in zip(keys.items(), newest, strict=True)
    }
    return best_mode(pose, ["one", "two"], further, most, 1e-3), pose.tried


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

    added, newest = "one more", 1.0

    def offers(self, band):
        assert band == 7.0
        return {"xy": Boom(self.at, self.modes + 1)}

    def without(self, offer):
        assert offer == "xy"
        return self.at


def grown(error, alone, most=9, barred=(), tolerance=0.21):
    """Modes of two booms, and the steps that led to them; `alone`: what the lack of each costs."""

    def pose(factor):
        return SimpleNamespace(
            band=7.0,
            of_models=lambda models, tolerance=None: factor * error(*models),
            tops=lambda models: (),
            error_at=lambda models: 0.0,
            of_exchange=lambda i, at: factor * alone["ab".index(at)],
        )

    steps = []
    poses = {"rest": pose(0.5), "folded": pose(1.0)}
    booms = appendages_grown(poses, [Boom("a"), Boom("b")], tolerance, most, set(barred), steps)
    return [boom.modes for boom in booms], [step.partition(":")[0] for step in steps]


def test_appendages_grow_by_the_mode_that_leaves_the_least_error_in_the_worst_pose():
    """2^-m + 0.6 2^-n: 0.8, 0.55, 0.4, 0.275, 0.2."""

    def error(m, n):
        return 0.5**m + 0.6 * 0.5**n

    assert grown(error, ()) == ([3, 3], ["a", "b", "a", "b"])
    assert grown(error, (), tolerance=0.3) == ([3, 2], ["a", "b", "a"])
    assert grown(error, (), tolerance=0.9) == ([1, 1], [])
    assert grown(error, (0.0, 0.0), most=2) == ([2, 2], ["a", "b"])
    assert grown(error, (0.0, 0.0), barred=[0], tolerance=0.6) == ([1, 3], ["b"] * 2)


@pytest.mark.parametrize(
    ("alone", "modes"),
    [((0.06, 0.02), [3, 1]), ((0.04, 0.02), [1, 1]), ((0.07, 0.08), [3, 9])],
)
def test_where_no_mode_pays_that_grows_whose_lack_alone_costs_most(alone, modes):
    """Of a only the third mode helps; less than a twentieth of the error is not its cause."""
    found, steps = grown(lambda m, n: 0.1 if m > 2 else 1.0, alone)
    assert found == modes
    assert steps == ["b"] * (modes[1] - 1) + ["a"] * (modes[0] - 1)
