"""Steps of a file that is exact in time: its own modes are those of the structure, its limits those
of the file as it stands; against MuJoCo's matrices and its own transitions.

OWN: of frequencies, whose damping shifts them by half its square. NEAR: either side of a limit.
"""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from examples import EXAMPLES

OWN = 1e-6
NEAR = 0.02
CRAFT = """<mujoco model="bus"><option gravity="0 0 0" timestep="0.05"/><worldbody><body name="bus">
<freejoint/><inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/>
<site name="mount" pos="0.6 0 0"/></body></worldbody></mujoco>"""


def frequencies(model: mujoco.MjModel) -> np.ndarray:
    """Of the elastic modes [rad/s], ascending, by MuJoCo's mass matrix and springs alone."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    stiffness = np.zeros((model.nv, model.nv))
    for i in range(model.nv):  # the springs' forces are linear in a turn of a hinge
        if model.jnt_type[model.dof_jntid[i]] == mujoco.mjtJoint.mjJNT_HINGE:
            for sign in (1.0, -1.0):
                data.qpos[:] = model.qpos0
                data.qpos[model.jnt_qposadr[model.dof_jntid[i]]] += sign * 1e-4
                mujoco.mj_forward(model, data)
                stiffness[:, i] -= sign * data.qfrc_spring / 2e-4
    data.qpos[:] = model.qpos0
    mujoco.mj_forward(model, data)
    moved = np.zeros((model.nv, model.nv))
    for i in range(model.nv):  # M^-1 e_i
        mujoco.mj_solveM(model, data, moved[i : i + 1], np.eye(model.nv)[i : i + 1])
    squares = np.sort(np.linalg.eigvals(moved @ stiffness).real)
    return np.sqrt(squares[squares > 1e-3])


def grows(model: mujoco.MjModel, step: float) -> bool:
    """Whether MuJoCo's own step of a model is unstable."""
    model.opt.timestep = step
    a = np.zeros((2 * model.nv, 2 * model.nv))
    mujoco.mjd_transitionFD(model, mujoco.MjData(model), 1e-6, True, a, None, None, None)
    # rigid motion has double poles at 1, which rounding takes apart
    return bool(np.abs(np.linalg.eigvals(a)).max() > 1.0 + 1e-3)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("timed") / "flexible.xml"
    spec = bc.read_spec(EXAMPLES / "array.toml")
    timed = bc.embed(CRAFT, {"mount": spec}, retime=True)
    timed.write(path)
    return path, bc.embed(CRAFT, {"mount": spec}, retime=False).model


@pytest.mark.slow
def test_modes_of_a_file_that_is_exact_in_time_are_the_structures_own(written):
    path, plain = written
    own = frequencies(plain)
    timed = frequencies(mujoco.MjModel.from_xml_path(str(path)))
    assert np.abs(timed / own - 1.0).max() > 1e-2  # its armature is felt
    limits = bc.stability(path).budgets[0]
    ratios = limits.ratios
    np.testing.assert_allclose(limits.frequencies, own, rtol=OWN)
    # what Euler shows at the step that the file was made for is the structure's own
    shown = limits.shown["Euler"]
    np.testing.assert_allclose(shown[0], [own[0], ratios[0]], rtol=1e-3)
    assert np.abs(shown[:, 0] / own - 1.0).max() < 1e-2


@pytest.mark.slow
def test_limits_of_a_file_that_is_exact_in_time_are_those_of_the_file(written):
    path, plain = written
    largest = bc.stability(path).budgets[0].largest_step["Euler"]
    timed = mujoco.MjModel.from_xml_path(str(path))
    assert not grows(timed, (1.0 - NEAR) * largest)
    assert grows(timed, (1.0 + NEAR) * largest)
    assert grows(plain, largest)  # without timing it is not stable there
