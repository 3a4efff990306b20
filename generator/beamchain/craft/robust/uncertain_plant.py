"""`plant.uncertain(...)`: an uncertain plant, and the worst that a given controller meets in it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from beamchain import report
from beamchain.caution import Caution
from beamchain.checks import positive, whole_number
from beamchain.craft.embedded import Embedded
from beamchain.craft.plants.controllers import Controller, place, places, read_controller
from beamchain.craft.robust.bounds import WIDEST, bounds
from beamchain.craft.robust.confirm import amplitude
from beamchain.craft.robust.lft import LARGEST, Lft, Made
from beamchain.craft.robust.systems import Complex
from beamchain.craft.robust.worst import Loops, Peak, search
from beamchain.craft.variants.quantities import quantities
from beamchain.errors import InputError
from beamchain.fitting.uncertain import OF_MODES, Correlation, UncertainCraft
from beamchain.ports.motions import Array, locked

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GRID = 24  # frequencies of the bounds between those that the peaks give
ROUNDS = 3  # of halving the grid about the largest bound


@dataclass(frozen=True, eq=False, repr=False)
class WorstCase:
    """The worst that a controller meets in an uncertain plant, from a disturbance at an input to an output.

    Args:
        input, output, unit: what is driven, what is seen, and the unit of gains.
        omega: `(k,)` [rad/s].
        stability: `(k,)` upper bound of the structured singular value; below one everywhere: the loop is stable for all
            values of the quantities (at these frequencies).
        bound, nominal, worst: `(k,)` upper bound of the gain over all values, gain of the nominal plant and of the worst
            sample.
        drawn: `(n,)` peak gains of samples from the distributions; infinite where one is unstable.
        deltas, values: of the worst sample.
        gain, frequency: peak of the worst sample, and where [rad/s]; infinite, and where the loop begins to ring.
        simulated: the same gain by a simulation in MuJoCo; NaN where there is none.

    Example:
        >>> import beamchain as bc
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> from beamchain.craft.plants.controllers import Controller, Loop
        >>> from beamchain.fitting.uncertain import Uncertain, Uncertainty
        >>> tenth = Uncertain(frequency=Uncertainty(relative=0.1, distribution="uniform"))
        >>> segment = bc.Segment(length=8.0, section=section)
        >>> boom = bc.Spec(segment=(segment,), damping=bc.Damping(ratio=0.01), uncertain=tenth)
        >>> plant = bc.plant(bc.embed(craft, {"mount": boom}), ["torque:bus"], ["attitude"])
        >>> uncertain = plant.uncertain()
        >>> loops = [Loop(input=f"torque_{a}", output=f"attitude_{a}", numerator=(600.0, 60.0), denominator=(0.05, 1.0))
        ...          for a in "xyz"]
        >>> controller = Controller(loop=tuple(loops))
        >>> worst = uncertain.worst_case(controller, "torque_z", "attitude_z", samples=5, simulate=False)
        >>> worst.stable, worst.gain <= worst.upper
        (True, True)
    """

    input: str
    output: str
    unit: str
    omega: Array
    stability: Array
    bound: Array
    nominal: Array
    worst: Array
    drawn: Array
    deltas: Array
    values: Mapping[str, float]
    gain: float
    frequency: float
    simulated: float

    def __repr__(self) -> str:
        return f"<WorstCase, {self.sentence}>"

    @property
    def stable(self) -> bool:
        """Whether no sample was found unstable."""
        return bool(np.isfinite(self.gain))

    @property
    def upper(self) -> float:
        """Upper bound of the peak gain, largest of `bound`."""
        return float(self.bound.max())

    @property
    def gap(self) -> float:
        """By how much the upper bound is above the worst sample found, relative to that."""
        return self.upper / self.gain - 1.0

    @property
    def sentence(self) -> str:
        """The finding in a sentence."""
        if not self.stable:
            return f"unstable for some values of the uncertain quantities, at {self.frequency:.4g} rad/s"
        seen = "" if np.isnan(self.simulated) else f", {self.simulated:.4g} in MuJoCo"
        most = f"at most {self.upper:.4g}" if np.isfinite(self.upper) else "not bounded"
        way = f"{self.input} to {self.output}"
        return f"{way}: worst sample {self.gain:.4g} {self.unit} at {self.frequency:.4g} rad/s{seen}; {most}"

    def as_dict(self) -> dict[str, Any]:
        """For JSON; None where something is not finite."""
        one = {
            "input": self.input, "output": self.output, "unit": self.unit, "stable": self.stable,
            "singular_value": float(self.stability.max()), "bound": self.upper, "gain": self.gain,
            "frequency": self.frequency, "simulated": self.simulated,
        }  # fmt: skip
        finite = {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in one.items()}
        return {**finite, "values": dict(self.values)}

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Gains over frequency: upper bound, worst sample, nominal, and the peak in MuJoCo. Returns the axes; shows nothing.

        Args:
            ax: drawn into; those of a new figure where left out.
        """
        return report.plot_worst(self, ax=ax)


