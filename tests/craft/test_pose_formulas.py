"""Closed forms beside the promise of a craft: damping at which it is compared, its peaks, what
grows, and the exact answer at a pose, by matrices written out here."""

from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.linalg import block_diag, eigh

import beamchain as bc
from formulas import (
    LoadOfPort,
    PlacedBody,
    Pose,
    counterpart,
    coupled_modes,
    exact_craft,
    extra_damping,
    growth,
    lacking_damping,
    load_on_exact,
    mode_words,
    mount,
    mounts_by_base,
    peaks_of_craft,
)

RNG = np.random.default_rng(11)


def by_modes(shapes, values):
    """`S^-T diag(values) S^-1`."""
    inverse = np.linalg.inv(shapes)
    return inverse.T @ np.diag(values) @ inverse


# -- damping at which it is compared ---------------------------------------------------------------
@pytest.mark.parametrize("undamped", [0.005, 0.03])
def test_modes_get_the_damping_that_they_lack(undamped):
    """Rigid, undamped, hardly damped and damped: none has less than 1e-5, the undamped theirs."""
    shapes = np.eye(4) + 0.3 * RNG.standard_normal((4, 4))
    w = np.array([0.0, 3.0, 5.0, 11.0])
    ratios = np.array([0.0, 0.0, 5e-6, 0.02])
    wanted = np.array([0.0, undamped, 1e-5, 0.02])
    mass, stiffness = by_modes(shapes, np.ones(4)), by_modes(shapes, w**2)
    damping = by_modes(shapes, 2.0 * ratios * w)
    lacks = lacking_damping(stiffness, mass, damping, undamped)
    np.testing.assert_allclose(damping + lacks, by_modes(shapes, 2.0 * wanted * w), atol=1e-7)


@pytest.mark.parametrize("damper", [0.0, 0.4])
def test_a_craft_without_any_damper_gets_half_a_percent(damper):
    """Of two springs one has a damper; beside it the other gets 1e-5."""
    bare = SimpleNamespace(
        mass=np.diag([2.0, 3.0]), stiffness=np.diag([18.0, 48.0]), damping=np.diag([0.0, damper])
    )
    ratio = 1e-5 if damper else 0.005
    wanted = [2.0 * ratio * 3.0 * 2.0, 0.0 if damper else 2.0 * ratio * 4.0 * 3.0]
    np.testing.assert_allclose(extra_damping(bare), np.diag(wanted), atol=1e-12)


# -- peaks and growth ------------------------------------------------------------------------------
def craft_of(mass, damping, stiffness, base):
    acceleration = np.zeros((6, len(mass)))
    acceleration[:, base] = RNG.standard_normal((6, len(base)))
    return SimpleNamespace(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        outputs=SimpleNamespace(acceleration=acceleration),
    )


def poles_of(mass, damping, stiffness):
    n = len(mass)
    bottom = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    return np.linalg.eigvals(np.vstack([np.eye(n, 2 * n, n), bottom]))


def test_peaks_are_those_of_a_free_and_of_a_held_base():
    half = RNG.standard_normal((4, 4))
    mass = half @ half.T + 4.0 * np.eye(4)
    stiffness = np.diag([0.0, 30.0, 70.0, 200.0])
    damping = np.diag([0.0, 0.3, 0.5, 0.9])
    found = peaks_of_craft(craft_of(mass, damping, stiffness, [0, 1]))
    held = np.ix_([2, 3], [2, 3])
    parts = (mass, damping, stiffness), (mass[held], damping[held], stiffness[held])
    poles = np.concatenate([poles_of(*part) for part in parts])
    poles = poles[(poles.imag > 1e-6)]
    assert len(found) >= len(poles) == 5
    for pole in poles:
        wanted = np.array([abs(pole), -pole.real / abs(pole)])
        assert np.min(np.max(np.abs(found / wanted - 1.0), axis=1)) < 1e-6


