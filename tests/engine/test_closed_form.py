"""A and B against closed forms, as MuJoCo's test/engine/engine_derivative_test.cc, LinearSystem,
does for hinge chains."""

import mujoco
import numpy as np
import pytest

from appendages import close
from beamchain import linearise
from mechanics import INTEGRATORS

# finite differences of a smooth step, relative to the largest entry of each block
DERIVATIVE = 1e-9
SEMI_IMPLICIT = ["Euler", "implicit", "implicitfast"]


def relative_to_block(ours, expected):
    """Largest difference over the largest entry."""
    return float(np.max(np.abs(ours - expected)) / np.max(np.abs(expected)))


def pendulum(lengths, masses, springs, dampers, h, integrator):
    """A chain of hinges hung on the world, point mass and small sphere at the end of
    every rod; no gravity."""
    body, close_tags = "", ""
    x = 0.0
    for i, (length, m, k, d) in enumerate(zip(lengths, masses, springs, dampers, strict=True)):
        body += (
            f'<body name="b{i}" pos="{x!r} 0 0"><joint name="j{i}" type="hinge" axis="0 0 1" '
            f'stiffness="{k!r}" damping="{d!r}"/><inertial pos="{length!r} 0 0" mass="{m!r}" '
            'diaginertia="0.01 0.01 0.01"/>'
        )
        close_tags += "</body>"
        x = length
    motors = "".join(f'<motor joint="j{i}"/>' for i in range(len(lengths)))
    sensors = "".join(f'<jointpos joint="j{i}"/>' for i in range(len(lengths)))
    return (
        f'<mujoco><option timestep="{h!r}" integrator="{integrator}" gravity="0 0 '
        f'0"/><worldbody>{body}{close_tags}'
        f"</worldbody><actuator>{motors}</actuator><sensor>{sensors}</sensor></mujoco>"
    )


def pendulum_mass(lengths, masses):
    """Mass matrix in joint angles at rest, written out:
    mass i moves by (x_i - x_j) per unit of joint j <= i."""
    nodes = np.cumsum(lengths)
    hinges = nodes - lengths
    count = len(lengths)
    out = np.zeros((count, count))
    for i in range(count):
        arm = np.where(np.arange(count) <= i, nodes[i] - hinges, 0.0)
        turn = (np.arange(count) <= i) * 1.0
        out += masses[i] * np.outer(arm, arm) + 0.01 * np.outer(turn, turn)
    return out


PENDULUMS = {
    2: ((0.5, 0.8), (1.3, 0.4), (2.0, 5.0), (0.02, 0.05)),
    3: ((0.5, 0.8, 0.3), (1.3, 0.4, 0.7), (2.0, 5.0, 3.0), (0.02, 0.05, 0.01)),
}


def test_two_links_by_hand():
    # M of two point masses, the textbook double pendulum stretched out
    (l1, l2), (m1, m2), _, _ = PENDULUMS[2]
    m11 = m1 * l1**2 + m2 * (l1 + l2) ** 2 + 0.02
    m12 = m2 * l2 * (l1 + l2) + 0.01
    m22 = m2 * l2**2 + 0.01
    assert pendulum_mass((l1, l2), (m1, m2)) == close(np.array([[m11, m12], [m12, m22]]), rel=1e-15)


@pytest.mark.parametrize("integrator", SEMI_IMPLICIT)
@pytest.mark.parametrize("h", [1e-3, 0.1])
@pytest.mark.parametrize("count", [2, 3])
def test_a_and_b_are_the_semi_implicit_step(count, h, integrator):
    lengths, masses, springs, dampers = PENDULUMS[count]
    m = pendulum_mass(lengths, masses)
    k = np.diag(springs)
    d = np.diag(dampers)
    linear = linearise(pendulum(lengths, masses, springs, dampers, h, integrator))
    # v+ = v + h (M + h D)^-1 (-K q - D v + u), q+ = q + h v+
    solve = np.linalg.inv(m + h * d)
    vq = -h * solve @ k
    vv = solve @ m
    vu = h * solve
    eye = np.eye(count)
    blocks = {
        "qq": (linear.a[:count, :count], eye + h * vq),
        "qv": (linear.a[:count, count:], h * vv),
        "vq": (linear.a[count:, :count], vq),
        "vv": (linear.a[count:, count:], vv),
        "qu": (linear.b[:count], h * vu),
        "vu": (linear.b[count:], vu),
    }
    for ours, expected in blocks.values():
        assert relative_to_block(ours, expected) < DERIVATIVE
    assert relative_to_block(linear.stiffness, np.linalg.solve(m, k)) < 1e-8
    assert relative_to_block(linear.inputs, np.linalg.inv(m)) < 1e-8
    # (X - 1) / h: rounding over h
    assert np.max(np.abs(linear.damping - np.linalg.solve(m, d))) < 1e-8 / h
    assert linear.c == close(np.hstack([eye, 0 * eye]), abs=DERIVATIVE)
    assert linear.d == close(0 * eye, abs=DERIVATIVE)


@pytest.mark.parametrize("h", [1e-3, 0.1])
def test_the_discrete_integrator_is_implicit_in_stiffness(h):
    if "discrete" not in INTEGRATORS:
        pytest.skip("this MuJoCo has no `discrete` integrator")
    lengths, masses, springs, _ = PENDULUMS[2]
    m = pendulum_mass(lengths, masses)
    k = np.diag(springs)
    linear = linearise(pendulum(lengths, masses, springs, (0.0, 0.0), h, "discrete"))
    # v+ = v - h M^-1 K (q + h v+)
    solve = np.linalg.inv(m + h**2 * k)
    assert relative_to_block(linear.a[2:, :2], -h * solve @ k) < DERIVATIVE
    assert relative_to_block(linear.a[2:, 2:], solve @ m) < DERIVATIVE


@pytest.mark.parametrize("h", [1e-3, 0.1])
def test_rk4_is_the_taylor_polynomial_and_mujoco_s_own_step(h):
    lengths, masses, springs, dampers = PENDULUMS[3]
    text = pendulum(lengths, masses, springs, dampers, h, "RK4")
    linear = linearise(text)
    m = pendulum_mass(lengths, masses)
    f = np.block(
        [
            [np.zeros((3, 3)), np.eye(3)],
            [-np.linalg.solve(m, np.diag(springs)), -np.linalg.solve(m, np.diag(dampers))],
        ]
    )
    g = np.vstack([np.zeros((3, 3)), np.linalg.inv(m)])
    hf = h * f
    a = np.eye(6) + hf + hf @ hf / 2 + hf @ hf @ hf / 6 + hf @ hf @ hf @ hf / 24
    b = h * (np.eye(6) + hf / 2 + hf @ hf / 6 + hf @ hf @ hf / 24) @ g
    assert relative_to_block(linear.a, a) < DERIVATIVE
    assert relative_to_block(linear.b, b) < DERIVATIVE

    # the same from MuJoCo's own RK4 steps, centred differences
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    eps = 1e-4
    for column in range(9):
        ends = []
        for sign in (1.0, -1.0):
            mujoco.mj_resetData(model, data)
            for target_, at in (
                (data.qpos, column),
                (data.qvel, column - 3),
                (data.ctrl, column - 6),
            ):
                if 0 <= at < 3:
                    target_[at] = sign * eps
            mujoco.mj_step(model, data)
            ends.append(np.concatenate([data.qpos, data.qvel]))
        slope = (ends[0] - ends[1]) / (2 * eps)
        expected = np.hstack([linear.a, linear.b])[:, column]
        # third derivatives times eps^2
        assert slope == close(expected, abs=1e-6 * np.max(np.abs(expected)))
