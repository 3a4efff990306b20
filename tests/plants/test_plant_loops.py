"""Margins of controllers on plants, and the command: checked by closing the loop, not by the formulas that found them."""

import json

import msgspec
import numpy as np
import pytest

import beamchain as bc
from beamchain.craft.plants.controllers import Controller, Filter, Loop, read_controller
from beamchain.craft.plants.loops import beyond, margins
from command import run

ON_THE_CIRCLE = (
    1e-4  # of det(1 + K G) at the margin's own frequency, relative to its size nearby; interpolated response
)
CRAFT = """<mujoco model="craft"><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/><site name="mount" pos="0.5 0 0.3"/>
<site name="tank" pos="-0.4 0 0"/></body></worldbody><keyframe><key name="parked" qpos="0 0 0 1 0 0 0"/></keyframe></mujoco>"""
BOOM = bc.Spec(
    name="boom", modes=bc.Modes(xy=2, xz=2), damping=bc.Damping(ratio=0.005),
    segment=(bc.Segment(length=8.0, section=bc.Equivalent(bending_stiffness_xy=2e3, bending_stiffness_xz=5e3, linear_mass=4.0,
                                                          polar_inertia=0.1)),),
)  # fmt: skip
LOOPS = Controller(loop=tuple(
    Loop(input=f"torque_{axis}", output=f"attitude_{axis}", numerator=(900.0, 80.0), denominator=(0.05, 1.0), delay=0.02,
         sensor=Filter(numerator=(1.0,), denominator=(0.01, 1.0)))
    for axis in "yz"
))  # fmt: skip
TOML = """[[loop]]
input = "torque_z"
output = "attitude_z"
numerator = [900.0, 80.0]
denominator = [0.05, 1.0]
delay = 0.02
"""


@pytest.fixture(scope="module")
def plant():
    return bc.plant(bc.embed(CRAFT, {"mount": BOOM}), ["torque:bus"], ["attitude"])


def returned(plant, controller, omega, factors, extra=0.0):
    """`det(1 + K G)` at one frequency, each loop's gain times a factor, the first delayed further."""
    s = 1j * omega
    out, names = list(plant.output_labels), list(plant.input_labels)
    response = plant.C @ np.linalg.solve(s * np.eye(plant.nstates) - plant.A, plant.B) + plant.D
    pick = response[
        np.ix_([out.index(one.output) for one in controller.loop], [names.index(one.input) for one in controller.loop])
    ]
    gains = []
    for k, (loop, factor) in enumerate(zip(controller.loop, factors, strict=True)):
        value = np.polyval(loop.numerator, s) / np.polyval(loop.denominator, s)
        value *= np.polyval(loop.sensor.numerator, s) / np.polyval(loop.sensor.denominator, s) if loop.sensor else 1.0
        gains.append(factor * value * np.exp(-s * (loop.delay + (extra if k == 0 else 0.0))))
    return np.linalg.det(np.eye(len(gains)) + np.diag(gains) @ pick)


def scaled(controller, number, factor):
    """The controller with one loop's gain times a factor."""
    loops = list(controller.loop)
    loops[number] = msgspec.structs.replace(loops[number], numerator=tuple(factor * v for v in loops[number].numerator))
    return Controller(loop=tuple(loops))


def test_at_the_gain_margin_the_loops_are_singular(plant):
    found = margins(plant, LOOPS)
    assert all(one.stable for one in found)
    for k, one in enumerate(found):
        assert np.isfinite(one.gain)
        factors = [one.gain if i == k else 1.0 for i in range(2)]
        assert abs(returned(plant, LOOPS, one.gain_frequency, factors)) < ON_THE_CIRCLE * abs(
            returned(plant, LOOPS, one.gain_frequency, [1.0, 1.0])
        )


def test_beyond_the_gain_margin_the_closed_loop_is_unstable(plant):
    for k, one in enumerate(margins(plant, LOOPS)):
        assert all(m.stable for m in margins(plant, scaled(LOOPS, k, 0.995 * one.gain)))
        assert not any(m.stable for m in margins(plant, scaled(LOOPS, k, 1.005 * one.gain)))


