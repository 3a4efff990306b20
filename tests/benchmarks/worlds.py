"""Craft-seconds per second of many worlds at a stated error: flexible and exact in time,
rigid at 1 ms and at the same step, equal links.

The seed's boom on its hub, 60 s. Error: the hub's motion in the doublet against the exact
structure, one world through `worlds.make` itself. Speed: an episode of 60 s, a random torque and
all observations every period, a reset at its start, and for the flexible craft new frequencies and
damping for every world, made exact in time. The rigid craft and the equal links are held by the
same periods and draw nothing. Kinds are timed in turns, and ratios are medians of ratios of the
same turn, so that other load on the machine falls on all alike. On the host mujoco the clock is
the processor time of all threads, so that a second is one of one core, shared or not; --wall, and
other hosts, take that of the wall. Settings that would take longer than a few seconds for one
period are left out ("-").

Run: python tests/benchmarks/worlds.py [--host mujoco|mjx|warp] [--most 4096] [--rounds 7] [--wall]
"""

import argparse
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "peers"))

from task import SCENARIO, TASK

from beamchain import worlds
from beamchain.engine.library import machine
from beamchain.studies import field
from beamchain.studies.field import RIGID_HUB, TIMED, Entry
from beamchain.studies.run_time import steps_below

RANGES = {"frequency": 0.05, "damping": 0.3}
EPISODE = SCENARIO.duration
COUNTS = (1, 4, 16, 64, 256, 1024, 4096)
LONGEST = 5.0  # [s] for one period of a setting that is still timed
SLOW, FEW = 0.5, 3  # [s] for one period of a setting that is timed in so many turns only
MODES = (2, 3, 4, 6, 8)
EQUAL = "equal links, midpoint"  # the better of the two recipes on this boom


clock = time.process_time


class Kind(NamedTuple):
    """A model at a step; `draws`: its worlds are randomised."""

    name: str
    model: Any
    step: float
    error: float | None
    draws: bool


def driven(entry: Entry) -> mujoco.MjModel:
    """The scene of an entry with a torque about the boom's bending axis on the hub."""
    chain = (
        field.rigid_chain(TASK.beam) if entry.model == RIGID_HUB else field.chain_of(TASK, entry)
    )
    spec = mujoco.MjSpec.from_string(field.scene_text(TASK.hub, chain))
    hub = spec.worldbody.first_body()
    hub.add_site(name="hub_torque")
    spec.add_actuator(
        name="torque",
        target="hub_torque",
        trntype=mujoco.mjtTrn.mjTRN_SITE,
        gear=[0, 0, 0, 0, 0, 1],
    )
    return spec.compile()


def error_of(model: mujoco.MjModel, step: float) -> float:
    """Of one world in the doublet."""
    one = worlds.make(model, count=1, timestep=step, observe=[], threads=1)
    motion = np.zeros((round(EPISODE / step), 6))
    for k, torque in enumerate(SCENARIO.profile.mean(step, len(motion))[:, 5]):
        one.step([torque])
        w, *v = one.qpos[0, 3:7]
        motion[k, :3] = one.qpos[0, :3] - one.model.qpos0[:3]
        motion[k, 3:] = (
            2.0 * np.arctan2(np.linalg.norm(v), w) * np.array(v) / max(np.linalg.norm(v), 1e-300)
        )
    return float(SCENARIO.error(motion, step))


def exact(target: float) -> Kind:
    """Fewest modes and largest step that meet the target."""
    for step in (1.0, 0.5, 0.25, 0.125):
        for n in (1, 2, 3, 4):
            model = driven(Entry(TIMED, n, "Euler"))
            if (error := error_of(model, step)) <= target:
                return Kind(
                    f"flexible, exact in time, {n} modes at {step:g} s", model, step, error, True
                )
    raise SystemExit(f"no model exact in time meets {target:g}")


def classical(target: float, period: float) -> Kind:
    """Fewest equal links that meet the target at their largest stable step."""
    n = round(27 * np.sqrt(1e-2 / target))
    while True:
        entry = Entry(EQUAL, n, "Euler")
        model = driven(entry)
        step = period / np.ceil(
            period / steps_below(SCENARIO, field.largest_step(TASK, entry))[0][0]
        )
        if (error := error_of(model, step)) <= target:
            return Kind(f"{EQUAL}, {n} at {1e3 * step:.3g} ms", model, step, error, False)
        n = round(n * 1.03) + 1