@pytest.mark.parametrize("lean", [0.0, 40.0])
def test_an_overdamped_motion_peaks_where_its_mode_is_as_well(lean):
    """m = 2, k = 18 and d = 60: poles -0.303 and -29.7 1/s, the mode at 3 rad/s of ratio 5, which
    counts as 1; an unsymmetric part of the stiffness is of poles alone."""
    stiffness = np.diag([18.0, 9800.0])
    stiffness[0, 1], stiffness[1, 0] = lean, -lean
    damping = np.diag([60.0, 2.8])
    craft = craft_of(np.diag([2.0, 2.0]), damping, stiffness, [0, 1])
    found = peaks_of_craft(craft)
    values, _ = eigh(np.diag([18.0, 9800.0]), 2.0 * np.eye(2))
    assert np.sqrt(values) == pytest.approx([3.0, 70.0])
    assert np.min(np.abs(found - [3.0, 1.0]).max(axis=1)) < 1e-9
    for pole in poles_of(2.0 * np.eye(2), damping, stiffness):
        assert np.min(np.abs(found[:, 0] / abs(pole) - 1.0)) < 1e-9


def test_modes_that_dampers_couple_peak_where_they_are_without_them_as_well():
    """m = 2, k = 18 and 50, d = 6 and 9: 3 and 5 rad/s, of d / 2 m w = 0.5 and 0.45."""
    mass, stiffness = 2.0 * np.eye(2), np.diag([18.0, 50.0])
    damping = np.array([[6.0, 5.0], [5.0, 9.0]])
    found = peaks_of_craft(craft_of(mass, damping, stiffness, [0, 1]))
    for wanted in ([3.0, 0.5], [5.0, 0.45]):
        assert np.min(np.abs(found - wanted).max(axis=1)) < 1e-9


@pytest.mark.parametrize(
    ("stiffness", "damping", "reach"),
    [
        ([[18.0, 0.0], [0.0, -5.0]], [0.2, 0.3], 2.0),  # falls
        ([[18.0, 9.0], [-9.0, 18.0]], [0.2, 0.3], 2.0),  # flutters
        ([[18.0, 0.0], [0.0, 5.0]], [0.2, -0.3], 2.0),  # is driven
        ([[18.0, 0.0], [0.0, -0.75]], [0.0, 0.0], 5.0),  # at a tenth of the reach
    ],
)
def test_what_grows_does_at_the_rate_of_its_pole(stiffness, damping, reach):
    mass, damping, stiffness = np.diag([2.0, 3.0]), np.diag(damping), np.array(stiffness)
    craft = craft_of(mass, damping, stiffness, [0])
    wanted = poles_of(mass, damping, stiffness).real.max()
    assert wanted > 0.02
    assert growth(craft, reach) == pytest.approx(wanted, rel=1e-9)


def test_slow_growth_is_rounding_and_what_is_far_beyond_the_reach_is_none():
    """A rate s of m s^2 = k: counted above 1e-4 of the reach and below 1000 of it."""
    for rate, counts in ((0.9e-4, False), (1.1e-4, True), (990.0, True), (1010.0, False)):
        craft = craft_of(np.diag([2.0]), np.zeros((1, 1)), np.array([[-2.0 * rate**2 * 25.0]]), [0])
        found = growth(craft, 5.0)
        assert found == pytest.approx(5.0 * rate if counts else 0.0, rel=1e-6)
    still = craft_of(np.diag([2.0, 3.0]), np.zeros((2, 2)), np.diag([0.0, 8.0]), [0])
    assert growth(still, 5.0) == 0.0


