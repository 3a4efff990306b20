"""The print of a Nastran normal-modes run (.f06): eigenvalues, participation factors, rigid mass.

Page headers may break a table anywhere, headings may be spaced out,
numbers may lack the E of their exponent.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.modal_data import ModalData
from beamchain.structure.planes import settle_rigid_mass
from beamchain.structure.readers.bounded import lines

PRECISION = 5e-7  # seven printed digits
AGREE = 1e-4  # relative: how far tables that say the same may be apart
ASK = (
    "ask Nastran for them: MEFFMASS(PRINT,ALL) = YES in the case control section and "
    "PARAM,GRDPNT,0 in the bulk data (SOL 103, the port clamped by SPC)"
)

_NUMBER = r"[+-]?(?:\d+\.\d*|\.\d+|\d+)(?:[EeDd][+-]?\d+|[+-]\d+)?"
_REAL = re.compile(_NUMBER + r"|\S+")
_ROW = re.compile(r"^\s*(\d+)\s+(\S.*)$")
_MATRIX = re.compile(r"^[0 ]?\s*\*(.*)\*\s*$")
_SUPERELEMENT = re.compile(r"\bSUPERELEMENT\s+[1-9]\d*\b")
_SUBCASE = re.compile(r"\bSUBCASE\s+(\d+)\s*$")
_PAGE = re.compile(r"\bPAGE\s+\d+\s*$")
_DATE = re.compile(r"\b(19|20)\d\d\b.*NASTRAN")

#: Headings without their blanks, the longest first, and the table each starts.
_HEADINGS = {
    "REALEIGENVALUES": "eigenvalues",
    "MODALPARTICIPATIONFACTORS": "participation",
    "MODALEFFECTIVEMASSFRACTION": "fractions",
    "MODALEFFECTIVEMASS": "effective mass",
    "MODALEFFECTIVEWEIGHT": "other",
    "TOTALEFFECTIVEMASSFRACTION": "other",
    "A-SETRIGIDBODYMASSMATRIX": "a-set mass",
    "RIGIDBODYMASSMATRIX": "a-set mass",
    "EFFECTIVEMASSMATRIX": "other",
    "OUTPUTFROMGRIDPOINTWEIGHTGENERATOR": "weight",
    "MO": "grid point mass",
}
# in every heading, page number and subcase; not in rows of numbers
_LETTERS = re.compile(r"[A-Z] *[A-Z]")
# most lines begin with none of them, which is seen at once
_FIRST = tuple({heading[:2] for heading in _HEADINGS})
_COLUMNS = {"eigenvalues": 6, "participation": 7, "effective mass": 7}


@dataclass
class _Subcase:
    """What the print holds for one subcase; rows by mode number."""

    tables: dict[str, dict[int, list[float]]] = field(default_factory=dict)
    matrices: dict[str, list[list[float]]] = field(default_factory=dict)
    points: dict[str, str] = field(default_factory=dict)
    fractions: bool = False
    superelements: bool = False


def read(path: Path, subcase: int | None = None) -> ModalData:
    """Modal data of a print, in its units, about its reference point."""
    cases, shared = _scan(path)
    number, case = _choose(path, cases, subcase)
    return _assemble(path, number, case, shared)


def _real(token: str, path: Path, line: int) -> float:
    """A Fortran number: D exponents, exponents without a letter."""
    word = token.upper().replace("D", "E")
    word = re.sub(r"(?<=[\d.])([+-]\d+)$", r"E\1", word) if "E" not in word else word
    try:
        value = float(word)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(
            f"file {str(path)!r}, line {line}: {token!r} is no number; the print is damaged or the "
            "run failed: run it again."
        )
    return value


def _scan(path: Path) -> tuple[dict[int, _Subcase], _Subcase]:
    """All tables by subcase, and what belongs to no subcase (the grid point weight generator)."""
    cases: dict[int, _Subcase] = {}
    shared = _Subcase()
    current, table = 0, ""
    for number, line in enumerate(lines(path), 1):
        if table in ("", "other") and not _LETTERS.search(line):
            continue
        if "SUPERELEMENT" in line and _SUPERELEMENT.search(line):
            shared.superelements = True
            line = _SUPERELEMENT.sub("", line)
            if not line.strip("0 \t"):
                continue
        if ("PAGE" in line and _PAGE.search(line)) or ("NASTRAN" in line and _DATE.search(line)):
            continue
        found = _SUBCASE.search(line) if "SUBCASE" in line else None
        if found:
            current = int(found[1])
            continue
        case = cases.setdefault(current, _Subcase())
        squeezed = "".join(line.lstrip("0").split())
        heading = None
        if squeezed.startswith(_FIRST):
            heading = next(
                (h for h in _HEADINGS if squeezed == h or (len(h) > 2 and squeezed.startswith(h))),
                None,
            )
        if heading is not None and not (heading == "MO" and table != "weight"):
            table = _HEADINGS[heading]
            case.fractions |= table == "fractions"
            continue
        if "REFERENCEPOINT" in squeezed:
            origin = "ORIGIN" in squeezed or squeezed.endswith("=0")
            where = "the origin" if origin else f"grid {squeezed.split('POINT')[-1].lstrip('=')}"
            (shared if table == "weight" else case).points[
                "grid point mass" if table == "weight" else "modes"
            ] = where
            continue
        if table in ("a-set mass", "grid point mass"):
            matrix = _MATRIX.match(line)
            if matrix and "**" not in line:
                rows = (shared if table == "grid point mass" else case).matrices.setdefault(
                    table, []
                )
                rows.append([_real(token, path, number) for token in _REAL.findall(matrix[1])])
                if len(rows) % 6 == 0:
                    table = "other"
            elif squeezed and "***" not in squeezed:
                table = "other"  # something else begins
            continue
        if (
            table in _COLUMNS
            and squeezed
            and not squeezed.startswith(("MODE", "NO.", "TOTAL", "(", "***"))
        ):
            row = _ROW.match(line)
            if row is None:
                table = ""
                continue
            tokens = [token for token in _REAL.findall(row[2]) if token.strip()]
            if len(tokens) != _COLUMNS[table]:
                raise InputError(
                    f"file {str(path)!r}, line {number}: a row of the {table} table holds "
                    f"{len(tokens) + 1} columns instead of {_COLUMNS[table] + 1}; the print is cut "
                    "or damaged: run it again."
                )
            values = [_real(token, path, number) for token in tokens]
            rows = case.tables.setdefault(table, {})
            mode = int(row[1])
            gap = max(abs(a - b) for a, b in zip(rows.get(mode, values), values, strict=True))
            if gap > 1e-6 * max(map(abs, values)):
                where = (
                    f"file {str(path)!r}, line {number}: mode {mode} stands twice in the "
                    f"{table} table with different "
                )
                if shared.superelements:
                    raise InputError(
                        f"{where}numbers, because the print holds superelements, each with modes "
                        "of its own; run the model without them (no SESET, BEGIN SUPER), or give "
                        "its assembled modes in a .toml file."
                    )
                raise InputError(f"{where}numbers; print one run only.")
            rows[mode] = values
    return cases, shared


def _choose(path: Path, cases: dict[int, _Subcase], subcase: int | None) -> tuple[int, _Subcase]:
    """The subcase whose modes are read."""
    full = [
        n for n, c in cases.items() if "participation" in c.tables and "eigenvalues" in c.tables
    ]
    if subcase is not None:
        if subcase not in full:
            known = ", ".join(str(n) for n in sorted(full)) or "none"
            raise InputError(
                f"subcase = {subcase} holds no modes with participation in {str(path)!r}; those "
                f"that do: {known}."
            )
        return subcase, cases[subcase]
    if len(full) > 1:
        raise InputError(
            f"file {str(path)!r} holds modes of subcases "
            f"{', '.join(str(n) for n in sorted(full))}; choose one with subcase = {min(full)}."
        )
    if full:
        return full[0], cases[full[0]]
    every = list(cases.values())
    if not any("eigenvalues" in c.tables for c in every):
        raise InputError(
            f"file {str(path)!r} holds no table of real eigenvalues; it is no print of a "
            f"normal-modes run, or it is cut: {ASK}."
        )
    if any("participation" in c.tables for c in every):
        raise InputError(
            f"file {str(path)!r} holds participation factors and eigenvalues in different "
            "subcases; print one run only."
        )
    if any(c.fractions or "effective mass" in c.tables for c in every):
        raise InputError(
            f"file {str(path)!r} holds effective masses but no MODAL PARTICIPATION FACTORS; "
            f"effective masses and fractions have lost the signs between force and moment: {ASK}."
        )
    raise InputError(
        f"file {str(path)!r} holds eigenvalues but no MODAL PARTICIPATION FACTORS; {ASK}."
    )


def _assemble(path: Path, number: int, case: _Subcase, shared: _Subcase) -> ModalData:
    eigen = case.tables["eigenvalues"]
    factors = case.tables["participation"]
    if set(eigen) != set(factors) or sorted(eigen) != list(range(1, len(eigen) + 1)):
        missing = sorted(set(range(1, max([*eigen, *factors]) + 1)) - (set(eigen) & set(factors)))
        raise InputError(
            f"file {str(path)!r}: mode {missing[0]} is missing in one of the tables (eigenvalues "
            f"{len(eigen)} rows, participation {len(factors)}); the print is cut: run it again."
        )
    # extraction order, eigenvalue, rad/s, Hz, mass, stiffness
    rows = np.array([eigen[k] for k in sorted(eigen)])
    table = np.array([factors[k] for k in sorted(factors)])  # Hz, six factors
    if rows[0, 1] <= 0.0 or rows[0, 2] < 1e-5 * rows[-1, 2]:
        raise InputError(
            f"file {str(path)!r}: mode 1 has the eigenvalue {rows[0, 1]:.3g}: the structure moves "
            "as a rigid body; clamp the port (SPC) and run it again."
        )
    radians = np.sqrt(rows[:, 1])
    for name, other in (
        ("radians", rows[:, 2]),
        ("cycles", rows[:, 3] * 2.0 * np.pi),
        ("frequency", table[:, 0] * 2.0 * np.pi),
    ):
        worst = int(np.argmax(np.abs(other / radians - 1.0)))
        if abs(other[worst] / radians[worst] - 1.0) > AGREE:
            raise InputError(
                f"file {str(path)!r}: mode {worst + 1}: eigenvalue {rows[worst, 1]:.6g} and its "
                f"{name} disagree; the print is damaged: run it again."
            )
    steps = [f"subcase {number}" if number else "no subcase named"]
    modal_mass = rows[:, 4]
    if np.any(modal_mass <= 0.0):
        raise InputError(
            f"file {str(path)!r}: a generalized mass is not positive; the print is damaged: run it "
            "again."
        )
    if np.max(np.abs(modal_mass - 1.0)) > PRECISION:
        steps.append("modes scaled to unit generalized mass")
    participation = table[:, 1:] * np.sqrt(modal_mass)[:, None]
    if "effective mass" in case.tables:
        _compare(path, participation, case.tables["effective mass"])
        steps.append("participation agrees with the effective masses")
    mass, words = _mass(path, case, shared, participation)
    steps += words
    where = case.points.get("modes", "the origin")
    if where != "the origin":
        steps.append(f"the print's reference point is {where}: `reference` counts from there")
    return ModalData(
        mass, radians, participation, precision=PRECISION, source=path.name, steps=tuple(steps)
    )


def _compare(path: Path, participation: Array, effective: dict[int, list[float]]) -> None:
    """Participation against the printed effective masses, where those are more than noise."""
    # of the three motions of a kind
    largest = np.repeat(np.max((participation**2).reshape(-1, 2, 3), axis=(0, 2)), 3)
    for mode, values in effective.items():
        if mode > participation.shape[0]:
            continue
        ours = participation[mode - 1] ** 2
        theirs = np.array(values[1:])
        bad = np.abs(ours - theirs) > AGREE * theirs + 1e-9 * largest
        if np.any(bad):
            i = int(np.argmax(bad))
            raise InputError(
                f"file {str(path)!r}: mode {mode}: participation squared {ours[i]:.6g} and "
                f"effective mass {theirs[i]:.6g} disagree; were the modes normalised otherwise in "
                "one table? Print one run only."
            )


def _mass(
    path: Path, case: _Subcase, shared: _Subcase, participation: Array
) -> tuple[Array, list[str]]:
    """The rigid mass matrix, with that of clamped nodes where it is printed."""
    found: dict[str, Array] = {}
    for name, holder in (("grid point mass", shared), ("a-set mass", case)):
        rows = holder.matrices.get(name, [])
        if not rows:
            continue
        if len(rows) % 6 or any(len(row) != 6 for row in rows):
            raise InputError(
                f"file {str(path)!r}: the rigid mass matrix ({name}) is not 6 x 6 ({len(rows)} "
                "rows); the print is cut: run it again."
            )
        found[name] = np.array(rows[:6])
    if not found:
        raise InputError(f"file {str(path)!r} holds no rigid mass matrix; {ASK}.")
    words: list[str] = []
    same = shared.points.get("grid point mass", "the origin") == case.points.get(
        "modes", "the origin"
    )
    if "grid point mass" in found:
        fits = same
        if same:
            try:
                settle_rigid_mass(found["grid point mass"], participation, PRECISION)
            except InputError:
                fits = False
        if fits or "a-set mass" not in found:
            words.append("rigid mass from the grid point weight generator, clamped nodes included")
            return found["grid point mass"], words
        words.append(
            "rigid mass of the grid point weight generator not used: "
            + (
                "it contradicts the participation (WTMASS?)"
                if same
                else "it stands about another point"
            )
        )
    words.append("rigid mass of the a-set: the mass of the clamped nodes is not in it")
    return found["a-set mass"], words
