"""Numbers by hand beside how a beam is cut in pieces, which way a body points, rows of recovery."""

from types import SimpleNamespace

import numpy as np
import pytest

from beamchain import (
    Beam,
    Equivalent,
    InputError,
    Joint,
    Lump,
    Material,
    ModalData,
    Rectangle,
    Round,
    Segment,
)
from beamchain.spec import RecoveryRows
from beamchain.structure.discretise import converged_model
from beamchain.structure.readers.imported import Imported, Units
from formulas import (
    Parts,
    Shapes,
    body_in_port,
    body_mass_matrix,
    change_of_lowest,
    check_outwards,
    edges_of_pieces,
    joined_neighbours,
    momentum_beyond,
    pieces_of_beam,
    proposed_axes,
    sampled_model,
    snapped,
    taper_cuts,
    with_length,
)

STEEL = Material(youngs_modulus=2e11, density=7800.0, poissons_ratio=0.25)


def rod(length=2.0, start=0.01, end=None, **more):
    taper = {} if end is None else {"section_end": Round(diameter=end)}
    return Segment(length=length, section=Round(diameter=start), material=STEEL, **taper, **more)


# -- pieces ----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("start", "end", "cuts"),
    [
        (0.01, 0.02, []),
        (0.01, 0.02 * 2.0**0.9e-9, []),
        (0.01, 0.02 * 2.0**1.1e-9, [2.0**0.5 - 1.0]),
        # diameters 2 and 4 of 1 to 8
        (0.01, 0.08, [1.0 / 7.0, 3.0 / 7.0]),
        (0.08, 0.01, [6.0 / 7.0, 4.0 / 7.0]),
    ],
)
def test_a_taper_is_cut_in_equal_ratios_of_two_at_most(start, end, cuts):
    assert taper_cuts(rod(start=start, end=end)) == pytest.approx(cuts, rel=1e-6)


def test_pieces_end_at_segments_bodies_stations_and_tapers():
    first, second = rod(), rod(1.0, 0.02, 0.08)
    slack = 1e-9 * 3.0
    lumps = (Lump(x=0.5, mass=1.0), Lump(x=2.0, mass=1.0), Lump(x=3.0, mass=1.0))
    parts = Parts((first, second), (), lumps)
    found = edges_of_pieces(parts, (2.0 - 0.9 * slack, 2.0 + 0.9 * slack, 2.5, 0.5))
    wanted = [(0.0, 0.5), (0.5, 2.0), (2.0, 2.0 + 1.0 / 3.0), (2.0 + 1.0 / 3.0, 2.5), (2.5, 3.0)]
    assert np.array([piece[2:] for piece in found]) == pytest.approx(np.array(wanted))
    assert [segment for segment, *_ in found] == [first, first, second, second, second]
    assert [start for _, start, *_ in found] == [0.0, 0.0, 2.0, 2.0, 2.0]
    # what lies farther from an end is a place of its own
    more = edges_of_pieces(Parts((first,), (), ()), (2.2e-9, 2.0 - 2.2e-9))
    assert len(more) == 3


def test_equal_neighbours_become_one_unless_a_joint_stands_between():
    thin, thick = rod(1.0), rod(1.0, 0.02)
    cone = rod(1.0, 0.01, 0.02)
    joints = [Joint(after_segment=k, stiffness_xy=1.0 + k) for k in (0, 2, 4)]
    segments = (thin, rod(2.0), rod(3.0), thick, thick, thick, cone, cone)
    found = joined_neighbours(Parts(segments, tuple(joints), ()))
    # 1 + 2, 3 behind the joint, 1, 2 behind the joint, two tapers
    assert [one.length for one in found.segments] == [3.0, 3.0, 1.0, 2.0, 1.0, 1.0]
    assert [one.section.diameter for one in found.segments] == [0.01] * 2 + [0.02] * 2 + [0.01] * 2
    assert [(j.after_segment, j.stiffness_xy) for j in found.joints] == [(0, 1), (1, 3), (3, 5)]


