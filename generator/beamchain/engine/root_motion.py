"""Motion and loads of roots of appendages along a run, as MuJoCo has them."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.library import mujoco, quiet
from beamchain.engine.linearise import NUMBERS, euler_damps_implicitly
from beamchain.engine.model_rows import along_all, gravity_of
from beamchain.ports.motions import Array

#: what makes up a state of a run: all that the next step and the accelerations follow from
STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
TIME = int(mujoco.mjtState.mjSTATE_TIME)


class Root(NamedTuple):
    """Where an appendage is looked at in a compiled model.

    Args:
        body: its first link, whose frame is that of the root.
        carried: per body that one of its ports carries, that body and the port's site.
    """

    body: int
    carried: tuple[tuple[int, int], ...]


class RootMotion(NamedTuple):
    """Motion and loads of a root at t instants, all in its axes.

    Args:
        acceleration: `(t, 6)` of the root, linear [m/s^2] and angular [rad/s^2].
        gravity: `(t, 3)` [m/s^2].
        spin: `(t, 3)` rate of the root [rad/s].
        load: `(t, 6)` force [N] and moment [N m] that the appendage puts on what carries it.
        carried: `(t, c, 6)` those that bodies put on its ports.
    """

    acceleration: Array
    gravity: Array
    spin: Array
    load: Array
    carried: Array


@dataclass(frozen=True, eq=False)
class Run:
    """Instants of a run of a model.

    Args:
        time: `(t,)` [s].
        states: `(t, size)` complete states; None where there are arrays only.
        arrays: by name of a field of MjData, `(t, ...)` each; with "qacc" accelerations as given.
    """

    time: Array
    states: Array | None
    arrays: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Motion:
    """Coordinates of a run `(t, nq)`, `(t, nv)`, `(t, nv)`, and the motion of roots."""

    qpos: Array
    qvel: Array
    qacc: Array
    roots: tuple[RootMotion, ...]


class _Step:
    """Accelerations `(v+ - v)/h` of a step of a model's own integrator.

    What it takes at the end of the step, dampers of joints and the kv of servos, is in the rates
    of a run as `(M + h D) a = f`; the equations of motion, `M a = f`, then miss the acceleration
    of a light joint with a strong servo by the factor `1 + h D/M`.

    Args:
        model: its step and integrator are those of the run.
        explicit: tendons whose damping is not taken so: that of modes which are exact in time.
    """

    def __init__(self, model: "mujoco.MjModel", explicit: Sequence[int]) -> None:
        self._model = copy.copy(model)
        self._data = mujoco.MjData(model)
        self._state = np.empty(mujoco.mj_stateSize(model, STATE))
        self._rows = along_all(model)[list(explicit)]
        self._damping = np.array(model.tendon_damping)[list(explicit)]
        self._model.tendon_damping[list(explicit)] = 0.0

    def acceleration(self, data: "mujoco.MjData") -> Array:
        """`(nv,)` in a state; that of the equations of motion where the step blows up."""
        ours = self._data
        mujoco.mj_getState(self._model, data, self._state, STATE)
        mujoco.mj_setState(self._model, ours, self._state, STATE)
        rates = np.array(data.qvel)
        ours.qfrc_applied[:] -= self._rows.T @ (self._damping * (self._rows @ rates))
        before = int(np.sum(ours.warning.number))
        with quiet():
            mujoco.mj_step(self._model, ours)
        if int(np.sum(ours.warning.number)) > before:
            return np.array(data.qacc)
        return (ours.qvel - rates) / float(self._model.opt.timestep)


def _takes_dampers_implicitly(model: "mujoco.MjModel") -> bool:
    """Whether a step differs from the equations of motion."""
    integrator = NUMBERS[int(model.opt.integrator)]
    if integrator == "Euler":
        return euler_damps_implicitly(model) and bool(np.any(model.dof_damping))
    return integrator != "RK4"


def motion_of(
    model: "mujoco.MjModel", run: Run, roots: Sequence[Root], explicit: Sequence[int] = ()
) -> Motion:
    """Motion and loads of roots along a run.

    Accelerations are those of a step of the model from each state, where they are not given;
    `explicit`: tendons whose damping acts as in the equations of motion, whatever the integrator.
    """
    data = mujoco.MjData(model)
    step = _Step(model, explicit) if _takes_dampers_implicitly(model) else None
    out = _Raw.of(model, run.time.size, roots)
    for t in range(run.time.size):
        if run.states is not None:
            mujoco.mj_setState(model, data, run.states[t], STATE)
        for name, values in run.arrays.items():
            getattr(data, name)[:] = values[t]
        mujoco.mj_setState(model, data, run.time[t : t + 1], TIME)
        if "qacc" in run.arrays:
            given = data.qacc.copy()
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            data.qacc[:] = given
        else:
            mujoco.mj_forward(model, data)
            if step is not None:
                data.qacc[:] = step.acceleration(data)
        mujoco.mj_rnePostConstraint(model, data)
        out.read(model, data, t)
    gravity = gravity_of(model)
    motions = tuple(out.motion(i, root, gravity) for i, root in enumerate(roots))
    return Motion(out.qpos, out.qvel, out.qacc, motions)


@dataclass(frozen=True, eq=False)
class _Raw:
    """What MuJoCo holds at t instants, as it holds it: of r roots, and of b bodies.

    `forces` `(t, b, 6)`: moment and force of the parent on each body, about `centres` `(t, b, 3)`;
    `sites` `(t, k, 3)`: places of all sites.
    """

    roots: tuple[Root, ...]
    trees: NDArray[np.intp]  # root body of the tree of each body
    qpos: Array
    qvel: Array
    qacc: Array
    places: Array
    axes: Array
    accelerations: Array
    velocities: Array
    forces: Array
    centres: Array
    sites: Array

    @staticmethod
    def of(model: "mujoco.MjModel", count: int, roots: Sequence[Root]) -> "_Raw":
        """Room for `count` instants."""
        r = len(roots)
        return _Raw(
            tuple(roots),
            np.array(model.body_rootid, dtype=np.intp),
            np.empty((count, model.nq)),
            np.empty((count, model.nv)),
            np.empty((count, model.nv)),
            np.empty((count, r, 3)),
            np.empty((count, r, 3, 3)),
            np.empty((count, r, 6)),
            np.empty((count, r, 6)),
            np.empty((count, model.nbody, 6)),
            np.empty((count, model.nbody, 3)),
            np.empty((count, model.nsite, 3)),
        )

    def read(self, model: "mujoco.MjModel", data: "mujoco.MjData", t: int) -> None:
        """One instant."""
        kind = mujoco.mjtObj.mjOBJ_XBODY
        self.qpos[t], self.qvel[t], self.qacc[t] = data.qpos, data.qvel, data.qacc
        self.forces[t] = data.cfrc_int
        self.centres[t] = data.subtree_com
        self.sites[t] = data.site_xpos
        for i, root in enumerate(self.roots):
            self.places[t, i] = data.xpos[root.body]
            self.axes[t, i] = data.xmat[root.body].reshape(3, 3)
            accelerations, velocities = self.accelerations[t, i], self.velocities[t, i]
            mujoco.mj_objectAcceleration(model, data, kind, root.body, accelerations, 1)
            mujoco.mj_objectVelocity(model, data, kind, root.body, velocities, 1)

    def motion(self, i: int, root: Root, gravity: Array) -> RootMotion:
        """Motion and loads of a root, under a gravity `(3,)`."""
        weight = gravity @ self.axes[:, i]
        rotation, linear = np.split(self.accelerations[:, i], 2, axis=1)
        carried = [
            self._load_on_parent(i, body, self.sites[:, site]) for body, site in root.carried
        ]
        none = np.zeros((len(self.qpos), 0, 6))
        return RootMotion(
            # MuJoCo's acceleration is against free fall
            acceleration=np.hstack([linear + weight, rotation]),
            gravity=weight,
            spin=self.velocities[:, i, :3],
            load=self._load_on_parent(i, root.body, self.places[:, i]),
            carried=np.stack(carried, axis=1) if carried else none,
        )

    def _load_on_parent(self, i: int, body: int, point: Array) -> Array:
        """`(t, 6)` force and moment about points `(t, 3)`, in the axes of root i, that a body, with
        all that it carries, puts on what carries it."""
        moment, force = np.split(-self.forces[:, body], 2, axis=1)
        moment = moment + np.cross(self.centres[:, self.trees[body]] - point, force)
        axes = self.axes[:, i]
        turned = [np.einsum("ti,tij->tj", vector, axes) for vector in (force, moment)]
        return np.hstack(turned)
