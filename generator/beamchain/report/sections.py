"""The sections of report.html as plain tables, pictures and sentences; the template lays them out."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamchain.assess.error import in_band_error
from beamchain.motion import Array
from beamchain.report.curves import METHODS, beam_model, chain_label, count, rival_chains, rival_model
from beamchain.report.page import Block, Lines, Picture, Pictures, Section, Table, Text, begun, inline
from beamchain.report.plots import percent, short
from beamchain.report.record import mass_record
from beamchain.report.shapes import kept_modes, shapes_svg
from beamchain.report.spec_text import spec_toml
from beamchain.spec import port_hub_mass
from beamchain.structure.beam import Beam

if TYPE_CHECKING:
    from beamchain.result import Fit

TARGETS = {
    "clamped": "clamped: the first cantilever modes, the better the heavier the hub",
    "free": "free: the first modes with nothing attached (the 2008 paper's)",
    "hub": "hub: the first modes of hub and appendage together",
    "auto": "auto: whichever needs fewest modes",
}
_EXACT = {
    "clamped": "The chain is exact with the root held; the heavier the hub, the closer the modes on it.",
    "free": "The chain is exact with nothing attached; the lighter the hub, the closer the modes on it.",
    "hub": "The chain is exact on the hub.",
}

RivalErrors = dict[str, dict[str, float]]


# -- words and numbers -----------------------------------------------------------------------------------------------
def _number(value: float) -> str:
    return f"{value + 0.0:.6g}"  # no minus before a zero


def _vector(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.5g}" for value in values)


def step_words(value: float) -> str:
    """A step, or that there is no limit."""
    return "no limit" if math.isinf(value) else f"{value:.4g}"


def _kept(fit: "Fit") -> str:
    """`first 2 modes in xy and 1 in torsion`."""
    (port, modes), *more = [(port, kept_modes(fit, port)) for port in fit.target]
    first = f"first {'mode' if modes == 1 else f'{modes} modes'} in {port}"
    parts = [first, *(f"{n} in {other}" for other, n in more)]
    return first if not more else f"{', '.join(parts[:-1])} and {parts[-1]}"


def left_out_blocks(items: Sequence[Mapping[str, Any]]) -> list[Block]:
    """The ledger as a table."""
    rows = [[str(i["what"]), str(i["why"]), percent(float(i["cost"])) if i["cost"] else "nothing"] for i in items]
    note = "Cost: relative change of the hub's motion within the band that leaving it out alone makes."
    return [Table(rows, ["left out", "why", "cost"], note=note, words=True)]


def rival_errors(fit: "Fit") -> RivalErrors:
    """Per port and rival its in-band error, computed as the chain's own."""
    out: RivalErrors = {}
    for port in fit.target:
        beam, hub = beam_model(fit, port), None if fit.hub_mass is None else port_hub_mass(fit.hub_mass, port)
        out[port] = {
            label: in_band_error(rival_model(fit, port, chain), beam, hub, fit.bandwidth[port])
            for label, chain in rival_chains(fit, port).items()
        }
    return out


class Verdict(NamedTuple):
    """The report in one sentence, and whether all that was asked for was reached."""

    good: bool
    sentence: str


def verdict(fit: "Fit", rivals: RivalErrors) -> Verdict:
    """What to tell somebody who reads one sentence."""
    if not fit.error:
        return _rigid_verdict(fit)
    frequency = max(error.frequency for error in fit.error.values())
    errors = {port: error.accelerance_in_band or 0.0 for port, error in fit.error.items()}
    worst = max(errors, key=lambda port: errors[port])
    links = sum(link.mass > 0.0 for link in fit.chain.links)
    what = f"{count(links, 'rigid link')} on {count(len(fit.chain.hinges), 'hinge')} stand for the beam's {_kept(fit)}"
    if fit.space is not None:
        what = what.replace("the beam's", "the imported modes:")
    hub = "the hub of the spec" if fit.hub_mass is not None else "a hub of 0.1, 1 or 10 times the appendage's mass"
    scene = fit.spec.scene
    promised = fit.promise is not None and scene is not None and scene.bandwidth is not None
    error = fit.promise if promised and fit.promise is not None else errors[worst]
    band = scene.bandwidth if promised and scene is not None and scene.bandwidth else fit.bandwidth[worst]
    text = f"{what}: the motion of {hub} is off by at most {percent(error)} up to {short(band)} rad/s"
    classical = None if promised else rivals[worst].get(METHODS["classical"])
    if classical is not None:
        text += f" (classical chain with as many hinges: {percent(classical)})"
    missed = scene is not None and error > scene.tolerance
    if scene is not None and missed:
        text += f", more than the tolerance of {percent(scene.tolerance)}"
    if (tip := fit.tip_told) is not None:
        text += f"; {tip}"
    text += f". Read back through MuJoCo the kept frequencies are within {percent(frequency)} of what was asked for"
    if not fit.status.ok:
        return Verdict(False, f"Less than was asked for: {fit.status.message.rstrip('.')}. {text}.")
    return Verdict(not missed, f"{text}.")


