"""Disturbances as files, the command that reads them, and what is refused: each in one sentence."""

import numpy as np
import pytest

import beamchain as bc
from command import call

DAMPED = """<mujoco><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="9" diaginertia="12 12 12"/>
<body name="wheel" pos="0.3 0 0"><joint name="spin" axis="0 0 1"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.02"/></body>
<body name="lopsided"><joint name="lopsided" axis="0 0 1"/>
<inertial pos="0.1 0 0" mass="0.1" diaginertia="0.01 0.01 0.02"/></body>
<body name="panel"><joint name="arm_hinge1_xy" axis="0 0 1" stiffness="300" damping="0.4"/>
<inertial pos="0 0 0" mass="1" diaginertia="3 3 3"/><site name="arm_tip" pos="2 0 0"/></body></body>
</worldbody></mujoco>"""
UNDAMPED = DAMPED.replace('damping="0.4"', "")
UNSTABLE = DAMPED.replace('damping="0.4"', 'damping="0"').replace(
    "</worldbody>",
    '</worldbody><actuator><general joint="arm_hinge1_xy" biastype="affine" biasprm="0 0 1"/>'
    "</actuator>",
)
TOML = """
[[wheel]]
joint = "spin"
speeds = [2.0, 30.0]
static = 2e-6
dynamic = 1e-7

[[wheel.harmonic]]
order = 2.82
radial_force = 3e-7

[[stepper]]
joint = "arm_hinge1_xy"
step = 1e-3
rate = 2.0

[[psd]]
input = "torque:hub"
signals = ["torque_z_hub"]
frequency = [0.1, 1.0, 10.0]
density = [1e-8, 1e-9, 1e-10]

[[snap]]
appendage = "arm_"
displacement = 0.001
time_constant = 3.0
"""


@pytest.fixture
def files(tmp_path):
    (tmp_path / "craft.xml").write_text(DAMPED)
    (tmp_path / "jitter.toml").write_text(TOML.replace("torque_z_hub", "torque_z"))
    return tmp_path


def test_a_file_says_what_python_says(files):
    read = bc.pointing(files / "craft.xml", files / "jitter.toml", window=0.5)
    python = bc.Disturbances(
        wheel=(
            bc.WheelDisturbance(
                joint="spin",
                speeds=[2.0, 30.0],
                static=2e-6,
                dynamic=1e-7,
                harmonic=[bc.WheelHarmonic(order=2.82, radial_force=3e-7)],
            ),
        ),
        stepper=[bc.StepperDisturbance(joint="arm_hinge1_xy", step=1e-3, rate=2.0)],
        psd=[
            bc.NoiseDisturbance(
                input="torque:hub",
                signals=["torque_z"],
                frequency=[0.1, 1.0, 10.0],
                density=[1e-8, 1e-9, 1e-10],
            )
        ],
        snap=[bc.ThermalSnap(appendage="arm_", displacement=0.001, time_constant=3.0)],
    )
    other = bc.pointing(DAMPED, python, window=0.5)
    assert read.table.rows == other.table.rows
    assert [row["source"] for row in read.table.records()[2::3]] == [
        "wheel spin",
        "stepper arm_hinge1_xy",
        "psd torque:hub",
        "snap arm_",
        "all",
    ]


def test_the_command_adds_the_budget(files):
    answer = call(
        "plant",
        files / "craft.xml",
        "--input",
        "torque:hub",
        "--output",
        "attitude",
        "--disturbances",
        files / "jitter.toml",
        "--window",
        "0.5",
        "--no-report",
        "--json",
        "-o",
        files / "plant.npz",
    )
    assert answer.status == 0
    record = answer.record["pointing"]
    assert record["window"] == 0.5
    budget = bc.pointing(DAMPED, files / "jitter.toml", window=0.5)
    assert record["budget"] == budget.table.records()
    refused = call(
        "plant",
        files / "craft.xml",
        "--disturbances",
        files / "jitter.toml",
        "--angle",
        "lopsided=0,1",
        "-o",
        files / "other.npz",
    )
    assert refused.status == 2
    assert "--disturbances takes one pose" in refused.err
    assert not (files / "other.npz").exists()


