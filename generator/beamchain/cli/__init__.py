"""The command line: parse, call, print."""

import json
import logging
import os
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from inspect import cleandoc
from io import TextIOWrapper
from typing import Any, NoReturn

import typer

from beamchain.checks import printable
from beamchain.cli.command import Command
from beamchain.cli.common import OneSentenceEach, explain, version
from beamchain.errors import BeamchainError

#: base of typer's own errors: click's, or in newer versions typer's copy of it
USAGE: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")

#: functions, each in a module of its name, in the order of the help
COMMANDS = ("fit", "embed", "study", "sweep", "inspect", "retime", "plant", "render", "init")

app = typer.Typer(
    name="beamchain",
    help="Model flexible spacecraft appendages in MuJoCo as hinge chains with the modes of the "
    "elastic beam.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def beamchain(
    _version: bool = typer.Option(
        False, "--version", callback=version, is_eager=True, help="Print the version and exit."
    ),
) -> None:
    """Model flexible spacecraft appendages in MuJoCo as hinge chains with the modes
    of the elastic beam."""


def _add(name: str, function: Callable[..., None]) -> None:
    """A command, the paragraphs of its docstring without the breaks of their lines."""
    paragraphs = cleandoc(function.__doc__ or "").split("\n\n")
    text = "\n\n".join(" ".join(each.split()) for each in paragraphs)
    app.command(name=name, cls=Command, help=text)(function)


for _name in COMMANDS:
    _add(_name, getattr(import_module(f"beamchain.cli.{_name}"), _name))
#: those of the packages beside the core
for _point in sorted(entry_points(group="beamchain.commands"), key=lambda point: point.name):
    _add(_point.name, _point.load())


def main() -> None:
    """Entry point. Exit status: 0 success, 2 wrong input,
    3 files written but a requirement not met."""
    # matrices are small: threads only wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # commands open no window of Matplotlib, which refuses to start with a name unknown
    os.environ["MPLBACKEND"] = "agg"
    log = logging.getLogger("beamchain.mujoco")
    log.handlers, log.propagate = [OneSentenceEach()], False
    # characters that the terminal's encoding lacks are spelled out
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        for word in sys.argv[1:]:
            if word.startswith("-") and printable(word) != word:
                raise BeamchainError(
                    f"'{printable(word)}' is no option; see --help, and write a name that begins "
                    "with a minus as ./NAME."
                )
        if "--json" in sys.argv:
            _run_for_a_script()
        app()
    except BeamchainError as error:
        _refuse(str(error), error)
    except KeyboardInterrupt:
        explain("stopped; nothing was left half written.")
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(0)
    except OSError as error:  # of standard output: files have their own
        explain(
            f"cannot write the output: {error.strerror or error}; what was asked for in files is "
            "written."
        )
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the rest of it, at exit
        sys.exit(2)
    except (MemoryError, RecursionError) as error:
        _refuse(f"the input is too large ({type(error).__name__}); make it smaller.", error)


def _refuse(sentence: str, error: BaseException) -> NoReturn:
    explain(sentence)
    _as_json(sentence, error)
    sys.exit(2)


def _run_for_a_script() -> None:
    """The command, its usage errors as JSON too."""
    try:
        sys.exit(app(standalone_mode=False) or 0)
    except USAGE as error:
        error.show()
        _as_json(error.format_message(), error)
        sys.exit(error.exit_code)


def _as_json(message: str, error: BaseException) -> None:
    """An error on stdout where a script asked for JSON;
    the sentence stands on stderr in any case."""
    if "--json" in sys.argv:
        record = {"message": " ".join(message.split()), "type": type(error).__name__}
        sys.stdout.write(json.dumps({"error": record}) + "\n")
