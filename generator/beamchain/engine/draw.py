"""Frames of a spacecraft in given positions: lit, before a dark blue sky with stars,
as large as the frame holds."""

from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.library import mujoco, rest
from beamchain.engine.linearise import compile_model
from beamchain.errors import EngineError
from beamchain.files import note_input
from beamchain.mjcf.visuals import PANEL, TRUSS
from beamchain.ports.motions import Array

Frame = NDArray[np.uint8]

SLIMMEST = 1.0 / 320.0  # of the picture's extent: thinner solids would vanish
GHOST = 0.3  # opacity of what is drawn for comparison
MARGIN = 1.05  # of the frame over what it holds
SAMPLES = 24  # positions from which the camera is placed
# degrees; from the mean direction outwards
AZIMUTHS = (68.0, 82.0, 98.0, 112.0)
ELEVATIONS = (-14.0, -26.0, -38.0)
SKY: Any = {
    "rgb1": (0.06, 0.12, 0.3),
    "rgb2": (0.02, 0.05, 0.16),
    "markrgb": (0.85, 0.9, 1.0),
    "random": 0.001,
}
PIXELS = 512  # of the sky, a side
AMBIENT, DIFFUSE = 0.35, 0.5  # at least, of the light at the camera
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))

# cells on panels and lattices in place of trusses, added to a scene that is drawn:
# they cost a simulation nothing
ACROSS = 4  # cells across a panel
MOST_CELLS = 40  # cells along a panel, bays along a truss, per link
FILLED = 0.9  # of its place that a cell covers
PROUD = 1.02  # thickness of a cell, of the panel's
STRUT = 0.07  # radius of a truss's struts, of its half width
SUBSTRATE = (0.78, 0.79, 0.82)
WAYS = ((-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0))  # corners of a truss's section


def stage(source: str | Path) -> "mujoco.MjModel":
    """A compiled model with stars, where the file gives no sky but a plain one, and light,
    where it gives none.

    A compiled .mjb file stays as it is.
    """
    model = compile_model(source)
    text = isinstance(source, str) and source.lstrip().startswith("<")
    if not text and Path(source).suffix.lower() == ".mjb":
        return model
    spec: Any = (
        mujoco.MjSpec.from_string(str(source)) if text else mujoco.MjSpec.from_file(str(source))
    )
    if not text:
        for folder, assets in (
            (spec.texturedir, spec.textures),
            (spec.meshdir, (*spec.meshes, *spec.hfields)),
        ):
            for asset in assets:
                note_input(Path(source).parent / folder / asset.file)
    kind = mujoco.mjtTexture.mjTEXTURE_SKYBOX
    flat = mujoco.mjtBuiltin.mjBUILTIN_FLAT
    skies = [texture for texture in spec.textures if texture.type == kind]
    if not skies:
        skies = [spec.add_texture(type=kind, builtin=flat)]
    if skies[0].builtin == flat:
        skies[0].builtin, skies[0].mark = (
            mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
            mujoco.mjtMark.mjMARK_RANDOM,
        )
        skies[0].width = skies[0].height = PIXELS
        for name, value in SKY.items():
            setattr(skies[0], name, value)
    if not spec.lights:
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=(-0.3, 0.4, -1.0),
            diffuse=(0.6, 0.6, 0.6),
        )
    lamp = spec.visual.headlight
    lamp.ambient, lamp.diffuse = (
        np.maximum(lamp.ambient, AMBIENT),
        np.maximum(lamp.diffuse, DIFFUSE),
    )
    return spec.compile()


