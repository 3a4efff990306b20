"""One chain of bodies from each port's own realisation: shared or interleaved hinges, torsion and axial springs on them."""

from collections.abc import Mapping

import numpy as np

from beamchain.chain import polar
from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.chain.interleave import MassGroups, PlaneLinks, cells, merge_cuts, plane_links
from beamchain.chain.realise import Nodes, planar_links
from beamchain.errors import RealisationError
from beamchain.motion import Array
from beamchain.structure.mass_line import MassLine

SAME = 1e-9  # relative: hinges and masses of two planes closer than this are the same


def hinges_at(
    cuts: Array, planes: Mapping[str, Nodes], scalars: Mapping[str, Mapping[int, float]]
) -> tuple[Hinge, ...]:
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


def assemble(
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
    return Chain(tuple(polar.with_polar(links, polars)), hinges_at(cuts, nodes, scalars), beam.length)


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
