"""`bc.margins`: the margins of a controller on a plant, of one pose or several, and why a closed
loop is unstable."""

from dataclasses import replace
from typing import NamedTuple, overload

import control

from beamchain.engine.library import one_thread
from beamchain.plants.blame import Progress, instabilities, no_progress
from beamchain.plants.closed_loop import ClosedLoop, close
from beamchain.plants.feedback import Given
from beamchain.plants.margins import Margins, beyond, limiting, margins_of
from beamchain.plants.realisation import Plant
from beamchain.plants.scheduled import ScheduledPlant


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
        controller: a TOML file of loops or what it holds (`bc.Controller`); a TransferFunction or
            StateSpace of python-control, whose inputs are outputs of the plant and whose outputs
            are inputs of it, by their labels (points as `_`), else in order where the sizes agree;
            or `{(input, output): system}`, single systems or numbers, which add up at an input.
            One with `dt=True` is refused, one without states fits any step.

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
    closed = close(plant, controller)
    found = replace(margins_of(closed), pose=pose)
    if isinstance(plant, Plant):
        loops = tuple(
            replace(loop, modes=limiting(plant, loop, closed.step)) for loop in found.loops
        )
        found = replace(found, loops=loops, beyond=tuple(beyond(plant, loops)))
    return LoopVerdict(closed, found)
