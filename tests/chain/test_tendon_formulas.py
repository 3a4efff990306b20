"""Conditions by which modal tendons are known beside their formulas: what makes modes these modes,
what makes a nearest one nearest, fillers of one motion by hand."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import nnls

from beamchain.errors import RealisationError
from formulas import (
    Chain,
    Hinge,
    Link,
    ModeGroup,
    Shapes,
    Tendon,
    armatures_of,
    damped_modes,
    fillers_of,
    given_modes,
    joint_damping,
    modal_matrix,
    nearest_flexibility,
    nearest_turn,
    next_pace,
    port_rows,
    springs_as_modes,
    stiffen_attachments,
    unfelt_motions,
)

ROUNDED = 1e-12


def group(rows, frequencies=None, **more):
    w = np.arange(1.0, 1.0 + len(rows)) if frequencies is None else np.array(frequencies)
    return ModeGroup(("xy",), w, np.array(rows), np.zeros(len(rows)), **more)


# -- groups ----------------------------------------------------------------------------------------
def test_flexibility_of_modes_above_and_close_to_a_frequency():
    modes = group([[1.0, 2.0], [3.0, 4.0]], [5.0, 2.0])
    assert modes.last == 5.0
    assert group([[1.0], [1.0], [1.0]], [1.0, 2.0, 9.0], normal=2).last == 2.0
    # 25 - 9, and half of 4 instead of 4 - 9
    found = modes.yielding(3.0)
    assert found == pytest.approx(np.array([[0.25, 0.5], [3.0 / 2**0.5, 4.0 / 2**0.5]]))


def test_ports_that_no_mode_moves_get_no_hinges():
    modes = ModeGroup(("xy", "xz"), np.ones(1), np.ones((1, 4)), np.zeros(1))
    assert modes.moving == ("xy", "xz")
    weighed = ModeGroup(
        ("xy", "xz"), np.ones(1), np.ones((1, 4)), np.zeros(1), weights={"xy": 0.0, "xz": 1.0}
    )
    assert weighed.moving == ("xz",)


def test_momenta_are_those_of_the_shapes_at_the_hinges():
    x, one = np.array([1.0, 3.0]), np.ones(2)
    shapes = Shapes(x, np.array([0.5, 0.7]), 0.0 * one, np.array([[1.0, 2.0]]), bending=True)
    found = group([[1.0, 1.0]], shapes=shapes).on(np.array([0.5, 2.0]))
    assert found.momenta == pytest.approx(np.array([[0.25 + 3.5, 1.4]]))


def test_participation_that_fits_another_rigid_mass_has_the_same_shares_of_it():
    file = np.array([[2.0, 0.6], [0.6, 3.0]])
    bodies = np.array([[1.9, 0.5], [0.5, 3.2]])
    rows = np.linalg.cholesky(file).T * np.array([[0.9999], [0.3]])
    rows = np.column_stack([rows, [7.0, 8.0]])  # a motion of a further port
    found = group(rows, rigid=file).fitting(bodies)
    shares = eigh(rows[:, :2].T @ rows[:, :2], file, eigvals_only=True)
    own = found.rows[:, :2].T @ found.rows[:, :2]
    assert eigh(own, bodies, eigvals_only=True) == pytest.approx(shares, rel=1e-9)
    assert found.rows[:, 2].tolist() == [7.0, 8.0]
    assert found.rigid is bodies
    # a motion alone: by the root of the masses
    alone = group([[1.999**0.5]], rigid=np.array([[2.0]])).fitting(np.array([[1.9]]))
    assert alone.rows[0, 0] == pytest.approx(np.sqrt(1.999 * 1.9 / 2.0), rel=1e-9)


def test_participation_that_leaves_the_bodies_something_stays():
    file, bodies = np.diag([2.0, 3.0]), np.diag([1.9, 3.0])
    for least, kept in ((1.1e-6, True), (0.9e-6, False)):
        modes = group([[np.sqrt(1.9 * (1.0 - least)), 0.0]], rigid=file)
        assert (modes.fitting(bodies) is modes) is kept
    # or where the bodies are the file's
    full = group([[np.sqrt(2.0), 0.0]], rigid=file)
    for part, kept in ((0.9, True), (-0.9, True), (1.1, False)):
        assert (full.fitting(np.diag([2.0, 3.0 * (1.0 + part * 1e-10)])) is full) is kept
    assert group([[1.0, 0.0]]).fitting(bodies).rigid is None


# -- modes in hinge coordinates --------------------------------------------------------------------
def limp(seed, hinges=5, motions=2):
    """P and Q of a chain, with rows of two modes that it lets go."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(hinges, hinges)) + 2.0 * np.eye(hinges)
    inertia = root @ root.T
    kinematics = random.normal(size=(motions, hinges))
    reached = kinematics @ np.linalg.solve(inertia, kinematics.T)
    mixed = np.linalg.qr(random.normal(size=(motions, motions)))[0]
    rows = np.diag([0.8, 0.4][:motions]) @ mixed @ np.linalg.cholesky(reached).T
    return kinematics, inertia, rows


