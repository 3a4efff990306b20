"""Superelements as they are delivered: mass and stiffness over the freedoms of several interface
grids, each in its own axes, and of modes; reduced to one port by holding the grids as one rigid
body.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as field_of
from pathlib import Path
from typing import Annotated

import numpy as np

from beamchain.checks import Struct, field
from beamchain.errors import InputError
from beamchain.ports.motions import Array, offset_matrix
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.craig_bampton import (
    FULL,
    Boundary,
    FreePoint,
    from_matrices,
    listed,
    read_arrays,
)
from beamchain.structure.readers.nastran_bulk import (
    Bulk,
    Freedom,
    GridPoint,
    dmig_matrices,
    read_bulk,
)
from beamchain.structure.readers.nastran_op4 import Matrix, read_op4
from beamchain.warning_codes import Caution

#: Names under which mass and stiffness are delivered, the likeliest first.
MASS = ("MXX", "MAAX", "MAA", "M", "MASS")
STIFFNESS = ("KXX", "KAAX", "KAA", "K", "STIFF")
DAMPING = ("K4XX", "K4AAX", "K4AA", "BXX", "BAAX", "BAA")  # structural and viscous, not read
FREE = (
    "Free-free modes without interface grids cannot be read: ask for a fixed-interface "
    "(Craig-Bampton) run with the interface in the a-set."
)
Triple = tuple[float, float, float]


class InterfaceGrid(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An interface grid of a superelement whose file holds matrices only.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.InterfaceGrid(id=3, at=(600.0, 0.0, 300.0)).components
        '123456'
    """

    id: Annotated[int, field("number of the grid", "", least=1, most=999_999_999)]
    at: Annotated[Triple, field("place of the grid in the axes of the file", "units of the file")]
    axes: Annotated[
        tuple[Triple, Triple, Triple],
        field("rows: directions of the components of the grid in the axes of the file", ""),
    ] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    components: Annotated[
        str, field("components held at the root, 1 to 3 for x, y, z, 4 to 6 for rotations")
    ] = "123456"
    row: Annotated[
        int | None,
        field(
            "row of the first component in the matrices, from 1 (of .npz and .mat its place in "
            "`boundary`); after the grid before it"
        ),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        text = self.components
        if not text or sorted(set(text)) != sorted(text) or not set(text) <= set("123456"):
            raise InputError(
                f'components = {text!r} must name different ones of 1 to 6; for example "123456".'
            )
        turn = np.array(self.axes)
        if np.max(np.abs(turn @ turn.T - np.eye(3))) > 1e-6 or np.linalg.det(turn) < 0.0:
            raise InputError(
                f"axes = {turn.tolist()} of grid {self.id} are not three perpendicular unit "
                "vectors, right-handed; give the directions of its components as rows."
            )


@dataclass(frozen=True, eq=False)
class Interface:
    """Where the freedoms of a superelement's matrices are.

    Args:
        asm: the bulk data that was delivered with the matrices.
        grids: the interface grids, where there is no such file.
        ports: interface grids that the port does not hold, by name.
    """

    asm: Path | None = None
    grids: tuple[InterfaceGrid, ...] = ()
    ports: Mapping[str, int] = field_of(default_factory=dict[str, int])

    @property
    def empty(self) -> bool:
        """Whether nothing is given."""
        return self.asm is None and not self.grids and not self.ports


def read(path: Path, subcase: int | None, interface: Interface) -> ModalData:
    """Modal data of the matrices of an OUTPUT4, punch, .npz or .mat file, about the mean of its
    interface grids, in basic axes."""
    if subcase is not None:
        raise InputError(
            f"subcase = {subcase} is given, but {path.name!r} holds one superelement; leave "
            "subcase out."
        )
    kind = path.suffix.lower()
    if kind == ".pch":
        return _from_punch(path, interface)
    if kind in (".npz", ".mat"):
        return _from_arrays(path, interface)
    others: set[str] = set()
    matrices = read_op4(path, {*MASS, *STIFFNESS}, others)
    mass, stiffness = _chosen(path, matrices, others)
    size = mass.values.shape[0]
    if interface.grids:
        rows, points = _stated_rows(interface.grids, size, f"the matrices of {path.name!r}")
        order: tuple[Freedom, ...] | None = None
        source = "the specification"
    else:
        bulk, source = _bulk_beside(path, interface.asm)
        order = bulk.freedoms()
        if len(order) != size:
            raise InputError(
                f"{path.name!r} holds matrices of {size} freedoms, but the grids and scalar points "
                f"of {source} make {len(order)}; put the .pch with its EXTRN beside it, or give "
                f"grids. {FREE}"
            )
        rows, points = _rows_of(order, bulk.grids), bulk.grids
    data = _modal_data(path, (mass, stiffness), rows, points, source, interface.ports)
    return _ignoring(data, others)


def _ignoring(data: ModalData, others: Collection[str]) -> ModalData:
    """The data, with a word on the matrices of damping that the file holds beside."""
    names = [name for name in DAMPING if name in others]
    if not names:
        return data
    verb = "which is" if len(names) == 1 else "which are"
    text = f"{data.source} holds {' and '.join(names)}, {verb} ignored"
    return replace(data, steps=(*data.steps, Caution("ignored-damping", text)))


def _from_punch(path: Path, interface: Interface) -> ModalData:
    """A punch file: its matrices name grids and components, whose places are in it or beside it."""
    bulk = read_bulk(path)
    matrices, freedoms = dmig_matrices(path, bulk, {*MASS, *STIFFNESS})
    mass, stiffness = _chosen(path, matrices, bulk.dmig)
    points = bulk.grids
    source = path.name
    if interface.grids:
        points = {grid.id: _point(grid) for grid in interface.grids}
        source = "the specification"
    elif interface.asm is not None or not points:
        beside, source = _bulk_beside(path, interface.asm)
        points = beside.grids
    unknown = sorted({grid for grid, component in freedoms if component and grid not in points})
    if unknown:
        raise InputError(
            f"{path.name!r}: the matrices name grid {unknown[0]}, which {source} does not hold; "
            "give asm, or grids."
        )
    rows = _rows_of(freedoms, points)
    if interface.grids:
        held = {(grid.id, int(c)) for grid in interface.grids for c in grid.components}
        rows = {freedom: row for freedom, row in rows.items() if freedom in held}
    data = _modal_data(path, (mass, stiffness), rows, points, source, interface.ports)
    return _ignoring(data, bulk.dmig)


def _from_arrays(path: Path, interface: Interface) -> ModalData:
    """A .npz or .mat file: the rows of the grids follow each other in its boundary."""
    mass, stiffness, boundary = read_arrays(path)
    if interface.grids:
        rows, points = _stated_rows(
            interface.grids, len(boundary), f"the boundary of {path.name!r}"
        )
        source = "the specification"
    else:
        bulk, source = _bulk_beside(path, interface.asm)
        order = [freedom for freedom in bulk.freedoms() if freedom[1]]
        rows, points = _rows_of(order, bulk.grids), bulk.grids
    if len(rows) != len(boundary) or len(set(boundary)) != len(boundary):
        raise InputError(
            f"{path.name!r}: boundary names {len(boundary)} freedoms, but the grids of {source} "
            f"have {len(rows)}; give each freedom of each grid once."
        )
    if not all(0 <= row < mass.shape[0] for row in boundary):
        raise InputError(
            f"{path.name!r}: boundary names a freedom that is not among the {mass.shape[0]} of the "
            "matrices."
        )
    placed = {freedom: boundary[k] for freedom, k in rows.items()}
    matrices = Matrix(mass, FULL), Matrix(stiffness, FULL)
    return _modal_data(path, matrices, placed, points, source, interface.ports)


def _chosen(
    path: Path, matrices: Mapping[str, Matrix], others: Collection[str]
) -> tuple[Matrix, Matrix]:
    """Mass and stiffness, of the same size; `others`: names of what else the file holds."""
    out: list[Matrix] = []
    for what, names in (("mass", MASS), ("stiffness", STIFFNESS)):
        name = next((name for name in names if name in matrices), None)
        if name is None:
            have = listed(sorted({*matrices, *others})) or "no matrix"
            raise InputError(
                f"file {str(path)!r} holds no {what} (tried {', '.join(names)}; it holds {have}); "
                "write it with EXTSEOUT, or rename the matrices."
            )
        out.append(matrices[name])
    shapes = [matrix.values.shape for matrix in out]
    if shapes[0] != shapes[1] or shapes[0][0] != shapes[0][1] or not shapes[0][0]:
        raise InputError(
            f"file {str(path)!r}: mass {shapes[0]} and stiffness {shapes[1]} are not square and of "
            "one size; write both for the same freedoms."
        )
    return out[0], out[1]


def _bulk_beside(path: Path, asm: Path | None) -> tuple[Bulk, str]:
    """The bulk data of a superelement: the file that is named, else the .asm beside it; with the
    order of the freedoms of a .pch beside it."""
    named = asm is not None
    found = asm if asm is not None else path.with_suffix(".asm")
    if not found.is_file():
        raise InputError(
            f"file {str(found)!r} does not exist; "
            + ("check asm." if named else "name the file with the grids by asm, or give grids.")
        )
    bulk = read_bulk(found)
    if not bulk.grids:
        raise InputError(
            f"file {str(found)!r} holds no GRID; give the assembly file, or grids. {FREE}"
        )
    punch = path.with_suffix(".pch")
    if not bulk.connected and path.suffix.lower() != ".pch" and punch.is_file():
        beside = read_bulk(punch)
        bulk = replace(
            bulk,
            connected=beside.connected,
            scalars=tuple(sorted({*bulk.scalars, *beside.scalars})),
        )
    return bulk, found.name


# -- rows and motions ------------------------------------------------------------------------------
def _point(grid: InterfaceGrid) -> GridPoint:
    return GridPoint(np.array(grid.at), np.array(grid.axes))


def _stated_rows(
    grids: Sequence[InterfaceGrid], size: int, name: str
) -> tuple[dict[Freedom, int], dict[int, GridPoint]]:
    """Rows of the freedoms of grids that a specification lists."""
    rows: dict[Freedom, int] = {}
    following = 0
    for grid in grids:
        first = following if grid.row is None else grid.row - 1
        following = first + len(grid.components)
        if first < 0 or following > size:
            raise InputError(
                f"grids: grid {grid.id} takes rows {first + 1} to {following}, but {name} "
                f"{'has' if 'boundary' in name else 'have'} {size}; check row and components."
            )
        rows |= {(grid.id, int(c)): first + k for k, c in enumerate(grid.components)}
    count = sum(len(grid.components) for grid in grids)
    if len(rows) != count or len(set(rows.values())) != count:
        raise InputError("grids names a grid or a row twice; give each once.")
    return rows, {grid.id: _point(grid) for grid in grids}


def _rows_of(order: Sequence[Freedom], points: Mapping[int, GridPoint]) -> dict[Freedom, int]:
    """Rows of the freedoms of grids."""
    return {freedom: k for k, freedom in enumerate(order) if freedom[1] and freedom[0] in points}


def rigid_motions(
    freedoms: Sequence[Freedom], points: Mapping[int, GridPoint], reference: Array
) -> Array:
    """`(b, 6)` freedoms of grids per motion of a rigid body that holds them, in basic axes about
    `reference` `(3,)`."""
    rows: list[Array] = []
    for grid, component in freedoms:
        point = points[grid]
        turn = np.kron(np.eye(2), point.axes)
        rows.append((turn @ offset_matrix(point.at - reference))[component - 1])
    return np.vstack(rows)


def _modal_data(
    path: Path,
    matrices: tuple[Matrix, Matrix],
    rows: Mapping[Freedom, int],
    points: Mapping[int, GridPoint],
    source: str,
    ports: Mapping[str, int],
) -> ModalData:
    """The modes with all grids held as one rigid body, but for those of `ports`."""
    _check_ports(path, rows, ports)
    held = tuple(freedom for freedom in rows if freedom[0] not in ports.values())
    if not held:
        raise InputError(
            f"{path.name!r}: none of its freedoms belongs to a grid that the port holds; give "
            "grids, and leave one out of ports."
        )
    names = tuple(dict.fromkeys(grid for grid, _ in held))
    reference = np.mean([points[grid].at for grid in names], axis=0)
    motion = rigid_motions(held, points, reference)
    if np.linalg.matrix_rank(motion / np.maximum(np.abs(motion).max(axis=0), 1e-300)) < 6:
        raise InputError(
            f"{path.name!r}: the {len(held)} freedoms of its interface grids do not hold a rigid "
            "body in six motions; give all of them."
        )
    free = tuple(
        FreePoint(
            name,
            points[grid].at - reference,
            tuple(rows[grid, component] for component in range(1, 7)),
            points[grid].axes,
        )
        for name, grid in ports.items()
    )
    boundary = Boundary(
        tuple(rows[freedom] for freedom in held),
        motion,
        tuple(f"grid {grid}, component {component}" for grid, component in held),
        free,
    )
    mass, stiffness = matrices
    data = from_matrices(
        mass.values,
        stiffness.values,
        boundary,
        path.name,
        precision=max(mass.precision, stiffness.precision),
    )
    grids = ", ".join(str(grid) for grid in names[:8]) + (", ..." if len(names) > 8 else "")
    where = ", ".join(f"{x:.6g}" for x in reference)
    one = len(names) == 1
    steps = [
        f"grid{'' if one else 's'} {grids} of {source} held as one rigid body; the file's "
        f"reference point is {'that grid' if one else 'their mean'} ({where})"
    ]
    steps += [f"grid {grid} is free, as port {name!r}" for name, grid in ports.items()]
    return replace(data, steps=(*steps, *data.steps))


def _check_ports(path: Path, rows: Mapping[Freedom, int], ports: Mapping[str, int]) -> None:
    """Every port is an interface grid of six freedoms, named once."""
    known = tuple(dict.fromkeys(grid for grid, _ in rows))
    for name, grid in ports.items():
        if grid not in known:
            listed = ", ".join(str(g) for g in known[:12])
            raise InputError(
                f"ports.{name} = {grid} is no interface grid of {path.name!r}; it has {listed}."
            )
        if any((grid, component) not in rows for component in range(1, 7)):
            raise InputError(
                f"ports.{name} = {grid}: the matrices of {path.name!r} hold only some of its six "
                "components; a port needs all of them."
            )
    if len(set(ports.values())) != len(ports):
        raise InputError("ports names a grid twice; give each its own name.")
