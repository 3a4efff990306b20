"""Prints what modal tendons cost and how the two kinds of chain behave in large motion.

Run: .venv/bin/python tests/benchmarks/modal_tendons.py [step | large | fit]

step: a step of the same bodies with springs on the hinges and with one tendon per mode.
large: spin, slews and long free runs of the recursion's chain and of an evenly cut one of the same
modes. fit: time from a beam to its verified chain, to be compared between commits.
"""

import statistics
import sys
import tempfile
import time
import warnings
from pathlib import Path

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
warnings.simplefilter("ignore")

import beamchain as bc  # noqa: E402
from arrays import deployed_array, random_array, space_beam, tube  # noqa: E402
from beamchain import BeamchainError  # noqa: E402
from beamchain.chain.build import cut_chain  # noqa: E402
from beamchain.chain.tendons import ModeGroup  # noqa: E402
from beamchain.spec import FitOptions, Root  # noqa: E402
from beamchain.steps.large_motion import large_motion  # noqa: E402
from mechanics import momentum  # noqa: E402
from random_appendages import random_appendage, toml  # noqa: E402
from spinning import FLAP, spinning  # noqa: E402

ROUNDS = 25
STEPS = 2000
HUB = bc.Hub(mass=20.0, inertia=(10.0, 10.0, 10.0), offset=(0.2, 0.0, 0.0))


def say(*words: object) -> None:
    print(*words, flush=True)


# -- cost of a step --------------------------------------------------------------------------------
def timed(models: list[mujoco.MjModel], integrator: str) -> list[float]:
    """Least time of a step of each [us], the models taken in turn."""
    best = [float("inf")] * len(models)
    kind = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    pairs = []
    for model in models:
        model.opt.integrator = kind
        pairs.append((model, mujoco.MjData(model)))
    for _ in range(ROUNDS):
        for i, (model, data) in enumerate(pairs):
            mujoco.mj_resetData(model, data)
            start = time.perf_counter()
            mujoco.mj_step(model, data, STEPS)
            best[i] = min(best[i], time.perf_counter() - start)
    return [b / STEPS * 1e6 for b in best]


def step_costs() -> None:
    say(
        "step of hub and chain: springs on the hinges, one tendon per mode on the same bodies, and "
        "the ratio"
    )
    say(
        f"{'modes':>20s} {'hinges':>6s}   "
        + "   ".join(f"{name:>26s}" for name in ("Euler", "RK4"))
    )
    beam = tube()
    kept = [{"xy": n} for n in (2, 3, 4, 5, 6)]
    kept += [{"xy": n, "xz": n} for n in (1, 2, 3, 4, 5, 6)]
    for modes in kept:
        models = []
        try:
            for springs in ("hinges", "modes"):
                result = bc.fit(
                    beam, modes=modes, root=Root(hub=HUB), options=FitOptions(springs=springs)
                )
                models.append(mujoco.MjModel.from_xml_string(result.scene_mjcf()))
        except BeamchainError as error:
            say(f"{modes!s:>20s}  {error}")
            continue
        row = f"{'+'.join(str(v) for v in modes.values()):>20s} {models[0].nv - 6:6d}   "
        for integrator in ("Euler", "RK4"):
            plain, tendons = timed(models, integrator)
            row += f"{plain:8.2f} {tendons:8.2f} us {tendons / plain:6.3f}   "
        say(row)


# -- large motion ----------------------------------------------------------------------------------
def evenly_cut(beam: bc.Beam, modes: dict[str, int], **more: object) -> bc.Fit:
    """A chain of the same modes on the cut that would be chosen if the recursion did not exist."""
    groups = []
    for port, target in bc.fit(beam, modes=modes).target.items():
        damping = np.zeros(target.modes)
        groups.append(
            ModeGroup(
                (port,),
                target.frequencies,
                target.participation,
                damping,
                target.shapes,
                rigid=target.rigid_mass,
            )
        )
    cut = cut_chain(beam.line, groups, ()).cut
    return bc.fit(
        beam, modes=modes, options=FitOptions(cuts=tuple(float(x) for x in cut.x)), **more
    )


def in_spin() -> None:
    say(
        "\nspin, eta = Omega sqrt(rho A L^4 / EI): first and second flap frequency against Wright "
        "et al. (1982)"
    )
    say(
        f"{'chain':>10s} {'n':>2s}   "
        + "   ".join(f"eta = {eta}".rjust(18) for eta in (1, 2, 5, 10))
        + "   shortest link"
    )
    for n in (1, 2, 3, 5):
        for name, make in (("recursion", bc.fit), ("cut", evenly_cut)):
            result = make(space_beam(), modes={"xy": n, "xz": n}, name="blade")
            row = f"{name:>10s} {n:2d}   "
            for eta in (1, 2, 5, 10):
                flap, _ = spinning(result, eta)
                k = min(n, 2)
                wrong = flap[:k] / np.array(FLAP[eta])[:k] - 1.0
                row += " ".join(f"{w:+8.1e}" for w in wrong).rjust(18) + "   "
            say(f"{row}{shortest(result):13.3f}")


def shortest(result: bc.Fit) -> float:
    """Shortest link over the length."""
    places = sorted({round(h.x, 9) for h in result.chain.hinges} | {0.0, result.chain.length})
    return min(b - a for a, b in zip(places[:-1], places[1:], strict=True)) / result.chain.length


