"""Files that hold modes, one reader per kind; `read_modes` chooses and brings all to SI,
appendage axes, the port."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from beamchain.checks import one_of, path_of, positive
from beamchain.errors import InputError
from beamchain.files import no_file
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers import craig_bampton, nastran_f06, nastran_op2, own_format

#: Reader by ending of the file's name.
READERS = {
    ".f06": nastran_f06.read,
    ".op2": nastran_op2.read,
    ".toml": own_format.read,
    ".json": own_format.read,
    ".npz": craig_bampton.read,
    ".mat": craig_bampton.read,
}


def read_modes(
    path: str | Path,
    *,
    reference: ArrayLike = (0.0, 0.0, 0.0),
    axes: ArrayLike | None = None,
    units: Mapping[str, float] | None = None,
    modes: Sequence[int] | None = None,
    subcase: int | None = None,
) -> ModalData:
    """Read modes that another program computed.

    Args:
        path: .f06, .op2 (needs pyYeti), .toml or .json, .npz or .mat (mass, stiffness, boundary).
        reference: the port, from the file's reference point, in the file's axes and units.
        axes: rows: appendage x, y, z in the file's axes; default: the file's own.
        units: `{"length": metres per unit, "mass": kilograms per unit}`; default: SI.
        modes: numbers from 1, by ascending frequency; default: all.
        subcase: number of the subcase, if the file holds several.

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
    data = READERS[kind](path, subcase)
    # first the port, in the file's own units, then the units, then the pairs,
    # which need the appendage's planes
    data = (
        data.moved(reference, axes)
        .scaled(units.get("length", 1.0), units.get("mass", 1.0))
        .untangled()
    )
    return data if modes is None else data.selected(modes)
