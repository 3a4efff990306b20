"""Pictures of a scene with MuJoCo's own renderer."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.library import mujoco
from beamchain.engine.slew import Slew
from beamchain.errors import EngineError
from beamchain.ports.motions import Array

Frame = NDArray[np.uint8]

SLIMMEST = 1.0 / 320.0  # of the picture's extent: thinner solids would vanish
GHOST = 0.3  # opacity of where a rigid appendage would be
MARGIN = 1.12


def film(model: "mujoco.MjModel", slew: Slew, *, exaggerate: float, width: int, height: int) -> Iterator[Frame]:
    """The frames `(height, width, 3)` of a slew, faintly with rigid appendages."""
    camera, extent = _camera(model, slew, exaggerate, width / height)
    _thicken(model, SLIMMEST * extent)
    model.vis.global_.offwidth = max(int(model.vis.global_.offwidth), width)
    model.vis.global_.offheight = max(int(model.vis.global_.offheight), height)
    data, rigid = mujoco.MjData(model), mujoco.MjData(model)
    try:
        renderer: Any = mujoco.Renderer(model, height, width)
    except (ImportError, AttributeError, RuntimeError, mujoco.FatalError) as error:
        raise EngineError(
            f"MuJoCo cannot draw here ({' '.join(str(error).split())[:120]}); set MUJOCO_GL to egl or osmesa before "
            "the process starts."
        ) from None
    hub = model.body(slew.body).id
    try:
        for k in range(slew.times.size):
            for state, factor in ((data, exaggerate), (rigid, 0.0)):
                state.qpos[:] = slew.shown(k, factor)
                mujoco.mj_kinematics(model, state)
                mujoco.mj_comPos(model, state)
                mujoco.mj_camlight(model, state)
            renderer.update_scene(data, camera)
            _ghosts(model, rigid, renderer.scene, hub)
            yield renderer.render().copy()
    finally:
        renderer.close()


def _ghosts(model: "mujoco.MjModel", rigid: "mujoco.MjData", scene: Any, hub: int) -> None:
    before = int(scene.ngeom)
    everything = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
    mujoco.mjv_addGeoms(model, rigid, mujoco.MjvOption(), mujoco.MjvPerturb(), everything, scene)
    for i in range(before, int(scene.ngeom)):
        geom = scene.geoms[i]
        own = int(geom.objtype) == int(mujoco.mjtObj.mjOBJ_GEOM) and int(model.geom_bodyid[geom.objid]) != hub
        geom.rgba[3] = GHOST if own else 0.0


def _thicken(model: "mujoco.MjModel", least: float) -> None:
    kinds = {int(mujoco.mjtGeom.mjGEOM_BOX): 3, int(mujoco.mjtGeom.mjGEOM_CYLINDER): 2}
    kinds |= {int(mujoco.mjtGeom.mjGEOM_CAPSULE): 2, int(mujoco.mjtGeom.mjGEOM_SPHERE): 1}
    for i in range(model.ngeom):
        n = kinds.get(int(model.geom_type[i]), 0)
        model.geom_size[i, :n] = np.maximum(model.geom_size[i, :n], least)


def _camera(model: "mujoco.MjModel", slew: Slew, exaggerate: float, aspect: float) -> tuple[Any, float]:
    """A camera that sees the whole film, and the width of what it sees [m]."""
    points, mean = _swept(model, slew, exaggerate)
    heading = np.degrees(np.arctan2(mean[1], mean[0]))
    azimuth, elevation = {0: (heading + 55.0, -25.0), 1: (heading + 75.0, -14.0), 2: (heading + 78.0, -38.0)}[slew.axis]
    camera: Any = mujoco.MjvCamera()
    az, el = np.radians([azimuth, elevation])
    forward = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    right = np.array([np.sin(az), -np.cos(az), 0.0])
    frame = np.column_stack([right, np.cross(right, forward), forward])
    seen = points @ frame
    centre = (seen.max(axis=0) + seen.min(axis=0)) / 2.0
    seen = np.abs(seen - centre)
    tangent = np.tan(np.radians(float(model.vis.global_.fovy)) / 2.0)
    across = np.maximum(seen[:, 0] / aspect, seen[:, 1]) / tangent
    distance = MARGIN * float(np.max(across + seen[:, 2]))
    camera.lookat[:] = frame @ centre
    camera.distance, camera.azimuth, camera.elevation = distance, azimuth, elevation
    return camera, 2.0 * distance * float(tangent)


def _swept(model: "mujoco.MjModel", slew: Slew, exaggerate: float) -> tuple[Array, Array]:
    """`(n, 3)` points that solids reach, and the mean direction from the hub."""
    data = mujoco.MjData(model)
    hub = model.body(slew.body).id
    points: list[Array] = []
    outwards = np.zeros(3)
    for k in range(0, slew.times.size, max(slew.times.size // 24, 1)):
        data.qpos[:] = slew.shown(k, exaggerate)
        mujoco.mj_kinematics(model, data)
        for i in range(model.ngeom):
            box = data.geom_xmat[i].reshape(3, 3) * model.geom_aabb[i, 3:]
            corners = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
            points.append(data.geom_xpos[i] + corners @ box.T)
            outwards += data.geom_xpos[i] - data.xpos[hub]
    return np.vstack(points), outwards
