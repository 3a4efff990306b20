"""From targets to one chain: which realisation is tried, what is done where it fails, and what is said of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Self

import numpy as np

from beamchain.chain import polar, rivals
from beamchain.chain.assemble import assemble, hinges_at
from beamchain.chain.chain import Chain, Hinge
from beamchain.chain.least_squares import fit_planar, fit_stiffness, payload_cases
from beamchain.chain.realise import Nodes, planar_links, realise, realise_scalar
from beamchain.chain.rods import Payload
from beamchain.chain.tip import tip_exact
from beamchain.errors import InputError, RealisationError
from beamchain.motion import Array
from beamchain.port import PortModel
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine

#: Target with the given number of modes of a port.
TargetOf = Callable[[str, int], PortModel]

PLANES = ("xy", "xz")
LOST_DIGITS = 1e-8  # a chain whose own frequencies miss the target by more is not handed out


@dataclass(frozen=True)
class Status:
    """What became of a fit.

    Args:
        ok: everything asked for was reached.
        message: what was made, in a sentence or two.
        history: what was tried, in order.
    """

    ok: bool
    message: str
    history: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Built:
    """A chain, the targets it was made for, and how it came about."""

    chain: Chain
    targets: dict[str, PortModel]
    status: Status


def build_exact(beam: MassLine, kept: Mapping[str, int], target_of: TargetOf, *, tip: bool = False) -> Built:
    """The exact chain of all kept ports; where it is not physical, the nearest that is, said so in the status.

    Args:
        beam: the appendage.
        kept: modes per port.
        target_of: target with a number of modes.
        tip: match the tip displacement of the planes' modes too.
    """
    if not kept:
        return _rigid(beam)
    attempt = _Attempt.start(beam, kept, target_of, tip)
    found: tuple[Chain, str] | None = None
    while found is None:
        try:
            found = assemble(beam, attempt.nodes, attempt.strings)
        except RealisationError as error:
            attempt.history.append(str(error))
            if not attempt.less_torsion(error):
                found = attempt.morehinges() if attempt.lopsided else attempt.one_plane_exact(error)
    return attempt.built(*found)


def _rigid(beam: MassLine) -> Built:
    """The appendage as one body."""
    link = rivals.rigid_link(beam, 0.0, beam.length)
    [polars] = polar.share([link], [link.inertia[0]], [[0]], np.array([link.inertia[0]]))
    chain = Chain((polar.with_polar([link], [polars])[0],), (), beam.length)
    return Built(chain, {}, Status(True, "one rigid body."))


@dataclass(eq=False)
class _Attempt:
    """The ports realised one by one, and what is done where no bodies satisfy all of them together.

    Args:
        beam: the appendage.
        kept: modes per port asked for.
        target_of: target with a number of modes.
        tip: match the tip displacement of the planes' modes too.
        targets: per port, what is aimed at.
        nodes: per plane, its canonical chain.
        strings: per scalar port, its inertias and springs.
        history: what was tried, in order.
        notes: where less comes out than was asked for.
        extra: a sentence on what comes out beyond it.
        fewer: a port has fewer modes than were asked for, as more are not physical.
    """

    beam: MassLine
    kept: Mapping[str, int]
    target_of: TargetOf
    tip: bool
    targets: dict[str, PortModel] = field(default_factory=dict[str, PortModel])
    nodes: dict[str, Nodes] = field(default_factory=dict[str, Nodes])
    strings: dict[str, tuple[Array, Array]] = field(default_factory=dict[str, tuple[Array, Array]])
    history: list[str] = field(default_factory=list[str])
    notes: list[str] = field(default_factory=list[str])
    extra: str = ""
    fewer: bool = False
    _evened: bool = False

    @classmethod
    def start(cls, beam: MassLine, kept: Mapping[str, int], target_of: TargetOf, tip: bool) -> Self:
        """Every port by itself, with as many modes as are physical."""
        self = cls(beam, kept, target_of, tip)
        for port, count in kept.items():
            if port in PLANES:
                self.targets[port], self.nodes[port] = _plane(beam, port, count, target_of, self.history, tip)
            else:
                self.targets[port] = target_of(port, count)
                self.strings[port] = realise_scalar(self.targets[port])
        self.notes = [
            f"{port} keeps {self.targets[port].modes} of the {count} modes asked for"
            for port, count in kept.items()
            if self.targets[port].modes < count
        ]
        self.fewer = bool(self.notes)
        return self

    def less_torsion(self, error: RealisationError) -> bool:
        """One torsion mode fewer, where the links do not hold the polar inertias."""
        torsion = self.targets.get("torsion")
        if torsion is None or torsion.modes <= 1 or "polar inertia" not in str(error):
            return False
        self.targets["torsion"] = self.target_of("torsion", torsion.modes - 1)
        self.strings["torsion"] = realise_scalar(self.targets["torsion"])
        self.notes = [note for note in self.notes if not note.startswith("torsion")]
        self.notes.append(f"torsion keeps {torsion.modes - 1} of the {self.kept['torsion']} modes asked for: {error}")
        return True

    @property
    def lopsided(self) -> bool:
        """Whether one plane has fewer hinges than the other, and has not been given as many yet."""
        return not self._evened and len({nodes.stiffness.size for nodes in self.nodes.values()}) == 2

    def morehinges(self) -> tuple[Chain, str] | None:
        """As many hinges in both planes: more than needed is no worse, and shared hinges or other cuts may do."""
        self._evened = True
        least = min(self.nodes, key=lambda port: self.nodes[port].stiffness.size)
        most = max(nodes.stiffness.size for nodes in self.nodes.values())
        saved = self.targets[least], self.nodes[least]
        try:
            self.targets[least], self.nodes[least] = _plane(self.beam, least, most, self.target_of, [], self.tip)
            found = assemble(self.beam, self.nodes, self.strings)
        except RealisationError:
            self.targets[least], self.nodes[least] = saved
            return None
        self.extra = f" {least} keeps {self.targets[least].modes} modes: with {self.kept[least]} no bodies exist."
        return found

    def one_plane_exact(self, error: RealisationError) -> tuple[Chain, str]:
        """The plane with more modes exact, the other by least squares; raises the error where there is one plane."""
        if len(self.nodes) < 2:
            raise error
        chain, how, miss = _second_by_least_squares(self.beam, self.nodes, self.strings, self.targets)
        self.notes.append(f"{error} The second plane is fitted by least squares: worst relative residual {miss:.1e}")
        return chain, how

    def built(self, chain: Chain, how: str) -> Built:
        """The chain with its status."""
        modes = ", ".join(f"{target.modes} in {port}" for port, target in self.targets.items())
        message = f"exact chain ({how}), modes kept: {modes}.{self.extra}"
        if self.notes:
            reasons = f" {self.history[0]}" if self.history and self.fewer else ""
            message = f"{message} {'; '.join(self.notes)}.{reasons}"
        return Built(chain, self.targets, Status(not self.notes, message, tuple(self.history)))


def _plane(
    beam: MassLine, port: str, count: int, target_of: TargetOf, history: list[str], tip: bool
) -> tuple[PortModel, Nodes]:
    """Target and canonical chain of a plane, with as many of `count` modes as are physical."""
    for modes in range(count, 0, -1):
        try:
            target = target_of(port, modes)
            nodes = realise(target)
            probe = Chain(
                tuple(planar_links(nodes, beam)), hinges_at(nodes.positions[1:-1], {port: nodes}, {}), beam.length
            )
            miss = float(np.max(np.abs(probe.port(port).frequencies / target.frequencies - 1.0)))
            if miss > LOST_DIGITS:
                raise RealisationError(f"digits are lost with {modes} modes: a frequency is off by {miss:.1e}.")
        except RealisationError as error:
            history.append(f"{port}, {modes} modes: {error}")
            continue
        return target, _with_tip(nodes, target, beam, f"{port}, {modes} modes", history) if tip else nodes
    raise RealisationError(f"no exact chain exists for this appendage in {port}: {history[-1]}")


def _with_tip(nodes: Nodes, target: PortModel, beam: MassLine, label: str, history: list[str]) -> Nodes:
    """The chain that also carries the tip's motion, where its bodies are physical."""
    try:
        found = tip_exact(nodes, target, beam.length)
        planar_links(found, beam)
    except RealisationError as error:
        history.append(f"{label}: the tip's motion is not matched: {error}")
        return nodes
    return found


