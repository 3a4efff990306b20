"""What a spacecraft is to an appendage, read from the compiled model: frame,
hub behind the port, Jacobian."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from beamchain.engine.bench import frozen_mass, mass_of_bodies
from beamchain.engine.library import hangs_on, mujoco, rest, rotation_matrix
from beamchain.engine.linearise import mass_matrix
from beamchain.errors import InputError
from beamchain.ports.motions import (
    PORT_MOTION,
    PORTS,
    UPRIGHT,
    Array,
    Quaternion,
    offset_matrix,
)

JOINT_KINDS = {0: "free", 1: "ball", 2: "slide", 3: "hinge"}
HELD = 1e9  # mass of a motion that is held, relative to the largest that is not
RANK = 1e-9  # relative singular value below which a motion of the port is held


class CarrierJoint(NamedTuple):
    """A joint between port and world; `own`: it carries the whole spacecraft; `holder`: "spring"
    or "servo", empty where it is loose."""

    name: str
    kind: str
    own: bool
    holder: str

    @property
    def sprung(self) -> bool:
        """Whether a spring or a position servo holds it."""
        return bool(self.holder)

    @property
    def words(self) -> str:
        """Its kind and its name, or its number: `hinge joint drive`, `free joint 0`."""
        return f"{self.kind} joint {self.name.removeprefix('joint ')}"


@dataclass(frozen=True, eq=False)
class Mount:
    """The place of an appendage in a compiled spacecraft at rest: port in its body,
    and in the world (axes in columns).

    `hub` `(6, 6)`: what is rigidly behind the port; `jacobian` `(6, nv)`: motion of the port;
    both in its axes.
    """

    at: str
    body: int
    position: Array
    quaternion: Array
    origin: Array
    axes: Array
    top: int
    joints: tuple[CarrierJoint, ...]
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
        """`(6, 6)` motion of another port of the same body per motion of this one."""
        here, there = (np.kron(np.eye(2), axes) for axes in (self.axes, other.axes))
        return there.T @ offset_matrix(other.origin - self.origin) @ here


def mount(
    model: "mujoco.MjModel",
    at: str,
    kind: str,
    name: str,
    *,
    reach: float = 0.0,
    turn: Quaternion = UPRIGHT,
) -> Mount:
    """Read a mount, a "site" or "body", from a compiled spacecraft.

    Args:
        model: the bare spacecraft.
        at, kind, name: the place, as it was given, and what it is.
        reach: the port lies so far out along the place's x axis [m], at the end of another
            appendage.
        turn: attitude of the appendage's root on the place.
    """
    data = rest(model)
    place = int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))
    if place < 0:
        raise InputError(
            f"--mount {at}: the compiled spacecraft has no {kind} {name!r}; name one that is "
            "written out."
        )
    if kind == "site":
        body = int(model.site_bodyid[place])
        position = model.site_pos[place].copy()
        quaternion = model.site_quat[place].copy()
        origin = data.site_xpos[place].copy()
        axes = data.site_xmat[place].reshape(3, 3).copy()
    else:
        body = place
        position = np.zeros(3)
        quaternion = np.array([1.0, 0.0, 0.0, 0.0])
        origin = data.xpos[body].copy()
        axes = data.xmat[body].reshape(3, 3).copy()
    origin = origin + reach * axes[:, 0]
    position = position + reach * rotation_matrix(quaternion)[:, 0]
    if turn != UPRIGHT:
        axes = axes @ rotation_matrix(np.array(turn))
        given = quaternion.copy()
        mujoco.mju_mulQuat(quaternion, given, np.array(turn))
    top = int(model.body_weldid[body])
    if top == 0:
        raise InputError(
            f"--mount {at}: {kind} {name!r} belongs to a body welded to the world, which no "
            "appendage can move; give the spacecraft's body a <freejoint/>, or name a body that "
            "moves."
        )
    return Mount(
        at,
        body,
        position,
        quaternion,
        origin,
        axes,
        top,
        _carriers(model, top),
        frozen_mass(model, data, top, origin, axes),
        motion(model, data, body, origin, axes),
    )


def motion(
    model: "mujoco.MjModel", data: "mujoco.MjData", body: int, origin: Array, axes: Array
) -> Array:
    """`(6, nv)` motion of a frame on a body, in the frame's axes (columns of `axes`)."""
    translation = np.zeros((3, model.nv))
    rotation = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, translation, rotation, origin, body)
    return np.vstack([axes.T @ translation, axes.T @ rotation])


