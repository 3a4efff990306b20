"""Chains that are not exact, for links that the user fixes and for comparison: least squares and recipes."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from beamchain.chain import rivals
from beamchain.chain.build import Built, Status, TargetOf
from beamchain.chain.chain import Chain, Hinge
from beamchain.chain.least_squares import TipBody, fit_planar, fit_stiffness, payload_cases
from beamchain.chain.links import polar_inertias, real_polar, with_polar
from beamchain.chain.recursion import planar_links
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam


def build_least_squares(
    beam: Beam,
    kept: Mapping[str, int],
    links: Array,
    free: tuple[str, ...],
    payload: Mapping[str, TipBody] | None,
    target_of: TargetOf,
) -> Built:
    """A chain by least squares: the plane with most modes decides the links [m]."""
    planes = [port for port in kept if port in ("xy", "xz")]
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
    real = real_polar(beam, found.positions)
    if found.nodes is not None:
        _, polars = polar_inertias(beam, pieces, found.positions, np.array([real.sum()]), real)
        pieces = with_polar(pieces, polars)
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
    if port not in ("xy", "xz") or len(kept) > 1:
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
