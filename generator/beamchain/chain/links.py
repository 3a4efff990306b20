"""The rigid links of a chain: bodies between its hinges,
and how much of the polar inertia each of them carries.

Theory: docs/theory.md, section 3.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np

from beamchain.chain.chain import Chain, Link
from beamchain.errors import RealisationError
from beamchain.ports.motions import Array, mean_mass
from beamchain.structure.mass_line import MassLine

ROUNDED = 1e-13  # of the whole inertia: what differences of its parts lose
FLAT = 1e-12  # of the largest second moment: thickness of a lamina
TINY = 1e-6  # polar over transverse inertia of a link where the appendage states none
TRIES = 400
NO_POLAR = 1e-14  # of the transverse inertia: less polar inertia is rounding
ROLL = 1e-3  # of the transverse inertia: what may be added to the roll inertia
UNSEEN = 1e-9  # of the lightest link's mass times the length squared: what bending does not feel


def _without_rounding(about: Array, noise: float) -> Array:
    """`(3, 3)` inertia about the centre, no second moment below zero by rounding."""
    moments = np.trace(about) / 2.0 * np.eye(3) - about
    values, axes = np.linalg.eigh(moments)
    if not -noise < values[0] < FLAT * values[2]:
        return about
    values = np.maximum(values, FLAT * values[2])
    return float(np.sum(values)) * np.eye(3) - (axes * values) @ axes.T


def bodies(line: MassLine, x: Array) -> list[Link]:
    """The appendage's own rigid pieces between the hinges; see `settled`."""
    edges = [0.0, *x.tolist(), line.length]
    pieces = line.matrices(line.moments(edges, inner=True))
    noise = ROUNDED * float(np.trace(line.whole[3:, 3:]))
    out: list[Link] = []
    for a, b, matrix in zip(edges[:-1], edges[1:], pieces, strict=True):
        mass = mean_mass(matrix)
        if mass <= 0.0:
            out.append(Link(a, b - a, 0.0, a, (0.0, 0.0, 0.0)))
            continue
        centre = (
            np.array([matrix[1, 5] - matrix[2, 4], 2.0 * matrix[2, 3], -2.0 * matrix[1, 3]])
            / 2.0
            / mass
        )
        about = matrix[3:, 3:] - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        about = _without_rounding(about, noise)
        if np.max(np.abs(about - np.diag(np.diag(about)))) < noise:
            about = np.diag(np.diag(about))
        centre[1:] = np.where(np.abs(centre[1:]) < ROUNDED * line.length, 0.0, centre[1:])
        inertia = (float(about[0, 0]), float(about[1, 1]), float(about[2, 2]))
        products = (float(about[0, 1]), float(about[0, 2]), float(about[1, 2]))
        out.append(
            Link(
                a,
                b - a,
                mass,
                float(centre[0]),
                inertia,
                (float(centre[1]), float(centre[2])),
                products,
            )
        )
    return out


def real_polar(beam: MassLine, cuts: Array) -> Array:
    """`(c + 1,)` polar inertia of the beam's pieces between the cuts [kg m^2]."""
    edges = [0.0, *cuts.tolist(), beam.length]
    return beam.moments(edges)[:, 3]


def with_polar(links: Sequence[Link], inertias: Sequence[float]) -> list[Link]:
    """The links with the given polar inertias."""
    return [
        replace(link, inertia=(polar, link.inertia[1], link.inertia[2]))
        for link, polar in zip(links, inertias, strict=True)
    ]


def _natural_positions(beam: MassLine, shares: Array) -> Array:
    """`(n,)` x [m] at which the beam's own polar inertia reaches `shares` `(n + 1,)`."""
    if not np.sum(shares) > 0.0:
        return np.zeros(shares.size - 1)
    grid = np.linspace(0.0, beam.length, 201)
    own = np.cumsum([0.0, *real_polar(beam, grid[1:-1])])
    return np.interp(np.cumsum(shares)[:-1] * (own[-1] / np.sum(shares)), own, grid)


def share(
    links: list[Link], wanted: list[float], groups: list[list[int]], real: Array
) -> list[float]:
    """Polar inertia of every link, near to `real` `(N,)`; sums per group as `wanted`."""
    out = [0.0] * len(links)
    for total, members in zip(wanted, groups, strict=True):
        low = np.array([abs(links[i].inertia[2] - links[i].inertia[1]) for i in members]) * (
            1.0 + 1e-12
        )
        high = np.array([links[i].inertia[2] + links[i].inertia[1] for i in members]) * (
            1.0 - 1e-12
        )
        floor = np.minimum(np.maximum(low, TINY * high / 2.0 * (total <= 0.0)), high)
        if total <= 0.0:
            for i, value in zip(members, floor, strict=True):
                out[i] = float(value)
            continue
        if not low.sum() * (1.0 - 1e-9) <= total <= high.sum():
            raise RealisationError(
                f"links {members[0] + 1} to {members[-1] + 1} would need a polar inertia of "
                f"{total:.4g} kg m^2, but "
                f"rigid bodies of their shape carry {low.sum():.4g} to {high.sum():.4g}: the "
                "appendage is too wide for "
                "its length here; keep fewer modes, or, of a beam that is given by segments, use "
                'theory = "timoshenko" (rotary inertia).'
            )
        weight = np.maximum(real[members], 1e-12 * total)
        lo = 0.0
        hi = float(np.max(high / weight)) + 1.0
        for _ in range(200):
            t = (lo + hi) / 2.0
            lo, hi = (t, hi) if np.clip(t * weight, low, high).sum() < total else (lo, t)
        values = np.clip((lo + hi) / 2.0 * weight, low, high)
        inner = (values > low * (1.0 + 1e-9)) & (values < high * (1.0 - 1e-9))
        if inner.any():  # the bisection's rounding goes to a link with room
            values[np.argmax(inner * values)] += total - values.sum()
        for i, value in zip(members, values, strict=True):
            out[i] = float(value)
    return out


