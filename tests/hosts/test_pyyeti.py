"""op2 files through pyYeti: one written here, record by record,
and those of real runs that pyYeti's own tests ship.

The file's layout is Nastran's OUTPUT2: every word that stands alone is a record of one
integer, a block is its name, its trailer and its records, of which each ends with the negative
number of the next.
"""

import struct
from pathlib import Path

import numpy as np
import pytest

import beamchain as bc

pytestmark = pytest.mark.host
pyyeti = pytest.importorskip(
    "pyyeti", reason="the extra nastran is not installed: pip install 'beamchain[nastran]'"
)
SINGLE = 1e-6  # relative: single precision


def record(content: bytes) -> bytes:
    return struct.pack("i", len(content)) + content + struct.pack("i", len(content))


def key(number: int) -> bytes:
    return record(struct.pack("i", number))


def words(content: bytes) -> bytes:
    return key(len(content) // 4) + record(content)


def block(name: str, trailer: tuple[int, ...], kind: int, records: list[bytes]) -> bytes:
    """Kind 0: a table of records; 1: a matrix, a record per column."""
    out = words(name.ljust(8).encode()) + key(-1) + words(struct.pack("7i", *trailer)) + key(-2)
    out += key(1) + key(0) + words(name.ljust(8).encode()) + key(-3)
    for i, content in enumerate(records):
        out += key(1) + key(kind) + words(content) + key(-4 - i)
    return out + key(1) + key(0) + key(0)


def matrix(name: str, values: np.ndarray) -> bytes:
    rows, columns = values.shape
    content = [struct.pack("i", 1) + column.astype("f4").tobytes() for column in values.T]
    return block(name, (101, columns, rows, 2, 1, rows, 0), 1, content)


def modes(radians: np.ndarray, modal: np.ndarray) -> bytes:
    rows = [
        struct.pack("2i5f", i, i, w**2, w, w / 2.0 / np.pi, m, m * w**2)
        for i, (w, m) in enumerate(zip(radians, modal, strict=True), 1)
    ]
    return block(
        "LAMA", (101, 0, 0, 0, 0, 0, 0), 0, [struct.pack("146i", *range(146)), b"".join(rows)]
    )


def head() -> bytes:
    out = (
        words(struct.pack("3i", 11, 22, 26))
        + words(b"NASTRAN FORT TAPE ID CODE - ")
        + words(b"XXXXXXXX")
    )
    return out + key(-1) + key(0)


RADIANS = np.array([3.0, 5.0])
MODAL = np.array([1.0, 4.0])
ROWS = np.zeros((6, 2))
ROWS[1], ROWS[5] = (0.5, 0.1), (2.0, 0.25)
MASS = np.diag([2.0, 2.0, 2.0, 1.0, 8.0, 8.0])


def written(path: Path, *blocks: bytes) -> Path:
    path.write_bytes(head() + b"".join(blocks) + key(0))
    return path


@pytest.mark.parametrize("name", ["RBMASS", "RBMASSS"])
@pytest.mark.parametrize("turned", [False, True])
def test_modes_participation_and_rigid_mass_are_read(name, turned, tmp_path):
    table = matrix("MPFACS", ROWS.T if turned else ROWS)
    data = bc.read_modes(
        written(tmp_path / "a.op2", modes(RADIANS, MODAL), table, matrix(name, MASS))
    )
    np.testing.assert_allclose(data.frequencies, RADIANS, rtol=SINGLE)
    np.testing.assert_allclose(np.abs(data.participation[:, 1]), [0.5, 0.2], rtol=SINGLE)
    np.testing.assert_allclose(np.abs(data.participation[:, 5]), [2.0, 0.5], rtol=SINGLE)
    np.testing.assert_allclose(data.rigid_mass, MASS, rtol=SINGLE)


def test_several_subcases_are_chosen_from(tmp_path):
    both = modes(RADIANS, MODAL), modes(2.0 * RADIANS, MODAL)
    path = written(tmp_path / "a.op2", *both, matrix("MPFACS", ROWS), matrix("RBMASS", MASS))
    with pytest.raises(bc.InputError, match="choose one with subcase = 1"):
        bc.read_modes(path)
    np.testing.assert_allclose(
        bc.read_modes(path, subcase=2).frequencies, 2.0 * RADIANS, rtol=SINGLE
    )
    with pytest.raises(bc.InputError, match="it holds 1 to 2"):
        bc.read_modes(path, subcase=3)


def test_real_files_lack_the_participation_and_are_told_so():
    """Runs of MSC Nastran; what is read of them until then is what pyYeti's tests are sure of."""
    folder = Path(pyyeti.__file__).parent / "tests"
    for name in ("nas2cam_extseout/cant_beam.op2", "nastran_op2_data/rdop2gpwg_1.op2"):
        with pytest.raises(
            bc.InputError,
            match=r"no participation or rigid mass \(MPFACS, RBMASS\).*give me the f06",
        ):
            bc.read_modes(folder / name)


def test_what_is_no_op2_is_refused_in_one_sentence(tmp_path):
    path = tmp_path / "a.op2"
    path.write_bytes(b"\4\0\0\0\1\0\0\0 nothing of the kind" * 20)
    with pytest.raises(bc.InputError, match=r"cannot be read as op2.*give the .f06"):
        bc.read_modes(path)
    with pytest.raises(bc.InputError, match="holds no eigenvalues"):
        bc.read_modes(written(path, matrix("MPFACS", ROWS), matrix("RBMASS", MASS)))
