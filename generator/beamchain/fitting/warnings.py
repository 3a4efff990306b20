"""What to know before a fit's files are used: dampers, steps, ports that are coupled,
probable slips of units."""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from beamchain.chain.chain import Chain
from beamchain.engine.bench import Measured
from beamchain.fitting.needs import AXES
from beamchain.fitting.options import Damping, Scene
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import LEAST_RATIO
from beamchain.ports.model import PortModel
from beamchain.steps.limits import StepChoice, StepLimits
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.imported import Units
from beamchain.structure.section import SOFT, Custom, Equivalent, soft_modulus
from beamchain.structure.segment import Segment
from beamchain.warning_codes import Caution

LIGHT = 5.0  # kg/m^3: a foam has more
# of the appendage's length: a section as wide, and wider than 1 m, is likelier one in mm
HUGE = 0.25
# m: a section with a dimension below was given in metres,
# unless another one is longer than the appendage
THIN = 0.05
LONG = 200.0  # m: no appendage yet, where a file in mm is read as metres
THREAD = 1e-3  # kg/m: thinner than any, where a file in tonnes is read as kilograms
DAMPED = 0.1  # ratio from which an aerospace structure is asked about: rubber has as much
STOCKY = 10.0  # length over depth, below which Euler's theory misses shear
REACH = 10.0  # times the band: modes beyond matter little
MOVED = 0.1  # of a motion's mass: what modes of a file carry of it where they are of that motion
DECOUPLED = 1e-9  # relative: what two independent ports may share


def rigid_plane(port: str) -> str:
    """The sentence for a bending plane that [modes] leaves out, without its end."""
    return (
        f"{port} is rigid, since [modes] names the other plane only; {port} = 2 keeps modes there, "
        f"{port} = 0 says that it shall be rigid"
    )


def fit_warnings(
    spec: Spec,
    measured: Measured,
    achieved: Mapping[str, PortModel],
    chain: Chain,
    limits: StepLimits,
) -> Iterator[str]:
    """What to know before the file is used."""
    for port in spec.unsaid:
        yield Caution("rigid-plane", rigid_plane(port))
    damped = any(tendon.is_mode and tendon.damping > 0.0 for tendon in chain.tendons)
    # a scene that says another is heard
    euler_runs = spec.scene is None or spec.scene.integrator == "Euler"
    if damped and euler_runs and not spec.exact_step:
        euler = limits.largest_step["Euler"]
        other = limits.largest_step["implicitfast"]
        text = (
            "the damping tendons are made for implicit, implicitfast and RK4: Euler, which MuJoCo "
            "takes where nothing is said, integrates tendon damping explicitly and is stable up "
            f"to {euler:.4g} s only (implicitfast {other:.4g} s)."
        )
        yield Caution("tendon-damping", text)
    if spec.damping is not None and spec.damping.form == "hinge":
        missed: list[str] = []
        for port, model in achieved.items():
            wanted = spec.damping.ratios(port, min(model.modes, spec.kept.get(port, model.modes)))
            missed += [
                f"{port} {k + 1}: {have:.4g} for {want:.4g}"
                for k, (want, have) in enumerate(zip(wanted, model.damping, strict=False))
                if abs(have - want) > 0.01 * want
            ]
        if missed:
            yield Caution(
                "hinge-damping",
                f"plain joint damping cannot give every mode its ratio ({'; '.join(missed)}).",
            )
    for pair, value in measured.couplings.items():
        if value > DECOUPLED:
            text = (
                f"MuJoCo sees the ports {pair} coupled, by {value:.1e} relative: they are not "
                "independent."
            )
            yield Caution("ports-coupled", text)


def turn_warning(
    error: float | None, scene: Scene, integrator: str, timestep: float, where: str = ""
) -> Iterator[str]:
    """Where a step turns the rigid spacecraft with more `error` of the rates per radian
    than the scene allows; `where`: words for its pose."""
    if error is not None and scene.rates is not None and error > scene.tolerance:
        rates = ", ".join(f"{rate:g}" for rate in scene.rates)
        yield Caution(
            "turn-error",
            f"{integrator} at {timestep:g} s turns the rigid spacecraft{where} from rates of "
            f"({rates}) rad/s with an error of {error:.2g} of them in one radian, above the "
            f"tolerance {scene.tolerance:g}, whatever the appendages do.",
        )


