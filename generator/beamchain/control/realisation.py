"""What `bc.plant` hands out: a `control.StateSpace` in modal form, with units, modal data,
export and the exact plant."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamchain.checks import finite_array
from beamchain.control.export import write_arrays
from beamchain.control.source import NO_EXACT, PlantSource
from beamchain.control.state_space import StateSpace
from beamchain.craft.modal_form import ModalForm
from beamchain.engine.allocation import Allocated
from beamchain.engine.library import one_thread
from beamchain.engine.signals import control_names
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked
from beamchain.steps.step_map import TimeError


class Plant(StateSpace):
    """A spacecraft as `control.StateSpace`, in modal form, with names and units;
    made by `bc.plant`.

    A, B, C and D are read-only. `input_labels`, `output_labels` and `state_labels` are control's,
    which takes no point in a name and has `_` there; `input_names`, `output_names` and
    `state_names` are those of the spacecraft. Units stand in `input_units`, `output_units` and
    `state_units`; `modes` are the names of the flexible modes.

    Args:
        form: what is kept of the craft's modal form; its states are those of the plant.
        signals: labels of inputs and outputs, and their units.
        modes: names of the flexible modes that are kept,
            ascending in frequency at the operating point.
        warnings: what was left out.
        source: what it was made of; None of a plant with all modes of the appendages.
        unreached: names of the flexible modes that were taken out, since no input drives them or no
            output sees them.
        oscillators: the form in which each mode is two states; `form` where left out.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> shipped = files("beamchain") / "examples"
        >>> arrays = {"left": shipped / "array.toml", "right": shipped / "array.toml"}
        >>> plant = bc.plant(
        ...     bc.embed(shipped / "satellite.xml", arrays), ["torque:bus"], ["attitude"]
        ... )
        >>> plant.modes[:2], plant.frequency.shape, plant.gain.shape
        (('array_left_mode1_xy', 'array_right_mode1_xy'), (6,), (6, 3, 3))
        >>> error = plant.truncation(
        ...     [1.0, 100.0]
        ... )  # (outputs, inputs, k): far beyond the kept modes it is large
    """

    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    state_units: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    modes: tuple[str, ...]
    warnings: tuple[str, ...]
    unreached: tuple[str, ...]
    source: PlantSource | None

    def __init__(
        self,
        form: ModalForm,
        signals: Sequence[Sequence[str]],
        modes: Sequence[str],
        warnings: Sequence[str] = (),
        source: PlantSource | None = None,
        unreached: Sequence[str] = (),
        oscillators: ModalForm | None = None,
    ) -> None:
        self.state_names, self.state_units = tuple(form.names), tuple(form.units)
        self.input_names, self.output_names = tuple(signals[0]), tuple(signals[1])
        self.input_units, self.output_units = tuple(signals[2]), tuple(signals[3])
        self.modes, self.warnings = tuple(modes), tuple(warnings)
        self.source = source
        self._oscillators = oscillators or form
        self.unreached = tuple(unreached)
        super().__init__(
            form.a,
            form.b,
            form.c,
            form.d,
            0 if source is None or source.step is None else source.step,
            name="plant",
            states=control_names(self.state_names),
            inputs=control_names(self.input_names),
            outputs=control_names(self.output_names),
            remove_useless_states=False,
        )
        for name in "ABCD":
            setattr(self, name, locked(getattr(self, name)))

    def __repr__(self) -> str:
        when = f"{self.dt:g} s steps" if self.dt else "continuous"
        few = ", ".join(f"{w:.4g}" for w in self.frequency[:3]) + (
            ", ..." if len(self.modes) > 3 else ""
        )
        return (
            f"<Plant, {self.ninputs} inputs, {self.noutputs} outputs, {self.nstates} states, "
            f"{when}; modes: {few} rad/s>"
        )

    @property
    def allocations(self) -> Mapping[str, Allocated]:
        """What allocations among the inputs are in this pose, by name."""
        return {} if self.source is None else self.source.allocations

    @property
    def pose(self) -> str:
        """What its pose is called, joints in degrees or metres; empty where none was asked for."""
        return "" if self.source is None else self.source.label

    def _poles(self) -> NDArray[np.complex128]:
        """A pole `s` per flexible mode, the one above the real axis."""
        out: list[complex] = []
        for name in self.modes:
            pole = self._oscillators.poles_of(name)
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
        """`(modes, outputs, inputs)` modal gains:
        size of the mode's numerator over `s^2 + 2 zeta w s + w^2`, at `s = jw`.

        Divided by the size of that polynomial they are the mode's share of the response at its own
        frequency, of a discrete plant too (at `z = exp(jwh)`), so that the gains of a plant and of
        its discrete form can be compared.
        """
        a, b, c = self._oscillators.a, self._oscillators.b, self._oscillators.c
        # states that hold an input until the next step: their rows of A are empty
        holding = np.flatnonzero(~a.any(axis=1)) if self.dt else np.empty(0, dtype=np.intp)
        out = np.zeros((len(self.modes), self.noutputs, self.ninputs))
        for k, name in enumerate(self.modes):
            at = self._oscillators.states_of(name)
            s = 1j * self.frequency[k]
            z = np.exp(s * self.dt) if self.dt else s
            block = a[np.ix_(at, at)]
            driven = b[at] + a[at][:, holding] @ b[holding] / z
            # (z - a)^-1 = adj(z - a) / det(z - a)
            adjugate = np.array([[z - block[1, 1], block[0, 1]], [block[1, 0], z - block[0, 0]]])
            numerator = c[:, at] @ adjugate @ driven
            if self.dt:
                poles = self._oscillators.poles_of(name)
                numerator = numerator / _zero_pole_product(poles, z, self.dt)
            out[k] = np.abs(numerator)
        return locked(out)

    @cached_property
    def _at_step(self) -> "tuple[TimeError | None, float | None]":
        return (None, None) if self.source is None else self.source.step_errors()

    @property
    def time_error(self) -> "TimeError | None":
        """The largest error of a coupled pole of the sampled plant, read back from MuJoCo's step;
        None: continuous."""
        return self._at_step[0]

    @property
    def sampled_error(self) -> float | None:
        """In-band error of the base body's motion at the samples; None: continuous,
        or the exact appendages are not known."""
        return self._at_step[1]

    @property
    def exact(self) -> "Plant":
        """The same plant with all modes of the appendages, continuous;
        those far above the kept ones gathered.

        Raises:
            InputError: the plant was made from a file, or a signal belongs to an appendage.
        """
        return self._beyond(float(np.max(self.frequency, initial=0.0)))

    @one_thread()
    def _beyond(self, omega: float) -> "Plant":
        if self.source is None:
            raise InputError(f"exact: {NO_EXACT}")
        true = self.source.exact(omega)
        kept = true.form().minimal()
        return Plant(kept, self.source.craft.signals, kept.oscillators(true.mode_names))

    @one_thread()
    def truncation(self, omega: ArrayLike) -> Array:
        """`(outputs, inputs, k)` error that leaving modes out makes, `|G - G_exact|/|G_exact|`,
        channel by channel.

        The multiplicative uncertainty of the plant;
        of a discrete plant the step's effect is in it too.

        Args:
            omega: `(k,)` [rad/s].

        Raises:
            InputError: as for `exact`, or a frequency is not finite.
        """
        at = np.atleast_1d(finite_array("omega", omega, (), (None,), unit="rad/s"))
        true = self._beyond(float(at.max(initial=0.0)))(1j * at, squeeze=False)
        ours = self(np.exp(1j * at * self.dt) if self.dt else 1j * at, squeeze=False)
        size = np.abs(true)
        # a channel that is none
        return locked(np.abs(ours - true) / np.maximum(size, 1e-12 * size.max(axis=(0, 1))))

    def record(self) -> dict[str, Any]:
        """What `write` writes: A, B, C, D, Ts (0: continuous),
        names and units in MATLAB's words."""
        return {
            "A": self.A,
            "B": self.B,
            "C": self.C,
            "D": self.D,
            "Ts": float(self.dt or 0.0),
            "InputName": list(self.input_names),
            "OutputName": list(self.output_names),
            "StateName": list(self.state_names),
            "InputUnit": list(self.input_units),
            "OutputUnit": list(self.output_units),
            "StateUnit": list(self.state_units),
            "ModeName": list(self.modes),
            "Frequency": self.frequency,
            "DampingRatio": self.damping_ratio,
        }

    def write(
        self, path: str | Path, *, force: bool = False, also: Mapping[Path, str] | None = None
    ) -> Path:
        """Write the plant to `.npz`, `.json` or `.mat`, whole or not at all.

        In MATLAB: `p = load("plant.mat"); G = ss(p.A, p.B, p.C, p.D, p.Ts, InputName=p.InputName)`.

        Args:
            path: its ending says the format.
            force: replace a file that exists.
            also: further files to write with it, content by path; all or none.

        Raises:
            InputError: the ending is none of these.
            OutputError: the file exists and `force` is False, or cannot be written.
        """
        return write_arrays(path, self.record(), force=force, also=also)


def _zero_pole_product(poles: NDArray[np.complex128], z: complex, step: float) -> complex:
    """`prod (z - z_i) / (s - s_i)` for `z = exp(s h)` and discrete poles `z_i = exp(s_i h)`.

    Each factor is `h z_i (exp(x) - 1)/x` with `x = (s - s_i) h`,
    which is finite at an undamped pole itself.
    """
    out = 1.0 + 0.0j
    for pole in poles:
        x = np.log(z) - np.log(pole)
        out *= step * pole * (np.expm1(x) / x if x else 1.0)
    return complex(out)
