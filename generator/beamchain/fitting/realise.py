"""The chain that has the kept modes: port by port where they are independent, else with one cut."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from beamchain.chain.build import (
    BuildOptions,
    Built,
    Springs,
    build_exact,
    cut_chain,
    with_modes,
)
from beamchain.chain.cut import MOST_ADDED, Cut
from beamchain.chain.tendons import ModeGroup, group_motion, joint_damping
from beamchain.errors import InputError, RealisationError
from beamchain.fitting.body import Body
from beamchain.fitting.hub import port_hub_mass
from beamchain.fitting.kept import Kept
from beamchain.fitting.options import Scene
from beamchain.fitting.slosh import pendulum_chain
from beamchain.fitting.spec import Spec
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS
from beamchain.steps.integrators import SCHEMES
from beamchain.structure import settle_modes
from beamchain.structure.mass_line import MassLine
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers import MATRICES
from beamchain.structure.readers.craig_bampton import ALMOST_BODY, EXACT_BODY
from beamchain.structure.rigid_body import body_departure
from beamchain.warning_codes import Caution

# residual over rigid mass: free frequencies are good to about 1e-16 over it (measured)
LIGHTEST = 1e-9
SLIGHT = 1e-6  # part of a mode in a port up to which the port's table leaves it out
ROUNDING = 1e-11  # relative: a residual mass below zero by less is zero
MASSLESS = 1e-9  # of the masses: a motion with less has none of its own
MOST_LACKING = 1.1  # more than a few printed digits explain
# of x, with which mass may grow from the root where only its moments are known
POWERS = (0, 1, 2, 4)
ENTRIES = (
    # precisions of the print by which two rounded entries of one matrix may differ,
    # with half as much to spare
    3.0
)


def chain_of(body: Body, kept: Kept, cut: Cut | None = None) -> tuple[Built, MassLine]:
    """The chain of the kept modes, and how its mass lies along x; `cut`: where its hinges stand,
    else chosen."""
    if body.spec.slosh is not None:
        return _pendulums(body, kept)
    if body.data is None:
        line = body.spec.beam.line
        return _damped(body.spec, _of_ports(body, kept, line, cut)), line
    built, line = _of_data(body, kept)
    built = _damped(body.spec, built)
    return replace(built, history=(*body.data.steps, *built.history)), line


def why(kept: Kept) -> str:
    """The reason for one cut, or for one per port, of modes that were imported."""
    if not kept.coupled_ports or kept.data is None:
        return "the ports are independent"
    worst = float(np.max(kept.data.leaks))
    names = " and ".join(kept.coupled_ports)
    return f"modes or mass couple {names} (up to {worst:.2g} of a mode's participation)"


def _pendulums(body: Body, kept: Kept) -> tuple[Built, MassLine]:
    """Pendulums that swing in both planes, and the fixed mass."""
    liquid = body.spec.slosh
    assert liquid is not None
    assert kept.data is not None
    targets = {port: kept.data.port(port, own=True) for port in kept.counts}
    how = f"{liquid.kept} pendulum{'s' if liquid.kept > 1 else ''} and a fixed mass"
    return Built(pendulum_chain(liquid), targets, how), liquid.line()


def _damped(spec: Spec, built: Built) -> Built:
    """The chain with its dampers in the hinges, where that is asked for; the last ratio of a port
    applies to its further modes."""
    if spec.damping is None or spec.damping.form != "hinge":
        return built
    chain = built.chain
    for port, target in built.targets.items():
        number = np.minimum(np.arange(chain.port(port).modes), target.modes - 1)
        chain = joint_damping(chain, port, target.damping[number])
    return replace(built, chain=chain)


# -- independent ports -----------------------------------------------------------------------------
def _of_ports(body: Body, kept: Kept, line: MassLine, cut: Cut | None = None) -> Built:
    """The chain of ports that are independent, each with its own modes."""
    spec = body.spec
    source = body
    if kept.data is not None and kept.target == "clamped":
        own = {port: kept.data.port(port, own=True) for port in kept.counts}
        same_planes(own, kept.data.tolerance)
        source = replace(body, ports=own)

    def target_of(port: str, count: int) -> PortModel:
        target = source.reduced(kept.target, port, count)
        if kept.target == "free" and body.data is None:
            _check_free(target)
        return target

    # at further ports the static responses that are kept are all that is left out
    filled = () if spec.further else kept.counts
    wishes = BuildOptions(
        springs=_springs(body, kept),
        per_mode=_damps_modes(body, kept),
        lines=spec.fit.cuts,
        further=tuple(spec.further.values()),
        cut=cut,
        left_out={port: _left_out(body, kept, (port,)) for port in filled},
        band=_band(body, kept),
        neutral=kept.target != "clamped",
    )
    return build_exact(line, kept.counts, target_of, wishes)


def _left_out(body: Body, kept: Kept, ports: tuple[str, ...]) -> ModeGroup:
    """The modes that are not kept, as they move some ports, for which fillers stand."""
    if body.data is None:
        (port,) = ports
        whole, count = body.ports[port], kept.counts[port]
        frequencies, rows = whole.frequencies[count:], whole.participation[count:]
    else:
        beyond = [k for k in range(body.data.modes) if k + 1 not in kept.numbers]
        frequencies = body.data.frequencies[beyond]
        rows = body.data.participation[beyond] @ group_motion(ports)
    return ModeGroup(ports, frequencies, rows, np.zeros(0))


def _band(body: Body, kept: Kept) -> float:
    """The scene's bandwidth, or the last kept frequency on the hub, of a free target on none,
    whichever is higher; 0 where neither is stated [rad/s]."""
    bandwidth = (body.spec.scene or Scene()).bandwidth or 0.0
    if body.hub is None and kept.target != "free":
        return bandwidth
    hub = kept.hub(body)
    if kept.data is not None:
        live = np.ix_(body.live, body.live)
        return max(bandwidth, kept.data.space().last_on_hub(hub[live]))
    models = {port: body.ports[port].truncated(count) for port, count in kept.counts.items()}
    coupled = (model.last_on_hub(port_hub_mass(hub, port)) for port, model in models.items())
    return max((bandwidth, *coupled))


def _springs(body: Body, kept: Kept) -> Springs:
    """Where springs stand: on modal tendons where modes are uncertain, sensed, or timed, and it is
    left to us."""
    spec = body.spec
    uncertain = spec.uncertain is not None and bool(spec.uncertain.modal)
    wanted = uncertain or spec.sensors.modes or (bool(spec.exact_step) and _needs_time(body, kept))
    return "modes" if spec.fit.springs == "auto" and wanted else spec.fit.springs


def _damps_modes(body: Body, kept: Kept) -> bool:
    """Whether each mode takes a damper on a tendon of its own."""
    spec = body.spec
    if spec.damping is not None and spec.damping.form != "modal":
        return False
    if kept.data is not None:
        return bool(np.any(kept.data.damping > 0.0))
    return any(
        np.any(body.ports[port].damping[:count] > 0.0) for port, count in kept.counts.items()
    )


def _needs_time(body: Body, kept: Kept) -> bool:
    """Whether a stated step takes a tendon per mode: to be exact in time,
    or to slow what RK4 could not follow."""
    scheme = SCHEMES[body.spec.integrator]
    if scheme.exact or body.spec.integrator != "RK4":
        return scheme.exact
    if kept.data is not None:
        free = [kept.data.space().free_frequencies]
    else:
        free = [
            body.reduced(kept.target, port, count).free_frequencies
            for port, count in kept.counts.items()
        ]
    last = float(np.max(np.concatenate([np.zeros(1), *free])))
    return last * body.spec.exact_step > scheme.phase


def _check_free(target: PortModel) -> None:
    """The free modes stand in double precision:
    what moves at the root is a difference of nearly equal masses."""
    if not target.modes:
        return
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


# -- imported modes --------------------------------------------------------------------------------
def _of_data(body: Body, kept: Kept) -> tuple[Built, MassLine]:
    """The chain, and the mass it is cut from:
    what the file leaves open of it lies farther out where that saves hinges, or is needed."""
    data = body.data
    assert data is not None
    assert kept.data is not None
    coupled = bool(kept.coupled_ports)
    saves = coupled and not data.states_line
    reasons: dict[int, RealisationError] = {}
    for most_added, power in product((0, MOST_ADDED) if saves else (MOST_ADDED,), POWERS):
        try:
            line = _roomy(data.line(power), kept.data)
            if coupled:
                return _couple_ports(body, kept, line, most_added), line
            return _of_ports(body, kept, line), line
        except RealisationError as error:
            reasons.setdefault(most_added, error)
        except InputError:
            if power == 0:
                raise
    departing = next((step for step in data.steps if _departs(step)), None)
    if departing is None:
        raise reasons[MOST_ADDED]
    raise RealisationError(
        f"{reasons[MOST_ADDED]} Note that {departing}; mend that first."
    ) from None


def _departs(step: str) -> bool:
    """Whether a reader's step says that the rigid mass is almost that of a body."""
    return isinstance(step, Caution) and step.code == "almost-rigid"