def _rigid_verdict(fit: "Fit") -> Verdict:
    """The sentence of an appendage that the scene needs no mode of."""
    scene = fit.spec.scene
    text = "One rigid body stands for the appendage"
    if scene is not None and scene.bandwidth is not None and fit.promise is not None:
        text += f": the motion of the hub is off by at most {percent(fit.promise)} up to {short(scene.bandwidth)} rad/s"
    less = "" if fit.status.ok else f"Less than was asked for: {fit.status.message.rstrip('.')}. "
    return Verdict(fit.status.ok, f"{less}{text}.")


def all_sections(
    fit: "Fit", pictures: Pictures, rivals: RivalErrors, left_out: Sequence[Mapping[str, Any]]
) -> list[Section]:
    """The page from top to bottom.

    Args:
        fit: what is told.
        pictures: SVG texts by file name.
        rivals: from `rival_errors`.
        left_out: what the scene does not need, as in fit.json.
    """
    out = [
        Section("What was asked", _asked(fit)),
        Section("At the root, over frequency", _accelerances(fit, pictures)),
        Section("Modes kept, and what MuJoCo makes of them", [mode_table(fit, port) for port in fit.target]),
        Section("Against the whole beam", _against_beam(fit, rivals, pictures)),
        Section("Mass, centre, inertia", [_mass(fit)]),
        Section("The chain", _chain(fit, pictures)),
        Section("Time steps", _steps(fit)),
    ]
    if shapes := shape_blocks(fit):
        out.insert(3, Section("Shapes of the modes kept", shapes))
    if fit.warnings:
        out.append(Section("Before you use it", [Lines([begun(text, {fit.spec.name}) for text in fit.warnings])]))
    if left_out:
        out.append(Section("Left out", left_out_blocks(left_out)))
    out += [Section("How it went", _history(fit)), Section("To reproduce", _reproduce(fit))]
    return [section for section in out if section.blocks]  # of a rigid body there is nothing to compare


# -- the sections ----------------------------------------------------------------------------------------------------
def _asked(fit: "Fit") -> list[Block]:
    spec, beam = fit.spec, fit.mass_line
    if isinstance(beam, Beam):
        carried = [count(len(beam.segments), "segment")]
        carried += [count(len(beam.joints), "compliant joint")] if beam.joints else []
        carried += [count(len(beam.lumps), "lumped body").replace("bodys", "bodies")] if beam.lumps else []
    else:
        carried = [f"imported from {spec.imported.file}" if spec.imported is not None else "imported"]
    asked = ", ".join(f"{n} in {port}" for port, n in spec.kept.items()) or "as imported"
    if fit.choice is not None:
        asked = "as few as the scene needs"
        if spec.modes is not None and spec.modes.given():
            asked += "; " + ", ".join(f"{n} in {port}" for port, n in spec.modes.given().items()) + " as given"
    rows = [
        ("appendage", f"{short(beam.length)} m long, {short(float(beam.rigid_mass()[0, 0]))} kg: {', '.join(carried)}"),
        ("modes to keep", asked),
        ("method", spec.fit.method),
        ("target", TARGETS[fit.kept_for]),
        ("hub", "none given" if spec.root.hub is None else _hub(fit)),
        ("band", "; ".join(f"{port} up to {_number(band)} rad/s" for port, band in fit.bandwidth.items())),
    ]
    if spec.damping is not None:
        form = "a tendon per mode" if spec.damping.form == "modal" else "plain joint damping"
        given = spec.damping.ratio
        ratios = "; ".join(f"{k} {_vector(v)}" for k, v in given.items()) if isinstance(given, dict) else f"{given:g}"
        rows.append(("damping", f"ratio {ratios}, as {form}"))
    if spec.payload is not None:
        rows.append(("payload", f"{short(spec.payload.mass)} kg at the tip, attached by the scene"))
    if spec.scene is not None:
        scene = spec.scene
        rows.append(("scene", f"{scene.integrator}, step {scene.step:g} s, tolerance {scene.tolerance:g}"))
    return [Table(rows, words=True)]


