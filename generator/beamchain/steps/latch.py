"""Latching of deployment hinges in a running simulation: at the instant at which the hinge reaches
its angle, with the energy that is dropped.

What the hinge was before stays in the model, in parameters of its stops and its friction, which
MuJoCo reads only where there are any; a latched hinge has none:

    jnt_solimp = -1 or -2, stiffness, springref, damping, armature    (-2: it has stops)
    dof_solref = frictionloss, 1

Where `retime` gives a latched hinge more armature, `dof_solimp` is the mark of a joint with timing
(`steps/joint_time.py`) whose last number is 1.

Copies, binary files and worlds therefore keep it.

Theory: docs/theory.md, section 9.
"""

from copy import copy
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.optimize import brentq

from beamchain.checks import not_negative, number, of_type, positive, true_or_false, unknown
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import NUMBERS, mass_matrix
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps.integrators import stable_armature
from beamchain.steps.modal import made_for, modal_tendons
from beamchain.steps.step_map import grows
from beamchain.warning_codes import Caution

#: All that `latch` and `unlatch` change in a model.
LATCH_FIELDS = (
    "jnt_stiffness",
    "jnt_limited",
    "qpos_spring",
    "dof_damping",
    "dof_armature",
    "dof_frictionloss",
    "dof_solref",
    "dof_solimp",
    "jnt_solimp",
)
ARMATURE = 4  # place of the armature in the record of a latched hinge
RAISED = 1.0  # last number of the mark of a latched hinge with more armature for another step
PHASE = 0.2  # rad per step of the latched hinge, where no stiffness is given
NEAR = 1e-6  # rad: a hinge at rest so near to its angle is there
LONGEST = 1.125  # of a step: what ends just before the angle goes on to it
SHORTEST = 1e-12  # of a step: what is shorter is none
MOTION = 10.0  # times what rate and acceleration give for a step: it does not get further
UNMARKED = (
    (0.02, 1.0),
    (0.9, 0.95, 0.001, 0.5, 2.0),
)  # MuJoCo's own solreffriction and solimplimit
WITHOUT_STOPS, WITH_STOPS = -1.0, -2.0
NOT_LINEAR = ("jnt_stiffnesspoly", "dof_dampingpoly", "jnt_springyield")


class Latched(float):
    """The energy [J] that `latch` dropped, with what else it did.

    Args:
        energy: dropped in all: with the drive spring and by the impact; less what an armature
            that is added to a moving hinge brings.
        joint: its name.
        time: of the simulation at the instant [s].
        angle: at which the hinge is held [rad].
        stiffness: of the latched hinge [N m/rad].
        impact: part of the energy that the impact took [J].
        warnings: where the loss is no property of the structure, or the step is unstable with the
            latched hinge.

    Example:
        >>> import beamchain as bc, mujoco
        >>> panel = '''<mujoco><option timestep="0.01" gravity="0 0 0" integrator="RK4"/><worldbody>
        ... <body><freejoint/><inertial pos="0 0 0" mass="50" diaginertia="9 9 9"/>
        ... <body><joint name="hinge" axis="0 0 1" stiffness="2" springref="100" range="-9 90"/>
        ... <inertial pos="1 0 0" mass="2" diaginertia=".1 .2 .2"/></body></body></worldbody>
        ... </mujoco>'''
        >>> model = mujoco.MjModel.from_xml_string(panel)
        >>> data = mujoco.MjData(model)
        >>> while (done := bc.latch(model, data, "hinge", stiffness=500.0)) is None:
        ...     mujoco.mj_step(model, data)
        >>> f"{data.qpos[7]:.10f} rad at {done.time:.4f} s, {done:.6f} J dropped"
        '1.5707963268 rad at 1.3629 s, 0.030462 J dropped'
    """

    joint: str
    time: float
    angle: float
    stiffness: float
    impact: float
    warnings: tuple[str, ...]

    def __new__(
        cls,
        energy: float,
        joint: str,
        time: float,
        angle: float,
        stiffness: float,
        impact: float = 0.0,
        warnings: tuple[str, ...] = (),
    ) -> Self:
        """The energy, with the rest beside it."""
        made = super().__new__(cls, energy)
        made.joint = joint
        made.time = time
        made.angle = angle
        made.stiffness = stiffness
        made.impact = impact
        made.warnings = warnings
        return made

    def __reduce__(self) -> tuple[type["Latched"], tuple[Any, ...]]:
        """For copies and pickling."""
        return type(self), (float(self), *vars(self).values())


