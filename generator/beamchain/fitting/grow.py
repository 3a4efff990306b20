"""The fewest modes that keep a tolerance: added one at a time where they pay most, then taken away
where they are not needed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from beamchain.fitting.candidate import Candidate
from beamchain.fitting.kept import Kept
from beamchain.ports.compare import keeps_tolerance
from beamchain.ports.model import PortModel

PAYS = 0.9  # a mode that leaves more than this of the error pays little by itself
IDLE = 0.05  # of the error: a port that alone costs less is not what it comes from


class Judge(Protocol):
    """Appendages on a hub or on a spacecraft at a pose, against the exact ones there."""

    @property
    def band(self) -> float:
        """Upper end of the band [rad/s]."""
        ...

    def of_models(self, models: Sequence[PortModel], tolerance: float | None = None) -> float:
        """In-band error with these models in six motions; with a `tolerance` as a search needs
        it."""
        ...

    def of_exchange(self, number: int, model: PortModel) -> float:
        """In-band error with a model for one appendage, and all others exact."""
        ...

    def floor(self, models: Sequence[PortModel]) -> Callable[[Sequence[PortModel]], float]:
        """What the in-band error of other models is no smaller than: their error where that of
        these is highest."""
        ...


@dataclass(frozen=True)
class Step:
    """A mode that was added: of which appendage, in words, and the error `before` and `after`."""

    number: int
    added: str
    before: float
    after: float


def grow(
    judges: Mapping[str, Judge],
    candidates: Sequence[Candidate],
    tolerance: float,
    may_keep: Callable[[int, Candidate], bool],
) -> tuple[list[Candidate], list[Step]]:
    """The candidates with the modes with which their models keep the tolerance, or the best that
    they may keep; and the steps taken.

    One mode at a time where it pays most; where none does, where its lack alone costs most.
    `may_keep`: whether appendage i may become another candidate.
    """
    ours, steps = list(candidates), list[Step]()
    # error with all exact but for a part, as it is now: by judge, number and part
    lacks = dict[tuple[str, int, str], float]()
    error, name = worst(judges, [item.model for item in ours], tolerance)
    while not keeps_tolerance(error, tolerance):
        judge = judges[name]
        offers = {
            (i, key): longer
            for i, item in enumerate(ours)
            for key, longer in item.offers(judge.band).items()
            if may_keep(i, longer)
        }
        if not offers:
            break
        found = _best(judge, [item.model for item in ours], offers, PAYS * error, tolerance)
        if found is None:  # it takes several: the one that costs most
            parts = {(i, key): (name, i, ours[i].part(key)) for i, key in offers}
            for part in parts.values():
                if part not in lacks:
                    lacks[part] = judge.of_exchange(part[1], ours[part[1]].without(part[2]))
            found = max(offers, key=lambda k: lacks[parts[k]])
            # what alone costs more than the tolerance has to be mended whatever else is
            if lacks[parts[found]] < min(IDLE * error, tolerance):
                break  # nothing that modes could mend
        i, key = found
        for each in judges:
            lacks.pop((each, i, ours[i].part(key)), None)
        ours[i] = offers[found]
        before = error
        error, name = worst(judges, [item.model for item in ours], tolerance)
        steps.append(Step(i, ours[i].added, before, error))
    return ours, steps


def prune(judge: Judge, item: Candidate, least: Kept, tolerance: float) -> Candidate:
    """A candidate alone without the modes that it does not need; it keeps the `least`."""

    def error(one: Candidate) -> float:
        return judge.of_models([one.model], tolerance)

    for key in item.droppable(judge.band, least):
        while (fewer := item.dropping(key, least)) is not None:
            left = error(fewer)
            if not keeps_tolerance(left, tolerance) and left > error(item):
                break
            item = fewer
    return item


def worst(
    judges: Mapping[str, Judge], models: Sequence[PortModel], tolerance: float | None = None
) -> tuple[float, str]:
    """The largest error, with a `tolerance` as a search needs it, and whose it is."""
    errors = {name: judge.of_models(models, tolerance) for name, judge in judges.items()}
    name = max(errors, key=lambda n: errors[n])
    return errors[name], name


def _best(
    judge: Judge,
    models: Sequence[PortModel],
    offers: Mapping[tuple[int, str], Candidate],
    most: float,
    tolerance: float,
) -> tuple[int, str] | None:
    """The mode more that leaves the least error, of those that leave `most` or less.

    A mode that leaves more than another where the error is highest now needs no trial.
    """

    def with_mode(key: tuple[int, str]) -> list[PortModel]:
        return [offers[key].model if k == key[0] else model for k, model in enumerate(models)]

    floor = judge.floor(models)
    floors = {key: floor(with_mode(key)) for key in offers}
    best = None
    least = most, np.inf
    for key in sorted(floors, key=lambda k: floors[k]):
        if floors[key] > least[0]:
            break
        left = max(floors[key], judge.of_models(with_mode(key), tolerance))
        if (left, offers[key].newest) < least:
            best = key
            least = left, offers[key].newest
    return best
