"""The figure of pointing.md, behind whose Python this is run: make docs-pictures."""

from pathlib import Path

from beamchain.pointing.plots import pointing_figure
from beamchain.report import to_svg

Path("pointing.svg").write_text(to_svg(pointing_figure(budget), "jitter"), encoding="utf-8")  # noqa: F821  # pyright: ignore
