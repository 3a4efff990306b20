"""Loads, stresses, displacements and accelerations inside an appendage, recovered from a run.

Theory: docs/theory.md, section 10.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beamchain import report
from beamchain.checks import finite_array, of_type, unknown
from beamchain.craft.appendage import Appendage
from beamchain.craft.recovered_body import (
    BeamBody,
    Coordinates,
    Place,
    beam_body,
    imported_body,
    place_of,
)
from beamchain.engine.library import mujoco
from beamchain.engine.root_motion import STATE, Motion, RootMotion, Run, motion_of
from beamchain.errors import InputError
from beamchain.ports.motions import PORT_MOTION, Array
from beamchain.steps.modal import TREE, modal_tendons
from beamchain.steps.retime import without_timing
from beamchain.steps.step_map import at_step_of
from beamchain.structure.beam import Beam
from beamchain.structure.readers.recovery_file import read_recovery
from beamchain.structure.recovery_rows import RecoveryRows
from beamchain.structure.section_loads import BEYOND, Inside, snapped
from beamchain.structure.sections_at import Sections, sections_at

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AXES = ("x", "y", "z")
STATIONS = 5  # evenly spaced from root to tip, where none are given
MOST_STATIONS = 1000
MOST_KNOWN = 16  # beams at their stations that are kept for further calls
STATIC = "modes left out"  # what a value comes from that no kept mode makes
CARRIED = "rigid motion and modes left out"
NOTHING = "nothing"  # where a value is zero
RIGID = "motion of the root"


# -- histories -------------------------------------------------------------------------------------
class Recorder:
    """Complete states of a run, one per call; `Embedded.recover` takes it in place of data.

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
        >>> record = flexible.recorder()
        >>> for _ in range(100):
        ...     record(data)
        ...     mujoco.mj_step(flexible.model, data)
        >>> len(record)
        100
    """

    def __init__(self, model: "mujoco.MjModel") -> None:
        self._model = model
        self._size = int(mujoco.mj_stateSize(model, STATE))
        self._time: list[float] = []
        self._states: list[Array] = []

    def __call__(self, data: "mujoco.MjData") -> None:
        """Record the state as it is, with the inputs that act in it.

        Call it where `ctrl` and applied forces are those of `data.time`: before the step.

        Raises:
            InputError: it is no MjData, or that of another model.
        """
        state = _state(self._model, data, self._size)
        self._time.append(float(data.time))
        self._states.append(state)

    def __len__(self) -> int:
        return len(self._time)

    def clear(self) -> None:
        """Forget what was recorded."""
        self._time.clear()
        self._states.clear()

    def run(self) -> Run:
        """What was recorded."""
        if not self._states:
            raise InputError(
                "the recorder has recorded nothing; call it with the data in every step: "
                "record(data)."
            )
        return Run(np.array(self._time), np.array(self._states), {})


def _state(model: "mujoco.MjModel", data: object, size: int) -> Array:
    of_type("data", data, mujoco.MjData, "the mujoco.MjData of the model with the appendages")
    assert isinstance(data, mujoco.MjData)
    if (data.qpos.size, data.qvel.size, data.ctrl.size) != (model.nq, model.nv, model.nu):
        raise InputError(
            f"data has {data.qpos.size} positions and {data.qvel.size} rates, the model with the "
            f"appendages {model.nq} and {model.nv}; give the data of embedded.model: "
            "mujoco.MjData(embedded.model)."
        )
    state = np.zeros(size)
    mujoco.mj_getState(model, data, state, STATE)
    return state


def run_of(model: "mujoco.MjModel", data: object) -> Run:
    """Instants from what a user gives: MjData, a `Recorder`, or arrays by name."""
    if isinstance(data, Recorder):
        return data.run()
    if isinstance(data, Mapping):
        return _run_of_arrays(model, data)
    state = _state(model, data, int(mujoco.mj_stateSize(model, STATE)))
    assert isinstance(data, mujoco.MjData)
    return Run(np.array([data.time]), state[None], {})


def _run_of_arrays(model: "mujoco.MjModel", given: "Mapping[Any, Any]") -> Run:
    shapes: dict[str, tuple[int, ...]] = {
        "qpos": (model.nq,),
        "qvel": (model.nv,),
        "qacc": (model.nv,),
        "ctrl": (model.nu,),
        "act": (model.na,),
        "qfrc_applied": (model.nv,),
        "xfrc_applied": (model.nbody, 6),
        "mocap_pos": (model.nmocap, 3),
        "mocap_quat": (model.nmocap, 4),
    }
    for name in given:
        if name not in (*shapes, "time"):
            raise unknown("an array of data", name, [*shapes, "time"])
    if "qpos" not in given:
        raise InputError(
            "data holds no qpos; give arrays by name: qpos (t, nq), qvel (t, nv), and qacc (t, nv) "
            "or ctrl (t, nu)."
        )
    arrays: dict[str, Array] = {}
    count = len(finite_array("qpos", given["qpos"], (None, model.nq)))
    for name, shape in shapes.items():
        if name in given:
            arrays[name] = finite_array(name, given[name], (count, *shape))
    if count == 0:
        raise InputError("data holds no instant; give at least one row of qpos.")
    time = given.get("time", float(model.opt.timestep) * np.arange(count))
    return Run(finite_array("time", time, (count,), unit="s"), None, arrays)


# -- results ---------------------------------------------------------------------------------------
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
        return report.recovery_html(self)

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
            for part in range(len(history.parts)):
                for s in range(history.values.shape[1]):
                    out.append(self._extreme(history, part, s))
        return (*out, *self._stress_extremes())

    def _extreme(self, history: History, part: int, s: int) -> Extreme:
        values = history.values[:, s, part]
        low, high = int(np.argmin(values)), int(np.argmax(values))
        origins = [
            self._origin(history.factors[s, part], history.follows, history.rest, t, values[t])
            for t in (low, high)
        ]
        return Extreme(
            history.label(part),
            history.units[part],
            float(history.x[s]) if history.x.size else None,
            float(values[low]),
            float(self.time[low]),
            origins[0],
            float(values[high]),
            float(self.time[high]),
            origins[1],
        )

    def _origin(self, factors: Array, follows: str, rest: str, t: int, value: float) -> str:
        """The mode, or the rest, that makes most of a value at an instant."""
        parts = factors * getattr(self, follows)[t]
        every = np.abs([*parts, value - np.sum(parts)])
        names = (*self.modes, rest)
        return names[int(np.argmax(every))] if np.max(every) > 0.0 else NOTHING

    def _stress_extremes(self) -> list[Extreme]:
        if self.sections is None:
            return []
        stress = self.stress
        out: list[Extreme] = []
        for s in np.flatnonzero(~np.isnan(stress[0, :, 0])).tolist():
            low, high = int(np.argmin(stress[:, s, 1])), int(np.argmax(stress[:, s, 0]))
            origins: list[str] = []
            for t, sign in ((low, -1.0), (high, 1.0)):
                # what the modes do in the fibre where it is largest
                fibre = self.sections.fibre(s, self.moment[t, s], sign)
                factors = self.sections.per_load(s, *fibre) @ np.concatenate(
                    [self.histories["force"].factors[s], self.histories["moment"].factors[s]]
                )
                value = stress[t, s, 0 if sign > 0.0 else 1]
                origins.append(self._origin(factors, "amplitudes", STATIC, t, value))
            out.append(
                Extreme(
                    "stress",
                    "N/m^2",
                    float(self.x[s]),
                    float(stress[low, s, 1]),
                    float(self.time[low]),
                    origins[0],
                    float(stress[high, s, 0]),
                    float(self.time[high]),
                    origins[1],
                )
            )
        return out

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


# -- recovery --------------------------------------------------------------------------------------
def appendage_at(appendages: Sequence[Appendage], place: object) -> Appendage:
    """The appendage at a place; None: the only one."""
    if place is None and len(appendages) == 1:
        return appendages[0]
    for appendage in appendages:
        if appendage.at == place:
            return appendage
    raise unknown("place", place, [a.at for a in appendages])


def recover(
    model: "mujoco.MjModel",
    appendages: Sequence[Appendage],
    data: object,
    *,
    place: object,
    x: ArrayLike | None,
    static: bool,
    rows: object,
    known: dict[tuple[str, bytes], BeamBody],
) -> Recovery:
    """What a run of a model did inside the appendage at a place; arguments as of
    `Embedded.recover`. `known`: beams by place and stations, which are dear, kept for the next."""
    appendage = appendage_at(appendages, place)
    if appendage.spec.slosh is not None:
        raise InputError(
            f"place = {appendage.at!r} is the liquid in a tank, which has no sections; read what "
            "it puts on the spacecraft by [sensors] root_load = true."
        )
    where = place_of(model, appendage, appendages)
    recovery_rows = _rows_of(appendage, rows)
    stations = _stations(appendage, x)
    run = run_of(model, data)
    moved, exact = _moved_by(model)
    motion = motion_of(moved, run, [where.root], exact)
    if appendage.fit.space is not None:
        return _of_imported(moved, appendage, run, motion, rows=recovery_rows, static=static)
    key = (appendage.at, stations.tobytes())
    body = known.get(key)
    if body is None:
        body = beam_body(model, appendage, stations)
        if len(known) >= MOST_KNOWN:
            known.clear()
        known[key] = body
    modes = _modes_in(body.coordinates, moved, motion)
    return _of_beam(appendage, where, body, run, motion, modes, stations=stations, static=static)


def _moved_by(model: "mujoco.MjModel") -> "tuple[mujoco.MjModel, list[int]]":
    """The model whose equations the positions of a run follow, and the modal tendons that its
    steps take exactly.

    Exact in time, positions are those of the same file with timing taken out. The timing of a tree
    changes stiffness as well, so that its positions are in balance in the file as it is alone.
    """
    modal = modal_tendons(model)
    forms = {mark.form for mark in modal.made_for if mark is not None}
    if not forms or TREE in forms:
        return model, []
    return at_step_of(without_timing(model), model), modal.index.tolist()


def _stations(appendage: Appendage, x: ArrayLike | None) -> Array:
    if appendage.fit.space is not None:
        if x is not None:
            raise InputError(
                f"x is given, but the appendage at {appendage.at} is imported modes, which know no "
                "sections along x; give recovery rows (rows=...) and leave x out."
            )
        return np.zeros(0)
    beam = appendage.fit.spec.beam
    if x is None:
        return snapped(beam, np.linspace(0.0, beam.length, STATIONS))
    stations = np.atleast_1d(finite_array("x", x, (), (None,), unit="m"))
    outside = (stations < 0.0) | (stations > beam.length * (1.0 + BEYOND))
    if np.any(outside):
        raise InputError(
            f"x = {float(stations[outside][0])!r} m lies outside the appendage at {appendage.at}, "
            f"which goes from 0 to {beam.length!r} m."
        )
    if not 1 <= stations.size <= MOST_STATIONS:
        raise InputError(f"x holds {stations.size} stations; give 1 to {MOST_STATIONS}.")
    return snapped(beam, np.minimum(stations, beam.length))


def _rows_of(appendage: Appendage, rows: object) -> RecoveryRows | None:
    """The rows that are given, or that the specification names; None: there are none."""
    imported = appendage.fit.spec.imported
    if rows is None:
        path = None if imported is None else imported.recovery
        return None if path is None else read_recovery(path)
    if appendage.fit.space is None:
        raise InputError(
            f"rows are given, but the appendage at {appendage.at} is a beam, whose loads follow "
            "from its sections; leave rows out and give stations x."
        )
    if isinstance(rows, str | Path):
        return read_recovery(rows)
    of_type("rows", rows, RecoveryRows, "a RecoveryRows, or the path of an .npz or .toml file")
    assert isinstance(rows, RecoveryRows)
    return rows


def _root_histories(root: RootMotion, force: Array, moment: Array) -> dict[str, History]:
    """Loads at the root; `force`, `moment` `(3, n)`: of the modes."""
    none = np.zeros(0)
    return {
        "root force": History(
            "root force",
            AXES,
            ("N",) * 3,
            root.load[:, None, :3],
            force[None],
            "amplitudes",
            CARRIED,
            none,
        ),
        "root moment": History(
            "root moment",
            AXES,
            ("N m",) * 3,
            root.load[:, None, 3:],
            moment[None],
            "amplitudes",
            CARRIED,
            none,
        ),
    }


# -- beams -----------------------------------------------------------------------------------------
class _Modes(NamedTuple):
    """The kept modes of all ports together: names, columns by port, and their coordinates."""

    names: tuple[str, ...]
    columns: Mapping[str, slice]
    amplitudes: Array
    rates: Array
    accelerations: Array


def _modes_in(
    coordinates: "Mapping[str, Coordinates]", model: "mujoco.MjModel", motion: Motion
) -> _Modes:
    names: list[str] = []
    columns: dict[str, slice] = {}
    values: list[tuple[Array, Array, Array]] = []
    for port, own in coordinates.items():
        columns[port] = slice(len(names), len(names) + len(own.labels))
        names += own.labels
        amplitudes = own.amplitudes(model, motion.qpos)
        values.append((amplitudes, own.rates(motion.qvel), own.rates(motion.qacc)))
    empty = np.zeros((len(motion.qpos), 0))
    amplitudes, rates, accelerations = (
        np.hstack([empty, *(group[i] for group in values)]) for i in range(3)
    )
    return _Modes(tuple(names), columns, amplitudes, rates, accelerations)


def _of_beam(
    appendage: Appendage,
    where: Place,
    body: BeamBody,
    run: Run,
    motion: Motion,
    modes: _Modes,
    *,
    stations: Array,
    static: bool,
) -> Recovery:
    beam = appendage.fit.spec.beam
    (root,) = motion.roots
    carried = _on_ports(root, where, len(appendage.fit.spec.further))
    s, n = stations.size, len(modes.names)
    load_factors = np.zeros((s, 6, n))
    motion_factors = np.zeros((s, 6, n))
    for port, columns in modes.columns.items():
        inside = body.ports[port]
        to_space = PORT_MOTION[port]
        # sum_k P_k W_k^2 eta_k
        strained = np.einsum("nsm,n->smn", inside.momentum, inside.frequencies**2)
        load_factors[:, :, columns] = np.einsum("im,smn->sin", to_space, strained)
        motion_factors[:, :, columns] = np.einsum("im,nsm->sin", to_space, inside.motion)
    load = np.einsum("sin,tn->tsi", load_factors, modes.amplitudes)
    shift = np.einsum("sin,tn->tsi", motion_factors, modes.amplitudes)
    if static:
        felt = _felt(root)
        load += _rigid_load(beam, root, stations)
        load += _carried_load(stations, list(appendage.fit.spec.further.values()), carried)
        for port, inside in body.ports.items():
            port_load, port_shift = _left_out(port, inside, felt, root.spin, carried)
            load += port_load @ PORT_MOTION[port].T
            shift += port_shift @ PORT_MOTION[port].T
    acceleration = _acceleration(root, stations, motion_factors, modes)
    at_root = _root_factors(appendage, body, modes)
    histories = _root_histories(root, at_root[:3], at_root[3:])
    for name, unit, values, factors, follows, rest in (
        ("force", "N", load[..., :3], load_factors[:, :3], "amplitudes", STATIC),
        ("moment", "N m", load[..., 3:], load_factors[:, 3:], "amplitudes", STATIC),
        ("displacement", "m", shift[..., :3], motion_factors[:, :3], "amplitudes", STATIC),
        ("rotation", "rad", shift[..., 3:], motion_factors[:, 3:], "amplitudes", STATIC),
        (
            "acceleration",
            "m/s^2",
            acceleration[..., :3],
            motion_factors[:, :3],
            "accelerations",
            RIGID,
        ),
        (
            "angular acceleration",
            "rad/s^2",
            acceleration[..., 3:],
            motion_factors[:, 3:],
            "accelerations",
            RIGID,
        ),
    ):
        histories[name] = History(name, AXES, (unit,) * 3, values, factors, follows, rest, stations)
    return Recovery(
        appendage.at,
        run.time,
        stations,
        modes.names,
        modes.amplitudes,
        modes.accelerations,
        histories,
        static,
        sections_at(beam, stations),
    )


def _root_factors(appendage: Appendage, body: BeamBody, modes: _Modes) -> Array:
    """`(6, n)` `L_k W_k^2`: load on the root per unit of each mode."""
    out = np.zeros((6, len(modes.names)))
    for port, columns in modes.columns.items():
        inside = body.ports[port]
        participation = appendage.fit.target[port].participation
        along = np.einsum("km,km->k", participation, inside.drive[:, : participation.shape[1]])
        signed = np.sign(along)[:, None] * participation
        out[:, columns] = PORT_MOTION[port] @ (signed.T * inside.frequencies**2)
    return out


def _on_ports(root: RootMotion, where: Place, count: int) -> Array:
    """`(t, c, 6)` wrench that what is carried puts on each further point of the appendage."""
    out = np.zeros((len(root.load), count, 6))
    for i, port in enumerate(where.ports):
        out[:, port] += root.carried[:, i]
    return out


def _felt(root: RootMotion) -> Array:
    """`(t, 6)` acceleration of the root that its modes feel, against free fall, with what a spin
    adds across the axis as an angular acceleration."""
    felt = root.acceleration.copy()
    felt[:, :3] -= root.gravity
    # (w x (w x x e_x)) has x (w_x w_y) along y and x (w_x w_z) along z
    felt[:, 4] -= root.spin[:, 0] * root.spin[:, 2]
    felt[:, 5] += root.spin[:, 0] * root.spin[:, 1]
    return felt


def _rigid_load(beam: Beam, root: RootMotion, stations: Array) -> Array:
    """`(t, s, 6)` load at stations of a rigid beam, by Newton and Euler of what lies beyond."""
    mass = beam.line.behind(stations)
    felt = root.acceleration.copy()
    felt[:, :3] -= root.gravity
    spin = root.spin
    weight = np.einsum("sij,tj->tsi", mass, felt)
    # m w x (w x c) and w x J w about the root; first moment m c from the mass matrix
    first = np.stack([mass[:, 1, 5], 0.0 * mass[:, 1, 5], 0.0 * mass[:, 1, 5]], axis=1)
    turned = np.cross(spin[:, None], first)
    weight[..., :3] += np.cross(spin[:, None], turned)
    inertia = np.einsum("sij,tj->tsi", mass[:, 3:, 3:], spin)
    weight[..., 3:] += np.cross(spin[:, None], inertia)
    return -_moved_to(weight, stations)


def _carried_load(stations: Array, places: Sequence[float], carried: Array) -> Array:
    """`(t, s, 6)` load at stations of wrenches on points beyond."""
    out = np.zeros((len(carried), stations.size, 6))
    for c, x in enumerate(places):
        at_point = np.repeat(carried[:, c, None], stations.size, axis=1)
        beyond = np.where(stations < x * (1.0 - BEYOND), 1.0, 0.0)
        out += _moved_to(at_point, stations - x) * beyond[:, None]
    return out


def _moved_to(load: Array, distance: Array) -> Array:
    """Loads `(t, s, 6)` about a point so far out on the axis `(s,)` [m]."""
    out = load.copy()
    # m - d e_x x f
    out[..., 4] += distance * load[..., 2]
    out[..., 5] -= distance * load[..., 1]
    return out


def _left_out(
    port: str, inside: Inside, felt: Array, spin: Array, carried: Array
) -> tuple[Array, Array]:
    """`(t, s, m)` load and motion at the stations by the modes left out, beside those of the rigid
    beam: `eta_k W_k^2 = -L_k a + tau_k f` of each."""
    motion = PORT_MOTION[port]
    driving = felt @ motion
    if port == "axial":
        away = -np.sum(spin[:, 1:] ** 2, axis=1)  # acceleration along x per metre of x
        driving = np.column_stack([driving, away])
    forces = (carried @ motion).reshape(len(felt), -1)
    by_mode = forces @ inside.drive_carried.T - driving @ inside.drive.T
    load = -np.einsum("tn,nsm->tsm", by_mode, inside.momentum)
    shift = np.einsum("smi,ti->tsm", inside.left_out, driving)
    shift += np.einsum("smi,ti->tsm", inside.left_out_carried, forces)
    return load, shift


def _acceleration(root: RootMotion, stations: Array, factors: Array, modes: _Modes) -> Array:
    """`(t, s, 6)` of the sections in space."""
    spin = root.spin[:, None]
    rate = np.einsum("sin,tn->tsi", factors, modes.rates)
    out = np.einsum("sin,tn->tsi", factors, modes.accelerations)
    out += root.acceleration[:, None]
    place = np.zeros((1, stations.size, 3))
    place[0, :, 0] = stations
    out[..., :3] += np.cross(root.acceleration[:, None, 3:], place)
    out[..., :3] += np.cross(spin, np.cross(spin, place))
    out[..., :3] += 2.0 * np.cross(spin, rate[..., :3])
    out[..., 3:] += np.cross(spin, rate[..., 3:])
    return out


# -- imported modes --------------------------------------------------------------------------------
def _of_imported(
    model: "mujoco.MjModel",
    appendage: Appendage,
    run: Run,
    motion: Motion,
    *,
    rows: RecoveryRows | None,
    static: bool,
) -> Recovery:
    body = imported_body(model, appendage)
    imported = appendage.fit.spec.imported
    (root,) = motion.roots
    coordinates = {} if body.coordinates is None else {"": body.coordinates}
    modes = _modes_in(coordinates, model, motion)
    names = modes.names
    space = appendage.fit.space
    assert space is not None
    clamped = appendage.fit.kept_for == "clamped"
    # L_k W_k^2, L of the kept modes from those of the file
    frequencies = np.zeros(0) if body.coordinates is None else body.coordinates.frequencies
    participation = body.kept @ space.data.in_file.T @ space.data.participation
    at_root = participation.T * frequencies**2
    histories = _root_histories(root, at_root[:3], at_root[3:])
    row_names: tuple[str, ...] = ()
    if rows is not None:
        rows.check_columns(body.kept.shape[1])
        row_names = rows.names
        # coordinates of the file's own units: energy is M L^2 / T^2 there
        units = imported.units if imported is not None else None
        metres, kilograms = (1.0, 1.0) if units is None else units.si
        size = 1.0 / (metres * np.sqrt(kilograms))
        by_amplitude = size * rows.modes @ body.kept.T
        by_acceleration = size * rows.accelerations @ body.kept.T
        values = modes.amplitudes @ by_amplitude.T + modes.accelerations @ by_acceleration.T
        values += root.acceleration @ rows.root.T
        # w x (w x r) of the points, along the motion of each row
        spin = root.spin[:, None]
        centripetal = np.cross(spin, np.cross(spin, rows.points[None]))
        values += np.einsum("tri,ri->tr", centripetal, rows.root[:, :3])
        if static:
            felt = root.acceleration.copy()
            felt[:, :3] -= root.gravity
            values += felt @ (size * rows.modes @ body.static).T
        for r, name in enumerate(rows.names):
            moves = not np.any(rows.modes[r])
            factors = by_acceleration[r] if moves else by_amplitude[r]
            histories[name] = History(
                name,
                ("",),
                (rows.units[r],),
                values[:, None, r : r + 1],
                factors[None, None],
                "accelerations" if moves else "amplitudes",
                RIGID if moves else STATIC,
                np.zeros(0),
            )
    return Recovery(
        appendage.at,
        run.time,
        np.zeros(0),
        names,
        modes.amplitudes,
        modes.accelerations,
        histories,
        static,
        names=row_names,
        in_file=tuple(space.in_file(name) for name in names) if clamped else (),
    )
