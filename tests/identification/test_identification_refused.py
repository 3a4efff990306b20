"""A log that cannot be one is refused by one sentence that names the column, its value and the
cure. What is only seen in a response stands in `test_identification.py`. No tolerances: sentences
only."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import beamchain as bc
from beamchain import identification
from refused import check_refused

CRAFT = """<mujoco><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/>
<site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>"""
TIME = np.arange(400) * 0.05
TORQUE = np.where(np.arange(400) // 20 % 2, 1.0, -1.0)
RATE = np.concatenate([[0.0], np.cumsum(TORQUE[:-1]) * 0.05 / 200.0]) + 1e-4 * np.sin(2.0 * TIME)
LOG = {"time": TIME, "torque_z": TORQUE, "rate_z": RATE}
OMEGA = np.linspace(1.0, 5.0, 20)
HALF = {"omega": OMEGA, "rate_z/torque_z re": OMEGA}


def identified(log=LOG, mount="mount", **more):
    identification.identify(log, CRAFT, mount, **more)


def changed(**columns):
    identified({**LOG, **columns})


def without(name, **more):
    identified({key: values for key, values in LOG.items() if key != name} | more)


def of_file(name, content):
    Path(name).write_bytes(content)
    identified(name)


REFUSED = {
    "time backwards": (lambda: changed(time=TIME[::-1]), ("must ascend",)),
    "rate nan": (
        lambda: changed(rate_z=np.where(np.arange(400) == 7, np.nan, RATE)),
        ("rate_z = nan in sample 8",),
    ),
    "rate too short": (lambda: changed(rate_z=RATE[:-1]), ("rate_z has 399",)),
    "constant torque": (
        lambda: changed(torque_z=np.ones(400)),
        ("nothing excites the craft", "torque_z is 1 N m"),
    ),
    "no torque": (lambda: changed(torque_z=np.zeros(400)), ("nothing excites the craft",)),
    "constant rate": (lambda: changed(rate_z=np.full(400, 0.1)), ("rate_z is constant",)),
    "sign": (lambda: changed(rate_z=-RATE), ("turns against its torque",)),
    "degrees": (lambda: changed(rate_z=57.3 * RATE), ("with rates in degrees",)),
    "rate for torque": (lambda: changed(torque_z=RATE, rate_z=TORQUE), ("swapped", "--map")),
    "column of no rate": (lambda: without("rate_z"), ("no column of a rate or attitude",)),
    "column with a slip": (
        lambda: without("torque_z", torqe_z=TORQUE),
        ("no column of a torque", "did you mean 'torque_z'"),
    ),
    "no time": (lambda: without("time"), ("a time log needs `time`",)),
    "other axes": (lambda: without("rate_z", rate_x=RATE), ("act about other axes",)),
    "ten samples": (
        lambda: identified({name: values[:10] for name, values in LOG.items()}),
        ("has 10 samples",),
    ),
    "a list": (lambda: identified([]), ("is no log",)),
    "two logs": (
        lambda: identified([LOG, {**LOG, "torque_x": TORQUE}]),
        ("no column 'torque_x'", "another log has"),
    ),
    "map": (lambda: identified(map={"rate_zz": "rate_z"}), ("'rate_zz'", "did you mean 'rate_z'")),
    "half a response": (lambda: identified(HALF), ("needs the columns", "rate_z/torque_z re")),
    "held out": (lambda: identified(held_out=0.9), ("held_out = 0.9",)),
    "modes": (lambda: identified(modes=0), ("modes = 0",)),
    "axes": (lambda: identified(axes="q"), ("axes = 'q' is unknown",)),
    "mount a number": (
        lambda: identified({}, mount=5),
        ("mount = 5 is an int", "site or body"),
    ),
    "map a number": (lambda: identified({}, map=5), ("map = 5 is an int", "by column")),
    "place": (lambda: identified(mount="mout"), ("mount = 'mout'", "did you mean 'mount'")),
    **{
        f"file {number}, {name}": (partial(of_file, name, content), words)
        for number, (name, content, words) in enumerate(
            (
                ("log.csv", b"", ("is empty",)),
                ("log.csv", b"time,torque_z,rate_z\n", ("no rows",)),
                ("log.csv", b"1,2,3\n4,5,6\n", ("no line of column names",)),
                ("log.csv", b"time,torque_z,rate_z\n0,1,a\n", ("no number",)),
                ("log.csv", b"time,torque_z,rate_z\n0,1\n", ("names 3 columns", "have 2")),
                ("log.npz", b"PK nothing", ("log.npz", "cannot be read")),
                ("log.xls", b"x", ("log.xls", "unknown ending")),
            )
        )
    },
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_log_that_cannot_be_one_is_refused(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_refused(REFUSED[case][0], bc.InputError, REFUSED[case][1])


@pytest.mark.parametrize("column", ["time", "torque_z", "rate_z"])
def test_logs_far_out(column):
    log = {"time": np.arange(200.0), "torque_z": np.ones(200), "rate_z": np.ones(200)}
    log[column] = log[column] * 1e300
    with pytest.raises(bc.InputError, match=f"{column} = .*1e.300 in sample .*at most 1e.12"):
        identified(log)
