"""Timing of many draws of one model whose appendages carry bodies, safe for every draw of their
modes and of what they carry.

A tendon of stiffness k and damping d has the armature `a = c h^2 k + h d/2` (`steps/tree_time.py`),
and the tree is stable if for every appendage alone

    S + diag(a - h d/2 - h^2 k/4) = S + diag(g) > 0

A draw k' keeps its factor c where that is safe by itself. Where it is not, its armature goes from
there towards `h d'/2 + h^2 k'/4 + max(g, (c - 1/4) h^2 k')`, as far as it has to. All the way it is
safe whatever is drawn, since the left side is then not smaller than with the nominal g. Where the
participation is drawn, S differs, and the way ends at g >= 0, of which S > 0 is all that is asked.
The nominal draw is the nominal model.

Theory: docs/theory.md, section 9.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES, is_stable, spare_armature
from beamchain.steps.modal import Modal, TimingMark, participating
from beamchain.steps.tree_time import ROOM, FreeAppendage, appendages_alone

HALVINGS = 10  # of the way to the armature that is safe for sure


class DrawnTendons(NamedTuple):
    """`(k, n)` of the modal tendons of k draws."""

    armature: Array
    stiffness: Array
    damping: Array


@dataclass(frozen=True, eq=False)
class TreeDraws:
    """The timing of a nominal model, carried over to draws of its modes.

    Args:
        integrator: MuJoCo's name.
        timestep: [s].
        factor: `(n,)` c.
        gap: `(n,)` g.
        stiffness, damping: `(n,)` timed over nominal.
        parts: the appendages alone.
    """

    integrator: str
    timestep: float
    factor: Array
    gap: Array
    stiffness: Array
    damping: Array
    parts: tuple[FreeAppendage, ...]

    @classmethod
    def of(
        cls,
        model: "mujoco.MjModel",
        modal: Modal,
        timed: "mujoco.MjModel",
        mark: TimingMark,
    ) -> "TreeDraws":
        """Of a model without timing, and of it as form 5 has `timed` it."""
        h, integrator, _ = mark
        at = modal.index
        armature = np.asarray(timed.tendon_armature - model.tendon_armature)[at]
        stiffness = np.array(timed.tendon_stiffness)[at]
        damping = np.array(timed.tendon_damping)[at]
        lag = SCHEMES[integrator].lag
        return cls(
            integrator,
            h,
            factor=(armature - lag * h * damping) / (h**2 * stiffness),
            gap=spare_armature(integrator, armature, stiffness, damping, h),
            stiffness=stiffness / modal.stiffness,
            damping=np.where(modal.damping > 0.0, damping / np.maximum(modal.damping, 1e-300), 1.0),
            parts=tuple(appendages_alone(model, modal)),
        )

    def drawn(self, stiffness: Array, damping: Array, participation: Array) -> DrawnTendons:
        """The tendons of draws, by stiffness and damping `(k, n)` without timing, and by the
        participation over the nominal one."""
        stiffness = stiffness * self.stiffness
        damping = damping * self.damping
        gap = (self.factor - SCHEMES[self.integrator].limit) * self.timestep**2 * stiffness
        for part in self.parts:
            at = part.tendons
            mass = (1.0 - ROOM) * participating(part.free, participation[:, at])
            other = np.any(participation[:, at] != 1.0, axis=1)[:, None]
            sure = np.where(other, np.maximum(self.gap[at], 0.0), self.gap[at])
            gap[:, at] = _safe_gap(mass, gap[:, at], np.maximum(gap[:, at], sure))
        armature = gap - spare_armature(self.integrator, 0.0, stiffness, damping, self.timestep)
        return DrawnTendons(np.maximum(armature, 0.0), stiffness, damping)


def _safe_gap(mass: Array, gap: Array, sure: Array) -> Array:
    """`(k, m)` of one appendage: `gap`, or as much of the way from there to `sure` as is safe."""
    unsafe = np.flatnonzero(~is_stable(mass, gap))
    low = np.zeros((unsafe.size, 1))
    high = np.ones((unsafe.size, 1))
    way = (sure - gap)[unsafe]
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        good = is_stable(mass[unsafe], gap[unsafe] + middle * way)[:, None]
        low, high = np.where(good, low, middle), np.where(good, middle, high)
    out = gap.copy()
    out[unsafe] += high * way
    return out
