"""Basilisk's MJScene with a file that embed wrote: string and file, against plain MuJoCo's RK4.

Basilisk brings a MuJoCo of its own and integrates with its own RK4 at the task's rate,
whatever the file says.
"""

import msgspec
import mujoco
import numpy as np
import pytest

import beamchain as bc
from limits import largest_steps
from spacecraft import APPENDAGES, CRAFTS

pytestmark = pytest.mark.host
bsk = pytest.importorskip(
    "Basilisk.simulation.mujoco",
    reason="Basilisk is not installed: pip install 'beamchain[basilisk]'",
)

DIFFERENCE = 1e-9  # of the peak: the bound; two MuJoCo versions, the same Runge-Kutta steps
# at steps some ten times as long the two attitudes, integrated unlike, differ more: 1e-8 measured
LONG = 1e-7
STEP, SECONDS = 0.002, 20.0
KICK = [0.01, -0.02, 0.015, 0.02, 0.03, -0.01]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A spacecraft with a solar-array drive and its array."""
    done = bc.embed(CRAFTS / "drive.xml", {"panel_mount": APPENDAGES / "array_left.toml"})
    return done.write(tmp_path_factory.mktemp("bsk") / "craft.xml")[-1]


def plain(path, step=STEP) -> np.ndarray:
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, step
    data = mujoco.MjData(model)
    data.qvel[:6] = KICK
    out = [data.qpos.copy()]
    for _ in range(round(SECONDS / step)):
        mujoco.mj_step(model, data)
        out.append(data.qpos.copy())
    return np.array(out)


def in_basilisk(scene, step=STEP) -> np.ndarray:
    from Basilisk.utilities import SimulationBaseClass, macros

    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(step)))
    simulation.AddModelToTask("task", scene)
    recorder = scene.stateOutMsg.recorder()
    simulation.AddModelToTask("task", recorder)
    simulation.InitializeSimulation()
    hub = scene.getBody("platform")
    hub.setVelocity(KICK[:3])
    hub.setAttitudeRate(KICK[3:])
    simulation.ConfigureStopTime(macros.sec2nano(SECONDS))
    simulation.ExecuteSimulation()
    return (
        np.array(recorder.qpos)[..., 0] if np.ndim(recorder.qpos) == 3 else np.array(recorder.qpos)
    )


@pytest.mark.parametrize("how", ["string", "file"])
def test_free_motion(path, how):
    scene = bsk.MJScene(path.read_text()) if how == "string" else bsk.MJScene.fromFile(str(path))
    ours = plain(path)
    theirs = in_basilisk(scene)
    assert theirs.shape == ours.shape
    peak = np.abs(ours - ours[0]).max(axis=0)
    worst = float(np.max(np.abs(theirs - ours) / peak))
    print(f"Basilisk ({how}) against plain RK4 over {SECONDS:g} s: {worst:.1e} of the peak")  # noqa: T201
    assert worst < DIFFERENCE


def test_modes_beyond_the_step_are_slowed(tmp_path):
    """Beyond the step that RK4 allows the file as it was blows up; retimed for it,
    Basilisk steps it like MuJoCo."""
    spec = msgspec.structs.replace(
        bc.read_spec(APPENDAGES / "array_left.toml"), modes=bc.Modes(xy=4, xz=4), scene=None
    )
    text = (
        (CRAFTS / "drive.xml").read_text().replace('integrator="implicitfast"', 'integrator="RK4"')
    )
    limit = largest_steps(bc.embed(text, {"panel_mount": spec}, retime=False).to_mjcf())["RK4"]
    # the drive's own spring, which is not slowed, takes 0.039 s
    step = min(float(f"{3.0 * limit:.2g}"), 0.03)
    assert step > 1.5 * limit
    text = text.replace('timestep="0.02"', f'timestep="{step}"')
    done = bc.embed(text, {"panel_mount": spec})
    assert any(warning.code == "slowed-modes" for warning in done.warnings)
    path = done.write(tmp_path / "craft.xml")[-1]
    ours = plain(path, step)
    theirs = in_basilisk(bsk.MJScene.fromFile(str(path)), step)
    peak = np.abs(ours - ours[0]).max(axis=0)
    worst = float(np.max(np.abs(theirs - ours) / peak))
    print(  # noqa: T201
        f"Basilisk with slowed modes at {step:g} s against RK4 over {SECONDS:g} s: {worst:.1e} of "
        "the peak"
    )
    assert np.all(np.isfinite(theirs))
    assert worst < LONG
