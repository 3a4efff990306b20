"""Chains that are not exact, to compare with: equal links with hinge stiffness from EI,
and the 2008 paper's three links.

Theory: docs/theory.md, section 3.
"""

from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from beamchain.chain.chain import Chain, Link, sprung
from beamchain.checks import one_of, whole_number
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine, Moments

RECIPES = ("classical", "midpoint")


def rigid_link(line: MassLine, start: float, end: float) -> Link:
    """The piece of an appendage between `start` and `end`, frozen."""
    m = Moments(*line.moments([start, end])[0].tolist())
    bending = m.second - m.first**2 / m.mass
    return Link(
        start=start,
        length=end - start,
        mass=m.mass,
        com=m.first / m.mass,
        inertia=(m.polar, bending + m.rotary_xz, bending + m.rotary_xy),
    )


def freeze_between(beam: Beam, hinges: Array, stiffness: Array, port: str) -> Chain:
    """Freeze the beam between hinges `(h,)` [m], 0: at the root, with springs `(h,)`."""
    edges = [0.0, *hinges.tolist(), beam.length]
    links = [
        Link(0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)) if b <= a else rigid_link(beam.line, a, b)
        for a, b in pairwise(edges)
    ]
    return Chain(tuple(links), sprung(port, hinges, stiffness), beam.length)


def equal_links(beam: Beam, count: int, recipe: str, port: str = "xy") -> Chain:
    """`count` equal segments with one hinge each, of EI N/L:
    the inverse compliance of the stretch that it stands for.

    "classical": at the inner end of every link, with 2 EI N/L at the root; "midpoint": in the
    middle of every segment.
    """
    one_of("recipe", recipe, RECIPES)
    whole_number("links", count, 1, 5000)
    h = beam.length / count
    inner = h * np.arange(count, dtype=np.float64)
    if recipe == "midpoint":
        hinges = inner + h / 2.0
        stretches = [(a, a + h) for a in inner]
    else:
        hinges = inner
        stretches = [(max(a - h / 2.0, 0.0), a + h / 2.0) for a in inner]
    stiffness = np.array([1.0 / beam.compliance(float(a), float(b), port) for a, b in stretches])
    return freeze_between(beam, hinges, stiffness, port)


def seed_frequency_factors(k: float) -> tuple[float, float]:
    """`w1*`, `w2*` of the paper's chain, equation (17): w = w* sqrt(c/m) / l."""
    root6 = 4.0 * np.sqrt(6.0)
    w1 = root6 / ((1.0 - k) * np.sqrt(1.0 + 2.0 * k - 3.0 * k**2))
    w2 = root6 / (k * (1.0 - k) * np.sqrt(3.0 - 2.0 * k - k**2))
    return float(w1), float(w2)


def seed_ratio(k: float) -> float:
    """`w1 / w2`, equation (18)."""
    return float(k * np.sqrt(k + 3.0) / np.sqrt(3.0 * k + 1.0))


def seed_parameters(
    mass: float, length: float, omega1: float, omega2: float
) -> tuple[float, float]:
    """The paper's `k` and `c` [N m] for two free frequencies [rad/s] of a beam."""
    ratio = omega1 / omega2
    if not 0.0 < ratio < 1.0:
        raise InputError(
            f"omega1 / omega2 = {ratio!r} must lie between 0 and 1 for the paper's three links."
        )
    k = float(brentq(lambda x: seed_ratio(x) - ratio, 0.0, 1.0, xtol=1e-15, rtol=1e-14))
    return k, mass * (omega1 * length / seed_frequency_factors(k)[0]) ** 2


def seed_chain(beam: Beam, k: float, c: float, port: str = "xy") -> Chain:
    """Links `(1-k)l/2, k l, (1-k)l/2` and two springs `c` [N m/rad] (Belonozhko 2008)."""
    if not beam.uniform:
        raise InputError(
            "the 2008 paper's three links stand for a uniform beam; fit this appendage with "
            "`beamchain fit`."
        )
    ends = np.array([(1.0 - k) / 2.0, (1.0 + k) / 2.0]) * beam.length
    return freeze_between(beam, ends, np.array([c, c]), port)
