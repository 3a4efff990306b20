"""What the environment and other libraries do to a command: one sentence, or nothing."""

import os
import subprocess
import sys

import pytest

from examples import example
from spacecraft import CRAFTS

HUGE = """<mujoco><option gravity="0 0 -1e11" timestep="0.01"/><worldbody><body name="b">
<freejoint/>
<inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/><body>
<joint name="j" stiffness="10" axis="0 0 1" pos=".1 0 0"/>
<inertial pos="1 0 0" mass="1" diaginertia="1 1 1"/></body></body></worldbody></mujoco>"""


def outside(arguments, folder, **environment):
    """A command as a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "beamchain", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )


@pytest.mark.slow
def test_mujoco_s_warnings_are_a_sentence_and_no_file(tmp_path):
    (tmp_path / "huge.xml").write_text(HUGE)
    done = outside(["inspect", "huge.xml"], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["huge.xml"]  # no MUJOCO_LOG.TXT
    assert done.stdout == ""
    sentences = done.stderr.splitlines()
    assert sum("MuJoCo warns: " in sentence for sentence in sentences) == 1
    assert all(sentence.startswith("beamchain: ") for sentence in sentences)


@pytest.mark.slow
def test_a_user_s_own_handler_stays(tmp_path):
    """Of Python programs that handle MuJoCo's warnings themselves."""
    code = (
        "import mujoco; heard = []; mujoco.set_mju_user_warning(heard.append)\n"
        "import beamchain as bc\n"
        "try: bc.linearise('huge.xml')\n"
        "except bc.BeamchainError: pass\n"
        "assert mujoco.get_mju_user_warning() is not None and heard, heard"
    )
    (tmp_path / "huge.xml").write_text(HUGE)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["huge.xml"]


@pytest.mark.slow
def test_a_renderer_that_there_is_not(tmp_path):
    done = outside(["inspect", str(CRAFTS / "planar.xml")], tmp_path, MUJOCO_GL="nonsense")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "MUJOCO_GL = 'nonsense'" in done.stderr
    assert "unset it" in done.stderr


@pytest.mark.slow
def test_a_backend_of_matplotlib_that_there_is_not(tmp_path):
    done = outside(["fit", str(example("boom")), "-o", "out"], tmp_path, MPLBACKEND="nonsense")
    assert (done.returncode, done.stderr) == (0, "")
