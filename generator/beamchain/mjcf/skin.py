"""Weights with which the links of a chain carry the drawn surfaces of its beam: MuJoCo skins.

MuJoCo draws a vertex p at `sum_i w_i (x_i + R_i (p - b_i))`, where bone i stands on a body at x_i
with attitude R_i, and b_i is the place at which it was bound. Bound at the place of its body less
d, a bone carries the point p + d of that body. Each link has a bone that is bound at its place,
one that is bound a length of the appendage before it, so that its displacement and its rotation
count by themselves, and for panels one that is bound as far aside. The weights of a vertex sum to
1 and the shifts d, weighted, to 0: a rigid motion is followed exactly. What else the weights can
do follows from least squares: in each kept mode the vertex shall move as the cross-section of the
elastic beam does.

Whatever the bones, all that a vertex gets of the rotation w_h of hinge h at x_h is `w_h x G_h`,
with `G_h` the sum of `w_i (p + d_i - x_h)` over the bones behind the hinge: three numbers per
hinge. Modes that turn the same hinges, in two planes or in bending and torsion, share them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space

from beamchain.chain.chain import Chain
from beamchain.mjcf.surfaces import Surface
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, Array

# weight of the distance from the plain weights, beside displacements relative to the largest
RIDGE = 3e-3
DIGITS = 5  # of a weight, behind the point


class Bone(NamedTuple):
    """A link, numbered from 0, that carries vertices."""

    link: int
    bound: Array  # (3,) place at which its body is bound [m]
    shift: Array  # (3,) place of its body less that [m]


@dataclass(frozen=True, eq=False)
class ModeMotion:
    """The kept modes (n) of a port.

    Args:
        x: `(s,)` stations [m].
        sections: `(n, s, 6)` motion of the beam's cross-section at each station.
        links: `(n, l, 6)` motion of each link of the chain, seen at the root.
    """

    x: Array
    sections: Array
    links: Array


@dataclass(frozen=True, eq=False)
class Skin:
    """A surface on its bones, with `weights` `(v, b)`."""

    surface: Surface
    bones: tuple[Bone, ...]
    weights: Array


def mode_motion(chain: Chain, port: str, kept: PortModel, x: Array, at: Array) -> ModeMotion:
    """How beam and links move in the kept modes of a port.

    Args:
        chain: it has modes of the same frequencies, perhaps others too.
        port: "xy", "xz", "torsion" or "axial".
        kept: modes of the beam, with the motion of the stations.
        x: `(s,)` stations [m].
        at: `(s,)` points of `kept` that stand for them [m].
    """
    motion = PORT_MOTION[port]
    sections = kept.point_motion(at.tolist()) @ motion.T
    own = chain.port(port)
    freedoms = chain.freedoms([port])
    motions = np.array([chain.freedom_motion(freedom) for freedom in freedoms])
    hinges = np.array([hinge for hinge, _ in freedoms])
    angles = chain.shapes(port)
    before = hinges < np.arange(len(chain.links))[:, None]
    links: list[Array] = []
    for frequency, participation in zip(kept.frequencies, kept.participation, strict=True):
        k = int(np.argmin(np.abs(own.frequencies - frequency)))
        sign = np.sign(own.participation[k] @ participation)
        links.append(sign * (before * angles[k]) @ motions)
    return ModeMotion(x, sections, np.array(links))


def skins(
    chain: Chain, surfaces: Sequence[Surface], modes: Sequence[ModeMotion]
) -> tuple[list[Skin], list[Array]]:
    """The surfaces on the links, and how far they miss each mode `(n,)` of each of `modes`: the
    largest error of a vertex's displacement, over the largest displacement of any vertex."""
    made: list[Skin] = []
    missed: list[Array] = []
    wanted = [_wanted(surface.points, modes) for surface in surfaces]
    largest = np.max([np.max(np.linalg.norm(w, axis=2), axis=0) for w in wanted], axis=0)
    for surface, displacement in zip(surfaces, wanted, strict=True):
        bones = _bones(chain, surface.points, panel=surface.look == "panel")
        carried = _carried(surface.points, bones, modes) / largest[:, None, None]
        displacement = displacement / largest[:, None]
        weights = _plain_weights(surface.points[:, 0], chain, bones)
        weights = _rounded(_least_squares(carried, displacement, weights, bones))
        made.append(Skin(surface, bones, weights))
        off = np.einsum("vkcb,vb->vkc", carried, weights) - displacement
        missed.append(np.max(np.linalg.norm(off, axis=2), axis=0))
    ends = np.cumsum([len(mode.sections) for mode in modes], dtype=np.int64)
    return made, np.split(np.max(missed, axis=0), ends)[:-1]


