"""The two-link arm as embedded hinge chains in MuJoCo, Euler exact in time and RK4."""

import re
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
from arm_task import ANGLE, BEAT, END, EXAMPLES, TORQUE, ArmPeer

import beamchain as bc

INTEGRATORS = {"Euler": mujoco.mjtIntegrator.mjINT_EULER, "RK4": mujoco.mjtIntegrator.mjINT_RK4}


def embedded(modes: str) -> mujoco.MjModel:
    """The shipped arm with these modes of both links, nothing damped, not timed."""
    with tempfile.TemporaryDirectory() as folder:
        craft = Path(folder) / "arm.xml"
        text = (EXAMPLES / "arm.xml").read_text().replace('damping="1"', 'damping="0"')
        craft.write_text(text)
        places = {}
        for place, name in (("shoulder", "upper"), ("forearm", "fore")):
            spec = (EXAMPLES / f"{name}.toml").read_text().replace("0.005", "0.0")
            spec = re.sub(r"\[modes\][^[]*", f"[modes]\n{modes}\n", spec)
            # the modes above are what is compared: none is added for a tolerance
            spec = spec[: spec.index("[scene]")]
            places[place] = Path(folder) / f"{name}.toml"
            places[place].write_text(spec)
        return bc.embed(craft, places, retime=False).model


class Chains:
    """Runs the arm from rest at the elbow's angle; only the steps are timed."""

    def __init__(self, model: mujoco.MjModel, integrator: str):
        self.model, self.integrator = model, integrator
        model.opt.integrator = INTEGRATORS[integrator]
        self.start = model.qpos0.copy()
        self.start[model.joint("elbow").qposadr[0]] = ANGLE

    def __call__(self, h: float, record: bool):
        model = self.model
        steps, beat = round(END / h), round(BEAT / h)
        torque = np.zeros(steps)
        torque[:beat], torque[beat : 2 * beat] = TORQUE, -TORQUE
        model.opt.timestep = h
        bc.retime(model, h, self.integrator, pose=self.start)
        if self.integrator == "Euler":  # the mean with the value before, as `bc.HeldInput` gives it
            torque = (torque + np.concatenate([[0.0], torque[:-1]])) / 2.0
        if not record:
            return None, self._timed(torque)
        return (self._attitude(torque) - self._attitude(-torque)) / 2.0, self._timed(torque)

    def _data(self) -> mujoco.MjData:
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.start
        mujoco.mj_forward(self.model, data)
        return data

    def _timed(self, torque: np.ndarray) -> float:
        data = self._data()
        edges = [0, *(np.flatnonzero(np.diff(torque)) + 1).tolist(), len(torque)]
        begin = time.thread_time()
        for first, end in pairwise(edges):
            data.qfrc_applied[5] = torque[first]
            mujoco.mj_step(self.model, data, nstep=end - first)
        return time.thread_time() - begin

    def _attitude(self, torque: np.ndarray) -> np.ndarray:
        data = self._data()
        out = np.empty(len(torque))
        for k, value in enumerate(torque):
            data.qfrc_applied[5] = value
            mujoco.mj_step(self.model, data)
            out[k] = 2.0 * np.arctan2(data.qpos[6], data.qpos[3])
        return out


def chains(name: str, n: int, modes: str, integrator: str) -> ArmPeer:
    model = embedded(modes)
    return ArmPeer(name, n, integrator, Chains(model, integrator), f"{model.nv} coordinates")
