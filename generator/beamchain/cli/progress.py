"""What is being done, on stderr, for work that takes over a second; gone when done."""

from collections.abc import Callable, Generator
from contextlib import contextmanager

from beamchain.studies.jobs import Progress


@contextmanager
def job_bar(what: str, silent: bool) -> Generator[Progress]:
    """A bar over jobs; gone when done.

    Args:
        what: shown before the bar.
        silent: show nothing.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("left"), TimeRemainingColumn(),
    )  # fmt: skip
    console = Console(stderr=True)
    with Bar(*columns, transient=True, disable=silent or not console.is_terminal, console=console) as bar:
        task = bar.add_task(what, total=None)

        def tell(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        yield tell


@contextmanager
def spinner(what: str, silent: bool) -> Generator[Callable[[str], None]]:
    """What is being done, while it is; the function it hands out says what is done next.

    Args:
        what: shown first.
        silent: show nothing.
    """
    from rich.console import Console
    from rich.progress import Progress as Bar
    from rich.progress import SpinnerColumn, TextColumn

    columns = SpinnerColumn(), TextColumn("{task.description}")
    console = Console(stderr=True)
    silent = silent or not console.is_terminal
    with Bar(*columns, transient=True, disable=silent, redirect_stdout=False, console=console) as bar:
        task = bar.add_task(what)

        def say(text: str) -> None:
            bar.update(task, description=text)

        yield say
