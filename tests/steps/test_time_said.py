"""What commands and results say of time: exact only where it is, both errors,
the mode that is the cause."""

import json
import re

import mujoco
import numpy as np
import pytest

import beamchain as bc
import stepped
from beamchain.steps.retime import retime_by
from command import call, run

TUBE = bc.Tube(outer_diameter=0.05, wall=0.002)
ALUMINIUM = bc.Material(youngs_modulus=7e10, density=2700.0)
PART = (
    "[[segment]]\nlength = {}\nsection = {{ shape = 'tube', outer_diameter = 0.05, wall = "
    "0.002 "
    "}}\n"
)
PART += "material = {{ youngs_modulus = 7e10, density = 2700.0 }}\n[damping]\nratio = {}\n"
JUDGED = re.compile(
    r"judged up to ([\d.]+) rad/s: a band up to ([\d.]+) rad/s needs a step of ([\d.]+) s or less"
)
SCENE = "[scene]\nbandwidth = 10.0\ntolerance = {}\naxes = ['z']\n"


def bus(step, integrator="Euler", mass=83.0):
    return (
        f'<mujoco><option gravity="0 0 0" timestep="{step}" '
        f'integrator="{integrator}"/><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" '
        f'mass="{mass}" diaginertia="{0.3 * mass} {0.4 * mass} {0.5 * mass}"/><site name="a" '
        'pos="0.5 0 0"/><site name="b" pos="-0.5 0 0" euler="0 0 180"/></body></worldbody></mujoco>'
    )


def boom(name, ratio, **more):
    part = bc.Segment(length=8.0, section=TUBE, material=ALUMINIUM)
    return bc.Spec(name=name, segment=(part,), damping=bc.Damping(ratio=ratio), **more)


@pytest.mark.slow
def test_implicit_states_both_errors_and_advises_euler():
    made = bc.embed(bus(0.002, "implicit"), {"a": boom("boom", 0.05)}, retime=True)
    said = [w for w in made.warnings if w.code in ("time-error", "exact-in-time")]
    assert [w.code for w in said] == ["time-error"]
    assert len(re.findall(r"off by [\d.e-]+ of \|z - 1\|", said[0])) == 1
    assert " (without, poles are off by up to " in said[0]
    assert "Euler" in said[0]
    assert "exact in time" not in said[0]


@pytest.mark.slow
def test_slowed_modes_are_named_by_the_coupled_frequency_from_which_on_they_are_felt():
    model = bc.embed(
        bus(0.02), {"a": boom("one", 0.01), "b": boom("two", 0.01)}, retime=False
    ).model
    done = retime_by(4, model, 0.1, "Euler")
    (said,) = done.slowed
    first = float(re.search(r"0.1 % stands at ([\d.]+) rad/s", said)[1])
    plain = mujoco.MjModel.from_xml_string(
        bc.embed(bus(0.02), {"a": boom("one", 0.01)}, retime=False).to_mjcf()
    )
    assert first < 15.0  # a coupled pole below the held tendon's 30 rad/s is off already
    assert "time-error" in [w.code for w in done.warnings]
    assert done.time_error.error > 1e-4
    assert bc.retime(plain, 0.0).time_error is None


@pytest.mark.slow
def test_retime_prints_both_errors_and_exits_with_3(tmp_path, capsys, monkeypatch):
    (tmp_path / "bus.xml").write_text(bus(0.02))
    (tmp_path / "boom.toml").write_text(
        "name = 'boom'\n" + PART.format(8.0, 0.01) + SCENE.format(1e-3)
    )
    at = ["--mount", f"a={tmp_path}/boom.toml", "--mount", f"b={tmp_path}/boom.toml"]
    run(
        ["embed", f"{tmp_path}/bus.xml", *at, "-o", f"{tmp_path}/out.xml", "--no-report"],
        capsys,
        monkeypatch,
    )
    words = ["retime", f"{tmp_path}/out.xml", "--timestep", "0.1"]
    words += ["-o", f"{tmp_path}/coarse.xml", "--json"]
    status, out, _ = run(words, capsys, monkeypatch)
    record = json.loads(out)
    assert (status, record["met"], record["tolerance"]) == (3, False, 1e-3)
    assert record["sampled_error"] > 1e-3
    assert record["time_error"]["error"] > 1e-6
    assert {"slowed-modes", "time-error"} <= {w["code"] for w in record["warnings"]}
    # a file without the marks of embed: the error of the poles alone
    bare = re.sub(r"<!--.*?-->", "", (tmp_path / "out.xml").read_text(), flags=re.DOTALL)
    bare = re.sub(r"<custom>.*?</custom>", "", bare, flags=re.DOTALL)
    (tmp_path / "bare.xml").write_text(bare)
    words = ["retime", f"{tmp_path}/bare.xml", "--timestep", "0.1", "-o"]
    status, out, _ = run([*words, f"{tmp_path}/b.xml", "--json"], capsys, monkeypatch)
    other = json.loads(out)
    assert (status, other["sampled_error"], other["met"]) == (0, None, None)
    assert other["time_error"]["error"] > 1e-6
    status, out, _ = run([*words, f"{tmp_path}/c.xml"], capsys, monkeypatch)
    assert "not known" in out


