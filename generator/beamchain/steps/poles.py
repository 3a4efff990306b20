"""What the craft shows at its step: every oscillating pole wanted and achieved, and what another step makes of it."""

import copy
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from beamchain.caution import Caution
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS, linearise, system_matrix
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES, Complex, seen, step_pole
from beamchain.steps.modal import modal_tendons
from beamchain.steps.retime import retime

AT_REST = 1e-5  # poles nearer to 1 than this are rigid motion
OVERDAMPED = 1e-9  # imaginary part, relative, below which a pole does not oscillate
GROWN = 1e-6  # negative damping ratio beyond rounding


@dataclass(frozen=True)
class PoleRow:
    """One oscillating mode of the craft.

    Args:
        frequency: [rad/s] `|s|` of the model with timing taken out.
        ratio: of damping, likewise.
        achieved_frequency: that the step shows, `|log(z)|/h`.
        achieved_ratio: likewise.
        slowed: it turns by more than the model's phase limit.
    """

    frequency: float
    ratio: float
    achieved_frequency: float
    achieved_ratio: float
    slowed: bool

    @property
    def grows(self) -> bool:
        """Whether the step makes it grow."""
        return self.achieved_ratio < -GROWN

    @property
    def error(self) -> float:
        """`|s' - s|/|s|`: of frequency and damping together."""
        wanted, got = (
            w * complex(-z, np.sqrt(max(1.0 - z**2, 0.0)))
            for w, z in ((self.frequency, self.ratio), (self.achieved_frequency, self.achieved_ratio))
        )
        return abs(got - wanted) / abs(wanted)


def pole_rows(model: "mujoco.MjModel") -> list[PoleRow]:
    """Every oscillating mode of a craft at its own step and integrator, against the same craft without timing."""
    plain = copy.copy(model)
    if modal_tendons(plain).names:
        retime(plain, 0.0)
    linear = linearise(plain)
    wanted = _oscillating(system_matrix(linear.stiffness, linear.damping))
    h = float(model.opt.timestep)
    z = np.linalg.eigvals(step_matrix(model)).astype(np.complex128)
    z = z[(np.abs(z - 1.0) > AT_REST) & (z.imag > -1e-12)]
    s = np.log(z) / h
    if wanted.size == 0 or s.size == 0:
        return []
    turn = np.abs(wanted) * h
    phase = phase_limit(model)
    shown = np.where(turn > phase, phase / turn, 1.0) * wanted
    cost = np.abs(s[None, :] - shown[:, None]) / np.abs(shown)[:, None]
    rows, columns = linear_sum_assignment(np.minimum(cost, 1e6))
    return [
        PoleRow(
            float(np.abs(wanted[i])), float(-wanted[i].real / np.abs(wanted[i])) + 0.0, float(np.abs(s[j])),
            float(-s[j].real / np.abs(s[j])) + 0.0, bool(turn[i] > phase),
        )
        for i, j in zip(rows, columns, strict=True)
    ]  # fmt: skip


def phase_limit(model: "mujoco.MjModel") -> float:
    """[rad] per step beyond which modes were slowed; infinity where none is retimed."""
    modal = modal_tendons(model)
    marks = [mark for mark in modal.made_for if mark is not None]
    if not marks:
        return float("inf")
    limits = [SCHEMES[mark.integrator].phase for mark in marks]
    for i, k, mark in zip(modal.index, modal.stiffness, modal.made_for, strict=True):
        if mark is not None:
            z = step_pole(mark.integrator, 1.0 + model.tendon_armature[i], model.tendon_damping[i], k, mark.timestep)
            shown = float(np.abs(np.log(z)))
            if np.sqrt(k) * mark.timestep > 1.2 * shown:  # nothing but slowing shifts a mode so far
                limits.append(shown)
    return min(limits)


def step_matrix(model: "mujoco.MjModel") -> Array:
    """`(2 nv, 2 nv)` one step of the model's own integrator, states (position, velocity)."""
    return linearise(model).a[: 2 * model.nv, : 2 * model.nv]


def _oscillating(f: Array) -> Complex:
    s = np.linalg.eigvals(f).astype(np.complex128)
    fastest = float(np.max(np.abs(s), initial=0.0))
    # rigid motion is a double pole at 0, which moves by the root of the rounding
    s = s[(s.imag > OVERDAMPED * np.abs(s)) & (np.abs(s) > AT_REST * fastest)]
    return s[np.argsort(np.abs(s))]


def mismatch(model: "mujoco.MjModel") -> list[str]:
    """Sentences where a model runs at another step or integrator than it was made for."""
    modal = modal_tendons(model)
    h, name = float(model.opt.timestep), NUMBERS[int(model.opt.integrator)]
    out: list[str] = []
    for mark in dict.fromkeys(mark for mark in modal.made_for if mark is not None):
        pair = {mark.integrator, name}
        if mark.timestep == h and (len(pair) == 1 or pair == {"implicit", "implicitfast"}):
            continue
        mine = [j for j, other in enumerate(modal.made_for) if other == mark]
        index = modal.index[mine]
        m, c, k = 1.0 + model.tendon_armature[index], model.tendon_damping[index], modal.stiffness[mine]
        w, _ = seen(step_pole(mark.integrator, m, c, k, mark.timestep), mark.timestep)
        z = step_pole(name, m, c, k, h)
        sentence = (
            f"the appendage of tendon {modal.names[mine[0]]!r} was made exact for {mark.integrator} at {mark.timestep:g} s, "
            f"but the model runs {name} at {h:g} s: "
        )
        if np.any(np.abs(z) > 1.0 + 1e-9):
            sentence += "that is unstable"
        else:
            kept = w >= np.sqrt(k) / 1.2
            shown, _ = seen(z, h)
            worst = np.max(np.abs(shown / np.sqrt(k) - 1.0)[kept], initial=0.0)
            sentence += f"its frequencies are off by up to {worst:.2g}"
        out.append(Caution("other-step", f"{sentence}; retime it for this step, or run it at its own."))
    return out
