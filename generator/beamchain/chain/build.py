"""From targets to one chain: which realisation is tried, what is done where it fails, and what is said of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from beamchain.chain import polar, rivals
from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.chain.interleave import MassGroups, PlaneLinks, cells, merge_cuts, plane_links
from beamchain.chain.least_squares import fit_planar, fit_stiffness, payload_cases
from beamchain.chain.realise import Nodes, planar_links, realise, realise_scalar
from beamchain.chain.rods import Payload
from beamchain.chain.tip import tip_exact
from beamchain.errors import InputError, RealisationError
from beamchain.port import Array, PortModel
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine

#: Target with the given number of modes of a port.
TargetOf = Callable[[str, int], PortModel]

PLANES = ("xy", "xz")
SAME = 1e-9  # relative: hinges and masses of two planes closer than this are the same
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
        link = rivals.rigid_link(beam, 0.0, beam.length)
        [polars] = polar.share([link], [link.inertia[0]], [[0]], np.array([link.inertia[0]]))
        return Built(
            Chain((polar.with_polar([link], [polars])[0],), (), beam.length), {}, Status(True, "one rigid body.")
        )
    history: list[str] = []
    targets: dict[str, PortModel] = {}
    nodes: dict[str, Nodes] = {}
    strings: dict[str, tuple[Array, Array]] = {}
    for port, count in kept.items():
        if port in PLANES:
            targets[port], nodes[port] = _plane(beam, port, count, target_of, history, tip)
        else:
            targets[port] = target_of(port, count)
            strings[port] = realise_scalar(targets[port])
    fewer = [
        f"{port} keeps {targets[port].modes} of the {count} modes asked for"
        for port, count in kept.items()
        if targets[port].modes < count
    ]
    notes = list(fewer)
    found: tuple[Chain, str] | None = None
    more: tuple[str, int] | None = None
    extra = ""
    while found is None:
        try:
            found = _assemble(beam, nodes, strings)
        except RealisationError as error:
            history.append(str(error))
            torsion = targets.get("torsion")
            if torsion is not None and torsion.modes > 1 and "polar inertia" in str(error):
                targets["torsion"] = target_of("torsion", torsion.modes - 1)
                strings["torsion"] = realise_scalar(targets["torsion"])
                notes = [n for n in notes if not n.startswith("torsion")]
                notes.append(f"torsion keeps {torsion.modes - 1} of the {kept['torsion']} modes asked for: {error}")
            elif len(nodes) == 2 and more is None and len({n.stiffness.size for n in nodes.values()}) == 2:
                # a plane with more hinges than it needs is no worse, and shared hinges or other cuts may do
                least = min(nodes, key=lambda port: nodes[port].stiffness.size)
                more = least, max(n.stiffness.size for n in nodes.values())
                saved = targets[least], nodes[least]
                try:
                    targets[least], nodes[least] = _plane(beam, least, more[1], target_of, [], tip)
                    found = _assemble(beam, nodes, strings)
                    extra = f" {least} keeps {targets[least].modes} modes: with {kept[least]} no bodies exist."
                except RealisationError:
                    targets[least], nodes[least] = saved
            elif len(nodes) == 2:
                chain, how, miss = _second_by_least_squares(beam, nodes, strings, targets)
                notes.append(f"{error} The second plane is fitted by least squares: worst relative residual {miss:.1e}")
                found = chain, how
            else:
                raise
    chain, how = found
    modes = ", ".join(f"{t.modes} in {port}" for port, t in targets.items())
    message = f"exact chain ({how}), modes kept: {modes}.{extra}"
    if notes:
        reasons = f" {history[0]}" if history and fewer else ""
        return Built(chain, targets, Status(False, f"{message} {'; '.join(notes)}.{reasons}", tuple(history)))
    return Built(chain, targets, Status(True, message, tuple(history)))


def _plane(
    beam: MassLine, port: str, count: int, target_of: TargetOf, history: list[str], tip: bool
) -> tuple[PortModel, Nodes]:
    """Target and canonical chain of a plane, with as many of `count` modes as are physical."""
    for modes in range(count, 0, -1):
        try:
            target = target_of(port, modes)
            nodes = realise(target)
            probe = Chain(
                tuple(planar_links(nodes, beam)), _hinges(nodes.positions[1:-1], {port: nodes}, {}), beam.length
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


def _hinges(cuts: Array, planes: Mapping[str, Nodes], scalars: Mapping[str, Mapping[int, float]]) -> tuple[Hinge, ...]:
    """Hinges at the cuts: a plane's spring where the plane has a hinge there, scalar springs by hinge number."""
    out: list[Hinge] = []
    for i, x in enumerate(cuts):
        stiffness: dict[str, float] = {}
        for port, nodes in planes.items():
            places = nodes.positions[1:-1]
            near = np.flatnonzero(np.abs(places - x) <= SAME * max(float(places[-1]), 1e-300)) if places.size else []
            if len(near):
                stiffness[port] = float(nodes.stiffness[near[0]])
        for port, springs in scalars.items():
            if i in springs:
                stiffness[port] = springs[i]
        out.append(Hinge(x=float(x), stiffness=stiffness))
    return tuple(out)


