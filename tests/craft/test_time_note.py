"""What `embed` says of timing where the file without it is unstable at the spacecraft's step, and
where it has no tendons that could be timed."""

import json

import mujoco
import numpy as np
import pytest

import beamchain as bc
from command import run

CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.5"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="{}" diaginertia="60 90 120"/><site name="left" pos="0 0.5 0"
 xyaxes="0 1 0 -1 0 0"/><site name="right" pos="0 -0.5 0" xyaxes="0 -1 0 1 0 0"/></body></worldbody>
</mujoco>"""


@pytest.mark.slow
def test_a_file_that_is_unstable_without_timing_is_called_so():
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    wing = bc.Spec(
        segment=(bc.Segment(length=8.0, section=section),), damping=bc.Damping(ratio=0.01)
    )
    made = bc.embed(CRAFT.format(60), {"left": wing, "right": wing}, retime=True)
    note = next(said for said in made.warnings if "have timing" in said)
    assert "(unstable in the rest pose without)" in note


def test_a_band_without_a_pole_is_called_so():
    """The first mode lies at 79 rad/s, and a step of 0.02 s moves it by a fifth."""
    section = bc.Equivalent(bending_stiffness_xy=5e4, linear_mass=1.0)
    boom = bc.Spec(
        segment=(bc.Segment(length=4.0, section=section),),
        scene=bc.Scene(bandwidth=8.0, tolerance=1e-4, axes=("z",)),
    )
    text = CRAFT.format(60).replace('timestep="0.5"', 'timestep="0.02"')
    made = bc.embed(text, {"left": boom}, retime=True)
    (note,) = (said for said in made.warnings if said.code == "exact-in-time")
    assert "have timing for Euler at 0.02 s, and no pole lies in the band; feed" in note


@pytest.mark.slow
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
    words = ["embed", "craft.xml", "--mount", "left=wing.toml", "-o", "flexible.xml", "--json"]
    code, out, _ = run([*words, "--no-report"], capsys, monkeypatch)
    record = json.loads(out)
    assert (code, record["met"]) == (3, False)
    assert record["craft_error"] < 0.02 < record["sampled_error"]
    assert mujoco.MjModel.from_xml_path("flexible.xml").ntendon == 0


@pytest.mark.slow
def test_a_resonance_just_beyond_the_band_is_made_exact_in_time():
    """Euler moves the one at 3.38 rad/s by 2.7e-4, which is 2.2e-3 of the motion at 3 rad/s."""
    text = """<mujoco><option gravity="0 0 0" timestep="0.01"/>
    <worldbody><body name="bus"><freejoint/><site name="m" pos="0.5 0 0"/>
    <inertial pos="0 0 0" mass="100" diaginertia="20 30 40"/></body></worldbody></mujoco>"""
    section = bc.Equivalent(bending_stiffness_xy=1277.4, linear_mass=1.0, polar_inertia=0.02)
    boom = bc.Spec(
        segment=(bc.Segment(length=10.0, section=section),),
        damping=bc.Damping(ratio=0.005),
        scene=bc.Scene(bandwidth=3.0, tolerance=1e-3, axes=("z",)),
    )

    def first_pole(model, step):
        model.opt.timestep = step
        data = mujoco.MjData(model)
        a = np.zeros((2 * model.nv, 2 * model.nv))
        mujoco.mjd_transitionFD(model, data, 1e-6, True, a, None, None, None)
        poles = np.log(np.linalg.eigvals(a).astype(complex)) / step
        return min(poles[poles.imag > 0.5], key=abs)

    plain = bc.embed(text, {"m": boom}, retime=False)
    exact = first_pole(plain.model, 1e-4)  # a hundredth of the step
    assert abs(first_pole(plain.model, 0.01) / exact - 1.0) > 2e-4
    made = bc.embed(text, {"m": boom})
    assert made.met
    assert abs(first_pole(made.model, 0.01) / exact - 1.0) < 1e-5
