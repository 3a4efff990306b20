"""Torques that act later than the log says, and a gyro that integrates over its sample.

The truth is the exact motion on a grid twice as fine as the log, of which every second sample is
logged; it shares no code with the package.
"""

import json

import numpy as np
import pytest

from beamchain import identification
from beamchain.identification.response import Piece, Raw
from beamchain.identification.sanity import unalias
from command import run
from flight_log import AXES, Gyro, Hub, noise, record, response, steps_at, turn, wings
from judge import judge
from modes_file import write_prior

HUB = Hub()
PAIR = wings(5.0, 1.0, 200.0, 350.0, 50.0, 0.05)  # about z 1.99, 12.5, 34.9 rad/s
ABOUT_Z = np.flatnonzero(PAIR.participation[5])
TWO = PAIR.kept(ABOUT_Z[:2])
STEP = 0.05
TIME = np.arange(0.0, 120.0, STEP)
FINE = Gyro(1e-5, 2e-4)
REACH = 3.3  # standard deviations: a right program fails once in a thousand seeds
USEFUL = 0.01  # of a step: the delay's standard deviation in such a log
EXACT = 1e-7  # of a step, and of a frequency: without noise, what double precision leaves
PROFILES = {"steps": steps_at(TIME, 1.0, 3.0), "white": noise(TIME, 1.0, 3)}


def late(halves, elastic=PAIR, gyro=FINE, torque=PROFILES["steps"], first=0):
    """A log whose torque acts `halves` half steps late; of its samples those from `first`."""
    fine = STEP / 2.0 * np.arange(2 * TIME.size)
    acting = np.repeat(torque, 2)
    if halves > 0:
        acting = np.concatenate([np.zeros(halves), acting[:-halves]])
    elif halves < 0:
        acting = np.concatenate([acting[-halves:], np.zeros(-halves)])
    rates = record(HUB, elastic, fine, {"z": acting}, gyro)["rate_z"][::2]
    return {"time": TIME[first:], "torque_z": torque[first:], "rate_z": rates[first:]}


def integrated(name, elastic=PAIR, gyro=FINE, torque=PROFILES["steps"]):
    """A log of a gyro that gives the mean rate since the sample before, in the column `name`."""
    torques = np.zeros((TIME.size, 3))
    torques[:, AXES.index("z")] = torque
    angle = turn(HUB, elastic, TIME, torques)[1][:, AXES.index("z")]
    mean = np.diff(angle, prepend=0.0) / STEP
    return {"time": TIME, "torque_z": torque, name: gyro.read(mean)}


def check(found, delay, plain=(0, 1)):
    assert abs(found.delay - delay) < REACH * found.delay_std, (found.delay, found.delay_std)
    assert found.delay_std < USEFUL * STEP
    verdict = judge(found, PAIR, [2], list(plain))
    assert verdict.verdict == "right", verdict


@pytest.fixture
def prior(tmp_path):
    return write_prior(tmp_path, PAIR.kept(6), frequency=1.1, participation=0.9)


@pytest.mark.parametrize(
    ("halves", "profile"),
    [(-1, "white"), (2, "steps")],
)
@pytest.mark.slow
def test_a_late_or_early_torque_is_found_without_a_prior(halves, profile):
    found = identification.identify(late(halves, torque=PROFILES[profile]), HUB.xml, "mount")
    check(found, halves * STEP / 2.0)
    assert not found.punctual
    assert any(one.code == "delay" for one in found.warnings)


@pytest.mark.slow
def test_a_late_torque_is_found_with_a_prior(prior):
    found = identification.identify(late(1), HUB.xml, "mount", prior=prior)
    assert abs(found.delay - STEP / 2.0) < REACH * found.delay_std
    verdict = judge(found, PAIR, [2], [0, 1])
    assert verdict.verdict != "wrong", verdict
    assert [m.determined for m in found.modes].count(True) >= 2


@pytest.mark.slow
def test_a_punctual_torque_is_said_to_be_punctual():
    found = identification.identify(late(0), HUB.xml, "mount")
    assert abs(found.delay) < REACH * found.delay_std
    assert not any(one.code == "delay" for one in found.warnings)
    assert ("zero within" in found.timing) == found.punctual


@pytest.mark.slow
def test_a_log_that_begins_in_motion_may_be_five_samples_late():
    found = identification.identify(late(10, first=130), HUB.xml, "mount")
    check(found, 5.0 * STEP)


