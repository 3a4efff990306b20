"""A superelement with several interface grids in axes of their own, and a writer of the files by
which such are delivered: OUTPUT4 in all its forms, assembly and punch files.

The structure is a frame of `frames.py`: three struts from three interface grids to a node that
carries a mast with a skew boom. It is reduced after Craig and Bampton here. Nothing is imported
from the package, and nothing is shared with its readers.
"""

import struct
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg import eigh

import frames
from solver import moved

GRIDS = (3, 11, 27)
PORT = 45  # the end of the mast, where it is an interface grid as well
PLACES = {  # mm
    3: (100.0, 250.0, 0.0),
    11: (100.0, -250.0, 300.0),
    27: (100.0, -250.0, -300.0),
    PORT: (1700.0, 0.0, 0.0),
}
FIRST_SCALAR = 5001
# axes of the components of grids 3 and 27: (origin, a point on z, a point in the plane of x and z)
SYSTEMS = {
    10: ("R", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    12: ("C", (130.0, 50.0, 80.0), (130.0, 53.0, 84.0), (131.0, 50.0, 80.0)),
}
OUTPUT = {3: 10, 11: 0, 27: 12, PORT: 10}


@dataclass(frozen=True)
class Superelement:
    """Craig-Bampton matrices in mm, t, N over the freedoms of the grids and then of the modes; and
    of the whole mesh, in basic axes: modes with the three grids held `(n,)`, their participation
    about the mean of these `(n, 6)`, motion of the port `(n, 6)`, rigid mass about it `(6, 6)`."""

    mass: np.ndarray
    stiffness: np.ndarray
    frequencies: np.ndarray
    participation: np.ndarray
    motion: np.ndarray
    rigid: np.ndarray
    grids: tuple


def output_axes(grid):
    """Rows: the directions of a grid's components, from the points of its system."""
    if OUTPUT[grid] == 0:
        return np.eye(3)
    kind, origin, on_z, in_xz = SYSTEMS[OUTPUT[grid]]
    origin = np.array(origin)
    z = np.array(on_z) - origin
    z /= np.linalg.norm(z)
    x = np.array(in_xz) - origin
    x -= z * (z @ x)
    x /= np.linalg.norm(x)
    if kind == "C":  # x of the components points away from the axis
        x = np.array(PLACES[grid]) - origin
        x -= z * (z @ x)
        x /= np.linalg.norm(x)
    return np.vstack([x, np.cross(z, x), z])


@cache
def superelement(modes=22, port=False):
    """The structure, with so many modes kept; `port`: with the end of its mast as a fourth grid."""
    grids = (*GRIDS, PORT) if port else GRIDS
    apex = (500.0, 0.0, 0.0)
    mast = PLACES[PORT]
    tube = {"young": 7e4, "density": 2.7e-9}
    legs = [frames.tube(PLACES[grid], apex, 3, 24.0, 1.5, **tube) for grid in GRIDS]
    legs.append(frames.tube(apex, mast, 8, 40.0, 1.5, **tube))
    legs.append(frames.strip(mast, (2000.0, 500.0, 200.0), 5, 30.0, 8.0, **tube))
    nodes, mass, stiffness = _mesh(legs, [PLACES[grid] for grid in grids])
    end = frames.node_at(nodes, legs[-1].end)
    mass[6 * end : 6 * end + 3, 6 * end : 6 * end + 3] += 4e-4 * np.eye(3)
    reference = np.mean([PLACES[grid] for grid in GRIDS], axis=0)
    rigid = np.vstack([moved(np.eye(6), p - reference) for p in nodes])
    held = 6 * len(GRIDS)
    squares, shapes = eigh(stiffness[held:, held:], mass[held:, held:])
    end = 6 * frames.node_at(nodes, mast) - held
    reduced = _craig_bampton(mass, stiffness, grids, modes)
    # the truth is of the whole mesh: rigid motion of every node, no reduction
    return Superelement(
        _symmetric(reduced.T @ mass @ reduced),
        _symmetric(reduced.T @ stiffness @ reduced),
        np.sqrt(squares[:modes]),
        shapes[:, :modes].T @ (mass @ rigid)[held:],
        shapes[end : end + 6, :modes].T,
        rigid.T @ mass @ rigid,
        grids,
    )


def _mesh(legs, held):
    """Nodes, the held ones first, mass and stiffness of the bars of a frame."""
    nodes, members = frames.nodes_of(legs, held)
    size = 6 * len(nodes)
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    for i, j, leg in members:
        m, _, s = frames.element(nodes[i], nodes[j], leg)
        at = np.r_[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
        mass[np.ix_(at, at)] += m.T @ m
        stiffness[np.ix_(at, at)] += s.T @ s
    return nodes, mass, stiffness


FEET = {1: (600.0, -900.0, 350.0), 2: (1000.0, -900.0, 350.0)}  # mm, on a line along x
FEET_SYSTEM = "CORD2R,7,,1000.,-900.,350.,1001.,-900.,350.\n,1000.,-899.,350.\n"  # of grid 2
FEET_TURN = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class Wing:
    """A wing on two feet, in mm, t, N: over the freedoms of both feet and of the modes its mass,
    stiffness, the displacements of a corner of its tip `(3, n)` and the forces of the first bar at
    the first foot `(6, n)`, in basic axes; and of the whole mesh its nodes, mass and stiffness, the
    feet first, and the motion of all nodes per freedom."""

    mass: np.ndarray
    stiffness: np.ndarray
    corner: np.ndarray
    bar: np.ndarray
    nodes: tuple
    mesh_mass: np.ndarray
    mesh_stiffness: np.ndarray
    motion: np.ndarray


@cache
def wing_on_two_feet(modes=14):
    """A wing of tubes in a plane that leaves its feet along -y: Craig-Bampton mass and stiffness in
    mm, t, N, over both feet, the second in turned axes, and the modes. Soft across the plane, with
    cells of the stiffness that are zero by symmetry, but for what rounding left there."""
    tube = {"young": 7e4, "density": 2.7e-9}
    z, root, tip = 350.0, -1900.0, -4900.0
    legs = [
        frames.tube(FEET[1], (500.0, root, z), 4, 40.0, 1.5, **tube),
        frames.tube(FEET[2], (1100.0, root, z), 4, 40.0, 1.5, **tube),
        frames.tube((500.0, root, z), (1100.0, root, z), 2, 40.0, 1.5, **tube),
        frames.tube((500.0, root, z), (500.0, tip, z), 6, 24.0, 1.0, **tube),
        frames.tube((1100.0, root, z), (1100.0, tip, z), 6, 24.0, 1.0, **tube),
        frames.tube((500.0, tip, z), (1100.0, tip, z), 2, 24.0, 1.0, **tube),
    ]
    nodes, mass, stiffness = _mesh(legs, list(FEET.values()))
    corner = frames.node_at(nodes, (500.0, tip, z))
    mass[6 * corner : 6 * corner + 3, 6 * corner : 6 * corner + 3] += 5e-4 * np.eye(3)  # 0.5 kg
    shapes = eigh(stiffness[12:, 12:], mass[12:, 12:])[1][:, :modes]
    # a solver leaves the sign of a shape open: here its sum, weighted from 1 to 2, is positive
    shapes = shapes * np.sign(np.linspace(1.0, 2.0, len(shapes)) @ shapes)
    follow = -np.linalg.solve(stiffness[12:, 12:], stiffness[12:, :12])
    turn = np.eye(12)
    turn[6:, 6:] = np.kron(np.eye(2), FEET_TURN.T)
    motion = np.vstack(
        [np.hstack([turn, np.zeros((12, modes))]), np.hstack([follow @ turn, shapes])]
    )
    first = legs[0]
    step = (np.array(first.end) - np.array(first.start)) / first.elements
    _, _, strain = frames.element(np.array(first.start), np.array(first.start) + step, first)
    second = frames.node_at(nodes, first.start + step)
    at = np.r_[:6, 6 * second : 6 * second + 6]
    return Wing(
        _symmetric(motion.T @ mass @ motion),
        _symmetric(motion.T @ stiffness @ motion),
        motion[6 * corner : 6 * corner + 3],
        (strain.T @ strain @ motion[at])[:6],
        tuple(nodes),
        mass,
        stiffness,
        motion,
    )


SHIPPED = 8  # modes of the delivery that the package ships


def shipped_wing():
    """Texts of the delivery that `beamchain init wing` writes, by ending."""
    wing = wing_on_two_feet(SHIPPED)
    matrices = {
        "KAA": wing.stiffness,
        "MAA": wing.mass,
        "MUG1": wing.corner,
        "MEF1": wing.bar,
    }
    pairs = [(grid, "123456") for grid in FEET]
    pairs += [(FIRST_SCALAR + k, "0") for k in range(SHIPPED)]
    cells = [f"{number:8d}{components:>8}" for number, components in pairs]
    rows = ["".join(cells[k : k + 4]) for k in range(0, len(cells), 4)]
    punch = "\n".join(["EXTRN   " + rows[0], *("        " + row for row in rows[1:])])
    return {
        "op4": op4_text(matrices).decode(),
        "asm": feet_text(modes=SHIPPED),
        "pch": punch + "\n",
    }


def feet_text(places=FEET, systems=(0, 7), modes=14):
    """The assembly file of `wing_on_two_feet`."""
    out = "$ superelement 101\n" + FEET_SYSTEM
    for (grid, place), system in zip(places.items(), systems, strict=True):
        out += f"GRID,{grid},,{','.join(map(str, place))},{system}\n"
    return out + f"SPOINT,{FIRST_SCALAR},THRU,{FIRST_SCALAR + modes - 1}\n"


def _craig_bampton(mass, stiffness, grids, modes):
    """Motion of the mesh per freedom of the grids, in their own axes, and per mode."""
    held = 6 * len(grids)
    shapes = eigh(stiffness[held:, held:], mass[held:, held:])[1][:, :modes]
    follow = -np.linalg.solve(stiffness[held:, held:], stiffness[held:, :held])
    turn = np.zeros((held, held))  # basic motion per motion in the grids' own axes
    for k, grid in enumerate(grids):
        turn[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = np.kron(np.eye(2), output_axes(grid).T)
    own = np.hstack([turn, np.zeros((held, shapes.shape[1]))])
    return np.vstack([own, np.hstack([follow @ turn, shapes])])


def _symmetric(matrix):
    return (matrix + matrix.T) / 2.0


# -- OUTPUT4 ---------------------------------------------------------------------------------------
def _runs(column):
    """First rows and numbers of the strings of a column that are not zero."""
    rows = np.flatnonzero(column)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        if run.size:
            yield int(run[0]) + 1, column[run]


def op4_binary(matrices, form="dense", order="<", wide=False, single=False):
    """An OUTPUT4 file: matrices by name; form "dense", "sparse" or "bigmat"."""
    integer = "q" if wide else "i"
    number = "f" if single and not wide else "d"
    words = 2 if number == "d" and not wide else 1

    def record(content):
        length = struct.pack(order + "i", len(content))
        return length + content + length

    def integers(*values):
        return struct.pack(f"{order}{len(values)}{integer}", *values)

    def reals(values):
        return struct.pack(f"{order}{len(values)}{number}", *values)

    out = b""
    for name, matrix in matrices.items():
        rows, columns = matrix.shape
        named = name.encode().ljust(8) + (b" " * 8 if wide else b"")
        sign = -1 if form == "bigmat" else 1
        out += record(integers(columns, sign * rows, 6, 1 if single else 2) + named)
        for k in range(columns):
            runs = list(_runs(matrix[:, k]))
            if not runs:
                continue
            if form == "dense":
                first = runs[0][0]
                last = runs[-1][0] + runs[-1][1].size - 1
                values = matrix[first - 1 : last, k]
                out += record(integers(k + 1, first, words * values.size) + reals(values))
                continue
            strings = b""
            count = 0
            for first, values in runs:
                length = words * values.size + 1
                if form == "bigmat":
                    strings += integers(length, first)
                else:
                    strings += integers(first + 65536 * length)
                strings += reals(values)
                count += length + (1 if form == "bigmat" else 0)
            out += record(integers(k + 1, 0, count) + strings)
        out += record(integers(columns + 1, 1, 1) + reals([2.0**0.5]))
    return out


def op4_text(matrices, form="dense", digits=16, letter="E"):
    """An OUTPUT4 file as text; `digits` after the point."""
    width = digits + 7
    per_line = 80 // width

    def number(value):
        return f"{value:{width}.{digits}E}".replace("E", letter)

    def lines(values):
        texts = [number(v) for v in values]
        for k in range(0, len(texts), per_line):
            yield "".join(texts[k : k + per_line])

    out = []
    for name, matrix in matrices.items():
        rows, columns = matrix.shape
        sign = -1 if form == "bigmat" else 1
        layout = f"1P,{per_line}E{width}.{digits}"
        out.append(f"{columns:8d}{sign * rows:8d}{6:8d}{2:8d}{name:<8}{layout}")
        for k in range(columns):
            runs = list(_runs(matrix[:, k]))
            if not runs:
                continue
            if form == "dense":
                first = runs[0][0]
                last = runs[-1][0] + runs[-1][1].size - 1
                values = matrix[first - 1 : last, k]
                out += [f"{k + 1:8d}{first:8d}{values.size:8d}", *lines(values)]
                continue
            extra = 1 if form == "bigmat" else 0
            count = sum(2 * values.size + 1 + extra for _, values in runs)
            out.append(f"{k + 1:8d}{0:8d}{count:8d}")
            for first, values in runs:
                length = 2 * values.size + 1
                if form == "bigmat":
                    out.append(f"{length:8d}{first:8d}")
                else:
                    out.append(f"{first + 65536 * length:12d}")
                out += lines(values)
        out += [f"{columns + 1:8d}{1:8d}{1:8d}", number(2.0**0.5)]
    return ("\n".join(out) + "\n").encode()


# -- bulk data -------------------------------------------------------------------------------------
def _large(name, *fields):
    """A card of fields of 16 characters."""
    texts = [f"{f:>16}" if isinstance(f, str | int) else f"{f:16.9E}" for f in fields]
    rows = [texts[k : k + 4] for k in range(0, len(texts), 4)]
    first = f"{name + '*':<8}" + "".join(rows[0])
    return [first, *(f"{'*':<8}" + "".join(row) for row in rows[1:])]


def systems_text():
    """The coordinate systems, one of each kind of card."""
    kind, *points = SYSTEMS[10]
    out = _large(f"CORD2{kind}", 10, 0, *(x for point in points for x in point))
    kind, *points = SYSTEMS[12]
    out.append(f"CORD2{kind},12,,{','.join(str(x) for point in points[:2] for x in point)}")
    out.append(f",{','.join(str(x) for x in points[2])}")
    return out


def grids_text(port=False):
    """The interface grids: fields of 16, of 8, and free ones."""
    out = _large("GRID", 3, 0, *PLACES[3], OUTPUT[3], 0, 0)
    x, y, z = PLACES[11]
    out.append(f"GRID    {11:8d}{'':8}{x:8.3f}{y:8.2f}{z:8.3f}{OUTPUT[11]:8d}")
    for grid in (27, PORT) if port else (27,):
        place = ",".join(str(x) for x in PLACES[grid])
        out.append(f"GRID,{grid},,{place},{OUTPUT[grid]}")
    return out


def asm_text(modes=22, port=False):
    """An assembly file."""
    last = FIRST_SCALAR + modes - 1
    out = [
        "$ superelement 75",
        "SEBULK        75  EXTOP4          MANUAL",
        "SECONCT       75       0",
    ]
    out += [f"        {'':8}" + "".join(f"{g:8d}{g:8d}" for g in GRIDS)]
    out += [*systems_text(), *grids_text(port), f"SPOINT  {FIRST_SCALAR:8d}    THRU{last:8d}"]
    return "\n".join(out) + "\n"


def extrn_text(order=GRIDS, modes=22):
    """The order of the freedoms, as a punch file states it."""
    pairs = [(g, "123456") for g in order]
    pairs += [(FIRST_SCALAR + k, "0") for k in range(modes)]
    cells = [f"{g:8d}{c:>8}" for g, c in pairs]
    rows = ["".join(cells[k : k + 4]) for k in range(0, len(cells), 4)]
    return (
        "\n".join(["BEGIN SUPER 75", "EXTRN   " + rows[0], *("        " + r for r in rows[1:])])
        + "\n"
    )


def punch_text(found, names=("KAAX", "MAAX"), digits=9):
    """A punch file: grids, coordinate systems, and both matrices as DMIG, one triangle each."""
    modes = found.frequencies.size
    freedoms = [(g, c) for g in GRIDS for c in range(1, 7)]
    freedoms += [(FIRST_SCALAR + k, 0) for k in range(modes)]
    out = [*systems_text(), *grids_text()]
    for name, matrix in zip(names, (found.stiffness, found.mass), strict=True):
        out.append(f"DMIG    {name:<8}{0:8d}{6:8d}{2:8d}{0:8d}{'':8}{'':8}{len(freedoms):8d}")
        for k, (grid, component) in enumerate(freedoms):
            rows = [j for j in range(k, len(freedoms)) if matrix[j, k] != 0.0]
            if not rows:
                continue
            out.append(f"DMIG*   {name:<16}{grid:16d}{component:16d}")
            for j in rows:
                value = f"{matrix[j, k]:16.{digits}E}".replace("E", "D")
                out.append(f"*       {freedoms[j][0]:16d}{freedoms[j][1]:16d}{value}")
    return "\n".join(out) + "\n"
