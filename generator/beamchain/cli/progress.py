"""What is being done, on stderr, for work that takes over a second; gone when done."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial
from typing import Any


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