def test_largest_change_of_the_lowest_frequencies():
    old, new = np.array([1.0, 2.0, 4.0]), np.array([1.01, 1.96, 5.0, 9.0])
    assert change_of_lowest(old, new, 1) == pytest.approx(0.01)
    assert change_of_lowest(old, new, 2) == pytest.approx(0.02)
    assert change_of_lowest(old, new, 9) == pytest.approx(0.25)
    assert change_of_lowest(old[:0], new, 2) == 0.0


def test_a_body_in_each_port():
    lump = Lump(x=1.5, mass=2.0, inertia=(0.3, 0.4, 0.5))
    assert body_in_port(lump, "xy") == (1.5, 2.0, 0.5)
    assert body_in_port(lump, "xz") == (1.5, 2.0, 0.4)
    assert body_in_port(lump, "torsion") == (1.5, 0.3, 0.0)
    assert body_in_port(lump, "axial") == (1.5, 2.0, 0.0)


@pytest.mark.parametrize("port", ["xy", "xz", "torsion", "axial"])
def test_stiffness_and_inertia_of_a_piece_at_gauss_points(port):
    """A flat bar that widens from 1 to 3 cm along y, 2 cm along z; G = E / 2.5."""
    segment = Segment(
        length=2.0,
        section=Rectangle(width_y=0.01, width_z=0.02),
        section_end=Rectangle(width_y=0.03, width_z=0.02),
        material=STEEL,
        theory="timoshenko",
        shear_factor=0.8,
        nonstructural_mass=0.7,
    )
    found = pieces_of_beam(Parts((segment,), (), ()), port, 4, ())
    xi = np.polynomial.legendre.leggauss(9)[0]
    for piece, (a, b) in zip(found, ((0.0, None), (None, 2.0)), strict=True):
        x = piece.start + piece.length * (1.0 + xi) / 2.0
        assert piece.start == pytest.approx(a if a is not None else found[0].length)
        assert piece.start + piece.length == pytest.approx(b or found[1].start)
        y, z = 0.01 * (1.0 + x), 0.02
        second = {"xy": z * y**3 / 12.0, "xz": y * z**3 / 12.0}
        if port in second:
            assert piece.stiffness == pytest.approx(2e11 * second[port])
            assert piece.shear_stiffness == pytest.approx(0.8 * 8e10 * y * z)
            assert piece.rotary_inertia == pytest.approx(7800.0 * second[port])
        else:
            assert piece.shear_stiffness is piece.rotary_inertia is None
        if port == "axial":
            assert piece.stiffness == pytest.approx(2e11 * y * z)
        mass = 7800.0 * y * z + 0.7
        polar = 7800.0 * (second["xy"] + second["xz"])
        assert piece.inertia == pytest.approx(polar if port == "torsion" else mass)


# -- inside ----------------------------------------------------------------------------------------
def test_stations_near_a_step_stand_on_it():
    """A millionth of 4 m: steps are ends of segments and bodies."""
    beam = Beam(segments=[rod(1.0), rod(3.0, 0.02)], lumps=[Lump(x=2.0, mass=1.0)])
    near, far = 3.9e-6, 4.1e-6
    for step in (0.0, 1.0, 2.0, 4.0):
        for sign in (1.0, -1.0):
            stations = np.clip(step + sign * np.array([near, far]), 0.0, 4.0)
            found = snapped(beam, stations)
            assert found[0] == step
            assert (found[1] == step) == (stations[1] == step)


def test_momentum_beyond_stations_is_of_what_hangs_behind():
    """Two modes of three points; force, and moment about the station."""
    x, moved, turned = (np.array(v) for v in ((1.0, 2.0, 4.0), (0.5, 0.7, 0.9), (0.1, 0.2, 0.3)))
    values = np.array([[1.0, 2.0, 3.0], [-1.0, 0.5, 2.0]])
    stations = np.array([0.5, 2.0 - 2e-9, 2.0, 5.0])
    found = momentum_beyond(Shapes(x, moved, turned, values, bending=True), stations, 1e-9)
    for k, (at, behind) in enumerate(zip(stations, (3, 2, 1, 0), strict=True)):
        own = slice(3 - behind, 3)
        force = values[:, own] @ moved[own]
        moment = values[:, own] @ (moved[own] * (x[own] - at) + turned[own])
        assert found[:, k] == pytest.approx(np.column_stack([force, moment]), rel=1e-12)
    plain = momentum_beyond(Shapes(x, moved, turned, values, bending=False), stations, 1e-9)
    assert plain[:, :, 0] == pytest.approx(found[:, :, 0])
    assert plain.shape == (2, 4, 1)


