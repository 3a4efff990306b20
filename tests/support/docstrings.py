"""Examples in docstrings."""

import doctest


def run_example(found, name, folder, monkeypatch):
    """There is one, and it gives what it says."""
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
