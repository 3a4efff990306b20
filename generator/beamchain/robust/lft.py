"""The plant with its uncertain quantities pulled out: `w = Delta z` around a nominal M,
proved against changed models."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import control
import numpy as np
from numpy.typing import ArrayLike

from beamchain.checks import as_array, finite_array, number, unknown, whole_number
from beamchain.errors import InputError
from beamchain.robust.delta_channels import channels
from beamchain.spec import Correlation
from beamchain.toolkit import (
    Array,
    LinearCraft,
    PlantSource,
    Quantity,
    StateSpace,
    System,
    apply,
    control_names,
    draws,
    locked,
    mujoco,
    one_thread,
    response,
    with_deltas,
    write_arrays,
)

PROVED = 1e-8  # relative, channel by channel, of a sample against the model with those properties
LARGEST = 2**31  # seed or number of samples
PRINTED = 5e-6  # relative, to which tables print values: the end of a range may be typed back
ROUNDING = 1e-10  # of a channel beside the largest of its output


class Block(NamedTuple):
    """A real number delta in [-1, 1], as often as it stands on the diagonal of Delta.

    Args:
        name: of its quantity, or what its quantities have in common.
        repetitions: of delta.
        quantities: names of what it moves: `nominal + reach delta` each.
        nominal, reach: of every quantity.
        unit: of the quantities.
    """

    name: str
    repetitions: int
    quantities: tuple[str, ...]
    nominal: Array
    reach: Array
    unit: str


class Lft:
    """A plant whose uncertain quantities stand in a diagonal Delta: `[z, y] = M [w, u]`,
    `w = Delta z`."""

    quantities: tuple[Quantity, ...]
    warnings: tuple[str, ...]
    blocks: tuple[Block, ...]
    inputs: list[str]
    outputs: list[str]
    units: tuple[list[str], list[str]]
    nominal: control.StateSpace

    def __init__(
        self,
        source: PlantSource,
        quantities: Sequence[Quantity],
        correlations: Sequence[Correlation],
        warnings: Sequence[str],
    ) -> None:
        craft = source.craft
        self.quantities = tuple(quantities)
        self.warnings = tuple(warnings)
        self._source = source
        self._correlations = tuple(correlations)
        keys = [(q.key, q.uncertainty.distribution) for q in quantities]
        groups = list(dict.fromkeys(keys))
        self._group = np.array([groups.index(key) for key in keys], dtype=np.intp)
        collected = channels(craft, quantities)
        of = collected.of
        order = sorted(range(len(of)), key=lambda i: (self._group[of[i]], of[i], i))
        self._of = np.array([of[i] for i in order], dtype=np.intp)
        reach = np.array([quantities[i].reach for i in of])
        linear = collected.add_to(craft.linear, order, reach)
        self.blocks = tuple(self._block(number) for number in range(len(groups)))
        self._prove(linear.first_order())
        form = replace(craft, linear=linear).form().minimal()
        self._system: System = form.a, form.b, form.c, form.d
        names = [q.name.replace(".", "_") for q in quantities]  # control takes no points
        words = [f"{names[i]}_{list(self._of[:k]).count(i) + 1}" for k, i in enumerate(self._of)]
        w, z = ([f"{kind}_{word}" for word in words] for kind in "wz")
        self.inputs, self.outputs, *units = craft.signals
        self.units = units[0], units[1]
        self._states = list(form.names)
        self._names = w + self.inputs, z + self.outputs
        self.nominal = self._space(self._system, *self._names)

    def __repr__(self) -> str:
        what = ", ".join(f"{block.name} x{block.repetitions}" for block in self.blocks)
        return (
            f"<UncertainPlant, {len(self.inputs)} inputs, {len(self.outputs)} outputs, "
            f"{len(self._states)} states; {what}>"
        )

    def _block(self, number: int) -> Block:
        members = [self.quantities[i] for i in np.flatnonzero(self._group == number)]
        name = members[0].name if len(members) == 1 else members[0].key
        repetitions = int(np.sum(self._group[self._of] == number))
        nominal = locked([q.nominal for q in members])
        reach = locked([q.reach for q in members])
        return Block(
            name, repetitions, tuple(q.name for q in members), nominal, reach, members[0].unit
        )

    def _space(self, system: System, inputs: list[str], outputs: list[str]) -> control.StateSpace:
        return StateSpace(
            *system,
            0,
            name="uncertain",
            states=control_names(self._states),
            inputs=control_names(inputs),
            outputs=control_names(outputs),
            remove_useless_states=False,
        )

    def values(self, deltas: ArrayLike) -> dict[str, float]:
        """Values of all quantities for `(blocks,)` deltas."""
        each = finite_array("deltas", deltas, (len(self.blocks),))[self._group]
        return {
            q.name: q.nominal + float(d) * q.reach
            for q, d in zip(self.quantities, each, strict=True)
        }

    def _deltas(self, values: "Mapping[str, float] | ArrayLike") -> Array:
        """`(quantities,)` deltas."""
        if isinstance(values, Mapping):
            names = [q.name for q in self.quantities]
            if wrong := [name for name in values if name not in names]:
                raise unknown("values", wrong[0], names)
            for q in self.quantities:
                value = number(q.name, values.get(q.name, q.nominal), q.unit)
                if abs(value - q.nominal) > q.reach + PRINTED * abs(value):
                    raise InputError(
                        f"{q.name} = {value:.9g} is outside its range, {q.nominal - q.reach:.9g} "
                        f"to {q.nominal + q.reach:.9g}; give a value in it, or a wider uncertainty."
                    )
            given = [float(values.get(q.name, q.nominal)) for q in self.quantities]
            pairs = zip(given, self.quantities, strict=True)
            deltas = np.array([(value - q.nominal) / q.reach for value, q in pairs])
            return np.clip(deltas, -1.0, 1.0)
        deltas = as_array("values", values)
        if deltas.shape != (len(self.blocks),) or not np.all(np.abs(deltas) <= 1.0 + ROUNDING):
            raise InputError(
                f"values = {values!s:.60} has the shape {deltas.shape}; give {{name: value}}, or a "
                f"delta for each of the {len(self.blocks)} blocks, finite, between -1 and 1."
            )
        return deltas[self._group]

    @one_thread()
    def sample(self, values: "Mapping[str, float] | ArrayLike") -> control.StateSpace:
        """The plant with other values of its uncertain quantities,
        its states and signals as before.

        Args:
            values: by name of the quantity, nominal where left out; or `(blocks,)` deltas.

        Raises:
            InputError: there is no such quantity.
        """
        return self._space(
            with_deltas(self._system, self._deltas(values)[self._of]), self.inputs, self.outputs
        )

    def draw(self, count: int, seed: int = 0) -> list[dict[str, float]]:
        """Values of the quantities in `count` samples,
        as the file of uncertainties says they are distributed."""
        whole_number("count", count, 0, LARGEST)
        whole_number("seed", seed, 0, LARGEST)
        table = draws(self.quantities, range(count), seed, self._correlations)
        return [
            {q.name: float(v) for q, v in zip(self.quantities, row, strict=True)} for row in table
        ]

    @one_thread()
    def model(self, values: "Mapping[str, float] | ArrayLike") -> "mujoco.MjModel":
        """The compiled model with those values in its fields: in free fall, without time,
        what the samples describe."""
        return self._again(self._deltas(values)).point.model

    def _again(self, each: Array) -> LinearCraft:
        model = copy(self._source.craft.point.model)
        values = [
            q.nominal + float(d) * q.reach for q, d in zip(self.quantities, each, strict=True)
        ]
        apply(model, self.quantities, np.array(values))
        return self._source.again(model)

    def write(self, path: str | Path, *, force: bool = False) -> Path:
        """Write M with its blocks to `.npz`, `.json` or `.mat`;
        w and z stand before the plant's own signals.

        Args:
            path: its ending says the format.
            force: replace a file that exists.
        """
        record = {
            **dict(zip("ABCD", self._system, strict=True)),
            "Ts": 0.0,
            "InputName": self._names[0],
            "OutputName": self._names[1],
            "StateName": self._states,
            "InputUnit": self.units[0],
            "OutputUnit": self.units[1],
            "BlockName": [block.name for block in self.blocks],
            "BlockRepetitions": [block.repetitions for block in self.blocks],
            "QuantityName": [q.name for q in self.quantities],
            "QuantityUnit": [q.unit for q in self.quantities],
            "QuantityBlock": [int(group) + 1 for group in self._group],
            "Nominal": [q.nominal for q in self.quantities],
            "Reach": [q.reach for q in self.quantities],
        }
        return write_arrays(path, record, force=force)

    def _prove(self, system: System) -> None:
        """One sample, in the whole craft's own coordinates,
        against the model with those properties."""
        modes = self._source.craft.modes.frequency
        s = (np.geomspace(0.2 * modes.min(), 2.0 * modes.max(), 7) * (0.3 + 1.0j)).astype(
            np.complex128
        )

        def off(each: Array) -> tuple[float, int]:
            ours = response(with_deltas(system, each[self._of]), s)
            true = response(self._again(each).linear.first_order(), s)
            size = np.abs(true) + ROUNDING / PROVED * np.abs(true).max(axis=2, keepdims=True)
            error = (np.abs(ours - true) / np.maximum(size, 1e-300)).max(axis=(0, 2))
            return float(error.max(initial=0.0)), int(np.argmax(error))

        n = len(self.quantities)
        trial = np.random.default_rng(0).uniform(-1.0, 1.0, len(self.blocks))[self._group]
        if off(trial)[0] <= PROVED:
            return
        for k in range(n):
            error, row = off(np.where(np.arange(n) == k, trial, 0.0))
            if error > PROVED:
                label = self._source.craft.signals[1][row]
                raise InputError(
                    f"uncertain: output {label!r} depends on {self.quantities[k].name} otherwise "
                    f"than through the motion of the craft (off by {error:.2g}): a sensor that "
                    "reads it, or a body that turns; leave one of the two out."
                )
        raise InputError(
            "uncertain: the quantities act together in a way that is not linear fractional; vary "
            "fewer."
        )