class UncertainPlant(Lft):
    """A plant with its uncertain quantities pulled out, `[z, y] = M [w, u]`, `w = Delta z`; made by `plant.uncertain`.

    `nominal` is M as a `control.StateSpace`, w and z before the plant's own signals; `blocks` are the deltas, each in
    [-1, 1], in the order in which they stand on the diagonal of Delta. `sample` closes M, `draw` draws values.

    Example:
        >>> import beamchain as bc
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> boom = bc.Spec(segment=(bc.Segment(length=8.0, section=section),), fit=bc.FitOptions(springs="modes"))
        >>> from beamchain.fitting.uncertain import Uncertainty, UncertainBody, UncertainCraft
        >>> tenth = Uncertainty(relative=0.1, distribution="uniform")
        >>> plant = bc.plant(bc.embed(craft, {"mount": boom}), inputs=["torque:bus"])
        >>> uncertain = plant.uncertain(UncertainCraft(body={"bus": UncertainBody(mass=tenth)}))
        >>> [(block.name, block.repetitions) for block in uncertain.blocks]
        [('bus.mass', 3)]
        >>> light = uncertain.sample({"bus.mass": 280.0})
    """

    def loops(self, controller: Controller, input: str, output: str) -> Loops:
        """The controller's loops closed around M."""
        blocks = [int(number) for number in self._group[self._of]]
        return Loops(self._system, blocks, self.inputs, self.outputs, controller, (input, output))

    def worst_case(
        self,
        controller: Controller | str | Path,
        input: str | None = None,
        output: str | None = None,
        omega: ArrayLike | None = None,
        *,
        samples: int = 100,
        seed: int = 0,
        simulate: bool = True,
    ) -> WorstCase:
        """The worst gain of a closed loop over all values of the uncertain quantities.

        The upper bound holds at the frequencies `omega`; beyond six repetitions of a delta it takes the quantities that
        share it as independent, and it leaves correlations aside. Dead times are exact in gains and bounds.

        Args:
            controller: loops, or the path of their file.
            input: where the disturbance is added to the plant's input; that of the first loop where left out.
            output: of the plant; that of the first loop where left out.
            omega: `(k,)` [rad/s], to which the worst sample's own is added; where left out, about the peaks that are found.
            samples: number of draws from the distributions.
            seed: of the draws.
            simulate: put the worst sample into MuJoCo.

        Raises:
            InputError: a name is unknown, or the nominal loop is unstable.
        """
        whole_number("samples", samples, 0, LARGEST)
        whole_number("seed", seed, 0, LARGEST)
        asked = [positive("omega", w, "rad/s") for w in ([] if omega is None else np.atleast_1d(omega).tolist())]
        loops_of = read_controller(controller)
        rows, columns = places(loops_of, self.inputs, self.outputs)
        first, last = input or loops_of.loop[0].input, output or loops_of.loop[0].output
        loops = self.loops(loops_of, first, last)
        drawn = np.array([self._of_draw(values) for values in self.draw(samples, seed)]).reshape(-1, len(self.blocks))
        deltas, worst, peaks = search(loops, drawn, seed)
        nominal = np.zeros(len(self.blocks))
        own = _grid(worst, [*peaks, loops.peak(nominal)], loops.poles)
        grid, rounds = (own, ROUNDS) if omega is None else (np.unique(np.append(asked, worst.omega)), 0)
        grid, mu, bound = self._bounds(loops, grid, rounds)
        ends = place(first, self.inputs, "input", ""), place(last, self.outputs, "output", "")
        simulated = float("nan")
        if simulate and np.isfinite(worst.gain):
            simulated = amplitude(self._again(deltas[self._group]), loops_of, (rows, columns), ends, worst.omega)
        unit = f"{self.units[1][ends[1]]} per {self.units[0][ends[0]]}"
        return WorstCase(
            first, last, unit, locked(grid), locked(mu), locked(bound), locked(loops.gain(nominal, grid)),
            locked(loops.gain(deltas, grid)), locked([peak.gain for peak in peaks]), locked(deltas), self.values(deltas),
            worst.gain, worst.omega, simulated,
        )  # fmt: skip

    def _of_draw(self, values: Mapping[str, float]) -> Array:
        """`(blocks,)` deltas of a draw; correlated ones differ within a block, which takes the first."""
        each = self._deltas(values)
        return np.array([each[int(np.argmax(self._group == k))] for k in range(len(self.blocks))])

    def _bounds(self, loops: Loops, grid: Array, rounds: int) -> tuple[Array, Array, Array]:
        """Both bounds on a grid, which is refined about the largest."""
        group = self._group[self._of]
        wide = {k for k, block in enumerate(self.blocks) if block.repetitions > WIDEST}
        keys = [(g, self._of[i] if g in wide else -1) for i, g in enumerate(group)]
        shared = [[i for i, key in enumerate(keys) if key == one] for one in dict.fromkeys(keys)]
        mu, gain = bounds(loops.exact(grid), shared)
        for _ in range(rounds):
            at = int(np.argmax(gain))
            if not np.isfinite(gain[at]):
                break
            near = grid[max(at - 1, 0) : at + 2]
            more = np.sqrt(near[1:] * near[:-1])
            found = bounds(loops.exact(more), shared)
            order = np.argsort(np.concatenate([grid, more]))
            grid, mu, gain = (np.concatenate(pair)[order] for pair in ((grid, more), (mu, found[0]), (gain, found[1])))
        return grid, mu, gain


