"""What a spec does not know exactly: the table [uncertain] of SPEC.toml, and numbers drawn from it."""

from typing import Annotated, Literal

import numpy as np
from scipy.special import ndtr

from beamchain.checks import Struct, field
from beamchain.errors import InputError

CUT = 3.0  # normal draws end here, in standard deviations: a tail would ask for negative stiffness
ONLY_RELATIVE = ("stiffness", "density")


class Uncertainty(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How a quantity varies: `relative` or `absolute`, one of the two."""

    relative: Annotated[
        float | None,
        field("standard deviation (normal, cut at three) or half width (uniform) over the value", "", above=0.0),
    ] = None
    absolute: Annotated[
        float | None,
        field(
            "standard deviation (normal, cut at three) or half width (uniform), in the unit of the quantity",
            "",
            above=0.0,
        ),
    ] = None
    distribution: Annotated[Literal["normal", "uniform"], field("distribution")] = "normal"
    each: Annotated[bool, field("every segment, joint, lump or mode draws for itself; else all of them together")] = (
        False
    )
    group: Annotated[str, field("quantities with the same group draw together, fully correlated")] = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.relative is None) == (self.absolute is None):
            raise InputError(
                "an uncertain quantity takes either relative or absolute; write for example { relative = 0.05 }."
            )
        if self.relative is not None and self.relative >= 1.0:
            raise InputError(f"relative = {self.relative!r} would turn the quantity negative; give less than 1.")
        if self.group and self.each:
            raise InputError(f'group = "{self.group}" and each = true contradict each other; leave one out.')

    def value(self, nominal: float, score: float) -> float:
        """The quantity for a standard normal `score`."""
        reach = float(np.clip(score, -CUT, CUT)) if self.distribution == "normal" else 2.0 * float(ndtr(score)) - 1.0
        return (
            nominal * (1.0 + self.relative * reach)
            if self.relative is not None
            else nominal + reach * (self.absolute or 0.0)
        )


class Uncertain(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The table [uncertain]; what is left out is certain."""

    stiffness: Annotated[Uncertainty | None, field("elastic stiffness of all segments (EI, GJ, EA); relative only")] = (
        None
    )
    density: Annotated[
        Uncertainty | None, field("mass per length of all segments, nonstructural mass included; relative only")
    ] = None
    damping: Annotated[Uncertainty | None, field("damping ratios of the modes")] = None
    payload: Annotated[Uncertainty | None, field("mass of the payload at the tip [kg]; its inertia in proportion")] = (
        None
    )
    lump: Annotated[Uncertainty | None, field("masses of the lumps [kg]; their inertia in proportion")] = None
    joint_stiffness: Annotated[Uncertainty | None, field("stiffness of the compliant hinge lines [N m/rad]")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ONLY_RELATIVE:
            given = getattr(self, name)
            if given is not None and given.relative is None:
                raise InputError(f"{name} takes relative only, because segments differ; write relative = 0.05.")

    def scores(self, seed: int, index: int, counts: dict[str, int]) -> dict[str, list[float]]:
        """Standard normal scores of sample `index`: per quantity `counts[name]` of them, equal where drawn together.

        A sample's scores depend on nothing but seed and index, so that any machine draws the same.
        """
        out: dict[str, list[float]] = {}
        groups: dict[str, float] = {}
        for number, name in enumerate(self.__struct_fields__):
            given: Uncertainty | None = getattr(self, name)
            if given is None:
                continue
            draw = np.random.default_rng([seed, index, number])
            if given.each:
                out[name] = draw.standard_normal(counts[name]).tolist()
            else:
                own = float(draw.standard_normal())
                score = groups.setdefault(given.group, own) if given.group else own
                out[name] = [score] * counts[name]
        return out
