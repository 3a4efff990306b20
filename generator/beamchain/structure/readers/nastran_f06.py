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
from beamchain.structure.readers.safe_reading import lines
from beamchain.structure.settle_modes import settle_rigid_mass

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
# what a line between the rows of a table may begin with
_BESIDE_ROWS = ("MODE", "NO.", "TOTAL", "(", "***")
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
    scanner = _Scanner(path)
    for number, line in enumerate(lines(path), 1):
        scanner.read(number, line)
    return scanner.cases, scanner.shared


class _Scanner:
    """Collects the tables of a print, line by line.

    The current table is "" where none has begun, and "other" within one that is not read.
    """

    def __init__(self, path: Path) -> None:
        self.cases: dict[int, _Subcase] = {}
        self.shared = _Subcase()
        self._path = path
        self._subcase = 0
        self._table = ""

    def read(self, number: int, line: str) -> None:
        """Take the next line; `number` is its own in the file."""
        if self._table in ("", "other") and not _LETTERS.search(line):
            return
        if "SUPERELEMENT" in line and _SUPERELEMENT.search(line):
            self.shared.superelements = True
            line = _SUPERELEMENT.sub("", line)
            if not line.strip("0 \t"):
                return
        if _is_page_header(line):
            return
        if "SUBCASE" in line and (subcase := _SUBCASE.search(line)):
            self._subcase = int(subcase[1])
            return
        text = "".join(line.lstrip("0").split())
        heading = self._heading(text)
        if heading:
            self._table = _HEADINGS[heading]
            self._case.fractions |= self._table == "fractions"
        elif "REFERENCEPOINT" in text:
            self._read_reference_point(text)
        elif self._table in ("a-set mass", "grid point mass"):
            self._read_matrix_row(number, line, text)
        elif self._table in _COLUMNS and text and not text.startswith(_BESIDE_ROWS):
            self._read_row(number, line)

    @property
    def _case(self) -> _Subcase:
        return self.cases.setdefault(self._subcase, _Subcase())

    def _heading(self, text: str) -> str:
        """The heading that a line without blanks is; "" where it is none."""
        if not text.startswith(_FIRST):
            return ""
        for heading in _HEADINGS:
            # MO heads the matrix of the weight generator, and begins other words elsewhere
            if heading == "MO":
                if text == "MO" and self._table == "weight":
                    return heading
            elif text.startswith(heading):
                return heading
        return ""

    def _read_reference_point(self, text: str) -> None:
        is_origin = "ORIGIN" in text or text.endswith("=0")
        point = "the origin" if is_origin else f"grid {text.split('POINT')[-1].lstrip('=')}"
        if self._table == "weight":
            self.shared.points["grid point mass"] = point
        else:
            self._case.points["modes"] = point

    def _read_matrix_row(self, number: int, line: str, text: str) -> None:
        """A row between asterisks; the sixth ends the matrix."""
        row = _MATRIX.match(line)
        if row and "**" not in line:
            holder = self.shared if self._table == "grid point mass" else self._case
            matrix = holder.matrices.setdefault(self._table, [])
            matrix.append([_real(token, self._path, number) for token in _REAL.findall(row[1])])
            if len(matrix) % 6 == 0:
                self._table = "other"
        elif text and "***" not in text:
            self._table = "other"  # something else begins

    def _read_row(self, number: int, line: str) -> None:
        """A mode's row of a table; a line that is none ends the table."""
        row = _ROW.match(line)
        if row is None:
            self._table = ""
            return
        columns = _COLUMNS[self._table]
        tokens = [token for token in _REAL.findall(row[2]) if token.strip()]
        if len(tokens) != columns:
            raise InputError(
                f"file {str(self._path)!r}, line {number}: a row of the {self._table} table holds "
                f"{len(tokens) + 1} columns instead of {columns + 1}; the print is cut "
                "or damaged: run it again."
            )
        values = [_real(token, self._path, number) for token in tokens]
        rows = self._case.tables.setdefault(self._table, {})
        mode = int(row[1])
        known = rows.get(mode, values)
        difference = max(abs(a - b) for a, b in zip(known, values, strict=True))
        if difference > 1e-6 * max(map(abs, values)):
            self._refuse_second_row(number, mode)
        rows[mode] = values

    def _refuse_second_row(self, number: int, mode: int) -> None:
        where = (
            f"file {str(self._path)!r}, line {number}: mode {mode} stands twice in the "
            f"{self._table} table with different "
        )
        if self.shared.superelements:
            raise InputError(
                f"{where}numbers, because the print holds superelements, each with modes "
                "of its own; run the model without them (no SESET, BEGIN SUPER), or give "
                "its assembled modes in a .toml file."
            )
        raise InputError(f"{where}numbers; print one run only.")


