"""`fit`: the whole walk from a beam to a verified drop-in file, and its result."""

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from beamchain.assess.doubtful import doubtful
from beamchain.assess.error import compare, in_band_error
from beamchain.assess.limits import coupled_limits
from beamchain.assess.plan import Plan, ledger, make_plan, verdict, whole_beam
from beamchain.cautions import fit_warnings, prewarp_note
from beamchain.chain.build import (
    Built,
    build_exact,
    build_least_squares,
    build_recipe,
    with_real_polar,
)
from beamchain.chain.chain import Chain
from beamchain.chain.damping import Damper, joint_damping, modal_ratios, tendons
from beamchain.chain.polar import raised
from beamchain.chain.prewarp import Prewarp, loaded_tendons, prewarp
from beamchain.chain.rods import Payload
from beamchain.engine.bench import measure, root_body
from beamchain.errors import InputError, RealisationError
from beamchain.mjcf.write import SMALLEST, check_hub
from beamchain.motion import PORTS, Array
from beamchain.port import PortModel, in_space
from beamchain.result import Fit, appendage_tree, seconds_taken
from beamchain.spec import Damping, FitOptions, Modes, Root, Scene, Spec, port_hub_mass
from beamchain.structure.beam import Beam
from beamchain.structure.imported import Imported
from beamchain.structure.modal_data import ModalData

LIGHTEST = 1e-9  # residual over rigid mass: free frequencies are good to about 1e-16 over it (measured)
LEAST_INERTIA = 1.01 * SMALLEST  # a body's inertia is rounded once more on its way
CANDIDATES = 4  # converged modes per port that a scene may choose from, where they become oscillators


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
    spec = as_spec(appendage)
    for word, value, kind, example in (
        ("root", root, Root, 'Root(target="hub", hub=Hub(...))'),
        ("damping", damping, Damping, "Damping(ratio=0.005)"),
        ("options", options, FitOptions, 'FitOptions(method="classical", links=20)'),
        ("scene", scene, Scene, "Scene(bandwidth=5.0)"),
    ):
        if value is not None and not isinstance(value, kind):
            raise InputError(f"{word} = {value!r} is a {type(value).__name__}; give a {kind.__name__}: {example}.")
    if modes is not None and not isinstance(modes, Modes | Mapping):
        raise InputError(f'modes = {modes!r} is a {type(modes).__name__}; give modes per port: modes={{"xy": 2}}.')
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
    try:
        return _beam_as_oscillators(spec) if spec.fit.form == "oscillators" else _fit(spec)
    except RealisationError as error:
        asked = " ".join(doubtful(spec.segment))
        raise RealisationError(f"{asked} As it is: {error}") from None if asked else error


def as_spec(appendage: Beam | Spec | ModalData) -> Spec:
    """What `fit` and `embed` are given, as a spec.

    Args:
        appendage: a beam, imported modes, or a whole spec.

    Raises:
        InputError: it is something else.
    """
    if isinstance(appendage, Spec):
        return appendage
    if isinstance(appendage, Beam):
        return Spec(segment=appendage.segments, joint=appendage.joints, lump=appendage.lumps)
    if isinstance(appendage, ModalData):
        return Spec(imported=Imported(file=f"{Path(appendage.source).stem or 'modes'}.toml"))
    raise InputError(
        f"the appendage is a {type(appendage).__name__}; give a Beam, a Spec (read_spec reads a SPEC.toml) or a ModalData."
    )


def _beam_as_oscillators(spec: Spec) -> Fit:
    """A beam's modes as oscillators: its modal data, as if another program had computed them."""
    from beamchain.importing import fit_imported

    if spec.payload is not None or spec.fit.method != "exact":
        raise InputError(
            'form = "oscillators" takes neither a payload nor another method than "exact"; use form = "chain" there.'
        )
    if spec.chooses:  # among more modes than a scene needs
        ports = dict.fromkeys(whole_beam(spec, spec.beam), CANDIDATES)
        return fit_imported(spec, ModalData.from_beam(spec.beam, ports, every=True))
    kept = spec.kept
    data = ModalData.from_beam(spec.beam, kept, every=True)
    return fit_imported(msgspec.structs.replace(spec, modes=Modes(**kept)), data)


