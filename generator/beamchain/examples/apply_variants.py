"""Apply the variants of `beamchain sweep` to one compiled model, as domain randomisation does;
run beside them."""

import mujoco
import numpy as np

model = mujoco.MjModel.from_xml_path("scene.xml")
data = mujoco.MjData(model)
variants = np.load("variants.npz")
for i in range(len(variants["sample"])):
    for field in variants["fields"]:
        getattr(model, field)[:] = variants[str(field)][i]
    mujoco.mj_setConst(model, data)  # masses of subtrees and inverse weights follow
    mujoco.mj_resetData(model, data)
    mujoco.mj_step(model, data)
