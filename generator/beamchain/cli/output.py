"""What commands print: tables, warnings, JSON, and, on stderr while work takes long,
what is being done."""

import sys
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beamchain.checks import printable
from beamchain.cli.common import console

if TYPE_CHECKING:
    from beamchain.report.table import Table

SETTLED = 2.0  # seconds of jobs from which the rest is estimated
LONG = 10.0  # seconds to come that are announced where no bar is shown


def print_table(table: "Table") -> None:
    """A table, with words on the left of their columns and numbers on the right."""
    console().print(table.grid())
    for note in table.notes:
        console().print(note)


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
    quiet: bool,
) -> None:
    """What a command ends with: its record as JSON,
    or what it shows and where the files are, or nothing."""
    if as_json:
        print_json(record())
    elif not quiet:
        show()
        print_files(files)


def print_files(files: Iterable[Path]) -> None:
    """The files written, of each folder on one line."""
    by_folder: dict[Path, list[str]] = {}
    for file in files:
        by_folder.setdefault(file.parent, []).append(file.name)
    for folder, names in by_folder.items():
        where = "" if folder == Path() else f" in {folder}"
        console().print(f"wrote {', '.join(names)}{where}", markup=False)


def print_first(lines: Iterable[str], notes: Sequence[str], *, full: bool) -> None:
    """The first screen: its lines, and the notes, without `full` the first few."""
    from beamchain.report.tables.first_screen import NOTES

    for line in lines:
        console().print(line, markup=False)
    print_warnings(notes if full else notes[:NOTES], "note")
    if len(notes) > NOTES and not full:
        console().print(f"{len(notes) - NOTES} more notes with --full")


@contextmanager
def job_bar(what: str, silent: bool) -> Generator[Callable[[int, int], None]]:
    """A bar over jobs, and the function that is told how many are done, and of how many.

    Where stderr is no terminal, one line says how long the jobs will take if that is long.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

    if not silent and not Console(stderr=True).is_terminal:
        yield _announcement(what)
        return
    text = TextColumn("{task.description}", markup=False)
    columns = (
        text,
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("left"),
    )
    with _live(what, silent, *columns) as update:
        yield lambda done, total: update(completed=done, total=total)


def _announcement(what: str) -> Callable[[int, int], None]:
    """What is told how many jobs are done, and says once on stderr how long the rest will take."""
    start = time.perf_counter()
    announced = False

    def announce(done: int, total: int) -> None:
        nonlocal announced
        passed = time.perf_counter() - start
        if announced or done == 0 or done == total or passed < SETTLED:
            return
        left = passed * (total - done) / done
        announced = True
        if left >= LONG:
            print(  # noqa: T201
                f"{what}: {done / total:.0%} done after {passed:.0f} s, about {left:.0f} s left",
                file=sys.stderr,
            )

    return announce


@contextmanager
def spinner(what: str, silent: bool) -> Generator[Callable[[str], None]]:
    """What is being done, while it is, on a terminal; the function it hands out says what is done
    next."""
    from rich.progress import SpinnerColumn, TextColumn

    with _live(
        what, silent, SpinnerColumn(), TextColumn("{task.description}", markup=False)
    ) as update:
        yield lambda text: update(description=text)


@contextmanager
def _live(what: str, silent: bool, *columns: Any) -> Generator[Callable[..., None]]:
    """A display on stderr, gone when done; none where that is no terminal."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    if silent or not console.is_terminal:
        yield _nothing
        return
    with Progress(*columns, transient=True, redirect_stdout=False, console=console) as bar:
        yield partial(bar.update, bar.add_task(what, total=None))


def _nothing(**_: object) -> None:
    """What a display does that is not shown."""
