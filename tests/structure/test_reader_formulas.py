"""Numbers by hand beside the formulas of readers: cards, matrices over grids, what is rounding."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh

import superelements as se
from beamchain import InputError, read_modes
from formulas import (
    Boundary,
    Eigenvalues,
    almost_body,
    body_departure,
    chosen_table,
    compare_with_print,
    data_of_tables,
    digits_of_numbers,
    dmig_matrices,
    frequencies_of_print,
    from_matrices,
    header_of_text,
    is_noisy,
    is_soft,
    largest_forces,
    largest_inner,
    mass_of_print,
    nearest_body,
    noise_of_freedoms,
    noise_of_motions,
    partition,
    read_bulk,
    read_op4,
    read_recovery,
    rigid_motion_of_inner,
    within_body,
)

ROUNDED = 1e-12


# -- bulk data -------------------------------------------------------------------------------------
def bulk_of(folder, *lines):
    path = folder / "a.pch"
    path.write_text("\n".join(lines) + "\n")
    return path, read_bulk(path)


def test_grids_in_coordinate_systems_of_each_kind(tmp_path):
    """System 5 turns x, y, z into y, z, x about (1, 2, 3); 6 and 7 stand in it."""
    _, bulk = bulk_of(
        tmp_path,
        "$ a remark",
        "CORD2R,5,,1.,2.,3.,2.,2.,3.",  # z along x of the basic axes
        ",1.,3.,3.",  # x along y
        "CORD2C,6,5,0.,0.,4.,0.,0.,6.",
        ",1.,0.,4.",
        "CORD2S,7,5,0.,0.,0.,0.,0.,1.",
        ",1.,0.,0.",
        "GRID,11,5,10.,20.,30.,5",
        "GRID,12,6,2.,30.,5.,6",
        "GRID,13,7,2.,60.,90.,7",
        "GRID,14,,7.,8.,9.",
        f"GRID*   {15:16d}{'':16}{'1.5':>16}{'-2.5+1':>16}*",
        f"*       {'3.5D-1':>16}{6:16d}",
    )
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    origin = np.array([1.0, 2.0, 3.0])
    assert bulk.grids[11].at == pytest.approx([31.0, 12.0, 23.0])
    assert bulk.grids[11].axes == pytest.approx(turn)
    # 2 at 30 degrees, 5 above 4
    own = np.array([np.sqrt(3.0), 1.0, 9.0])
    assert bulk.grids[12].at == pytest.approx(origin + own @ turn)
    radial = np.array([[np.sqrt(3.0), 1.0, 0.0], [-1.0, np.sqrt(3.0), 0.0], [0.0, 0.0, 2.0]]) / 2.0
    assert bulk.grids[12].axes == pytest.approx(radial @ turn)
    # 2 at 60 degrees from z, 90 degrees around it
    own = np.array([0.0, np.sqrt(3.0), 1.0])
    assert bulk.grids[13].at == pytest.approx(origin + own @ turn)
    outwards = np.array([[0.0, np.sqrt(3.0), 1.0], [0.0, 1.0, -np.sqrt(3.0)], [-2.0, 0.0, 0.0]])
    assert bulk.grids[13].axes == pytest.approx(outwards / 2.0 @ turn, abs=1e-12)
    assert bulk.grids[14].at.tolist() == [7.0, 8.0, 9.0]
    assert np.array_equal(bulk.grids[14].axes, np.eye(3))
    # a number without a letter before its exponent, directions of system 6 at that place
    assert bulk.grids[15].at == pytest.approx([1.5, -25.0, 0.35])
    x, y, _ = (bulk.grids[15].at - origin) @ turn.T
    around = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, np.hypot(x, y)]]) / np.hypot(x, y)
    assert bulk.grids[15].axes == pytest.approx(around @ turn)


def test_systems_that_stand_in_each_other_add_up(tmp_path):
    """Each turns x, y, z into y, z, x about a place of its own; the first stands in none."""
    lines, place, turn = [], np.zeros(3), np.eye(3)
    cycle = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    for number, within in ((1, ""), (2, 1), (3, 2), (4, 3)):
        at = np.array([number + 1.0, 2.0, -3.0 * number])
        on_z, in_xz = at + np.eye(3)[0], at + np.eye(3)[1]
        numbers = [f"{v:.1f}" for v in (*at, *on_z, *in_xz)]
        lines += [
            f"CORD2R,{number},{within}," + ",".join(numbers[:6]),
            "," + ",".join(numbers[6:]),
        ]
        place, turn = place + at @ turn, cycle @ turn
    lines.reverse()
    lines = [line for pair in zip(lines[1::2], lines[::2], strict=True) for line in pair]
    grid = bulk_of(tmp_path, "GRID,9,4,0.5,-7.,2.,4", *lines)[1].grids[9]
    assert grid.at == pytest.approx(place + np.array([0.5, -7.0, 2.0]) @ turn)
    assert grid.axes == pytest.approx(turn)


def test_systems_that_stand_in_each_other_in_a_circle_are_refused(tmp_path):
    lines = [
        line
        for own, other in ((5, 6), (6, 5))
        for line in (f"CORD2R,{own},{other},0.,0.,0.,0.,0.,1.", ",1.,0.,0.")
    ]
    with pytest.raises(ValueError, match="refers to itself"):
        bulk_of(tmp_path, *lines, "GRID,1,5,1.,0.,0.")


@pytest.mark.parametrize(("off", "line"), [(2e-9, False), (0.5e-9, True)])
def test_three_points_on_a_line_make_no_axes(off, line, tmp_path):
    lines = ("CORD2R,5,,0.,0.,0.,2.,0.,0.", f",3.,{3.0 * off!r},0.", "GRID,1,5,1.,0.,0.")
    if line:
        with pytest.raises(ValueError, match="lie on a line"):
            bulk_of(tmp_path, *lines)
    else:
        assert bulk_of(tmp_path, *lines)[1].grids[1].at == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)


def test_points_in_their_order(tmp_path):
    _, bulk = bulk_of(
        tmp_path,
        "SPOINT,7,THRU,9,10",
        "SPOINT,3,4",
        "GRID,5,,1.,2.,3.",
        "EXTRN,5,1246,8,0,4,0",
        "GRID\t6\t\t1234.5\t2.5\t3.5",  # tabs go to every eighth column
    )
    assert bulk.grids[6].at.tolist() == [1234.5, 2.5, 3.5]
    assert bulk.scalars == (3, 4, 7, 8, 9, 10)
    listed = [(5, 1), (5, 2), (5, 4), (5, 6), (8, 0), (4, 0)]
    assert bulk.connected == tuple(listed)
    assert bulk.freedoms() == (*listed, (3, 0), (7, 0), (9, 0), (10, 0))
    _, plain = bulk_of(tmp_path, "SPOINT,7,THRU,8", "GRID,5,,1.,2.,3.")
    assert plain.freedoms() == (*((5, c) for c in range(1, 7)), (7, 0), (8, 0))


@pytest.mark.parametrize(("form", "kind", "precision"), [(6, 2, 5e-10), (1, 1, 6e-8)])
def test_matrices_of_columns(form, kind, precision, tmp_path):
    path, bulk = bulk_of(
        tmp_path,
        f"DMIG,KAAX,0,{form},{kind}",
        "DMIG,KAAX,5,2,,5,2,4.0",
        ",9,0,-1.5,,5,4,0.25",
        "DMIG,KAAX,9,0,,9,0,8.0",
        "DMIG,OTHER,0,1,2",
        "DMIG,OTHER,77,1,,77,1,3.0",
    )
    matrices, freedoms = dmig_matrices(path, bulk, {"KAAX"})
    assert freedoms == ((5, 2), (5, 4), (9, 0))
    other = 1.0 * (form == 6)
    wanted = [[4.0, 0.25 * other, -1.5 * other], [0.25, 0.0, 0.0], [-1.5, 0.0, 8.0]]
    assert matrices["KAAX"].values.tolist() == wanted
    assert matrices["KAAX"].precision == pytest.approx(precision)


# -- rigid bodies and what is almost one -----------------------------------------------------------
def departing(along, across, masses=10.0, inertia=1e3):
    """A body whose mass depends on direction, and whose first moment is not antisymmetric."""
    rigid = np.diag([masses] * 3 + [0.5 * inertia, inertia, 0.9 * inertia])
    rigid[1, 5] = rigid[5, 1] = 2.0 * masses
    rigid[2, 4] = rigid[4, 2] = -2.0 * masses
    rigid[[0, 1, 2], [0, 1, 2]] += along * np.array([1.0, -0.5, -0.5])
    rigid[3, 1] += across
    rigid[1, 3] += across
    rigid[4, 0] += across
    rigid[0, 4] += across
    return rigid


@pytest.mark.parametrize(
    ("along", "across", "noisy"),
    [
        # up to 2e-5 of 1000, and one no more than four times the other
        (0.0199, 0.01, True),
        (0.0201, 0.01, False),
        (0.01, 0.0199, True),
        (0.01, 0.0201, False),
        (0.0039, 0.001, True),
        (0.0041, 0.001, False),
        (0.001, 0.0039, True),
        (0.001, 0.0041, False),
    ],
)
def test_noise_of_few_digits_is_small_and_alike_in_masses_and_moments(along, across, noisy):
    assert is_noisy(departing(along, across)) is noisy


@pytest.mark.parametrize(
    ("along", "across", "share"),
    [
        (0.2, 0.0, 0.2 / 10.0),
        (0.0, 0.2, 0.2 / 100.0),  # over the root of 10 kg times 1000 kg m^2
        (0.02, 0.3, 0.3 / 100.0),
    ],
)
def test_departure_from_a_rigid_body_is_over_its_masses(along, across, share):
    assert body_departure(departing(along, across)) == pytest.approx(share)
    # all rotations over the largest inertia, here about x
    wide = departing(0.0, 0.2)
    wide[3, 3] = 4e3
    assert body_departure(wide) == pytest.approx(0.2 / 200.0)
    # without inertia the rotations count as displacements by 1 m
    bare = departing(along, across)
    bare[3:, 3:] = 0.0
    assert body_departure(bare) == pytest.approx(max(along, across) / 10.0)
    assert body_departure(np.zeros((6, 6))) == np.inf


def test_noise_of_freedoms_is_relative_and_up_to_its_coupling_absolute():
    # a departure of 0.04, 0.2 kg of 5 kg
    rigid = np.diag([5.2, 4.9, 4.9, 3.0, 3.0, 3.0])
    for coupling, absolute in ((-0.1, 0.1), (0.3, 0.2)):
        mass = np.diag([1.0, 16.0, 100.0])
        mass[0, 2] = mass[2, 0] = coupling
        wanted = np.sqrt(np.maximum(0.04 * np.array([1.0, 16.0, 100.0]), absolute))
        assert noise_of_freedoms(mass, rigid) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(("along", "across"), [(0.2, 0.3), (0.2, 4.0)])
def test_noise_of_motions_is_what_no_body_has(along, across):
    # of displacements: that of the masses, or of the first moments in proportion 1 / 10
    moving = max(along, across * 0.1)
    wanted = np.sqrt([moving] * 3 + [across**2 / moving] * 3)
    assert noise_of_motions(departing(along, across)) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(
    ("along", "across", "precision", "taken"),
    [
        # 1e-3 of the mass, or 1e-2 where noise of few digits does so
        (0.99e-2, 0.0, 1e-12, "said"),
        (1.01e-2, 0.0, 1e-12, "left"),
        (0.99e-1, 0.05, 1e-12, "said"),
        (1.01e-1, 0.05, 1e-12, "left"),
        # 1e-9, or a hundred precisions, need no word
        (0.9e-8, 0.0, 1e-12, "plain"),
        (1.1e-8, 0.0, 1e-12, "said"),
        (0.9e-5, 0.0, 1e-8, "plain"),
        (1.1e-5, 0.0, 1e-8, "said"),
    ],
)
def test_almost_a_body_becomes_one(along, across, precision, taken):
    rigid = departing(along, across, inertia=1e4)
    found, words = almost_body(rigid, precision)
    assert bool(words) == (taken == "said")
    if taken == "left":
        assert found is rigid
    else:
        assert found == pytest.approx(nearest_body(rigid), rel=1e-12)
        assert found[3, 1] == 0.0


@pytest.mark.parametrize("room", [0.0, 0.3])
@pytest.mark.parametrize("polar", [0.8, 0.0])
def test_participation_within_a_body_is_cut_at_its_share(room, polar):
    """`U min(s, sqrt(1 - room)) V^T R` of `L = U s V^T R`, `M = R^T R`."""
    mass = departing(0.0, 0.0)
    mass[3, 3] = polar
    live = np.array([0, 1, 2, 4, 5] if polar == 0.0 else range(6))
    root = np.linalg.cholesky(mass[np.ix_(live, live)]).T
    random = np.random.default_rng(4)
    left = np.linalg.qr(random.normal(size=(7, 3)))[0]
    right = np.linalg.qr(random.normal(size=(live.size, 3)))[0].T
    for shares in ([1.3, 1.2, 1.1], [1.2, 0.9, 0.3], [0.8, 0.5, 0.1]):
        rows, wanted = np.zeros((7, 6)), np.zeros((7, 6))
        rows[:, live] = (left * shares) @ right @ root
        wanted[:, live] = (left * np.minimum(shares, np.sqrt(1.0 - room))) @ right @ root
        assert within_body(rows, mass, room) == pytest.approx(wanted, rel=1e-9, abs=1e-10)


# -- forces at a port ------------------------------------------------------------------------------
MOTION = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 2.0, -3.0],
        [0.0, 0.6, 0.8, 1.0, 0.0, 0.5],
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.6, 0.8],
        [0.0, 0.0, 0.0, 0.0, 0.8, -0.6],
    ]
)


def test_forces_that_no_freedom_of_a_port_exceeds():
    """Soft ones count as 1e-10 of the stiffest shift, or of the stiffest rotation."""
    stiffness = np.diag([1e3, 1e-9, 50.0, -1.0, 2.0])
    stiffness[0, 1] = stiffness[1, 0] = 7.0  # only the diagonal counts
    clipped = np.array([1e3, 1e-9, 50.0, 0.0, 2.0])
    own = np.array([1e3, 1e-7, 50.0, 5e-9, 2.0])
    energy = [sum(k * m**2 for k, m in zip(clipped, column, strict=True)) for column in MOTION.T]
    wanted = np.sqrt(np.outer(own, energy))
    assert largest_forces(stiffness, MOTION) == pytest.approx(wanted, rel=ROUNDED, abs=1e-200)
    only = largest_forces(stiffness[2:, 2:], MOTION[2:])
    energy = [sum(clipped[2:] * column[2:] ** 2) for column in MOTION.T]
    assert only == pytest.approx(np.sqrt(np.outer(own[2:], energy)), rel=ROUNDED, abs=1e-200)


def test_forces_that_no_inner_freedom_exceeds():
    stiffness = np.diag([4.0, 1e3, 9.0, 20.0, -2.0, 50.0, 3.0, 2.0])
    boundary = Boundary((1, 3, 5, 6, 7), MOTION)
    held = np.array([1e3, 20.0, 50.0, 3.0, 2.0])
    energy = held @ MOTION**2
    found = largest_inner(partition(stiffness, stiffness, boundary))
    assert found == pytest.approx(np.sqrt(np.outer([4.0, 9.0, 0.0], energy)), abs=1e-200)


@pytest.mark.parametrize("where", [(0, 0), (4, 1), (2, 5)])
def test_a_support_is_soft_where_the_whole_goes_on_it_a_thousand_times_slower(where):
    random = np.random.default_rng(8)
    outer, inner = [0, 1, 3, 4, 6, 7], [2, 5]
    motion = random.normal(size=(6, 6))
    follow = random.normal(size=(2, 6))
    mass = np.diag(random.uniform(1.0, 2.0, 8))
    mass[2, 5] = mass[5, 2] = 0.3
    k_ii = np.array([[90.0, -20.0], [-20.0, 40.0]])
    stiffness = np.zeros((8, 8))
    stiffness[np.ix_(inner, inner)] = k_ii
    parts = partition(mass, stiffness, Boundary(tuple(outer), motion))
    whole = np.zeros((8, 6))
    whole[outer], whole[inner] = motion, follow
    moved = [column @ mass @ column for column in whole.T]
    lowest = eigh(k_ii, mass[np.ix_(inner, inner)], eigvals_only=True)[0]
    i, j = where
    limit = 1e-6 * lowest * np.sqrt(moved[i] * moved[j])
    for part, soft in ((0.999, True), (-0.999, True), (1.001, False), (-1.001, False)):
        held = np.zeros((6, 6))
        held[i, j] = part * limit
        assert is_soft(held, parts, follow) is soft


# -- headers of matrices ---------------------------------------------------------------------------
@pytest.mark.parametrize("wide", [False, True])
def test_a_header_with_fields_of_8_or_of_16(wide):
    """Columns, rows, form, type, name, and the form of numbers."""
    sizes, end = ((16, 16, 8, 8), "|I16") if wide else ((8, 8, 8, 8), "")
    fields = "".join(f"{n:{size}d}" for n, size in zip((7, 5, 2, 2), sizes, strict=True))
    header, layout = header_of_text(f"{fields}KAA     1P,3E23.16{end}")
    assert (header.name, header.rows, header.columns, header.kind) == ("KAA", 5, 7, 2)
    other, same = header_of_text(f"{7:8d}{5:8d}{2:8d}{2:8d}KAA     1P,3E23.16")
    assert (header, layout) == (other, same)
    for words, numbers in (("1P,3E23.16", (3, 23, 17)), ("5E16.9", (5, 16, 9)), ("", (5, 16, 10))):
        _, layout = header_of_text(f"{fields}KAA     {words}{end}")
        assert (layout.per_line, layout.width, layout.digits) == numbers


def test_the_largest_number_of_a_grid(tmp_path):
    """999,999,999 is looked for, one more is none."""
    path = tmp_path / "a.op4"
    path.write_text("")
    for grid, words in ((999_999_999, None), (1_000_000_000, "999999999")):
        with pytest.raises(InputError) as caught:
            read_modes(path, ports={"root": grid})
        assert ("ports.root" in str(caught.value)) is (words is not None)


@pytest.mark.parametrize("form", ["dense", "sparse", "bigmat"])
@pytest.mark.parametrize("binary", [False, True])
def test_strings_of_a_column_end_where_they_say(form, binary, tmp_path):
    """One of three numbers, then eight of one each; a matrix that is not asked for goes by."""
    k = np.zeros((19, 2))
    k[:3, 0], k[4::2, 0], k[4:9, 1] = [9.0, 10.0, 11.0], np.arange(1.0, 9.0), 0.1
    path = tmp_path / "a.op4"
    write = se.op4_binary if binary else se.op4_text
    path.write_bytes(write({"OTHER": k.T, "KAA": k, "MAA": 2.0 * k}, form))
    others = set()
    found = read_op4(path, {"KAA", "MAA"}, others)
    assert others == {"OTHER"}
    assert found["KAA"].values == pytest.approx(k)
    assert found["MAA"].values == pytest.approx(2.0 * k)


def test_matrices_of_a_text_file_are_counted(tmp_path, monkeypatch):
    """However long the columns before are; those that are not asked for count as well."""
    monkeypatch.setattr("beamchain.structure.readers.nastran_op4.MOST_MATRICES", 2)
    path, wide = tmp_path / "a.op4", np.ones((1, 7))
    path.write_bytes(se.op4_text({"A": wide.T, "B": wide}))
    assert read_op4(path, {"B"})["B"].values == pytest.approx(wide)
    path.write_bytes(se.op4_text({"A": wide, "B": wide, "C": wide}))
    with pytest.raises(InputError, match="more than 2 matrices"):
        read_op4(path, {"C"})


# -- tables of modes -------------------------------------------------------------------------------
def tables(*masses):
    return Eigenvalues(np.array([3.0, 4.0]), np.array(masses))


def test_a_subcase_is_chosen_by_its_number():
    first, second = tables(1.0, 1.0), tables(4.0, 9.0)
    assert chosen_table("a", [first], None) is first
    assert chosen_table("a", [first, second], 1) is first
    assert chosen_table("a", [first, second], 2) is second
    for found, number, says in (
        ([], None, "no eigenvalues"),
        ([first, second], None, "2 subcases"),
        ([first, second], 0, "1 to 2"),
        ([first, second], 3, "1 to 2"),
    ):
        with pytest.raises(InputError, match=says):
            chosen_table("a", found, number)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("masses", "scaled"), [((1.0, 1.0), False), ((4.0, 0.25), True)])
def test_participation_is_of_modes_of_unit_mass(turned, masses, scaled):
    """L / sqrt(m): a factor is L / m."""
    factors = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0.0, 0.3, 0.0, 0.0, 0.0, 0.7]])
    rigid = np.diag([9.0, 9.0, 9.0, 5.0, 6.0, 7.0])
    given = {"MPFACS": factors.T if turned else factors, "RBMASSS": rigid}
    data = data_of_tables("a", tables(*masses), given)
    assert data.frequencies.tolist() == [3.0, 4.0]
    assert data.participation[0] == pytest.approx(factors[0] * np.sqrt(masses[0]), rel=ROUNDED)
    assert data.participation[1] == pytest.approx(factors[1] * np.sqrt(masses[1]), rel=ROUNDED)
    assert data.rigid_mass == pytest.approx(rigid)
    assert any("unit generalized mass" in step for step in data.steps) is scaled
    for wrong, says in (
        ({"MPFACS": factors}, "RBMASS"),
        ({"MPFACS": factors[:1], "RBMASS": rigid}, "do not fit"),
        ({"MPFACS": factors, "RBMASS": rigid[:5]}, "do not fit"),
    ):
        with pytest.raises(InputError, match=says):
            data_of_tables("a", tables(*masses), wrong)


@pytest.mark.parametrize(
    ("squares", "radians", "cycles", "says"),
    [
        ((0.04, 9.0), 1.0, 1.0, None),
        ((0.0, 9.0), 1.0, 1.0, "as a rigid body"),
        ((2e-10, 4.0), 1.0, 1.0, "as a rigid body"),  # 1e-5 of the highest is 2e-5
        ((8e-10, 4.0), 1.0, 1.0, None),
        ((0.04, 9.0), 1.01, 1.0, "its radians disagree"),
        ((0.04, 9.0), 1.0, 1.01, "its frequency disagree"),
    ],
)
def test_frequencies_of_a_print_are_the_roots_of_its_eigenvalues(squares, radians, cycles, says):
    roots = np.sqrt(squares)
    hertz = roots / (2.0 * np.pi)
    rows = np.column_stack([[1.0, 2.0], squares, roots * [1.0, radians], hertz])
    if says is None:
        assert frequencies_of_print("a.f06", rows, hertz) == pytest.approx(roots, rel=ROUNDED)
    else:
        with pytest.raises(InputError, match=says):
            frequencies_of_print("a.f06", rows, hertz * [1.0, cycles])


def test_the_rigid_mass_of_a_print_is_its_first_matrix():
    first = np.arange(36.0).reshape(6, 6)
    rows = [*first.tolist(), *np.eye(6).tolist()]

    def holder(name, rows, **points):
        return SimpleNamespace(matrices={name: rows}, points=points)

    nothing = holder("", [])
    found, said = mass_of_print("a.f06", nothing, holder("grid point mass", rows), np.eye(6))
    assert (found.tolist(), len(said)) == (first.tolist(), 1)
    found, said = mass_of_print("a.f06", holder("a-set mass", rows), nothing, np.eye(6))
    assert (found.tolist(), len(said)) == (first.tolist(), 1)
    for cut in (rows[:7], [*rows[:5], rows[5][:5]]):
        with pytest.raises(InputError, match="the print is cut"):
            mass_of_print("a.f06", holder("a-set mass", cut), nothing, np.eye(6))
    with pytest.raises(InputError, match="holds no rigid mass"):
        mass_of_print("a.f06", nothing, nothing, np.eye(6))


@pytest.mark.parametrize(
    ("mode", "column", "off", "says"),
    [
        (1, 1, 4.0 * 0.9e-4, None),
        (1, 1, 4.0 * 1.1e-4, "mode 1: participation squared 4 "),
        (2, 5, 0.25 * 1.1e-4, "mode 2: participation squared 0.25 "),
        # 1e-9 of the largest of all displacements, or of all rotations
        (2, 1, 3.9e-9, None),
        (2, 1, 4.1e-9, "mode 2"),
        (1, 5, 0.9e-7, None),
        (1, 5, 1.1e-7, "mode 1"),
        (3, 1, 9.0, None),
    ],
)
def test_effective_masses_of_a_print_are_participation_squared(mode, column, off, says):
    rows = np.array([[0.0, 2.0, 0.0, 10.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.5]])
    printed = {k: [float(k), *values] for k, values in enumerate([*rows**2, np.zeros(6)], start=1)}
    printed[mode][1 + column] += off
    if says is None:
        compare_with_print("a.f06", rows, printed)
    else:
        with pytest.raises(InputError, match=says):
            compare_with_print("a.f06", rows, printed)


# -- matrices --------------------------------------------------------------------------------------
def test_modes_of_one_mass_on_a_spring_beside_a_port():
    """3 kg, 2 m along x from a port of 5 kg, that slide along y on 12 N/m."""
    arm = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 2.0, -1.0])
    own = np.diag([5.0, 5.0, 5.0, 0.1, 0.2, 0.3])
    mass = np.zeros((7, 7))
    mass[:6, :6], mass[6, 6] = own, 3.0
    order = [6, *range(6)]  # the port last
    stiffness = 12.0 * np.outer(arm, arm)
    found = from_matrices(
        mass[np.ix_(order, order)], stiffness[np.ix_(order, order)], range(1, 7), "a"
    )
    assert found.frequencies == pytest.approx([2.0], rel=1e-9)
    assert found.rigid_mass == pytest.approx(own + 3.0 * np.outer(arm[:6], arm[:6]))
    effective = found.participation.T @ found.participation
    assert effective == pytest.approx(3.0 * np.outer(arm[:6], arm[:6]), abs=1e-9)


@pytest.mark.parametrize("off", [0.0, 3e-6, -4e-5])
def test_modes_beside_almost_a_rigid_body_are_those_beside_one(off):
    """3 kg and 1 kg, 2 m and 5 m along x, that slide along y on 12 and 25 N/m; the mass along x is
    off."""
    arms = np.zeros((2, 6))
    arms[:, 1], arms[:, 5] = 1.0, [2.0, 5.0]
    across = np.zeros((2, 6))
    across[:, 2], across[:, 4] = 1.0, [-2.0, -5.0]
    masses = np.diag([3.0, 1.0])
    own = np.diag([9.0, 5.0, 5.0, 0.1, 0.2, 0.3]) + across.T @ masses @ across
    mass = np.zeros((8, 8))
    mass[:6, :6], mass[6:, 6:] = own, masses
    mass[0, 0] += off
    rows = np.hstack([arms, -np.eye(2)])
    stiffness = rows.T @ np.diag([12.0, 25.0]) @ rows
    found = from_matrices(mass, stiffness, range(6), "a")
    rigid, within = own + arms.T @ masses @ arms, 1e-9 + 2.0 * abs(off)
    assert found.frequencies == pytest.approx([2.0, 5.0], rel=within)
    assert found.rigid_mass == pytest.approx(rigid, rel=within, abs=within)
    assert body_departure(found.rigid_mass) < 1e-12
    for row, arm, m in zip(found.participation, arms, (3.0, 1.0), strict=True):
        assert np.outer(row, row) == pytest.approx(m * np.outer(arm, arm), abs=20.0 * within)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e7])
@pytest.mark.parametrize(("share", "held"), [(1e-14, False), (1e-11, True)])
def test_a_freedom_that_is_held_by_rounding_is_loose(unit, share, held):
    """Two freedoms on a spring between them, and the share of one on the ground."""
    inner = unit * np.array([[1.0, -1.0], [-1.0, 1.0 + share]])
    stiffness = np.zeros((8, 8))
    stiffness[6:, 6:] = inner
    boundary = Boundary(tuple(range(6)), np.eye(6), ())
    parts = partition(np.eye(8), stiffness, boundary)
    if held:
        found = rigid_motion_of_inner(parts, boundary, "a", 1e-12)
        assert found[0] == pytest.approx(np.zeros((2, 6)))
    else:
        with pytest.raises(InputError, match="can still move"):
            rigid_motion_of_inner(parts, boundary, "a", 1e-12)


@pytest.mark.parametrize("held", [0, 1])
def test_the_grid_that_is_held_elsewhere_is_named(held):
    """Two grids that move along x on a spring of 1000 N/m between them, one on one of 1 N/m."""
    stiffness = np.array([[1e3, -1e3, 0.0], [-1e3, 1e3, 0.0], [0.0, 0.0, 5.0]])
    stiffness[held, held] += 1.0
    motion = np.zeros((2, 6))
    motion[:, 0] = 1.0
    boundary = Boundary((0, 1), motion, ("grid 4", "grid 9"))
    with pytest.raises(InputError, match=f"most at {boundary.names[held]},"):
        rigid_motion_of_inner(partition(np.eye(3), stiffness, boundary), boundary, "a", 1e-12)


@pytest.mark.parametrize(
    ("numbers", "digits"),
    [((2.0, -30.0, 4e-7), 1), ((0.25, -1.5e-7), 2), ((0.0, 123.4), 4), ((0.00102,), 3), ((), 1)],
)
def test_digits_that_numbers_were_given_with(numbers, digits):
    assert digits_of_numbers([(1.0,), numbers]) == digits


# -- rows of recovery ------------------------------------------------------------------------------
def test_rows_of_a_file_have_zeros_where_one_leaves_out_what_another_gives(tmp_path):
    text, arrays = tmp_path / "a.toml", tmp_path / "a.npz"
    text.write_text(
        """[[row]]
        name = "moment"
        unit = "N m"
        modes = [1.0, 2.0]
        [[row]]
        name = "tip"
        accelerations = [3.0, 4.0]
        root = [0.0, 1.0, 0.0, 0.0, 0.0, 2.0]
        point = [2.0, 0.0, 0.5]"""
    )
    root = np.array([[0.0] * 6, [0.0, 1.0, 0.0, 0.0, 0.0, 2.0]])
    wanted = {
        "modes": np.array([[1.0, 2.0], [0.0, 0.0]]),
        "accelerations": np.array([[0.0, 0.0], [3.0, 4.0]]),
        "root": root,
        "points": np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.5]]),
    }
    np.savez(arrays, names=["moment", "tip"], units=["N m", ""], **wanted)
    for path in (text, arrays):
        found = read_recovery(path)
        assert (found.names, found.units) == (("moment", "tip"), ("N m", ""))
        assert found.source == path.name
        for name, values in wanted.items():
            assert getattr(found, name).tolist() == values.tolist()
    text.write_text(text.read_text().replace("[3.0, 4.0]", "[3.0, 4.0, 5.0]"))
    with pytest.raises(InputError):
        read_recovery(text)
    text.write_text(text.read_text() + '\n[[row]]\nname = "c"\naccelerations = [1.0]')
    for ending, says in (("op4", "MUG1"), ("txt", "unknown ending"), ("npz", "is empty")):
        path = tmp_path / f"rows.{ending}"
        path.write_text("")
        with pytest.raises(InputError, match=says):
            read_recovery(path)
    with pytest.raises(InputError, match="'c' has 1 numbers in accelerations, others have 3"):
        read_recovery(text)