def _carriers(model: "mujoco.MjModel", top: int) -> tuple[CarrierJoint, ...]:
    held = held_joints(model)
    out: list[CarrierJoint] = []
    while top:
        parent = int(model.body_weldid[int(model.body_parentid[top])])
        first = int(model.body_jntadr[top])
        for j in range(first, first + int(model.body_jntnum[top])):
            name = model.joint(j).name or f"joint {j}"
            out.append(
                CarrierJoint(
                    name, JOINT_KINDS[int(model.jnt_type[j])], parent == 0, held.get(j, "")
                )
            )
        top = parent
    return tuple(out)


def held_joints(model: "mujoco.MjModel") -> dict[int, str]:
    """Joints that a "servo" or a "spring" holds."""
    servos = (model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)) & (
        model.actuator_biasprm[:, 1] < 0.0
    )
    return {
        **dict.fromkeys(model.actuator_trnid[servos, 0].tolist(), "servo"),
        **dict.fromkeys(np.flatnonzero(model.jnt_stiffness > 0.0).tolist(), "spring"),
    }


def rigid_hubs(
    model: "mujoco.MjModel",
    mounts: Sequence[Mount],
    rigid: Mapping[str, Array],
    riding: Mapping[str, tuple[Sequence[int], Collection[str]]],
) -> dict[str, Array]:
    """`(6, 6)` what is rigidly behind each port, by name; `rigid`: of appendages.

    `riding`: bodies and appendages that the appendage itself carries, which are not behind it.
    """
    out: dict[str, Array] = {}
    data = rest(model)
    for own in mounts:
        bodies, places = riding[own.at]
        total = own.hub - mass_of_bodies(model, data, bodies, own.origin, own.axes)
        for other in mounts:
            is_behind = other.at != own.at and other.at not in places
            if is_behind and hangs_on(model, other.top, own.top):
                motion = own.from_port(other)
                total += motion.T @ rigid[other.at] @ motion
        out[own.at] = (total + total.T) / 2.0
    return out


def apparent_hubs(
    model: "mujoco.MjModel", mounts: Sequence[Mount], rigid: Mapping[str, Array]
) -> dict[str, Array]:
    """`(6, 6)` hub that each port feels, by name: `(J M^-1 J^T)^-1`, loose joints free,
    sprung ones locked unless there are no others.

    Motions that the spacecraft's joints hold get 1e9 times the largest mass.
    """
    held = held_joints(model)
    loose = [i for i in range(model.nv) if int(model.dof_jntid[i]) not in held]
    bare = mass_matrix(model)
    out: dict[str, Array] = {}
    for own in mounts:
        mass = bare.copy()
        for other in mounts:
            if other.at != own.at:
                mass += other.jacobian.T @ rigid[other.at] @ other.jacobian
        # where springs hold all that moves the port, they give way
        moves = [i for i in loose if np.any(own.jacobian[:, i] != 0.0)]
        free = loose if moves else list(range(model.nv))
        jacobian = own.jacobian[:, free]
        mobility = jacobian @ np.linalg.solve(mass[np.ix_(free, free)], jacobian.T)
        scale = np.sqrt(np.diag(own.hub))
        values, vectors = np.linalg.eigh(mobility * np.outer(scale, scale))
        moving = values > RANK * values.max()
        masses = np.where(moving, 1.0 / np.where(moving, values, 1.0), HELD / values[moving].min())
        hub = (vectors * masses) @ vectors.T * np.outer(scale, scale)
        out[own.at] = (hub + hub.T) / 2.0
    return out


def root_frame(mount: Mount, data: "mujoco.MjData") -> tuple[Array, Array]:
    """Origin `(3,)` and axes `(3, 3)`, in columns, of an appendage's root in the world."""
    frame = data.xmat[mount.body].reshape(3, 3)
    origin = data.xpos[mount.body] + frame @ mount.position
    return origin, frame @ rotation_matrix(mount.quaternion)
