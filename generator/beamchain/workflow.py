"""`fit`: the whole walk from a beam to a verified drop-in file, and its result."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from lxml.etree import _Element as Element

from beamchain.assess.error import Comparison, compare, in_band_error
from beamchain.assess.stability import StepLimits, numerical_pole, step_limits
from beamchain.chain.build import (
    Built,
    Status,
    build_exact,
    build_least_squares,
    build_recipe,
    with_real_polar,
)
from beamchain.chain.chain import Chain
from beamchain.chain.damping import Damper, joint_damping, tendons
from beamchain.chain.prewarp import Prewarp, loaded_tendons, prewarp
from beamchain.chain.rods import Payload
from beamchain.engine.bench import Measured, measure
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.files import write_files
from beamchain.mjcf import write
from beamchain.port import PORTS, Array, PortModel, in_space
from beamchain.spec import Damping, FitOptions, Hub, Modes, Root, Scene, Spec, port_hub_mass
from beamchain.structure.beam import Beam

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DECOUPLED = 1e-9  # relative: what two independent ports may share


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
        prewarps: per port, where `fit.timestep` asks for it; the error in band is then that of what the step shows.
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
    dampers: tuple[Damper, ...] = ()
    warnings: tuple[str, ...] = ()
    prewarps: Mapping[str, Prewarp] = field(default_factory=dict[str, Prewarp])

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

    def appendage(self) -> Element:
        """The drop-in MJCF as an lxml tree."""
        scene = self.spec.scene or Scene()
        return write.appendage(
            self.chain, self.spec.name, beam=self.spec.beam, dampers=self.dampers, visuals=scene.visuals
        )

    def to_mjcf(self) -> str:
        """The drop-in MJCF file as text."""
        return write.text(self.appendage())

    def scene_mjcf(self) -> str:
        """A free-flying hub with the appendage on it, as text. Without a hub in the spec: ten times the appendage."""
        scene = self.spec.scene or Scene()
        hub = self.spec.root.hub or default_hub(self.spec.beam)
        timestep = self.spec.fit.timestep or (scene.timestep if self.spec.scene else self._safe_step(scene.integrator))
        root = write.scene(
            self.appendage(), self.spec.name, mass=hub.mass, inertia=hub.inertia, offset=hub.offset,
            timestep=timestep, integrator=scene.integrator,
        )  # fmt: skip
        return write.text(root)

    def bench_mjcf(self) -> str:
        """The appendage on the test bench: its root free in every kept port, as text."""
        ports = [port for port in PORTS if port in self.achieved]
        return write.text(write.bench(self.appendage(), ports, 0.01, _ballast(self.chain)))

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


def default_hub(beam: Beam) -> Hub:
    """Ten times the appendage's mass, a cube as wide as a tenth of its length, root at a face."""
    mass, side = 10.0 * beam.rigid_mass()[0, 0], 0.1 * beam.length
    inertia = max(mass * side**2 / 6.0, 1e-12)
    return Hub(mass=mass, inertia=(inertia, inertia, inertia), offset=(side / 2.0, 0.0, 0.0))


