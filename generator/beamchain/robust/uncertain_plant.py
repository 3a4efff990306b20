"""An uncertain plant, and the worst that a given controller meets in it."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from beamchain.checks import of_type, positive, whole_number
from beamchain.errors import InputError
from beamchain.results import Margins
from beamchain.robust.bounds import Bounder, GainBound, frequencies
from beamchain.robust.least_margins import (
    ALL,
    DISK,
    GAIN,
    LESS,
    PHASE,
    LeastMargin,
    WorstMargins,
    figure,
    smallness,
)
from beamchain.robust.lft import LARGEST, Lft
from beamchain.robust.search import Search, Tell, stability_limit
from beamchain.robust.simulated_gain import FORGOTTEN, simulated_gain
from beamchain.robust.uncertain_loop import TOTAL, UncertainLoop
from beamchain.robust.worst_gains import WorstCase
from beamchain.spec import Controller, Correlation, Uncertain, UncertainCraft
from beamchain.toolkit import (
    OF_MODES,
    Array,
    Given,
    PlantSource,
    locked,
    one_thread,
    place,
    quantities,
    read_controller,
)
from beamchain.warning_codes import Caution

SECONDS = 120.0  # after which a bound is refined no further
CORNERS = 40  # of the ranges, which are tried, and whose gains say where a bound is to be close
# frequencies of the curves: per decade, and half widths beside a resonance
CURVES = 100, np.sinh(np.linspace(-3.0, 3.0, 13))
UNSTABLE = 300  # frequencies of the curves about that at which a loop begins to ring


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

    @cached_property
    def found(self) -> list[Array]:
        """Where searches have ended, which others try as well."""
        return []

    def loops(
        self,
        controller: Given,
        input: str | None = None,
        output: str | None = None,
        offset: float = 0.0,
    ) -> UncertainLoop:
        """A controller's loops closed around M.

        Args:
            controller: as of `bc.margins`.
            input: of the plant, where the disturbance is added; all that are driven where left out.
            output: of the plant, where its effect is seen.
            offset: added to the response.
        """
        if isinstance(controller, str | Path):
            controller = read_controller(controller)
        return UncertainLoop(
            self._system,
            [int(number) for number in self._group[self._of]],
            self.inputs,
            self.outputs,
            controller,
            None if input is None or output is None else (input, output),
            offset,
        )

    @one_thread()
    def worst_case(
        self,
        controller: Given,
        input: str | None = None,
        output: str | None = None,
        omega: ArrayLike | None = None,
        *,
        samples: int = 100,
        seed: int = 0,
        simulate: bool = True,
        bound: bool = False,
        seconds: float = SECONDS,
        progress: Tell | None = None,
    ) -> WorstCase:
        """The worst gain of a closed loop over all values of the uncertain quantities, as far as a
        search finds it, and what it cannot exceed where `bound` asks for that.

        Tried are draws, corners of the ranges, those to which slopes point at every frequency,
        where earlier searches ended, and a local search from the worst of all. Dead times are exact
        in gains. The worst sample of continuous loops is
        run in MuJoCo: its values are written into the compiled model, which `mj_step` takes
        through a sine at the worst frequency with the controller in the loop, until the motion is
        steady. A run that would take more than 300,000 steps is left out.

        Args:
            controller: as of `bc.margins`; of a sampled one, gains are those at the samples.
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
            progress: told what is being done, such as `print`.

        Raises:
            InputError: a name is unknown, the nominal loop is unstable, a bound is asked for of a
                sampled controller, or the extra `robust` is not installed.
        """
        asked = _checked(samples, seed, seconds, omega)
        search = self._gain_search(controller, input, output, samples, seed, progress)
        loop, ends = search.loop, search.loop.ends
        nominal = np.zeros(len(self.blocks))
        drawn = [search.reach(row) for row in self.drawn_deltas(samples, seed)]
        grid = self._curves(search) if asked is None else asked
        limit = self._bound(search, grid, seconds) if bound and search.stable else None
        deltas = search.worst(0)
        gain, frequency = (float(part[0]) for part in search.reach(deltas))
        simulated = float("nan")
        if not search.stable:
            frequency = stability_limit(loop, deltas)
            if asked is None and frequency:
                grid = frequency * np.unique([*np.geomspace(0.5, 2.0, UNSTABLE), 1.0])
        elif simulate and isinstance(loop.controller, Controller):
            sample = self._again(deltas[self._group])
            settling = loop.settling(deltas, frequency, FORGOTTEN)
            simulated = simulated_gain(sample, loop.controller, ends, frequency, settling)
        grid = np.unique(np.append(grid, [frequency] if frequency else []))
        output_unit = self.units[1][place(ends[1], self.outputs, "output", "")]
        input_unit = self.units[0][place(ends[0], self.inputs, "input", "")]
        return WorstCase(
            input=ends[0],
            output=ends[1],
            unit=f"{output_unit} per {input_unit}",
            omega=locked(grid),
            nominal=locked(loop.gain(nominal, grid)),
            worst=locked(loop.gain(deltas, grid)),
            drawn=locked([reach.sizes[0] for reach in drawn]),
            deltas=locked(deltas),
            values=self.values(deltas),
            gain=gain,
            frequency=frequency,
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
            controller: continuous loops, a file or `bc.spec.Controller`.
            input, output: as of `worst_case`.
            omega: `(k,)` frequencies [rad/s] at which samples say where to look.
            samples, seed: draws that say where to look.
            seconds: after which nothing is refined further.

        Raises:
            InputError: a name is unknown, the nominal loop is unstable, or the extra `robust` is
                not installed.
        """
        asked = _checked(samples, seed, seconds, omega)
        search = self._gain_search(controller, input, output, samples, seed)
        return self._bound(search, self._curves(search) if asked is None else asked, seconds)

    @one_thread()
    def worst_margins(
        self,
        controller: Given,
        *,
        samples: int = 50,
        seed: int = 0,
        bound: bool = False,
        seconds: float = SECONDS,
        progress: Tell | None = None,
    ) -> WorstMargins:
        """The least margins over the values of the uncertain quantities, as far as a search finds
        them: at every input that loops drive, the loops of the others closed, and of the disk
        margin all loops at once.

        Tried are draws, corners of the ranges, those to which slopes point at every frequency,
        where earlier searches ended, and for every figure a local search from the least of all that
        was tried for any. What is stated is what `bc.margins` states at these values, the least
        over all of them.

        Args:
            controller: as of `bc.margins`.
            samples: number of draws from the distributions.
            seed: of the draws.
            bound: prove as well what no value lets the disk margins fall below; not where an
                unstable sample was found, of which no margin is left.
            seconds: for the bounds together, after which they are refined no further.
            progress: told what is being done, such as `print`.

        Raises:
            InputError: a name is unknown, the nominal loop is unstable, or a bound is asked for of
                a sampled controller.
        """
        _checked(samples, seed, seconds)
        loop = self.loops(controller)
        nominal = np.zeros(len(self.blocks))
        if not (first := self._margins(loop, nominal)).stable:
            raise InputError(
                "controller: the closed loop of the nominal plant is not stable, so that nothing "
                "can be worse; bc.margins says why."
            )
        search = self._searched(loop, samples, seed, progress)
        points = [nominal, *search.found()]
        bounds: dict[str, GainBound] = {}
        # of an unstable sample no margin is left, which needs no proof
        for name in loop.names if bound and search.stable else ():
            disk = Search(self.loops(loop.controller, name, TOTAL + name, loop.offset))
            for deltas in points:
                disk.reach(deltas)
            share = seconds / len(loop.names)
            bounds[name] = self._bound(disk, self._curves(disk), share)
            points.append(disk.worst(0))
        points = list({deltas.tobytes(): deltas for deltas in points}.values())
        margins = [first, *(self._margins(loop, deltas) for deltas in points[1:])]
        single = [(at, kind) for kind in (GAIN, LESS, PHASE) for at in loop.names]
        rows: list[LeastMargin] = []
        for at, kind in (*((at, DISK) for at in loop.names), *single, (ALL, DISK)):
            each = [figure(one, at, kind) for one in margins]
            k = min(range(len(each)), key=lambda k: smallness(kind, each[k].value))
            proved = 1.0 / bounds[at].gain if at in bounds else 0.0
            rows.append(
                LeastMargin(
                    at,
                    kind,
                    "degrees" if kind == PHASE else "",
                    each[0].value,
                    *each[k],
                    self.values(points[k]),
                    proved if bound and kind == DISK and at != ALL else None,
                    {b.name: float(d) for b, d in zip(self.blocks, points[k], strict=True)},
                )
            )
        return WorstMargins(tuple(rows), search.stable, bounds)

    def _margins(self, loop: UncertainLoop, deltas: Array) -> Margins:
        """What `bc.margins` says of the craft with the values of a sample `(blocks,)`."""
        # in the sample's own modes, which responses take apart
        form = self._again(deltas[self._group]).form().minimal()
        return loop.margins((form.a, form.b, form.c, form.d))

    def _gain_search(
        self,
        controller: Given,
        input: str | None,
        output: str | None,
        samples: int,
        seed: int,
        progress: Tell | None = None,
    ) -> "Search[UncertainLoop]":
        """A search for the worst gain from an input to an output."""
        for field, name in (("input", input), ("output", output)):
            if name is not None:
                of_type(field, name, str, "the name of a plant's input or output")
        first = self.loops(controller)
        loop = self.loops(first.controller, input or first.names[0], output or first.measured[0])
        loop.check_gain()
        return self._searched(loop, samples, seed, progress)

    def _searched(
        self, loop: UncertainLoop, samples: int, seed: int, progress: Tell | None
    ) -> "Search[UncertainLoop]":
        """A search from draws, corners, and where earlier ones ended."""
        corners = np.random.default_rng(seed).choice([-1.0, 1.0], (CORNERS, len(self.blocks)))
        search = Search(loop, progress)
        nominal = np.zeros(len(self.blocks))
        search.run([nominal, *self.found, *self.drawn_deltas(samples, seed), *corners])
        known = {deltas.tobytes() for deltas in self.found}
        self.found += [deltas for deltas in search.found() if deltas.tobytes() not in known]
        return search

    def _bound(self, search: "Search[UncertainLoop]", grid: Array, seconds: float) -> GainBound:
        """The bound; where its programs find a worse sample than the search, that goes on from
        there."""
        if not isinstance(search.loop.controller, Controller):
            raise InputError(
                "bound: bounds take continuous loops, the path of a TOML file with [[loop]] or "
                "bc.spec.Controller; leave bound out."
            )
        nominal = np.zeros((1, len(self.blocks)))
        corners = np.random.default_rng(0).choice([-1.0, 1.0], (CORNERS, len(self.blocks)))
        samples = np.vstack([search.worst(0)[None], nominal, corners])
        omega = frequencies(search.loop, grid)
        bounder = Bounder(search.loop, self.blocks, samples, omega, seconds)
        bound = bounder.bound()
        deltas, gain = bounder.best
        if search.stable and gain > search.sizes[0]:
            search.climb(0, deltas)
        return bound

    def _curves(self, search: "Search[UncertainLoop]") -> Array:
        """Frequencies over the band of the closed loop, closer about resonances of the nominal
        sample and of the worst."""
        loop = search.loop
        closed = [loop.closed(d) for d in (search.worst(0), np.zeros(len(self.blocks)))]
        poles = np.concatenate([one.to_s(one.eigenvalues) for one in closed])
        light = poles[(np.abs(poles.real) < 0.1 * np.abs(poles)) & (poles.imag > 0.0)]
        reaches = [search.reach(deltas) for deltas in (*search.tried, search.worst(0))]
        tops = [float(reach.omega[0]) for reach in reaches if reach.stable]
        high = 1.5 * max([*np.abs(light), float(np.abs(poles).min()), tops[-1]])
        low = 0.3 * min(tops)
        near = [one.frequencies(*CURVES) for one in closed]
        omega = np.unique(np.concatenate([[low, high], *near]))
        return omega[(omega >= low) & (omega <= high)]

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


def _checked(
    samples: int, seed: int, seconds: float, omega: ArrayLike | None = None
) -> Array | None:
    """What was asked, refused where it is no number of that kind; the frequencies."""
    whole_number("samples", samples, 0, LARGEST)
    whole_number("seed", seed, 0, LARGEST)
    positive("seconds", seconds, "s")
    if omega is None:
        return None
    return np.array([positive("omega", w, "rad/s") for w in np.atleast_1d(omega).tolist()])


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
