"""Internals: every reader of a file that a user names, a good file for each,
and ways to spoil it."""

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

import beamchain as bc
from beamchain import read_modes, read_spec
from beamchain.cli.common import read_text
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
    grids = [bc.spec.InterfaceGrid(id=g, at=PLACES[g], axes=_rows(output_axes(g))) for g in GRIDS]
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
    "profile": (
        "csv",
        PROFILE.encode(),
        lambda path: parse_profile(read_text(path, "--profile"), path.name),
    ),
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


#: files that are refused: ending and content, by name
REFUSED: dict[str, tuple[str, bytes]] = {
    "UTF-16": ("xml", '<?xml version="1.0" encoding="utf-16"?><mujoco/>'.encode("utf-16")),
    "NaN in JSON": (
        "json",
        json.dumps({**MODES, "mass": (FEW.mass * np.nan).tolist()}).encode(),
    ),
    "infinity in JSON": (
        "json",
        json.dumps({**MODES, "frequencies": [1.0, 2.0, float("inf")]}).encode(),
    ),
}


def reader_of(ending: str) -> list[Callable[[Path], object]]:
    """All readers that take files of an ending."""
    return list(dict.fromkeys(read for kind, _, read in READERS.values() if kind == ending))


__all__ = ["APPENDAGES", "READERS", "REFUSED", "reader_of", "spoilt"]
