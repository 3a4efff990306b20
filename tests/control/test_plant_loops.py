"""Margins of controllers on plants, and the command: checked by closing the loop,
not by the formulas that found them."""

import json
import re

import numpy as np
import pytest

import beamchain as bc
from command import call, run
from loops import asked, margins, scaled, written

ON_THE_CIRCLE = (
    # of det(1 + K G) at the margin's own frequency, relative to its size nearby;
    # interpolated response
    1e-4
)
CRAFT = """<mujoco model="craft"><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/><site name="mount" pos="0.5 0 0.3"/>
<site name="tank" pos="-0.4 0 0"/></body></worldbody><keyframe>
<key name="parked" qpos="0 0 0 1 0 0 0"/></keyframe></mujoco>"""
BOOM = bc.Spec(
    name="boom",
    modes=bc.Modes(xy=2, xz=2),
    damping=bc.Damping(ratio=0.005),
    segment=(
        bc.Segment(
            length=8.0,
            section=bc.Equivalent(
                bending_stiffness_xy=2e3,
                bending_stiffness_xz=5e3,
                linear_mass=4.0,
                polar_inertia=0.1,
            ),
        ),
    ),
)
LOOPS = [
    {
        "input": f"torque_{axis}",
        "output": f"attitude_{axis}",
        "numerator": [900.0, 80.0],
        "denominator": [0.05, 1.0],
        "delay": 0.02,
        "sensor": {"numerator": [1.0], "denominator": [0.01, 1.0]},
    }
    for axis in "yz"
]
ANGLES = ["--from", "torque:bus", "--to", "attitude"]
TOML = """[[loop]]
input = "torque_z"
output = "attitude_z"
numerator = [900.0, 80.0]
denominator = [0.05, 1.0]
delay = 0.02
"""


@pytest.fixture(scope="module")
def embedded():
    return bc.embed(CRAFT, {"mount": BOOM})


@pytest.fixture(scope="module")
def file(embedded, tmp_path_factory):
    """The spacecraft whose plant has the loops; `plant` is the same plant."""
    return embedded.write(tmp_path_factory.mktemp("loops") / "flexible.xml")[-1]


@pytest.fixture(scope="module")
def plant(embedded):
    return bc.plant(embedded, ["torque:bus"], ["attitude"])


def returned(plant, loops, omega, factors, extra=0.0):
    """`det(1 + K G)` at one frequency, each loop's gain times a factor,
    the first delayed further."""
    s = 1j * omega
    out = list(plant.output_labels)
    names = list(plant.input_labels)
    response = plant.C @ np.linalg.solve(s * np.eye(plant.nstates) - plant.A, plant.B) + plant.D
    pick = response[
        np.ix_(
            [out.index(one["output"]) for one in loops],
            [names.index(one["input"]) for one in loops],
        )
    ]
    gains = []
    for k, (loop, factor) in enumerate(zip(loops, factors, strict=True)):
        value = np.polyval(loop["numerator"], s) / np.polyval(loop["denominator"], s)
        sensor = loop.get("sensor", {"numerator": [1.0], "denominator": [1.0]})
        value *= np.polyval(sensor["numerator"], s) / np.polyval(sensor["denominator"], s)
        gains.append(factor * value * np.exp(-s * (loop["delay"] + (extra if k == 0 else 0.0))))
    return np.linalg.det(np.eye(len(gains)) + np.diag(gains) @ pick)


@pytest.fixture(scope="module")
def found(file):
    """The margins of the loops."""
    return margins(file, LOOPS, *ANGLES)


@pytest.mark.slow
def test_at_the_gain_margin_the_loops_are_singular(plant, found):
    assert all(one.stable for one in found)
    for k, one in enumerate(found):
        assert np.isfinite(one.gain)
        factors = [one.gain if i == k else 1.0 for i in range(2)]
        assert abs(returned(plant, LOOPS, one.gain_frequency, factors)) < ON_THE_CIRCLE * abs(
            returned(plant, LOOPS, one.gain_frequency, [1.0, 1.0])
        )


@pytest.mark.slow
def test_beyond_the_gain_margin_the_closed_loop_is_unstable(file, found):
    for k, one in enumerate(found):
        assert all(m.stable for m in margins(file, scaled(LOOPS, k, 0.995 * one.gain), *ANGLES))
        assert not any(m.stable for m in margins(file, scaled(LOOPS, k, 1.005 * one.gain), *ANGLES))


