"""What a fit of a beam starts from: the whole beam, what of it is kept, and the chain for that."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs

from beamchain.chain.build import Built, Wishes, build_exact
from beamchain.chain.chain import Chain
from beamchain.chain.cut import Cut
from beamchain.chain.tendons import ModeGroup, joint_damping
from beamchain.engine.bench import Measured
from beamchain.errors import InputError, RealisationError
from beamchain.fitting.choose import Plan, further_columns, make_plan, whole_beam
from beamchain.fitting.hub import port_hub_mass
from beamchain.fitting.needs import Choice, Promise
from beamchain.fitting.options import Damping, Scene
from beamchain.fitting.spec import Spec
from beamchain.fitting.warnings import doubtful, fit_warnings
from beamchain.mjcf.write import check_hub
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.limits import StepLimits
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine

# residual over rigid mass: free frequencies are good to about 1e-16 over it (measured)
LIGHTEST = 1e-9


@dataclass(frozen=True, eq=False)
class BeamCase:
    """A beam, port by port: all modes that were computed, and the plan of those that are kept."""

    spec: Spec
    whole: Mapping[str, PortModel]
    plan: Plan
    live: tuple[int, ...] = tuple(range(6))

    @property
    def target(self) -> str:
        """The root's boundary condition whose modes are kept: "clamped", "free" or "hub"."""
        return self.plan.target

    @property
    def choice(self) -> Choice | None:
        """How the scene decided; None where the modes are stated."""
        return self.plan.choice

    @property
    def promise(self) -> Promise | None:
        """The in-band error on the hub, where the scene states a bandwidth."""
        return self.plan.promise

    @property
    def kept(self) -> Mapping[str, int]:
        """Number of modes per port that is flexible."""
        return self.plan.kept

    @property
    def blocks(self) -> tuple[tuple[str, ...], ...]:
        """Ports that the bench frees; a planar boom is tested as the paper does."""
        return (("xy",),) if tuple(self.kept) == ("xy",) else tuple((port,) for port in PORTS)

    def fallback(self) -> None:
        """A beam has no other modes to try."""

    def build(self) -> tuple[Built, MassLine]:
        """The chain, and how the beam's mass lies along x."""
        return damp_chain(self.spec, self.plan, self.spec.beam), self.spec.beam.line

    def full(self, ports: Mapping[str, PortModel]) -> dict[str, PortModel]:
        """Per port every mode that was computed, of those kept or not."""
        del ports
        return dict(self.whole)

    def truth(self, port: str) -> PortModel:
        """Every mode of a port, damped as asked for."""
        return self.spec.with_ratios(port, self.whole[port])

    def compared(self, measured: Measured) -> None:
        """Independent ports are compared one by one."""
        del measured

    def cautions(
        self,
        measured: Measured,
        targets: Mapping[str, PortModel],
        chain: Chain,
        limits: StepLimits,
    ) -> tuple[str, ...]:
        """What to know before the file is used."""
        achieved = {port: measured.ports[port] for port in targets}
        return (
            *fit_warnings(self.spec, measured, achieved, chain, limits),
            *doubtful(self.spec.segment, self.spec.damping, targets),
        )


def beam_case(spec: Spec) -> BeamCase:
    """The case of a beam, with the modes that are stated or that its scene needs."""
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
    whole = whole_beam(spec, spec.beam)
    return BeamCase(spec, whole, make_plan(spec, whole, spec.beam.rigid_mass(), hub))


def on_modes(spec: Spec, *, wanted: bool = False) -> Spec:
    """The spec with springs on modal tendons where its modes are uncertain,
    or where that is wanted anyway."""
    if spec.fit.springs == "auto" and (
        wanted or (spec.uncertain is not None and spec.uncertain.modal)
    ):
        return structs.replace(spec, fit=structs.replace(spec.fit, springs="modes"))
    return spec


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
        # at further ports the static responses that are kept are all that is left out
        left_out={} if spec.further else _left_out(plan),
        band=_band(spec, plan),
        neutral=plan.target != "clamped",
    )
    return build_exact(beam.line, kept, target_of, wishes)


def _left_out(plan: Plan) -> dict[str, ModeGroup]:
    """Per port the modes beyond those kept, for which fillers stand."""
    return {
        port: ModeGroup((port,), whole.frequencies[n:], whole.participation[n:], np.zeros(0))
        for port, n in plan.kept.items()
        if (whole := plan.full[port]).modes > n
    }


def _band(spec: Spec, plan: Plan) -> float:
    """The scene's bandwidth, or the last kept frequency on the hub, of a free target on none,
    whichever is higher; 0 where neither is stated [rad/s]."""
    stated = None if spec.root.hub is None else spec.root.hub.mass_matrix()
    hub = np.zeros((6, 6)) if plan.target == "free" else stated
    bandwidth = (spec.scene or Scene()).bandwidth or 0.0
    if hub is None:
        return bandwidth
    kept = {port: plan.full[port].truncated(count) for port, count in plan.kept.items()}
    coupled = (model.last_on_hub(port_hub_mass(hub, port)) for port, model in kept.items())
    return max((bandwidth, *coupled))


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
