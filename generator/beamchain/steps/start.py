"""Starting a model that is exact in time from a given state: `qvel` holds the mean rate of the step before.

Theory: docs/theory.md, section 5.
"""

import numpy as np
from scipy.linalg import eigh

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS, mass_matrix
from beamchain.ports.motions import Array
from beamchain.steps import discrete
from beamchain.steps.modal import condensed, foreign, modal_tendons


def start_velocity(model: "mujoco.MjModel", qpos: Array, qvel: Array) -> Array:
    """`(nv,)` values for `data.qvel` of a craft that is at `qpos` with the true rates `qvel` at t = 0.

    MuJoCo's semi-implicit step leaves in `qvel` the mean rate over the step just taken. Told the true rate instead, a mode
    that starts in motion is out by half a step. The appendages' modes are followed back by one undriven step; rigid
    motion keeps its rate. Under RK4, and where the model was not made exact in time, `qvel` is returned as it is.

    Args:
        model: compiled and retimed; its own step and integrator.
        qpos: `(nq,)`.
        qvel: `(nv,)`.

    Raises:
        InputError: the model has no modal tendons.

    Example:
        >>> import beamchain as bc, mujoco
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> model = bc.embed(craft, {"mount": spec}, retime=True).model
        >>> data = mujoco.MjData(model)
        >>> data.qvel[5] = 0.1
        >>> bc.start_velocity(model, data.qpos, data.qvel).shape
        (10,)
    """
    modal = modal_tendons(model)
    if not modal.names:
        raise foreign("a start in motion that is exact in time")
    name, h = NUMBERS[int(model.opt.integrator)], float(model.opt.timestep)
    out = np.array(qvel, dtype=np.float64)
    if not discrete.SCHEMES[name].exact or all(mark is None for mark in modal.made_for):
        return out
    c, follow = condensed(mass_matrix(model, np.asarray(qpos, dtype=np.float64)), modal.rows)
    inverse, shapes = eigh(c, np.diag(modal.stiffness))
    square = 1.0 / inverse
    y = shapes * np.sqrt(square)  # modes of the step itself, y^T C y = 1
    drag = np.einsum("ki,k,ki->i", y, np.asarray(model.tendon_damping[modal.index]), y)
    w, zeta = discrete.seen(discrete.step_pole(name, 1.0, drag, square, h), h)
    lengths = np.array(
        [
            row @ _by_dof(model, qpos) - model.tendon_lengthspring[i, 0]
            for row, i in zip(modal.rows, modal.index, strict=True)
        ]
    )
    position = (y.T @ (modal.stiffness * lengths)) / square
    rate = (y.T @ (modal.stiffness * (modal.rows @ out))) / square
    mean = discrete.start_rate(position, rate, w, np.minimum(zeta, 1.0), h)
    return out + follow @ (y @ (mean - rate))


def keyframe_velocities(model: "mujoco.MjModel") -> Array:
    """`(nkey, nv)` what the keyframes' `qvel` must be for the motion that they give as true rates.

    To be written once, with the retimed model; asking twice of a model whose keyframes were changed converts them twice.

    Args:
        model: compiled and retimed.
    """
    return np.array([start_velocity(model, model.key_qpos[i], model.key_qvel[i]) for i in range(model.nkey)]).reshape(
        -1, model.nv
    )


def _by_dof(model: "mujoco.MjModel", qpos: Array) -> Array:
    """Positions of hinges and slides in the places of their degrees of freedom; others 0."""
    out = np.zeros(model.nv)
    for joint in range(model.njnt):
        if int(model.jnt_type[joint]) >= 2:
            out[int(model.jnt_dofadr[joint])] = qpos[int(model.jnt_qposadr[joint])]
    return out