@pytest.mark.slow
def test_at_the_delay_margin_the_loops_are_singular(plant, found):
    one = found[0]
    near = np.linspace(0.98, 1.02, 401) * one.phase_frequency
    gap = min(abs(returned(plant, LOOPS, omega, [1.0, 1.0], one.delay)) for omega in near)
    assert gap < 1e-3
    assert (
        min(abs(returned(plant, LOOPS, omega, [1.0, 1.0], 0.5 * one.delay)) for omega in near)
        > 1e-2
    )


@pytest.mark.slow
def test_the_disk_margin_bounds_gain_and_phase(found):
    for one in found:
        assert (2.0 + one.disk) / (2.0 - one.disk) <= one.gain * (1.0 + 1e-6)
        assert 2.0 * np.degrees(np.arctan(one.disk / 2.0)) <= abs(one.phase) * (1.0 + 1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"input": "torque_q"},
            "loop.input = 'torque_q' is no input of the plant; choose from torque_x",
        ),
        ({"output": "rate_z"}, "loop.output = 'rate_z' is no output of the plant"),
        ({"numerator": [1.0, 2.0, 3.0]}, "has a higher power of s than denominator"),
        ({"denominator": [0.0]}, "is zero; give"),
        ({"delay": -1.0}, "delay = -1.0 must not be negative"),
    ],
)
def test_wrong_loops_are_told(change, words, file):
    answer = asked(file, [{**LOOPS[0], **change}], *ANGLES)
    assert answer.status == 2
    assert words in answer.err


def test_a_controller_without_loops_is_told(file, tmp_path):
    (tmp_path / "none.toml").write_text("loop = []\n")
    answer = call(
        "plant", file, "--controller", tmp_path / "none.toml", "-o", tmp_path / "plant.npz", *ANGLES
    )
    assert answer.status == 2
    assert "has no loop; give at least one [[loop]]" in answer.err


@pytest.mark.slow
def test_loops_on_one_input_add_up(embedded, file):
    """An attitude loop from a star tracker and a gyro, both on one input;
    another loop beside it."""
    words = ["--from", "torque:bus", "--to", "attitude", "--to", "rate"]
    plant = bc.plant(embedded, ["torque:bus"], ["attitude", "rate"])
    lag = {"input": "torque_y", "denominator": [0.05, 1.0]}
    angle = {**lag, "output": "attitude_y", "numerator": [80.0], "delay": 0.05}
    rate = {**lag, "output": "rate_y", "numerator": [900.0], "delay": 0.02}
    both = [angle, LOOPS[1], rate]
    found = margins(file, both, *words)
    assert [(one.input, one.output) for one in found] == [
        ("torque_y", "attitude_y + rate_y"),
        ("torque_z", "attitude_z"),
    ]
    assert all(one.stable for one in found)
    for one, factors in zip(
        found, ((found[0].gain, 1.0, found[0].gain), (1.0, found[1].gain, 1.0)), strict=True
    ):
        assert np.isfinite(one.gain)
        assert abs(returned(plant, both, one.gain_frequency, factors)) < ON_THE_CIRCLE * abs(
            returned(plant, both, one.gain_frequency, (1.0, 1.0, 1.0))
        )
    for factor, stable in ((0.995, True), (1.005, False)):
        louder = scaled(scaled(both, 0, factor * found[0].gain), 2, factor * found[0].gain)
        assert margins(file, louder, *words)[0].stable == stable


@pytest.mark.slow
def test_a_wrong_sign_is_unstable_and_has_no_margins(file, tmp_path, capsys, monkeypatch):
    answer = asked(file, scaled(LOOPS, 0, -1.0), *ANGLES)
    assert answer.status == 3
    one = answer.record["margins"][0][0]
    assert one["stable"] is False
    assert [one[name] for name in ("gain", "lowest_gain", "phase", "delay", "disk")] == [None] * 5
    words = [
        "plant",
        str(file),
        "--controller",
        str(written(scaled(LOOPS, 0, -1.0), tmp_path)),
        *ANGLES,
    ]
    code, told, _ = run([*words, "-o", str(tmp_path / "plant.npz"), "--full"], capsys, monkeypatch)
    assert code == 3
    assert re.search(r"UNSTABLE(\W+-){4}\W", told)


