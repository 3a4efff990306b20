"""One chain with springs on its hinges from each port's own realisation, where all ports can share the same bodies.

Theory: docs/theory.md, section 3.
"""

from collections.abc import Mapping

import numpy as np

from beamchain.chain import polar
from beamchain.chain.chain import Chain, Hinge
from beamchain.chain.recursion import Nodes, planar_links
from beamchain.errors import RealisationError
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine

SAME = 1e-9  # relative: hinges and masses of two planes closer than this are the same


def assemble(beam: MassLine, nodes: Mapping[str, Nodes], strings: Mapping[str, tuple[Array, Array]]) -> Chain:
    """The chain whose bodies serve all planes, torsion springs on its hinges.

    Args:
        beam: the appendage.
        nodes: per plane, its canonical chain.
        strings: per scalar port, its inertias and springs.

    Raises:
        RealisationError: the ports do not share their bodies.
    """
    total = beam.moments(0.0, beam.length, closed=True)
    rotary = abs(total.rotary_xy - total.rotary_xz) / total.second
    if len(nodes) == 1 and not isinstance(beam, Beam):
        rotary = 0.0  # of imported mass it is known to the print, and only one plane asks
    shared = _shared(nodes, rotary)
    if shared is None:
        raise RealisationError("the planes do not share their hinges.")
    if "axial" in strings:
        raise RealisationError("axial modes do not share the hinges of bending.")
    own = total.polar if total.polar > polar.NO_POLAR * total.second else 0.0
    links, cuts = planar_links(shared, beam), shared.positions[1:-1]
    inertias = np.array([own]) if "torsion" not in strings else strings["torsion"][0]
    turning, polars = polar.place(beam, links, cuts, inertias, polar.real_polar(beam, cuts))
    torsion = dict(zip(turning, strings["torsion"][1].tolist(), strict=True)) if "torsion" in strings else {}
    hinges = tuple(
        Hinge(
            x=float(x),
            stiffness={port: float(own.stiffness[i]) for port, own in nodes.items()}
            | ({"torsion": torsion[i]} if i in torsion else {}),
        )
        for i, x in enumerate(cuts)
    )
    return Chain(tuple(polar.with_polar(links, polars)), hinges, beam.length)


def _shared(nodes: Mapping[str, Nodes], rotary: float) -> Nodes | None:
    """The nodes that serve every bending plane at once, if there are such."""
    if not nodes or rotary > SAME:
        return None
    first, *others = nodes.values()
    for other in others:
        if other.masses.size != first.masses.size:
            return None
        if np.any(np.abs(other.masses - first.masses) > SAME * first.masses) or np.any(
            np.abs(other.lengths - first.lengths) > SAME * first.lengths
        ):
            return None
    return first
