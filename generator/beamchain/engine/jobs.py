"""Many independent jobs in processes of this machine, or on the cluster that joblib was told of."""

import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager, nullcontext
from functools import cache
from typing import Any

from joblib import Parallel, delayed, parallel_config

from beamchain.checks import whole_number
from beamchain.errors import EngineError

#: Called after every job with the number done and the number of all.
Progress = Callable[[int, int], None]

MOST_WORKERS = 256  # processes
PATROL = 0.2  # [s] between two looks of a worker at its parent


def check_workers(workers: int | None) -> None:
    """Refuse `workers` that is neither None nor a number of processes."""
    if workers is not None:
        whole_number("workers", workers, 1, MOST_WORKERS)


def run_jobs(
    function: Callable[..., Any],
    jobs: Sequence[tuple[Any, ...]],
    *,
    workers: int | None = None,
    progress: Progress | None = None,
) -> list[Any]:
    """Run an importable `function(*arguments)` for every job.

    Args:
        function: called in workers, or in this process where there is one.
        jobs: its arguments, job by job.
        workers: processes, of which no more are started than there are jobs; None: as
            `joblib.parallel_config` was told, without it this process.
        progress: told how many are done.

    Returns:
        The results in the order of the jobs.

    Raises:
        EngineError: a worker process died.
    """
    results: list[Any] = []
    tell = progress or _silent
    tell(0, len(jobs))
    here = workers is not None
    number = min(workers or 1, max(len(jobs), 1))
    with parallel_config("loky", n_jobs=number, inner_max_num_threads=1) if here else nullcontext():
        try:
            # which workers that start now inherit: this process alone answers them
            with _interrupts_ignored():
                parent = os.getpid() if here else None
                coming = Parallel(return_as="generator")(
                    delayed(_run)(parent, function, job) for job in jobs
                )
            for result in coming:
                results.append(result)
                tell(len(results), len(jobs))
        except BrokenExecutor as error:
            sentence = " ".join(str(error).split())[:200]
            raise EngineError(
                f"a worker process died ({sentence}); was memory short? Run it again with fewer "
                "workers."
            ) from None
    return results


def _silent(done: int, total: int) -> None:
    """The progress that nobody wants to know."""


def _run(parent: int | None, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """One job; a worker on the machine of its `parent` ends with it, however that ends."""
    if parent not in (None, os.getpid()):
        _end_with(parent)
    return function(*arguments)


@cache
def _end_with(parent: int) -> None:
    """End this process when its parent is another than `parent`:
    the system gives orphans a new one."""

    def patrol() -> None:
        while os.getppid() == parent:
            time.sleep(PATROL)
        os._exit(1)

    threading.Thread(target=patrol, daemon=True).start()


@contextmanager
def _interrupts_ignored() -> Generator[None]:
    """Ctrl-C is answered after a moment; outside the main thread,
    where handlers cannot be set, at once."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
