"""Controllers as files of loops: transfer functions with dead times,
their responses and their states."""

import re
from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import Annotated, Any

import control
import msgspec
import numpy as np
from numpy.typing import NDArray

from beamchain.checks import Struct, field
from beamchain.control.systems import System, balancing, side_by_side
from beamchain.engine.allocation import Allocation
from beamchain.engine.combinations import Alignment, InputNames, OutputNames
from beamchain.errors import InputError
from beamchain.fitting.toml_files import read_struct
from beamchain.ports.motions import Array

Response = NDArray[np.complex128]
SHORTEST = 1e-9  # [s] of a dead time that is not zero
LEAST = 1e-30  # of a coefficient that is not zero
BESIDE = 1e-9  # relative, of a frequency at which an undamped filter is infinite
ORDER = 6  # of the Pade approximation of a delay, with which the closed loop's poles are judged


class Filter(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A proper transfer function in s.

    Example:
        >>> import beamchain as bc
        >>> wheel = bc.spec.Filter(numerator=(1.0,), denominator=(0.05, 1.0))
        >>> wheel.denominator
        (0.05, 1.0)
    """

    numerator: Annotated[
        tuple[float, ...], field("coefficients of the numerator, highest power of s first", "")
    ]
    denominator: Annotated[
        tuple[float, ...], field("coefficients of the denominator, highest power first", "")
    ]

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, values in (("numerator", self.numerator), ("denominator", self.denominator)):
            for i, value in enumerate(values):
                if 0.0 < abs(value) < LEAST:
                    raise InputError(
                        f"{name}[{i}] = {value!r} is smaller than {LEAST:g}, which double "
                        "precision cannot compute with; write 0.0 if nothing is meant."
                    )
        top, bottom = (
            np.trim_zeros(np.asarray(c), "f") for c in (self.numerator, self.denominator)
        )
        if bottom.size == 0:
            raise InputError(
                f"denominator = {list(self.denominator)} is zero; give [1.0] for a plain gain."
            )
        if top.size > bottom.size:
            raise InputError(
                f"numerator = {list(self.numerator)} has a higher power of s than denominator = "
                f"{list(self.denominator)}, which no controller can realise; add a pole beyond the "
                "band, for example denominator = [0.01, 1.0]."
            )

    def response(self, s: Response) -> Response:
        """Its value at `s`; at a pole that `s` meets exactly, that beside it."""
        bottom = np.polyval(self.denominator, s)
        beside = np.polyval(self.denominator, s * (1.0 + BESIDE))
        return np.polyval(self.numerator, s) / np.where(bottom == 0.0, beside, bottom)


class Loop(Filter, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One loop of a controller, `input = -K(s) output`: negative feedback.

    Loops on one input add up.

    Example:
        >>> import beamchain as bc
        >>> loop = bc.spec.Loop(
        ...     input="torque_z",
        ...     output="rate_z",
        ...     numerator=(40.0,),
        ...     denominator=(1.0,),
        ...     delay=0.02,
        ... )
        >>> loop.delay
        0.02
    """

    input: Annotated[str, field("input of the plant that the loop drives")]
    output: Annotated[str, field("output of the plant that the loop measures")]
    delay: Annotated[float, field("dead time of the loop", "s", least=0.0)] = 0.0
    actuator: Annotated[Filter | None, field("dynamics of the actuator")] = None
    sensor: Annotated[Filter | None, field("dynamics of the sensor")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if 0.0 < self.delay < SHORTEST:
            raise InputError(
                f"delay = {self.delay!r} s is shorter than {SHORTEST:g} s, nothing for a plant; "
                "write 0.0."
            )

    @property
    def parts(self) -> list[Filter]:
        """Controller, actuator and sensor."""
        return [self, *(part for part in (self.actuator, self.sensor) if part is not None)]


class Controller(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The loops of a controller, as a file states them.

    Example:
        >>> import beamchain as bc
        >>> rate = bc.spec.Loop(
        ...     input="torque_z", output="rate_z", numerator=(40.0,), denominator=(1.0,)
        ... )
        >>> len(bc.spec.Controller(loop=(rate,)).loop)
        1
    """

    loop: Annotated[tuple[Loop, ...], field("the loops, one [[loop]] each")]
    allocation: Annotated[
        dict[str, Allocation],
        field("inputs NAME_x, NAME_y, NAME_z: torque on a body, distributed over actuators"),
    ] = msgspec.field(default_factory=dict[str, Allocation])
    alignment: Annotated[
        dict[str, Alignment],
        field("outputs NAME_x, NAME_y, NAME_z: a sensor in the axes of a body"),
    ] = msgspec.field(default_factory=dict[str, Alignment])

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind, table in (("allocation", self.allocation), ("alignment", self.alignment)):
            for name in table:
                if not name or re.search(r"\s", name):
                    words = "_".join(name.split()) or "NAME"
                    raise InputError(
                        f"{kind}: the table's name {name!r} becomes the name of signals, which has "
                        f"no blanks; write [{kind}.{words}]."
                    )


def read_controller(path: str | Path | Controller) -> Controller:
    """Read a controller from TOML; one that was read already is returned.

    Raises:
        InputError: the file cannot be read, or a value is not allowed.
    """
    return read_struct(path, Controller, "controller", "a TOML file with [[loop]]")


def signals_with(
    controller: Controller, inputs: Sequence[str] | None, outputs: Sequence[str] | None
) -> tuple[InputNames, OutputNames]:
    """Inputs and outputs of a plant for a controller: the names asked for, and those that it
    combines; the combined ones alone where no name is asked for.

    Raises:
        InputError: a combination has the name of another input or output.
    """
    for kind, table, names in (
        ("allocation", controller.allocation, inputs or ()),
        ("alignment", controller.alignment, outputs or ()),
    ):
        if twice := [name for name in table if name in names]:
            raise InputError(
                f"[{kind}.{twice[0]}] of the controller has the name of a signal that is asked for "
                "as well; give the table another name."
            )
    driven = dict.fromkeys(inputs or ()) | controller.allocation
    seen = dict.fromkeys(outputs or ()) | controller.alignment
    return (
        {name: what or name for name, what in driven.items()} if controller.allocation else inputs,
        {name: what or name for name, what in seen.items()} if controller.alignment else outputs,
    )


def places(
    controller: Controller, inputs: list[str], outputs: list[str]
) -> tuple[list[int], list[int]]:
    """Outputs and inputs of a plant that the loops take, by number."""
    if not controller.loop:
        raise InputError(
            "the controller has no loop; give at least one [[loop]] with input, output, numerator, "
            "denominator."
        )
    rows = [place(loop.output, outputs, "output") for loop in controller.loop]
    columns = [place(loop.input, inputs, "input") for loop in controller.loop]
    return rows, columns


def place(name: str, labels: list[str], kind: str, of: str = "loop.") -> int:
    """Number of a signal of a plant."""
    if name not in labels:
        raise InputError(
            f"{of}{kind} = {name!r} is no {kind} of the plant; choose from {', '.join(labels)}."
        )
    return labels.index(name)


def loop_response(loop: Loop, s: Response) -> Response:
    """`K(s)` of a loop, with all its parts and its dead time."""
    with np.errstate(all="ignore"):
        out = np.prod([part.response(s) for part in loop.parts], axis=0) * np.exp(-s * loop.delay)
    _check_finite(loop, out)
    return out


def _check_finite(loop: Loop, *values: NDArray[Any]) -> None:
    """Refuse a loop that double precision cannot compute with."""
    if not all(np.all(np.isfinite(value)) for value in values):
        raise InputError(
            f"the loop from {loop.output!r} to {loop.input!r} has coefficients so far apart that "
            "double precision cannot compute with them; leave out those that do not matter in its "
            "band."
        )


def realise(controller: Controller, order: int = ORDER) -> System:
    """All loops side by side, dead times as Pade approximations of an order."""
    return side_by_side(_balance(loop, order) for loop in controller.loop)


def takes_time(controller: Controller) -> bool:
    """Whether a loop has a pole or a dead time, so that it is continuous."""
    return any(_balance(loop, ORDER)[0].size for loop in controller.loop)


def _companion(top: Array, bottom: Array) -> System:
    """A, B, C, D of a proper transfer function, in controllable form,
    however small its first coefficients are."""
    n = bottom.size - 1
    bottom, top = bottom / bottom[0], np.append(np.zeros(n + 1 - top.size), top) / bottom[0]
    a = np.eye(n, k=-1)
    a[0] = -bottom[1:]
    b = np.eye(n, 1)
    # top/bottom = top[0] + (top - top[0] bottom)/bottom, whose numerator is of lower degree
    c = (top - top[0] * bottom)[None, 1:]
    return a, b, c, top[None, :1]


def _balance(loop: Loop, order: int) -> System:
    """One loop as states."""
    fractions = (
        control.pade(loop.delay, order),
        *((part.numerator, part.denominator) for part in loop.parts),
    )
    tops, bottoms = zip(*fractions, strict=True)
    top, bottom = (
        np.trim_zeros(reduce(np.polymul, polynomials), "f") for polynomials in (tops, bottoms)
    )
    with np.errstate(all="ignore"):
        parts = realise_fraction(top, bottom)
    _check_finite(loop, *parts)
    return parts


def realise_fraction(top: Array, bottom: Array) -> System:
    """A, B, C, D of a proper transfer function with its states scaled alike; the companion form
    alone of a delay has entries as large as the delay to the power -6.

    What double precision cannot compute is NaN.
    """
    if bottom.size == 1:
        gain = np.full((1, 1), (top.sum() / bottom)[0])
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), gain
    a, b, c, d = _companion(top, bottom)
    whole = np.block([[a, b], [c, np.zeros((1, 1))]])
    if not np.all(np.isfinite(whole)):
        return a, b, c, np.full((1, 1), np.nan)
    scale = balancing(whole)
    ratio = scale[:-1] / scale[-1]
    return a * ratio / ratio[:, None], b / ratio[:, None], c * ratio, d
