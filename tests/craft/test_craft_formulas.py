"""Closed forms beside the formulas of a craft."""

from itertools import pairwise
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import beamchain as bc
from formulas import (
    BentLine,
    ModalForm,
    ModesOfCraft,
    Reference,
    Seen,
    SlewBody,
    apart,
    bent_line,
    check_inertia,
    clusters,
    equal_parts,
    modes_finely_divided,
    momentum_of_mode,
    motion_of_modes,
    pairs_of_modes,
    phase_of_two,
    port_of_mode,
    shares_of_energy,
    slow_modes,
    turned_by,
    turns_of_hinge,
)


# -- modal forms -----------------------------------------------------------------------------------
def response(form, s):
    n = len(form.a)
    return form.c @ np.linalg.solve(s * np.eye(n) - form.a, form.b) + form.d


def form_of(b, c):
    """Two rigid directions and two modes; positions stand before rates."""
    a = np.zeros((8, 8))
    a[:2, 2:4] = np.eye(2)
    for i, (w, ratio) in enumerate(((3.0, 0.01), (7.0, 0.02))):
        a[4 + 2 * i : 6 + 2 * i, 4 + 2 * i : 6 + 2 * i] = [[0.0, 1.0], [-(w**2), -2.0 * ratio * w]]
    names = ("x", "y", "x_rate", "y_rate", "one", "one_rate", "two", "two_rate")
    weight = np.array([1.0, 0.5, 1.0, 0.5, 1.0, 3.0, 1.0, 7.0])
    return ModalForm(a, b, c, np.array([[0.3]]), names, ("",) * 8, weight, (2, 2))


RANDOM = np.random.default_rng(4)
B = np.array([[0, 0, 0.2, 0.5, 0, 1.1, 0, -0.7]]).T
C = np.array([[1.0, -2.0, 0, 0, 0.4, 0, 0.9, 0]])
S = 0.3 + 2.1j


def test_a_reduced_form_has_the_response_of_its_states():
    """Rigid positions and rates side by side, then what is kept."""
    form = form_of(B, C)
    whole = form.reduced(np.ones(8, dtype=bool))
    assert whole.names == ("x", "x_rate", "y", "y_rate", "one", "one_rate", "two", "two_rate")
    assert response(whole, S) == pytest.approx(response(form, S), rel=1e-13)
    less = form.reduced(np.array([True] * 6 + [False] * 2))
    wanted = 0.3 + (0.2 - 1.0) / S**2 + 0.4 * 1.1 / (S**2 + 0.06 * S + 9.0)
    assert response(less, S)[0, 0] == pytest.approx(wanted, rel=1e-13)
    assert less.states_of("one") == [4, 5]
    assert less.oscillators(["one", "two"]) == ["one"]


@pytest.mark.parametrize(
    ("names", "rigid", "keep", "left", "counts"),
    [
        ("x y x_rate one", (2, 1), (1, 1, 1, 1), "x x_rate y one", (2, 1)),
        ("x x_rate y_rate one", (1, 2), (1, 1, 1, 1), "x x_rate y_rate one", (1, 2)),
        ("x y x_rate y_rate one", (2, 2), (0, 1, 0, 1, 1), "y y_rate one", (1, 1)),
    ],
)
def test_a_rigid_rate_stands_behind_its_position(names, rigid, keep, left, counts):
    names, n = tuple(names.split()), len(keep)
    a, b = RANDOM.normal(size=(n, n)), RANDOM.normal(size=(n, 1))
    form = ModalForm(a, b, b.T, np.eye(1), names, names, np.arange(n) + 1.0, rigid)
    found = form.reduced(np.array(keep, dtype=bool))
    pick = [names.index(name) for name in left.split()]
    assert (found.names, found.units, found.rigid) == (tuple(left.split()),) * 2 + (counts,)
    assert np.array_equal(found.a, a[np.ix_(pick, pick)])
    assert np.array_equal(found.b, b[pick])
    assert np.array_equal(found.c, b.T[:, pick])
    assert np.array_equal(found.weight, np.array(pick) + 1.0)


