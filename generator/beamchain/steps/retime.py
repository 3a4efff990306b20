"""Making a compiled model exact in time for a step, in place:
armature and damping on its modal tendons.

* Form 2: every mode of the held appendage is exact; coefficients stay, and no hub is needed.
* Form 4: form 2 with armature and damping tuned until the craft's own poles are exact, or, in
  several poses, as near as they can be in all of them.
* Form 5: where appendages carry bodies; stable for every payload and pose, the response near
  that of exact motion at the poses of the craft (`steps/tree_time.py`).

Modes beyond the phase limit are slowed, so that any step is stable; on a light hub the limit is
lowered. The model's own step and integrator (`opt`) are the caller's.

Theory: docs/theory.md, section 5.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from beamchain.checks import not_negative, of_type, one_of, positive, true_or_false
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import INTEGRATORS, NUMBERS, mass_matrix
from beamchain.engine.operating_point import Pose, check_pose, poses, state_at
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps.forms import ModeTime, TendonValues, appendage_poles, form2, form4
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.joint_time import joint_armature, take_out_joints, write_joints
from beamchain.steps.latch import is_raised, latch_armature
from beamchain.steps.modal import (
    TREE,
    UNMARKED,
    Modal,
    TimingMark,
    condensed_mass,
    foreign,
    modal_tendons,
)
from beamchain.steps.step_map import TimeError, lowest_wrong, motion_for, time_error
from beamchain.steps.tree_time import appendages_alone, tree_form, tuned_poses, turned_poses
from beamchain.warning_codes import Caution

UNIT_MASS = 1e-4  # by which the modal mass of a tendon of ours may miss 1
ARRAYS = (
    "tendon_stiffness",
    "tendon_armature",
    "tendon_damping",
    "tendon_solimp_lim",
    "dof_armature",
    "dof_solimp",
    "jnt_solimp",
)


@dataclass(frozen=True, eq=False)
class Retimed:
    """What `retime` did to a model.

    Args:
        timestep: [s]; 0: the timing was taken out.
        integrator: MuJoCo's name.
        form: 2, 4 or 5.
        phase: [rad] per step, the limit beyond which modes were slowed.
        lambda_max: `h^2 lambda_max` of the tendons' springs and dampers on the craft;
            stable below 4 (RK4: 8).
        modes: one per modal tendon.
        before: the arrays as they were, for `undo`.
        model: a copy of the model as it was written, with its step and integrator; None:
            the timing was taken out.
        qpos: the pose in which the craft's coupling was looked at; None: rest and keyframes.

    Example:
        >>> import beamchain as bc, mujoco
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(
        ...     segment=(bc.Segment(length=8.0, section=section),),
        ...     fit=bc.spec.FitOptions(springs="modes"),
        ... )
        >>> model = mujoco.MjModel.from_xml_string(bc.fit(spec).scene_mjcf())
        >>> done = bc.retime(model, 2.0, "Euler")
        >>> [(mode.name, mode.slowed) for mode in done.modes][:2], done.slowed[0].code
        ([('appendage_mode1_xy', True), ('appendage_mode2_xy', True)], 'slowed-modes')
        >>> done.undo(model)
    """

    timestep: float
    integrator: str
    form: int
    phase: float
    lambda_max: float
    modes: tuple[ModeTime, ...]
    before: Mapping[str, Array]
    model: "mujoco.MjModel | None" = None
    qpos: Array | None = None

    @property
    def slowed(self) -> list[str]:
        """A warning where modes were slowed, with the coupled frequency from which on it is felt,
        and one for every latched hinge that was; empty where none was."""
        if self.model is None:
            return []
        raised = [dof for dof in range(self.model.nv) if is_raised(self.model, dof)]
        return [*self._slowed_modes(), *(self._slowed_latch(self.model, dof) for dof in raised)]

    def _slowed_latch(self, model: "mujoco.MjModel", dof: int) -> str:
        name = model.joint(int(model.dof_jntid[dof])).name
        more = float(model.dof_armature[dof] - model.dof_solimp[dof, 3])
        text = (
            f"the latched hinge {name!r} has {more:.3g} kg m^2 more armature, with which its "
            f"spring is stable for {self.integrator} at {self.timestep:g} s and slower; where it "
            f"turns at w rad/s, that brings {more / 2.0:.3g} w^2 J. Take a shorter step to keep it."
        )
        return Caution("slowed-modes", text)

    def _slowed_modes(self) -> list[str]:
        slow = [mode for mode in self.modes if mode.slowed]
        if not slow or self.model is None:
            return []
        first = lowest_wrong(self.model, without_timing(self.model), _places(self.model, self.qpos))
        felt = "no pole of the spacecraft is off by more than 0.1 %"
        if first is not None:
            felt = (
                f"the lowest pole of the spacecraft that is off by more than 0.1 % stands at "
                f"{first.frequency:.4g} rad/s (coupled, read back) and is off by "
                f"{100.0 * first.error:.2g} % of |z - 1|"
            )
        if first is not None and first.damped_by:
            felt += f" (joint {first.damped_by!r} damps it, which timing cannot correct)"
        text = (
            f"{len(slow)} of {len(self.modes)} appendage modes are too fast for {self.integrator} "
            f"at {self.timestep:g} s on this spacecraft and were slowed; {felt}."
        )
        return [Caution("slowed-modes", text)]

    @cached_property
    def time_error(self) -> TimeError | None:
        """The largest error of a coupled pole up to the last kept mode,
        read back from the step of the model as written.

        It holds for the pose that `retime` was given, else for the worst of rest and keyframes;
        None where the timing was taken out.
        """
        if self.model is None:
            return None
        places = _places(self.model, self.qpos)
        return time_error(self.model, without_timing(self.model), places)

    @property
    def warnings(self) -> list[str]:
        """What a user of the model must know: slowed modes, and poles that are not exact."""
        off = self.time_error if self.form == 4 else None
        if off is None or off.exact:
            return self.slowed
        return [*self.slowed, Caution("time-error", time_sentence(off))]

    @property
    def lowered(self) -> bool:
        """The phase limit had to be lowered for this craft."""
        return self.phase < SCHEMES[self.integrator].phase

    def undo(self, model: "mujoco.MjModel") -> None:
        """Every array of `model` back as it was before the call, bit for bit."""
        for name, values in self.before.items():
            getattr(model, name)[:] = values


@one_thread()
def retime(
    model: "mujoco.MjModel",
    timestep: float,
    integrator: str | None = None,
    *,
    pose: Pose = None,
    band: float | None = None,
    joints: bool = False,
) -> Retimed:
    """Make the appendages of a model exact in time for a step, in place.

    Each tendon is timed by itself; errors of the coupled poles are of fourth order in the step.
    Appendages that carry bodies are timed together: stable for every payload and pose, and near in
    the response. Any earlier timing is removed first, so that repeated calls do not accumulate.
    `model.opt` is not changed: run the model at this step, and give the input as `HeldInput` does
    (RK4: as it is).

    Args:
        model: compiled; arrays change, its topology does not.
        timestep: [s]; 0 removes the timing: the model is restored bit for bit.
        integrator: MuJoCo's name; default: the model's own. RK4: only modes beyond its
            limit are slowed; "discrete": nothing is changed, it is stable at every step and
            cannot be made exact.
        pose: at which the craft's coupling is computed: name or number of a keyframe, `qpos`, or
            `{joint: position}` [rad, m]; default: the initial one and every keyframe. Appendages
            that carry bodies are looked at in several poses, whatever is given.
        band: up to where appendages that carry bodies keep the response [rad/s]; default: the last
            kept mode, and at most 0.2 rad per step. Beyond half a radian per step nothing is kept.
        joints: put armature on the spacecraft's own sprung and servo-driven joints as well, whose
            step error is then of fourth order; they have no friction.

    Raises:
        InputError: the model has no modal tendons, or no such pose.

    Example:
        >>> import beamchain as bc, mujoco
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(
        ...     segment=(bc.Segment(length=8.0, section=section),),
        ...     fit=bc.spec.FitOptions(springs="modes"),
        ... )
        >>> model = mujoco.MjModel.from_xml_string(bc.fit(spec).scene_mjcf())
        >>> done = bc.retime(model, 0.05, "Euler")
        >>> [mode.slowed for mode in done.modes]
        [False, False, False, False]
    """
    of_type("model", model, mujoco.MjModel, "a compiled mujoco.MjModel")
    qpos = None if pose is None else state_at(model, pose)[0]
    if qpos is not None:
        check_pose(model, qpos)
    return retime_by(2, model, timestep, integrator, qpos=qpos, band=band, joints=joints)


@one_thread()
def retime_by(
    form: int,
    model: "mujoco.MjModel",
    timestep: float,
    integrator: str | None = None,
    *,
    qpos: Array | None = None,
    band: float | None = None,
    joints: bool = False,
) -> Retimed:
    """Make the appendages exact in time by a form, as the module describes them; the rest as
    `retime`.

    4 needs Euler, implicit or implicitfast; otherwise it is 2. 5 is taken wherever an appendage
    carries bodies.
    """
    h = not_negative("timestep", timestep, "s")
    band = None if band is None else positive("band", band, "rad/s")
    with_joints = true_or_false("joints", joints)
    name = NUMBERS[int(model.opt.integrator)] if integrator is None else integrator
    one_of("integrator", name, tuple(SCHEMES))
    modal = modal_tendons(model)
    if not modal.names:
        raise foreign("retiming")
    before = {array: np.array(getattr(model, array), dtype=np.float64) for array in ARRAYS}
    take_out_joints(model)
    _take_out(model, modal, qpos)
    if h == 0.0:
        return Retimed(0.0, name, form, SCHEMES[name].phase, 0.0, (), MappingProxyType(before))
    if name not in INTEGRATORS:
        raise InputError(f"this MuJoCo has no integrator {name!r}.")
    modal = modal_tendons(model)
    try:
        if form == TREE or carries_bodies(model, modal, qpos):
            form = TREE
            _check_alone(model, modal)
        added = np.zeros(model.nv)
        if with_joints:
            added = joint_armature(model, modal, name, h, slowed=False)
        plan = _plan(model, modal, form, name, h, added, qpos, band)
        if with_joints and _grows(model, modal, plan, added, TimingMark(h, name, form), qpos):
            added = joint_armature(model, modal, name, h, slowed=True)
            plan = _plan(model, modal, form, name, h, added, qpos, band)
        # tendons are stable without what latched hinges get: their springs take all of it
        write_joints(model, added + latch_armature(model, name, h), TimingMark(h, name, TREE))
    except BaseException:
        for array, values in before.items():
            getattr(model, array)[:] = values
        raise
    write_values(model, modal, plan, TimingMark(h, name, form))
    written = copy.copy(model)
    written.opt.timestep, written.opt.integrator = h, INTEGRATORS[name]
    return Retimed(
        h,
        name,
        form,
        plan.phase,
        plan.lambda_max,
        plan.modes,
        MappingProxyType(before),
        written,
        None if qpos is None else np.array(qpos, dtype=np.float64),
    )


def _plan(
    model: "mujoco.MjModel",
    modal: Modal,
    form: int,
    integrator: str,
    timestep: float,
    joints: Array,
    qpos: Array | None,
    band: float | None,
) -> TendonValues:
    """The numbers of the tendons; `joints` `(nv,)`: armature of the craft's own joints."""
    if form == TREE:
        return tree_form(model, modal, integrator, timestep, joints=joints, band=band)
    stepped = copy.copy(model)
    stepped.dof_armature[:] += joints
    c = coupled_mass(stepped, modal, qpos)
    plan = form2(modal, c, integrator, timestep)
    if form == 2:
        return plan
    places = _places(model, qpos).values()
    motions = [motion_for(model, timestep, integrator, place) for place in places]
    poles = [appendage_poles(modal, motion) for motion in motions]
    if np.any(joints):
        motions = [motion_for(stepped, timestep, integrator, place) for place in places]
    return form4(modal, c, integrator, timestep, plan, motions, poles)


