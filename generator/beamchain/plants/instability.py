"""Why a closed loop is unstable: its growing poles, what each grows from, and which loop is to
blame."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

Kind = Literal["mode", "rigid", "controller", "state", "several"]
WORDS: Mapping[str, str] = MappingProxyType(
    {"mode": "", "rigid": "rigid motion ", "controller": "", "state": "state ", "several": ""}
)


@dataclass(frozen=True)
class Instability:
    """A pole, or a pair of poles, of a closed loop that grows.

    Args:
        pole: `s` [rad/s], above or on the real axis; of a sampled loop `log(z)/T`.
        origin: what it grows from as the gains of all loops rise from 0 to 1: the name of a mode
            of the plant, of a rigid motion or of another state, or `the controller`.
        kind: which of these it is; `several` of a pair that meets other poles on the real axis on
            its way, so that each of the two has an origin of its own.
        gain: factor of the gains of all loops from which on it grows; 0: from the smallest on.
        crossing: frequency at which it crosses the axis [rad/s]; infinite where it comes back from
            infinity, at a gain that leaves the direct parts of plant and controller no solution,
            `det(1 + L) = 0` at infinite frequency.
        alone: inputs whose loop makes it grow with all others open, and the factor of that loop's
            gain from which on it does.
        stable_without: inputs whose loop ends the growth where it alone is opened.
        timestep: [s] of a sampled loop; 0: continuous.

    Example:
        >>> import beamchain as bc, control
        >>> plant = control.ss([[0.0, 1.0], [-4.0, -0.02]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
        >>> controller = control.tf([2.0], [1.0, 1.0])
        >>> found = bc.margins(plant, controller).instabilities[0]
        >>> round(found.frequency, 3), list(found.alone), found.origin
        (2.111, ['u[0]'], 'x[0]')
    """

    pole: complex
    origin: str
    kind: Kind
    gain: float
    crossing: float
    alone: Mapping[str, float]
    stable_without: tuple[str, ...]
    timestep: float

    @property
    def frequency(self) -> float:
        """`|s|` [rad/s]."""
        return abs(self.pole)

    @property
    def hertz(self) -> float:
        """The same [Hz]."""
        return self.frequency / math.tau

    @property
    def damping_ratio(self) -> float:
        """Below zero."""
        return -self.pole.real / abs(self.pole)

    @property
    def time_constant(self) -> float:
        """In which it grows by a factor e [s]."""
        return 1.0 / self.pole.real

    @property
    def causes(self) -> tuple[str, ...]:
        """The inputs whose loops are to blame: those that alone make it grow, else those without
        which it ends; none: all together."""
        return tuple(self.alone) or self.stable_without

    @property
    def sentence(self) -> str:
        """All of it in words."""
        rings = abs(self.pole.imag) > 1e-9 * abs(self.pole)
        how = f"{self.hertz:.3g} Hz, {self.frequency:.4g} rad/s" if rings else "without oscillation"
        pushed = not rings and 0.0 in (self.gain, *self.alone.values())
        sign = "; is the sign of the numerators right?" if pushed else "."
        what = f"{WORDS[self.kind]}{self.origin}"
        return (
            f"UNSTABLE: {what} ({how}) grows with time constant {self.time_constant:.3g} s; "
            f"{self._blame()}{self._endless()}{sign}"
        )

    def _endless(self) -> str:
        if self.crossing < math.inf:
            return ""
        return (
            f"; at {self.gain:.3g} of the gains of all loops their direct parts have no solution, "
            "1 + L = 0 at infinite frequency"
        )

    def _blame(self) -> str:
        if self.alone:
            each = [
                f"the loop {name} alone makes it so, {_since(factor, 'its gain')}"
                for name, factor in self.alone.items()
            ]
            return " and ".join(each)
        text = f"no loop alone makes it so, all together do, {_since(self.gain, 'their gains')}"
        if self.stable_without:
            text += f", and not without {' or '.join(self.stable_without)}"
        return text

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "pole": [self.pole.real, self.pole.imag],
            "frequency": self.frequency,
            "frequency_hz": self.hertz,
            "damping": self.damping_ratio,
            "time_constant": self.time_constant,
            "origin": self.origin,
            "kind": self.kind,
            "gain": self.gain,
            "crossing": self.crossing if self.crossing < math.inf else None,
            "alone": dict(self.alone),
            "stable_without": list(self.stable_without),
            "sentence": self.sentence,
        }


def _since(factor: float, what: str) -> str:
    return f"from {factor:.2g} of {what} on" if factor > 0.0 else f"at any part of {what}"
