"""Error against run time of the chain exact in time, beside the exact chain under RK4 and,
where installed, Exudyn.

The seed's boom on its hub, the doublet, 60 s, error as simulated. Per kind and target the cheapest
settings are looked for over a ladder of steps (a setting counts if every finer step meets the
target too); then all that were found, and the settings that docs/accuracy.md names, are timed in
turns in this process, each run after one untimed run of the same, and medians are printed.

Run: python tests/benchmarks/time_exact.py [--other NAME SCENE.xml INTEGRATOR STEP]...
with Exudyn: PYTHONPATH=generator build/peers/venv/bin/python -W ignore
tests/benchmarks/time_exact.py (after make bench-peers)
"""

import argparse
import statistics
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

PEERS = Path(__file__).parent / "peers"
sys.path[:0] = [str(PEERS), str(Path(__file__).parents[1] / "support")]

from task import SCENARIO, TASK  # noqa: E402

from beamchain.engine.rollout import seconds_of, simulate  # noqa: E402
from beamchain.studies import field  # noqa: E402
from beamchain.studies.field import TIMED, Entry  # noqa: E402
from beamchain.studies.pareto import TARGETS, power  # noqa: E402
from beamchain.studies.run_time import steps_below  # noqa: E402
from mechanics import compiled as compile_model  # noqa: E402

ROUNDS = 41
TRIED = 3  # cheapest settings of a kind and target that are timed in turns
CHAIN = "exact chain, RK4"
# n and step [s] of the model exact in time
NAMED = ((2, 1.0), (3, 0.5), (4, 0.25), (5, 0.125), (6, 0.125))
SIZES = range(1, 7)


class Setting(NamedTuple):
    """One model at one step.

    Args:
        kind, n, step: what it is; step [s].
        error: as simulated.
        run: simulates 60 s, returns the time of the simulation alone [s].
    """

    kind: str
    n: int
    step: float
    error: float
    run: Callable[[], float]


def ours(kind: str, model: Any, n: int, integrator: str, h: float, wrench: np.ndarray) -> Setting:
    error = SCENARIO.error(simulate(model, integrator, h, wrench).motion, h)
    return Setting(kind, n, h, error, lambda: seconds_of(model, integrator, h, wrench))


def of_field(kind: str, entry: Entry, h: float) -> Setting:
    wrench = entry.fed(SCENARIO.profile.mean(h, round(SCENARIO.duration / h)))
    return ours(kind, field.model_of(TASK, entry, h), entry.n, entry.integrator, h, wrench)


def ladder_of(kind: str, entry: Entry) -> list[Setting]:
    return [
        of_field(kind, entry, h) for h, _ in steps_below(SCENARIO, field.largest_step(TASK, entry))
    ]


def peer_ladder(peer: Any, fastest: float) -> list[Setting]:
    out: list[Setting] = []
    for h, _ in steps_below(SCENARIO, 2.7 / fastest):
        angle, _ = peer.run(h, True)
        if angle is None or not np.all(np.isfinite(angle)):
            continue
        motion = np.zeros((angle.size, 6))
        motion[:, 5] = angle
        out.append(
            Setting(
                peer.model, peer.n, h, SCENARIO.error(motion, h), lambda h=h: peer.run(h, False)[1]
            )
        )
    return out


def meeting(ladder: list[Setting], target: float) -> Setting | None:
    """The largest step of a ladder that meets the target together with every finer one."""
    found, worst = None, 0.0
    for setting in sorted(ladder, key=lambda s: s.step):
        worst = max(worst, setting.error)
        if worst <= target:
            found = setting
    return found


def cheapest(ladders: list[list[Setting]], target: float) -> list[Setting]:
    """The settings of a kind that may be the fastest to a target, by a first timing."""
    found = [s for s in (meeting(ladder, target) for ladder in ladders) if s is not None]
    first = {id(s): min(s.run() for _ in range(5)) for s in found}
    return sorted(found, key=lambda s: first[id(s)])[:TRIED]


def in_turns(settings: list[Setting]) -> list[float]:
    """Median time of each [s]."""
    times: list[list[float]] = [[] for _ in settings]
    for _ in range(ROUNDS):
        for taken, setting in zip(times, settings, strict=True):
            setting.run()
            taken.append(setting.run())
    return [statistics.median(t) for t in times]


def field_of_all() -> dict[str, list[list[Setting]]]:
    """Per kind, the ladders of its sizes; the model exact in time first."""
    out = {
        TIMED: [ladder_of(TIMED, Entry(TIMED, n, "Euler")) for n in SIZES],
        CHAIN: [ladder_of(CHAIN, Entry("exact, hub", n, "RK4")) for n in SIZES],
    }
    if find_spec("exudyn") is None:
        print("Exudyn is not installed here; make bench-peers makes an environment with it.")
        return out
    from exudyn_peers import floating, modal

    w = TASK.full["xy"].with_hub(TASK.hub.mass_matrix()[np.ix_([1, 5], [1, 5])]).free_frequencies
    for make in (modal, floating):
        ladders = [peer_ladder(make(n), float(w[n - 1])) for n in SIZES]
        out[next(s.kind for ladder in ladders for s in ladder)] = ladders
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--other",
        nargs=4,
        action="append",
        default=[],
        metavar=("NAME", "XML", "INTEGRATOR", "STEP"),
        help="a scene of another version, the hub's free joint first, to be timed in the same "
        "turns",
    )
    given = parser.parse_args()
    kinds = field_of_all()
    chosen: dict[tuple[str, float], list[Setting]] = {}
    for kind, ladders in kinds.items():
        for target in TARGETS:
            chosen[kind, target] = cheapest(ladders, target)
    named = [of_field(TIMED, Entry(TIMED, n, "Euler"), h) for n, h in NAMED]
    others = []
    for name, path, integrator, step in given.other:
        h = float(step)
        wrench = SCENARIO.profile.mean(h, round(SCENARIO.duration / h))
        others.append(ours(name, compile_model(Path(path)), 0, integrator, h, wrench))
    settings = [*named, *others, *(s for group in chosen.values() for s in group)]
    seconds = {id(s): t for s, t in zip(settings, in_turns(settings), strict=True)}
    print(f"{TIMED}, as simulated, {SCENARIO.duration:g} s; medians of {ROUNDS} runs in turns")
    for s in named:
        print(f"  n = {s.n}, h = {s.step:g} s: error {s.error:.2e}, {1e3 * seconds[id(s)]:.3f} ms")
    for s in others:
        print(f"{s.kind}, h = {s.step:g} s: error {s.error:.2e}, {1e3 * seconds[id(s)]:.3f} ms")
    for target in TARGETS:
        print(f"to {power(target)}")
        base = None
        for kind in [*kinds, *dict.fromkeys(s.kind for s in others)]:
            group = chosen.get((kind, target)) or [
                s for s in others if s.kind == kind and s.error <= target
            ]
            best = min(group, key=lambda s: seconds[id(s)], default=None)
            if best is None:
                print(f"  {kind:22} never")
                continue
            base = base or seconds[id(best)]
            ratio = seconds[id(best)] / base
            print(
                f"  {kind:22} n = {best.n}, h = {best.step:.4g} s: error {best.error:.2e}, "
                f"{1e3 * seconds[id(best)]:.3f} ms, {ratio:.2f} times ours, ours {1.0 / ratio:.3f} "
                "of it"
            )


if __name__ == "__main__":
    main()
