"""Closed forms beside the formulas of a craft."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import beamchain as bc
from formulas import (
    ModalForm,
    ModesOfCraft,
    Reference,
    Seen,
    SlewBody,
    apart,
    check_inertia,
    clusters,
    equal_parts,
    load_of_modes_left_out,
    modes_finely_divided,
    momentum_of_mode,
    pairs_of_modes,
    phase_of_two,
    port_of_mode,
    shares_of_energy,
    slow_modes,
    turns_of_hinge,
)


def test_centrifugal_load_of_axial_modes_left_out():
    # turning at w, a point at x is accelerated by -(w_y^2 + w_z^2) x along x
    inside = SimpleNamespace(
        drive=np.array([[0.2, 5.0]]),  # of acceleration, and of that per metre
        drive_carried=np.zeros((1, 0)),
        momentum=np.array([[[7.0]]]),
        left_out=np.array([[[0.0, 3.0]]]),
        left_out_carried=np.zeros((1, 1, 0)),
    )
    spin = np.array([[9.0, 0.3, 0.4], [0.0, 0.0, 2.0]])
    felt, carried = np.zeros((2, 6)), np.zeros((2, 0, 6))
    load, shift = load_of_modes_left_out("axial", inside, felt, spin, carried)
    away = np.array([-0.25, -4.0])
    assert load[:, 0, 0] == pytest.approx(away * 5.0 * 7.0, rel=1e-14)
    assert shift[:, 0, 0] == pytest.approx(away * 3.0, rel=1e-14)


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
        with pytest.raises(bc.InputError, match="bus.*3, 4, 7.1"):
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
    found = momentum_of_mode(model, np.array([2.0, 3.0]), "xy")
    assert found == pytest.approx(2.0 * rows[0, :3] + 3.0 * rows[1, :3])
    found = momentum_of_mode(model, np.array([2.0, 3.0]), "torsion")
    assert found == pytest.approx(2.0 * rows[0, 3:] + 3.0 * rows[1, 3:])
