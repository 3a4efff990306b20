"""Files that ask for too much, or lead to themselves: one sentence,
within seconds and below a gigabyte."""

import os
import resource
import signal
import time
from multiprocessing import get_context

import pytest

import beamchain as bc
from command import run
from hostile_sizes import SIZES, random_sizes
from spacecraft import spec

EXAMPLES = int(os.environ.get("BEAMCHAIN_FUZZ", "25"))
SECONDS = 20  # of the processor, for one file
MEGABYTES = 1000  # more than before


def write(files, folder):
    """Write the files and give the path of the spacecraft's."""
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder / "craft.xml"


def _measured(path, pipe) -> None:
    """In a process of its own: what came of it, its processor time and its memory."""
    signal.setitimer(signal.ITIMER_PROF, SECONDS)  # ends the process
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    try:
        bc.linearise(path)
        said = ""
    except bc.BeamchainError as error:
        said = str(error)
    except BaseException as error:
        said = f"TRACEBACK {type(error).__name__}: {error}"[:300]
    used = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024.0
    pipe.send((said, time.process_time() - start, used))


def measured(path) -> str:
    """The answer to a file, in a process that may die; it took seconds and less than a gigabyte."""
    ours, theirs = get_context("fork").Pipe(duplex=False)
    child = get_context("fork").Process(target=_measured, args=(path, theirs))
    child.start()
    theirs.close()
    try:
        said, seconds, megabytes = ours.recv()
    except EOFError:
        child.join()
        pytest.fail(f"the process ended with {child.exitcode}: more than {SECONDS} s, or a crash")
    child.join()
    assert not said.startswith("TRACEBACK"), said
    assert seconds < SECONDS
    assert megabytes < MEGABYTES
    return said


@pytest.mark.filterwarnings("ignore")  # Python warns of forking; threads are asleep here
@pytest.mark.parametrize("name", SIZES)
def test_a_file_that_asks_for_too_much(name, tmp_path):
    files, word = SIZES[name]
    assert word in measured(write(files, tmp_path))


@pytest.mark.parametrize(
    "name", ["attaches itself", "a ring of attached files", "includes itself", "replicated again"]
)
def test_embed_says_the_same(name, tmp_path, capsys, monkeypatch):
    files, word = SIZES[name]
    out = tmp_path / "out" / "flexible.xml"
    arguments = [
        "embed",
        str(write(files, tmp_path)),
        "--at",
        f"mount={spec('rod')}",
        "-o",
        str(out),
    ]
    code, _, error = run(arguments, capsys, monkeypatch)
    assert code == 2
    assert error.splitlines()[-1].startswith("beamchain: ")
    assert word in error
    assert not out.parent.exists()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "part", [0, *(pytest.param(part, marks=pytest.mark.slow) for part in range(1, 5))]
)
def test_any_size(part, tmp_path):
    for seed in range(part, EXAMPLES, 5):
        measured(write({"craft.xml": random_sizes(seed)}, tmp_path))


def test_what_spacecraft_ask_for_is_taken(tmp_path):
    """Panels that are replicated, a part that is attached twice, keyframes and memory."""
    part = (
        '<mujoco><worldbody><body name="part"><joint name="j" stiffness="4"/><inertial pos="0 '
        "0 "
        '0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
    )
    (tmp_path / "part.xml").write_text(part)
    twice = "".join(
        f'<frame><attach model="part" body="part" prefix="{p}"/></frame>' for p in ("a_", "b_")
    )
    path = tmp_path / "craft.xml"
    path.write_text(
        '<mujoco><size nkey="10" memory="100M"/><asset><model name="part" '
        'file="part.xml"/></asset><worldbody><body name="bus"><inertial pos="0 0 0" mass="9" '
        f'diaginertia="9 9 9"/>{twice}<replicate count="8" offset="0.1 0 0"><site '
        'name="cell"/></replicate></body></worldbody></mujoco>'
    )
    assert bc.linearise(path).frequencies().tolist() == pytest.approx([2.0, 2.0])
