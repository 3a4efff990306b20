"""Jobs over executors: stored as they come, resumed, nothing done twice; a Dask worker killed in the middle."""

import os
import signal
import time
from pathlib import Path

import pytest

import beamchain as bc
from beamchain.engine.jobs import run_jobs, workers


def square(value: int, log: str) -> int:
    with Path(log).open("a") as stream:
        stream.write(f"{value} {os.getpid()}\n")
    return value * value


def slow_square(value: int, log: str) -> int:
    time.sleep(0.2)
    return square(value, log)


def broken(value: int, log: str) -> int:
    if value == 2:
        raise KeyboardInterrupt
    return square(value, log)


def jobs(count: int, log: Path) -> dict[str, tuple[int, str]]:
    return {f"job {i}": (i, str(log)) for i in range(count)}


def done(log: Path) -> list[int]:
    return [int(line.split()[0]) for line in log.read_text().splitlines()]


def test_results_come_in_the_order_of_the_jobs(tmp_path):
    told = []
    found = run_jobs(square, jobs(5, tmp_path / "log"), progress=lambda a, b: told.append((a, b)))
    assert found == {f"job {i}": i * i for i in range(5)}
    assert told == [(i, 5) for i in range(6)]


def test_interrupted_work_resumes_and_does_nothing_twice(tmp_path):
    log, store = tmp_path / "log", tmp_path / "folder" / "store.jsonl"
    with pytest.raises(KeyboardInterrupt):
        run_jobs(broken, jobs(5, log), store=store)
    with store.open("a") as stream:
        stream.write('{"key": "job 3", "val')  # cut off while it was written
    found = run_jobs(square, jobs(5, log), store=store, resume=True)
    assert found == {f"job {i}": i * i for i in range(5)}
    assert sorted(done(log)) == [0, 1, 2, 3, 4]
    run_jobs(square, jobs(5, log), store=store, resume=True)
    assert len(done(log)) == 5
    run_jobs(square, jobs(5, log), store=store)
    assert len(done(log)) == 10


def test_local_processes(tmp_path):
    before = dict(os.environ)
    with workers(2) as pool:
        assert pool is not None
        found = run_jobs(square, jobs(9, tmp_path / "log"), executor=pool)
    assert found == {f"job {i}": i * i for i in range(9)}
    assert str(os.getpid()) not in (tmp_path / "log").read_text()
    assert dict(os.environ) == before


def test_one_worker_is_this_process():
    with workers(1) as pool:
        assert pool is None


def test_dask_without_the_extra_or_without_a_scheduler():
    with pytest.raises(bc.BeamchainError, match=r"extra|answers"), workers(1, "tcp://127.0.0.1:1"):
        pass


@pytest.mark.host
def test_dask_with_a_worker_killed_in_the_middle(tmp_path):
    distributed = pytest.importorskip("distributed", reason="the dask extra is not installed")
    log = tmp_path / "log"
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, scheduler_port=0
    ) as cluster:
        pids = [worker.pid for worker in cluster.workers.values()]
        killed = []

        def kill(count: int, _all: int) -> None:
            if count == 5 and not killed:
                os.kill(pids[0], signal.SIGKILL)
                killed.append(pids[0])

        with workers(1, cluster.scheduler_address) as pool:
            found = run_jobs(slow_square, jobs(24, log), executor=pool, progress=kill)
    assert killed
    assert found == {f"job {i}": i * i for i in range(24)}
    assert set(done(log)) == set(range(24))
