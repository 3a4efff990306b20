"""Latching of deployment hinges in a running simulation: at the instant at which the hinge reaches
its angle, with the energy that is dropped.

Theory: docs/theory.md, section 9.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.optimize import brentq

from beamchain.caution import Caution
from beamchain.checks import not_negative, number, of_type, positive, true_or_false, unknown
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import mass_matrix
from beamchain.ports.motions import Array
from beamchain.steps.modal import modal_tendons

SHORTEST = 1e-12  # of a step: what is shorter is none
FIELDS = (
    "jnt_stiffness",
    "jnt_limited",
    "qpos_spring",
    "dof_damping",
    "dof_armature",
    "jnt_margin",
)


@dataclass(frozen=True, eq=False)
class Latched:
    """What `latch` did.

    Args:
        joint: its name.
        time: of the simulation at the instant [s].
        angle: at which the hinge is held [rad].
        energy: dropped with the drive spring, and by the impact [J].
        impact: part of it that the impact took [J].
        warnings: where the loss is no property of the structure.
        before: fields of the model as they were, for `unlatch`.

    Example:
        >>> import beamchain as bc, mujoco
        >>> panel = '''<mujoco><option timestep="0.01" gravity="0 0 0" integrator="RK4"/><worldbody>
        ... <body><freejoint/><inertial pos="0 0 0" mass="50" diaginertia="9 9 9"/>
        ... <body><joint name="hinge" axis="0 0 1" stiffness="2" springref="100"/>
        ... <inertial pos="1 0 0" mass="2" diaginertia=".1 .2 .2"/></body></body></worldbody>
        ... </mujoco>'''
        >>> model = mujoco.MjModel.from_xml_string(panel)
        >>> data = mujoco.MjData(model)
        >>> while (done := bc.latch(model, data, "hinge", 1.5, stiffness=500.0)) is None:
        ...     mujoco.mj_step(model, data)
        >>> f"{data.qpos[7]:.12f}", round(done.energy, 6)
        ('1.500000000000', 0.060186)
    """

    joint: str
    time: float
    angle: float
    energy: float
    impact: float
    warnings: tuple[str, ...]
    before: Mapping[str, Array]


@one_thread()
def latch(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    joint: str,
    angle: float,
    *,
    stiffness: float,
    damping: float = 0.0,
    armature: float | None = None,
    impact: bool = False,
) -> Latched | None:
    """Hold a deployment hinge from the instant at which it reaches an angle.

    If the next step of the simulation does not reach it, nothing is done. Otherwise a shortened
    step is made, which ends there, and the hinge's drive spring and limits give way to a spring
    that is slack at the angle. Integrate the deployment with RK4: a step of Euler loses momentum
    while bodies unfold.

    Args:
        model, data: both change.
        joint: name of a hinge.
        angle: at which it latches [rad].
        stiffness: of the latched hinge [N m/rad].
        damping: [N m s/rad].
        armature: of the latched hinge [kg m^2]; default: as it is.
        impact: stop the hinge at once, `v+ = v - M^-1 e (e^T M^-1 e)^-1 v_j`, which conserves
            momentum. The loss is a property of the structure only where its neighbours are rigid.

    Returns:
        What was done, or None where the next step does not reach the angle.

    Raises:
        InputError: no such hinge, or a number that is not allowed.

    Example:
        >>> import beamchain as bc, mujoco
        >>> hinge = '''<mujoco><worldbody><body><joint name="hinge" axis="0 0 1"/>
        ... <inertial pos="1 0 0" mass="2" diaginertia=".1 .2 .2"/></body></worldbody></mujoco>'''
        >>> model = mujoco.MjModel.from_xml_string(hinge)
        >>> bc.latch(model, mujoco.MjData(model), "hinge", 0.5, stiffness=500.0) is None
        True
    """
    of_type("model", model, mujoco.MjModel, "a compiled mujoco.MjModel")
    of_type("data", data, mujoco.MjData, "the mujoco.MjData of the model")
    place = _hinge(model, joint)
    target = number("angle", angle, "rad")
    spring = positive("stiffness", stiffness, "N m/rad")
    damper = not_negative("damping", damping, "N m s/rad")
    inertia = None if armature is None else not_negative("armature", armature, "kg m^2")
    is_impact = true_or_false("impact", impact)
    position = int(model.jnt_qposadr[place])
    dof = int(model.jnt_dofadr[place])
    if not _step_to(model, data, position, target):
        return None
    before = {name: np.array(getattr(model, name), dtype=np.float64) for name in FIELDS}
    stretch = float(data.qpos[position] - model.qpos_spring[position])
    energy = 0.5 * float(np.ravel(model.jnt_stiffness[place])[0]) * stretch**2
    lost = 0.0
    warnings: list[str] = []
    if is_impact:
        lost = _stop(model, data, dof)
        if _has_flexible_neighbour(model, place):
            text = (
                f"joint {joint!r} was stopped at once beside a flexible body: the {lost:.3g} J "
                "that this took depend on how many modes are kept; latch it with stiffness and "
                "damping alone."
            )
            warnings.append(Caution("impact-on-flexible", text))
    model.jnt_stiffness[place] = spring
    model.qpos_spring[position] = target
    model.jnt_limited[place] = 0
    model.dof_damping[dof] = damper
    if inertia is not None:
        model.dof_armature[dof] = inertia
    mujoco.mj_forward(model, data)
    return Latched(
        joint,
        float(data.time),
        target,
        energy + lost,
        lost,
        tuple(warnings),
        MappingProxyType(before),
    )


def unlatch(model: "mujoco.MjModel", latched: Latched) -> None:
    """Give a hinge back what it had before `latch`: its drive spring, damping and limits.

    Other hinges that were latched since then stay so.

    Args:
        model: it changes.
        latched: what `latch` returned.

    Raises:
        InputError: the model has no such hinge.

    Example:
        >>> import beamchain as bc, mujoco
        >>> hinge = '''<mujoco><worldbody><body><joint name="hinge" axis="0 0 1" damping="0.1"/>
        ... <inertial pos="1 0 0" mass="2" diaginertia=".1 .2 .2"/></body></worldbody></mujoco>'''
        >>> model = mujoco.MjModel.from_xml_string(hinge)
        >>> data = mujoco.MjData(model)
        >>> data.qvel[0] = 1.0
        >>> done = bc.latch(model, data, "hinge", 0.001, stiffness=500.0)
        >>> float(model.jnt_stiffness[0])
        500.0
        >>> bc.unlatch(model, done)
        >>> float(model.jnt_stiffness[0]), float(model.dof_damping[0])
        (0.0, 0.1)
    """
    of_type("model", model, mujoco.MjModel, "a compiled mujoco.MjModel")
    of_type("latched", latched, Latched, "what bc.latch returned")
    place = _hinge(model, latched.joint)
    for name, values in latched.before.items():
        if name.startswith("jnt_"):
            own = place
        elif name.startswith("dof_"):
            own = int(model.jnt_dofadr[place])
        else:
            own = int(model.jnt_qposadr[place])
        getattr(model, name)[own] = values[own]


def _hinge(model: "mujoco.MjModel", name: str) -> int:
    hinges = {model.joint(j).name: j for j in range(model.njnt) if int(model.jnt_type[j]) == 3}
    if name not in hinges:
        raise unknown("hinge", name, [found for found in hinges if found])
    return hinges[name]


def _step_to(model: "mujoco.MjModel", data: "mujoco.MjData", position: int, target: float) -> bool:
    """Make a step that ends where a coordinate is at its target; False where a whole step does not
    reach it."""
    whole = float(model.opt.timestep)

    def at(step: float) -> float:
        trial = copy.copy(data)
        model.opt.timestep = step
        mujoco.mj_step(model, trial)
        return float(trial.qpos[position]) - target

    try:
        start = float(data.qpos[position]) - target
        if start == 0.0:
            return True
        if start * at(whole) > 0.0:
            return False
        step = float(brentq(at, SHORTEST * whole, whole, xtol=1e-15 * whole, rtol=1e-15))
        model.opt.timestep = step
        mujoco.mj_step(model, data)
    finally:
        model.opt.timestep = whole
    return True


def _stop(model: "mujoco.MjModel", data: "mujoco.MjData", dof: int) -> float:
    """Stop a hinge at once without a change of momentum; the kinetic energy lost [J]."""
    mass = mass_matrix(model, np.array(data.qpos))
    unit = np.zeros(model.nv)
    unit[dof] = 1.0
    spread = np.linalg.solve(mass, unit)
    rate = float(data.qvel[dof])
    data.qvel[:] -= spread * (rate / spread[dof])
    data.qvel[dof] = 0.0
    return 0.5 * rate**2 / float(spread[dof])


def _has_flexible_neighbour(model: "mujoco.MjModel", joint: int) -> bool:
    """Whether a body on either side of a hinge is a link of an appendage."""
    rows = modal_tendons(model).rows
    links = {int(model.dof_bodyid[i]) for i in np.flatnonzero(np.any(rows != 0.0, axis=0))}
    inside = links | {int(model.body_parentid[body]) for body in links}
    body = int(model.jnt_bodyid[joint])
    children = [i for i in range(model.nbody) if int(model.body_parentid[i]) == body]
    return bool({body, int(model.body_parentid[body]), *children} & inside)
