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
from numpy.typing import NDArray
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
    parts = _partition(mass, stiffness, boundary)
    if not parts.inner.size:
        raise InputError(
            f"{name}: all {d} freedoms belong to the port, so that nothing can vibrate; export "
            "modes, or inner freedoms, too."
        )
    follow, strained = _rigid_motion(parts, boundary, name, precision)
    body = _moving_body(parts, follow, precision)
    frequencies, shapes = _held_modes(body.inner, parts.k_ii, name)
    # L = Phi^T P, Phi of unit mass
    participation = shapes @ body.coupling
    if body.rigid is not body.stated:
        participation = within_body(participation, body.rigid, body_departure(body.stated))
    further = tuple(
        FurtherPoint(
            point.name,
            point.place,
            shapes[:, np.searchsorted(parts.inner, point.rows)] @ np.kron(np.eye(2), point.axes),
        )
        for point in boundary.free
    )
    held = len(boundary.rows)
    steps = [
        f"matrices of {d} freedoms, {'six' if held == 6 else held} of them the port's; the lowest "
        f"{frequencies.size} modes with the port held"
    ]
    if held != 6:
        steps.append(
            f"rigid-body check: forces of {strained:.1e} of the terms they are the sum of, where "
            f"{max(STRAINED, ROUNDED * precision):.0e} is taken"
        )
    if body.departure:
        steps.append(body.departure)
    return ModalData(
        body.rigid,
        frequencies,
        participation,
        precision=precision,
        source=name,
        steps=tuple(steps),
        further=further,
        origin=shapes,
    )


class _Partition(NamedTuple):
    """Mass and stiffness of the `inner` freedoms, i, and of those of the boundary, o, whose
    `motion` is `(o, 6)` per motion of the port."""

    inner: NDArray[np.intp]
    motion: Array
    m_ii: Array
    m_io: Array
    m_oo: Array
    k_ii: Array
    k_io: Array
    k_oo: Array

    def masses(self, follow: Array) -> tuple[Array, Array]:
        """`(6, 6)` mass of the port's motion and `(n, 6)` its coupling to the inner freedoms, which
        `follow` it."""
        # G = follow, R = motion: P = M_ii G + M_io R, M = R^T M_oo R + G^T M_io R + P^T G
        between = self.m_io @ self.motion
        coupling = self.m_ii @ follow + between
        rigid = self.motion.T @ self.m_oo @ self.motion + follow.T @ between + coupling.T @ follow
        return rigid, coupling


def _partition(mass: Array, stiffness: Array, boundary: Boundary) -> _Partition:
    """The symmetric parts of mass and stiffness, by the freedoms of a boundary and the others."""
    outer = np.array(boundary.rows)
    inner = np.setdiff1d(np.arange(len(mass)), outer)
    blocks = [
        (matrix[np.ix_(rows, columns)] + matrix[np.ix_(columns, rows)].T) / 2.0
        for matrix in (mass, stiffness)
        for rows, columns in ((inner, inner), (inner, outer), (outer, outer))
    ]
    return _Partition(inner, boundary.motion, *blocks)


class _MovingBody(NamedTuple):
    """Masses of a structure in motions of the port `(6, 6)` and of inner freedoms `(n, n)`, and
    their `coupling` `(n, 6)`.

    `stated`: the rigid mass as it followed from the matrices, before it was made a rigid body's;
    `departure`: a sentence on how far that is from one, where it is worth a word.
    """

    rigid: Array
    coupling: Array
    inner: Array
    stated: Array
    departure: str


def _moving_body(parts: _Partition, follow: Array, precision: float) -> _MovingBody:
    """Masses of a structure whose inner freedoms `follow` `(n, 6)` the port."""
    stated, coupling = parts.masses(follow)
    # modes with the grids held do not follow the grids: then K_ib is zero but for rounding
    still, still_coupling = parts.masses(np.zeros_like(follow))
    k_ib = parts.k_io @ parts.motion
    is_rounding = np.abs(k_ib) <= STRAINED * NOISE * _largest_inner(parts)
    size = np.sqrt(np.abs(np.diag(stated)))
    is_near = np.abs(stated - still) <= ALMOST_BODY * np.outer(size, size)
    if is_rounding.all() and is_near.all() and body_departure(still) < body_departure(stated):
        stated, coupling = still, still_coupling
    rigid, departure = _almost_body(stated, precision)
    if not departure:
        return _MovingBody(rigid, coupling, parts.m_ii, stated, departure)
    whole = np.block([[rigid, coupling.T], [coupling, parts.m_ii]])
    noise = [noise_of_motions(stated), _noise_of_freedoms(parts.m_ii, stated)]
    whole = independent_parts(whole, parts.k_ii, np.sqrt(NOISY) * np.concatenate(noise))
    rigid = realisable_body(whole[:6, :6])
    return _MovingBody(rigid, whole[6:, :6], whole[6:, 6:], stated, departure)


