"""Every public name, and every class that a public function returns, has an example in its
docstring, which gives what it says."""

import doctest
import importlib

import pytest

import beamchain as bc
import returned

SLOW = ("study", "stability", "worlds", "Study", "Worlds")
NAMES = [name for name in bc.__all__ if name != "__version__"]
RESULTS = [*returned.by_functions(), "UncertainPlant", "WorstCase"]
MARKED = [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in (*NAMES, *RESULTS)]


def run(found, name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    tests = [
        test for test in doctest.DocTestFinder(recurse=False).find(found, name) if test.examples
    ]
    assert tests, f"{name} has no example in its docstring"
    told = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS, verbose=False)
    for test in tests:
        runner.run(test, out=told.append)
    assert not runner.summarize(verbose=False).failed, "".join(told)


@pytest.mark.parametrize("name", MARKED)
def test_its_example_runs(name, tmp_path, monkeypatch):
    found = getattr(bc, name) if name in NAMES else returned.by_all()[name]
    run(found, name, tmp_path, monkeypatch)


def test_the_example_of_the_environment_runs(tmp_path, monkeypatch):
    pytest.importorskip(
        "gymnasium", reason="Gymnasium is not installed: pip install 'beamchain[gym]'"
    )
    run(importlib.import_module("beamchain.gym"), "beamchain.gym", tmp_path, monkeypatch)
