"""Closed forms and difference quotients beside the search for the timing of a tree."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from formulas import (
    FreeAppendage,
    ResponseResidual,
    Room,
    SeenAtPose,
    Tendons,
    modal_tendons,
    motion_at,
    nearest_response,
    newton_step,
    outer_motions,
    step_length,
    tree_form,
)
from motions_made import made_motion

STEP = 0.05
STIFFNESS = np.array([40.0, 90.0, 60.0])
DAMPING = np.array([0.3, 0.2, 0.5])
PAIR, SINGLE = np.array([[0.9, 0.2], [0.2, 0.7]]), np.array([[0.8]])
UNKNOWNS = np.array([0.5, 0.6, 0.4, 0.01, -0.012, 0.005, 0.1, -0.2, 0.05])  # c, s, e
MODAL = SimpleNamespace(names=("a", "b", "c"), stiffness=STIFFNESS, damping=DAMPING)
ALONE = (
    FreeAppendage(np.array([0, 2]), PAIR, PAIR),
    FreeAppendage(np.array([1]), SINGLE, SINGLE),
)
INTEGRATORS = ("Euler", "implicitfast", "RK4")
# armature over h d / 2: Euler damps tendons by the rate before the step, implicitfast by that after
LATE = {"Euler": 1.0, "implicitfast": -1.0, "RK4": 0.0}


def room(integrator):
    return Room.of(ALONE, MODAL, integrator, STEP, 4.0)


def quotients(function, at, size=1e-6):
    """`(m, n)` by central differences."""
    moves = size * np.eye(at.size)
    return np.array(
        [(np.asarray(function(at + m)) - function(at - m)) / (2.0 * size) for m in moves]
    ).T


def test_bounds_of_the_search():
    # |s|: 5/16 of the squared phase at the end of the band, between 1 and 5 %
    for band, softer in ((1.0, 0.01), (6.0, 5.0 / 16.0 * 0.09), (20.0, 0.05)):
        found = Room.of(ALONE, MODAL, "Euler", STEP, band)
        assert found.high == pytest.approx([3.0] * 3 + [softer] * 3 + [0.3] * 3)
        assert found.low == pytest.approx([-1e-9] * 3 + [-softer] * 3 + [-0.3] * 3)
    assert room("Euler").start == pytest.approx([0.55] * 3 + [0.0] * 6)
    assert room("RK4").start == pytest.approx([0.425] * 3 + [0.0] * 6)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_tendons_of_the_unknowns(integrator):
    found = room(integrator).tendons(UNKNOWNS)
    c, s, e = UNKNOWNS.reshape(3, 3)
    late = LATE[integrator]
    assert found.stiffness == pytest.approx((1.0 + s) * STIFFNESS)
    assert found.damping == pytest.approx((1.0 + e) * DAMPING)
    assert found.armature == pytest.approx(
        c * STEP**2 * STIFFNESS + late * (1.0 + e) * STEP * DAMPING / 2.0
    )


@pytest.mark.parametrize(("integrator", "limit"), [("Euler", 0.25), ("RK4", 0.125)])
def test_the_barrier_and_its_derivatives(integrator, limit):
    made = room(integrator)
    c, s, _ = UNKNOWNS.reshape(3, 3)
    more = (0.98 * c - (1.0 + s) * limit) * STEP**2 * STIFFNESS
    pair = 0.98 * PAIR + np.diag(more[[0, 2]])
    determinant = (pair[0, 0] * pair[1, 1] - pair[0, 1] ** 2) * (0.98 * 0.8 + more[1])
    edges = np.concatenate([UNKNOWNS - made.low, made.high - UNKNOWNS])
    assert made.value(UNKNOWNS) == pytest.approx(-np.log(edges).sum() - np.log(determinant))
    gradient, hessian = made.derivatives(UNKNOWNS)
    assert gradient == pytest.approx(quotients(made.value, UNKNOWNS), rel=1e-5, abs=1e-6)
    second = quotients(lambda at: made.derivatives(at)[0], UNKNOWNS)
    assert hessian == pytest.approx(second, rel=1e-5, abs=1e-4)
    for i, beyond in ((0, -0.1), (4, 1.0), (8, -0.3)):
        outside = UNKNOWNS.copy()
        outside[i] = beyond
        assert made.value(outside) == np.inf
    heavy = FreeAppendage(np.array([1]), SINGLE, -5.0 * SINGLE)
    assert Room.of([heavy], MODAL, integrator, STEP, 4.0).value(UNKNOWNS) == np.inf


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_slopes_by_the_unknowns_are_those_by_the_tendons_they_make(integrator):
    made = room(integrator)
    by_tendons = np.random.default_rng(1).normal(size=(2, 9))
    wanted = quotients(lambda at: by_tendons @ np.concatenate(made.tendons(at)), UNKNOWNS)
    assert made.by_unknowns(by_tendons) == pytest.approx(wanted, rel=1e-7, abs=1e-8)


def test_largest_squared_phase_of_the_appendages_alone():
    # without coupling, so that each tendon is by itself: (h^2 k' + 2 h d') / (S + c h^2 k + h d'/2)
    apart = (FreeAppendage(np.array([0, 1, 2]), np.eye(3), np.diag([0.9, 0.8, 0.7])),)
    made = Room.of(apart, MODAL, "Euler", STEP, 4.0)
    c, s, e = UNKNOWNS.reshape(3, 3)
    squares, damped = STEP**2 * STIFFNESS, STEP * (1.0 + e) * DAMPING
    mass = np.array([0.9, 0.8, 0.7]) + c * squares + damped / 2.0
    wanted = np.max(((1.0 + s) * squares + 2.0 * damped) / mass)
    assert made.largest(UNKNOWNS) == pytest.approx(wanted)


# -- responses -------------------------------------------------------------------------------------
def response(integrator):
    """Three motions, two of them looked at; the exact response is another than the step's."""
    random = np.random.default_rng(4)
    b = random.normal(size=(3, 3))
    damping = np.diag([0.02, 0.3, 0.4]) + 0.01
    implicit = damping if integrator == "implicitfast" else 0.4 * damping  # Euler: of joints
    motion = made_motion(np.array([0.0, 30.0, 80.0]), implicit, damping, integrator, STEP)
    seen = SeenAtPose(
        motion,
        rows=random.normal(size=(2, 3)),
        tendons=b,
        plain=Tendons(STIFFNESS, DAMPING, np.zeros(3)),
        joints=np.diag([0.1, 0.0, 0.2]),
        exact=None,
        omega=np.zeros(0),
    )
    z = np.exp(STEP * np.array([0.3 + 3.0j, 0.2 + 6.0j]))
    exact = random.normal(size=(2, 2, 2))
    return ResponseResidual(seen, z - 1.0, exact + np.swapaxes(exact, 1, 2), np.array([1.0, 2.5]))


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_what_a_response_misses_and_its_slopes(integrator):
    compared = response(integrator)
    seen, motion = compared.seen, compared.seen.motion
    numbers = np.concatenate([1.02 * STIFFNESS, 1.1 * DAMPING, [0.05, 0.08, 0.02]])
    tendons = Tendons(*np.split(numbers, 3))
    wanted, worst = [], 0.0
    for step, exact, size in zip(compared.step, compared.exact, compared.size, strict=True):
        z = 1.0 + step
        spring, late = STEP**2 * z / (z - 1.0) ** 2, STEP * z / (z - 1.0)
        early = STEP / (z - 1.0)
        if integrator == "RK4":
            s = np.log(z) / STEP
            spring, late, early = 1.0 / s**2, 1.0 / s, 1.0 / s
        b = seen.tendons
        extra = 0.1 * b.T @ np.diag(DAMPING) @ b
        dynamic = (
            np.eye(3)
            + seen.joints
            + b.T @ np.diag(tendons.armature) @ b
            + (motion.damping - motion.implicit) * early
            + motion.implicit * late
            + extra * (early if integrator == "Euler" else late)
            + (np.diag(motion.squares) + 0.02 * b.T @ np.diag(STIFFNESS) @ b) * spring
        )
        missed = (seen.rows @ np.linalg.inv(dynamic) @ seen.rows.T - exact) / size
        worst = max(worst, np.linalg.svd(missed)[1][0])
        wanted.append([missed[0, 0], np.sqrt(2.0) * missed[0, 1], missed[1, 1]])
    wanted = np.ravel(wanted)
    difference = compared.difference(tendons)
    assert difference == pytest.approx(np.concatenate([wanted.real, wanted.imag]))
    assert compared.worst(tendons) == pytest.approx(worst)
    got, slopes = compared.slopes(tendons)
    assert got == pytest.approx(difference)
    by_numbers = quotients(lambda at: compared.difference(Tendons(*np.split(at, 3))), numbers)
    assert slopes == pytest.approx(by_numbers, rel=1e-5, abs=1e-7)


