"""What `embed` says of timing where the file without it is unstable at the spacecraft's step, and
where it has no tendons that could be timed."""

import json

import mujoco
import pytest

import beamchain as bc
from command import run

CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.5"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="{}" diaginertia="60 90 120"/><site name="left" pos="0 0.5 0"
 xyaxes="0 1 0 -1 0 0"/><site name="right" pos="0 -0.5 0" xyaxes="0 -1 0 1 0 0"/></body></worldbody>
</mujoco>"""


def test_a_file_that_is_unstable_without_timing_is_called_so():
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    wing = bc.Spec(
        segment=(bc.Segment(length=8.0, section=section),), damping=bc.Damping(ratio=0.01)
    )
    made = bc.embed(CRAFT.format(60), {"left": wing, "right": wing}, retime=True)
    note = next(said for said in made.warnings if "with timing" in said)
    assert "; without: unstable at this step." in note


@pytest.mark.parametrize(("integrator", "step"), [("discrete", 0.02), ("RK4", 0.3)])
def test_a_step_that_misses_is_told_of_springs_on_hinges_too(
    integrator, step, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    text = CRAFT.format(300).replace(
        'timestep="0.5"', f'timestep="{step}" integrator="{integrator}"'
    )
    (tmp_path / "craft.xml").write_text(text)
    (tmp_path / "wing.toml").write_text(
        'name = "wing"\n[[segment]]\nlength = 8.0\nsection = { shape = "equivalent", '
        "bending_stiffness_xy = 2e3, linear_mass = 4.0 }\n[damping]\nratio = 0.0\n"
        '[scene]\nbandwidth = 2.0\ntolerance = 0.02\naxes = ["z"]\n'
    )
    words = ["embed", "craft.xml", "--at", "left=wing.toml", "-o", "flexible.xml", "--json"]
    code, out, _ = run([*words, "--no-report"], capsys, monkeypatch)
    record = json.loads(out)
    assert (code, record["met"]) == (3, False)
    assert record["craft_error"] < 0.02 < record["sampled_error"]
    assert mujoco.MjModel.from_xml_path("flexible.xml").ntendon == 0
