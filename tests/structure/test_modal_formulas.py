"""Numbers by hand beside imported modes: units, planes, ports, what the print decides."""

import numpy as np
import pytest

from beamchain import InputError, ModalData
from beamchain.spec import FurtherPoint
from formulas import MassPiece, near_groups, settle_rigid_mass, turn_into_planes

ROUNDED = 1e-12
RIGID = np.diag([2.0, 2.0, 2.0, 0.5, 8.0, 18.0])
RIGID[1, 5] = RIGID[5, 1] = 3.0
RIGID[2, 4] = RIGID[4, 2] = -3.0


def data(rows, frequencies=None, rigid=RIGID, **more):
    rows = np.array(rows, dtype=float)
    w = np.arange(3.0, 3.0 + len(rows)) if frequencies is None else np.array(frequencies)
    return ModalData(rigid_mass=rigid, frequencies=w, participation=rows, **more)


# -- units -----------------------------------------------------------------------------------------
def test_units_of_all_that_a_file_holds():
    """1 unit of length is 1e-3 m, 1 unit of mass 16 kg; modes have 1 unit of modal mass."""
    mm, root = 1e-3, 4.0
    point = FurtherPoint("mast", np.array([5.0, 6.0, 7.0]), np.array([[1.0, 2, 3, 4, 5, 6]]))
    piece = MassPiece(100.0, 400.0, np.array([[0.2, 3.0, 4.0, 5.0], [0.1, 1.0, 2.0, 3.0]]))
    got = data(
        [[0.1, 0.3, 0.2, 0.05, 0.4, 0.2]],
        tip=np.array([[1.0, 2, 3, 4, 5, 6]]),
        length=900.0,
        pieces=(piece,),
        further=(point,),
    ).scaled(mm, 16.0)
    assert got.participation[0] == pytest.approx(
        root * np.array([0.1, 0.3, 0.2, 0.05e-3, 0.4e-3, 0.2e-3]), rel=ROUNDED
    )
    motion = np.array([1.0, 2.0, 3.0, 4e3, 5e3, 6e3]) / root
    assert got.tip[0] == pytest.approx(motion, rel=ROUNDED)
    assert got.further[0].motion[0] == pytest.approx(motion, rel=ROUNDED)
    assert got.further[0].place == pytest.approx([5e-3, 6e-3, 7e-3], rel=ROUNDED)
    assert (got.length, got.frequencies[0]) == (pytest.approx(0.9), 3.0)
    (found,) = got.pieces
    assert (found.start, found.length) == (pytest.approx(0.1), pytest.approx(0.4))
    # kg/m, and kg m
    units = np.array([16.0 / mm, 16.0 * mm, 16.0 * mm, 16.0 * mm])
    assert found.densities == pytest.approx(piece.densities * units, rel=ROUNDED)
    same = data([[0.1, 0.3, 0.2, 0.05, 0.4, 0.2]])
    assert same.scaled(1.0, 1.0) is same
    assert same.scaled(1.0, 4.0).rigid_mass == pytest.approx(4.0 * RIGID)
    assert same.scaled(2.0, 1.0).rigid_mass[5, 5] == pytest.approx(72.0)


# -- shares and ports ------------------------------------------------------------------------------
# over the roots of the masses: xy 3, 4; xz 12; torsion 5; axial 2
MIXED = [2.0, 3.0, 0.0, 5.0, 12.0, 4.0] * np.sqrt(np.diag(RIGID)) / 40.0


def test_shares_of_the_ports_in_a_mode():
    squares = np.array([25.0, 144.0, 25.0, 4.0])
    of = data([MIXED], precision=1e-9)
    assert of.shares[0] == pytest.approx(squares / 198.0, rel=ROUNDED)
    assert of.parts[0] == pytest.approx(np.sqrt(squares / 198.0), rel=ROUNDED)
    assert of.belongs == ("xz",)
    assert of.labels == ("",)
    assert of.leaks == pytest.approx([np.sqrt(54.0 / 198.0)], rel=ROUNDED)
    wanted = np.array([4.0, 9.0, 0.0, 25.0, 144.0, 16.0]) / 1600.0
    assert of.effective_mass_fractions[0] == pytest.approx(wanted, rel=ROUNDED)