def test_a_newton_step_goes_down_the_objective_and_is_halved_until_it_does():
    made, compared, weight = room("Euler"), response("Euler"), 1e-3

    def objective(at):
        missed = compared.difference(made.tendons(at))
        return missed @ missed / 2.0 + weight * made.value(at)

    step, decrease = newton_step(made, [compared], weight, UNKNOWNS)
    slope = quotients(objective, UNKNOWNS)
    assert decrease == pytest.approx(-slope @ step, rel=1e-4)
    length = step_length(made, [compared], weight, UNKNOWNS, step, decrease)
    now = objective(UNKNOWNS)
    tried = 0.5 ** np.arange(20)
    lowered = [objective(UNKNOWNS + t * step) < now - 1e-4 * t * decrease for t in tried]
    assert length == tried[lowered.index(True)]
    assert step_length(made, [compared], weight, UNKNOWNS, -step, decrease) == 0.0


def test_a_craft_is_seen_in_its_base_and_in_a_hinge_that_hangs_on_an_appendage():
    """Of a point of the base in its axes, and not in those of the world: MuJoCo's own Jacobians."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="bus" pos="1 2 3" euler="20 30 40"><freejoint/>
        <geom size=".5"/><body pos="1 0 0"><joint name="h1" axis="0 0 1"/>
        <geom size=".1"/><body pos="1 0 0"><joint name="drive" axis="0 1 0"/><geom size=".1"/>
        </body></body></body></worldbody><tendon><fixed name="arm_mode1" stiffness="35">
        <joint joint="h1" coef="1"/></fixed></tendon></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    modal = modal_tendons(model)
    assert modal.names == ("arm_mode1",)
    found = outer_motions(model, modal, data)
    shift, turn = np.zeros((3, 8)), np.zeros((3, 8))
    mujoco.mj_jacBody(model, data, shift, turn, 1)
    axes = data.xmat[1].reshape(3, 3)
    np.testing.assert_allclose(found[:3], axes.T @ shift, atol=1e-12)
    np.testing.assert_allclose(found[3:6], axes.T @ turn, atol=1e-12)
    np.testing.assert_array_equal(found[6:], np.eye(8)[[7]])


def test_a_slow_craft_is_compared_at_its_slow_mode():
    """Of a few mrad/s, in a band of 0.01: where MuJoCo's own masses have it."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0" timestep="0.5"/><worldbody><body><freejoint/>
        <inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/><body pos="1 0 0">
        <joint name="h1" axis="0 0 1"/><inertial pos="1 0 0" mass="1" diaginertia=".1 .1 .1"/>
        </body></body></worldbody><tendon><fixed name="arm_mode1" stiffness="1e-6">
        <joint joint="h1" coef="1"/></fixed></tendon></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    # what a moment at the hinge moves while all else is free
    moved = np.zeros((1, 7))
    mujoco.mj_solveM(model, data, moved, np.eye(7)[[6]])
    pole = np.sqrt(1e-6 * moved[0, 6])
    assert 2e-3 < pole < 9e-3
    qpos, joints = np.array(model.qpos0), np.zeros(7)
    found = SeenAtPose.of(model, modal_tendons(model), qpos, motion_at(model), 0.01, joints)
    # and from a fiftieth of the band on
    wanted = np.sort([*np.geomspace(0.0002, 0.01, 40), pole])
    assert found.omega == pytest.approx(wanted, rel=1e-6)
    # motions of the base, of which each moves one unit of mass while the hinge is locked
    free = np.zeros((7, 7))
    mujoco.mj_solveM(model, data, free, np.eye(7))
    held = np.linalg.inv(np.linalg.inv(free)[:6, :6])
    share = np.diag(free)[:6] / np.diag(held)
    assert np.sum(found.rows**2, axis=1) == pytest.approx(share)