def test_one_input_drives_one_rigid_direction():
    form = form_of(B, C)
    spanned = form.reduced(np.ones(8, dtype=bool)).spanned()
    assert spanned.rigid == (1, 1)
    assert len(spanned.names) == 6
    assert response(spanned, S) == pytest.approx(response(form, S), rel=1e-12)


def test_states_that_nothing_drives_or_sees_are_not_active():
    b, c = B.copy(), C.copy()
    b[5], c[0, 6] = 0.0, 0.0  # the first mode is not driven, the second not seen
    assert form_of(b, c).active().tolist() == [True] * 4 + [False] * 4
    assert form_of(B, C).active().all()


# -- uncertain inertia -----------------------------------------------------------------------------
@pytest.mark.parametrize(("reach", "kept"), [(0.9, True), (1.1, False)])
def test_principal_moments_stay_a_body_s_at_every_corner(reach, kept):
    """Moments 3, 4, 6: the largest may grow by 1 until it is the sum of the others."""
    range_of = SimpleNamespace(kind="inertia_zz", nominal=6.0, reach=reach)
    if kept:
        check_inertia("bus", np.diag([3.0, 4.0, 6.0]), [range_of])
    else:
        with pytest.raises(bc.InputError, match="3, 4, 7.1"):
            check_inertia("bus", np.diag([3.0, 4.0, 6.0]), [range_of])


# -- slews -----------------------------------------------------------------------------------------
@pytest.mark.parametrize("angle", [1e-9, 0.3, 2.0, 3.1])
def test_two_motions_are_apart_by_their_largest_turn_and_distance(angle):
    start = Rotation.from_rotvec([0.2, -0.9, 0.4])
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    nothing = np.zeros((3, 2, 3, 3)), np.zeros((3, 2, 3)), np.zeros((3, 3)), np.zeros(3)
    one = Seen(*nothing, np.zeros(3))
    other = Seen(*(part.copy() for part in nothing), np.zeros(3))
    one.rotations[:] = start.as_matrix()
    for k, part in enumerate((0.2, 1.0, 0.5)):
        other.rotations[k, 0] = start.as_matrix()
        other.rotations[k, 1] = (start * Rotation.from_rotvec(part * angle * axis)).as_matrix()
        other.places[k, 0] = part * np.array([2.0, -3.0, 6.0])
    turned, moved = apart(one, other)
    assert turned == pytest.approx([0.0, angle], rel=1e-6, abs=1e-15)
    assert moved == pytest.approx([7.0, 0.0])


