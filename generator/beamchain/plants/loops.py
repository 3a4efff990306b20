"""Margins of a controller on a plant: classical,
delay and disk margins at every input with the others closed."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import control
import numpy as np

from beamchain.errors import InputError
from beamchain.plants.controllers import Controller, Response, places, realise, response
from beamchain.plants.realisation import Plant
from beamchain.plants.systems import taking_part
from beamchain.ports.motions import Array
from beamchain.steps.modal import FILLER

UNSEEN = 1e-9  # relative, below which a state takes no part in a loop
GROWS = 1e-9  # relative real part of a pole, below which it is rounding


class Margins(NamedTuple):
    """Margins at an input of the plant, the loops of all others closed;
    infinite where there is no limit.

    Of an unstable closed loop they are not defined: NaN.

    Args:
        input, outputs: the input that is broken, and what its loops measure.
        stable: whether the closed loop is stable, all loops together.
        gain: factor by which the gain may rise, and `gain_frequency` at which the loop
            then rings [rad/s].
        lowest_gain: factor below one to which it may fall; 0 where it may vanish.
        phase: [degrees], at `phase_frequency` [rad/s].
        delay: further dead time that the loop bears [s].
        disk: disk margin (balanced, skew 0) at `disk_frequency` [rad/s]:
            gain and phase may change together by it.
        omega, response: `(k,)` [rad/s] and the open loop's response.
    """

    input: str
    outputs: tuple[str, ...]
    stable: bool
    gain: float
    gain_frequency: float
    lowest_gain: float
    phase: float
    phase_frequency: float
    delay: float
    disk: float
    disk_frequency: float
    omega: Array
    response: Response

    def as_dict(self) -> dict[str, Any]:
        """For JSON, without the curve; None where there is no limit."""
        values = {"input": self.input, "output": " + ".join(self.outputs), **self._asdict()}
        return {
            key: None if isinstance(value, float) and not np.isfinite(value) else value
            for key, value in values.items()
            if key not in ("outputs", "omega", "response")
        }

    @property
    def name(self) -> str:
        """Input and what its loops measure."""
        return f"{self.input} from {' + '.join(self.outputs)}"


def margins(plant: Plant, controller: Controller) -> list[Margins]:
    """Margins at every input that a loop drives, the loops of the other inputs closed.

    The open loop at an input with the others closed is `1/[(1 + K G)^-1]_ii - 1`;
    dead times are exact in it.

    Args:
        plant: continuous.
        controller: its loops.

    Raises:
        InputError: a loop names no signal of the plant, or the plant is discrete.
    """
    if plant.dt:
        raise InputError(
            "margins are those of the continuous plant; leave discrete out and give each loop its "
            "delay."
        )
    rows, columns = places(controller, list(plant.input_names), list(plant.output_names))
    stable, poles = _closed_poles(plant, controller, rows, columns)
    omega = _grid(plant, poles)
    s = (1j * omega).astype(np.complex128)
    inputs = list(dict.fromkeys(columns))
    drives = np.equal.outer(inputs, columns).astype(np.float64)
    own = np.array([response(loop, s) for loop in controller.loop])
    through = (
        own[:, None, :]
        * np.asarray(plant(s, squeeze=False))[np.ix_(rows, inputs, range(omega.size))]
    )
    inverse: Any = np.linalg.inv(np.eye(len(inputs)) + np.einsum("il,ljk->kij", drives, through))
    return [
        _margins(
            plant.input_names[column],
            tuple(
                loop.output
                for loop, at in zip(controller.loop, columns, strict=True)
                if at == column
            ),
            stable,
            omega,
            (1.0 / inverse[:, i, i] - 1.0).astype(np.complex128),
        )
        for i, column in enumerate(inputs)
    ]


def margin_warnings(plants: Sequence[Plant], of_loops: Sequence[Sequence[Margins]]) -> list[str]:
    """Warnings of the first plant, and what to say of the margins of each;
    there are none without a controller."""
    far = (
        said
        for plant, found in zip(plants, of_loops, strict=False)
        for said in beyond(plant, found)
    )
    return [*plants[0].warnings, *dict.fromkeys(far)]


def beyond(plant: Plant, found: Iterable[Margins]) -> list[str]:
    """What to say of margins at frequencies that the plant's kept modes do not reach."""
    top = max(
        (
            w
            for name, w in zip(plant.modes, plant.frequency, strict=True)
            if not FILLER.search(name)
        ),
        default=np.inf,
    )
    out: list[str] = []
    for one in found:
        at = {"gain": one.gain_frequency, "phase": one.phase_frequency, "disk": one.disk_frequency}
        far = [
            f"{what} margin (at {omega:.4g} rad/s)"
            for what, omega in at.items()
            if top < omega < np.inf
        ]
        if far:
            out.append(
                f"{one.name}: {', '.join(far)} above the highest mode kept ({top:.4g} rad/s); keep "
                "more modes before relying on it, for example by a scene with a larger bandwidth."
            )
    return out


