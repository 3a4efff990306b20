"""Matrices in Nastran's OUTPUT4 files: text or binary, dense or sparse, in either byte order.

Source: the descriptions of OUTPUT4 in the DMAP guides of MSC and NX Nastran. Every matrix has a
header (columns, rows, form, type, name); then a record per column with its number, its first row
(0: sparse) and the number of words; a column beyond the last ends the matrix. A sparse column
consists of strings of numbers, each with its own first row; "bigmat" (a negative number of rows, or
more than 65,535) gives row and length a word each, otherwise both share one.
"""

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.readers import safe_reading

LARGEST_FILE = 300_000_000
SMALLER = "write the mass and stiffness matrices alone"
NEITHER = "it is neither a text nor a binary OUTPUT4 file: write it again"
ROWS_OF_BIGMAT = 65_536  # from as many rows on a sparse matrix is "bigmat"
HEADERS = {24: 4, 48: 8}  # bytes of a binary header -> bytes of its integers
SINGLE = 6e-8  # half a unit in the last place of a single-precision number
DOUBLE = 1e-12  # with some room for what was computed from such numbers
MOST_MATRICES = 10_000  # of one file; a superelement has some thirty
COMPLEX = (3, 4)
TYPES = (1, 2, *COMPLEX)
DIGITS = frozenset("0123456789+-.EeDd ")
FORMAT = re.compile(r"(1P)?,?\s*(\d{1,2})[ED](\d{1,2})\.(\d{1,2})")
BARE_EXPONENT = re.compile(r"(?<=[\d.])(?=[+-]\d{1,3}$)")  # 1.234-100, as Fortran prints it


class Matrix(NamedTuple):
    """A matrix `(rows, columns)`, and the relative precision of its numbers."""

    values: Array
    precision: float


@dataclass(frozen=True)
class Header:
    """What stands before the columns of a matrix."""

    name: str
    rows: int
    columns: int
    kind: int
    bigmat: bool

    @classmethod
    def of(cls, name: str, numbers: tuple[int, ...]) -> "Header":
        """The header of these numbers: columns, rows, form, type."""
        columns, rows, _, kind = numbers
        name = name.replace("\0", " ").replace(" ", "").upper()
        if kind not in TYPES or columns < 0:
            raise ValueError(f"matrix {name!r:.20} is of type {kind}, with {columns} columns")
        bigmat = rows < 0 or rows >= ROWS_OF_BIGMAT
        return cls(name, abs(rows), columns, kind, bigmat)

    @property
    def words(self) -> int:
        """Words of four bytes per number."""
        return 2 if self.kind % 2 == 0 else 1


class _Target:
    """A matrix as it is filled, or one that is passed over (`values` None)."""

    def __init__(self, header: Header, wanted: Collection[str], path: Path) -> None:
        self.header = header
        self.column = 0
        self.values: Array | None = None
        if header.name in wanted:
            _check_header(header, path)
            self.values = np.zeros((header.rows, header.columns))

    def begin(self, column: int) -> bool:
        """Go to a column; False beyond the last one."""
        if column <= self.column:
            raise ValueError(f"column {column} of {self.header.name} follows {self.column}")
        self.column = column
        return column <= self.header.columns

    def check(self, row: int, count: int) -> None:
        """A string of `count` numbers from `row` lies inside the matrix."""
        per_entry = 2 if self.header.kind in COMPLEX else 1
        if count < 0 or row < 1 or row - 1 + count // per_entry > self.header.rows:
            raise ValueError(
                f"column {self.column} of {self.header.name} has {count} numbers from row {row}, "
                f"and the matrix has {self.header.rows} rows"
            )

    def put(self, row: int, numbers: Array) -> None:
        """Numbers of the present column, from `row` on."""
        if self.values is not None:
            self.values[row - 1 : row - 1 + numbers.size, self.column - 1] = numbers


def _check_count(matrices: int) -> None:
    if matrices > MOST_MATRICES:
        raise ValueError(f"it has more than {MOST_MATRICES} matrices")


def _check_header(header: Header, path: Path) -> None:
    """A wanted matrix is real and of a bounded size."""
    if header.kind in COMPLEX:
        raise InputError(
            f"file {str(path)!r}: {header.name} holds complex numbers; give real mass and "
            "stiffness, and the damping as ratios by [damping]."
        )
    if max(header.rows, header.columns) > safe_reading.LONGEST:
        raise InputError(
            f"file {str(path)!r}: {header.name} has the shape ({header.rows}, {header.columns}); "
            f"at most {safe_reading.LONGEST} freedoms are taken: reduce the model first."
        )