class Hinge(NamedTuple):
    """Where a hinge stands in the arrays of a model."""

    name: str
    joint: int
    position: int
    dof: int


def latch(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    joint: str,
    *,
    angle: float | None = None,
    stiffness: float | None = None,
    damping: float | None = None,
    armature: float | None = None,
    impact: bool = False,
) -> Latched | None:
    """Hold a deployment hinge from the instant at which it reaches an angle.

    Call it before every step. If the next step does not reach the angle, nothing is done and None
    is returned. Otherwise that step is made, shortened so that it ends at the angle (or longer by
    an eighth at most), and the hinge's drive spring, friction and stops give way to a spring that
    is slack there. The stop at the angle does not act in that step. Integrate the deployment with
    RK4: a step of Euler loses momentum while bodies unfold.

    The model remembers what the hinge was, for `unlatch`: in copies, binary files and worlds too.

    Args:
        model, data: both change.
        joint: name of a hinge.
        angle: at which it latches, from either side [rad]. Default: of its two stops (`range`) the
            one nearer to the rest angle of its drive spring, without a drive spring the one that
            it moves towards; a hinge without stops is held where it is.
        stiffness: of the latched hinge [N m/rad]. It is a property of the structure, and should be
            given; the default makes the hinge swing by 0.2 rad of phase in a step, which is about
            as stiff as the step resolves.
        damping: [N m s/rad]; default: as it is.
        armature: of the latched hinge [kg m^2]; default: as it is, and beside a flexible body what
            keeps the step stable: `h^2 k/8 + h d/2` under RK4, `h^2 k/4` otherwise.
        impact: stop the hinge at once, `v+ = v - M^-1 e (e^T M^-1 e)^-1 v_j`, which conserves
            momentum. The loss is a property of the structure only where its neighbours are rigid.

    Returns:
        The energy that was dropped [J], which knows instant and angle as well; None where the next
        step does not reach the angle. Compare with `is None`: the energy may be zero.

    Raises:
        InputError: no such hinge, a number that is not allowed, or a hinge that cannot latch: it
            is latched, it is beyond its stop, or its spring is not linear.

    Example:
        >>> import beamchain as bc, mujoco
        >>> hinge = '''<mujoco><worldbody><body><joint name="hinge" axis="0 0 1"/>
        ... <inertial pos="1 0 0" mass="2" diaginertia=".1 .2 .2"/></body></worldbody></mujoco>'''
        >>> model = mujoco.MjModel.from_xml_string(hinge)
        >>> data = mujoco.MjData(model)
        >>> bc.latch(model, data, "hinge", angle=0.5, stiffness=500.0) is None
        True
        >>> bc.latch(model, data, "hinge", stiffness=500.0)  # it has no stops
        0.0
    """
    hinge = _hinge(model, data, joint)
    target = None if angle is None else number("angle", angle, "rad")
    spring = None if stiffness is None else positive("stiffness", stiffness, "N m/rad")
    damper = None if damping is None else not_negative("damping", damping, "N m s/rad")
    inertia = None if armature is None else not_negative("armature", armature, "kg m^2")
    is_impact = true_or_false("impact", impact)
    _check_can_latch(model, hinge)
    if is_impact and np.any(data.eq_active):
        raise InputError(
            "impact=True stops one hinge by itself, and the model has active equality constraints, "
            "which would stop more with it; latch with stiffness and damping alone."
        )
    if target is None:
        target = _stop_ahead(model, data, hinge)
    if not _step_to(model, data, hinge, target):
        return None
    energy = _spring_energy(model, data, hinge)
    lost = 0.0
    warnings: list[str] = []
    is_flexible = _has_flexible_neighbour(model, hinge.joint)
    if is_impact:
        lost = _stop(model, data, hinge.dof)
        if is_flexible:
            text = (
                f"joint {joint!r} was stopped at once beside a flexible body: the {lost:.3g} J "
                "that this took depend on how many modes are kept; latch it with stiffness and "
                "damping alone."
            )
            warnings.append(Caution("impact-on-flexible", text))
    before = float(model.dof_armature[hinge.dof])
    _mark(model, hinge)
    if damper is not None:
        model.dof_damping[hinge.dof] = damper
    if inertia is not None:
        model.dof_armature[hinge.dof] = inertia
    if spring is None:
        spring = _default_stiffness(model, data, hinge.dof)
    model.jnt_stiffness[hinge.joint] = spring
    model.qpos_spring[hinge.position] = target
    integrator, step = NUMBERS[int(model.opt.integrator)], float(model.opt.timestep)
    stable = _stable_armature(model, hinge.joint, integrator, step)
    if inertia is None and is_flexible:
        model.dof_armature[hinge.dof] = stable
    mujoco.mj_forward(model, data)
    warnings += _unstable(model, data, hinge, stable)
    # an armature has no rows on the root: it brings energy, and no momentum
    added = 0.5 * (float(model.dof_armature[hinge.dof]) - before) * float(data.qvel[hinge.dof]) ** 2
    return Latched(
        energy - _spring_energy(model, data, hinge) + lost - added,
        joint,
        float(data.time),
        target,
        spring,
        lost,
        tuple(warnings),
    )