def test_at_the_delay_margin_the_loops_are_singular(plant):
    one = margins(plant, LOOPS)[0]
    near = np.linspace(0.9, 1.1, 2001) * one.phase_frequency
    gap = min(abs(returned(plant, LOOPS, omega, [1.0, 1.0], one.delay)) for omega in near)
    assert gap < 1e-3
    assert min(abs(returned(plant, LOOPS, omega, [1.0, 1.0], 0.5 * one.delay)) for omega in near) > 1e-2


def test_the_disk_margin_bounds_gain_and_phase(plant):
    for one in margins(plant, LOOPS):
        assert (2.0 + one.disk) / (2.0 - one.disk) <= one.gain * (1.0 + 1e-6)
        assert 2.0 * np.degrees(np.arctan(one.disk / 2.0)) <= abs(one.phase) * (1.0 + 1e-6)


def test_a_wrong_sign_is_unstable(plant):
    assert not margins(plant, scaled(LOOPS, 0, -1.0))[0].stable


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"input": "torque_q"}, "loop.input = 'torque_q' is no input of the plant; choose from torque_x"),
        ({"output": "rate_z"}, "loop.output = 'rate_z' is no output of the plant"),
        ({"numerator": (1.0, 2.0, 3.0)}, "has a higher power of s than denominator"),
        ({"denominator": (0.0,)}, "is zero; give"),
        ({"delay": -1.0}, "delay = -1.0 must not be negative"),
    ],
)
def test_wrong_loops_are_told(change, words, plant):
    with pytest.raises(bc.InputError, match=words):
        margins(plant, Controller(loop=(msgspec.structs.replace(LOOPS.loop[0], **change),)))


def test_a_controller_without_loops_is_told(plant):
    with pytest.raises(bc.InputError, match=r"has no loop; give at least one \[\[loop\]\]"):
        margins(plant, Controller(loop=()))


@pytest.fixture(scope="module")
def of_two():
    """A plant, and an attitude loop from a star tracker and a gyro, both on one input; another loop beside it."""
    plant = bc.plant(bc.embed(CRAFT, {"mount": BOOM}), ["torque:bus"], ["attitude", "rate"])
    angle = Loop(input="torque_y", output="attitude_y", numerator=(80.0,), denominator=(0.05, 1.0), delay=0.05)
    rate = Loop(input="torque_y", output="rate_y", numerator=(900.0,), denominator=(0.05, 1.0), delay=0.02)
    return plant, Controller(loop=(angle, LOOPS.loop[1], rate))


def test_loops_on_one_input_add_up(of_two):
    plant, both = of_two
    found = margins(plant, both)
    assert [one.name for one in found] == ["torque_y from attitude_y + rate_y", "torque_z from attitude_z"]
    assert all(one.stable for one in found)
    for one, factors in zip(found, ((found[0].gain, 1.0, found[0].gain), (1.0, found[1].gain, 1.0)), strict=True):
        assert np.isfinite(one.gain)
        assert abs(returned(plant, both, one.gain_frequency, factors)) < ON_THE_CIRCLE * abs(
            returned(plant, both, one.gain_frequency, (1.0, 1.0, 1.0))
        )
    for factor, stable in ((0.995, True), (1.005, False)):
        louder = scaled(scaled(both, 0, factor * found[0].gain), 2, factor * found[0].gain)
        assert margins(plant, louder)[0].stable == stable


def test_an_unstable_loop_has_no_margins(plant):
    one = margins(plant, scaled(LOOPS, 0, -1.0))[0]
    assert np.isnan([one.gain, one.lowest_gain, one.phase, one.delay, one.disk]).all()
    assert one.as_dict()["gain"] is None
    assert ("", "", "delay, s", "-", "") in one.rows()


def test_margins_above_the_kept_modes_are_told(plant):
    found = margins(plant, LOOPS)
    top = max(w for name, w in zip(plant.modes, plant.frequency, strict=True) if "filler" not in name)
    expected = [w > top for one in found for w in (one.gain_frequency, one.phase_frequency, one.disk_frequency)]
    assert sum(said.count(" margin (at ") for said in beyond(plant, found)) == sum(expected)
    far = [one._replace(gain_frequency=1.01 * top) for one in found[:1]]
    assert f"{found[0].name}: gain margin (at {1.01 * top:.4g} rad/s)" in beyond(plant, far)[0]