# -- a pose ----------------------------------------------------------------------------------------
CRAFT = """<mujoco><option gravity="0 0 0"/><worldbody>
<body name="bus" pos="0.3 0 0.1" euler="20 -30 40"><freejoint/>
<inertial pos="0.1 -0.05 0.2" mass="60" diaginertia="20 25 30"/>
<site name="left" pos="0.5 0.3 0" euler="10 0 90"/>
<body pos="0 -0.4 0.1"><joint name="drive" axis="0 0.3 1" stiffness="40" damping="0.6"/>
<inertial pos="0.1 0 0" mass="7" diaginertia="0.3 0.4 0.5"/>
<site name="right" pos="0 -0.3 0" euler="0 0 -90"/></body></body></worldbody></mujoco>"""
LENGTH = 4.0
BODY = np.diag([8.0, 8.0, 8.0, 0.6, 42.0, 43.0])
BODY[1, 5] = BODY[5, 1] = 8.0 * 2.0
BODY[2, 4] = BODY[4, 2] = -8.0 * 2.0
ROWS = {
    "left": np.array([[0.0, 2.0, 0.1, 0.0, -0.2, 5.0], [0.1, 0.0, 1.9, 0.2, -4.8, 0.0]]),
    "right": np.array([[0.0, 1.8, 0.0, 0.0, 0.0, 4.7], [0.0, 0.0, 0.2, 0.5, -0.4, 0.0]]),
}
FREQUENCY = {"left": np.array([2.0, 3.1]), "right": np.array([2.6, 9.0])}
RATIO = {"left": np.array([0.01, 0.02]), "right": np.array([0.015, 0.004])}
QPOS = np.array([0.1, 0.2, -0.3, 0.9, 0.2, -0.3, 0.1, 0.35])
NV, BAND = 7, 4.0
MODEL = mujoco.MjModel.from_xml_string(CRAFT)
PLACES = ("left", "right")


def carried(place, **more):
    model = bc.PortModel(BODY, FREQUENCY[place], ROWS[place], damping=RATIO[place])
    at = PLACES.index(place)
    dofs = [NV + 2 * at, NV + 2 * at + 1]
    kept = np.array([True, place == "left"])
    return PlacedBody(mount(MODEL, place, "site", place), model, kept, dofs, {"xy": 2.0}, **more)


def pose(wanted=range(6), own=None):
    return Pose(MODEL, QPOS, [carried(place) for place in PLACES], BAND, wanted, own)


def jacobian(model, data, body, point, axes):
    """`(6, nv)` motion of a point of a body in some axes."""
    both = np.zeros((2, 3, NV))
    mujoco.mj_jac(model, data, both[0], both[1], point, body)
    return np.vstack([axes.T @ both[0], axes.T @ both[1]])


def truth(model=MODEL):
    """Motion of the bus and of both roots, mass matrix, damping and stiffness of it all."""
    data = mujoco.MjData(model)
    data.qpos[:] = QPOS / np.append(np.ones(3), [*np.full(4, np.linalg.norm(QPOS[3:7])), 1.0])
    mujoco.mj_forward(model, data)
    own = np.zeros((NV, NV))
    mujoco.mj_fullM(model, data, own)
    bus = jacobian(model, data, 1, data.xpos[1], data.xmat[1].reshape(3, 3))
    roots = [
        jacobian(model, data, model.site(p).bodyid[0], at.xpos, at.xmat.reshape(3, 3))
        for p in PLACES
        for at in [data.site(p)]
    ]
    rigid = own + sum(root.T @ BODY @ root for root in roots)
    pushed = np.vstack([ROWS[p] @ root for p, root in zip(PLACES, roots, strict=True)])
    mass = np.block([[rigid, pushed.T], [pushed, np.eye(4)]])
    w = np.concatenate([FREQUENCY[p] for p in PLACES])
    z = np.concatenate([RATIO[p] for p in PLACES])
    drive = np.diag([0.0] * 6 + [1.0])
    damping = block_diag(0.6 * drive, np.diag(2.0 * z * w))
    return bus, roots, rigid, mass, damping, block_diag(40.0 * drive, np.diag(w**2))