def _grid(worst: Peak, peaks: Sequence[Peak], poles: Complex) -> Array:
    """Frequencies about the peaks, and over the band of the closed loop."""
    if not np.isfinite(worst.gain):
        return worst.omega * np.sort(np.append(np.geomspace(0.5, 2.0, 8), 1.0))
    near = np.array([peak.omega for peak in peaks if np.isfinite(peak.gain)])
    light = np.abs(poles[(np.abs(poles.real) < 0.1 * np.abs(poles)) & (poles.imag > 0.0)])
    top = np.append(light, worst.omega).max()
    wide = np.geomspace(0.3 * min(near.min(), worst.omega), 1.5 * top, GRID)
    return np.unique(
        np.concatenate([wide, light, np.quantile(near, [0.0, 0.5, 1.0]), worst.omega * np.array([0.98, 1.0, 1.02])])
    )


def uncertain_plant(made: Made, embedded: Embedded | None, given: UncertainCraft | None) -> UncertainPlant:
    """The uncertain plant of a craft; what is `given` goes before the specifications of embedded appendages."""
    own = {a.prefix: a.spec.uncertain for a in embedded.appendages if a.spec.uncertain is not None} if embedded else {}
    said = [
        Caution("left-certain", f"the structural properties that {prefix!r} has uncertain (stiffness, density, ...) are left "
                "certain in the plant: they change the fit itself; beamchain sweep shows what they do to the modes.")
        for prefix, one in own.items() if one.structural
    ]  # fmt: skip
    modal = {prefix: one for prefix, one in own.items()
             if any(getattr(part, kind) is not None for part in (one, *one.mode) for kind in OF_MODES)}  # fmt: skip
    correlations = [
        Correlation(of=tuple(f"{prefix}{name}" for name in one.of), matrix=one.matrix)
        for prefix, those in modal.items() if prefix not in (given.appendage if given else {}) for one in those.correlation
    ]  # fmt: skip
    found = quantities(made.craft.point.model, given, modal, correlations)
    if not found:
        raise InputError(
            "uncertain: nothing is; give a file with [body.NAME], [joint.NAME] or [appendage.PREFIX], or [uncertain] with "
            "frequency, damping or participation in an appendage's specification."
        )
    return UncertainPlant(made, found, [*correlations, *(given.correlation if given else ())], said)
