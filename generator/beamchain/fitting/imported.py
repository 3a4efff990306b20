"""What a fit of imported modes starts from: a chain, port by port where the modes are,
else with one cut for all."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from msgspec import structs

from beamchain.caution import Caution
from beamchain.chain.build import Built, Status, Wishes, build_exact, cut_chain, with_modes
from beamchain.chain.chain import Chain
from beamchain.chain.cut import MOST_ADDED
from beamchain.chain.tendons import ModeGroup, group_motion, joint_damping
from beamchain.engine.bench import Measured
from beamchain.errors import InputError, RealisationError
from beamchain.fitting.choose import make_plan
from beamchain.fitting.fewest import fewest
from beamchain.fitting.hub import port_hub_mass
from beamchain.fitting.needs import AXES, FAR, Choice, Promise
from beamchain.fitting.options import Damping, Scene, Target
from beamchain.fitting.result import InSpace
from beamchain.fitting.spec import Spec
from beamchain.fitting.warnings import doubtful, imported_warnings
from beamchain.ports.compare import compare, in_band_error, with_damping
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.limits import StepLimits
from beamchain.structure import planes
from beamchain.structure.mass_line import MassLine
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers import MATRICES
from beamchain.structure.readers.craig_bampton import ALMOST_BODY, EXACT_BODY
from beamchain.structure.readers.imported import with_length
from beamchain.structure.rigid_body import body_departure

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


# -- what a fit starts from ------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class ImportedCase:
    """All modes of a file (`data`), damped, and the `selected` ones, which the chain shall keep.

    `numbers`: of these in the file; `target`: "clamped", "free" or "hub"; `choice`:
    how the scene decided; `promise`: the in-band error on the hub, where a bandwidth is stated.
    """

    spec: Spec
    data: ModalData
    selected: ModalData
    numbers: tuple[int, ...]
    target: str = "clamped"
    choice: Choice | None = None
    promise: Promise | None = None

    @property
    def scene(self) -> Scene:
        """The spec's, or what is taken without one."""
        return self.spec.scene or Scene()

    @property
    def hub(self) -> Array | None:
        """`(6, 6)` about the root."""
        return None if self.spec.root.hub is None else self.spec.root.hub.mass_matrix()

    @property
    def carrier(self) -> Array:
        """`(6, 6)` the hub on which a free or hub target is exact, about the root:
        a free one's has no mass."""
        return np.zeros((6, 6)) if self.hub is None or self.target == "free" else self.hub

    @property
    def fillers_above(self) -> float:
        """The scene's bandwidth, or the last kept frequency on the hub, of a free target on none,
        whichever is higher; 0 where neither is stated [rad/s]."""
        bandwidth = self.scene.bandwidth or 0.0
        if self.target != "free" and self.hub is None:
            return bandwidth
        live = np.ix_(self.live, self.live)
        return max(bandwidth, self.selected.space().last_on_hub(self.carrier[live]))

    def left_out(self, ports: tuple[str, ...]) -> ModeGroup:
        """The modes of the file that are not kept, as they move some ports."""
        beyond = [k for k in range(self.data.modes) if k + 1 not in self.numbers]
        rows = self.data.participation[beyond] @ group_motion(ports)
        return ModeGroup(ports, self.data.frequencies[beyond], rows, np.zeros(0))

    @property
    def chooses(self) -> bool:
        """Whether the scene decides which modes are kept."""
        return self.spec.chooses and (
            self.spec.imported is None or self.spec.imported.modes is None
        )

    def band(self, model: PortModel) -> float:
        """Upper end of the band [rad/s]."""
        return self.scene.bandwidth or float(model.frequencies[-1])

    def chosen(self, target: Target | None = None) -> "ImportedCase":
        """The case with the fewest modes that the scene needs; `target`: instead of the spec's."""
        if not self.chooses or self.promise is None:
            return self
        if any(len(ports) > 1 for ports in self.data.groups):
            fixed = {} if self.spec.modes is None else self.spec.modes.given()
            numbers, choice = fewest(
                self.promise,
                with_damping(self.data.space(), self.spec.undamped_ratio),
                self.data.belongs,
                self.scene.tolerance,
                fixed,
                self.scene.tip,
            )
            return self._choose(numbers, "clamped", choice)
        full = {port: self.data.port(port, own=True) for port in PORTS if port in self.data.belongs}
        root = self.spec.root if target is None else structs.replace(self.spec.root, target=target)
        plan = make_plan(
            structs.replace(self.spec, root=root), full, self.data.rigid_mass, self.hub
        )
        return self._choose(_first(self.data, plan.kept), plan.target, plan.choice)

    def _choose(
        self, numbers: tuple[int, ...], target: str, choice: Choice | None
    ) -> "ImportedCase":
        selected = self.data.selected(numbers) if numbers else self.data.frozen()
        return replace(self, selected=selected, numbers=numbers, target=target, choice=choice)

    @property
    def kept(self) -> dict[str, int]:
        """The targets hold the kept modes and no others."""
        return {}

    @property
    def live(self) -> tuple[int, ...]:
        """Motions in which the appendage has inertia (0 to 5)."""
        return tuple(self.data.live)

    @property
    def blocks(self) -> tuple[tuple[str, ...], ...]:
        """Ports that modes or mass couple stand together."""
        return self.selected.blocks

    @property
    def coupled_ports(self) -> tuple[str, ...]:
        """The first ports that kept modes couple; empty where all are independent."""
        groups = self.selected.groups if self.selected.modes else ()
        return next((ports for ports in groups if len(ports) > 1), ())

    @property
    def why(self) -> str:
        """The reason for one cut, or for one per port."""
        if not self.coupled_ports:
            return "the ports are independent"
        worst = float(np.max(self.selected.leaks))
        names = " and ".join(self.coupled_ports)
        return f"modes or mass couple {names} (up to {worst:.2g} of a mode's participation)"

    def fallback(self) -> "ImportedCase | None":
        """The clamped modes, where the scene chose others."""
        if self.target == "clamped" or self.spec.root.target not in (None, "auto"):
            return None
        return _stated(self.spec, self.data).chosen("clamped")

    def build(self) -> tuple[Built, MassLine]:
        """The chain, and the mass it is cut from."""
        built, line = _build(self, coupled=bool(self.coupled_ports))
        chain = built.chain
        if self.spec.damping is not None and self.spec.damping.form == "hinge":
            for port, target in built.targets.items():
                ratios = np.resize(target.damping, chain.port(port).modes)
                chain = joint_damping(chain, port, ratios)
        status = replace(
            built.status.adding(f"Ports: {self.why}."),
            history=(*self.data.steps, *built.status.history),
        )
        return replace(built, chain=chain, status=status), line

    def full(self, ports: Mapping[str, PortModel]) -> dict[str, PortModel]:
        """Per port of `ports` every mode of the file that moves there."""
        return {port: self.data.port(port) for port in ports}

    def truth(self, port: str) -> PortModel:
        """Every mode of the file that moves in a port, damped."""
        return self.data.port(port)

    def compared(self, measured: Measured) -> InSpace:
        """The comparison in all motions at once."""
        live = list(self.live)
        full = self.data.space()
        target = self.selected.space()
        if self.target != "clamped" and target.modes:
            target = full.reduced(target.modes, self.carrier[np.ix_(live, live)])
        hub = None if self.hub is None else self.hub[np.ix_(live, live)]
        achieved = measured.motion
        error = replace(
            compare(achieved, target),
            accelerance_in_band=in_band_error(
                measured.damped_motion,
                full,
                hub,
                self.band(target),
                undamped=self.spec.undamped_ratio,
            ),
        )
        return InSpace(
            data=self.data,
            why=self.why,
            full=full,
            target=target,
            achieved=achieved,
            error=error,
            live=self.live,
            numbers=self.numbers,
        )

    def cautions(
        self,
        measured: Measured,
        targets: Mapping[str, PortModel],
        chain: Chain,
        limits: StepLimits,
    ) -> tuple[str, ...]:
        """Damping and units that are probably a slip."""
        del measured, targets, chain, limits
        imported = self.spec.imported
        units = None if imported is None else imported.units
        return (
            *doubtful((), self.spec.damping),
            *imported_warnings(self.data, self.numbers, self.spec.damping, units, self.spec.scene),
        )


