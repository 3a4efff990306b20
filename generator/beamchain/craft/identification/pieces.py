"""Logs cut at gaps, saturated samples left out, and what the columns say of each other."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.caution import Caution
from beamchain.craft.identification.logs import TimeLog
from beamchain.craft.identification.response import Piece
from beamchain.errors import InputError
from beamchain.ports.motions import Array

GAP = 1.5  # steps; where steps are unequal by themselves, more
UNEQUAL_GAP = 6.0
ROUNDED = 0.75  # of the last printed digit of time, by which equal steps may seem to differ
EQUAL = 1e-3  # of a step likewise
RUN = 3  # equal extreme samples in a row that mean saturation
FEWEST = 12  # samples of a piece
CONSTANT = 1e-9  # relative variation of a torque that excites nothing
COARSE = 0.2  # of the samples that repeat the last one: then a sensor's last digit is large beside its noise


class Cut(NamedTuple):
    """Pieces of logs, their channels, and what was noticed."""

    pieces: list[Piece]
    torques: tuple[str, ...]
    sensed: tuple[str, ...]
    warnings: list[str]


def cut(logs: Sequence[TimeLog], torques: Sequence[str], sensed: Sequence[str]) -> Cut:
    """The channels `torques` and `sensed` of logs, in pieces without gaps.

    Raises:
        InputError: a log lacks a channel that another has, or is nothing but gaps.
    """
    out, said = list[Piece](), list[str]()
    for number, log in enumerate(logs):
        for name in (*torques, *sensed):
            if name not in log.torques and name not in log.sensed:
                raise InputError(
                    f"{log.source} has no column {name!r}, which another log has; give all logs the same columns."
                )
        u = np.column_stack([log.torques[n] for n in torques])
        y = np.column_stack([log.sensed[n] for n in sensed])
        use = np.ones(y.shape, dtype=np.bool_)
        for i, name in enumerate(sensed):
            full = saturated(y[:, i])
            if full.any():
                use[:, i] = ~full
                said.append(
                    Caution(
                        "sensor",
                        f"{log.source}: {int(full.sum())} samples of {name} stand at its extreme value in a row: "
                        "taken as saturated and left out.",
                    )
                )
            repeats = float(np.mean(np.diff(y[:, i]) == 0.0))
            if repeats > COARSE and not full.any():
                said.append(
                    Caution(
                        "sensor",
                        f"{log.source}: {100 * repeats:.0f} % of the samples of {name} repeat the one before: the last "
                        "digit of the sensor is coarse beside its noise, so that errors are not quite random.",
                    )
                )
        steps = np.diff(log.time)
        usual = float(np.median(steps))
        unequal = float(np.mean(np.abs(steps / usual - 1.0) > 0.05)) > 0.1
        gaps = np.flatnonzero(steps > (UNEQUAL_GAP if unequal else GAP) * usual)
        if gaps.size:
            said.append(
                Caution(
                    "log-gaps",
                    f"{log.source} has {gaps.size} gap(s), the longest of {steps[gaps].max():.4g} s: after each the "
                    "motion starts anew, unknown.",
                )
            )
        edges = [0, *(gaps + 1).tolist(), log.time.size]
        short = 0
        for a, b in zip(edges, edges[1:], strict=False):
            if b - a < FEWEST:
                short += b - a
                continue
            angles = tuple(name.startswith("attitude") for name in sensed)
            out.append(Piece(log.time[a:b], u[a:b], y[a:b], use[a:b], angles, even(log.time[a:b]), number))
        if short:
            said.append(
                Caution(
                    "log-gaps",
                    f"{log.source}: {short} samples stand in pieces of fewer than {FEWEST} and are left out.",
                )
            )
    if not out:
        raise InputError(f"the logs have no piece of {FEWEST} samples without a gap; check the column time (seconds).")
    return Cut(out, tuple(torques), tuple(sensed), said)


def even(time: Array) -> bool:
    """Whether steps are equal but for the rounding of the column."""
    n = time.size
    ideal = time[0] + (time[-1] - time[0]) / (n - 1) * np.arange(n)
    off = float(np.max(np.abs(time - ideal)))
    if off < EQUAL * (time[-1] - time[0]) / (n - 1):
        return True
    for digits in range(7):
        if np.allclose(time, np.round(time, digits), rtol=0.0, atol=1e-9 * 10.0**-digits):
            return off <= ROUNDED * 10.0**-digits
    return False


def saturated(values: Array) -> NDArray[np.bool_]:
    """Samples at the largest or the smallest value, where they come in runs, and the one after each run."""
    out = np.zeros(values.size, dtype=np.bool_)
    low, high = float(values.min()), float(values.max())
    levels = np.unique(values).size
    if low == high or (levels < 50 and not _clipped(values, levels)):
        return out
    for level in (low, high):
        full = np.concatenate([[False], values == level, [False]])
        starts, ends = np.flatnonzero(full[1:] & ~full[:-1]), np.flatnonzero(~full[1:] & full[:-1])
        if np.max(ends - starts, initial=0) >= RUN:  # then single samples at this value are saturated too
            for a, b in zip(starts, ends, strict=True):
                out[a : b + 1] = True
    return out


def _clipped(values: Array, levels: int) -> bool:
    """Whether a coarse sensor stands at an extreme far more often than at the level next to it."""
    count = np.unique(values, return_counts=True)[1]
    return levels > 4 and max(count[0] / max(count[1], 1), count[-1] / max(count[-2], 1)) > 5.0


def active(logs: Sequence[TimeLog], names: Sequence[str]) -> list[str]:
    """The torques among `names` that are not zero all the time.

    Raises:
        InputError: none of them changes.
    """
    out, constant = list[str](), list[str]()
    for name in names:
        values = [log.torques[name] for log in logs if name in log.torques]
        top = max((float(np.max(np.abs(v))) for v in values), default=0.0)
        if any(float(np.ptp(v)) > CONSTANT * top for v in values):
            out.append(name)
        elif values:
            constant.append(f"{name} is {values[0][0]:.4g} N m throughout")
    if not out:
        raise InputError(
            f"nothing excites the craft: {', '.join(constant)}; what a log without changing torque shows "
            "depends on an unknown "
            "beginning. Give a log with a torque that changes."
        )
    return out
