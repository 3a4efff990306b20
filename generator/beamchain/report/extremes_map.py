"""The map of the extremes suite: what passed, what was refused and why, over each pair of ranges."""

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.figure import Figure

from beamchain.report.plots import STYLE

if TYPE_CHECKING:
    from beamchain.extremes.suite import Row

#: What a refusal is counted as: the first of these words its sentence holds.
REASONS = (
    ("mjMINVAL", ("takes nothing below", "mjMINVAL")),
    ("too wide for its length", ("too wide",)),
    ("not physical", ("not physical", "no physical", "massless", "singular", "no exact chain")),
    ("digits are lost", ("digits", "determined too badly")),
    ("body depth", ("nested bodies",)),
)
OTHER = "other reason"

# readable without colour: filled, hollow and crossed marks
MARKS = {
    "passed": ("#0a5fb4", "o", "all modes asked for"),
    "fewer": ("#58a1e0", "s", "fewer modes, said so"),
    "refused": ("#8a8a8a", "x", "refused with a reason"),
    "failed": ("#d00000", "*", "failed silently"),
}
PAIRS = (
    ("length", "slenderness", "length [m]", "length / diameter"),
    ("density", "modulus", "density [kg/m³]", "modulus [N/m²]"),
    ("taper", "tip", "tip / root diameter", "tip mass / beam"),
    ("hub", "joint", "hub mass / beam", "joint stiffness / (EI/L)"),
    ("modes", "damping", "modes asked for", "damping ratio"),
)
LINEAR = ("modes", "damping")


def reason(row: "Row") -> str:
    """The short name of why a case was refused."""
    return next((name for name, words in REASONS if any(word in row.reason for word in words)), OTHER)


def extremes_map(rows: Sequence["Row"]) -> bytes:
    """The map as PNG.

    Args:
        rows: of the suite.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(12.0, 7.6), layout="constrained")
        axes = figure.subplots(2, 3)
        groups = {
            "refused": [r for r in rows if r.verdict == "refused"],
            "fewer": [r for r in rows if r.verdict == "passed" and r.reason],
            "passed": [r for r in rows if r.verdict == "passed" and not r.reason],
            "failed": [r for r in rows if r.verdict == "failed"],
        }
        for ax, (x, y, x_label, y_label) in zip(axes.flat, PAIRS, strict=False):
            for name, members in groups.items():
                colour, mark, label = MARKS[name]
                shown = [r for r in members if _shown(r, x) and _shown(r, y)]
                ax.plot(
                    [_value(r, x) for r in shown], [_value(r, y) for r in shown],
                    mark, color=colour, ms=3.2, mew=0.7, ls="none", label=f"{label}: {len(members)}",
                )  # fmt: skip
            ax.set_xlabel(x_label)
            ax.set_ylabel(y_label)
            if x not in LINEAR:
                ax.set_xscale("log")
            if y not in LINEAR:
                ax.set_yscale("log")
        axes.flat[0].legend(fontsize=7.5, loc="lower left")
        last = axes.flat[-1]
        counts: dict[str, int] = {}
        for row in groups["refused"]:
            counts[reason(row)] = counts.get(reason(row), 0) + 1
        names = sorted(counts, key=lambda n: counts[n])
        last.barh(range(len(names)), [counts[n] for n in names], color="#8a8a8a")
        last.set_yticks(range(len(names)), names)
        last.set_xlabel("cases refused, by reason")
        figure.suptitle(
            f"{len(rows)} extreme appendages, each verified through MuJoCo by an independent check, or refused"
        )
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=110, metadata={"Software": None})
        return stream.getvalue()


def _shown(row: "Row", field: str) -> bool:
    return field in LINEAR or _value(row, field) > 0.0


def _value(row: "Row", field: str) -> float:
    value = float(getattr(row.case, field))
    # whole numbers lie on top of each other: spread them by the case's own length
    return value + 0.3 * (row.case.slenderness % 1.0) if field == "modes" else value
