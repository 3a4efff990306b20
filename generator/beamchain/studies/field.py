"""The field of a study: models of the same appendage on the same hub, the package's and rivals."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from lxml import etree

from beamchain.chain import baselines
from beamchain.chain.build import BuildOptions, Built, build_exact, with_real_polar
from beamchain.chain.chain import Chain
from beamchain.chain.tendons import damped_modes, joint_damping
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model
from beamchain.errors import RealisationError
from beamchain.fitting.hub import Hub
from beamchain.fitting.options import Target
from beamchain.mjcf import write
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, Array
from beamchain.steps.integrators import PHASE, map_modes
from beamchain.steps.retime import retime_by
from beamchain.structure.beam import Beam

TIMED = "exact in time"
# largest n
OURS = {TIMED: 6, "exact, hub": 6, "exact, clamped": 6, "exact, free": 6}
EQUAL = {"equal links, midpoint": "midpoint", "equal links, classical": "classical"}
EQUAL_COUNTS = (3, 5, 7, 10, 14, 20, 24, 27, 30, 40, 57, 80, 95, 113)
PAPER = "paper's 3 links"
RIGID_HUB = "rigid hub"
INTEGRATORS = ("Euler", "implicitfast", "RK4", "discrete")
DAMPED = 6  # first modes of a rival that get a damping tendon
MARGIN = 0.97  # of the stability limit: the largest step tried
# a model exact in time is tried up to this many times the step from which its
# fastest mode is slowed
BEYOND = 2.0


class Entry(NamedTuple):
    """One competitor: a model, its size and an integrator; its steps are found by the study."""

    model: str
    n: int
    integrator: str

    @property
    def ours(self) -> bool:
        """Made by this package's own methods."""
        return self.model in OURS

    @property
    def timed(self) -> bool:
        """Made for one step, at which every sampled position is exact;
        fed with the mean of this and the last wrench."""
        return self.model == TIMED

    def fed(self, wrench: Array) -> Array:
        """What the model is given in each step of a wrench `(t, 6)` that is constant over each."""
        if not self.timed:
            return wrench
        before = np.vstack([np.zeros((1, 6)), wrench[:-1]])
        return (wrench + before) / 2.0  # as HeldInput does, step by step


@dataclass(frozen=True, eq=False)
class Task:
    """What every model is made from."""

    beam: Beam
    full: dict[str, PortModel]  # all its modes per kept port, with damping ratios
    kept: dict[str, int]  # modes per port in the spec; the planes' numbers are what a study varies
    hub: Hub
    tendons: bool = True  # damping as tendons, not in the hinges

    @property
    def planes(self) -> list[str]:
        """Bending planes kept."""
        return [port for port in ("xy", "xz") if port in self.kept]


def entries(task: Task) -> list[Entry]:
    """Everything that can be built for this appendage, cheapest first within each model."""
    out = [Entry(RIGID_HUB, 0, integrator) for integrator in INTEGRATORS]
    for model, most in OURS.items():
        integrators = ("Euler",) if model == TIMED else INTEGRATORS
        out += [Entry(model, n, i) for i in integrators for n in range(1, most + 1)]
    if not task.planes:
        return out
    if task.beam.uniform and len(task.kept) == 1:
        out += [Entry(PAPER, 2, integrator) for integrator in INTEGRATORS]
    for model in EQUAL:
        out += [Entry(model, n, i) for i in INTEGRATORS for n in EQUAL_COUNTS]
    return out


def largest_step(task: Task, entry: Entry) -> float:
    """Largest step worth trying, a little below the stability limit on this hub [s];
    infinity: none.

    A model exact in time is stable at every step;
    it is tried from steps at which the fastest mode of every port is slowed.
    """
    if entry.model == RIGID_HUB or entry.integrator == "discrete":
        return float("inf")
    if entry.timed:
        _, targets = _build(task, entry)
        fastest = [m.last_on_hub(_hub_of(task, port)) for port, m in targets.items()]
        return BEYOND * PHASE / min(fastest)
    chain = chain_of(task, entry)
    ports = {port: chain.port(port) for port in chain.ports}
    coupled = model_in_space(ports, chain.rigid_mass() + task.hub.mass_matrix())
    ratio = max((float(np.max(task.full[p].damping, initial=0.0)) for p in ports), default=0.0)
    on_tendons = any(t.damping > 0.0 for t in chain.tendons)
    mode = map_modes(entry.integrator, 1.0, 2.0 * ratio, 1.0, 1.0, tendon=on_tendons)
    return MARGIN * mode.largest_step() / float(coupled.free_frequencies[-1])


def model_of(task: Task, entry: Entry, timestep: float = 0.0) -> "mujoco.MjModel":
    """The compiled scene of an entry: a free-flying hub with the appendage, nothing drawn.

    The link welded to the hub becomes part of it when compiled (`fusestatic`), for rivals too. A
    model exact in time is made for the timestep [s]; the others are the same at every step.
    """
    if entry.model == RIGID_HUB:
        return compile_model(scene_text(task.hub, rigid_chain(task.beam)))
    model = compile_model(scene_text(task.hub, chain_of(task, entry)))
    if entry.timed:
        retime_by(4, model, timestep, entry.integrator)
    return model


