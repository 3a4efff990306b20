"""`plant`: the spacecraft as a control engineer's plant, in one pose or in several."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from beamchain.checks import positive, true_or_false
from beamchain.control.at_step import at_step, retime_at
from beamchain.control.realisation import Plant
from beamchain.control.scheduled import ScheduledPlant, follow, in_one_order, reduced_alike
from beamchain.control.source import PlantSource
from beamchain.craft.embedded import Embedded
from beamchain.craft.linear_craft import LinearCraft, linear_craft
from beamchain.craft.modal_form import ModalForm
from beamchain.craft.plant_load import limp_cautions, thrust_cautions, under_load
from beamchain.craft.poses import Poses, pose_label, poses_of
from beamchain.craft.source import compiled_model, linear_omissions
from beamchain.engine.combinations import (
    InputNames,
    OutputNames,
    allocations_of,
    settled,
)
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linear import linear_at
from beamchain.engine.linearise import NUMBERS
from beamchain.engine.normal_modes import NormalModes
from beamchain.engine.operating_point import (
    Pose,
    Rates,
    operating_point,
    quiet_copy,
    rest_point,
)
from beamchain.engine.operating_point import poses as poses_of_file
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps.cures import RUINED
from beamchain.steps.modal import FILLER
from beamchain.steps.retime import without_timing
from beamchain.warning_codes import Caution

# of a mode's discrete pole beyond the unit circle: more than what turning wheels do to it
GROWS = 1e-5
ROUNDING = 1e-9
SAME = 1e-6  # of a joint [rad, m] in two poses that are one


@one_thread()
def plant(
    model: "Embedded | mujoco.MjSpec | mujoco.MjModel | str | Path",
    inputs: InputNames = None,
    outputs: OutputNames = None,
    pose: Pose = None,
    *,
    rates: Mapping[str, float] | None = None,
    discrete: float | None = None,
    loaded: bool = False,
) -> "Plant | ScheduledPlant":
    """The spacecraft as a control engineer's plant:
    a `control.StateSpace` with names and units, in modal form.

    Linear about `pose`, in free fall: gravity, contacts and constraints are left out, and
    what holds the pose (springs' and servos' set points) is taken as in balance. Servos are part of
    the plant, their inputs are set points. Continuous plants are without the armature that makes
    appendages exact in time for a step.

    Signs: a torque on a body is in the body's own axes, a positive input of a wheel's or
    drive's motor accelerates it about its joint's axis, so that the hub turns the other way.
    Attitude is the small rotation vector [rad] from the body's axes in `pose` to its axes now
    (twice a quaternion's vector part), rate is in the body's axes. Gyroscopic moments of
    turning wheels are included.

    States: rigid motion as integrators (`rigid_attitude_x`, `rigid_attitude_x_rate`: of the whole
    craft, which the hub follows but for its modes), then what else there is, then oscillators named
    by the appendage's mode that holds most of their strain energy (`array_mode1_xy`,
    `array_mode1_xy_rate`; modal mass 1). What nothing drives or nothing sees is taken out: angles
    of wheels, modes in which two arrays oppose each other (named in `unreached`).

    Args:
        model: path or text of an MJCF file, MjSpec, MjModel,
            or what `bc.embed` returns (needed for `exact`).
        inputs: actuators by name, `"torque:BODY"` and `"force:BODY"` (at its mass centre, three
            signals each), `"wrench:SITE"` (six, in the site's axes). All actuators where left out;
            without one a torque on the base. Or a mapping `{NAME: what}`: `bc.allocate(...)` gives
            torque on a body (`NAME_x`, `NAME_y`, `NAME_z`), `{name: weight}` drives several
            together, another name is a new name for an input.
        outputs: sensors by name (their linear part), `"attitude"`, `"rate"` of the base,
            `"motion:SITE"` (displacement and rotation of a site, in its axes). Attitude and
            rate where left out. Or a mapping: `bc.align(...)` gives a sensor in the axes of a body,
            `{name: weight}` the sum of several.
        pose: name or number of a keyframe, `qpos`, or `{joint: position}` [rad, m]; the pose of
            rest where left out. A list of such poses, or `{joint: [angles]}`: a plant per pose,
            modes followed by their shapes through the list in its order, all joints moving together
            from one pose to the next; a `ScheduledPlant`.
        rates: `{joint: rad/s}` of wheels; those of the keyframe where left out.
        discrete: a step [s]: the sampled plant that MuJoCo runs at that step with the model's own
            integrator, exact in time, its input the mean of this and the last one (`bc.HeldInput`),
            which adds a state per input. None: continuous.
        loaded: whether the craft is linear under its own load in `pose`: the gravity of its
            `<option>`, where its base is held, and the `ctrl` of the keyframe that `pose` names,
            such as a constant thrust that accelerates a free base. Appendages are bent and
            stiffened by it, and the liquids of tanks swing by it; attitude and rate are expressed
            in axes that accelerate with the craft. Without it the pendulums of a liquid have no
            restoring force. The moment of the thrust about the centre of mass is taken as balanced.

    Returns:
        A `Plant`: `frequency`, `damping_ratio`, `gain` of its modes, `exact`,
            `truncation(omega)`, `write(path)`.

    Raises:
        InputError: an unknown name, a sensor without a linear part, torque that the actuators of
            an allocation do not give, a pose in contact or out of range, a body that moves there
            and is not a balanced wheel, nothing flexible, a step that is unstable.
        EngineError: MuJoCo refuses the model.

    Example:
        >>> import beamchain as bc, control
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> plant = bc.plant(bc.embed(craft, {"mount": spec}), inputs=["torque:bus"])
        >>> plant.input_labels
        ['torque_x', 'torque_y', 'torque_z']
        >>> loop = control.feedback(
        ...     plant["attitude_z", "torque_z"], control.tf([20.0, 100.0], [0.1, 1.0])
        ... )
    """
    step = None if discrete is None else positive("discrete", discrete, "s")
    whole = compiled_model(model)
    loaded = true_or_false("loaded", loaded)
    given = _Given(
        model if isinstance(model, Embedded) else None, whole, rates, inputs, outputs, step, loaded
    )
    poses = poses_of(whole, pose)
    if loaded and (poses is not None or step is not None):
        raise InputError(
            f"loaded: a plant under a load is {'of one pose' if step is None else 'continuous'}; "
            f"{'give one keyframe' if step is None else 'leave discrete out'}."
        )
    if poses is None:
        craft, said = given.craft(pose)
        form = craft.form(step is not None)
        said = [*given.left_out, *said, *given.unverified([craft.point.qpos])]
        label = pose_label(whole, pose)
        kept = form.minimal()
        return given.plant(craft, form, kept, kept, craft.mode_names, said, label, pose)
    return given.scheduled(poses)


@dataclass(frozen=True)
class _Given:
    """What `plant` was asked for, apart from the pose."""

    embedded: Embedded | None
    model: "mujoco.MjModel"
    rates: Rates
    inputs: InputNames
    outputs: OutputNames
    step: float | None
    loaded: bool = False

    @property
    def left_out(self) -> list[str]:
        """Sentences on what the plant leaves out."""
        found = linear_omissions(self.model)
        if self.loaded:
            return [text for text in found if getattr(text, "code", "") != "gravity"]
        why = "the plant is one in free fall (loaded=True: under its load)"
        return [*found, *limp_cautions(self.model, why)]

    def unverified(self, poses: Sequence[Array]) -> list[str]:
        """What to say of the worst of some poses `(nq,)` that the file's proof does not cover."""
        if self.loaded:
            return []
        joints = self.model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE)
        at = self.model.jnt_qposadr[joints]
        proven = np.array(list(poses_of_file(self.model).values()))[:, at]
        new = [q for q in poses if not np.isclose(q[at], proven, atol=SAME).all(axis=1).any()]
        cure = "give the spacecraft a keyframe there and embed again"
        if self.embedded is None:
            low, high = proven.min(axis=0) - SAME, proven.max(axis=0) + SAME
            if all(np.all((low <= q[at]) & (q[at] <= high)) for q in new):
                return []
            text = (
                f"the pose lies beyond the file's keyframes, where its modes were chosen; {cure}."
            )
            return [Caution("pose-not-proven", text)]
        error = max(map(self.embedded.error_at, new), default=0.0)
        allowed = RUINED if self.embedded.tolerance is None else self.embedded.tolerance
        if error <= allowed:
            return []
        text = (
            f"away from the file's keyframes the error is {error:.2g}, above {allowed:g}; {cure}."
        )
        return [Caution("pose-not-proven", text)]

    def scheduled(self, poses: Poses) -> ScheduledPlant:
        """The plants of several poses, with one order of states."""
        crafts = [self.craft(one.given)[0] for one in poses.each]
        names = crafts[0].mode_names
        said = [*self.left_out, *self.unverified([craft.point.qpos for craft in crafts])]
        sampled = self.step is not None
        followed = list(zip(crafts, follow(crafts, self.modes_at), strict=True))
        whole = [craft.form(sampled, modes, names) for craft, modes in followed]
        forms = in_one_order(whole)
        if forms is None:  # the modes' own coordinates are the same in every pose
            forms = [craft.form(sampled, modes, names, together=True) for craft, modes in followed]
            kept, own = reduced_alike(forms), [form.minimal() for form in whole]
        else:
            kept = own = reduced_alike(forms)
        plants = tuple(
            self.plant(crafts[i], whole[i], kept[i], own[i], names, said, label)
            for i, label in enumerate(poses.labels)
        )
        return ScheduledPlant(
            plants, poses.labels, poses.joints, poses.units, poses.values, poses.joint
        )

    def modes_at(self, qpos: Array) -> NormalModes:
        """The normal modes at positions, without time or at the step."""
        model = without_timing(self.model)
        if self.step is not None:
            model, _ = retime_at(self.model, self.step, qpos)
        return linear_at(rest_point(quiet_copy(model), qpos)).modes()

    def craft(self, pose: Pose) -> tuple[LinearCraft, list[str]]:
        """The craft at a pose, without time or at its step, and sentences on that step."""
        model = without_timing(self.model)
        said = list[str]()
        if self.step is not None:
            model, said = at_step(
                self.model, self.step, operating_point(model, pose, self.rates).qpos, self.embedded
            )
        craft = linear_craft(model, pose, self.rates, self.inputs, self.outputs)
        if self.loaded:
            craft, _ = under_load(craft, model, pose)
            said = [*said, *thrust_cautions(model, pose)]
        if not craft.modes.frequency.size:
            raise InputError(
                "the model has no flexible mode, for no spring holds anything in it; put "
                "appendages in with bc.embed, or take bc.linearise for a rigid craft."
            )
        return craft, said

    def plant(
        self,
        craft: LinearCraft,
        whole: ModalForm,
        form: ModalForm,
        own: ModalForm,
        names: Sequence[str],
        said: Sequence[str],
        label: str,
        pose: Pose = None,
    ) -> Plant:
        """The plant of what is kept, `form`, of a craft's whole modal form in a pose; in `own` each
        mode is two states."""
        modes = own.oscillators(names)
        unreached = [name for name in whole.oscillators(names) if name not in modes]
        if not modes:
            said = [*said, "no flexible mode is both driven by the inputs and seen by the outputs."]
        if beyond := [name for name in modes if FILLER.search(name)]:
            said = [
                *said,
                f"{', '.join(beyond)}: no mode of an appendage, but what makes up a chain's mass "
                "beyond the modes kept; its frequency predicts nothing. Keep more modes if a loop "
                "acts up there.",
            ]
        if self.step is not None:
            said = [*said, *_growing(own, self.step)]
            form, own = (self._discrete(one, craft, self.step) for one in (form, own))
        allocations = allocations_of(craft.point, self.inputs)
        for name, allocated in allocations.items():
            said = [*said, *allocated.cautions(name)]
        source = PlantSource(
            craft=craft,
            inputs=settled(self.inputs, allocations),
            outputs=self.outputs,
            model=self.model,
            embedded=self.embedded,
            step=self.step,
            loaded=self.loaded,
            pose=pose,
            label=label,
            allocations=allocations,
        )
        return Plant(form, craft.signals, modes, said, source, unreached, own)

    def _discrete(self, form: ModalForm, craft: LinearCraft, step: float) -> ModalForm:
        """A step from `(A - 1)/h`, its input averaged where the integrator gives the
        whole impulse at once."""
        system = np.eye(form.a.shape[0]) + step * form.a, step * form.b, form.c, form.d
        if NUMBERS[int(self.model.opt.integrator)] == "RK4":
            return replace(form, a=system[0], b=system[1])
        a, b, c, d = _held_input(system)
        names = (*form.names, *(f"{i.label}_previous" for i in craft.inputs))
        units = (i.unit for i in craft.inputs)
        weight = np.append(form.weight, np.ones(len(craft.inputs)))
        return replace(
            form, a=a, b=b, c=c, d=d, names=names, units=(*form.units, *units), weight=weight
        )


def _growing(form: ModalForm, step: float) -> list[str]:
    """What to say of oscillators that a step lets grow; `form` is of `(A - 1)/h`.

    Raises:
        InputError: one grows by more than what turning wheels do to it.
    """
    said: list[str] = []
    for name in form.oscillators([name for name in form.names if not name.startswith("rigid_")]):
        size = float(np.abs(1.0 + step * form.poles_of(name)).max())
        if size > 1.0 + GROWS and not name.startswith("nutation"):
            raise InputError(
                f"discrete = {step:g} s is unstable: mode {name!r} grows by a factor "
                f"{size:.6g} per step; give a shorter step."
            )
        if size > 1.0 + ROUNDING:
            text = (
                f"the step makes {name!r} grow by {(size - 1.0) / step:.2g} per second; "
                "implicit does not."
            )
            said.append(Caution("turn-error", text))
    return said


def _held_input(system: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
    """The same system fed with half of this and half of the previous input,
    which becomes a state (docs/theory.md, 5)."""
    a, b, c, d = system
    n, m = b.shape
    both = np.block([[a, b / 2.0], [np.zeros((m, n + m))]])
    return both, np.vstack([b / 2.0, np.eye(m)]), np.hstack([c, d / 2.0]), d / 2.0