def draw_frames(
    model: "mujoco.MjModel", body: str, shown: Array, ghosts: Array, *, width: int, height: int
) -> Iterator[Frame]:
    """Frames `(height, width, 3)`, all from one place,
    from which they are seen as large and as moving as can be.

    `shown`, `ghosts` `(k, nq)`: positions, and those drawn faintly for comparison, of all but the
    spacecraft's `body`. Thin solids of the model are made thick enough to be seen.
    """
    camera, extent = _camera(model, body, shown, ghosts, width / height)
    _thicken(model, SLIMMEST * extent)
    model.vis.global_.offwidth = max(int(model.vis.global_.offwidth), width)
    model.vis.global_.offheight = max(int(model.vis.global_.offheight), height)
    data = mujoco.MjData(model)
    faint = mujoco.MjData(model)
    try:
        renderer: Any = mujoco.Renderer(model, height, width)
    except (ImportError, AttributeError, RuntimeError, mujoco.FatalError) as error:
        raise EngineError(
            f"MuJoCo cannot draw here ({' '.join(str(error).split())[:120]}); set MUJOCO_GL to egl "
            "or osmesa before the process starts."
        ) from None
    hub = model.body(body).id
    try:
        for positions in zip(shown, ghosts, strict=True):
            for state, at in zip((data, faint), positions, strict=True):
                state.qpos[:] = at
                mujoco.mj_kinematics(model, state)
                mujoco.mj_comPos(model, state)
                mujoco.mj_camlight(model, state)
            renderer.update_scene(data, camera)
            # cast by a far light they are ragged
            renderer.scene.flags[int(mujoco.mjtRndFlag.mjRND_SHADOW)] = 0
            decorate(model, renderer.scene, SLIMMEST * extent / 4.0)
            _ghosts(model, faint, renderer.scene, hub)
            yield renderer.render().copy()
    finally:
        renderer.close()


def _ghosts(model: "mujoco.MjModel", faint: "mujoco.MjData", scene: Any, hub: int) -> None:
    before = int(scene.ngeom)
    everything = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
    mujoco.mjv_addGeoms(model, faint, mujoco.MjvOption(), mujoco.MjvPerturb(), everything, scene)
    for i in range(before, int(scene.ngeom)):
        geom = scene.geoms[i]
        own = (
            int(geom.objtype) == int(mujoco.mjtObj.mjOBJ_GEOM)
            and int(model.geom_bodyid[geom.objid]) != hub
        )
        geom.rgba[3] = GHOST if own else 0.0


def _thicken(model: "mujoco.MjModel", least: float) -> None:
    kinds = {int(mujoco.mjtGeom.mjGEOM_BOX): 3, int(mujoco.mjtGeom.mjGEOM_CYLINDER): 2}
    kinds |= {int(mujoco.mjtGeom.mjGEOM_CAPSULE): 2, int(mujoco.mjtGeom.mjGEOM_SPHERE): 1}
    for i in range(model.ngeom):
        n = kinds.get(int(model.geom_type[i]), 0)
        model.geom_size[i, :n] = np.maximum(model.geom_size[i, :n], least)


