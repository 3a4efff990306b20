"""What leaving out saves: the model a scene gets,
beside the one that leaves nothing out and the classical chain within the same tolerance.

Everything in one run: bodies, joints, degrees of freedom, time per step (all models of a scene in
turns, medians) and the largest stable step. The classical chain is the recipe EI N/L with 2 EI N/L
at the root, hinged in the ports that the chosen model keeps; its number of segments is the least
within the tolerance that a search finds.

Run: python tests/benchmarks/savings.py
"""

import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import msgspec
import mujoco

import beamchain as bc
from beamchain.chain.baselines import equal_links
from beamchain.chain.chain import Chain, Hinge
from beamchain.fitting.body import body_of
from beamchain.fitting.document import appendage_tree
from beamchain.fitting.hub import default_hub
from beamchain.fitting.needs import FAR
from beamchain.mjcf import write
from beamchain.ports.compose import model_in_space

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from every_mode import everything

EXAMPLES = Path(bc.__file__).parent / "examples"
MOST = 494  # segments: MuJoCo nests 496 bodies, hub and root among them
ROUNDS, SECONDS = 15, 0.02  # of every model in turns, so long each
PLANES = ("xy", "xz")


class Model(NamedTuple):
    """A model to be timed: its scene, in-band error,
    and largest stable step of implicitfast [s]."""

    scene: str
    error: float
    step: float


def scene(
    bandwidth: float,
    tolerance: float = 1e-3,
    axes: tuple[str, ...] = ("x", "y", "z", "tx", "ty", "tz"),
) -> bc.Scene:
    return msgspec.convert({"bandwidth": bandwidth, "tolerance": tolerance, "axes": axes}, bc.Scene)


def scenes() -> dict[str, bc.Spec]:
    """Six scenes: the seed's boom twice, the shipped examples, a light hub with a wide band."""
    boom, mast, array = (
        bc.read_spec(EXAMPLES / f"{n}.toml")
        for n in ("seed_boom", "instrument_mast", "array_uncertain")
    )
    bare = {"modes": None, "uncertain": None}
    tube = bc.Segment(
        length=3.0,
        section=bc.Tube(outer_diameter=0.03, wall=0.001),
        material=bc.Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33),
    )
    light = bc.spec.Root(hub=bc.Hub(mass=4.0, inertia=(0.05, 0.06, 0.07), offset=(0.1, 0.0, 0.0)))
    chooses = msgspec.structs.replace
    free = bc.spec.Root(hub=boom.root.hub)
    return {
        "seed boom, z, 3 rad/s, 1e-3": chooses(
            boom, **bare, root=free, scene=scene(3.0, axes=("z",))
        ),
        "seed boom, all axes, 5 rad/s, 1e-4": chooses(
            boom, **bare, root=free, scene=scene(5.0, 1e-4)
        ),
        "array_scene as shipped (z, 5 rad/s, 1e-3)": bc.read_spec(EXAMPLES / "array_scene.toml"),
        "array, all axes, 20 rad/s, 1e-3": chooses(
            array, **bare, root=bc.spec.Root(hub=array.root.hub), scene=scene(20.0)
        ),
        "mast with its instrument, all axes, 10 rad/s, 1e-3": chooses(
            mast, **bare, scene=scene(10.0)
        ),
        "tube on a 4 kg hub, y and z, 200 rad/s, 1e-2": bc.Spec(
            segment=(tube,), root=light, scene=scene(200.0, 1e-2, ("y", "z"))
        ),
    }


def classical(spec: bc.Spec, ports: list[str], count: int) -> Chain:
    """Equal links, hinged in every one of `ports`."""
    planes = [port for port in ports if port in PLANES] or ["xy"]
    chains = {port: equal_links(spec.beam, count, "classical", port) for port in planes}
    first = chains[planes[0]]
    step = spec.beam.length / count
    hinges: list[Hinge] = []
    for i, hinge in enumerate(first.hinges):
        springs = {port: chain.hinges[i].stiffness[port] for port, chain in chains.items()}
        if "torsion" in ports:
            springs["torsion"] = 1.0 / spec.beam.compliance(
                max(i - 0.5, 0.0) * step, (i + 0.5) * step, "torsion"
            )
        hinges.append(replace(hinge, stiffness=springs))
    return replace(first, hinges=tuple(hinges))


def rival(spec: bc.Spec, ports: list[str]) -> tuple[int, float]:
    """The least number of segments within the tolerance, and the error;
    the most there can be where none is within."""
    assert spec.scene is not None
    assert spec.scene.bandwidth is not None
    assert spec.root.hub is not None
    tolerance = spec.scene.tolerance
    band = spec.scene.bandwidth
    promise = body_of(spec).promise
    assert promise is not None
    known: dict[int, float] = {}

    def error(count: int) -> float:
        if count not in known:
            chain = classical(spec, ports, count)
            models = {p: spec.with_ratios(p, chain.port(p)).condensed(FAR * band) for p in ports}
            known[count] = promise.error(model_in_space(models, promise.exact.rigid_mass))
        return known[count]

    high = 2
    while error(high) > tolerance:
        if high == MOST:
            return high, known[high]
        high = min(2 * high, MOST)
    low = high // 2
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if error(middle) <= tolerance else (middle, high)
    return high, known[high]