def test_margins_are_of_continuous_plants():
    sampled = bc.plant(bc.embed(CRAFT, {"mount": BOOM}), ["torque:bus"], ["attitude"], discrete=0.01)
    with pytest.raises(bc.InputError, match="leave discrete out"):
        margins(sampled, LOOPS)


# -- the command -------------------------------------------------------------------------------------------------------
@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bc.embed(CRAFT, {"mount": BOOM}).write(tmp_path / "flexible.xml")
    (tmp_path / "loops.toml").write_text(TOML)
    return tmp_path


def test_the_command_writes_plant_and_report(place, capsys, monkeypatch, plant):
    asked = ["plant", "flexible.xml", "--input", "torque:bus", "--output", "attitude", "--controller", "loops.toml"]
    code, told, _ = run([*asked, "-o", "plant.npz", "--json"], capsys, monkeypatch)
    assert code == 0
    record = json.loads(told)
    own = margins(plant, read_controller("loops.toml"))[0]
    assert record["margins"][0][0]["gain"] == pytest.approx(own.gain, rel=1e-6)
    assert [mode["name"] for mode in record["modes"]] == list(plant.modes)
    np.testing.assert_allclose(np.load("plant.npz")["Frequency"], plant.frequency, rtol=1e-9)
    page = (place / "plant_report.html").read_text()
    for words in ("Margins", "Nichols", "Hz", "boom_mode1_xy", "Poles"):
        assert words in page
    code, _, error = run([*asked, "-o", "plant.npz"], capsys, monkeypatch)
    assert (code, "--force" in error) == (2, True)


def test_the_command_takes_keyframes_and_tells_what_is_unstable(place, capsys, monkeypatch):
    (place / "loops.toml").write_text(TOML.replace("[900.0, 80.0]", "[-900.0, -80.0]"))
    asked = ["plant", "flexible.xml", "--input", "torque:bus", "--at", "parked", "--controller", "loops.toml"]
    code, told, _ = run([*asked, "-o", "plant.mat", "--no-report"], capsys, monkeypatch)
    assert code == 3
    assert "UNSTABLE" in told
    assert not (place / "plant_report.html").exists()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--input", "weel"], "weel"),
        (["--angle", "drive"], "is not JOINT=ANGLES"),
        (["--angle", "drive=0,x"], "is not JOINT=ANGLES"),
        (["--angle", "drive=0,1", "--at", "parked"], "leave one out"),
        (["--controller", "nothing.toml"], "does not exist"),
        (["--at", "nowhere"], "nowhere"),
    ],
)
def test_wrong_calls_write_nothing(more, words, place, capsys, monkeypatch):
    before = sorted(place.iterdir())
    code, _, error = run(
        ["plant", "flexible.xml", "-o", "plant.npz", "--input", "torque:bus", *more], capsys, monkeypatch
    )
    assert code == 2
    assert words in error
    assert error.count("\n") == 1
    assert sorted(place.iterdir()) == before


def test_angles_give_a_plant_each(place, capsys, monkeypatch):
    turning = CRAFT.replace(
        '<site name="mount" pos="0.5 0 0.3"/>',
        '<body name="yoke" pos="0.5 0 0.3"><joint name="drive" axis="1 0 0"/><inertial pos="0 0 0" mass="4" '
        'diaginertia="0.2 0.2 0.2"/><site name="mount"/></body>',
    ).replace(' 1 0 0 0"/>', ' 1 0 0 0 0"/>').replace("</worldbody>", '</worldbody><actuator><position name="hold" joint="drive" '
                                                      'kp="4e4" kv="400"/></actuator>')  # fmt: skip
    bc.embed(turning, {"mount": replace_modes(BOOM)}).write(place / "turning.xml")
    asked = ["plant", "turning.xml", "--input", "torque:bus", "--angle", "drive=0,45,90", "--controller", "loops.toml"]
    code, told, _ = run([*asked, "-o", "angles.npz", "--json"], capsys, monkeypatch)
    record = json.loads(told)
    assert code in (0, 3)
    np.testing.assert_allclose(record["angles"], [0.0, 45.0, 90.0], atol=1e-9)
    assert len(record["margins"]) == 3
    assert np.load("angles.npz")["A"].shape[0] == 3
    assert "angle of the drive" in (place / "angles_report.html").read_text()


def replace_modes(spec):
    """The boom with one mode per plane, to be quick."""
    return spec.replace(modes=1)
