"""Many independent jobs over any `concurrent.futures.Executor`: stored as they come, resumed where they stopped."""

import hashlib
import json
import os
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from beamchain.errors import EngineError, InputError, OutputError
from beamchain.files import check_regular

#: Called after every job with the number done and the number of all.
Progress = Callable[[int, int], None]

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
AHEAD = 4  # jobs handed out per worker before the first comes back


def run_jobs(
    function: Callable[..., Any],
    jobs: Mapping[str, tuple[Any, ...]],
    *,
    executor: Executor | None = None,
    store: Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run `function(*arguments)` for every job.

    Args:
        function: importable; returns plain lists, dicts, numbers and text.
        jobs: arguments by a key that says all that matters for the result.
        executor: where they run; in this process, one after the other, where left out.
        store: file of JSON lines that holds what is done.
        resume: take what `store` already holds; else it starts anew.
        progress: told after every job.

    Returns:
        results by key, in the order of the jobs.

    Raises:
        EngineError: a worker died for good; what is done stays in `store`.
        OutputError: `store` is no file, or cannot be written.
    """
    if store is not None:
        check_regular(store)
    done = _read(store) if store is not None and resume else {}
    done = {key: value for key, value in done.items() if key in jobs}
    if store is not None:  # begun anew with what is whole: a line cut off while it was written would spoil the next
        store.unlink(missing_ok=True)
        for key, value in done.items():
            _append(store, key, value)
    tell = progress or _silent
    tell(len(done), len(jobs))
    for key, value in _results(function, {k: a for k, a in jobs.items() if k not in done}, executor):
        done[key] = value
        if store is not None:
            _append(store, key, value)
        tell(len(done), len(jobs))
    return {key: done[key] for key in jobs}


def _silent(_done: int, _all: int) -> None:
    return None


def _results(
    function: Callable[..., Any], jobs: Mapping[str, tuple[Any, ...]], executor: Executor | None
) -> Iterator[tuple[str, Any]]:
    if executor is None:
        for key, arguments in jobs.items():
            yield key, function(*arguments)
        return
    waiting = iter(jobs.items())
    running: dict[Future[Any], str] = {}
    limit = AHEAD * int(getattr(executor, "_max_workers", 0) or 16)
    try:
        while True:
            while len(running) < limit and (job := next(waiting, None)) is not None:
                running[executor.submit(function, *job[1])] = job[0]
            if not running:
                return
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                yield running.pop(future), future.result()
    except BrokenExecutor as error:
        raise EngineError(
            f"a worker process died ({error}); what is done is kept: run the same command again with --resume."
        ) from None
    finally:
        for future in running:
            future.cancel()


@contextmanager
def workers(count: int, dask: str | None = None) -> Generator[Executor | None]:
    """An executor: `count` local processes, or a Dask cluster; None for a single local worker.

    Args:
        count: local processes.
        dask: address of a Dask scheduler, for example "tcp://host:8786".

    Raises:
        InputError: Dask is not installed, or no scheduler answers.
    """
    if dask is not None:
        try:
            from distributed import Client  # pyright: ignore[reportMissingImports]
        except ImportError:
            raise InputError("--dask needs the extra: pip install 'beamchain[dask]'.") from None
        try:
            client = Client(dask, timeout=10, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(f"no Dask scheduler answers at {dask!r} ({error}); check the address.") from None
        with client:
            yield client.get_executor(pure=False, retries=3)
    elif count > 1:
        with _one_thread_each(), ProcessPoolExecutor(count, mp_context=get_context("spawn")) as pool:
            yield pool
    else:
        yield None


@contextmanager
def _one_thread_each() -> Generator[None]:
    """Processes started meanwhile keep their linear algebra to one thread: matrices are small, cores shared."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update({name: "1" for name in THREADS if before[name] is None})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]


def _read(store: Path) -> dict[str, Any]:
    if not store.is_file():
        return {}
    out: dict[str, Any] = {}
    with store.open(encoding="utf-8", errors="replace") as stream:
        for line in stream:
            try:
                entry = json.loads(line)
                if entry["check"] == _check(entry["key"], entry["value"]):
                    out[entry["key"]] = entry["value"]
            except (ValueError, KeyError, TypeError, RecursionError):
                continue  # damaged, or the line that was being written when it stopped: it is done again
    return out


def _check(key: str, value: Any) -> str:
    """A sum that tells a damaged line."""
    return hashlib.blake2b(json.dumps([key, value]).encode(), digest_size=8).hexdigest()


def _append(store: Path, key: str, value: Any) -> None:
    try:
        store.parent.mkdir(parents=True, exist_ok=True)
        with store.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps({"key": key, "value": value, "check": _check(key, value)}) + "\n")
    except OSError as error:
        raise OutputError(f"cannot write to {str(store)!r}: {error.strerror}; choose another folder.") from None
