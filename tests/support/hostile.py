"""Internals: every reader of a file that a user names, a good file for each,
and ways to spoil it."""

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

import beamchain as bc
from beamchain import read_modes, read_spec
from beamchain.cli.study import read_text
from beamchain.craft.embedding import take_out
from beamchain.mjcf.craft import read_craft
from beamchain.structure.readers.nastran_bulk import read_bulk
from beamchain.structure.readers.recovery_file import read_recovery
from beamchain.studies.scenario import parse_profile
from prints import plate, whole
from spacecraft import APPENDAGES, CRAFTS
from superelements import (
    GRIDS,
    PLACES,
    asm_text,
    op4_binary,
    op4_text,
    output_axes,
    punch_text,
    superelement,
)

SPEC = """name = "boom"
[[segment]]
length = 15.0
section = { shape = "round", diameter = 0.012 }
section_end = { shape = "round", diameter = 0.010 }
material = { youngs_modulus = 2.06e11, density = 7800.0, poissons_ratio = 0.3 }
[[joint]]
after_segment = 0
stiffness_xy = 1000.0
[[lump]]
x = 15.0
mass = 0.5
[damping]
ratio = { xy = [0.005, 0.01] }
[root]
target = "hub"
hub = { mass = 500.0, inertia = [400.0, 400.0, 500.0], offset = [1.0, 0.0, 0.0] }
[scene]
bandwidth = 10.0
axes = ["z"]
"""
PROFILE = "time,mz\n0,1.0e-3\n4,-1.0e-3\n8,0\n"
FEW = plate(3)
MODES = {
    "frequencies": FEW.frequencies.tolist(),
    "participation": FEW.participation.T.tolist(),
    "mass": FEW.mass.tolist(),
    "damping": [0.01, 0.01, 0.02],
    "length": 0.21,
}


def toml_modes() -> str:
    return "\n".join(f"{key} = {json.dumps(value)}" for key, value in MODES.items()) + "\n"


def matrices() -> dict[str, np.ndarray]:
    """A mass on six springs before another on the port: eight freedoms would do,
    twelve are clearer."""
    k = np.diag([3.0, 4.0, 5.0, 6.0, 7.0, 8.0])
    return {
        "mass": np.kron(np.diag([1.0, 2.0]), np.eye(6)),
        "stiffness": np.block([[k, -k], [-k, k]]),
        "boundary": np.arange(6),
    }


def rows_npz() -> bytes:
    """Recovery rows over three modes."""
    stream = io.BytesIO()
    np.savez(
        stream,
        names=["moment", "place"],
        units=["N m", "m"],
        modes=np.ones((2, 3)),
        root=np.eye(2, 6),
    )
    return stream.getvalue()


ROWS = """[[row]]
name = "moment"
unit = "N m"
modes = [1.0, 2.0, -3.0]
[[row]]
name = "acceleration"
accelerations = [1.0, 0.5, 0.25]
root = [0.0, 1.0, 0.0, 0.0, 0.0, 8.0]
"""
SMALL = superelement(modes=3)
BOTH = {"KXX": SMALL.stiffness, "MXX": SMALL.mass}


def read_superelement(path: Path) -> object:
    """An OUTPUT4 file, the grids of which are stated."""
    grids = [bc.InterfaceGrid(id=g, at=PLACES[g], axes=_rows(output_axes(g))) for g in GRIDS]
    return read_modes(path, grids=grids)


def _rows(matrix: np.ndarray) -> tuple:
    return tuple(tuple(float(x) for x in row) for row in matrix)


def marked() -> bytes:
    """A spacecraft with an appendage that embed put in."""
    return bc.embed(CRAFTS / "planar.xml", {"mount": APPENDAGES / "rod.toml"}).to_mjcf().encode()


def npz() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **matrices())
    return stream.getvalue()


def mat() -> bytes:
    from scipy.io import savemat

    stream = io.BytesIO()
    savemat(stream, {**matrices(), "boundary": np.arange(1, 7)}, do_compression=True)
    return stream.getvalue()


