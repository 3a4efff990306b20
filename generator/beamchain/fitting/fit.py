"""`fit`: from a specification to a verified drop-in file."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from msgspec import structs

from beamchain.chain.build import Built
from beamchain.chain.links import raise_polar_inertia
from beamchain.checks import kind_of
from beamchain.engine.bench import measure, root_body
from beamchain.engine.gravity_stiffness import sprung_by_acceleration
from beamchain.engine.library import one_thread
from beamchain.errors import EngineError, InputError, RealisationError
from beamchain.fitting.body import Body, body_of
from beamchain.fitting.cure import cure_of
from beamchain.fitting.document import appendage_tree
from beamchain.fitting.hub import Hub
from beamchain.fitting.kept import Kept
from beamchain.fitting.options import Damping, FitOptions, Modes, Root, Scene, Target
from beamchain.fitting.proof import assess_fit
from beamchain.fitting.realise import chain_of
from beamchain.fitting.result import Fit, with_known
from beamchain.fitting.select import select
from beamchain.fitting.spec import Spec, read_spec
from beamchain.fitting.uncertain import uncertain_from
from beamchain.fitting.warnings import doubtful
from beamchain.mjcf.write import SMALLEST, UNITS
from beamchain.ports.motions import Array
from beamchain.steps.cures import RUINED
from beamchain.steps.turn import central_inertia, turn_error
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.imported import Imported
from beamchain.structure.readers.recovery_file import read_recovery
from beamchain.warning_codes import Caution

# cached by a fit, the same whatever it is held against
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
    """The fit, judged at the stated step where there is one, with a cure where it misses what was
    asked for; `data`: its imported modes."""
    made = with_known(made, READ_BACK, at_step=True)
    cautions = made.cautions
    hinged = made.spec.damping is not None and made.spec.damping.form == "hinge"
    cure = None
    if made.missed or (hinged and made.met is None and (made.in_band_error or 0.0) > RUINED):
        cure = cure_of(made, lambda spec: fit_spec(spec, data))
    if cure is not None and not made.missed:
        cautions = (*cautions, Caution("hinge-damping", cure.words))
    return with_known(made, READ_BACK, cautions=cautions, cure=cure)


def fit_spec(spec: Spec, data: ModalData | None = None) -> Fit:
    """What `fit` does with a whole specification; `data`: its imported modes,
    else read from its file."""
    began = time.perf_counter()
    return fit_kept(*body_and_kept(spec, data), began)


@one_thread()
def body_and_kept(spec: Spec, data: ModalData | None = None) -> tuple[Body, Kept]:
    """The appendage of a specification, and what is kept of it; `data`: its imported modes,
    else read from its file."""
    imported = spec.imported
    if imported is not None:
        data = imported.read() if data is None else data
        if spec.uncertain is None and data.uncertain:
            uncertain = uncertain_from(data.uncertain, data.source)
            spec = structs.replace(spec, uncertain=uncertain)
        if imported.recovery is not None:
            read_recovery(imported.recovery).check_columns(data.in_file.shape[1])
    body = body_of(spec, data)
    body = replace(body, spec=_with_integrator(spec, body.rigid_mass))
    return body, select(body)


@one_thread()
def fit_kept(body: Body, kept: Kept, began: float | None = None) -> Fit:
    """Modes realised, written, read back through MuJoCo, and compared; `began`: when the appendage
    was read, by `time.perf_counter` [s]."""
    now = time.perf_counter()
    try:
        return _fit(body, kept, [began or now, now])
    except EngineError as error:
        if body.spec.imported is None:
            raise
        units = body.spec.imported.units
        cure = "Check imported.units (length = {:g}, mass = {:g}).".format(*units.si)
        raise EngineError(str(error).replace(UNITS, cure)) from None


def _fit(body: Body, kept: Kept, clock: list[float]) -> Fit:
    kept, built, line = _realise(body, kept)
    chain, note = raise_polar_inertia(built.chain, LEAST_INERTIA)
    built = replace(built, chain=chain)
    clock.append(time.perf_counter())
    tree = appendage_tree(body.spec, chain)
    if chain.hung:
        tree = sprung_by_acceleration(tree, chain.acceleration)
    clock.append(time.perf_counter())
    measured = measure(
        tree,
        kept.blocks,
        timestep=(body.spec.scene or Scene()).step,
        integrator=body.spec.integrator,
        ballast=root_body(chain),
        live=body.live,
    )
    fitted = assess_fit(body, kept, built, line, measured, clock)
    if not note:
        return fitted
    return replace(fitted, cautions=(*fitted.cautions, Caution("raised-inertia", note)))


def _realise(body: Body, kept: Kept) -> tuple[Kept, Built, MassLine]:
    """The chain of the kept modes; of clamped ones where those that the scene chose have none."""
    try:
        return kept, *chain_of(body, kept)
    except RealisationError as error:
        auto = body.spec.root.target in (None, "auto")
        if auto and kept.target != "clamped":
            kept = select(body, "clamped")
            return kept, *chain_of(body, kept)
        questions = " ".join(doubtful(body.spec.segment))
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
    return structs.replace(spec, scene=structs.replace(scene, integrator=chosen))


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
        f"the appendage is {kind_of(appendage)}; give a Beam, a Spec, the path of a "
        "SPEC.toml, or a ModalData."
    )
