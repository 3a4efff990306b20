"""The tables of a fit: kept modes, links, hinges, tendons, errors, what was left out."""

import math
from collections.abc import Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamchain.ports.compare import DEFAULT_RATIO
from beamchain.ports.motions import PORTS
from beamchain.report.formats import (
    damping_ratio,
    digits,
    hundredths,
    number,
    relative,
    step_text,
    vector,
    whole,
)
from beamchain.report.table import Column, Rows, Table
from beamchain.structure.section import Equivalent

if TYPE_CHECKING:
    from beamchain.fitting.kept import LeftOut
    from beamchain.fitting.result import Fit, InSpace
    from beamchain.ports.motions import Array
    from beamchain.structure.modal_data import ModalData

MOTIONS = ("x", "y", "z", "rot. x", "rot. y", "rot. z")
#: unit of a mode's participation in a port
PARTICIPATION = {"torsion": "√(kg m²)", "axial": "√kg"}
ROUNDING = 1e-9  # of the largest coordinate of a mass centre: one below it is zero
PLANE_PARTICIPATION = "force √kg, moment √kg m"


class MatchedMode(NamedTuple):
    """A mode of the target, and the chain's that stands for it; errors are relative."""

    port: str
    number: int  # among the modes of the target, from 1
    in_file: int | None  # its number in the file of imported modes
    target_frequency: float  # with the root held [rad/s]
    frequency: float  # the same through MuJoCo
    frequency_error: float
    free_frequency: float | None  # with nothing attached [rad/s]; None where there is no such mode
    target_participation: "Array"  # at the root
    participation_error: float
    target_damping: float  # ratio
    damping: float  # the same through MuJoCo
    tip_error: float | None  # of the tip's motion; None where it is not known


def left_out_sentences(fit: "Fit") -> list[str]:
    """The modes of the file that a specification leaves out by number within the band."""
    space = fit.space
    if space is None or fit.choice is not None:
        return []
    data = space.data
    out: list[str] = []
    for k in range(data.modes):
        moved = [port for port, part in zip(PORTS, data.parts[k], strict=True) if part > 0.0]
        band = max((fit.bandwidth.get(port, 0.0) for port in moved), default=0.0)
        omega = float(data.frequencies[k])
        if k + 1 not in space.numbers and omega <= band:
            out.append(
                f"mode {k + 1} of the file ({omega:.4g} rad/s) lies in the band and is not kept"
            )
    return out


def assumed_sentences(fit: "Fit") -> list[str]:
    """What a specification leaves out, and what stands in its place."""
    out: list[str] = []
    spec = fit.spec
    undamped = bool(fit.target) and not any(np.any(model.damping) for model in fit.target.values())
    if spec.damping is None and spec.slosh is None and undamped:
        judged = f"{DEFAULT_RATIO * 100.0:g} %"
        out.append(f"No [damping] is given: the file has none, and errors are those at {judged}.")
    for i, segment in enumerate(spec.segment):
        section = segment.section
        if isinstance(section, Equivalent) and not section.polar_inertia:
            about = float(fit.measured.rigid_mass[3, 3])
            out.append(
                f"segment[{i}] is given without polar_inertia: the inertia about x of the whole "
                f"appendage is {about:.1e} kg m² in the file."
            )
            break
    return out


def matched_modes(fit: "Fit", port: str) -> list[MatchedMode]:
    """The matched modes of a port, slowest first."""
    target = fit.target[port]
    achieved = fit.achieved[port]
    error = fit.readback_error[port]
    free = achieved.free_frequencies
    tip = fit.tip_error.get(port, ())
    modes: list[MatchedMode] = []
    for match in np.argsort(error.matches[:, 1]):
        i, j = (int(index) for index in error.matches[match])
        mode = MatchedMode(
            port=port,
            number=j + 1,
            in_file=_in_file(fit, port, float(target.frequencies[j])),
            target_frequency=float(target.frequencies[j]),
            frequency=float(achieved.frequencies[i]),
            frequency_error=float(error.frequency_errors[match]),
            free_frequency=float(free[i]) if i < len(free) else None,
            target_participation=target.participation[j],
            participation_error=float(error.participation_errors[match]),
            target_damping=float(target.damping[j]),
            damping=float(achieved.damping[i]),
            tip_error=float(tip[j]) if j < len(tip) else None,
        )
        modes.append(mode)
    return modes


