"""The fewest modes a scene needs where modes move in several ports at once,
proved against all of them in space."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence

import numpy as np

from beamchain.fitting.needs import AXES, FAR, Choice, LeftOut
from beamchain.ports.compare import (
    STANDARD_HUBS,
    Block,
    Reference,
    keeps_tolerance,
    tolerance_statement,
    with_damping,
)
from beamchain.ports.coupled import CoupledPort
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array

TRIED = 6  # lightest of the modes kept, each tried without
LISTED = 6  # modes left out whose cost is worked out each by itself; the rest stands in one line


class SpacePromise:
    """The in-band error of some of the modes against all, on the hub in space,
    in the motions that matter.

    `full` holds the motions `live`, in which the appendage has inertia;
    without `hub_mass` `(6, 6)` the worst of three.
    """

    def __init__(
        self,
        full: PortModel,
        hub_mass: Array | None,
        live: Sequence[int],
        axes: Sequence[str],
        bandwidth: float,
    ) -> None:
        self.full: PortModel = with_damping(full)
        self.bandwidth: float = bandwidth
        self._near = self.full.condensed(FAR * bandwidth)
        self._hub = None if hub_mass is None else hub_mass[np.ix_(live, live)]
        self._keep = [i for i, motion in enumerate(live) if motion in {AXES[axis] for axis in axes}]
        hubs = (
            [self._hub]
            if self._hub is not None
            else [factor * full.rigid_mass for factor in STANDARD_HUBS]
        )
        self._references = [
            Reference([Block(hub, self._near, tuple(self._keep))], bandwidth) for hub in hubs
        ]
        self._known: dict[tuple[tuple[int, ...], float | None], float] = {}

    def error(self, model: PortModel | CoupledPort, tolerance: float | None = None) -> float:
        """In-band error of any model with the same motions; `tolerance`: as of
        `ports.compare.maximum_of`, for a search."""
        if not self._keep:
            return 0.0
        return max(reference.error(0, model, tolerance) for reference in self._references)

    def of(self, modes: Sequence[int], tolerance: float | None = None) -> float:
        """In-band error with these modes only, numbers from 0."""
        kept = tuple(sorted(modes))
        key = kept, tolerance
        if key not in self._known:
            self._known[key] = self.error(self.full.picked(kept), tolerance)
        return self._known[key]

    def weights(self) -> Array:
        """`(n,)` how much each mode can move the hub inside the band, roughly:
        what is tried first."""
        hub = self._hub if self._hub is not None else STANDARD_HUBS[0] * self.full.rigid_mass
        return weights(self.full, hub, self.bandwidth)


def weights(full: PortModel, hub: Array, band: float) -> Array:
    """`(n,)` how much each mode of a damped model can move a hub `(m, m)` in the
    `band` [rad/s], roughly."""
    scale = np.sqrt(np.diag(full.rigid_mass + hub))
    size = np.sum((full.participation / scale) ** 2, axis=1)
    ratio = np.minimum(band / full.frequencies, 1.0)
    peak = 1.0 / np.maximum(2.0 * full.damping, 1e-6)
    return size * np.minimum(ratio**2 / np.maximum(1.0 - ratio**2, 1e-12), peak)


def fewest(
    promise: SpacePromise,
    belongs: Sequence[str],
    tolerance: float,
    fixed: Mapping[str, int],
    tip: bool = False,
) -> tuple[tuple[int, ...], Choice]:
    """The modes to keep, numbers from 1, and how they were chosen.

    Modes are taken in the order of their weight until the error stays within the tolerance; then
    the lightest are tried without. `belongs`: port of each mode; of a `fixed` port the first modes
    stay, and the others go; `tip`: keep every mode inside the band.
    """
    n = promise.full.modes
    own = {port: [k for k in range(n) if belongs[k] == port] for port in PORTS}
    held = {k for port, count in fixed.items() for k in own[port][:count]}
    barred = {k for port, count in fixed.items() for k in own[port][count:]}
    if tip:
        held |= {k for k in range(n) if promise.full.frequencies[k] <= promise.bandwidth} - barred
    order = [int(k) for k in np.argsort(-promise.weights()) if k not in held | barred]
    # the error falls with every mode but for trifles, which the trials afterwards find
    low = bisect_left(
        range(len(order)),
        True,
        key=lambda count: keeps_tolerance(
            promise.of([*held, *order[:count]], tolerance), tolerance
        ),
    )
    kept = [*held, *order[:low]]
    for k in reversed(order[max(low - TRIED, 0) : low]):
        fewer = [j for j in kept if j != k]
        error = promise.of(fewer, tolerance)
        if keeps_tolerance(error, tolerance) or error <= promise.of(kept, tolerance):
            kept = fewer
    kept.sort()
    total = promise.of(kept)
    counts = {port: sum(belongs[k] == port for k in kept) for port in PORTS if own[port]}
    met = keeps_tolerance(total, tolerance)
    reasoning = (
        f"modes that couple the ports: {len(kept)} of {n} kept, in-band error {total:.2e}"
        f"{'' if met else f' ({tolerance_statement(total, tolerance)})'}",
        "kept: "
        f"{', '.join(_name(promise, belongs, k) for k in kept) or 'none, the appendage is rigid'}",
    )
    out = _ledger(promise, belongs, kept)
    cannot = [
        f"motion above {promise.full.frequencies[k]:.3g} rad/s"
        for k in sorted(set(range(n)) - set(kept))[:1]
    ]
    if not tip:
        cannot.append(
            "tip pointing: the model is right at the root; set scene.tip = true where the tip "
            "matters"
        )
    choice = Choice(counts, "clamped", total, met, tuple(out), tuple(cannot), reasoning)
    return tuple(k + 1 for k in kept), choice


def _name(promise: SpacePromise, belongs: Sequence[str], k: int) -> str:
    return f"mode {k + 1} ({belongs[k]}, {promise.full.frequencies[k]:.3g} rad/s)"


def _ledger(promise: SpacePromise, belongs: Sequence[str], kept: Sequence[int]) -> list[LeftOut]:
    """What was left out and what each costs by itself; beyond the heaviest, together."""
    n = promise.full.modes
    weights = promise.weights()
    band = promise.bandwidth
    left = sorted(set(range(n)) - set(kept), key=lambda k: -weights[k])
    out: list[LeftOut] = []
    for k in left[:LISTED]:
        where = "outside" if promise.full.frequencies[k] > band else "inside"
        cost = promise.of([j for j in range(n) if j != k])
        out.append(LeftOut(_name(promise, belongs, k), f"{where} {band:.4g} rad/s", cost))
    rest = set(left[LISTED:])
    if rest:
        cost = promise.of([j for j in range(n) if j not in rest])
        out.append(LeftOut(f"{len(rest)} lighter modes", "together within the tolerance", cost))
    return out
