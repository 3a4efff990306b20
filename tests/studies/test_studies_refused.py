"""What cannot be studied is refused by one sentence that names the key, its value and the cure.
Tests an internal as well, `studies.scenario.parse_profile`. No tolerances: sentences only."""

from functools import partial

import pytest
from msgspec import structs

import beamchain as bc
from beamchain.errors import EngineError
from beamchain.studies.scenario import parse_profile
from examples import example
from refused import check_refused

SEED = example("seed_boom")
QUICK = {"models": ["exact, hub"], "duration": 20.0, "budget": 0.002}
PROFILES = {
    "": ("give a column time",),
    "time,mq\n0,1\n1,0\n": ("mq",),
    "time,mz\n0,1\n": ("at least two rows",),
    "time,mz\n1,1\n2,0\n": ("start at 0",),
    "time,mz\n0,1\n0,0\n": ("ascend",),
    "time,mz\n0,one\n1,0\n": ("row 1 is 0, one; give one finite number per column",),
    "time,mz\n0,nan\n1,0\n": ("finite",),
}


def swept_without_ranges():
    spec = bc.read_spec(example("array_uncertain"))
    bc.sweep(structs.replace(spec, uncertain=None), 3)


REFUSED = {
    **{
        f"profile {text!r}": (partial(parse_profile, text, "p"), words)
        for text, words in PROFILES.items()
    },
    "model of no name": (lambda: bc.study(SEED, models=("spaghetti",)), ("choose from",)),
    "model of another name": (
        lambda: bc.study(SEED, models=["magic"]),
        ("model 'magic' is not in the field",),
    ),
    "nothing uncertain": (swept_without_ranges, ("no [uncertain]",)),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_studied_is_refused(case):
    check_refused(REFUSED[case][0], bc.InputError, REFUSED[case][1])


def test_a_load_that_throws_the_appendage_about_is_refused():
    check_refused(
        lambda: bc.study(SEED, amplitude=1e7, **QUICK), EngineError, ("7 links", "smaller load")
    )
