"""What a planned test would determine, against the least variances that an independent simulation of the same craft allows."""

import json
import sys

import numpy as np
import pytest

import beamchain as bc
from beamchain.cli import main
from beamchain.craft.identification.planned import planned
from flight_log import Gyro, Hub, cramer_rao, record, steps_at, wings
from modes_file import write_prior

BOUND = 1e-3  # of a standard deviation: both take derivatives by differences
LIKE = 0.1  # of the deviations that an identification states, whose damping and frequency are estimates themselves
HUB = Hub()
PAIR = wings(5.0, 1.0, 200.0, 350.0, 50.0, 0.05)
TWO = PAIR.kept(np.flatnonzero(PAIR.participation[5])[:2])
TIME = np.arange(0.0, 120.0, 0.05)
TORQUE = steps_at(TIME, 1.0, 3.0)
NOISE = 1e-5


def plan(tmp_path, noise=NOISE, size=1.0):
    prior = write_prior(tmp_path, TWO)
    return planned({"time": TIME, "torque_z": size * TORQUE}, HUB.xml, "mount", prior=prior, noise=noise)


def test_deviations_are_those_of_cramer_and_rao(tmp_path):
    found = plan(tmp_path)
    least = cramer_rao(HUB, TWO, TIME, {"z": TORQUE}, NOISE)
    true = np.array([TWO.frequency, TWO.damping, np.abs(TWO.participation[5])])
    assert np.abs(found.deviations.T / (least / true) - 1.0).max() < BOUND
    assert found.determined == (True, True)


def test_what_is_planned_is_what_comes_out(tmp_path):
    found = plan(tmp_path)
    modes = bc.identify(record(HUB, TWO, TIME, {"z": TORQUE}, Gyro(NOISE)), HUB.xml, "mount", modes=2).modes
    stated = np.array([[m.frequency_std / m.frequency, m.damping_std / m.damping] for m in modes])
    assert np.abs(stated / found.deviations[:, :2] - 1.0).max() < LIKE


def test_a_thousandth_of_the_torque_is_not_enough_and_the_advice_says_how_much_is(tmp_path):
    weak = plan(tmp_path, size=1e-3)
    assert weak.determined == (False, False)
    factor = float(weak.advice[0].split("has near it, ")[1].split(" times the torque")[0])
    assert not plan(tmp_path, size=0.97e-3 * factor).determined[0]
    assert plan(tmp_path, size=1.03e-3 * factor).determined[0]


def test_the_command_prints_it_and_writes_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "craft.xml").write_text(HUB.xml)
    np.savetxt("torques.csv", np.column_stack([TIME, TORQUE]), delimiter=",", header="time,torque_z", comments="")
    prior = write_prior(tmp_path, TWO)
    before = sorted(tmp_path.iterdir())
    words = [
        "identify",
        "torques.csv",
        "--craft",
        "craft.xml",
        "--at",
        "mount",
        "--prior",
        str(prior),
        "--plan",
        "1e-5",
    ]
    monkeypatch.setattr(sys, "argv", ["beamchain", *words, "--json"])
    with pytest.raises(SystemExit) as done:
        main()
    assert done.value.code in (None, 0)
    modes = json.loads(capsys.readouterr().out)["modes"]
    expected = plan(tmp_path).as_dict()["modes"]
    assert [m["frequency_std"] for m in modes] == pytest.approx([m["frequency_std"] for m in expected], rel=1e-9)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("given", "noise", "said"),
    [
        ({"torque_z": TORQUE}, NOISE, "no column `time`"),
        ({"time": TIME}, NOISE, "no column of a torque"),
        ({"time": TIME, "torque_z": np.ones(TIME.size)}, NOISE, "nothing excites the craft"),
        ({"time": TIME[::-1], "torque_z": TORQUE}, NOISE, "it must ascend"),
        ({"time": TIME, "torque_x": TORQUE}, NOISE, "no mode that torque_x would move"),
        ({"time": TIME, "torque_z": TORQUE}, 0.0, "noise = 0.0 must be above zero"),
        (3, NOISE, "give a path or a mapping"),
    ],
)
def test_a_wrong_plan_is_answered(given, noise, said, tmp_path):
    with pytest.raises(bc.InputError, match=said):
        planned(given, HUB.xml, "mount", prior=write_prior(tmp_path, TWO), noise=noise)