def _hub(fit: "Fit") -> str:
    hub = fit.spec.root.hub
    assert hub is not None
    text = f"{short(hub.mass)} kg, inertia {_vector(hub.inertia)} kg m² about its centre"
    return text if not any(hub.offset) else f"{text}, root at {_vector(hub.offset)} m from it"


def _accelerances(fit: "Fit", pictures: Pictures) -> list[Block]:
    blocks: list[Block] = []
    for port in fit.target:
        label = (
            f"Accelerance of the root in {port} over frequency: the beam, the chain through MuJoCo, and other chains."
        )
        caption = (
            f"Port {port}: acceleration of the free root per wrench on it, magnitude and phase, undamped. Where "
            "blue has a black core, chain and beam agree; the shaded band is the one kept."
        )
        blocks.append(Picture(inline(pictures[f"accelerance_{port}.svg"], label), caption, "zoom"))
    return blocks


def mode_table(fit: "Fit", port: str) -> Table:
    """Modes of a port: asked for, read back through MuJoCo, how far off."""
    target, achieved, error = fit.target[port], fit.achieved[port], fit.error[port]
    ratios, tip = bool(np.any(target.damping > 0.0) or np.any(achieved.damping > 0.0)), fit.tip_error.get(port)
    head = ["mode", "target, rad/s", "target, Hz", "through MuJoCo, rad/s", "relative error"]
    head += ["participation, target", "participation, through MuJoCo", "relative error"]
    head += ["damping ratio, asked", "damping ratio, through MuJoCo"] if ratios else []
    head += ["tip motion, relative error"] if tip is not None else []
    rows: list[list[str]] = []
    order = np.argsort(error.matches[:, 1])
    for (i, j), df, dp in zip(
        error.matches[order], error.frequency_errors[order], error.participation_errors[order], strict=True
    ):
        want, have = float(target.frequencies[j]), float(achieved.frequencies[i])
        row = [str(int(j) + 1), _number(want), _number(want / (2.0 * np.pi)), _number(have), percent(df)]
        row += [_vector(target.participation[j]), _vector(achieved.participation[i]), percent(dp)]
        row += [f"{target.damping[j]:.4g}", f"{achieved.damping[i]:.4g}"] if ratios else []
        row += [percent(float(tip[j])) if j < tip.size else ""] if tip is not None else []
        rows.append(row)
    unit = {"torsion": "√(kg m²)", "axial": "√kg"}.get(port, "force √kg, moment √kg m")
    note = f"Cantilever modes, root held. Participation in {unit}."
    if fit.kept_for in ("free", "hub"):
        note += " The target keeps other modes exactly (next section); its own cantilever modes differ from the beam's."
    return Table(rows, head, caption=f"Port {port}", note=note)


def shape_blocks(fit: "Fit") -> list[Block]:
    """Per port the mode shapes, where there are any."""
    caption = (
        "Port {}: cantilever modes, mass-normalised, root on the left. Black: the beam; blue: the chain, white dots "
        "its hinges. Faster modes ring faster; the amplitude is the eye's."
    )
    drawn = {port: shapes_svg(fit, port) for port in fit.target}
    return [Picture(svg, caption.format(port), "ring") for port, svg in drawn.items() if svg]


