"""What of a spacecraft's appendages may be changed where a tolerance is missed, and its error at
another step."""

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from msgspec import structs

from beamchain.craft.appendage import Appendage
from beamchain.craft.error import Pose
from beamchain.craft.promise import candidate_of, joint_request
from beamchain.craft.timing import decide_timing, fit_on_tendons, with_timing
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import INTEGRATORS
from beamchain.fitting.candidate import free_ports
from beamchain.fitting.cure import FREE, modes_entry, with_free_modes, with_modal_damping
from beamchain.fitting.spec import Spec
from beamchain.steps.cures import Setting

LIKELY = 2  # places for a mode more that are tried: those that help most by the models


def changes_of(
    appendages: Sequence[Appendage], places: Sequence[str], exact: Mapping[str, Sequence[Pose]]
) -> dict[str, dict[str, Spec]]:
    """Changes of specifications that may help, in words, with the specifications by place: dampers
    on the modes, one mode more, no typed numbers of modes. Appendages of one specification are
    changed together.

    `places`: of those that may be changed; `exact`: the answers of `craft_poses`.
    """
    groups: list[list[int]] = []
    for i, a in enumerate(appendages):
        if a.at in places:
            same = (group for group in groups if appendages[group[0]].spec == a.spec)
            group = next(same, None)
            groups.append([i]) if group is None else group.append(i)
    out: dict[str, dict[str, Spec]] = {}
    for group in groups:
        modal = with_modal_damping(appendages[group[0]].spec)
        if modal is not None:
            out[_words('write damping.form = "modal"', appendages, group)] = {
                appendages[i].at: modal for i in group
            }
    poses = [pose for several in exact.values() for pose in several]
    band = max(pose.band for pose in poses)
    models = [candidate_of(a).model for a in appendages]
    free = [with_free_modes(a.spec) for a in appendages]
    found: list[tuple[float, str, dict[str, Spec]]] = []
    for group in groups:
        longer = [candidate_of(appendages[i], free[i]).offers(band) for i in group]
        for key in longer[0]:
            wished = {i: one[key] for i, one in zip(group, longer, strict=True) if key in one}
            ours = [wished[i].model if i in wished else m for i, m in enumerate(models)]
            specs = {
                appendages[i].at: structs.replace(one.stated, root=free[i].root)
                for i, one in wished.items()
            }
            said = f"keep one mode more ({modes_entry(next(iter(specs.values())))})"
            left = max(pose.of_models(ours) for pose in poses)
            found.append((left, _words(said, appendages, group), specs))
    found.sort(key=lambda one: one[0])
    out |= {words: specs for _, words, specs in found[:LIKELY]}
    for group in groups:
        scene = free[group[0]].scene
        typed = free[group[0]] != appendages[group[0]].spec
        if typed and scene is not None and scene.bandwidth is not None:
            out[_words(FREE, appendages, group)] = {appendages[i].at: free[i] for i in group}
    return out


def more_modes(appendages: Sequence[Appendage], most: int) -> dict[str, int]:
    """A larger number of modes to allow an appendage, in words, where one has as many as `most`."""
    full = any(free_ports(a.spec) and candidate_of(a).modes >= most for a in appendages)
    if not (full and most):
        return {}
    said = f"allow {2 * most} modes an appendage (max_modes in Python, or state [modes])"
    return {said: 2 * most}


def _words(said: str, appendages: Sequence[Appendage], group: Sequence[int]) -> str:
    return f"{said} in the specification at {' and '.join(appendages[i].at for i in group)}"


def models_at(
    setting: Setting,
    plain: "mujoco.MjModel",
    appendages: Sequence[Appendage],
    build: "Callable[[tuple[Appendage, ...]], mujoco.MjModel | None]",
    *,
    joints: bool,
) -> "tuple[mujoco.MjModel, mujoco.MjModel | None]":
    """The model at another step or integrator, without timing and with it; None where timing is not
    needed there, or needs tendons that the model does not have.

    `plain`: without timing; `build` compiles the spacecraft with other appendages.
    """

    def stepped(model: "mujoco.MjModel") -> "mujoco.MjModel":
        out = copy.copy(model)
        out.opt.timestep = setting.timestep
        out.opt.integrator = INTEGRATORS[setting.integrator]
        return out

    bare = stepped(plain)
    if not decide_timing(bare, appendages, setting.timing).needed:
        return bare, None
    on_tendons = tuple(replace(a, fit=fit_on_tendons(a.fit)) for a in appendages)
    sprung: mujoco.MjModel | None = bare
    if any(a.fit is not b.fit for a, b in zip(on_tendons, appendages, strict=True)):
        built = build(on_tendons)
        sprung = None if built is None else stepped(built)
    if sprung is None:
        return bare, None
    band = joint_request([a.spec for a in appendages]).band
    return bare, with_timing(sprung, band, joints=joints)[0]
