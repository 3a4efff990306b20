"""`pointing`: jitter and pointing budgets of a flexible spacecraft, source by source."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamchain import Embedded, pointing, report
from beamchain.checks import positive, unknown
from beamchain.errors import InputError
from beamchain.pointing.disturbed_craft import DisturbedCraft, disturbed_craft
from beamchain.pointing.error_indices import SIGMAS, ErrorIndex
from beamchain.pointing.jitter_sources import (
    Disturbances,
    NoiseDisturbance,
    StepperDisturbance,
    ThermalSnap,
    WheelDisturbance,
    read_disturbances,
)
from beamchain.pointing.modal_response import REST, ModalResponse
from beamchain.pointing.source_errors import (
    SourceError,
    noise_error,
    snap_error,
    stepper_error,
    wheel_error,
    wheel_lines,
)
from beamchain.pointing.wheel_run import WheelRun, run_wheel
from beamchain.pointing.wheel_sweep import UNDAMPED
from beamchain.toolkit import (
    FILLER,
    Appendage,
    LinearCraft,
    OutputNames,
    Pose,
    compiled_model,
    linear_omissions,
    locked,
    marked_appendages,
    mujoco,
    one_thread,
    without_timing,
)
from beamchain.warning_codes import Caution, warnings_record

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GROWS = 1e-6  # damping ratio below whose negative a craft is unstable
# beyond what wheels have: a static imbalance over the mass [m], a dynamic one over the inertia
FAR_OFF, ASKEW = 1e-4, 1e-3
RIGID = 1e-6  # of the fastest pole: slower ones are rigid motion


class WorstError(NamedTuple):
    """The source that makes the largest error of an output.

    Args:
        output: name.
        source: name.
        peak: largest APE.
        speed: of the wheel [rad/s]; None: the source is no wheel.
        mode: that has the largest share.
        share: of that mode.
    """

    output: str
    source: str
    peak: float
    speed: float | None
    mode: str
    share: float


@dataclass(frozen=True, eq=False, repr=False)
class Pointing:
    """A pointing budget: what each source does to each output, and all together.

    Args:
        outputs: names.
        units: of the outputs.
        window: of RPE [s].
        sources: the error that each makes.
        ape: of all sources, per output.
        rpe: of all sources, per output.
        warnings: what to know before use.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import pointing
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/>
        ... <body name="wheel" pos="0 0 0.4"><joint name="rw" axis="0 1 0"/>
        ... <inertial pos="0 0 0" mass="5" diaginertia="0.02 0.04 0.02"/></body></body>
        ... </worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(
        ...     segment=(bc.Segment(length=8.0, section=section),),
        ...     damping=bc.Damping(ratio=0.005),
        ... )
        >>> wheel = pointing.WheelDisturbance(joint="rw", speeds=(1.0, 40.0), static=1e-6)
        >>> budget = pointing.budget(
        ...     bc.embed(craft, {"mount": spec}), pointing.Disturbances(wheel=(wheel,))
        ... )
        >>> budget.worst[1].source, budget.worst[1].mode
        ('wheel rw', 'appendage_mode1_xz')
    """

    outputs: tuple[str, ...]
    units: tuple[str, ...]
    window: float
    sources: tuple[SourceError, ...]
    ape: ErrorIndex
    rpe: ErrorIndex
    warnings: tuple[str, ...]
    _whole: DisturbedCraft
    _given: Disturbances

    def __repr__(self) -> str:
        worst = ", ".join(
            f"{e.output} {e.peak:.4g} {unit} ({e.source})"
            for e, unit in zip(self.worst, self.units, strict=True)
        )
        return f"<Pointing, {len(self.sources)} sources, RPE over {self.window:g} s; worst {worst}>"

    def _repr_html_(self) -> str:
        notes = [f"note: {text}" for text in self.warnings]
        return report.table_html(self.table, notes)

    def __getitem__(self, name: str) -> SourceError:
        """A source's error by its name.

        Raises:
            InputError: there is no such source.
        """
        for source in self.sources:
            if source.name == name:
                return source
        raise unknown("source", name, [source.name for source in self.sources])

    @property
    def table(self) -> "report.Table":
        """The budget: source by source and in total, per output."""
        return pointing.tables.pointing_table(self)

    @property
    def mode_table(self) -> "report.Table":
        """The modes that the errors come from, source by source."""
        return pointing.tables.pointing_mode_table(self)

    @property
    def worst(self) -> tuple[WorstError, ...]:
        """Per output the source whose error has the largest peak."""
        out: list[WorstError] = []
        for number, name in enumerate(self.outputs):
            source = max(self.sources, key=lambda s, n=number: float(s.ape.peak[n]))
            mode, share = next(iter(source.shares[number].items()), (REST, float("nan")))
            speed = None if source.speed is None else float(source.speed[number])
            peak = float(source.ape.peak[number])
            out.append(WorstError(name, source.name, peak, speed, mode, share))
        return tuple(out)

    def as_dict(self) -> dict[str, Any]:
        """Numbers and names, for JSON."""
        return {
            "window": self.window,
            "budget": self.table.records(),
            "modes": self.mode_table.records(),
            "warnings": warnings_record(self.warnings),
        }

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Peaks of the error over the speed of the wheels, one curve per output and wheel.
        Returns the axes; shows nothing.

        Args:
            ax: drawn into; those of a new figure where left out.

        Raises:
            InputError: no source is a wheel.
        """
        if not self._given.wheel:
            raise InputError("plot: no source is a wheel, so that nothing depends on a speed.")
        return pointing.plots.plot_pointing(self, ax=ax)

    @one_thread()
    def simulate(self, source: str | None = None, output: str | None = None) -> WheelRun:
        """A plain MuJoCo run of a wheel's disturbance, at the speed of the largest stated error.

        The wheel turns at that speed, forces and torques turn with it on its mass centre, in phases
        in which they add up for the output. Five time constants of the mode that has the largest
        share pass before the amplitude is measured.

        Args:
            source: name of a wheel, such as `wheel rw1`; where left out, that with the largest
                error.
            output: name; where left out, that of the wheel's largest error, among those with the
                unit of the first.

        Raises:
            InputError: the source is no wheel, or the run would be too long.
        """
        wheels = {name: s for name, s in self._given.named if isinstance(s, WheelDisturbance)}
        if not wheels:
            raise InputError("simulate: no source is a wheel; runs are made of wheels alone.")
        if source is not None and source not in wheels:
            raise unknown("source", source, wheels)
        if output is not None and output not in self.outputs:
            raise unknown("output", output, self.outputs)
        alike = [n for n, unit in enumerate(self.units) if unit == self.units[0]]
        numbers = alike if output is None else [self.outputs.index(output)]
        names = list(wheels) if source is None else [source]
        name, number = max(
            ((name, n) for name in names for n in numbers),
            key=lambda at: float(self[at[0]].ape.peak[at[1]]),
        )
        return _simulate(self, name, wheels[name], number)


