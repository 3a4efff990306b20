"""Identification: an hour of 100 Hz with six modes,
and how often 95 % intervals hold the truth over random logs.

python tests/benchmarks/identification.py [DRAWS]
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "support"))
sys.path.insert(0, str(Path(__file__).parent.parent / "identification"))

from beamchain import identification
from flight_log import Gyro, Hub, cramer_rao, record, steps_at, wings

HUB = Hub()
GYRO = Gyro(1e-5, 2e-4)
PAIR = wings(5.0, 1.0, 200.0, 350.0, 50.0, 0.05)
ABOUT_Z = np.flatnonzero(PAIR.participation[5])


def an_hour() -> None:
    """360,000 samples of one axis, 20 N m and a gyro that shows six of the 40 modes,
    kept by request."""
    t = np.arange(0.0, 3600.0, 0.01)
    # the first six about z lie below half the sample rate
    soft = wings(5.0, 1.0, 10.0, 17.0, 50.0, 0.05)
    log = record(HUB, soft, t, {"z": steps_at(t, 20.0, 3.0)}, Gyro(1e-6, 2e-5))
    wall = time.perf_counter()
    cpu = time.process_time()
    found = identification.identify(log, HUB.xml, "mount", modes=6)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    print(f"an hour of 100 Hz, six modes: {wall:.1f} s, {cpu:.1f} s of processor time")
    true = soft.frequency[np.flatnonzero(soft.participation[5])]
    for mode in found.modes:
        nearest = true[np.argmin(np.abs(true - mode.frequency))]
        print(f"  {mode.frequency:10.6f} +- {mode.frequency_std:.1e} rad/s, truth {nearest:10.6f}")


def coverage(count: int) -> None:
    """Two modes in the log, 120 s of 20 Hz, another draw of the noise each time."""
    two = PAIR.kept(ABOUT_Z[:2])
    t = np.arange(0.0, 120.0, 0.05)
    torque = {"z": steps_at(t, 1.0, 3.0)}
    truth = np.array([two.frequency, two.damping, np.abs(two.participation[5])])
    bound = cramer_rao(HUB, two, t, torque, GYRO.noise)
    off, std = np.empty((2, count, 3, 2))
    for seed in range(count):
        modes = identification.identify(
            record(HUB, two, t, torque, GYRO, seed), HUB.xml, "mount", modes=2
        ).modes
        off[seed] = (
            np.transpose([[m.frequency, m.damping, abs(m.participation[5])] for m in modes]) - truth
        )
        std[seed] = np.transpose(
            [[m.frequency_std, m.damping_std, m.participation_std[5]] for m in modes]
        )
    print(
        f"95 % intervals, {count} draws, two modes: share that holds the truth; deviation over the "
        "Cramer-Rao bound"
    )
    for k, name in enumerate(("frequency", "damping", "participation")):
        held = (np.abs(off[:, k]) <= 1.96 * std[:, k]).mean(axis=0)
        ratio = np.sqrt((off[:, k] ** 2).mean(axis=0)) / bound[k]
        said = std[:, k].mean(axis=0) / bound[k]
        print(
            f"  {name:14} held {held.round(3)}, scattered {ratio.round(3)}, stated {said.round(3)}"
        )


if __name__ == "__main__":
    an_hour()
    coverage(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
