"""Closed forms beside a linear model: its states, its response, its smaller forms, all of dense
matrices."""

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from beamchain import PortModel
from formulas import (
    Activations,
    Inputs,
    Outputs,
    Signal,
    activation_names,
    coordinate_names,
    slopes,
)

RANDOM = np.random.default_rng(8)
N, ACTS, IN, OUT = 4, 2, 3, 2
OMEGA = np.array([0.4, 1.7, 6.0])


def spread(size, least=1.0):
    rows = RANDOM.normal(size=(size, size))
    return rows @ rows.T + least * np.eye(size)


M, K = spread(N, 3.0), spread(N)
D = 0.1 * RANDOM.normal(size=(N, N))
B, F = RANDOM.normal(size=(N, IN)), RANDOM.normal(size=(N, ACTS))
L, E = -spread(ACTS), RANDOM.normal(size=(ACTS, IN))
Y0, Y1, Y2 = (RANDOM.normal(size=(OUT, N)) for _ in range(3))
YU, YA = RANDOM.normal(size=(OUT, IN)), RANDOM.normal(size=(OUT, ACTS))


def names(letter, count):
    return tuple(Signal(f"{letter}{k}", "m") for k in range(count))


def linear(stiffness=K):
    return bc.Linear(
        M,
        D,
        stiffness,
        names("q", N),
        Inputs(names("u", IN), B),
        Outputs(names("y", OUT), Y0, Y1, Y2, YU),
        Activations(("one", "two"), F, L, E, YA),
    )


def response(s, appendages=0.0):
    """y = Y2 q'' + Y1 q' + Y0 q + Yu u + Ya a of M q'' + D q' + K q = F a + B u, a' = L a + E u."""
    a = np.linalg.solve(s * np.eye(ACTS) - L, E)
    q = np.linalg.solve(s**2 * (M + appendages) + s * D + K, F @ a + B)
    return (Y2 * s**2 + Y1 * s + Y0) @ q + YU + YA @ a


def test_response_and_states_with_actuators_that_lag():
    wanted = np.moveaxis([response(1j * w) for w in OMEGA], 0, -1)
    assert linear().response(OMEGA) == pytest.approx(wanted, rel=1e-11)
    a, b, c, d = linear().first_order()
    assert a.shape == (2 * N + ACTS, 2 * N + ACTS)
    found = [c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b) + d for w in OMEGA]
    assert np.moveaxis(found, 0, -1) == pytest.approx(wanted, rel=1e-11)
    # positions stand first, then their rates
    assert a[:N] == pytest.approx(np.eye(2 * N + ACTS)[N : 2 * N])
    assert a[N : 2 * N, :N] == pytest.approx(-np.linalg.solve(M, K))


def test_some_inputs_and_outputs():
    found = linear().picked([2, 0], [1])
    wanted = [response(1j * w)[np.ix_([1], [2, 0])] for w in OMEGA]
    assert found.response(OMEGA) == pytest.approx(np.moveaxis(wanted, 0, -1), rel=1e-11)
    assert [one.name for one in found.inputs.signals] == ["u2", "u0"]
    assert [one.name for one in found.outputs.signals] == ["y1"]


def test_other_coordinates_have_the_same_response():
    turn = RANDOM.normal(size=(N, N))
    found = linear().in_coordinates(turn, names("x", N))
    wanted = np.moveaxis([response(1j * w) for w in OMEGA], 0, -1)
    assert found.response(OMEGA) == pytest.approx(wanted, rel=1e-9)
    assert found.stiffness == pytest.approx(turn.T @ K @ turn)
    fewer = linear().in_coordinates(turn[:, :2], names("x", 2))
    assert fewer.damping == pytest.approx(turn[:, :2].T @ D @ turn[:, :2])


def test_the_accelerance_of_a_body():
    motion = RANDOM.normal(size=(6, N))
    found = linear().on_body(motion)
    for k, w in enumerate(OMEGA):
        s = 1j * w
        inner = np.linalg.inv(s**2 * M + s * D + K)
        assert found.response(OMEGA)[:, :, k] == pytest.approx(s**2 * motion @ inner @ motion.T)
    assert [one.name for one in found.inputs.signals][::3] == ["force_x", "torque_x"]
    assert [tuple(one) for one in found.outputs.signals][2:4] == [
        ("acceleration_z", "m/s^2"),
        ("angular_acceleration_x", "rad/s^2"),
    ]
    assert found.outputs.feedthrough.shape == (6, 6)


