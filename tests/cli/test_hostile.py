"""Tests internals as well, the readers in `support/hostile.py` and `files.write_files`, beside
the commands.

Spoilt input: no traceback, no hang, nothing written outside the output, nothing overwritten.

Every reader gets good files that were spoilt (hypothesis). What comes back is either a result or
one `BeamchainError`. `make fuzz` runs the same
properties longer (BEAMCHAIN_FUZZ examples). Specifications far out and spoilt ones are fitted too;
their seed is fixed but in `make fuzz`, and printed; BEAMCHAIN_SEED sets it.
"""

import functools
import os
import shutil
import signal
import sys
import time
import traceback
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import beamchain as bc
from beamchain.errors import OutputError
from beamchain.files import write_files
from hostile import READERS, REFUSED, SPEC, reader_of, spoilt
from hostile_specs import hostile_spec
from seeds import seed

SECONDS = 5.0  # for any one file
HANG = 60.0  # of the processor, for any one specification
SLOW = 0.01  # share of the specifications that may take more than SECONDS (8 of 2,000 were seen)
EXAMPLES = int(os.environ.get("BEAMCHAIN_FUZZ", "25"))
SPECS = int(os.environ.get("BEAMCHAIN_FUZZ", "160"))
PARTS = 8  # of them, for workers to share
WRITTEN = 25  # of so many fits one is written whole
SEED = seed()
OPENED: list[str] | None = None  # files opened for writing, while it is a list


def taken(read, path) -> None:
    """A result, or an error of ours."""
    try:
        read(path)
    except bc.BeamchainError as error:
        assert str(error).strip()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", list(READERS))