def _bones(chain: Chain, points: Array, *, panel: bool) -> tuple[Bone, ...]:
    """Two of every link, and a third one where the surface is a panel."""
    sizes = np.ptp(points, axis=0)
    axes = (0, 1 + int(np.argmax(sizes[1:])))[: 2 if panel else 1]
    shifts = [np.zeros(3), *(chain.length * np.eye(3)[axis] for axis in axes)]
    places = [np.zeros(3), *(np.array([hinge.x, 0.0, 0.0]) for hinge in chain.hinges)]
    pairs = product(shifts, enumerate(places))
    return tuple(Bone(i, x - shift, shift) for shift, (i, x) in pairs)


def _displacement(motion: Array, points: Array) -> Array:
    """`(..., 3)` displacement of points `(..., 3)` per `motion` `(..., 6)` of the origin."""
    return motion[..., :3] + np.cross(motion[..., 3:], points)


def _wanted(points: Array, modes: Sequence[ModeMotion]) -> Array:
    """`(v, k, 3)` displacement of vertices `(v, 3)` with their cross-sections in all modes."""
    beside = points * np.array([0.0, 1.0, 1.0])
    moved = [np.zeros((len(points), 0, 3))]
    for mode in modes:
        sections = mode.sections[:, np.searchsorted(mode.x, points[:, 0])]
        moved.append(_displacement(sections, beside).transpose(1, 0, 2))
    return np.concatenate(moved, axis=1)


def _carried(points: Array, bones: Sequence[Bone], modes: Sequence[ModeMotion]) -> Array:
    """`(v, k, 3, b)` displacement of vertices `(v, 3)` by each bone alone in all modes."""
    links = [bone.link for bone in bones]
    shifts = np.array([bone.shift for bone in bones])
    none = np.zeros((0, len(links), 6))
    motion = np.concatenate([none, *(mode.links[:, links] for mode in modes)])
    moved = _displacement(motion, points[:, None, None] + shifts)
    return moved.transpose(0, 1, 3, 2)


def _plain_weights(x: Array, chain: Chain, bones: Sequence[Bone]) -> Array:
    """`(v, b)` weights without the modes: from the middle of each link over to the next."""
    middles = np.array([link.start + link.length / 2.0 for link in chain.links])
    shares = [np.interp(x, middles, unit) for unit in np.eye(middles.size)]
    return np.stack([shares[bone.link] * (not np.any(bone.shift)) for bone in bones], axis=1)


def _least_squares(carried: Array, wanted: Array, plain: Array, bones: Sequence[Bone]) -> Array:
    """`(v, b)` weights w that sum to 1, whose shifts sum to 0:

    `|A w - u|^2 + ridge^2 |w - w_plain|^2` is least, with `A` `carried` and `u` `wanted`.
    """
    count = len(bones)
    shifts = np.array([bone.shift for bone in bones])
    free = null_space(np.vstack([np.ones(count), shifts.T / np.max(shifts)]))
    rows = carried.reshape(len(carried), -1, count)
    off = wanted.reshape(len(wanted), -1) - np.einsum("vrb,vb->vr", rows, plain)
    rows = rows @ free
    matrix = rows.transpose(0, 2, 1) @ rows + RIDGE**2 * np.eye(free.shape[1])
    side = np.einsum("vrf,vr->vf", rows, off)
    return plain + np.linalg.solve(matrix, side[..., None])[..., 0] @ free.T


def _rounded(weights: Array) -> Array:
    """Weights of few digits that still sum to 1; the largest of each vertex takes the rest."""
    short = np.round(weights, DIGITS)
    largest = np.argmax(np.abs(short), axis=1)
    short[np.arange(len(short)), largest] += 1.0 - np.sum(short, axis=1)
    return np.round(short, DIGITS)
