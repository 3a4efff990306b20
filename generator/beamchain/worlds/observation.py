"""What is observed of every world, by name: attitude, mean rate, wheel speeds,
modal amplitudes, sensors."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.checks import list_of_names
from beamchain.errors import InputError
from beamchain.toolkit import Array, base, modal_tendons, mujoco, wraps

FREE, BALL, HINGE = 0, 1, 3  # mjtJoint
# how far behind a joint's position and velocity the rotation stands
QUATERNION = {FREE: (3, 3), BALL: (0, 0)}
JOINT = 0  # mjTRN_JOINT
CYCLE: NDArray[np.intp] = np.array([1, 2, 0])
BACK: NDArray[np.intp] = np.array([2, 0, 1])
LEAST = 1e-10  # size of a quaternion that MuJoCo normalises


class Observer:
    """Reads named arrays `(k, ...)` from the positions, rates and sensors of k worlds;
    `names` None: all there is."""

    def __init__(self, model: "mujoco.MjModel", names: Sequence[str] | None) -> None:
        modal = modal_tendons(model)
        body = base(model) if model.nv else 0
        turns = np.isin(model.jnt_type, list(QUATERNION)) & (model.jnt_bodyid == body)
        self._turn = None
        for j in np.flatnonzero(turns)[:1]:
            place, rate = QUATERNION[int(model.jnt_type[j])]
            self._turn = int(model.jnt_qposadr[j]) + place, int(model.jnt_dofadr[j]) + rate
        bent = np.any(modal.rows != 0.0, axis=0)
        self.wheels: list[int] = [i for i in range(model.nu) if _wheel(model, i, bent)]
        self._spin = [int(model.jnt_dofadr[int(model.actuator_trnid[i, 0])]) for i in self.wheels]
        self._hinges = np.flatnonzero(bent)
        joints = model.dof_jntid[self._hinges]
        self._places = np.asarray(model.jnt_qposadr[joints], dtype=np.intp)
        self._rows = self._nominal = np.ascontiguousarray(modal.rows[:, self._hinges].T)
        column = {int(joint): i for i, joint in enumerate(joints)}
        self._wraps = [
            (w, column[int(model.wrap_objid[w])], n)
            for n, i in enumerate(modal.index)
            for w in wraps(model, int(i))
        ]
        self._rest = model.tendon_lengthspring[modal.index, 0]
        self._sensors = {
            str(model.sensor(i).name) or f"sensor {i}": slice(int(a), int(a + model.sensor_dim[i]))
            for i, a in enumerate(model.sensor_adr)
        }
        sources = {
            "attitude": self._turn,
            "rate": self._turn,
            "wheels": self.wheels,
            "modes": modal.names,
        }
        there = [*(name for name, source in sources.items() if source), *self._sensors]
        wanted: Sequence[str] = there
        if names is not None:
            wanted = [names] if isinstance(names, str) else list_of_names("observe", names)
        for name in wanted:
            if name not in there:
                raise InputError(
                    f"observe names {name!r}, which the model does not have; choose from "
                    f"{', '.join(there)}."
                )
        self.names: tuple[str, ...] = tuple(dict.fromkeys(wanted))
        self.mode_names: tuple[str, ...] = modal.names
        needed = [
            int(model.sensor_needstage[i])
            for i, name in enumerate(self._sensors)
            if name in self.names
        ]
        # of MuJoCo's computation, to which sensors have to be brought
        self.stage: int = max(needed, default=0)

    def follow(self, coefficients: Array) -> None:
        """Coefficients of tendons that differ between worlds,
        `(k, nwrap)` as in MuJoCo's `wrap_prm`."""
        rows = np.zeros((len(coefficients), *self._rows.shape[-2:]))
        for wrap, hinge, mode in self._wraps:
            rows[:, hinge, mode] = coefficients[:, wrap]
        self._rows = rows

    def check_places(self, qpos: Array) -> None:
        """Refuse positions `(k, nq)` whose quaternion of the base has no size."""
        if self._turn is not None and np.any(np.linalg.norm(self.attitude(qpos), axis=1) < LEAST):
            place, _ = self._turn
            raise InputError(
                f"qpos has zeros for the quaternion of the spacecraft (qpos[{place}:{place + 4}]), "
                "which is no attitude; 1, 0, 0, 0 is that of rest, and many.model.qpos0 the "
                "model's own positions."
            )

    def attitude(self, qpos: Array) -> Array:
        """`(k, 4)` quaternion of the base, scalar first; of none where nothing turns freely."""
        if self._turn is None:
            return np.zeros((len(qpos), 4))
        place, _ = self._turn
        return qpos[:, place : place + 4].copy()

    def spin(self, qvel: Array) -> Array:
        """`(k, 3)` rate of the base in its own axes at this moment [rad/s]."""
        if self._turn is None:
            return np.zeros((len(qvel), 3))
        _, rate = self._turn
        return qvel[:, rate : rate + 3].copy()

    def moved(self, qpos: Any, qvel: Any) -> dict[str, Any]:
        """What follows from positions `(t, nq)` and rates `(t, nv)` of one world alone,
        also for JAX to differentiate."""
        out: dict[str, Any] = {}
        if self._turn:
            place, rate = self._turn
            out |= {"attitude": qpos[:, place : place + 4], "rate": qvel[:, rate : rate + 3]}
        out["wheels"] = qvel[:, np.array(self._spin, dtype=np.intp)]
        out["modes"] = qpos[:, self._places] @ self._nominal - self._rest
        return out

    def read(
        self, qpos: Array, qvel: Array, sensors: Array, attitude: Array, rate: Array
    ) -> dict[str, Array]:
        """The named arrays; the caller keeps `attitude` `(k, 4)` now, and `rate` `(k, 3)`,
        the mean over the last step."""
        readers = {
            "attitude": attitude.copy,
            "rate": rate.copy,
            "wheels": lambda: qvel[:, self._spin],
            "modes": lambda: self._modes(qpos[:, self._places]),
        }
        return {
            name: readers[name]() if name in readers else sensors[:, self._sensors[name]].copy()
            for name in self.names
        }

    def _modes(self, bent: Array) -> Array:
        """Amplitudes of the modes of bent hinges,
        the rows of tendons alike in all worlds or not."""
        if self._rows.ndim == 2:
            return bent @ self._rows - self._rest
        return np.einsum("kj,kjn->kn", bent, self._rows) - self._rest