def _in_file(fit: "Fit", port: str, frequency: float) -> int | None:
    """Number in the file of the kept mode of a frequency [rad/s]; of equal ones the port's."""
    space = fit.space
    if space is None or fit.kept_for != "clamped":
        return None

    def away(number: int) -> tuple[float, bool]:
        gap = abs(space.data.frequencies[number - 1] / frequency - 1.0)
        return round(gap, 9), space.data.belongs[number - 1] != port

    return min(space.numbers, key=away)


def every_mode(fit: "Fit") -> list[MatchedMode]:
    """The matched modes of all ports; one that couples ports once, in the port that it moves
    most."""
    modes = [mode for port in fit.readback_error for mode in matched_modes(fit, port)]
    space = fit.space
    if space is None or not space.couples or fit.kept_for != "clamped":
        return modes
    by_number: dict[int, MatchedMode] = {}
    for mode in modes:
        assert mode.in_file is not None
        if mode.in_file not in by_number or space.data.belongs[mode.in_file - 1] == mode.port:
            by_number[mode.in_file] = mode
    return [
        by_number[number]._replace(number=k)
        for k, number in enumerate(space.numbers, 1)
        if number in by_number
    ]


def mode_table(fit: "Fit", title: str = "") -> Table:
    """The kept modes, each once: asked for, read back through MuJoCo, how far off."""
    modes = every_mode(fit)
    column = Rows(modes).column
    columns = [
        column("port", "port"),
        column("mode", "number", format=whole),
        *_file_column([mode.in_file for mode in modes]),
        column("target", "target_frequency", "rad/s", number, place="page"),
        column("target", lambda m: m.target_frequency / math.tau, "Hz", number, place="page"),
        column("through MuJoCo", "frequency", "rad/s", number),
        column("relative error", "frequency_error", format=relative),
        column(
            "nothing attached", "free_frequency", "rad/s", number, missing="none", place="brief"
        ),
        column("participation", "target_participation", format=vector, place="page"),
        column("relative error", "participation_error", format=relative, place="page"),
    ]
    if any(mode.target_damping > 0.0 or mode.damping > 0.0 for mode in modes):
        columns += [
            column("damping ratio, asked", "target_damping", format=damping_ratio),
            column("damping ratio, through MuJoCo", "damping", format=damping_ratio),
        ]
    if any(mode.tip_error is not None for mode in modes):
        name = "tip motion, relative error"
        columns.append(column(name, "tip_error", format=relative, place="page"))
    return Table(title, tuple(columns))


def _file_column(numbers: Sequence[int | None]) -> tuple[Column, ...]:
    """The numbers of modes in their file; no column where nothing was imported."""
    if all(number is None for number in numbers):
        return ()
    return (Column("mode of the file", numbers, format=whole, missing="-"),)


def mode_notes(fit: "Fit") -> list[str]:
    """How the modes are to be read, port by port."""
    units = (f"{port}: {PARTICIPATION.get(port, PLANE_PARTICIPATION)}" for port in fit.target)
    note = f"Cantilever modes, root held. Participation in {'; '.join(units)}."
    if fit.kept_for in ("free", "hub"):
        note += (
            " The target keeps other modes exactly (next section); its own cantilever modes "
            "differ from the beam's."
        )
    return [note, *(fit.measured.reading_sentence(port) for port in fit.target)]


def link_table(fit: "Fit") -> Table:
    """The rigid links of the chain."""
    links = fit.chain.links
    column = Rows(links).column
    columns = (
        Column("link", range(1, len(links) + 1), format=whole),
        column("starts at x", "start", "m", number),
        column("length", "length", "m", number),
        column("mass", "mass", "kg", number),
        column("centre of mass x", "com", "m", number),
        column("inertia xx, yy, zz about it", "inertia", "kg m^2", vector),
    )
    return Table("Links", columns)


def _stiffness_text(stiffness: float) -> str:
    return number(stiffness) if stiffness else "free"


