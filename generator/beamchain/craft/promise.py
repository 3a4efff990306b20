"""What the craft is promised, and the modes that keep it:
added one at a time where they pay most."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamchain.craft.appendage import Appendage, carried
from beamchain.craft.candidates import Candidate, candidate, model_of
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


def keep_promise(
    craft: "mujoco.MjModel",
    appendages: tuple[Appendage, ...],
    most: int,
    refit: Callable[[Appendage, Spec], Fit],
) -> tuple[tuple[Appendage, ...], tuple[str, ...]]:
    """The appendages with as many modes as the craft's promise needs, and the steps taken;
    counts that were typed stay.

    `most`: modes of an appendage; `refit` fits an appendage anew with the modes
    that a spec asks for.
    """
    want = joint_request([a.spec for a in appendages])
    if want.band is None or want.tolerance is None:
        return appendages, ()
    kept = list(appendages)
    steps = list[str]()
    for members in by_base(craft, [a.mount for a in appendages]).values():
        group = [appendages[i] for i in members]
        for i, a in zip(
            members, _keep_on_base(craft, group, want, most, refit, steps), strict=True
        ):
            kept[i] = a
    return tuple(kept), tuple(steps)


def _keep_on_base(
    craft: "mujoco.MjModel",
    appendages: Sequence[Appendage],
    want: JointRequest,
    most: int,
    refit: Callable[[Appendage, Spec], Fit],
    steps: list[str],
) -> Sequence[Appendage]:
    """`keep_promise` for the appendages of one base body; `steps` gets a line for each."""
    assert want.band is not None
    assert want.tolerance is not None
    found = craft_poses(craft, carried(None, appendages), want.band, want.motions)
    flat = {name: several[0] for name, several in found.items()}
    best = appendages
    least = _worst(flat, [model_of(a) for a in appendages])[0]
    ours = list(appendages)
    barred = set[int]()
    for _ in range(ROUNDS):
        if keeps_tolerance(least, want.tolerance):
            break
        wanted = _grow(flat, [candidate(a) for a in ours], want.tolerance, most, barred, steps)
        changed = [i for i, item in enumerate(wanted) if item.grown]
        if not changed:
            break
        for i in changed:
            try:
                ours[i] = replace(ours[i], fit=refit(ours[i], wanted[i].spec))
            except RealisationError as error:
                barred.add(i)
                steps.append(f"{ours[i].at}: no chain has {wanted[i].modes} modes: {error}")
        error, _ = _worst(flat, [model_of(a) for a in ours])
        if error < least:
            best = tuple(ours)
            least = error
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
            for key, longer in item.further(worst.band).items()
        }
        if not further:
            break
        found = _best(worst, [item.model for item in ours], further, PAYS * error, tolerance)
        if found is None:  # it takes several: the one that costs most
            for i, key in further:
                if (name, i, key) not in lacks:
                    lacks[name, i, key] = worst.of_exchange(i, ours[i].alone(key))
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
            f"{ours[i].a.at}: {ours[i].added}: error of the craft {before:.2e} -> {error:.2e}"
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
