"""Nastran's binary results (.op2), through pyNastran (the extra `nastran`, in an environment of its own)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.bounded import check_size

PRECISION = 6e-7  # single precision, as op2 files usually have


def read(path: Path, subcase: int | None = None) -> ModalData:
    """Modal data of an op2 file, in its units, about its reference point."""
    check_size(path)
    try:
        from pyNastran.op2.op2 import OP2  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise InputError(
            f"reading {path.name!r} needs pyNastran ({error}); pip install 'beamchain[nastran]' in an environment of "
            "its own, or give the .f06."
        ) from None
    model: Any = OP2(debug=None)
    try:
        model.read_op2(str(path), build_dataframe=False)
    except Exception as error:  # pyNastran raises whatever its tables run into
        raise InputError(
            f"file {str(path)!r} cannot be read as op2 ({type(error).__name__}: {error}); run it again with "
            "PARAM,POST,-1, or give the .f06."
        ) from None
    return from_tables(path.name, dict(model.eigenvalues), dict(model.matrices), subcase)


def from_tables(
    name: str, eigenvalues: Mapping[Any, Any], matrices: Mapping[str, Any], subcase: int | None = None
) -> ModalData:
    """Modal data from pyNastran's tables: eigenvalues by title, matrices by name."""
    if not eigenvalues:
        raise InputError(f"file {name!r} holds no eigenvalues; it is no result of a normal-modes run: give the .f06.")
    titles = list(eigenvalues)
    if subcase is not None and not 1 <= subcase <= len(titles):
        raise InputError(f"subcase = {subcase} is not in {name!r}; it holds 1 to {len(titles)}.")
    if subcase is None and len(titles) > 1:
        raise InputError(f"file {name!r} holds modes of {len(titles)} subcases; choose one with subcase = 1.")
    table = eigenvalues[titles[(subcase or 1) - 1]]
    matrices = {"RBMASS": matrices["RBMASSS"], **matrices} if "RBMASSS" in matrices else dict(matrices)  # NX's name
    missing = [key for key in ("MPFACS", "RBMASS") if key not in matrices]
    if missing:
        raise InputError(
            f"file {name!r} holds no participation or rigid mass ({', '.join(missing)}); give me the f06, printed with "
            "MEFFMASS(PRINT,ALL) = YES and PARAM,GRDPNT,0."
        )
    participation, mass = _dense(matrices["MPFACS"]), _dense(matrices["RBMASS"])
    radians = np.asarray(table.radians, dtype=np.float64)
    if participation.shape[0] == 6 and participation.shape[1] == radians.size:
        participation = participation.T
    modal_mass = np.asarray(table.generalized_mass, dtype=np.float64)
    if participation.shape != (radians.size, 6) or mass.shape != (6, 6):
        raise InputError(
            f"file {name!r}: MPFACS {participation.shape} and RBMASS {mass.shape} do not fit {radians.size} modes; "
            "give the .f06."
        )
    scaled = bool(np.max(np.abs(modal_mass - 1.0)) > PRECISION)
    return ModalData(
        mass, radians, participation * np.sqrt(modal_mass)[:, None], precision=PRECISION, source=name,
        steps=("modes scaled to unit generalized mass",) if scaled else (),
    )  # fmt: skip


def _dense(matrix: Any) -> Array:
    data = getattr(matrix, "data", matrix)
    return np.asarray(data.toarray() if hasattr(data, "toarray") else data, dtype=np.float64)
