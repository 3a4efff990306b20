"""Tests an internal, `files.write_files`, beside the commands: killed without warning (SIGKILL) at
any moment: every file that is there is whole, and the last says that all are."""

import json
import os
import signal
import subprocess
import sys
import time
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from beamchain.files import write_files

FILES = {
    "appendage.xml": "<mujoco/>" * 50_000,
    "scene.xml": "<mujoco/>",
    "picture.svg": "<svg/>",
    "fit.json": '{"a": 1}',
}
BOOM = """name = "boom"
[[segment]]
length = 15.0
section = { shape = "round", diameter = 0.012 }
material = { youngs_modulus = 2.06e11, density = 7800.0 }
[root]
hub = { mass = 500.0, inertia = [400.0, 400.0, 500.0], offset = [1.0, 0.0, 0.0] }
[uncertain]
stiffness = { relative = 0.05 }
"""
#: command: its arguments (OUT: the folder), and the file that comes last; all others write by the
#: same `write_files`
COMMANDS = {
    "fit": (["fit", "SPEC", "-o", "OUT"], "fit.json"),
    "sweep": (["sweep", "SPEC", "-o", "OUT", "--samples", "12"], "sweep.json"),
}
MOMENTS = 2  # kills per command


def _write_and_die(folder: Path, after: int, force: bool) -> None:
    count, rename = [0], Path.replace

    def counted(self, target):
        if count[0] == after:
            os.kill(os.getpid(), signal.SIGKILL)
        count[0] += 1
        return rename(self, target)

    Path.replace = counted  # type: ignore[method-assign]
    write_files({folder / name: text for name, text in FILES.items()}, force=force)


def visible(folder: Path) -> dict[str, Path]:
    return (
        {p.name: p for p in folder.iterdir() if not p.name.startswith(".")}
        if folder.is_dir()
        else {}
    )


@pytest.mark.filterwarnings("ignore")  # Python warns of forking
@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("after", range(len(FILES) + 1))
def test_killed_between_two_files(after, force, tmp_path):
    if force:
        for name in FILES:
            (tmp_path / name).write_text("old")
    child = get_context("fork").Process(target=_write_and_die, args=(tmp_path, after, force))
    child.start()
    child.join()
    assert child.exitcode == (-signal.SIGKILL if after < len(FILES) else 0)
    found = visible(tmp_path)
    for name, path in found.items():
        assert path.read_text() in (FILES[name], "old" if force else FILES[name])
    assert ("fit.json" in found) == (after == len(FILES))
    if "fit.json" in found:
        assert {name: path.read_text() for name, path in found.items()} == FILES


def whole(path: Path) -> bool:
    """Whether a file ends as a file of its kind does."""
    content = path.read_bytes()
    kind = path.suffix
    if kind == ".json":
        json.loads(content)
    elif kind in (".xml", ".svg"):
        etree.fromstring(content)
    elif kind == ".html":
        return content.rstrip().endswith(b"</html>")
    elif kind == ".png":
        return content.endswith(b"IEND\xaeB`\x82")
    elif kind == ".npz":
        with np.load(path) as stored:
            return all(stored[name].size >= 0 for name in stored.files)
    elif kind == ".py":
        compile(content, path.name, "exec")
    return bool(content)


def started(command: str, folder: Path) -> subprocess.Popen:
    recipe = folder / "boom.toml"
    recipe.write_text(BOOM if command == "sweep" else BOOM.split("[uncertain]")[0])
    out = folder / "out"
    arguments = [
        a.replace("SPEC", str(recipe)).replace("OUT", str(out)) for a in COMMANDS[command][0]
    ]
    return subprocess.Popen(
        [sys.executable, "-m", "beamchain", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        cwd=folder,
        start_new_session=True,
    )


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_killed_at_any_moment(command, tmp_path):
    folder = tmp_path / "whole"
    folder.mkdir()
    start = time.perf_counter()
    done = started(command, folder)
    _, said = done.communicate(timeout=120)
    seconds = time.perf_counter() - start
    assert done.returncode in (0, 3), said
    everything = set(visible(folder / "out"))
    last = COMMANDS[command][1]
    assert last in everything
    for i in range(MOMENTS):
        # most of them in the last tenth, where files are written
        moment = seconds * (0.5 if i == 0 else 0.9 + 0.02 * i)
        folder = tmp_path / str(i)
        folder.mkdir()
        child = started(command, folder)
        time.sleep(moment)
        os.killpg(child.pid, signal.SIGKILL)
        child.communicate()
        found = visible(folder / "out")
        assert all(whole(path) for path in found.values()), found
        if last in found:
            assert set(found) == everything