def _closed_poles(
    plant: Plant, controller: Controller, rows: list[int], columns: list[int]
) -> tuple[bool, Response]:
    """Whether the closed loop is stable, and its poles, of the states that take part in it."""
    a, b, c, d = (np.asarray(getattr(plant, name), dtype=np.float64) for name in "ABCD")
    b, c = b[:, columns], c[rows]
    driven, seen = (
        np.abs(m).max(axis=1) > UNSEEN * np.abs(m).max(initial=1e-300) for m in (b, c.T)
    )
    keep = taking_part(np.abs(a) > 0.0, driven, seen)
    system = control.ss(a[np.ix_(keep, keep)], b[keep], c[:, keep], d[np.ix_(rows, columns)])
    own: Any = control.ss(*realise(controller))
    closed: Any = control.feedback(system, own)
    poles = np.asarray(closed.poles(), dtype=np.complex128)
    return bool(np.all(poles.real < GROWS * np.abs(poles).max(initial=1.0))), poles


def _grid(plant: Plant, poles: Response) -> Array:
    """`(k,)` frequencies that resolve the modes and the closed loop's poles [rad/s]."""
    poles = poles[np.abs(poles) > 0.0]
    size = np.abs(np.concatenate([poles, plant.frequency]))
    ratio = np.abs(np.concatenate([-poles.real / np.abs(poles), plant.damping_ratio]))
    near = np.sinh(np.linspace(-6.0, 6.0, 122))  # without 0: an undamped plant is infinite there
    fine = size[:, None] * (1.0 + np.clip(ratio, 1e-6, 0.02)[:, None] * near)
    wide = np.geomspace(0.01 * size.min(), 10.0 * size.max(), 3000)
    grid = np.unique(np.concatenate([fine.ravel(), wide]))
    return grid[(grid >= wide[0]) & (grid <= wide[-1])]


def _margins(
    name: str, outputs: tuple[str, ...], stable: bool, omega: Array, response: Response
) -> Margins:
    """Margins of one open loop, on its grid."""
    if not stable:
        no = float("nan")
        return Margins(name, outputs, stable, no, no, no, no, no, no, no, no, omega, response)
    frd = control.FrequencyResponseData(response, omega, smooth=True)
    gains, phases, _, at_gain, at_phase, _ = (
        np.atleast_1d(np.asarray(v, dtype=np.float64))
        for v in control.stability_margins(frd, returnall=True)
    )
    up = gains > 1.0
    down = gains[(gains < 1.0) & (gains > 0.0)]
    gain = min(zip(gains[up], at_gain[up], strict=True), default=(np.inf, np.inf))
    phase = min(
        zip(phases, at_phase, strict=True),
        key=lambda found: abs(found[0]),
        default=(np.inf, np.inf),
    )
    later = np.radians(np.mod(phases, 360.0)) / at_phase
    size = np.abs((1.0 - response) / (1.0 + response))
    worst = np.argmax(size)
    numbers = (
        *gain,
        down.max(initial=0.0),
        *phase,
        later.min(initial=np.inf),
        2.0 / size[worst],
        omega[worst],
    )
    return Margins._make(
        (name, outputs, stable, *(float(number) for number in numbers), omega, response)
    )
