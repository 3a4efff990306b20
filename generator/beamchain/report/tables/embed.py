"""The tables of a spacecraft with its appendages: what hangs where, and the coupled modes."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from beamchain.report.curves import kept_count
from beamchain.report.formats import digits, number, relative, short, vector, whole
from beamchain.report.table import Column, Table
from beamchain.report.tables.steps import Limits, step_table

if TYPE_CHECKING:
    from beamchain.craft.appendage import Appendage
    from beamchain.craft.assembly import Assembly
    from beamchain.craft.coupled_modes import Mode
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit

SHOWN = 10.0  # times the band: coupled modes beyond are left to `Embedded.assembly`
coupled_frequency = digits(8)  # shows differences that the proof resolves


def appendage_table(embedded: "Embedded") -> Table:
    """Where every appendage is, what it hangs on, and what it keeps."""
    appendages = embedded.appendages
    columns = (
        Column("at", [a.at for a in appendages]),
        Column("prefix", [a.prefix for a in appendages], place="brief"),
        Column("appendage", [size_words(a.fit) for a in appendages], place="page"),
        Column("mass centre in the base's axes", _centres(embedded), "m", vector, place="page"),
        Column("modes kept", [modes_kept(a.fit) for a in appendages], place="page"),
        Column("target", [a.fit.kept_for for a in appendages]),
        Column("rigidly behind its root", [a.hub.mass for a in appendages], "kg", number),
        Column("on", [_joints(a) for a in appendages]),
        Column("status", [_status(a) for a in appendages], place="page"),
    )
    if any(a.loads for a in appendages):
        columns = (*columns, Column("carries", [_carried(a) for a in appendages], missing="-"))
    return Table("Appendages", columns)


def _centres(embedded: "Embedded") -> list[list[float]]:
    return [embedded.mass_centres[a.at].tolist() for a in embedded.appendages]


def appendage_sentences(embedded: "Embedded") -> list[str]:
    """Where every appendage stands and, of imported ones, which modes of the file are kept."""
    base = embedded.composite.body
    out: list[str] = []
    for a in embedded.appendages:
        where = ", ".join(short(x) for x in embedded.mass_centres[a.at])
        stands = f"its mass centre stands at ({where}) m in the axes of {base}"
        line = f"{a.at}: {size_words(a.fit)}; {stands}"
        space = a.fit.space
        if space is not None and a.fit.kept_for == "clamped":
            line += f"; kept: {space.kept_words}"
        out.append(f"{line}.")
    return out


def _carried(appendage: "Appendage") -> str | None:
    """What hangs on its ports, by port."""
    ports = [f"{', '.join(names)} on {port}" for port, names in appendage.carries.items()]
    places = list(dict.fromkeys(place for load in appendage.loads for place in load.places))
    if places:
        ports.append(f"with it the appendages at {', '.join(places)}")
    return "; ".join(ports) or None


def size_words(fit: "Fit") -> str:
    """Name, length and mass of an appendage."""
    mass = fit.measured.rigid_mass[0, 0]
    return f"{fit.spec.name}: {short(fit.line.length)} m, {short(mass)} kg"


def modes_kept(fit: "Fit") -> str:
    """How many modes an appendage keeps of each port; of imported ones, which of the file."""
    space = fit.space
    if space is not None and (space.couples or not fit.target):
        return f"{len(space.numbers)}, coupled: {space.kept_words}" if fit.target else "rigid"
    counts = ", ".join(f"{kept_count(fit, port)} in {port}" for port in fit.target)
    if space is None or fit.kept_for != "clamped":
        return counts or "rigid"
    return f"{counts}: {space.kept_words}"


def _joints(appendage: "Appendage") -> str:
    joints = ", ".join(joint.words for joint in appendage.mount.joints)
    return joints or "nothing that moves"


def _status(appendage: "Appendage") -> str:
    status = appendage.fit.status
    return "as asked" if status.ok else status.message


def _frequency_columns(modes: "Sequence[Mode]") -> tuple[Column, ...]:
    """Exact and MuJoCo's frequencies and their difference."""
    exact = [mode.exact for mode in modes]
    hertz = [None if mode.exact is None else mode.exact / math.tau for mode in modes]
    through_mujoco = [mode.mujoco for mode in modes]
    errors = [mode.error for mode in modes]
    return (
        Column("mode", range(1, len(modes) + 1), format=whole),
        Column("exact", exact, "rad/s", coupled_frequency, missing="-", key="exact"),
        Column("exact", hertz, "Hz", digits(5), missing="-", place="page"),
        Column(
            "MuJoCo", through_mujoco, "rad/s", coupled_frequency, missing="left out", key="mujoco"
        ),
        Column("difference", errors, format=relative, key="error"),
    )


