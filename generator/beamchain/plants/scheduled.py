"""Plants over the angles of a drive: one order of states,
modes followed from angle to angle by their shapes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from beamchain import report
from beamchain.craft.linear_craft import LinearCraft
from beamchain.engine.normal_modes import NormalModes
from beamchain.fitting.uncertain import UncertainCraft
from beamchain.plants.controllers import Controller
from beamchain.plants.export import write
from beamchain.plants.realisation import Plant
from beamchain.plants.uncertain_plant import UncertainPlant, WorstCases
from beamchain.plants.worst_margins import WorstMargins
from beamchain.ports.motions import Array, locked

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# least modal assurance between neighbouring angles; below it the angle between is looked at
ALIKE = 0.9
# rad between angles: never more, and below which modes are taken as they are
WIDEST, FINEST = 0.1, 0.02


@dataclass(frozen=True, eq=False, repr=False)
class ScheduledPlant:
    """A plant per angle of a joint, all with the same states.

    Args:
        joint: name.
        angles: `(k,)` [rad].
        plants: one per angle; `scheduled[i]` is one of them.

    Example:
        >>> import beamchain as bc
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <body name="yoke" pos="0.5 0 0"><joint name="drive" axis="1 0 0" stiffness="1e4"/>
        ... <inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/><site name="mount"/></body></body>
        ... </worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(
        ...     segment=(bc.Segment(length=8.0, section=section),), modes=bc.Modes(xy=1, xz=0)
        ... )
        >>> scheduled = bc.plant(
        ...     bc.embed(craft, {"mount": spec}), ["torque:bus"], at={"drive": [0.0, 0.8, 1.6]}
        ... )
        >>> len(scheduled), scheduled.matrices()[0].shape[0], scheduled[1].dt
        (3, 3, 0)
    """

    joint: str
    angles: Array
    plants: tuple[Plant, ...]

    def __repr__(self) -> str:
        return (
            f"<ScheduledPlant, {len(self.plants)} angles of {self.joint!r}, "
            f"{self.plants[0]!r:.200}>"
        )

    def __len__(self) -> int:
        return len(self.plants)

    def __getitem__(self, number: int) -> Plant:
        return self.plants[number]

    @property
    def modes(self) -> tuple[str, ...]:
        """Names of the flexible modes, those at the first angle."""
        return self.plants[0].modes

    @property
    def frequency(self) -> Array:
        """`(k, modes)` [rad/s]."""
        return locked([plant.frequency for plant in self.plants])

    @property
    def damping_ratio(self) -> Array:
        """`(k, modes)`."""
        return locked([plant.damping_ratio for plant in self.plants])

    @property
    def gain(self) -> Array:
        """`(k, modes, outputs, inputs)` modal gains, see `Plant.gain`."""
        return locked([plant.gain for plant in self.plants])

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C and D, each `(k, ...)`."""
        a, b, c, d = (locked([getattr(plant, name) for plant in self.plants]) for name in "ABCD")
        return a, b, c, d

    def uncertain(
        self, uncertain: "UncertainCraft | str | Path | None" = None
    ) -> tuple[UncertainPlant, ...]:
        """An uncertain plant per angle, see `Plant.uncertain`;
        their states are in an order of their own."""
        return tuple(plant.uncertain(uncertain) for plant in self.plants)

    @property
    def labels(self) -> tuple[str, ...]:
        """What the poses are called."""
        return tuple(f"{self.joint} {np.degrees(angle):.4g}°" for angle in self.angles)

    def worst_case(
        self,
        uncertain: "UncertainCraft | str | Path | None",
        controller: "Controller | str | Path",
        input: str | None = None,
        output: str | None = None,
        omega: "ArrayLike | None" = None,
        **options: Any,
    ) -> WorstCases:
        """The worst case at every pose: the poses are a grid, the quantities take all values at
        each.

        Args:
            uncertain: what is uncertain, as of `uncertain`.
            controller, input, output, omega, options: as of `UncertainPlant.worst_case`.

        Raises:
            InputError: as of `UncertainPlant.worst_case`.
        """
        cases = [
            replace(plant.worst_case(controller, input, output, omega, **options), pose=label)
            for plant, label in zip(self.uncertain(uncertain), self.labels, strict=True)
        ]
        return WorstCases(tuple(cases))

    def worst_margins(
        self,
        uncertain: "UncertainCraft | str | Path | None",
        controller: "Controller | str | Path",
        **options: Any,
    ) -> tuple[WorstMargins, ...]:
        """The least margins at every pose, see `UncertainPlant.worst_margins`."""
        return tuple(
            replace(plant.worst_margins(controller, **options), pose=label)
            for plant, label in zip(self.uncertain(uncertain), self.labels, strict=True)
        )

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Frequencies of the modes over the angle, as thick as their gain.
        Returns the axes; shows nothing.

        Args:
            ax: drawn into; those of a new figure where left out.
        """
        return report.plot_scheduled(self, ax=ax)

    def write(
        self, path: str | Path, *, force: bool = False, also: Mapping[Path, str] | None = None
    ) -> Path:
        """Write all plants to one `.npz`, `.json` or `.mat`, see `Plant.write`;
        in `.mat` the angle is the last index.

        Args:
            path: its ending says the format.
            force: replace a file that exists.
            also: further files to write with it, content by path; all or none.
        """
        record = self.plants[0].record() | dict(zip("ABCD", self.matrices(), strict=True))
        record |= {"Frequency": self.frequency, "DampingRatio": self.damping_ratio}
        record |= {"Angle": self.angles, "Joint": self.joint}
        return write(path, record, force=force, also=also)


def follow(
    craft: "Callable[[float], LinearCraft]", angles: Array
) -> list[tuple[LinearCraft, NormalModes]]:
    """The craft at every angle `(k,)` [rad],
    and its normal modes in the order and with the signs of the first."""
    first = craft(float(angles[0]))
    out = [(first, first.modes)]
    for before, after in zip(angles[:-1], angles[1:], strict=True):
        there = craft(float(after))
        out.append((there, _follow(craft, out[-1][1], there, float(before), float(after))))
    return out


def _follow(
    craft: "Callable[[float], LinearCraft]",
    known: NormalModes,
    there: LinearCraft,
    before: float,
    after: float,
) -> NormalModes:
    """The modes at `after` in the order of those known at `before`,
    by way of the angle between where they differ much."""
    new = there.modes
    overlap = known.shapes.T @ ((known.mass + new.mass) / 2.0) @ new.shapes
    rows, columns = linear_sum_assignment(-np.abs(overlap))
    alike = float(np.min(np.abs(overlap[rows, columns]) ** 2, initial=1.0)) >= ALIKE
    if abs(after - before) > (WIDEST if alike else FINEST):
        middle = (before + after) / 2.0
        between = craft(middle)
        halfway = _follow(craft, known, between, before, middle)
        return _follow(craft, halfway, there, middle, after)
    return new.ordered([int(i) for i in columns], np.where(overlap[rows, columns] < 0.0, -1.0, 1.0))
