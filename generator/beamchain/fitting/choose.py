"""From a spec to what is kept: the modes the user stated, or the fewest that the scene needs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs

from beamchain.chain.build import Status
from beamchain.errors import InputError
from beamchain.fitting.hub import port_hub_mass
from beamchain.fitting.needs import (
    AXES,
    FAR,
    MOST,
    Candidates,
    Choice,
    LeftOut,
    Promise,
    Reduce,
    choose,
    with_polar_inertia,
)
from beamchain.fitting.options import Modes
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import keeps_tolerance, tolerance_statement, with_damping
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.beam import Beam

TOO_MANY = 2000  # modes below the bandwidth that are looked through
REFERENCE_MODES = 40  # most modes of the whole beam that are converged for a scene


@dataclass(frozen=True, eq=False)
class Plan:
    """What the chain shall keep: modes per port that has any, for a target "clamped",
    "free" or "hub".

    `full`: the whole appendage per port; `reduce`: model of (target, port, modes); `choice`: how
    the scene decided, None where the spec states the modes; `promise`: the in-band error in space,
    where the scene states a bandwidth.
    """

    kept: dict[str, int]
    target: str
    full: Mapping[str, PortModel]
    reduce: Reduce
    choice: Choice | None
    promise: Promise | None


def whole_beam(spec: Spec, beam: Beam) -> dict[str, PortModel]:
    """Per port the whole beam: the ports kept,
    or for a scene all in which the appendage is flexible."""
    stations = list(spec.further.values())
    if not spec.chooses:
        return {port: beam.port(port, 2 * count + 4, stations) for port, count in spec.kept.items()}
    assert spec.scene is not None
    assert spec.scene.bandwidth is not None
    out: dict[str, PortModel] = {}
    for port in PORTS:
        count = _modes_below(beam, port, spec.scene.bandwidth)
        if count > TOO_MANY:
            raise InputError(
                f"scene.bandwidth = {spec.scene.bandwidth!r} rad/s lies above some {count:.3g} "
                f"modes of the appendage in {port}, where {TOO_MANY} can be looked through; lower "
                "it, or check the appendage's sizes and units."
            )
        try:
            model = beam.port(port, 2 * MOST, stations)
        except InputError:
            continue  # rigid there
        inside = int(np.sum(model.frequencies <= FAR * spec.scene.bandwidth))
        if inside > 2 * MOST:
            model = beam.port(port, min(inside, REFERENCE_MODES), stations)
        out[port] = model
    return out


def _modes_below(beam: Beam, port: str, omega: float) -> float:
    """About how many modes of a port lie below `omega` [rad/s]: half waves along the appendage."""
    waves = 0.0
    for segment in beam.segments:
        at = segment.at(np.array([0.5]))
        stiffness, inertia, power = {
            "xy": (at.bending_xy, at.mass, 0.25),
            "xz": (at.bending_xz, at.mass, 0.25),
            "torsion": (at.torsion, at.polar, 0.5),
            "axial": (at.axial, at.mass, 0.5),
        }[port]
        if np.all(stiffness > 0.0):
            waves += (
                segment.length * float((inertia / stiffness)[0]) ** power * omega ** (2.0 * power)
            )
    return waves / float(np.pi)


def everything(spec: Spec) -> Spec:
    """The spec with every port kept.

    All cantilever modes up to three times the scene's bandwidth, one to five each and no fewer than
    the scene needs; of imported modes all.
    """
    if not spec.chooses or spec.scene is None or spec.scene.bandwidth is None:
        raise InputError(
            "nothing is left out without scene.bandwidth; give [scene] bandwidth, or state [modes]."
        )
    if spec.imported is not None:
        every = tuple(range(1, spec.imported.read().modes + 1))
        return structs.replace(
            spec, imported=structs.replace(spec.imported, modes=every), modes=None
        )
    full = whole_beam(spec, spec.beam)
    hub = None if spec.root.hub is None else spec.root.hub.mass_matrix()
    needed = make_plan(spec, full, spec.beam.rigid_mass(), hub).kept
    counts = {
        port: max(
            needed.get(port, 0),
            int(np.clip(np.sum(model.frequencies <= 3.0 * spec.scene.bandwidth), 1, 5)),
        )
        for port, model in full.items()
    }
    return structs.replace(spec, modes=Modes(**counts))


def further_columns(spec: Spec) -> tuple[int, ...]:
    """Where the further points' motion stands in a port model's `tip`: 0 the tip,
    then the stations in order of x."""
    ordered = sorted(spec.further.values())
    return tuple(0 if name == "tip" else 1 + ordered.index(x) for name, x in spec.further.items())


def make_plan(
    spec: Spec, full: Mapping[str, PortModel], rigid_mass: Array, hub: Array | None
) -> Plan:
    """Decide what is kept of `full`, the whole beam per port; `rigid_mass`,
    `hub` `(6, 6)` about the root."""

    columns = further_columns(spec)

    def reduce(target: str, port: str, count: int) -> PortModel:
        model = full[port]
        if columns and count:
            m = model.motions
            return model.attached(count, [m * c + i for c in columns for i in range(m)])
        return model.for_target(target, count, None if hub is None else port_hub_mass(hub, port))

    scene, wanted = spec.scene, spec.root.target
    promise = None
    whole: dict[str, PortModel] = {}
    if scene is not None and scene.bandwidth is not None:
        far = FAR * scene.bandwidth
        whole = {
            port: with_damping(spec.with_ratios(port, model), spec.undamped_ratio).condensed(far)
            for port, model in full.items()
        }
        exact = model_in_space(whole, with_polar_inertia(rigid_mass))
        wanted_motions = {AXES[axis] for axis in scene.axes}
        promise = Promise(exact, hub, sorted(wanted_motions), scene.bandwidth, spec.undamped_ratio)
    for port, count in ({} if spec.modes is None else spec.modes.given()).items():
        if port in full and count > full[port].modes:
            raise InputError(
                f"modes.{port} = {count}, but the appendage has only {full[port].modes} there; ask "
                "for fewer."
            )
    if not spec.chooses or promise is None or scene is None:
        return Plan(dict(spec.kept), wanted or "clamped", full, reduce, None, promise)
    free = ["clamped", "free"] if hub is None else ["clamped", "hub", "free"]
    free = free[:1] if columns else free
    targets = free if wanted in (None, "auto") else [str(wanted)]
    fixed = {} if spec.modes is None else spec.modes.given()
    rigid = [port for port, count in fixed.items() if count and port not in full]
    if rigid:
        raise InputError(
            f"modes.{rigid[0]} = {fixed[rigid[0]]} but the appendage is rigid there; set it to 0."
        )

    def reduced(target: str, port: str, count: int) -> PortModel:
        return spec.with_ratios(port, reduce(target, port, count))

    frequencies = {port: model.frequencies for port, model in full.items()}
    candidates = Candidates(whole, frequencies, reduced)
    choice = choose(promise, candidates, targets, scene.tolerance, fixed, scene.tip)
    return Plan(
        {port: n for port, n in choice.modes.items() if n},
        choice.target,
        full,
        reduce,
        choice,
        promise,
    )


def verdict(spec: Spec, status: Status, promise: float | None) -> Status:
    """The build's status, and whether the scene's promise holds as measured."""
    if promise is None or spec.scene is None:
        return status
    tolerance = spec.scene.tolerance
    bandwidth = spec.scene.bandwidth
    said = f"in-band error of the hub up to {bandwidth:g} rad/s: {promise:.2e}"
    if keeps_tolerance(promise, tolerance):
        ok = status.ok or spec.chooses  # the promise is what a scene asks for, however it is kept
        return replace(
            status,
            ok=ok,
            message=f"{status.message} {said}, {tolerance_statement(promise, tolerance)}.",
        )
    said += f", {tolerance_statement(promise, tolerance)}: the best model is written."
    return replace(status, ok=False, message=f"{status.message} {said}")


def ledger(spec: Spec, choice: Choice | None, tendons: bool) -> tuple[LeftOut, ...]:
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
