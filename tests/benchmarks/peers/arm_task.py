"""What every model of the two-link arm is given: the shipped arm bent at its elbow, a torque on its
bus, and the exact answer by modes of three-dimensional finite elements."""

import json
import statistics
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "support"))

from compare import TARGETS, cheapest

from arms import Arm, Link, modes

EXAMPLES = Path(str(files("beamchain"))) / "examples"
ANGLE = np.pi / 4.0  # of the elbow
# nothing is damped: neither the links nor the hinge
UPPER = Link("upper", 6.0, 0.05, 0.08)
FORE = Link("fore", 5.0, 0.04, 0.05, 4.0, (0.02, 0.02, 0.02), (0.0, 0.0, 1.0))
ARM = Arm((UPPER, FORE), hand=20.0, hand_inertia=(0.5, 0.5, 0.5), ratio=0.0, elements=60)
TORQUE = 1.0  # on the bus about z [N m]: the elbow turns by 1e-4 rad, which moves no frequency
BEAT, END = 0.5, 20.0  # the torque's sign changes after a beat, it ends after two [s]
TOP = 2000.0  # of the modes in the answer [rad/s]; 500 makes 1.3e-5 of difference
# of the beat: the ladder of steps, 20 ms to 0.125 ms
DIVISORS = (25, 40, 63, 100, 160, 250, 400, 630, 1000, 1600, 2500, 4000)
WORST = 0.5  # errors above are no point
LONGEST = 3.0  # a run of this length [s] is the last of its ladder
ROUNDS = 5  # of the timing


class Truth:
    """The bus's attitude about z [rad], and what is elastic in it at most."""

    def __init__(self):
        self.omega, shapes = modes(ARM, TOP, {"fore": ANGLE})
        self.weight = shapes[5] ** 2
        self.largest = np.max(np.abs(self.attitude(np.linspace(0.0, END, 20_001), elastic=True)))

    def attitude(self, at, *, elastic=False):
        """`(t,)` at times `at` [s]; `elastic`: without what the rigid arm would do."""
        vibrating = self.omega > 0.0
        w = np.where(vibrating, self.omega, 1.0)
        out = np.zeros((len(at), len(w)))
        for start, change in ((0.0, 1.0), (BEAT, -2.0), (2.0 * BEAT, 1.0)):
            since = np.maximum(np.asarray(at) - start, 0.0)[:, None]
            free = 0.0 if elastic else since**2 / 2.0
            out += change * np.where(vibrating, (1.0 - np.cos(w * since)) / w**2, free)
        return TORQUE * out @ self.weight

    def error(self, attitude, h):
        """Largest error of attitudes after every step over the largest elastic part."""
        at = h * np.arange(1, len(attitude) + 1)
        return float(np.max(np.abs(attitude - self.attitude(at))) / self.largest)


class ArmPeer(NamedTuple):
    """One model of the arm, ready to run.

    `run(timestep, record)` simulates 20 s and returns the bus's attitude `(steps,)` after every
    step where `record`, and the time [s] of the simulation alone. The attitude is the part that
    changes its sign with the torque: what is quadratic in the motion is no error of a model.
    """

    model: str
    n: int
    integrator: str
    run: Callable[[float, bool], tuple[np.ndarray | None, float]]
    note: str


def measure(peers: list[ArmPeer]) -> list[dict[str, Any]]:
    """Error and time of every model over a ladder of steps, largest first, timed in turns."""
    truth = Truth()
    points, runs = [], []
    for peer in peers:
        sys.stdout.write(f"{peer.model}, n = {peer.n}, {peer.integrator}\n")
        sys.stdout.flush()
        still, before = 0, 0.0
        for divisor in DIVISORS:
            h = BEAT / divisor
            attitude, seconds = peer.run(h, True)
            if attitude is None or not np.all(np.isfinite(attitude)):
                continue
            error = truth.error(attitude, h)
            if error < WORST:
                points.append({**peer._asdict(), "timestep": h, "error": error})
                del points[-1]["run"]
                runs.append((points[-1], peer))
            still = still + 1 if before and abs(error / before - 1.0) < 0.02 else 0
            before = error
            if still == 2 or seconds > LONGEST:
                break  # finer steps change nothing, or cost too much
    for point, _ in runs:
        point["times"] = []
    for _ in range(ROUNDS):
        for point, peer in runs:
            if not point["times"] or point["times"][0] < 0.5:
                point["times"].append(peer.run(point["timestep"], False)[1])
    for point, _ in runs:
        point["seconds"] = statistics.median(point.pop("times"))
    return points


def write(points: list[dict[str, Any]], path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(points, indent=1))


def table(points: list[dict[str, Any]]) -> None:
    """Every setting, then the cheapest of each program to an error, over ours."""
    for p in points:
        print(
            f"{p['model']:28} n={p['n']} {p['integrator']:26} h={p['timestep']:.4g} "
            f"error {p['error']:.2e} {1e3 * p['seconds'] / END:.3f} ms per second"
        )
    families = list(dict.fromkeys(p["model"] for p in points))
    print("to reach an error of the bus's attitude over 20 s, per simulated second, and over ours")
    for target in TARGETS:
        best = {
            name: cheapest([p for p in points if p["model"] == name], target, "error")
            for name in families
        }
        ours = best[families[0]]
        for name, found in best.items():
            if found is None:
                least = min((p["error"] for p in points if p["model"] == name), default=WORST)
                print(f"  {target:g}: {name:28} never, {least:.1e} at best")
                continue
            over = "" if ours is None else f", {found['seconds'] / ours['seconds']:.2f} x"
            print(
                f"  {target:g}: {name:28} n={found['n']} {found['integrator']} "
                f"h={found['timestep']:.4g}: {1e3 * found['seconds'] / END:.2f} ms{over}"
            )
