"""Tests internals, `identification.logs` and `channels`, beside `identification.identify`:
every kind of file gives the same columns. No tolerances: what is read is compared exactly.
"""

import numpy as np
import pytest

from beamchain import identification
from beamchain.identification.channels import (
    active_torques,
    cut_pieces,
    is_even,
    saturated_samples,
)
from beamchain.identification.logs import read_logs
from command import run
from spacecraft import spec

CRAFT = """<mujoco><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/>
<site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>"""
TIME = np.arange(400) * 0.05
TORQUE = np.where(np.arange(400) // 20 % 2, 1.0, -1.0)
RATE = np.concatenate([[0.0], np.cumsum(TORQUE[:-1]) * 0.05 / 200.0]) + 1e-4 * np.sin(2.0 * TIME)
LOG = {"time": TIME, "torque_z": TORQUE, "rate_z": RATE}


def written(path, columns):
    names = list(columns)
    np.savetxt(
        path,
        np.column_stack([columns[n] for n in names]),
        delimiter=",",
        header=",".join(names),
        comments="",
        fmt="%.17g",
    )
    return path


# -- files -----------------------------------------------------------------------------------------
def test_every_kind_of_file_gives_the_same_columns(tmp_path):
    written(tmp_path / "log.csv", LOG)
    np.savez(tmp_path / "log.npz", **LOG)
    for name in ("log.csv", "log.npz"):
        (log,), spectra = read_logs(tmp_path / name, None, ())
        assert not spectra
        assert np.array_equal(log.time, TIME)
        assert np.array_equal(log.torques["torque_z"], TORQUE)
        assert np.array_equal(log.sensed["rate_z"], RATE)


def test_a_semicolon_and_decimal_commas_are_read(tmp_path):
    lines = [
        "time;torque_z;rate_z",
        *(
            f"{t:.2f};{u:.1f};{r:.6f}".replace(".", ",")
            for t, u, r in zip(TIME, TORQUE, RATE, strict=True)
        ),
    ]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    (log,), _ = read_logs(tmp_path / "log.csv", None, ())
    assert np.array_equal(log.time, np.round(TIME, 2))


def test_columns_are_named_by_map():
    named = {"t": TIME, "wheel": TORQUE, "gyro": RATE}
    (log,), _ = read_logs(named, {"t": "time", "wheel": "torque_z", "gyro": "rate_z"}, ())
    assert set(log.sensed) == {"rate_z"}


def test_a_frequency_response_is_read_in_both_forms():
    omega = np.linspace(1.0, 5.0, 20)
    value = 1.0 / (1j * omega * 200.0)
    for columns in (
        {"rate_z/torque_z re": value.real, "rate_z/torque_z im": value.imag},
        {"rate_z/torque_z": value},
    ):
        _, (one,) = read_logs({"omega": omega, **columns}, None, ())
        assert np.array_equal(one.value, value)
        assert (one.sensed, one.torque, one.order) == ("rate_z", "torque_z", 0)
    _, (one,) = read_logs(
        {
            "frequency": omega,
            "rate_z/torque_z magnitude": np.abs(value),
            "rate_z/torque_z phase_deg": np.full(20, -90.0),
        },
        None,
        (),
    )
    assert np.array_equal(one.omega, 2.0 * np.pi * omega)


# -- pieces ----------------------------------------------------------------------------------------
def test_gaps_make_pieces():
    (log,), _ = read_logs(
        {name: np.delete(values, slice(100, 140)) for name, values in LOG.items()}, None, ()
    )
    pieces, warnings = cut_pieces([log], ["torque_z"], ["rate_z"])
    assert [piece.time.size for piece in pieces] == [100, 260]
    assert [w.code for w in warnings] == ["log-gaps"]


def test_equal_steps_are_seen_through_the_digits_of_the_column():
    assert is_even(np.round(np.arange(1000) / 30.0, 3))
    assert not is_even(np.cumsum(np.random.default_rng(0).choice([0.03, 0.04], 1000)))


def test_runs_at_an_extreme_are_saturated():
    values = np.clip(np.sin(TIME) + 1e-3 * np.random.default_rng(1).standard_normal(400), -2.0, 0.8)
    at = np.flatnonzero(values == 0.8)
    assert at.size > 10
    assert saturated_samples(values)[at].all()
    assert not saturated_samples(values)[values < 0.7].any()


def test_only_torques_that_change_are_used():
    (log,), _ = read_logs(
        {**LOG, "torque_x": np.zeros(400), "torque_y": np.full(400, 2.0)}, None, ()
    )
    assert active_torques([log], ["torque_x", "torque_y", "torque_z"]) == ["torque_z"]


# -- the command -----------------------------------------------------------------------------------
def test_the_command_refuses_with_status_2_and_writes_nothing(tmp_path, capsys, monkeypatch):
    written(tmp_path / "log.csv", {**LOG, "time": TIME[::-1]})
    (tmp_path / "craft.xml").write_text(CRAFT)
    monkeypatch.chdir(tmp_path)
    status, _, said = run(
        ["identify", "log.csv", "--craft", "craft.xml", "--mount", "mount", "-o", "modes.toml"],
        capsys,
        monkeypatch,
    )
    assert status == 2
    assert "must ascend" in said
    assert "Traceback" not in said
    assert sorted(p.name for p in tmp_path.iterdir()) == ["craft.xml", "log.csv"]


def test_the_command_writes_no_output_onto_its_prior(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path / "log.csv", LOG)
    (tmp_path / "craft.xml").write_text(CRAFT)
    (tmp_path / "rod.toml").write_bytes(spec("rod").read_bytes())
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    call = ["identify", "log.csv", "--craft", "craft.xml", "--mount", "mount"]
    more = ["--prior", "rod.toml", "-o", "rod.toml", "--force"]
    code, said, sentence = run([*call, *more], capsys, monkeypatch)
    assert (code, said) == (2, "")
    assert sentence.startswith("beamchain: ")
    assert sentence.count("\n") == 1
    assert "read for it" in sentence
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.slow
def test_a_good_log_is_read_as_its_mapping_is(tmp_path):
    omega = np.linspace(0.2, 8.0, 300)
    s = 1j * omega
    log = {
        "omega": omega,
        "rate_z/torque_z": 1.0 / (s * (130.0 - 36.0 * s**2 / (s**2 + 0.02 * s + 4.0))),
    }
    craft = """<mujoco><worldbody><body name="bus"><freejoint/>
    <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
    <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>"""
    path = tmp_path / "log.npz"
    renamed = {"response": "rate_z/torque_z"}
    arrays = {"omega": omega, "response": log["rate_z/torque_z"]}
    np.savez_compressed(path, **arrays)
    stored = identification.identify(path, craft, "mount", map=renamed)
    given = identification.identify(log, craft, "mount")
    np.testing.assert_array_equal(
        [m.frequency for m in stored.modes], [m.frequency for m in given.modes]
    )
