"""What MuJoCo read back, compared with what was asked for: a fit is put together here,
whatever it started from."""

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from beamchain.chain.build import Built
from beamchain.chain.chain import Chain
from beamchain.engine.bench import Measured
from beamchain.fitting.choose import ledger, verdict
from beamchain.fitting.hub import port_hub_mass
from beamchain.fitting.needs import Choice
from beamchain.fitting.options import Scene
from beamchain.fitting.result import Fit, InSpace
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import Comparison, compare, in_band_error
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, Array
from beamchain.steps.limits import StepLimits, coupled_limits
from beamchain.structure.mass_line import MassLine


def step_limits(chain: Chain, motion: PortModel, hub: Array | None) -> StepLimits:
    """Largest stable steps of a written chain;
    `motion` and `hub` (None: alone) in the same motions of the root."""
    damped, sprung = (
        any(getattr(t, kind) > 0.0 for t in chain.tendons) for kind in ("damping", "stiffness")
    )
    return coupled_limits(motion, hub, tendon=damped, sprung=sprung)


def assess_fit(
    spec: Spec,
    built: Built,
    measured: Measured,
    limits: StepLimits,
    clock: list[float],
    *,
    full: dict[str, PortModel],
    truth: Mapping[str, PortModel],
    achieved: Mapping[str, PortModel],
    kept: Mapping[str, int],
    kept_for: str,
    choice: Choice | None,
    promise: float | None,
    cautions: tuple[str, ...],
    line: MassLine | None = None,
    space: InSpace | None = None,
) -> Fit:
    """The fit of a chain that was measured: errors per port, verdict, and what was left out.

    `clock`: times at which modelling, realising, writing and verifying began [s]; `truth`: per
    port all modes, damped as asked for; `achieved`: read back, with damping that can be
    compared with it; `kept`: modes that are kept per port, where the targets hold more. The
    others are fields of `Fit`.
    """
    scene = spec.scene or Scene()
    hub = None if spec.root.hub is None else spec.root.hub.mass_matrix()
    bandwidth: dict[str, float] = {}
    error: dict[str, Comparison] = {}
    for port, target in built.targets.items():
        modes = min(kept.get(port, target.modes), target.modes)
        bandwidth[port] = scene.bandwidth or float(target.frequencies[modes - 1])
        carrier = None if hub is None else port_hub_mass(hub, port)
        whole = measured.coupled
        made = achieved[port] if whole is None else whole.seen(PORT_MOTION[port])
        in_band = in_band_error(made, truth[port], carrier, bandwidth[port])
        plain = compare(measured.ports[port], target.truncated(modes))
        error[port] = replace(plain, accelerance_in_band=in_band)
    clock.append(time.perf_counter())
    return Fit(
        spec=spec,
        chain=built.chain,
        full=full,
        target=built.targets,
        achieved={port: measured.ports[port] for port in built.targets},
        error=error,
        measured=measured,
        limits=limits,
        status=verdict(spec, built.status, promise),
        seconds=dict(
            zip(("model", "realise", "write", "verify"), np.diff(clock).tolist(), strict=True)
        ),
        bandwidth=bandwidth,
        kept_for=kept_for,
        choice=choice,
        promise=promise,
        cut=built.cut,
        left_out=ledger(spec, choice, bool(built.chain.tendons)),
        cautions=cautions,
        line=line,
        space=space,
    )