def rival_model(spec: bc.Spec, ports: list[str], count: int, error: float) -> Model:
    """The classical chain in its scene; where a short wide link is no body,
    its polar inertia is cut to what is."""
    chain = classical(spec, ports, count)
    links = []
    for link in chain.links:
        ix, iy, iz = link.inertia
        links.append(
            replace(
                link,
                inertia=(min(max(ix, abs(iz - iy) * (1.0 + 1e-9), 1e-6 * iz), iy + iz), iy, iz),
            )
        )
    chain = replace(chain, links=tuple(links))
    hub = spec.root.hub or default_hub(spec.beam.line)
    assert spec.scene is not None
    text = write.document_text(
        write.scene_document(
            appendage_tree(spec, chain),
            spec.name,
            mass=hub.mass,
            inertia=hub.inertia_matrix(),
            offset=hub.offset,
            timestep=spec.scene.timestep or 0.002,  # MuJoCo's own
            integrator=spec.scene.integrator,
        )
    )
    space = model_in_space({port: chain.port(port) for port in ports}, chain.rigid_mass()).with_hub(
        hub.mass_matrix()
    )
    return Model(text, error, 2.0 / float(space.free_frequencies[-1]))


def own(fit: bc.Fit) -> Model:
    return Model(fit.scene_mjcf(), fit.promise or 0.0, fit.limits.largest_step["implicitfast"])


def times(models: list["mujoco.MjModel"]) -> list[float]:
    """Median time per step of each model [s], in turns."""
    states = [mujoco.MjData(model) for model in models]
    counts: list[int] = []
    for model, state in zip(models, states, strict=True):
        # stable for the stiffest; a step costs the same whatever its length
        model.opt.timestep = 1e-6
        start = time.perf_counter()
        mujoco.mj_step(model, state, 50)
        counts.append(max(int(SECONDS * 50 / (time.perf_counter() - start)), 5))
    taken: list[list[float]] = [[] for _ in models]
    for _ in range(ROUNDS):
        for i, (model, state) in enumerate(zip(models, states, strict=True)):
            start = time.perf_counter()
            mujoco.mj_step(model, state, counts[i])
            taken[i].append((time.perf_counter() - start) / counts[i])
    return [statistics.median(t) for t in taken]


def rows(spec: bc.Spec) -> list[list[str]]:
    """A table row per model: the chosen one in numbers, the others over it."""
    assert spec.scene is not None
    chosen = bc.fit(spec)
    full = bc.fit(everything(spec))
    assert chosen.choice is not None
    ports = [port for port, count in chosen.choice.modes.items() if count]
    count, error = rival(spec, ports)
    missed = error > spec.scene.tolerance
    keeps = ", ".join(f"{n} {port}" for port, n in chosen.choice.modes.items() if n)
    models = {
        f"chosen: {keeps}": own(chosen),
        f"everything: {', '.join(f'{t.modes} {port}' for port, t in full.target.items())}": own(
            full
        ),
        f"classical, {'none within: ' if missed else ''}N = {count}": rival_model(
            spec, ports, count, error
        ),
    }
    compiled = [mujoco.MjModel.from_xml_string(model.scene) for model in models.values()]
    seconds = times(compiled)
    out: list[list[str]] = []
    for (label, model), built, cost in zip(models.items(), compiled, seconds, strict=True):
        sizes = [built.nbody - 2, built.njnt - 1, built.nv - 6]
        if not out:
            first, base, step = sizes, cost, model.step
            shown = [*map(str, sizes), f"{cost * 1e6:.2f} us", f"{model.step:.3g} s", ""]
        else:
            shown = [f"x {a / max(b, 1):.3g}" for a, b in zip(sizes, first, strict=True)]
            shown += [
                f"x {cost / base:.3g}",
                f"/ {step / model.step:.3g}",
                f"x {cost / base * step / model.step:.3g}",
            ]
        out.append([label, *shown, f"{model.error:.1e}"])
    return out


def main() -> None:
    print(f"MuJoCo {mujoco.__version__}, medians of {ROUNDS} rounds in turns")
    print()
    head = [
        "scene",
        "model",
        "bodies",
        "joints",
        "nv",
        "time per step",
        "stable step",
        "time at it",
        "in-band error",
    ]
    print(f"| {' | '.join(head)} |")
    print("|" + "---|" * len(head))
    for name, spec in scenes().items():
        for i, row in enumerate(rows(spec)):
            print(f"| {' | '.join([name if i == 0 else '', *row])} |", flush=True)


if __name__ == "__main__":
    main()