def appendage(modes):
    return PortModel(
        spread(6, 4.0),
        np.sort(RANDOM.uniform(1.0, 4.0, modes)),
        RANDOM.normal(size=(modes, 6)) / 3.0,
        RANDOM.uniform(0.01, 0.05, modes),
    )


def test_appendages_on_a_model():
    """D(s) = M - s^2 L^T (s^2 + 2 z w s + w^2)^-1 L at each root, by the response and by modal
    coordinates."""
    models, roots = [appendage(2), appendage(1)], [RANDOM.normal(size=(6, N)) for _ in range(2)]
    wanted = []
    for w in OMEGA:
        s, more = 1j * w, np.zeros((N, N), dtype=complex)
        for model, root in zip(models, roots, strict=True):
            own = model.frequencies
            gain = s**2 / (s**2 + 2.0 * model.damping * own * s + own**2)
            rows = model.participation
            more += root.T @ (model.rigid_mass - rows.T @ np.diag(gain) @ rows) @ root
        wanted.append(response(s, more))
    wanted = np.moveaxis(wanted, 0, -1)
    assert linear().response(OMEGA, models, roots) == pytest.approx(wanted, rel=1e-10)
    found = linear().with_appendages(models, roots)
    assert found.response(OMEGA) == pytest.approx(wanted, rel=1e-10)
    assert [one.name for one in found.coordinates][N - 1 :] == ["q3", "mode 1", "mode 2", "mode 3"]


def test_fewer_coordinates_keep_the_slow_modes_and_what_is_static():
    """Without dampers: the modes up to there, and all that a constant load does."""
    size = 8
    mass, stiffness = spread(size, 4.0), spread(size)
    stiffness[0] = stiffness[:, 0] = 0.0  # one rigid motion
    squares = eigh(stiffness, mass, eigvals_only=True)
    w = np.sqrt(np.clip(squares, 0.0, None))
    force, seen = RANDOM.normal(size=(size, 1)), RANDOM.normal(size=(1, size))
    none = np.zeros((size, 0))
    whole = bc.Linear(
        mass,
        np.zeros((size, size)),
        stiffness,
        names("q", size),
        Inputs(names("u", 1), force),
        Outputs(names("y", 1), 0.0 * seen, 0.0 * seen, seen, np.zeros((1, 1))),
        Activations((), none, np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))),
    )
    above = float(w[3] + w[4]) / 2.0
    found = whole.condensed(above)
    # one rigid motion, three modes, and what the load and the output have of those beyond
    assert len(found.coordinates) == 6
    assert found.coordinates[5].name == "shape 6"
    own = np.linalg.eigvals(np.linalg.solve(found.mass, found.stiffness))
    own = np.sqrt(np.clip(np.sort(own.real), 0.0, None))
    assert own[1:4] == pytest.approx(w[1:4], rel=1e-9)
    # what is left out falls as the fourth power of frequency
    for omega, miss in ((0.02, 1e-7), (0.2, 1e-3)):
        at = np.array([omega * w[1]])
        exact, ours = (one.response(at)[0, 0, 0] for one in (whole, found))
        rigid = whole.response(np.array([1e-4 * w[1]]))[0, 0, 0]
        assert abs(ours - exact) < miss * abs(exact - rigid)
    assert whole.condensed(2.0 * w[-1]) is whole


# -- slopes ----------------------------------------------------------------------------------------
def test_slopes_of_a_polynomial_of_degree_four_are_exact():
    """Five points see no even power, and of a fifth 4 steps^4."""

    def function(i, x):
        return np.array([2.0 + 3.0 * x, i + 5.0 * x + 7.0 * x**2 + 11.0 * x**3 + 13.0 * x**4])

    assert slopes(function, 2, 0.3) == pytest.approx(np.array([[3.0, 3.0], [5.0, 5.0]]), rel=1e-12)
    fifth = slopes(lambda i, x: np.array([x**5 + i]), 1, 0.3)
    assert fifth == pytest.approx(np.array([[-4.0 * 0.3**4]]), rel=1e-10)
    assert slopes(function, 0, 0.3).shape == (0, 0)


