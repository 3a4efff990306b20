"""What logs hold for an identification: channels by name, the axes that are driven,
pieces without gaps and saturation."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orth

from beamchain.errors import InputError
from beamchain.identification.hub import Bare, directions
from beamchain.identification.logs import SENSED, TORQUES, Response, TimeLog
from beamchain.identification.prior import Prior
from beamchain.identification.response import Data, Piece, Spectrum
from beamchain.identification.sanity import check_swapped
from beamchain.toolkit import Array
from beamchain.warning_codes import Caution

PROPORTIONAL = 1e-6  # one less the cosine between the torques of two axes over time
GAP = 1.5  # steps; where steps are unequal by themselves, more
UNEQUAL_GAP = 6.0
ROUNDED = 0.75  # of the last printed digit of time, by which equal steps may seem to differ
EQUAL = 1e-3  # of a step likewise
RUN = 3  # equal extreme samples in a row that mean saturation
FEWEST = 12  # samples of a piece
# samples at either end of a piece that do not count: a delay of so many steps brings torques from
# outside into it, which are not known
MARGIN = 2
CONSTANT = 1e-9  # relative variation of a torque that excites nothing
# of the samples that repeat the last one: then a sensor's last digit is large beside its noise
COARSE = 0.2


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


def driven_axes(
    known: Bare, torques: Sequence[str], sensed: Sequence[str], prior: Prior | None
) -> tuple[Array, list[str]]:
    """Axes `(3, a)` that are driven, and the sensors that are used:
    without a prior those about driven axes only."""
    inputs = directions(known, torques)
    axes = orth(inputs.T, rcond=1e-6)
    used = np.flatnonzero(np.any(np.abs(inputs) > 1e-9, axis=0))
    if axes.shape[1] == used.size == np.linalg.matrix_rank(np.abs(inputs) > 1e-9):
        axes = np.eye(3)[:, used]
    along = [n for n in sensed if np.linalg.norm(directions(known, (n,)) @ axes) >= 1.0 - 1e-6]
    if not along:
        raise InputError(
            f"the torques ({', '.join(torques)}) act about other axes than those sensed "
            f"({', '.join(sensed)}); the log must hold the rate or attitude about an axis that is "
            "driven."
        )
    return axes, along if prior is None else list(sensed)


def time_channels(
    logs: Sequence[TimeLog], known: Bare, wanted: Sequence[str], prior: Prior | None
) -> Channels:
    """The channels of time logs about the wanted axes.

    Raises:
        InputError: nothing is left, nothing is driven, or a sensor shows nothing.
    """
    torques = [
        n
        for n in dict.fromkeys(n for log in logs for n in log.torques)
        if n not in TORQUES or n[-1] in wanted
    ]
    sensed = [n for n in SENSED if n[-1] in wanted and any(n in log.sensed for log in logs)]
    if not torques or not sensed:
        raise InputError(
            f"axes = {''.join(wanted)!r} leaves no torque or no sensor of the log; it has "
            f"{', '.join([*logs[0].torques, *logs[0].sensed])}."
        )
    torques = active_torques(logs, torques)
    axes, sensed = driven_axes(known, torques, sensed, prior)
    pieces, warnings = cut_pieces(logs, torques, sensed)
    sizes = np.array([p.time.size for p in pieces])
    scale = np.sqrt(
        np.mean([np.var(p.outputs, axis=0) * p.time.size for p in pieces], axis=0) / np.mean(sizes)
    )
    for name, size in zip(sensed, scale, strict=True):
        if not size > 0.0:
            raise InputError(
                f"{name} is constant throughout the log; the sensor shows no motion: check the "
                "column and its unit (rad/s)."
            )
    check_swapped(pieces, torques, sensed)
    u = np.vstack([piece.inputs for piece in pieces])
    u /= np.linalg.norm(u, axis=0)
    alike = np.abs(u.T @ u)
    warnings += [
        Caution(
            "proportional-torques",
            f"{torques[j]} and {torques[i]} are proportional throughout: what one axis does cannot "
            "be told from the other, nor would exchanged columns be noticed; drive the axes one "
            "after the other.",
        )
        for i, j in np.argwhere(np.tril(1.0 - alike < PROPORTIONAL, -1))
    ]
    inputs = directions(known, torques)
    outputs = directions(known, sensed)
    return Channels(
        [*pieces], tuple(torques), tuple(sensed), inputs, outputs, axes, scale, warnings
    )


def spectral_channels(
    spectra: Sequence[Response], known: Bare, wanted: Sequence[str], prior: Prior | None
) -> Channels:
    """The channels of frequency responses about the wanted axes.

    Raises:
        InputError: none is from a torque about a wanted axis.
    """
    about = [*known.actuators, *(f"torque_{axis}" for axis in wanted)]
    chosen = [r for r in spectra if r.sensed[-1] in wanted and r.torque in about]
    if not chosen:
        raise InputError(
            "no frequency response of the log is from a torque (torque_x|y|z or an actuator of the "
            "craft) about the wanted axes."
        )
    torques = tuple(dict.fromkeys(r.torque for r in chosen))
    axes, kept = driven_axes(
        known, torques, list(dict.fromkeys(f"rate_{r.sensed[-1]}" for r in chosen)), prior
    )
    pieces: list[Data] = [
        Spectrum(r.omega, r.value, kept.index(rate), torques.index(r.torque), r.order, r.accuracy)
        for r in chosen
        if (rate := f"rate_{r.sensed[-1]}") in kept
    ]
    inputs = directions(known, torques)
    outputs = directions(known, kept)
    return Channels(pieces, torques, tuple(kept), inputs, outputs, axes, np.ones(len(kept)), [])


def cut_pieces(
    logs: Sequence[TimeLog], torques: Sequence[str], sensed: Sequence[str]
) -> tuple[list[Piece], list[str]]:
    """The channels `torques` and `sensed` of logs, in pieces without gaps, and what was noticed.

    Raises:
        InputError: a log lacks a channel that another has, or is nothing but gaps.
    """
    out = list[Piece]()
    messages = list[str]()
    kinds = tuple(name.rpartition("_")[0] for name in sensed)
    for number, log in enumerate(logs):
        for name in (*torques, *sensed):
            if name not in log.torques and name not in log.sensed:
                raise InputError(
                    f"{log.source} has no column {name!r}, which another log has; give all logs "
                    "the same columns."
                )
        u = np.column_stack([log.torques[n] for n in torques])
        y = np.column_stack([log.sensed[n] for n in sensed])
        use = np.column_stack([~saturated_samples(column) for column in y.T])
        for name, column, full in zip(sensed, y.T, ~use.T, strict=True):
            repeats = float(np.mean(np.diff(column) == 0.0))
            if full.any():
                text = (
                    f"{log.source}: {int(full.sum())} samples of {name} stand at its extreme value "
                    "in a row: taken as saturated and left out."
                )
                messages.append(Caution("sensor", text))
            elif repeats > COARSE:
                text = (
                    f"{log.source}: {100 * repeats:.0f} % of the samples of {name} repeat the one "
                    "before: the last digit of the sensor is coarse beside its noise, so that "
                    "errors are not quite random."
                )
                messages.append(Caution("sensor", text))
        steps = np.diff(log.time)
        usual = float(np.median(steps))
        unequal = float(np.mean(np.abs(steps / usual - 1.0) > 0.05)) > 0.1
        gaps = np.flatnonzero(steps > (UNEQUAL_GAP if unequal else GAP) * usual)
        if gaps.size:
            text = (
                f"{log.source} has {gaps.size} gap(s), the longest of {steps[gaps].max():.4g} s: "
                "after each the motion starts anew, unknown."
            )
            messages.append(Caution("log-gaps", text))
        edges = [0, *(gaps + 1).tolist(), log.time.size]
        short = 0
        for a, b in zip(edges, edges[1:], strict=False):
            if b - a < FEWEST:
                short += b - a
            else:
                piece = Piece(
                    time=log.time[a:b],
                    inputs=u[a:b],
                    outputs=y[a:b],
                    use=use[a:b],
                    kinds=kinds,
                    even=is_even(log.time[a:b]),
                    log=number,
                )
                out.append(piece.trimmed(MARGIN))
        if short:
            text = (
                f"{log.source}: {short} samples stand in pieces of fewer than {FEWEST} and are "
                "left out."
            )
            messages.append(Caution("log-gaps", text))
    if not out:
        raise InputError(
            f"the logs have no piece of {FEWEST} samples without a gap; check the column time "
            "(seconds)."
        )
    return out, messages


def is_even(time: Array) -> bool:
    """Whether steps are equal but for the rounding of the column."""
    ideal = np.linspace(time[0], time[-1], time.size)
    off = float(np.max(np.abs(time - ideal)))
    if off < EQUAL * (time[-1] - time[0]) / (time.size - 1):
        return True
    for digits in range(7):
        if np.allclose(time, np.round(time, digits), rtol=0.0, atol=1e-9 * 10.0**-digits):
            return off <= ROUNDED * 10.0**-digits
    return False


def saturated_samples(values: Array) -> NDArray[np.bool_]:
    """Samples at the largest or the smallest value, where they come in runs,
    and the one after each run."""
    out = np.zeros(values.size, dtype=np.bool_)
    levels, count = np.unique(values, return_counts=True)
    if levels.size == 1:
        return out
    # a coarse sensor: at an extreme far more often than at the level next to it
    if levels.size < 50:
        often = max(count[0] / count[1], count[-1] / count[-2])
        if levels.size <= 4 or often <= 5.0:
            return out
    for level in (levels[0], levels[-1]):
        full = np.concatenate([[False], values == level, [False]])
        starts = np.flatnonzero(full[1:] & ~full[:-1])
        ends = np.flatnonzero(~full[1:] & full[:-1])
        # then single samples at this value are saturated too
        if np.max(ends - starts, initial=0) >= RUN:
            for a, b in zip(starts, ends, strict=True):
                out[a : b + 1] = True
    return out


def active_torques(logs: Sequence[TimeLog], names: Sequence[str]) -> list[str]:
    """The torques among `names` that are not zero all the time.

    Raises:
        InputError: none of them changes.
    """
    out = list[str]()
    constant = list[str]()
    for name in names:
        values = [log.torques[name] for log in logs if name in log.torques]
        top = max((float(np.max(np.abs(v))) for v in values), default=0.0)
        if any(float(np.ptp(v)) > CONSTANT * top for v in values):
            out.append(name)
        elif values:
            constant.append(f"{name} is {values[0][0]:.4g} N m throughout")
    if not out:
        raise InputError(
            f"nothing excites the craft: {', '.join(constant)}; what a log without changing torque "
            "shows depends on an unknown beginning. Give a log with a torque that changes."
        )
    return out
