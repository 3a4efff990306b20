"""What a spec does not know exactly: the table [uncertain] of SPEC.toml, and numbers drawn from it."""

from typing import Literal

import numpy as np
from scipy.special import ndtr

from beamchain.checks import Struct, one_of, own_numbers, positive
from beamchain.errors import InputError

CUT = 3.0  # normal draws end here, in standard deviations: a tail would ask for negative stiffness
ONLY_RELATIVE = ("stiffness", "density")


class Uncertainty(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How a quantity varies: `relative` or `absolute` (in the quantity's own unit), one of the two.

    Args:
        relative, absolute: standard deviation ("normal", cut at three) or half width ("uniform").
        distribution: "normal" or "uniform".
        each: every segment, joint, lump or mode draws for itself; else all of them together.
        group: quantities with the same group draw together, fully correlated.
    """

    relative: float | None = None
    absolute: float | None = None
    distribution: Literal["normal", "uniform"] = "normal"
    each: bool = False
    group: str = ""

    def __post_init__(self) -> None:
        own_numbers(self)
        one_of("distribution", self.distribution, ("normal", "uniform"))
        if (self.relative is None) == (self.absolute is None):
            raise InputError(
                "an uncertain quantity takes either relative or absolute; write for example { relative = 0.05 }."
            )
        if self.relative is not None and positive("relative", self.relative, "") >= 1.0:
            raise InputError(f"relative = {self.relative!r} would turn the quantity negative; give less than 1.")
        if self.absolute is not None:
            positive("absolute", self.absolute, "")
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
    """The table [uncertain]; what is left out is certain.

    Args:
        stiffness: all elastic stiffness of the segments (EI, GJ, EA), relative.
        density: mass per length, nonstructural mass included, relative.
        damping: ratios of the modes.
        payload: mass of the payload at the tip [kg]; its inertia in proportion.
        lump: masses carried along the way [kg]; their inertia in proportion.
        joint_stiffness: compliant hinge lines [N m/rad], relative best.
    """

    stiffness: Uncertainty | None = None
    density: Uncertainty | None = None
    damping: Uncertainty | None = None
    payload: Uncertainty | None = None
    lump: Uncertainty | None = None
    joint_stiffness: Uncertainty | None = None

    def __post_init__(self) -> None:
        own_numbers(self)
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
