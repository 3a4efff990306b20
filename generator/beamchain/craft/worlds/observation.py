"""What is observed of every world, by name: attitude, mean rate, wheel speeds, modal amplitudes, sensors."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.craft.plants.signals import base
from beamchain.engine.forces import wraps
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps.modal import modal_tendons

FREE, BALL, HINGE = 0, 1, 3  # mjtJoint
QUATERNION = {
    FREE: (3, 3),
    BALL: (0, 0),
}  # of a joint: how far behind its position and its velocity the rotation stands
JOINT = 0  # mjTRN_JOINT


class Observer:
    """Reads named arrays `(k, ...)` from the positions, rates and sensors of k worlds.

    Args:
        model: compiled.
        names: of what to observe; None: all there is.
    """

    wheels: list[int]
    names: tuple[str, ...]
    stage: int

    def __init__(self, model: "mujoco.MjModel", names: Sequence[str] | None) -> None:
        modal = modal_tendons(model)
        body = base(model) if model.nv else 0
        turning = [
            i for i in range(model.njnt) if int(model.jnt_bodyid[i]) == body and int(model.jnt_type[i]) in QUATERNION
        ]
        self._turn = None
        if turning:
            place, rate = QUATERNION[int(model.jnt_type[turning[0]])]
            self._turn = int(model.jnt_qposadr[turning[0]]) + place, int(model.jnt_dofadr[turning[0]]) + rate
        bent = np.any(modal.rows != 0.0, axis=0)
        #: actuators that turn a wheel: a leaf body on a hinge without limits
        self.wheels = [i for i in range(model.nu) if _wheel(model, i, bent)]
        self._spin = [int(model.jnt_dofadr[int(model.actuator_trnid[i, 0])]) for i in self.wheels]
        self._hinges = np.flatnonzero(bent)
        joints = [int(model.dof_jntid[d]) for d in self._hinges]
        self._places = np.array([int(model.jnt_qposadr[j]) for j in joints], dtype=np.intp)
        self._rows = self._nominal = np.ascontiguousarray(modal.rows[:, self._hinges].T)
        column = {joint: i for i, joint in enumerate(joints)}
        self._wraps = [
            (w, column[int(model.wrap_objid[w])], n) for n, i in enumerate(modal.index) for w in wraps(model, int(i))
        ]
        self._rest = np.asarray(model.tendon_lengthspring)[modal.index, 0] if len(modal.names) else np.zeros(0)
        self._sensors = {
            str(model.sensor(i).name) or f"sensor {i}": slice(int(a), int(a + model.sensor_dim[i]))
            for i, a in enumerate(model.sensor_adr)
        }
        there = [
            *(["attitude", "rate"] if self._turn else []), *(["wheels"] if self.wheels else []),
            *(["modes"] if modal.names else []), *self._sensors,
        ]  # fmt: skip
        wanted = there if names is None else [names] if isinstance(names, str) else list(names)
        for name in wanted:
            if name not in there:
                raise InputError(
                    f"observe names {name!r}, which the model does not have; choose from {', '.join(there)}."
                )
        self.names = tuple(dict.fromkeys(wanted))
        needed = [int(model.sensor_needstage[i]) for i, name in enumerate(self._sensors) if name in self.names]
        self.stage = max(needed, default=0)  # of MuJoCo's computation, to which sensors have to be brought

    def follow(self, coefficients: Array) -> None:
        """Coefficients of tendons that differ between worlds, `(k, nwrap)` as in MuJoCo's `wrap_prm`."""
        rows = np.zeros((len(coefficients), *self._rows.shape[-2:]))
        for wrap, hinge, mode in self._wraps:
            rows[:, hinge, mode] = coefficients[:, wrap]
        self._rows = rows

    def attitude(self, qpos: Array) -> Array:
        """`(k, 4)` quaternion of the base, scalar first; of none where nothing turns freely."""
        return qpos[:, self._turn[0] : self._turn[0] + 4].copy() if self._turn else np.zeros((len(qpos), 4))

    def spin(self, qvel: Array) -> Array:
        """`(k, 3)` rate of the base in its own axes at this moment [rad/s]."""
        return qvel[:, self._turn[1] : self._turn[1] + 3].copy() if self._turn else np.zeros((len(qvel), 3))

    def moved(self, qpos: Any, qvel: Any) -> dict[str, Any]:
        """What follows from positions `(t, nq)` and rates `(t, nv)` of one world alone, also for JAX to differentiate."""
        out: dict[str, Any] = {}
        if self._turn:
            place, rate = self._turn
            out |= {"attitude": qpos[:, place : place + 4], "rate": qvel[:, rate : rate + 3]}
        out["wheels"] = qvel[:, np.array(self._spin, dtype=np.intp)]
        out["modes"] = qpos[:, self._places] @ self._nominal - self._rest
        return out

    def read(self, qpos: Array, qvel: Array, sensors: Array, attitude: Array, rate: Array) -> dict[str, Array]:
        """The named arrays.

        Args:
            qpos, qvel, sensors: of all worlds.
            attitude, rate: as the caller keeps them: `(k, 4)` now, `(k, 3)` mean over the last step.
        """
        out: dict[str, Array] = {}
        for name in self.names:
            if name == "attitude":
                out[name] = attitude.copy()
            elif name == "rate":
                out[name] = rate.copy()
            elif name == "wheels":
                out[name] = qvel[:, self._spin]
            elif name == "modes":
                bent = qpos[:, self._places]
                one = self._rows.ndim == 2
                out[name] = (bent @ self._rows if one else np.einsum("kj,kjn->kn", bent, self._rows)) - self._rest
            else:
                out[name] = sensors[:, self._sensors[name]].copy()
        return out


def _wheel(model: "mujoco.MjModel", actuator: int, bent: NDArray[np.bool_]) -> bool:
    joint = int(model.actuator_trnid[actuator, 0])
    if (
        int(model.actuator_trntype[actuator]) != JOINT
        or int(model.jnt_type[joint]) != HINGE
        or model.jnt_limited[joint]
    ):
        return False
    leaf = not np.any(np.asarray(model.body_parentid) == int(model.jnt_bodyid[joint]))
    return leaf and not bent[int(model.jnt_dofadr[joint])]


def mean_rate(before: Array, after: Array, span: "Array | float") -> Array:
    """`(k, 3)` mean rate in body axes [rad/s] between two attitudes `(k, 4)`: what an integrating gyro has measured."""
    w, v, a, u = before[:, :1], before[:, 1:], after[:, :1], after[:, 1:]
    turn = w * u - a * v - (v[:, CYCLE] * u[:, BACK] - v[:, BACK] * u[:, CYCLE])
    whole = w * a + np.einsum("ki,ki->k", v, u)[:, None]
    sine = np.sqrt(np.einsum("ki,ki->k", turn, turn))[:, None]
    angle = 2.0 * np.arctan2(sine, np.abs(whole))
    scale = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 2.0)
    return np.asarray(turn * np.where(whole < 0.0, -scale, scale) / span)


CYCLE: NDArray[np.intp] = np.array([1, 2, 0])
BACK: NDArray[np.intp] = np.array([2, 0, 1])
