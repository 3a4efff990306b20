"""`fit`: from a specification to a verified drop-in file."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec

from beamchain.caution import Caution
from beamchain.chain.build import Built
from beamchain.chain.links import raise_polar_inertia
from beamchain.engine.bench import measure, root_body
from beamchain.engine.hanging import sprung_by_acceleration
from beamchain.engine.library import one_thread
from beamchain.errors import EngineError, InputError, RealisationError
from beamchain.fitting.beam_case import beam_case, on_modes
from beamchain.fitting.cure import cure_of
from beamchain.fitting.document import appendage_tree
from beamchain.fitting.hub import Hub
from beamchain.fitting.imported import imported_case
from beamchain.fitting.options import Damping, FitOptions, Modes, Root, Scene, Target
from beamchain.fitting.proof import Case, assess_fit
from beamchain.fitting.result import Fit
from beamchain.fitting.slosh import slosh_case
from beamchain.fitting.spec import Spec, read_spec
from beamchain.fitting.uncertain import uncertain_from
from beamchain.fitting.warnings import doubtful
from beamchain.mjcf.write import SMALLEST, UNITS
from beamchain.ports.compare import tolerance_statement
from beamchain.ports.motions import Array
from beamchain.steps.cures import RUINED, UNCURED
from beamchain.steps.sampled import judged_part, off_by
from beamchain.steps.turn import central_inertia, turn_error
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.imported import Imported
from beamchain.structure.readers.recovery_file import read_recovery

# cached by a fit, the same whatever its status
READ_BACK = ("_scenes", "time", "time_error", "_sampled")
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
        scene: requirements of the simulation: if they include a bandwidth, the modes are chosen for
            it; if they include a step, the files are exact in time for it.
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
    )
    data = appendage if isinstance(appendage, ModalData) else None
    return decide(fit_spec(spec, data), data)


def decide(made: Fit, data: ModalData | None = None) -> Fit:
    """The fit, its status decided at the stated step where there is one, and where it misses what
    was asked for with the cure, which its message begins with; `data`: its imported modes."""
    text = f"{made.status.message}{_at_its_step(made)}"
    missed = made.met is False or made.ruined
    cautions = made.cautions
    hinged = made.spec.damping is not None and made.spec.damping.form == "hinge"
    cure = None
    if missed or (hinged and made.met is None and (made.in_band_error or 0.0) > RUINED):
        cure = cure_of(made, lambda spec: fit_spec(spec, data))
    if missed:
        text = f"{UNCURED if cure is None else cure.words} {text}"
    elif cure is not None:
        cautions = (*cautions, Caution("hinge-damping", cure.words))
    status = replace(made.status, ok=made.status.ok and not missed, message=text)
    decided = replace(made, status=status, cautions=cautions, cure=cure)
    vars(decided).update({name: vars(made)[name] for name in READ_BACK if name in vars(made)})
    return decided


def _at_its_step(made: Fit) -> str:
    """The error at the stated step, as the end of a message; empty where none is stated, or where
    neither a tolerance nor 0.1 is held against it."""
    scene, error, step = made.spec.scene, made.sampled_error, made.spec.exact_step
    if error is None or (made.met is None and not made.ruined):
        return ""
    kept = f", above {RUINED:g}"
    if scene is not None and scene.bandwidth is not None:
        part = judged_part(step, scene.bandwidth)
        kept = f", {tolerance_statement(error, scene.tolerance)}"
        kept = f"{part}; the tolerance {scene.tolerance:g} is not met" if part else kept
    said = f" Stepped by {made.spec.integrator} at {step:g} s: off {off_by(error)}{kept}."
    return f"{said} {made.blamed}".rstrip()


def fit_spec(spec: Spec, data: ModalData | None = None) -> Fit:
    """What `fit` does with a whole specification; `data`: its imported modes,
    else read from its file."""
    imported = spec.imported
    with one_thread():
        if spec.slosh is not None:
            return _fit(_with_integrator(spec, spec.slosh.rigid_mass()))
        if imported is None:
            return _fit(_with_integrator(on_modes(spec), spec.beam.rigid_mass()))
        data = imported.read() if data is None else data
        if spec.uncertain is None and data.uncertain:
            uncertain = uncertain_from(data.uncertain, data.source)
            spec = msgspec.structs.replace(spec, uncertain=uncertain)
        if imported.recovery is not None:
            read_recovery(imported.recovery).check_columns(data.in_file.shape[1])
        try:
            return _fit(_with_integrator(on_modes(spec), data.rigid_mass), data)
        except EngineError as error:
            units = imported.units
            cure = "Check imported.units (length = {:g}, mass = {:g}).".format(*units.si)
            raise EngineError(str(error).replace(UNITS, cure)) from None


def _fit(spec: Spec, data: ModalData | None = None) -> Fit:
    """The fit of a beam, or of imported modes: chosen, realised, written, measured, compared."""
    clock = [time.perf_counter()]
    case: Case
    if spec.slosh is not None:
        case = slosh_case(spec)
    else:
        case = beam_case(spec) if data is None else imported_case(spec, data)
    clock.append(time.perf_counter())
    case, built, line = _realise(case)
    chain, note = raise_polar_inertia(built.chain, LEAST_INERTIA)
    built = replace(built, chain=chain)
    clock.append(time.perf_counter())
    tree = appendage_tree(spec, chain)
    if chain.hung:
        tree = sprung_by_acceleration(tree, chain.acceleration)
    clock.append(time.perf_counter())
    measured = measure(
        tree,
        case.blocks,
        timestep=(spec.scene or Scene()).step,
        integrator=spec.integrator,
        ballast=root_body(chain),
        live=case.live,
    )
    fitted = assess_fit(case, built, measured, clock, line)
    if not note:
        return fitted
    return replace(fitted, cautions=(*fitted.cautions, Caution("raised-inertia", note)))


def _realise(case: Case) -> tuple[Case, Built, MassLine]:
    """The chain of a case, or of its fallback where it has none."""
    try:
        return case, *case.build()
    except RealisationError as error:
        other = case.fallback()
        if other is not None:
            return other, *other.build()
        questions = " ".join(doubtful(case.spec.segment))
        if not questions:
            raise
        raise RealisationError(f"{questions} As it is: {error}") from None


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