def _places(model: "mujoco.MjModel", qpos: Array | None) -> dict[str, Array]:
    """The pose that was given, or rest and every keyframe."""
    return poses(model) if qpos is None else {"rest": qpos}


def _grows(
    model: "mujoco.MjModel",
    modal: Modal,
    plan: TendonValues,
    joints: Array,
    mark: TimingMark,
    qpos: Array | None,
) -> bool:
    """Whether a step would be unstable in one of the poses."""
    timed = copy.copy(model)
    write_values(timed, modal, plan, mark)
    timed.dof_armature[:] += joints
    places = tuned_poses(model, modal) + turned_poses(model, modal)
    if qpos is not None:
        places.append(qpos)
    motions = (motion_for(timed, mark.timestep, mark.integrator, place) for place in places)
    return any(motion.grows for motion in motions)


def time_sentence(off: TimeError) -> str:
    """A sentence for a step whose poles are not those of exact motion: the one that is off most,
    and why, where that is known."""
    said = (
        f"{off.integrator} at {off.step:g} s does not keep every pole of this spacecraft: "
        f"{off.words}."
    )
    return f"{said} {time_reason(off)}".rstrip()


def time_reason(off: TimeError) -> str:
    """Why poles are off; empty where that is not known."""
    if off.damped_by:
        return f"Timing cannot correct what joint {off.damped_by!r} damps."
    if off.integrator in ("implicit", "implicitfast"):
        return (
            f"{off.integrator} cannot reproduce the pole of a mode whose damping ratio exceeds "
            "omega h/12, as Euler can."
        )
    return ""