def imported_case(spec: Spec, data: ModalData) -> ImportedCase:
    """The case of a spec: damped as it says, with the modes that it states, that its scene needs,
    or all."""
    return _stated(spec, data).chosen()


def _stated(spec: Spec, data: ModalData) -> ImportedCase:
    """The case before its scene chooses."""
    data = with_length(data.untangled(), None)
    if spec.damping is not None:
        data = replace(data, damping=_ratios(spec.damping, data))
    promise = _promise(spec, data)
    wanted = None if spec.imported is None else spec.imported.modes
    target = "clamped" if spec.root.target in (None, "auto") else str(spec.root.target)
    if spec.modes is not None:
        if wanted is not None:
            raise InputError(
                "[modes] and imported.modes are both given; name the modes by number "
                "(imported.modes) or count them per port ([modes])."
            )
        numbers = _first(data, spec.modes.counts())
        wanted = None if spec.chooses else numbers
    if wanted is None:
        numbers = tuple(range(1, data.modes + 1))
        return ImportedCase(spec, data, data, numbers, target, promise=promise)
    selected = data.selected(wanted)
    return ImportedCase(spec, data, selected, tuple(sorted(wanted)), target, promise=promise)


def _ratios(damping: Damping, data: ModalData) -> Array:
    """`(n,)` damping ratio of every mode of the file."""
    if isinstance(damping.ratio, tuple):
        if len(damping.ratio) > data.modes:
            raise InputError(
                f"damping.ratio holds {len(damping.ratio)} values, but {data.source} has "
                f"{data.modes} modes; give one per mode of the file, in its order."
            )
        return damping.ratios("", data.modes)
    ratios = np.zeros(data.modes)
    for port in PORTS:
        own = [k for k, b in enumerate(data.belongs) if b == port]
        ratios[own] = damping.ratios(port, len(own))
    return ratios


