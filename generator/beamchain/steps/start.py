"""The initial rates and the input that go with models exact in time.

Theory: docs/theory.md, section 5.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from beamchain.checks import finite_array, of_type
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import NUMBERS, mass_matrix
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES, apparent_pole, start_rate, step_pole
from beamchain.steps.modal import FREE_BALL, condensed_mass, foreign, modal_tendons


@one_thread()
def start_velocity(model: "mujoco.MjModel", qpos: Array, qvel: Array) -> Array:
    """`(nv,)` values for `data.qvel` of a craft that is at `qpos` with the true
    rates `qvel` at t = 0.

    MuJoCo's semi-implicit step leaves in `qvel` the mean rate over the step just taken, so the
    modes are followed back by one undriven step. Under RK4, and where the model was not made exact
    in time, `qvel` is returned as it is.

    Args:
        model: compiled and retimed; its own step and integrator.
        qpos: `(nq,)`.
        qvel: `(nv,)`.

    Raises:
        InputError: the model has no modal tendons.

    Example:
        >>> import beamchain as bc, mujoco
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> model = bc.embed(craft, {"mount": spec}, retime=True).model
        >>> data = mujoco.MjData(model)
        >>> data.qvel[5] = 0.1
        >>> bc.start_velocity(model, data.qpos, data.qvel).shape
        (10,)
    """
    of_type("model", model, mujoco.MjModel, "a compiled mujoco.MjModel")
    modal = modal_tendons(model)
    if not modal.names:
        raise foreign("a start in motion that is exact in time")
    name = NUMBERS[int(model.opt.integrator)]
    h = float(model.opt.timestep)
    qpos = finite_array("qpos", qpos, (model.nq,))
    out = finite_array("qvel", qvel, (model.nv,))
    if not SCHEMES[name].exact or all(mark is None for mark in modal.made_for):
        return out
    c, follow = condensed_mass(mass_matrix(model, qpos), modal.rows)
    inverse, shapes = eigh(c, np.diag(modal.stiffness))
    square = 1.0 / inverse
    y = shapes * np.sqrt(square)  # modes of the step itself, y^T C y = 1
    drag = np.einsum("ki,k,ki->i", y, np.asarray(model.tendon_damping[modal.index]), y)
    w, zeta = apparent_pole(step_pole(name, 1.0, drag, square, h), h)
    places = np.zeros(model.nv)
    plain = model.jnt_type > FREE_BALL
    places[model.jnt_dofadr[plain]] = qpos[model.jnt_qposadr[plain]]
    lengths = modal.rows @ places - model.tendon_lengthspring[modal.index, 0]
    position = (y.T @ (modal.stiffness * lengths)) / square
    rate = (y.T @ (modal.stiffness * (modal.rows @ out))) / square
    mean = start_rate(position, rate, w, np.minimum(zeta, 1.0), h)
    return out + follow @ (y @ (mean - rate))


def ctrl_bounds(model: "mujoco.MjModel", ranges: Array | None = None) -> tuple[Array, Array]:
    """Least and largest `ctrl` `(..., nu)` that MuJoCo does not cut, infinite without a range.

    `ranges`: `(..., nu, 2)` in place of the model's `actuator_ctrlrange`.
    """
    ranges = np.asarray(model.actuator_ctrlrange if ranges is None else ranges)
    cut = np.asarray(model.actuator_ctrllimited, dtype=np.bool_)
    if int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL):
        cut = np.zeros_like(cut)
    return np.where(cut, ranges[..., 0], -np.inf), np.where(cut, ranges[..., 1], np.inf)


class HeldInput:
    """Mean of the current and the previous input, `ctrl = (u_k + u_(k-1))/2`.

    Fed with this mean, every sampled position of a model made exact in time is the exact one for an
    input held over each step, of undamped modes; with a damping ratio zeta and x radians per step
    it is off by about zeta x^2/6. One object per model and per simulated world; `(worlds, nu)`
    arrays work as well.

    Args:
        before: input held before t = 0; zero where left out.
        model: compiled; inputs are then its `ctrl` `(..., nu)`, and what lies beyond `ctrlrange` is
            cut before the mean is formed. MuJoCo alone would cut the mean, which is late by a
            step's share of what lies beyond.

    Raises:
        InputError: `before` is not finite, or `model` is no compiled model.

    Example:
        >>> import beamchain as bc
        >>> held = bc.HeldInput()
        >>> [float(held(value)) for value in (2.0, 2.0, 0.0, 0.0)]
        [1.0, 2.0, 1.0, 0.0]
    """

    def __init__(
        self, before: ArrayLike | None = None, *, model: "mujoco.MjModel | None" = None
    ) -> None:
        self._bounds: tuple[Array, Array] | None = None
        if model is not None:
            of_type("model", model, mujoco.MjModel, "a compiled mujoco.MjModel")
            self._bounds = ctrl_bounds(model)
        self._first = None if before is None else self._cut("before", before)
        self._previous = self._first

    def __call__(self, now: ArrayLike) -> Array:
        """Values for `data.ctrl` (or `qfrc_applied`) in the step over which `now`,
        of any shape, is held.

        Raises:
            InputError: a number is not finite, or the shape differs from that of the input before.
        """
        value = self._cut("now", now)
        before = np.zeros_like(value) if self._previous is None else self._previous
        if before.shape not in ((), value.shape) and value.shape:
            raise InputError(
                f"now has the shape {value.shape}, the input before it {before.shape}; "
                "take one HeldInput per model, and reset() it where the input changes its shape."
            )
        self._previous = value
        return (value + before) / 2.0

    def reset(self) -> None:
        """Back to the input before t = 0."""
        self._previous = self._first

    def _cut(self, name: str, given: ArrayLike) -> Array:
        """Finite numbers, within the range of the model's actuators."""
        value = finite_array(name, given)
        if self._bounds is None:
            return value
        size = self._bounds[0].size
        if value.ndim and value.shape[-1] != size:
            raise InputError(
                f"{name} has the shape {value.shape}, and the model {size} actuators; give one "
                f"number for each, (..., {size})."
            )
        return np.clip(value, *self._bounds)