def unlatch(model: "mujoco.MjModel", data: "mujoco.MjData", joint: str) -> float:
    """Give a hinge back what it had before `latch`: drive spring, damping, armature, friction and
    stops. Other hinges stay as they are.

    Args:
        model, data: both change.
        joint: name of a hinge that was latched.

    Returns:
        The energy that the drive spring brings, less that of the latched hinge [J].

    Raises:
        InputError: the model has no such hinge, or it is not latched.

    Example:
        >>> import beamchain as bc, mujoco
        >>> hinge = '''<mujoco><worldbody><body>
        ... <joint name="hinge" axis="0 0 1" damping="0.1" stiffness="2" springref="90"/>
        ... <inertial pos="1 0 0" mass="2" diaginertia=".1 .2 .2"/></body></worldbody></mujoco>'''
        >>> model = mujoco.MjModel.from_xml_string(hinge)
        >>> data = mujoco.MjData(model)
        >>> dropped = bc.latch(model, data, "hinge", stiffness=500.0)
        >>> float(model.jnt_stiffness[0])
        500.0
        >>> brought = bc.unlatch(model, data, "hinge")
        >>> float(model.jnt_stiffness[0]), float(model.dof_damping[0]), dropped == brought
        (2.0, 0.1, True)
    """
    hinge = _hinge(model, data, joint)
    if not is_latched(model, hinge.joint):
        raise InputError(f"hinge {joint!r} is not latched, so that there is nothing to undo.")
    held = _spring_energy(model, data, hinge)
    moving = 0.5 * float(data.qvel[hinge.dof]) ** 2
    armature = float(model.dof_armature[hinge.dof])
    take_out_latch(model, hinge.joint)
    mujoco.mj_forward(model, data)
    added = moving * (float(model.dof_armature[hinge.dof]) - armature)
    return _spring_energy(model, data, hinge) - held + added