@one_thread()
def budget(
    craft: "Embedded | mujoco.MjSpec | mujoco.MjModel | str | Path",
    disturbances: "Disturbances | str | Path",
    outputs: OutputNames = None,
    pose: Pose = None,
    *,
    rates: Mapping[str, float] | None = None,
    window: float = 1.0,
) -> Pointing:
    """Jitter and pointing budget of a flexible spacecraft, source by source.

    Of the linear craft in free fall, without a controller: below the bandwidth of the attitude loop
    errors are smaller than stated. A wheel's disturbance is looked at over its speeds: its
    gyroscopic moments at each speed are part of the craft, and every resonance is resolved. One
    wheel is swept at a time, the others turn at `rates`.

    Indices as in ECSS-E-ST-60-10C: APE is the error itself, RPE its deviation from the mean over
    `window`. Peaks are what a periodic or transient error reaches (orders of a wheel in their worst
    phases; harmonics of a drive in theirs), and three sigma of a random one, which is within them
    99.7 % of the time. Sources are independent: root mean squares add up as squares; peaks of
    periodic and transient sources add up as they are, and three sigma of all random ones together
    on top.

    Args:
        craft: path or text of an MJCF file, MjSpec, MjModel, or what `bc.embed` returns.
        disturbances: `pointing.Disturbances`, or the path of its TOML file.
        outputs: as for `bc.plant`; the attitude of the base body where left out.
        pose: as for `bc.plant`.
        rates: `{joint: rad/s}` of wheels that turn; those of the keyframe where left out.
        window: of RPE [s], such as the time of an exposure.

    Raises:
        InputError: a joint, signal, appendage or output that is not there, a wheel that is not
            balanced, an undamped mode that is driven without limit, or an unstable craft.
        EngineError: MuJoCo refuses the model.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import pointing
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(
        ...     segment=(bc.Segment(length=8.0, section=section),),
        ...     damping=bc.Damping(ratio=0.005),
        ... )
        >>> noise = pointing.NoiseDisturbance(
        ...     input="torque:bus", frequency=(0.1, 10.0), density=(1e-8, 1e-8)
        ... )
        >>> budget = pointing.budget(
        ...     bc.embed(craft, {"mount": spec}), pointing.Disturbances(psd=(noise,)), window=0.5
        ... )
        >>> budget.ape.rms.shape, bool((budget.rpe.rms < budget.ape.rms).all())
        ((3,), True)
    """
    given = read_disturbances(disturbances)
    window = positive("window", window, "s")
    model = without_timing(compiled_model(craft))
    asked = ["attitude"] if outputs is None else outputs
    whole = disturbed_craft(model, given, asked, pose, rates, _appendages(craft, given))
    _check_stable(whole)
    errors: list[SourceError] = []
    for number, (name, source) in enumerate(given.named):
        match source:
            case WheelDisturbance():
                errors.append(wheel_error(whole, number, name, source, window))
            case StepperDisturbance():
                errors.append(stepper_error(whole, number, name, source, window))
            case NoiseDisturbance():
                errors.append(noise_error(whole, number, name, source, window))
            case ThermalSnap():
                errors.append(snap_error(whole, number, name, source, window))
    _, names, _, units = whole.craft.signals
    return Pointing(
        outputs=tuple(names),
        units=tuple(units),
        window=window,
        sources=tuple(errors),
        ape=_total([error.ape for error in errors], [error.kind for error in errors]),
        rpe=_total([error.rpe for error in errors], [error.kind for error in errors]),
        warnings=(*linear_omissions(model), *_imbalances(model, given), *_beyond(whole, given)),
        _whole=whole,
        _given=given,
    )