@pytest.mark.parametrize(
    ("precision", "tolerance"),
    [(1e-13, 2e-12), (1e-7, 2e-6), (4.9e-7, 9.8e-6), (1e-6, 1e-5), (6e-6, 1.2e-5)],
)
def test_what_a_print_leaves_open(precision, tolerance):
    """20 precisions, 1e-5 at most, but two precisions at least; 1e-9 of parts."""
    assert data([MIXED], precision=precision).tolerance == pytest.approx(tolerance)
    least = max(tolerance, 1e-9)
    for part, seen in ((1.01, True), (0.99, False)):
        row = np.zeros(6)
        row[1], row[3] = 0.2 * np.sqrt(2.0), 0.2 * part * least * np.sqrt(0.5)
        of = data([row], precision=precision)
        assert bool(of.parts[0, 2] > 0.0) is seen
        assert of.labels == (("",) if seen else ("xy",))
        assert of.blocks[0] == (("xy", "torsion") if seen else ("xy",))
        # a view of a port has a mode that moves it by more than the print
        sees = part * least > max(tolerance, 1e-13)
        assert of.port("torsion").modes == int(sees)
        assert of.port("torsion", own=True).modes == 0
        if tolerance > 1e-8:  # below, one less a share is rounding
            assert bool(of.leaks[0] > 0.0) is seen


def test_ports_that_the_rigid_mass_couples():
    for part, joined in ((1.1, True), (-1.1, True), (0.9, False)):
        rigid = np.array(RIGID)
        rigid[0, 4] = rigid[4, 0] = part * 1e-9 * np.sqrt(2.0 * 8.0)
        of = data([[0.0, 0.3, 0.0, 0.0, 0.0, 0.2], [0.0, 0.0, 0.2, 0.0, -0.3, 0.0]], rigid=rigid)
        together = (("xy",), ("xz", "axial"), ("torsion",))
        assert of.blocks == (together if joined else (("xy",), ("xz",), ("torsion",), ("axial",)))
        assert of.groups == (together[:2] if joined else (("xy",), ("xz",)))
    flat = np.array(RIGID)
    flat[3, 3] = 0.0
    of = data([[0.0, 0.3, 0.0, 0.0, 0.0, 0.2]], rigid=flat)
    assert of.blocks == (("xy",), ("xz",), ("axial",))
    assert of.live == [0, 1, 2, 4, 5]
    assert of.scale == pytest.approx(np.sqrt([2.0, 2.0, 2.0, 1.0, 8.0, 18.0]))
    assert of.space().rigid_mass == pytest.approx(flat[np.ix_(of.live, of.live)])
    assert of.space().participation.tolist() == [[0.0, 0.3, 0.0, 0.0, 0.2]]
    small = data([[0.0, 0.03, 0.0, 0.0, 0.0, 0.02]], [0.05], rigid=0.01 * RIGID)
    assert small.live == [0, 1, 2, 3, 4, 5]
    assert small.scale == pytest.approx(0.1 * np.sqrt(np.diag(RIGID)))


def test_a_port_has_its_motions_and_modes():
    tip = np.arange(12.0).reshape(2, 6)
    rows = [[0.0, 0.3, 0.0, 0.0, 0.0, 0.2], [0.0, 0.0, 0.2, 0.0, -0.3, 0.0]]
    of = data(rows, tip=tip, damping=np.array([0.01, 0.02]))
    # the plane xz turns about -y
    found = of.port("xz")
    assert found.rigid_mass == pytest.approx(np.array([[2.0, 3.0], [3.0, 8.0]]), rel=ROUNDED)
    assert found.frequencies.tolist() == [4.0]
    assert found.participation.tolist() == [[0.2, 0.3]]
    assert found.damping.tolist() == [0.02]
    assert found.tip.tolist() == [[8.0, -10.0]]
    assert of.port("axial").modes == 0
    both = data([MIXED], tip=tip[:1])
    assert [both.port(p).modes for p in ("xy", "xz", "torsion", "axial")] == [1, 1, 1, 1]
    assert [both.port(p, own=True).modes for p in ("xy", "xz")] == [0, 1]


