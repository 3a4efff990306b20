"""What commands print: tables, warnings, JSON, and, on stderr while work takes long,
what is being done."""

import sys
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beamchain.checks import printable
from beamchain.cli.common import console

if TYPE_CHECKING:
    from beamchain.report.table import Table


def print_all(*parts: "str | Table | None") -> None:
    """Sentences, and tables with their notes, in this order."""
    for part in parts:
        if isinstance(part, str):
            console().print(part)
        elif part is not None:
            console().print(part.grid())
            print_all(*part.notes)


def print_warnings(warnings: Iterable[str], word: str = "warning") -> None:
    """One line each."""
    for warning in warnings:
        print_headed(word, warning)


def print_headed(head: str, text: str) -> None:
    """A line that begins with a bold word or name."""
    from rich.text import Text

    console().print(Text.assemble((printable(head), "bold"), f": {printable(text)}"))


def print_json(record: dict[str, Any]) -> None:
    """A record on stdout."""
    from beamchain.files import to_json

    sys.stdout.write(to_json(record))


def tell(
    record: Callable[[], dict[str, Any]],
    show: Callable[[], None],
    files: Iterable[Path],
    as_json: bool,
) -> None:
    """What a command ends with: its record as JSON, or what it shows and where the files are."""
    if as_json:
        print_json(record())
    else:
        show()
        print_files(files)


def print_files(files: Iterable[Path]) -> None:
    """The files written, of each folder on one line."""
    by_folder: dict[Path, list[str]] = {}
    for file in files:
        by_folder.setdefault(file.parent, []).append(file.name)
    for folder, names in by_folder.items():
        where = "" if folder == Path() else f" in {folder}"
        print_all(f"wrote {', '.join(names)}{where}")


def print_first(lines: Iterable[str], notes: Sequence[str], *, full: bool) -> None:
    """The first screen: its lines, and the notes, without `full` the first few."""
    from beamchain.report.tables.first_screen import NOTES

    print_all(*lines)
    print_warnings(notes if full else notes[:NOTES], "note")
    if len(notes) > NOTES and not full:
        print_all(f"{len(notes) - NOTES} more notes with --full")


@contextmanager
def job_bar(what: str) -> Generator[Callable[[int, int], None]]:
    """A bar over jobs on a terminal's stderr, and the function that is told how many are done, and
    of how many."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(transient=True, redirect_stdout=False, console=Console(stderr=True)) as bar:
        job = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(job, completed=done, total=total)


@contextmanager
def spinner(what: str) -> Generator[Callable[[str], None]]:
    """What is being done, while it is, on a terminal's stderr; the function it hands out says what
    is done next."""
    from rich.console import Console

    with Console(stderr=True, markup=False).status(what) as status:
        yield status.update