@pytest.mark.slow
def test_margins_above_the_kept_modes_of_their_axis_are_told(file, found, plant):
    """About z the boom bends in the plane xy, about y in xz: each loop has its own highest mode."""
    kept = dict(zip(plant.modes, plant.frequency, strict=True))
    top = {
        axis: max(w for name, w in kept.items() if name.endswith(port) and "filler" not in name)
        for axis, port in (("z", "_xy"), ("y", "_xz"))
    }
    assert top["z"] < 0.9 * top["y"]
    warnings = [one["message"] for one in asked(file, LOOPS, *ANGLES).record["warnings"]]
    for one in found:
        at = {"gain": one.gain_frequency, "phase": one.phase_frequency, "disk": one.disk_frequency}
        of_loop = [said for said in warnings if said.startswith(f"{one.input} from {one.output}: ")]
        for what, omega in at.items():
            stated = [said for said in of_loop if f"{what} margin (at {omega:.4g} rad/s)" in said]
            # one that belongs to the mode lies beside it
            assert len(stated) == (1 if 1.05 * top[one.input[-1]] < omega < np.inf else 0)
    assert any(one.gain_frequency > top[one.input[-1]] for one in found)


def test_margins_are_of_continuous_plants(file):
    answer = asked(file, LOOPS, *ANGLES, "--discrete", 0.01)
    assert answer.status == 2
    assert "leave --discrete out" in answer.err


# -- the command -----------------------------------------------------------------------------------
@pytest.fixture
def place(embedded, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    embedded.write(tmp_path / "flexible.xml")
    (tmp_path / "loops.toml").write_text(TOML)
    return tmp_path


@pytest.mark.slow
def test_the_command_writes_plant_and_report(place, capsys, monkeypatch, plant):
    asked = [
        "plant",
        "flexible.xml",
        "--from",
        "torque:bus",
        "--to",
        "attitude",
        "--controller",
        "loops.toml",
    ]
    code, told, _ = run([*asked, "-o", "plant.npz", "--json"], capsys, monkeypatch)
    assert code == 0
    record = json.loads(told)
    gain = record["margins"][0][0]["gain"]
    loops = [LOOPS[1] | {"sensor": {"numerator": [1.0], "denominator": [1.0]}}]
    omega = record["margins"][0][0]["gain_frequency"]
    assert abs(returned(plant, loops, omega, [gain])) < ON_THE_CIRCLE * abs(
        returned(plant, loops, omega, [1.0])
    )
    assert [mode["name"] for mode in record["modes"]] == list(plant.modes)
    np.testing.assert_allclose(np.load("plant.npz")["Frequency"], plant.frequency, rtol=1e-9)
    page = (place / "plant_report.html").read_text()
    for words in ("Margins", "Nichols", "Hz", "boom_mode1_xy", "Poles"):
        assert words in page
    code, _, error = run([*asked, "-o", "plant.npz"], capsys, monkeypatch)
    assert (code, "--force" in error) == (2, True)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--from", "weel"], "weel"),
        (["--controller", "nothing.toml"], "does not exist"),
        (["--pose", "nowhere"], "nowhere"),
    ],
)
def test_wrong_calls_write_nothing(more, words, place, capsys, monkeypatch):
    before = sorted(place.iterdir())
    code, _, error = run(
        ["plant", "flexible.xml", "-o", "plant.npz", "--from", "torque:bus", *more],
        capsys,
        monkeypatch,
    )
    assert code == 2
    assert words in error
    assert error.count("\n") == 1
    assert sorted(place.iterdir()) == before


@pytest.mark.slow
def test_angles_give_a_plant_each(place, capsys, monkeypatch):
    turning = (
        CRAFT.replace(
            '<site name="mount" pos="0.5 0 0.3"/>',
            '<body name="yoke" pos="0.5 0 0.3"><joint name="drive" axis="1 0 0"/><inertial pos="0 '
            '0 0" mass="4" diaginertia="0.2 0.2 0.2"/><site name="mount"/></body>',
        )
        .replace(' 1 0 0 0"/>', ' 1 0 0 0 0"/>')
        .replace(
            "</worldbody>",
            '</worldbody><actuator><position name="hold" joint="drive" '
            'kp="4e4" kv="400"/></actuator>',
        )
    )
    bc.embed(turning, {"mount": BOOM.replace(modes=1)}).write(place / "turning.xml")
    asked = [
        "plant",
        "turning.xml",
        "--from",
        "torque:bus",
        "--pose",
        "drive=0,90",
        "--controller",
        "loops.toml",
    ]
    code, told, _ = run([*asked, "-o", "angles.npz", "--json"], capsys, monkeypatch)
    record = json.loads(told)
    assert code in (0, 3)
    np.testing.assert_allclose(record["angles"], [0.0, 90.0], atol=1e-9)
    assert len(record["margins"]) == 2
    assert np.load("angles.npz")["A"].shape[0] == 2
    assert "angle of the drive" in (place / "angles_report.html").read_text()