def _assemble(
    beam: MassLine, nodes: Mapping[str, Nodes], strings: Mapping[str, tuple[Array, Array]]
) -> tuple[Chain, str]:
    """One chain for all ports, exact in each, and how it was found."""
    total = beam.moments(0.0, beam.length, closed=True)
    torsion = strings.get("torsion")
    inertias = np.array([total.polar]) if torsion is None else torsion[0]
    shared = _shared(nodes, abs(total.rotary_xy - total.rotary_xz) / total.second)
    if shared is not None and "axial" not in strings and inertias.size - 1 <= shared.stiffness.size:
        cuts = shared.positions[1:-1]
        links = planar_links(shared, beam)
        try:
            return _finish(beam, nodes, links, cuts, strings, inertias, {}), "shared hinges"
        except RealisationError:
            pass  # the split of the masses does not suit the polar inertia: let the linear program choose bodies
    planes = {
        port: plane_links(nodes[port])
        if port in nodes
        else PlaneLinks(np.zeros(0), np.array([[total.mass, total.first, total.second + rotary]]))
        for port, rotary in (("xy", total.rotary_xy), ("xz", total.rotary_xz))
    }
    positions = [p.hinges for p in planes.values()]
    groups = None
    if "axial" in strings:
        wish = polar.natural_positions(beam, strings["axial"][0], "mass")
        groups = MassGroups(_snap(wish, np.concatenate(positions), 0.02 * beam.length), strings["axial"][0])
        positions.append(groups.hinges)
    missing = inertias.size - 1 - merge_cuts(positions, beam.length).size
    wish = polar.natural_positions(beam, inertias, "polar")
    taken = np.concatenate(positions)
    gaps = np.array([float(np.min(np.abs(taken - x), initial=np.inf)) for x in wish])
    for extra in (max(missing, 0), inertias.size - 1):  # first without more bodies than needed
        cuts = merge_cuts([*positions, wish[np.argsort(gaps)[::-1][:extra]]], beam.length)
        links = cells(beam, cuts, planes["xy"], planes["xz"], groups)
        slides = {}
        if groups is not None:
            at = [int(np.argmin(np.abs(cuts - x))) for x in groups.hinges]
            slides = {i: float(k) for i, k in zip(at, strings["axial"][1], strict=True)}
        try:
            return _finish(beam, nodes, links, cuts, strings, inertias, slides), "interleaved hinges"
        except RealisationError:
            if extra == inertias.size - 1:
                raise
    raise RealisationError("no hinges were left to try.")


def _finish(
    beam: MassLine,
    nodes: Mapping[str, Nodes],
    links: list[Link],
    cuts: Array,
    strings: Mapping[str, tuple[Array, Array]],
    inertias: Array,
    slides: dict[int, float],
) -> Chain:
    """Polar inertia and torsion springs onto links and hinges."""
    turning, polars = polar.place(beam, links, cuts, inertias, polar.real_polar(beam, cuts))
    scalars: dict[str, dict[int, float]] = {"axial": slides} if slides else {}
    if "torsion" in strings:
        scalars["torsion"] = {i: float(k) for i, k in zip(turning, strings["torsion"][1], strict=True)}
    return Chain(tuple(polar.with_polar(links, polars)), _hinges(cuts, nodes, scalars), beam.length)


def _shared(nodes: Mapping[str, Nodes], rotary: float) -> Nodes | None:
    """The nodes that serve every bending plane at once, if there are such."""
    if not nodes or rotary > SAME:
        return None
    first, *others = nodes.values()
    if first.excess is not None and len(nodes) > 1:
        return None
    for other in others:
        if other.masses.size != first.masses.size:
            return None
        if np.any(np.abs(other.masses - first.masses) > SAME * first.masses) or np.any(
            np.abs(other.lengths - first.lengths) > SAME * first.lengths
        ):
            return None
    return first


def _snap(wish: Array, places: Array, near: float) -> Array:
    """Each wish moved onto the nearest place within `near`, if none was taken before."""
    out: list[float] = []
    for x in wish:
        free = [float(p) for p in places if abs(p - x) <= near and p not in out]
        out.append(min(free, key=lambda p: abs(p - x)) if free else float(x))
    return np.array(out)


def _second_by_least_squares(
    beam: MassLine,
    nodes: Mapping[str, Nodes],
    strings: Mapping[str, tuple[Array, Array]],
    targets: Mapping[str, PortModel],
) -> tuple[Chain, str, float]:
    """The plane with more modes exact, the other by least squares on its springs."""
    first = max(nodes, key=lambda port: nodes[port].stiffness.size)
    second = next(port for port in nodes if port != first)
    chain, how = _assemble(beam, {first: nodes[first]}, strings)
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
