"""Files that hold modes, one reader per kind; `read_modes` chooses and brings all to SI,
appendage axes, the port."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from beamchain.checks import list_of_names, of_type, one_of, path_of, positive, whole_number
from beamchain.errors import InputError
from beamchain.files import no_file
from beamchain.ports.motions import Array
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers import (
    craig_bampton,
    nastran_f06,
    nastran_op2,
    nastran_op4,
    own_format,
    superelement,
)
from beamchain.structure.readers.superelement import Interface, InterfaceGrid

#: Reader by ending of the file's name, of files that say by themselves where the port is.
MODES = {
    ".f06": nastran_f06.read,
    ".op2": nastran_op2.read,
    ".toml": own_format.read,
    ".json": own_format.read,
    ".npz": craig_bampton.read,
    ".mat": craig_bampton.read,
}
#: Endings of files whose matrices have several interface grids, of which the places are beside.
MATRICES = (".op4", ".pch", ".npz", ".mat")
READERS = (*MODES, *(kind for kind in MATRICES if kind not in MODES))


def read_modes(
    path: str | Path,
    *,
    reference: ArrayLike = (0.0, 0.0, 0.0),
    axes: ArrayLike | None = None,
    units: Mapping[str, float] | None = None,
    modes: Sequence[int] | None = None,
    subcase: int | None = None,
    asm: str | Path | None = None,
    grids: Sequence[InterfaceGrid] = (),
    ports: Mapping[str, int] | None = None,
) -> ModalData:
    """Read modes that another program computed.

    Args:
        path: .f06, .op2 (needs pyYeti), .toml or .json, .npz or .mat (mass, stiffness, boundary),
            .op4 or .pch (mass and stiffness of a superelement).
        reference: the port, from the file's reference point (of a superelement: its interface
            grid, or the mean of several), in the file's axes and units.
        axes: rows: appendage x, y, z in the file's axes; default: the file's own.
        units: `{"length": metres per unit, "mass": kilograms per unit}`; default: SI.
        modes: numbers from 1, by ascending frequency; default: all.
        subcase: number of the subcase, if the file holds several.
        asm: bulk data with the interface grids of a superelement; default: the .asm beside it.
        grids: the interface grids, where there is no such file.
        ports: numbers of interface grids that the root does not hold, by name.

    Returns:
        Checked data in SI about the port, modes of equal frequency rotated into the bending planes;
        `steps` lists the changes made.

    Raises:
        InputError: the file is missing, truncated, corrupt or contradictory;
            the message states what is needed.

    Example:
        >>> import beamchain as bc
        >>> import json, pathlib, tempfile
        >>> mass = [
        ...     [30, 0, 0, 0, 0, 0],
        ...     [0, 30, 0, 0, 0, 120],
        ...     [0, 0, 30, 0, -120, 0],
        ...     [0, 0, 0, 20, 0, 0],
        ...     [0, 0, -120, 0, 600, 0],
        ...     [0, 120, 0, 0, 0, 600],
        ... ]
        >>> modes = {
        ...     "mass": mass,
        ...     "frequencies": [1.3],
        ...     "participation": [[0], [4], [0], [0], [0], [23]],
        ... }
        >>> file = pathlib.Path(tempfile.mkdtemp()) / "modes.json"
        >>> _ = file.write_text(json.dumps(modes))
        >>> bc.read_modes(file).frequencies
        array([1.3])
    """
    path = path_of("path", path, "the path of a file of modes")
    kind = path.suffix.lower()
    if kind not in READERS:
        raise InputError(
            f"file {str(path)!r} has an unknown ending; beamchain reads {', '.join(READERS)}."
        )
    if what := no_file(path):
        raise InputError(f"file {str(path)!r} {what}; give the path of the file with the modes.")
    units = dict(units or {})
    for name, value in units.items():
        one_of("units", name, ("length", "mass"))
        positive(f"units.{name}", value, "SI units per unit of the file")
    data = _read(path, kind, subcase, asm, grids, ports or {})
    # first the port, in the file's own units, then the units, then the pairs,
    # which need the appendage's planes
    data = (
        data.moved(reference, axes)
        .scaled(units.get("length", 1.0), units.get("mass", 1.0))
        .untangled()
    )
    return data if modes is None else data.selected(modes)


def read_op4(path: str | Path, names: Sequence[str]) -> dict[str, Array]:
    """Matrices of an OUTPUT4 file by name, such as the recovery matrices of a superelement.

    Args:
        path: .op4, as text or binary.
        names: of the matrices, such as "MUG1" (displacements) and "MEF1" (element forces).

    Returns:
        A matrix `(rows, columns)` per name, in the units of the file.

    Raises:
        InputError: the file is missing, cut or spoilt, or does not hold one of them.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> delivery = files("beamchain") / "examples" / "wing" / "wing.op4"
        >>> bc.spec.read_op4(delivery, ["MUG1"])["MUG1"].shape
        (3, 20)
    """
    path = path_of("path", path, "the path of an .op4 file")
    wanted = [name.upper() for name in list_of_names("names", names)]
    if what := no_file(path):
        raise InputError(f"file {str(path)!r} {what}; give the path of the .op4 file.")
    found = nastran_op4.read_op4(path, set(wanted))
    for name in wanted:
        if name not in found:
            raise InputError(
                f"file {str(path)!r} holds no {name}; check its name, and that EXTSEOUT wrote it."
            )
    return {name: found[name].values for name in wanted}


def _read(
    path: Path,
    kind: str,
    subcase: int | None,
    asm: str | Path | None,
    grids: Sequence[InterfaceGrid],
    ports: Mapping[str, int],
) -> ModalData:
    """What a file holds, in its own units and axes, about its own reference point."""
    if asm is not None:
        asm = path_of("asm", asm, "the path of the bulk data with the interface grids")
    for i, grid in enumerate(grids):
        of_type(f"grids[{i}]", grid, InterfaceGrid, "an InterfaceGrid(id=3, at=(0.6, 0.0, 0.3))")
    for name, grid in ports.items():
        whole_number(f"ports.{name}", grid, 1, 999_999_999)
    interface = Interface(asm, tuple(grids), dict(ports))
    if interface.asm is not None and interface.grids:
        raise InputError(
            "asm and grids are both given; name the file with the grids, or list them."
        )
    if kind in MODES and interface.empty:
        return MODES[kind](path, subcase)
    if kind in MATRICES:
        return superelement.read(path, subcase, interface)
    given = "asm" if asm is not None else "grids" if grids else "ports"
    raise InputError(
        f"{given} is given, but {path.name!r} states its reference "
        f"point itself; leave it out, or give matrices ({', '.join(MATRICES)})."
    )