def _appendages(
    craft: "Embedded | mujoco.MjSpec | mujoco.MjModel | str | Path", given: Disturbances
) -> tuple[Appendage, ...]:
    """The appendages of a craft where the displacement of a tip asks for them, and known."""
    if all(snap.displacement is None for snap in given.snap):
        return ()
    if isinstance(craft, Embedded):
        return craft.appendages
    marked = marked_appendages(craft) if isinstance(craft, str | Path) else None
    return () if marked is None else marked[1]


def _total(indices: list[ErrorIndex], kinds: list[str]) -> ErrorIndex:
    """One index of all sources together; NaN where no source has a mean square."""
    rms = np.array([index.rms for index in indices])
    stationary = np.isfinite(rms).any(axis=0)
    whole = np.where(stationary, np.sqrt(np.nansum(rms**2, axis=0)), np.nan)
    peaks = np.array([index.peak for index in indices])
    random = np.array([kind == "psd" for kind in kinds])
    variance = (rms[random] ** 2).sum(axis=0)
    peak = peaks[~random].sum(axis=0) + SIGMAS * np.sqrt(variance)
    return ErrorIndex(locked(whole), locked(peak))


def _check_stable(whole: DisturbedCraft) -> None:
    """Refuse a craft whose motion grows."""
    poles = np.linalg.eigvals(whole.craft.linear.first_order()[0])
    size = np.abs(poles)
    moves = size > RIGID * size.max(initial=0.0)
    growing = poles[moves & (poles.real > GROWS * size)]
    if growing.size:
        worst = growing[np.argmax(growing.real)]
        raise InputError(
            f"the craft is unstable: its motion at {abs(worst):.5g} rad/s grows by "
            f"{worst.real:.3g} per second, and so does its error; check the signs of gains and "
            "springs."
        )


