"""What a log cannot be: swapped columns, wrong units, a response that does not follow its torque;
and modes above half the sample rate."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.errors import InputError
from beamchain.identification.hub import Bare
from beamchain.identification.response import Data, Piece, Raw
from beamchain.identification.structure import frozen_inertia
from beamchain.toolkit import Array

DEGREE = 180.0 / np.pi
ROUGH = 0.5  # of the least inertia, before the modes are taken out
LESS = 0.02  # of the hub's inertia, by which a log's total may be less before it is refused
MOST = 300.0  # times the hub's inertia that an appendage is expected to have
OFF_PRIOR = 3.0  # times, by which the total may differ from the prior's
EXPLAINS = 0.5  # part of a column's variation that tells which is torque and which is rate
LITTLE = 0.05


def _explained_part(target: Array, source: Array, use: NDArray[np.bool_]) -> float:
    """Part of the variation of a column that another one's explains."""
    x = source[use] - source[use].mean()
    y = target[use] - target[use].mean()
    return float((x @ y) ** 2 / max((x @ x) * (y @ y), 1e-300))


def check_swapped(pieces: Sequence[Piece], torques: Sequence[str], sensed: Sequence[str]) -> None:
    """Refuse a log whose torque is the integral of its rate,
    or whose rate follows another axis's torque.

    Raises:
        InputError: columns are swapped.
    """
    piece = max(pieces, key=lambda p: p.time.size)
    h = np.diff(piece.time)[:, None]
    once = np.vstack(
        [np.zeros((1, piece.outputs.shape[1])), np.cumsum(h * piece.outputs[:-1], axis=0)]
    )
    table = np.zeros((len(sensed), len(torques)))
    same = np.zeros((len(sensed), len(torques)), dtype=np.bool_)
    held = piece.held(0.0)
    for i, rate in enumerate(sensed):
        use = piece.use[:, i]
        motion = piece.read(held.rigid, i)
        for m, torque in enumerate(torques):
            same[i, m] = torque[-2:] == rate[-2:]
            table[i, m] = _explained_part(piece.outputs[:, i], motion[:, m], use)
            if same[i, m] and piece.kinds[i] != "attitude":
                back = _explained_part(piece.inputs[:, m], once[:, i], use)
                if table[i, m] < LITTLE and back > EXPLAINS:
                    raise InputError(
                        f"{torque} follows from {rate} as a rate from a torque, and not the other "
                        "way: the two columns are swapped; exchange them, or use map (--map)."
                    )
    for i, m in np.argwhere(same & (table < LITTLE)):
        others = np.where(same[i], 0.0, table[i])
        if others.max() > EXPLAINS:
            raise InputError(
                f"{sensed[i]} follows {torques[int(np.argmax(others))]} and not {torques[m]}: "
                "columns of different axes are swapped; exchange them, or use map (--map)."
            )


def check_rigid(
    gain: Array, data: Any, known: Bare, rigid: Array, *, roughly: bool = False
) -> None:
    """Refuse a total inertia that contradicts the craft.

    Args:
        gain: `(p, m)` angular accelerations per torque of the frozen craft, as the log has them.
        data: the channels: names, directions, motion axes.
        known: the craft.
        rigid: `(6, 6)` that the prior believes of the appendage; zero without one.
        roughly: the modes are not taken out yet, so that only gross contradictions count.

    Raises:
        InputError: it is negative, less than the hub's alone, or far from what the prior says.
    """
    bare = frozen_inertia(known.mass)
    whole = frozen_inertia(known.mass, rigid)
    inverse = (
        np.linalg.pinv(data.outputs @ data.axes)
        @ gain
        @ np.linalg.pinv((data.inputs @ data.axes).T)
    )
    there = bool(np.any(rigid))
    for i, axis in enumerate(data.axes.T):
        value = float(inverse[i, i])
        hub = float(axis @ bare @ axis)
        expected = float(axis @ whole @ axis)
        name = f"about {_axis_name(axis)}"
        if value <= 0.0:
            raise InputError(
                f"the craft turns against its torque {name} ({', '.join(data.torques)} to "
                f"{', '.join(data.sensed)}): a sign or a column is wrong; turn the sign of the "
                "torque, and see that each column is what its name says."
            )
        total = 1.0 / value
        low = (ROUGH if roughly else 1.0 - LESS) * hub
        high = MOST * hub
        if there:
            low, high = (
                max(low, expected / OFF_PRIOR * (ROUGH if roughly else 1.0)),
                expected * OFF_PRIOR,
            )
        if not low <= total <= high:
            raise InputError(
                f"the log's total inertia {name} is {total:.4g} kg m^2, that of the bare "
                f"craft{' with the prior' if there else ' alone'} is {expected:.4g}; with rates in "
                f"degrees it would be {total * DEGREE:.4g}: check the units (rad/s, N m), the "
                f"columns, the craft's mass properties{' and the prior' if there else ''}."
            )


def _axis_name(axis: Array) -> str:
    i = int(np.argmax(np.abs(axis)))
    return (
        f"the mount's {'xyz'[i]}"
        if abs(axis[i]) > 0.999
        else f"({', '.join(f'{v:.3g}' for v in axis)}) at the mount"
    )


def unalias(
    raw: Raw, pieces: Sequence[Data], inputs: Array, outputs: Array, axes: Array
) -> tuple[Raw, list[complex]]:
    """The model with poles put where they belong whose residue has the wrong sign:
    a mode above half the sample rate.

    Returns:
        The model, and its poles that were moved.
    """
    first = pieces[0]
    if not isinstance(first, Piece) or not all(isinstance(p, Piece) and p.even for p in pieces):
        return raw, []
    turn = 2.0 * np.pi / float(np.mean(first.steps))
    to_out = np.linalg.pinv(outputs @ axes)
    to_in = np.linalg.pinv((inputs @ axes).T)
    poles = raw.poles.copy()
    residues = raw.residues.copy()
    shapes = raw.shapes.copy()
    moved = list[complex]()
    for k, pole in enumerate(raw.poles):
        strength = (to_out @ raw.residues[k] @ to_in).real
        if np.trace(strength) < 0.0:
            poles[k] = complex(pole.real, turn - pole.imag)
            residues[k] = -raw.residues[k].conj() * (turn - pole.imag) / pole.imag
            shapes[k] = raw.shapes[k].conj()
            moved.append(complex(poles[k]))
    return raw._replace(poles=poles, residues=residues, shapes=shapes).sorted(), moved
