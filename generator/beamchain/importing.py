"""Imported modes -> a verified drop-in file: chain or oscillators, by how much the modes leak between ports."""

import time
from dataclasses import replace

import numpy as np

from beamchain.assess.doubtful import doubtful
from beamchain.assess.error import Comparison, compare, in_band_error
from beamchain.assess.limits import coupled_limits
from beamchain.assess.plan import ledger, verdict
from beamchain.chain.build import Built, Status
from beamchain.chain.chain import Chain, Link
from beamchain.chain.damping import Damper, joint_damping, tendons
from beamchain.chain.near import build_chain, same_planes
from beamchain.chain.oscillators import LEAST, Oscillators, realise_oscillators
from beamchain.engine.bench import Measured, measure, root_body
from beamchain.engine.space import block, measure_in_space
from beamchain.errors import InputError, RealisationError
from beamchain.imported_case import Case, case_of, form_of, resolvable
from beamchain.mjcf import write
from beamchain.mjcf.oscillators import oscillators as write_oscillators
from beamchain.motion import PORT_MOTION, PORTS, Array
from beamchain.port import PortModel, in_space
from beamchain.result import Fit, InSpace, default_hub, seconds_taken
from beamchain.spec import Spec, port_hub_mass
from beamchain.structure.mass_line import MassLine, SpreadMass
from beamchain.structure.modal_data import ModalData

SLIGHT = 1e-6  # part of a mode in a port up to which the port's table leaves it out
EMPTY = 1e-5  # residual mass at the root below which the free appendage has no fastest mode


def fit_imported(spec: Spec, data: ModalData) -> Fit:
    """Fit a chain or oscillators to imported modes and prove it through MuJoCo's own linearisation.

    Args:
        spec: with [imported].
        data: its modes, all of the file.

    Raises:
        InputError: what is asked for contradicts the data.
        RealisationError: neither form exists.
    """
    started = time.perf_counter()
    case = case_of(spec, data)
    form, why = form_of(case)
    forced = spec.fit.form is not None
    if form == "oscillators":
        try:
            return _oscillator_fit(case.for_oscillators(), why, started)
        except RealisationError as error:
            if forced:
                raise
            return _chain_fit(case.for_chain(), f"{why}, but {error}", started, ok=False)
    try:
        chosen = case.for_chain()
        fit = _chain_fit(chosen, why, started)
        if not fit.status.ok and chosen.target != "clamped" and spec.root.target in (None, "auto"):
            fit = _chain_fit(case.for_chain("clamped"), why, started)
    except RealisationError as error:
        if forced:
            raise
        return _oscillator_fit(case.for_oscillators(), f"no chain has these modes: {error}", started)
    if fit.status.ok or forced:
        return fit
    try:
        return _oscillator_fit(case.for_oscillators(), f"a chain would give less: {fit.status.message}", started)
    except RealisationError:
        return fit


# -- the chain ---------------------------------------------------------------------------------------------------------
def _chain_fit(case: Case, why: str, started: float, *, ok: bool = True) -> Fit:
    spec, data, kept = case.spec, case.data, case.kept
    clock = [started, time.perf_counter()]
    targets = {port: kept.port(port, own=True) for port in PORTS if port in kept.belongs}
    same_planes(targets, kept.tolerance)
    target = case.target
    whole = {port: data.port(port, own=True) for port in targets} if target in ("free", "hub") else {}

    def target_of(port: str, count: int) -> PortModel:
        if count > targets[port].modes:
            raise RealisationError(f"only {targets[port].modes} modes in {port} were imported, but {count} are needed.")
        if target == "free":
            model = whole[port].reduced(count, np.zeros((whole[port].motions,) * 2))
            return model.replaced(damping=whole[port].damping[:count])
        if target == "hub":
            if case.hub is None:
                raise InputError('target = "hub" needs the hub; add root.hub, or use target = "clamped".')
            model = whole[port].reduced(count, port_hub_mass(case.hub, port))
            return model.replaced(damping=whole[port].damping[:count])
        return targets[port].truncated(count)

    counts = {port: model.modes for port, model in targets.items()}
    built, line, notes = build_chain(data.line(), counts, targets, target_of)
    chain, dampers = _damped(spec, built)
    clock.append(time.perf_counter())
    tree = write.appendage(chain, spec.name, beam=line, dampers=dampers, visuals=case.scene.visuals)
    clock.append(time.perf_counter())
    measured = measure(tree, PORTS, timestep=case.scene.timestep, ballast=root_body(chain))
    live = tuple(data.live)
    achieved = _living(in_space(measured.ports, measured.rigid_mass), live)
    space = _space(case, "chain", why, achieved, live, None)
    loss = (
        f"against all six motions of the imported modes its in-band error is {space.error.accelerance_in_band:.2e} up "
        f"to {case.band(kept.space()):.4g} rad/s."
    )
    message = " ".join([f"{why}.", built.status.message, *notes, loss])
    status = Status(built.status.ok and ok and not notes, message, (*data.steps, *built.status.history))
    return _finish(case, chain, built.targets, measured, space, line, dampers, status, clock)