def _wheel(model: "mujoco.MjModel", actuator: int, bent: NDArray[np.bool_]) -> bool:
    """Whether an actuator turns a leaf body on a hinge without limits."""
    joint = int(model.actuator_trnid[actuator, 0])
    if (
        model.actuator_trntype[actuator] != JOINT
        or model.jnt_type[joint] != HINGE
        or model.jnt_limited[joint]
    ):
        return False
    leaf = not np.any(model.body_parentid == model.jnt_bodyid[joint])
    return leaf and not bent[int(model.jnt_dofadr[joint])]


def mean_rate(before: Array, after: Array, span: "Array | float") -> Array:
    """`(k, 3)` mean rate in body axes [rad/s] between two attitudes `(k, 4)`:
    what an integrating gyro has measured."""
    # the turn from (w, v) to (a, u) is conj(w, v) (a, u) = (w a + v.u, w u - a v - v x u),
    # of cosine and sine of half its angle
    w = before[:, :1]
    v = before[:, 1:]
    a = after[:, :1]
    u = after[:, 1:]
    # np.cross takes longer, at every step
    turn = w * u - a * v - (v[:, CYCLE] * u[:, BACK] - v[:, BACK] * u[:, CYCLE])
    whole = w * a + np.einsum("ki,ki->k", v, u)[:, None]
    sine = np.sqrt(np.einsum("ki,ki->k", turn, turn))[:, None]
    angle = 2.0 * np.arctan2(sine, np.abs(whole))
    scale = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 2.0)
    return np.asarray(turn * np.where(whole < 0.0, -scale, scale) / span)
