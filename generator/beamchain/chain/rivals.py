"""Chains that are not exact: least squares on links that the user fixes, and recipes in use, to compare with.

The recipes: equal links with hinge stiffness from EI, and the 2008 paper's three links.

Theory: docs/theory.md, section 3.
"""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from beamchain.chain.build import Built, Status, TargetOf
from beamchain.chain.chain import Chain, Link, sprung
from beamchain.chain.least_squares import TipBody, fit_planar, fit_stiffness, payload_cases
from beamchain.chain.links import rigid_in_torsion
from beamchain.chain.recursion import planar_links
from beamchain.checks import one_of, whole_number
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine

RECIPES = ("naive", "classical", "midpoint")


def rigid_link(beam: MassLine, start: float, end: float) -> Link:
    """The piece of the beam between `start` and `end`, frozen."""
    m = beam.moments(start, end, closed=end >= beam.length * (1.0 - 1e-12))
    bending = m.second - m.first**2 / m.mass
    return Link(
        start=start,
        length=end - start,
        mass=m.mass,
        com=m.first / m.mass,
        inertia=(m.polar, bending + m.rotary_xz, bending + m.rotary_xy),
    )


def cut(beam: Beam, hinges: Array, stiffness: Array, port: str) -> Chain:
    """Freeze the beam between hinges `(h,)` [m], 0: at the root, with springs `(h,)`."""
    edges = [0.0, *hinges.tolist(), beam.length]
    links = [
        Link(0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)) if b <= a else rigid_link(beam, a, b) for a, b in pairwise(edges)
    ]
    return Chain(tuple(links), sprung(port, hinges, stiffness), beam.length)


def equal_links(beam: Beam, count: int, recipe: str, port: str = "xy") -> Chain:
    """`count` equal segments with one hinge each, of EI N/L: the inverse compliance of the stretch that it stands for.

    "naive": at the inner end of every link, the root included; "classical": the same with 2 EI N/L at the root;
    "midpoint": in the middle of every segment.
    """
    one_of("recipe", recipe, RECIPES)
    whole_number("links", count, 1, 5000)
    h = beam.length / count
    inner = h * np.arange(count, dtype=np.float64)
    if recipe == "midpoint":
        hinges, stretches = inner + h / 2.0, [(a, a + h) for a in inner]
    elif recipe == "classical":
        hinges, stretches = inner, [(max(a - h / 2.0, 0.0), a + h / 2.0) for a in inner]
    else:
        hinges, stretches = inner, [(a, a + h) for a in inner]
    stiffness = np.array([1.0 / beam.compliance(float(a), float(b), port) for a, b in stretches])
    return cut(beam, hinges, stiffness, port)


def seed_frequency_factors(k: float) -> tuple[float, float]:
    """`w1*`, `w2*` of the paper's chain, equation (17): w = w* sqrt(c/m) / l."""
    root6 = 4.0 * np.sqrt(6.0)
    w1 = root6 / ((1.0 - k) * np.sqrt(1.0 + 2.0 * k - 3.0 * k**2))
    w2 = root6 / (k * (1.0 - k) * np.sqrt(3.0 - 2.0 * k - k**2))
    return float(w1), float(w2)


def seed_ratio(k: float) -> float:
    """`w1 / w2`, equation (18)."""
    return float(k * np.sqrt(k + 3.0) / np.sqrt(3.0 * k + 1.0))


def seed_parameters(mass: float, length: float, omega1: float, omega2: float) -> tuple[float, float]:
    """The paper's `k` and `c` [N m] for two free frequencies [rad/s] of a beam."""
    ratio = omega1 / omega2
    if not 0.0 < ratio < 1.0:
        raise InputError(f"omega1 / omega2 = {ratio!r} must lie between 0 and 1 for the paper's three links.")
    k = float(brentq(lambda x: seed_ratio(x) - ratio, 1e-12, 1.0 - 1e-12, xtol=1e-15, rtol=1e-14))
    return k, mass * (omega1 * length / seed_frequency_factors(k)[0]) ** 2


def seed_chain(beam: Beam, k: float, c: float, port: str = "xy") -> Chain:
    """Links `(1-k)l/2, k l, (1-k)l/2` and two springs `c` [N m/rad] (Belonozhko 2008)."""
    if not beam.uniform:
        raise InputError('method = "seed" is the paper\'s recipe for a uniform beam; use "exact" for this appendage.')
    ends = np.array([(1.0 - k) / 2.0, (1.0 + k) / 2.0]) * beam.length
    return cut(beam, ends, np.array([c, c]), port)


# -- built for a specification ----------------------------------------------------------------------------------------
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
    edges = [0.0, *found.positions.tolist(), beam.length]
    if found.nodes is None:
        pieces = [rigid_link(beam, a, b) for a, b in pairwise(edges)]
    else:
        pieces = rigid_in_torsion(beam, planar_links(found.nodes, beam), found.positions)
    chain = Chain(tuple(pieces), sprung(first, found.positions, found.stiffness), beam.length)
    targets = {first: target_of(first, kept[first])}
    notes = [f"{first}: {found.message}"]
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
        k, c = seed_parameters(moments.mass, beam.length, float(free[0]), float(free[1]))
        chain = seed_chain(beam, k, c, port)
        return Built(chain, targets, Status(True, f"the paper's three links: k = {k:.6g}, c = {c:.6g} N m/rad."))
    count = links or kept[port]
    chain = equal_links(beam, count, method, port)
    return Built(chain, targets, Status(True, f"{method} recipe with {count} equal segments and as many hinges."))