def step_warnings(
    scene: Scene, step: float, limits: StepLimits, steps: Sequence[StepChoice]
) -> Iterator[str]:
    """Where scene.xml's own step is unstable, or its vibration misses the tolerance;
    the best of `steps` first."""
    largest = limits.largest_step[scene.integrator]
    taken = f"{scene.integrator} at {step:g} s"
    kept = next((choice for choice in steps if choice.integrator == scene.integrator), None)
    if step > largest:
        yield Caution(
            "unstable-step",
            f"scene.xml takes {taken}, which is unstable above {largest:.4g} s.",
        )
    elif kept is not None and step > kept.step:
        best = steps[0]
        yield Caution(
            "inaccurate-step",
            f"scene.xml takes {taken}, whose own error is above the tolerance {scene.tolerance:g}: "
            f"it keeps that up to {kept.step:.3g} s, {best.integrator} up to {best.step:.3g} s "
            "with the chain made anew for it.",
        )


# -- numbers of a spec that can be meant, but are more often a slip of units or of theory ----------
def doubtful(
    segments: Sequence[Segment],
    damping: Damping | None = None,
    ports: Collection[str] = ("xy", "xz"),
) -> list[str]:
    """Warnings, one of a kind; only the kept `ports` count:
    what is rigid by choice needs no theory."""
    out: dict[str, str] = {}
    place, ratio = next(
        ((place, ratio) for place, ratio in _ratios(damping) if ratio >= DAMPED), ("", 0.0)
    )
    if ratio:
        out["high-damping"] = (
            f"damping.{place} = {ratio:g} is {ratio:.0%} of critical, where structures have 0.001 "
            f"to 0.02: a likely slip; if {ratio:g} % were meant, write {ratio * 1e-2:g}."
        )
    low = next((item for item in _ratios(damping) if item[1] < LEAST_RATIO), None)
    if low is not None:
        out["least-damping"] = (
            f"damping.{low[0]} = {low[1]:g} is below {LEAST_RATIO:g}, at which errors compare it: "
            "the frequency of a narrower peak is beyond a model in double precision."
        )
    length = sum(segment.length for segment in segments)
    for i, segment in enumerate(segments):
        where = f"segment[{i}]"
        material = segment.material
        if material is not None and (e := material.youngs_modulus) < SOFT:
            out["soft-material"] = f"{where}: {soft_modulus(e)}."
        if material is not None and (rho := material.density) < LIGHT:
            out["light-material"] = (
                f"{where}: density = {rho:g} kg/m^3 is lighter than foam; if g/cm^3 were meant, "
                f"write {rho * 1e3:g}."
            )
        sizes = (
            {} if isinstance(segment.section, Custom | Equivalent) else segment.section.dimensions()
        )
        most = max(sizes.values(), default=0.0)
        thin = min(sizes.values(), default=0.0) < THIN
        if most > max(length if thin else HUGE * length, 1.0):  # a panel is wide, but thin
            name, size = max(sizes.items(), key=lambda item: item[1])
            meant = ", ".join(f"{key} = {value * 1e-3:g}" for key, value in sizes.items())
            out["huge-section"] = (
                f"{where}: {name} = {size:g} m on an appendage {length:g} m long; if mm were "
                f"meant, write {meant}."
            )
            continue
        at = segment.at(np.array([0.0]))
        axial = float(at.axial[0])
        if segment.theory == "euler" and axial > 0.0:
            bending = {"xy": float(at.bending_xy[0]), "xz": float(at.bending_xz[0])}
            depth = np.sqrt(
                12.0
                * max((bending[port] for port in ports if port in bending), default=0.0)
                / axial
            )
            if length < STOCKY * depth:
                out["stocky-beam"] = (
                    f"{where}: the appendage is only {length / depth:.2g} times as long as it is "
                    "deep; Euler's theory "
                    'leaves shear out: set theory = "timoshenko".'
                )
    return [Caution(code, text) for code, text in out.items()]