def _second_by_least_squares(
    beam: MassLine,
    nodes: Mapping[str, Nodes],
    strings: Mapping[str, tuple[Array, Array]],
    targets: Mapping[str, PortModel],
) -> tuple[Chain, str, float]:
    """The plane with more modes exact, the other by least squares on its springs."""
    first = max(nodes, key=lambda port: nodes[port].stiffness.size)
    second = next(port for port in nodes if port != first)
    chain, how = assemble(beam, {first: nodes[first]}, strings)
    edges = [0.0, *(h.x for h in chain.hinges), beam.length]
    start = np.array([1.0 / beam.compliance(a, b, second) for a, b in zip(edges[:-2], edges[2:], strict=True)]) * 2.0
    chain, miss = fit_stiffness(chain, second, targets[second], start)
    return chain, f"{how} for {first}", miss


def build_least_squares(
    beam: Beam,
    kept: Mapping[str, int],
    links: Array,
    free: tuple[str, ...],
    payload: Mapping[str, Payload] | None,
    target_of: TargetOf,
) -> Built:
    """A chain by least squares: the plane with most modes decides the links, the other ports get springs on them.

    Args:
        beam: the appendage.
        kept: modes per port.
        links: `(N,)` lengths to start from or to keep [m].
        free: "stiffness", "lengths", "masses".
        payload: per plane, what the scene will attach at the tip.
        target_of: target with a number of modes.

    Raises:
        InputError: axial modes are asked for, or fewer hinges than modes.
    """
    planes = [port for port in kept if port in PLANES]
    if not planes or "axial" in kept:
        raise InputError('method = "least_squares" needs modes in a bending plane and takes none in axial.')
    if links.size - 1 < max(kept.values()):
        raise InputError(
            f"fit.links gives {links.size - 1} hinges, fewer than the {max(kept.values())} modes kept; give more links."
        )
    first = max(planes, key=lambda port: kept[port])
    cases = payload_cases(beam, first, kept[first], None if payload is None else payload[first])
    found = fit_planar(beam, first, cases, links, free)
    if found.nodes is not None:
        pieces = planar_links(found.nodes, beam)
    else:
        edges = [0.0, *found.positions.tolist(), beam.length]
        pieces = [rivals.rigid_link(beam, a, b) for a, b in pairwise(edges)]
    real = polar.real_polar(beam, found.positions)
    if found.nodes is not None:
        _, polars = polar.place(beam, pieces, found.positions, np.array([real.sum()]), real)
        pieces = polar.with_polar(pieces, polars)
    hinges = tuple(
        Hinge(x=float(x), stiffness={first: float(c)}) for x, c in zip(found.positions, found.stiffness, strict=True)
    )
    chain = Chain(tuple(pieces), hinges, beam.length)
    targets = {first: target_of(first, kept[first])}
    notes = [f"{first}: {found.message}"]
    edges = [0.0, *found.positions.tolist(), beam.length]
    for port in kept:
        if port == first:
            continue
        targets[port] = target_of(port, kept[port])
        start = np.array([2.0 / beam.compliance(a, b, port) for a, b in zip(edges[:-2], edges[2:], strict=True)])
        chain, miss = fit_stiffness(chain, port, targets[port], start)
        notes.append(f"{port}: springs by least squares, worst relative residual {miss:.2e}.")
    return Built(chain, {port: targets[port] for port in kept}, Status(found.ok, " ".join(notes), found.history))


