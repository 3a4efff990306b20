"""Mode shapes of the beam and of its chain, laid over each other;
the drawing rings by style sheet alone."""

from typing import TYPE_CHECKING, Any

import numpy as np

from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.report.curves import kept_count
from beamchain.report.formats import error_text
from beamchain.report.page import page_text
from beamchain.report.plots import BEAM, OURS
from beamchain.structure.beam import Beam
from beamchain.structure.discretise import Parts, sampled_model

if TYPE_CHECKING:
    from beamchain.chain.chain import Chain
    from beamchain.fitting.result import Fit

WIDTH, HEIGHT, LEFT, SWING = 640.0, 116.0, 14.0, 36.0  # of a mode's strip and its largest amplitude
SLOWEST = 2.4  # seconds that the first mode takes for one oscillation on the page
FASTEST = 0.5
MOST = 6  # modes drawn
POINTS = 80  # of a beam's shape, beside the root and the ends of segments
MODES = 12  # that the sampled beam has at least


def beam_shapes(beam: Beam, port: str, count: int, points: int = POINTS) -> tuple[Array, Array]:
    """`x` `(k,)` [m] and displacement (or angle) `(count, k)` in the beam's mass-normalised
    cantilever modes, from its finite elements."""
    x = np.union1d(np.linspace(0.0, beam.length, points + 1), beam.starts)
    parts = Parts(beam.segments, beam.joints, beam.lumps)
    model = sampled_model(parts, port, max(count, MODES), tuple(x[1:-1].tolist()))
    assert model.tip is not None
    # columns: of the tip, then of every station; in bending each with its slope
    moved = model.tip[:count, :: 2 if port in ("xy", "xz") else 1]
    return x, np.column_stack([np.zeros(moved.shape[0]), moved[:, 1:], moved[:, 0]])


def chain_shapes(chain: "Chain", port: str, model: PortModel) -> tuple[Array, Array]:
    """Displacement (or angle) at the ends of the links in the chain's
    mass-normalised cantilever modes.

    `x` `(k,)` [m] and the shapes `(n, k)`; in torsion and axial motion each hinge stands twice,
    before and after.
    """
    at = np.array([hinge.x for hinge in chain.hinges if port in hinge.stiffness])
    angles = chain.shapes(port)
    if port in ("xy", "xz"):
        x = np.array([0.0, *at, chain.length])
        return x, angles @ np.clip(x[None] - at[:, None], 0.0, None)
    x = np.array([0.0, *np.repeat(at, 2), chain.length])
    passed = np.cumsum(angles, axis=1)
    before = np.column_stack([np.zeros(model.modes), passed[:, :-1]])
    steps = np.stack([before, passed], axis=2).reshape(model.modes, -1)
    return x, np.column_stack([np.zeros(model.modes), steps, passed[:, -1]])


def all_shapes(fit: "Fit") -> dict[str, str]:
    """Inline SVGs by port, where there are shapes."""
    drawn = {port: shapes_svg(fit, port) for port in fit.target}
    return {port: svg for port, svg in drawn.items() if svg}


def shapes_svg(fit: "Fit", port: str) -> str:
    """Inline SVG of the kept modes of a port, beam under chain;
    empty where the beam or the chain has no shape."""
    beam = fit.beam
    if beam is None:
        return ""
    ours = fit.chain.port(port)
    count = min(kept_count(fit, port), ours.modes, MOST)
    full = fit.full[port].truncated(count)
    nodes, bent = chain_shapes(fit.chain, port, ours)
    x, exact = beam_shapes(beam, port, count)
    exact = exact * np.sign(exact[:, -1] * bent[:count, -1])[:, None]

    def points(at: Array, shape: Array, size: float) -> list[str]:
        scale = (WIDTH - 2.0 * LEFT) / beam.length
        return [f"{LEFT + scale * a:.1f} {-size * b:.1f}" for a, b in zip(at, shape, strict=True)]

    strips: list[dict[str, Any]] = []
    for k, (a, b) in enumerate(zip(full.frequencies, ours.frequencies[:count], strict=True)):
        size = SWING / float(np.abs(exact[k]).max())
        strips.append(
            {
                "told": f"{a:.5g} rad/s, chain {error_text(float(b / a) - 1.0)}",
                "seconds": max(SLOWEST * float(full.frequencies[0] / a), FASTEST),
                "beam": points(x, exact[k], size),
                "chain": points(nodes, bent[k], size),
            }
        )
    return page_text(
        "shapes.svg",
        port=port,
        strips=strips,
        width=WIDTH,
        height=HEIGHT,
        left=LEFT,
        ours=OURS,
        beam=BEAM,
    )