def polar_inertias(
    beam: MassLine, links: list[Link], cuts: Array, inertias: Array, real: Array
) -> tuple[list[int], list[float]]:
    """The n hinges of `cuts` `(c,)` [m] that turn in torsion,
    and the links' polar inertias `(c + 1,)`.

    `inertias` `(n + 1,)`: of the groups; one entry: rigid in torsion. `real` `(c + 1,)`:
    of the real pieces.
    """
    n = inertias.size - 1
    wish = _natural_positions(beam, inertias) if n else np.zeros(0)
    choices = sorted(
        combinations(range(cuts.size), n), key=lambda c: float(np.sum((cuts[list(c)] - wish) ** 2))
    )
    reason = RealisationError(f"{n} torsion modes need {n} hinges, but there are {cuts.size}.")
    for choice in choices[:TRIES]:
        bounds = [0, *(i + 1 for i in choice), len(links)]
        groups = [list(range(a, b)) for a, b in pairwise(bounds)]
        try:
            return list(choice), share(links, inertias.tolist(), groups, real)
        except RealisationError as error:
            reason = error
    raise reason


def rigid_in_torsion(beam: MassLine, links: list[Link], cuts: Array) -> list[Link]:
    """The links with the beam's own polar inertia, shared out so that each can carry its part."""
    real = real_polar(beam, cuts)
    return with_polar(links, polar_inertias(beam, links, cuts, np.array([real.sum()]), real)[1])


def raise_polar_inertia(chain: Chain, least: float) -> tuple[Chain, str]:
    """The chain with no inertia below `least` [kg m^2], the polar one first, and a sentence that
    says so; both as before where none is.

    A chain that bends in torsion is left alone,
    as is one whose roll inertia would no longer be small, and every link whose bending would be
    felt.
    """
    if chain.hung:  # its moving links have some, and the first does not move
        return chain, ""
    rigid = chain.rigid_mass()
    across = float(max(rigid[4, 4], rigid[5, 5]))
    across_links = [min(link.inertia[1:]) for link in chain.links]
    lightest = min((link.mass for link in chain.links if link.mass), default=0.0)
    bends = sum(max(least - own, 0.0) for own in across_links) > UNSEEN * lightest * chain.length**2
    low = [
        i
        for i, link in enumerate(chain.links)
        if min(link.inertia) < least <= link.mass and not (bends and across_links[i] < least)
    ]
    added = sum(least - min(chain.links[i].inertia) for i in low)
    if not low or "torsion" in chain.ports or added > ROLL * across:
        return chain, ""
    links = list(chain.links)
    for i in low:
        a, b, c = links[i].inertia
        links[i] = replace(links[i], inertia=(max(a, least), max(b, least), max(c, least)))
    smallest = min(min(chain.links[i].inertia) for i in low)
    roll = float(rigid[3, 3])
    return replace(chain, links=tuple(links)), (
        f"the links are so thin that their polar inertia falls to {smallest:.3g} kg m^2; MuJoCo "
        f"takes nothing below 1e-15, so {len(low)} of them carry {least:.3g}: the appendage's roll "
        f"inertia is {roll + added:.3g} instead of {roll:.3g} kg m^2 "
        f"({(roll + added) / across:.1e} of its transverse inertia). Bending does not see it."
    )


def settle_links(line: MassLine, links: Sequence[Link], cuts: Array) -> list[Link]:
    """Links that are rigid bodies: long ones carry what short ones cannot."""
    if any(link.beside != (0.0, 0.0) or link.products != (0.0, 0.0, 0.0) for link in links):
        return list(links)  # imported mass has its breadth in all three inertias
    rigid = line.rigid_mass()
    none = float(rigid[3, 3]) <= NO_POLAR * float(max(rigid[4, 4], rigid[5, 5]))
    solid = [link.inertia for link in links if link.mass > 0.0]
    if not none and all(
        abs(b - c) * (1.0 + 1e-12) <= a <= (b + c) * (1.0 - 1e-12) and a > 0.0 for a, b, c in solid
    ):
        return list(links)
    real = real_polar(line, cuts)
    return with_polar(
        links,
        share(list(links), [0.0 if none else float(real.sum())], [list(range(len(links)))], real),
    )
