"""Random logs of random spacecraft, judged by one who knows the truth: never silently wrong.

Each case draws an appendage of 40 modes (a pair of wings, or a boom that also pushes its port),
damping from 0.05 to 5 %, a torque profile, a sample rate, a duration from 20 s, and a gyro; and one
trouble, or none. `judge.py` states what right, undetermined, refused and wrong mean; of a log that
ought to be refused, a record that calls no mode determined is undetermined, and so is one of
swapped columns that says that its torques are proportional. BEAMCHAIN_CASES draws that many, else
every trouble once.

    BEAMCHAIN_CASES=300 PYTHONPATH=tests/support python tests/identification/test_campaign.py

prints every case, and the counts.
"""

import os
import sys
from collections import Counter
from dataclasses import dataclass

import numpy as np
import pytest

import beamchain as bc
from beamchain import identification
from flight_log import (
    Gyro,
    Hub,
    boom,
    chirp,
    cramer_rao,
    doublet,
    noise,
    record,
    slew,
    steps_at,
    wings,
    without,
)
from judge import Judgement, judge
from modes_file import write_prior

# least relative deviation of a row that the log allows:
# a mode better determined than this shows plainly
PLAIN = 0.02
TROUBLES = (
    "none",
    "none",
    "none",
    "close",
    "fast",
    "gaps",
    "unequal",
    "saturated",
    "quantised",
    "prior",
    "prior off",
    "noise only",
    "still",
    "degrees",
    "swapped",
    "reversed",
    "nan",
    "three axes",
    "boom",
    "boom prior",
    "light",
)
CASES = int(os.environ.get("BEAMCHAIN_CASES", len(TROUBLES)))
REFUSED = {"still", "degrees", "swapped", "reversed", "nan"}
# a log that shows nothing may be refused, or found without modes
MAY_REFUSE = {"noise only", "light"}


@dataclass
class Case:
    """A spacecraft, its log and what is wrong with it."""

    trouble: str
    hub: Hub
    elastic: object
    log: dict
    plain: list
    axes: list
    pushes: bool
    prior: object = None