@pytest.mark.slow
def test_unequal_steps_and_gaps_change_nothing():
    """The torque is logged at unequal times, and acts 0.03 s after them."""
    rng = np.random.default_rng(4)
    grid = np.cumsum(rng.choice([4, 5, 8], 2400))
    fine = 0.01 * np.arange(grid[-1] + 1)
    logged = steps_at(0.01 * grid, 1.0, 3.0)
    at = np.searchsorted(grid, np.arange(fine.size) - 3, side="right") - 1
    rates = record(HUB, PAIR, fine, {"z": np.where(at < 0, 0.0, logged[at])}, FINE)["rate_z"]
    log = {"time": 0.01 * grid, "torque_z": logged, "rate_z": rates[grid]}
    keep = (log["time"] < 40.0) | (log["time"] > 46.0)
    found = identification.identify({k: v[keep] for k, v in log.items()}, HUB.xml, "mount")
    check(found, 0.03)


@pytest.mark.slow
def test_a_rate_integrating_gyro_is_named_by_its_column():
    found = identification.identify(integrated("mean_rate_z"), HUB.xml, "mount")
    assert abs(found.delay) < REACH * found.delay_std
    verdict = judge(found, PAIR, [2], [0, 1])
    assert verdict.verdict == "right", verdict


@pytest.mark.slow
def test_a_rate_integrating_gyro_called_a_rate_is_half_a_sample_late(prior):
    found = identification.identify(integrated("rate_z"), HUB.xml, "mount", prior=prior)
    assert abs(found.delay / STEP - 0.5) < 0.01
    warning = next(one for one in found.warnings if one.code == "delay")
    assert "mean_rate" in warning


@pytest.mark.slow
def test_without_noise_delay_and_modes_are_exact():
    found = identification.identify(late(1, TWO, Gyro()), HUB.xml, "mount", modes=2)
    assert abs(found.delay - STEP / 2.0) < EXACT * STEP
    for mode, true in zip(found.modes, TWO.frequency, strict=True):
        assert abs(mode.frequency / true - 1.0) < EXACT
    mean = identification.identify(
        integrated("mean_rate_z", TWO, Gyro()), HUB.xml, "mount", modes=2
    )
    for mode, true in zip(mean.modes, TWO.frequency, strict=True):
        assert abs(mode.frequency / true - 1.0) < EXACT


@pytest.mark.slow
def test_a_frequency_response_with_a_delay():
    omega = np.linspace(0.2, 20.0, 600)
    rng = np.random.default_rng(2)
    error = 1e-3 * (rng.standard_normal(600) + 1j * rng.standard_normal(600))
    value = response(HUB, TWO, omega)[:, 2, 2] * np.exp(-0.025j * omega) * (1.0 + error)
    found = identification.identify({"omega": omega, "rate_z/torque_z": value}, HUB.xml, "mount")
    assert abs(found.delay - 0.025) < REACH * found.delay_std
    assert judge(found, TWO, [2], [0, 1]).verdict == "right"


@pytest.mark.slow
def test_the_command_and_the_record_state_the_delay(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "craft.xml").write_text(HUB.xml)
    np.savez(tmp_path / "log.npz", **late(1))
    words = ["identify", "log.npz", "--craft", "craft.xml", "--mount", "mount", "-o", "modes.toml"]
    code, shown, errors = run(words, capsys, monkeypatch)
    assert code == 0, errors
    assert "not zero within its interval" in " ".join((shown + errors).split())
    entry = json.loads((tmp_path / "modes.json").read_text())
    assert abs(entry["delay"] - 0.025) < REACH * entry["delay_std"]
    assert entry["delay_zero_within_interval"] is False
    assert "Delay between torque and motion" in (tmp_path / "modes_report.html").read_text()


def test_a_mode_above_half_the_sample_rate_moves_with_its_shape():
    """Tests internals, `identification.sanity.unalias`: what two sensors show of a free mode at
    its samples is the same where it was taken for its alias and where it belongs."""
    found = Raw(
        poles=np.array([-0.3 + 20.0j]),
        residues=np.full((1, 2, 2), -0.01 + 0.002j) * np.eye(2),
        shapes=np.array([[1.0, 0.4 - 0.7j]]),
        rigid=np.eye(2) / 150.0,
    )
    time = STEP * np.arange(40)
    piece = Piece(time, *(np.zeros((40, 2)),) * 2, np.ones((40, 2), bool), ("rate",) * 2, even=True)
    axes = np.eye(3)[:, :2]
    raw, moved = unalias(found, [piece], axes.T, axes.T, axes)
    assert abs(moved[0] - complex(-0.3, 2.0 * np.pi / STEP - 20.0)) < EXACT

    def motions(model):
        shown = (model.shapes[:, :, None] * np.exp(model.poles[:, None, None] * time)).ravel()
        return np.column_stack([shown.real, shown.imag])

    wanted = motions(found)
    left = wanted - motions(raw) @ np.linalg.lstsq(motions(raw), wanted)[0]
    assert np.abs(left).max() < EXACT
