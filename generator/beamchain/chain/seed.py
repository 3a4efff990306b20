"""The 2008 paper's example: every printed number beside the computed one,
and the exact chain on the same beam.

P. P. Belonozhko, "Представление деформируемых упругих элементов космических аппаратов системами
твердых тел" (representing deformable elastic spacecraft elements by systems of rigid bodies), УДК
539.3 + 629.7, equation (20) ff.
"""

from typing import NamedTuple

import numpy as np

from beamchain.chain import baselines
from beamchain.chain.recursion import planar_chain, realise
from beamchain.ports.model import PortModel
from beamchain.structure.beam import Beam
from beamchain.structure.section import Material, Round
from beamchain.structure.segment import Segment

_ENTRIES = {"T0_y0": (0, 0), "M0_y0": (0, 1), "T0_phi1": (1, 0), "M0_phi1": (1, 1)}

#: The paper's numbers, as printed; a tuple holds (beam, chain).
PRINTED: dict[str, tuple[float, float]] = {
    "gain.T0_y0": (0.9069, 0.7321),
    "gain.M0_y0": (-0.2823, -0.1743),
    "gain.T0_phi1": (-0.2823, -0.1743),
    "gain.M0_phi1": (0.1160, 0.0541),
    "n1.T0_y0": (1.0648, 1.0977),
    "n1.M0_y0": (0.7105, 0.7815),
    "n1.T0_phi1": (0.7105, 0.7815),
    "n1.M0_phi1": (0.4690, 0.5613),
    "n2.T0_y0": (3.5124, 3.7917),
    "n2.M0_y0": (2.9837, 3.4521),
    "n2.T0_phi1": (2.9837, 3.4521),
    "n2.M0_phi1": (2.5745, 3.1515),
}
#: The others, in the order in which they are computed.
PRINTED_OTHER = {
    "beam.mass": 13.232,
    "beam.omega1": 1.533,
    "beam.omega2": 4.2257,
    "chain.k": 0.26985,
    "chain.c": 51.325,
    "chain.omega1": 1.533,
    "chain.omega2": 4.2257,
}


class SeedRow(NamedTuple):
    """A printed number and ours."""

    name: str
    printed: float
    computed: float

    @property
    def difference(self) -> float:
        """Relative difference."""
        return self.computed / self.printed - 1.0


class SeedTable(NamedTuple):
    """`rows`: printed and computed; `exact`: the exact 3-link chain."""

    rows: list[SeedRow]
    exact: list[tuple[str, float]]

    def as_dict(self) -> dict[str, list[dict[str, str | float]]]:
        """For JSON."""
        rows: list[dict[str, str | float]] = [
            {"name": row.name, "printed": row.printed, "computed": row.computed}
            for row in self.rows
        ]
        return {
            "rows": rows,
            "exact": [{"name": name, "computed": value} for name, value in self.exact],
        }


def seed_beam() -> Beam:
    """The paper's beam, equation (20): round steel rod, 15 m, 12 mm."""
    steel = Material(youngs_modulus=2.06e11, density=7800.0)
    return Beam(segments=(Segment(length=15.0, section=Round(diameter=0.012), material=steel),))


def port_parameters(model: PortModel) -> dict[str, float]:
    """Gains and zeros of the four transfer functions in the paper's form (15)."""
    out: dict[str, float] = {}
    for name, (i, j) in _ENTRIES.items():
        out[f"gain.{name}"] = float(model.gains[i, j])
        first, second = np.real(model.zeros(i, j))
        out[f"n1.{name}"], out[f"n2.{name}"] = float(first), float(second)
    return out


def seed_table() -> SeedTable:
    """The paper's example recomputed without rounding on the way."""
    beam = seed_beam()
    model = beam.port("xy", 6).reduced(2, np.zeros((2, 2)))
    mass = float(beam.rigid_mass()[0, 0])
    omega1, omega2 = (float(w) for w in model.free_frequencies)
    k, c = baselines.seed_parameters(mass, beam.length, omega1, omega2)
    chain = baselines.seed_chain(beam, k, c).port("xy")
    values = mass, omega1, omega2, k, c, *chain.free_frequencies[:2].tolist()
    rows = [
        SeedRow(name, printed, own)
        for (name, printed), own in zip(PRINTED_OTHER.items(), values, strict=True)
    ]
    for i, (owner, port) in enumerate((("beam", model), ("chain", chain))):
        computed = port_parameters(port)
        rows += [
            SeedRow(f"{owner}.{name}", pair[i], computed[name]) for name, pair in PRINTED.items()
        ]
    return SeedTable(rows, _exact(beam, model))


def _exact(beam: Beam, target: PortModel) -> list[tuple[str, float]]:
    nodes = realise(target)
    chain = planar_chain(nodes, beam.line)
    out: list[tuple[str, float]] = []
    for i, link in enumerate(chain.links, 1):
        out += [
            (f"link{i}.length", link.length),
            (f"link{i}.mass", link.mass),
            (f"link{i}.com", link.com - link.start),
        ]
        out.append((f"link{i}.inertia", link.inertia[2]))
    out += [
        (f"hinge{i}.stiffness", hinge.stiffness["xy"]) for i, hinge in enumerate(chain.hinges, 1)
    ]
    model = chain.port("xy")
    out += [
        ("omega1", float(model.free_frequencies[0])),
        ("omega2", float(model.free_frequencies[1])),
    ]
    return out + list(port_parameters(model).items())
