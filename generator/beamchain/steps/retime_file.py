"""What `retime` did to a compiled model, written into its MJCF document."""

from collections.abc import Callable, Iterable
from pathlib import Path

from lxml import etree
from lxml.etree import _Element as Element

from beamchain.checks import one_of
from beamchain.engine.forces import wraps
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import INTEGRATORS, NUMBERS, compile_model
from beamchain.errors import InputError
from beamchain.mjcf.craft import read_craft, relocate
from beamchain.mjcf.write import number
from beamchain.steps.integrators import SCHEMES, hinge_armature
from beamchain.steps.modal import modal_tendons
from beamchain.steps.poles import PoleRow, pole_rows
from beamchain.steps.retime import retime

SAFE = 1.8  # rad per step of a spring that nothing slows; 2 is the limit without damping


def put_time(parts: Iterable[Element], model: "mujoco.MjModel", named: Callable[[str], str] = lambda name: name) -> int:
    """Write a model's modal tendons into its document, and count them."""
    modal = modal_tendons(model)
    own = {name: int(i) for name, i in zip(modal.names, modal.index, strict=True)}
    found = 0
    for part in parts:
        for fixed in part.iter("fixed"):
            i = own.get(named(fixed.get("name") or ""))
            if i is None:
                continue
            found += 1
            for attribute, values in (
                ("stiffness", model.tendon_stiffness), ("damping", model.tendon_damping),
                ("armature", model.tendon_armature), ("solimplimit", model.tendon_solimp_lim),
            ):  # fmt: skip
                fixed.set(attribute, number(values[i]))
            coefficients = {model.joint(int(model.wrap_objid[w])).name: model.wrap_prm[w] for w in wraps(model, i)}
            for joint in fixed.iter("joint"):
                joint.set("coef", number(float(coefficients[named(joint.get("joint") or "")])))
    return found


def put_hinge_armature(root: Element, timestep: float, integrator: str) -> None:
    """Armature on hinges with springs of their own, for Euler and its kin."""
    if not SCHEMES[integrator].exact:
        return
    for joint in root.iter("joint"):
        stiffness = joint.get("stiffness")
        if stiffness is not None and float(stiffness) > 0.0:
            joint.set("armature", number(hinge_armature(float(stiffness), timestep)))


def retimed_file(path: Path, timestep: float, integrator: str | None, folder: Path) -> tuple[bytes, list[PoleRow]]:
    """A model's file made exact in time (0: timing taken out), and what its modes show."""
    document = relocate(read_craft(path), folder)
    model = compile_model(path)
    if integrator is not None:
        one_of("integrator", integrator, tuple(INTEGRATORS))
        model.opt.integrator = INTEGRATORS[integrator]
    name = NUMBERS[int(model.opt.integrator)]
    if timestep > 0.0:
        model.opt.timestep = timestep
    retime(model, timestep, name, form=4)
    rows = pole_rows(model)
    grown = [row.frequency for row in rows if row.grows]
    if grown and timestep > 0.0:
        raise InputError(
            f"{name} at {timestep:g} s is unstable whatever the appendages do: the spacecraft's own springs vibrate at "
            f"{max(grown):.4g} rad/s, and only modes of appendages are slowed; take a step below {SAFE / max(grown):.2g} s, "
            "or leave those springs out."
        )
    parts = document.parts()
    missing = len(modal_tendons(model).names) - put_time(parts, model)
    if missing:
        raise InputError(
            f"{missing} modal tendons of the model stand in files that it attaches, which this command does not write; "
            'give one self-contained file (`beamchain embed` without form "attach"), or use bc.retime on the compiled model.'
        )
    own = document.root
    option = own.find("option")
    if option is None:
        option = etree.Element("option")
        option.tail = "\n  "
        own.insert(0, option)
    if timestep > 0.0:
        option.set("timestep", number(timestep))
    if integrator is not None:
        option.set("integrator", integrator)
    if any(part is not own and part.find(".//fixed") is not None for part in parts):
        raise InputError(
            "the modal tendons stand in a file that this one includes; give that file, or one without <include>."
        )
    return document.to_bytes(), rows
