"""What all commands share: options, error sentences, the terminal."""

import logging
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

    from beamchain.engine.library import mujoco
    from beamchain.steps.deployment import Commands

SpecPath = Annotated[
    Path,
    typer.Argument(
        metavar="SPEC.toml", help="Specification of the appendage; see `beamchain init schema`."
    ),
]
Folder = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the results.")
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]
Full = Annotated[
    bool, typer.Option("--full", help="Print every table as well, and how the modes were chosen.")
]
Model = Annotated[Path, typer.Argument(metavar="FILE.xml", help="The spacecraft's MJCF file.")]
Inputs = Annotated[
    list[str] | None,
    typer.Option(
        "--from",
        metavar="NAME",
        help="An actuator, torque:BODY, force:BODY or wrench:SITE. Repeatable; default: the "
        "\\[allocation] tables of LOOPS.toml, else all actuators.",
    ),
]
Outputs = Annotated[
    list[str] | None,
    typer.Option(
        "--to",
        metavar="NAME",
        help="A sensor, attitude, rate or motion:SITE. Repeatable; default: the \\[alignment] "
        "tables of LOOPS.toml, else attitude and rate.",
    ),
]
Poses = Annotated[
    list[str] | None,
    typer.Option(
        "--pose",
        metavar="JOINT=45,...",
        help="Pose to linearise in: joints in degrees (slides in m), or the name of a keyframe; "
        "default: rest. Repeatable, or JOINT=0,45,90: a plant for each, modes followed in this "
        "order.",
    ),
]
Torque = Annotated[
    Path | None,
    typer.Option(
        metavar="CSV",
        help="Film a simulation under these commands in place of a turn: a column time and others "
        "named after actuators of the file; a row holds until the next.",
    ),
]
LARGEST_HISTORY = 10_000_000  # bytes
SHORTEST, LONGEST = 1e-3, 1e5  # of a run [s]


def read_text(path: Path, option: str) -> str:
    """The text of a CSV file that the user names in an option."""
    from beamchain.errors import InputError
    from beamchain.files import note_input

    note_input(path)
    try:
        if path.stat().st_size > LARGEST_HISTORY:
            raise InputError(
                f"{option} {str(path)!r} has more than the {LARGEST_HISTORY} bytes taken; thin it "
                "out."
            )
        return path.read_text(encoding="utf-8-sig")  # as spreadsheets write it too
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{option} {str(path)!r} cannot be read ({error}); give a CSV file of text."
        ) from None


def read_commands(
    model: "mujoco.MjModel", torque: Path, seconds: float | None = None
) -> "Commands":
    """The commands of actuators that --torque names, of a run of some seconds or else of one to
    their last time."""
    from beamchain.errors import InputError
    from beamchain.steps.deployment import commands

    given = commands(model, read_text(torque, "--torque"), torque.name)
    last = float(given.times[-1])
    if seconds is None and not SHORTEST <= last <= LONGEST:
        raise InputError(
            f"--torque ends at {last:g} s; give times from {SHORTEST:g} to {LONGEST:g} s."
        )
    return given


def version(value: bool) -> None:
    """Print the version and stop."""
    if value:
        from beamchain import __version__

        typer.echo(f"beamchain {__version__}")
        raise typer.Exit


def explain(sentence: str) -> None:
    """An error as one sentence on stderr."""
    from beamchain.checks import printable

    print(f"beamchain: {printable(' '.join(sentence.split()))}", file=sys.stderr)  # noqa: T201


class OneSentenceEach(logging.Handler):
    """Shows each kind of MuJoCo's warnings once:
    those that differ in numbers only are of one kind."""

    def __init__(self) -> None:
        super().__init__()
        self._shown: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """A warning on stderr, unless there was such a one."""
        sentence = " ".join(str(record.msg).split())
        kind = re.sub(r"[-+.\d]+(e[-+]?\d+)?", "", sentence)
        if kind not in self._shown:
            self._shown.add(kind)
            explain(f"MuJoCo warns: {sentence}")


def console() -> "Console":
    """The terminal; plain text and no colours when piped or with NO_COLOR.

    Texts are shown as they are, users' names in them too: no brackets are markup,
    no colons are emoji.
    """
    from rich.console import Console

    from beamchain.checks import printable

    class Terminal(Console):
        def render_str(self, text: str, **settings: Any) -> "Text":
            return super().render_str(printable(text), **settings)

    width = None if sys.stdout.isatty() else 120
    return Terminal(highlight=False, soft_wrap=False, markup=False, emoji=False, width=width)
