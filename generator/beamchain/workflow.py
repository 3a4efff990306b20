"""`fit`: the whole walk from a beam to a verified drop-in file, and its result."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from lxml.etree import _Element as Element

from beamchain.assess.error import Comparison, compare, in_band_error
from beamchain.assess.needs import AXES, Choice, LeftOut
from beamchain.assess.plan import Plan, ledger, make_plan, verdict, whole_beam
from beamchain.assess.stability import StepLimits, numerical_pole, step_limits
from beamchain.assess.steps import StepChoice, choose_step
from beamchain.chain.build import (
    Built,
    Status,
    build_exact,
    build_least_squares,
    build_recipe,
    with_real_polar,
)
from beamchain.chain.chain import Chain
from beamchain.chain.damping import Damper, joint_damping, modal_ratios, tendons
from beamchain.chain.oscillators import Oscillators
from beamchain.chain.rods import Payload
from beamchain.engine.bench import Measured, measure
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.files import write_files
from beamchain.mjcf import write
from beamchain.mjcf.oscillators import oscillators as write_oscillators
from beamchain.port import PORTS, Array, PortModel, in_space
from beamchain.spec import Damping, FitOptions, Hub, Modes, Root, Scene, Spec, port_hub_mass
from beamchain.structure.beam import Beam
from beamchain.structure.imported import Imported
from beamchain.structure.mass_line import MassLine
from beamchain.structure.modal_data import ModalData

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DECOUPLED = 1e-9  # relative: what two independent ports may share


@dataclass(frozen=True, eq=False)
class InSpace:
    """A fit seen with all six motions of the root at once, which shows what ports do to each other.

    Args:
        data: the imported modes, about the port, in SI; what was done to them stands in its `steps`.
        form: "chain" or "oscillators", and `why`.
        full: all imported modes.
        target: the modes that were asked for.
        achieved: read back through `mjd_transitionFD`.
        error: achieved against target; in band, against all modes.
        live: motions in which the appendage has inertia; the models hold these only.
        made: the oscillators, in that form.
    """

    data: ModalData
    form: str
    why: str
    full: PortModel
    target: PortModel
    achieved: PortModel
    error: Comparison
    live: tuple[int, ...]
    made: Oscillators | None = None


@dataclass(frozen=True, eq=False)
class Fit:
    """An appendage as a hinge chain, proved through MuJoCo.

    Args:
        spec: what was asked for.
        chain: what came out.
        full: per port, all modes of the beam's discretisation: the truth.
        target: per port, the reduced model the chain was made for.
        achieved: per port, read back through `mjd_transitionFD`.
        error: per port, achieved against target; in band, against the whole beam.
        measured: the bench.
        limits: step limits on the hub of the spec, or alone.
        status: ok, message, history.
        seconds: model, realise, write, verify.
        bandwidth: per port, of the in-band error [rad/s].
        dampers: the damping tendons.
        warnings: what to know before the file is used; shown by `beamchain fit` and in the report.
        line: how the mass lies along x, where that is not the spec's beam.
        space: all six motions at once, where the modes were imported. In the oscillator form `chain` is what stays when
            nothing moves, one rigid link, and `space.made` holds the oscillators.
    """

    spec: Spec
    chain: Chain
    full: dict[str, PortModel]
    target: dict[str, PortModel]
    achieved: dict[str, PortModel]
    error: dict[str, Comparison]
    measured: Measured
    limits: StepLimits
    status: Status
    seconds: dict[str, float]
    bandwidth: dict[str, float]
    kept_for: str = "clamped"
    dampers: tuple[Damper, ...] = ()
    choice: Choice | None = None
    promise: float | None = None
    left_out: tuple[LeftOut, ...] = ()
    warnings: tuple[str, ...] = ()
    line: MassLine | None = None
    space: InSpace | None = None

    @property
    def mass_line(self) -> MassLine:
        """How the appendage's mass lies along x: its beam, or what imported modes say of it."""
        return self.spec.beam if self.line is None else self.line

    @property
    def oscillators(self) -> Oscillators | None:
        """The oscillators, in that form."""
        return None if self.space is None else self.space.made

    @cached_property
    def hub_mass(self) -> Array | None:
        """`(6, 6)` mass matrix of the spec's hub about the root; None without one."""
        return None if self.spec.root.hub is None else self.spec.root.hub.mass_matrix()

    @property
    def tip_error(self) -> dict[str, Array]:
        """Per port `(n,)`: relative error of the tip displacement (or angle) in each kept mode."""
        out: dict[str, Array] = {}
        for port, target in self.target.items():
            ours = self.chain.port(port)
            if ours.tip is not None and target.tip is not None:
                k = min(ours.modes, target.modes)
                out[port] = ours.tip[:k, 0] / target.tip[:k, 0] - 1.0
        return out

    @cached_property
    def steps(self) -> tuple[StepChoice, ...]:
        """Integrators, each with its largest step within the tolerance, cheapest first; empty without a bandwidth."""
        scene = self.spec.scene
        if scene is None or scene.bandwidth is None or not self.achieved:
            return ()
        model = in_space(self.achieved, self.measured.rigid_mass)
        hub = self.hub_mass if self.hub_mass is not None else self.measured.rigid_mass
        keep = sorted(AXES[axis] for axis in scene.axes)
        return choose_step(model, hub, keep, scene.bandwidth, scene.tolerance, tendon=bool(self.dampers))

    def appendage(self) -> Element:
        """The drop-in MJCF as an lxml tree."""
        scene = self.spec.scene or Scene()
        if self.oscillators is not None:
            return write_oscillators(self.oscillators, self.spec.name, visuals=scene.visuals)
        return _tree(self.spec, self.chain, self.mass_line, self.dampers)

    def to_mjcf(self) -> str:
        """The drop-in MJCF file as text."""
        return write.text(self.appendage())

    def scene_mjcf(self) -> str:
        """A free-flying hub with the appendage on it, as text. Without a hub in the spec: ten times the appendage."""
        scene = self.spec.scene or Scene()
        hub = self.spec.root.hub or default_hub(self.mass_line)
        timestep = self.spec.fit.timestep or (scene.timestep if self.spec.scene else self._safe_step(scene.integrator))
        root = write.scene(
            self.appendage(), self.spec.name, mass=hub.mass, inertia=hub.inertia_matrix(), offset=hub.offset,
            timestep=timestep, integrator=scene.integrator, contacts=scene.contacts,
        )  # fmt: skip
        return write.text(root)

    def _safe_step(self, integrator: str) -> float:
        """A round step: a fifth of the stability limit at most."""
        bound = 0.2 * min(self.limits.largest_step[integrator], 5.0)
        exponent = np.floor(np.log10(bound))
        return float(max(m for m in (1.0, 2.0, 5.0) if m * 10**exponent <= bound * (1 + 1e-12)) * 10**exponent)

    def attach(self, spec: "mujoco.MjSpec", site: str) -> None:
        """Attach the appendage to a site of an `mujoco.MjSpec` (x of the site's frame outwards), names unprefixed.

        Raises:
            InputError: the spec has no such site.
        """
        place = spec.site(site)
        if place is None:
            known = ", ".join(s.name for s in spec.sites if s.name) or "none"
            raise InputError(f"site {site!r} is not in the model; its sites are: {known}.")
        # MuJoCo warns of an empty prefix: take the name off every element, and have MuJoCo put it back
        prefix = f"{self.spec.name}_"
        child = mujoco.MjSpec.from_string(self.to_mjcf().replace(f'"{prefix}', '"'))
        spec.attach(child, site=place, prefix=prefix)

    def plot(self, ax: "Axes | None" = None, port: str | None = None) -> "Axes":
        """Accelerance of the first kept port: beam, chain through MuJoCo. Returns the axes; shows nothing."""
        from beamchain.report.plots import plot_accelerance

        return plot_accelerance(self, ax=ax, port=port)

    def as_dict(self) -> dict[str, Any]:
        """What fit.json holds."""
        from beamchain.report.record import fit_record

        return fit_record(self)

    def write(self, folder: str | Path, *, force: bool = False) -> list[Path]:
        """Write appendage.xml, scene.xml, pictures, report.html and fit.json (last) into `folder`; all or none.

        Raises:
            OutputError: a file exists and `force` is False, or the folder cannot be written.
        """
        from beamchain.report.html import fit_report
        from beamchain.report.record import to_json

        folder = Path(folder)
        report, pictures = fit_report(self)
        files: dict[Path, str | bytes] = {
            folder / "appendage.xml": self.to_mjcf(),
            folder / "scene.xml": self.scene_mjcf(),
            **{folder / name: content for name, content in pictures.items()},
            folder / "report.html": report,
            folder / "fit.json": to_json(self.as_dict()),
        }
        write_files(files, force=force)
        return list(files)


