"""Matrices of a finite-element or Craig-Bampton model: modes with the port held,
participation, rigid mass.

Source: R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA Journal
6 (1968) 1313-1319, doi:10.2514/3.4741.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.modal_data import FurtherPoint, ModalData
from beamchain.structure.readers.safe_reading import check_size, mat_arrays, names_held, npz_arrays
from beamchain.structure.rigid_body import (
    body_departure,
    independent_parts,
    nearest_body,
    noise_of_motions,
    realisable_body,
    within_body,
)
from beamchain.warning_codes import Caution

LARGEST = 4000  # freedoms; beyond that reduce in the program that made the model
MOST = 200  # modes handed on, the lowest
LARGEST_FILE = 300_000_000
DETERMINATE = 1e-6  # relative stiffness that may be left at the port
SOFT = 1e-6  # of the first mode's w^2: a support of six freedoms that is softer is rounding
STRAINED = 1e-4  # relative forces on freedoms that move as one rigid body; wrong axes leave 1
NOISE = 1e-2  # of a freedom's own scale, below which a sum of terms is rounding and no force
SOFTEST = 1e-10  # of the stiffest freedom of its kind: stiffness that is rounding (a drilling one)
ROUNDED = 100.0  # precisions of the numbers that rounding may leave of such forces
FULL = 1e-12  # relative precision of matrices of all digits
# relative, most by which a rigid mass may depart from a rigid body's: grids that are off move it by
# up to 3 times what they strain the structure, so that what is taken there is taken here
ALMOST_BODY = 10.0 * STRAINED
NOISY = 4.0  # of what noise was seen to be: an entry below it may be zero
NOISY_BODY = 1e-2  # the same where noise of few digits does so
FEW_DIGITS = 2e-5  # of the largest entry, up to which such noise is taken, in all entries alike
EXACT_BODY = 1e-9  # relative: a departure of numbers of all digits that needs no word
LOOSE = 1e-13  # pivot over diagonal entry below which a freedom is not held
NAMES = {
    "mass": ("mass", "M", "m", "MAA", "maa"),
    "stiffness": ("stiffness", "K", "k", "KAA", "kaa"),
}
BOUNDARY = ("boundary", "b", "bset")
LISTED = 20  # names of a file in a message


def read(path: Path, subcase: int | None = None) -> ModalData:
    """Modal data of a .npz (freedoms from 0) or .mat file (from 1)."""
    mass, stiffness, boundary = read_arrays(path, subcase)
    first = 0 if path.suffix.lower() == ".npz" else 1
    return from_matrices(mass, stiffness, boundary, path.name, first=first)


def read_arrays(path: Path, subcase: int | None = None) -> tuple[Array, Array, list[int]]:
    """Mass and stiffness `(d, d)` of a .npz or .mat file, and the freedoms of its boundary,
    from 0."""
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
    except NotImplementedError:  # SciPy, of HDF5
        raise InputError(
            f"file {str(path)!r} is of MATLAB v7.3 (HDF5), which is not read; save it with -v7."
        ) from None
    except Exception as error:  # zip, MATLAB and NumPy each raise their own kind
        raise InputError(
            f"file {str(path)!r} cannot be read ({type(error).__name__}: {error}); it is cut or of "
            "another kind: save mass, stiffness and boundary again."
        ) from None
    found: dict[str, Any] = {}
    for key, names in {**NAMES, "boundary": BOUNDARY}.items():
        name = next((n for n in names if n in held), None)
        if name is None:
            have = listed(names_held(path))
            raise InputError(
                f"file {str(path)!r} holds no {key} (tried {', '.join(names)}; it holds "
                f"{have or 'nothing'}); add it, or rename what it holds."
            )
        found[key] = held[name]
    boundary = [int(v) - first for v in np.ravel(found["boundary"])]
    return _dense(found["mass"], path.name), _dense(found["stiffness"], path.name), boundary


def listed(names: Sequence[str]) -> str:
    """Names of what a file holds, for a message."""
    return ", ".join(names[:LISTED]) + (", ..." if len(names) > LISTED else "")


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


@dataclass(frozen=True, eq=False)
class Boundary:
    """The freedoms by which a structure is held, all of one rigid body.

    Args:
        rows: of these freedoms in the matrices, from 0.
        motion: `(b, 6)` their motion per motion of the port.
        names: what they are called in messages.
        free: points whose motion is wanted.
    """

    rows: tuple[int, ...]
    motion: Array
    names: tuple[str, ...] = ()
    free: tuple["FreePoint", ...] = ()


class FreePoint(NamedTuple):
    """A point that the boundary leaves free: its `place` `(3,)` from the port, its six `rows` in
    the matrices, and the directions of their components, `axes` `(3, 3)` rows."""

    name: str
    place: Array
    rows: tuple[int, ...]
    axes: Array


def from_matrices(
    mass: Array,
    stiffness: Array,
    boundary: Sequence[int] | Boundary,
    name: str = "matrices",
    *,
    precision: float = FULL,
    first: int = 0,
) -> ModalData:
    """Modal data from mass and stiffness `(d, d)`.

    Args:
        mass, stiffness: over the same freedoms.
        boundary: the port's six freedoms, from 0, or any number that one rigid body holds.
        name: of the file, for messages.
        precision: relative, of the numbers.
        first: number of the first freedom in the file, for messages.
    """
    d = mass.shape[0]
    if not isinstance(boundary, Boundary):
        _check_boundary(boundary, d, name, first)
        boundary = Boundary(tuple(boundary), np.eye(6))
    _check_matrices(mass, stiffness, name)
    mass, stiffness = (mass + mass.T) / 2.0, (stiffness + stiffness.T) / 2.0
    outer = list(boundary.rows)
    inner = [i for i in range(d) if i not in set(outer)]
    if not inner:
        raise InputError(
            f"{name}: all {d} freedoms belong to the port, so that nothing can vibrate; export "
            "modes, or inner freedoms, too."
        )
    k_ii = stiffness[np.ix_(inner, inner)]
    m_ii = mass[np.ix_(inner, inner)]
    m_ib = mass[np.ix_(inner, outer)] @ boundary.motion
    m_bb = boundary.motion.T @ mass[np.ix_(outer, outer)] @ boundary.motion
    # inner motion per rigid motion of the port: G = -K_ii^-1 K_ib
    follow, strained = _rigid_motion(mass, stiffness, inner, boundary, name, precision)
    # M_rigid = M_bb + G^T M_ib + M_ib^T G + G^T M_ii G
    rigid = m_bb + follow.T @ m_ib + m_ib.T @ follow + follow.T @ m_ii @ follow
    k_ib = stiffness[np.ix_(inner, outer)] @ boundary.motion
    # modes with the grids held do not follow the grids: then K_ib is zero but for rounding
    is_rounding = np.abs(k_ib) <= STRAINED * NOISE * _largest_inner(stiffness, inner, boundary)
    size = np.sqrt(np.abs(np.diag(rigid)))
    is_near = np.abs(rigid - m_bb) <= ALMOST_BODY * np.outer(size, size)
    if is_rounding.all() and is_near.all() and body_departure(m_bb) < body_departure(rigid):
        follow, rigid = np.zeros_like(follow), m_bb
    raw = rigid
    rigid, departure = _almost_body(raw, precision)
    # P = M_ii G + M_ib
    coupling = m_ii @ follow + m_ib
    if departure:
        whole = np.block([[rigid, coupling.T], [coupling, m_ii]])
        noise = np.concatenate([noise_of_motions(raw), _noise_of_freedoms(m_ii, raw)])
        whole = independent_parts(whole, k_ii, np.sqrt(NOISY) * noise)
        rigid, coupling, m_ii = realisable_body(whole[:6, :6]), whole[6:, :6], whole[6:, 6:]
    # for 1/w^2: massless freedoms do no harm, low modes keep their digits
    inverse, shapes = linalg.eigh(m_ii, k_ii)
    order = np.argsort(inverse)[::-1]
    order = order[inverse[order] > 1e-14 * inverse[order[0]]][:MOST]
    if not order.size or inverse[order[0]] <= 0.0:
        raise InputError(
            f"{name}: no freedom beside the port's has mass, so that nothing can vibrate; export "
            "the mass matrix again."
        )
    w = 1.0 / np.sqrt(inverse[order])
    # L = Phi^T P, Phi of unit mass
    normal = (w * shapes[:, order]).T
    participation = normal @ coupling
    if rigid is not raw:
        participation = within_body(participation, rigid, body_departure(raw))
    number = {row: k for k, row in enumerate(inner)}
    further = tuple(
        FurtherPoint(
            point.name,
            point.place,
            normal[:, [number[row] for row in point.rows]] @ np.kron(np.eye(2), point.axes),
        )
        for point in boundary.free
    )
    held = "six" if len(outer) == 6 else str(len(outer))
    steps = [
        f"matrices of {d} freedoms, {held} of them the port's; the lowest {w.size} modes with the "
        "port held"
    ]
    if len(outer) != 6:
        steps.append(
            f"rigid-body check: forces of {strained:.1e} of the terms they are the sum of, where "
            f"{max(STRAINED, ROUNDED * precision):.0e} is taken"
        )
    if departure:
        steps.append(departure)
    return ModalData(
        rigid,
        w,
        participation,
        precision=precision,
        source=name,
        steps=tuple(steps),
        further=further,
        origin=normal,
    )


def _almost_body(rigid: Array, precision: float) -> tuple[Array, str]:
    """The rigid mass `(6, 6)` as that of a rigid body where it is almost that of one, and a
    sentence where the departure is worth a word."""
    departure = body_departure(rigid)
    limit = NOISY_BODY if _is_noisy(rigid) else ALMOST_BODY
    if departure > limit:
        return rigid, ""  # refused where it matters: independent ports need no such body
    if departure <= max(EXACT_BODY, ROUNDED * precision):
        return realisable_body(rigid), ""
    text = (
        "the rigid mass that follows from mass and stiffness departs from a rigid body's by "
        f"{departure:.1e} (that of a rigid body is taken; up to {limit:.0e} is accepted); "
        "usual causes: grids in the .asm rounded to 8 characters, a stiffness between interface "
        "and modes that is not zero, an a-set that leaves freedoms out"
    )
    return realisable_body(rigid), Caution("almost-rigid", text)


def _is_noisy(rigid: Array) -> bool:
    """Whether a rigid mass `(6, 6)` departs from a rigid body's by noise of few digits: masses and
    first moments alike."""
    change = np.abs(rigid - nearest_body(rigid))
    across, along = float(np.max(change[3:, :3])), float(np.max(change[:3, :3]))
    most = FEW_DIGITS * float(np.max(np.abs(rigid)))
    return max(across, along) <= min(most, 4.0 * min(across, along))


def _noise_of_freedoms(mass: Array, rigid: Array) -> Array:
    """`(n,)` sizes s of the noise of inner freedoms' `mass`, s_i s_j in its entry ij: that of the
    `rigid` mass, absolute where freedoms are coupled that much, and relative."""
    own = np.diag(mass)
    coupling = float(np.max(np.abs(mass - np.diag(own))))
    absolute = float(np.max(np.abs(rigid - nearest_body(rigid))))
    return np.sqrt(np.maximum(body_departure(rigid) * own, min(coupling, absolute)))


def _check_boundary(boundary: Sequence[int], d: int, name: str, first: int) -> None:
    """Six different freedoms, where no grids say more."""
    if len(boundary) != 6 or len(set(boundary)) != 6 or not all(0 <= b < d for b in boundary):
        raise InputError(
            f"{name}: boundary = {[b + first for b in boundary]}, counted from {first}, must name "
            f"six different freedoms of the {d} (x, y, z and rotations of the port); for several "
            "interface grids, give their places in `grids`, or tie them to one first (RBE2)."
        )


def _check_matrices(mass: Array, stiffness: Array, name: str) -> None:
    """Sizes and symmetry."""
    d = mass.shape[0]
    if stiffness.shape != (d, d):
        raise InputError(
            f"{name}: mass {mass.shape} and stiffness {stiffness.shape} differ in size; give both "
            "for the same freedoms."
        )
    for word, matrix in (("mass", mass), ("stiffness", stiffness)):
        if np.max(np.abs(matrix - matrix.T)) > 1e-6 * np.max(np.abs(matrix)):
            raise InputError(
                f"{name}: the {word} matrix is not symmetric; give the full matrix, not a triangle."
            )


def _rigid_motion(
    mass: Array,
    stiffness: Array,
    inner: list[int],
    boundary: Boundary,
    name: str,
    precision: float,
) -> tuple[Array, float]:
    """`(n, 6)` motion of the inner freedoms per motion of the port, which must not strain them;
    and the largest force that is left at the port, relative to the terms it is the sum of."""
    outer = list(boundary.rows)
    motion = boundary.motion
    k_ii = stiffness[np.ix_(inner, inner)]
    k_io = stiffness[np.ix_(inner, outer)]
    k_oo = stiffness[np.ix_(outer, outer)]
    k_ib = k_io @ motion
    try:
        factor = linalg.cho_factor(k_ii)
        # rounding decides whether a singular matrix is factored:
        # its last pivot then is nothing but rounding
        if np.min(np.diag(factor[0]) ** 2 / np.diag(k_ii)) < LOOSE:
            raise linalg.LinAlgError
    except linalg.LinAlgError:
        raise InputError(
            f"{name}: with the {'six ' if len(outer) == 6 else ''}boundary freedoms held the "
            "structure can still move (its stiffness is not positive definite); check "
            f"{'grids and the order of the freedoms' if boundary.names else 'boundary'}, and that "
            "massless freedoms have stiffness."
        ) from None
    follow = -linalg.cho_solve(factor, k_ib)
    # forces at the port's freedoms: zero where the port is the only support
    forces = k_oo @ motion + k_io.T @ follow
    if len(outer) == 6 and _is_soft(motion.T @ forces, mass, k_ii, follow, inner, boundary):
        return follow, 0.0
    terms = np.abs(k_oo) @ np.abs(motion) + np.abs(k_io.T) @ np.abs(follow)
    shares = np.abs(forces) / np.maximum(terms, NOISE * _largest_forces(k_oo, motion))
    strained = float(np.max(shares))
    if boundary.names:
        limit = max(STRAINED, ROUNDED * precision)
        if strained > limit:
            relative = np.max(np.abs(forces), axis=1) / np.max(terms, axis=1).clip(1e-300)
            relative[np.max(shares, axis=1) <= limit] = 0.0
            worst = boundary.names[int(np.argmax(relative))]
            raise InputError(
                f"{name}: moving the interface grids as one rigid body strains the structure "
                f"(forces of {strained:.1e} of their terms, most at {worst}, where {limit:.0e} is "
                "taken); check the places and axes of the grids and the order of the freedoms, or "
                "the structure is held elsewhere too, or mass and stiffness are exchanged."
            )
        return follow, strained
    condensed = motion.T @ forces
    scale = np.sqrt(np.sum(np.abs(motion) * terms, axis=0) + 1e-300)
    held = np.max(np.abs(stiffness[outer])) > 0.0
    if held and np.max(np.abs(condensed / np.outer(scale, scale))) > DETERMINATE:
        raise InputError(
            f"{name}: moving the port as a rigid body strains the structure; it is held elsewhere "
            "too, or boundary does not name the port's freedoms in the order x, y, z, rotations."
        )
    return follow, strained


def _is_soft(
    held: Array, mass: Array, k_ii: Array, follow: Array, inner: list[int], boundary: Boundary
) -> bool:
    """Whether a stiffness `held` `(6, 6)` against rigid motion is next to none for the mass that
    moves: that of a Craig-Bampton reduction is rounding of far larger numbers, which are not in
    the file any more.

    `follow`: motion of the inner freedoms per rigid motion of the port.
    """
    motion = np.zeros((mass.shape[0], 6))
    motion[list(boundary.rows)], motion[inner] = boundary.motion, follow
    moved = np.sqrt(np.diag(motion.T @ mass @ motion).clip(0.0))
    last = len(inner) - 1
    # 1/w^2 of the first mode, massless freedoms or not
    (longest,) = linalg.eigh(
        mass[np.ix_(inner, inner)], k_ii, eigvals_only=True, subset_by_index=(last, last)
    )
    return bool(np.all(np.abs(held) * longest <= SOFT * np.outer(moved, moved)))


def _largest_forces(stiffness: Array, motion: Array) -> Array:
    """`(b, 6)` forces that no freedom of the port exceeds under a motion of the port: by
    Cauchy-Schwarz |K_i u| <= sqrt(K_ii u^T K u), with the diagonal of K in the energy.

    A sum of terms far below it is zero by symmetry, and its terms are rounding.
    """
    diagonal = np.diag(stiffness).clip(0.0)
    own = diagonal.copy()
    shifts = np.any(motion[:, :3] != 0.0, axis=1)  # the others are rotations, in other units
    for kind in (shifts, ~shifts):
        if np.any(kind):
            own[kind] = np.maximum(own[kind], SOFTEST * np.max(own[kind]))
    energy = np.sum(diagonal[:, None] * motion**2, axis=0)  # R^T diag(K) R
    return np.sqrt(np.outer(own, energy)) + 1e-300


def _largest_inner(stiffness: Array, inner: list[int], boundary: Boundary) -> Array:
    """`(n, 6)` forces that no inner freedom exceeds under a motion of the port, by
    Cauchy-Schwarz as for the port's own."""
    own = np.diag(stiffness)[inner].clip(0.0)
    diagonal = np.diag(stiffness)[list(boundary.rows)].clip(0.0)
    energy = np.sum(diagonal[:, None] * boundary.motion**2, axis=0)  # R^T diag(K) R
    return np.sqrt(np.outer(own, energy)) + 1e-300
