"""What commands print: tables, warnings, JSON, and, on stderr while work takes long, what is being done."""

import sys
from collections.abc import Callable, Collection, Generator, Iterable, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from beamchain.cli.common import console


def print_table(
    title: str,
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    left: Collection[int] = (0,),
    caption: str = "",
    **columns: Any,
) -> None:
    """A table; the columns `left` hold words, the others numbers; `columns`: further settings of rich for all."""
    from rich.table import Table

    table = Table(title=title, title_justify="left", caption=caption or None)
    for i, name in enumerate(head):
        table.add_column(name, justify="left" if i in left else "right", **columns)
    for row in rows:
        table.add_row(*row)
    console().print(table)


def print_warnings(warnings: Iterable[str], word: str = "warning") -> None:
    """One line each."""
    from rich.markup import escape

    for warning in warnings:
        console().print(f"[bold]{word}[/bold]: {escape(warning)}")


def print_json(record: dict[str, Any]) -> None:
    """A record on stdout."""
    from beamchain.files import to_json

    sys.stdout.write(to_json(record))


def tell(
    record: Callable[[], dict[str, Any]], show: Callable[[], None], files: Iterable[Path], as_json: bool, quiet: bool
) -> None:
    """What a command ends with: its record as JSON, or what it shows and where the files are, or nothing."""
    if as_json:
        print_json(record())
    elif not quiet:
        show()
        for file in files:
            console().print(f"wrote {file}", markup=False)  # brackets in a path are not markup


@contextmanager
def job_bar(what: str, silent: bool) -> Generator[Callable[[int, int], None]]:
    """A bar over jobs, and the function that is told how many are done, and of how many."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    text = TextColumn("{task.description}")
    columns = text, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()
    with _live(what, silent, *columns) as update:
        yield lambda done, total: update(completed=done, total=total)


@contextmanager
def spinner(what: str, silent: bool) -> Generator[Callable[[str], None]]:
    """What is being done, while it is; the function it hands out says what is done next."""
    from rich.progress import SpinnerColumn, TextColumn

    with _live(what, silent, SpinnerColumn(), TextColumn("{task.description}")) as update:
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