def _roomy(line: MassLine, kept: ModalData) -> MassLine:
    """The mass line, heavier by what the print lacks for the modes' participation to leave
    something at the root."""
    if not kept.modes:
        return line
    live = [i for i in kept.live if line.rigid_mass()[i, i] > 0.0]
    own = line.whole[np.ix_(live, live)]
    size = np.sqrt(np.diag(own))
    rows = kept.participation[:, live] / size
    # largest participation squared over the mass that moves with it, where any does
    values, vectors = np.linalg.eigh(own / np.outer(size, size))
    moved = values > MASSLESS
    most = float(np.linalg.norm(rows @ vectors[:, moved] / np.sqrt(values[moved]), 2) ** 2)
    if not 1.0 + ROUNDING < most < MOST_LACKING:
        return line
    factor = most + 0.2 * (most - 1.0)
    return line.times(factor)


def _couple_ports(body: Body, kept: Kept, line: MassLine, most_added: int) -> Built:
    """Modes that couple ports, on one cut, with up to `most_added` hinges beyond the fewest."""
    spec, modes = body.spec, kept.data
    assert body.data is not None
    assert modes is not None
    if spec.fit.springs == "hinges":
        raise InputError(
            'fit.springs = "hinges" needs ports that are independent, but these modes couple them; '
            'use fit.springs = "auto".'
        )
    _check_body(modes)
    modes = _for_target(body, kept, modes)
    groups = [_group(body, kept, modes, ports) for ports in modes.groups]
    built = cut_chain(line, groups, spec.fit.cuts, most_added=most_added)
    alive = [
        port
        for port in PORTS
        if np.all(np.diag(PORT_MOTION[port].T @ modes.rigid_mass @ PORT_MOTION[port]) > 0.0)
    ]
    targets = {port: model for port in alive if (model := _visible_modes(modes, port)).modes}
    return replace(built, targets=targets)