def latch_armature(model: "mujoco.MjModel", integrator: str, timestep: float) -> Array:
    """`(nv,)` armature that hinges which are latched beside flexible bodies lack at a step."""
    out = np.zeros(model.nv)
    for joint in range(model.njnt):
        if is_latched(model, joint) and _has_flexible_neighbour(model, joint):
            dof = int(model.jnt_dofadr[joint])
            needed = _stable_armature(model, joint, integrator, timestep)
            out[dof] = max(needed - float(model.dof_armature[dof]), 0.0)
    return out


def _stable_armature(
    model: "mujoco.MjModel", joint: int, integrator: str, timestep: float
) -> float:
    """With which the spring of a latched hinge is stable at a step, whatever it joins."""
    stiffness = float(model.jnt_stiffness[joint])
    damping = float(model.dof_damping[int(model.jnt_dofadr[joint])])
    before = float(model.jnt_solimp[joint, ARMATURE])
    return before + stable_armature(integrator, timestep, stiffness, damping)


@one_thread()
def _unstable(
    model: "mujoco.MjModel", data: "mujoco.MjData", hinge: Hinge, armature: float
) -> list[str]:
    """A warning where the step is unstable with a latched hinge, and is not with an armature."""
    own = float(model.dof_armature[hinge.dof])
    heavier = copy(model)
    heavier.dof_armature[hinge.dof] = armature
    if own >= armature or not grows(model, data.qpos) or grows(heavier, data.qpos):
        return []
    text = (
        f"joint {hinge.name!r} was latched with an armature of {own:g} kg m^2, with which "
        f"{NUMBERS[int(model.opt.integrator)]} at {float(model.opt.timestep):g} s is unstable; "
        f"give armature={_round_up(armature):g}, or take a shorter step."
    )
    return [Caution("unstable-step", text)]


def _round_up(value: float) -> float:
    digit = 10.0 ** (np.floor(np.log10(value)) - 2.0)
    return float(np.ceil(value / digit) * digit)


def is_latched(model: "mujoco.MjModel", joint: int) -> bool:
    """Whether a joint is a latched hinge."""
    return is_mark(model.jnt_solimp[joint])


def is_mark(impedance: Array) -> bool:
    """Whether a `jnt_solimp` is what a latched hinge was before."""
    return float(impedance[0]) in (WITHOUT_STOPS, WITH_STOPS)


def is_raised(model: "mujoco.MjModel", dof: int) -> bool:
    """Whether `retime` gave a latched hinge more armature."""
    mark = model.dof_solimp[dof]
    return made_for(mark) is not None and float(mark[4]) == RAISED


def take_out_latch(model: "mujoco.MjModel", joint: int) -> None:
    """The fields of a latched hinge as they were before."""
    dof = int(model.jnt_dofadr[joint])
    mark, stiffness, reference, damping, armature = (float(v) for v in model.jnt_solimp[joint])
    model.jnt_limited[joint] = mark == WITH_STOPS
    model.jnt_stiffness[joint] = stiffness
    model.qpos_spring[int(model.jnt_qposadr[joint])] = reference
    model.dof_damping[dof] = damping
    model.dof_armature[dof] = armature
    model.dof_frictionloss[dof] = model.dof_solref[dof, 0]
    if is_raised(model, dof):
        model.dof_solimp[dof] = UNMARKED[1]
    model.dof_solref[dof], model.jnt_solimp[joint] = UNMARKED


def _mark(model: "mujoco.MjModel", hinge: Hinge) -> None:
    """Remember what the hinge is; stops and friction do not act any more."""
    joint, position, dof = hinge[1:]
    model.jnt_solimp[joint] = (
        WITH_STOPS if model.jnt_limited[joint] else WITHOUT_STOPS,
        float(model.jnt_stiffness[joint]),
        float(model.qpos_spring[position]),
        float(model.dof_damping[dof]),
        float(model.dof_armature[dof]),
    )
    model.dof_solref[dof, 0] = float(model.dof_frictionloss[dof])
    model.dof_frictionloss[dof] = 0.0
    model.jnt_limited[joint] = False


