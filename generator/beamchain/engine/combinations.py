"""What `inputs` and `outputs` of a linear model may be: names as in `signals.py`, and under names
of their own torque distributed over actuators, sensors in a body's axes, and weighted sums."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, TypeVar

import numpy as np

from beamchain.checks import Struct, field, list_of_names, number, of_type
from beamchain.engine.allocation import Allocated, Allocation, allocated, torques
from beamchain.engine.library import mujoco
from beamchain.engine.operating_point import OperatingPoint
from beamchain.engine.signals import (
    AXES,
    Input,
    Output,
    Reader,
    base,
    named_inputs,
    named_output,
    number_of,
    sensor_axes,
    usual_inputs,
)
from beamchain.errors import InputError
from beamchain.ports.motions import Array


class Alignment(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A sensor with three axes, turned from its own axes into those of a body.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.Alignment(sensor="star", body="bus").sensor
        'star'
    """

    sensor: Annotated[
        str, field("sensor with three axes: framequat, gyro, accelerometer, magnetometer, ...")
    ]
    body: Annotated[
        str | None, field("body into whose axes it is turned; left out: the base body")
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        of_type("sensor of an alignment", self.sensor, str, "the name of a sensor")
        if self.body is not None:
            of_type("body of an alignment", self.body, str, "the name of a body")


InputNames = Sequence[str] | Mapping[str, str | Allocation | Mapping[str, float]] | None
OutputNames = Sequence[str] | Mapping[str, str | Alignment | Mapping[str, float]] | None
Combined = TypeVar("Combined", Allocation, Alignment)


def align(sensor: str, body: str | None = None) -> Alignment:
    """A sensor as an output of `bc.plant`, turned from its own axes into those of a body.

    Under the name NAME it gives the outputs `NAME_x`, `NAME_y` and `NAME_z`, in the sensor's unit.
    The turn is that at the pose.

    Args:
        sensor: one with three axes: a star tracker (framequat), gyro, accelerometer, velocimeter,
            magnetometer, ...
        body: the body; the base body where left out.

    Raises:
        InputError: a name is none.

    Example:
        >>> import beamchain as bc
        >>> bc.align(sensor="star", body="bus").body
        'bus'
    """
    return Alignment(sensor=sensor, body=body)


def inputs_of(point: OperatingPoint, names: InputNames) -> list[Input]:
    """The inputs that `names` ask for; the usual ones where left out."""
    model = point.model
    data = point.data()
    given = usual_inputs(model) if names is None else names
    groups: list[_Group] = []
    signals: list[list[Input]] = []
    for name, what in _items("inputs", given, Allocation):
        group: list[Input]
        place = ""
        if isinstance(what, Allocation):
            found = allocated(model, data, name, what)
            group = torques(model, name, found)
        elif isinstance(what, Mapping):
            group = _weighted_inputs(model, data, name, what)
        else:
            place, group = named_inputs(model, data, what)
        if what == name:
            groups.append(_Group(place, tuple(signal.label for signal in group), fixed=False))
        else:
            labels = [signal.label for signal in group]
            named = labels if isinstance(what, Allocation) else _renamed(name, labels)
            groups.append(_Group(name, tuple(named), fixed=True))
        signals.append(group)
    labels = _told_apart("inputs", groups)
    return [
        replace(signal, label=label)
        for group, those in zip(signals, labels, strict=True)
        for signal, label in zip(group, those, strict=True)
    ]


def outputs_of(point: OperatingPoint, names: OutputNames) -> list[Output]:
    """The outputs that `names` ask for; attitude and rate of the base where left out."""
    data = point.data()
    given = ["attitude", "rate"] if names is None else names
    groups: list[_Group] = []
    signals: list[Output] = []
    for name, what in _items("outputs", given, Alignment):
        place = ""
        if isinstance(what, Alignment):
            output = _aligned(point, data, name, what)
        elif isinstance(what, Mapping):
            output = _weighted_output(point, data, name, what)
        else:
            place, output = named_output(point, data, what)
        if what == name:
            groups.append(_Group(place, output.labels, fixed=False))
        else:
            groups.append(_Group(name, tuple(_renamed(name, output.labels)), fixed=True))
        signals.append(output)
    labels = _told_apart("outputs", groups)
    return [replace(output, labels=those) for output, those in zip(signals, labels, strict=True)]


def allocations_of(point: OperatingPoint, names: InputNames) -> dict[str, Allocated]:
    """What the allocations among the inputs are at a point, by name."""
    data = point.data()
    return {
        name: allocated(point.model, data, name, what)
        for name, what in (names.items() if isinstance(names, Mapping) else ())
        if isinstance(what, Allocation)
    }


def settled(names: InputNames, allocations: Mapping[str, Allocated]) -> InputNames:
    """The same inputs with the commands that allocations have now, whatever becomes of the
    craft: a flight computer does not know how the craft varies."""
    if not isinstance(names, Mapping):
        return names
    return {
        name: Allocation(
            actuators=what.actuators,
            axes=what.axes,
            matrix=tuple(map(tuple, allocations[name].commands.tolist())),
            about=what.about,
        )
        if isinstance(what, Allocation)
        else what
        for name, what in names.items()
    }


# -- names -----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Group:
    """Labels of what one name gives; a place behind them tells them from others where they are
    not `fixed`."""

    place: str
    labels: tuple[str, ...]
    fixed: bool


def _items(
    field: str,
    names: "Sequence[str] | Mapping[str, str | Combined | Mapping[str, float]]",
    kind: "type[Combined]",
) -> "list[tuple[str, str | Combined | Mapping[str, float]]]":
    """What stands under each name, `kind` among it: a name of a list stands for itself."""
    cure = f'write {field}=["..."].'
    if not isinstance(names, Mapping):
        listed = list_of_names(field, names)
        if not listed:
            raise InputError(f"{field} is empty; {cure}")
        if twice := [name for name, count in Counter(listed).items() if count > 1]:
            raise InputError(f"{field} names {twice[0]!r} twice; name each signal once.")
        return [(name, name) for name in listed]
    if not names:
        raise InputError(f"{field} is empty; {cure}")
    call = "bc.allocate([...])" if kind is Allocation else "bc.align(...)"
    out: list[tuple[str, str | Combined | Mapping[str, float]]] = []
    for name, what in names.items():
        if not isinstance(name, str) or not name:
            raise InputError(f"{field}: {name!r:.60} is no name of a signal; give a text.")
        wanted = f"a name, {call} or {{name: weight}}"
        of_type(f"{field}[{name!r}]", what, (str, kind, Mapping), wanted)
        out.append((name, what))
    return out


def _renamed(name: str, labels: Sequence[str]) -> list[str]:
    """Labels under another name: alone it, else it with an axis or with what they were called."""
    if len(labels) == 1:
        return [name]
    parts = [label.rpartition("_") for label in labels]
    alike = len({stem for stem, _, _ in parts}) == 1
    ends = [end for _, _, end in parts] if alike else labels
    return [f"{name}_{end}" for end in ends]


def _told_apart(field: str, groups: Sequence[_Group]) -> list[tuple[str, ...]]:
    """Labels of every group, the place behind those that several have."""
    uses = Counter(label for group in groups for label in group.labels)
    out = [
        tuple(
            f"{label}_{group.place}"
            if uses[label] > 1 and group.place and not group.fixed
            else label
            for label in group.labels
        )
        for group in groups
    ]
    counts = Counter(label for labels in out for label in labels)
    if twice := [label for label, count in counts.items() if count > 1]:
        raise InputError(
            f"{field}: two signals would be called {twice[0]!r}; give one of them another name, "
            f"{field}={{NAME: ...}}."
        )
    return out


# -- sensors in a body's axes, weighted sums -------------------------------------------------------
# What is read stands in functions of the module, so that plants can be pickled.
def _read_turned(turn: Array, read: Reader, data: "mujoco.MjData") -> Array:
    return turn @ read(data)


def _read_sum(parts: Sequence[tuple[float, Reader]], data: "mujoco.MjData") -> Array:
    return np.asarray(sum(weight * read(data) for weight, read in parts), dtype=np.float64)


def _aligned(
    point: OperatingPoint, data: "mujoco.MjData", name: str, alignment: Alignment
) -> Output:
    """A sensor in a body's axes, `data` at the point."""
    model = point.model
    field = f"alignment {name!r}"
    sensor = number_of(model, "sensor", alignment.sensor, f"sensor of {field}")
    if alignment.body is None:
        body = base(model)
    else:
        body = number_of(model, "body", alignment.body, f"body of {field}")
    axes = sensor_axes(model, data, sensor)
    if axes is None:
        raise InputError(
            f"{field}: sensor {alignment.sensor!r} has no three axes to turn; give its name alone, "
            f"outputs={{{name!r}: {alignment.sensor!r}}}."
        )
    _, output = named_output(point, data, alignment.sensor)
    turn = data.xmat[body].reshape(3, 3).T @ axes
    labels = tuple(f"{name}_{axis}" for axis in AXES)
    return replace(output, labels=labels, read=partial(_read_turned, turn, output.read))


def _weighted_inputs(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    name: str,
    weights: Mapping[str, float],
) -> list[Input]:
    """Inputs that drive several together, each by its weight."""
    given = _weights(f"inputs[{name!r}]", weights)
    groups = [(weight, named_inputs(model, data, part)[1]) for part, weight in given.items()]
    sizes = {part: len(group) for part, (_, group) in zip(given, groups, strict=True)}
    _check_alike(f"inputs[{name!r}]", sizes)
    out: list[Input] = []
    for same in zip(*(group for _, group in groups), strict=True):
        parts = tuple((weight, one) for (weight, _), one in zip(groups, same, strict=True))
        out.append(Input(same[0].label, _common(one.unit for one in same), parts=parts))
    return out


def _weighted_output(
    point: OperatingPoint, data: "mujoco.MjData", name: str, weights: Mapping[str, float]
) -> Output:
    """The weighted sum of several outputs."""
    given = _weights(f"outputs[{name!r}]", weights)
    parts = [(weight, named_output(point, data, part)[1]) for part, weight in given.items()]
    sizes = {part: len(one.labels) for part, (_, one) in zip(given, parts, strict=True)}
    _check_alike(f"outputs[{name!r}]", sizes)
    units = zip(*(one.units for _, one in parts), strict=True)
    return Output(
        parts[0][1].labels,
        tuple(_common(same) for same in units),
        partial(_read_sum, tuple((weight, one.read) for weight, one in parts)),
        all(one.local for _, one in parts),
    )


def _weights(field: str, weights: Mapping[str, float]) -> dict[str, float]:
    """Weights by name, checked."""
    out: dict[str, float] = {}
    for part, weight in weights.items():
        of_type(f"a name in {field}", part, str, "the name of a signal")
        out[part] = number(f"{field}[{part!r}]", weight, "")
    if not any(out.values()):
        raise InputError(f"{field} = {out} has no weight; give {{name: weight}}, not all zero.")
    return out


def _check_alike(field: str, sizes: Mapping[str, int]) -> None:
    """Refuse sums of signals of different sizes."""
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name!r} has {size}" for name, size in sizes.items())
        raise InputError(
            f"{field} adds signals of different sizes ({listed}); add those that have as many axes."
        )


def _common(units: Iterable[str]) -> str:
    """The unit that all have; empty where they differ."""
    found = set(units)
    return found.pop() if len(found) == 1 else ""