def scene_text(hub: Hub, chain: Chain) -> str:
    """The scene of a chain on the hub as MJCF text, without what costs time and moves nothing."""
    tree = write.appendage_document(chain, "appendage", visuals=False, sites={})
    root: Any = write.scene_document(
        tree,
        "appendage",
        mass=hub.mass,
        inertia=hub.inertia_matrix(),
        offset=hub.offset,
        timestep=0.01,
        integrator="Euler",
    )
    for tag in ("geom", "site", "light"):
        for element in root.findall(f".//worldbody//{tag}"):
            element.getparent().remove(element)
    root.insert(0, etree.Element("compiler", fusestatic="true"))
    return write.document_text(root)


def rigid_chain(beam: Beam) -> Chain:
    """The appendage as one rigid link."""
    rigid = Chain((baselines.rigid_link(beam.line, 0.0, beam.length),), (), beam.length)
    return with_real_polar(rigid)


@lru_cache(maxsize=8)
def chain_of(task: Task, entry: Entry) -> Chain:
    """The chain of an entry, damped; kept, because every step of a ladder asks for it."""
    chain, targets = _build(task, entry)
    if any(t.stiffness > 0.0 for t in chain.tendons):
        return chain  # each mode has its damping already
    for port in chain.ports:
        ratios = task.full[port].damping
        if not np.any(ratios > 0.0):
            continue
        # plain joint damping would starve the first modes of a chain of many links
        if task.tendons:
            chain = damped_modes(
                chain, {port: targets[port].damping if port in targets else ratios[:DAMPED]}
            )
        else:
            chain = joint_damping(chain, port, np.resize(ratios, max(len(chain.hinges), 1)))
    return chain


def sizes(kept: Mapping[str, int], n: int) -> dict[str, int]:
    """Modes per port of a model of size n: in the planes, where any is kept."""
    varied = {"xy", "xz"} & kept.keys() or kept.keys()
    return {port: n if port in varied else count for port, count in kept.items()}


def target_of(model: str) -> Target:
    """The modes that one of our models keeps."""
    words: dict[str, Target] = {TIMED: "hub", "exact, hub": "hub", "exact, free": "free"}
    return words.get(model, "clamped")


def _build(task: Task, entry: Entry) -> tuple[Chain, Mapping[str, PortModel]]:
    beam = task.beam
    kept = sizes(task.kept, entry.n)
    if entry.model in OURS:
        built = _build_own(task, entry, kept)
        short = {
            port: target.modes
            for port, target in built.targets.items()
            if target.modes < kept[port]
        }
        if short:
            raise RealisationError(
                f"{entry.model}: no chain with {entry.n} modes; {' '.join(built.missing)}"
            )
        return built.chain, built.targets
    port = task.planes[0]
    if entry.model == PAPER:
        free = beam.port(port, 4).free_frequencies
        k, c = baselines.seed_parameters(
            float(beam.rigid_mass()[0, 0]), beam.length, float(free[0]), float(free[1])
        )
        return with_real_polar(baselines.seed_chain(beam, k, c, port)), {}
    bending = [p for p in kept if p != "axial"]
    chains = [baselines.equal_links(beam, entry.n, EQUAL[entry.model], p) for p in bending]
    hinges = tuple(
        replace(
            hinge,
            stiffness={p: c.hinges[i].stiffness[p] for p, c in zip(bending, chains, strict=True)},
        )
        for i, hinge in enumerate(chains[0].hinges)
    )
    # a short piece of a wide panel, frozen, has more polar inertia than a thin body can have:
    # it gets what it can
    links = tuple(
        replace(link, inertia=(min(x, (1.0 - 1e-9) * (y + z)), y, z))
        for link in chains[0].links
        for x, y, z in (link.inertia,)
    )
    return with_real_polar(replace(chains[0], hinges=hinges, links=links)), {}


def _hub_of(task: Task, port: str) -> Array:
    """The hub's mass matrix in the motions of a port."""
    return PORT_MOTION[port].T @ task.hub.mass_matrix() @ PORT_MOTION[port]


def _build_own(task: Task, entry: Entry, kept: dict[str, int]) -> Built:
    def target(port: str, count: int) -> PortModel:
        full = task.full[port]
        out = full.for_target(target_of(entry.model), count, _hub_of(task, port))
        return out.replaced(damping=full.damping[: out.modes])

    has_damping = any(np.any(task.full[port].damping > 0.0) for port in kept)
    if entry.timed:  # armature and damping of the modes stand on their tendons
        wishes = BuildOptions(springs="modes", per_mode=has_damping)
    else:
        wishes = BuildOptions(per_mode=has_damping and task.tendons)
    return build_exact(task.beam.line, kept, target, wishes)
