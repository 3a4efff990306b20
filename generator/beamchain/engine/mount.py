"""What a spacecraft is to an appendage, read from the compiled model: frame, hub behind the port, Jacobian."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from beamchain.engine.bench import frozen_mass
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.port import PORT_MOTION, PORTS, Array

JOINT_KINDS = {0: "free", 1: "ball", 2: "slide", 3: "hinge"}
RANK = 1e-9  # relative singular value below which a motion of the port is held


@dataclass(frozen=True, eq=False)
class Mount:
    """The place of an appendage in a compiled spacecraft at rest.

    Args:
        at: name as given.
        body: id of the body.
        position, quaternion: of the port in that body.
        origin, axes: `(3,)`, `(3, 3)` of the port in the world, axes in columns.
        top: id of the body on top of what is rigid with `body`.
        joints: name and kind of the joints that carry `top`.
        hub: `(6, 6)` what is rigidly behind the port, with all that hangs on it, about the port in its axes.
        jacobian: `(6, nv)` motion of the port in its axes per degree of freedom.
    """

    at: str
    body: int
    position: Array
    quaternion: Array
    origin: Array
    axes: Array
    top: int
    joints: tuple[tuple[str, str], ...]
    hub: Array
    jacobian: Array

    def held(self, ports: Iterable[str] = PORTS) -> list[str]:
        """Ports that the spacecraft's own joints hold, wholly or in part."""
        out: list[str] = []
        scale = max(float(np.abs(self.jacobian).max(initial=0.0)), 1e-300)
        for port in ports:
            rows = PORT_MOTION[port].T @ self.jacobian
            if rows.size == 0 or np.linalg.matrix_rank(rows, tol=RANK * scale) < rows.shape[0]:
                out.append(port)
        return out

    def from_port(self, other: "Mount") -> Array:
        """`(6, 6)` motion of another port, in its own axes, per motion of this one, both on one rigid body."""
        arm = other.origin - self.origin
        x, y, z = arm
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turn = other.axes.T @ self.axes
        return np.block([[turn, -other.axes.T @ cross @ self.axes], [np.zeros((3, 3)), turn]])


def mount(model: "mujoco.MjModel", at: str, kind: str, name: str) -> Mount:
    """Read a mount from a compiled spacecraft.

    Args:
        model: the spacecraft.
        at: name as the user gave it.
        kind: "site" or "body".
        name: of the site or body.

    Raises:
        InputError: the body is static.
    """
    data = rest(model)
    place = int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))
    if place < 0:
        raise InputError(f"--at {at}: the compiled spacecraft has no {kind} {name!r}; name one that is written out.")
    if kind == "site":
        body = int(model.site_bodyid[place])
        position, quaternion = model.site_pos[place].copy(), model.site_quat[place].copy()
        origin, axes = data.site_xpos[place].copy(), data.site_xmat[place].reshape(3, 3).copy()
    else:
        body = place
        position, quaternion = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        origin, axes = data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()
    top = int(model.body_weldid[body])
    if top == 0:
        raise InputError(
            f"--at {at}: {kind} {name!r} belongs to a body welded to the world, which no appendage can move; give the "
            "spacecraft's body a <freejoint/>, or name a body that moves."
        )
    first = int(model.body_jntadr[top])
    joints = tuple(
        (model.joint(j).name or f"joint {j}", JOINT_KINDS[int(model.jnt_type[j])])
        for j in range(first, first + int(model.body_jntnum[top]))
    )
    translation, rotation = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, translation, rotation, origin, body)
    return Mount(
        at, body, position, quaternion, origin, axes, top, joints,
        frozen_mass(model, data, top, origin, axes), np.vstack([axes.T @ translation, axes.T @ rotation]),
    )  # fmt: skip


def rest(model: "mujoco.MjModel") -> "mujoco.MjData":
    """Data at the rest pose, kinematics and Jacobians ready."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_crb(model, data)
    return data


def full_mass(model: "mujoco.MjModel") -> Array:
    """`(nv, nv)` mass matrix at the rest pose, through `mj_mulM`, which all versions share."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    out, column = np.zeros((model.nv, model.nv)), np.zeros(model.nv)
    for i, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, column, unit)
        out[:, i] = column
    return (out + out.T) / 2.0


def hub_with_others(model: "mujoco.MjModel", mounts: Sequence[Mount], rigid: Mapping[str, Array]) -> dict[str, Array]:
    """`(6, 6)` hub seen by each port: the spacecraft behind it with all other appendages rigid, by name.

    Args:
        model: the bare spacecraft.
        mounts: of all appendages.
        rigid: `(6, 6)` rigid mass of each appendage about its own port, by name.
    """
    out: dict[str, Array] = {}
    for own in mounts:
        total = own.hub.copy()
        for other in mounts:
            if other.at != own.at and _hangs_on(model, other.top, own.top):
                motion = own.from_port(other)
                total += motion.T @ rigid[other.at] @ motion
        out[own.at] = (total + total.T) / 2.0
    return out


def _hangs_on(model: "mujoco.MjModel", body: int, top: int) -> bool:
    while body not in (0, top):
        body = int(model.body_parentid[body])
    return body == top