def hinge_table(fit: "Fit") -> Table:
    """The hinges of the chain with their springs and dampers, port by port."""
    hinges = fit.chain.hinges
    columns = [
        Column("hinge", range(1, len(hinges) + 1), format=whole),
        Column("x", [hinge.x for hinge in hinges], "m", number),
    ]
    for port in fit.chain.ports:
        unit = "N/m" if port == "axial" else "N m/rad"
        springs = [hinge.stiffness.get(port) for hinge in hinges]
        stiffness = Column(f"stiffness {port}", springs, unit, _stiffness_text, missing="rigid")
        columns.append(stiffness)
    for port in fit.chain.ports:
        dampers = [hinge.damping.get(port) for hinge in hinges]
        if any(damper is not None for damper in dampers):
            unit = "N s/m" if port == "axial" else "N m s/rad"
            columns.append(Column(f"damping {port}", dampers, unit, number))
    return Table("Hinges", tuple(columns))


def tendon_table(fit: "Fit") -> Table:
    """The tendons of the chain, one per mode."""
    tendons = fit.chain.tendons
    column = Rows(tendons).column
    space = fit.space if fit.kept_for == "clamped" else None
    in_file = [space.in_file(t.label) if space and t.is_mode else None for t in tendons]
    columns = (
        column("tendon", lambda t: f"{fit.spec.name}_{t.label}"),
        *_file_column(in_file),
        column("frequency", lambda t: t.stiffness**0.5 or None, "rad/s", number, missing="-"),
        column("damping", "damping", "1/s", number),
        column("armature", "armature", format=number),
    )
    return Table("Tendons", columns)


def in_band_table(fits: "Sequence[Fit]", at: Sequence[str] = ()) -> Table:
    """Error of the hub's motion of appendages at some places, each alone, port by port."""
    rows = [
        (k, fit.bandwidth[port], port, error.accelerance_in_band or 0.0)
        for k, fit in enumerate(fits)
        for port, error in fit.readback_error.items()
    ]
    column = Rows(rows).column
    columns = (
        column("port", itemgetter(2)),
        column("band", lambda row: f"0 to {number(row[1])}", "rad/s"),
        column("in-band error", itemgetter(3), format=relative),
    )
    if at:
        return Table("In-band error", (column("at", lambda row: at[row[0]]), *columns))
    note = "No hub is given: the worst of three, 0.1, 1 and 10 times the appendage's rigid mass."
    if fits[0].hub_mass is not None:
        note = "On the hub of the spec."
    if fits[0].promise is not None:
        note += " Each port by itself; what the scene asks of the hub counts all ports together."
    return Table("In-band error", columns, (note,))


def imported_table(data: "ModalData") -> Table:
    """Imported modes about the port, and the port that each is counted to."""
    frequencies = data.frequencies
    shares = zip(MOTIONS, np.transpose(data.participation), strict=True)
    columns = (
        Column("mode", range(1, len(frequencies) + 1), format=whole),
        Column("frequency", list(frequencies), "rad/s", number),
        Column("frequency", list(frequencies / (2.0 * np.pi)), "Hz", number),
        *(Column(motion, list(share), format=digits(5)) for motion, share in shares),
        Column("port", data.belongs),
        Column("outside it", list(data.leaks), format=relative),
        Column("damping ratio", list(data.damping), format=damping_ratio),
    )
    return Table("Imported modes", columns)


def effective_mass_table(space: "InSpace") -> Table:
    """Effective masses in percent of the rigid mass, mode by mode, of the kept ones and of all:
    translations along the axes of the appendage, rotations about the port."""
    data = space.data
    shares = 100.0 * data.effective_mass_fractions
    kept = [k - 1 for k in space.numbers]
    sums = {"all": shares.sum(axis=0)}
    if len(kept) < data.modes:
        sums = {"kept": shares[kept].sum(axis=0), **sums}
    every = np.vstack([shares, *sums.values()])
    frequencies: list[float | None] = [*(data.frequencies / (2.0 * np.pi)).tolist()]
    frequencies += [None] * len(sums)
    columns = (
        Column("mode", [*(str(k + 1) for k in range(data.modes)), *sums]),
        Column("frequency", frequencies, "Hz", digits(7)),
        *(
            Column(motion, share, "%", hundredths)
            for motion, share in zip(MOTIONS, every.T.tolist(), strict=True)
        ),
    )
    notes = (
        "Translations along the axes of the appendage, rotations about the port.",
        f"Kept: {space.kept_words}.",
        mass_words(data.rigid_mass),
    )
    return Table("Effective masses", columns, notes)