def draw(seed):
    rng = np.random.default_rng([20261122, seed])
    trouble = TROUBLES[seed % len(TROUBLES)]
    pushes = trouble.startswith("boom")
    make = boom if pushes else wings
    length = rng.uniform(3.0, 9.0)
    line = rng.uniform(0.4, 2.0)
    first = np.exp(rng.uniform(np.log(0.6), np.log(6.0)))  # rad/s about z
    stiffness = line * (first * length**2 / 3.516) ** 2
    elastic = make(
        length, line, stiffness, stiffness * rng.uniform(1.3, 3.0), rng.uniform(20.0, 200.0), 0.05
    )
    elastic = elastic.damped(np.exp(rng.uniform(np.log(5e-4), np.log(0.05), 40)))
    about_z = np.flatnonzero(elastic.participation[5])
    size = elastic.rigid[5, 5] / (
        30.0 if trouble == "light" else np.exp(rng.uniform(np.log(0.2), np.log(3.0)))
    )
    hub = Hub(
        mass=float(rng.uniform(100.0, 600.0)), inertia=size * np.diag(rng.uniform(0.8, 1.2, 3))
    )
    if trouble == "light":
        hub = Hub(mass=600.0, inertia=hub.inertia * 900.0)
    if trouble == "close":
        apart = rng.choice([0.01, 0.03, 0.1])
        elastic = doublet(elastic, "z", elastic.frequency[about_z[0]], apart, rng.uniform(0.3, 1.0))
    duration = np.exp(rng.uniform(np.log(20.0), np.log(300.0)))
    per_period = rng.uniform(8.0, 40.0)
    step = 2.0 * np.pi / first / per_period
    if trouble == "fast":
        step = 2.0 * np.pi / elastic.frequency[about_z[1]] / rng.uniform(1.2, 1.9)
    count = int(np.clip(duration / step, 400, 12000))
    time = step * np.arange(count)
    if trouble == "unequal":
        time = np.cumsum(step * rng.choice([0.8, 1.0, 1.6], count))
    profile = {
        "steps": lambda k: steps_at(time, 1.0, rng.uniform(1.0, 6.0) / first * 2.0, k),
        "chirp": lambda k: chirp(time, 1.0, 0.02 * first, 1.5 * first),
        "noise": lambda k: noise(time, 1.0, k),
        "slew": lambda k: slew(time, 1.0, 0.05 * time[-1], 0.1 * time[-1], 0.15 * time[-1]),
    }[rng.choice(["steps", "chirp", "noise", "slew"])]
    axes = [0, 1, 2] if trouble == "three axes" else [1, 2] if trouble == "swapped" else [2]
    torques = {"xyz"[a]: hub.inertia[a, a] * 0.002 * profile(seed + a) for a in axes}
    exact = record(hub, elastic, time, torques)
    amplitude = float(np.std(exact["rate_z"]))
    level = amplitude * np.exp(rng.uniform(np.log(1e-4), np.log(3e-2)))
    gyro = Gyro(level, amplitude * rng.uniform(-1.0, 1.0))
    if trouble == "quantised":
        gyro = Gyro(level, gyro.bias, amplitude * np.exp(rng.uniform(np.log(1e-3), np.log(0.3))))
    if trouble == "saturated":
        gyro = Gyro(
            level, 0.0, 0.0, float(np.quantile(np.abs(exact["rate_z"]), rng.uniform(0.8, 0.98)))
        )
    if trouble == "still":
        torques = {"z": np.full(count, rng.choice([0.0, 1.0]))}
    if trouble == "noise only":
        elastic = elastic.kept(0)
    log = record(hub, elastic, time, torques, gyro, seed)
    plain = (
        plainly(hub, elastic, time, torques["z"], level, about_z)
        if axes == [2] and trouble not in ("still", "noise only")
        else []
    )
    if trouble == "gaps":
        places = rng.uniform(0.0, time[-1], 4)
        log = without(log, *((p, p + 0.03 * time[-1]) for p in places))
    if trouble == "degrees":
        log["rate_z"] = np.degrees(log["rate_z"])
    if trouble == "swapped":
        log["rate_y"], log["rate_z"] = log["rate_z"], log["rate_y"]
    if trouble == "reversed":
        log["time"] = log["time"][::-1].copy()
    if trouble == "nan":
        log["rate_z"][count // 3] = np.nan
    return Case(trouble, hub, elastic, log, plain, axes, pushes)


def plainly(hub, elastic, time, torque, level, about_z):
    """Ranks of the modes about z below half the sample rate whose rows the log determines well,
    had it these modes alone."""
    below = [k for k in about_z if elastic.frequency[k] < 0.8 * np.pi / np.diff(time).min()][:3]
    if not below:
        return []
    least = cramer_rao(hub, elastic.kept(below), time, {"z": torque}, level)
    rows = np.abs(elastic.participation[5, below])
    return [
        rank
        for rank, (std, row) in enumerate(zip(least[2], rows, strict=True))
        if std < PLAIN * row
    ]


def verdict(case, folder):
    if case.trouble in ("prior", "boom prior", "prior off"):
        few = case.elastic.kept(6)
        off = 1.2 if case.trouble != "prior off" else 1.8
        case.prior = write_prior(
            folder, few, frequency=off, participation=1.0 if case.pushes else 0.9
        )
    try:
        found = identification.identify(case.log, case.hub.xml, "mount", prior=case.prior)
    except bc.InputError as refused:
        rightly = (
            case.trouble in REFUSED
            or (case.trouble in MAY_REFUSE and not case.plain)
            or not case.plain
        )
        return Judgement("refused rightly" if rightly else "refused wrongly", (str(refused),))
    if case.trouble in REFUSED:
        # then no program can notice
        alike = any(one.code == "proportional-torques" for one in found.warnings)
        silent = any(mode.determined for mode in found.modes) and not (
            alike and case.trouble == "swapped"
        )
        return Judgement(
            "wrong" if silent else "undetermined", (f"{case.trouble} was taken as it is",)
        )
    return judge(found, case.elastic, case.axes, case.plain, case.hub if case.pushes else None)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 100 + CASES))
def test_cases(seed, tmp_path):
    judged = verdict(draw(seed), tmp_path)
    assert judged.verdict in ("right", "undetermined", "refused rightly"), judged


if __name__ == "__main__":
    import tempfile
    import time
    import warnings
    from pathlib import Path

    warnings.simplefilter("error")
    first = 100
    numbers = [int(s) for s in sys.argv[1:]] or range(first, first + CASES)
    counts: Counter = Counter()
    for number in numbers:
        case = draw(number)
        begin = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            try:
                one = verdict(case, Path(folder))
            except Exception as error:
                one = Judgement("traceback", (repr(error),))
        counts[one.verdict] += 1
        print(
            f"{number} {case.trouble:11} {len(case.log['time'])} "
            f"{time.perf_counter() - begin:.1f}s {one.verdict}",
            *one.reasons[:4],
            sep=" | ",
            flush=True,
        )
    print(dict(counts))