def _hinge(model: "mujoco.MjModel", data: "mujoco.MjData", name: str) -> Hinge:
    of_type("model", model, mujoco.MjModel, "a compiled mujoco.MjModel")
    of_type("data", data, mujoco.MjData, "the mujoco.MjData of the model")
    counts = model.nq, model.nv, model.nu, model.nbody, model.ngeom, model.nsensordata
    of_data = data.qpos, data.qvel, data.ctrl, data.xpos, data.geom_xpos, data.sensordata
    if tuple(map(len, of_data)) != counts:
        raise InputError(
            f"data, with {data.qpos.size} positions and {data.qvel.size} rates, was made for "
            f"another model than this, which has {model.nq} and {model.nv}; give the "
            "mujoco.MjData of this model."
        )
    kind = int(mujoco.mjtJoint.mjJNT_HINGE)
    joint = -1
    if isinstance(name, str):
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
    if joint < 0 or int(model.jnt_type[joint]) != kind:
        names = [model.joint(j).name for j in np.flatnonzero(model.jnt_type == kind)]
        raise unknown("hinge", name, [known for known in names if known])
    return Hinge(name, joint, int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint]))


def _check_can_latch(model: "mujoco.MjModel", hinge: Hinge) -> None:
    name, joint, _, dof = hinge
    if is_latched(model, joint):
        raise InputError(f"hinge {name!r} is latched already; bc.unlatch sets it free.")
    for field in NOT_LINEAR:
        values = getattr(model, field, None)  # not in every MuJoCo
        if values is not None and np.any(values[dof if field.startswith("dof_") else joint]):
            raise InputError(
                f"hinge {name!r} has a {field}, so that its spring or damper is not linear; latch "
                "takes hinges with one stiffness and one damping."
            )
    if tuple(model.dof_solref[dof]) != UNMARKED[0] or tuple(model.jnt_solimp[joint]) != UNMARKED[1]:
        raise InputError(
            f"hinge {name!r} has a solreffriction or solimplimit of its own, where latch keeps "
            "what the hinge was before; leave both at MuJoCo's defaults."
        )


def _stop_ahead(model: "mujoco.MjModel", data: "mujoco.MjData", hinge: Hinge) -> float:
    """The stop at which a hinge latches if no angle is given."""
    if not model.jnt_limited[hinge.joint]:
        return float(data.qpos[hinge.position])
    low, high = (float(v) for v in model.jnt_range[hinge.joint])
    if float(model.jnt_stiffness[hinge.joint]) > 0.0:
        return high if float(model.qpos_spring[hinge.position]) > (low + high) / 2.0 else low
    rate = float(data.qvel[hinge.dof])
    if rate == 0.0:
        raise InputError(
            f"angle is missing: hinge {hinge.name!r} has stops at {low:.6g} and {high:.6g} rad, "
            "but neither a drive spring nor a rate that tell which of them is meant; give angle."
        )
    return high if rate > 0.0 else low


def _step_to(model: "mujoco.MjModel", data: "mujoco.MjData", hinge: Hinge, target: float) -> bool:
    """Make a step that ends where a hinge is at its target; False where the next step does not
    reach it."""
    start = float(data.qpos[hinge.position]) - target
    is_stop = _is_stop(model, data, hinge, start, target)
    if start == 0.0 or (is_stop and _has_just_passed(model, data, hinge, start)):
        return True
    whole = float(model.opt.timestep)
    rate, acceleration = abs(data.qvel[hinge.dof]), abs(data.qacc[hinge.dof])
    if acceleration > 0.0 and abs(start) > NEAR + MOTION * whole * (rate + whole * acceleration):
        return False
    trial = mujoco.MjData(model)

    def at(step: float) -> float:
        mujoco.mj_copyData(trial, model, data)
        model.opt.timestep = step
        mujoco.mj_step(model, trial)
        return float(trial.qpos[hinge.position]) - target

    limited = bool(model.jnt_limited[hinge.joint])
    try:
        model.jnt_limited[hinge.joint] = limited and not is_stop
        if not start * at(LONGEST * whole) <= 0.0:  # nor where the simulation diverges
            return abs(start) <= NEAR
        if start * at(SHORTEST * whole) > 0.0:
            low, high = SHORTEST * whole, LONGEST * whole
            model.opt.timestep = float(brentq(at, low, high, xtol=1e-15 * whole, rtol=1e-15))
            mujoco.mj_step(model, data)
    finally:
        model.opt.timestep = whole
        model.jnt_limited[hinge.joint] = limited
    return True


