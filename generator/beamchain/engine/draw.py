"""Frames of a spacecraft in given positions, as large as the frame holds."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.checks import is_mjcf_text
from beamchain.engine.geometry import drawn_points
from beamchain.engine.library import mujoco, rest
from beamchain.engine.linearise import compile_model
from beamchain.errors import EngineError
from beamchain.files import note_input
from beamchain.ports.motions import Array

Frame = NDArray[np.uint8]

SLIMMEST = 1.0 / 320.0  # of the picture's extent: thinner solids would vanish
GHOST = 0.3  # opacity of what is drawn for comparison
MARGIN = 1.05  # of the frame over what it holds
SAMPLES = 24  # positions that the frame is made to hold
AZIMUTH, ELEVATION = 112.0, -32.0  # of the view, from the direction of the appendage [degrees]
SKY = (0.06, 0.12, 0.3), (0.02, 0.05, 0.16)  # above and below


def stage(source: str | Path) -> "mujoco.MjModel":
    """A compiled model with a sky and a light, where the file gives none.

    A compiled .mjb file stays as it is.
    """
    model = compile_model(source)
    text = is_mjcf_text(source)
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
    if not any(texture.type == kind for texture in spec.textures):
        gradient = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
        above, below = SKY
        spec.add_texture(type=kind, builtin=gradient, rgb1=above, rgb2=below, width=64, height=64)
    if not spec.lights:
        sun = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        spec.worldbody.add_light(type=sun, dir=(-0.3, 0.4, -1.0), diffuse=(0.6, 0.6, 0.6))
    lamp = spec.visual.headlight
    lamp.ambient = np.maximum(lamp.ambient, (0.35, 0.35, 0.38))
    lamp.diffuse = np.maximum(lamp.diffuse, 0.5)
    return spec.compile()


def draw_frames(
    model: "mujoco.MjModel",
    body: str | int,
    shown: Array,
    ghosts: Array,
    *,
    width: int,
    height: int,
) -> Iterator[Frame]:
    """Frames `(height, width, 3)`, all from one place.

    `shown`, `ghosts` `(k, nq)`: positions, and those drawn faintly for comparison. Thin solids of
    the model are made thick enough to be seen. The view is turned with the appendages, which
    stand on the spacecraft's `body`.
    """
    model.vis.global_.offwidth = max(int(model.vis.global_.offwidth), width)
    model.vis.global_.offheight = max(int(model.vis.global_.offheight), height)
    try:
        renderer: Any = mujoco.Renderer(model, height, width)
    except (ImportError, AttributeError, RuntimeError, mujoco.FatalError) as error:
        raise EngineError(
            f"MuJoCo cannot draw here ({' '.join(str(error).split())[:120]}); set MUJOCO_GL to egl "
            "or osmesa before the process starts."
        ) from None
    try:
        some = np.concatenate([shown, ghosts])[:: max(len(shown) // SAMPLES, 1)]
        points = np.concatenate([drawn_points(model, rest(model, at)) for at in some])
        camera, extent = _camera(
            model, points, rest(model, shown[0]).body(body).xpos, width / height
        )
        thicken(model, SLIMMEST * extent)
        sky = _picture(model, shown[0], renderer, camera, hidden=True)
        drawn, faint = None, sky
        for at, rigid in zip(shown, ghosts, strict=True):
            image = _picture(model, at, renderer, camera)
            if drawn is None or np.any(rigid != drawn):  # in a film of a mode it stays
                drawn = rigid
                faint = (1.0 - GHOST) * sky + GHOST * _picture(model, rigid, renderer, camera)
            behind = np.all(image == sky, axis=-1, keepdims=True)
            yield np.where(behind, faint, image).astype(np.uint8)
    finally:
        renderer.close()


def _picture(
    model: "mujoco.MjModel", positions: Array, renderer: Any, camera: Any, *, hidden: bool = False
) -> Frame:
    """One frame; `hidden`: of the sky alone."""
    option: Any = mujoco.MjvOption()
    if hidden:
        option.geomgroup[:] = 0
        option.skingroup[:] = 0
    data = rest(model, positions)
    mujoco.mj_camlight(model, data)
    renderer.update_scene(data, camera, option)
    # cast by a far light they are ragged
    renderer.scene.flags[int(mujoco.mjtRndFlag.mjRND_SHADOW)] = 0
    return np.array(renderer.render())


def thicken(model: "mujoco.MjModel", least: float) -> None:
    """Make solids and struts so thick that they are seen, `least` [m]."""
    kinds = {int(mujoco.mjtGeom.mjGEOM_BOX): 3, int(mujoco.mjtGeom.mjGEOM_CYLINDER): 2}
    kinds |= {int(mujoco.mjtGeom.mjGEOM_CAPSULE): 2, int(mujoco.mjtGeom.mjGEOM_SPHERE): 1}
    for i in range(model.ngeom):
        n = kinds.get(int(model.geom_type[i]), 0)
        model.geom_size[i, :n] = np.maximum(model.geom_size[i, :n], least)
    # tubes and struts; panels have a material
    model.skin_inflate[model.skin_matid < 0] = least / 2.0


def _camera(
    model: "mujoco.MjModel", points: Array, place: Array, aspect: float
) -> tuple[Any, float]:
    """The camera that sees all `points` `(n, 3)` of a spacecraft whose body is at `place` `(3,)`,
    and the width of what it sees [m]."""
    camera: Any = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = azimuth_of(points, place), ELEVATION
    up = float(np.tan(np.radians(float(model.vis.global_.fovy)) / 2.0))
    frame = view_frame(camera.azimuth, camera.elevation)
    middle, camera.distance = _fit_view(points @ frame, np.array([aspect * up, up]) / MARGIN)
    camera.lookat[:] = frame @ middle
    return camera, 2.0 * float(camera.distance) * up


def azimuth_of(points: Array, place: Array) -> float:
    """Azimuth [degrees] of the view of all `points` `(n, 3)` of a spacecraft whose
    body is at `place` `(3,)`."""
    flat = (points - place)[:, :2]
    out = np.linalg.eigh(flat.T @ flat)[1][:, -1]  # the direction of arrays on both sides too
    out = out if out @ flat.mean(axis=0) >= 0.0 else -out
    return float(np.degrees(np.arctan2(out[1], out[0]))) + AZIMUTH


def view_frame(azimuth: float, elevation: float = ELEVATION) -> Array:
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