def without_timing(model: "mujoco.MjModel") -> "mujoco.MjModel":
    """A copy with the timing taken out."""
    out = copy.copy(model)
    take_out_joints(out)
    _take_out(out, modal_tendons(out), None)
    return out


def carries_bodies(model: "mujoco.MjModel", modal: Modal, qpos: Array | None) -> bool:
    """Whether something hangs on the links of an appendage: its modal masses are not 1, but alone
    they are."""
    mass = mass_matrix(model, qpos)
    own = [_modal_mass(mass, row) for row in modal.rows]
    return any(value > 1.0 + UNIT_MASS for value in own) and _is_unit(model, modal)


def _is_unit(model: "mujoco.MjModel", modal: Modal) -> bool:
    """Whether every tendon is a mode of mass 1 of its appendage alone."""
    masses = [np.diag(alone.held) for alone in appendages_alone(model, modal)]
    return bool(np.all(np.abs(np.concatenate([np.zeros(0), *masses]) - 1.0) <= UNIT_MASS))


def _check_alone(model: "mujoco.MjModel", modal: Modal) -> None:
    if not _is_unit(model, modal):
        raise InputError(
            "form = 5 needs appendages as they were written, whose modes have the mass 1 without "
            "what they carry; write the appendage again."
        )


def coupled_mass(model: "mujoco.MjModel", modal: Modal, qpos: Array | None) -> Array:
    """`(p, n, n)` condensed mass in a pose, or at rest and every keyframe; a tendon whose own modal
    mass is not 1 is refused."""
    masses = [mass_matrix(model, place) for place in _places(model, qpos).values()]
    mass = masses[0]
    for i, name in enumerate(modal.names):
        own = _modal_mass(mass, modal.rows[i])
        if own > 1.0 + UNIT_MASS and _is_unit(model, modal):
            raise InputError(
                f"tendon {name!r} belongs to an appendage that carries bodies, which this does "
                "not take; embed and bc.retime do."
            )
        if abs(own - 1.0) > UNIT_MASS:
            raise InputError(
                f"tendon {name!r} has the name of a modal tendon, but the mass {own:.6g} of its "
                "mode is not 1; rename it if it is not an appendage's, or write the appendage "
                "again."
            )
    return condensed_mass(np.array(masses), modal.rows)[0]


