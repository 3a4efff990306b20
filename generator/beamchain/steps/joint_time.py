"""Timing of a craft's own sprung joints: drives, latches, compliant hinge lines between bodies.

A joint of stiffness k (its spring and a position servo on it) gets the armature

    k h^2/12 + h (d_e - d_i)/2

d_e its damping that the integrator takes at the start of the step, d_i that at its end: its own
step error is then of fourth order, as that of a tendon is. Where the step would be unstable so,
joints that turn by more than `sqrt(2)` per step get `k h^2/4` instead, which is stable whatever
they join. RK4 needs none for its error; where its step would be unstable, such joints get
`k h^2/8 + h d/2`. What was before stands in `solimpfriction`, which MuJoCo reads for joints with
friction only; a last number of 1 marks what latched hinges get more. What is damped at the end of
the step leaves `zeta x^2/6`.

Theory: docs/theory.md, section 9.
"""

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.engine.linear import linear_at
from beamchain.engine.linearise import INTEGRATORS, mass_matrix
from beamchain.engine.operating_point import poses, quiet_copy, rest_point
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES, stable_armature
from beamchain.steps.latch import ARMATURE, RAISED, is_latched, is_raised
from beamchain.steps.modal import HINGE_OR_SLIDE, TREE, UNMARKED, Modal, TimingMark, made_for

FAST = 2.0  # h^2 k (RK4: and h d) over the inertia that a joint feels, above which it is slowed
SLOWED = 3.0  # times k h^2/12


def sprung_joints(model: "mujoco.MjModel", modal: Modal) -> dict[int, float]:
    """Stiffness of the craft's own hinges and slides that have one [N m/rad, N/m], by degree of
    freedom; latched hinges have their own armature."""
    inner = np.any(modal.rows != 0.0, axis=0)
    stiffness = np.diag(linear_at(rest_point(quiet_copy(model))).stiffness)
    dofs = [
        int(model.jnt_dofadr[j])
        for j in range(model.njnt)
        if int(model.jnt_type[j]) in HINGE_OR_SLIDE and not is_latched(model, j)
    ]
    return {dof: float(stiffness[dof]) for dof in dofs if not inner[dof] and stiffness[dof] > 0.0}


def joint_armature(
    model: "mujoco.MjModel", modal: Modal, integrator: str, timestep: float, *, slowed: bool
) -> Array:
    """`(nv,)` armature that the craft's own sprung joints get; `slowed`: fast ones more."""
    out = np.zeros(model.nv)
    is_rk4 = integrator == "RK4"
    if not SCHEMES[integrator].exact and not (is_rk4 and slowed):
        return out
    still = quiet_copy(model)
    linear = linear_at(rest_point(still))
    lightness = np.max(
        [np.diag(np.linalg.inv(mass_matrix(still, qpos))) for qpos in poses(still).values()], axis=0
    )
    for dof, stiffness in sprung_joints(model, modal).items():
        spring = stiffness * timestep**2 / 12.0
        damping = float(linear.damping[dof, dof])
        fastest = max(stiffness * timestep**2, damping * timestep if is_rk4 else 0.0)
        is_fast = slowed and fastest * lightness[dof] > FAST
        if is_rk4:
            if is_fast:
                out[dof] = stable_armature(integrator, timestep, stiffness, damping)
            continue
        if is_fast:
            spring *= SLOWED
        at_end = damping
        if not SCHEMES[integrator].implicit_damping:
            at_end = min(float(model.dof_damping[dof]), damping)
        late = timestep * (damping - 2.0 * at_end) / 2.0
        out[dof] = max(spring + late, -float(model.dof_armature[dof]))
    return out


def write_joints(model: "mujoco.MjModel", added: Array, mark: TimingMark) -> None:
    """Put armature `(nv,)` on joints, and what was before into their marks."""
    for dof in np.flatnonzero(added):
        if float(model.dof_frictionloss[dof]) > 0.0:
            joint = int(model.dof_jntid[dof])
            raise InputError(
                f"joint {model.joint(joint).name!r} has friction, so that its step error cannot be "
                "taken out; leave out its frictionloss, or the timing of joints."
            )
        number = float(INTEGRATORS[mark.integrator])
        before = float(model.dof_armature[dof])
        raised = RAISED * is_latched(model, int(model.dof_jntid[dof]))
        model.dof_solimp[dof] = (mark.timestep, number, TREE, before, raised)
        model.dof_armature[dof] += added[dof]


def timed_joints(model: "mujoco.MjModel") -> list[int]:
    """Degrees of freedom of joints that have timing."""
    return [d for d in range(model.nv) if made_for(model.dof_solimp[d]) is not None]


def take_out_joints(model: "mujoco.MjModel") -> None:
    """The joints as they were before they got timing."""
    for dof in timed_joints(model):
        joint = int(model.dof_jntid[dof])
        if is_latched(model, joint) and not is_raised(model, dof):
            # since then: what it gets back when it is unlatched
            model.jnt_solimp[joint, ARMATURE] = model.dof_solimp[dof, 3]
        else:
            model.dof_armature[dof] = model.dof_solimp[dof, 3]
        model.dof_solimp[dof] = UNMARKED
