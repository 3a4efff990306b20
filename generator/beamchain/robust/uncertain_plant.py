"""An uncertain plant, and the worst that a given controller meets in it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beamchain import report, robust
from beamchain.checks import of_type, positive, whole_number
from beamchain.errors import InputError
from beamchain.robust.bounds import Bounder, GainBound, frequencies
from beamchain.robust.least_margins import (
    ALL,
    DISK,
    PHASE,
    LeastMargin,
    SampleLoops,
    WorstMargins,
    figure,
    smallness,
)
from beamchain.robust.lft import LARGEST, Lft
from beamchain.robust.search import Loops, Peak, climb, search
from beamchain.robust.simulated_gain import FORGOTTEN, simulated_gain
from beamchain.spec import Controller, Correlation, Uncertain, UncertainCraft
from beamchain.toolkit import (
    OF_MODES,
    Array,
    PlantSource,
    locked,
    one_thread,
    place,
    places,
    quantities,
    read_controller,
)
from beamchain.warning_codes import Caution

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SECONDS = 120.0  # after which a bound is refined no further
CORNERS = 40  # of the ranges, whose gains say where a bound is to be close
GRID = 300  # frequencies of the curves over the band of the closed loop
# frequencies of the curves at a resonance, in its half widths
AROUND = np.sinh(np.linspace(-3.0, 3.0, 13))


@dataclass(frozen=True, eq=False, repr=False)
class WorstCase:
    """The worst that a controller meets in an uncertain plant,
    from a disturbance at an input to an output.

    Args:
        input, output, unit: what is driven, what is seen, and the unit of gains.
        omega: `(k,)` [rad/s].
        nominal, worst: `(k,)` gain of the nominal plant and of the worst sample.
        drawn: `(n,)` peak gains of samples from the distributions;
        infinite where one is unstable.
        deltas, values: of the worst sample.
        gain: peak gain of the worst sample; infinite where the loop becomes unstable.
        frequency: where the peak is [rad/s]; where the loop becomes unstable, that at which it
            begins to ring on the way from the nominal values to the worst ones; 0 where it begins
            to drift away, without ringing.
        simulated: the same gain in a run of MuJoCo at that frequency; NaN where there is none.
        nominal_values, percent: of every quantity, and where the worst value lies in its range,
            -100 to 100, 0 the nominal one.
        value_units: of the quantities.
        bound: what no value exceeds; None where it was not asked for, or the worst sample is
            unstable.
        pose: of the craft, one of several; empty where there is one.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> from beamchain.spec import Controller, Loop, Uncertain, Uncertainty
        >>> tenth = Uncertain(frequency=Uncertainty(relative=0.1, distribution="uniform"))
        >>> segment = bc.Segment(length=8.0, section=section)
        >>> boom = bc.Spec(segment=(segment,), damping=bc.Damping(ratio=0.01), uncertain=tenth)
        >>> plant = bc.plant(bc.embed(craft, {"mount": boom}), ["torque:bus"], ["attitude"])
        >>> uncertain = robust.uncertain(plant)
        >>> loops = [
        ...     Loop(
        ...         input=f"torque_{a}",
        ...         output=f"attitude_{a}",
        ...         numerator=(600.0, 60.0),
        ...         denominator=(0.05, 1.0),
        ...     )
        ...     for a in "xyz"
        ... ]
        >>> controller = Controller(loop=tuple(loops))
        >>> worst = uncertain.worst_case(
        ...     controller, "torque_z", "attitude_z", samples=5, simulate=False
        ... )
        >>> worst.stable, float(worst.drawn.max()) <= worst.gain
        (True, True)
    """

    input: str
    output: str
    unit: str
    omega: Array
    nominal: Array
    worst: Array
    drawn: Array
    deltas: Array
    values: Mapping[str, float]
    gain: float
    frequency: float
    simulated: float
    nominal_values: Mapping[str, float]
    percent: Mapping[str, float]
    value_units: Mapping[str, str]
    bound: GainBound | None = None
    pose: str = ""

    def __repr__(self) -> str:
        return f"<WorstCase, {self.sentence}>"

    @property
    def stable(self) -> bool:
        """Whether no sample was found unstable."""
        return bool(np.isfinite(self.gain))

    @property
    def sentence(self) -> str:
        """The finding in a sentence."""
        where = f"{self.pose}: " if self.pose else ""
        if not self.stable:
            how = f"ring at {self.frequency:.4g} rad/s" if self.frequency else "drift away"
            return (
                f"{where}unstable for some values of the uncertain quantities; on the way to them "
                f"from the nominal ones the loop begins to {how}"
            )
        seen = "" if np.isnan(self.simulated) else f", {self.simulated:.4g} in MuJoCo"
        above = "" if self.bound is None else f"; {self.bound.sentence}"
        return (
            f"{where}{self.input} to {self.output}: worst sample {self.gain:.4g} {self.unit} at "
            f"{self.frequency:.4g} rad/s{seen}{above}"
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON; None where something is not finite."""
        record = {
            "input": self.input,
            "output": self.output,
            "unit": self.unit,
            "stable": self.stable,
            "gain": self.gain,
            "frequency": self.frequency,
            "simulated": self.simulated,
            "pose": self.pose,
        }
        finite = {
            key: None if isinstance(value, float) and not np.isfinite(value) else value
            for key, value in record.items()
        }
        bound = None if self.bound is None else self.bound.as_dict()
        rows = self.table.records()
        return {**finite, "values": dict(self.values), "quantities": rows, "bound": bound}

    @property
    def table(self) -> "report.Table":
        """The worst values beside the nominal ones, in percent of their ranges."""
        return robust.tables.worst_value_table(self)

    def _repr_html_(self) -> str:
        return report.table_html(self.table, [self.sentence])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Gains over frequency: worst sample, nominal, and the peak in MuJoCo.
        Returns the axes; shows nothing.

        Args:
            ax: drawn into; those of a new figure where left out.
        """
        return robust.plots.plot_worst(self, ax=ax)


@dataclass(frozen=True, eq=False, repr=False)
class WorstCases:
    """A worst case at every pose of a craft.

    Args:
        cases: one per pose.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> len(robust.WorstCases(()))
        0
    """

    cases: tuple[WorstCase, ...]

    def __repr__(self) -> str:
        return f"<WorstCases, {len(self)} poses; {self.worst.sentence}>"

    def __len__(self) -> int:
        return len(self.cases)

    def __getitem__(self, number: int) -> WorstCase:
        return self.cases[number]

    def __iter__(self) -> Iterator[WorstCase]:
        return iter(self.cases)

    @property
    def labels(self) -> tuple[str, ...]:
        """The poses."""
        return tuple(case.pose for case in self.cases)

    @property
    def worst(self) -> WorstCase:
        """That of the largest gain, with its pose."""
        return max(self.cases, key=lambda case: case.gain)

    @property
    def stable(self) -> bool:
        """Whether no sample was found unstable at any pose."""
        return all(case.stable for case in self.cases)

    @property
    def table(self) -> "report.Table":
        """The worst gains, pose by pose."""
        return robust.tables.worst_table(self.cases)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"worst": self.worst.pose, "cases": [case.as_dict() for case in self.cases]}

    def _repr_html_(self) -> str:
        return report.table_html(self.table, [self.worst.sentence])


class Search(NamedTuple):
    """What a search for the worst sample found.

    Args:
        loops, ends: the closed loop, and the names of its input and output.
        deltas, worst: of the worst sample, and its peak.
        peaks: of the draws.
        grid: `(k,)` frequencies that show them [rad/s].
    """

    loops: Loops
    ends: tuple[str, str]
    deltas: Array
    worst: Peak
    peaks: Sequence[Peak]
    grid: Array


class UncertainPlant(Lft):
    """A plant with its uncertain quantities pulled out, `[z, y] = M [w, u]`, `w = Delta z`;
    made by `robust.uncertain`.

    `nominal` is M as a `control.StateSpace`, w and z before the plant's own signals; `blocks` are
    the deltas, each in [-1, 1], in the order in which they stand on the diagonal of Delta. `sample`
    closes M, `draw` draws values.

    Args:
        source: what the plant was made of.
        quantities: what is uncertain.
        correlations: of these, as in the craft's file.
        warnings: what a user must know.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> boom = bc.Spec(
        ...     segment=(bc.Segment(length=8.0, section=section),),
        ...     fit=bc.spec.FitOptions(springs="modes"),
        ... )
        >>> tenth = bc.spec.Uncertainty(relative=0.1, distribution="uniform")
        >>> plant = bc.plant(bc.embed(craft, {"mount": boom}), inputs=["torque:bus"])
        >>> uncertain = robust.uncertain(
        ...     plant, bc.spec.UncertainCraft(body={"bus": bc.spec.UncertainBody(mass=tenth)})
        ... )
        >>> [(block.name, block.repetitions) for block in uncertain.blocks]
        [('bus.mass', 3)]
        >>> light = uncertain.sample({"bus.mass": 280.0})
    """

    def loops(self, controller: Controller, input: str, output: str) -> Loops:
        """The controller's loops closed around M.

        Args:
            controller: the loops.
            input: of the plant, where the disturbance is added.
            output: of the plant, where its effect is seen.
        """
        blocks = [int(number) for number in self._group[self._of]]
        return Loops(self._system, blocks, self.inputs, self.outputs, controller, (input, output))

    @one_thread()
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
        bound: bool = False,
        seconds: float = SECONDS,
    ) -> WorstCase:
        """The worst gain of a closed loop over all values of the uncertain quantities, as far as a
        search finds it, and what it cannot exceed where `bound` asks for that.

        Tried are draws, corners of the ranges, and a local search from the worst of both. Dead
        times are exact in gains. The worst sample is
        run in MuJoCo: its values are written into the compiled model, which `mj_step` takes
        through a sine at the worst frequency with the controller in the loop, until the motion is
        steady. A run that would take more than 300,000 steps is left out.

        Args:
            controller: loops, or the path of their file.
            input: where the disturbance is added to the plant's input;
                that of the first loop where left out.
            output: of the plant; that of the first loop where left out.
            omega: `(k,)` frequencies [rad/s] at which the result states the gains, to which the
                worst sample's own is added; where left out, about the peaks that are found.
            samples: number of draws from the distributions.
            seed: of the draws.
            simulate: run the worst sample in MuJoCo.
            bound: prove an upper bound as well, see `bound`; not where an unstable sample was
                found.
            seconds: for the bound, after which it is refined no further.

        Raises:
            InputError: a name is unknown, the nominal loop is unstable, or the extra `robust` is
                not installed.
        """
        search_of = self._search(controller, input, output, omega, samples, seed, seconds)
        loops, ends, deltas, worst, peaks, grid = search_of
        limit = None
        nominal = np.zeros(len(self.blocks))
        if bound and worst.stable:
            limit, deltas, worst = self._bound(search_of, seconds)
        grid = _with_peak(grid, worst)
        simulated = float("nan")
        if simulate and worst.stable:
            sample = self._again(deltas[self._group])
            settling = loops.settling(deltas, worst.omega, FORGOTTEN)
            simulated = simulated_gain(sample, loops.controller, ends, worst.omega, settling)
        output_unit = self.units[1][place(ends[1], self.outputs, "output", "")]
        input_unit = self.units[0][place(ends[0], self.inputs, "input", "")]
        return WorstCase(
            input=ends[0],
            output=ends[1],
            unit=f"{output_unit} per {input_unit}",
            omega=locked(grid),
            nominal=locked(loops.gain(nominal, grid)),
            worst=locked(loops.gain(deltas, grid)),
            drawn=locked([peak.gain for peak in peaks]),
            deltas=locked(deltas),
            values=self.values(deltas),
            gain=worst.gain,
            frequency=worst.omega,
            simulated=simulated,
            nominal_values={q.name: q.nominal for q in self.quantities},
            percent=self.percent(deltas),
            value_units={q.name: q.unit for q in self.quantities},
            bound=limit,
        )

    @one_thread()
    def bound(
        self,
        controller: Controller | str | Path,
        input: str | None = None,
        output: str | None = None,
        omega: ArrayLike | None = None,
        *,
        samples: int = 100,
        seed: int = 0,
        seconds: float = SECONDS,
    ) -> GainBound:
        """What the gain of a closed loop cannot exceed at any values of the uncertain quantities
        in their ranges: steps over frequency, each of which holds between its ends.

        For every interval a semidefinite program (cvxpy, Clarabel) gives multipliers, and the
        eigenvalues of a Hamiltonian matrix the gain that these prove from one end to the other; see
        docs/theory.md, section 8. Dead times are exact. Correlated quantities take all values of
        their ranges. A finite bound proves that the loop is stable for all values.

        Args:
            controller, input, output: as of `worst_case`.
            omega: `(k,)` frequencies [rad/s] at which samples say where to look.
            samples, seed: draws that say where to look.
            seconds: after which nothing is refined further.

        Raises:
            InputError: a name is unknown, the nominal loop is unstable, or the extra `robust` is
                not installed.
        """
        search_of = self._search(controller, input, output, omega, samples, seed, seconds)
        return self._bound(search_of, seconds)[0]

    @one_thread()
    def worst_margins(
        self,
        controller: Controller | str | Path,
        *,
        samples: int = 50,
        seed: int = 0,
        bound: bool = False,
        seconds: float = SECONDS,
    ) -> WorstMargins:
        """The least margins over the values of the uncertain quantities, as far as a search finds
        them: at every input that loops drive, the loops of the others closed, and of the disk
        margin all loops at once.

        Tried are draws, corners of the ranges, those to which slopes point at every frequency, and
        for every figure a local search from the least of all that was tried for any. What is stated
        is what `bc.margins` states at these values, the least over all of them.

        Args:
            controller: loops, or the path of their file.
            samples: number of draws from the distributions.
            seed: of the draws.
            bound: prove as well what no value lets the disk margins fall below; not where an
                unstable sample was found, of which no margin is left.
            seconds: for the bounds together, after which they are refined no further.

        Raises:
            InputError: a name is unknown, or the nominal loop is unstable.
        """
        whole_number("samples", samples, 0, LARGEST)
        whole_number("seed", seed, 0, LARGEST)
        positive("seconds", seconds, "s")
        loops_of = read_controller(controller)
        blocks = [int(number) for number in self._group[self._of]]
        loops = SampleLoops(self._system, blocks, self.inputs, self.outputs, loops_of)
        nominal = np.zeros(len(self.blocks))
        if not loops.margins(nominal).stable:
            raise InputError(
                "controller: the closed loop of the nominal plant is not stable, so that nothing "
                "can be worse; bc.margins says why."
            )
        drawn = self.drawn_deltas(samples, seed)
        corners = np.random.default_rng(seed).choice([-1.0, 1.0], (CORNERS, nominal.size))
        points = [nominal, *loops.search([nominal, *drawn, *corners])]
        found = [loops.margins(deltas) for deltas in points]
        bounds: dict[str, GainBound] = {}
        # of an unstable sample no margin is left, which needs no proof
        for i, name in enumerate(loops.names if bound and found[-1].stable else ()):
            disk = loops.disk(name)
            peaks = [disk.peak(deltas) for deltas in points]
            k = min(range(len(found)), key=lambda k: found[k].loops[i].disk)
            grid = _grid(disk, peaks[k], [points[k], nominal], peaks)
            search_of = Search(disk, (name, name), points[k], peaks[k], peaks, grid)
            bounds[name], better, _ = self._bound(search_of, seconds / len(loops.names))
            points.append(better)
            found.append(loops.margins(better))
        rows: list[LeastMargin] = []
        for at, kind in loops.rows:
            each = [figure(one, at, kind) for one in found]
            k = min(range(len(each)), key=lambda k: smallness(kind, each[k].value))
            values, by_block = self._sample(points[k])
            unit = "degrees" if kind == PHASE else ""
            proved = 1.0 / bounds[at].gain if at in bounds else 0.0
            rows.append(
                LeastMargin(
                    at,
                    kind,
                    unit,
                    each[0].value,
                    *each[k],
                    values,
                    proved if bound and kind == DISK and at != ALL else None,
                    by_block,
                )
            )
        return WorstMargins(tuple(rows), all(one.stable for one in found), bounds)

    def _sample(self, deltas: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Values of the quantities for `(blocks,)` deltas, and these by block."""
        names = [block.name for block in self.blocks]
        return self.values(deltas), dict(zip(names, deltas.tolist(), strict=True))

    def _search(
        self,
        controller: Controller | str | Path,
        input: str | None,
        output: str | None,
        omega: ArrayLike | None,
        samples: int,
        seed: int,
        seconds: float,
    ) -> "Search":
        """The worst sample that is found."""
        whole_number("samples", samples, 0, LARGEST)
        whole_number("seed", seed, 0, LARGEST)
        positive("seconds", seconds, "s")
        asked = [
            positive("omega", w, "rad/s")
            for w in ([] if omega is None else np.atleast_1d(omega).tolist())
        ]
        loops_of = read_controller(controller)
        places(loops_of, self.inputs, self.outputs)  # refused before the first loop is asked
        for field, name in (("input", input), ("output", output)):
            if name is not None:
                of_type(field, name, str, "the name of a plant's input or output")
        ends = input or loops_of.loop[0].input, output or loops_of.loop[0].output
        loops = self.loops(loops_of, *ends)
        deltas, worst, peaks = search(loops, self.drawn_deltas(samples, seed), seed)
        nominal = np.zeros(len(self.blocks))
        if omega is None:
            grid = _grid(loops, worst, [deltas, nominal], [*peaks, loops.peak(nominal)])
        else:
            grid = _with_peak(np.array(asked), worst)
        return Search(loops, ends, deltas, worst, peaks, grid)

    def _bound(self, found: "Search", seconds: float) -> tuple[GainBound, Array, Peak]:
        """The bound, and the worst sample after it: a program's worst case may be a worse one."""
        loops = found.loops
        nominal = np.zeros((1, len(self.blocks)))
        corners = np.random.default_rng(0).choice([-1.0, 1.0], (CORNERS, len(self.blocks)))
        samples = np.vstack([found.deltas[None], nominal, corners])
        omega = frequencies(loops, found.grid)
        bounder = Bounder(loops, self.blocks, samples, omega, seconds)
        bound = bounder.bound()
        deltas, gain = bounder.best
        if found.worst.stable and gain > found.worst.gain:
            better = climb(loops, deltas)
            return bound, better.deltas, better.peak
        return bound, found.deltas, found.worst

    def drawn_deltas(self, samples: int, seed: int) -> Array:
        """`(samples, blocks)` deltas of draws from the distributions.

        Args:
            samples: number of draws.
            seed: of the draws.
        """
        rows = [self._block_deltas(values) for values in self.draw(samples, seed)]
        return np.array(rows).reshape(-1, len(self.blocks))

    def percent(self, deltas: Array) -> dict[str, float]:
        """Where every quantity lies in its range, -100 to 100, of `(blocks,)` deltas."""
        each = 100.0 * deltas[self._group]
        return {q.name: float(value) for q, value in zip(self.quantities, each, strict=True)}

    def _block_deltas(self, values: Mapping[str, float]) -> Array:
        """`(blocks,)` deltas of a draw; correlated ones differ within a block,
        which takes the first."""
        each = self._deltas(values)
        return np.array([each[int(np.argmax(self._group == k))] for k in range(len(self.blocks))])


