"""What a plant was made of, so that it can be made again with other numbers."""

from dataclasses import replace
from typing import NamedTuple

from beamchain.craft.embedded import Embedded
from beamchain.craft.linear_craft import LinearCraft
from beamchain.engine.combinations import InputNames, OutputNames, inputs_of, outputs_of
from beamchain.engine.library import mujoco
from beamchain.engine.linear import linear_at
from beamchain.engine.operating_point import OperatingPoint


class PlantSource(NamedTuple):
    """What a plant was made of.

    Args:
        craft: linear, in the plant's pose.
        inputs, outputs: as `bc.plant` was given them, allocations with the commands that they have
            there.
        embedded: what was linearised; None of a plain model.
        loaded: whether the craft is under its load.
    """

    craft: LinearCraft
    inputs: InputNames
    outputs: OutputNames
    embedded: Embedded | None = None
    loaded: bool = False

    def again(self, model: "mujoco.MjModel") -> LinearCraft:
        """The same of a model with other numbers, at the same point."""
        point = OperatingPoint(model, self.craft.point.qpos, self.craft.point.qvel)
        driven = inputs_of(point, self.inputs)
        seen = outputs_of(point, self.outputs)
        linear = linear_at(point, driven, seen)
        return replace(
            self.craft, linear=linear, inputs=tuple(driven), outputs=tuple(seen), point=point
        )
