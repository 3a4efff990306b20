"""What a plant was made of: it can be made again with other numbers, or with all modes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from beamchain.control.at_step import step_errors
from beamchain.craft.embedded import Embedded
from beamchain.craft.linear_craft import LinearCraft, exact_craft
from beamchain.engine.allocation import Allocated
from beamchain.engine.combinations import InputNames, OutputNames, inputs_of, outputs_of
from beamchain.engine.library import mujoco
from beamchain.engine.linear import linear_at
from beamchain.engine.operating_point import OperatingPoint, Pose
from beamchain.errors import InputError
from beamchain.steps.step_map import TimeError

NO_EXACT = (
    "the model is only a file, which does not hold the modes that its chains leave out; "
    "give what bc.embed returns."
)


@dataclass(frozen=True, eq=False)
class PlantSource:
    """What a plant was made of.

    Args:
        craft: linear, in the plant's pose.
        inputs, outputs: as `bc.plant` was given them, allocations with the commands that they have
            there.
        model: what was linearised, its appendages timed as they were given.
        embedded: the same as `bc.embed` returned it; None of a plain model.
        step: of a sampled plant [s]; None: continuous.
        loaded: whether the craft is under its load.
        pose: as it was given; `label` is what it is called.
        allocations: what allocations among the inputs are in this pose, by name.
    """

    craft: LinearCraft
    inputs: InputNames
    outputs: OutputNames
    model: "mujoco.MjModel"
    embedded: Embedded | None
    step: float | None
    loaded: bool
    pose: Pose
    label: str
    allocations: Mapping[str, Allocated]

    def again(self, model: "mujoco.MjModel") -> LinearCraft:
        """The craft of a model with other numbers, at the same point."""
        point = OperatingPoint(model, self.craft.point.qpos, self.craft.point.qvel)
        driven = inputs_of(point, self.inputs)
        seen = outputs_of(point, self.outputs)
        linear = linear_at(point, driven, seen)
        return replace(
            self.craft, linear=linear, inputs=tuple(driven), outputs=tuple(seen), point=point
        )

    def exact(self, omega: float) -> LinearCraft:
        """The craft with all modes of its appendages up to a frequency [rad/s].

        Raises:
            InputError: the plant was made from a file, or a signal belongs to an appendage.
        """
        if self.embedded is None:
            raise InputError(f"exact: {NO_EXACT}")
        return exact_craft(
            self.embedded,
            self.craft.point,
            self.inputs,
            self.outputs,
            omega,
            self.pose,
            loaded=self.loaded,
        )

    def step_errors(self) -> tuple[TimeError | None, float | None]:
        """The largest error of a pole, and the in-band error of the base's response, at the step;
        None: there is none."""
        if self.step is None:
            return None, None
        return step_errors(self.model, self.craft.point, self.step, self.embedded)
