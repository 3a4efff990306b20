"""The fewest modes a scene needs where modes move in several ports at once,
proved against all of them in space."""

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from beamchain.fitting.needs import Choice, LeftOut, Promise
from beamchain.ports.compare import keeps_tolerance, tolerance_statement
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array

TRIED = 6  # lightest of the modes kept, each tried without
LISTED = 6  # modes left out whose cost is worked out each by itself; the rest stands in one line


def weights(full: PortModel, hub: Array, band: float) -> Array:
    """`(n,)` how much each mode of a damped model can move a hub `(m, m)` in the
    `band` [rad/s], roughly."""
    scale = np.sqrt(np.diag(full.rigid_mass + hub))
    size = np.sum((full.participation / scale) ** 2, axis=1)
    ratio = band / full.frequencies
    peak = 1.0 / np.maximum(2.0 * full.damping, 1e-6)
    return size * np.minimum(ratio**2 / np.maximum(1.0 - ratio**2, 1e-12), peak)


def fewest(
    promise: Promise,
    full: PortModel,
    belongs: Sequence[str],
    tolerance: float,
    fixed: Mapping[str, int],
    tip: bool = False,
) -> tuple[tuple[int, ...], Choice]:
    """The modes to keep, numbers from 1, and how they were chosen.

    Modes are taken in the order of their weight until the error stays within the tolerance; then
    the lightest are tried without.

    Args:
        promise: the error that is asked for.
        full: all modes, damped, in the promise's motions.
        belongs: port of each mode.
        tolerance: of the in-band error.
        fixed: ports of which the first modes stay, so many, and the others go.
        tip: keep every mode inside the band.
    """

    def error(modes: Sequence[int], wanted: float | None = None) -> float:
        return promise.error(full.picked(sorted(modes)), wanted)

    def keeps(modes: Sequence[int]) -> bool:
        return keeps_tolerance(error(modes, tolerance), tolerance)

    of_port = {port: [k for k in range(full.modes) if belongs[k] == port] for port in PORTS}
    held = {k for port, count in fixed.items() for k in of_port[port][:count]}
    barred = {k for port, count in fixed.items() for k in of_port[port][count:]}
    if tip:
        held |= set(np.flatnonzero(full.frequencies <= promise.bandwidth).tolist()) - barred
    weight = weights(full, promise.hubs[0], promise.bandwidth)
    order = [int(k) for k in np.argsort(-weight) if k not in held | barred]
    # the error falls with every mode but for trifles, which the trials afterwards find
    count = bisect_left(range(len(order)), True, key=lambda n: keeps([*held, *order[:n]]))
    kept = [*held, *order[:count]]
    for k in reversed(order[max(count - TRIED, 0) : count]):
        fewer = [j for j in kept if j != k]
        if keeps(fewer) or error(fewer, tolerance) <= error(kept, tolerance):
            kept = fewer
    kept.sort()

    total = error(kept)
    met = keeps_tolerance(total, tolerance)
    above = "" if met else f" ({tolerance_statement(total, tolerance)})"
    names = [
        f"mode {k + 1} of the file ({belongs[k]}, {w:.3g} rad/s)"
        for k, w in enumerate(full.frequencies)
    ]
    left = [k for k in range(full.modes) if k not in kept]
    cannot = [f"motion above {full.frequencies[k]:.3g} rad/s" for k in left[:1]]
    if not tip:
        cannot.append(
            "tip pointing: the model is right at the root; set scene.tip = true where the tip "
            "matters"
        )
    choice = Choice(
        modes={port: sum(belongs[k] == port for k in kept) for port in PORTS if of_port[port]},
        target="clamped",
        error=total,
        met=met,
        left_out=tuple(
            _ledger(error, names, sorted(left, key=lambda k: -weight[k]), full, promise.bandwidth)
        ),
        cannot=tuple(cannot),
        reasoning=(
            f"modes that couple the ports: {len(kept)} of {full.modes} kept, in-band error "
            f"{total:.2e}{above}",
            f"kept: {', '.join(names[k] for k in kept) or 'none, the appendage is rigid'}",
        ),
    )
    return tuple(k + 1 for k in kept), choice


def _ledger(
    error: Callable[[Sequence[int]], float],
    names: Sequence[str],
    left: Sequence[int],
    full: PortModel,
    band: float,
) -> list[LeftOut]:
    """What was `left` out, the heaviest first, and what each costs by itself; beyond the heaviest,
    together."""
    out: list[LeftOut] = []
    for k in left[:LISTED]:
        where = "outside" if full.frequencies[k] > band else "inside"
        cost = error([j for j in range(full.modes) if j != k])
        out.append(LeftOut(names[k], f"{where} {band:.4g} rad/s", cost))
    rest = set(left[LISTED:])
    if rest:
        cost = error([j for j in range(full.modes) if j not in rest])
        out.append(LeftOut(f"{len(rest)} lighter modes", "together within the tolerance", cost))
    return out
