"""`robust.uncertain`, and the worst of a controller at every pose of a plant."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, overload

from numpy.typing import ArrayLike

from beamchain import Plant
from beamchain.errors import InputError
from beamchain.results import ScheduledPlant
from beamchain.robust.least_margins import WorstMarginsOfPoses
from beamchain.robust.search import Tell
from beamchain.robust.uncertain_plant import UncertainPlant, uncertain_plant
from beamchain.robust.worst_gains import WorstCases
from beamchain.spec import UncertainCraft
from beamchain.toolkit import Given, one_thread, read_uncertain


@overload
def uncertain(plant: Plant, craft: UncertainCraft | str | Path | None = None) -> UncertainPlant: ...
@overload
def uncertain(
    plant: ScheduledPlant, craft: UncertainCraft | str | Path | None = None
) -> tuple[UncertainPlant, ...]: ...
@one_thread()
def uncertain(
    plant: Plant | ScheduledPlant, craft: UncertainCraft | str | Path | None = None
) -> UncertainPlant | tuple[UncertainPlant, ...]:
    """A plant with its uncertain quantities pulled out: a linear fractional transformation.

    Args:
        plant: continuous, without a load, as `bc.plant` returned it.
        craft: what is uncertain, or the path of its file; of what `bc.embed` returned, [uncertain]
            of the specifications holds for the modes that it does not name.

    Returns:
        An `UncertainPlant`; of a plant in several poses one each, their states in an order of their
            own. What a search finds in one of them is tried in the others.

    Raises:
        InputError: the plant is discrete, nothing is uncertain, a name is unknown, a range is
            impossible, or a signal depends on a quantity otherwise than through the craft's motion.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> boom = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> plant = bc.plant(bc.embed(craft, {"mount": boom}), inputs=["torque:bus"])
        >>> tenth = bc.spec.Uncertainty(relative=0.1, distribution="uniform")
        >>> bus = bc.spec.UncertainCraft(body={"bus": bc.spec.UncertainBody(mass=tenth)})
        >>> robust.uncertain(plant, bus).blocks[0].name
        'bus.mass'
    """
    given = None if craft is None else read_uncertain(craft)
    if isinstance(plant, ScheduledPlant):
        several = tuple(_of_plant(each, given) for each in plant)
        for each in several[1:]:
            each.found = several[0].found
        return several
    return _of_plant(plant, given)


def _of_plant(plant: Plant, given: UncertainCraft | None) -> UncertainPlant:
    if not isinstance(plant, Plant):
        raise InputError(f"plant: {plant!r:.60} is none; give what bc.plant returns.")
    if plant.dt:
        raise InputError("uncertain: uncertain plants are continuous; leave discrete out.")
    if plant.source is None:
        raise InputError("uncertain: an exact plant is certain; give what bc.plant returns.")
    if plant.source.loaded:
        raise InputError("uncertain: uncertain plants are without a load; leave loaded out.")
    return uncertain_plant(plant.source, given)


def worst_case(
    plant: ScheduledPlant,
    craft: UncertainCraft | str | Path | None,
    controller: Given,
    input: str | None = None,
    output: str | None = None,
    omega: ArrayLike | None = None,
    *,
    progress: Tell | None = None,
    **options: Any,
) -> WorstCases:
    """The worst case at every pose: the poses are a grid, the quantities take all values at each.

    Args:
        plant: in several poses.
        craft: what is uncertain, as of `uncertain`.
        controller, input, output, omega, progress, options: as of `UncertainPlant.worst_case`.

    Raises:
        InputError: as of `UncertainPlant.worst_case`.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <body name="yoke" pos="0.5 0 0"><joint name="drive" axis="1 0 0" stiffness="1e4"/>
        ... <inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/><site name="mount"/></body></body>
        ... </worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> boom = bc.Spec(
        ...     segment=(bc.Segment(length=8.0, section=section),),
        ...     modes=bc.Modes(xy=1, xz=0),
        ...     damping=bc.Damping(ratio=0.01),
        ... )
        >>> poses = {"drive": [0.0, 1.5]}
        >>> plant = bc.plant(
        ...     bc.embed(craft, {"mount": boom}), ["torque:bus"], ["attitude"], pose=poses
        ... )
        >>> tenth = bc.spec.Uncertainty(relative=0.1, distribution="uniform")
        >>> bus = bc.spec.UncertainCraft(body={"bus": bc.spec.UncertainBody(mass=tenth)})
        >>> loop = bc.spec.Loop(
        ...     input="torque_z",
        ...     output="attitude_z",
        ...     numerator=(600.0, 60.0),
        ...     denominator=(0.05, 1.0),
        ... )
        >>> loops = bc.spec.Controller(loop=(loop,))
        >>> len(robust.worst_case(plant, bus, loops, samples=2, simulate=False))
        2
    """
    cases = (
        replace(
            each.worst_case(
                controller, input, output, omega, progress=_at(label, progress), **options
            ),
            pose=label,
        )
        for each, label in _poses(plant, craft)
    )
    return WorstCases(tuple(cases))


def worst_margins(
    plant: ScheduledPlant,
    craft: UncertainCraft | str | Path | None,
    controller: Given,
    *,
    progress: Tell | None = None,
    **options: Any,
) -> WorstMarginsOfPoses:
    """The least margins at every pose.

    Args:
        plant: in several poses.
        craft: what is uncertain, as of `uncertain`.
        controller, progress, options: as of `UncertainPlant.worst_margins`.

    Raises:
        InputError: as of `UncertainPlant.worst_margins`.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="10" diaginertia="5 6 7"/><body name="rotor">
        ... <joint name="drive" axis="0 0 1" stiffness="12" damping="0.04"/>
        ... <inertial pos="0 0 0" mass="1" diaginertia="1 1 2"/></body></body>
        ... </worldbody></mujoco>'''
        >>> plant = bc.plant(craft, ["torque:bus"], ["attitude"], pose={"drive": [0.0, 0.3]})
        >>> third = bc.spec.Uncertainty(relative=0.3)
        >>> drive = bc.spec.UncertainCraft(joint={"drive": bc.spec.UncertainJoint(stiffness=third)})
        >>> law = {"numerator": (8.0, 3.0), "denominator": (0.1, 1.0)}
        >>> loop = bc.spec.Loop(input="torque_z", output="attitude_z", **law)
        >>> loops = bc.spec.Controller(loop=(loop,))
        >>> robust.worst_margins(plant, drive, loops, samples=2).labels[0]
        'drive 0°'
    """
    margins = (
        replace(
            each.worst_margins(controller, progress=_at(label, progress), **options), pose=label
        )
        for each, label in _poses(plant, craft)
    )
    return WorstMarginsOfPoses(tuple(margins))


def _poses(
    plant: ScheduledPlant, craft: UncertainCraft | str | Path | None
) -> Iterator[tuple[UncertainPlant, str]]:
    """The uncertain plant of every pose, and the pose's name."""
    if not isinstance(plant, ScheduledPlant):
        raise InputError(
            f"plant: {type(plant).__name__} is not a plant in several poses; give bc.plant a list "
            "of poses, or ask robust.uncertain(plant, craft) for that of one."
        )
    return zip(uncertain(plant, craft), plant.labels, strict=True)


def _at(label: str, progress: Tell | None) -> Tell | None:
    """Who is told what is done at a pose."""
    return progress and (lambda text: progress(f"{label}: {text}"))
