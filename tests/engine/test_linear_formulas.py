"""Linear models of dense matrices: their own equations beside every form of them."""

import mujoco
import numpy as np
import pytest
from scipy.linalg import block_diag, eigh

from beamchain import Linear, PortModel
from formulas import (
    Activations,
    Inputs,
    Outputs,
    Signal,
    activation_names,
    coordinate_names,
    rigid_body,
    slopes,
)

NV, NA, M, P = 4, 2, 3, 2
OMEGA = np.array([0.6, 2.3])


def spread(random, size):
    rows = random.normal(size=(size, size))
    return rows @ rows.T + size * np.eye(size)


def dense(*, active=True, loose=0):
    """All matrices full; `loose`: coordinates without a spring."""
    random = np.random.default_rng(11)
    stiffness = 3.0 * spread(random, NV)
    stiffness[:loose], stiffness[:, :loose] = 0.0, 0.0
    na = NA if active else 0
    names = [Signal(f"q{k}", "m") for k in range(NV)]
    return Linear(
        spread(random, NV),
        random.normal(size=(NV, NV)),
        stiffness,
        tuple(names),
        Inputs(tuple(Signal(f"u{k}", "N") for k in range(M)), random.normal(size=(NV, M))),
        Outputs(
            tuple(Signal(f"y{k}", "m") for k in range(P)),
            *random.normal(size=(3, P, NV)),
            random.normal(size=(P, M)),
        ),
        Activations(
            ("lag",) * na,
            random.normal(size=(NV, na)),
            -2.0 * np.eye(na) + random.normal(size=(na, na)) / 3.0,
            random.normal(size=(na, M)),
            random.normal(size=(P, na)),
        ),
    )


def response(linear, omega):
    """From the equations: s a = L a + E u; (s^2 M + s D + K) q = F a + B u."""
    out = []
    for s in 1j * omega:
        a = linear.activations
        lag = np.linalg.inv(s * np.eye(len(a.names)) - a.rate) @ a.feed
        dynamic = s**2 * linear.mass + s * linear.damping + linear.stiffness
        q = np.linalg.inv(dynamic) @ (linear.inputs.force + a.force @ lag)
        y = linear.outputs
        seen = y.position @ q + s * y.rate @ q + s**2 * y.acceleration @ q
        out.append(seen + y.feedthrough + a.seen @ lag)
    return np.moveaxis(np.array(out), 0, -1)


@pytest.mark.parametrize("active", [True, False])
def test_response_and_states_are_those_of_the_equations(active):
    linear = dense(active=active)
    wanted = response(linear, OMEGA)
    assert linear.response(OMEGA) == pytest.approx(wanted, rel=1e-11)
    a, b, c, d = linear.first_order()
    assert a.shape == (2 * NV + linear.activations.force.shape[1],) * 2
    for k, s in enumerate(1j * OMEGA):
        found = c @ np.linalg.inv(s * np.eye(len(a)) - a) @ b + d
        assert found == pytest.approx(wanted[:, :, k], rel=1e-11)
    assert a[0, NV] == 1.0  # q, then q'


def test_what_is_picked_keeps_its_responses():
    linear = dense()
    picked = linear.picked([2, 0], [1])
    assert picked.response(OMEGA) == pytest.approx(response(linear, OMEGA)[[1]][:, [2, 0]])
    assert [signal.name for signal in picked.inputs.signals] == ["u2", "u0"]
    assert [signal.name for signal in picked.outputs.signals] == ["y1"]


def test_other_coordinates_of_all_motions_have_the_same_responses():
    linear = dense()
    motion = spread(np.random.default_rng(2), NV) + 0.3 * np.triu(np.ones((NV, NV)))
    names = [Signal(f"x{k}", "") for k in range(NV)]
    other = linear.in_coordinates(motion, names)
    assert other.response(OMEGA) == pytest.approx(response(linear, OMEGA), rel=1e-9)
    assert other.coordinates == tuple(names)
    assert other.mass == pytest.approx(motion.T @ linear.mass @ motion)


def test_on_a_body_the_response_is_its_accelerance():
    linear = dense()
    motion = np.random.default_rng(5).normal(size=(6, NV))
    on_body = linear.on_body(motion)
    for k, s in enumerate(1j * OMEGA):
        dynamic = linear.mass + linear.damping / s + linear.stiffness / s**2
        wanted = motion @ np.linalg.inv(dynamic) @ motion.T
        assert on_body.response(OMEGA)[:, :, k] == pytest.approx(wanted, rel=1e-11)
    assert [s.name for s in on_body.inputs.signals][2:4] == ["force_z", "torque_x"]
    assert [s.unit for s in on_body.inputs.signals] == ["N"] * 3 + ["N m"] * 3
    units = [s.unit for s in on_body.outputs.signals]
    assert units == ["m/s^2"] * 3 + ["rad/s^2"] * 3
    free = rigid_body(motion @ motion.T + np.eye(6))
    wanted = np.linalg.inv(motion @ motion.T + np.eye(6))
    assert free.response(OMEGA)[:, :, 1] == pytest.approx(wanted, rel=1e-9)
    assert [(s.name, s.unit) for s in free.coordinates][2:4] == [
        ("position_z", "m"),
        ("attitude_x", "rad"),
    ]