def _promise(spec: Spec, data: ModalData) -> Promise | None:
    """The in-band error in the live motions, where the scene states a bandwidth."""
    if spec.scene is None or spec.scene.bandwidth is None:
        return None
    bandwidth = spec.scene.bandwidth
    live = data.live
    hub = None if spec.root.hub is None else spec.root.hub.mass_matrix()[np.ix_(live, live)]
    motions = {AXES[axis] for axis in spec.scene.axes}
    return Promise(
        with_damping(data.space(), spec.undamped_ratio).condensed(FAR * bandwidth),
        hub,
        wanted=[i for i, motion in enumerate(live) if motion in motions],
        bandwidth=bandwidth,
        undamped=spec.undamped_ratio,
    )


def _first(data: ModalData, counts: dict[str, int]) -> tuple[int, ...]:
    """Numbers of the first modes of each port."""
    numbers: list[int] = []
    for port, count in counts.items():
        own = [k + 1 for k, b in enumerate(data.belongs) if b == port]
        if len(own) < count:
            raise InputError(
                f"modes.{port} = {count}, but only {len(own)} of the imported modes move mainly in "
                f"{port}; ask for fewer, or import more modes."
            )
        numbers += own[:count]
    return tuple(sorted(numbers))


# -- the chain -------------------------------------------------------------------------------------
def _build(case: ImportedCase, *, coupled: bool) -> tuple[Built, MassLine]:
    """The chain, and the mass it is cut from:
    what the file leaves open of it lies farther out where that saves hinges, or is needed."""
    saves = coupled and not case.data.states_line
    reasons: dict[int, RealisationError] = {}
    for most_added, power in product((0, MOST_ADDED) if saves else (MOST_ADDED,), POWERS):
        try:
            line = _roomy(case.data.line(power), case.selected)
            if coupled:
                return _couple_ports(case, line, most_added), line
            return _separate(case, line), line
        except RealisationError as error:
            reasons.setdefault(most_added, error)
        except InputError:
            if power == 0:
                raise
    departing = next((step for step in case.data.steps if _departs(step)), None)
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


