"""What the craft is promised, and the modes that keep it:
added one at a time where they pay most."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamchain.craft.appendage import Appendage, carried
from beamchain.craft.candidates import Candidate
from beamchain.craft.error import Pose, by_base, craft_poses
from beamchain.engine.library import mujoco
from beamchain.errors import RealisationError
from beamchain.fitting.needs import AXES
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import keeps_tolerance
from beamchain.ports.model import PortModel

MOST_MODES = 12  # of an appendage, unless --max-modes says otherwise
PAYS = 0.9  # a mode that leaves more than this of the error pays little by itself
IDLE = 0.05  # of the error: a port that alone costs less is not what it comes from
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


def fits_that_keep(
    craft: "mujoco.MjModel",
    candidates: Sequence[Candidate],
    most: int,
    fit: Callable[[Candidate], Fit],
) -> tuple[list[Fit], tuple[str, ...]]:
    """The chains of all appendages, with as many modes as the craft's promise needs, and the steps
    taken; counts that were typed stay.

    `candidates`: with the modes that each needs by itself; `most`: modes of an appendage;
    `fit` makes the chain of a candidate.
    """
    want = joint_request([item.body.spec for item in candidates])
    if want.band is None or want.tolerance is None:
        return [fit(item) for item in candidates], ()
    made: dict[int, Fit] = {}
    steps = list[str]()
    for members in by_base(craft, [item.mount for item in candidates]).values():
        group = [candidates[i] for i in members]
        made |= zip(members, _keep_on_base(craft, group, want, most, fit, steps), strict=True)
    return [made[i] for i in range(len(candidates))], tuple(steps)


def _keep_on_base(
    craft: "mujoco.MjModel",
    candidates: Sequence[Candidate],
    want: JointRequest,
    most: int,
    fit: Callable[[Candidate], Fit],
    steps: list[str],
) -> list[Fit]:
    """`fits_that_keep` for the appendages of one base body; `steps` gets a line for each."""
    assert want.band is not None
    assert want.tolerance is not None
    found = craft_poses(craft, [item.placed for item in candidates], want.band, want.motions)
    poses = {name: several[0] for name, several in found.items()}
    ours, best = list(candidates), list[Fit]()
    barred = set[int]()
    least = np.inf
    for _ in range(ROUNDS):
        wanted = _grow(poses, ours, want.tolerance, most, barred, steps)
        if best and all(new is old for new, old in zip(wanted, ours, strict=True)):
            break
        for i, item in enumerate(wanted):
            try:
                made = fit(item)
            except RealisationError as error:
                if item is ours[i]:
                    raise
                barred.add(i)
                steps.append(f"{item.at}: no chain has {item.modes} modes: {error}")
                made = fit(ours[i])
            ours[i] = replace(item, kept=made.kept, fit=made)
        error, _ = _worst(poses, [item.model for item in ours])
        if error < least or not best:
            best = [item.fit for item in ours if item.fit is not None]
            least = error
        if keeps_tolerance(least, want.tolerance):
            break
    return best


def _grow(
    poses: Mapping[str, Pose],
    ours: Sequence[Candidate],
    tolerance: float,
    most: int,
    barred: set[int],
    steps: list[str],
) -> list[Candidate]:
    """The appendages with the modes with which their models keep the tolerance,
    or the best up to `most` each.

    One mode at a time where it pays most; where none does, where its lack alone costs most.
    `steps` gets a line each.
    """
    ours = list(ours)
    # error with all exact but for one port, as it is now: by pose, appendage and port
    lacks = dict[tuple[str, int, str], float]()
    error, name = _worst(poses, [item.model for item in ours])
    while not keeps_tolerance(error, tolerance):
        worst = poses[name]
        further = {
            (i, key): longer
            for i, item in enumerate(ours)
            if i not in barred and item.modes < most
            for key, longer in item.offers(worst.band).items()
        }
        if not further:
            break
        found = _best(worst, [item.model for item in ours], further, PAYS * error, tolerance)
        if found is None:  # it takes several: the one that costs most
            for i, key in further:
                if (name, i, key) not in lacks:
                    lacks[name, i, key] = worst.of_exchange(i, ours[i].without(key))
            found = max(further, key=lambda k: lacks[name, *k])
            if lacks[name, *found] < IDLE * error:
                break  # nothing that modes could mend
        i, key = found
        for pose in poses:
            lacks.pop((pose, i, key), None)
        ours[i] = further[found]
        before = error
        error, name = _worst(poses, [item.model for item in ours])
        steps.append(
            f"{ours[i].at}: {ours[i].added}: error of the craft {before:.2e} -> {error:.2e}"
        )
    return ours


def _best(
    pose: Pose,
    models: Sequence[PortModel],
    further: Mapping[tuple[int, str], Candidate],
    most: float,
    tolerance: float,
) -> tuple[int, str] | None:
    """The mode more that leaves the least error, of those that leave `most` or less.

    A mode that leaves more than another where the error is highest now needs no trial.
    """

    def with_mode(key: tuple[int, str]) -> list[PortModel]:
        return [further[key].model if k == key[0] else model for k, model in enumerate(models)]

    tops = pose.tops(models)
    floors = {key: pose.error_at(with_mode(key), *tops) for key in further}
    best = None
    least = most, np.inf
    for key in sorted(floors, key=lambda k: floors[k]):
        if floors[key] > least[0]:
            break
        left = max(floors[key], pose.of_models(with_mode(key), tolerance))
        if (left, further[key].newest) < least:
            best = key
            least = left, further[key].newest
    return best


def _worst(poses: Mapping[str, Pose], models: Sequence[PortModel]) -> tuple[float, str]:
    errors = {name: pose.of_models(models) for name, pose in poses.items()}
    name = max(errors, key=lambda n: errors[n])
    return errors[name], name