def default_hub(beam: MassLine) -> Hub:
    """Ten times the appendage's mass, a cube as wide as a tenth of its length, root at a face."""
    mass, side = 10.0 * beam.rigid_mass()[0, 0], 0.1 * beam.length
    inertia = max(mass * side**2 / 6.0, 1e-12)
    return Hub(mass=mass, inertia=(inertia, inertia, inertia), offset=(side / 2.0, 0.0, 0.0))


def fit(
    appendage: Beam | Spec | ModalData,
    *,
    name: str | None = None,
    modes: Mapping[str, int] | Modes | None = None,
    root: Root | None = None,
    damping: Damping | None = None,
    options: FitOptions | None = None,
    scene: Scene | None = None,
) -> Fit:
    """Fit a hinge chain to an appendage and prove it through MuJoCo's own linearisation.

    Args:
        appendage: a beam, imported modes, or a whole spec (what is given beside it replaces what the spec says).
        name: prefix of bodies, joints and sites.
        modes: flexible modes per port, `{"xy": 2}` where nothing is said.
        root: target and hub.
        damping: ratios of the cantilever modes.
        options: method and its settings.
        scene: what the scene needs.

    Returns:
        The fit; `status.ok` is False where less came out than was asked for, with the reason.

    Raises:
        InputError: what is asked for contradicts itself or is not available.
        RealisationError: no chain exists even with one mode.
        EngineError: MuJoCo refuses the model (sizes beyond its limits).
    """
    if isinstance(appendage, Spec):
        spec = appendage
    elif isinstance(appendage, ModalData):
        spec = Spec(imported=Imported(file=f"{Path(appendage.source).stem or 'modes'}.toml"))
    else:
        spec = Spec(segment=appendage.segments, joint=appendage.joints, lump=appendage.lumps)
    if modes is not None and not isinstance(modes, Modes):
        unknown = set(modes) - set(Modes.__struct_fields__)
        if unknown:
            raise InputError(
                f"modes: unknown port {sorted(unknown)[0]!r}; choose from {', '.join(Modes.__struct_fields__)}."
            )
        modes = Modes(**dict(modes))
    given: dict[str, Any] = {
        "name": name,
        "modes": modes,
        "root": root,
        "damping": damping,
        "fit": options,
        "scene": scene,
    }
    changes = {key: value for key, value in given.items() if value is not None}
    if changes:
        spec = Spec(**{field: changes.get(field, getattr(spec, field)) for field in Spec.__struct_fields__})
    if spec.imported is not None:
        from beamchain.importing import fit_imported  # which returns a Fit

        return fit_imported(spec, appendage if isinstance(appendage, ModalData) else spec.imported.read())
    return _fit(spec)


