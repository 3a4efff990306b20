"""Nastran's binary results (.op2), through pyYeti (the extra `nastran`)."""

import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from beamchain.errors import InputError
from beamchain.import_lock import importing
from beamchain.ports.motions import Array
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.safe_reading import check_size

PRECISION = 6e-7  # single precision, as op2 files usually have
RIGID = ("RBMASS", "RBMASSS")  # MSC's name, NX's name


class Eigenvalues(NamedTuple):
    """The modes of a subcase.

    Args:
        radians: `(n,)` circular frequencies.
        modal: `(n,)` generalized masses.
    """

    radians: Array
    modal: Array


def read(path: Path, subcase: int | None = None) -> ModalData:
    """Modal data of an op2 file, in its units, about its reference point."""
    check_size(path)
    try:
        with importing, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of its own imports
            from pyyeti.nastran import op2  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise InputError(
            f"reading {path.name!r} needs pyYeti ({error}); pip install 'beamchain[nastran]', or "
            "give the .f06."
        ) from None
    try:
        with op2.OP2(str(path)) as file:
            tables = [_eigenvalues(file, which) for which in range(len(file.dbdct.get("LAMA", [])))]
            there = [name for name in ("MPFACS", *RIGID) if name in file.dbdct]
            matrices: dict[str, Any] = file.rdop2mats(there) if there else {}
    except Exception as error:  # pyYeti raises whatever its records run into
        raise InputError(
            f"file {str(path)!r} cannot be read as op2 ({type(error).__name__}: {error}); run it "
            "again with PARAM,POST,-1, or give the .f06."
        ) from None
    return _modal_data(path.name, _chosen(path.name, tables, subcase), matrices)


def _eigenvalues(file: Any, which: int) -> Eigenvalues:
    """A table LAMA: an identification, then seven words per mode."""
    file.set_position("LAMA", which)
    file.rdop2nt()
    file.rdop2record("bytes")
    content = file.rdop2record("bytes")
    words = [("number", file._intstr), ("order", file._intstr)]
    words += [
        (name, file._rfrm) for name in ("eigenvalue", "radians", "cycles", "mass", "stiffness")
    ]
    rows = np.frombuffer(content, dtype=np.dtype(words))
    return Eigenvalues(rows["radians"].astype(np.float64), rows["mass"].astype(np.float64))


def _chosen(name: str, tables: list[Eigenvalues], subcase: int | None) -> Eigenvalues:
    if not tables:
        raise InputError(
            f"file {name!r} holds no eigenvalues; it is no result of a normal-modes run: give the "
            ".f06."
        )
    if subcase is not None and not 1 <= subcase <= len(tables):
        raise InputError(f"subcase = {subcase} is not in {name!r}; it holds 1 to {len(tables)}.")
    if subcase is None and len(tables) > 1:
        raise InputError(
            f"file {name!r} holds modes of {len(tables)} subcases; choose one with subcase = 1."
        )
    return tables[(subcase or 1) - 1]


def _modal_data(name: str, table: Eigenvalues, matrices: dict[str, Any]) -> ModalData:
    rigid = next((key for key in RIGID if key in matrices), "RBMASS")
    missing = [key for key in ("MPFACS", rigid) if key not in matrices]
    if missing:
        raise InputError(
            f"file {name!r} holds no participation or rigid mass ({', '.join(missing)}); give me "
            "the f06, printed with MEFFMASS(PRINT,ALL) = YES and PARAM,GRDPNT,0."
        )
    participation, mass = (np.asarray(matrices[key], dtype=np.float64) for key in ("MPFACS", rigid))
    if participation.shape == (6, table.radians.size):
        participation = participation.T
    if participation.shape != (table.radians.size, 6) or mass.shape != (6, 6):
        raise InputError(
            f"file {name!r}: MPFACS {participation.shape} and {rigid} {mass.shape} do not fit "
            f"{table.radians.size} modes; give the .f06."
        )
    scaled = bool(np.max(np.abs(table.modal - 1.0)) > PRECISION)
    return ModalData(
        mass,
        table.radians,
        participation * np.sqrt(table.modal)[:, None],
        precision=PRECISION,
        source=name,
        steps=("modes scaled to unit generalized mass",) if scaled else (),
    )
