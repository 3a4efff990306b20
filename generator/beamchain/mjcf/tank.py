"""The looks of a tank's liquid: a translucent cylinder, and a ball per pendulum."""

from beamchain.chain.chain import Chain
from beamchain.mjcf.visuals import Shape
from beamchain.structure.slosh import Slosh

LIQUID = "0.35 0.6 0.85 0.3"
BALL = "0.2 0.4 0.75 1"
DENSE = 0.05  # of the tank's radius: half of the largest ball's
SMALLEST = 0.03  # of the tank's radius


def tank_shapes(liquid: Slosh, chain: Chain) -> list[list[Shape]]:
    """Shapes of the fixed mass and of every pendulum: balls with volumes as their masses."""
    half = liquid.height / 2.0
    out = [[Shape("cylinder", half, (half, liquid.radius, liquid.radius), LIQUID)]]
    heaviest = max(link.mass for link in chain.links[1:])
    for link in chain.links[1:]:
        share = (link.mass / heaviest) ** (1.0 / 3.0)
        radius = liquid.radius * max(2.0 * DENSE * share, SMALLEST)
        out.append([Shape("sphere", link.com, (radius, radius, radius), BALL)])
    return out
