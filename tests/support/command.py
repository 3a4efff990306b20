"""The command line, called in the tests' own process:
the one place of the tests that knows where it is."""

import contextlib
import io
import json
import sys
from typing import Any, NamedTuple
from unittest import mock

import pytest

from beamchain.cli import app, main

#: names of the commands that the help lists
COMMANDS = sorted(str(command.name) for command in app.registered_commands if not command.hidden)


class Answer(NamedTuple):
    """What a call gave: exit status, standard output, standard error."""

    status: int
    out: str
    err: str

    @property
    def record(self) -> Any:
        """Of `--json`."""
        return json.loads(self.out)


def call(*words: object) -> Answer:
    """One call, without a test's fixtures; every word becomes a text."""
    out = io.StringIO()
    err = io.StringIO()
    arguments = ["beamchain", *map(str, words)]
    with (
        mock.patch.object(sys, "argv", arguments),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as stopped,
    ):
        main()
    return Answer(int(stopped.value.code or 0), out.getvalue(), err.getvalue())


def run(arguments, capsys, monkeypatch):
    """Exit status, stdout and stderr of one call."""
    monkeypatch.setattr("sys.argv", ["beamchain", *arguments])
    with pytest.raises(SystemExit) as stopped:
        main()
    told = capsys.readouterr()
    return int(stopped.value.code or 0), told.out, told.err
