"""Timing of many draws of one model whose appendages carry bodies, safe for every draw.

A tendon of stiffness k and damping d has the armature `a = c h^2 k + h d/2` (`steps/tree_time.py`),
and the tree is stable if for every appendage alone

    S + diag(a - h d/2 - h^2 k/4) = S + diag(g) > 0

A draw k' keeps its factor c where that is safe by itself. Where it is not, its armature goes from
there towards `h d'/2 + h^2 k'/4 + max(g, (c - 1/4) h^2 k')`, as far as it has to. All the way it is
safe whatever is drawn, since the left side is then not smaller than with the nominal g. The nominal
draw is the nominal model.

Theory: docs/theory.md, section 9.
"""

import copy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES, is_stable, spare_armature
from beamchain.steps.modal import Modal
from beamchain.steps.retime import retime_by
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
        integrator: str,
        timestep: float,
        band: float | None,
    ) -> "TreeDraws":
        """Of a model without timing; `band` as of `retime`."""
        h = float(timestep)
        timed = copy.copy(model)
        retime_by(5, timed, h, integrator, band=band)
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

    def drawn(self, stiffness: Array, damping: Array) -> DrawnTendons:
        """The tendons of draws, by stiffness and damping `(k, n)` without timing."""
        stiffness = stiffness * self.stiffness
        damping = damping * self.damping
        gap = (self.factor - SCHEMES[self.integrator].limit) * self.timestep**2 * stiffness
        for part in self.parts:
            at = part.tendons
            gap[:, at] = self._safe(part, gap[:, at])
        armature = gap - spare_armature(self.integrator, 0.0, stiffness, damping, self.timestep)
        return DrawnTendons(np.maximum(armature, 0.0), stiffness, damping)

    def _safe(self, part: FreeAppendage, gap: Array) -> Array:
        """`(k, m)` of one appendage: `gap`, or as much above it as is safe."""
        sure = np.maximum(gap, self.gap[part.tendons])
        mass = (1.0 - ROOM) * part.free
        unsafe = np.flatnonzero(~is_stable(mass, gap))
        low = np.zeros((unsafe.size, 1))
        high = np.ones((unsafe.size, 1))
        way = (sure - gap)[unsafe]
        for _ in range(HALVINGS):
            middle = (low + high) / 2.0
            good = is_stable(mass, gap[unsafe] + middle * way)[:, None]
            low, high = np.where(good, low, middle), np.where(good, middle, high)
        out = gap.copy()
        out[unsafe] += high * way
        return out
