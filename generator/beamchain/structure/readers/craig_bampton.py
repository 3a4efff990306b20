"""Matrices of a finite-element or Craig-Bampton model: modes with the port held,
participation, rigid mass.

Source: R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA Journal
6 (1968) 1313-1319, doi:10.2514/3.4741.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import linalg

from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.bounded import check_size, mat_arrays, npz_arrays

LARGEST = 4000  # freedoms; beyond that reduce in the program that made the model
MOST = 200  # modes handed on, the lowest
LARGEST_FILE = 300_000_000
DETERMINATE = 1e-6  # relative stiffness that may be left at the port
LOOSE = 1e-13  # pivot over diagonal entry below which a freedom is not held
NAMES = {
    "mass": ("mass", "M", "m", "MAA", "maa"),
    "stiffness": ("stiffness", "K", "k", "KAA", "kaa"),
}
BOUNDARY = ("boundary", "b", "bset")


def read(path: Path, subcase: int | None = None) -> ModalData:
    """Modal data of a .npz (freedoms from 0) or .mat file (from 1)."""
    if subcase is not None:
        raise InputError(
            f"subcase = {subcase} is given, but {path.name!r} holds one set of matrices; leave "
            "subcase out."
        )
    check_size(path, LARGEST_FILE)
    first = 0 if path.suffix.lower() == ".npz" else 1
    wanted = {*BOUNDARY, *(name for names in NAMES.values() for name in names)}
    try:
        held = npz_arrays(path, wanted) if first == 0 else mat_arrays(path, wanted)
    except InputError:
        raise
    except Exception as error:  # zip, MATLAB and NumPy each raise their own kind
        raise InputError(
            f"file {str(path)!r} cannot be read ({type(error).__name__}: {error}); it is cut or of "
            "another kind: save mass, stiffness and boundary again."
        ) from None
    found: dict[str, Any] = {}
    for key, names in {**NAMES, "boundary": BOUNDARY}.items():
        name = next((n for n in names if n in held), None)
        if name is None:
            have = ", ".join(sorted(held)) or "nothing of that kind"
            raise InputError(
                f"file {str(path)!r} holds no {key} (tried {', '.join(names)}; it holds {have}); "
                "add it."
            )
        found[key] = held[name]
    boundary = [int(v) - first for v in np.ravel(found["boundary"])]
    return from_matrices(
        _dense(found["mass"], path.name), _dense(found["stiffness"], path.name), boundary, path.name
    )


def _dense(matrix: Any, name: str) -> Array:
    shape = tuple(getattr(matrix, "shape", ()))
    if len(shape) != 2 or shape[0] != shape[1] or shape[0] > LARGEST:
        raise InputError(
            f"{name}: a matrix has the shape {shape}; give a square one of at most {LARGEST} "
            "freedoms."
        )
    out = np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix)  # sparse or not
    if out.dtype.kind not in "fiu" or not np.all(np.isfinite(out)):
        raise InputError(
            f"{name}: a matrix holds entries that are no finite real numbers; save it again."
        )
    return np.asarray(out, dtype=np.float64)


def from_matrices(
    mass: Array, stiffness: Array, boundary: Sequence[int], name: str = "matrices"
) -> ModalData:
    """Modal data from mass and stiffness `(d, d)`; `boundary`: the port's six freedoms, from 0."""
    d = mass.shape[0]
    _check_matrices(mass, stiffness, boundary, name)
    mass, stiffness = (mass + mass.T) / 2.0, (stiffness + stiffness.T) / 2.0
    outer = list(boundary)
    inner = [i for i in range(d) if i not in set(outer)]
    k_ii = stiffness[np.ix_(inner, inner)]
    m_ii = mass[np.ix_(inner, inner)]
    m_ib = mass[np.ix_(inner, outer)]
    m_bb = mass[np.ix_(outer, outer)]
    # inner motion per rigid motion of the port: G = -K_ii^-1 K_ib
    follow = _rigid_motion(stiffness, inner, outer, name)
    # M_rigid = M_bb + G^T M_ib + M_ib^T G + G^T M_ii G
    rigid = m_bb + follow.T @ m_ib + m_ib.T @ follow + follow.T @ m_ii @ follow
    # for 1/w^2: massless freedoms do no harm, low modes keep their digits
    inverse, shapes = linalg.eigh(m_ii, k_ii)
    order = np.argsort(inverse)[::-1]
    order = order[inverse[order] > 1e-14 * inverse[order[0]]][:MOST]
    w = 1.0 / np.sqrt(inverse[order])
    # L = Phi^T (M_ii G + M_ib), Phi of unit mass
    normal = (w * shapes[:, order]).T
    participation = normal @ (m_ii @ follow + m_ib)
    steps = (
        f"matrices of {d} freedoms, six of them the port's; the lowest {w.size} modes with the "
        "port held",
    )
    return ModalData(
        rigid, w, participation, precision=1e-12, source=name, steps=steps, origin=normal
    )


def _check_matrices(mass: Array, stiffness: Array, boundary: Sequence[int], name: str) -> None:
    """Sizes, the six freedoms, symmetry."""
    d = mass.shape[0]
    if stiffness.shape != (d, d):
        raise InputError(
            f"{name}: mass {mass.shape} and stiffness {stiffness.shape} differ in size; give both "
            "for the same freedoms."
        )
    if len(boundary) != 6 or len(set(boundary)) != 6 or not all(0 <= b < d for b in boundary):
        raise InputError(
            f"{name}: boundary = {list(boundary)} must name six different freedoms of the {d} (x, "
            "y, z and rotations of the port); tie several interface nodes to one first (RBE2)."
        )
    for word, matrix in (("mass", mass), ("stiffness", stiffness)):
        if np.max(np.abs(matrix - matrix.T)) > 1e-6 * np.max(np.abs(matrix)):
            raise InputError(
                f"{name}: the {word} matrix is not symmetric; give the full matrix, not a triangle."
            )


def _rigid_motion(stiffness: Array, inner: list[int], outer: list[int], name: str) -> Array:
    """`(n, 6)` motion of the inner freedoms per motion of the port, which must not strain them."""
    k_ii = stiffness[np.ix_(inner, inner)]
    k_ib = stiffness[np.ix_(inner, outer)]
    k_bb = stiffness[np.ix_(outer, outer)]
    try:
        factor = linalg.cho_factor(k_ii)
        # rounding decides whether a singular matrix is factored:
        # its last pivot then is nothing but rounding
        if np.min(np.diag(factor[0]) ** 2 / np.diag(k_ii)) < LOOSE:
            raise linalg.LinAlgError
    except linalg.LinAlgError:
        raise InputError(
            f"{name}: with the six boundary freedoms held the structure can still move (its "
            "stiffness is not positive definite); check boundary, and that massless freedoms have "
            "stiffness."
        ) from None
    follow = -linalg.cho_solve(factor, k_ib)
    condensed = k_bb + k_ib.T @ follow  # zero where the port is the only support
    terms = np.abs(np.diag(k_bb)) + np.abs(np.sum(k_ib * follow, axis=0))
    scale = np.sqrt(terms + 1e-300)
    held = np.max(np.abs(stiffness[outer])) > 0.0
    if held and np.max(np.abs(condensed / np.outer(scale, scale))) > DETERMINATE:
        raise InputError(
            f"{name}: moving the port as a rigid body strains the structure; it is held elsewhere "
            "too, or boundary does not name the port's freedoms in the order x, y, z, rotations."
        )
    return follow