def _fit(spec: Spec) -> Fit:
    clock = [time.perf_counter()]
    beam = spec.beam
    if spec.root.target == "hub" and spec.root.hub is None:
        raise InputError(
            'target = "hub" needs the hub; add hub = { mass = 500.0, inertia = [400.0, 400.0, 500.0] }, or use '
            'target = "clamped" (`beamchain embed` reads the hub from the spacecraft).'
        )
    hub = None
    if spec.root.hub is not None:
        check_hub(spec.root.hub.mass, spec.root.hub.inertia_matrix())
        hub = spec.root.hub.mass_matrix()
    full = whole_beam(spec, beam)
    clock.append(time.perf_counter())
    plan = make_plan(spec, full, beam.rigid_mass(), hub)
    kept = plan.kept
    built = build(spec, plan, beam, full, hub)
    warped = (
        {p: _prewarp(spec, p, full[p], t.modes, hub) for p, t in built.targets.items()} if spec.fit.timestep else {}
    )
    chain, dampers = damped_chain(spec, plan, built, warped)
    chain, note = raised(chain, LEAST_INERTIA)
    clock.append(time.perf_counter())
    scene = spec.scene or Scene()
    tree = appendage_tree(spec, chain, beam, dampers)
    clock.append(time.perf_counter())
    free = tuple(kept) if tuple(kept) == ("xy",) else PORTS  # a planar boom is tested as the paper does
    measured = measure(tree, free, timestep=scene.timestep, ballast=root_body(chain))
    bandwidth, error = {}, {}
    for port, target in built.targets.items():
        bandwidth[port] = scene.bandwidth or float(target.frequencies[-1])
        port_hub = None if hub is None else port_hub_mass(hub, port)
        plain = compare(measured.ports[port], target)
        seen = warped[port].shown(measured.ports[port]) if port in warped else measured.ports[port]
        in_band = in_band_error(seen, spec.with_ratios(port, full[port]), port_hub, bandwidth[port])
        error[port] = replace(plain, accelerance_in_band=in_band)
    achieved = {port: measured.ports[port] for port in built.targets}
    limits = coupled_limits(in_space(achieved, measured.rigid_mass), hub, tendon=bool(dampers))
    clock.append(time.perf_counter())
    seen = {port: warped[port].shown(model) if port in warped else model for port, model in achieved.items()}
    promise = plan.promise.error(seen, dict.fromkeys(seen, "achieved")) if plan.promise else None
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
        seconds=seconds_taken(clock),
        bandwidth=bandwidth,
        kept_for=plan.target,
        dampers=dampers,
        choice=plan.choice,
        promise=promise,
        left_out=ledger(spec, plan.choice, bool(dampers)),
        cautions=(
            *fit_warnings(spec, measured, achieved, dampers, limits),
            *prewarp_note(warped),
            *doubtful(spec.segment, spec.damping, built.targets),
            *([note] if note else []),
        ),
        prewarps=warped,
    )


def build(spec: Spec, plan: Plan, beam: Beam, full: Mapping[str, PortModel], hub: Array | None) -> Built:
    """The chain of a plan, with what was tried and what came of it."""
    kept = plan.kept

    def target_of(port: str, count: int) -> PortModel:
        if spec.fit.timestep:
            return _prewarp(spec, port, full[port], count, hub).target
        target = plan.reduce(plan.target, port, count)
        if plan.target == "free" and target.modes:
            _check_free(target)
        return spec.with_ratios(port, target)

    options = spec.fit
    payload = spec.payload
    if options.timestep and (options.method != "exact" or payload is not None):
        raise InputError(
            f"fit.timestep = {options.timestep!r} pre-warps the exact chain only; leave it out, or use "
            'method = "exact" without a payload.'
        )
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


def _check_free(target: PortModel) -> None:
    """The free modes stand in double precision: what moves at the root is a difference of nearly equal masses."""
    scale = np.sqrt(np.diag(target.rigid_mass))
    left = float(np.linalg.eigvalsh(target.residual_mass / np.outer(scale, scale))[0])
    if left < LIGHTEST:
        raise RealisationError(
            f"with {target.modes} free modes the root is too light beside the rest: its residual mass is {left:.1e} of the "
            f"rigid mass, where {LIGHTEST:g} is needed for frequencies good to 1e-6. Keep fewer modes, or choose target "
            '"clamped" or "hub".'
        )


def _prewarp(spec: Spec, port: str, model: PortModel, count: int, hub: Array | None) -> Prewarp:
    """What the chain aims at in a port: the modes on the spec's hub unless another target is named."""
    load = None if hub is None else port_hub_mass(hub, port)
    if spec.root.target == "clamped":
        load = None
    elif spec.root.target == "free":
        load = np.zeros((model.motions, model.motions))
    integrator = (spec.scene or Scene()).integrator
    return prewarp(spec.with_ratios(port, model), count, load, integrator, spec.fit.timestep)


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


def damped_chain(
    spec: Spec, plan: Plan, built: Built, warped: Mapping[str, Prewarp]
) -> tuple[Chain, tuple[Damper, ...]]:
    """The wanted damping: tendons beside the chain, or dampers in its hinges where asked for or good enough."""
    chain, dampers = built.chain, []
    if spec.damping is None:
        return chain, ()
    if spec.damping.form == "hinge" and any(plan.rates.size for plan in warped.values()):
        raise InputError(
            'damping.form = "hinge" cannot give each mode what "discrete" leaves of its damping; '
            'use damping.form = "modal", or leave fit.timestep out.'
        )
    hinged = chain
    for port in built.targets:
        hinged = joint_damping(hinged, port, spec.damping.ratios(port, chain.port(port).modes))
    if spec.damping.form == "hinge":
        return hinged, ()
    if plan.choice is not None and plan.promise is not None and spec.scene is not None and not warped:
        models = {port: hinged.port(port).replaced(damping=modal_ratios(hinged, port)) for port in built.targets}
        if plan.promise.error(models, dict.fromkeys(models, "hinge damping")) <= spec.scene.tolerance:
            return hinged, ()
    for port, target in built.targets.items():
        if port in warped and warped[port].rates.size:
            dampers += loaded_tendons(chain, port, warped[port])
        else:
            dampers += tendons(chain, port, spec.damping.ratios(port, target.modes))
    return chain, tuple(dampers)