def coupled_table(assembly: "Assembly") -> Table:
    """The coupled modes of the whole spacecraft up to ten times the band, exact and through
    MuJoCo."""
    modes = [m for m in assembly.modes if (m.exact or m.mujoco or 0.0) <= SHOWN * assembly.band]
    columns = (
        *_frequency_columns(modes),
        Column("kept", [kept_word(assembly, mode) for mode in modes]),
        Column("kept", [mode.kept for mode in modes], key="kept", place="record"),
        Column("what moves", [mode.words for mode in modes], key="moving"),
    )
    beyond = any(m.kept and m.exact is not None and m.exact > assembly.band for m in modes)
    notes = (
        f"Rows above {number(assembly.band)} rad/s are not judged; modes that are left out may "
        "shift them.",
    )
    title = "Coupled modes of the whole spacecraft, without damping"
    hidden = len(assembly.modes) - len(modes)
    more = (f"{hidden} more lie above {number(SHOWN * assembly.band)} rad/s.",) if hidden else ()
    return Table(title, columns, notes=(notes if beyond else ()) + more)


def keyframe_table(assembly: "Assembly", modes: "Sequence[Mode]", key: str) -> Table:
    """The coupled modes at a keyframe."""
    words = [kept_word(assembly, mode) for mode in modes]
    columns = (*_frequency_columns(modes), Column("kept", words))
    return Table(f"Coupled modes at keyframe {key}, without damping", columns)


def pose_table(embedded: "Embedded") -> Table:
    """The error of the whole at every pose, in continuous time and at the file's own step."""
    poses = embedded.promise.poses
    sampled = embedded.sampled_poses
    between = [name for name in sampled if name not in poses]
    worst = max(between, key=lambda name: sampled[name].error, default="")
    names = [*poses, *([worst] if worst else [])]  # of those between poses the worst
    columns = (
        Column("pose", names),
        Column("error", [poses.get(name) for name in names], format=relative, missing="-"),
        Column("at the step", [sampled[name].error for name in names], format=relative),
    )
    if embedded.loaded:
        words_of = embedded.loads
        loads = [" and ".join(words_of.get(name, [])) or None for name in names]
        columns = (*columns, Column("load (not at the step)", loads, missing="none"))
    between_two = "The last pose lies between two of those above: of such, the worst at the step."
    notes = (between_two,) if worst else ()
    return Table(f"In-band error up to {number(embedded.band)} rad/s", columns, notes=notes)


def kept_word(assembly: "Assembly", mode: "Mode") -> str:
    """Whether a coupled mode is judged: yes, no, or kept but beyond the band."""
    if mode.kept and mode.exact is not None and mode.exact <= assembly.band:
        return "yes"
    return "kept, beyond the band" if mode.kept else "no"


def file_step_table(limits: Limits, integrator: str, timestep: float, fastest: float) -> Table:
    """The largest steps, and whether the file's own is stable; `fastest`: mode [rad/s]."""
    table = step_table(limits)
    state = "stable" if timestep < limits.largest_step[integrator] else "unstable: too large"
    asked = f"the file's, step {timestep:g} s: {state}"
    remarks = [asked if name == integrator else "" for name in limits.largest_step]
    note = f"Of the whole file at rest; fastest mode {number(fastest)} rad/s."
    return replace(table, columns=(*table.columns, Column("", remarks)), notes=(note,))


def in_band_table(appendages: "Sequence[Appendage]") -> Table:
    """Errors of equal appendages, each alone on the hub that its root feels."""
    errors = [(a, port, error) for a in appendages for port, error in a.fit.readback_error.items()]
    columns = (
        Column("at", [a.at for a, _, _ in errors]),
        Column("port", [port for _, port, _ in errors]),
        Column("band", [f"0 to {number(a.fit.bandwidth[port])}" for a, port, _ in errors], "rad/s"),
        Column(
            "in-band error",
            [error.accelerance_in_band or 0.0 for _, _, error in errors],
            format=relative,
        ),
    )
    return Table("In-band error", columns)
