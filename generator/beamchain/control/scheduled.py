"""Plants in several poses: one order of states, modes followed from pose to pose by their
shapes."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from beamchain import report
from beamchain.control.export import write_arrays
from beamchain.control.realisation import Plant
from beamchain.craft.linear_craft import LinearCraft
from beamchain.craft.modal_form import ModalForm
from beamchain.craft.poses import Way
from beamchain.engine.normal_modes import NormalModes
from beamchain.ports.motions import Array, locked

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# least modal assurance between neighbouring poses; below it the pose between is looked at
ALIKE = 0.9
# rad or m between poses: never more, and below which modes are taken as they are
WIDEST, FINEST = 0.1, 0.02


@dataclass(frozen=True, eq=False, repr=False)
class ScheduledPlant:
    """A plant per pose, all with the same states.

    Args:
        plants: one per pose; `scheduled[i]` is one of them.
        labels: what the poses are called: joints in degrees or metres, keyframes by name.
        joints: names of the joints that the poses name or that move between them.
        units: of their positions, `rad` or `m`.
        values: `(k, joints)` positions of these joints [rad, m].
        joint: the one joint of a grid `pose={joint: [angles]}`; None of a list of poses.

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
        ...     bc.embed(craft, {"mount": spec}), ["torque:bus"], pose={"drive": [0.0, 0.8, 1.6]}
        ... )
        >>> len(scheduled), scheduled.matrices()[0].shape[0], scheduled[1].dt
        (3, 3, 0)
        >>> scheduled.labels
        ('drive 0°', 'drive 45.8366°', 'drive 91.6732°')
    """

    plants: tuple[Plant, ...]
    labels: tuple[str, ...]
    joints: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    joint: str | None = None

    def __repr__(self) -> str:
        few = ", ".join(repr(label) for label in self.labels[:3])
        more = ", ..." if len(self) > 3 else ""
        return f"<ScheduledPlant, {len(self)} poses ({few}{more}), {self.plants[0]!r:.200}>"

    def __len__(self) -> int:
        return len(self.plants)

    def __getitem__(self, number: int) -> Plant:
        return self.plants[number]

    def __iter__(self) -> Iterator[Plant]:
        return iter(self.plants)

    @property
    def angles(self) -> Array | None:
        """`(k,)` [rad] of the joint of a grid; None of a list of poses."""
        return None if self.joint is None else self.values[:, self.joints.index(self.joint)]

    @property
    def grid(self) -> tuple[Array, str] | None:
        """`(k,)` positions of the joint of a grid as they are read, and their unit, degrees or m;
        None of a list of poses."""
        if self.joint is None or self.angles is None:
            return None
        if self.units[self.joints.index(self.joint)] == "m":
            return self.angles, "m"
        return np.degrees(self.angles), "degrees"

    @property
    def modes(self) -> tuple[str, ...]:
        """Names of the flexible modes that oscillate in any pose, those of the first pose first."""
        return tuple(dict.fromkeys(name for plant in self.plants for name in plant.modes))

    @property
    def frequency(self) -> Array:
        """`(k, modes)` [rad/s]; NaN where a mode does not oscillate in a pose."""
        return self._of_modes("frequency", np.nan)

    @property
    def damping_ratio(self) -> Array:
        """`(k, modes)`; NaN where a mode does not oscillate in a pose."""
        return self._of_modes("damping_ratio", np.nan)

    @property
    def gain(self) -> Array:
        """`(k, modes, outputs, inputs)` modal gains, see `Plant.gain`; 0 where a mode does not
        oscillate in a pose."""
        return self._of_modes("gain", 0.0)

    def _of_modes(self, what: str, without: float) -> Array:
        """`(k, modes, ...)` of each plant's modes, in one order."""
        names = self.modes
        out = np.full((len(self), len(names), *getattr(self[0], what).shape[1:]), without)
        for values, plant in zip(out, self.plants, strict=True):
            values[[names.index(name) for name in plant.modes]] = getattr(plant, what)
        return locked(out)

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C and D, each `(k, ...)`."""
        a, b, c, d = (locked([getattr(plant, name) for plant in self.plants]) for name in "ABCD")
        return a, b, c, d

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Frequencies of the modes over the poses, or the angle of a grid, as thick as their gain.
        Returns the axes; shows nothing.

        Args:
            ax: drawn into; those of a new figure where left out.
        """
        return report.plot_scheduled(self, ax=ax)

    def write(
        self, path: str | Path, *, force: bool = False, also: Mapping[Path, str] | None = None
    ) -> Path:
        """Write all plants to one `.npz`, `.json` or `.mat`, see `Plant.write`;
        in `.mat` the pose is the last index.

        `PoseLabel` are the labels, `Pose` `(k, joints)` the positions of `PoseJoint`; of a grid
        there are also `Joint` and its `Angle`.

        Args:
            path: its ending says the format.
            force: replace a file that exists.
            also: further files to write with it, content by path; all or none.
        """
        record = self.plants[0].record() | dict(zip("ABCD", self.matrices(), strict=True))
        record |= {"ModeName": list(self.modes)}
        record |= {"Frequency": self.frequency, "DampingRatio": self.damping_ratio}
        record |= {"PoseLabel": list(self.labels), "Pose": self.values}
        record |= {"PoseJoint": list(self.joints), "PoseUnit": list(self.units)}
        if self.joint is not None:
            record |= {"Angle": self.angles, "Joint": self.joint}
        return write_arrays(path, record, force=force, also=also)


def follow(
    crafts: "Sequence[LinearCraft]", between: "Callable[[Array], NormalModes]"
) -> list[NormalModes]:
    """The normal modes of a craft in one pose after the other, in the order and with the signs of
    the first pose.

    From a pose to the next all joints move together; `between` gives the modes at positions on
    the way.
    """
    out = [crafts[0].modes]
    for before, after in pairwise(crafts):
        way = Way.between(after.point.model, before.point.qpos, after.point.qpos)
        out.append(_follow(way, between, out[-1], after.modes, (0.0, 1.0)))
    return out


def _follow(
    way: Way,
    between: "Callable[[Array], NormalModes]",
    known: NormalModes,
    new: NormalModes,
    part: tuple[float, float],
) -> NormalModes:
    """The modes at the end of a part of the way in the order of those known at its start, by way
    of its middle where they differ much."""
    overlap = known.shapes.T @ ((known.mass + new.mass) / 2.0) @ new.shapes
    rows, columns = linear_sum_assignment(-np.abs(overlap))
    alike = float(np.min(np.abs(overlap[rows, columns]) ** 2, initial=1.0)) >= ALIKE
    start, end = part
    if way.length * (end - start) > (WIDEST if alike else FINEST):
        middle = (start + end) / 2.0
        halfway = _follow(way, between, known, between(way.at(middle)), (start, middle))
        return _follow(way, between, halfway, new, (middle, end))
    return new.ordered([int(i) for i in columns], np.where(overlap[rows, columns] < 0.0, -1.0, 1.0))


def in_one_order(forms: "Sequence[ModalForm]") -> "list[ModalForm] | None":
    """The forms with their states in the order of the first; None where their states differ, since
    a pole that oscillates in one pose is real in another."""
    names = forms[0].names
    if any(set(form.names) != set(names) for form in forms):
        return None
    return [form.picked([form.names.index(name) for name in names], form.rigid) for form in forms]


def reduced_alike(forms: "Sequence[ModalForm]") -> list[ModalForm]:
    """Of forms with the same states those that something drives and something sees in any of
    them."""
    keep = np.any([form.active() for form in forms], axis=0)
    return [form.reduced(keep) for form in forms]