@pytest.mark.parametrize("guided", [False, True])
@pytest.mark.parametrize("neutral", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_modes_have_unit_mass_and_their_participation(seed, neutral, guided):
    kinematics, inertia, rows = limp(seed)
    momenta = np.random.default_rng(seed).normal(size=(2, 5)) if guided else None
    modes = group(rows, [3.0, 7.0], neutral=neutral, momenta=momenta)
    shapes, armature, frequencies = modal_matrix(kinematics, inertia, modes, (20.0, 30.0))
    whole = shapes.T @ (inertia + armature) @ shapes
    assert whole == pytest.approx(np.eye(5), abs=1e-9)
    assert kinematics @ shapes[:, :2] == pytest.approx(rows.T, abs=1e-9)
    # inertia between the hinges is none that pushes apart
    size = np.sqrt(np.diag(inertia))
    assert np.linalg.eigvalsh(armature / np.outer(size, size))[0] > -1e-9
    assert frequencies[:2].tolist() == [3.0, 7.0]
    assert np.all((frequencies[2:] >= 20.0 - 1e-9) & (frequencies[2:] <= 30.0 + 1e-9))
    if neutral:
        felt = kinematics @ shapes[:, 2:]
        assert felt == pytest.approx(np.zeros((2, 3)), abs=1e-9)


def test_modes_that_take_all_that_is_let_go_need_no_armature():
    """As many hinges as the root has motions: the modes are those of the bodies."""
    kinematics, inertia, _ = limp(4, hinges=2)
    reached = kinematics @ np.linalg.solve(inertia, kinematics.T)
    rows = np.linalg.cholesky(reached).T
    shapes, armature, _ = modal_matrix(kinematics, inertia, group(rows), (20.0, 30.0))
    assert armature == pytest.approx(np.zeros((2, 2)), abs=1e-9)
    assert kinematics @ shapes == pytest.approx(rows.T, abs=1e-9)
    for part, held in ((1.0 - 1e-7, True), (1.0 + 1e-7, False)):
        if held:
            modal_matrix(kinematics, inertia, group(part * rows), (20.0, 30.0))
        else:
            with pytest.raises(RealisationError, match="times the mass that the limp chain lets"):
                modal_matrix(kinematics, inertia, group(part * rows), (20.0, 30.0))


def test_a_motion_that_no_hinge_makes_takes_no_part():
    kinematics, inertia, rows = limp(2)
    more, none = np.vstack([kinematics, np.zeros(5)]), np.zeros((2, 1))
    shapes, armature, _ = modal_matrix(more, inertia, group(np.hstack([rows, none])), (20.0, 30.0))
    assert more @ shapes[:, :2] == pytest.approx(np.hstack([rows, none]).T, abs=1e-9)
    assert shapes.T @ (inertia + armature) @ shapes == pytest.approx(np.eye(5), abs=1e-9)


@pytest.mark.parametrize("size", [1, 3])
@pytest.mark.parametrize("seed", range(4))
def test_no_turn_is_nearer_to_the_real_modes(seed, size):
    """`|Z lift - guide|` is convex: nearest where the slope leads out of `|Z| <= 1`."""
    random = np.random.default_rng(seed)
    root = random.uniform(0.3, 1.0, 3)
    vectors = np.linalg.qr(random.normal(size=(3, 3)))[0]
    lift = (vectors * root) @ vectors.T
    guide = random.normal(size=(size, 3))
    z = nearest_turn(lift, np.zeros((3, 0)), size, guide)
    assert np.linalg.norm(z, 2) <= 1.0 + 1e-9
    slope = (z @ lift - guide) @ lift
    least = -np.sum(np.linalg.svd(slope, compute_uv=False))
    assert np.sum(slope * z) == pytest.approx(least, abs=1e-5)


def test_paces_of_projected_gradients_are_nesterov_s():
    """t'^2 - t' = t^2: the golden ratio is behind 1, and 4.8 behind the root of 4.8^2 - 4.8."""
    golden = (1.0 + 5.0**0.5) / 2.0
    assert next_pace(1.0) == pytest.approx((golden, 0.0))
    assert next_pace(18.24**0.5) == pytest.approx((4.8, (18.24**0.5 - 1.0) / 4.8))


def test_no_turn_is_flat_where_the_root_is_blind():
    """0.3 at least of a combination that the root does not see; what is above stays."""
    free = np.array([[0.6], [0.8], [0.0]])
    guide = 0.1 * np.outer([1.0, 0.0], free[:, 0]) + np.outer([0.0, 0.5], [0.8, -0.6, 0.0])
    z = nearest_turn(np.eye(3), free, 2, guide)
    assert z == pytest.approx(guide + 0.2 * np.outer([1.0, 0.0], free[:, 0]), abs=1e-6)
    steep = nearest_turn(np.eye(3), free, 2, 4.0 * guide)
    # 0.4 and 2, which is cut
    assert steep == pytest.approx(
        0.4 * np.outer([1.0, 0.0], free[:, 0]) + np.outer([0.0, 1.0], [0.8, -0.6, 0.0]), abs=1e-6
    )
    # without real modes: an isometry that takes what is not seen first
    plain = nearest_turn(np.eye(3), free, 2, None)
    assert plain @ plain.T == pytest.approx(np.eye(2), abs=1e-12)
    assert plain @ free == pytest.approx(np.array([[1.0], [0.0]]), abs=1e-12)
    assert nearest_turn(np.eye(3), free, 4, None) @ free == pytest.approx(
        np.array([[1.0], [0.0], [0.0], [0.0]]), abs=1e-12
    )


# -- fillers ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("seed", range(4))
def test_no_flexibility_is_nearer_to_what_is_wanted(seed):
    """Convex: nearest where the slope leads out of `0 <= S <= 1`."""
    random = np.random.default_rng(seed)
    felt = random.normal(size=(4, 3))
    wanted = random.normal(size=(4, 4))
    wanted = 2.0 * (wanted + wanted.T)
    share = nearest_flexibility(felt, wanted)
    values = np.linalg.eigvalsh(share)
    assert values[0] >= -1e-12
    assert values[-1] <= 1.0 + 1e-12
    slope = felt.T @ (felt @ share @ felt.T - wanted) @ felt
    least = np.sum(np.minimum(np.linalg.eigvalsh(slope), 0.0))
    assert np.sum(slope * share) == pytest.approx(least, abs=1e-4 * np.linalg.norm(slope))


def test_a_flexibility_that_can_be_had_is_had():
    felt = np.array([[1.0, 0.3], [0.2, 2.0], [0.5, -0.4]])
    share = np.array([[0.5, 0.1], [0.1, 0.4]])
    found = nearest_flexibility(felt, felt @ share @ felt.T)
    assert found == pytest.approx(share, abs=1e-7)


@pytest.mark.parametrize(
    ("wanted", "frequency", "felt"),
    [
        # of 1.8 that is felt by a motion of 2; W^2 - 9 from 7 to 40, so that 40 / 7 are 1
        (5.0, 4.0, 1.8),  # more than all
        (1.8, 4.0, 1.8),
        (1.2, np.sqrt(9.0 + 7.0 * (1.8 / 1.2) ** 2), 1.8),
        (1.8 * np.sqrt(7.0 / 40.0), 7.0, 1.8),
        (0.5, 7.0, 0.5 * np.sqrt(40.0 / 7.0)),  # less of it, at the highest frequency
        (0.001, 7.0, 0.01),  # but the least
    ],
)
def test_a_filler_is_as_flexible_as_what_is_left_out(wanted, frequency, felt):
    """Felt `f` at `w`: `f^2 / (w^2 - 9) = wanted^2 / 7`."""
    beyond = np.array([[wanted / np.sqrt(7.0)], [0.0]])
    turn, frequencies = fillers_of(
        np.array([[2.0, 0.0], [0.0, 0.0]]), beyond, 3.0, (4.0, 7.0), least=0.01
    )
    assert frequencies == pytest.approx([frequency, 7.0], rel=1e-6)
    assert 2.0 * np.abs(turn[0]) == pytest.approx([felt, 0.0], rel=1e-6)
    assert np.abs(turn[1]) == pytest.approx([0.0, 1.0])


def test_a_filler_that_is_not_felt_stays_at_the_highest():
    for size, moves in ((1.1e-9, True), (0.9e-9, False)):
        turn, frequencies = fillers_of(
            np.array([[size]]), np.array([[1.0]]), 3.0, (4.0, 7.0), least=0.01
        )
        assert frequencies == pytest.approx([4.0 if moves else 7.0])
        assert np.abs(turn) == pytest.approx(np.array([[0.9 if moves else 1.0]]))


def test_motions_that_the_root_does_not_feel_beside_modes():
    random = np.random.default_rng(6)
    basis = np.linalg.qr(random.normal(size=(6, 6)))[0]
    seen, unseen = basis[:, :2], basis[:, 2:]
    u = 0.8 * np.linalg.qr(random.normal(size=(6, 2)))[0]
    for count in (1, 4):
        found = unfelt_motions(u, seen, unseen, count)
        assert found.shape == (6, count)
        assert seen.T @ found == pytest.approx(np.zeros((2, count)), abs=1e-12)
        # beside the modes there is room for them: u u^T + v v^T <= 1
        assert np.linalg.eigvalsh(u @ u.T + found @ found.T)[-1] <= 1.0 + 1e-9
        # and none for more along any of them
        more = found * 1.001
        assert np.linalg.eigvalsh(u @ u.T + more @ more.T)[-1] > 1.0
    # that which may be longest comes first: beside the modes one may be whole
    for k in (1, 3):
        longest = np.sum(unfelt_motions(u, seen, unseen, k) ** 2, axis=0)
        assert longest[0] == pytest.approx(1.0)
        assert np.all(np.diff(longest) <= 1e-12)
    # modes of full length leave no room in their own directions
    full = np.column_stack([unseen[:, 0], unseen[:, 1]])
    assert unfelt_motions(full, seen, unseen, 4).shape == (6, 2)


def test_attachments_are_stiffer_by_what_fillers_yield():
    """The flexibility of the port, `sum u u^T / W^2` of attachments and fillers, stays."""
    random = np.random.default_rng(2)
    shapes, moved = random.normal(size=(6, 6)), random.normal(size=(2, 6))
    w = np.array([1.0, 2.0, 3.0, 4.0, 50.0, 60.0])
    new, frequencies = stiffen_attachments(shapes, w, moved, 4)
    turn = np.linalg.lstsq(shapes[:, 2:4], new[:, 2:4], rcond=None)[0]
    assert turn @ turn.T == pytest.approx(np.eye(2), abs=1e-9)
    own = moved[:, 2:4] @ turn
    fillers = (moved[:, 4:] / w[4:] ** 2) @ moved[:, 4:].T
    wanted = (moved[:, 2:4] / w[2:4] ** 2) @ moved[:, 2:4].T
    assert (own / frequencies[2:4] ** 2) @ own.T + fillers == pytest.approx(wanted, rel=1e-9)
    assert np.array_equal(new[:, [0, 1, 4, 5]], shapes[:, [0, 1, 4, 5]])
    assert frequencies[[0, 1, 4, 5]].tolist() == [1.0, 2.0, 50.0, 60.0]
    # fillers that yield more than there is
    soft = np.array([1.0, 2.0, 3.0, 4.0, 0.5, 0.6])
    assert np.array_equal(stiffen_attachments(shapes, soft, moved, 4)[1], soft)


def _inertia_of(tendons, freedoms):
    """`(f, f)` that the armature of tendons adds between hinges."""
    rows = np.zeros((len(tendons), len(freedoms)))
    for row, tendon in zip(rows, tendons, strict=True):
        row[[freedoms.index(f) for f in tendon.freedoms]] = tendon.coefficients
    return rows.T * [t.armature for t in tendons] @ rows


def test_armatures_add_up_to_the_inertia_between_hinges():
    random = np.random.default_rng(3)
    root = random.normal(size=(3, 3))
    inertia = root @ root.T + np.eye(3)
    thin = random.normal(size=(3, 2))
    armature = thin @ thin.T
    freedoms = ((0, "xy"), (1, "xy"), (2, "xy"))
    found = armatures_of(freedoms, armature, inertia)
    assert [t.freedoms for t in found] == [freedoms, freedoms[:2]]
    assert _inertia_of(found, freedoms) == pytest.approx(armature, abs=1e-9)
    for part, count in ((1.1e-13, 1), (0.9e-13, 0)):
        slight = part * np.outer(inertia[0], inertia[0]) / inertia[0, 0]
        assert len(armatures_of(freedoms, slight, inertia)) == count


# -- tendons of a chain ----------------------------------------------------------------------------
LINKS = tuple(Link(1.0 * k, 1.0, 2.0 + k, k + 0.5, (0.1, 0.2, 0.3)) for k in range(3))
SPRINGS = (5.0, 3.0)
CHAIN = Chain(
    LINKS, tuple(Hinge(x, {"xy": c}) for x, c in zip((1.0, 2.0), SPRINGS, strict=True)), 3.0
)
FREEDOMS = ((0, "xy"), (1, "xy"))
# links of 3 and 4 kg behind hinges at 1 and 2 m
MASS = np.array(
    [[0.6 + 3.0 * 0.25 + 4.0 * 2.25, 0.3 + 4.0 * 0.75], [0.3 + 4.0 * 0.75, 0.3 + 4.0 * 0.25]]
)


def test_motion_of_a_point_per_hinge_before_it():
    motion = np.eye(6)[:, [1, 5]]
    assert port_rows(CHAIN, FREEDOMS, motion, 2.5) == pytest.approx(
        np.array([[1.5, 0.5], [1.0, 1.0]])
    )
    assert port_rows(CHAIN, FREEDOMS, motion, 2.0) == pytest.approx(
        np.array([[1.0, 0.0], [1.0, 0.0]])
    )
    assert port_rows(CHAIN, (), motion, 2.0).shape == (2, 0)


def test_motion_of_a_point_in_all_directions():
    """0.7 m beyond the second hinge, 1.7 m beyond the first; a rotation about -y moves to z."""
    hinges = (Hinge(1.0, {"xy": 1.0, "torsion": 2.0}), Hinge(2.0, {"xz": 1.0}))
    found = port_rows(
        Chain(LINKS, hinges, 3.0), ((0, "xy"), (0, "torsion"), (1, "xz")), np.eye(6), 2.7
    )
    bent, twisted, lifted = found.T
    assert bent == pytest.approx([0.0, 1.7, 0.0, 0.0, 0.0, 1.0])
    assert twisted == pytest.approx([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    assert lifted == pytest.approx([0.0, 0.0, 0.7, 0.0, -1.0, 0.0])


def test_springs_as_modes_are_the_same_springs():
    squares, shapes = eigh(np.diag(SPRINGS), MASS)
    ratios = np.array([0.02, 0.05])
    found = springs_as_modes(CHAIN, {"xy": ratios})
    assert [dict(h.stiffness) for h in found.hinges] == [{"xy": 0.0}] * 2
    assert [t.label for t in found.tendons] == ["mode1_xy", "mode2_xy"]
    assert [t.stiffness for t in found.tendons] == pytest.approx(squares, rel=1e-9)
    assert found.stiffness(FREEDOMS) == pytest.approx(np.diag(SPRINGS), abs=1e-9)
    rates = shapes.T @ found.damping(FREEDOMS) @ shapes
    assert rates == pytest.approx(np.diag(2.0 * ratios * np.sqrt(squares)), abs=1e-9)


def test_damped_modes_keep_the_springs():
    squares, shapes = eigh(np.diag(SPRINGS), MASS)
    for ratios, labels in (
        ([0.02, 0.05], ["mode1_xy", "mode2_xy"]),
        ([0.0, 0.05], ["mode2_xy"]),
        ([0.02], ["mode1_xy"]),
    ):
        found = damped_modes(CHAIN, {"xy": np.array(ratios)})
        assert found.hinges == CHAIN.hinges
        assert [t.label for t in found.tendons] == labels
        rates = np.zeros(2)
        rates[: len(ratios)] = 2.0 * np.array(ratios) * np.sqrt(squares[: len(ratios)])
        assert shapes.T @ found.damping(FREEDOMS) @ shapes == pytest.approx(
            np.diag(rates), abs=1e-9
        )
        assert found.stiffness(FREEDOMS) == pytest.approx(np.diag(SPRINGS))
    tied = damped_modes(
        Chain(LINKS, CHAIN.hinges, 3.0, tendons=(Tendon("own", (), np.ones(0)),)), {}
    )
    assert [t.label for t in tied.tendons] == ["own"]


@pytest.mark.parametrize("ratios", [(0.02, 0.05), (0.05, 0.001), (0.0, 0.05)])
def test_dampers_at_the_hinges_have_the_least_error_of_the_ratios(ratios):
    """Of a mode without damping over the largest rate that is wanted."""
    squares, shapes = eigh(np.diag(SPRINGS), MASS)
    wanted = 2.0 * np.array(ratios) * np.sqrt(squares)
    size = np.where(wanted > 0.0, wanted, wanted.max())
    best, _ = nnls(shapes.T**2 / size[:, None], wanted / size)
    found = joint_damping(CHAIN, "xy", np.array([*ratios, 0.5]))
    assert [h.damping["xy"] for h in found.hinges] == pytest.approx(best, rel=1e-9)
    assert joint_damping(CHAIN, "xy", np.zeros(2)) is CHAIN


def test_the_damper_of_one_hinge_is_that_of_an_oscillator():
    chain = Chain(LINKS[:2], (Hinge(1.0, {"xy": 5.0}, {"xz": 0.7}),), 2.0)
    inertia = 0.3 + 3.0 * 0.25
    found = joint_damping(chain, "xy", np.array([0.03]))
    assert dict(found.hinges[0].damping) == {
        "xz": 0.7,
        "xy": pytest.approx(2.0 * 0.03 * np.sqrt(5.0 * inertia), rel=1e-9),
    }


@pytest.mark.parametrize(
    ("normal", "band", "wanted"),
    [
        (3, 0.0, 2.6 * 9.0),
        (3, 12.0, 2.0 * 12.0),
        (1, 0.0, 9.0),  # as high as static responses, which set the step
        (2, 0.0, 2.6 * 4.0),
    ],
)
def test_fillers_of_what_is_not_known_stand_above_the_modes_and_the_band(normal, band, wanted):
    links = tuple(Link(1.0 * k, 1.0, 2.0 + k, k + 0.5, (0.1, 0.2, 0.3)) for k in range(5))
    loose = Chain(links, tuple(Hinge(k, {"xy": 0.0}) for k in (1.0, 2.0, 3.0, 4.0)), 5.0)
    rows = np.array([[0.5, 0.9], [0.2, -0.1], [0.1, 0.2]])
    w, ratios = np.array([2.0, 4.0, 9.0]), np.array([0.02, 0.0, 0.0])
    modes = ModeGroup(("xy",), w, rows, ratios, normal=normal, band=band)
    found = given_modes(loose, [modes], ratio=0.05)
    sprung = {t.label: t for t in found.tendons if t.stiffness}
    filler = sprung.pop("filler1_xy")
    assert filler.stiffness == pytest.approx(wanted**2, rel=1e-9)
    assert filler.damping == pytest.approx(2.0 * 0.05 * wanted, rel=1e-9)
    assert [t.stiffness for t in sprung.values()] == pytest.approx(w**2, rel=1e-9)


def test_a_tendon_over_some_hinges_does_not_pull_the_others():
    tied = Chain(LINKS, CHAIN.hinges, 3.0, tendons=(Tendon("own", FREEDOMS[1:], np.ones(1), 7.0),))
    assert tied.stiffness(FREEDOMS) == pytest.approx(np.diag([5.0, 3.0 + 7.0]))
    soft = Chain(LINKS, tuple(Hinge(x, {"xy": 1e-3 * x}) for x in (1.0, 2.0)), 3.0)
    assert soft.stiffness(FREEDOMS) == pytest.approx(np.diag([1e-3, 2e-3]))


def test_modes_that_are_given_are_damped_and_stand_in_the_chain():
    """w^2 and 2 zeta w on tendons; with the inertia between hinges, the modes are these."""
    limp_chain = Chain(LINKS, tuple(Hinge(x, {"xy": 0.0}) for x in (1.0, 2.0)), 3.0)
    rows, w, ratios = np.array([[0.5, 0.9], [0.2, -0.1]]), np.array([2.0, 7.0]), [0.02, 0.05]
    modes = ModeGroup(("xy",), w, rows, np.array(ratios))
    found = given_modes(limp_chain, [modes])
    assert found.stiffness(FREEDOMS).shape == (2, 2)
    across = _inertia_of([t for t in found.tendons if t.armature], FREEDOMS)
    squares, shapes = eigh(found.stiffness(FREEDOMS), MASS + across)
    assert np.sqrt(squares) == pytest.approx(w, rel=1e-9)
    rates = shapes.T @ found.damping(FREEDOMS) @ shapes
    assert rates == pytest.approx(np.diag(2.0 * np.array(ratios) * w), abs=1e-9)
    numbered = [t.label for t in found.tendons if t.armature]
    assert numbered == [f"armature{k + 1}" for k in range(len(numbered))]
    assert numbered
