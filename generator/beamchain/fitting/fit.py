"""`fit`: from a specification to a verified drop-in file."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from beamchain.caution import Caution
from beamchain.chain.build import Built, Wishes, build_exact
from beamchain.chain.cut import Cut
from beamchain.chain.links import raise_polar_inertia
from beamchain.chain.tendons import joint_damping
from beamchain.engine.bench import measure, root_body
from beamchain.engine.library import one_thread
from beamchain.errors import InputError, RealisationError
from beamchain.fitting.choose import Plan, further_columns, make_plan, whole_beam
from beamchain.fitting.document import appendage_tree
from beamchain.fitting.hub import Hub, port_hub_mass
from beamchain.fitting.needs import damped_in_space
from beamchain.fitting.options import Damping, FitOptions, Modes, Root, Scene, Target
from beamchain.fitting.proof import assess_fit, step_limits
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec, read_spec
from beamchain.fitting.uncertain import uncertain_from
from beamchain.fitting.warnings import doubtful, fit_warnings
from beamchain.late import importing
from beamchain.mjcf.write import SMALLEST, check_hub
from beamchain.ports.compare import tolerance_statement
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.sampled import off_by
from beamchain.steps.turn import central_inertia, turn_error
from beamchain.structure.beam import Beam
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.imported import Imported

# residual over rigid mass: free frequencies are good to about 1e-16 over it (measured)
LIGHTEST = 1e-9
# cached by a fit, the same whatever its status
READ_BACK = ("_scenes", "time", "time_error", "sampled_error")
LEAST_INERTIA = 1.01 * SMALLEST  # a body's inertia is rounded once more on its way


def fit(
    appendage: Spec | Beam | ModalData | str | Path,
    *,
    name: str | None = None,
    modes: int | Mapping[str, int] | Modes | None = None,
    hub: Hub | None = None,
    target: Target | None = None,
    damping: float | Mapping[str, Sequence[float]] | Damping | None = None,
    scene: Scene | None = None,
    timestep: float | None = None,
    root: Root | None = None,
    options: FitOptions | None = None,
) -> Fit:
    """Fit a hinge chain to an appendage and verify it through MuJoCo's own linearisation.

    Args:
        appendage: a specification or its path, a beam, or imported modes.
            The other arguments override its values.
        name: prefix of bodies, joints and sites.
        modes: number of flexible modes, for both bending planes or by port; default:
            two in both bending planes.
        hub: the rigid spacecraft that carries the appendage.
        target: boundary condition of the root at which the modes are exact: "clamped", "free",
            "hub", or "auto" with a scene.
        damping: damping ratio of the cantilever modes, or lists of ratios by port.
        scene: requirements of the simulation; if they include a bandwidth,
            the modes are chosen for it.
        timestep: step for which the files are made exact in time [s].
        root: hub and target in one.
        options: where the springs stand, hinges at prescribed places.

    Returns:
        The fit; if a requirement is not met, `status.ok` is False and `status.message`
        states the reason.

    Raises:
        InputError: the requirements contradict each other or are not supported.
        RealisationError: no chain exists even with one mode.
        EngineError: MuJoCo rejects the model (sizes beyond its limits).

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> boom = bc.Beam(segments=(bc.Segment(length=8.0, section=section),))
        >>> found = bc.fit(boom, modes={"xy": 2}, damping=0.005)
        >>> [round(row.frequency_rad_s, 3) for row in found.modes]
        [1.228, 7.699]
    """
    spec = as_spec(appendage).replace(
        name=name,
        modes=modes,
        root=root,
        hub=hub,
        target=target,
        damping=damping,
        fit=options,
        scene=scene,
        timestep=timestep,
    )
    return at_its_step(fit_spec(spec, appendage if isinstance(appendage, ModalData) else None))


def at_its_step(made: Fit) -> Fit:
    """The fit, its status decided at the stated step,
    where there is one and a scene states a tolerance."""
    scene = made.spec.scene
    error = made.sampled_error
    if scene is None or made.met is None or error is None:
        return made
    text = (
        f"{made.status.message} Stepped by {made.spec.integrator} at {made.spec.exact_step:g} s: "
        f"off {off_by(error)}, {tolerance_statement(error, scene.tolerance)}."
    )
    decided = replace(
        made, status=replace(made.status, ok=made.status.ok and made.met, message=text)
    )
    vars(decided).update({name: vars(made)[name] for name in READ_BACK if name in vars(made)})
    return decided


def fit_spec(spec: Spec, data: ModalData | None = None) -> Fit:
    """What `fit` does with a whole specification; `data`: its imported modes,
    else read from its file."""
    with one_thread():
        if spec.imported is not None:
            with importing:
                from beamchain.fitting.imported import fit_imported  # which returns a Fit

            data = spec.imported.read() if data is None else data
            if spec.uncertain is None and data.uncertain:
                own = uncertain_from(data.uncertain, data.source)
                spec = msgspec.structs.replace(spec, uncertain=own)
            return fit_imported(_with_integrator(on_modes(spec), data.rigid_mass), data)
        spec = _with_integrator(on_modes(spec), spec.beam.rigid_mass())
        try:
            return _fit(spec)
        except RealisationError as error:
            asked = " ".join(doubtful(spec.segment))
            if not asked:
                raise
            raise RealisationError(f"{asked} As it is: {error}") from None


def on_modes(spec: Spec, *, wanted: bool = False) -> Spec:
    """The spec with springs on modal tendons where its modes are uncertain,
    or where that is wanted anyway."""
    if spec.fit.springs == "auto" and (
        wanted or (spec.uncertain is not None and spec.uncertain.modal)
    ):
        return msgspec.structs.replace(spec, fit=msgspec.structs.replace(spec.fit, springs="modes"))
    return spec


def _with_integrator(spec: Spec, rigid: Array) -> Spec:
    """The spec with the integrator that "auto" means,
    for `rigid` `(6, 6)` of the appendage about its root.

    Euler, exact in time, if its error in the rotation of the rigid spacecraft at the scene's rates
    is within the tolerance; otherwise RK4.
    """
    scene = spec.scene
    if scene is None or scene.integrator != "auto":
        return spec
    assert scene.rates is not None
    if spec.root.hub is None:
        raise InputError(
            'integrator = "auto" chooses by how the whole spacecraft turns; add root.hub with its '
            "mass and inertia, or name "
            "an integrator."
        )
    error = turn_error(
        central_inertia(spec.root.hub.mass_matrix() + rigid), scene.rates, scene.step
    )
    chosen = "Euler" if error <= scene.tolerance else "RK4"
    return msgspec.structs.replace(spec, scene=msgspec.structs.replace(scene, integrator=chosen))


def as_spec(appendage: Beam | Spec | ModalData | str | Path) -> Spec:
    """The appendage given to `fit` or `embed`, as a specification."""
    if isinstance(appendage, str | Path):
        return read_spec(appendage)
    if isinstance(appendage, Spec):
        return appendage
    if isinstance(appendage, Beam):
        return Spec(segment=appendage.segments, joint=appendage.joints, lump=appendage.lumps)
    if isinstance(appendage, ModalData):
        return Spec(imported=Imported(file=f"{Path(appendage.source).stem or 'modes'}.toml"))
    raise InputError(
        f"the appendage is a {type(appendage).__name__}; give a Beam, a Spec, the path of a "
        "SPEC.toml, or a ModalData."
    )


def _fit(spec: Spec) -> Fit:
    clock = [time.perf_counter()]
    beam = spec.beam
    if spec.root.target == "hub" and spec.root.hub is None:
        raise InputError(
            'target = "hub" needs the hub; add hub = { mass = 500.0, inertia = [400.0, 400.0, '
            '500.0] }, or use target = "clamped" (`beamchain embed` reads the hub from the '
            "spacecraft)."
        )
    hub = None
    if spec.root.hub is not None:
        check_hub(spec.root.hub.mass, spec.root.hub.inertia_matrix())
        hub = spec.root.hub.mass_matrix()
    full = whole_beam(spec, beam)
    clock.append(time.perf_counter())
    plan = make_plan(spec, full, beam.rigid_mass(), hub)
    kept = plan.kept
    built = damp_chain(spec, plan, beam)
    chain, note = raise_polar_inertia(built.chain, LEAST_INERTIA)
    clock.append(time.perf_counter())
    scene = spec.scene or Scene()
    tree = appendage_tree(spec, chain, beam)
    clock.append(time.perf_counter())
    # a planar boom is tested as the paper does
    free = ("xy",) if tuple(kept) == ("xy",) else PORTS
    blocks = [(port,) for port in free]
    measured = measure(tree, blocks, timestep=scene.step, ballast=root_body(chain))
    achieved = {port: measured.ports[port] for port in built.targets}
    limits = step_limits(chain, model_in_space(achieved, measured.rigid_mass), hub)
    promise = None
    if plan.promise is not None:
        promise = plan.promise.error(
            damped_in_space(achieved, plan.promise.exact.rigid_mass)
            if measured.coupled is None
            else measured.coupled
        )
    return assess_fit(
        spec,
        replace(built, chain=chain),
        measured,
        limits,
        clock,
        full=full,
        truth={port: spec.with_ratios(port, full[port]) for port in built.targets},
        achieved=achieved,
        kept=kept,
        kept_for=plan.target,
        choice=plan.choice,
        promise=promise,
        cautions=(
            *fit_warnings(spec, measured, achieved, chain, limits),
            *doubtful(spec.segment, spec.damping, built.targets),
            *([Caution("raised-inertia", note)] if note else []),
        ),
    )


def build(
    spec: Spec, plan: Plan, beam: Beam, cut: Cut | None = None, *, per_mode: bool = False
) -> Built:
    """The chain of a plan; `cut`: where the hinges stand, else chosen; `per_mode`:
    a damping tendon per mode."""
    kept = plan.kept

    def target_of(port: str, count: int) -> PortModel:
        target = plan.reduce(plan.target, port, count)
        if plan.target == "free" and target.modes:
            _check_free(target)
        return spec.with_ratios(port, target)

    wishes = Wishes(
        springs=spec.fit.springs,
        per_mode=per_mode,
        lines=spec.fit.cuts,
        further=tuple(spec.further.values()),
        columns=further_columns(spec),
        cut=cut,
        neutral=_last_on_hub(spec, plan),
    )
    return build_exact(beam, kept, target_of, wishes)


def _last_on_hub(spec: Spec, plan: Plan) -> dict[str, float]:
    """Per port the last kept frequency on the hub on which a free or hub target is exact;
    empty for a clamped one [rad/s]."""
    if plan.target == "clamped":
        return {}
    hub = (
        spec.root.hub.mass_matrix()
        if plan.target == "hub" and spec.root.hub is not None
        else np.zeros((6, 6))
    )
    return {
        port: plan.reduce("clamped", port, count).last_on_hub(port_hub_mass(hub, port))
        for port, count in plan.kept.items()
    }


def _check_free(target: PortModel) -> None:
    """The free modes stand in double precision:
    what moves at the root is a difference of nearly equal masses."""
    scale = np.sqrt(np.diag(target.rigid_mass))
    left = float(np.linalg.eigvalsh(target.residual_mass / np.outer(scale, scale))[0])
    if left < LIGHTEST:
        raise RealisationError(
            f"with {target.modes} free modes the root is too light beside the rest: its residual "
            f"mass is {left:.1e} of the "
            f"rigid mass, where {LIGHTEST:g} is needed for frequencies good to 1e-6. Keep fewer "
            "modes, or choose target "
            '"clamped" or "hub".'
        )


def damp_chain(spec: Spec, plan: Plan, beam: Beam, cut: Cut | None = None) -> Built:
    """The chain of a plan, damped as wanted: by a tendon per mode,
    or in its hinges where that is asked for."""
    if spec.fit.springs == "auto":
        spec = on_modes(
            spec, wanted=spec.sensors.modes or (bool(spec.exact_step) and needs_time(spec, plan))
        )
    given = spec.damping or Damping()
    ratios = {port: given.ratios(port, count) for port, count in plan.kept.items()}
    wanted = any(np.any(values > 0.0) for values in ratios.values())
    built = build(spec, plan, beam, cut, per_mode=wanted and given.form == "modal")
    if not wanted or given.form == "modal":
        return built
    chain = built.chain
    for port in built.targets:
        chain = joint_damping(chain, port, given.ratios(port, chain.port(port).modes))
    return replace(built, chain=chain)


def needs_time(spec: Spec, plan: Plan) -> bool:
    """Whether a stated step takes a tendon per mode: to be exact in time,
    or to slow what RK4 could not follow."""
    scheme = SCHEMES[spec.integrator]
    if scheme.exact or spec.integrator != "RK4":
        return scheme.exact
    free = [
        plan.reduce(plan.target, port, count).free_frequencies for port, count in plan.kept.items()
    ]
    return float(np.max(np.concatenate([np.zeros(1), *free]))) * spec.exact_step > scheme.phase
