"""Every public name has an example in its docstring, and the example gives what it says."""

import doctest

import pytest

import beamchain as bc

NAMES = [name for name in bc.__all__ if name != "__version__"]


SLOW = ("study", "stability", "worlds")


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in NAMES])
def test_its_example_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = getattr(bc, name)
    tests = [test for test in doctest.DocTestFinder(recurse=False).find(found, name) if test.examples]
    assert tests, f"bc.{name} has no example in its docstring"
    told = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS, verbose=False)
    for test in tests:
        runner.run(test, out=told.append)
    assert not runner.summarize(verbose=False).failed, "".join(told)