def _fit(spec: Spec) -> Fit:
    clock = [time.perf_counter()]
    beam = spec.beam
    if spec.root.target == "hub" and spec.root.hub is None:
        raise InputError(
            'target = "hub" needs the hub; add hub = { mass = 500.0, inertia = [400.0, 400.0, 500.0] }, or use '
            'target = "clamped" (`beamchain embed` reads the hub from the spacecraft).'
        )
    hub = None if spec.root.hub is None else spec.root.hub.mass_matrix()
    full = whole_beam(spec, beam)
    clock.append(time.perf_counter())
    plan = make_plan(spec, full, beam.rigid_mass(), hub)
    kept = plan.kept
    built = _build(spec, plan, beam)
    chain, dampers = _damped(spec, plan, built)
    clock.append(time.perf_counter())
    scene = spec.scene or Scene()
    tree = _tree(spec, chain, beam, dampers)
    clock.append(time.perf_counter())
    free = tuple(kept) if tuple(kept) == ("xy",) else PORTS  # a planar boom is tested as the paper does
    measured = measure(tree, free, timestep=scene.timestep, ballast=_ballast(chain))
    bandwidth, error = {}, {}
    for port, target in built.targets.items():
        bandwidth[port] = scene.bandwidth or float(target.frequencies[-1])
        port_hub = None if hub is None else port_hub_mass(hub, port)
        plain = compare(measured.ports[port], target)
        in_band = in_band_error(measured.ports[port], spec.with_ratios(port, full[port]), port_hub, bandwidth[port])
        error[port] = replace(plain, accelerance_in_band=in_band)
    tendon = bool(dampers)
    limits = _limits(measured, built.targets, hub, tendon)
    clock.append(time.perf_counter())
    steps = ("model", "realise", "write", "verify")
    seconds = {step: b - a for step, a, b in zip(steps, clock[:-1], clock[1:], strict=True)}
    achieved = {port: measured.ports[port] for port in built.targets}
    promise = plan.promise.error(achieved, dict.fromkeys(achieved, "achieved")) if plan.promise else None
    return Fit(
        spec=spec,
        chain=chain,
        full=full,
        target=built.targets,
        achieved=achieved,
        error=error,
        measured=measured,
        limits=limits,
        status=verdict(spec, built.status, promise),
        seconds=seconds,
        bandwidth=bandwidth,
        kept_for=plan.target,
        dampers=dampers,
        choice=plan.choice,
        promise=promise,
        left_out=ledger(spec, plan, bool(dampers)),
        warnings=_warnings(spec, measured, achieved, dampers, limits),
    )


