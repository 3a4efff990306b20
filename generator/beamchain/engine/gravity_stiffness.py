"""Pendulums read back from MuJoCo: the stiffness that an acceleration gives their hinges."""

from copy import deepcopy

import numpy as np
from lxml.etree import _Element as Element

from beamchain.engine.library import mujoco
from beamchain.engine.linear import POSITION, slopes
from beamchain.engine.linearise import compile_model
from beamchain.mjcf import write
from beamchain.ports.motions import Array


def sprung_by_acceleration(appendage: Element, acceleration: float) -> Element:
    """A drop-in element whose hinges have springs as stiff as MuJoCo's gravity against the x axis
    of the root makes them with the root held [m/s^2]."""
    out = deepcopy(appendage)
    model = compile_model(write.document_text(deepcopy(appendage)))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    root = write.find(appendage, "worldbody/body").get("name") or ""
    model.opt.gravity[:] = -acceleration * data.body(root).xmat.reshape(3, 3)[:, 0]

    def force(i: int, by: float) -> Array:
        data.qpos[:] = model.qpos0
        mujoco.mj_integratePos(model, data.qpos, np.eye(model.nv)[i], by)
        mujoco.mj_forward(model, data)
        return np.array(data.qfrc_bias - data.qfrc_passive)

    stiffness = np.diag(slopes(force, model.nv, POSITION))
    for joint in out.iter("joint"):
        if joint.get("stiffness") is not None:
            number = int(model.joint(str(joint.get("name"))).dofadr[0])
            write.set_attributes(joint, stiffness=float(stiffness[number]))
    return out