@pytest.mark.parametrize(
    ("limits", "angles"),
    [
        ("", [90.0, 90.0, 180.0]),
        ('range="-120 150"', [90.0, 90.0]),
        ('range="-60 50"', [-60.0, -60.0]),
        ('range="-20 60" ref="10"', [50.0, 50.0]),
    ],
)
def test_a_hinge_is_turned_as_far_as_its_range_goes(limits, angles):
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body><joint type="slide"/><joint name="drive" {limits}/>
        <geom size="1"/></body></worldbody></mujoco>"""
    )
    found = turns_of_hinge(model, model.joint("drive").id, 4.0)
    assert np.degrees([turn.angle for turn in found]) == pytest.approx(angles)
    assert [turn.duration for turn in found] == [20.0, 40.0, 40.0][: len(found)]


def test_steps_fill_a_sample_and_modes_are_divided():
    assert [equal_parts(1.0, step) for step in (0.25, 0.3, 1.0 / 3.0, 2.0)] == [4, 4, 3, 1]
    # kept, static shapes (two of each load in bending), divided: three times, at most six
    for kept, static, port, modes in (
        (1, 0, "xy", 3),
        (2, 0, "xz", 6),
        (6, 0, "torsion", 5),
        (3, 1, "xy", 3),
        (3, 1, "torsion", 6),
    ):
        assert modes_finely_divided(kept, static, port) == modes


def test_what_a_slew_is_off_is_a_share_of_its_elastic_motion():
    body = SlewBody("bus", 0.2, 0.4, 0.01, 0.06, 0.03, 1.0)
    assert body.chain_share == pytest.approx(0.15)
    assert body.step_share == pytest.approx(0.15)
    assert SlewBody("bus", 0.0, 1e-10, 0.5, 0.5, 0.5, 0.5).chain_share == 0.0
    assert Reference(None, 0.3, 1.0).compared().step == 0.6
    assert Reference(None, 0.4, 1.0).compared().step == 0.2


# -- coupled modes ---------------------------------------------------------------------------------
def test_modes_of_two_masses_that_a_spring_holds_together():
    mass, k = np.diag([2.0, 6.0]), 30.0
    craft = SimpleNamespace(mass=mass, stiffness=k * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    frequency, shapes = slow_modes(craft, 5.0)
    assert frequency == pytest.approx([np.sqrt(k * (1 / 2 + 1 / 6))])  # the rigid motion is none
    assert shapes.T @ mass @ shapes == pytest.approx(np.eye(1))
    assert np.abs(shapes[:, 0]) == pytest.approx([3.0 / np.sqrt(24.0), 1.0 / np.sqrt(24.0)])


@pytest.mark.parametrize("lean", [0.0, 1e-3])
def test_modes_a_hundred_thousandth_as_fast_as_a_tenth_of_the_reach_are_rigid(lean):
    """A billionth of 3 rad/s squared; a thrust makes the stiffness unsymmetric."""
    slow = 1e-9 * 3.0**2 * np.array([0.8, 1.2])
    mass = np.diag([2.0, 0.5, 4.0, 3.0])
    stiffness = np.diag([2.0 * slow[0], 0.5 * slow[1], 4.0 * 16.0, 3.0 * 49.0])
    stiffness[2, 3] = lean
    linear = SimpleNamespace(mass=mass, stiffness=stiffness)
    frequency, shapes = slow_modes(linear, 30.0)
    assert frequency == pytest.approx([np.sqrt(slow[1]), 4.0, 7.0], rel=1e-4)
    assert np.einsum("ik,ij,jk->k", shapes, mass, shapes) == pytest.approx(np.ones(3))


def test_modes_under_a_thrust_that_stays_with_the_craft():
    # K = [[20, 3], [0, 45]] over masses 5: squares 4 and 9, shapes (1, 0) and (3, 5^2 / 5)
    craft = SimpleNamespace(mass=5.0 * np.eye(2), stiffness=np.array([[20.0, 3.0], [0.0, 45.0]]))
    frequency, shapes = slow_modes(craft, 3.0)
    assert frequency == pytest.approx([2.0, 3.0])
    assert np.abs(shapes[:, 0]) == pytest.approx([1.0 / np.sqrt(5.0), 0.0])
    assert shapes[1, 1] / shapes[0, 1] == pytest.approx(25.0 / 3.0)
    assert 5.0 * np.sum(shapes**2, axis=0) == pytest.approx([1.0, 1.0])


def modes_of(frequency, shapes, share):
    return ModesOfCraft(np.array(frequency), np.array(shapes, float).T, np.array(share, float).T)


def test_modes_are_paired_by_what_moves_where_frequencies_cross():
    mass = np.eye(2)
    one, other = [1.0, 0.0], [0.0, 1.0]
    exact = modes_of([1.0, 1.2], [one, other], [one, other])
    crossed = modes_of([1.1, 1.3], [other, one], [other, one])
    kept = np.array([True, True])
    assert pairs_of_modes(exact, crossed, kept, mass) == {0: 1, 1: 0}
    # two pairs that are unlike cost 2, half of it for the motion and half for the energy, and
    # frequencies off by a factor r twice 2 ln r: alike below r = e
    for r, partners in ((2.65, {0: 1, 1: 0}), (2.8, {0: 0, 1: 1})):
        exact = modes_of([1.0, r], [one, other], [one, other])
        crossed = modes_of([1.0, r], [other, one], [other, one])
        assert pairs_of_modes(exact, crossed, kept, mass) == partners
    # one is left for two: the kept one has it
    single = modes_of([1.1], [one], [one])
    assert pairs_of_modes(exact, single, np.array([False, True]), mass) == {1: 0}


@pytest.mark.parametrize(("off", "still"), [(0.46, 0), (0.54, 1)])
def test_a_mode_that_moves_the_craft_is_half_a_log_unit_from_one_that_does_not(off, still):
    """One exact mode moves the craft, and of two in MuJoCo one does, which is farther off."""
    mass = np.diag([4.0, 1e-12])
    exact = modes_of([1.0], [[0.5, 0.0]], [[1.0]])
    ours = modes_of([1.0, np.exp(off)], [[0.0, 0.7], [0.5, 0.0]], [[1.0], [1.0]])
    pairs = pairs_of_modes(exact, ours, np.array([True]), mass)
    assert pairs == {0: 1 - still}


def test_modes_of_one_frequency_may_mix():
    mixed = np.array([[1.0, 1.0], [1.0, -1.0]]) / np.sqrt(2.0)
    exact = modes_of([1.0, 1.0], np.eye(2), np.eye(2))
    ours = modes_of([1.0, 1.0], mixed, np.full((2, 2), 0.5))
    assert set(pairs_of_modes(exact, ours, np.array([True, True]), np.eye(2))) == {0, 1}
    assert clusters(np.array([1.0, 1.0 + 1e-9, 2.0, 3.0])).tolist() == [0, 0, 1, 2]


def test_energy_of_a_mode_is_shared_among_the_parts_that_strain():
    energy = np.array([[1.0, 0.0], [2.0, 1.0], [1.0, 4.0]])
    found = shares_of_energy(energy, [np.array([0, 1]), np.array([2])])
    assert found == pytest.approx(np.array([[0.75, 0.2], [0.25, 0.8]]))


@pytest.mark.parametrize(
    ("momenta", "words"),
    [
        ([[1, 0.1, 0], [2, 0, 0]], " in phase"),
        ([[0.1, 0, 0], [0.2, 0, 0]], " in phase"),
        ([[0, 0, 0], [2, 0, 0]], ""),
        ([[1, 0.1, 0], [-2, 0, 0]], " opposed"),
        ([[1, 0, 0], [0, 2, 0]], ""),
        ([[1, 0, 0]], ""),
    ],
)
def test_whether_two_appendages_move_the_same_way(momenta, words):
    assert phase_of_two(np.array(momenta, float)) == words


def test_a_mode_is_of_the_port_in_which_its_strongest_cantilever_mode_participates():
    rows = np.array([[0.1, 0.9, 0, 0, 0, 0.4], [0, 0, 0.2, 0.5, -0.1, 0]])
    model = bc.PortModel(np.diag([4.0, 4.0, 4.0, 0.3, 2.0, 2.0]), np.array([2.0, 5.0]), rows)
    assert port_of_mode(model, np.array([1.0, 0.3])) == "xy"  # energies 4 and 2.25
    assert port_of_mode(model, np.array([1.0, 0.5])) == "torsion"  # 4 and 6.25
    # by squares of what it moves per root of the mass: 0.32 in bending and 0.36 in torsion
    row = [0.0, 0.8, 0.0, 0.6 * np.sqrt(0.3), 0.0, 0.4 * np.sqrt(2.0)]
    both = model.replaced(participation=[row, np.zeros(6)])
    assert port_of_mode(both, np.array([1.0, 0.0])) == "torsion"
    found = momentum_of_mode(model, np.array([2.0, 3.0]), "xy")
    assert found == pytest.approx(2.0 * rows[0, :3] + 3.0 * rows[1, :3])
    found = momentum_of_mode(model, np.array([2.0, 3.0]), "torsion")
    assert found == pytest.approx(2.0 * rows[0, 3:] + 3.0 * rows[1, 3:])


# -- bent lines ------------------------------------------------------------------------------------
@pytest.mark.parametrize("size", [0.0, 1e-6, 1e-3, 2.0, 3.1])
def test_rotations_by_vectors(size):
    vectors = size * np.array([[2.0, -1.0, 2.0], [0.0, 3.0, 0.0]]) / 3.0
    wanted = Rotation.from_rotvec(vectors).as_matrix()
    np.testing.assert_allclose(turned_by(vectors), wanted, atol=1e-14)


def test_motion_slope_and_curvature_of_cubic_modes():
    """Splines give cubics back, one to either side of a hinge line."""
    at = np.linspace(0.1, 3.0, 30)

    def cubic(x, derivative=0):
        inner = np.poly1d([0.2, -0.5, 0.0, 0.0])
        kink = np.poly1d([0.4, 0.7, -0.3, 0.0])  # from the hinge at 1
        for _ in range(derivative):
            inner, kink = inner.deriv(), kink.deriv()
        return inner(x) + np.where(x > 1.0 + 1e-9, kink(x - 1.0), 0.0)

    moved = np.sqrt(np.linspace(1.0, 2.0, 30))
    model = SimpleNamespace(
        shapes=SimpleNamespace(x=at, moved=moved, values=(moved * cubic(at))[None])
    )
    x = np.array([0.0, 0.5, 1.0, 1.7, 3.0])
    motion, slope, bend = motion_of_modes(model, x, [0.0, 1.0, 3.0])
    np.testing.assert_allclose(motion[0], cubic(x), atol=1e-12)
    np.testing.assert_allclose(slope[0], cubic(x, 1), atol=1e-11)
    np.testing.assert_allclose(bend[0], cubic((x[1:] + x[:-1]) / 2.0, 2), atol=1e-9)


@pytest.mark.parametrize("off", [-0.5e-9, 0.0, 0.5e-9])
def test_a_hinge_line_belongs_to_the_cubics_on_both_sides(off):
    """Four points, of which two stand on hinge lines as far as rounding goes, make each cubic."""
    breaks = np.array([0.0, 1.0, 2.5, 4.0])

    def bent(x):
        behind = [np.maximum(x - line, 0.0) for line in breaks[1:-1]]
        return 0.2 * x**3 - 0.5 * x + sum(y - 0.8 * y**3 for y in behind)

    lines = breaks[1:-1] + 4.0 * off
    inner = np.concatenate([np.linspace(a, b, 4)[1:3] for a, b in pairwise(breaks)])
    at = np.sort(np.concatenate([inner, lines, breaks[-1:]]))
    model = SimpleNamespace(
        shapes=SimpleNamespace(x=at, moved=np.ones(at.size), values=bent(at)[None])
    )
    x = np.array([2e-9, 0.4, *(breaks[1:-1] - 4.0 * off), 3.1, 4.0])
    motion, slope, _ = motion_of_modes(model, x, breaks.tolist())
    assert motion[0] == pytest.approx(bent(x), abs=1e-7)
    # a line's own slope is that before it
    before = x - 1e-5 * (x > 1.0 - 1e-6)
    assert slope[0] == pytest.approx((bent(before + 1e-6) - bent(before - 1e-6)) / 2e-6, abs=1e-3)


@pytest.mark.parametrize("port", ["xy", "xz", "torsion"])
def test_a_line_that_bends_in_a_cantilever_s_first_mode(port):
    length, side, density = 3.0, 0.04, 2700.0
    beam = bc.Beam(
        segments=[
            bc.Segment(
                length=length,
                section=bc.Rectangle(width_y=side, width_z=side),
                material=bc.Material(youngs_modulus=7e10, density=density),
            )
        ]
    )
    mass = density * side**2
    rigid = beam.rigid_mass()
    model = beam.port(port, 3, [1.5, length])
    line = bent_line(beam, {port: model}, rigid, [1.5, length], 50.0)
    assert np.sum(line.masses) == pytest.approx(mass * length)
    assert line.lengths == pytest.approx(np.full(40, length / 40))
    assert line.masses == pytest.approx(mass * line.lengths)
    assert line.centres == pytest.approx(line.lengths / 2.0)
    polar, across = mass * side**2 / 6.0 * line.lengths, mass * line.lengths**3 / 12.0
    assert line.inertias[:, 0, 0] == pytest.approx(polar)
    assert line.inertias[:, 1, 1] == pytest.approx(across)
    assert line.inertias[:, 2, 2] == pytest.approx(across)
    eta = np.zeros((1, line.model.modes))
    eta[0, 0] = 1e-4
    axes, ends, centres = line.bent(eta)
    x = np.cumsum(line.lengths)
    if port == "torsion":
        # sin(pi x / 2 L), mass-normalised by the polar inertia per length
        turn = np.sin(np.pi * x / (2.0 * length)) * np.sqrt(2.0 / (mass * side**2 / 6.0 * length))
        found = np.arctan2(axes[0, :, 2, 1], axes[0, :, 1, 1])
        middle = np.sin(np.pi * (x - length / 80) / (2.0 * length)) / np.sin(
            np.pi * x / (2.0 * length)
        )
        assert np.abs(found) == pytest.approx(1e-4 * turn * middle, rel=1e-3)
        assert ends[0, :, 0] == pytest.approx(x)
        return
    root = 1.8751040687 / length
    ratio = (np.cosh(1.8751040687) + np.cos(1.8751040687)) / (
        np.sinh(1.8751040687) + np.sin(1.8751040687)
    )
    shape = np.cosh(root * x) - np.cos(root * x) - ratio * (np.sinh(root * x) - np.sin(root * x))
    column = 1 if port == "xy" else 2
    wanted = 1e-4 * shape / np.sqrt(mass * length)
    assert np.abs(ends[0, :, column]) == pytest.approx(wanted, rel=1e-3, abs=1e-9)
    assert np.max(np.abs(ends[0, :, 3 - column])) < 1e-12
    halfway = (ends[0] + np.vstack([np.zeros(3), ends[0, :-1]])) / 2.0
    assert centres[0] == pytest.approx(halfway, abs=1e-12)
    # a port between cells has the slope of the mode there
    for number, (place, cell) in enumerate(((1.5, 19), (length, 39))):
        where, turned = line.port(number, axes, ends, eta)
        rise = np.sinh(root * place) + np.sin(root * place)
        rise -= ratio * (np.cosh(root * place) - np.cos(root * place))
        slope = 1e-4 * root * rise / np.sqrt(mass * length)
        assert np.abs(turned[0, column, 0]) == pytest.approx(slope, rel=1e-3)
        assert where[0] == pytest.approx(ends[0, cell])


def test_an_arc_has_a_shorter_chord():
    # a cell of length h that bends by t: the chord 2 sin(t / 2) h / t
    nothing = np.zeros((1, 1, 3))
    bows = nothing.copy()
    bows[0, 0, 2] = 0.2
    line = BentLine(
        None, np.zeros(1, int), np.array([2.0]), np.ones(1), np.array([1.0]),
        np.eye(3)[None], nothing, np.array([[0.3]]), bows, (), np.ones(1),
    )  # fmt: skip
    _, ends, _ = line.bent(np.array([[1.0]]))
    assert ends[0, 0, 0] == pytest.approx(2.0 * np.sin(0.1) / 0.1 + 0.3, rel=1e-5)
