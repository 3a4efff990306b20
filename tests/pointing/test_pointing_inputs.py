"""Disturbances as files, the command that reads them, and what is refused: each in one sentence."""

import numpy as np
import pytest

from beamchain import pointing
from command import call
from jittered import DAMPED, UNDAMPED, WHEEL

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


@pytest.mark.slow
def test_a_file_says_what_python_says(files):
    read = pointing.budget(files / "craft.xml", files / "jitter.toml", window=0.5)
    python = pointing.Disturbances(
        wheel=(
            pointing.WheelDisturbance(
                joint="spin",
                speeds=[2.0, 30.0],
                static=2e-6,
                dynamic=1e-7,
                harmonic=[pointing.WheelHarmonic(order=2.82, radial_force=3e-7)],
            ),
        ),
        stepper=[pointing.StepperDisturbance(joint="arm_hinge1_xy", step=1e-3, rate=2.0)],
        psd=[
            pointing.NoiseDisturbance(
                input="torque:hub",
                signals=["torque_z"],
                frequency=[0.1, 1.0, 10.0],
                density=[1e-8, 1e-9, 1e-10],
            )
        ],
        snap=[pointing.ThermalSnap(appendage="arm_", displacement=0.001, time_constant=3.0)],
    )
    other = pointing.budget(DAMPED, python, window=0.5)
    assert read.table.rows == other.table.rows
    assert [row["source"] for row in read.table.records()[2::3]] == [
        "wheel spin",
        "stepper arm_hinge1_xy",
        "psd torque:hub",
        "snap arm_",
        "all",
    ]


@pytest.mark.slow
def test_the_command_adds_the_budget(files):
    answer = call(
        "pointing",
        files / "craft.xml",
        "--to",
        "attitude",
        "--disturbances",
        files / "jitter.toml",
        "--window",
        "0.5",
        "-o",
        files / "jitter.html",
    )
    assert answer.status == 0
    budget = pointing.budget(DAMPED, files / "jitter.toml", window=0.5)
    page = (files / "jitter.html").read_text(encoding="utf-8")
    assert all(source.name in page for source in budget.sources)
    shown = [[cell.strip() for cell in line.split("│")] for line in answer.out.splitlines()]
    for _, *row, _ in budget.table.rows:  # names and shares may take two lines
        assert row in [cells[2:-2] for cells in shown]


def test_undamped_modes_away_from_the_range_are_no_hindrance():
    wheel = pointing.WheelDisturbance(**{**WHEEL, "speeds": (2.0, 8.0)})
    assert pointing.budget(UNDAMPED, pointing.Disturbances(wheel=(wheel,))).ape.peak[2] > 0.0


@pytest.mark.slow
def test_a_deviation_vanishes_with_the_window_and_is_the_error_itself_in_an_endless_one(files):
    short, shorter, endless = (
        pointing.budget(files / "craft.xml", files / "jitter.toml", window=window)
        for window in (1e-5, 1e-6, 1e9)
    )
    for one, other, whole in zip(short.sources, shorter.sources, endless.sources, strict=True):
        # in proportion to a window in which the error is a straight line
        assert np.isclose(one.rpe.peak[2] / other.rpe.peak[2], 10.0, rtol=1e-3)
        assert np.isclose(whole.rpe.peak[2], whole.ape.peak[2], rtol=5e-3)


@pytest.mark.slow
def test_an_imbalance_in_other_units_is_noted(files):
    """2 kg that lie 0.1 mm off the axis are 2e-4 kg m."""
    for old, new, said in (
        ("static = 2e-6", "static = 1.9e-4", 0),
        ("static = 2e-6", "static = 0.5", 1),
        ("dynamic = 1e-7", "dynamic = 3e-5", 1),
    ):
        text = TOML.partition("[[stepper]]")[0].replace(old, new)
        (files / "jitter.toml").write_text(text)
        found = pointing.budget(files / "craft.xml", files / "jitter.toml")
        codes = [getattr(text, "code", "") for text in found.warnings]
        assert codes.count("imbalance") == said, new
    assert "1 g cm^2 is 1e-7 kg m^2" in " ".join(found.warnings)


NOISE = """[[psd]]
input = "torque:hub"
frequency = [0.1, 10.0]
density = [1e-8, 1e-8]
"""


def test_a_page_without_wheels(files):
    (files / "noise.toml").write_text(NOISE)
    words = ("--disturbances", files / "noise.toml", "-o", files / "noise.html")
    assert call("pointing", files / "craft.xml", *words).status == 0
    assert "psd torque:hub" in (files / "noise.html").read_text(encoding="utf-8")


def test_a_budget_has_one_pose(files):
    words = ("--disturbances", files / "jitter.toml", "-o", files / "jitter.html")
    poses = ("--pose", "spin=0", "--pose", "spin=60")
    answer = call("pointing", files / "craft.xml", *words, *poses)
    assert answer.status == 2
    assert "pose" in answer.err
    assert not (files / "jitter.html").exists()
