"""Workers: they end with the process that started them, however that ends;
their results are those of one process.

No tolerances: processes are there or not. Processes are told by their session, as /proc lists them.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from joblib import cpu_count, parallel_config

import beamchain as bc

ARRAY = Path(str(files("beamchain"))) / "examples" / "array_uncertain.toml"
PATIENCE = 120.0  # [s] for workers to start on a busy machine, and to end

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/stat").is_file(), reason="processes are looked up in /proc"
)


def session(leader: int) -> dict[int, float]:
    """Processor time [ticks] of every living process of a session, by number."""
    out = {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, _, of, *rest = place.read_text().rpartition(")")[2].split()
            if int(of) == leader and state != "Z":
                out[int(place.parent.name)] = float(rest[7]) + float(rest[8])
    return out


def wait_until(done, what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end, what
        time.sleep(0.05)


@pytest.fixture
def sweep(tmp_path):
    """A long sweep whose two workers compute, in a session of its own."""
    if cpu_count() < 2:
        pytest.skip("this machine has one core")
    words = ["sweep", str(ARRAY), "-o", "out", "--samples", "100000"]
    child = subprocess.Popen(
        [sys.executable, "-m", "beamchain", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "LOKY_MAX_CPU_COUNT": "2"},
        start_new_session=True,
        # a run of the tests in the background may have passed on that SIGINT is ignored
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    ticks = os.sysconf("SC_CLK_TCK")

    def compute() -> bool:
        assert child.poll() is None, child.stderr.read()
        return (
            sum(
                spent > ticks
                for process, spent in session(child.pid).items()
                if process != child.pid
            )
            >= 2
        )

    wait_until(compute, "no workers")
    yield child
    for process in session(child.pid):
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
    child.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_no_worker_outlives_its_parent(sweep, end):
    os.kill(sweep.pid, end)
    _, message = sweep.communicate(timeout=PATIENCE)
    assert sweep.returncode in (-end, 128 + end)
    wait_until(lambda: not session(sweep.pid), f"alive: {session(sweep.pid)}")
    assert "Traceback" not in message
    assert "KeyboardInterrupt" not in message


@pytest.mark.slow
def test_ctrl_c_reaches_all_of_them_and_gives_no_traceback(sweep, tmp_path):
    """The terminal signals the whole group."""
    os.killpg(sweep.pid, signal.SIGINT)
    _, message = sweep.communicate(timeout=PATIENCE)
    assert sweep.returncode == 130
    assert len(message.strip().splitlines()) <= 1, message
    wait_until(lambda: not session(sweep.pid), f"alive: {session(sweep.pid)}")
    assert not list(tmp_path.rglob("*.*"))


@pytest.mark.slow
def test_joblib_says_where_jobs_run():
    steps = []
    alone = bc.sweep(ARRAY, 12, seed=3)
    with parallel_config("threading", n_jobs=2):
        shared = bc.sweep(
            ARRAY, 12, seed=3, progress=lambda done, total: steps.append((done, total))
        )
    for name, values in alone.fields.items():
        np.testing.assert_array_equal(shared.fields[name], values)
    assert steps == [(0, 2), (1, 2), (2, 2)]
