"""Every public name, and every class that a public function returns, has an example in its
docstring, which gives what it says."""

import doctest
import importlib

import pytest

import returned

SLOW = ("study", "stability", "worlds.make", "results.Study", "worlds.Worlds")
EVERY = {**returned.public(), **returned.by_functions()}
MARKED = [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in EVERY]


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
    run(EVERY[name], name, tmp_path, monkeypatch)


def test_the_example_of_the_environment_runs(tmp_path, monkeypatch):
    pytest.importorskip(
        "gymnasium", reason="Gymnasium is not installed: pip install 'beamchain[worlds]'"
    )
    run(
        importlib.import_module("beamchain.worlds.gym"),
        "beamchain.worlds.gym",
        tmp_path,
        monkeypatch,
    )
