"""What `retime` did to a compiled model, written into its MJCF document."""

import copy
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from lxml import etree
from lxml.etree import _Element as Element

from beamchain.checks import one_of
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import INTEGRATORS, NUMBERS, compile_model
from beamchain.engine.model_checks import TRIAL, check_step, steps_well
from beamchain.engine.operating_point import pose_words, poses
from beamchain.errors import InputError
from beamchain.mjcf.craft import Craft, read_craft
from beamchain.mjcf.relocate import relocate
from beamchain.mjcf.undo_marks import JointMark, change_once_marked, name_step
from beamchain.mjcf.write import number
from beamchain.steps.integrators import SCHEMES, hinge_armature
from beamchain.steps.joint_time import timed_joints
from beamchain.steps.modal import TimingMark, made_for, modal_tendons, timing_marks
from beamchain.steps.poles import PoleRow, growing_frequencies, pole_rows
from beamchain.steps.retime import retime, retime_by
from beamchain.steps.step_map import growing_poses

SAFE = 1.8  # rad per step of a spring that nothing slows; 2 is the limit without damping


def time_attributes(
    parts: Iterable[Element],
    model: "mujoco.MjModel",
    named: Callable[[str], str] = lambda name: name,
) -> dict[Element, dict[str, str]]:
    """Attributes of a document's modal tendons as the model has them.

    `named`: the model's name of what the document names so.
    """
    modal = modal_tendons(model)
    numbers = {name: int(i) for name, i in zip(modal.names, modal.index, strict=True)}
    out: dict[Element, dict[str, str]] = {}
    for fixed in (element for part in parts for element in part.iter("fixed")):
        i = numbers.get(named(fixed.get("name") or ""))
        if i is None:
            continue
        out[fixed] = {
            "stiffness": number(model.tendon_stiffness[i]),
            "damping": number(model.tendon_damping[i]),
            "armature": number(model.tendon_armature[i]),
            "solimplimit": number(model.tendon_solimp_lim[i]),
        }
    return out


def joint_attributes(
    parts: Iterable[Element], model: "mujoco.MjModel", dofs: Iterable[int]
) -> dict[Element, dict[str, str]]:
    """Attributes of a document's joints as the model has them, for those of some degrees of
    freedom."""
    elements = {str(node.get("name")): node for part in parts for node in part.iter("joint")}
    out: dict[Element, dict[str, str]] = {}
    for dof in dofs:
        joint = model.joint(int(model.dof_jntid[dof]))
        if joint.name not in elements:
            body = model.body(int(model.dof_bodyid[dof])).name
            raise InputError(
                f"a sprung joint of body {body!r} does not stand by name in the file itself, so "
                "that its armature cannot be written; give it a name there, or leave out the "
                "timing of joints."
            )
        out[elements[joint.name]] = {
            "armature": number(model.dof_armature[dof]),
            "solimpfriction": number(model.dof_solimp[dof]),
        }
    return out


def put_time(
    tree: Element, model: "mujoco.MjModel", named: Callable[[str], str] = lambda name: name
) -> None:
    """Write a model's modal tendons into an appendage's tree."""
    changes = time_attributes([tree], model, named)
    for element, attributes in changes.items():
        for name, value in attributes.items():
            element.set(name, value)
    if changes:
        _put_words(tree, timed_words(model))


def put_hinge_armature(root: Element, timestep: float, integrator: str) -> None:
    """Armature on hinges with springs of their own, for Euler and its kin."""
    if not SCHEMES[integrator].exact:
        return
    for joint in root.iter("joint"):
        stiffness = joint.get("stiffness")
        if stiffness is not None and float(stiffness) > 0.0:
            joint.set("armature", number(hinge_armature(float(stiffness), timestep)))
    _put_words(root, TimingMark(timestep, integrator, 2).words)


def _put_words(root: Element, words: str) -> None:
    root.insert(0, etree.Comment(f" {words} "))