def imported_warnings(
    data: ModalData,
    numbers: Sequence[int],
    damping: Damping | None = None,
    units: Units | None = None,
    scene: Scene | None = None,
) -> list[str]:
    """Warnings about a file of modes: what its reader noted, forgotten units, modes that end too
    soon for the scene, and a table of damping that leaves out kept modes (`numbers`, from 1)."""
    out: list[str] = []
    for step in data.steps:
        if not isinstance(step, Caution):
            continue
        if step.code != "ignored-damping":
            out.append(Caution(step.code, f"{data.source}: {step}."))
        elif damping is None and not np.any(data.damping > 0.0):
            said = f"{step}; [damping] is not given: the modes are undamped."
            out.append(Caution("ignored-damping", said))
    if units is not None and (units.length is None) != (units.mass is None):
        given = f"length = {units.length:g}" if units.mass is None else f"mass = {units.mass:g}"
        missing, unit = ("mass", "kg") if units.mass is None else ("length", "m")
        out.append(
            Caution(
                "half-units",
                f"imported.units gives {given} alone, so that {missing} is taken in {unit}; "
                "Nastran models in mm and tonne need units = { length = 1e-3, mass = 1e3 }. If "
                f"{missing} is in {unit}, write {missing} = 1.0 beside it.",
            )
        )
    mass = float(data.rigid_mass[0, 0])
    length = data.length or 0.0
    if length > LONG or mass < THREAD * length:
        out.append(
            Caution(
                "file-units",
                f"{data.source}: {mass:.4g} kg over {length:.4g} m; units of the file? Nastran "
                "models in mm and tonne need units = { length = 1e-3, mass = 1e3 } in [imported].",
            )
        )
    if scene is not None and scene.bandwidth is not None:
        out += _ends_too_soon(data, scene, scene.bandwidth)
    ratio = None if damping is None else damping.ratio
    if isinstance(ratio, dict) and any(any(values) for values in ratio.values()):
        bare = [k for k in numbers if data.belongs[k - 1] not in ratio]
        if bare:
            others = ", ".join(dict.fromkeys(data.belongs[k - 1] for k in bare))
            many = f"modes {', '.join(map(str, bare))}" if len(bare) > 1 else f"mode {bare[0]}"
            out.append(
                Caution(
                    "undamped-modes",
                    f"damping.ratio names {', '.join(ratio)} only and leaves {many} of the file "
                    f"({others}) undamped; name these ports as well, or list a value per mode of "
                    "the file: ratio = [0.005, 0.01].",
                )
            )
    return out


def _ends_too_soon(data: ModalData, scene: Scene, band: float) -> list[str]:
    """Where modes beyond the last of a file matter in the band."""
    reach = float(np.max(data.frequencies, initial=0.0)) / band
    if not 0.0 < reach < REACH:
        return []
    carried = data.effective_mass_fractions.sum(axis=0)
    missing = {
        axis: 1.0 - carried[number]
        for axis, number in AXES.items()
        if axis in scene.axes and carried[number] > MOVED
    }
    axis = max(missing, key=lambda name: missing[name], default=None)
    # m_left (w / w_beyond)^2 of the mass is not felt, and no mode left out is below the last one
    if axis is None or missing[axis] / reach**2 <= scene.tolerance:
        return []
    return [
        Caution(
            "last-mode",
            f"{data.source}: its modes end at {reach * band:.4g} rad/s, {reach:.2g} times the "
            f"scene's bandwidth, and leave {missing[axis]:.1%} of the effective mass in {axis} to "
            f"modes beyond. The stated error knows none of these: up to some "
            f"{missing[axis] / reach**2:.1e} of the motion. Ask for modes up to "
            f"{REACH * band:.4g} rad/s, or for residual vectors.",
        )
    ]


def _ratios(damping: Damping | None) -> list[tuple[str, float]]:
    """Every ratio stated, with its place."""
    if damping is None:
        return []
    if isinstance(damping.ratio, tuple):
        return [(f"ratio[{i}]", v) for i, v in enumerate(damping.ratio)]
    if not isinstance(damping.ratio, dict):
        return [("ratio", damping.ratio)]
    return [
        (f"ratio.{port}[{i}]", v)
        for port, values in damping.ratio.items()
        for i, v in enumerate(values)
    ]