def test_a_step_is_halved_until_it_lowers_the_objective_enough():
    """From 3 along -d, of half the square and a barrier of 1/x: the first of 1, 1/2, 1/4, ... that
    stays above zero and gains 1e-4 of the slope's promise."""

    def length(way, weight, decrease):
        walls = SimpleNamespace(
            value=lambda at: 1.0 / at[0] if at[0] > 0.0 else np.inf, tendons=lambda at: at
        )
        half = SimpleNamespace(difference=lambda at: np.sqrt(0.5) * at)
        compared, at = [half, half], np.array([3.0])
        return step_length(walls, compared, weight, at, np.array([-way]), decrease)

    def lowers(x, weight):
        return x > 0.0 and x**2 / 2.0 + weight / x < 4.5 + weight / 3.0

    for way in (2.0, 2.99, 3.5, 5.7, 11.9, 70.0):
        for weight in (0.0, 0.5, 4.0, 20.0):
            found = length(way, weight, 0.0)
            halves = 0.5 ** np.arange(12)
            wanted = next(one for one in halves if lowers(3.0 - one * way, weight))
            assert found == wanted
    assert length(2.0, 0.0, 3.9e4) == 1.0  # from 4.5 to 0.5
    assert length(2.0, 0.0, 4.1e4) == 0.5
    assert length(2.0, 0.0, 6.1e4) == 0.0
    assert length(-2.0, 0.0, 1.0) == 0.0


