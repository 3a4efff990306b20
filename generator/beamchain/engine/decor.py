"""Cells on panels and lattices in place of trusses, added to a scene that is drawn: they cost a simulation nothing."""

from collections.abc import Iterator
from itertools import pairwise, product
from typing import Any

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.mjcf.visuals import PANEL, TRUSS
from beamchain.ports.motions import Array

ACROSS = 4  # cells across a panel
MOST = 40  # cells along a panel, bays along a truss, per link
FILLED = 0.9  # of its place that a cell covers
PROUD = 1.02  # thickness of a cell, of the panel's
STRUT = 0.07  # radius of a truss's struts, of its half width
SUBSTRATE = (0.78, 0.79, 0.82)
WAYS = ((-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0))  # corners of a truss's section


def decorate(model: "mujoco.MjModel", scene: Any, slim: float) -> None:
    """Draw the panels and trusses among the geoms of a renderer's scene, known by name and colour, in detail.

    `slim`: least radius of a strut [m].
    """
    solid, box = int(mujoco.mjtObj.mjOBJ_GEOM), int(mujoco.mjtGeom.mjGEOM_BOX)
    for i in range(int(scene.ngeom)):
        geom = scene.geoms[i]
        if int(geom.objtype) != solid or int(geom.type) != box or "shape" not in model.geom(geom.objid).name:
            continue
        own = " ".join(f"{value:g}" for value in model.geom_rgba[geom.objid])
        if own not in (PANEL, TRUSS) or geom.rgba[3] == 0.0:
            continue
        place, turn, half = np.array(geom.pos), np.array(geom.mat).reshape(3, 3), np.array(geom.size)
        colour = np.array(geom.rgba, dtype=np.float32)
        if own == PANEL:
            geom.rgba[:3] = SUBSTRATE
            for middle, size in _cells(half):
                _add(scene, size, place + turn @ middle, turn, colour, gloss=0.6)
            continue
        geom.rgba[3] = 0.0
        radius = max(STRUT * float(half[1:].max()), slim)
        for one, two in _struts(half):
            span = two - one
            size = np.array([radius, radius, float(np.linalg.norm(span)) / 2.0])
            _add(scene, size, place + turn @ (one + two) / 2.0, turn @ _along(span), colour)


def _add(scene: Any, half: Array, place: Array, turn: Array, colour: Any, gloss: float = 0.0) -> None:
    """One more box in a scene, unless it is full; boxes are by far the quickest to draw."""
    if int(scene.ngeom) < int(scene.maxgeom):
        geom = scene.geoms[int(scene.ngeom)]
        scene.ngeom += 1
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_BOX, half, place, turn.ravel(), colour)
        geom.specular = geom.shininess = gloss


def _along(span: Array) -> Array:
    """`(3, 3)` axes of which the third points along `span`."""
    z: Array = span / np.linalg.norm(span)
    x: Array = np.linalg.qr(np.column_stack([z, np.eye(3)[:, int(np.argmin(np.abs(z)))]]))[0][:, 1]
    return np.column_stack([x, np.cross(z, x).astype(np.float64), z])


def _cells(half: Array) -> Iterator[tuple[Array, Array]]:
    """Middle and half extents of every cell of a panel with half extents `(3,)`."""
    thin = 1 + int(np.argmin(half[1:]))
    wide = 3 - thin
    along = min(max(round(float(ACROSS * half[0] / half[wide])), 1), MOST)
    size = np.empty(3)
    size[[0, wide, thin]] = FILLED * half[0] / along, FILLED * half[wide] / ACROSS, PROUD * half[thin]
    for i, j in product(range(along), range(ACROSS)):
        middle = np.zeros(3)
        middle[[0, wide]] = ((2 * i + 1) / along - 1.0) * half[0], ((2 * j + 1) / ACROSS - 1.0) * half[wide]
        yield middle, size


def _struts(half: Array) -> Iterator[tuple[Array, Array]]:
    """Ends of every strut of a truss with half extents `(3,)`: longerons, battens and a diagonal in every bay."""
    bays = min(max(round(float(half[0] / half[1:].max())), 1), MOST)
    x = np.linspace(-half[0], half[0], bays + 1)
    corners = [np.array([[at, a * half[1], b * half[2]] for a, b in WAYS]) for at in x]
    yield from zip(corners[0], corners[-1], strict=True)
    for frame in corners:
        yield from ((frame[k], frame[(k + 1) % 4]) for k in range(4))
    for bay, (here, there) in enumerate(pairwise(corners)):
        yield from ((here[(k + bay) % 4], there[(k + bay + 1) % 4]) for k in range(4))
