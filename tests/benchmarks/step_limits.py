"""Step limits predicted and measured, as a table in Markdown: `python
tests/benchmarks/step_limits.py`."""

import platform
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import beamchain as bc
from measured_limit import limits
from step_models import MODELS, written


def main() -> None:
    """Print the table."""
    lines: list[str] = []
    worst, finite = 0.0, 0
    for name, (kind, _) in MODELS.items():
        with tempfile.TemporaryDirectory() as folder:
            path = written(name, Path(folder))
            rows = limits(bc.stability(path), mujoco.MjModel.from_xml_path(str(path)))
        for integrator, stated, measured in rows:
            if np.inf in (stated, measured):
                same = stated == measured
                figures = "none | none | -" if same else f"{stated:.5g} | {measured:.5g} | differ"
            else:
                difference = measured / stated - 1.0
                worst, finite = max(worst, abs(difference)), finite + 1
                figures = f"{stated:.5g} | {measured:.5g} | {100.0 * difference:+.3f} %"
            lines.append(f"| {name} | {kind} | {integrator} | {figures} |")
    print("# Largest stable steps, predicted and measured\n")
    print(
        f"{len(MODELS)} models, {len(lines)} rows, {finite} of them with a limit; worst difference "
        f"{100.0 * worst:.2f} %. Predicted from MuJoCo's A and B and the damping each integrator "
        "takes implicitly; measured by bisection on 1000 steps of a small perturbation. MuJoCo "
        f"{mujoco.__version__}, Python {platform.python_version()}. Printed by `python "
        "tests/benchmarks/step_limits.py`.\n"
    )
    print(
        "| model | kind | integrator | predicted s | measured s | difference "
        "|\n|---|---|---|---:|---:|---:|"
    )
    print("\n".join(lines))


if __name__ == "__main__":
    main()