def _for_target(body: Body, kept: Kept, modes: ModalData) -> ModalData:
    """The kept modes of a file, for another target than the clamped one as many on its hub."""
    if kept.target == "clamped":
        return modes
    reduced = kept.in_space(body)
    with_modes(reduced, modes.modes, " and ".join(kept.coupled_ports))
    rows = np.zeros((modes.modes, 6))
    rows[:, body.live] = reduced.participation
    return replace(modes, frequencies=reduced.frequencies, participation=rows, tip=None)


def _group(body: Body, kept: Kept, modes: ModalData, ports: tuple[str, ...]) -> ModeGroup:
    """Those of the modes that some ports share, as a cut asks for them."""
    motion = group_motion(ports)
    own = np.flatnonzero([port in ports for port in modes.belongs])
    parts = modes.parts[own][:, [PORTS.index(port) for port in ports]]
    damping = modes.damping[own] if _damps_modes(body, kept) else np.zeros(own.size)
    return ModeGroup(
        ports,
        modes.frequencies[own],
        modes.participation[own] @ motion,
        damping,
        numbers=tuple(range(1, own.size + 1)) if len(ports) == 1 else tuple((own + 1).tolist()),
        weights=dict(zip(ports, np.sum(parts**2, axis=0).tolist(), strict=True)),
        rigid=motion.T @ modes.rigid_mass @ motion,
        left_out=_left_out(body, kept, ports),
        band=_band(body, kept),
        neutral=kept.target != "clamped",
    )


def _check_body(data: ModalData) -> None:
    """The rigid mass matrix is a rigid body's, to the precision of the print."""
    miss = body_departure(data.rigid_mass)
    # `settle_rigid_mass` moves an entry and an eigenvalue by up to `least` each; a comparison has
    # two entries
    least = min(settle_modes.ROUNDING * data.precision, settle_modes.PRINTED)
    if miss > max(ENTRIES * data.precision + 4.0 * least, EXACT_BODY):
        matrices = Path(data.source).suffix.lower() in MATRICES
        cure = (
            f"up to {ALMOST_BODY:.0e} is taken for rounding: check that the a-set holds all six "
            "freedoms of every interface grid and that mass and stiffness are of the same freedoms"
            if matrices
            else "give the mass of the grid point weight generator (PARAM,GRDPNT,0)"
        )
        raise RealisationError(
            f"the rigid mass matrix differs by {miss:.1e} from a rigid body's (its mass depends on "
            f"the direction), which no set of bodies can be; {cure}."
        )


def _visible_modes(data: ModalData, port: str) -> PortModel:
    """The port's model with the modes that move there by more than noise."""
    share = np.sqrt(data.shares[:, PORTS.index(port)])
    model = data.port(port)
    # no mode that `port` takes for rounding
    strong = np.flatnonzero(share > max(SLIGHT, data.tolerance))
    return model.picked(
        sorted({int(np.flatnonzero(model.frequencies == data.frequencies[k])[0]) for k in strong})
    )


def same_planes(targets: dict[str, PortModel], tolerance: float) -> None:
    """Planes that agree within the print become one, so that they share their hinges."""
    if not {"xy", "xz"} <= set(targets):
        return
    a, b = targets["xy"], targets["xz"]
    if a.modes != b.modes:
        return
    scale = np.sqrt(np.diag(a.rigid_mass))
    gap = max(
        float(np.max(np.abs(a.frequencies / b.frequencies - 1.0))),
        float(np.max(np.abs((a.participation - b.participation) / scale))),
        float(np.max(np.abs((a.rigid_mass - b.rigid_mass) / np.outer(scale, scale)))),
    )
    if gap <= tolerance:
        targets["xz"] = b.replaced(
            rigid_mass=a.rigid_mass, frequencies=a.frequencies, participation=a.participation
        )
