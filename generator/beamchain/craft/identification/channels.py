"""What logs hold for an identification: pieces, channels by name, and the axes that are driven."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import orth

from beamchain.caution import Caution
from beamchain.craft.identification.hub import Bare, directions
from beamchain.craft.identification.logs import SENSED, TORQUES
from beamchain.craft.identification.pieces import Cut, active, cut
from beamchain.craft.identification.prior import Prior
from beamchain.craft.identification.response import Data, Spectrum
from beamchain.craft.identification.sanity import check_swapped
from beamchain.errors import InputError
from beamchain.ports.motions import Array

PROPORTIONAL = 1e-6  # one less the cosine between the torques of two axes over time


class Channels(NamedTuple):
    """What the log has: pieces, names, directions in the mount's axes, the driven axes `(3, a)`."""

    pieces: list[Data]
    torques: tuple[str, ...]
    sensed: tuple[str, ...]
    inputs: Array
    outputs: Array
    axes: Array
    scale: Array
    warnings: list[str]


def driven(known: Bare, torques: Sequence[str], sensed: Sequence[str], prior: Prior | None) -> tuple[Array, list[str]]:
    """Axes `(3, a)` that are driven, and the sensors that are used: without a prior those about driven axes only."""
    inputs = directions(known, tuple(torques))
    axes = orth(inputs.T, rcond=1e-6)
    if axes.shape[1] == np.linalg.matrix_rank(np.abs(inputs) > 1e-9):
        used = np.flatnonzero(np.any(np.abs(inputs) > 1e-9, axis=0))
        axes = np.eye(3)[:, used] if used.size == axes.shape[1] else axes
    elsewhere = [n for n in sensed if np.linalg.norm(directions(known, (n,)) @ axes) < 1.0 - 1e-6]
    kept = [n for n in sensed if prior is not None or n not in elsewhere]
    if not [n for n in kept if n not in elsewhere]:
        raise InputError(
            f"the torques ({', '.join(torques)}) act about other axes than those sensed ({', '.join(sensed)}); "
            "the log must hold the "
            "rate or attitude about an axis that is driven."
        )
    return axes, kept


def of_time(logs: Any, known: Bare, wanted: Sequence[str], prior: Prior | None) -> Channels:
    """The channels of time logs about the wanted axes.

    Raises:
        InputError: nothing is left, nothing is driven, or a sensor shows nothing.
    """
    torques = [n for n in dict.fromkeys(n for log in logs for n in log.torques) if n not in TORQUES or n[-1] in wanted]
    sensed = [n for n in SENSED if n[-1] in wanted and any(n in log.sensed for log in logs)]
    if not torques or not sensed:
        raise InputError(
            f"axes = {''.join(wanted)!r} leaves no torque or no sensor of the log; it has "
            f"{', '.join([*logs[0].torques, *logs[0].sensed])}."
        )
    torques = active(logs, torques)
    axes, sensed = driven(known, torques, sensed, prior)
    made: Cut = cut(logs, torques, sensed)
    scale = np.sqrt(
        np.mean([np.var(p.outputs, axis=0) * p.time.size for p in made.pieces], axis=0)
        / np.mean([p.time.size for p in made.pieces])
    )
    for name, size in zip(sensed, scale, strict=True):
        if not size > 0.0:
            raise InputError(
                f"{name} is constant throughout the log; the sensor shows no motion: check the column and its "
                "unit (rad/s)."
            )
    check_swapped(made)
    alike = _proportional(made)
    return Channels(
        [*made.pieces],
        tuple(torques),
        tuple(sensed),
        directions(known, made.torques),
        directions(known, made.sensed),
        axes,
        scale,
        [*made.warnings, *alike],
    )


def _proportional(made: Cut) -> list[str]:
    """What is said of torques that are multiples of each other throughout."""
    u = np.vstack([piece.inputs for piece in made.pieces])
    u = u / np.linalg.norm(u, axis=0)
    pairs = [(i, j) for j in range(u.shape[1]) for i in range(j) if 1.0 - abs(float(u[:, i] @ u[:, j])) < PROPORTIONAL]
    return [
        Caution(
            "proportional-torques",
            f"{made.torques[i]} and {made.torques[j]} are proportional throughout: what one axis does cannot be told from "
            "the other, nor would exchanged columns be noticed; drive the axes one after the other.",
        )
        for i, j in pairs
    ]


def of_spectra(spectra: Any, known: Bare, wanted: Sequence[str], prior: Prior | None) -> Channels:
    """The channels of frequency responses about the wanted axes.

    Raises:
        InputError: none is from a torque about a wanted axis.
    """
    own = [
        r
        for r in spectra
        if r.sensed[-1] in wanted and (r.torque in known.actuators or (r.torque in TORQUES and r.torque[-1] in wanted))
    ]
    if not own:
        raise InputError(
            "no frequency response of the log is from a torque (torque_x|y|z or an actuator of the craft) "
            "about the wanted axes."
        )
    torques = tuple(dict.fromkeys(r.torque for r in own))
    axes, kept = driven(known, torques, [f"rate_{a}" for a in dict.fromkeys(r.sensed[-1] for r in own)], prior)
    pieces: list[Data] = [
        Spectrum(r.omega, r.value, kept.index(f"rate_{r.sensed[-1]}"), torques.index(r.torque), r.order, r.accuracy)
        for r in own
        if f"rate_{r.sensed[-1]}" in kept
    ]
    return Channels(
        pieces,
        torques,
        tuple(kept),
        directions(known, torques),
        directions(known, tuple(kept)),
        axes,
        np.ones(len(kept)),
        [],
    )