@settings(
    max_examples=EXAMPLES,
    deadline=1000.0 * SECONDS,
    derandomize=EXAMPLES <= 25,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(data=st.data())
def test_a_spoilt_file(name, tmp_path, data):
    ending, good, read = READERS[name]
    path = tmp_path / f"spoilt.{ending}"
    path.write_bytes(data.draw(st.one_of(spoilt(good), st.binary(max_size=400))))
    taken(read, path)


@pytest.mark.parametrize("name", list(READERS))
def test_the_good_file_is_good(name, tmp_path):
    ending, good, read = READERS[name]
    path = tmp_path / f"good.{ending}"
    path.write_bytes(good)
    if name == "results":
        pytest.skip("pyYeti has an environment of its own")
    assert read(path) is not None


@pytest.mark.parametrize(
    "name",
    [
        "print",
        "modes, JSON",
        "matrices, NumPy",
        "matrices, MATLAB",
        "superelement, text",
        "superelement, binary",
        "assembly",
        "punch",
        "spec",
    ],
)
@pytest.mark.slow
def test_a_file_cut_anywhere(name, tmp_path):
    ending, good, read = READERS[name]
    path = tmp_path / f"cut.{ending}"
    for at in range(0, len(good), max(len(good) // 25, 1)):
        path.write_bytes(good[:at])
        taken(read, path)


CASES = [(name, i) for name, (end, _) in REFUSED.items() for i in range(len(reader_of(end)))]


@pytest.mark.parametrize(("name", "reader"), CASES)
def test_what_is_no_number_or_no_text_is_refused(name, reader, tmp_path):
    ending, content = REFUSED[name]
    path = tmp_path / f"refused.{ending}"
    path.write_bytes(content)
    with pytest.raises(bc.BeamchainError):
        reader_of(ending)[reader](path)


def test_a_spec_of_100_megabytes(tmp_path):
    path = tmp_path / "large.toml"
    with path.open("wb") as stream:
        stream.truncate(100_000_000)
    with pytest.raises(bc.BeamchainError, match="100000000 bytes, more than"):
        bc.fit(READERS["spec"][2](path))


@pytest.mark.parametrize("name", ["../x", "/tmp/x", "a/b", "..", "a\\b", "x\0", "con.xml"])
def test_names_that_lead_outside(name, tmp_path):
    path = tmp_path / "spec.toml"
    path.write_text(SPEC.replace('"boom"', repr(name).replace("'", '"')))
    with pytest.raises(bc.BeamchainError):
        READERS["spec"][2](path)


def test_nothing_is_overwritten_not_even_a_dangling_link(tmp_path):
    link = tmp_path / "fit.json"
    link.symlink_to(tmp_path / "nowhere")
    with pytest.raises(OutputError, match="exists"):
        write_files({link: "x"}, force=False)
    assert link.is_symlink()


def test_reading_leaves_no_file_open(tmp_path):
    path = tmp_path / "x.npz"
    path.write_bytes(READERS["matrices, NumPy"][1])
    before = len(list(Path("/proc/self/fd").iterdir())) if Path("/proc/self/fd").exists() else 0
    for _ in range(5):
        READERS["matrices, NumPy"][2](path)
    after = len(list(Path("/proc/self/fd").iterdir())) if before else 0
    assert after <= before


class Overrun(BaseException):
    """More seconds of the processor than are allowed; no `except Exception` takes it."""


def _overrun(number, frame):
    raise Overrun(f"more than {HANG} s of the processor")


def _opened(event, arguments):
    # else one opened already
    path = event == "open" and OPENED is not None and not isinstance(arguments[0], int)
    if path and (arguments[2] or 0) & (os.O_WRONLY | os.O_RDWR):
        OPENED.append(str(arguments[0]))


@functools.cache
def _watch_files():
    """Once per process: a hook cannot be taken out again."""
    sys.addaudithook(_opened)


def _fitted(number, folder):
    """What goes wrong with the hostile specification of a number, if anything;
    its folder holds nothing else."""
    global OPENED
    text, document = hostile_spec(number)
    (folder / "spec.toml").write_text(text)
    if document is not None:
        (folder / "modes.json").write_text(document)
    before = signal.signal(signal.SIGPROF, _overrun)
    wrong = ""
    start = time.process_time()
    OPENED = []
    try:
        signal.setitimer(signal.ITIMER_PROF, HANG, 1.0)
        result = bc.fit(bc.read_spec(folder / "spec.toml"))
        result.scene_mjcf(), result.as_dict(), str(result), result.warnings
        if number % WRITTEN == 0:
            signal.setitimer(signal.ITIMER_PROF, 0.0)  # drawing has no search in it
            result.write(folder / "out")
    except bc.BeamchainError as error:
        wrong = "" if str(error).strip() else "an error without a sentence"
    except (Exception, Overrun):
        wrong = traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        took, opened, OPENED = time.process_time() - start, OPENED, None
    outside = [
        path
        for path in opened
        if folder not in Path(path).resolve().parents and "__pycache__" not in path
    ]
    if outside:
        wrong += f"\nopened for writing: {outside}"
    return took, f"\nspecification {number}, {took:.2f} s: {wrong}\n{text}" if wrong else ""


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_hostile_specifications(part, tmp_path):
    """Read, fitted, shown: a result or one sentence, nearly always in seconds,
    and nothing written elsewhere."""
    sys.stdout.write(f"BEAMCHAIN_SEED={SEED}\n")
    _watch_files()
    failed, times = [], []
    for i in range(part, SPECS, PARTS):
        folder = tmp_path / str(i)
        folder.mkdir()
        took, wrong = _fitted(SEED * 1_000_000 + i, folder)
        shutil.rmtree(folder)
        times.append(took)
        failed += [wrong] if wrong else []
    longest = max(times, default=0.0)
    sys.stdout.write(
        f"{len(times)} specifications, {sum(times):.1f} s of the processor, {longest:.1f} s the "
        "longest\n"
    )
    assert not failed, f"{len(failed)} of {len(times)}:" + "".join(failed[:10])
    # one in a hundred of all: a part of a hundred may hold a few more than its share
    assert sum(took > SECONDS for took in times) <= max(4, SLOW * len(times))
