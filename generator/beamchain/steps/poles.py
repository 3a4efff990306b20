"""What the craft shows at its step: every oscillating pole wanted and achieved,
and what another step makes of it."""

import copy
from dataclasses import dataclass

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES, apparent_pole, step_pole
from beamchain.steps.modal import modal_tendons
from beamchain.steps.retime import retime
from beamchain.steps.step_map import GROWN, at_step_of, motion_at, pole_pairs
from beamchain.warning_codes import Caution

OVERDAMPED = 1e-9  # imaginary part, relative, below which a pole does not oscillate


@dataclass(frozen=True)
class PoleRow:
    """One oscillating mode of the craft.

    Args:
        frequency: [rad/s] `|s|` of the model with timing taken out.
        ratio: of damping, likewise.
        achieved_frequency: that the step shows, `|log(z)|/h`.
        achieved_ratio: likewise.
        slowed: it turns by more than the model's phase limit.
        step_error: `|z - exp(s h)| / |exp(s h) - 1|` of its pole.
    """

    frequency: float
    ratio: float
    achieved_frequency: float
    achieved_ratio: float
    slowed: bool
    step_error: float

    @property
    def error(self) -> float:
        """`|s' - s|/|s|`: of frequency and damping together."""
        wanted, got = (
            w * complex(-z, np.sqrt(max(1.0 - z**2, 0.0)))
            for w, z in (
                (self.frequency, self.ratio),
                (self.achieved_frequency, self.achieved_ratio),
            )
        )
        return abs(got - wanted) / abs(wanted)


def pole_rows(
    model: "mujoco.MjModel",
    plain: "mujoco.MjModel | None" = None,
    qpos: Array | None = None,
) -> list[PoleRow]:
    """Every oscillating mode of a craft at its own step and integrator,
    against the same craft without timing, in a pose, the initial one where left out.

    `plain`: that craft; made from `model`, by taking the timing out of its tendons, where left out.
    """
    if plain is None:
        plain = copy.copy(model)
        if modal_tendons(plain).names:
            retime(plain, 0.0)
    h = float(model.opt.timestep)
    phase = phase_limit(model)
    pairs = pole_pairs(motion_at(model, qpos), motion_at(at_step_of(plain, model), qpos))
    ringing = np.flatnonzero(pairs.wanted.imag > OVERDAMPED * np.abs(pairs.wanted))
    rows: list[PoleRow] = []
    for i in ringing:
        s = pairs.wanted[i]
        # a step that is too long parts a pair into two real poles:
        # the larger one is what the mode does
        twin = int(np.argmin(np.abs(pairs.wanted - np.conj(s))))
        k = max((int(i), twin), key=lambda j: float(np.abs(1.0 + pairs.shown[j])))
        got = np.log1p(pairs.shown[k]) / h
        rows.append(
            PoleRow(
                frequency=float(np.abs(s)),
                ratio=float(-s.real / np.abs(s)) + 0.0,
                achieved_frequency=float(np.abs(got)),
                achieved_ratio=float(-got.real / np.abs(got)) + 0.0,
                slowed=bool(np.abs(s) * h > phase),
                step_error=float(pairs.error[k]),
            )
        )
    return rows


def growing_frequencies(model: "mujoco.MjModel", qpos: Array) -> Array:
    """Frequencies of the modes of a file in a pose, timing included, that its own step makes
    grow [rad/s]."""
    motion = motion_at(model, qpos)
    poles, vectors = np.linalg.eig(motion.difference)
    growing = np.abs(1.0 + poles) > 1.0 + GROWN
    shapes = np.abs(vectors[: motion.squares.size, growing]) ** 2
    # Rayleigh's quotient of each growing motion, masses being one
    return np.sqrt((motion.squares[:, None] * shapes).sum(axis=0) / shapes.sum(axis=0))


def phase_limit(model: "mujoco.MjModel") -> float:
    """[rad] per step beyond which modes were slowed; infinity where none is retimed."""
    modal = modal_tendons(model)
    marks = [mark for mark in modal.made_for if mark is not None]
    if not marks:
        return float("inf")
    limits = [SCHEMES[mark.integrator].phase for mark in marks]
    for i, k, mark in zip(modal.index, modal.stiffness, modal.made_for, strict=True):
        if mark is not None:
            z = step_pole(
                mark.integrator,
                1.0 + model.tendon_armature[i],
                model.tendon_damping[i],
                k,
                mark.timestep,
            )
            shown = float(np.abs(np.log(z)))
            if np.sqrt(k) * mark.timestep > 1.2 * shown:  # nothing but slowing shifts a mode so far
                limits.append(shown)
    return min(limits)


def mismatch(model: "mujoco.MjModel") -> list[str]:
    """Sentences where a model runs at another step or integrator than it was made for."""
    modal = modal_tendons(model)
    h = float(model.opt.timestep)
    name = NUMBERS[int(model.opt.integrator)]
    out: list[str] = []
    for mark in dict.fromkeys(mark for mark in modal.made_for if mark is not None):
        pair = {mark.integrator, name}
        if mark.timestep == h and (len(pair) == 1 or pair == {"implicit", "implicitfast"}):
            continue
        mine = [j for j, other in enumerate(modal.made_for) if other == mark]
        index = modal.index[mine]
        m = 1.0 + model.tendon_armature[index]
        c = model.tendon_damping[index]
        k = modal.stiffness[mine]
        w, _ = apparent_pole(step_pole(mark.integrator, m, c, k, mark.timestep), mark.timestep)
        z = step_pole(name, m, c, k, h)
        sentence = (
            f"the appendage of tendon {modal.names[mine[0]]!r} was made exact for "
            f"{mark.integrator} at {mark.timestep:g} s, but the model runs {name} at {h:g} s: "
        )
        if np.any(np.abs(z) > 1.0 + 1e-9):
            sentence += "that is unstable"
        else:
            kept = w >= np.sqrt(k) / 1.2
            shown, _ = apparent_pole(z, h)
            worst = np.max(np.abs(shown / np.sqrt(k) - 1.0)[kept], initial=0.0)
            sentence += f"its frequencies are off by up to {worst:.2g}"
        out.append(
            Caution("other-step", f"{sentence}; retime it for this step, or run it at its own.")
        )
    return out