@pytest.mark.slow
def test_a_step_is_judged_without_timing_too_and_the_resonance_it_shifts_is_named(tmp_path):
    """Two wings of 0.5 % damping at a step whose response is off by what it makes of one
    resonance; the poles with and without the step are those of `mj_step` and of M, D, K."""
    (tmp_path / "bus.xml").write_text(bus(0.01))
    text = "name = 'boom'\n" + PART.format(8.0, 0.005) + SCENE.format(1e-3)
    (tmp_path / "boom.toml").write_text(text)
    at = ["--mount", f"a={tmp_path}/boom.toml", "--mount", f"b={tmp_path}/boom.toml"]
    words = ["embed", tmp_path / "bus.xml", *at, "-o", tmp_path / "out.xml", "--no-report"]
    answer = call(*words, "--no-retime")
    assert answer.status == 3
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    assert np.all(model.tendon_armature == 0.0)  # nothing was timed
    said = " ".join(answer.out.split())
    frequency, shift, ratio = re.search(
        r"at ([\d.]+) rad/s \(a and b .* shifts by (\S+) of .* damping ratio, ([\d.e-]+),", said
    ).groups()
    exact = stepped.continuous(model)
    s = exact[np.argmin(np.abs(exact - 1j * float(frequency)))]
    shown = np.log(np.linalg.eigvals(stepped.stepped(model)[0]).astype(complex)) / 0.01
    near = shown[np.argmin(np.abs(shown - s))]
    assert float(frequency) == pytest.approx(abs(s), rel=1e-3)
    assert float(shift) == pytest.approx(abs(near) / abs(s) - 1.0, rel=0.05)  # two digits
    assert float(ratio) == pytest.approx(-s.real / abs(s), rel=0.01)
    change = float(re.search(r"changes its response there by ([\d.e-]+)\.", said)[1])
    stated = float(re.search(r"by ([\d.e-]+) when stepped", said)[1])
    assert change == pytest.approx(stated, rel=0.3)  # the mode is most of the motion there
    assert answer.out.count("above the tolerance") == 1


@pytest.mark.slow
def test_fit_is_decided_at_the_stated_step(tmp_path, capsys, monkeypatch):
    hub = "[root]\nhub = { mass = 83.0, inertia = [20.0, 30.0, 40.0], offset = [0.5, 0.0, 0.0] }\n"
    text = "name = 'boom'\n" + PART.format(8.0, 0.05) + hub + SCENE.format(1e-3)
    (tmp_path / "loose.toml").write_text(text)
    (tmp_path / "stepped.toml").write_text(text + "timestep = 0.1\nintegrator = 'implicit'\n")
    loose = bc.fit(bc.read_spec(tmp_path / "loose.toml")).as_dict()
    assert (loose["ok"], loose["met"]) == (True, True)
    assert (loose["sampled_error"], loose["time_error"]) == (None, None)
    words = ["fit", f"{tmp_path}/stepped.toml", "-o", f"{tmp_path}/stepped", "--json"]
    status, out, _ = run(words, capsys, monkeypatch)
    at_step = json.loads(out)
    assert (status, at_step["met"], at_step["ok"]) == (3, False, False)
    assert at_step["sampled_error"] > 1e-3 > at_step["in_band_error"]
    assert at_step["time_error"]["integrator"] == "implicit"
    # limits are those of the file as it is written
    assert (
        loose["stability"]["largest_step"]["Euler"]
        < 0.06
        < 0.1
        <= at_step["stability"]["largest_step"]["implicit"]
    )


