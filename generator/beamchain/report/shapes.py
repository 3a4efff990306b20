"""Mode shapes of the beam and of its chain, laid over each other; the drawing rings by style sheet alone."""

from typing import TYPE_CHECKING

import numpy as np

from beamchain.motion import Array
from beamchain.port import PortModel
from beamchain.report.plots import BEAM, OURS, percent
from beamchain.structure.beam import Beam
from beamchain.structure.shapes import mode_shapes

if TYPE_CHECKING:
    from beamchain.chain.chain import Chain
    from beamchain.result import Fit

WIDTH, HEIGHT, LEFT, SWING = 640.0, 116.0, 14.0, 36.0  # of a mode's strip and its largest amplitude
SLOWEST = 2.4  # seconds that the first mode takes for one oscillation on the page
FASTEST = 0.5
MOST = 6  # modes drawn


def chain_shapes(chain: "Chain", port: str, model: PortModel) -> tuple[Array, Array]:
    """Displacement (or angle) at the ends of the links in the chain's mass-normalised cantilever modes.

    Args:
        chain: whose hinges move in `port`.
        port: any.
        model: `chain.port(port)`.

    Returns:
        `x` `(k,)` [m] and the shapes `(n, k)`; in torsion and axial motion each hinge stands twice, before and after.
    """
    at = np.array([hinge.x for hinge in chain.hinges if port in hinge.stiffness])
    angles = chain.shapes(port, model)
    if port in ("xy", "xz"):
        x = np.array([0.0, *at, chain.length])
        return x, angles @ np.clip(x[None] - at[:, None], 0.0, None)
    x = np.array([0.0, *np.repeat(at, 2), chain.length])
    passed = np.cumsum(angles, axis=1)
    before = np.column_stack([np.zeros(model.modes), passed[:, :-1]])
    steps = np.stack([before, passed], axis=2).reshape(model.modes, -1)
    return x, np.column_stack([np.zeros(model.modes), steps, passed[:, -1]])


def kept_modes(fit: "Fit", port: str) -> int:
    """How many modes of a port were kept: a target may hold static shapes of further points beside them."""
    return min(fit.target[port].modes, len(fit.error[port].matches)) if port in fit.error else fit.target[port].modes


def shapes_svg(fit: "Fit", port: str) -> str:
    """Inline SVG of the kept modes of a port, beam under chain; empty where the beam or the chain has no shape."""
    beam = fit.mass_line
    if not isinstance(beam, Beam):
        return ""
    ours = fit.chain.port(port)
    count = min(kept_modes(fit, port), ours.modes, MOST)
    full = fit.full[port].truncated(count)
    x, exact = mode_shapes(beam, port, full)
    nodes, bent = chain_shapes(fit.chain, port, ours)
    first = float(full.frequencies[0])
    strips = [
        _strip(k, beam.length, (x, exact[k]), (nodes, bent[k]), _told(full, ours, k), _seconds(full, k, first))
        for k in range(count)
    ]
    label = f"Shapes of the first {count} cantilever modes in {port}: the beam's and the chain's, over each other."
    return (
        f'<svg class="shapes" role="img" aria-label="{label}" viewBox="0 0 {WIDTH:g} {HEIGHT * count:g}">'
        + "".join(strips)
        + "</svg>"
    )


def _told(full: PortModel, ours: PortModel, k: int) -> str:
    a, b = float(full.frequencies[k]), float(ours.frequencies[k])
    return f"mode {k + 1}: {a:.5g} rad/s, chain {percent(b / a - 1.0)} off"


def _seconds(full: PortModel, k: int, first: float) -> float:
    return max(SLOWEST * first / float(full.frequencies[k]), FASTEST)


def _strip(
    k: int, length: float, beam: tuple[Array, Array], chain: tuple[Array, Array], told: str, seconds: float
) -> str:
    size = SWING / float(np.abs(beam[1]).max())
    scale = (WIDTH - 2.0 * LEFT) / length

    def path(x: Array, y: Array) -> str:
        return "M" + "L".join(f"{LEFT + scale * a:.1f} {-size * b:.1f}" for a, b in zip(x, y, strict=True))

    dots = "".join(
        f"M{LEFT + scale * a:.1f} {-size * b:.1f}h0" for a, b in zip(chain[0][1:-1], chain[1][1:-1], strict=True)
    )
    every = max(beam[0].size // 80, 1)
    keep = np.unique([*range(0, beam[0].size, every), beam[0].size - 1])
    end = WIDTH - LEFT
    return (
        f'<g transform="translate(0 {HEIGHT * (k + 0.57):g})">'
        f'<text x="{LEFT:g}" y="{-HEIGHT * 0.43:g}">{told}</text>'
        f'<path class="rest" d="M{LEFT:g} 0H{end:g}M{LEFT:g} -14V14"/>'
        f'<g class="ring" style="animation-duration:{seconds / 2.0:.2f}s">'
        f'<path d="{path(*chain)}" stroke="{OURS}" stroke-width="4" opacity="0.85"/>'
        f'<path d="{path(beam[0][keep], beam[1][keep])}" stroke="{BEAM}" stroke-width="1.4"/>'
        f'<path d="{dots}" stroke="{OURS}" stroke-width="11" class="dot"/>'
        f'<path d="{dots}" stroke="#fff" stroke-width="6" class="dot"/>'
        "</g></g>"
    )