def test_coordinates_and_activations_have_names():
    bodies = """<body name="{0}"><freejoint name="{0}"/><geom size=".1"/><body><joint type="ball"
    name="ball{0}"/><geom size=".1"/></body><body><joint type="slide"/><geom size=".1"/></body>
    <body><joint name="turn{0}"/><geom size=".1"/></body></body>"""
    actuators = """<actuator><motor name="plain" joint="turna"/><general name="lag"
    joint="turna" dyntype="filter" dynprm="1"/><general joint="turna" dyntype="integrator"/>
    </actuator>"""
    one = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{bodies.format('a')}</worldbody>{actuators}</mujoco>"
    )
    found = [tuple(signal) for signal in coordinate_names(one)]
    assert found == [
        *((f"position_{axis}", "m") for axis in "xyz"),
        *((f"attitude_{axis}", "rad") for axis in "xyz"),
        *((f"balla_{axis}", "rad") for axis in "xyz"),
        ("joint 2", "m"),
        ("turna", "rad"),
    ]
    assert activation_names(one) == ("lag", "actuator 2")
    two = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{bodies.format('a')}{bodies.format('b')}</worldbody></mujoco>"
    )
    found = [signal.name for signal in coordinate_names(two)]
    assert found[:6:5] == ["a_position_x", "a_attitude_z"]
    assert found[11] == "b_position_x"


def test_a_linear_model_of_wheels_wrenches_and_lags():
    """A body that turns at a rate beside what is found: gyroscopic moments are not symmetric, and
    dampers are; a wrench at a site is felt with its arm."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 -9"/><worldbody><body name="hub"><freejoint/>
        <inertial pos="0 0 0" mass="40" diaginertia="5 6 7"/><site name="port" pos=".5 .2 -.3"/>
        <body name="rotor"><joint name="wheel" axis="0 1 0" damping=".4" stiffness="3"/>
        <inertial pos="0 0 0" mass="2" diaginertia=".2 .3 .2"/></body></body></worldbody>
        <actuator><general name="lag" joint="wheel" dyntype="filter" dynprm=".5" gear="3"/>
        <motor name="spin" joint="wheel" gear="2"/></actuator>
        <sensor><gyro name="gyro" site="port"/><accelerometer name="felt" site="port"/></sensor>
        </mujoco>"""
    )
    inputs = ["lag", "spin", "wrench:port"]
    found = bc.Linear.of(model, inputs, ["gyro", "felt"], rates={"wheel": 50.0})
    momentum = 0.3 * 50.0
    damping = np.zeros((7, 7))
    damping[6, 6] = 0.4
    # h along y: w x h is (-w_z, 0, w_x) times it
    damping[3, 5], damping[5, 3] = -momentum, momentum
    assert found.damping == pytest.approx(damping, abs=1e-9)
    stiffness = np.zeros((7, 7))
    stiffness[6, 6] = 3.0
    assert found.stiffness == pytest.approx(stiffness, abs=1e-9)
    force = np.zeros((7, 8))
    force[6, 1] = 2.0
    force[:3, 2:5] = force[3:6, 5:8] = np.eye(3)
    for k in range(3):
        force[3:6, 2 + k] = np.cross([0.5, 0.2, -0.3], np.eye(3)[k])
    assert found.inputs.force == pytest.approx(force, abs=1e-9)
    assert found.activations.force == pytest.approx(np.array([[0.0]] * 6 + [[3.0]]), abs=1e-9)
    assert found.activations.rate == pytest.approx(np.array([[-2.0]]))
    assert found.activations.feed == pytest.approx(np.array([[2.0] + [0.0] * 7]), abs=1e-9)
    assert found.outputs.rate[:3, 3:6] == pytest.approx(np.eye(3), abs=1e-9)
    arm = np.array([[0.0, -0.3, -0.2], [0.3, 0.0, 0.5], [0.2, -0.5, 0.0]])
    assert found.outputs.acceleration[3:, :3] == pytest.approx(np.eye(3), abs=1e-9)
    assert found.outputs.acceleration[3:, 3:6] == pytest.approx(arm, abs=1e-9)
    assert np.abs(found.outputs.position).max() < 1e-6
    assert np.abs(found.outputs.feedthrough).max() < 1e-9
