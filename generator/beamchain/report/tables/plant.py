"""The tables of a plant: signals, modes and their gains, margins, the worst case."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from beamchain.report.formats import digits, number
from beamchain.report.table import Column, Table

if TYPE_CHECKING:
    from beamchain.plants.loops import Margins
    from beamchain.plants.realisation import Plant
    from beamchain.plants.uncertain_plant import WorstCase

LARGEST_PAIRS = 6  # pairs of input and output whose modal gains a page shows
ROUNDING = 1e-9  # gain relative to the largest, below which it is rounding


def signal_table(title: str, names: Sequence[str], units: Sequence[str]) -> Table:
    """Inputs or outputs with their units."""
    columns = (Column("signal", names, key="name"), Column("unit", units, key="unit"))
    return Table(title, columns)


def mode_table(plant: "Plant") -> Table:
    """The flexible modes; in brief with the pair of signals that each shows most in."""
    pairs = [f"{seen} per {driven}" for seen in plant.output_names for driven in plant.input_names]
    gains = plant.gain.reshape(len(plant.modes), len(pairs))
    frequencies = plant.frequency.tolist()
    columns = (
        Column("mode", plant.modes, key="name"),
        Column("frequency", frequencies, "rad/s", number, key="frequency"),
        Column("frequency", [w / math.tau for w in frequencies], "Hz", digits(5)),
        Column("damping ratio", plant.damping_ratio.tolist(), format=digits(3), key="damping"),
        Column("largest gain", list(gains.max(axis=1)), format=digits(3), place="brief"),
        Column("of", [pairs[strongest] for strongest in gains.argmax(axis=1)], place="brief"),
    )
    return Table("Flexible modes", columns)


def gain_table(plant: "Plant") -> Table:
    """Gains of the modes in the pairs of input and output that have the largest."""
    pairs = [(i, j) for i in range(plant.noutputs) for j in range(plant.ninputs)]
    peaks = plant.gain.max(axis=0, initial=0.0)
    largest = sorted(pairs, key=lambda pair: -float(peaks[pair]))[:LARGEST_PAIRS]
    least = ROUNDING * peaks.max(initial=0.0)
    columns = [Column("mode", plant.modes)]
    for i, j in largest:
        gains = [gain if gain > least else 0.0 for gain in plant.gain[:, i, j].tolist()]
        name = f"{plant.input_names[j]} → {plant.output_names[i]}"
        columns.append(Column(name, gains, format=digits(3)))
    return Table("Modal gains", tuple(columns))


def margin_text(value: float) -> str:
    """A margin; infinity is no limit, and an unstable loop has none."""
    if math.isinf(value):
        return "no limit"
    return "-" if math.isnan(value) else f"{value:.4g}"


def margin_table(margins_by_plant: "Sequence[Sequence[Margins]]") -> Table:
    """Margins at every input that a loop drives, plant by plant."""
    names: list[str] = []
    states: list[str] = []
    kinds: list[str] = []
    values: list[float] = []
    frequencies: list[float | None] = []
    for number_of_plant, margins in enumerate(margins_by_plant, 1):
        prefix = f"{number_of_plant}: " if len(margins_by_plant) > 1 else ""
        for margin in margins:
            rows = (
                ("gain, factor", margin.gain, margin.gain_frequency),
                ("gain down to, factor", margin.lowest_gain, None),
                ("phase, degrees", margin.phase, margin.phase_frequency),
                ("delay, s", margin.delay, None),
                ("disk", margin.disk, margin.disk_frequency),
            )
            blank = [""] * (len(rows) - 1)
            names += [f"{prefix}{margin.name}", *blank]
            states += ["stable" if margin.stable else "UNSTABLE", *blank]
            kinds += [kind for kind, _, _ in rows]
            values += [value for _, value, _ in rows]
            frequencies += [frequency for _, _, frequency in rows]
    columns = (
        Column("input broken", names),
        Column("closed loop", states),
        Column("margin", kinds),
        Column("value", values, format=margin_text),
        Column("at", frequencies, "rad/s", margin_text),
    )
    return Table("Margins, the other loops closed", columns)


def _gain_text(value: float) -> str:
    return f"{value:.5g}" if math.isfinite(value) else "none"


def _sample_text(gain: float) -> str:
    return "unstable" if math.isinf(gain) else _gain_text(gain)


def worst_table(cases: "Sequence[WorstCase]") -> Table:
    """The worst sample of the gain from a disturbance to an output, plant by plant."""
    names = [f"{case.input} → {case.output}" for case in cases]
    if len(cases) > 1:
        names = [f"{i}: {name}" for i, name in enumerate(names, 1)]
    predicted = [case.gain if case.stable else math.inf for case in cases]
    drawn = [float(max(case.drawn, default=math.nan)) for case in cases]
    columns = (
        Column("disturbance → output", names),
        Column("worst sample, predicted", predicted, format=_sample_text),
        Column("worst sample, MuJoCo", [case.simulated for case in cases], format=_gain_text),
        Column("at", [case.frequency for case in cases], "rad/s", _gain_text),
        Column("worst of the draws", drawn, format=_gain_text),
        Column("unit", [case.unit for case in cases]),
    )
    return Table("Worst case", columns)


def worst_value_table(cases: "Sequence[WorstCase]") -> Table:
    """Values of the uncertain quantities in the worst sample of every plant."""
    quantities: Mapping[str, float] = cases[0].values if cases else {}
    columns = [Column("quantity", list(quantities))]
    for i, case in enumerate(cases, 1):
        name = f"worst sample {i}" if len(cases) > 1 else "worst sample"
        columns.append(Column(name, [case.values[q] for q in quantities], format=number))
    return Table("Values of the worst sample", tuple(columns))
