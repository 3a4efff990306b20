"""What MuJoCo read back, compared with what was asked for: a fit is put together here,
whatever it started from."""

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol, Self

import numpy as np

from beamchain.chain.build import Built
from beamchain.chain.chain import Chain
from beamchain.engine.bench import Measured
from beamchain.fitting.choose import ledger, verdict
from beamchain.fitting.hub import default_hub, port_hub_mass
from beamchain.fitting.needs import Choice, Promise
from beamchain.fitting.options import Scene
from beamchain.fitting.result import Fit, InSpace
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import Comparison, compare, in_band_error
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.steps.limits import StepLimits, coupled_limits
from beamchain.structure.mass_line import MassLine

EMPTY = 1e-5  # residual mass at the root below which the free appendage has no fastest mode
SAME_MASS = 1e-9  # relative, beyond which the chain's rigid mass is said to differ


class Case(Protocol):
    """What a fit starts from: an appendage with every mode, and those that its chain shall keep.

    A beam (`fitting.beam_case`) or imported modes (`fitting.imported`).
    """

    @property
    def spec(self) -> Spec:
        """The specification."""
        ...

    @property
    def target(self) -> str:
        """The root's boundary condition whose modes are kept: "clamped", "free" or "hub"."""
        ...

    @property
    def choice(self) -> Choice | None:
        """How the scene decided; None where the modes are stated."""
        ...

    @property
    def promise(self) -> Promise | None:
        """The in-band error on the hub, where the scene states a bandwidth."""
        ...

    @property
    def kept(self) -> Mapping[str, int]:
        """Number of modes per port whose target holds more than those."""
        ...

    @property
    def live(self) -> tuple[int, ...]:
        """Motions in which the appendage has inertia (0 to 5)."""
        ...

    @property
    def blocks(self) -> tuple[tuple[str, ...], ...]:
        """Ports that the bench frees; those that modes or mass couple stand together."""
        ...

    def build(self) -> tuple[Built, MassLine]:
        """The chain, and how its mass lies along x."""
        ...

    def fallback(self) -> Self | None:
        """The case that is tried where this one has no chain."""
        ...

    def full(self, ports: Mapping[str, PortModel]) -> dict[str, PortModel]:
        """Per port all modes that are known."""
        ...

    def truth(self, port: str) -> PortModel:
        """The same of one port, damped as asked for."""
        ...

    def compared(self, measured: Measured) -> InSpace | None:
        """The comparison in all motions at once, where modes may couple ports."""
        ...

    def cautions(
        self,
        measured: Measured,
        targets: Mapping[str, PortModel],
        chain: Chain,
        limits: StepLimits,
    ) -> tuple[str, ...]:
        """What to know before the file is used."""
        ...


def step_limits(chain: Chain, motion: PortModel, hub: Array | None) -> StepLimits:
    """Largest stable steps of a written chain;
    `motion` and `hub` (None: alone) in the same motions of the root."""
    damped, sprung = (
        any(getattr(t, kind) > 0.0 for t in chain.tendons) for kind in ("damping", "stiffness")
    )
    return coupled_limits(motion, hub, tendon=damped, sprung=sprung)


def assess_fit(
    case: Case,
    built: Built,
    measured: Measured,
    clock: list[float],
    line: MassLine,
) -> Fit:
    """The fit of a chain that was measured: errors per port, verdict, and what was left out.

    `clock`: times at which modelling, realising, writing and verifying began [s]; `line`: how the
    chain's mass lies along x.
    """
    spec = case.spec
    hub = None if spec.root.hub is None else spec.root.hub.mass_matrix()
    status = built.status
    space = case.compared(measured)
    if space is not None and case.target == "clamped":  # another target has modes of its own
        status = status.adding(f"Kept: {space.kept_words}.")
    if space is not None and space.error.mass_error > SAME_MASS:
        status = status.adding(
            "The rigid mass matrix of the file departs from that of a rigid body by "
            f"{space.error.mass_error:.1e}."
        )
    motion = measured.motion
    carrier = hub
    if hub is None and not line.exact and _is_empty(motion):
        # alone such an appendage has a root without mass, whose fastest mode lies at infinity
        carrier = default_hub(line).mass_matrix()
        status = status.adding(
            "Step limits: on ten times its mass, as its root has none of its own."
        )
    live = np.ix_(case.live, case.live)
    limits = step_limits(built.chain, motion, None if carrier is None else carrier[live])
    bandwidth, error = _port_errors(case, built, measured, hub)
    promise = None
    if case.promise is not None:
        promise = case.promise.error(measured.damped_motion)
    clock.append(time.perf_counter())
    return Fit(
        spec=spec,
        chain=built.chain,
        full=case.full(built.targets),
        target=built.targets,
        achieved={port: measured.ports[port] for port in built.targets},
        readback_error=error,
        measured=measured,
        limits=limits,
        status=verdict(spec, status, promise),
        seconds=dict(
            zip(("model", "realise", "write", "verify"), np.diff(clock).tolist(), strict=True)
        ),
        bandwidth=bandwidth,
        kept_for=case.target,
        choice=case.choice,
        promise=promise,
        cut=built.cut,
        left_out=ledger(spec, case.choice, bool(built.chain.tendons)),
        cautions=case.cautions(measured, built.targets, built.chain, limits),
        line=line,
        space=space,
    )


def _is_empty(motion: PortModel) -> bool:
    """Whether the modes leave no mass at the root in some direction."""
    scale = np.sqrt(np.diag(motion.rigid_mass))
    residual = motion.residual_mass / np.outer(scale, scale)
    return bool(np.linalg.eigvalsh(residual)[0] < EMPTY)


def _port_errors(
    case: Case, built: Built, measured: Measured, hub: Array | None
) -> tuple[dict[str, float], dict[str, Comparison]]:
    """Per port the band [rad/s], and the comparison of what was read back with its target;
    in band with the whole appendage on `hub` `(6, 6)`."""
    scene = case.spec.scene or Scene()
    bandwidth: dict[str, float] = {}
    error: dict[str, Comparison] = {}
    for port, target in built.targets.items():
        modes = min(case.kept.get(port, target.modes), target.modes)
        bandwidth[port] = scene.bandwidth or float(target.frequencies[modes - 1])
        carrier = None if hub is None else port_hub_mass(hub, port)
        undamped = case.spec.undamped_ratio
        made = measured.damped_port(port)
        in_band = in_band_error(made, case.truth(port), carrier, bandwidth[port], undamped=undamped)
        plain = compare(measured.ports[port], target.truncated(modes))
        error[port] = replace(plain, accelerance_in_band=in_band)
    return bandwidth, error
