"""What was recovered inside an appendage: histories, stresses and extremes."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamchain import report
from beamchain.checks import finite_array
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.sections_at import Sections

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NOTHING = "nothing"  # where a value is zero


class Extreme(NamedTuple):
    """The smallest and the largest value of a quantity in a run."""

    quantity: str  #: such as "moment z"
    unit: str  #: of the values
    x: float | None  #: station [m]; None where there is none
    smallest: float  #: value
    smallest_at: float  #: time [s]
    smallest_from: str  #: the mode that contributes most there
    largest: float  #: value
    largest_at: float  #: time [s]
    largest_from: str  #: the mode that contributes most there


@dataclass(frozen=True, eq=False)
class History:
    """One recovered quantity with its components.

    Args:
        name: of the quantity.
        parts: names of its c components; empty names where it has one.
        units: of each component.
        values: `(t, s, c)` at instants and stations.
        factors: `(s, c, n)` what each kept mode adds per unit of its coordinate.
        follows: the coordinate: "amplitudes", or "accelerations" of the modes.
        rest: what the part comes from that the kept modes do not make.
        x: `(s,)` stations [m]; empty where there are none.
    """

    name: str
    parts: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    factors: Array
    follows: str
    rest: str
    x: Array

    def label(self, part: int) -> str:
        """Name of a component."""
        return f"{self.name} {self.parts[part]}".strip()


@dataclass(frozen=True, eq=False, repr=False)
class Recovery:
    """What a run did inside an appendage.

    Arrays are over t instants and s stations; vectors are in the axes of the root, x outwards.
    Loads at a station are those of what lies beyond it on what lies before it.

    Args:
        place: of the appendage.
        time: `(t,)` [s].
        x: `(s,)` stations [m]; empty for imported modes.
        modes: names of the n kept modes.
        amplitudes: `(t, n)` their coordinates [sqrt(kg) m].
        accelerations: `(t, n)` of these.
        histories: recovered quantities by name.
        static: whether the static part of the modes left out was added.
        sections: of the beam at the stations, with NaN where they are not drawn.
        names: of the rows of imported modes.
        in_file: numbers of the kept modes in their file, from 1; empty for a beam, or where other
            modes than the file's are kept.

    Example:
        >>> import beamchain as bc, mujoco
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> flexible = bc.embed(craft, {"mount": spec})
        >>> data = mujoco.MjData(flexible.model)
        >>> data.qfrc_applied[5] = 1.0  # torque about z
        >>> loads = flexible.recover(data, "mount", x=[0.0, 4.0])
        >>> loads.moment.shape
        (1, 2, 3)
        >>> bool(abs(loads.moment[0, 0, 2] / loads.root_moment[0, 2] - 1.0) < 1e-6)
        True
    """

    place: str
    time: Array
    x: Array
    modes: tuple[str, ...]
    amplitudes: Array
    accelerations: Array
    histories: Mapping[str, History]
    static: bool
    sections: Sections | None = None
    names: tuple[str, ...] = ()
    in_file: tuple[int, ...] = ()

    def __repr__(self) -> str:
        return (
            f"<Recovery at {self.place!r}, {self.time.size} instants, {self.x.size} stations, "
            f"{len(self.modes)} modes>"
        )

    def _repr_html_(self) -> str:
        return report.table_html(report.recovery_table(self))

    @property
    def root_force(self) -> Array:
        """`(t, 3)` force that the appendage puts on what carries it, in the mount's axes [N]."""
        return self.histories["root force"].values[:, 0]

    @property
    def root_moment(self) -> Array:
        """`(t, 3)` its moment about the mount [N m]."""
        return self.histories["root moment"].values[:, 0]

    @property
    def force(self) -> Array:
        """`(t, s, 3)` axial force and shear forces [N]."""
        return self._of_beam("force")

    @property
    def moment(self) -> Array:
        """`(t, s, 3)` torsion and bending moments [N m]."""
        return self._of_beam("moment")

    @property
    def displacement(self) -> Array:
        """`(t, s, 3)` elastic displacement of the axis against the root [m]."""
        return self._of_beam("displacement")

    @property
    def rotation(self) -> Array:
        """`(t, s, 3)` elastic rotation against the root [rad]."""
        return self._of_beam("rotation")

    @property
    def acceleration(self) -> Array:
        """`(t, s, 3)` acceleration of the axis in space [m/s^2]."""
        return self._of_beam("acceleration")

    @property
    def angular_acceleration(self) -> Array:
        """`(t, s, 3)` angular acceleration of the section in space [rad/s^2]."""
        return self._of_beam("angular acceleration")

    @property
    def stress(self) -> Array:
        """`(t, s, 2)` largest and smallest normal stress in the section [N/m^2];
        NaN where its outline is not known."""
        self._of_beam("force")
        assert self.sections is not None
        return self.sections.extreme_stress(self.force, self.moment)

    def stress_at(self, y: float, z: float) -> Array:
        """`(t, s)` normal stress of the fibre at y, z of the section [N/m^2];
        NaN where the section is not drawn.

        `N / A - M_z y / I_z + M_y z / I_y`

        Args:
            y: of the fibre [m].
            z: of the fibre [m].
        """
        self._of_beam("force")
        assert self.sections is not None
        place = finite_array("y and z", (y, z), (2,), unit="m")
        return self.sections.stress(self.force, self.moment, place[0], place[1])

    @property
    def rows(self) -> Array:
        """`(t, r)` what the recovery rows of imported modes give, in their order."""
        if not self.names:
            raise InputError(
                f"there are no recovery rows for the appendage at {self.place}; give them as "
                "rows=..., or as recovery in [imported]."
            )
        return np.stack([self.histories[name].values[:, 0, 0] for name in self.names], axis=1)

    def _of_beam(self, name: str) -> Array:
        if name not in self.histories:
            raise InputError(
                f"the appendage at {self.place} is imported modes, which know no {name} along x; "
                "give recovery rows."
            )
        return self.histories[name].values

    @property
    def extremes(self) -> tuple[Extreme, ...]:
        """Smallest and largest value of every component at every station, when, and the mode
        that contributes most."""
        out: list[Extreme] = []
        for history in self.histories.values():
            for part, s in product(range(len(history.parts)), range(history.values.shape[1])):
                values, factors = history.values[:, s, part], history.factors[s, part]
                low, high = (
                    self._end(history, factors, int(t), values[t])
                    for t in (np.argmin(values), np.argmax(values))
                )
                x = float(history.x[s]) if history.x.size else None
                out.append(Extreme(history.label(part), history.units[part], x, *low, *high))
        return (*out, *self._stress_extremes())

    def _stress_extremes(self) -> list[Extreme]:
        if self.sections is None:
            return []
        stress, force, moment = self.stress, self.histories["force"], self.histories["moment"]
        out: list[Extreme] = []
        for s in np.flatnonzero(~np.isnan(stress[0, :, 0])).tolist():
            by_load = np.concatenate([force.factors[s], moment.factors[s]])
            ends: list[tuple[float, float, str]] = []
            for sign, values in ((-1.0, stress[:, s, 1]), (1.0, stress[:, s, 0])):
                t = int(np.argmax(sign * values))
                # what the modes do in the fibre where it is largest
                fibre = self.sections.fibre(s, moment.values[t, s], sign)
                factors = self.sections.per_load(s, *fibre) @ by_load
                ends.append(self._end(force, factors, t, values[t]))
            out.append(Extreme("stress", "N/m^2", float(self.x[s]), *ends[0], *ends[1]))
        return out

    def _end(
        self, history: History, factors: Array, t: int, value: float
    ) -> tuple[float, float, str]:
        """A value at an instant, its time, and the mode, or the rest, that makes most of it."""
        parts = factors * getattr(self, history.follows)[t]
        every = np.abs([*parts, value - np.sum(parts)])
        names = (*self.modes, history.rest)
        origin = names[int(np.argmax(every))] if np.max(every) > 0.0 else NOTHING
        return float(value), float(self.time[t]), origin

    @property
    def table(self) -> Any:
        """The `Table` of extremes, each component at the station where it is largest."""
        return report.recovery_table(self)

    def as_dict(self) -> dict[str, Any]:
        """Place, stations, modes and extremes, for JSON."""
        return report.recovery_record(self)

    def plot(
        self, quantity: str = "root moment", ax: "Axes | None" = None, part: str | None = None
    ) -> "Axes":
        """Plot a quantity over time. Returns the axes; shows nothing.

        Args:
            quantity: "root force", "root moment", "force", "moment", "displacement", "rotation",
                "acceleration", "angular acceleration" or "stress"; or the name of a row.
            ax: axes to draw into; default: a new figure.
            part: component, "x", "y" or "z"; default: the one that is largest.

        Raises:
            InputError: there is no such quantity or component.
        """
        return report.plot_recovery(self, quantity, ax=ax, part=part)
