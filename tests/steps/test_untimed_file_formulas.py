"""A file from which timing is taken out again, beside its numbers before."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from lxml import etree

from beamchain import InputError
from beamchain.steps.modal import TimingMark
from beamchain.steps.retime import Retimed
from beamchain.steps.retime_file import put_hinge_armature
from formulas import TimeError, grows_retimed, modal_tendons, retimed_file

FILE = """<mujoco><option gravity="0 0 0" timestep="0.02" integrator="implicitfast"/><worldbody>
<body name="arm"><joint name="h1" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1" diaginertia=".2 .2 .25"/></body></worldbody><tendon>
<fixed name="arm_mode1" stiffness="35" damping="0.2"><joint joint="h1" coef="0.5"/></fixed></tendon>
</mujoco>"""


def test_without_timing_a_file_has_the_springs_that_it_had(tmp_path):
    """0.25 kg m^2 over 0.5^2 is a mass of 1; exact at 0.05 s: exp(s h) of s^2 + 0.2 s + 35."""
    plain, timed = tmp_path / "plain.xml", tmp_path / "timed.xml"
    plain.write_text(FILE)
    there = retimed_file(plain, 0.05, None, tmp_path)
    timed.write_bytes(there.text)
    model = mujoco.MjModel.from_xml_path(str(timed))
    assert model.opt.timestep == 0.05
    data, found = mujoco.MjData(model), []
    for start in ((0.1, 0.0), (0.0, 0.1)):
        mujoco.mj_resetData(model, data)
        data.qpos[0], data.qvel[0] = start
        mujoco.mj_step(model, data)
        found.append(np.array([data.qpos[0], data.qvel[0]]) / 0.1)
    poles = np.sort_complex(np.linalg.eigvals(np.array(found).T))
    wanted = np.sort_complex(np.exp(0.05 * np.roots([1.0, 0.2, 35.0])))
    assert poles == pytest.approx(wanted, rel=1e-6)
    back = retimed_file(timed, 0.0, None, tmp_path)
    (tmp_path / "back.xml").write_bytes(back.text)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "back.xml"))
    assert model.opt.timestep == 0.05
    assert model.tendon_stiffness[0] == pytest.approx(35.0, rel=1e-12)
    assert model.tendon_damping[0] == pytest.approx(0.2, rel=1e-12)
    assert model.tendon_armature[0] == 0.0


def test_a_step_at_which_a_spring_of_the_craft_would_grow_is_refused(tmp_path):
    """h^2 k / J is 4 at 1600 N m/rad on 1 kg m^2."""
    path = tmp_path / "a.xml"
    more = """<body><joint stiffness="1610"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>"""
    path.write_text(FILE.replace("</worldbody>", more))
    with pytest.raises(InputError, match=r"vibrate at 40\.12 rad"):
        retimed_file(path, 0.05, "Euler", tmp_path)


def test_hinges_with_springs_of_their_own_get_armature_where_tendons_are_exact():
    """k h^2 / 12, however soft."""
    for integrator, exact in (("Euler", True), ("RK4", False)):
        root = etree.fromstring(
            """<mujoco><joint name="soft" stiffness="0.06"/><joint name="hard" stiffness="30"/>
            <joint name="loose" stiffness="0"/><joint name="free"/></mujoco>"""
        )
        put_hinge_armature(root, 0.2, integrator)
        found = {one.get("name"): one.get("armature") for one in root.iter("joint")}
        assert (found["loose"], found["free"]) == (None, None)
        if exact:
            armature = [float(found[name]) for name in ("soft", "hard")]
            assert armature == pytest.approx([0.06 * 0.04 / 12.0, 30.0 * 0.04 / 12.0])
        else:
            assert (found["soft"], found["hard"]) == (None, None)


@pytest.mark.parametrize(("unstable", "wanted"), [(0.3, 1), (0.7, 1), (1.1, 1), (9, 0)])
def test_a_step_is_looked_at_in_every_pose(unstable, wanted, monkeypatch):
    model = mujoco.MjModel.from_xml_string(FILE)
    asked = []

    def motion_for(timed, timestep, integrator, qpos):
        asked.append((float(qpos), timestep, integrator, timed.dof_armature.tolist()))
        return SimpleNamespace(grows=qpos == unstable)

    monkeypatch.setattr("beamchain.steps.retime.motion_for", motion_for)
    monkeypatch.setattr("beamchain.steps.retime.tuned_poses", lambda *_: [0.2, 0.3])
    monkeypatch.setattr("beamchain.steps.retime.turned_poses", lambda *_: [0.7])
    plan = SimpleNamespace(armature=np.zeros(1), damping=np.zeros(1), stiffness=None)
    mark = TimingMark(0.05, "RK4", 2)
    found = grows_retimed(model, modal_tendons(model), plan, np.array([0.4]), mark, 1.1)
    assert found == wanted
    assert asked[-1] == (unstable if wanted else 1.1, 0.05, "RK4", [0.4])
    assert model.dof_armature.tolist() == [0.0]
    assert grows_retimed(model, modal_tendons(model), plan, np.zeros(1), mark, None) is (
        unstable < 1.0
    )


def test_a_retimed_model_is_warned_of_where_form_4_is_not_exact():
    model = mujoco.MjModel.from_xml_string(FILE)
    for form, error, codes in (
        (4, 2e-6, ["time-error"]), (4, 1e-7, []), (2, 2e-6, []), (5, 2e-6, []),
    ):  # fmt: skip
        done = Retimed(0.02, "Euler", form, 2.0, 0.5, (), {}, model)
        done.__dict__["time_error"] = TimeError(error, 3.0, "rest", 0.02, "Euler")
        assert [one.code for one in done.warnings] == codes
    assert Retimed(0.0, "Euler", 4, 2.0, 0.5, (), {}).warnings == []