# -- which way a body points -----------------------------------------------------------------------
@pytest.mark.parametrize("k", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_axes_that_point_outwards_turn_as_little_as_they_can(k, sign):
    centre = np.array([0.3, -0.2, 0.1])
    centre[k] = sign * 2.0
    axes = proposed_axes(centre)
    assert axes @ axes.T == pytest.approx(np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[0].tolist() == (sign * np.eye(3)[k]).tolist()
    assert axes[2].tolist() == ([1.0, 0.0, 0.0] if k == 2 else [0.0, 0.0, 1.0])


def body(centre, gyration=0.5):
    """Modal data of 2 kg, a ball about its centre."""
    rigid = body_mass_matrix(2.0, np.array(centre), 2.0 * gyration**2 * np.eye(3))
    row = np.array([[0.0, 0.3, 0.0, 0.0, 0.0, 0.0]])
    return ModalData(rigid, np.array([3.0]), row)


@pytest.mark.parametrize(
    ("centre", "says"),
    [
        ((1.0, 0.0, 0.0), None),
        ((-1.0, 0.0, 0.0), "not outwards along x"),
        ((0.0, 0.1, 0.0), "not outwards along x"),
        # on the root but for 1e-9 of the radius of gyration, 0.5 sqrt(3) m
        ((-0.9e-9 * 0.75**0.5, 0.0, 0.0), None),
        ((-1.1e-9 * 0.75**0.5, 0.0, 0.0), "not outwards along x"),
        ((0.5, 0.49, 0.0), None),
        ((0.05, 0.0, 0.049), None),
        ((0.5, 0.0, -0.49), None),
    ],
)
def test_the_centre_lies_on_the_side_to_which_x_points(centre, says):
    if says is None:
        check_outwards(body(centre))
    else:
        with pytest.raises(InputError, match=says):
            check_outwards(body(centre))


def test_the_centre_is_told_in_all_three_directions():
    with pytest.raises(InputError, match=r"at x = -1, y = 0\.25, z = -0\.5 m from the root"):
        check_outwards(body((-1.0, 0.25, -0.5)))


def test_axes_are_proposed_in_those_of_the_file():
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    with pytest.raises(InputError) as told:
        check_outwards(body((0.0, -1.0, 0.0)), turn)
    # x of the appendage along -y of the present axes, which is z of the file
    assert "axes = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]" in str(told.value)


def test_a_length_is_the_stated_one_or_the_file_s_or_that_of_a_uniform_rod():
    rigid = np.diag([2.0, 2.0, 2.0, 0.0, 6.0, 6.0])  # 2 kg on 3 m
    rigid[1, 5] = rigid[5, 1] = 3.0
    rigid[2, 4] = rigid[4, 2] = -3.0
    row = np.array([[0.0, 0.3, 0.0, 0.0, 0.0, 0.0]])
    plain = ModalData(rigid, np.array([3.0]), row)
    assert with_length(plain, 7.0).length == 7.0
    assert with_length(plain, None).length == pytest.approx(3.0, rel=1e-9)
    held = ModalData(rigid, np.array([3.0]), row, length=4.0)
    assert with_length(held, None) is held
    assert (Units().si, Units(length=0.1, mass=3.0).si) == ((1.0, 1.0), (0.1, 3.0))
    with pytest.raises(InputError):
        Imported(file="a.op2", modes=tuple(range(1, 202)))
    assert len(Imported(file="a.op2", modes=tuple(range(1, 201))).modes) == 200


# -- rows of recovery ------------------------------------------------------------------------------
def test_rows_have_zeros_for_what_is_left_out():
    rows = RecoveryRows(names=("a", "b"), modes=[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert rows.accelerations.tolist() == np.zeros((2, 3)).tolist()
    assert rows.root.tolist() == np.zeros((2, 6)).tolist()
    assert rows.points.tolist() == np.zeros((2, 3)).tolist()
    assert rows.units == ("", "")
    root = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    one = RecoveryRows(names=("a",), accelerations=[1.0, 2.0], root=root, units=("m",))
    assert one.modes.tolist() == [[0.0, 0.0]]
    assert one.root.tolist() == [root]
    rows.check_columns(3)
    for wrong in (2, 4):
        with pytest.raises(InputError):
            rows.check_columns(wrong)


@pytest.mark.parametrize(
    ("given", "taken"),
    [
        ({}, True),
        ({"names": ()}, False),
        ({"names": ("a",)}, False),
        ({"names": ("a", "a")}, False),
        ({"units": ("m",)}, False),
        ({"modes": np.zeros((2, 0))}, False),
        ({"accelerations": np.ones((2, 4))}, False),
        ({"root": np.ones((2, 5))}, False),
        ({"points": np.ones((2, 3)), "root": np.eye(6)[3:5]}, False),
        ({"points": np.ones((2, 3)), "root": np.eye(6)[:2]}, True),
        ({"points": np.ones((2, 3)), "root": np.eye(6)[1:3]}, True),
    ],
)
def test_rows_that_do_not_fit_are_refused(given, taken):
    whole = {"names": ("a", "b"), "modes": np.ones((2, 3)), **given}
    if taken:
        assert RecoveryRows(**whole).modes.shape == (2, 3)
    else:
        with pytest.raises(InputError):
            RecoveryRows(**whole)


def test_at_most_4000_rows():
    names = tuple(str(k) for k in range(4001))
    assert len(RecoveryRows(names=names[:4000], modes=np.ones((4000, 1))).names) == 4000
    with pytest.raises(InputError):
        RecoveryRows(names=names, modes=np.ones((4001, 1)))


@pytest.mark.parametrize(
    ("section", "end", "shrinks"),
    [
        ((0.2, 0.1), (0.1, 0.15), True),
        ((0.2, 0.1), (0.15, 0.2), False),
        ((0.1, 0.1), (0.2, 0.1), False),
    ],
)
def test_a_segment_shrinks_as_its_strongest_taper_does(section, end, shrinks):
    first, last = (Rectangle(width_y=y, width_z=z) for y, z in (section, end))
    segment = Segment(length=1.0, section=first, section_end=last, material=STEEL)
    assert segment.shrinks is shrinks
    assert segment.taper == pytest.approx(2.0)


def test_an_equivalent_segment_s_stiffness_and_inertia_along_it():
    here, there = (
        Equivalent(
            bending_stiffness_xy=bent, linear_mass=mass, torsion_stiffness=gj, axial_stiffness=ea
        )
        for bent, mass, gj, ea in ((8.0, 0.2, 3.0, 1.0), (4.0, 0.6, 1.0, 5.0))
    )
    segment = Segment(length=1.0, section=here, section_end=there, nonstructural_mass=0.1)
    at = segment.at(np.array([0.25]))
    assert at.bending_xy[0] == at.bending_xz[0] == pytest.approx(7.0)
    assert (at.mass[0], at.torsion[0]) == (pytest.approx(0.4), pytest.approx(2.5))
    assert at.axial[0] == pytest.approx(2.0)
    assert (at.polar[0], at.shear_xy[0], at.rotary_xz[0]) == (0.0, 0.0, 0.0)


def test_a_long_piece_beside_short_ones_has_its_modes_too():
    """A rod of 1 m as one of 0.995 m and five of 1 mm, which are alike to 1e-13: as many functions
    in each as the long one needs."""

    def part(length, more):
        section = Equivalent(
            bending_stiffness_xy=1.0, axial_stiffness=400.0 * (1.0 + more), linear_mass=1.0
        )
        return Segment(length=length, section=section)

    rod = Beam(segments=(part(0.995, 1e-13), *(part(0.001, 1e-13 * (k % 2)) for k in range(5))))
    wanted = (np.arange(5) + 0.5) * np.pi * 20.0
    assert rod.port("axial", 5).frequencies[:5] == pytest.approx(wanted, rel=1e-10)


def test_a_drawn_rod_has_its_lowest_modes_at_its_stations():
    """Held at the root: w = (n - 1/2) pi sqrt(EA / m) / L, u ~ sin((n - 1/2) pi x / L)."""
    section = Equivalent(bending_stiffness_xy=1.0, axial_stiffness=36.0, linear_mass=4.0)
    parts = Parts((Segment(length=3.0, section=section),), (), ())
    found = sampled_model(parts, "axial", 0, (0.5, 1.5, 2.0))
    waves = np.pi * np.array([0.5, 1.5])
    assert found.frequencies[:2] == pytest.approx(waves, rel=1e-6)
    sines = np.sin(waves[:, None] * np.array([3.0, 0.5, 1.5, 2.0]) / 3.0)
    size = np.sqrt(2.0 / 12.0)  # of unit modal mass
    assert np.abs(found.tip[:2]) == pytest.approx(size * np.abs(sines), rel=1e-5, abs=1e-6)


# -- refinement ------------------------------------------------------------------------------------
FEW, SOME, MANY = 3, 20, 150  # pieces


@pytest.mark.parametrize(
    ("pieces", "modes", "held", "free", "asked"),
    [
        # 10 + 1.6 functions for each mode over the pieces, four more each; twice that beyond 1e-3
        (FEW, 5, [1.1e-3, 0.9e-3, 1.05e-11, 0.9e-11], [0.0] * 9, [10, 14, 22, 30, 38]),
        (FEW, 0, [0.9e-3, 0.9e-11], [0.0] * 9, [8, 12, 16]),
        (FEW, 30, [1e-6, 2.9e-11], [0.0] * 9, [24, 28, 32]),
        (SOME, 5, [0.9e-3, 0.9e-11], [0.0] * 9, [3, 7, 11]),
        (SOME, 31, [0.9e-3, 3.0e-11], [0.0] * 9, [5, 9, 13]),
        (MANY, 5, [0.9e-3, 0.9e-11], [0.0] * 9, [5, 7, 9]),
        (MANY, 5, [0.1, 0.1, 0.1, 1e-6, 0.0], [0.0] * 9, [5, 7, 11, 19, 27, 35]),
        # three in a row that are no less than 0.3 of the least are rounding, one below 1e-9
        (FEW, 5, [1e-6, 2.9e-7, 1e-7, 1e-7, 1e-7], [0.0] * 9, [10, 14, 18, 22, 26, 30]),
        (FEW, 5, [1e-6, 4e-7, 1e-7, 1e-7, 1e-7, 1e-7], [0.0] * 9, [10, 14, 18, 22, 26, 30, 34]),
        (FEW, 5, [1.1e-9, 0.9e-9], [0.0] * 9, [10, 14, 18]),
        (FEW, 5, [0.9e-11] * 9, [1e-6, 2.9e-7, 1e-7], [10, 14, 18, 22]),
        (FEW, 5, [1e-6, 1e-6, 0.0], [2e-6, 1e-6, 2e-6, 0.0], [10, 14, 18, 22]),
        # what does not settle ends beyond 60
        (FEW, 5, [0.5] * 9, [0.0] * 9, [10, 14, 22, 30, 38, 46, 54, 62, 70]),
    ],
)
def test_functions_are_added_until_frequencies_stand_still(
    pieces, modes, held, free, asked, monkeypatch
):
    """Changes of the held and of the free frequencies from one degree to the next."""
    found = []
    of_held, of_free = (np.cumprod([1.0, *(1.0 + np.array(each))]) for each in (held, free))

    def discretised(parts, port, functions, *, wanted, stations, shaped):
        assert (port, wanted, stations, shaped) == ("xy", max(modes, 1), (0.5,), True)
        k = len(found)
        found.append(functions)
        further = np.full(wanted, 9.0 + k)  # beyond those that are wanted
        return SimpleNamespace(
            frequencies=np.append(np.full(wanted, of_held[k]), further),
            free_frequencies=np.append(np.full(wanted, of_free[k]), further),
        )

    parts = SimpleNamespace(segments=[None] * pieces)
    monkeypatch.setattr("beamchain.structure.discretise._join_equal_neighbours", lambda _: parts)
    monkeypatch.setattr("beamchain.structure.discretise._edges", lambda _: [None] * pieces)
    monkeypatch.setattr("beamchain.structure.discretise._discretise", discretised)
    last = converged_model.__wrapped__(None, "xy", modes, (0.5,), shaped=True)
    assert found == asked
    assert last.frequencies[0] == of_held[len(asked) - 1]
