"""What the environment and other libraries do to a command: one sentence, or nothing."""

import os
import subprocess
import sys

import numpy as np
import pytest

from beamchain import identification
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


def test_a_renderer_that_there_is_not(tmp_path):
    done = outside(["inspect", str(CRAFTS / "planar.xml")], tmp_path, MUJOCO_GL="nonsense")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "MUJOCO_GL = 'nonsense'" in done.stderr
    assert "unset it" in done.stderr


@pytest.mark.slow
def test_a_backend_of_matplotlib_that_there_is_not(tmp_path):
    assert outside(["init", "boom"], tmp_path).returncode == 0
    done = outside(["fit", "boom.toml", "-o", "out"], tmp_path, MPLBACKEND="nonsense")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_good_log_is_read_as_its_mapping_is(tmp_path):
    omega = np.linspace(0.2, 8.0, 300)
    s = 1j * omega
    log = {
        "omega": omega,
        "rate_z/torque_z": 1.0 / (s * (130.0 - 36.0 * s**2 / (s**2 + 0.02 * s + 4.0))),
    }
    craft = """<mujoco><worldbody><body name="bus"><freejoint/>
    <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
    <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>"""
    path = tmp_path / "log.npz"
    renamed = {"response": "rate_z/torque_z"}
    arrays = {"omega": omega, "response": log["rate_z/torque_z"]}
    np.savez_compressed(path, **arrays)
    stored = identification.identify(path, craft, "mount", map=renamed)
    given = identification.identify(log, craft, "mount")
    np.testing.assert_array_equal(
        [m.frequency for m in stored.modes], [m.frequency for m in given.modes]
    )