@pytest.mark.parametrize("wanted", [(0, 1, 2, 3, 4, 5), (1, 5)])
def test_the_exact_answer_at_a_pose(wanted):
    """Accelerance of the bus, each motion by the root of the inertia that it feels, drive held."""
    made = pose(wanted)
    bus, roots, rigid, mass, damping, stiffness = truth()
    for found, root in zip(made.jacobians, roots, strict=True):
        np.testing.assert_allclose(found, root, atol=1e-12)
    felt = np.linalg.inv(bus[:, :6] @ np.linalg.solve(rigid[:6, :6], bus[:, :6].T))
    size = np.sqrt(np.diag(felt))[list(wanted)]
    np.testing.assert_allclose(made.scale, np.outer(size, size), rtol=1e-9)
    locked = np.linalg.inv(felt)[np.ix_(wanted, wanted)] * np.outer(size, size)
    assert made.frozen == pytest.approx(np.linalg.norm(locked, 2), rel=1e-9)
    np.testing.assert_allclose(
        made.rigid_accelerance, bus @ np.linalg.solve(rigid, bus.T), atol=1e-12
    )
    seen = np.hstack([bus, np.zeros((6, 4))])[list(wanted)]
    for w in (0.7, 2.3, 8.0):
        dynamic = stiffness - w**2 * mass + 1j * w * damping
        exact = -(w**2) * seen @ np.linalg.solve(dynamic, seen.T) * np.outer(size, size)
        for found in (made.exact(np.array([w])), made.response(made.whole, np.array([w]))):
            np.testing.assert_allclose(found[0], exact, rtol=1e-6, atol=1e-9)
    assert [part.tolist() for part in made.modal_coordinates] == [[7, 8], [9, 10]]
    assert made.own_dofs(11).tolist() == list(range(7))


def curve_without(keep, omega, whole=None):
    """The error of the craft, or a `whole` of its own, with some of its four modes left out, by
    matrices."""
    bus, _, rigid, mass, damping, stiffness = whole or truth()
    felt = np.linalg.inv(bus[:, :6] @ np.linalg.solve(rigid[:6, :6], bus[:, :6].T))
    size = np.outer(np.sqrt(np.diag(felt)), np.sqrt(np.diag(felt)))
    frozen = np.linalg.norm(np.linalg.inv(felt) * size, 2)
    w = omega[:, None, None]
    dynamic = stiffness - w**2 * mass + 1j * w * damping
    seen = np.hstack([bus, np.zeros((6, 4))])
    both = []
    for pick in (np.arange(11), np.array([*range(7), *(7 + k for k in keep)])):
        part = np.linalg.solve(dynamic[:, pick[:, None], pick], seen[:, pick].T)
        both.append(-(w**2) * (seen[:, pick] @ part) * size)
    largest = np.maximum(np.linalg.norm(both[0], 2, axis=(1, 2)), frozen)
    return np.linalg.norm(both[1] - both[0], 2, axis=(1, 2)) / largest


def highest(keep, whole=None):
    """The largest value of that curve in the band."""
    grid = np.linspace(0.01, BAND, 250)
    at = grid[np.argmax(curve_without(keep, grid, whole))]
    return curve_without(keep, np.minimum(at + np.linspace(-0.02, 0.02, 41), BAND), whole).max()


FINE = 2e-3  # of the largest value, between points that are that close


def test_a_mode_left_out_costs_its_curve():
    """In a search as in the error itself; where it costs most no trial with the mode stands lower
    than it does there."""
    made = pose()
    left, right = made.whole
    fewer = [left.picked([0]), right]
    wanted = highest([0, 2, 3])
    assert made.of_models(fewer) == pytest.approx(wanted, rel=FINE)
    assert made.of_models(fewer, 1e-3) == pytest.approx(wanted, rel=0.02)
    assert made.of_exchange(0, left.picked([0])) == pytest.approx(wanted, rel=0.02)
    assert made.of_exchange(1, right.picked([])) == pytest.approx(highest([0, 1]), rel=0.02)
    floor = made.floor(fewer)
    assert floor(fewer) == pytest.approx(wanted, rel=0.02)
    grid = np.linspace(0.01, BAND, 250)
    at = grid[np.argmax(curve_without([0, 2, 3], grid))]
    near = np.minimum(at + np.linspace(-0.02, 0.02, 21), BAND)
    top = near[np.argmax(curve_without([0, 2, 3], near))]
    assert floor([left, right]) == pytest.approx(0.0, abs=1e-9)
    for keep in ([0, 2], [0, 1, 2], [1, 2, 3]):
        others = [
            left.picked([k for k in keep if k < 2]),
            right.picked([k - 2 for k in keep if k > 1]),
        ]
        found = floor(others)
        assert found <= highest(keep) * (1.0 + FINE)
        assert found >= 0.97 * curve_without(keep, np.array([top]))[0]