def _camera(
    model: "mujoco.MjModel", body: str, shown: Array, ghosts: Array, aspect: float
) -> tuple[Any, float]:
    """The camera that shows most motion of all that see every position,
    and the width of what it sees [m]."""
    some = range(0, len(shown), max(len(shown) // SAMPLES, 1))
    points, faint = (
        np.array([_corners(model, positions[k]) for k in some]) for positions in (shown, ghosts)
    )
    moved, points = points - faint, np.concatenate([points, faint])
    out = points.mean(axis=(0, 1)) - rest(model, shown[0]).body(body).xpos
    heading = np.degrees(np.arctan2(out[1], out[0]))
    up = float(np.tan(np.radians(float(model.vis.global_.fovy)) / 2.0))
    best: tuple[float, Any] = (-1.0, None)
    for turn, elevation in product(AZIMUTHS, ELEVATIONS):
        frame = _frame(heading + turn, elevation)
        middle, distance = _fit_view(
            points.reshape(-1, 3) @ frame, np.array([aspect * up, up]) / MARGIN
        )
        spread = np.std(points @ frame[:, :2], axis=(0, 1)).sum()
        seen = float(np.linalg.norm(moved @ frame[:, :2]) * spread) / distance**2
        if seen > best[0]:
            camera: Any = mujoco.MjvCamera()
            camera.lookat[:] = frame @ middle
            camera.distance, camera.azimuth, camera.elevation = distance, heading + turn, elevation
            best = seen, camera
    return best[1], 2.0 * float(best[1].distance) * up


def _frame(azimuth: float, elevation: float) -> Array:
    """`(3, 3)` right, up and forward of a camera, in columns."""
    az, el = np.radians([azimuth, elevation])
    forward = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    right = np.array([np.sin(az), -np.cos(az), 0.0])
    return np.column_stack([right, np.cross(right, forward), forward])


def _fit_view(points: Array, tangents: Array) -> tuple[Array, float]:
    """Where to look `(3,)` and from how far,
    so that `(n, 3)` points just lie between the four sides of the picture.

    A point is within a side where its coordinate across is at most the tangent of the angle
    times its distance.
    """
    across, depth = points[:, :2], points[:, 2:]
    right = np.max(across - tangents * depth, axis=0)
    left = np.max(-across - tangents * depth, axis=0)
    reach = float(np.max((right + left) / (2.0 * tangents)) + depth.mean())
    return np.array([*((right - left) / 2.0), depth.mean()]), reach


def _corners(model: "mujoco.MjModel", positions: Array) -> Array:
    """`(n, 3)` corners of all solids that are seen."""
    data = rest(model, positions)
    out: Sequence[Array] = [
        data.geom_xpos[i]
        + (CORNERS * model.geom_aabb[i, 3:] + model.geom_aabb[i, :3])
        @ data.geom_xmat[i].reshape(3, 3).T
        for i in range(model.ngeom)
        if int(model.geom_type[i]) != int(mujoco.mjtGeom.mjGEOM_PLANE)
        and model.geom_rgba[i, 3] > 0.0
    ]
    return np.concatenate(out)


def decorate(model: "mujoco.MjModel", scene: Any, slim: float) -> None:
    """Draw the panels and trusses among the geoms of a renderer's scene,
    known by name and colour, in detail.

    `slim`: least radius of a strut [m].
    """
    solid = int(mujoco.mjtObj.mjOBJ_GEOM)
    box = int(mujoco.mjtGeom.mjGEOM_BOX)
    for i in range(int(scene.ngeom)):
        geom = scene.geoms[i]
        if (
            int(geom.objtype) != solid
            or int(geom.type) != box
            or "shape" not in model.geom(geom.objid).name
        ):
            continue
        own = " ".join(f"{value:g}" for value in model.geom_rgba[geom.objid])
        if own not in (PANEL, TRUSS) or geom.rgba[3] == 0.0:
            continue
        place = np.array(geom.pos)
        turn = np.array(geom.mat).reshape(3, 3)
        half = np.array(geom.size)
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


def _add(
    scene: Any, half: Array, place: Array, turn: Array, colour: Any, gloss: float = 0.0
) -> None:
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
    along = min(max(round(float(ACROSS * half[0] / half[wide])), 1), MOST_CELLS)
    size = np.empty(3)
    size[[0, wide, thin]] = (
        FILLED * half[0] / along,
        FILLED * half[wide] / ACROSS,
        PROUD * half[thin],
    )
    for i, j in product(range(along), range(ACROSS)):
        middle = np.zeros(3)
        middle[[0, wide]] = (
            ((2 * i + 1) / along - 1.0) * half[0],
            ((2 * j + 1) / ACROSS - 1.0) * half[wide],
        )
        yield middle, size


def _struts(half: Array) -> Iterator[tuple[Array, Array]]:
    """Ends of every strut of a truss with half extents `(3,)`: longerons,
    battens and a diagonal in every bay."""
    bays = min(max(round(float(half[0] / half[1:].max())), 1), MOST_CELLS)
    x = np.linspace(-half[0], half[0], bays + 1)
    corners = [np.array([[at, a * half[1], b * half[2]] for a, b in WAYS]) for at in x]
    yield from zip(corners[0], corners[-1], strict=True)
    for frame in corners:
        yield from ((frame[k], frame[(k + 1) % 4]) for k in range(4))
    for bay, (here, there) in enumerate(pairwise(corners)):
        yield from ((here[(k + bay) % 4], there[(k + bay + 1) % 4]) for k in range(4))