def _damped(spec: Spec, built: Built) -> tuple[Chain, tuple[Damper, ...]]:
    """The modes' ratios as tendons, or as dampers in the hinges."""
    chain, dampers = built.chain, list[Damper]()
    for port, target in built.targets.items():
        if not np.any(target.damping > 0.0):
            continue
        if spec.damping is not None and spec.damping.form == "hinge":
            chain = joint_damping(chain, port, target.damping)
        else:
            dampers += tendons(chain, port, target.damping)
    return chain, tuple(dampers)


# -- the oscillators ---------------------------------------------------------------------------------------------------
def _oscillator_fit(case: Case, why: str, started: float) -> Fit:
    spec, data, kept = case.spec, case.data, case.kept
    if spec.root.target in ("free", "hub"):
        raise InputError(
            f'root.target = "{spec.root.target}" and form = "oscillators" do not go together: oscillators are the '
            "clamped "
            'modes; use target = "clamped".'
        )
    clock = [started, time.perf_counter()]
    length = float(data.length or 1.0)
    made = realise_oscillators(
        kept.rigid_mass, kept.frequencies, kept.participation, kept.damping, numbers=case.numbers, length=length,
        precision=kept.precision,
    )  # fmt: skip
    clock.append(time.perf_counter())
    tree = write_oscillators(made, spec.name, visuals=case.scene.visuals)
    clock.append(time.perf_counter())
    live = tuple(data.live)
    measured, achieved = measure_in_space(tree, timestep=case.scene.timestep, ballast=_root_ballast(made), live=live)
    space = _space(case, "oscillators", why, achieved, live, made)
    alive = [
        port for port in PORTS if np.all((PORT_MOTION[port].T @ kept.rigid_mass @ PORT_MOTION[port]).diagonal() > 0.0)
    ]
    targets = {port: model for port in alive if (model := _shown(kept, port)).modes}
    kinds = [item.kind for item in made.items]
    parts = ", ".join(
        f"{n} {kind}{'s' if n > 1 else ''}" for kind in ("slider", "rotor", "screw") if (n := kinds.count(kind))
    )
    message = f"{why}. One rigid body of {made.root.mass:.6g} kg: the scene needs no mode."
    if kinds:
        message = (
            f"{why}. {len(kinds)} modes as {parts} on one rigid root body of {made.root.mass:.6g} kg, exact at the "
            "port."
        )
    if made.repair > 1e-12:
        message += (
            f" The root body's moments moved by {made.repair:.1e} of the appendage's, within the print, to be a body's."
        )
    if made.leak > 1e-12:
        message += f" Left out: {made.leak:.1e} of a mode (a twist along its force, within the print)."
    status = Status(True, message, data.steps)
    rigid = made.rigid_mass()
    link = Link(
        start=0.0, length=length, mass=float(rigid[0, 0]), com=float(rigid[1, 5] / rigid[0, 0]),
        inertia=_principal(rigid),
    )  # fmt: skip
    return _finish(case, Chain((link,), (), length), targets, measured, space, _line(data), (), status, clock)


def _principal(rigid: Array) -> tuple[float, float, float]:
    """Inertias about the mass centre as a chain's link states them."""
    m, x = float(rigid[0, 0]), float(rigid[1, 5] / rigid[0, 0])
    return float(rigid[3, 3]), float(rigid[4, 4] - m * x * x), float(rigid[5, 5] - m * x * x)


def _line(data: ModalData) -> MassLine:
    """The mass line for drawing and sizes; one without moments where the length does not hold the mass."""
    try:
        return data.line()
    except InputError:
        return SpreadMass(float(data.length or 1.0), data.rigid_mass, (), np.zeros((0, 5)))