def _against_beam(fit: "Fit", rivals: RivalErrors, pictures: Pictures) -> list[Block]:
    if not fit.error:
        return []
    labels = list(dict.fromkeys(label for found in rivals.values() for label in found))
    rows: list[list[str]] = []
    for port, error in fit.error.items():
        own = percent(error.accelerance_in_band or 0.0)
        others = [percent(rivals[port][label]) if label in rivals[port] else "" for label in labels]
        rows.append([port, f"0 to {_number(fit.bandwidth[port])}", own, *others])
    place = "On the hub of the spec." if fit.hub_mass is not None else (
        "No hub is given: the worst of three, 0.1, 1 and 10 times the appendage's rigid mass."
    )  # fmt: skip
    names = [f"{label}, as many hinges" if label == METHODS["classical"] else label for label in labels]
    if fit.promise is not None:
        place += " Each port by itself; what the scene asks of the hub counts all ports together."
    head = ["port", "band, rad/s", chain_label(fit), *names]
    blocks: list[Block] = [Table(rows, head, caption="In-band error", note=place)]
    for port in fit.target:
        label = f"Relative error of the hub's motion in {port} over frequency, for the chain and for other chains."
        caption = (
            f"Port {port}: error of the hub's motion at each frequency; its largest in the band is the in-band error."
        )
        blocks.append(Picture(inline(pictures[f"error_{port}.svg"], label), caption, "zoom"))
    blocks += [_frequencies(fit, port) for port in fit.target]
    return blocks


def _frequencies(fit: "Fit", port: str) -> Table:
    """Model error: frequencies held, free and on the hub, of the beam and of the chain in continuous time."""
    full, achieved = fit.full[port], fit.achieved[port]
    kept = min(fit.target[port].modes, achieved.modes, achieved.free_frequencies.size)
    cases = [("root held", full.frequencies, achieved.frequencies)]
    cases.append(("nothing attached", full.free_frequencies, achieved.free_frequencies))
    if fit.hub_mass is not None:
        hub = port_hub_mass(fit.hub_mass, port)
        cases.append(("on the hub", full.with_hub(hub).free_frequencies, achieved.with_hub(hub).free_frequencies))
    rows = [
        [f"{name}, mode {k + 1}", _number(exact[k]), _number(ours[k]), percent(ours[k] / exact[k] - 1.0)]
        for name, exact, ours in cases
        for k in range(min(kept, exact.size, ours.size))
    ]
    head = ["frequencies, rad/s", "beam", "chain, through MuJoCo", "model error"]
    note = "Continuous time: no integrator is in these numbers."
    if fit.spec.fit.method == "exact":
        note += " " + _EXACT.get(fit.kept_for, "")
    return Table(rows, head, caption=f"Model error in {port}", note=note)


def _mass(fit: "Fit") -> Table:
    want, have = fit.mass_line.rigid_mass(), fit.measured.rigid_mass
    target, got = mass_record(want), mass_record(have)

    def row(name: str, a: float, b: float) -> list[str]:
        return [name, _number(a), _number(b), percent(b / a - 1.0) if a else "0" if b == a else "–"]

    rows = [row("mass, kg", target["mass"], got["mass"])]
    rows += [
        row(f"centre of mass {axis}, m", a, b) for axis, a, b in zip("xyz", target["com"], got["com"], strict=True)
    ]
    inertia: tuple[Array, Array] = target["inertia"], got["inertia"]
    pairs = [(0, 0), (1, 1), (2, 2)] + [
        (i, j) for i, j in ((0, 1), (0, 2), (1, 2)) if inertia[0][i, j] or inertia[1][i, j]
    ]
    rows += [row(f"inertia {'xyz'[i]}{'xyz'[j]}, kg m²", inertia[0][i, j], inertia[1][i, j]) for i, j in pairs]
    note = "Frozen, inertia about the root; the chain's from MuJoCo's compiled bodies."
    return Table(rows, ["", "beam", "chain", "relative difference"], note=note)


def _chain(fit: "Fit", pictures: Pictures) -> list[Block]:
    label = "The chain drawn to scale along its axis, and the classical chain with as many hinges below it."
    caption = "To scale along x; the depth of the beam (grey) is exaggerated. The first link is welded to the hub."
    blocks: list[Block] = [Picture(inline(pictures["chain.svg"], label), caption)]
    rows = [
        [
            str(i),
            _number(link.start),
            _number(link.length),
            _number(link.mass),
            _number(link.com),
            _vector(link.inertia),
        ]
        for i, link in enumerate(fit.chain.links, 1)
    ]
    about = "inertia xx, yy, zz about it, kg m²"
    head = ["link", "starts at x, m", "length, m", "mass, kg", "centre of mass x, m", about]
    blocks.append(Table(rows, head, caption="Links"))
    ports = fit.chain.ports
    damped = [port for port in ports if any(port in hinge.damping for hinge in fit.chain.hinges)]
    rows = [
        [
            str(i), _number(hinge.x),
            *(_spring(hinge.stiffness.get(port)) for port in ports),
            *(_number(hinge.damping[port]) if port in hinge.damping else "" for port in damped),
        ]
        for i, hinge in enumerate(fit.chain.hinges, 1)
    ]  # fmt: skip
    head = ["hinge", "x, m", *(f"stiffness {port}, {'N/m' if port == 'axial' else 'N m/rad'}" for port in ports)]
    head += [f"damping {port}, {'N s/m' if port == 'axial' else 'N m s/rad'}" for port in damped]
    blocks.append(Table(rows, head, caption="Hinges"))
    if fit.chain.tendons:
        blocks.append(_tendons(fit))
    return blocks