def _separate(case: ImportedCase, line: MassLine) -> Built:
    """Ports that are independent, each with its own modes."""
    spec = case.spec
    data = case.data
    kept = case.selected
    targets = (
        {port: kept.port(port, own=True) for port in PORTS if port in kept.belongs}
        if kept.modes
        else {}
    )
    same_planes(targets, kept.tolerance)
    target = case.target
    if target == "hub" and case.hub is None:
        raise InputError('target = "hub" needs the hub; add root.hub, or use target = "clamped".')
    whole = (
        {port: data.port(port, own=True) for port in targets} if target in ("free", "hub") else {}
    )

    hubs = {port: port_hub_mass(case.carrier, port) for port in targets}

    def target_of(port: str, count: int) -> PortModel:
        if target == "clamped":
            return targets[port].truncated(count)
        return whole[port].reduced(count, hubs[port]).replaced(damping=whole[port].damping[:count])

    counts = {port: model.modes for port, model in targets.items()}
    wishes = Wishes(
        spec.fit.springs,
        _per_mode(spec, kept),
        spec.fit.cuts,
        left_out={port: case.left_out((port,)) for port in targets},
        band=case.fillers_above,
        neutral=target != "clamped",
    )
    return build_exact(line, counts, target_of, wishes)


def _per_mode(spec: Spec, kept: ModalData) -> bool:
    """Whether each mode takes a tendon: for damping of its own, or to be exact in time."""
    timed = (
        spec.exact_step > 0.0 and SCHEMES[spec.integrator].exact and spec.fit.springs != "hinges"
    )
    damped = bool(np.any(kept.damping > 0.0)) and (
        spec.damping is None or spec.damping.form == "modal"
    )
    return damped or timed or spec.sensors.modes


def _couple_ports(case: ImportedCase, line: MassLine, most_added: int) -> Built:
    """Modes that couple ports, on one cut, with up to `most_added` hinges beyond the fewest."""
    spec, kept = case.spec, case.selected
    if spec.fit.springs == "hinges":
        raise InputError(
            'fit.springs = "hinges" needs ports that are independent, but these modes couple them; '
            'use fit.springs = "auto".'
        )
    _check_body(kept)
    if case.target != "clamped":
        live = list(kept.live)
        hub = case.carrier[np.ix_(live, live)]
        reduced = case.data.space().reduced(kept.modes, hub)
        with_modes(reduced, kept.modes, " and ".join(case.coupled_ports))
        rows = np.zeros((kept.modes, 6))
        rows[:, live] = reduced.participation
        kept = replace(kept, frequencies=reduced.frequencies, participation=rows, tip=None)
    damping = kept.damping if _per_mode(spec, kept) else np.zeros(kept.modes)
    groups: list[ModeGroup] = []
    for ports in kept.groups:
        parts = kept.parts[:, [PORTS.index(port) for port in ports]]
        own = np.flatnonzero([port in ports for port in kept.belongs])
        weights = {port: float(np.sum(parts[own, i] ** 2)) for i, port in enumerate(ports)}
        numbers = tuple(range(1, own.size + 1)) if len(ports) == 1 else tuple((own + 1).tolist())
        rows = kept.participation[own] @ group_motion(ports)
        mass = group_motion(ports).T @ kept.rigid_mass @ group_motion(ports)
        groups.append(
            ModeGroup(
                ports,
                kept.frequencies[own],
                rows,
                damping[own],
                numbers=numbers,
                weights=weights,
                rigid=mass,
                left_out=case.left_out(ports),
                band=case.fillers_above,
                neutral=case.target != "clamped",
            )
        )
    chain, how, cut = cut_chain(line, groups, spec.fit.cuts, most_added=most_added)
    alive = [
        port
        for port in PORTS
        if np.all(np.diag(PORT_MOTION[port].T @ kept.rigid_mass @ PORT_MOTION[port]) > 0.0)
    ]
    targets = {port: model for port in alive if (model := _visible_modes(kept, port)).modes}
    return Built(
        chain, targets, Status(True, f"exact chain ({how}), {kept.modes} modes kept."), cut
    )


def _check_body(data: ModalData) -> None:
    """The rigid mass matrix is a rigid body's, to the precision of the print."""
    miss = body_departure(data.rigid_mass)
    # `settle_rigid_mass` moves an entry and an eigenvalue by up to `least` each; a comparison has
    # two entries
    least = min(planes.ROUNDING * data.precision, planes.PRINTED)
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
