"""A progress bar with the time left, for work that takes over a second."""

from collections.abc import Generator
from contextlib import contextmanager

from beamchain.jobs import Progress


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
    with Bar(*columns, transient=True, disable=silent, console=Console(stderr=True)) as bar:
        task = bar.add_task(what, total=None)

        def tell(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        yield tell
