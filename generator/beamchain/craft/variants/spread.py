"""What spreads over the variants of a craft: its coupled frequencies, and the gains of its modes."""

import re
from dataclasses import dataclass

import numpy as np

from beamchain.craft.plants.craft_modes import linear_craft
from beamchain.craft.plants.signals import base
from beamchain.engine.forces import along
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.ports.motions import Array

FILLER = re.compile(r"(?:^|_)filler\d+(?:_(?:xy|xz|torsion|axial)\d*)?$")
ZERO = 1e-12  # relative: squares of frequencies below it are of springs that others make superfluous


@dataclass(frozen=True, eq=False)
class Gain:
    """A pair of signals, as `torque:bus=attitude`, whose modal gains are followed: the numerator over `s^2 + 2 zeta w s + w^2`.

    `force` `(nv, m)` is what the inputs do to the degrees of freedom, `position` and `rate` `(p, nv)` what the outputs read.
    """

    name: str
    unit: str
    force: Array
    position: Array
    rate: Array

    def sizes(self, frequency: Array, shapes: Array) -> Array:
        """`(n,)` largest singular value of the gain of each mode; damping left out."""
        position, rate, force = (
            np.linalg.norm(rows @ shapes, axis=0) for rows in (self.position, self.rate, self.force.T)
        )
        return np.asarray(np.hypot(position, frequency * rate) * force, dtype=np.float64)


def gain(model: "mujoco.MjModel", pair: str) -> Gain:
    """The signals of `INPUT=OUTPUT`, named as for `bc.plant`.

    Raises:
        InputError: a name is unknown, or the signals' gain is not one of second order.
    """
    source, sign, seen = pair.partition("=")
    if not sign or not source or not seen:
        raise InputError(
            f"gain = {pair!r} is not INPUT=OUTPUT; write for example torque:{model.body(base(model)).name}=attitude."
        )
    craft = linear_craft(model, None, None, [source], [seen])
    linear = craft.linear
    if np.any(linear.of_acceleration) or not np.any(linear.force):
        raise InputError(
            f"gain = {pair!r}: only forces and torques (also motors') to positions and rates have modal gains of one "
            "number; give attitude, rate, motion:SITE, or a sensor of such."
        )
    out = dict.fromkeys(unit for one in craft.outputs for unit in one.units)
    into = dict.fromkeys(one.unit or "1" for one in craft.inputs)
    unit = f"{' or '.join(f'({one})' if '/' in one else one for one in out)}/s^2 per {' or '.join(into)}"
    return Gain(pair, unit, linear.force, linear.of_position, linear.of_rate)


def usual_gain(model: "mujoco.MjModel") -> tuple[str, ...]:
    """A torque on the base to its attitude, where the base is free and named."""
    body = base(model)
    joint = int(model.body_jntadr[body])
    free = joint >= 0 and int(model.jnt_type[joint]) == 0
    return (f"torque:{model.body(body).name}=attitude",) if free and model.body(body).name else ()


def normal_shapes(model: "mujoco.MjModel", mass: Array) -> tuple[Array, Array]:
    """`(n,)` coupled frequencies of an untimed model [rad/s], ascending, and `(nv, n)` shapes of unit modal mass.

    Fillers, which only hold what the kept modes leave free, are not counted. `mass`: `(nv, nv)`, at rest.
    """
    tendons, joints = (np.atleast_2d(k.T)[0] for k in (model.tendon_stiffness, model.jnt_stiffness))
    sprung, joints = np.flatnonzero(tendons > 0.0), joints[model.dof_jntid]
    rows = [np.sqrt(tendons[i]) * along(model, int(i)) for i in sprung]
    springs = np.vstack([*rows, (np.sqrt(joints)[:, None] * np.eye(model.nv))[joints > 0.0]])
    spread = np.linalg.solve(mass, springs.T)
    flexible = springs @ spread
    squares, vectors = np.linalg.eigh((flexible + flexible.T) / 2.0)
    keep = squares > ZERO * max(float(np.max(squares, initial=0.0)), 1e-300)
    fillers = sum(FILLER.search(str(model.tendon(int(i)).name)) is not None for i in sprung)
    w = np.sqrt(squares[keep])[: max(int(np.sum(keep)) - fillers, 0)]
    return w, np.asarray((spread @ vectors[:, keep])[:, : w.size] / w, dtype=np.float64)