@pytest.mark.slow
def test_a_sampled_plant_names_the_servo_that_is_unstable():
    craft = (
        '<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody><body '
        'name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="100 110 120"/><body '
        'name="yoke"><joint name="drive" axis="0 0 1"/><inertial pos="0 0 0" mass="5" '
        'diaginertia="1 1 1"/><site name="b" pos="0.2 0 '
        '0"/></body></body></worldbody><actuator><position name="servo" joint="drive" kp="3000" '
        'kv="60"/></actuator></mujoco>'
    )
    made = bc.embed(craft, {"b": boom("boom", 0.005)}, retime=True)
    with pytest.raises(bc.BeamchainError, match="unstable: .*'drive'.* 'servo'") as bad:
        bc.plant(made, ["torque:bus"], ["attitude"], discrete=0.25)
    assert "retime" not in str(bad.value)
    step = float(re.search(r"give a step of ([\d.]+) s", str(bad.value))[1])
    plant = bc.plant(made, ["torque:bus"], ["attitude"], discrete=step)  # the cure helps
    assert plant.time_error.step == step
    assert plant.sampled_error > 0.0
    assert bc.plant(made, ["torque:bus"], ["attitude"]).time_error is None


@pytest.mark.parametrize("damper", ['damping="400"', ""])
@pytest.mark.slow
def test_a_pole_that_a_drive_damps_is_named_and_euler_is_not_advised(damper):
    """Its error is that of the drive's damper, taken at the end of the step: no timing of the
    appendage mends it, and with kv in place of damping Euler would be unstable."""
    servo = "" if damper else ' kv="400"'
    text = (
        '<mujoco><option gravity="0 0 0" timestep="0.005" integrator="implicitfast"/><worldbody>'
        '<body name="bus"><freejoint/><inertial pos="0 0 0" mass="200" diaginertia="60 80 100"/>'
        '<body name="drum" pos="0.5 0 0">'
        f'<joint name="drive" axis="0 0 1" {damper}/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/><site name="a"/></body>'
        '</body></worldbody><actuator><position joint="drive" kp="500"'
        f"{servo}/></actuator></mujoco>"
    )
    made = bc.embed(text, {"a": boom("boom", 0.01)}, retime=True)
    (said,) = [w for w in made.warnings if w.code == "time-error"]
    assert "damped by 'drive'" in said
    assert "Timing cannot correct" in said
    assert "Euler" not in said
    assert made.time_error.damped_by == "drive"
    (slowed,) = bc.retime(made.model, 0.1, "implicitfast").slowed
    assert "joint 'drive' damps it" in slowed


@pytest.mark.slow
def test_a_step_that_does_not_represent_the_band_does_not_meet_it(tmp_path):
    # a sampled motion is judged up to 2.6 rad per step: up to there a stiff boom, whose modes lie
    # beyond the band, has next to no error
    band, step = 60.0, 0.2
    wide = bc.Tube(outer_diameter=0.2, wall=0.002)
    part = bc.Segment(length=2.0, section=wide, material=ALUMINIUM)
    scene = bc.Scene(bandwidth=band, tolerance=0.2)
    stiff = bc.Spec(name="boom", segment=(part,), scene=scene, modes=bc.Modes(xy=1, xz=0))
    made = bc.embed(bus(step), {"a": stiff})
    made.write(tmp_path / "out.xml")
    fitted = bc.fit(stiff, scene=bc.Scene(bandwidth=band, tolerance=0.2, timestep=step))
    words = ["retime", tmp_path / "out.xml", "--timestep", step / 2, "-o", tmp_path / "half.xml"]
    retimed = call(*words)
    assert (made.met, fitted.met, fitted.status.ok, retimed.status) == (False, False, False, 3)
    said = {made.headline: step, fitted.status.message: step, retimed.out: step / 2}
    for text, h in said.items():
        judged, asked, longest = map(float, JUDGED.search(" ".join(text.split())).groups())
        assert (judged, asked) == (pytest.approx(2.6 / h, rel=1e-3), band)
        assert 0.999 * 2.6 / band <= longest <= 2.6 / band
    assert made.sampled_error < scene.tolerance
    assert made.cure.setting.timestep <= longest
    assert not JUDGED.search(bc.embed(bus(longest), {"a": stiff}).headline)