def _has_just_passed(
    model: "mujoco.MjModel", data: "mujoco.MjData", hinge: Hinge, start: float
) -> bool:
    """Whether a hinge passed its angle, from which it is `start` [rad] away, within the last step:
    in the shortened step in which another hinge latched."""
    passed = float(data.qvel[hinge.dof]) * float(model.opt.timestep)
    return start * passed > 0.0 and NEAR < abs(start) <= LONGEST * abs(passed)


def _is_stop(
    model: "mujoco.MjModel", data: "mujoco.MjData", hinge: Hinge, start: float, target: float
) -> bool:
    """Whether a hinge latches at one of its stops, `start` [rad] beyond it; refused where the stop
    acts before."""
    if not model.jnt_limited[hinge.joint]:
        return False
    low, high = (float(v) for v in model.jnt_range[hinge.joint])
    if target > high + NEAR or target < low - NEAR:
        raise InputError(
            f"angle = {target:.6g} rad lies beyond the stops of hinge {hinge.name!r}, which are at "
            f"{low:.6g} and {high:.6g} rad."
        )
    margin = float(model.jnt_margin[hinge.joint])
    above, below = high - target <= NEAR + margin, target - low <= NEAR + margin
    if not (above or below):
        return False
    if margin > 0.0:
        raise InputError(
            f"hinge {hinge.name!r} has margin={margin:.6g}, so that its stop acts before the angle "
            f"{target:.6g} rad is reached; set the margin of the joint to 0."
        )
    beyond = max(start if above else 0.0, -start if below else 0.0)
    if beyond > NEAR and not _has_just_passed(model, data, hinge, start):
        raise InputError(
            f"hinge {hinge.name!r} is {beyond:.3g} rad beyond its stop at {target:.6g} rad, where "
            "it would be held bent; call bc.latch before every step, from before the stop is "
            "reached on, or put the hinge back to it."
        )
    return True


def _spring_energy(model: "mujoco.MjModel", data: "mujoco.MjData", hinge: Hinge) -> float:
    """Energy in the spring of a hinge [J]."""
    stretch = float(data.qpos[hinge.position] - model.qpos_spring[hinge.position])
    return 0.5 * float(model.jnt_stiffness[hinge.joint]) * stretch**2


@one_thread()
def _spread(model: "mujoco.MjModel", data: "mujoco.MjData", dof: int) -> Array:
    """`M^-1 e` `(nv,)`: acceleration of everything per torque in a hinge."""
    return np.linalg.solve(mass_matrix(model, np.array(data.qpos)), np.eye(model.nv)[dof])


def _default_stiffness(model: "mujoco.MjModel", data: "mujoco.MjData", dof: int) -> float:
    """With which the hinge alone, all other springs taken away, swings by `PHASE` in a step."""
    compliance = float(_spread(model, data, dof)[dof])
    return (PHASE / float(model.opt.timestep)) ** 2 / compliance


def _stop(model: "mujoco.MjModel", data: "mujoco.MjData", dof: int) -> float:
    """Stop a hinge at once without a change of momentum; the kinetic energy lost [J]."""
    spread = _spread(model, data, dof)
    rate = float(data.qvel[dof])
    # v+ = v - M^-1 e (e^T M^-1 e)^-1 v_j
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