def mass_words(rigid: "Array") -> str:
    """Total mass and mass centre of a `(6, 6)` mass matrix about the root."""
    found = mass_record(rigid)
    centre = np.array(found["com"])
    centre[np.abs(centre) < ROUNDING * np.max(np.abs(centre))] = 0.0
    where = ", ".join(number(float(x)) for x in centre)
    return f"Total mass {number(found['mass'])} kg, mass centre at ({where}) m from the root."


def model_error_table(fit: "Fit", port: str) -> Table:
    """Held, free and on the hub: frequencies of the beam and of the chain in continuous time."""
    beam = fit.full[port]
    chain = fit.achieved[port]
    kept = min(fit.target[port].modes, chain.modes, chain.free_frequencies.size)
    cases = [
        ("root held", beam.frequencies, chain.frequencies),
        ("nothing attached", beam.free_frequencies, chain.free_frequencies),
    ]
    if (hub := fit.body.port_hub(port)) is not None:
        coupled_beam = beam.with_hub(hub).free_frequencies
        coupled_chain = chain.with_hub(hub).free_frequencies
        cases.append(("on the hub", coupled_beam, coupled_chain))
    rows = [
        (f"{name}, mode {k}", float(exact), float(achieved))
        for name, of_beam, of_chain in cases
        for k, (exact, achieved) in enumerate(
            zip(of_beam[:kept], of_chain[:kept], strict=False), start=1
        )
    ]
    column = Rows(rows).column
    columns = (
        column("frequencies, rad/s", itemgetter(0)),
        column("beam", itemgetter(1), format=number),
        column("chain, through MuJoCo", itemgetter(2), format=number),
        column("model error", lambda row: row[2] / row[1] - 1.0, format=relative),
    )
    return Table(f"Model error in {port}", columns)


def mass_record(rigid: "Array") -> dict[str, Any]:
    """Mass, centre and inertia about the port from a `(6, 6)` mass matrix."""
    m = float(rigid[0, 0])
    com = [(rigid[1, 5] - rigid[2, 4]) / 2.0 / m, -rigid[0, 5] / m, rigid[0, 4] / m]
    return {"mass": m, "com": com, "inertia": rigid[3:, 3:]}


def bench_table(fit: "Fit") -> Table:
    """What the integrator makes of the modes on the bench; empty where not all oscillate."""
    bench = fit.measured.linearisation
    title = f"Integrator error: {bench.integrator} at a step of {bench.timestep:g} s"
    continuous = bench.frequencies()
    discrete, ratios = bench.discrete_frequencies()
    if continuous.size != discrete.size:
        return Table(title, ())
    columns = (
        Column("mode on the bench", range(1, continuous.size + 1), format=whole),
        Column("continuous", list(continuous), "rad/s", number),
        Column("at this step", list(discrete), "rad/s", number),
        Column("integrator error", list(discrete / continuous - 1.0), format=relative),
        Column("damping ratio at this step", list(ratios), format=damping_ratio),
    )
    return Table(title, columns)


def left_out_table(items: "Sequence[LeftOut]") -> Table:
    """What the model does without."""
    column = Rows(items).column
    columns = (
        column("left out", "what"),
        column("why", "why"),
        column("cost", lambda item: item.cost or None, format=relative, missing="nothing"),
    )
    note = (
        "Cost: relative change of the hub's motion within the band that leaving it out alone makes."
    )
    return Table("Left out", columns, (note,))


def kept_step_table(fit: "Fit") -> Table:
    """The largest steps that keep the scene's tolerance."""
    column = Rows(fit.steps).column
    columns = (
        column("integrator", "integrator"),
        column("largest step", "step", "s", step_text),
        column("bounded by", "bound"),
        column("cost", "cost", format="{:.2f}".format),
    )
    return Table("Steps that keep the tolerance", columns)
