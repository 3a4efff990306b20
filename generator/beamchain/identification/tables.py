"""The tables of an identification: modes with intervals, participation, orders, channels."""

import math
from typing import TYPE_CHECKING

from beamchain.identification.result import INTERVAL
from beamchain.report import Column, Table, digits, relative, whole
from beamchain.toolkit import MOTIONS

if TYPE_CHECKING:
    from beamchain.identification.result import Identification


def mode_table(identification: "Identification") -> Table:
    """The modes with the root held."""
    modes = identification.modes
    half_widths = [INTERVAL * mode.frequency_std for mode in modes]
    damping_half_widths = [INTERVAL * mode.damping_std for mode in modes]
    determined = ["yes" if mode.determined else "no" for mode in modes]
    columns = (
        Column("mode", [mode.number for mode in modes], format=whole),
        Column("frequency", [mode.frequency for mode in modes], "rad/s", digits(7)),
        Column("+/- 95 %", half_widths, format=digits(2)),
        Column("damping ratio", [mode.damping for mode in modes], format=digits(4)),
        Column("+/- 95 %", damping_half_widths, format=digits(2)),
        Column("determined", determined),
        Column("remark", [mode.remark for mode in modes]),
    )
    return Table("Modes with the root held", columns)


def _with_interval(pair: tuple[float, float]) -> str:
    value, deviation = pair
    if not math.isfinite(deviation):
        return f"{value + 0.0:.5g}, unknown"
    return f"{value + 0.0:.5g} ± {INTERVAL * deviation:.2g}"


def participation_table(identification: "Identification") -> Table:
    """What every mode does to the root, with intervals."""
    modes = identification.modes
    columns = [Column("mode", [mode.number for mode in modes], format=whole)]
    for k, motion in enumerate(MOTIONS):
        pairs = [(float(m.participation[k]), float(m.participation_std[k])) for m in modes]
        columns.append(Column(motion, pairs, format=_with_interval))
    return Table("Participation", tuple(columns))


def order_table(identification: "Identification") -> Table:
    """The criterion for each number of modes in the model."""
    orders = identification.order
    frequencies = [", ".join(f"{w:.5g}" for w in order.frequencies) for order in orders]
    columns = (
        Column("modes", [order.modes for order in orders], format=whole),
        Column("criterion", [order.criterion for order in orders], format=digits(6)),
        Column("gain", [order.gain for order in orders], format=digits(4)),
        Column("coupled frequencies", frequencies, "rad/s"),
    )
    return Table("Number of modes", columns)


def channel_table(identification: "Identification") -> Table:
    """What the model leaves of each channel."""
    names = list(identification.noise)
    residuals = [identification.noise[name] for name in names]
    whiteness = [identification.whiteness[name] for name in names]
    held_out = [identification.held_out[name] for name in names]
    columns = (
        Column("channel", names),
        Column("residual, deviation", residuals, format=digits(4)),
        Column("probability of white residuals", whiteness, format=digits(2)),
        Column("held-out part, error", held_out, format=relative),
    )
    return Table("Channels", columns)
