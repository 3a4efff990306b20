"""What the craft is promised, and the modes that keep it: added one at a time where they pay most."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from beamchain.appendage import Appendage, carried
from beamchain.assess.craft_error import Pose, craft_poses
from beamchain.assess.needs import AXES
from beamchain.engine.library import mujoco
from beamchain.errors import InputError, RealisationError
from beamchain.motion import PORTS
from beamchain.port import PortModel, in_space
from beamchain.result import Fit
from beamchain.spec import Modes, Scene, Spec, port_hub_mass

MOST_MODES = 12  # of an appendage, unless --max-modes says otherwise
FOR_TIES = 1e-9  # relative: a gain that is none


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

    One mode at a time, in the port of the appendage where it lowers the error most; counts that were typed stay.

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
    ours = list(appendages)
    models = [in_six(a.fit) for a in ours]
    barred: set[tuple[int, str, int]] = set()
    steps: list[str] = []
    error, worst = _worst(flat, models)
    best, least = tuple(ours), error
    while error > want.tolerance:
        tried: dict[tuple[int, str], float] = {}
        for i, a in enumerate(ours):
            if sum(m.modes for m in a.fit.target.values()) >= most:
                continue
            for port, model in _further(a).items():
                if (i, port, model.modes) not in barred:
                    changed = [*models[:i], in_six(a.fit, {port: model}), *models[i + 1 :]]
                    tried[i, port] = worst.of_models(changed)
        if not tried:
            break
        i, port = _choice(ours, tried)
        counts = {p: m.modes for p, m in ours[i].fit.target.items()}
        counts[port] = counts.get(port, 0) + 1
        try:
            again = replace(ours[i], fit=refit(ours[i], counts))
        except RealisationError:
            barred.add((i, port, counts[port]))
            continue
        ours[i], models[i] = again, in_six(again.fit)
        before = error
        error, worst = _worst(flat, models)
        steps.append(
            f"{again.at}: {counts[port]} modes in {port} instead of {counts[port] - 1}: "
            f"error of the craft {before:.2e} -> {error:.2e}"
        )
        if error < least:
            best, least = tuple(ours), error
    return best, tuple(steps)


def _worst(poses: Mapping[str, Pose], models: Sequence[PortModel]) -> tuple[float, Pose]:
    errors = {name: pose.of_models(models) for name, pose in poses.items()}
    name = max(errors, key=lambda n: errors[n])
    return errors[name], poses[name]


def _choice(appendages: Sequence[Appendage], tried: Mapping[tuple[int, str], float]) -> tuple[int, str]:
    """The port where one mode more leaves the least error; of equals the one whose next mode is slowest."""
    least = min(tried.values())
    equal = [key for key, value in tried.items() if value <= least * (1.0 + FOR_TIES)]
    return min(equal, key=lambda key: float(_further(appendages[key[0]])[key[1]].frequencies[-1]))


def _further(a: Appendage) -> dict[str, PortModel]:
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
        count = fit.target[port].modes + 1 if port in fit.target else 1
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