def _root_ballast(made: Oscillators) -> Array | None:
    """Something to hold on the bench where the modes leave nothing at the root."""
    rigid = made.rigid_mass()
    scale = np.sqrt(np.where(np.diag(rigid) > 0.0, np.diag(rigid), 1.0))
    left = (
        np.linalg.eigvalsh(made.space().residual_mass / np.outer(scale, scale))[0]
        if np.all(np.diag(rigid) > 0)
        else 0.0
    )
    if left > EMPTY and made.root.mass > 0.0 and float(made.root.principal()[0].min()) > LEAST:
        return None
    return np.array([rigid[0, 0], *np.full(3, max(float(np.max(np.diag(rigid)[3:])), 1e-9))])


def _shown(data: ModalData, port: str) -> PortModel:
    """The port's model with the modes that move there by more than noise."""
    share = np.sqrt(data.shares[:, PORTS.index(port)])
    model = data.port(port)
    strong = np.flatnonzero(share > max(SLIGHT, data.precision))
    pick = [int(np.flatnonzero(model.frequencies == data.frequencies[k])[0]) for k in strong]
    pick = sorted(set(pick))
    return model.replaced(
        frequencies=model.frequencies[pick], participation=model.participation[pick], damping=model.damping[pick],
        tip=None if model.tip is None else model.tip[pick],
    )  # fmt: skip


# -- both --------------------------------------------------------------------------------------------------------------
def _living(model: PortModel, live: tuple[int, ...]) -> PortModel:
    return block(model, np.eye(6)[:, list(live)])


def _space(
    case: Case, form: str, why: str, achieved: PortModel, live: tuple[int, ...], made: Oscillators | None
) -> InSpace:
    """The comparison with all motions at once."""
    full, target = case.data.space(), case.kept.space()
    hub = None if case.hub is None else case.hub[np.ix_(live, live)]
    error = compare(achieved, target)
    in_band = in_band_error(resolvable(achieved), resolvable(full), hub, case.band(target))
    error = replace(error, accelerance_in_band=in_band)
    return InSpace(case.data, form, why, full, target, achieved, error, live, made)


def _finish(
    case: Case, chain: Chain, targets: dict[str, PortModel], measured: Measured, space: InSpace, line: MassLine,
    dampers: tuple[Damper, ...], status: Status, clock: list[float],
) -> Fit:  # fmt: skip
    """Errors per port, step limits, and the result."""
    full: dict[str, PortModel] = {}
    error: dict[str, Comparison] = {}
    bandwidth: dict[str, float] = {}
    for port, target in targets.items():
        full[port] = case.data.port(port)
        bandwidth[port] = case.band(target)
        hub = None if case.hub is None else port_hub_mass(case.hub, port)
        plain = compare(measured.ports[port], target)
        in_band = in_band_error(resolvable(measured.ports[port]), resolvable(full[port]), hub, bandwidth[port])
        error[port] = replace(plain, accelerance_in_band=in_band)
    limits_hub = case.hub
    residual = space.achieved.residual_mass
    scale = np.sqrt(np.diag(space.achieved.rigid_mass))
    if limits_hub is None and np.linalg.eigvalsh(residual / np.outer(scale, scale))[0] < EMPTY:
        # alone such an appendage has a root without mass, whose fastest mode lies at infinity
        limits_hub = default_hub(line).mass_matrix()
        status = replace(
            status, message=f"{status.message} Step limits: on ten times its mass, as its root has none of its own."
        )
    achieved = {port: measured.ports[port] for port in targets}
    if space.made is None:
        limits = coupled_limits(in_space(achieved, measured.rigid_mass), limits_hub, tendon=bool(dampers))
    else:
        held = None if limits_hub is None else limits_hub[np.ix_(space.live, space.live)]
        limits = coupled_limits(space.achieved, held, tendon=False)
    promise = None if case.promise is None else case.promise.error(resolvable(space.achieved))
    clock.append(time.perf_counter())
    return Fit(
        spec=case.spec,
        chain=chain,
        full=full,
        target=targets,
        achieved=achieved,
        error=error,
        measured=measured,
        limits=limits,
        status=verdict(case.spec, status, promise),
        seconds=seconds_taken(clock),
        bandwidth=bandwidth,
        kept_for=case.target,
        dampers=dampers,
        choice=case.choice,
        promise=promise,
        left_out=ledger(case.spec, case.choice, bool(dampers)),
        cautions=tuple(doubtful((), case.spec.damping)),
        line=line,
        space=space,
    )
