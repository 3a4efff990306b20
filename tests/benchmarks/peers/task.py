"""What every peer is given: the seed's boom on its hub, the torque, and the exact answer."""

import json
import statistics
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from beamchain import read_spec
from beamchain.fitting.spec_text import spec_toml
from beamchain.studies.run_time import LADDER
from beamchain.studies.study import Options, prepare

SPEC = Path(str(files("beamchain"))) / "examples" / "seed_boom.toml"
ROUNDS = 7
TASK, SCENARIO = prepare(spec_toml(read_spec(SPEC)), Options())
ARM = float(TASK.hub.offset[0])
LENGTH = TASK.beam.length
MASS = float(TASK.beam.rigid_mass()[0, 0])
BENDING = float(TASK.beam.segments[0].at(np.array([0.5])).bending_xy[0])
AXIAL = float(TASK.beam.segments[0].at(np.array([0.5])).axial[0])
MOMENT = float(SCENARIO.profile.wrench[0, 5])
HALF = float(SCENARIO.profile.times[1])
END = SCENARIO.duration


class Peer(NamedTuple):
    """One model in another simulator, ready to run.

    `run(timestep, record)` simulates the scenario and returns the hub's angle `(steps,)` where
    `record`, and the time [s] of the simulation alone.
    """

    model: str
    n: int
    integrator: str
    run: Callable[[float, bool], tuple[np.ndarray | None, float]]
    note: str


def measure(
    peers: list[Peer], longest: float, rungs: int = 12, limits: dict[str, float] | None = None
) -> list[dict[str, Any]]:
    """Error and time over a ladder of steps, timed in turns."""
    points: list[dict[str, Any]] = []
    runs: list[tuple[dict[str, Any], Peer]] = []
    for peer in peers:
        limit = (limits or {}).get(f"{peer.model} {peer.n}", SCENARIO.beat)
        divisors = [
            d
            for d in (*LADDER, 64, 80, 96, 128, 160, 192, 256, 512, 1024)
            if SCENARIO.beat / d <= limit
        ]
        still, before, spent = 0, 0.0, 0.0
        for divisor in divisors[:rungs]:
            h = SCENARIO.beat / divisor
            angle, seconds = peer.run(h, True)
            if angle is None or not np.all(np.isfinite(angle)):
                continue
            spent += seconds
            motion = np.zeros((angle.size, 6))
            motion[:, 5] = angle
            error = SCENARIO.error(motion, h)
            if error < 2.0:
                point = {
                    "model": peer.model,
                    "n": peer.n,
                    "integrator": peer.integrator,
                    "timestep": h,
                    "error": error,
                    "error_appendage": error,
                    "note": peer.note,
                }
                points.append(point)
                runs.append((point, peer))
            still = still + 1 if before and abs(error / before - 1.0) < 0.01 else 0
            before = error
            if still == 2 or spent > longest:
                break
    times: dict[int, list[float]] = {i: [] for i in range(len(runs))}
    for turn in range(ROUNDS):
        for i, (point, peer) in enumerate(runs):
            if turn == 0 or times[i][0] < 0.3:
                times[i].append(peer.run(point["timestep"], False)[1])
    for i, (point, _) in enumerate(runs):
        point["seconds"] = statistics.median(times[i])
        point["seconds_per_step"] = point["seconds"] * point["timestep"] / END
    return points


def write(points: list[dict[str, Any]], path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(points, indent=1))
