"""What the craft is promised, and the modes that keep it: added one at a time where they pay most."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from beamchain.craft.appendage import Appendage, carried
from beamchain.craft.error import Pose, craft_poses
from beamchain.engine.library import mujoco
from beamchain.errors import InputError, RealisationError
from beamchain.fitting.hub import port_hub_mass
from beamchain.fitting.needs import AXES
from beamchain.fitting.options import Modes, Scene
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec
from beamchain.ports.compose import in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS

MOST_MODES = 12  # of an appendage, unless --max-modes says otherwise
PAYS = 0.9  # a mode that leaves more than this of the error pays little by itself
IDLE = 0.05  # of the error: a port that alone costs less is not what it comes from
ROUNDS = 3  # of growing and fitting: what comes out may miss what was foreseen


@dataclass(frozen=True)
class Asked:
    """What the scenes of all appendages ask of the craft together.

    Args:
        band: the largest [rad/s]; None where no scene states one.
        tolerance: the smallest; None where no scene states a band.
        motions: union of the motions asked for (0 to 5), in the base body's axes; all where nothing is asked.
    """

    band: float | None
    tolerance: float | None
    motions: tuple[int, ...]


def asked(specs: Sequence[Spec]) -> Asked:
    """What the scenes with a bandwidth ask for: largest band, smallest tolerance, union of the motions."""
    scenes = [s.scene for s in specs if s.scene is not None and s.scene.bandwidth is not None]
    if not scenes:
        return Asked(None, None, tuple(range(6)))
    motions = tuple(sorted({AXES[axis] for scene in scenes for axis in scene.axes}))
    return Asked(max(_band(scene) for scene in scenes), min(scene.tolerance for scene in scenes), motions)


def _band(scene: Scene) -> float:
    assert scene.bandwidth is not None
    return scene.bandwidth


def kept_band(appendages: Sequence[Appendage]) -> float:
    """Up to here every appendage keeps every mode of its kept ports [rad/s]."""
    return min(w for item in carried(None, appendages) for w in item.band.values())


def in_six(fit: Fit, changed: Mapping[str, PortModel] | None = None) -> PortModel:
    """A fit in six motions as MuJoCo has it; `changed`: other models of some ports."""
    if fit.space is not None:
        live, model = list(fit.space.live), fit.space.achieved
        rigid, rows = np.zeros((6, 6)), np.zeros((model.modes, 6))
        rigid[np.ix_(live, live)], rows[:, live] = model.rigid_mass, model.participation
        rigid += np.diag(np.where(np.diag(rigid) > 0.0, 0.0, np.diag(fit.measured.rigid_mass)))
        return PortModel(rigid, model.frequencies, rows, model.damping)
    return in_space({**fit.achieved, **(changed or {})}, fit.measured.rigid_mass)


def keep_promise(
    craft: "mujoco.MjModel",
    appendages: tuple[Appendage, ...],
    most: int,
    refit: Callable[[Appendage, dict[str, int]], Fit],
) -> tuple[tuple[Appendage, ...], tuple[str, ...]]:
    """The appendages with as many modes as the craft's promise needs, and the steps taken.

    Counts that were typed stay.

    Args:
        craft: the bare spacecraft.
        appendages: each fitted on its own hub.
        most: modes of an appendage.
        refit: fits an appendage anew with a number of modes per port.
    """
    want = asked([a.spec for a in appendages])
    if want.band is None or want.tolerance is None:
        return appendages, ()
    found = craft_poses(craft, carried(None, appendages), want.band, want.motions)
    if len(next(iter(found.values()))) > 1:  # several craft in one file
        return appendages, ()
    flat = {name: several[0] for name, several in found.items()}
    best, least = appendages, _worst(flat, [in_six(a.fit) for a in appendages])[0]
    ours, steps, barred = list(appendages), list[str](), set[tuple[int, str]]()
    for _ in range(ROUNDS):
        if least <= want.tolerance:
            break
        counts = [{port: target.modes for port, target in a.fit.target.items()} for a in ours]
        wanted = _grow(flat, ours, counts, want.tolerance, most, barred, steps)
        changed = [i for i, a in enumerate(ours) if any(a.fit.target[p].modes != n if p in a.fit.target else n
                                                        for p, n in wanted[i].items())]  # fmt: skip
        if not changed:
            break
        for i in changed:
            try:
                ours[i] = replace(ours[i], fit=refit(ours[i], wanted[i]))
            except RealisationError as error:
                barred |= {(i, port) for port in PORTS}
                steps.append(f"{ours[i].at}: no chain has {wanted[i]}: {error}")
        error, _ = _worst(flat, [in_six(a.fit) for a in ours])
        if error < least:
            best, least = tuple(ours), error
    return best, tuple(steps)


def _grow(
    poses: Mapping[str, Pose],
    ours: Sequence[Appendage],
    counts: Sequence[dict[str, int]],
    tolerance: float,
    most: int,
    barred: set[tuple[int, str]],
    steps: list[str],
) -> list[dict[str, int]]:
    """Modes per appendage and port with which the models keep the tolerance, or the best up to `most`.

    One mode at a time where it pays most; where none pays by itself, in the port that alone costs most. `steps` gets a line each.
    """
    counts = [dict(some) for some in counts]
    changed: list[dict[str, PortModel]] = [{} for _ in ours]

    def models(more: Mapping[tuple[int, str], PortModel]) -> list[PortModel]:
        return [
            in_six(a.fit, {**changed[i], **{port: m for (k, port), m in more.items() if k == i}})
            for i, a in enumerate(ours)
        ]

    error, worst = _worst(poses, models({}))
    while error > tolerance:
        further: dict[tuple[int, str], PortModel] = {}
        for i, a in enumerate(ours):
            if sum(counts[i].values()) < most:
                further |= {(i, p): m for p, m in _further(a, counts[i]).items() if (i, p) not in barred}
        if not further:
            break
        tried = {key: worst.of_models(models({key: further[key]})) for key in further}
        found = min(tried, key=lambda k: (tried[k], further[k].frequencies[-1]))
        if tried[found] > PAYS * error:  # it takes several: the port that alone costs most, the others exact
            alone = {key: worst.of_models(_alone(worst, ours, changed, key)) for key in further}
            heavy = max(alone, key=lambda k: alone[k])
            if alone[heavy] < IDLE * error:
                break  # nothing that modes could mend
            found = heavy if tried[heavy] > PAYS * error or tried[found] > tried[heavy] else found
        i, port = found
        changed[i][port] = further[found]
        counts[i][port] = counts[i].get(port, 0) + 1
        before = error
        error, worst = _worst(poses, models({}))
        steps.append(f"{ours[i].at}: mode {counts[i][port]} in {port}: error of the craft {before:.2e} -> {error:.2e}")
    return counts


def _alone(
    pose: Pose, ours: Sequence[Appendage], changed: Sequence[Mapping[str, PortModel]], key: tuple[int, str]
) -> list[PortModel]:
    """Exact appendages, but for one port of one of them, which stays as it is."""
    i, port = key
    fit, out = ours[i].fit, [item.whole for item in pose.carried]
    own = {p: fit.spec.with_ratios(p, model) for p, model in fit.full.items()}
    for p in PORTS:
        if p not in own and p != port and p in fit.achieved:
            own[p] = fit.achieved[p]
    now = changed[i].get(port, fit.achieved.get(port))
    own = {p: model for p, model in own.items() if p != port}
    out[i] = in_space(own if now is None else {**own, port: now}, fit.measured.rigid_mass)
    return out


def _worst(poses: Mapping[str, Pose], models: Sequence[PortModel]) -> tuple[float, Pose]:
    errors = {name: pose.of_models(models) for name, pose in poses.items()}
    name = max(errors, key=lambda n: errors[n])
    return errors[name], poses[name]


def _further(a: Appendage, counts: Mapping[str, int]) -> dict[str, PortModel]:
    """Per port whose number of modes is free, its model with one mode more."""
    spec, fit = a.spec, a.fit
    if spec.imported is not None or spec.fit.method != "exact":
        return {}
    given = {} if spec.modes is None else spec.modes.given()
    if spec.modes is not None and not spec.chooses:
        return {}
    out: dict[str, PortModel] = {}
    for port in PORTS:
        if port in given:
            continue
        count = counts.get(port, 0) + 1
        try:
            full = fit.full[port] if port in fit.full else spec.beam.port(port, 2 * count + 4)
        except InputError:
            continue  # rigid there
        if count > full.modes:
            continue
        if fit.kept_for == "clamped":
            model = full.truncated(count)
        else:
            hub = a.hub.mass_matrix() if fit.kept_for == "hub" else np.zeros((6, 6))
            model = full.reduced(count, port_hub_mass(hub, port))
        out[port] = spec.with_ratios(port, model)
    return out


def with_counts(spec: Spec, counts: Mapping[str, int]) -> Spec:
    """The spec with its modes per port."""
    return msgspec.structs.replace(spec, modes=Modes(**{port: counts.get(port, 0) for port in PORTS}))
