"""Tests internals as well, the reader of OUTPUT4 against pyYeti's, beside whole superelements.

Superelements of real Nastran runs, which pyYeti's own tests ship with Nastran's answers: a boom in
two pieces that meet at four grids, one of them in axes of its own (mm, t).
"""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from beamchain.structure.readers.nastran_op4 import read_op4
from mechanics import mass_matrix, stiffness_matrix
from solver import moved
from spec_tables import spec_of

pytestmark = pytest.mark.host
pyyeti = pytest.importorskip(
    "pyyeti", reason="the extra nastran is not installed: pip install 'beamchain[nastran]'"
)
from pyyeti.nastran import op2, op4  # noqa: E402

FOLDER = Path(pyyeti.__file__).parent / "tests"
PRINTED = 3e-7  # relative: seven digits, of which the last is that of Nastran's own solver
MUJOCO = 1e-8  # of the mass matrix and the tendons of a compiled file
RIGID = 5e-4  # what holding the four grids as one rigid body changes of the first five modes
UNITS = {"length": 1e-3, "mass": 1e3}
OUTWARDS = [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]
FILES = sorted(FOLDER.rglob("*.op4"))
RING = """<mujoco><option gravity="0 0 0"/><worldbody><body name="ring"><freejoint/>
<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
<site name="in"/><site name="out" euler="0 0 180"/></body></worldbody></mujoco>"""
RING_MASS = np.diag([1e-3] * 3 + [100.0] * 3)  # t, t mm^2


@pytest.mark.filterwarnings("ignore")  # pyYeti warns of names that are no identifiers
@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_every_output4_file_is_read_as_pyyeti_reads_it(path):
    names, matrices, _, kinds = op4.OP4().listload(str(path), sparse=True)
    wanted = {
        name.upper(): matrix.toarray()
        for name, matrix, kind in zip(names, matrices, kinds, strict=True)
        if names.count(name) == 1 and kind < 3 and max(matrix.shape) <= 4000
    }
    if "badname" in path.name:  # a name with a null byte
        with pytest.raises(bc.InputError, match="neither a text nor a binary"):
            read_op4(path, wanted)
        return
    found = read_op4(path, wanted)
    assert set(found) == set(wanted)
    for name, matrix in wanted.items():
        np.testing.assert_array_equal(found[name].values, matrix)


def test_outboard_has_the_printed_frequencies_and_effective_masses():
    data = bc.read_modes(FOLDER / "cla_test_data" / "outboard.op4")
    text = (FOLDER / "cla_test_data" / "outboard_cbcheck.out").read_text()
    table = text[text.index("FIXED-BASE MODES") :]
    rows = re.findall(r"^ +\d+ +([\d.]+)" + r" +([\d.]+)" * 6 + "$", table, re.MULTILINE)
    printed = np.array(rows, dtype=float)
    assert printed.shape == (22, 7)
    assert data.frequencies / (2.0 * np.pi) == pytest.approx(printed[:, 0], abs=5.1e-4)
    # the rotations of the print are about the centre of the interface too
    shares = 100.0 * data.effective_mass_fractions
    assert shares == pytest.approx(printed[:, 1:], abs=5.1e-3)
    total = re.search(r"Total Effective Mass:" + r" +([\d.]+)" * 6, table)
    assert shares.sum(axis=0) == pytest.approx([float(x) for x in total.groups()], abs=5.1e-3)
    print(shares.sum(axis=0).round(2))  # noqa: T201


def printed_frequencies(name):
    """The elastic modes of an assembly, of the print [Hz]."""
    text = (FOLDER / name / "assemble.out").read_text()
    rows = re.findall(r"^ +\d+ +\d+ +\S+E\S+ +\S+ +(\d\.\d{6}E[+-]\d\d) ", text, re.MULTILINE)
    values = np.array(rows, dtype=float)
    return values[values > 1e-3][:5]


def superelements(name, tmp_path):
    """Both pieces as files of this project would be delivered, with their assembly files."""
    folder = FOLDER / name
    if name == "nas2cam_extseout":
        return folder / "inboard.op4", folder / "outboard.op4"
    # the outboard piece of this run has no file of its own: it stands in the results
    results = op2.rdnas2cam(str(folder / "nas2cam"))
    path = tmp_path / "outboard.op4"
    both = {"kxx": np.asarray(results["kaa"][101]), "mxx": np.asarray(results["maa"][101])}
    op4.write(str(path), both)
    (tmp_path / "outboard.asm").write_bytes(
        (FOLDER / "cla_test_data" / "outboard.asm").read_bytes()
    )
    return folder / "inboard.op4", path


