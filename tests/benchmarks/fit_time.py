"""Times that README quotes: `beamchain fit` as a whole process, spec to verified chain inside one,
and a step's cost.

Run: python tests/benchmarks/fit_time.py
"""

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mujoco

import beamchain as bc

EXAMPLE = Path(bc.__file__).parent / "examples" / "seed_boom.toml"
REPEATS = 7


def median(values: list[float]) -> str:
    return (
        f"{statistics.median(values) * 1e3:8.1f} ms  ({min(values) * 1e3:.1f} to "
        f"{max(values) * 1e3:.1f})"
    )


def whole_process() -> list[float]:
    times = []
    with tempfile.TemporaryDirectory() as folder:
        for i in range(REPEATS):
            start = time.perf_counter()
            command = [
                sys.executable,
                "-m",
                "beamchain",
                "fit",
                str(EXAMPLE),
                "-o",
                f"{folder}/{i}",
            ]
            subprocess.run(command, check=True)
            times.append(time.perf_counter() - start)
    return times


def inside(modes: dict[str, int]) -> list[float]:
    times = []
    for _ in range(REPEATS + 1):
        start = time.perf_counter()
        spec = bc.read_spec(EXAMPLE)
        bc.fit(spec, modes=modes)
        times.append(time.perf_counter() - start)
    return times[1:]  # the first call imports


def step_costs() -> dict[str, float]:
    """Microseconds per step of hub and three links, per integrator."""
    model = mujoco.MjModel.from_xml_string(bc.fit(bc.read_spec(EXAMPLE)).scene_mjcf())
    data = mujoco.MjData(model)
    out = {}
    for name in ("Euler", "implicitfast", "implicit", "discrete", "RK4"):
        value = getattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}", None)
        if value is None:
            continue
        model.opt.integrator = value
        best = float("inf")
        for _ in range(5):
            mujoco.mj_resetData(model, data)
            start = time.perf_counter()
            mujoco.mj_step(model, data, 5000)
            best = min(best, time.perf_counter() - start)
        out[name] = best / 5000 * 1e6
    return out


def main() -> None:
    print(f"MuJoCo {mujoco.__version__}, medians of {REPEATS} (least to most)")
    print(f"beamchain fit, whole process:           {median(whole_process())}")
    for n in (1, 2, 3, 5):
        print(f"spec to verified chain, xy = {n}, inside: {median(inside({'xy': n}))}")
    print(
        "spec to verified chain, 3 + 3 + 2, inside: "
        f"{median(inside({'xy': 3, 'xz': 3, 'torsion': 2}))}"
    )
    costs = step_costs()
    row = ", ".join(
        f"{name} {cost:.2f} us ({cost / costs['Euler']:.2f})" for name, cost in costs.items()
    )
    print(f"a step of hub and 3 links (against Euler's): {row}")


if __name__ == "__main__":
    main()