# -- checks and selections -------------------------------------------------------------------------
@pytest.mark.parametrize(("precision", "most"), [(1e-13, 1e-6), (1e-6, 1e-5)])
def test_a_rigid_mass_is_symmetric_to_its_print(precision, most):
    for part, taken in ((0.99, True), (1.01, False), (-1.01, False)):
        rigid = np.array(RIGID)
        rigid[5, 1] += part * most * np.sqrt(2.0 * 18.0)
        row = [0.0, 0.3, 0.0, 0.0, 0.0, 0.2]
        if taken:
            found = data([row], rigid=rigid, precision=precision).rigid_mass
            assert found[1, 5] == pytest.approx(3.0 + part * most * 3.0)
        else:
            with pytest.raises(InputError, match=r"rotation z.*y|y.*rotation z"):
                data([row], rigid=rigid, precision=precision)


def test_modes_go_by_frequency_and_keep_their_numbers():
    rows = [[0.0, 0.1 * k, 0.0, 0.0, 0.0, 0.0] for k in (1, 2, 3)]
    point = FurtherPoint("mast", np.ones(3), np.arange(18.0).reshape(3, 6))
    of = data(rows, [5.0, 4.0, 6.0], damping=np.array([0.1, 0.2, 0.3]), further=(point,))
    assert of.frequencies.tolist() == [4.0, 5.0, 6.0]
    assert of.participation[:, 1] == pytest.approx([0.2, 0.1, 0.3])
    assert of.damping.tolist() == [0.2, 0.1, 0.3]
    assert of.further[0].motion[:, 0].tolist() == [6.0, 0.0, 12.0]
    some = of.selected((3, 1))
    assert some.frequencies.tolist() == [4.0, 6.0]
    assert some.damping.tolist() == [0.2, 0.3]
    assert some.further[0].motion[:, 0].tolist() == [6.0, 12.0]
    assert some.in_file.tolist() == [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    assert some.selected((2,)).in_file.tolist() == [[0.0, 0.0, 1.0]]
    for wrong in ((0,), (4,), (1, 1), ()):
        with pytest.raises(InputError):
            of.selected(wrong)


# -- planes ----------------------------------------------------------------------------------------
def test_groups_of_near_frequencies():
    w = np.array([1.0, 2.0, 2.0 * (1 + 0.9e-3), 3.0, 4.0, 4.0, 4.0 * (1 + 1.1e-3), 9.0, 9.005])
    assert near_groups(w, 1e-3) == [[1, 2], [4, 5], [7, 8]]
    assert near_groups(w[:1], 1e-3) == []


@pytest.mark.parametrize("angle", [0.3, 2.0])
def test_modes_of_one_frequency_are_turned_into_the_planes(angle):
    """Two that bend and one that twists; motions in units of their scale."""
    scale = np.array([1.0, 1.0, 2.0, 0.5, 4.0, 3.0])
    plain = np.zeros((4, 6))
    plain[0, [1, 5]] = 1.2, 0.7
    plain[1, [2, 4]] = 0.9, -1.1
    plain[2, 3] = 0.6
    plain[3, [1, 2]] = 5.0, 4.0  # of no group
    c, s = np.cos(angle), np.sin(angle)
    mixed = np.eye(4)
    mixed[:3, :3] = [[c, s, 0.0], [-s * c, c * c, s], [s * s, -c * s, c]]
    turn, changed = turn_into_planes(mixed @ plain * scale, scale, [[0, 1, 2]])
    assert changed == [[0, 1, 2]]
    assert turn @ turn.T == pytest.approx(np.eye(4), abs=1e-12)
    # the heaviest first: weights 1, 0.618 and 0.382 of the squares
    assert np.abs(turn @ mixed @ plain) == pytest.approx(np.abs(plain), abs=1e-12)
    # what is in its planes stays, in its order
    assert turn_into_planes(plain[::-1], scale, [[0, 1], [2, 3]])[1] == []
    assert np.array_equal(turn_into_planes(plain, scale, [[0, 1]])[0], np.eye(4))
    # so do modes that share one plane
    alike = np.array([[0.0, 3.0, 0.0, 0.0, 0.0, 1.0], [0.0, 4.0, 0.0, 0.0, 0.0, 2.0]])
    assert turn_into_planes(alike, scale, [[0, 1]])[1] == []


@pytest.mark.parametrize(
    ("mass", "precision", "most"),
    [
        # half a digit of 30 is 0.05, of 5 it is 0.005 and goes in with 5 twice
        (25.0, 5e-3, 0.1),
        (1.0, 1e-6, 1e-5),
        (1.0, 1e-9, 2e-8),
    ],
)
def test_a_residual_that_the_last_digits_decide_is_none(mass, precision, most):
    """Half a digit of its numbers, or 20 precisions, of which 1e-5 at most counts."""
    for part, left in ((0.99, 0.0), (1.01, 1.01), (-0.99, 0.0)):
        rigid = np.array([[mass + part * most]])
        found, change = settle_rigid_mass(rigid, np.array([[np.sqrt(mass)]]), precision)
        assert found[0, 0] == pytest.approx(mass + left * most, rel=1e-12)
        moved = abs(part - left) * most / rigid[0, 0]
        assert change == pytest.approx(moved, abs=1e-15)


@pytest.mark.parametrize(
    ("precision", "most"), [(0.0, 1e-9), (1e-12, 1e-9), (1e-6, 2e-5), (4e-3, 0.08), (0.01, 0.1)]
)
def test_a_residual_below_zero_by_more_than_rounding_is_refused(precision, most):
    """20 precisions, of which a tenth at most counts, and 1e-9 at least."""
    taken = 1.0 + 0.99 * most
    found, change = settle_rigid_mass(np.eye(1), np.array([[np.sqrt(taken)]]), precision)
    assert found[0, 0] == pytest.approx(taken, rel=1e-14)
    assert change == pytest.approx(0.99 * most, rel=1e-6)
    for k, name in enumerate(("displacement", "rotation")):
        rows = np.zeros((1, 2))
        rows[0, k] = np.sqrt(1.0 + 1.01 * most)
        with pytest.raises(InputError, match=f"mainly in {name}"):
            settle_rigid_mass(np.eye(2), rows, precision)


@pytest.mark.parametrize(("least", "kept"), [(-5e-6, 0.0), (5e-6, 0.0), (1.1e-5, 1.1e-5)])
def test_a_direction_without_residual_mass_has_none(least, kept):
    """20 precisions are 2e-5, of which 1e-5 counts."""
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    residual = turn.T @ np.diag([least, 0.5]) @ turn
    rows = np.linalg.cholesky(np.eye(2) - residual).T
    found, change = settle_rigid_mass(np.eye(2), rows, 1e-6)
    moved = (kept - least) * np.outer(turn[0], turn[0])
    assert found == pytest.approx(np.eye(2) + moved, abs=1e-13)
    assert change == pytest.approx(np.max(np.abs(moved)), abs=1e-13)


def test_a_motion_without_inertia_has_none_afterwards():
    rows = np.array([[1.0, 1e-12]])
    found, _ = settle_rigid_mass(np.diag([2.0, 0.0]), rows, 1e-9)
    assert found.tolist() == [[2.0, 0.0], [0.0, 0.0]]