def _tree(spec: Spec, chain: Chain, line: MassLine, dampers: tuple[Damper, ...]) -> Element:
    """The drop-in file with the elements that the scene uses."""
    scene = spec.scene or Scene(tip=True)
    return write.appendage(
        chain,
        spec.name,
        beam=line,
        dampers=dampers,
        visuals=scene.visuals,
        tip=scene.tip or spec.payload is not None,
        contacts=scene.contacts,
    )


def _warnings(
    spec: Spec, measured: Measured, achieved: Mapping[str, PortModel], dampers: tuple[Damper, ...], limits: StepLimits
) -> tuple[str, ...]:
    """What to know before the file is used."""
    out: list[str] = []
    if dampers:
        euler, other = limits.largest_step["Euler"], limits.largest_step["implicitfast"]
        text = (
            "the damping tendons are made for implicit, implicitfast and RK4: Euler, which MuJoCo takes where nothing "
            f"is said, integrates tendon damping explicitly and is stable up to {euler:.4g} s only "
            f"(implicitfast {other:.4g} s)"
        )
        scene = spec.scene or Scene()
        if scene.integrator == "Euler":
            worst = max(dampers, key=lambda d: d.damping)
            model = achieved[worst.port]
            k = min(worst.mode, model.modes) - 1
            w, zeta = float(model.frequencies[k]), float(model.damping[k])
            pole = numerical_pole("Euler", w, zeta, scene.timestep, tendon=True)
            seen = -pole.real / abs(pole)
            text += (
                f"; at the scene's step of {scene.timestep:g} s mode {worst.mode} in {worst.port} will show a damping "
                f"ratio of {seen:.4g} instead of {zeta:.4g}"
            )
        out.append(f'{text}. Use implicitfast, or damping.form = "hinge".')
    if spec.damping is not None and spec.damping.form == "hinge":
        missed: list[str] = []
        for port, model in achieved.items():
            wanted = spec.damping.ratios(port, min(model.modes, spec.kept[port]))
            missed += [
                f"{port} {k + 1}: {have:.4g} for {want:.4g}"
                for k, (want, have) in enumerate(zip(wanted, model.damping, strict=False))
                if abs(have - want) > 0.01 * want
            ]
        if missed:
            out.append(
                f"plain joint damping cannot give every mode its ratio ({'; '.join(missed)}); "
                'damping.form = "modal" is exact.'
            )
    for pair, value in measured.couplings.items():
        if value > DECOUPLED:
            out.append(f"MuJoCo sees the ports {pair} coupled, by {value:.1e} relative: they are not independent.")
    return tuple(out)


