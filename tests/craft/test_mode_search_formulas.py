"""The mode that pays most, of candidates whose errors stand in a table."""

from types import SimpleNamespace

import pytest

from formulas import best_mode

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