def test_appendages_stand_behind_the_coordinates_with_their_roots_motion():
    linear = dense()
    random = np.random.default_rng(8)
    models = [
        PortModel(
            spread(random, 6) + 20.0 * np.eye(6),
            np.sort(random.uniform(0.5, 3.0, n)),
            random.normal(size=(n, 6)),
            np.linspace(0.02, 0.05, n),
        )
        for n in (2, 1)
    ]
    roots = random.normal(size=(2, 6, NV))
    whole = linear.with_appendages(models, roots)
    mass = block_diag(linear.mass, np.eye(3))
    at = NV
    for model, root in zip(models, roots, strict=True):
        mass[:NV, :NV] += root.T @ model.rigid_mass @ root
        modes = slice(at, at + model.modes)
        mass[modes, :NV] = model.participation @ root
        mass[:NV, modes] = mass[modes, :NV].T
        at += model.modes
    w = np.concatenate([model.frequencies for model in models])
    ratio = np.concatenate([model.damping for model in models])
    assert whole.mass == pytest.approx(mass, rel=1e-12)
    assert whole.stiffness == pytest.approx(block_diag(linear.stiffness, np.diag(w**2)))
    assert whole.damping == pytest.approx(block_diag(linear.damping, np.diag(2.0 * ratio * w)))
    assert [s.name for s in whole.coordinates][-2:] == ["mode 2", "mode 3"]
    # condensed to the roots it is the dynamic mass
    found = linear.response(OMEGA, models, roots)
    assert found == pytest.approx(response(whole, OMEGA), rel=1e-9)


def test_condensed_modes_are_kept_and_the_static_response_of_the_rest():
    random = np.random.default_rng(4)
    size, loose = 9, 1
    mass, stiffness = spread(random, size), 40.0 * spread(random, size)
    stiffness[:loose], stiffness[:, :loose] = 0.0, 0.0
    nothing, one = np.zeros((1, size)), random.normal(size=(1, size))
    none = np.zeros((size, 0))
    linear = Linear(
        mass,
        np.zeros((size, size)),
        stiffness,
        tuple(Signal(f"q{k}", "m") for k in range(size)),
        Inputs((Signal("u", "N"),), random.normal(size=(size, 1))),
        Outputs((Signal("y", "m"),), nothing, nothing, one, np.zeros((1, 1))),
        Activations((), none, np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))),
    )
    squares, shapes = eigh(stiffness, mass)
    w = np.sqrt(np.maximum(squares, 0.0))
    fewer = linear.condensed(1.0001 * w[3])  # three modes, and one static shape each
    assert len(fewer.coordinates) == loose + 3 + 2
    assert [s.name for s in fewer.coordinates][-1] == "shape 6"
    found = np.sqrt(np.maximum(eigh(fewer.stiffness, fewer.mass)[0], 0.0))
    assert found[1:4] == pytest.approx(w[1:4], rel=1e-9)
    # the modes kept answer as they did; the others as at rest
    products = (one @ shapes).ravel() * (shapes.T @ linear.inputs.force).ravel()
    s = 1j * OMEGA * 1e-3
    kept = products[:1].sum() + (products[1:4, None] * s**2 / (s**2 + squares[1:4, None])).sum(0)
    at_rest = (products[4:, None] * s**2 / squares[4:, None]).sum(0)
    assert fewer.response(OMEGA * 1e-3)[0, 0] == pytest.approx(kept + at_rest, rel=1e-7)
    assert linear.condensed(1.0001 * w[-1]) is linear


def test_slopes_by_five_points_are_exact_to_the_fourth_power():
    def function(i, by):
        x = np.array([0.3, 0.7])
        x[i] += by
        return np.array([x[0] ** 4 - x[1] ** 3, 2.0 * x[0] * x[1], x[1] ** 4])

    wanted = np.array([[4.0 * 0.027, -3.0 * 0.49], [1.4, 0.6], [0.0, 4.0 * 0.343]])
    assert slopes(function, 2, 0.2) == pytest.approx(wanted, rel=1e-12, abs=1e-14)
    assert slopes(function, 0, 0.2).shape == (0, 0)


JOINTS = """<mujoco><worldbody><body name="bus"><freejoint name="free"/><geom size=".1"/>
<body><joint name="ball" type="ball"/><geom size=".1"/><body><joint type="slide"/>
<joint name="hinge"/><geom size=".1"/></body></body></body>{more}</worldbody><actuator>
<motor joint="hinge"/><general name="lag" joint="hinge" dyntype="filter"/></actuator></mujoco>"""


@pytest.mark.parametrize("several", [False, True])
def test_names_of_coordinates_and_of_states_of_actuators(several):
    more = '<body name="other"><freejoint name="loose"/><geom size=".1"/></body>'
    model = mujoco.MjModel.from_xml_string(JOINTS.format(more=more if several else ""))
    found = [(s.name, s.unit) for s in coordinate_names(model)]
    wanted = [
        *((f"ball_{axis}", "rad") for axis in "xyz"),
        ("joint 2", "m"),
        ("hinge", "rad"),
    ]
    assert found[6:11] == wanted
    prefix = "bus_" if several else ""
    assert found[2:4] == [(f"{prefix}position_z", "m"), (f"{prefix}attitude_x", "rad")]
    assert len(found) == (17 if several else 11)
    assert activation_names(model) == ("lag",)