WHEEL = {"joint": "spin", "speeds": (2.0, 30.0), "static": 2e-6}
STEPPER = {"joint": "arm_hinge1_xy", "step": 1e-3, "rate": 2.0}
PSD = {"input": "torque:hub", "frequency": (0.1, 10.0), "density": (1e-8, 1e-8)}
SNAP = {"appendage": "arm_", "displacement": 0.001, "time_constant": 3.0}
KINDS = {
    "wheel": (bc.WheelDisturbance, WHEEL),
    "stepper": (bc.StepperDisturbance, STEPPER),
    "psd": (bc.NoiseDisturbance, PSD),
    "snap": (bc.ThermalSnap, SNAP),
}


@pytest.mark.parametrize(
    ("kind", "changed", "sentence"),
    [
        ("wheel", {"joint": "sping"}, r"wheel.joint = 'sping' is unknown; did you mean 'spin'\?"),
        ("wheel", {"joint": "lopsided"}, "'lopsided' is no balanced wheel"),
        ("wheel", {"speeds": (30.0, 2.0)}, r"speeds = \[30, 2\] of wheel 'spin' is no range"),
        ("wheel", {"speeds": (0.0, 0.0)}, "is no range"),
        ("wheel", {"speeds": (float("nan"), 1.0)}, r"speeds\[0\] = nan cannot be used"),
        ("wheel", {"speeds": (1.0,)}, r"speeds = \(1.0,\) of wheel 'spin' is no range"),
        ("wheel", {"speeds": 5.0}, "speeds = 5.0 of wheel 'spin' is no range"),
        ("wheel", {"joint": 5}, "wheel.joint = 5 is a int; give the name of a hinge"),
        ("wheel", {"harmonic": ({"order": 2.0},)}, r"is no list of bc.WheelHarmonic\(...\)"),
        ("wheel", {"static": 0.0}, "disturbs nothing; give static"),
        ("wheel", {"static": -1.0}, "static = -1.0 must not be negative"),
        ("wheel", {"count": 1}, "count = 1 must be a whole number from 2"),
        ("stepper", {"joint": "arm"}, "stepper.joint = 'arm' is unknown"),
        ("stepper", {"joint": "spin"}, "neither a position servo nor a spring"),
        ("stepper", {"torque": 1.0}, "takes either step"),
        ("stepper", {"step": None, "torque": 1.0}, "takes either step"),
        ("stepper", {"step": None, "torque": 1.0, "width": 0.5}, "is not shorter than the time"),
        ("stepper", {"rate": 0.0}, "rate = 0.0 must be above zero"),
        ("psd", {"frequency": 5.0}, "frequency of psd 'torque:hub' = 5.0 is no list of numbers"),
        ("psd", {"signals": "torque_z"}, "signals of psd 'torque:hub' = 'torque_z' is no list"),
        ("psd", {"input": "torque:bus"}, "'bus' is unknown"),
        ("psd", {"signals": ("torque_q",)}, "signals of psd 'torque:hub' = 'torque_q' is unknown"),
        ("psd", {"frequency": (10.0, 0.1)}, "list frequencies in ascending order"),
        ("psd", {"frequency": (1.0,)}, "has 1 frequencies and 2 densities"),
        ("psd", {"density": (1e-8, 0.0)}, "density = 0 of psd 'torque:hub' is not above zero"),
        ("psd", {"input": "wrench:arm_tip"}, "different units"),
        ("snap", {"appendage": "boom_"}, "snap.appendage = 'boom_' is unknown"),
        ("snap", {"mode": 2}, "mode of snap = 'arm_mode2_xy' is unknown"),
        ("snap", {"port": "xz", "displacement": None, "moment": 1.0}, "no hinge in port 'xz'"),
        ("snap", {"port": "torsion"}, "twist displaces no tip"),
        ("snap", {"moment": 1.0}, "takes either displacement"),
        ("snap", {"time_constant": -1.0}, "time_constant = -1.0 must be above zero"),
    ],
)
def test_a_mistake_gets_its_sentence(kind, changed, sentence):
    struct, given = KINDS[kind]
    with pytest.raises(bc.InputError, match=sentence):
        bc.pointing(DAMPED, bc.Disturbances(**{kind: (struct(**{**given, **changed}),)}))