def _spring(stiffness: float | None) -> str:
    return "rigid" if stiffness is None else "free" if stiffness == 0.0 else _number(stiffness)


def _tendons(fit: "Fit") -> Block:
    """The modal tendons, which hold the springs of hinges that are free."""
    names = {freedom: f"{freedom[0] + 1} {freedom[1]}" for tendon in fit.chain.tendons for freedom in tendon.freedoms}
    rows = [
        [
            tendon.label, _number(float(np.sqrt(tendon.stiffness))), _number(tendon.damping), _number(tendon.armature),
            ", ".join(f"{names[f]}: {c:.4g}" for f, c in zip(tendon.freedoms, tendon.coefficients, strict=True)),
        ]
        for tendon in fit.chain.tendons
    ]  # fmt: skip
    note = (
        "Each mode is one tendon over the hinges; its length is the coordinate of the mass-normalised cantilever mode. "
        "Fillers are the modes of hinges beyond those kept, above the band; armature tendons carry inertia alone."
    )
    head = ["tendon", "frequency, rad/s", "damping, 1/s", "armature", "coefficients, by hinge"]
    return Table(rows, head, caption="Tendons", note=note)


def _steps(fit: "Fit") -> list[Block]:
    limits, linear = fit.limits, fit.measured.linearisation
    rows: list[list[str]] = []
    for name, largest in limits.largest_step.items():
        steps = limits.accuracy.get(name)
        rows.append([name, step_words(largest), *([step_words(step) for step in steps] if steps else ["", ""])])
    where = "on the hub of the spec" if fit.hub_mass is not None else "with nothing attached, the safe case"
    head = ["integrator", "stable up to, s", "first mode within 1 % up to, s", "within 0.1 % up to, s"]
    note = f"Fastest mode {where}: {_number(limits.omega_max)} rad/s."
    blocks: list[Block] = [Table(rows, head, caption="Largest time step", note=note)]
    continuous, (discrete, ratios) = linear.frequencies(), linear.discrete_frequencies()
    if continuous.size == discrete.size:
        rows = [
            [str(k + 1), _number(w), _number(d), percent(d / w - 1.0), f"{0.0 if abs(z) < 1e-9 else z:.3g}"]
            for k, (w, d, z) in enumerate(zip(continuous, discrete, ratios, strict=True))
        ]
        caption = f"Integrator error: {linear.integrator} at a step of {linear.timestep:g} s"
        head = [
            "mode on the bench",
            "continuous, rad/s",
            "at this step, rad/s",
            "integrator error",
            "damping ratio at this step",
        ]
        note = "Bench: the root driven, nothing else attached. The model error is under “Against the whole beam”."
        blocks.append(Table(rows, head, caption=caption, note=note))
    else:
        step = f"{linear.timestep:g} s ({linear.integrator})"
        blocks.append(Text(f"At the bench's step of {step} not every mode oscillates: too large for this chain."))
    return blocks


def _history(fit: "Fit") -> list[Block]:
    lines = [*fit.status.history, fit.status.message]
    time = ", ".join(f"{step} {1e3 * seconds:.1f} ms" for step, seconds in fit.seconds.items())
    coupling = f"Largest coupling between ports that MuJoCo sees: {percent(fit.measured.coupling)}."
    return [Lines(lines), Text(f"Time taken: {time}." + (f" {coupling}" if len(fit.target) > 1 else ""))]


def _reproduce(fit: "Fit") -> list[Block]:
    name = fit.spec.name
    return [
        Text(f"Save the lines below as {name}.toml, then:"),
        Text(f"beamchain fit {name}.toml -o {name}", "code"),
        Text(spec_toml(fit.spec), "code"),
    ]
