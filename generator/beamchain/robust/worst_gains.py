"""The worst gain of a controller on an uncertain plant: results."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from beamchain import report, robust
from beamchain.robust.bounds import GainBound
from beamchain.toolkit import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class WorstCase:
    """The worst that a controller meets in an uncertain plant,
    from a disturbance at an input to an output.

    Args:
        input, output, unit: what is driven, what is seen, and the unit of gains.
        omega: `(k,)` [rad/s].
        nominal, worst: `(k,)` gain of the nominal plant and of the worst sample.
        drawn: `(n,)` peak gains of samples from the distributions;
        infinite where one is unstable.
        deltas, values: of the worst sample.
        gain: peak gain of the worst sample; infinite where the loop becomes unstable.
        frequency: where the peak is [rad/s]; where the loop becomes unstable, that at which it
            begins to ring on the way from the nominal values to the worst ones; 0 where it begins
            to drift away, without ringing.
        simulated: the same gain in a run of MuJoCo at that frequency; NaN where there is none.
        nominal_values, percent: of every quantity, and where the worst value lies in its range,
            -100 to 100, 0 the nominal one.
        value_units: of the quantities.
        bound: what no value exceeds; None where it was not asked for, or the worst sample is
            unstable.
        pose: of the craft, one of several; empty where there is one.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> from beamchain.spec import Controller, Loop, Uncertain, Uncertainty
        >>> tenth = Uncertain(frequency=Uncertainty(relative=0.1, distribution="uniform"))
        >>> segment = bc.Segment(length=8.0, section=section)
        >>> boom = bc.Spec(segment=(segment,), damping=bc.Damping(ratio=0.01), uncertain=tenth)
        >>> plant = bc.plant(bc.embed(craft, {"mount": boom}), ["torque:bus"], ["attitude"])
        >>> uncertain = robust.uncertain(plant)
        >>> loops = [
        ...     Loop(
        ...         input=f"torque_{a}",
        ...         output=f"attitude_{a}",
        ...         numerator=(600.0, 60.0),
        ...         denominator=(0.05, 1.0),
        ...     )
        ...     for a in "xyz"
        ... ]
        >>> controller = Controller(loop=tuple(loops))
        >>> worst = uncertain.worst_case(
        ...     controller, "torque_z", "attitude_z", samples=5, simulate=False
        ... )
        >>> worst.stable, float(worst.drawn.max()) <= worst.gain
        (True, True)
    """

    input: str
    output: str
    unit: str
    omega: Array
    nominal: Array
    worst: Array
    drawn: Array
    deltas: Array
    values: Mapping[str, float]
    gain: float
    frequency: float
    simulated: float
    nominal_values: Mapping[str, float]
    percent: Mapping[str, float]
    value_units: Mapping[str, str]
    bound: GainBound | None = None
    pose: str = ""

    def __repr__(self) -> str:
        return f"<WorstCase, {self.sentence}>"

    @property
    def stable(self) -> bool:
        """Whether no sample was found unstable."""
        return bool(np.isfinite(self.gain))

    @property
    def sentence(self) -> str:
        """The finding in a sentence."""
        where = f"{self.pose}: " if self.pose else ""
        if not self.stable:
            how = f"ring at {self.frequency:.4g} rad/s" if self.frequency else "drift away"
            return (
                f"{where}unstable for some values of the uncertain quantities; on the way to them "
                f"from the nominal ones the loop begins to {how}"
            )
        seen = "" if np.isnan(self.simulated) else f", {self.simulated:.4g} in MuJoCo"
        above = "" if self.bound is None else f"; {self.bound.sentence}"
        return (
            f"{where}{self.input} to {self.output}: worst sample {self.gain:.4g} {self.unit} at "
            f"{self.frequency:.4g} rad/s{seen}{above}"
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON; None where something is not finite."""
        record = {
            "input": self.input,
            "output": self.output,
            "unit": self.unit,
            "stable": self.stable,
            "gain": self.gain,
            "frequency": self.frequency,
            "simulated": self.simulated,
            "pose": self.pose,
        }
        finite = {
            key: None if isinstance(value, float) and not np.isfinite(value) else value
            for key, value in record.items()
        }
        bound = None if self.bound is None else self.bound.as_dict()
        rows = self.table.records()
        return {**finite, "values": dict(self.values), "quantities": rows, "bound": bound}

    @property
    def table(self) -> "report.Table":
        """The worst values beside the nominal ones, in percent of their ranges."""
        return robust.tables.worst_value_table(self)

    def _repr_html_(self) -> str:
        return report.table_html(self.table, [self.sentence])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Gains over frequency: worst sample, nominal, and the peak in MuJoCo.
        Returns the axes; shows nothing.

        Args:
            ax: drawn into; those of a new figure where left out.
        """
        return robust.plots.plot_worst(self, ax=ax)


@dataclass(frozen=True, eq=False, repr=False)
class WorstCases:
    """A worst case at every pose of a craft.

    Args:
        cases: one per pose.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> len(robust.WorstCases(()))
        0
    """

    cases: tuple[WorstCase, ...]

    def __repr__(self) -> str:
        return f"<WorstCases, {len(self)} poses; {self.worst.sentence}>"

    def __len__(self) -> int:
        return len(self.cases)

    def __getitem__(self, number: int) -> WorstCase:
        return self.cases[number]

    def __iter__(self) -> Iterator[WorstCase]:
        return iter(self.cases)

    @property
    def labels(self) -> tuple[str, ...]:
        """The poses."""
        return tuple(case.pose for case in self.cases)

    @property
    def worst(self) -> WorstCase:
        """That of the largest gain, with its pose."""
        return max(self.cases, key=lambda case: case.gain)

    @property
    def stable(self) -> bool:
        """Whether no sample was found unstable at any pose."""
        return all(case.stable for case in self.cases)

    @property
    def table(self) -> "report.Table":
        """The worst gains, pose by pose."""
        return robust.tables.worst_table(self.cases)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"worst": self.worst.pose, "cases": [case.as_dict() for case in self.cases]}

    def _repr_html_(self) -> str:
        return report.table_html(self.table, [self.worst.sentence])