def _is_page_header(line: str) -> bool:
    has_page = "PAGE" in line and _PAGE.search(line)
    has_date = "NASTRAN" in line and _DATE.search(line)
    return bool(has_page or has_date)


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
    """The modal data of a subcase, its tables checked against each other."""
    eigen = case.tables["eigenvalues"]
    factors = case.tables["participation"]
    if set(eigen) != set(factors) or sorted(eigen) != list(range(1, len(eigen) + 1)):
        missing = sorted(set(range(1, max([*eigen, *factors]) + 1)) - (set(eigen) & set(factors)))
        raise InputError(
            f"file {str(path)!r}: mode {missing[0]} is missing in one of the tables (eigenvalues "
            f"{len(eigen)} rows, participation {len(factors)}); the print is cut: run it again."
        )
    # extraction order, eigenvalue, rad/s, Hz, mass, stiffness
    eigen_rows = np.array([eigen[k] for k in sorted(eigen)])
    factor_rows = np.array([factors[k] for k in sorted(factors)])  # Hz, six factors
    omega = _frequencies(path, eigen_rows, factor_rows[:, 0])
    modal_mass = eigen_rows[:, 4]
    if np.any(modal_mass <= 0.0):
        raise InputError(
            f"file {str(path)!r}: a generalized mass is not positive; the print is damaged: run it "
            "again."
        )
    steps = [f"subcase {number}" if number else "no subcase named"]
    if np.max(np.abs(modal_mass - 1.0)) > PRECISION:
        steps.append("modes scaled to unit generalized mass")
    participation = factor_rows[:, 1:] * np.sqrt(modal_mass)[:, None]
    if "effective mass" in case.tables:
        _compare(path, participation, case.tables["effective mass"])
        steps.append("participation agrees with the effective masses")
    rigid_mass, mass_steps = _mass(path, case, shared, participation)
    steps += mass_steps
    point = case.points.get("modes", "the origin")
    basic = "the origin of the basic axes"
    steps.append(f"the file's reference point is {basic if point == 'the origin' else point}")
    return ModalData(
        rigid_mass, omega, participation, precision=PRECISION, source=path.name, steps=tuple(steps)
    )


def _frequencies(path: Path, eigen_rows: Array, cycles: Array) -> Array:
    """Frequencies [rad/s] by the eigenvalues; the other columns that state them must agree.

    `cycles`: those of the participation table [Hz].
    """
    eigenvalues = eigen_rows[:, 1]
    if eigenvalues[0] <= 0.0 or eigen_rows[0, 2] < 1e-5 * eigen_rows[-1, 2]:
        raise InputError(
            f"file {str(path)!r}: mode 1 has the eigenvalue {eigenvalues[0]:.3g}: the structure "
            "moves as a rigid body; clamp the port (SPC) and run it again."
        )
    omega = np.sqrt(eigenvalues)
    stated = {
        "radians": eigen_rows[:, 2],
        "cycles": eigen_rows[:, 3] * 2.0 * np.pi,
        "frequency": cycles * 2.0 * np.pi,
    }
    for column, values in stated.items():
        difference = np.abs(values / omega - 1.0)
        worst = int(np.argmax(difference))
        if difference[worst] > AGREE:
            raise InputError(
                f"file {str(path)!r}: mode {worst + 1}: eigenvalue {eigenvalues[worst]:.6g} and "
                f"its {column} disagree; the print is damaged: run it again."
            )
    return omega


def _compare(path: Path, participation: Array, effective: dict[int, list[float]]) -> None:
    """Participation against the printed effective masses, where those are more than noise."""
    # of the three motions of a kind
    largest = np.repeat(np.max((participation**2).reshape(-1, 2, 3), axis=(0, 2)), 3)
    for mode, values in effective.items():
        if mode > participation.shape[0]:
            continue
        squared = participation[mode - 1] ** 2
        printed = np.array(values[1:])
        is_off = np.abs(squared - printed) > AGREE * printed + 1e-9 * largest
        if np.any(is_off):
            i = int(np.argmax(is_off))
            raise InputError(
                f"file {str(path)!r}: mode {mode}: participation squared {squared[i]:.6g} and "
                f"effective mass {printed[i]:.6g} disagree; were the modes normalised otherwise in "
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
    by_weight = found.get("grid point mass")
    by_a_set = found.get("a-set mass")
    steps: list[str] = []
    if by_weight is not None:
        point = shared.points.get("grid point mass", "the origin")
        same_point = point == case.points.get("modes", "the origin")
        agrees = same_point and _agrees(by_weight, participation)
        if agrees or by_a_set is None:
            return by_weight, [
                "rigid mass from the grid point weight generator, clamped nodes included"
            ]
        reason = (
            "it contradicts the participation (WTMASS?)"
            if same_point
            else "it stands about another point"
        )
        steps.append(f"rigid mass of the grid point weight generator not used: {reason}")
    assert by_a_set is not None
    steps.append("rigid mass of the a-set: the mass of the clamped nodes is not in it")
    return by_a_set, steps


def _agrees(mass: Array, participation: Array) -> bool:
    """Whether a rigid mass matrix is at least what the modes participate with."""
    try:
        settle_rigid_mass(mass, participation, PRECISION)
    except InputError:
        return False
    return True
