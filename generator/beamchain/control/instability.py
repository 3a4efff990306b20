"""Why a closed loop is unstable: its growing poles, what each grows from, and which loop is to
blame."""

import math
from collections.abc import Mapping, Sequence
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
    def pushed(self) -> bool:
        """Whether it grows without oscillation at any gain, as where a sign is wrong."""
        return not self._rings and 0.0 in (self.gain, *self.alone.values())

    @property
    def sentence(self) -> str:
        """All of it in words."""
        return self.finding + ("; is the sign of the numerators right?" if self.pushed else ".")

    @property
    def finding(self) -> str:
        """The same without a question on the signs, and without the full stop."""
        how = "without oscillation"
        if self._rings:
            how = f"{self.hertz:.3g} Hz, {self.frequency:.4g} rad/s"
        what = f"{WORDS[self.kind]}{self.origin}"
        return (
            f"UNSTABLE: {what} ({how}) grows with time constant {self.time_constant:.3g} s; "
            f"{self._blame()}{self._endless()}"
        )

    @property
    def _rings(self) -> bool:
        return abs(self.pole.imag) > 1e-9 * abs(self.pole)

    def _endless(self) -> str:
        if self.crossing < math.inf:
            return ""
        return (
            f"; at {self.gain:.3g} of the gains of all loops their direct parts have no solution, "
            "1 + L = 0 at infinite frequency"
        )

    def _blame(self) -> str:
        if self.alone:
            return _alone(self.alone)
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


def sentences(several: Sequence[Instability]) -> list[str]:
    """Why a loop is unstable in words; where several poles ask for the sign, the question stands
    first and once.

    Args:
        several: all growing poles of a closed loop.
    """
    pushed = [one for one in several if one.pushed]
    if len(pushed) < 2:
        return [one.sentence for one in several]
    names = sorted({name for one in pushed for name in one.causes})
    whose = f"the numerators on {_listed(names)}" if names else "the numerators"
    question = (
        f"Is the sign of {whose} right? {len(pushed)} poles grow without oscillation at any gain."
    )
    return [question, *(f"{one.finding}." for one in several)]


def _alone(factors: Mapping[str, float]) -> str:
    """Which loops are to blame alone, and from which gains on."""
    names = list(factors)
    since = [_since(factor, "its gain") for factor in factors.values()]
    if len(names) == 1:
        return f"the loop {names[0]} alone makes it so, {since[0]}"
    if len(set(since)) == 1:
        return f"each of the loops {', '.join(names)} alone makes it so, {since[0]}"
    each = [f"{name} ({when})" for name, when in zip(names, since, strict=True)]
    return f"each of the loops {', '.join(each)} alone makes it so"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _since(factor: float, what: str) -> str:
    """From which factor of the nominal gain on."""
    if factor > 0.0:
        return f"at gains above {factor:.2g} of the nominal"
    return f"at any part of {what}"