def assembled(inboard, outboard, motion, ring=0.0):
    """Elastic frequencies [Hz] of both pieces with the 24 freedoms of the grids in common, or with
    the grids moving by `motion` `(24, 6)` and a `ring` `(6, 6)` between them."""
    pieces = [read_op4(path, {"MXX", "KXX"}) for path in (inboard, outboard)]
    sizes = [piece["MXX"].values.shape[0] - 24 for piece in pieces]
    grids = motion.shape[1]
    total = grids + sum(sizes)
    mass, stiffness = np.zeros((total, total)), np.zeros((total, total))
    mass[:grids, :grids] += ring
    begin = grids
    for piece, size in zip(pieces, sizes, strict=True):
        turn = np.zeros((24 + size, total))
        turn[:24, :grids] = motion
        turn[24:, begin : begin + size] = np.eye(size)
        mass += turn.T @ piece["MXX"].values @ turn
        stiffness += turn.T @ piece["KXX"].values @ turn
        begin += size
    squares = eigh((stiffness + stiffness.T) / 2.0, (mass + mass.T) / 2.0, eigvals_only=True)
    return np.sqrt(squares[6:11]) / (2.0 * np.pi)


def rigid_motion():
    """Motion of the four grids in their own axes per motion of one rigid body."""
    rows = []
    for grid, place in (
        (3, (600.0, 0.0, 300.0)),
        (11, (600.0, 300.0, 300.0)),
        (19, (600.0, 300.0, 0.0)),
        (27, (600.0, 0.0, 0.0)),
    ):
        turn = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]) if grid == 11 else np.eye(3)
        motion = moved(np.eye(6), np.array(place) - (600.0, 150.0, 150.0))
        rows.append(np.kron(np.eye(2), turn) @ motion)
    return np.vstack(rows)


def frequencies_in_mujoco(text):
    """Elastic frequencies [Hz] of a compiled file: its mass matrix and the springs of its tendons,
    without differences of steps."""
    model = mujoco.MjModel.from_xml_string(text)
    squares = eigh(stiffness_matrix(model), mass_matrix(model), eigvals_only=True)
    return np.sqrt(squares[6:11]) / (2.0 * np.pi)


@pytest.mark.parametrize("name", ["nas2cam_csuper", "nas2cam_extseout"])
def test_two_pieces_of_a_boom(name, tmp_path):
    """Joined at four grids the matrices that are read have the printed frequencies. Appendages hold
    their grids as one rigid body: through MuJoCo, on a ring of 1 kg, they are exactly that, which
    differs from the print by as much as the four grids move against each other."""
    inboard, outboard = superelements(name, tmp_path)
    printed = printed_frequencies(name)
    joined = assembled(inboard, outboard, np.eye(24))
    assert joined == pytest.approx(printed, rel=PRINTED)
    held = assembled(inboard, outboard, rigid_motion())
    assert held == pytest.approx(printed, rel=RIGID)
    pieces = {
        "in": {"file": str(inboard), "units": UNITS},
        "out": {"file": str(outboard), "units": UNITS, "axes": OUTWARDS},
    }
    craft = tmp_path / "ring.xml"
    craft.write_text(RING)
    specs = {at: spec_of({"name": at, "imported": imported}) for at, imported in pieces.items()}
    through = frequencies_in_mujoco(bc.embed(craft, specs, retime=False).to_mjcf())
    on_ring = assembled(inboard, outboard, rigid_motion(), RING_MASS)
    assert through == pytest.approx(on_ring, rel=MUJOCO)
    for label, values in (
        ("print", printed),
        ("joined", joined),
        ("grids rigid", held),
        ("grids rigid, on the ring", on_ring),
        ("the same through MuJoCo", through),
    ):
        print(f"{name}, {label}: {', '.join(f'{value:.6f}' for value in values)} Hz")  # noqa: T201


def test_four_modes_of_a_piece_keep_the_step_of_the_last():
    """A third of 2 / omega, Euler's limit of one mode, at least: fillers do not set the step."""
    file = str(FOLDER / "cla_test_data" / "outboard.op4")
    imported = {"file": file, "units": UNITS, "axes": OUTWARDS, "modes": [1, 2, 3, 4]}
    result = bc.fit(spec_of({"name": "outboard", "imported": imported}))
    assert result.space.data.modes == 22
    step = result.limits.largest_step["Euler"]
    share = step * result.space.data.frequencies[3] / 2.0
    print(f"largest plain Euler step {step:.4f} s, {share:.3f} of 2 / omega of mode 4")  # noqa: T201
    assert share > 1.0 / 3.0