def test_a_mode_left_out_of_a_boom_that_carries_a_hand_costs_its_curve():
    """The hand on the bus moves by what the modes of the left boom do at its end as well."""
    hand = """<body name="hand" pos="0.4 4.2 0.3" euler="0 40 10">
    <inertial pos="0.1 0.2 0" mass="3" diaginertia="0.2 0.3 0.4"/></body>"""
    model = mujoco.MjModel.from_xml_string(CRAFT.replace("<body pos", f"{hand}<body pos"))
    tips = np.array([[0.0, 0.9, 0.1, 0.0, 0.1, 0.3], [0.1, 0.0, -0.8, 0.2, 0.4, 0.0]])
    body = model.body("hand").id
    items = []
    for place, tip, loads in (
        ("left", tips, (LoadOfPort(LENGTH, (body,), ()),)),
        ("right", np.zeros((2, 6)), ()),
    ):
        whole = bc.PortModel(
            BODY, FREQUENCY[place], ROWS[place], damping=RATIO[place], tip=tip, points=(LENGTH,)
        )
        at = mount(model, place, "site", place)
        items.append(PlacedBody(at, whole, np.ones(2, bool), [], {"xy": 2.0}, loads))
    made = Pose(model, QPOS, items, BAND, range(6))
    bus, roots, rigid, mass, damping, stiffness = truth(model)
    data = mujoco.MjData(model)
    data.qpos[:] = QPOS
    mujoco.mj_forward(model, data)
    axes = data.site("left").xmat.reshape(3, 3)
    out = data.xipos[body] - data.site("left").xpos - LENGTH * axes[:, 0]
    moved = [(axes @ tip[:3] + np.cross(axes @ tip[3:], out), axes @ tip[3:]) for tip in tips]
    by_modes = np.array([np.concatenate(each) for each in moved]).T
    turned = data.ximat[body].reshape(3, 3)
    weight = block_diag(3.0 * np.eye(3), turned @ np.diag(model.body_inertia[body]) @ turned.T)
    own = jacobian(model, data, body, data.xipos[body], np.eye(3))
    mass[:NV, NV : NV + 2] += own.T @ weight @ by_modes
    mass[NV : NV + 2, :NV] = mass[:NV, NV : NV + 2].T
    mass[NV : NV + 2, NV : NV + 2] += by_modes.T @ weight @ by_modes
    whole = bus, roots, rigid, mass, damping, stiffness
    left, right = made.whole
    wanted = highest([0, 2, 3], whole)
    assert made.of_exchange(0, left.picked([0])) == pytest.approx(wanted, rel=0.02)
    assert made.of_models([left.picked([0]), right]) == pytest.approx(wanted, rel=0.02)


def test_a_drive_without_a_damper_has_half_a_percent_in_the_exact_craft():
    model = mujoco.MjModel.from_xml_string(CRAFT.replace(' damping="0.6"', ""))
    made = Pose(model, QPOS, [carried(place) for place in PLACES], BAND, range(6), None)
    data = mujoco.MjData(model)
    data.qpos[:] = QPOS
    mujoco.mj_forward(model, data)
    mass = np.zeros((NV, NV))
    mujoco.mj_fullM(model, data, mass)
    squares, shapes = eigh(np.diag([0.0] * 6 + [40.0]), mass)
    wanted = 2.0 * 0.005 * np.sqrt(squares[-1])
    assert shapes[:, -1] @ made.craft.damping @ shapes[:, -1] == pytest.approx(wanted, rel=1e-6)
    assert np.max(np.abs(made.bare.damping)) < 1e-9


def test_axes_that_the_base_cannot_make_are_refused():
    held = mujoco.MjModel.from_xml_string(CRAFT.replace("<freejoint/>", '<joint axis="0 0 1"/>'))
    item = PlacedBody(
        mount(held, "left", "site", "left"),
        bc.PortModel(BODY, FREQUENCY["left"], ROWS["left"], damping=RATIO["left"]),
        np.array([True, True]),
        [2, 3],
        {"xy": 2.0},
    )
    qpos = np.array([0.3, 0.2])
    assert Pose(held, qpos, [item], BAND, range(6)).motions == (5,)
    assert Pose(held, qpos, [item], BAND, (5,)).motions == (5,)
    with pytest.raises(bc.InputError, match="y, z: body 'bus' .* only make the motions z;"):
        Pose(held, qpos, [item], BAND, (4, 5))


