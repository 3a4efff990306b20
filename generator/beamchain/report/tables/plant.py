"""The tables of a plant: signals, modes and their gains and margins."""

import math
from collections.abc import Sequence
from operator import attrgetter
from typing import TYPE_CHECKING

from beamchain.report.formats import digits, number
from beamchain.report.table import Column, Place, Rows, Table

if TYPE_CHECKING:
    from beamchain.control.margins import LoopMargins, Margins
    from beamchain.control.realisation import Plant
    from beamchain.control.scheduled import ScheduledPlant

FEW = 4  # poses whose frequencies the terminal shows


def input_table(plant: "Plant") -> Table:
    """Inputs with their units."""
    return _signal_table("Inputs", plant.input_names, plant.input_units)


def output_table(plant: "Plant") -> Table:
    """Outputs with their units."""
    return _signal_table("Outputs", plant.output_names, plant.output_units)


def _signal_table(title: str, names: Sequence[str], units: Sequence[str]) -> Table:
    return Table(title, (Column("signal", names, key="name"), Column("unit", units, key="unit")))


def mode_table(plant: "Plant") -> Table:
    """The flexible modes with the pair of signals that each shows most in."""
    pairs = [f"{seen} per {driven}" for seen in plant.output_names for driven in plant.input_names]
    gains = plant.gain.reshape(len(plant.modes), len(pairs))
    frequencies = plant.frequency.tolist()
    columns = (
        Column("mode", plant.modes, key="name"),
        Column("frequency", frequencies, "rad/s", number, key="frequency"),
        Column("frequency", [w / math.tau for w in frequencies], "Hz", digits(5)),
        Column("damping ratio", plant.damping_ratio.tolist(), format=digits(3), key="damping"),
        Column("largest gain", list(gains.max(axis=1)), format=digits(3)),
        Column("of", [pairs[strongest] for strongest in gains.argmax(axis=1)]),
    )
    unreached = ", ".join(plant.unreached)
    note = f"taken out, since no input drives them or no output sees them: {unreached}"
    notes = (note,) if unreached else ()
    return Table(titled("Flexible modes", [plant.pose]), columns, notes)


def pose_table(scheduled: "ScheduledPlant") -> Table:
    """Frequencies of the modes in every pose."""
    columns = [Column("mode", scheduled.modes)]
    for i, label in enumerate(scheduled.labels):
        place = "everywhere" if i < FEW else "page"
        rates = [None if math.isnan(w) else w for w in scheduled.frequency[i].tolist()]
        columns.append(Column(label, rates, format=number, place=place, missing="no oscillation"))
    return Table("Frequencies in every pose, rad/s", tuple(columns))


def margin_text(value: float, count: int = 4) -> str:
    """A margin; infinity is no limit, and an unstable loop has none."""
    if math.isinf(value):
        return "no limit"
    return "-" if math.isnan(value) else f"{value:.{count}g}"


def margin_at_text(pair: tuple[float, float]) -> str:
    """A margin and the frequency at which it is."""
    value, frequency = pair
    at = f" ({frequency:.3g})" if math.isfinite(value) and math.isfinite(frequency) else ""
    return f"{margin_text(value, 3)}{at}"


def pose_columns(poses: Sequence[str]) -> tuple[Column, ...]:
    """The pose of every row, a joint on each line; no column where there is one."""
    if len(set(poses)) < 2:
        return ()
    return (Column("pose", [pose.replace(", ", ",\n") for pose in poses]),)


def titled(title: str, poses: Sequence[str]) -> str:
    """A title with the pose where there is one for all rows."""
    return f"{title}, {poses[0]}" if len(set(poses)) == 1 and poses[0] else title


def margin_table(several: "Sequence[Margins]") -> Table:
    """Margins at every input that a loop drives, the loops of the others closed, pose by pose; why
    a closed loop is unstable in its notes."""
    loops = [(margins.pose, loop) for margins in several for loop in margins.loops]
    reasons = [(margins.pose, said) for margins in several for said in margins.reasons]
    notes = [f"{pose}: {said}" if pose else said for pose, said in reasons]
    if any(margins.timestep for margins in several):
        notes.append("Sampled: all figures hold at the samples, up to pi/T.")

    def figures(name: str, unit: str, field: str, place: Place = "everywhere") -> Column:
        where = f"{field.removesuffix('_db')}_frequency"
        pairs = [(getattr(loop, field), getattr(loop, where)) for _, loop in loops]
        return Column(name, pairs, unit, margin_at_text, place=place)

    columns = (
        *pose_columns([pose for pose, _ in loops]),
        Column("input broken", [loop.input for _, loop in loops]),
        Column("measured", ["\n".join(loop.outputs) for _, loop in loops]),
        Column("closed loop", [_state(loop) for _, loop in loops]),
        figures("gain", "dB (at rad/s)", "gain_db"),
        figures("gain down to", "dB (at rad/s)", "lowest_gain_db"),
        figures("phase", "degrees (at rad/s)", "phase"),
        Column("delay", [loop.delay for _, loop in loops], "s", margin_text),
        figures("disk (at rad/s)", "", "disk"),
        figures("modulus (at rad/s)", "", "modulus", "page"),
    )
    title = titled("Margins, the other loops closed", [margins.pose for margins in several])
    return Table(title, columns, tuple(notes))


def limiting_table(several: "Sequence[Margins]") -> Table:
    """The flexible modes near whose frequencies the margins lie; of loops that have any."""
    figures = ("gain", "phase", "disk")
    every = [(margins.pose, loop) for margins in several for loop in margins.loops]
    loops = [(pose, loop) for pose, loop in every if not loop.modes.keys().isdisjoint(figures)]
    columns = [
        *pose_columns([pose for pose, _ in loops]),
        Column("input broken", [loop.input for _, loop in loops]),
    ]
    for figure in figures:
        columns.append(Column(figure, [loop.modes.get(figure) for _, loop in loops], missing="-"))
    return Table("Modes within 20 % of a margin's frequency", tuple(columns))


def _state(loop: "LoopMargins") -> str:
    if loop.stable:
        return "stable"
    return "UNSTABLE" if loop.causes else "unstable because of other loops"


def closed_loop_table(several: "Sequence[Margins]") -> Table:
    """Disk margin of all inputs at once, and the peaks of S and T, pose by pose."""
    poses = [margins.pose for margins in several]
    columns = list(pose_columns(poses) or [Column("broken", ["all inputs"] * len(poses))])
    for name, field in (
        ("disk", "all_at_once"),
        ("peak of S", "peak_sensitivity"),
        ("peak of T", "peak_complementary"),
    ):
        extremum = attrgetter(f"{field}.value", f"{field}.frequency")
        column = Rows(several).column(f"{name} (at rad/s)", extremum, format=margin_at_text)
        columns.append(column)
    return Table("All loops at once", tuple(columns))
