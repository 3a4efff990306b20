"""What MuJoCo read back, compared with what was asked for: a fit is put together here,
whatever it started from."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from beamchain.chain.build import Built
from beamchain.chain.chain import Chain
from beamchain.engine.bench import Measured
from beamchain.fitting.body import Body
from beamchain.fitting.hub import default_hub
from beamchain.fitting.kept import Choice, Kept, LeftOut
from beamchain.fitting.options import Scene
from beamchain.fitting.realise import why
from beamchain.fitting.result import Fit, InSpace
from beamchain.fitting.slosh import heavy, weightless
from beamchain.fitting.spec import Spec
from beamchain.fitting.warnings import doubtful, fit_warnings, imported_warnings
from beamchain.ports.compare import Comparison, compare, in_band_error
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.steps.limits import StepLimits, coupled_limits
from beamchain.structure.mass_line import MassLine

EMPTY = 1e-5  # residual mass at the root below which the free appendage has no fastest mode


def step_limits(chain: Chain, motion: PortModel, hub: Array | None) -> StepLimits:
    """Largest stable steps of a written chain;
    `motion` and `hub` (None: alone) in the same motions of the root."""
    damped, sprung = (
        any(getattr(t, kind) > 0.0 for t in chain.tendons) for kind in ("damping", "stiffness")
    )
    return coupled_limits(motion, hub, tendon=damped, sprung=sprung)


def assess_fit(
    body: Body, kept: Kept, built: Built, line: MassLine, measured: Measured, clock: list[float]
) -> Fit:
    """The fit of a chain that was measured: errors per port, and what was left out.

    `line`: how the chain's mass lies along x; `clock`: times at which modelling, realising, writing
    and verifying began [s].
    """
    spec, hub = body.spec, body.hub
    motion = measured.motion
    loaded = default_hub(line).mass_matrix() if hub is None and needs_hub(line, motion) else hub
    live = np.ix_(body.live, body.live)
    limits = step_limits(built.chain, motion, None if loaded is None else loaded[live])
    bandwidth, error = _port_errors(body, kept, built, measured)
    promise = None if body.promise is None else body.promise.error(measured.damped_motion)
    clock.append(time.perf_counter())
    return Fit(
        spec=spec,
        chain=built.chain,
        body=body,
        kept=kept.of_chain(built.targets),
        target=built.targets,
        achieved={port: measured.ports[port] for port in built.targets},
        readback_error=error,
        measured=measured,
        limits=limits,
        how=built.how,
        missing=built.missing,
        history=built.history,
        seconds=dict(
            zip(("model", "realise", "write", "verify"), np.diff(clock).tolist(), strict=True)
        ),
        bandwidth=bandwidth,
        promise=promise,
        cut=built.cut,
        left_out=_omissions(spec, kept.choice, bool(built.chain.tendons)),
        cautions=tuple(_cautions(body, kept, built, measured, limits)),
        line=line,
        space=None if body.data is None else _in_space(body, kept, measured),
    )


def _in_space(body: Body, kept: Kept, measured: Measured) -> InSpace:
    """The comparison in all motions at once, where modes may couple ports."""
    assert body.data is not None
    full, target = body.data.space(), kept.in_space(body)
    scene = body.spec.scene or Scene()
    in_band = in_band_error(
        measured.damped_motion,
        full,
        None if body.hub is None else body.hub[np.ix_(body.live, body.live)],
        scene.bandwidth or float(target.frequencies[-1]),
        undamped=body.spec.undamped_ratio,
    )
    return InSpace(
        data=body.data,
        why=why(kept),
        full=full,
        target=target,
        achieved=measured.motion,
        error=replace(compare(measured.motion, target), accelerance_in_band=in_band),
        live=body.live,
        numbers=kept.numbers,
    )


def _cautions(
    body: Body, kept: Kept, built: Built, measured: Measured, limits: StepLimits
) -> Iterator[str]:
    """What to know before the file is used."""
    spec = body.spec
    if spec.slosh is not None:
        yield weightless("nothing but the keyframe `burn` of scene.xml accelerates the tank")
        yield from heavy(spec.slosh, None if spec.root.hub is None else spec.root.hub.mass)
    elif body.data is None:
        achieved = {port: measured.ports[port] for port in built.targets}
        yield from fit_warnings(spec, measured, achieved, built.chain, limits)
        yield from doubtful(spec.segment, spec.damping, built.targets)
    else:
        units = None if spec.imported is None else spec.imported.units
        yield from doubtful((), spec.damping)
        yield from imported_warnings(body.data, kept.numbers, spec.damping, units, spec.scene)


def needs_hub(line: MassLine, motion: PortModel) -> bool:
    """Whether step limits need a hub: alone such an appendage has a root without mass in some
    direction, and its fastest mode lies at infinity."""
    if line.exact:
        return False
    scale = np.sqrt(np.diag(motion.rigid_mass))
    residual = motion.residual_mass / np.outer(scale, scale)
    return bool(np.linalg.eigvalsh(residual)[0] < EMPTY)


def _port_errors(
    body: Body, kept: Kept, built: Built, measured: Measured
) -> tuple[dict[str, float], dict[str, Comparison]]:
    """Per port the band [rad/s], and the comparison of what was read back with its target;
    in band with the whole appendage on the hub."""
    spec = body.spec
    bandwidth: dict[str, float] = {}
    error: dict[str, Comparison] = {}
    for port, target in built.targets.items():
        # static shapes of loads on further points stand behind the modes
        modes = min(kept.counts[port], target.modes) if spec.further else target.modes
        bandwidth[port] = (spec.scene or Scene()).bandwidth or float(target.frequencies[modes - 1])
        hub = body.port_hub(port)
        in_band = in_band_error(
            measured.damped_port(port),
            body.view(port),
            hub,
            bandwidth[port],
            undamped=spec.undamped_ratio,
        )
        plain = compare(measured.ports[port], target.truncated(modes))
        error[port] = replace(plain, accelerance_in_band=in_band)
    return bandwidth, error


def _omissions(spec: Spec, choice: Choice | None, tendons: bool) -> tuple[LeftOut, ...]:
    """What was left out: modes, then elements of the file."""
    scene = spec.scene
    if choice is None or scene is None:
        return ()
    why = "no damping is wanted" if spec.damping is None else 'damping.form = "hinge"'
    rest = (
        (scene.visuals, "geoms", "scene.visuals = false"),
        (
            scene.contacts,
            "contacts",
            "scene.contacts = false: geoms are massless and touch nothing",
        ),
        (scene.tip, "tip site", "scene.tip = false"),
        (tendons, "modal tendons", f"the springs stand on the hinges, {why}"),
    )
    return *choice.left_out, *(LeftOut(what, said, 0.0) for there, what, said in rest if not there)
