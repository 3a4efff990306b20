"""What commands print at their end: tables, warnings, and the choice between JSON, words and nothing."""

from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

from beamchain.cli.common import console, print_json, print_written


def print_table(
    title: str, head: Sequence[str], rows: Iterable[Sequence[str]], left: Collection[int] = (0,), caption: str = ""
) -> None:
    """A table; the columns `left` hold words, the others numbers."""
    from rich.table import Table

    table = Table(title=title, title_justify="left", caption=caption or None)
    for i, name in enumerate(head):
        table.add_column(name, justify="left" if i in left else "right")
    for row in rows:
        table.add_row(*row)
    console().print(table)


def print_warnings(warnings: Iterable[str], word: str = "warning") -> None:
    """One line each."""
    from rich.markup import escape

    for warning in warnings:
        console().print(f"[bold]{word}[/bold]: {escape(warning)}")


def tell(
    record: Callable[[], dict[str, Any]], show: Callable[[], None], files: Iterable[Path], as_json: bool, quiet: bool
) -> None:
    """What a command ends with: its record as JSON, or what it shows and where the files are, or nothing."""
    if as_json:
        print_json(record())
    elif not quiet:
        show()
        print_written(files)
