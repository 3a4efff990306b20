"""What `retime` did to a compiled model, written into its MJCF document."""

from collections.abc import Callable, Iterable

import numpy as np
from lxml.etree import _Element as Element

from beamchain.engine.forces import wraps
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.mjcf.write import number
from beamchain.steps.discrete import SCHEMES, hinge_armature
from beamchain.steps.modal import JOINT, modal_tendons


def put_time(parts: Iterable[Element], model: "mujoco.MjModel", named: Callable[[str], str] = lambda name: name) -> int:
    """Write armature, damping, stiffness, coefficients and mark of a model's modal tendons into its document.

    Args:
        parts: roots of the document that hold the tendons.
        model: compiled from them, then retimed.
        named: name in the model of what has a name in the document.

    Returns:
        how many tendons were found.
    """
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
                value = np.atleast_1d(values[i])
                fixed.set(attribute, number(value if attribute == "solimplimit" else value[0]))
            coefficients = {
                model.joint(int(model.wrap_objid[w])).name: float(model.wrap_prm[w])
                for w in wraps(model, i)
                if int(model.wrap_type[w]) == JOINT
            }
            for joint in fixed.iter("joint"):
                joint.set("coef", number(coefficients[named(joint.get("joint") or "")]))
    return found


def put_hinge_armature(root: Element, timestep: float, integrator: str) -> None:
    """Armature `k h^2/12` on hinges with springs of their own: the form without tendons, right to fourth order.

    Args:
        root: of the appendage's document.
        timestep: [s].
        integrator: MuJoCo's name; nothing is done for those that it does not help.
    """
    if not SCHEMES[integrator].exact:
        return
    for joint in root.iter("joint"):
        stiffness = joint.get("stiffness")
        if stiffness is not None and float(stiffness) > 0.0:
            joint.set("armature", number(hinge_armature(float(stiffness), timestep)))


def check_found(found: int, model: "mujoco.MjModel") -> None:
    """Every modal tendon of the model stands in the document.

    Raises:
        InputError: some stand in files that the document attaches.
    """
    missing = len(modal_tendons(model).names) - found
    if missing:
        raise InputError(
            f"{missing} modal tendons of the model stand in files that it attaches, which this command does not write; "
            'give one self-contained file (`beamchain embed` without form "attach"), or use bc.retime on the compiled model.'
        )
