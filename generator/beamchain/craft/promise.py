"""What the craft is promised, and the modes that keep it:
added one at a time where they pay most."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs

from beamchain.craft.appendage import Appendage, carried, placed_body
from beamchain.craft.error import PlacedBody, by_base, craft_poses
from beamchain.craft.loads import Load
from beamchain.engine.library import mujoco
from beamchain.engine.mount import Mount
from beamchain.errors import RealisationError
from beamchain.fitting.candidate import Candidate
from beamchain.fitting.grow import grow, worst
from beamchain.fitting.needs import AXES
from beamchain.fitting.options import Root
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import keeps_tolerance

MOST_MODES = 12  # of an appendage, unless `max_modes` says otherwise
ROUNDS = 3  # of growing and fitting: what comes out may miss what was foreseen


@dataclass(frozen=True)
class JointRequest:
    """What the scenes of all appendages ask of the craft together;
    None where no scene states a band.

    `band`: the largest [rad/s]; `tolerance`: the smallest; `motions`: union of those asked for,
    or all (0 to 5).
    """

    band: float | None
    tolerance: float | None
    motions: tuple[int, ...]


def joint_request(specs: Sequence[Spec]) -> JointRequest:
    """What the scenes with a bandwidth ask for: largest band, smallest tolerance,
    union of the motions."""
    scenes = [s.scene for s in specs if s.scene is not None and s.scene.bandwidth is not None]
    if not scenes:
        return JointRequest(None, None, tuple(range(6)))
    motions = tuple(sorted({AXES[axis] for scene in scenes for axis in scene.axes}))
    return JointRequest(
        max(s.bandwidth or 0.0 for s in scenes), min(s.tolerance for s in scenes), motions
    )


def kept_band(appendages: Sequence[Appendage]) -> float:
    """Up to here every appendage keeps every mode of its kept ports [rad/s]."""
    return min(w for item in carried(None, appendages) for w in item.band.values())


@dataclass(frozen=True, eq=False)
class Placed:
    """An appendage on a spacecraft before it has a chain.

    Args:
        at: site or body.
        mount: the place in the bare spacecraft.
        loads: what its ports carry.
        candidate: every mode of it, and those that it would keep.
        fit: its chain, where one was made before.
    """

    at: str
    mount: Mount
    loads: tuple[Load, ...]
    candidate: Candidate
    fit: Fit | None = None

    @property
    def exact(self) -> PlacedBody:
        """All its modes, on the spacecraft."""
        item = self.candidate
        return placed_body(self.mount, item.body, item.exact, self.loads)

    def with_fit(self, candidate: Candidate, fit: Fit) -> "Placed":
        """The same with the chain of a candidate; of one that carries, the model stays that which
        was asked for, with the motion of its ports."""
        measured = None if self.loads else fit.measured.space
        candidate = replace(candidate, kept=fit.kept, measured=measured)
        return replace(self, candidate=candidate, fit=fit)


def candidate_of(a: Appendage, spec: Spec | None = None) -> Candidate:
    """An appendage as it was fitted; `spec`: in place of its own."""
    spec = spec or a.spec
    body = replace(
        a.fit.body, spec=structs.replace(spec, root=Root(target=spec.root.target, hub=a.hub))
    )
    return Candidate(body, a.fit.kept, None if a.loads else a.fit.measured.space)


def fits_that_keep(
    craft: "mujoco.MjModel",
    placed: Sequence[Placed],
    want: JointRequest,
    most: int,
    fit: Callable[[Candidate], Fit],
) -> tuple[list[Fit], tuple[str, ...]]:
    """The chains of all appendages, with as many modes as the craft's promise needs, and the steps
    taken; counts that were typed stay.

    `placed`: with the modes that each needs by itself; `want`: what is promised; `most`: modes of
    an appendage; `fit` makes the chain of a candidate.
    """
    if want.band is None or want.tolerance is None:
        return [item.fit or fit(item.candidate) for item in placed], ()
    made: dict[int, Fit] = {}
    told = list[str]()
    for members in by_base(craft, [item.mount for item in placed]).values():
        group = [placed[i] for i in members]
        made |= zip(members, _keep_on_base(craft, group, want, most, fit, told), strict=True)
    return [made[i] for i in range(len(placed))], tuple(told)


def _keep_on_base(
    craft: "mujoco.MjModel",
    placed: Sequence[Placed],
    want: JointRequest,
    most: int,
    fit: Callable[[Candidate], Fit],
    told: list[str],
) -> list[Fit]:
    """`fits_that_keep` for the appendages of one base body; `told` gets a line for each step."""
    assert want.band is not None
    assert want.tolerance is not None
    found = craft_poses(craft, [item.exact for item in placed], want.band, want.motions)
    poses = {name: several[0] for name, several in found.items()}
    ours, best = list(placed), list[Fit]()
    barred = set[int]()
    least = np.inf
    for _ in range(ROUNDS):
        wanted, steps = grow(
            poses,
            [item.candidate for item in ours],
            want.tolerance,
            lambda i, longer: i not in barred and longer.modes <= most,
        )
        told += [
            f"{ours[step.number].at}: {step.added}: error of the craft {step.before:.2e} -> "
            f"{step.after:.2e}"
            for step in steps
        ]
        if best and not steps:
            break
        for i, candidate in enumerate(wanted):
            ours[i], failed = _realised(ours[i], candidate, fit)
            told += failed
            if failed:
                barred.add(i)
        error, _ = worst(poses, [item.candidate.model for item in ours])
        if error < least or not best:
            best = [item.fit for item in ours if item.fit is not None]
            least = error
        if keeps_tolerance(least, want.tolerance):
            break
    return best


def _realised(
    item: Placed, candidate: Candidate, fit: Callable[[Candidate], Fit]
) -> tuple[Placed, list[str]]:
    """An appendage with the chain of a candidate, or of the last before it that has one; and a line
    for each that has none.

    Raises:
        RealisationError: not even what it began with has one.
    """
    failed = list[str]()
    while candidate is not item.candidate or item.fit is None:
        try:
            return item.with_fit(candidate, fit(candidate)), failed
        except RealisationError as error:
            if candidate.before is None:
                raise RealisationError(f"{item.at}: {error}") from None
            failed.append(f"{item.at}: no chain has {candidate.modes} modes: {error}")
            candidate = candidate.before
    return item, failed
