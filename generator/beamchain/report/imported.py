"""What a report adds for imported modes: where they came from and what was done to them."""

from typing import TYPE_CHECKING

import numpy as np

from beamchain.report.page import Block, Lines, Section, Table, Text
from beamchain.report.plots import percent

if TYPE_CHECKING:
    from beamchain.fitting.result import Fit, InSpace


def with_imported(fit: "Fit", page: list[Section]) -> list[Section]:
    """The page with a section on the imported modes after the first.

    Args:
        fit: what is told.
        page: the sections of any fit.
    """
    if fit.space is None:
        return page
    first, *rest = page
    return [first, Section("The imported modes", _modes(fit.space)), *rest]


def _modes(space: "InSpace") -> list[Block]:
    data = space.data
    rows = [
        [
            str(k + 1), f"{w:.6g}", f"{w / (2.0 * np.pi):.6g}",
            *(f"{value + 0.0:.5g}" for value in data.participation[k]), data.belongs[k], percent(float(data.leaks[k])),
            f"{data.damping[k]:.4g}",
        ]
        for k, w in enumerate(data.frequencies)
    ]  # fmt: skip
    head = ["mode", "rad/s", "Hz", "x", "y", "z", "rot. x", "rot. y", "rot. z", "port", "outside it", "damping ratio"]
    note = (
        "Participation of the mass-normalised modes about the port, in appendage axes: √kg and √kg m. “Outside it”: "
        "part of the participation that lies in other ports, every motion scaled by its rigid mass."
    )
    error = space.error
    seen = (
        f"All {len(space.live)} motions of the root at once, read back through MuJoCo: frequencies within "
        f"{percent(error.frequency)}, participation within {percent(error.participation)}, in-band error "
        f"{percent(error.accelerance_in_band or 0.0)}."
    )
    return [Text(f"Ports: {space.why}."), Lines(data.steps), Table(rows, head, note=note), Text(seen)]
