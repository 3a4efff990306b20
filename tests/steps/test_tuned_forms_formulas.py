"""The forms of timed tendons beside the matrices of the step that they make."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh

from formulas import Craft, appendage_poles, form2, form2_many, form4, time_modes, tune
from motions_made import made_motion

STEP = 0.05
STIFFNESS, DAMPING = np.array([35.0, 80.0]), np.array([0.04, 0.1])
# tendons that make the springs of 40 and 90 of the second and the third motion
TURN = np.array([[0.96, -0.28], [0.28, 0.96]])
ROWS = np.diag(STIFFNESS**-0.5) @ TURN @ np.array([[0.0, 40.0**0.5, 0.0], [0.0, 0.0, 90.0**0.5]])
SQUARES = np.array([0.0, 40.0, 90.0])
JOINTS, OTHERS = np.diag([0.0, 0.02, 0.01]) + 0.002, np.diag([0.1, 0.0, 0.03])
MODAL = SimpleNamespace(
    names=("a", "b"),
    stiffness=STIFFNESS,
    damping=DAMPING,
    frequency=np.sqrt(STIFFNESS),
    rows=ROWS,
)
SEMI_IMPLICIT = ("Euler", "implicitfast")


def pencil(integrator, c, stiffness, damping, mass, h=STEP):
    """Largest of (h^2 k +- 2 h d, C + m - 1) over poses."""
    sign = -1.0 if integrator == "implicitfast" else 1.0
    force = np.diag(h**2 * stiffness + 2.0 * sign * h * damping)
    return max(eigh(force, one + np.diag(mass - 1.0), eigvals_only=True)[-1] for one in c)


def runge_kutta(c, stiffness, damping, mass, h):
    """Largest |exp(s h)| to fourth order over poses."""
    out = 0.0
    for one in c:
        left = np.linalg.inv(one + np.diag(mass - 1.0))
        flow = np.block(
            [[np.zeros((2, 2)), np.eye(2)], [-left @ np.diag(stiffness), -left @ np.diag(damping)]]
        )
        x = h * np.linalg.eigvals(flow)
        out = max(out, np.max(np.abs(1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24)))
    return out


POSES = np.array([[[0.9, 0.1], [0.1, 0.8]], [[0.55, 0.2], [0.2, 0.62]]])
LIGHT = POSES - np.diag([0.3, 0.35])


@pytest.mark.parametrize("integrator", [*SEMI_IMPLICIT, "RK4"])
def test_the_phase_limit_is_lowered_just_until_the_craft_is_stable(integrator):
    stiffness = np.array([[400.0, 3000.0], [35.0, 80.0], [900.0, 2500.0]])
    damping = np.array([[3.0, 9.0], [0.4, 0.2], [4.0, 2.0]])

    def within(number, phase):
        k, d = stiffness[number], damping[number]
        t = time_modes(integrator, np.sqrt(k), d / 2.0 / np.sqrt(k), STEP, phase=phase)
        if integrator == "RK4":
            reach = STEP * np.sqrt(8.0 / 7.6)
            return runge_kutta(LIGHT, k, t.damping, t.mass, reach) <= 1.0 + 1e-9
        return pencil(integrator, LIGHT, k, t.damping, t.mass) <= 3.8

    many = form2_many(integrator, LIGHT[:, None], stiffness, damping, STEP)
    usual = 2.0 if integrator == "RK4" else 2.6
    assert [within(number, usual) for number in range(3)] == [False, True, False]
    for number in range(3):
        modal = SimpleNamespace(
            names=("a", "b"),
            stiffness=stiffness[number],
            damping=damping[number],
            frequency=np.sqrt(stiffness[number]),
        )
        found = form2(modal, LIGHT, integrator, STEP)
        assert within(number, found.phase)
        if number == 1:
            assert found.phase == usual
        else:
            assert 0.3 < found.phase < usual
            assert not within(number, 1.0005 * found.phase)
        ratio = modal.damping / 2.0 / modal.frequency
        t = time_modes(integrator, modal.frequency, ratio, STEP, phase=found.phase)
        assert found.armature == pytest.approx(t.mass - 1.0)
        assert found.damping == pytest.approx(t.damping)
        assert many.mass[number] == pytest.approx(t.mass)
        assert many.damping[number] == pytest.approx(t.damping)
        if integrator != "RK4":
            largest = pencil(integrator, LIGHT, modal.stiffness, t.damping, t.mass)
            assert found.lambda_max == pytest.approx(largest)
        for k, mode in enumerate(found.modes):
            shown = (mode.name, mode.frequency, mode.ratio, mode.mass, mode.damping, mode.slowed)
            assert shown == pytest.approx(
                ("ab"[k], modal.frequency[k], ratio[k], t.mass[k], t.damping[k], t.slowed[k])
            )
            w = modal.frequency[k]
            if integrator == "Euler":
                share = min(1.0, found.phase / w / STEP)
                s = share * w * complex(-ratio[k], np.sqrt(1.0 - ratio[k] ** 2))
                assert mode.pole == pytest.approx(s, rel=1e-9)


def test_discrete_bears_every_craft_as_it_is():
    found = form2(MODAL, 0.01 * POSES, "discrete", STEP)
    assert found.phase == np.inf
    assert found.armature.tolist() == [0.0, 0.0]
    assert found.damping == pytest.approx(DAMPING)


# -- a craft ---------------------------------------------------------------------------------------
def craft(integrator):
    tendons = ROWS.T @ np.diag(DAMPING) @ ROWS
    implicit = JOINTS + (tendons if integrator == "implicitfast" else 0.0)
    motion = made_motion(SQUARES, implicit, JOINTS + OTHERS + tendons, integrator, STEP)
    return Craft(motion, ROWS, STIFFNESS, DAMPING)


def matrix(integrator, armature, damping, h=STEP, rest=JOINTS + OTHERS):
    """Of `(M + h D_i) (v' - v) = -h (K y + D v)`, `y' = y + h v'` over (y, h v)."""
    mass = np.eye(3) + ROWS.T @ np.diag(armature) @ ROWS
    tendons = ROWS.T @ np.diag(damping) @ ROWS
    late = JOINTS + (tendons if integrator == "implicitfast" else 0.0)
    left = np.linalg.inv(mass + h * late)
    pull = h**2 * left @ np.diag(SQUARES)
    keep = np.eye(3) - h * left @ (rest + tendons)
    return np.block([[np.eye(3) - pull, keep], [-pull, keep]])


def upper(values):
    values = values[values.imag > 1e-6]
    return values[np.argsort(np.abs(values))]


def motion(integrator, h=STEP):
    """As read from a model: shapes of its own, and all of the damping."""
    shapes = np.array([[1.0, 0.2, 0.0], [0.1, 0.9, 0.3], [-0.2, 0.0, 1.1]])
    tendons = ROWS.T @ np.diag(DAMPING) @ ROWS
    rest = JOINTS + (OTHERS if integrator == "Euler" else 0.0)
    whole = rest + tendons
    implicit = JOINTS if integrator == "Euler" else whole
    made = made_motion(SQUARES, implicit, whole, integrator, h, shapes)
    modal = SimpleNamespace(**vars(MODAL) | {"rows": ROWS @ np.linalg.inv(shapes)})
    return modal, made, rest


@pytest.mark.parametrize("integrator", SEMI_IMPLICIT)
def test_a_craft_has_the_tendons_of_its_motion(integrator):
    modal, made, rest = motion(integrator)
    assert Craft.of(modal, made).rows == pytest.approx(ROWS)
    # without those, as the integrator takes them
    step = made.with_tendons(ROWS, np.zeros(2), -DAMPING, np.zeros(2))
    assert step.implicit == pytest.approx(JOINTS)
    assert step.explicit == pytest.approx(rest - JOINTS, abs=1e-12)
    assert step.stiffness == pytest.approx(np.diag(SQUARES))
    whole = rest + ROWS.T @ np.diag(DAMPING) @ ROWS
    values = np.linalg.eigvals(
        np.block([[np.zeros((3, 3)), np.eye(3)], [-np.diag(SQUARES), -whole]])
    )
    assert appendage_poles(modal, made) == pytest.approx(upper(values), rel=1e-9)


@pytest.mark.parametrize(("share", "kept"), [(0.45, []), (0.55, [0]), (1.0, [0])])
@pytest.mark.parametrize("slow", [1.0, 0.001])
def test_a_pole_belongs_to_an_appendage_with_half_of_its_energy(share, kept, slow):
    # a tendon with that share of the spring of the second motion
    squares = np.array([0.0, 25.0, 49.0]) * slow
    rows = np.array([[0.3, 1.0, 0.0]])
    whole = made_motion(squares, np.zeros((3, 3)), np.diag([0.0, 0.0, 3.0]), "Euler", STEP)
    made = Craft(whole, rows, share * squares[1:2], np.array([0.0]))
    found = made.appendage_poles()
    assert found == pytest.approx([5j * np.sqrt(slow)] * len(kept), rel=1e-9)


@pytest.mark.parametrize("integrator", SEMI_IMPLICIT)
@pytest.mark.parametrize("h", [STEP, 0.285])
def test_form_4_gives_the_step_the_poles_of_exact_motion(integrator, h):
    modal, made, rest = motion(integrator, h)
    c = np.linalg.inv(ROWS @ ROWS.T)[None]
    plan = form2(modal, c, integrator, h)
    found = form4(modal, c, integrator, h, plan, [made])
    poles = h * appendage_poles(modal, made)
    turn = np.abs(poles)
    assert (turn[1] > 2.6) == (h > STEP)
    wanted = np.exp(poles * np.minimum(2.6 / turn, 1.0))
    z = upper(np.linalg.eigvals(matrix(integrator, found.armature, found.damping, h, rest)))
    assert z[np.argsort(np.angle(z))] == pytest.approx(wanted, abs=1e-9)
    assert found.phase == 2.6
    whole = 1.0 + found.armature
    assert found.lambda_max == pytest.approx(
        pencil(integrator, c, STIFFNESS, found.damping, whole, h)
    )
    for k, mode in enumerate(found.modes):
        assert mode.ratio == pytest.approx(DAMPING[k] / 2.0 / np.sqrt(STIFFNESS[k]))
        assert mode.mass == pytest.approx(whole[k])
        assert mode.damping == pytest.approx(found.damping[k])
        assert mode.slowed == plan.modes[k].slowed
    # a craft on which that is unstable keeps its plan, and what no appendage holds too
    assert form4(modal, 0.02 * c, integrator, h, plan, [made]) is plan
    assert form4(modal, c, integrator, h, plan, [made], [np.zeros(0, complex)]) is plan
    assert form4(modal, c, "discrete", h, plan, [made]) is plan


@pytest.mark.parametrize("integrator", SEMI_IMPLICIT)
def test_the_error_of_what_cannot_be_had_counts_slow_poles_more(integrator):
    start = np.linalg.eigvals(matrix(integrator, np.array([0.03, 0.05]), DAMPING))
    start = start[start.imag > 1e-6]
    start = start[np.argsort(np.abs(np.log(start)))]
    wanted = start[:, None] ** np.array([0.97, 1.04])  # in two poses of one craft
    poses = [wanted[:, 0], wanted[:, 1]]
    crafts = [craft(integrator)] * 2
    found = tune(crafts, np.array([0.01, 0.02]), 1.1 * DAMPING, poses, STEP)
    z = np.linalg.eigvals(matrix(integrator, found.armature, found.damping))
    turns = np.abs(np.log(wanted))
    sizes = np.abs(wanted - 1.0) * turns / turns.min()
    near = [z[np.argmin(np.abs(z - want))] for want in start]
    worst = np.max(np.abs(wanted - np.array(near)[:, None]) / sizes)
    assert found.error == pytest.approx(worst, rel=1e-9)
    assert 0.01 < found.error < 0.06
    undamped = tune(crafts[:1], np.array([0.01, 0.02]), 0.0 * DAMPING, poses[:1], STEP)
    assert undamped.damping.tolist() == [0.0, 0.0]
