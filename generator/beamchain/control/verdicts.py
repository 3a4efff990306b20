"""`bc.margins`: the margins of a controller on a plant, of one pose or several, which mode limits
them, and why a closed loop is unstable."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, overload

import control
import numpy as np

from beamchain.checks import of_type
from beamchain.control.closed_loop import ClosedLoop, Names, close
from beamchain.control.feedback import Given, Signals
from beamchain.control.instability_causes import Progress, instabilities, no_progress
from beamchain.control.margins import LoopMargins, Margins, margins_of
from beamchain.control.realisation import Plant
from beamchain.control.scheduled import ScheduledPlant
from beamchain.engine.library import one_thread
from beamchain.ports.motions import Array
from beamchain.steps.modal import FILLER, PATTERN

SHOWN = 1e-2  # of the largest modal gain: modes with less are not those of a loop
MOVED = 0.05  # relative, by which a margin that belongs to a mode may lie above it
NEAR = 0.2  # relative, of a margin's frequency and that of the mode it is named after


@overload
def margins(plant: ScheduledPlant, controller: Given) -> tuple[Margins, ...]: ...
@overload
def margins(plant: control.StateSpace, controller: Given) -> Margins: ...
@one_thread()
def margins(
    plant: control.StateSpace | ScheduledPlant, controller: Given
) -> Margins | tuple[Margins, ...]:
    """Margins of a controller on a plant, `input = -K output`: gain, phase, delay, modulus and disk
    margin at every input that it drives with the other loops closed, the disk margin of all inputs
    at once, peaks of sensitivities, and why the closed loop is unstable.

    Everything refers to the inputs of the plant: `L = K G`, `S = 1/(1 + L)`, `T = 1 - S`. With the
    other loops closed, the open loop at input i is `1/S_ii - 1`. Figures are the least (or largest)
    over all frequencies, on a grid that resolves the poles of open and closed loop, and polished.

    Dead times of a file are exact in all figures. Poles are those of a Pade approximation of order
    6, or of a higher one that has as many unstable poles as Nyquist's criterion counts.

    A sampled controller sees the plant at its samples and holds its inputs between them: a
    continuous plant is sampled exactly; a plant of `discrete=h` at a multiple of h as well. All is
    then said at the samples, at frequencies up to pi/T.

    Args:
        plant: of `bc.plant`, or any `control.StateSpace`; of several poses one result each.
        controller: a TOML file of loops or what it holds (`bc.spec.Controller`); a
            TransferFunction or StateSpace of python-control, whose inputs are outputs of the plant
            and whose outputs are inputs of it, by their labels (points as `_`), else in order where
            the sizes agree; or `{(input, output): system}`, single systems or numbers, which add up
            at an input. One with `dt=True` is refused, one without states fits any step.

    Raises:
        InputError: the controller names no signal of the plant, has other sizes, is improper or not
            finite, makes an algebraic loop, is continuous on a sampled plant, or sampled at several
            rates or at one that is no multiple of the plant's.

    Example:
        >>> import beamchain as bc, control
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> plant = bc.plant(bc.embed(craft, {"mount": spec}), inputs=["torque:bus"])
        >>> controller = {("torque_z", "attitude_z"): control.tf([200.0, 20.0], [0.1, 1.0])}
        >>> bc.margins(plant, controller).stable
        True
    """
    found = tuple(one.explained() for one in loop_verdicts(plant, controller))
    return found if isinstance(plant, ScheduledPlant) else found[0]


class LoopVerdict(NamedTuple):
    """A closed loop and its margins, which do not yet say why it is unstable."""

    closed: ClosedLoop
    margins: Margins

    def explained(self, tell: Progress = no_progress) -> Margins:
        """The margins that say so; `tell` is told how many growing poles have been followed, and
        of how many."""
        if self.margins.stable:
            return self.margins
        causes = instabilities(self.closed, tell)
        names = {name for one in causes for name in one.causes}
        loops = (
            replace(loop, causes=not names or loop.input in names) for loop in self.margins.loops
        )
        return replace(self.margins, loops=tuple(loops), instabilities=causes)


@one_thread()
def loop_verdicts(
    plant: control.StateSpace | ScheduledPlant, controller: Given
) -> list[LoopVerdict]:
    """The closed loop of every pose with its margins."""
    if isinstance(plant, ScheduledPlant):
        pairs = zip(plant.plants, plant.labels, strict=True)
        return [_loop_verdict(one, controller, label) for one, label in pairs]
    return [_loop_verdict(plant, controller, plant.pose if isinstance(plant, Plant) else "")]


def _loop_verdict(plant: control.StateSpace, controller: Given, pose: str) -> LoopVerdict:
    of_type("plant", plant, control.StateSpace, "what bc.plant returns, or a control.StateSpace")
    closed = close(plant, _names_of(plant), controller)
    found = replace(margins_of(closed), pose=pose)
    if isinstance(plant, Plant):
        loops = tuple(
            replace(loop, modes=_limiting(plant, loop, closed.step)) for loop in found.loops
        )
        found = replace(found, loops=loops, beyond=tuple(_beyond(plant, loops)))
    return LoopVerdict(closed, found)


def margin_warnings(plants: Sequence[Plant], found: Sequence[Margins]) -> list[str]:
    """Warnings of the first plant, and what to say of the margins of each;
    there are none without a controller."""
    far = (said for one in found for said in (*one.warnings, *one.beyond))
    return [*plants[0].warnings, *dict.fromkeys(far)]


def _shares(plant: Plant, loop: LoopMargins) -> Array:
    """`(modes,)` modal gains from the input of a loop to its outputs, in the output where they are
    largest beside those of the appendages' other modes."""
    rows = [plant.output_names.index(name) for name in loop.outputs]
    gains = plant.gain[:, rows, plant.input_names.index(loop.input)]
    own = [k for k, name in enumerate(plant.modes) if PATTERN.fullmatch(name)]
    largest = (gains[own] if own else gains).max(axis=0, initial=0.0)
    return np.asarray((gains / np.maximum(largest, 1e-300)).max(axis=1), dtype=np.float64)


