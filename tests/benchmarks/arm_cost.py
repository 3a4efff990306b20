"""What a flexible arm costs: a step of the shipped arm over a step of the same arm rigid, by the
number of modes, and the time to embed it.

    python tests/benchmarks/arm_cost.py

Processor time, best of several rounds, flexible and rigid by turns; of the command also the
time on the clock.
"""

import resource
import subprocess
import sys
import tempfile
import time
from importlib.resources import files
from pathlib import Path

import mujoco

import beamchain as bc

SHIPPED = files("beamchain") / "examples"
ROUNDS = 9
STEPS = 4000
COUNTS = (1, 2, 3)  # modes of bending in each plane, beside one of torsion
INTEGRATORS = ("Euler", "implicitfast", "RK4")


def say(words: str) -> None:
    print(words, flush=True)


def arm(integrator, modes, **options):
    """The shipped arm with another number of modes."""
    text = (SHIPPED / "arm.xml").read_text()
    text = text.replace('integrator="Euler"', f'integrator="{integrator}"')
    specs = {}
    for place, name in (("shoulder", "upper"), ("forearm", "fore")):
        spec = bc.read_spec(SHIPPED / f"{name}.toml")
        specs[place] = spec.replace(modes=bc.Modes(xy=modes, xz=modes, torsion=1), scene=None)
    return bc.embed(text, specs, **options).model


def seconds_per_step(model):
    """Of one round."""
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.1
    mujoco.mj_step(model, data)
    start = time.process_time()
    mujoco.mj_step(model, data, STEPS)
    return (time.process_time() - start) / STEPS


def best(models):
    """Of several models, by turns."""
    rounds = [[seconds_per_step(model) for model in models] for _ in range(ROUNDS)]
    return [min(times) for times in zip(*rounds, strict=True)]


def embed_times():
    """In a process that has imported everything, and as a command, both with the proof."""
    at = {"shoulder": SHIPPED / "upper.toml", "forearm": SHIPPED / "fore.toml"}
    inside = []
    for _ in range(4):
        start = time.process_time()
        made = bc.embed(SHIPPED / "arm.xml", at)
        between = time.process_time()
        assert made.met  # the promise at every pose, and the error at the step
        inside.append((between - start, time.process_time() - start))
    outside = []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "flexible.xml"
        words = [word for place, file in at.items() for word in ("--mount", f"{place}={file}")]
        for options in ([], ["--no-report"]):
            command = [sys.executable, "-m", "beamchain", "embed", str(SHIPPED / "arm.xml"), *words]
            times = []
            for _ in range(3):
                before = resource.getrusage(resource.RUSAGE_CHILDREN)
                start = time.perf_counter()
                done = [*command, *options, "-o", str(out), "--force"]
                subprocess.run(done, check=True, capture_output=True)
                clock = time.perf_counter() - start
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
                used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
                times.append((used, clock))
            outside.append(min(times))
    return min(inside[1:]), outside


if __name__ == "__main__":
    say("step of the flexible arm over the same arm rigid")
    say(f"{'integrator':12}{'modes a plane':>14}{'nv':>5}{'flexible':>12}{'rigid':>10}{'ratio':>8}")
    for integrator in INTEGRATORS:
        for modes in COUNTS:
            flexible = arm(integrator, modes)
            rigid = arm(integrator, modes, rigid=True)
            ours, theirs = best([flexible, rigid])
            say(
                f"{integrator:12}{modes:14}{flexible.nv:5}{1e6 * ours:9.2f} us"
                f"{1e6 * theirs:7.2f} us{ours / theirs:8.2f}"
            )
    (embed, proved), (command, short) = embed_times()
    say(f"embed, everything imported: {embed:.2f} s; with its proof {proved:.2f} s")
    say(f"the whole command: {command[0]:.2f} s, on the clock {command[1]:.2f} s")
    say(f"without a report: {short[0]:.2f} s, on the clock {short[1]:.2f} s")