def _build(spec: Spec, plan: Plan, beam: Beam) -> Built:
    kept = plan.kept

    def target_of(port: str, count: int) -> PortModel:
        return spec.with_ratios(port, plan.reduce(plan.target, port, count))

    options = spec.fit
    payload = spec.payload
    if not kept or (options.method == "exact" and payload is None):
        return build_exact(beam, kept, target_of, tip=(spec.scene or Scene()).tip)
    if options.method in ("exact", "least_squares"):
        loads = None
        if payload is not None:
            ix, iy, iz = payload.inertia
            del ix
            loads = {"xy": Payload(payload.mass, iz), "xz": Payload(payload.mass, iy)}
        free = options.free if options.links is None or options.method == "least_squares" else ("stiffness",)
        return build_least_squares(beam, kept, _links(spec, beam, kept), free, loads, target_of)
    links = options.links if isinstance(options.links, int) else None
    built = build_recipe(beam, options.method, kept, links, target_of)
    return replace(built, chain=with_real_polar(built.chain))


def _links(spec: Spec, beam: Beam, kept: dict[str, int]) -> Array:
    """Link lengths for least squares: the user's, or as many equal ones as the modes need."""
    links = spec.fit.links
    if isinstance(links, tuple):
        total = sum(links)
        if abs(total / beam.length - 1.0) > 1e-6:
            raise InputError(
                f"fit.links = {list(links)!r} add up to {total!r} m, but the appendage is {beam.length!r} m long; "
                "make them add up to its length."
            )
        return np.array(links) * (beam.length / total)
    most = max(kept.values())
    count = links if links is not None else most + 1 if spec.payload is None else max(most + 2, 2 * most)
    return np.full(count, beam.length / count)


def _damped(spec: Spec, plan: Plan, built: Built) -> tuple[Chain, tuple[Damper, ...]]:
    """The wanted damping: tendons beside the chain, or dampers in its hinges where asked for or good enough."""
    chain, dampers = built.chain, []
    if spec.damping is None:
        return chain, ()
    hinged = chain
    for port in built.targets:
        hinged = joint_damping(hinged, port, spec.damping.ratios(port, chain.port(port).modes))
    if spec.damping.form == "hinge":
        return hinged, ()
    if plan.choice is not None and plan.promise is not None and spec.scene is not None:
        models = {port: hinged.port(port).replaced(damping=modal_ratios(hinged, port)) for port in built.targets}
        if plan.promise.error(models, dict.fromkeys(models, "hinge damping")) <= spec.scene.tolerance:
            return hinged, ()
    for port, target in built.targets.items():
        dampers += tendons(chain, port, spec.damping.ratios(port, target.modes))
    return chain, tuple(dampers)


def _ballast(chain: Chain) -> Array | None:
    """Something to hold where a hinge at the root leaves the bench massless: as much as the chain weighs."""
    first = chain.links[0]
    if first.mass > 0.0 and min(first.inertia[1:]) > 0.0:
        return None
    rigid = np.diag(chain.rigid_mass())
    return np.array([rigid[0], *np.full(3, max(rigid[3:]))])


def _limits(measured: Measured, targets: Mapping[str, PortModel], hub: Array | None, tendon: bool) -> StepLimits:
    """Step limits on the hub in space, or of the free appendage without one."""
    return coupled_limits(in_space({port: measured.ports[port] for port in targets}, measured.rigid_mass), hub, tendon)


def coupled_limits(model: PortModel, hub: Array | None, tendon: bool) -> StepLimits:
    """Step limits of a port model on a hub `(m, m)`, or alone."""
    coupled = model if hub is None else model.with_hub(hub)
    a, *_ = coupled.state_space()
    poles = np.linalg.eigvals(a)
    poles = poles[poles.imag > 0.0]
    frequencies = np.abs(poles)
    ratios = np.where(np.abs(poles.real) < 1e-12 * frequencies, 0.0, -poles.real / frequencies)
    return step_limits(frequencies, np.clip(ratios, 0.0, None), tendon=tendon)