#: name: (ending, a good file, reader)
READERS: dict[str, tuple[str, bytes, Callable[[Path], object]]] = {
    "spec": ("toml", SPEC.encode(), lambda path: read_spec(path).beam),
    "print": ("f06", whole(FEW).encode(), read_modes),
    "results": ("op2", b"\x04\x00\x00\x00\x03\x00\x00\x00\x04\x00\x00\x00NASTRAN" * 8, read_modes),
    "modes, TOML": ("toml", toml_modes().encode(), read_modes),
    "modes, JSON": ("json", json.dumps(MODES).encode(), read_modes),
    "superelement, text": ("op4", op4_text(BOTH, "bigmat", 8), read_superelement),
    "superelement, text, dense": ("op4", op4_text(BOTH, "dense"), read_superelement),
    "superelement, binary": ("op4", op4_binary(BOTH, "sparse", ">"), read_superelement),
    "superelement, binary, bigmat": (
        "op4",
        op4_binary(BOTH, "bigmat", wide=True),
        read_superelement,
    ),
    "assembly": ("asm", asm_text(3).encode(), read_bulk),
    "punch": ("pch", punch_text(SMALL).encode(), read_modes),
    "matrices, NumPy": ("npz", npz(), read_modes),
    "matrices, MATLAB": ("mat", mat(), read_modes),
    "recovery rows, NumPy": ("npz", rows_npz(), read_recovery),
    "recovery rows, TOML": ("toml", ROWS.encode(), read_recovery),
    "spacecraft": (
        "xml",
        (CRAFTS / "observer.xml").read_bytes(),
        lambda path: read_craft(path).includes,
    ),
    "spacecraft with a mark": ("xml", marked(), take_out),
    "profile": ("csv", PROFILE.encode(), lambda path: parse_profile(read_text(path), path.name)),
}

WORDS = (
    b"nan",
    b"NaN",
    b"inf",
    b"-Infinity",
    b"1e309",
    b"-1",
    b"0",
    b"1e-320",
    b"9" * 400,
    b"[",
    b"]" * 3,
    b"{",
    b'"',
    b"\0",
    b"\xff\xfe",
    b"\xed\xa0\x80",
    b"\n",
    b"=",
    b",,",
    b"<!DOCTYPE x>",
    b"&amp;",
    b"&x;",
    b"..",
    b"../../etc/passwd",
    b"null",
    b"true",
    b"1_0",
    b"-0.0",
    b"\r",
    b"\x85",
    "\u202e".encode(),
    b"1.0D+400",
    b"*",
    b"1.234-400",
)


@st.composite
def spoilt(draw: st.DrawFn, good: bytes) -> bytes:
    """A good file cut off, with words put in, bytes changed, pieces doubled or dropped."""
    content = bytearray(good)
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(("cut", "word", "byte", "double", "drop", "number")))
        at = draw(st.integers(0, max(len(content) - 1, 0)))
        size = draw(st.integers(1, 60))
        if kind == "cut":
            del content[at:]
        elif kind == "word":
            content[at:at] = draw(st.sampled_from(WORDS))
        elif kind == "byte" and content:
            content[at] = draw(st.integers(0, 255))
        elif kind == "double":
            content[at:at] = content[at : at + size]
        elif kind == "drop":
            del content[at : at + size]
        else:  # a whole number or word replaced
            end = at
            while end < len(content) and content[end : end + 1] not in b" ,\n]}\"'=":
                end += 1
            content[at:end] = draw(st.sampled_from(WORDS))
    return bytes(content)


