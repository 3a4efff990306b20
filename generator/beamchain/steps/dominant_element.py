"""What makes a step unstable: the spring, servo or tendon that carries the pole which grows.

Appendages that are stable without the springs around them, as with timing, are not to blame for it.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array
from beamchain.steps.elements import Element, elements
from beamchain.steps.step_map import Motion, motion_at

SAFE = 0.9  # of a largest stable step
HALVINGS = 6
LEAST = 1e-6  # of the step that was tried: no shorter one is looked for
STOPPED = 1e-2  # of what a pole grows by: growth below it is none


class Culprit(NamedTuple):
    """The element that carries most of a growing pole.

    Args:
        name: of its joint or tendon.
        kind: "spring", "servo" or "appendage".
        words: the element in words.
        share: of the energy of the motion that grows.
        growth: factor per step.
        frequency: of that motion, in continuous time [rad/s].
        damps: whether its damper does it, taken at the start of the step, and not its spring.
        moves: the inertia that it moves, all else loose, in words; empty where it is no joint's.
    """

    name: str
    kind: str
    words: str
    share: float
    growth: float
    frequency: float
    damps: bool = False
    moves: str = ""


def culprit(model: "mujoco.MjModel", qpos: Array) -> Culprit:
    """What carries the pole of the model's step at a pose that grows most."""
    motion = motion_at(model, qpos)
    n, h = motion.squares.size, motion.timestep
    values, vectors = np.linalg.eig(motion.difference)
    k = int(np.argmax(np.abs(1.0 + values)))
    shape = motion.shapes @ vectors[:n, k]
    rate = motion.shapes @ vectors[n:, k] / h
    every = elements(model, qpos)
    found = [
        (
            element.stiffness * np.abs(element.row @ shape) ** 2,
            h * element.explicit * element.damping * np.abs(element.row @ rate) ** 2,
            element,
        )
        for element in every
    ]
    total = max(sum(spring + damper for spring, damper, _ in found), 1e-300)
    around = [element for element in every if element.kind != "appendage"]
    growth = float(np.abs(1.0 + values[k]))
    if around and _growth_without(motion, around) - 1.0 < STOPPED * (growth - 1.0):
        found = [part for part in found if part[2].kind != "appendage"]
    nothing = Element(
        np.zeros(model.nv), 0.0, 0.0, 0.0, "of the spacecraft", "spring", "the spacecraft"
    )
    spring, damper, element = max(
        found, key=lambda part: part[0] + part[1], default=(0.0, 0.0, nothing)
    )
    row = element.row / max(float(np.linalg.norm(element.row)), 1e-300)
    yields = float(np.sum((row @ motion.shapes) ** 2))  # M^-1 = shapes shapes^T
    of_joint = element.kind != "appendage" and np.count_nonzero(row) == 1 and yields > 0.0
    moved = vectors[:n, k]
    frequency = np.sqrt(
        np.abs(motion.squares) @ np.abs(moved) ** 2 / max(float(np.sum(np.abs(moved) ** 2)), 1e-300)
    )
    return Culprit(
        element.name,
        element.kind,
        element.words,
        float((spring + damper) / total),
        growth,
        float(frequency),
        bool(damper > spring),
        inertia_words(model, int(np.argmax(np.abs(row))), 1.0 / yields) if of_joint else "",
    )


def _growth_without(motion: Motion, springs: Sequence[Element]) -> float:
    """The largest |z| of the step without some springs."""
    rows = np.array([element.row for element in springs]) @ motion.shapes
    stiffness = np.array([element.stiffness for element in springs])
    nothing = np.zeros_like(stiffness)
    return float(motion.with_tendons(rows, -stiffness, nothing, nothing).growth)


def stable_step(grows: Callable[[float], bool], step: float) -> float:
    """A step below one that is unstable at which nothing grows,
    close to the largest and rounded down [s]; 0 without one."""
    low = step / 2.0
    while low > LEAST * step and grows(low):
        low /= 2.0
    if low <= LEAST * step:
        return 0.0
    top = 2.0 * low
    for _ in range(HALVINGS):
        middle = (low + top) / 2.0
        low, top = (low, middle) if grows(middle) else (middle, top)
    digit = 10.0 ** (np.floor(np.log10(SAFE * low)) - 1.0)
    return float(np.floor(SAFE * low / digit) * digit)


def inertia_words(model: "mujoco.MjModel", dof: int, value: float) -> str:
    """An inertia that a degree of freedom moves, in words."""
    kind = int(model.jnt_type[int(model.dof_jntid[dof])])
    return f"{value:.3g} {'kg' if kind == int(mujoco.mjtJoint.mjJNT_SLIDE) else 'kg m^2'}"