def _limiting(plant: Plant, loop: LoopMargins, step: float) -> dict[str, str]:
    """By figure, the mode that answers most near the figure's frequency."""
    frequency = plant.frequency
    seen = frequency
    if step:  # the samples of a mode beyond pi/T are those of a slower one
        turn = 2.0 * np.pi / step
        seen = np.abs((frequency + turn / 2.0) % turn - turn / 2.0)
    shares = _shares(plant, loop)
    out: dict[str, str] = {}
    for figure, w in loop.limited.items():
        near = np.flatnonzero((np.abs(seen - w) <= NEAR * w) & (shares >= SHOWN))
        width = 2.0 * plant.damping_ratio[near] * frequency[near] * w
        answers = shares[near] / np.hypot(seen[near] ** 2 - w**2, width)
        if near.size:
            out[figure] = plant.modes[int(near[np.argmax(answers)])]
    return out


def _highest_shown(plant: Plant, loop: LoopMargins) -> float:
    """Frequency of the highest mode of an appendage that a loop's input and outputs show [rad/s];
    of the highest of all modes where they show none."""
    modes = [k for k, name in enumerate(plant.modes) if not FILLER.search(name)]
    shares = _shares(plant, loop)
    own = [k for k in modes if PATTERN.fullmatch(plant.modes[k]) and shares[k] >= SHOWN]
    return max((float(plant.frequency[k]) for k in own or modes), default=np.inf)


def _beyond(plant: Plant, found: Sequence[LoopMargins]) -> list[str]:
    """What to say of margins at frequencies that the plant's kept modes do not reach."""
    out: list[str] = []
    for one in found:
        top = _highest_shown(plant, one)
        at = {
            "gain": one.gain_frequency,
            "phase": one.phase_frequency,
            "modulus": one.modulus_frequency,
            "disk": one.disk_frequency,
        }
        far = [
            f"{what} margin (at {omega:.4g} rad/s)"
            for what, omega in at.items()
            if (1.0 + MOVED) * top < omega and (omega < np.inf or np.isfinite(getattr(one, what)))
        ]
        if far:
            out.append(
                f"{one.name}: {', '.join(far)} above the highest mode kept that this loop shows "
                f"({top:.4g} rad/s); keep more modes before relying on it, for example by a scene "
                "with a larger bandwidth."
            )
    return out


def _names_of(plant: control.StateSpace) -> Names:
    """Those of `bc.plant`, or python-control's labels."""
    inputs, outputs = list(plant.input_labels), list(plant.output_labels)
    if isinstance(plant, Plant):
        own = Signals(list(plant.input_names), list(plant.output_names), inputs, outputs)
        return Names(own, plant.state_names, plant.modes)
    return Names(Signals(inputs, outputs, inputs, outputs), tuple(plant.state_labels), ())
