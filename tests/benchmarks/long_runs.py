"""Undamped runs of a million steps at half the stable step: energy and phase per integrator;
a craft that tumbles.

`python tests/benchmarks/long_runs.py [STEPS]`
"""

import sys
from pathlib import Path

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from mechanics import INTEGRATORS
from undisturbed import ringing, tumbling

STEPS = 1_000_000


def main(steps: int) -> None:
    """Print both tables."""
    print(
        f"MuJoCo {mujoco.__version__}; the seed's boom with 2 modes on its hub, first mode rung "
        f"alone, {steps} steps\n"
    )
    print(
        "| integrator | step s | energy, worst drift in the run | energy at the end | phase error "
        "per period | predicted |"
    )
    print("|---|---:|---:|---:|---:|---:|")
    for integrator in INTEGRATORS:
        row = ringing(integrator, steps)
        energy = f"{row.worst:.2e} | {row.last:+.2e}"
        print(
            f"| {integrator} | {row.timestep:.4g} | {energy} | {row.phase:+.3e} | "
            f"{row.predicted:+.3e} |"
        )
    print(
        "\nA craft in space with two flexible arrays, tumbling freely, 20 s; worst drift of its "
        "momenta, relative\n"
    )
    print("| integrator | step s | linear momentum | angular momentum | order of the angular |")
    print("|---|---:|---:|---:|---:|")
    for integrator in INTEGRATORS:
        rows = [tumbling(integrator, h) for h in (0.02, 0.01, 0.005)]
        for k, (h, (linear, angular)) in enumerate(zip((0.02, 0.01, 0.005), rows, strict=True)):
            order = f"{np.log2(rows[k - 1][1] / angular):.2f}" if k else "-"
            print(f"| {integrator} | {h} | {linear:.1e} | {angular:.2e} | {order} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else STEPS)
