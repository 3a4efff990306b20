"""What a controller feeds back, `u = -K y`: files of loops, python-control's systems and mappings
of them in one form."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any, cast

import control
import numpy as np

from beamchain.checks import kind_of, preview
from beamchain.control.controllers import (
    Controller,
    loop_response,
    place,
    places,
    read_controller,
    realise,
    realise_fraction,
    takes_time,
)
from beamchain.control.systems import Complex, System, response, side_by_side, with_gains
from beamchain.errors import InputError
from beamchain.ports.motions import Array

SAME = 1e-9  # relative, of steps that are one

LTI = control.StateSpace | control.TransferFunction
Given = Controller | str | Path | LTI | Mapping[tuple[str, str], Any]


@dataclass(frozen=True, eq=False)
class Feedback:
    """`u = -K y` from outputs of a plant to the inputs that it drives.

    Args:
        rows, columns: numbers of these outputs and inputs, each once.
        realise: A, B, C, D of K, dead times as Pade approximations of an order.
        response: `(k, columns, rows)` K at s, or z, `(k,)`, dead times exact.
        step: [s]; 0: continuous; None: it has no states, and takes the plant's.
        delays: `(columns,)` the longest dead time on the way to every input [s].
    """

    rows: list[int]
    columns: list[int]
    realise: Callable[[int], System]
    response: Callable[[Complex], Complex]
    step: float | None
    delays: tuple[float, ...]

    @property
    def delayed(self) -> bool:
        """Whether it has dead times."""
        return any(self.delays)

    def measured(self, system: System) -> list[list[int]]:
        """The outputs that every input is fed from, by number."""
        a, b, c, d = system
        reach = np.eye(a.shape[0], dtype=np.bool_) | (a != 0.0)
        for _ in range(a.shape[0].bit_length()):
            reach = reach @ reach
        fed = ((c != 0.0) @ reach @ (b != 0.0)) | (d != 0.0)
        return [[row for row, yes in zip(self.rows, one, strict=True) if yes] for one in fed]


@dataclass(frozen=True)
class Signals:
    """Inputs and outputs of a plant, as the user calls them and as python-control does."""

    inputs: list[str]
    outputs: list[str]
    input_labels: list[str]
    output_labels: list[str]

    def input(self, name: str) -> int:
        """Number of an input, by either name."""
        return _number(name, self.inputs, self.input_labels, "input")

    def output(self, name: str) -> int:
        """Number of an output, by either name."""
        return _number(name, self.outputs, self.output_labels, "output")


def _number(name: str, names: list[str], labels: list[str], kind: str) -> int:
    if name not in names and name in labels:
        return labels.index(name)
    return place(name, names, kind, "controller: ")


def feedback(controller: Given, signals: Signals) -> Feedback:
    """A controller in this form.

    Raises:
        InputError: it is none, names no signal of the plant, has other sizes, is improper or not
            finite, or samples at two rates.
    """
    if isinstance(controller, Controller | str | Path):
        return _of_file(read_controller(controller), signals)
    if isinstance(controller, Mapping):
        return _of_mapping(cast("Mapping[Any, Any]", controller), signals)
    if isinstance(controller, control.StateSpace | control.TransferFunction):
        return _of_system(controller, signals)
    raise InputError(
        f"controller = {preview(controller)} is {kind_of(controller)}; give a TOML file "
        "with [[loop]], a TransferFunction or StateSpace of python-control, or "
        "{(input, output): system}."
    )


def _of_file(controller: Controller, signals: Signals) -> Feedback:
    seen, driven = places(controller, signals.inputs, signals.outputs)
    rows, columns, drive, measure = _ends(seen, driven)

    def realised(order: int) -> System:
        return with_gains(drive, realise(controller, order), measure)

    def values(s: Complex) -> Complex:
        each = np.array([loop_response(loop, s) for loop in controller.loop])
        return np.einsum("il,lk,lj->kij", drive, each, measure).astype(np.complex128)

    delays = tuple(
        max(loop.delay for loop, place in zip(controller.loop, driven, strict=True) if place == one)
        for one in columns
    )
    step = 0.0 if takes_time(controller) else None
    return Feedback(rows, columns, realised, values, step, delays)


def _of_mapping(several: Mapping[Any, Any], signals: Signals) -> Feedback:
    if not several:
        raise InputError(
            "controller: the mapping holds no loop; give {(input, output): system}, at least one."
        )
    systems: list[System] = []
    steps: dict[str, float] = {}
    seen: list[int] = []
    driven: list[int] = []
    for key, given in several.items():
        if not (isinstance(key, tuple) and len(cast("tuple[Any, ...]", key)) == 2):
            raise InputError(
                f"controller: the key {preview(key)} is no pair of names; give "
                "{(input, output): system}."
            )
        pair = cast("tuple[str, str]", key)
        driven.append(signals.input(pair[0]))
        seen.append(signals.output(pair[1]))
        name = f"the loop from {pair[1]!r} to {pair[0]!r}"
        one: Any = control.ss([], [], [], float(given)) if _is_number(given) else given
        if not isinstance(one, control.StateSpace | control.TransferFunction):
            raise InputError(
                f"controller: {name} is {kind_of(given)}; give a TransferFunction or "
                "StateSpace of python-control, or a number."
            )
        if (one.ninputs, one.noutputs) != (1, 1):
            raise InputError(
                f"controller: {name} has {one.ninputs} inputs and {one.noutputs} outputs; give a "
                "system with one of each."
            )
        systems.append(_states(one, name))
        step = _step(one, systems[-1], name)
        if step is not None:
            steps[name] = step
    rows, columns, drive, measure = _ends(seen, driven)
    whole = with_gains(drive, side_by_side(systems), measure)
    return _rational(rows, columns, whole, _one_step(steps))


def _ends(seen: list[int], driven: list[int]) -> tuple[list[int], list[int], Array, Array]:
    """The outputs that loops measure and the inputs that they drive, each once; and which loops
    drive which input `(columns, loops)` and measure which output `(loops, rows)`."""
    rows, columns = list(dict.fromkeys(seen)), list(dict.fromkeys(driven))
    drive, measure = np.equal.outer(columns, driven), np.equal.outer(seen, rows)
    return rows, columns, drive.astype(np.float64), measure.astype(np.float64)


def _of_system(system: LTI, signals: Signals) -> Feedback:
    seen = _matched(list(system.input_labels), signals.output_labels, "output")
    driven = _matched(list(system.output_labels), signals.input_labels, "input")
    if seen is None or driven is None:
        sizes = len(signals.outputs), len(signals.inputs)
        if (system.ninputs, system.noutputs) != sizes:
            raise InputError(
                f"controller: it takes {system.ninputs} signals and gives {system.noutputs}, but "
                f"the plant has {sizes[0]} outputs and {sizes[1]} inputs; name its inputs like "
                "outputs of the plant and its outputs like inputs of the plant, or give "
                "{(input, output): system}."
            )
        seen, driven = list(range(sizes[0])), list(range(sizes[1]))
    states = _states(system, "the controller")
    step = _step(system, states, "the controller")
    a, b, c, d = states
    active = np.flatnonzero((np.abs(c) > 0.0).any(axis=1) | (np.abs(d) > 0.0).any(axis=1)).tolist()
    if not active:
        raise InputError("controller: it gives nothing but zero; give one that drives an input.")
    columns = [driven[i] for i in active]
    return _rational(seen, columns, (a, b, c[active], d[active]), step)


def _matched(labels: list[str], plant: list[str], kind: str) -> list[int] | None:
    """Signals of the plant that the labels of a system name; None where they name none."""
    known = [label for label in labels if label in plant]
    if not known:
        return None
    for label in labels:
        if label not in plant:
            raise InputError(
                f"controller: its signal {label!r} is no {kind} of the plant, though {known[0]!r} "
                f"is; choose from {', '.join(plant)}."
            )
    return [plant.index(label) for label in labels]


def _rational(rows: list[int], columns: list[int], system: System, step: float | None) -> Feedback:
    delays = (0.0,) * len(columns)
    return Feedback(rows, columns, lambda _: system, lambda s: response(system, s), step, delays)


def _is_number(given: object) -> bool:
    return isinstance(given, Real) and not isinstance(given, bool)


def _states(system: LTI, name: str) -> System:
    """A, B, C, D of a system; of a matrix of transfer functions entry by entry."""
    if isinstance(system, control.StateSpace):
        a, b, c, d = (np.asarray(getattr(system, key), dtype=np.float64) for key in "ABCD")
    else:
        a, b, c, d = _of_fractions(system, name)
    if not all(np.all(np.isfinite(part)) for part in (a, b, c, d)):
        raise InputError(
            f"controller: {name} has coefficients that are not finite, or so far apart that double "
            "precision cannot compute with them; give finite ones, and leave out what does not "
            "matter in its band."
        )
    return a, b, c, d


def _of_fractions(system: control.TransferFunction, name: str) -> System:
    entries = list(np.ndindex(system.noutputs, system.ninputs))
    parts = side_by_side(_of_fraction(system, i, j, name) for i, j in entries)
    *_, drive, measure = _ends([j for _, j in entries], [i for i, _ in entries])
    return with_gains(drive, parts, measure)


def _of_fraction(system: control.TransferFunction, i: int, j: int, name: str) -> System:
    """One entry; of a zero there is no state."""
    top, bottom = (
        np.trim_zeros(np.atleast_1d(np.asarray(part[i][j], dtype=np.float64)), "f")
        for part in (cast("Any", system).num, cast("Any", system).den)
    )
    if top.size > bottom.size:
        raise InputError(
            f"controller: {name} is improper, its numerator has a higher power than its "
            "denominator; add a pole beyond the band, for example 1/(0.01 s + 1)."
        )
    with np.errstate(all="ignore"):
        return realise_fraction(top, bottom if top.size else np.ones(1))


def _step(system: LTI, states: System, name: str) -> float | None:
    """Step of a system [s]; None: it has no states, and fits any."""
    step = cast("float | bool | None", system.dt)
    if step is True:
        raise InputError(
            f"controller: {name} is sampled at a step that it does not say (dt = True); give its "
            "step in seconds, for example dt=0.25."
        )
    if states[0].shape[0] == 0 and not step:
        return None
    if step is None:
        raise InputError(
            f"controller: {name} does not say whether it is continuous (dt = None); write dt=0, or "
            "its step in seconds."
        )
    return float(step)


def _one_step(steps: Mapping[str, float]) -> float | None:
    """The step that all loops share."""
    if not steps:
        return None
    (first, step), *others = steps.items()
    for name, other in others:
        if abs(other - step) > SAME * max(step, other):
            words = [f"at {s:g} s" if s else "continuously" for s in (step, other)]
            raise InputError(
                f"controller: {first} acts {words[0]}, {name} {words[1]}; give all loops one step "
                "(control.c2d samples a continuous one, control.sample_system as well)."
            )
    return step