def _with_peak(omega: Array, worst: Peak) -> Array:
    """Frequencies with that of the worst sample, unless it drifts away."""
    return np.unique(np.append(omega, [worst.omega] if worst.omega else []))


def _grid(loops: Loops, worst: Peak, samples: Sequence[Array], peaks: Sequence[Peak]) -> Array:
    """Frequencies over the band of the closed loop, closer about its resonances in `samples`."""
    if not worst.stable and worst.omega:
        return worst.omega * np.unique([*np.geomspace(0.5, 2.0, GRID), 1.0])
    poles = np.concatenate([loops._resonances(deltas).poles for deltas in samples])
    light = poles[(np.abs(poles.real) < 0.1 * np.abs(poles)) & (poles.imag > 0.0)]
    tops = [peak.omega for peak in (*peaks, worst) if peak.stable]
    low = 0.3 * min(tops)
    high = 1.5 * max([*np.abs(light), float(np.abs(poles).min()), tops[-1]])
    near = (light.imag[:, None] - light.real[:, None] * AROUND).ravel()
    omega = np.concatenate([np.geomspace(low, high, GRID), near, [tops[-1]]])
    return np.unique(omega[(omega >= low) & (omega <= high)])


def uncertain_plant(source: PlantSource, given: UncertainCraft | None) -> UncertainPlant:
    """The uncertain plant of a craft; what is `given` goes before the specifications of
    embedded appendages."""
    tables = {
        appendage.prefix: appendage.spec.uncertain
        for appendage in (source.embedded.appendages if source.embedded else ())
        if appendage.spec.uncertain is not None
    }
    warnings = [
        Caution(
            "left-certain",
            f"the structural properties that {prefix!r} has uncertain (stiffness, density, ...) "
            "are left certain in the plant: they change the fit itself; beamchain sweep shows what "
            "they do to the modes.",
        )
        for prefix, table in tables.items()
        if table.structural
    ]
    modal = {prefix: table for prefix, table in tables.items() if _has_modes(table)}
    given_prefixes = given.appendage if given else {}
    correlations = [
        Correlation(of=tuple(f"{prefix}{name}" for name in each.of), matrix=each.matrix)
        for prefix, table in modal.items()
        if prefix not in given_prefixes
        for each in table.correlation
    ]
    uncertain = quantities(source.craft.point.model, given, modal, correlations)
    if not uncertain:
        raise InputError(
            "uncertain: nothing is; give a file with [body.NAME], [joint.NAME] or "
            "[appendage.PREFIX], or [uncertain] with frequency, damping or participation in an "
            "appendage's specification."
        )
    every_correlation = [*correlations, *(given.correlation if given else ())]
    return UncertainPlant(source, uncertain, every_correlation, warnings)


def _has_modes(table: Uncertain) -> bool:
    """Whether a table says of any mode that it is uncertain."""
    return any(
        getattr(part, kind) is not None for part in (table, *table.mode) for kind in OF_MODES
    )
