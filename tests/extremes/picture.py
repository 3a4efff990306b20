"""The map of the extremes suite: what passed, what was refused and why,
over each pair of ranges."""

import io
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.figure import Figure
from PIL import Image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from extremes.suite import Row

STYLE = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "font.size": 9.5,
}

#: What a refusal, or a loss of modes, is counted as: the first of these words its sentence holds.
REASONS = (
    ("link below mjMINVAL", ("would have mass",)),
    ("hub below mjMINVAL", ("the hub has mass",)),
    ("appendage below mjMINVAL", ("the appendage has mass",)),
    ("no such rigid body", ("which no body has", "too wide")),
    ("more bodies than MJCF nests", ("nested bodies",)),
    ("number below 1e-30", ("must be above 1e-30",)),
    ("root too light for free modes", ("the root is too light",)),
    ("digits are lost", ("digits",)),
    (
        "exact chain not physical",
        (
            "not physical",
            "limp chain",
            "before the root",
            "no physical",
            "massless",
            "singular",
            "no exact chain",
        ),
    ),
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
    ("taper", "tip", "tip / root diameter (1: not shown)", "tip mass / beam (0: not shown)"),
    ("hub", "joint", "hub mass / beam", "joint stiffness / (EI/L) (rigid: not shown)"),
    ("modes", "damping", "modes asked for", "damping ratio"),
)
LINEAR = ("modes", "damping")


def reason(row: "Row") -> str:
    """The short name of why a case was refused."""
    return next(
        (name for name, words in REASONS if any(word in row.reason for word in words)), OTHER
    )


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
            drawn = False
            for name, members in groups.items():
                colour, mark, label = MARKS[name]
                shown = [r for r in members if _shown(r, x) and _shown(r, y)]
                drawn = drawn or bool(shown)
                ax.plot(
                    [_value(r, x) for r in shown],
                    [_value(r, y) for r in shown],
                    mark,
                    color=colour,
                    ms=3.2,
                    mew=0.7,
                    ls="none",
                    label=f"{label}: {len(members)}",
                )
            ax.set_xlabel(x_label)
            ax.set_ylabel(y_label)
            if x not in LINEAR and drawn:
                ax.set_xscale("log")
            if y not in LINEAR and drawn:
                ax.set_yscale("log")
        _bars(axes.flat[-1], groups)
        handles, labels = axes.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=9)
        figure.suptitle(
            f"{len(rows)} extreme appendages: verified through MuJoCo by an independent check, or "
            "refused"
        )
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=110, metadata={"Software": None})
        return small(stream.getvalue())


def small(png: bytes) -> bytes:
    """The same picture in 64 colours."""
    stream = io.BytesIO()
    Image.open(io.BytesIO(png)).convert("RGB").quantize(64).save(
        stream, format="PNG", optimize=True
    )
    return stream.getvalue()


def _bars(ax: "Axes", groups: "dict[str, list[Row]]") -> None:
    """How many cases were refused, or keep fewer modes, for which reason."""
    counts = {key: Counter(reason(row) for row in groups[key]) for key in ("refused", "fewer")}
    names = sorted(
        {*counts["refused"], *counts["fewer"]},
        key=lambda n: counts["refused"][n] + counts["fewer"][n],
    )
    for key, label in (("refused", "refused"), ("fewer", "fewer modes")):
        at = [(i, counts[key][name]) for i, name in enumerate(names) if counts[key][name]]
        bars = ax.barh(
            [y for y, _ in at], [n for _, n in at], height=0.6, color=MARKS[key][0], label=label
        )
        ax.bar_label(bars, padding=2, fontsize=7.5)
    ax.set_yticks(range(len(names)), names, fontsize=7.5)
    ax.set_xscale("log")
    ax.set_xlim(0.7, 3.0 * max((max(c.values(), default=1) for c in counts.values()), default=1))
    ax.set_xlabel("cases")
    ax.set_title("why", fontsize=10)
    ax.legend(fontsize=7.5, loc="lower right")


def _shown(row: "Row", field: str) -> bool:
    value = _value(row, field)
    return field in LINEAR or (value > 0.0 and not (field == "taper" and value == 1.0))


def _value(row: "Row", field: str) -> float:
    value = float(getattr(row.case, field))
    # whole numbers lie on top of each other: spread them by the case's own length
    return value + 0.3 * (row.case.slenderness % 1.0) if field == "modes" else value