def compiled(factor):
    """The exact craft, the appendages' frequencies off by factors."""
    *_, mass, damping, stiffness = truth()
    stiffness = stiffness.copy()
    stiffness[NV:, NV:] *= np.array(factor)[:, None] ** 2
    return SimpleNamespace(mass=mass, damping=damping, stiffness=stiffness)


@dataclass(frozen=True)
class Matrices:
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray


def test_a_file_is_compared_with_the_damping_that_it_lacks():
    """An undamped file: 1e-5 of its drive, as of the bare craft, whose joint has a damper; its
    appendages as theirs say. The springs of a liquid stand in where no load acts."""
    given = compiled(np.ones(4))
    left = carried("left", undamped=0.03, alone=np.diag([4.0, 1.0]))
    right = carried("right", springs=np.array([7.0, 0.0]))
    made = Pose(MODEL, QPOS, [left, right], BAND, range(6))
    none = Matrices(given.mass, np.zeros((11, 11)), given.stiffness)
    found = made.comparable(none)
    w = np.concatenate([FREQUENCY[p] for p in PLACES])
    # of 4 kg the frequency is half, 2 z w m
    wanted = 2.0 * np.array([0.03 * 4.0 / 2.0, 0.03, 0.005, 0.005]) * w
    np.testing.assert_allclose(np.diag(found.damping)[NV:], wanted, rtol=1e-9)
    np.testing.assert_allclose(found.damping[:NV, :NV], made.extra, atol=1e-15)
    added = found.stiffness - given.stiffness
    np.testing.assert_allclose(np.diag(added)[NV:], [0.0, 0.0, 7.0, 0.0])
    assert np.count_nonzero(added) == 1
    damped = made.comparable(Matrices(given.mass, given.damping, given.stiffness))
    np.testing.assert_allclose(
        damped.damping, given.damping + block_diag(made.extra, np.zeros((4, 4)))
    )


def frequencies(matrices):
    values = eigh(matrices.stiffness, matrices.mass, eigvals_only=True)
    return np.sqrt(values[values > 1e-6])


def test_peaks_are_looked_for_with_what_lies_beyond_25_bands_gathered():
    wholes = [SimpleNamespace(condensed=lambda w, of=of: (of, w)) for of in PLACES]
    made = SimpleNamespace(
        band=3.0,
        carried=[SimpleNamespace(whole=whole) for whole in wholes],
        _damped=lambda models: models,
    )
    made._gathered = partial(Pose._gathered, made)
    assert Pose.near.func(made) == [(of, 75.0) for of in PLACES]


def test_coupled_modes_stand_in_pairs():
    """Exact ones and those of a file whose modes are a little off; what lies beyond the band and is
    in no pair is left out."""
    made = pose()
    ours = compiled([1.01, 0.99, 1.02, 1.0])
    exact, other = frequencies(compiled(np.ones(4))), frequencies(ours)
    found = coupled_modes(made, ours, BAND)
    assert [mode.exact for mode in found] == pytest.approx(exact, rel=1e-8)
    assert [mode.mujoco for mode in found] == pytest.approx(other, rel=1e-8)
    assert [mode.error for mode in found] == pytest.approx(other / exact - 1.0, rel=1e-5)
    # most strain energy in what was asked for, or in the craft's own spring
    _, shapes = eigh(truth()[5], truth()[3])
    strain = shapes[:, -5:] ** 2 * np.diag(truth()[5])[:, None]
    asked = strain[[6, 7, 8, 9]].sum(axis=0) > 0.5 * strain.sum(axis=0)
    assert [mode.kept for mode in found] == asked.tolist()
    assert [bool(mode.words) for mode in found] == (asked | (exact <= BAND)).tolist()


