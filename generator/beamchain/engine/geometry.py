"""Where what is drawn of a model stands: corners of its solids, vertices of its skins."""

from itertools import product

import numpy as np

from beamchain.engine.library import mujoco, rotation_matrix
from beamchain.ports.motions import Array

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def drawn_points(model: "mujoco.MjModel", data: "mujoco.MjData") -> Array:
    """`(n, 3)` corners of all solids that are seen, and vertices of skins [m].

    `data` has its kinematics ready. A plane has no corners.
    """
    points = [skin_vertices(model, data, skin) for skin in range(model.nskin)]
    for i in range(model.ngeom):
        if model.geom_type[i] == int(mujoco.mjtGeom.mjGEOM_PLANE) or not model.geom_rgba[i, 3]:
            continue
        box = CORNERS * model.geom_aabb[i, 3:] + model.geom_aabb[i, :3]
        points.append(data.geom_xpos[i] + box @ data.geom_xmat[i].reshape(3, 3).T)
    return np.concatenate([np.zeros((0, 3)), *points])


def skin_vertices(model: "mujoco.MjModel", data: "mujoco.MjData", skin: int) -> Array:
    """`(v, 3)` vertices of a skin, `sum_i w_i (x_i + R_i (p - b_i))` over its bones [m]."""
    first = int(model.skin_vertadr[skin])
    bound = np.array(model.skin_vert[first : first + int(model.skin_vertnum[skin])], np.float64)
    vertices = np.zeros_like(bound)
    bones = int(model.skin_boneadr[skin]) + np.arange(int(model.skin_bonenum[skin]))
    for bone in bones.tolist():
        start = int(model.skin_bonevertadr[bone])
        carried = slice(start, start + int(model.skin_bonevertnum[bone]))
        ids = model.skin_bonevertid[carried]
        weights = np.asarray(model.skin_bonevertweight[carried], dtype=np.float64)
        body = int(model.skin_bonebodyid[bone])
        turn = rotation_matrix(np.array(model.skin_bonebindquat[bone], dtype=np.float64))
        # from the body's frame where it was bound, to where it is
        inside = (bound[ids] - model.skin_bonebindpos[bone]) @ turn
        placed = data.xpos[body] + inside @ data.xmat[body].reshape(3, 3).T
        vertices[ids] += weights[:, None] * placed
    return vertices
