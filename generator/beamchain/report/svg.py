"""Figures as SVG."""

import io
import warnings

from matplotlib.figure import Figure

from beamchain.report.plots import drawing


def to_svg(figure: Figure, name: str) -> str:
    """SVG text of a figure, the same for the same fit; ids carry `name`,
    so that several can stand in one page."""
    for i, ax in enumerate(figure.axes, 1):  # by itself matplotlib would count those in Hz too
        ax.set_gid(f"panel_{i}")
    stream = io.StringIO()
    with drawing(**{"svg.hashsalt": name}), warnings.catch_warnings():
        # letters are text in the file, which the reader's fonts show:
        # only their widths are guessed here
        warnings.filterwarnings("ignore", message=r"Glyph \d+ .* missing from")
        warnings.filterwarnings(
            "ignore", message=r"Matplotlib currently does not support .* natively"
        )
        figure.savefig(
            stream, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type"))
        )
    text = stream.getvalue().replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")
    for before in ('id="', "url(#", 'href="#'):
        text = text.replace(before, f"{before}{name}-")
    return text