def test_a_mode_without_a_partner_is_listed_up_to_the_band():
    """The file lacks the last mode of the right appendage, then the first."""
    exact = frequencies(compiled(np.ones(4)))
    for lacks, band, listed in ((10, BAND, 4), (10, 2.0 * exact[-1], 5)):
        made = pose()
        object.__setattr__(made.carried[1], "dofs", [i for i in (9, 10) if i != lacks])
        left = [i for i in range(11) if i != lacks]
        every = compiled(np.ones(4))
        ours = SimpleNamespace(
            mass=every.mass[np.ix_(left, left)], stiffness=every.stiffness[np.ix_(left, left)]
        )
        found = coupled_modes(made, ours, band)
        assert len(found) == listed
        assert [mode.mujoco is None for mode in found] == [False] * 4 + [True] * (listed - 4)
    # and one that only the file has
    more = (
        block_diag(compiled(np.ones(4)).mass, 1.0),
        block_diag(compiled(np.ones(4)).stiffness, 1.5),
    )
    found = coupled_modes(
        pose(own=range(7)), SimpleNamespace(mass=more[0], stiffness=more[1]), BAND
    )
    (alone,) = [mode for mode in found if mode.exact is None]
    assert alone.mujoco == pytest.approx(np.sqrt(1.5))
    assert not alone.kept


def test_a_mode_in_words():
    """What moves, the way it does, and what the bus does most by the inertia that it feels."""
    made = pose()
    shape = np.zeros(11)
    shape[7], shape[9] = 1.0, 0.9
    assert mode_words(made, shape).startswith("left and right opposed, bending xy; bus still")
    shape[9] = -0.9
    assert mode_words(made, shape).startswith("left and right in phase, bending xy; bus still")
    # energies 4 and 6.76 a^2: a tenth of the sum at a = 0.2564
    shape[9] = 0.25
    assert mode_words(made, shape) == "left, bending xy; bus still"
    shape[9] = 0.26
    assert mode_words(made, shape) == "left and right opposed, bending xy; bus still"
    shape[:] = 0.0
    shape[10] = 1.0
    assert mode_words(made, shape) == "right, torsion; bus still"
    shape[6] = 0.45  # 40 x 0.2025 = 8.1 of 89.1
    assert mode_words(made, shape) == "right, torsion; bus still"
    shape[6] = 0.6
    assert mode_words(made, shape) == "right, torsion; springs of the spacecraft; bus still"
    shape[5] = 0.5
    assert mode_words(made, shape).endswith("springs of the spacecraft; bus about z")


def test_bases_and_counterparts():
    assert mounts_by_base(MODEL, [carried(p).mount for p in PLACES]) == {1: [0, 1]}
    text = CRAFT.replace('<body name="bus"', '<body name="other"/><body name="bus"')
    assert counterpart(MODEL, mujoco.MjModel.from_xml_string(text), 1) == 2
    assert counterpart(MODEL, mujoco.MjModel.from_xml_string(text), 2) == 2


def test_a_joint_that_moves_the_base_a_little_is_not_held_with_those_that_do_not():
    """A mode of 5 rad/s alone, beside a joint on its own spring that it pushes."""
    mass, stiffness = np.diag([1.0, 1.0]), np.array([[144.0, 0.0], [0.0, 25.0]])
    mass[0, 1] = mass[1, 0] = 0.4
    outputs = SimpleNamespace(acceleration=np.array([[0.05, 0.0], [-0.02, 0.0]]))
    craft = SimpleNamespace(
        mass=mass, damping=np.zeros((2, 2)), stiffness=stiffness, outputs=outputs
    )
    found = peaks_of_craft(craft)[:, 0]
    both = np.sqrt(eigh(stiffness, mass, eigvals_only=True))
    for wanted in (*both, 5.0):
        assert np.min(np.abs(found - wanted)) < 1e-7
    assert np.abs(both - 5.0).min() > 0.05


