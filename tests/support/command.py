"""The command line, called in the tests' own process."""

import pytest

from beamchain.cli import main


def run(arguments, capsys, monkeypatch):
    """Exit status, stdout and stderr of one call."""
    monkeypatch.setattr("sys.argv", ["beamchain", *arguments])
    with pytest.raises(SystemExit) as stopped:
        main()
    told = capsys.readouterr()
    return int(stopped.value.code or 0), told.out, told.err