def read_op4(
    path: Path, wanted: Collection[str], others: set[str] | None = None
) -> dict[str, Matrix]:
    """The wanted matrices of an OUTPUT4 file, by name in capitals; the names of those that are
    passed over are added to `others`.

    Raises:
        InputError: the file is cut or spoilt, or a wanted matrix is complex, too large, or stands
            in the file more than once.
    """
    safe_reading.check_size(path, LARGEST_FILE, smaller=SMALLER)
    matrices: dict[str, Matrix] = {}
    try:
        with path.open("rb") as stream:
            binary = _integer_size(stream.read(4)) is not None
        for name, matrix in (_binary if binary else _text)(path, wanted):
            if matrix is None:
                if others is not None:
                    others.add(name)
                continue
            if name in matrices:
                raise InputError(
                    f"file {str(path)!r} holds {name} more than once; write the superelement that "
                    "is meant into a file of its own."
                )
            matrices[name] = matrix
    except InputError:
        raise
    except OSError as error:
        raise InputError(
            f"file {str(path)!r} cannot be read ({error.strerror}); check its permissions."
        ) from None
    except (ValueError, OverflowError) as error:
        raise InputError(
            f"file {str(path)!r} cannot be read as OUTPUT4 ({error}); it is cut or spoilt: write "
            "it again."
        ) from None
    for name, matrix in matrices.items():
        if not np.all(np.isfinite(matrix.values)):
            raise InputError(
                f"file {str(path)!r}: {name} holds a value that is not a finite number; write it "
                "again."
            )
    return matrices


# -- binary ----------------------------------------------------------------------------------------
def _integer_size(first: bytes) -> tuple[str, int] | None:
    """Byte order and size of the integers; None for a text. The first record is a header."""
    for order in "<>":
        length = int.from_bytes(first, "little" if order == "<" else "big")
        if length in HEADERS:
            return order, HEADERS[length]
    return None


def _records(content: memoryview, order: str) -> Iterator[memoryview]:
    """Fortran's records, of which each stands between two copies of its length."""
    at = 0
    while at < len(content):
        frame = np.frombuffer(content[at : at + 4], order + "u4") if at + 4 <= len(content) else []
        end = at + 4 + int(frame[0]) if len(frame) else len(content)
        if end + 4 > len(content):
            raise ValueError(f"it ends within the record at byte {at}")
        if content[end : end + 4] != content[at : at + 4]:
            raise ValueError(f"the record at byte {at} does not end where it says")
        yield content[at + 4 : end]
        at = end + 4


def _binary(path: Path, wanted: Collection[str]) -> Iterator[tuple[str, Matrix | None]]:
    content = memoryview(path.read_bytes())
    kind = _integer_size(bytes(content[:4]))
    assert kind is not None
    order, size = kind
    integer = np.dtype(f"{order}i{size}")
    records = _records(content, order)
    for count, head in enumerate(records):
        _check_count(count)
        if len(head) != 6 * size:
            raise ValueError(f"a header of {len(head)} bytes stands among ones of {6 * size}")
        numbers = tuple(np.frombuffer(head[: 4 * size], integer).tolist())
        header = Header.of(bytes(head[4 * size :]).decode("latin-1"), numbers)
        target = _Target(header, wanted, path)
        double = header.words == 2 or size == 8
        number = np.dtype(f"{order}f{8 if double else 4}")
        for record in records:
            if len(record) < 3 * size:
                raise ValueError(f"a column of {header.name} has {len(record)} bytes")
            column, row, count = np.frombuffer(record[: 3 * size], integer).tolist()
            if not target.begin(column):
                break
            used = record[3 * size : 3 * size + max(count, 0) * size]
            if count < 0 or len(used) < count * size:
                raise ValueError(f"column {column} of {header.name} is shorter than it says")
            if row > 0:
                _put_numbers(target, row, used, number)
            else:
                _put_strings(target, used, integer, number)
        else:
            raise ValueError(f"it ends within {header.name}")
        if target.values is None:
            yield header.name, None
        else:
            yield header.name, Matrix(target.values, DOUBLE if double else SINGLE)


def _put_numbers(target: _Target, row: int, words: memoryview, number: np.dtype) -> None:
    count = len(words) // number.itemsize
    target.check(row, count)
    if target.values is not None:
        target.put(row, np.frombuffer(words[: count * number.itemsize], number))


def _put_strings(target: _Target, words: memoryview, integer: np.dtype, number: np.dtype) -> None:
    """The strings of a sparse column: length and row, then numbers."""
    size = integer.itemsize
    head = 2 * size if target.header.bigmat else size
    at = 0
    while at + head <= len(words):
        numbers = np.frombuffer(words[at : at + head], integer).tolist()
        length, row = numbers if target.header.bigmat else _split_word(numbers[0])
        end = at + head + (length - 1) * size
        if length < 1 or end > len(words):
            raise ValueError(
                f"a string of column {target.column} of {target.header.name} has {length} words"
            )
        _put_numbers(target, row, words[at + head : end], number)
        at = end