def _modal_mass(mass: Array, row: Array) -> float:
    """Mass of a tendon's mode in the held appendage."""
    span = np.flatnonzero(row)
    return 1.0 / float(
        row[span] @ np.linalg.solve(mass[np.ix_(span.tolist(), span.tolist())], row[span])
    )


def _take_out(model: "mujoco.MjModel", modal: Modal, qpos: Array | None) -> None:
    """The tendons as they were before they were made exact in time."""
    for i, stiffness, mark in zip(modal.index, modal.stiffness, modal.made_for, strict=True):
        if mark is not None:
            model.tendon_damping[i] = model.tendon_solimp_lim[i, 3]
            model.tendon_armature[i] = 0.0
        if mark is not None and mark.form == TREE:
            model.tendon_stiffness[i] = stiffness
    # of a participation other than the nominal one, or a user's default
    if np.any(model.tendon_margin[modal.index]):
        mass = mass_matrix(model, qpos)
        for i, row, mark in zip(modal.index, modal.rows, modal.made_for, strict=True):
            own = float(model.tendon_margin[i])
            if mark is not None and abs(_modal_mass(mass, row) + own - 1.0) < UNIT_MASS:
                model.tendon_armature[i] = own
    for i, mark in zip(modal.index, modal.made_for, strict=True):
        if mark is not None:
            model.tendon_solimp_lim[i] = UNMARKED


def write_values(
    model: "mujoco.MjModel", modal: Modal, plan: TendonValues, mark: TimingMark
) -> None:
    """Write the numbers of a form, and what they were made for,
    into the tendons of a model that is not timed."""
    stiffer = np.zeros(modal.stiffness.size)
    if plan.stiffness is not None:
        stiffer = plan.stiffness / modal.stiffness - 1.0
    for j, i in enumerate(modal.index):
        model.tendon_solimp_lim[i] = (
            mark.timestep,
            INTEGRATORS[mark.integrator],
            mark.form + stiffer[j],
            modal.damping[j],
            modal.stiffness[j],
        )
    model.tendon_armature[modal.index] += plan.armature
    model.tendon_damping[modal.index] = plan.damping
    if plan.stiffness is not None:
        model.tendon_stiffness[modal.index] = plan.stiffness
