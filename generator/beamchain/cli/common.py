"""What all commands share: options, error sentences, the terminal."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

SpecPath = Annotated[
    Path, typer.Argument(metavar="SPEC.toml", help="Specification of the appendage; see `beamchain schema`.")
]
Folder = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the results.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]
Dask = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Run on this Dask scheduler (extra: dask).")]
Resume = Annotated[bool, typer.Option("--resume", help="Continue an interrupted run without repeating finished work.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]


def version(value: bool) -> None:
    """Print the version and stop."""
    if value:
        from beamchain import __version__

        typer.echo(f"beamchain {__version__}")
        raise typer.Exit


def explain(sentence: str) -> None:
    """An error as one sentence on stderr."""
    print(f"beamchain: {' '.join(sentence.split())}", file=sys.stderr)  # noqa: T201


def console() -> "Console":
    """The terminal; plain text and no colours when piped or with NO_COLOR."""
    from rich.console import Console

    return Console(highlight=False, soft_wrap=False, width=None if sys.stdout.isatty() else 120)