# -- the exact plant -------------------------------------------------------------------------------
@pytest.mark.parametrize(("omega", "loaded"), [(1.0, False), (3.0, False), (3.0, True)])
def test_the_exact_plant_has_all_modes_of_the_appendages(monkeypatch, omega, loaded):
    """Those beyond 25 times the frequencies of interest and of what is kept are gathered; a load
    finds them behind the craft's own coordinates, and tells modes apart without a free base."""
    items = [carried(place) for place in PLACES]
    wholes = [item.whole for item in items]
    items[0].dofs[:], items[1].dofs[:] = [1, 4], [5, 10]  # between those of the craft
    lines = [SimpleNamespace(model=whole) for whole in wholes]
    for item, line in zip(items, lines, strict=True):
        object.__setattr__(item, "line", lambda band, line=line: (tops.append(band), line)[1])
    tops, bases = [], []

    def exact_appendage(body, kept, rigid_mass, modes):
        assert (kept, rigid_mass, modes) == ("kept", "of the chain", 40)
        return SimpleNamespace(model=SimpleNamespace(condensed=lambda w: (tops.append(w), body)[1]))

    def under_load(*given):
        assert given[4] == lines
        return SimpleNamespace(loaded=lambda linear, at, w: (bases.append((at, w)), linear)[1])

    module = "beamchain.craft.linear_craft"
    monkeypatch.setattr(f"{module}.carried", lambda *_: items)
    monkeypatch.setattr(f"{module}.exact_appendage", exact_appendage)
    monkeypatch.setattr(f"{module}.LoadedTree", under_load)
    monkeypatch.setattr(f"{module}._load", lambda *_: SimpleNamespace(free=0))
    measured = SimpleNamespace(rigid_mass="of the chain")
    fits = [SimpleNamespace(body=whole, kept="kept", measured=measured) for whole in wholes]
    made = SimpleNamespace(
        model=SimpleNamespace(nv=11),
        craft=MODEL,
        appendages=[
            SimpleNamespace(prefix=f"{place}_", fit=fit)
            for place, fit in zip(PLACES, fits, strict=True)
        ],
        bare_qpos=lambda qpos: qpos[:8],
    )
    point = SimpleNamespace(qpos=np.append(QPOS, np.ones(4)), qvel=1e-12 * np.arange(11.0))
    found = exact_craft(made, point, None, None, omega, loaded=loaded)
    *_, mass, damping, stiffness = truth()
    np.testing.assert_allclose(found.linear.mass, mass, atol=1e-9)
    np.testing.assert_allclose(found.linear.damping, damping, atol=1e-6)
    np.testing.assert_allclose(found.linear.stiffness, stiffness, atol=1e-6)
    assert found.point.qvel == pytest.approx(1e-12 * np.array([0, 2, 3, 6, 7, 8, 9]), abs=0.0)
    names = ("drive", "left_mode1_xy", "left_mode1_xz", "right_mode1_xy", "right_mode1_torsion")
    assert found.names == names
    assert [each.name for each in found.linear.coordinates[-4:]] == list(names[1:])
    springs = np.diag(stiffness)
    np.testing.assert_allclose(found.rows, np.diag(np.sqrt(springs))[6:], atol=1e-6)
    if not loaded:
        assert tops == [25.0 * max(omega, 2.0)] * 2
        assert found.internal is None
        return
    assert tops == [omega] * 2
    assert bases == [([7, 9], omega)]
    np.testing.assert_allclose(found.internal, np.diag(springs), atol=1e-6)


def test_the_exact_plant_is_accelerated_by_its_thrust_over_all_its_mass():
    """60 kg of the bus, 7 of what turns on it, and 8 kg of each of two appendages."""
    text = CRAFT.replace(
        "</mujoco>",
        """<actuator><motor name="jet" site="left" gear="0 0 1 0 0 0"/></actuator><keyframe>
        <key name="burn" qpos="0 0 0 1 0 0 0 0" ctrl="41.5"/></keyframe></mujoco>""",
    )
    made = SimpleNamespace(craft=mujoco.MjModel.from_xml_string(text))
    found = load_on_exact(made, [carried(place) for place in PLACES], "burn")
    assert np.linalg.norm(found.field) == pytest.approx(41.5 / (67.0 + 16.0))
