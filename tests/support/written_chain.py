"""What an exported chain along x is made of, as plain MuJoCo compiles it: rigid bodies,
hinges and point masses.

A planar chain of rods moves as point masses at its hinges on massless rods do (`nodes`), however
the mass at a hinge is shared between the two bodies that meet there.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from readback import compiled


@dataclass(frozen=True)
class Body:
    """A rigid body: `start` and `com` along x from the root, `inertia` about its centre,
    in axes of the appendage."""

    start: float
    mass: float
    com: float
    inertia: np.ndarray

    def moments_fit_together(self, rounding: float = 1e-12) -> bool:
        """Whether a rigid body has such a mass and such moments of inertia."""
        a, b, c = np.linalg.eigvalsh(self.inertia)
        return self.mass > 0.0 and a > 0.0 and a + b >= c * (1.0 - rounding)


@dataclass(frozen=True)
class Hinge:
    """Where it is along x from the root, and its springs and dampers per port."""

    x: float
    stiffness: dict
    damping: dict


@dataclass(frozen=True)
class Written:
    """Bodies and hinges from the root outwards, and the length from root to tip."""

    bodies: tuple
    hinges: tuple
    length: float

    def planar(self, port: str = "xy") -> tuple[list, list]:
        """What `dense_port` takes: (mass, x, inertia) per body and (x, stiffness) per hinge."""
        axis = {"xy": 2, "xz": 1}[port]
        bodies = [(body.mass, body.com, body.inertia[axis, axis]) for body in self.bodies]
        return bodies, [(hinge.x, hinge.stiffness[port]) for hinge in self.hinges]

    def nodes(self, port: str = "xy") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Point masses `(N + 1,)`, lengths of the rods between them `(N,)` and springs `(N - 1,)`
        of a planar chain."""
        axis = {"xy": 2, "xz": 1}[port]
        masses, lengths = [0.0], []
        for body in self.bodies:
            arm = body.com - body.start
            first = body.mass * arm
            second = body.inertia[axis, axis] + body.mass * arm**2
            # a mass b at the end of a rod l: first = b l, second = b l^2;
            # at the root all of it may stand there
            lengths.append(second / first if first > 0.0 else 0.0)
            outer = first**2 / second if first > 0.0 else body.mass
            masses[-1] += body.mass - outer
            masses.append(outer)
        springs = [hinge.stiffness[port] for hinge in self.hinges]
        return np.array(masses), np.array(lengths), np.array(springs)


def read_chain(source) -> Written:
    """The bodies and hinges of an exported appendage (path or text), from the compiled model."""
    model, data = compiled(source)
    root = data.xpos[1, 0]
    bodies, hinges = [], {}
    for i in range(1, model.nbody):
        turn = data.ximat[i].reshape(3, 3)
        inertia = turn @ np.diag(model.body_inertia[i]) @ turn.T
        bodies.append(
            Body(
                float(data.xpos[i, 0] - root),
                float(model.body_mass[i]),
                float(data.xipos[i, 0] - root),
                inertia,
            )
        )
    for j in range(model.njnt):
        x = float(data.xanchor[j, 0] - root)
        port = model.joint(j).name.rpartition("_")[2]
        hinge = hinges.setdefault(int(model.jnt_bodyid[j]), Hinge(x, {}, {}))
        hinge.stiffness[port] = float(np.ravel(model.jnt_stiffness[j])[0])
        hinge.damping[port] = float(np.ravel(model.dof_damping[model.jnt_dofadr[j]])[0])
    tips = [i for i in range(model.nsite) if model.site(i).name.endswith("_tip")]
    length = float(data.site_xpos[tips[0], 0] - root) if tips else float("nan")
    return Written(tuple(bodies), tuple(hinges.values()), length)


def joints_of(model: "mujoco.MjModel", port: str) -> list[int]:
    """Degrees of freedom of the hinges that move in a port, by the ends of their names."""
    return [
        int(model.jnt_dofadr[j])
        for j in range(model.njnt)
        if model.joint(j).name.endswith(f"_{port}")
    ]