def bombs() -> dict[str, tuple[str, Callable[[], bytes]]]:
    """Files made to hurt: ending and what makes the content, by name."""
    deep = 200_000
    entities = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
    lol = f'<?xml version="1.0"?><!DOCTYPE m [<!ENTITY l0 "lol">{entities}]><mujoco model="&l9;"/>'
    outside = '<!DOCTYPE m [<!ENTITY x SYSTEM "file:///etc/passwd">]><mujoco model="&x;"/>'
    parameter = '<!DOCTYPE m [<!ENTITY % x SYSTEM "http://127.0.0.1:9/x.dtd"> %x;]><mujoco/>'
    quadratic = f'<!DOCTYPE m [<!ENTITY a "{"a" * 50_000}">]><mujoco model="{"&a;" * 50_000}"/>'
    return {
        "entities of entities": ("xml", lol.encode),
        "an entity of quadratic size": ("xml", quadratic.encode),
        "an external entity": ("xml", outside.encode),
        "an external parameter entity": ("xml", parameter.encode),
        "deep XML": (
            "xml",
            lambda: b"<mujoco>" + b"<body>" * deep + b"</body>" * deep + b"</mujoco>",
        ),
        "many elements": ("xml", lambda: b"<mujoco>" + b"<a/>" * 5_000_000 + b"</mujoco>"),
        "many attributes": (
            "xml",
            lambda: b"<mujoco " + b" ".join(b'a%d="1"' % i for i in range(200_000)) + b"/>",
        ),
        "UTF-16": (
            "xml",
            lambda: '<?xml version="1.0" encoding="utf-16"?><mujoco/>'.encode("utf-16"),
        ),
        "deep TOML": ("toml", lambda: b'name = "a"\nx = ' + b"[" * deep + b"]" * deep),
        "deep inline tables": ("toml", lambda: b'name = "a"\nx = ' + b"{a=" * deep),
        "deep keys": ("toml", lambda: b"a." * deep + b"a = 1"),
        "many dotted keys": (
            "toml",
            lambda: b"".join(b"a%d.b.c.d = 1\n" % i for i in range(300_000)),
        ),
        "deep JSON": ("json", lambda: b'{"mass": ' + b"[" * deep + b"]" * deep + b"}"),
        "NaN in JSON": (
            "json",
            lambda: json.dumps({**MODES, "mass": (FEW.mass * np.nan).tolist()}).encode(),
        ),
        "infinity in JSON": (
            "json",
            lambda: json.dumps({**MODES, "frequencies": [1.0, 2.0, float("inf")]}).encode(),
        ),
        "a long number in JSON": ("json", lambda: b'{"length": ' + b"9" * 5_000_000 + b"}"),
        "a long number in TOML": ("toml", lambda: b"length = " + b"9" * 5_000_000),
        "numbers without end": (
            "json",
            lambda: b'{"frequencies": [' + b"1.0," * 4_900_000 + b"1.0]}",
        ),
        "numbers without end, TOML": (
            "toml",
            lambda: b"frequencies = [" + b"1.0," * 4_900_000 + b"1.0]",
        ),
        "a small zip that is large": ("npz", zip_bomb),
        "a matrix that is not there": ("npz", claimed),
        "a matrix of many columns": (
            "op4",
            lambda: (
                b"99999999" * 2
                + b"       6       2KXX     1P,5E16.9\n"
                + b"       1       1       1\n"
            ),
        ),
        "a column of many numbers": (
            "op4",
            lambda: (
                b"    4000" * 2
                + b"       6       2KXX     1P,5E16.9\n       1       199999999\n"
                + b" 1.000000000E+00" * 5
                + b"\n"
                + b" 1.000000000E+00\n" * 300_000
            ),
        ),
        "headers of OUTPUT4 without end": (
            "op4",
            lambda: (
                b"       0       0       6       2A       1P,5E16.9\n"
                b"       1       1       1\n1.0\n" * 200_000
            ),
        ),
        "empty records of OUTPUT4": ("op4", lambda: b"\x18\0\0\0" + bytes(20_000_000)),
        "columns of OUTPUT4 without end": ("op4", binary_columns),
        "a card without end": (
            "pch",
            lambda: b"DMIG,KAAX,1,1,,1,1,1.0\n" + b",1,1,1.0\n" * 300_000,
        ),
        "many grids": (
            "asm",
            lambda: b"".join(b"GRID,%d,,0.,0.,0.\n" % i for i in range(1, 100_000)),
        ),
        "many scalar points": ("asm", lambda: b"SPOINT,1,THRU,99999999\n" * 1000),
        "systems that refer to each other": (
            "asm",
            lambda: (
                b"GRID,1,5000,0.,0.,0.\n"
                + b"".join(
                    b"CORD2R,%d,%d,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n" % (i, i - 1)
                    for i in range(1, 5001)
                )
            ),
        ),
        "one line of 20 MB": ("f06", lambda: b" " * 20_000_000),
        "20 MB of eigenvalues": (
            "f06",
            lambda: (
                whole(FEW).encode()
                + b"     1         1  1.0E+00  1.0E+00  1.0E+00  1.0E+00  1.0E+00\n" * 300_000
            ),
        ),
        "a line of a CSV without end": ("csv", lambda: b"time,mz\n" + b"1" * 3_000_000),
        "many rows of a CSV": (
            "csv",
            lambda: b"time,mz\n" + b"".join(b"%d,1\n" % i for i in range(2_000_000)),
        ),
        "quotes of a CSV without end": ("csv", lambda: b'time,mz\n"' + b"1\n" * 1_000_000),
    }


def binary_columns() -> bytes:
    """A binary OUTPUT4 file of a thousand matrices with empty columns."""

    def record(content: bytes) -> bytes:
        length = len(content).to_bytes(4, "little")
        return length + content + length

    integers = np.array([4000, 4000, 6, 2], dtype="<i4").tobytes()
    columns = b"".join(record(np.array([k, 0, 0], dtype="<i4").tobytes()) for k in range(1, 4002))
    return b"".join(record(integers + f"K{k}".ljust(8).encode()) + columns for k in range(100))


def zip_bomb() -> bytes:
    """2 MB that unpack to 2 GB: a good header, then zeros."""
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
        archive.open("mass.npy", "w", force_zip64=True) as file,
    ):
        np.lib.format.write_array_header_1_0(
            file, {"descr": "<f8", "fortran_order": False, "shape": (16000, 16000)}
        )
        block = bytes(1 << 24)
        for _ in range(122):
            file.write(block)
    return stream.getvalue()


def claimed() -> bytes:
    """A header that promises a terabyte, and nothing behind it."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive, archive.open("mass.npy", "w") as file:
        np.lib.format.write_array_header_1_0(
            file, {"descr": "<f8", "fortran_order": False, "shape": (400000, 400000)}
        )
    return stream.getvalue()


def reader_of(ending: str, name: str = "") -> list[Callable[[Path], object]]:
    """All readers that take files of an ending."""
    del name
    return list(dict.fromkeys(read for kind, _, read in READERS.values() if kind == ending))


__all__ = ["APPENDAGES", "READERS", "bombs", "reader_of", "spoilt"]
