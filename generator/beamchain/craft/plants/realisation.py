"""What `bc.plant` hands out: a `control.StateSpace` in modal form, with units, modal data, export and the exact plant."""

from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamchain.craft.plants.export import write
from beamchain.craft.plants.modal_form import ModalForm
from beamchain.craft.robust.uncertain_plant import UncertainPlant
from beamchain.errors import InputError
from beamchain.fitting.uncertain import UncertainCraft, read_uncertain
from beamchain.ports.motions import Array, locked

NO_EXACT = (
    "the model is only a file, which does not hold the modes that its chains leave out; give what bc.embed returns."
)
SAMPLED = "uncertain plants are continuous; leave discrete out."


class Plant(control.StateSpace):
    """A spacecraft as `control.StateSpace`, in modal form, with names and units; made by `bc.plant`.

    A, B, C and D are read-only. `input_labels`, `output_labels` and `state_labels` are control's, their units stand in
    `input_units`, `output_units` and `state_units`; `modes` are the names of the flexible modes.

    Args:
        form: what is kept of the craft's modal form.
        signals: labels of inputs and outputs, and their units.
        modes: names of the flexible modes that are kept, ascending in frequency at the operating point.
        warnings: what was left out.
        timestep: [s]; None: continuous.
        exact: makes the plant with all modes of the appendages up to a frequency; or why there is none.
        uncertain: makes the uncertain plant; or why there is none.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> shipped = files("beamchain") / "examples"
        >>> arrays = {"left": shipped / "array.toml", "right": shipped / "array.toml"}
        >>> plant = bc.plant(bc.embed(shipped / "satellite.xml", arrays), ["torque:bus"], ["attitude"])
        >>> plant.modes[:2], plant.frequency.shape, plant.gain.shape
        (('array_left_mode1_xy', 'array_right_mode1_xy'), (6,), (6, 3, 3))
        >>> error = plant.truncation([1.0, 100.0])  # (outputs, inputs, k): far beyond the kept modes it is large
    """

    state_units: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    modes: tuple[str, ...]
    warnings: tuple[str, ...]

    def __init__(
        self,
        form: ModalForm,
        signals: Sequence[Sequence[str]],
        modes: Sequence[str],
        warnings: Sequence[str] = (),
        timestep: float | None = None,
        exact: "Callable[[float], Plant] | str" = NO_EXACT,
        uncertain: "Callable[[UncertainCraft | None], UncertainPlant] | str" = SAMPLED,
    ) -> None:
        self.state_units = tuple(form.units)
        self.input_units, self.output_units = tuple(signals[2]), tuple(signals[3])
        self.modes, self.warnings, self._exact, self._uncertain = tuple(modes), tuple(warnings), exact, uncertain
        super().__init__(
            form.a, form.b, form.c, form.d, 0 if timestep is None else timestep, name="plant", states=list(form.names),
            inputs=list(signals[0]), outputs=list(signals[1]), remove_useless_states=False,
        )  # fmt: skip
        for name in "ABCD":
            setattr(self, name, locked(getattr(self, name)))

    def __repr__(self) -> str:
        when = f"{self.dt:g} s steps" if self.dt else "continuous"
        few = ", ".join(f"{w:.4g}" for w in self.frequency[:3]) + (", ..." if len(self.modes) > 3 else "")
        return f"<Plant, {self.ninputs} inputs, {self.noutputs} outputs, {self.nstates} states, {when}; modes: {few} rad/s>"

    def _matrix(self, name: str) -> Array:
        return np.asarray(getattr(self, name), dtype=np.float64)

    def _states(self, mode: str) -> list[int]:
        return [list(self.state_labels).index(word) for word in (mode, f"{mode}_rate")]

    def _poles(self) -> NDArray[np.complex128]:
        """A pole `s` per flexible mode, the one above the real axis."""
        out: list[complex] = []
        for name in self.modes:
            at = self._states(name)
            pole = np.linalg.eigvals(self._matrix("A")[np.ix_(at, at)]).astype(np.complex128)
            pole = np.log(pole) / self.dt if self.dt else pole
            out.append(complex(pole[np.argmax(pole.imag)]))
        return np.array(out, dtype=np.complex128)

    @cached_property
    def frequency(self) -> Array:
        """`(modes,)` frequencies of the flexible modes, `|s|` [rad/s]."""
        return locked(np.abs(self._poles()))

    @cached_property
    def damping_ratio(self) -> Array:
        """`(modes,)` damping ratios of the flexible modes."""
        return locked(-self._poles().real / np.abs(self._poles()))

    @cached_property
    def gain(self) -> Array:
        """`(modes, outputs, inputs)` modal gains: size of the mode's numerator over `s^2 + 2 zeta w s + w^2`, at `s = jw`.

        Of a discrete plant they belong to its own matrices in z, and cannot be compared with those of a continuous one.
        """
        out = np.zeros((len(self.modes), self.noutputs, self.ninputs))
        for k, name in enumerate(self.modes):
            at = self._states(name)
            b, c = self._matrix("B")[at], self._matrix("C")[:, at]
            s = 1j * self.frequency[k]
            out[k] = np.abs(np.outer(c[:, 0] + s * c[:, 1], b[1]) + np.outer(c[:, 0] * s + 0.0, b[0]))
        return locked(out)

    @property
    def exact(self) -> "Plant":
        """The same plant with all modes of the appendages, continuous; those far above the kept ones gathered.

        Raises:
            InputError: the plant was made from a file, or a signal belongs to an appendage.
        """
        return self._beyond(float(np.max(self.frequency, initial=0.0)))

    def _beyond(self, omega: float) -> "Plant":
        if isinstance(self._exact, str):
            raise InputError(f"exact: {self._exact}")
        return self._exact(omega)

    def truncation(self, omega: ArrayLike) -> Array:
        """`(outputs, inputs, k)` error that leaving modes out makes, `|G - G_exact|/|G_exact|`, channel by channel.

        The multiplicative uncertainty of the plant; of a discrete plant the step's effect is in it too.

        Args:
            omega: `(k,)` [rad/s].

        Raises:
            InputError: as for `exact`.
        """
        at = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        true = self._beyond(float(at.max(initial=0.0)))(1j * at, squeeze=False)
        ours = self(np.exp(1j * at * self.dt) if self.dt else 1j * at, squeeze=False)
        size = np.abs(true)
        return locked(np.abs(ours - true) / np.maximum(size, 1e-12 * size.max(axis=(0, 1))))  # a channel that is none

    def uncertain(self, uncertain: "UncertainCraft | str | Path | None" = None) -> UncertainPlant:
        """The plant with its uncertain quantities pulled out: a linear fractional transformation.

        Args:
            uncertain: of the craft, or the path of its file; of what `bc.embed` returned, [uncertain] of the specifications
                holds for the modes that it does not name.

        Raises:
            InputError: the plant is discrete, nothing is uncertain, a name is unknown, a range is impossible, or a signal
                depends on a quantity otherwise than through the craft's motion.
        """
        if isinstance(self._uncertain, str):
            raise InputError(f"uncertain: {self._uncertain}")
        return self._uncertain(None if uncertain is None else read_uncertain(uncertain))

    def record(self) -> dict[str, Any]:
        """What `write` writes: A, B, C, D, Ts (0: continuous), names and units in MATLAB's words."""
        return {
            "A": self.A, "B": self.B, "C": self.C, "D": self.D, "Ts": float(self.dt or 0.0),
            "InputName": self.input_labels, "OutputName": self.output_labels, "StateName": self.state_labels,
            "InputUnit": list(self.input_units), "OutputUnit": list(self.output_units), "StateUnit": list(self.state_units),
            "ModeName": list(self.modes), "Frequency": self.frequency, "DampingRatio": self.damping_ratio,
        }  # fmt: skip

    def write(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the plant to `.npz`, `.json` or `.mat`, whole or not at all.

        In MATLAB: `p = load("plant.mat"); G = ss(p.A, p.B, p.C, p.D, p.Ts, InputName=p.InputName)`.

        Args:
            path: its ending says the format.
            force: replace a file that exists.

        Raises:
            InputError: the ending is none of these.
            OutputError: the file exists and `force` is False, or cannot be written.
        """
        return write(path, self.record(), force=force)