def _held_modes(mass: Array, stiffness: Array, name: str) -> tuple[Array, Array]:
    """Frequencies `(m,)` [rad/s] and shapes `(m, n)` of unit mass, the lowest `MOST`."""
    # for 1/w^2: massless freedoms do no harm, low modes keep their digits
    inverse, shapes = linalg.eigh(mass, stiffness)
    order = np.argsort(inverse)[::-1]
    order = order[inverse[order] > 1e-14 * inverse[order[0]]][:MOST]
    if not order.size or inverse[order[0]] <= 0.0:
        raise InputError(
            f"{name}: no freedom beside the port's has mass, so that nothing can vibrate; export "
            "the mass matrix again."
        )
    frequencies = 1.0 / np.sqrt(inverse[order])
    return frequencies, (frequencies * shapes[:, order]).T


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
    parts: _Partition, boundary: Boundary, name: str, precision: float
) -> tuple[Array, float]:
    """`(n, 6)` motion of the inner freedoms per motion of the port, which must not strain them;
    and the largest force that is left at the port, relative to the terms it is the sum of."""
    motion, k_ii, k_io, k_oo = parts.motion, parts.k_ii, parts.k_io, parts.k_oo
    held = len(motion)
    try:
        factor = linalg.cho_factor(k_ii)
        # rounding decides whether a singular matrix is factored:
        # its last pivot then is nothing but rounding
        if np.min(np.diag(factor[0]) ** 2 / np.diag(k_ii)) < LOOSE:
            raise linalg.LinAlgError
    except linalg.LinAlgError:
        raise InputError(
            f"{name}: with the {'six ' if held == 6 else ''}boundary freedoms held the "
            "structure can still move (its stiffness is not positive definite); check "
            f"{'grids and the order of the freedoms' if boundary.names else 'boundary'}, and that "
            "massless freedoms have stiffness."
        ) from None
    # G = -K_ii^-1 K_ib
    follow = -linalg.cho_solve(factor, k_io @ motion)
    # forces at the port's freedoms: zero where the port is the only support
    forces = k_oo @ motion + k_io.T @ follow
    if held == 6 and _is_soft(motion.T @ forces, parts, follow):
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
    is_sprung = np.any(k_oo) or np.any(k_io)
    if is_sprung and np.max(np.abs(condensed / np.outer(scale, scale))) > DETERMINATE:
        raise InputError(
            f"{name}: moving the port as a rigid body strains the structure; it is held elsewhere "
            "too, or boundary does not name the port's freedoms in the order x, y, z, rotations."
        )
    return follow, strained


def _is_soft(held: Array, parts: _Partition, follow: Array) -> bool:
    """Whether a stiffness `held` `(6, 6)` against rigid motion is next to none for the mass that
    moves: that of a Craig-Bampton reduction is rounding of far larger numbers, which are not in
    the file any more.

    `follow`: motion of the inner freedoms per rigid motion of the port.
    """
    moved = np.sqrt(np.diag(parts.masses(follow)[0]).clip(0.0))
    last = len(follow) - 1
    # 1/w^2 of the first mode, massless freedoms or not
    (longest,) = linalg.eigh(
        parts.m_ii, parts.k_ii, eigvals_only=True, subset_by_index=(last, last)
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


def _largest_inner(parts: _Partition) -> Array:
    """`(n, 6)` forces that no inner freedom exceeds under a motion of the port, by
    Cauchy-Schwarz as for the port's own."""
    own = np.diag(parts.k_ii).clip(0.0)
    diagonal = np.diag(parts.k_oo).clip(0.0)
    energy = np.sum(diagonal[:, None] * parts.motion**2, axis=0)  # R^T diag(K) R
    return np.sqrt(np.outer(own, energy)) + 1e-300