def timed_words(model: "mujoco.MjModel") -> str:
    """Which integrator and step a model is timed for; empty where nothing in it is."""
    joints = [made_for(model.dof_solimp[dof]) for dof in timed_joints(model)]
    made = next(filter(None, [*timing_marks(model), *joints]), None)
    return "" if made is None else made.words


class RetimedFile(NamedTuple):
    """A model's file with timing for a step, the model that it compiles to with and without it,
    and what its modes show."""

    text: bytes
    model: "mujoco.MjModel"
    plain: "mujoco.MjModel"
    rows: list[PoleRow]
    notes: list[str]


def retimed_file(
    path: Path,
    timestep: float,
    integrator: str | None,
    folder: Path,
    band: float | None = None,
    *,
    joints: bool = False,
) -> RetimedFile:
    """A model's file made exact in time (0: timing taken out); `band`, `joints` as of `retime`."""
    if timestep > 0.0:
        check_step(timestep, "timestep")
    document = relocate(read_craft(path), folder)
    model = compile_model(path)
    if integrator is not None:
        one_of("integrator", integrator, tuple(INTEGRATORS))
        model.opt.integrator = INTEGRATORS[integrator]
    name = NUMBERS[int(model.opt.integrator)]
    if timestep > 0.0:
        model.opt.timestep = timestep
    before = timed_joints(model)
    done = retime_by(4, model, timestep, name, band=band, joints=joints)
    plain = copy.copy(model)
    retime(plain, 0.0)
    rows = pole_rows(model, plain)
    if timestep > 0.0:
        _check_stable(model)
    changes = time_attributes(document.parts(), model)
    _check_tendons(document, model, changes)
    joints_changed = joint_attributes([document.root], model, {*before, *timed_joints(model)})
    option = document.root.find("option")
    settings: dict[str, str] = {}
    if timestep > 0.0:
        settings["timestep"] = number(timestep)
    if integrator is not None:
        settings["integrator"] = integrator
    if option is not None and settings:
        changes[option] = settings
    edits = [document.change(element, attributes) for element, attributes in changes.items()]
    edits += [
        change_once_marked(document, element, JointMark, attributes)
        for element, attributes in joints_changed.items()
    ]
    if option is None and settings:
        words = " ".join(f'{name}="{value}"' for name, value in settings.items())
        edits.append(document.prepend(document.root, f"<option {words}/>"))
    document = name_step(document.edit(edits), timed_words(model))
    return RetimedFile(document.content, model, plain, rows, done.slowed)


def _check_stable(model: "mujoco.MjModel") -> None:
    """The model, as it is written, does not grow at its step in any pose."""
    name = NUMBERS[int(model.opt.integrator)]
    timestep = model.opt.timestep
    places = poses(model)
    growing = growing_poses(model, places)
    if growing:
        grown = growing_frequencies(model, places[growing[0]])
        where = "" if growing[0] == "rest" else f" in {pose_words(growing[0])}"
        raise InputError(
            f"{name} at {timestep:g} s is unstable whatever the appendages do: the spacecraft's "
            f"own springs vibrate at {max(grown):.4g} rad/s{where}, and only modes of appendages "
            f"are slowed; take a step below {SAFE / max(grown):.2g} s, let their joints have "
            "armature (--retime-joints), or leave those springs out."
        )
    if not steps_well(model):
        raise InputError(
            f"{name} at {timestep:g} s diverges within {TRIAL} steps, so that nothing is written; "
            "take a shorter step."
        )


def _check_tendons(
    document: Craft, model: "mujoco.MjModel", changes: Mapping[Element, object]
) -> None:
    """All modal tendons of the model stand in the file itself."""
    included = {element for part in document.parts()[1:] for element in part.iter()}
    missing = len(modal_tendons(model).names) - sum(element.tag == "fixed" for element in changes)
    if missing:
        raise InputError(
            f"{missing} modal tendons of the model stand in files that it attaches, which this "
            "command does not write; "
            "give one self-contained file, as `beamchain embed` writes it, or use bc.retime on the "
            "compiled model."
        )
    if not included.isdisjoint(changes):
        raise InputError(
            "the modal tendons stand in a file that this one includes; give that file, or one "
            "without <include>."
        )