def in_slew() -> None:
    say(
        "\nwhere 1 % of a chain of 60 links is left (L = EI = m = 1): spin, acceleration and "
        "angular acceleration of the root"
    )
    say(f"{'chain':>10s} {'n':>2s}   {'spin':>8s} {'accel.':>8s} {'slew':>8s}   bent by then")
    beam = space_beam()
    for n in (1, 2, 3, 4, 5):
        for name, make in (("recursion", bc.fit), ("cut", evenly_cut)):
            limit = large_motion(
                make(beam, modes={"xy": n, "xz": n}).chain, beam, "xy", modes=min(n, 2)
            )
            say(
                f"{name:>10s} {n:2d}   {limit.spin:8.3g} {limit.acceleration:8.3g} "
                f"{limit.slew:8.3g}   {limit.bent:8.3g}"
            )


def drift(
    result: bc.Fit, integrator: str, timestep: float, seconds: float
) -> tuple[float, float, float]:
    """Worst drift of energy, linear and angular momentum of a tumbling craft, relative."""
    model = mujoco.MjModel.from_xml_string(result.scene_mjcf())
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.timestep = timestep
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    data = mujoco.MjData(model)
    data.qvel[:6] = [0.02, -0.01, 0.03, 0.1, 0.2, -0.1]
    energy, moved, turned = [], [], []
    every = max(1, round(seconds / timestep / 2000))
    for _ in range(2000):
        both = momentum(model, data)
        energy.append(data.energy[0] + data.energy[1])
        moved.append(both[:3])
        turned.append(both[3:])
        mujoco.mj_step(model, data, every)
    p = np.array(moved)
    angular = np.array(turned)
    return (
        float(np.max(np.abs(np.array(energy) / energy[0] - 1.0))),
        float(np.max(np.linalg.norm(p - p[0], axis=1)) / np.linalg.norm(p[0])),
        float(np.max(np.linalg.norm(angular - angular[0], axis=1)) / np.linalg.norm(angular[0])),
    )


def free_runs() -> None:
    say(
        "\na craft of 40 kg with a soft boom tumbles freely for 2,000 s: worst drift of energy, "
        "linear and angular momentum"
    )
    section = bc.Equivalent(
        bending_stiffness_xy=6.0,
        bending_stiffness_xz=9.0,
        torsion_stiffness=8.0,
        linear_mass=0.8,
        polar_inertia=0.02,
    )
    beam = bc.Beam(segments=(bc.Segment(length=3.0, section=section),))
    root = Root(hub=bc.Hub(mass=40.0, inertia=(4.0, 6.0, 9.0), offset=(0.3, 0.1, 0.0)))
    for n in (2, 4):
        modes = {"xy": n, "xz": n, "torsion": 1}
        for name, make in (("recursion", bc.fit), ("cut", evenly_cut)):
            result = make(beam, modes=modes, root=root)
            for integrator, timestep in (("RK4", 0.02), ("Euler", 0.005)):
                words = "  ".join(f"{d:.1e}" for d in drift(result, integrator, timestep, 2000.0))
                say(f"{name:>10s} {n:2d}   {integrator:>5s} at {timestep:g} s   {words}")


# -- time to fit -----------------------------------------------------------------------------------
def fit_times() -> None:
    say("beam to verified chain inside the process, least of 7")
    cases = [("tube", tube()), ("array with two hinge lines", deployed_array())]
    cases += [(f"random array {seed}", random_array(seed)) for seed in range(8)]
    for name, beam in cases:
        row = f"{name:>28s}"
        for modes in ({"xy": 1}, {"xy": 3}, {"xy": 2, "xz": 2}, {"xy": 3, "xz": 3, "torsion": 2}):
            best = float("inf")
            try:
                for _ in range(7):
                    start = time.perf_counter()
                    bc.fit(beam, modes=modes)
                    best = min(best, time.perf_counter() - start)
                row += f" {best * 1e3:8.1f} ms"
            except BeamchainError:
                row += "     refused"
        say(row)


def shortest_links() -> None:
    say(
        "\nthe 200 random appendages of tests/support/random_appendages.py: time to fit and "
        "shortest link over the length"
    )
    short = []
    times = []
    kinds = {"hinges": 0, "modes": 0}
    for seed in range(200):
        spec = random_appendage(seed)
        text = toml(spec)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "spec.toml"
            path.write_text(text)
            start = time.perf_counter()
            result = bc.fit(bc.read_spec(path))
            times.append(time.perf_counter() - start)
        if not result.status.ok:
            say(f"seed {seed}: {result.status.message}")
        kinds["modes" if result.chain.tendons else "hinges"] += 1
        if result.chain.hinges:
            short.append((shortest(result), seed))
    short.sort()
    say(f"springs on the hinges {kinds['hinges']}, one tendon per mode {kinds['modes']}")
    say(
        "shortest: "
        + ", ".join(f"{s:.4f} (seed {k})" for s, k in short[:5])
        + f"; median {short[len(short) // 2][0]:.3f}"
    )
    say(f"time: median {statistics.median(times) * 1e3:.0f} ms, longest {max(times) * 1e3:.0f} ms")


PARTS = {
    "step": (step_costs,),
    "large": (in_spin, in_slew, free_runs),
    "fit": (fit_times, shortest_links),
}

if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        for function in PARTS[part]:
            function()
