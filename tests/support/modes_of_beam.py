"""A beam's modes as another program would deliver them."""

import json

import numpy as np

from beamchain.ports.compose import in_space
from beamchain.ports.motions import PORT_MOTION
from beamchain.structure.mass_line import MassPiece
from beamchain.structure.modal_data import EXACT, ModalData
from beamchain.structure.readers.own_format import FULL_DIGITS

STATIONS = 5  # a linear taper's mass per length is quadratic, its polar inertia quartic: five stations are exact


def line_of(beam):
    """Pieces and points of a beam, exact for linear tapers."""
    pieces = []
    for x0, segment in zip(beam.starts, beam.segments, strict=True):
        at = segment.at(np.linspace(0.0, 1.0, STATIONS))
        turn = 1.0 if segment.theory == "timoshenko" else 0.0
        rows = np.column_stack([at.mass, at.polar, turn * at.rotary_xy, turn * at.rotary_xz])
        pieces.append(MassPiece(x0, segment.length, rows))
    points = [[b.x, b.mass, b.inertia[0], b.inertia[2], b.inertia[1]] for b in beam.lumps]
    return tuple(pieces), np.array(points, dtype=np.float64).reshape(-1, 5)


def modes_of_beam(beam, modes, *, every=False):
    """The lowest modes per port; `every`: all of the discretisation, of which those are the converged ones."""
    ports = {port: beam.port(port, 2 * count + 4) for port, count in modes.items()}
    if not every:
        ports = {port: model.truncated(modes[port]) for port, model in ports.items()}
    rigid = beam.rigid_mass()
    whole = in_space(ports, rigid + np.diag([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]) * (rigid[3, 3] <= 0))
    tip = np.vstack([m.tip @ PORT_MOTION[p].T for p, m in ports.items() if m.tip is not None])
    order = np.argsort(np.concatenate([m.frequencies for m in ports.values()]), kind="stable")
    pieces, points = line_of(beam)
    return ModalData(
        rigid, whole.frequencies, whole.participation, tip=tip[order], length=beam.length, pieces=pieces,
        points=points, source="a beam",
    )  # fmt: skip


def modes_text(data):
    """The data as a .toml file that reads back as the same numbers."""

    def listed(values):
        return "[" + ", ".join(repr(float(v)) for v in values) + "]"

    def table(key, rows):
        return [f"{key} = [", *(f"  {listed(row)}," for row in rows), "]"]

    out = [f"note = {json.dumps(f'{data.source}; SI, about the port')}", f"frequencies = {listed(data.frequencies)}"]
    out += table("participation", data.participation.T) + table("mass", data.rigid_mass)
    out.append(f"damping = {listed(data.damping)}")
    out.append(f"digits = {FULL_DIGITS if data.precision <= EXACT else round(-np.log10(data.precision / 5.0))}")
    if data.tip is not None:
        out += table("tip", data.tip.T)
    if data.length is not None:
        out.append(f"length = {float(data.length)!r}")
    for piece in data.pieces:
        out += ["", "[[line]]", f"start = {float(piece.start)!r}", f"length = {float(piece.length)!r}"]
        names = ("mass", "polar", "rotary_xy", "rotary_xz")
        out += [f"{name} = {listed(piece.densities[:, i])}" for i, name in enumerate(names)]
    for point in data.points:
        out += ["", "[[points]]"]
        names = ("x", "mass", "polar", "rotary_xy", "rotary_xz")
        out += [f"{name} = {float(value)!r}" for name, value in zip(names, point, strict=True)]
    return "\n".join(out) + "\n"
