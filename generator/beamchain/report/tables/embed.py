"""The tables of a spacecraft with its appendages: what hangs where, and the coupled modes."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from beamchain.report.curves import kept_count
from beamchain.report.formats import digits, number, relative, short, vector, whole
from beamchain.report.table import Column, Rows, Table

if TYPE_CHECKING:
    from beamchain.craft.appendage import Appendage
    from beamchain.craft.assembly import Assembly
    from beamchain.craft.coupled_modes import Mode
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit

SHOWN = 10.0  # times the band: coupled modes beyond are left to `Embedded.assembly`


def appendage_table(embedded: "Embedded") -> Table:
    """Where every appendage is, what it hangs on, and what it keeps."""
    column = Rows(embedded.appendages).column
    centres = [embedded.mass_centres[a.at] for a in embedded.appendages]
    columns = [
        column("at", "at"),
        column("prefix", "prefix", place="brief"),
        column("appendage", lambda a: size_words(a.fit), place="page"),
        Column("mass centre in the base's axes", centres, "m", vector),
        column("modes kept", lambda a: modes_kept(a.fit), place="page"),
        column("target", "fit.kept_for"),
        column("rigidly behind its root", "hub.mass", "kg", number),
        column("on", lambda a: ", ".join(j.words for j in a.mount.joints) or "nothing that moves"),
    ]
    if any(a.loads for a in embedded.appendages):
        columns.append(column("carries", _carried, missing="-"))
    return Table("Appendages", tuple(columns))


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


def _mode_columns(modes: "Sequence[Mode]", band: float) -> tuple[Column, ...]:
    """Exact and MuJoCo's frequencies, their difference, and whether they are kept."""
    column = Rows(modes).column
    hertz = [None if mode.exact is None else mode.exact / math.tau for mode in modes]
    precise = digits(8)  # shows differences that the proof resolves
    return (
        Column("mode", range(1, len(modes) + 1), format=whole),
        column("exact", "exact", "rad/s", precise, missing="-", key="exact"),
        Column("exact", hertz, "Hz", digits(5), missing="-", place="page"),
        column("MuJoCo", "mujoco", "rad/s", precise, missing="left out", key="mujoco"),
        column("difference", "error", format=relative, key="error"),
        column("kept", lambda mode: kept_word(mode, band)),
        column("kept", "kept", key="kept", place="record"),
    )


def coupled_table(assembly: "Assembly") -> Table:
    """The coupled modes of the whole spacecraft up to ten times the band, exact and through
    MuJoCo."""
    modes = [m for m in assembly.modes if (m.exact or m.mujoco or 0.0) <= SHOWN * assembly.band]
    moving = Column("what moves", [mode.words for mode in modes], key="moving")
    notes: list[str] = []
    if any(mode.kept and (mode.exact or 0.0) > assembly.band for mode in modes):
        notes.append(
            f"Rows above {number(assembly.band)} rad/s are not judged; modes that are left out may "
            "shift them."
        )
    if hidden := len(assembly.modes) - len(modes):
        notes.append(f"{hidden} more lie above {number(SHOWN * assembly.band)} rad/s.")
    title = "Coupled modes of the whole spacecraft, without damping"
    return Table(title, (*_mode_columns(modes, assembly.band), moving), tuple(notes))


def pose_table(embedded: "Embedded") -> Table:
    """The error of the whole at every pose, in continuous time and at the file's own step."""
    poses = embedded.promise.poses
    sampled = embedded.sampled_poses
    between = [name for name in sampled if name not in poses]
    worst = max(between, key=lambda name: sampled[name].error, default="")
    names = [*poses, *([worst] if worst else [])]  # of those between poses the worst
    columns = [
        Column("pose", names),
        Column("error", [poses.get(name) for name in names], format=relative, missing="-"),
        Column("at the step", [sampled[name].error for name in names], format=relative),
    ]
    if embedded.loaded:
        loads = [" and ".join(embedded.loads.get(name, [])) or None for name in names]
        columns.append(Column("load (not at the step)", loads, missing="none"))
    between_two = "The last pose lies between two of those above: of such, the worst at the step."
    notes = (between_two,) if worst else ()
    return Table(f"In-band error up to {number(embedded.band)} rad/s", tuple(columns), notes)


def kept_word(mode: "Mode", band: float) -> str:
    """Whether a coupled mode is judged: yes, no, or kept but beyond the band."""
    if mode.kept and mode.exact is not None and mode.exact <= band:
        return "yes"
    return "kept, beyond the band" if mode.kept else "no"