def _imbalances(model: "mujoco.MjModel", given: Disturbances) -> list[str]:
    """What to say of wheels whose mass would lie farther off the axis, or whose principal axis
    would be turned farther from it, than in any wheel that flies."""
    out: list[str] = []
    for wheel in given.wheel:
        body = int(model.jnt_bodyid[model.joint(wheel.joint).id])
        mass, inertia = float(model.body_mass[body]), float(model.body_inertia[body].max())
        if wheel.static > FAR_OFF * mass:
            out.append(
                Caution(
                    "imbalance",
                    f"wheel {wheel.joint!r}: static = {wheel.static:g} kg m would be its "
                    f"{mass:.4g} kg {wheel.static / mass:.2g} m off the axis; 1 g cm is 1e-5 kg m.",
                )
            )
        if wheel.dynamic > ASKEW * inertia:
            out.append(
                Caution(
                    "imbalance",
                    f"wheel {wheel.joint!r}: dynamic = {wheel.dynamic:g} kg m^2 would turn its "
                    f"principal axis by {wheel.dynamic / inertia:.2g} rad from the axis; 1 g cm^2 "
                    "is 1e-7 kg m^2.",
                )
            )
    return out


def _beyond(whole: DisturbedCraft, given: Disturbances) -> list[str]:
    """A sentence on what disturbs above the highest mode that the appendages keep."""
    modes = zip(whole.craft.mode_names, whole.craft.modes.frequency, strict=True)
    kept = [float(w) for name, w in modes if not FILLER.search(name)]
    if not kept:
        return []
    highest = [
        max(abs(speed) for speed in wheel.speeds) * max(h.order for h in wheel.orders)
        for wheel in given.wheel
    ]
    highest += [2.0 * np.pi * noise.frequency[-1] for noise in given.psd]
    if max(highest, default=0.0) <= max(kept):
        return []
    return [
        f"disturbances reach {max(highest):.4g} rad/s, the modes kept end at {max(kept):.4g} "
        "rad/s; resonances of the structure above are not in the budget: keep more modes if they "
        "matter."
    ]


def _simulate(budget: Pointing, name: str, source: WheelDisturbance, output: int) -> WheelRun:
    """The run of a wheel at the speed of the largest error of an output."""
    whole = budget._whole
    number = [word for word, _ in budget._given.named].index(name)
    error = budget[name]
    assert error.speed is not None
    speed = float(error.speed[output])
    craft = whole.of_wheel(number, source.joint, speed)
    lines = wheel_lines(whole, number, source, speed)
    responses = [line.parts[:, output].sum(axis=0) for line in lines]
    # turned so that all add up
    amplitudes = [
        line.patterns @ np.exp(-1j * np.angle(response))
        for line, response in zip(lines, responses, strict=True)
    ]
    expected = [float(np.abs(response).sum()) for response in responses]
    times, values, found, timestep = run_wheel(
        craft,
        np.array([line.omega for line in lines]),
        np.array(amplitudes),
        output,
        _settling(craft, error.shares[output]),
    )
    return WheelRun(
        source=name,
        output=budget.outputs[output],
        speed=speed,
        stated=float(error.ape.peak[output]),
        simulated=float(sum(found)),
        orders=tuple(zip(expected, found, strict=True)),
        times=times,
        values=values,
        timestep=timestep,
    )


def _settling(craft: LinearCraft, shares: Mapping[str, float]) -> float:
    """Time constant [s] of the mode that has the largest share; where none has, the longest of all
    that rings and decays, 0 where nothing does."""
    form = craft.form().minimal()
    for mode in form.oscillators(list(shares)):
        decay = -float(form.poles_of(mode).real.max())
        if decay > 0.0:
            return 1.0 / decay
    poles = ModalResponse(form, ()).poles
    decays = -poles.real[(poles.imag > 0.0) & (-poles.real > UNDAMPED * np.abs(poles))]
    return 1.0 / float(decays.min()) if decays.size else 0.0
