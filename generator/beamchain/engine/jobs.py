"""Many independent jobs over any `concurrent.futures.Executor`, stored as they come; spec texts as their inputs."""

import hashlib
import io
import json
import os
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from beamchain.engine.library import mujoco
from beamchain.errors import EngineError, InputError, OutputError
from beamchain.files import check_regular

#: Called after every job with the number done and the number of all.
Progress = Callable[[int, int], None]

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def run_jobs(
    function: Callable[..., Any],
    jobs: Mapping[str, tuple[Any, ...]],
    *,
    executor: Executor | None = None,
    store: Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run an importable `function(*arguments)` for every job; the results, plain data, by key, in the order of the jobs.

    A key says all that matters for its result. `store`: file of JSON lines that holds what is done, also after a worker died
    for good; with `resume` what it holds already is taken, else it starts anew.
    """
    if store is not None:
        check_regular(store)
    before = _read(store) if store is not None and resume else {}
    if store is not None:  # begun anew with what is whole: a line cut off while it was written would spoil the next
        store.unlink(missing_ok=True)
    done: dict[str, Any] = {}
    if progress is not None:
        progress(sum(key in before for key in jobs), len(jobs))
    for key, value in _results(function, jobs, before, executor):
        done[key] = value
        if store is not None:
            _append(store, key, value)
        if progress is not None and key not in before:
            progress(len(done), len(jobs))
    return {key: done[key] for key in jobs}


def _results(
    function: Callable[..., Any],
    jobs: Mapping[str, tuple[Any, ...]],
    done: Mapping[str, Any],
    executor: Executor | None,
) -> Iterator[tuple[str, Any]]:
    """What is done already, then the rest as it comes."""
    yield from ((key, done[key]) for key in jobs if key in done)
    waiting = {key: arguments for key, arguments in jobs.items() if key not in done}
    if executor is None:
        yield from ((key, function(*arguments)) for key, arguments in waiting.items())
        return
    running: dict[Future[Any], str] = {}
    try:
        running = {executor.submit(function, *arguments): key for key, arguments in waiting.items()}
        for future in as_completed(running):
            yield running[future], future.result()
    except BrokenExecutor as error:
        raise EngineError(
            f"a worker process died ({error}); what is done is kept: run the same command again with --resume."
        ) from None
    finally:
        for future in running:
            future.cancel()


@contextmanager
def workers(count: int, dask: str | None = None) -> Generator[Executor | None]:
    """`count` local processes, or the Dask cluster of a scheduler ("tcp://host:8786"); None for one local worker."""
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
    missing = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(missing, "1"))
    try:
        yield
    finally:
        for name in missing:
            del os.environ[name]


def _read(store: Path) -> dict[str, Any]:
    out: dict[str, Any] = {}
    with store.open(encoding="utf-8", errors="replace") if store.is_file() else io.StringIO() as stream:
        for line in stream:
            with suppress(ValueError, KeyError, TypeError, RecursionError):  # damaged, or cut off: it is done again
                entry = json.loads(line)
                if entry["check"] == _check(entry["key"], entry["value"]):
                    out[entry["key"]] = entry["value"]
    return out


def stamp(*inputs: Any) -> str:
    """Twelve letters that change with any of the inputs and with MuJoCo: the beginning of a job's key."""
    return hashlib.sha256(json.dumps([*inputs, mujoco.__version__]).encode()).hexdigest()[:12]


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
