"""Closed forms beside the timing of tendons and the map of a step."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

from beamchain import PortModel
from formulas import (
    Craft,
    LinearModel,
    StepOfCraft,
    form2_many,
    motion_at,
    squared_phase,
    tune,
    unit_mass_of_port,
)
from motions_made import made_motion

STEP = 0.05
ROWS = np.array([[1.0, 0.3, -0.4], [0.2, 1.1, 0.5]])
SQUARES = np.array([0.0, 40.0, 90.0])
JOINTS, OTHERS = np.diag([0.0, 0.2, 0.1]) + 0.02, np.diag([0.1, 0.0, 0.3])
STIFFNESS, DAMPING, ARMATURE = np.array([35.0, 80.0]), np.array([0.4, 0.2]), np.array([0.03, 0.05])
SEMI_IMPLICIT = ("Euler", "implicitfast")


def craft(integrator):
    tendons = ROWS.T @ np.diag(DAMPING) @ ROWS
    whole = JOINTS + OTHERS + tendons
    implicit = JOINTS if integrator == "Euler" else whole
    motion = made_motion(SQUARES, implicit, whole, integrator, STEP)
    return Craft(motion, ROWS, STIFFNESS, DAMPING)


def step_matrix(integrator, armature, damping):
    """Of `(M + h D_i) (v' - v) = -h (K y + D v)`, `y' = y + h v'` over (y, h v)."""
    mass = np.eye(3) + ROWS.T @ np.diag(armature) @ ROWS
    tendons = ROWS.T @ np.diag(damping) @ ROWS
    whole = JOINTS + OTHERS + tendons
    late = whole if integrator == "implicitfast" else JOINTS
    left = np.linalg.inv(mass + STEP * late)
    pull, keep = STEP**2 * left @ np.diag(SQUARES), np.eye(3) - STEP * left @ whole
    return np.block([[np.eye(3) - pull, keep], [-pull, keep]])


def upper(values):
    return np.sort_complex(values[values.imag > 1e-6])


@pytest.mark.parametrize("integrator", SEMI_IMPLICIT)
def test_poles_of_a_step_and_their_slopes(integrator):
    def poles(armature, damping):
        return upper(np.linalg.eigvals(step_matrix(integrator, armature, damping)))

    step = StepOfCraft.of(craft(integrator), ARMATURE, DAMPING)
    z, y = step.poles()
    order = np.argsort(z.real)
    z, y = z[order], y[:, order]
    assert z == pytest.approx(poles(ARMATURE, DAMPING))
    by_armature, by_damping = step.derivatives(z, y)
    for k in range(2):
        change = 1e-6 * np.eye(2)[k]
        quotient = (poles(ARMATURE + change, DAMPING) - poles(ARMATURE - change, DAMPING)) / 2e-6
        assert by_armature[:, k] == pytest.approx(quotient, rel=1e-5)
        quotient = (poles(ARMATURE, DAMPING + change) - poles(ARMATURE, DAMPING - change)) / 2e-6
        assert by_damping[:, k] == pytest.approx(quotient, rel=1e-5)
    wanted = z[::-1] * (1.0 + 1e-3j)
    assert step.paired(wanted)[0] == pytest.approx(z[::-1])


def test_poles_are_paired_by_how_far_off_they_are_of_their_own_turn():
    """Turns of 0.28 and 0.63: the first is 0.18 from 0.1 and 0.22 from 0.5, the other 0.61 and
    0.67."""
    poles, wanted = np.array([1.0 + 0.1j, 1.0 + 0.5j]), np.array([1.0 + 0.28j, 1.6 + 0.2j])
    for order in ([0, 1], [1, 0]):
        step = SimpleNamespace(poles=lambda order=order: (poles[order], np.eye(2)[:, order]))
        z, y = StepOfCraft.paired(step, wanted)
        assert z.tolist() == poles.tolist()
        assert y.tolist() == np.eye(2).tolist()


@pytest.mark.parametrize("integrator", SEMI_IMPLICIT)
def test_tuned_tendons_give_the_step_the_poles_that_are_wanted(integrator):
    wanted = upper(np.linalg.eigvals(step_matrix(integrator, ARMATURE, DAMPING)))
    found = tune([craft(integrator)], np.array([0.0, 0.02]), 1.3 * DAMPING, [wanted], STEP)
    assert found.error < 1e-10
    assert found.armature == pytest.approx(ARMATURE, rel=1e-7)
    assert found.damping == pytest.approx(DAMPING, rel=1e-7)


def test_poles_of_appendages_are_those_whose_energy_is_in_their_tendons():
    # three motions, of which a tendon holds the second and something else the third
    rows = np.array([[0.0, 2.0, 0.0]])
    squares, damping = np.array([0.0, 36.0, 25.0]), np.diag([0.0, 0.2, 0.1])
    motion = made_motion(squares, damping, damping, "implicit", STEP)
    made = Craft(motion, rows, np.array([9.0]), np.array([0.05]))
    (pole,) = made.appendage_poles()
    assert pole == pytest.approx(-0.1 + 1j * np.sqrt(36.0 - 0.01))


def test_a_step_grows_where_the_squared_phase_is_above_four():
    """At that limit a pole of the step is -1."""
    mass, spring, damper = np.array([[0.8]]), np.array([30.0]), np.array([2.0])
    poses = np.array([[[0.5]], [[0.8]]])  # the lighter is worst
    for integrator, sign in (("Euler", 1.0), ("implicitfast", -1.0)):
        got = squared_phase(integrator, poses, spring, damper / 4.0, np.array([0.1]), STEP)
        assert got == pytest.approx((STEP**2 * 30.0 + sign * STEP) / 0.6)
    h = brentq(lambda h: h**2 * 30.0 + 4.0 * h - 4.0 * 0.8, 0.01, 1.0)
    # z^2 - (2 - c h / m - k h^2 / m) z + 1 - c h / m at z = -1
    assert 1.0 + (2.0 - 2.0 * h / 0.8 - 30.0 * h**2 / 0.8) + 1.0 - 2.0 * h / 0.8 == pytest.approx(
        0.0, abs=1e-12
    )
    got = squared_phase("Euler", mass[None], spring, damper, np.zeros(1), h)
    assert got == pytest.approx(4.0)


def test_the_squared_phase_of_runge_kutta_is_eight_at_its_limit():
    mass, spring = np.array([[[0.8]]]), np.array([30.0])
    none = np.zeros(1)
    assert squared_phase("RK4", mass, spring, none, none, STEP) == pytest.approx(
        STEP**2 * 30.0 / 0.8
    )
    damper = np.array([3.0])
    pole = np.roots([0.8, 3.0, 30.0])[0]

    def grows(h):
        x = pole * h
        return abs(1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24) - 1.0

    limit = brentq(grows, 0.3, 0.8)
    assert squared_phase("RK4", mass, spring, damper, none, limit) == pytest.approx(8.0)
    assert squared_phase("RK4", mass, spring, damper, none, limit / 2) == pytest.approx(2.0)


@pytest.mark.parametrize("integrator", [*SEMI_IMPLICIT, "RK4"])
def test_modes_that_are_too_fast_are_slowed_until_the_step_is_stable(integrator):
    stiffness = np.array([[30.0, 4e4], [30.0, 900.0]])
    damping = np.array([[0.05, 0.8], [0.05, 0.1]])
    c = np.array([[[0.9, 0.1], [0.1, 0.5]]])
    found = form2_many(integrator, c[:, None], stiffness, damping, STEP)
    for k in range(2):
        mass = c[0] + np.diag(found.mass[k] - 1.0)
        got = squared_phase(
            integrator, mass[None], stiffness[k], found.damping[k], np.zeros(2), STEP
        )
        assert got <= (7.6 if integrator == "RK4" else 3.8) * (1.0 + 1e-6)
    assert found.slowed.tolist() == [[False, True], [False, False]]


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
def test_map_of_a_step_of_two_damped_springs(integrator):
    """Masses 2 and 5, springs to the world and a damped tendon between them."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="{STEP}" integrator="{integrator}"/><worldbody>
        <body><joint name="a" type="slide" axis="1 0 0" stiffness="8" damping=".6"/>
        <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
        <body><joint name="b" type="slide" axis="1 0 0" stiffness="3" damping=".2"/>
        <inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/></body></worldbody>
        <tendon><fixed stiffness="12" damping=".4"><joint joint="a" coef="1"/>
        <joint joint="b" coef="-1"/></fixed></tendon></mujoco>"""
    )
    h, mass = STEP, np.diag([2.0, 5.0])
    between = np.array([[1.0, -1.0], [-1.0, 1.0]])
    k, joints = np.diag([8.0, 3.0]) + 12.0 * between, np.diag([0.6, 0.2])
    d = joints + 0.4 * between
    if integrator == "RK4":
        inverse = np.linalg.inv(mass)
        a = h * np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ k, -inverse @ d]])
        powers = [np.linalg.matrix_power(a, n) for n in range(4)]
        mean = powers[0] + powers[1] / 2 + powers[2] / 6 + powers[3] / 24
        change, drive = a @ mean, h * mean[:, 2:] @ inverse
    else:
        late = d if integrator == "implicitfast" else joints
        left = np.linalg.inv(mass + h * late)
        faster = np.hstack([-h * left @ k, -h * left @ d])
        slower = h * faster + np.hstack([np.zeros((2, 2)), h * np.eye(2)])
        change = np.vstack([slower, faster])
        drive = np.vstack([h**2 * left, h * left])
    motion = motion_at(model)
    back = np.linalg.inv(motion.shapes)
    to = np.block([[back, np.zeros((2, 2))], [np.zeros((2, 2)), h * back]])
    assert motion.difference == pytest.approx(to @ change @ np.linalg.inv(to), abs=1e-9)
    # a force F is shapes^T F on the y
    assert motion.drive @ motion.shapes.T == pytest.approx(to @ drive, abs=1e-9)
    poles = np.linalg.eigvals(np.eye(4) + change)
    assert motion.growth == pytest.approx(np.max(np.abs(poles)))
    assert np.sort_complex(1.0 + motion.step_poles()) == pytest.approx(np.sort_complex(poles))
    inverse = np.linalg.inv(mass)
    flow = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ k, -inverse @ d]])
    found = np.sort_complex(motion.continuous_poles())
    assert found == pytest.approx(np.sort_complex(h * np.linalg.eigvals(flow)), rel=1e-6)


# -- step limits -----------------------------------------------------------------------------------
K, D, AT_JOINTS, IN_STEP, OF_TENDONS = 50.0, 0.8, 0.3, 14.0, 9.0
LIMITED = LinearModel(*(np.array([[v]]) for v in (K, D, AT_JOINTS, IN_STEP, OF_TENDONS)))


def one_step(integrator, h, of_tendons=OF_TENDONS):
    """Of `y'' + D y' + K y = 0` over (y, h v), as MuJoCo's integrators take it."""
    if integrator == "RK4":
        a = h * np.array([[0.0, 1.0 / h], [-K * h, -D]])
        powers = [np.linalg.matrix_power(a, n) for n in range(5)]
        return powers[0] + powers[1] + powers[2] / 2 + powers[3] / 6 + powers[4] / 24
    late = AT_JOINTS if integrator == "Euler" else D
    left = 1.0 + h * late
    kept = 1.0 - h * (D - late)
    if integrator == "discrete":
        # springs at the end of the step; those of tendons for the position alone
        pull = h**2 * K / (left + h**2 * (IN_STEP + of_tendons))
        keep = kept / (left + h**2 * IN_STEP)
    else:
        pull, keep = h**2 * K / left, kept / left
    return np.array([[1.0 - pull, keep], [-pull, keep]])