def build_recipe(beam: Beam, method: str, kept: Mapping[str, int], links: int | None, target_of: TargetOf) -> Built:
    """A rival's chain with as many hinges as `links`, or as modes are kept."""
    port = next(iter(kept))
    if port not in PLANES or len(kept) > 1:
        raise InputError(f'method = "{method}" is a recipe for one bending plane; keep modes in xy or xz only.')
    targets = {port: target_of(port, kept[port])}
    if method == "seed":
        free = beam.port(port, 4).free_frequencies
        moments = beam.moments(0.0, beam.length, closed=True)
        k, c = rivals.seed_parameters(moments.mass, beam.length, float(free[0]), float(free[1]))
        chain = rivals.seed_chain(beam, k, c, port)
        return Built(chain, targets, Status(True, f"the paper's three links: k = {k:.6g}, c = {c:.6g} N m/rad."))
    count = links or kept[port]
    chain = rivals.equal_links(beam, count, method, port)
    return Built(chain, targets, Status(True, f"{method} recipe with {count} equal segments and as many hinges."))


def with_real_polar(chain: Chain) -> Chain:
    """A recipe's chain with a little polar inertia where the appendage states none, which MuJoCo needs."""
    links = list(chain.links)
    for i, link in enumerate(links):
        ix, iy, iz = link.inertia
        if link.mass > 0.0 and ix <= 0.0:
            links[i] = replace(link, inertia=(max(polar.TINY * iz, abs(iz - iy)), iy, iz))
    return replace(chain, links=tuple(links))
