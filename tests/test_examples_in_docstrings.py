"""Every public name, and every class that a public function returns, has an example in its
docstring, which gives what it says."""

import pytest

import returned
from docstrings import run_example

SLOW = ("study", "stability", "worlds.make", "results.Study", "worlds.Worlds")
EVERY = {**returned.public(), **returned.by_functions()}
MARKED = [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in EVERY]


@pytest.mark.parametrize("name", MARKED)
@pytest.mark.slow
def test_its_example_runs(name, tmp_path, monkeypatch):
    run_example(EVERY[name], name, tmp_path, monkeypatch)