def fit(
    appendage: Beam | Spec,
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
        appendage: a beam, or a whole spec (what is given beside it replaces what the spec says).
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
    return _fit(spec)


def _fit(spec: Spec) -> Fit:
    clock = [time.perf_counter()]
    beam, kept = spec.beam, spec.kept
    hub = None if spec.root.hub is None else spec.root.hub.mass_matrix()
    full = {port: beam.port(port, 2 * count + 4) for port, count in kept.items()}
    clock.append(time.perf_counter())
    built = _build(spec, beam, kept, full, hub)
    plans = {p: _prewarp(spec, p, full[p], t.modes, hub) for p, t in built.targets.items()} if spec.fit.timestep else {}
    chain, dampers = _damped(spec, built, plans)
    clock.append(time.perf_counter())
    scene = spec.scene or Scene()
    tree = write.appendage(chain, spec.name, beam=beam, dampers=dampers, visuals=scene.visuals)
    clock.append(time.perf_counter())
    free = tuple(kept) if tuple(kept) == ("xy",) else PORTS  # a planar boom is tested as the paper does
    measured = measure(tree, free, timestep=scene.timestep, ballast=_weight(chain))
    bandwidth, error = {}, {}
    for port, target in built.targets.items():
        bandwidth[port] = scene.bandwidth or float(target.frequencies[-1])
        port_hub = None if hub is None else port_hub_mass(hub, port)
        plain = compare(measured.ports[port], target)
        seen = plans[port].shown(measured.ports[port]) if port in plans else measured.ports[port]
        in_band = in_band_error(seen, with_ratios(spec, port, full[port]), port_hub, bandwidth[port])
        error[port] = replace(plain, accelerance_in_band=in_band)
    tendon = bool(dampers)
    limits = _limits(measured, built.targets, hub, tendon)
    clock.append(time.perf_counter())
    steps = ("model", "realise", "write", "verify")
    seconds = {step: b - a for step, a, b in zip(steps, clock[:-1], clock[1:], strict=True)}
    achieved = {port: measured.ports[port] for port in built.targets}
    return Fit(
        spec, chain, full, built.targets, achieved, error, measured, limits, built.status, seconds, bandwidth, dampers,
        (*_warnings(spec, measured, achieved, dampers, limits), *_prewarp_note(plans)), plans,
    )  # fmt: skip


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


def with_ratios(spec: Spec, port: str, model: PortModel) -> PortModel:
    """The model with the spec's damping ratios in its cantilever modes."""
    return model if spec.damping is None else model.replaced(damping=spec.damping.ratios(port, model.modes))


def _build(spec: Spec, beam: Beam, kept: dict[str, int], full: dict[str, PortModel], hub: Array | None) -> Built:
    target = spec.root.target or "clamped"

    def target_of(port: str, count: int) -> PortModel:
        model = full[port]
        if spec.fit.timestep:
            return _prewarp(spec, port, model, count, hub).target
        if target == "free":
            out = model.reduced(count, np.zeros((model.motions, model.motions)))
        elif target == "hub":
            assert hub is not None
            out = model.reduced(count, port_hub_mass(hub, port))
        else:
            out = model.truncated(count)
        return with_ratios(spec, port, out)

    options = spec.fit
    payload = spec.payload
    if options.timestep and (options.method != "exact" or payload is not None):
        raise InputError(
            f"fit.timestep = {options.timestep!r} pre-warps the exact chain only; leave it out, or use "
            'method = "exact" without a payload.'
        )
    if options.method == "exact" and payload is None:
        return build_exact(beam, kept, target_of, tip=spec.scene is not None and spec.scene.tip)
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


def _prewarp(spec: Spec, port: str, model: PortModel, count: int, hub: Array | None) -> Prewarp:
    """What the chain aims at in a port: the modes on the spec's hub unless another target is named."""
    load = None if hub is None else port_hub_mass(hub, port)
    if spec.root.target == "clamped":
        load = None
    elif spec.root.target == "free":
        load = np.zeros((model.motions, model.motions))
    integrator = (spec.scene or Scene()).integrator
    return prewarp(with_ratios(spec, port, model), count, load, integrator, spec.fit.timestep)


def _prewarp_note(plans: Mapping[str, Prewarp]) -> list[str]:
    """For which step and integrator a pre-warped chain is right."""
    if not plans:
        return []
    plan = next(iter(plans.values()))
    on = "a held root: give root.hub for the coupled modes" if plan.hub_mass is None else "the modes on the hub"
    return [
        f"pre-warped for {plan.integrator} at {plan.timestep:g} s, on {on}: at any other step or integrator the "
        "frequencies are off; the errors stated are those of what that step shows."
    ]


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


def _damped(spec: Spec, built: Built, plans: Mapping[str, Prewarp]) -> tuple[Chain, tuple[Damper, ...]]:
    """The wanted damping: tendons beside the chain, or dampers in its hinges."""
    chain, dampers = built.chain, []
    if spec.damping is None:
        return chain, ()
    for port, target in built.targets.items():
        if port in plans and plans[port].rates.size:
            if spec.damping.form == "hinge":
                raise InputError(
                    'damping.form = "hinge" cannot give each mode what "discrete" leaves of its damping; '
                    'use damping.form = "modal", or leave fit.timestep out.'
                )
            dampers += loaded_tendons(chain, port, plans[port])
            continue
        ratios = spec.damping.ratios(port, chain.port(port).modes)
        if spec.damping.form == "hinge":
            chain = joint_damping(chain, port, ratios)
        else:
            dampers += tendons(chain, port, ratios[: max(target.modes, 1)])
    return chain, tuple(dampers)


def _weight(chain: Chain) -> Array:
    """A root body as heavy as the chain: with it the bench is well conditioned, however light the first link is."""
    rigid = np.diag(chain.rigid_mass())
    return np.array([rigid[0], *np.full(3, max(rigid[3:]))])


def _ballast(chain: Chain) -> Array | None:
    """Something to hold where a hinge at the root leaves the bench massless: as much as the chain weighs."""
    return None if chain.links[0].mass > 0.0 else _weight(chain)


def _limits(measured: Measured, targets: Mapping[str, PortModel], hub: Array | None, tendon: bool) -> StepLimits:
    """Step limits on the hub in space, or of the free appendage without one."""
    model = in_space({port: measured.ports[port] for port in targets}, measured.rigid_mass)
    coupled = model if hub is None else model.with_hub(hub)
    a, *_ = coupled.state_space()
    poles = np.linalg.eigvals(a)
    poles = poles[poles.imag > 0.0]
    frequencies = np.abs(poles)
    ratios = np.where(np.abs(poles.real) < 1e-12 * frequencies, 0.0, -poles.real / frequencies)
    return step_limits(frequencies, np.clip(ratios, 0.0, None), tendon=tendon)
