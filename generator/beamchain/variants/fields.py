"""Per-world fields of one compiled model: rows of a table of variants,
or modes drawn from ranges and made exact in time.

Both sources give each world a key, from which its fields follow at every step.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.checks import number, of_type
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.engine.model_fields import DERIVED, with_fields
from beamchain.errors import InputError
from beamchain.fitting.quantity import Quantity, drawn_fields
from beamchain.fitting.uncertain import Uncertainty
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.modal import Modal, foreign, modal_tendons, timing_marks
from beamchain.steps.retime import retime_by, without_timing
from beamchain.variants.timing import DrawTiming

RANGES = ("frequency", "damping")
#: All that a draw of modes changes.
TENDONS = ("tendon_stiffness", "tendon_damping", "tendon_armature", "tendon_solimp_lim")
RIGID = "variants=None takes a spacecraft without any."
#: endings of integer fields that are no part of how a model is connected
LOOSE = ("contype", "conaffinity", "condim", "priority", "group", "matid")

Fields = dict[str, Array]
Keys = NDArray[Any]


class Modes:
    """Modal tendons of a model with frequencies and damping drawn uniformly,
    each mode of each world for itself; exact in time for its step where the model is.

    `ranges`: half widths relative to the nominal values, `{"frequency": 0.05, "damping": 0.3}`.
    """

    size: int | None = None  #: any number can be drawn

    def __init__(self, model: "mujoco.MjModel", ranges: Mapping[str, float]) -> None:
        self._ranges = ranges
        self._widths = [_width(name, ranges.get(name, 0.0)) for name in RANGES]
        self._model = without_timing(model)
        modal = modal_tendons(self._model)
        if not modal.names:
            raise InputError(f"{foreign('a draw of modes')} {RIGID}")
        self._count = len(modal.names)
        self._quantities = _quantities_of_modes(modal, self._widths)
        self._timing: DrawTiming | None = None
        if any(timing_marks(model)):
            integrator = NUMBERS[int(model.opt.integrator)]
            self._timing = DrawTiming.of(model, float(model.opt.timestep), integrator)
        #: of the fields of one world
        self.nbytes: int = sum(getattr(model, name).nbytes for name in TENDONS)

    def keys(self, count: int, rng: np.random.Generator, *, first: bool = False) -> Keys:  # noqa: ARG002
        """`(count, 2, n)` numbers from -1 to 1."""
        return rng.uniform(-1.0, 1.0, (count, 2, self._count))

    def fields(self, keys: Keys) -> Fields:
        """The four arrays of tendons that hold modes."""
        drawn = keys[:, [width > 0.0 for width in self._widths]].reshape(len(keys), -1)
        values = np.array([q.nominal for q in self._quantities])
        values = values + drawn * np.array([q.reach for q in self._quantities])
        fields = drawn_fields(self._model, self._quantities, values)
        if self._timing is not None:
            self._timing.write(fields)
        return {name: fields[name] for name in TENDONS}

    def drawn(self, keys: Keys) -> dict[str, Array]:
        """`(k, n)` factors on the nominal frequencies and damping ratios."""
        return {
            name: 1.0 + width * keys[:, i]
            for i, (name, width) in enumerate(zip(RANGES, self._widths, strict=True))
        }

    def at(self, timed: "mujoco.MjModel") -> "Modes":
        """The same ranges for the model at another step."""
        return Modes(timed, self._ranges)


def _quantities_of_modes(modal: Modal, widths: Sequence[float]) -> list[Quantity]:
    """The frequencies and the damping ratios of all modes that are drawn, each for itself."""
    nominal = (modal.frequency, modal.damping / (2.0 * modal.frequency))
    return [
        Quantity(
            name=f"{tendon}.{kind}",
            unit="",
            nominal=float(value),
            uncertainty=Uncertainty(relative=width, distribution="uniform"),
            index=int(index),
            key=f"{tendon}.{kind}",
        )
        for kind, width, values in zip(RANGES, widths, nominal, strict=True)
        if width > 0.0
        for tendon, index, value in zip(modal.names, modal.index, values, strict=True)
    ]


class Table:
    """Given variants, arrays `(k, ...)` by name of MuJoCo's field, taken in their order at first
    and then drawn with equal chances; made exact in time for `timestep` [s] (`band` as of
    `retime`), or taken as they are where it is None. `columns` `(k,)` by name: what was drawn for
    them.
    """

    def __init__(
        self,
        model: "mujoco.MjModel",
        fields: Mapping[str, Any],
        timestep: float | None,
        band: float | None,
        columns: Mapping[str, Array],
    ) -> None:
        self._model, self._given, self._band = model, fields, band
        self._columns = columns
        self.size: int = max(np.shape(next(iter(fields.values())))[:1], default=0)
        for name, values in fields.items():
            of_type("a field of variants", name, str, "the name of a field of MuJoCo's model")
            private = name.startswith("_")
            shape = None if private else getattr(getattr(model, name, None), "shape", None)
            if shape is None:
                raise InputError(
                    f"variants have the field {name!r}, which MuJoCo's model does not have as an "
                    "array; masses, for example, are 'body_mass'. bc.sweep makes such arrays of a "
                    f"spacecraft; ranges on its modes are {' and '.join(map(repr, RANGES))}."
                )
            given = np.asarray(values)
            fits = given.shape == (self.size, *shape) and self.size > 0
            if not fits or not np.all(np.isfinite(given)):
                raise InputError(
                    f"variants[{name!r}] has the shape {given.shape}; finite numbers of the shape "
                    f"({self.size or 'k'}, {', '.join(map(str, shape))}) are needed: the model's "
                    "own, with the same k for all fields."
                )
            _check_connected(name, given, getattr(model, name))
        self._rows = {name: np.array(values, dtype=np.float64) for name, values in fields.items()}
        if set(fields) - set(TENDONS) or timestep is not None:
            self._derive(timestep)
        self.nbytes: int = sum(values[0].nbytes for values in self._rows.values())

    def keys(self, count: int, rng: np.random.Generator, *, first: bool = False) -> Keys:
        """`(count, 1)` numbers of variants."""
        numbers = np.arange(count) % self.size if first else rng.integers(self.size, size=count)
        return numbers[:, None]

    def fields(self, keys: Keys) -> Fields:
        """Rows of the table."""
        return {name: values[keys[:, 0]] for name, values in self._rows.items()}

    def drawn(self, keys: Keys) -> dict[str, Array]:
        """`(k,)`: the row of the table, and what was drawn for it."""
        rows = keys[:, 0]
        return {"row": rows.copy(), **{name: of[rows] for name, of in self._columns.items()}}

    def at(self, timed: "mujoco.MjModel") -> "Table":
        """The same variants for the model at another step."""
        step = float(timed.opt.timestep)
        return Table(self._model, self._given, step, self._band, self._columns)

    def _derive(self, timestep: float | None) -> None:
        """What follows from the fields: MuJoCo's constants, and numbers exact in time;
        one model per variant, once."""
        base = self._model
        if not modal_tendons(base).names:
            timestep = None  # nothing is to be made exact
        derived: list[dict[str, Array]] = []
        marks = self._rows.get("tendon_solimp_lim")
        if marks is None and "tendon_armature" in self._rows and any(timing_marks(base)):
            # armatures on a timed model hold its timing, and its marks are those of every variant
            marks = np.repeat(np.asarray(base.tendon_solimp_lim)[None], self.size, axis=0)
        if timestep is not None and marks is None:
            base = without_timing(base)
        elif marks is not None and np.all(marks[:, modal_tendons(base).index, 0] == timestep):
            timestep = None  # they are exact already
        names = DERIVED if timestep is None else (*DERIVED, *TENDONS)
        for i in range(self.size):
            model = with_fields(base, {name: values[i] for name, values in self._rows.items()})
            mujoco.mj_setConst(model, mujoco.MjData(model))
            if timestep is not None:
                retime_by(2, model, timestep, band=self._band)
            derived.append({name: np.array(getattr(model, name)) for name in names})
        for name in names:
            rows = np.array([fields[name] for fields in derived])
            if np.any(rows != getattr(self._model, name)):
                self._rows[name] = rows


Source = Modes | Table


def source_of(
    model: "mujoco.MjModel",
    timed: "mujoco.MjModel",
    variants: Any,
    timestep: float | None,
    band: float | None = None,
) -> Source | None:
    """What `variants` of a model mean, which runs as `timed`; `timestep`, `band` as of `Table`.
    None for worlds that are all the same."""
    given = getattr(variants, "fields", variants)
    if given is None:
        return None
    if not isinstance(given, Mapping) or not given:
        raise InputError(
            f"variants = {given!r:.60} is not understood; give the result of bc.sweep, arrays by "
            "the name of MuJoCo's field, or "
            'ranges on the modes: {"frequency": 0.05, "damping": 0.3}.'
        )
    if set(given) <= set(RANGES):
        return Modes(timed, given)
    if wrong := [name for name in given if name in RANGES]:
        raise InputError(
            f"variants mix {wrong[0]!r}, a range on modes, with fields of MuJoCo's model; give one "
            "or the other."
        )
    quantities = getattr(variants, "quantities", ())  # of a sweep
    columns: dict[str, Array] = {q.name: variants.values[:, i] for i, q in enumerate(quantities)}
    return Table(model, given, timestep, band, columns)


def _check_connected(name: str, given: Array, own: NDArray[Any]) -> None:
    """Refuse other numbers in a field that says how the bodies, joints and lists of a model are
    connected: MuJoCo would read past its arrays."""
    index = own.dtype.kind == "i" and own.dtype.itemsize > 1 and not name.endswith(LOOSE)
    if index and np.any(given != own):
        raise InputError(
            f"variants[{name!r}] differs from the model's own; this field says how the model is "
            "connected, which is the same in all worlds. Leave it out, and make the variants of "
            "one structure: appendages with every number of [modes] given, 0 for torsion too."
        )


def runs_exact(model: "mujoco.MjModel") -> bool:
    """Whether a model was made exact in time,
    so that its input has to be the mean of this and the last one."""
    marked = any(mark is not None for mark in modal_tendons(model).made_for)
    return marked and SCHEMES[NUMBERS[int(model.opt.integrator)]].exact


def _width(name: str, value: object) -> float:
    width = number(f"variants[{name!r}]", value, "")
    if not 0.0 <= width < 1.0:
        raise InputError(
            f"variants[{name!r}] = {width:g} must lie from 0 to below 1: it is the half width "
            "relative to the nominal value, and no frequency or damping can reach zero."
        )
    return width