def test_a_response_is_taken_beside_the_unit_circle_and_relative_to_one_at_least():
    """Of gains 3 and -4 at the first frequency, 0.2 and 0.1 at the second."""
    gains = np.array([[3.0, -4.0], [0.2, 0.1]])
    seen = SeenAtPose(
        SimpleNamespace(timestep=STEP),
        *(None for _ in range(4)),
        exact=lambda step: step[:, None, None] * np.array([np.diag(gain) for gain in gains]),
        omega=np.array([2.0, 5.0]),
    )
    found = seen.compared(0.1)
    step = np.exp((0.1 + 1j) * STEP * np.array([2.0, 5.0])) - 1.0
    assert found.step == pytest.approx(step)
    assert found.exact == pytest.approx(np.array([np.diag(row) for row in step[:, None] * gains]))
    assert found.size == pytest.approx([max(4.0 * abs(step[0]), 1.0), 1.0])


@pytest.mark.parametrize(("apart", "last"), [(0.4, -2), (0.6, 0)])
def test_the_search_comes_nearer_to_the_circle_while_responses_are_alike(apart, last):
    """Differences `A x - (1 + nearness) b`; without walls the least squares are at `A x = b`."""
    a, b, asked = np.array([[2.0, 1.0], [0.5, 3.0]]), np.array([1.0, -2.0]), []

    def compared(nearness):
        asked.append(nearness)

        def missed(x):
            return a @ x - (1.0 + nearness) * b

        return SimpleNamespace(
            difference=missed, slopes=lambda x: (missed(x), a), worst=lambda x: apart
        )

    nothing = SimpleNamespace(
        start=np.zeros(2),
        tendons=lambda x: x,
        value=lambda x: 0.0,
        derivatives=lambda x: (np.zeros(2), np.zeros((2, 2))),
        by_unknowns=lambda rows: rows,
    )
    found = nearest_response(nothing, [SimpleNamespace(compared=compared)])
    assert sorted(asked, reverse=True) == asked
    assert found == pytest.approx(np.linalg.solve(a, (1.0 + asked[last]) * b), rel=1e-6)


@pytest.mark.parametrize(
    ("band", "kept", "top"),
    [(None, 3.0, 3.0), (None, 9.0, 4.0), (7.0, 3.0, 7.0), (12.0, 3.0, 10.0)],
)
def test_up_to_where_a_tree_s_response_is_kept(band, kept, top, monkeypatch):
    """To the band, of half a radian per step at most, else to the last kept mode, of a fifth."""

    def made(alone, modal, integrator, step, highest):
        assert (alone, modal, integrator, step) == (["alone"], MODAL, "Euler", STEP)
        raise ArithmeticError(highest)

    for name, told in (
        ("tuned_poses", lambda *_: [None]),
        ("motion_for", lambda *_: "motion"),
        ("last_kept", lambda *_: kept),
        ("appendages_alone", lambda *_: ["alone"]),
        ("_TendonBounds.of", made),
    ):
        monkeypatch.setattr(f"beamchain.steps.tree_time.{name}", told)
    with pytest.raises(ArithmeticError) as found:
        tree_form(None, MODAL, "Euler", STEP, joints=np.zeros(2), band=band)
    assert found.value.args[0] == pytest.approx(top)


def test_the_timing_of_a_tree_gives_its_step_the_pole_of_exact_motion():
    """1 kg on a sprung and damped slide on 4 kg that slide along: a reduced mass of 0.8 kg."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="{STEP}"/><worldbody><body>
        <joint type="slide" axis="0 1 0"/><inertial pos="0 0 0" mass="4" diaginertia="9 9 9"/>
        <body><joint name="q" type="slide" axis="0 1 0"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body></worldbody><tendon>
        <fixed name="arm_mode1" stiffness="35" damping="0.3"><joint joint="q" coef="1"/></fixed>
        </tendon></mujoco>"""
    )
    found = tree_form(model, modal_tendons(model), "Euler", STEP, joints=np.zeros(2), band=9.0)
    mass = 0.8 + found.armature[0]
    pull, lost = STEP**2 * found.stiffness[0] / mass, STEP * found.damping[0] / mass
    step = np.roots([1.0, pull + lost - 2.0, 1.0 - lost])
    exact = np.exp(STEP * np.roots([0.8, 0.3, 35.0]))
    assert np.sort_complex(step) == pytest.approx(np.sort_complex(exact), abs=2e-5)
    assert found.lambda_max == pytest.approx(pull + 2.0 * lost)
    (mode,) = found.modes
    assert (mode.frequency, mode.ratio) == pytest.approx((35.0**0.5, 0.15 / 35.0**0.5))
    left = tree_form(model, modal_tendons(model), "discrete", STEP, joints=np.zeros(2))
    assert (left.damping[0], left.armature[0], left.stiffness) == (0.3, 0.0, None)