EVERY = ("Euler", "implicit", "implicitfast", "discrete", "RK4")


@pytest.mark.parametrize("integrator", EVERY)
def test_what_a_step_shows_of_a_damped_spring(integrator):
    pole = complex(-D / 2.0, np.sqrt(K - D**2 / 4.0))
    assert np.max(LIMITED.poles().imag) == pytest.approx(pole.imag)
    for h in (0.02, 0.1):
        z = np.linalg.eigvals(one_step(integrator, h))
        found = np.linalg.eigvals(LIMITED.step(integrator, h))
        assert np.sort_complex(found) == pytest.approx(np.sort_complex(z), rel=1e-9)
        shown = np.log(z[np.argmax(z.imag)]) / h
        assert LIMITED.shown(integrator, h, np.array([pole]))[0] == pytest.approx(shown)
    for error in (1e-2, 1e-4):
        step = LIMITED.step_for_error(integrator, pole, error, 0.2)
        z = np.linalg.eigvals(one_step(integrator, step))
        off = abs(abs(np.log(z[np.argmax(z.imag)])) / step / abs(pole) - 1.0)
        assert off == pytest.approx(error, rel=1e-4) or (step > 0.19 and off < error)


@pytest.mark.parametrize("integrator", EVERY)
@pytest.mark.parametrize("of_tendons", [0.0, 3.0])
def test_the_largest_step_is_where_a_pole_leaves_the_unit_circle(integrator, of_tendons):
    matrices = (np.array([[v]]) for v in (K, D, AT_JOINTS, IN_STEP, of_tendons))

    def grows(h):
        return np.max(np.abs(np.linalg.eigvals(one_step(integrator, h, of_tendons)))) - 1.0

    found = LinearModel(*matrices).largest_step(integrator)
    assert np.isfinite(found)
    assert grows(found * (1.0 - 1e-6)) < 0.0 < grows(found * (1.0 + 1e-6))


def test_a_free_port_in_units_of_its_own_mass():
    # one mode: (1 - l^2 / m) q'' + 2 zeta w q' + w^2 q = 0
    model = PortModel(
        np.array([[4.0]]), np.array([3.0]), np.array([[1.2]]), damping=np.array([0.02])
    )
    left = 1.0 - 1.2**2 / 4.0
    stiffness, damping = unit_mass_of_port(model)
    assert stiffness[0, 0] == pytest.approx(9.0 / left)
    assert damping[0, 0] == pytest.approx(0.12 / left)
