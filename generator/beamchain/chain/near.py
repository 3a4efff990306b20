"""Chains of a mass line: exact where that is physical, else the nearest by least squares, its loss stated."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from beamchain.chain import polar
from beamchain.chain.build import PLANES, Built, Status, TargetOf, build_exact
from beamchain.chain.chain import Chain, Hinge
from beamchain.chain.least_squares import NOTHING, Case, fit_planar, fit_stiffness
from beamchain.chain.realise import planar_links
from beamchain.errors import RealisationError
from beamchain.port import PortModel
from beamchain.structure.mass_line import MassLine, SpreadMass

POLAR_SHARES = (1.0, 0.7, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01)  # of the polar inertia a chain is tried with
MOST = 3  # modes per port: what is coupled beyond chains gains nothing from more
LEAST_NODE = 1e-3  # of the mass: a node that least squares made lighter is no part of a chain


def build_near(line: MassLine, targets: Mapping[str, PortModel]) -> Built:
    """A chain whose stiffness, lengths and masses come nearest to the first modes of each port.

    Args:
        line: how the mass lies.
        targets: per port, its own modes.

    Raises:
        RealisationError: no bending plane takes part, or no start converges to a physical chain.
    """
    planes = [port for port in targets if port in PLANES]
    if not planes:
        raise RealisationError("no mode moves mainly in a bending plane, which a chain needs.")
    first = max(planes, key=lambda port: targets[port].modes)
    most = MOST
    while True:
        cut = {port: model.truncated(min(model.modes, most)) for port, model in targets.items() if port != "axial"}
        links = np.full(cut[first].modes + 1, line.length / (cut[first].modes + 1))
        found = fit_planar(line, first, [Case(NOTHING, cut[first])], links)
        nodes = found.nodes
        assert nodes is not None  # the masses are free
        if most == 1 or nodes.masses.min() > LEAST_NODE * nodes.masses.sum():
            break
        most -= 1
    pieces = planar_links(nodes, line)
    real = polar.real_polar(line, found.positions)
    _, polars = polar.place(line, pieces, found.positions, np.array([real.sum()]), real)
    hinges = tuple(
        Hinge(x=float(x), stiffness={first: float(c)}) for x, c in zip(found.positions, found.stiffness, strict=True)
    )
    chain = Chain(tuple(polar.with_polar(pieces, polars)), hinges, line.length)
    notes = [f"No exact chain; {first}: {found.message}"]
    kept = {first: cut[first]}
    edges = [0.0, *found.positions.tolist(), line.length]
    for port, model in cut.items():
        if port == first:
            continue
        kept[port] = model.truncated(min(model.modes, len(hinges)))
        start = np.array([2.0 / line.compliance(a, b, port) for a, b in zip(edges[:-2], edges[2:], strict=True)])
        chain, miss = fit_stiffness(chain, port, kept[port], start)
        notes.append(f"{port}: springs by least squares, worst relative residual {miss:.2e}.")
    left = sum(model.modes for model in targets.values()) - sum(model.modes for model in kept.values())
    if left:
        notes.append(f"{left} of the modes asked for are left out.")
    return Built(chain, kept, Status(False, " ".join(notes), found.history))


def build_chain(
    line: MassLine, counts: Mapping[str, int], targets: Mapping[str, PortModel], target_of: TargetOf
) -> tuple[Built, MassLine, list[str]]:
    """The exact chain, else the nearest.

    Thin links that cannot carry a wide appendage's polar inertia carry less of it, which is said.
    """
    reasons: list[RealisationError] = []

    def exact(own: MassLine) -> Built:
        return build_exact(own, counts, target_of)

    def near(own: MassLine) -> Built:
        return build_near(own, targets)

    for build in (exact, near):
        for share in POLAR_SHARES:
            own = line if share == 1.0 else _narrowed(line, share)
            try:
                built = build(own)
            except RealisationError as error:
                reasons.append(error)
                if "polar" not in str(error) and "both planes" not in str(error):
                    break
                continue
            if share == 1.0:
                return built, line, []
            note = f"The links are too thin for the appendage's width: they carry {share:g} of its polar inertia."
            return built, line, [note]
    raise reasons[0]


def _narrowed(line: MassLine, share: float) -> MassLine:
    """The line with a share of its polar inertia, and none that its breadth adds in one plane only."""
    assert isinstance(line, SpreadMass)
    keep = np.array([1.0, share, 0.0, 0.0])
    pieces = tuple(replace(piece, densities=piece.densities * keep) for piece in line.pieces)
    return replace(line, pieces=pieces, points=line.points * np.array([1.0, *keep]))


def same_planes(targets: dict[str, PortModel], tolerance: float) -> None:
    """Planes that agree within the print become one, so that they share their hinges."""
    if not {"xy", "xz"} <= set(targets):
        return
    a, b = targets["xy"], targets["xz"]
    if a.modes != b.modes:
        return
    scale = np.sqrt(np.diag(a.rigid_mass))
    gap = max(
        float(np.max(np.abs(a.frequencies / b.frequencies - 1.0))),
        float(np.max(np.abs((a.participation - b.participation) / scale))),
        float(np.max(np.abs((a.rigid_mass - b.rigid_mass) / np.outer(scale, scale)))),
    )
    if gap <= tolerance:
        targets["xz"] = b.replaced(rigid_mass=a.rigid_mass, frequencies=a.frequencies, participation=a.participation)