@pytest.mark.parametrize(
    ("craft", "kind", "changed", "sentence"),
    [
        (UNDAMPED, "wheel", {}, r"at 11.\d+ rad/s its order 1 drives 'arm_mode1_xy' .* undamped"),
        (UNDAMPED, "psd", {}, "'arm_mode1_xy' .* undamped, so that its variance has no limit"),
        (UNSTABLE, "psd", {}, "the craft is unstable: its motion at 1"),
        (
            DAMPED.replace('name="arm_tip"', 'name="end"'),
            "snap",
            {},
            "no site 'arm_tip'.*scene.tip",
        ),
    ],
)
def test_a_craft_that_has_no_budget_says_why(craft, kind, changed, sentence):
    struct, given = KINDS[kind]
    disturbances = bc.Disturbances(**{kind: (struct(**{**given, **changed}),)})
    with pytest.raises(bc.InputError, match=sentence):
        bc.pointing(craft, disturbances)


def test_undamped_modes_away_from_the_range_are_no_hindrance():
    wheel = bc.WheelDisturbance(**{**WHEEL, "speeds": (2.0, 8.0)})
    assert bc.pointing(UNDAMPED, bc.Disturbances(wheel=(wheel,))).ape.peak[2] > 0.0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"window": 0.0}, "window = 0.0 must be above zero"),
        ({"outputs": ["gyro"]}, "'gyro' is unknown"),
        ({"outputs": []}, "outputs is empty"),
        ({"at": {"drive": 1.0}}, "joint of at = 'drive' is unknown"),
        ({"rates": {"lopsided": 1.0}}, "only balanced wheels may turn"),
    ],
)
def test_wrong_arguments(arguments, sentence):
    disturbances = bc.Disturbances(wheel=(bc.WheelDisturbance(**WHEEL),))
    with pytest.raises(bc.InputError, match=sentence):
        bc.pointing(DAMPED, disturbances, **arguments)


def test_nothing_and_twice_the_same():
    with pytest.raises(bc.InputError, match="the disturbances are empty"):
        bc.Disturbances()
    with pytest.raises(bc.InputError, match=r"psd = 'x' is no list of bc.NoiseDisturbance"):
        bc.Disturbances(psd="x")
    wheel = bc.WheelDisturbance(**WHEEL)
    with pytest.raises(bc.InputError, match=r"two \[\[wheel\]\] tables are of 'spin'"):
        bc.Disturbances(wheel=(wheel, wheel))
    with pytest.raises(bc.InputError, match="give the path of a TOML file with"):
        bc.pointing(DAMPED, 5)
    budget = bc.pointing(DAMPED, bc.Disturbances(wheel=(wheel,)))
    with pytest.raises(bc.InputError, match="source = 'wheel rw' is unknown"):
        budget.simulate("wheel rw")
    with pytest.raises(bc.InputError, match="output = 'rate' is unknown"):
        budget.simulate(output="rate")
    with pytest.raises(bc.InputError, match="source = 'rw' is unknown"):
        budget["rw"]


@pytest.mark.slow
def test_a_deviation_vanishes_with_the_window_and_is_the_error_itself_in_an_endless_one(files):
    short, shorter, endless = (
        bc.pointing(files / "craft.xml", files / "jitter.toml", window=window)
        for window in (1e-5, 1e-6, 1e9)
    )
    for one, other, whole in zip(short.sources, shorter.sources, endless.sources, strict=True):
        # in proportion to a window in which the error is a straight line
        assert np.isclose(one.rpe.peak[2] / other.rpe.peak[2], 10.0, rtol=1e-3)
        assert np.isclose(whole.rpe.peak[2], whole.ape.peak[2], rtol=5e-3)


def test_an_imbalance_in_other_units_is_noted(files):
    """2 kg that lie 0.1 mm off the axis are 2e-4 kg m."""
    for old, new, said in (
        ("static = 2e-6", "static = 1.9e-4", 0),
        ("static = 2e-6", "static = 0.5", 1),
        ("dynamic = 1e-7", "dynamic = 3e-5", 1),
    ):
        text = (TOML.replace("torque_z_hub", "torque_z")).replace(old, new)
        (files / "jitter.toml").write_text(text)
        found = bc.pointing(files / "craft.xml", files / "jitter.toml")
        codes = [getattr(text, "code", "") for text in found.warnings]
        assert codes.count("imbalance") == said, new
    assert "1 g cm^2 is 1e-7 kg m^2" in " ".join(found.warnings)