class Run:
    """Worlds of a kind, timed a little at a time."""

    def __init__(self, kind: Kind, count: int, host: str, period: float) -> None:
        self.count, self.draws, self.hold = count, kind.draws, round(period / kind.step)
        self.worlds = worlds.make(
            kind.model, RANGES if kind.draws else None, count=count, host=host, timestep=kind.step
        )
        self.torque = 1e-4 * np.random.default_rng(0).normal(size=(8, count, 1))
        self.periods = round(EPISODE / period)
        self.once(1)
        self.last = self.once(1)[1]
        self.number = max(1, min(self.periods, int(0.05 / max(self.last, 1e-9))))

    def once(self, number: int) -> tuple[float, float]:
        """Time of a reset and of a period [s]."""
        start = clock()
        self.worlds.reset(draw=self.draws)
        middle = clock()
        for k in range(number):
            self.worlds.step(self.torque[k % 8], self.hold)
        return middle - start, (clock() - middle) / number

    def speed(self) -> float:
        """Craft-seconds per second."""
        reset, period = self.once(self.number)
        return self.count * EPISODE / (reset + self.periods * period)


def memory(n: int, host: str, count: int = 1 << 15) -> float:
    """Bytes that a randomised world with n modes takes, by the growth of a fresh process."""
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import worlds; "
        f"print(worlds.grown({n}, {host!r}, {count}))"
    )
    return (
        float(
            subprocess.run(
                [sys.executable, "-c", code], capture_output=True, text=True, check=True
            ).stdout
        )
        / count
    )


def grown(n: int, host: str, count: int) -> float:
    """Growth of this process by worlds [bytes]; 0 where the system does not say."""

    def resident() -> float:
        pages = Path("/proc/self/statm")
        return 4096.0 * int(pages.read_text(encoding="ascii").split()[1]) if pages.exists() else 0.0

    model = driven(Entry(TIMED, n, "Euler"))
    kept = [worlds.make(model, RANGES, count=64, host=host, timestep=0.5)]
    before = resident()
    kept.append(worlds.make(model, RANGES, count=count, host=host, timestep=0.5))
    kept[1].step(np.zeros(1))
    return resident() - before


def affordable(kind: Kind, count: int, period: float, each: dict[str, float]) -> bool:
    """Whether one period of so many worlds takes less than `LONGEST`,
    by the time of a single one."""
    if kind.name not in each:
        data = mujoco.MjData(kind.model)
        start = clock()
        mujoco.mj_step(kind.model, data, nstep=50)
        each[kind.name] = (clock() - start) / 50
    return count * each[kind.name] * period / kind.step <= LONGEST


def table(target: float, host: str, most: int, rounds: int) -> None:
    mine = exact(target)
    period = mine.step
    rigid = Kind("rigid at 1 ms", driven(Entry(RIGID_HUB, 0, "Euler")), 1e-3, None, False)
    same = Kind("rigid at the same step", rigid.model, period, None, False)
    chain = classical(target, period)
    print(f"\nerror {target:g}, a torque every {period:g} s, host {host}; craft-seconds per second")
    for kind in (mine, chain):
        print(f"  {kind.name}: error {kind.error:.1e}, {kind.model.nv} degrees of freedom")
    print(
        f"{'worlds':>7} {'flexible':>10} {'rigid':>10} {'same step':>10} {'equal':>10} "
        f"{'to rigid':>9} {'to same':>9} {'to equal':>9}"
    )
    each: dict[str, float] = {}
    for count in [c for c in COUNTS if c <= most]:
        runs: list[Run | None] = [Run(mine, count, host, period)]
        for kind in (rigid, same, chain):
            runs.append(
                Run(kind, count, host, period) if affordable(kind, count, period, each) else None
            )
        turns = [
            [
                run.speed() if run is not None and (turn < FEW or run.last < SLOW) else None
                for run in runs
            ]
            for turn in range(rounds)
        ]
        said = [f"{count:7}"]
        for column in zip(*turns, strict=True):
            timed = [speed for speed in column if speed is not None]
            said.append(f"{statistics.median(timed):10.4g}" if timed else f"{'-':>10}")
        for i in (1, 2, 3):
            ratios = [turn[0] / turn[i] for turn in turns if turn[i] is not None]
            said.append(f"{statistics.median(ratios):9.4g}" if ratios else f"{'-':>9}")
        print(*said, flush=True)


def growth(host: str, rounds: int) -> None:
    print(f"\nmodes, 256 worlds at 0.5 s, host {host}; craft-seconds per second")
    for n in MODES:
        run = Run(Kind("", driven(Entry(TIMED, n, "Euler")), 0.5, None, True), 256, host, 0.5)
        resets = statistics.median(run.once(1)[0] for _ in range(rounds))
        speed = statistics.median(run.speed() for _ in range(rounds))
        size = memory(n, host) / 1e3
        print(
            f"{n:7} {speed:10.4g}   reset with draws {1e6 * resets / 256:.3g} us   {size:.3g} kB a "
            "world",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--host", default="mujoco")
    parser.add_argument("--most", type=int, default=COUNTS[-1])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--wall", action="store_true")
    given = parser.parse_args()
    global clock
    if given.wall or given.host != "mujoco":
        clock = time.perf_counter
    print(machine())
    for target in (1e-2, 1e-3):
        table(target, given.host, given.most, given.rounds)
    growth(given.host, given.rounds)


if __name__ == "__main__":
    main()