def _split_word(word: int) -> tuple[int, int]:
    """Length and row that share a word: `row + 65536 (words + 1)`, the length being words + 1."""
    return word >> 16, word & 0xFFFF


# -- text ------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Layout:
    """How numbers stand on lines."""

    per_line: int = 5
    width: int = 16
    digits: int = 10

    @classmethod
    def of(cls, text: str) -> "Layout":
        """The layout of a Fortran format such as 1P,3E23.16."""
        if not text.strip():
            return cls()
        found = FORMAT.match(text.strip().upper())
        if found is None:
            raise ValueError(f"the format {text.strip()!r:.20} is unknown")
        per_line, width, decimals = (int(found[i]) for i in (2, 3, 4))
        if not (per_line and decimals < width):
            raise ValueError(f"the format {text.strip()!r:.20} holds no numbers")
        return cls(per_line, width, decimals + (1 if found[1] else 0))

    def read(self, lines: Iterator[str], count: int) -> Iterator[str]:
        """The pieces of `count` numbers."""
        left = count
        while left > 0:
            line = next(lines, None)
            if line is None:
                raise ValueError("it ends within a column")
            pieces = min(left, self.per_line)
            line = line[: pieces * self.width]
            if not DIGITS.issuperset(line) or len(line) <= (pieces - 1) * self.width:
                raise ValueError(f"the line {line.strip()!r:.40} does not hold {pieces} numbers")
            yield from (line[k * self.width : (k + 1) * self.width] for k in range(pieces))
            left -= pieces

    def skip(self, lines: Iterator[str], count: int) -> None:
        """Pass over the lines of `count` numbers."""
        needed = -(-count // self.per_line)
        if sum(1 for _ in islice(lines, needed)) < needed:
            raise ValueError("it ends within a column")


def fortran_number(text: str) -> float:
    """A number as Fortran prints it: 1.5E-3, 1.5D-3, or 1.5-3.

    Raises:
        ValueError: it is none.
    """
    return float(BARE_EXPONENT.sub("E", text.strip().upper().replace("D", "E")))


def _text(path: Path, wanted: Collection[str]) -> Iterator[tuple[str, Matrix | None]]:
    lines = safe_reading.lines(path, smaller=SMALLER, no_text=NEITHER)
    count = 0
    for line in lines:
        if not line.strip():
            continue
        count += 1
        _check_count(count)
        header, layout = _text_header(line)
        target = _Target(header, wanted, path)
        while True:
            head = next(lines, None)
            if head is None:
                raise ValueError(f"it ends within {header.name}")
            column, row, words = _integers(head, (8, 8, 8))
            if not target.begin(column):
                layout.skip(lines, max(words, 1))
                break
            if row > 0:
                _take(target, layout, lines, row, words)
            else:
                _take_strings(target, layout, lines, words)
        if target.values is None:
            yield header.name, None
        else:
            printed = max(5.0 * 10.0**-layout.digits, SINGLE if header.words == 1 else DOUBLE)
            yield header.name, Matrix(target.values, printed)


def _text_header(line: str) -> tuple[Header, Layout]:
    line = line.rstrip()
    wide = line.endswith("|I16")
    if wide:
        line = line[:-4]
    widths = (16, 16, 8, 8) if wide else (8, 8, 8, 8)
    begin = sum(widths)
    header = Header.of(line[begin : begin + 8], _integers(line, widths))
    return header, Layout.of(line[begin + 8 :])


def _integers(line: str, widths: tuple[int, ...]) -> tuple[int, ...]:
    """Integers that stand in fields of these widths."""
    out: list[int] = []
    at = 0
    for width in widths:
        piece = line[at : at + width].strip()
        if not piece.lstrip("-").isdigit() or not piece.isascii():
            raise ValueError(f"the line {line.strip()!r:.40} does not hold {len(widths)} integers")
        out.append(int(piece))
        at += width
    return tuple(out)


def _take(target: _Target, layout: Layout, lines: Iterator[str], row: int, count: int) -> None:
    target.check(row, count)
    if target.values is None:
        layout.skip(lines, count)
    else:
        numbers = [fortran_number(piece) for piece in layout.read(lines, count)]
        target.put(row, np.array(numbers))


def _take_strings(target: _Target, layout: Layout, lines: Iterator[str], words: int) -> None:
    """The strings of a sparse column, `words` long together."""
    bigmat = target.header.bigmat
    while words > 0:
        line = next(lines, None)
        if line is None:
            raise ValueError(f"it ends within {target.header.name}")
        if bigmat:
            length, row = _integers(line, (8, 8))
        else:
            length, row = _split_word(*_integers(line, (16,)))
        if length < 1:
            raise ValueError(f"a string of {target.header.name} has {length} words")
        _take(target, layout, lines, row, (length - 1) // target.header.words)
        words -= length + (1 if bigmat else 0)
