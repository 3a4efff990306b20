"""Closed forms beside a linear model: its states, its response, its smaller and larger forms, all
of dense matrices; and beside that of a craft."""

import mujoco
import numpy as np
import pytest
from scipy.linalg import block_diag, eigh

import beamchain as bc
from beamchain import PortModel
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

N, ACTS, IN, OUT = 4, 2, 3, 2
OMEGA = np.array([0.4, 1.7, 6.0])
RANDOM = np.random.default_rng(8)


def spread(size, least=1.0, random=RANDOM):
    rows = random.normal(size=(size, size))
    return rows @ rows.T + least * np.eye(size)


M, K = spread(N, 3.0), spread(N)
D = 0.1 * RANDOM.normal(size=(N, N))
B, F = RANDOM.normal(size=(N, IN)), RANDOM.normal(size=(N, ACTS))
L, E = -spread(ACTS), RANDOM.normal(size=(ACTS, IN))
Y0, Y1, Y2 = (RANDOM.normal(size=(OUT, N)) for _ in range(3))
YU, YA = RANDOM.normal(size=(OUT, IN)), RANDOM.normal(size=(OUT, ACTS))


@pytest.fixture
def random():
    return np.random.default_rng(5)


def names(letter, count):
    return tuple(Signal(f"{letter}{k}", "m") for k in range(count))


def linear(acts=ACTS):
    return bc.Linear(
        M,
        D,
        K,
        names("q", N),
        Inputs(names("u", IN), B),
        Outputs(names("y", OUT), Y0, Y1, Y2, YU),
        Activations(("one", "two")[:acts], F[:, :acts], L[:acts, :acts], E[:acts], YA[:, :acts]),
    )


def response(acts=ACTS, appendages=np.zeros_like):
    """y = Y2 q'' + Y1 q' + Y0 q + Yu u + Ya a of M q'' + D q' + K q = F a + B u, a' = L a + E u."""
    out = []
    for s in 1j * OMEGA:
        a = np.linalg.solve(s * np.eye(acts) - L[:acts, :acts], E[:acts])
        q = np.linalg.solve(s**2 * (M + appendages(s)) + s * D + K, F[:, :acts] @ a + B)
        out.append((Y2 * s**2 + Y1 * s + Y0) @ q + YU + YA[:, :acts] @ a)
    return np.moveaxis(out, 0, -1)


@pytest.mark.parametrize("acts", [ACTS, 0])
def test_response_and_states_are_those_of_the_equations(acts):
    wanted = response(acts)
    assert linear(acts).response(OMEGA) == pytest.approx(wanted, rel=1e-11)
    a, b, c, d = linear(acts).first_order()
    assert a.shape == (2 * N + acts, 2 * N + acts)
    found = [c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b) + d for w in OMEGA]
    assert np.moveaxis(found, 0, -1) == pytest.approx(wanted, rel=1e-11)
    # positions stand first, then their rates
    assert a[:N] == pytest.approx(np.eye(2 * N + acts)[N : 2 * N])
    assert a[N : 2 * N, :N] == pytest.approx(-np.linalg.solve(M, K))


def test_some_inputs_and_outputs():
    found = linear().picked([2, 0], [1])
    assert found.response(OMEGA) == pytest.approx(response()[[1]][:, [2, 0]], rel=1e-11)
    assert [one.name for one in found.inputs.signals] == ["u2", "u0"]
    assert [one.name for one in found.outputs.signals] == ["y1"]


def test_other_coordinates_have_the_same_response(random):
    turn = random.normal(size=(N, N))
    found = linear().in_coordinates(turn, names("x", N))
    assert found.response(OMEGA) == pytest.approx(response(), rel=1e-9)
    assert found.coordinates == names("x", N)
    some = turn[:, :2]
    fewer = linear().in_coordinates(some, names("x", 2))
    for one, own in ((fewer.mass, M), (fewer.damping, D), (fewer.stiffness, K)):
        assert one == pytest.approx(some.T @ own @ some)


def test_the_accelerance_of_a_body(random):
    motion = random.normal(size=(6, N))
    found = linear().on_body(motion)
    for k, s in enumerate(1j * OMEGA):
        wanted = s**2 * motion @ np.linalg.inv(s**2 * M + s * D + K) @ motion.T
        assert found.response(OMEGA)[:, :, k] == pytest.approx(wanted, rel=1e-11)
    assert [tuple(one) for one in found.inputs.signals] == [
        *((f"force_{axis}", "N") for axis in "xyz"),
        *((f"torque_{axis}", "N m") for axis in "xyz"),
    ]
    assert [tuple(one) for one in found.outputs.signals] == [
        *((f"acceleration_{axis}", "m/s^2") for axis in "xyz"),
        *((f"angular_acceleration_{axis}", "rad/s^2") for axis in "xyz"),
    ]
    assert found.outputs.feedthrough.shape == (6, 6)
    mass = spread(6, random=random)
    free = rigid_body(mass)
    assert free.response(OMEGA)[:, :, 1] == pytest.approx(np.linalg.inv(mass), rel=1e-9)
    assert [part.shape for part in free.activations[1:]] == [(6, 0), (0, 0), (0, 6), (6, 0)]
    assert [tuple(one) for one in free.coordinates][2:4] == [
        ("position_z", "m"),
        ("attitude_x", "rad"),
    ]


def test_appendages_stand_behind_the_coordinates_with_the_motion_of_their_roots(random):
    """D(s) = M - s^2 L^T (s^2 + 2 z w s + w^2)^-1 L at each root, by the response and by modal
    coordinates."""
    models = [
        PortModel(
            spread(6, 4.0, random),
            np.sort(random.uniform(1.0, 4.0, modes)),
            random.normal(size=(modes, 6)) / 3.0,
            random.uniform(0.01, 0.05, modes),
        )
        for modes in (2, 1)
    ]
    roots = random.normal(size=(2, 6, N))
    rigid = sum(root.T @ one.rigid_mass @ root for one, root in zip(models, roots, strict=True))
    rows = np.vstack([one.participation @ root for one, root in zip(models, roots, strict=True)])
    own = np.concatenate([one.frequencies for one in models])
    ratio = np.concatenate([one.damping for one in models])

    def felt(s):
        return rigid - rows.T @ np.diag(s**2 / (s**2 + 2.0 * ratio * own * s + own**2)) @ rows

    wanted = response(appendages=felt)
    assert linear().response(OMEGA, models, roots) == pytest.approx(wanted, rel=1e-10)
    whole = linear().with_appendages(models, roots)
    assert whole.response(OMEGA) == pytest.approx(wanted, rel=1e-10)
    assert whole.mass == pytest.approx(np.block([[M + rigid, rows.T], [rows, np.eye(3)]]))
    assert whole.stiffness == pytest.approx(block_diag(K, np.diag(own**2)))
    assert whole.damping == pytest.approx(block_diag(D, np.diag(2.0 * ratio * own)))
    assert [one.name for one in whole.coordinates][N - 1 :] == ["q3", "mode 1", "mode 2", "mode 3"]


@pytest.mark.parametrize("small", [1.0, 1e-9])
def test_fewer_coordinates_keep_the_slow_modes_and_what_is_static(small, random):
    """Without dampers: the modes up to there, and all that a constant load does, however small."""
    size = 9
    mass, stiffness = spread(size, 4.0, random), spread(size, 1.0, random)
    stiffness[0] = stiffness[:, 0] = 0.0  # one rigid motion
    squares, shapes = eigh(stiffness, mass)
    w = np.sqrt(np.clip(squares, 0.0, None))
    force, seen = small * random.normal(size=(size, 1)), random.normal(size=(1, size))
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
    few = whole.shapes_up_to(1.0001 * w[3])
    found = whole.in_coordinates(few, names("shape ", few.shape[1]))
    # one rigid motion, three modes, and what the load and the output have of those beyond
    assert len(found.coordinates) == 6
    kept = np.sqrt(np.clip(eigh(found.stiffness, found.mass, eigvals_only=True), 0.0, None))
    assert kept[1:4] == pytest.approx(w[1:4], rel=1e-9)
    # what is left out falls as the fourth power of frequency
    products = (seen @ shapes).ravel() * (shapes.T @ force).ravel()
    for omega, miss in ((0.02 * w[1], 1e-7), (0.2 * w[1], 1e-3)):
        elastic = np.sum(products[1:] * omega**2 / (omega**2 - squares[1:]))
        ours = found.response(np.array([omega]))[0, 0, 0]
        assert abs(ours - products[0] - elastic) < miss * abs(elastic)
    assert np.array_equal(whole.shapes_up_to(1.0001 * w[-1]), np.eye(size))


def test_slopes_of_a_polynomial_of_degree_four_are_exact():
    """Five points see no even power, and of a fifth 4 steps^4."""

    def function(i, x):
        several = 5.0 * x + 7.0 * x**2 + 11.0 * x**3 + 13.0 * x**4
        return np.array([2.0 + 3.0 * x, i + (i + 1.0) * several])

    assert slopes(function, 2, 0.3) == pytest.approx(np.array([[3.0, 3.0], [5.0, 10.0]]), rel=1e-12)
    fifth = slopes(lambda i, x: np.array([x**5 + i]), 1, 0.3)
    assert fifth == pytest.approx(np.array([[-4.0 * 0.3**4]]), rel=1e-10)
    assert slopes(function, 0, 0.3).shape == (0, 0)


def test_coordinates_and_activations_have_names():
    bodies = """<body name="bus"><freejoint name="free"/><geom size=".1"/><body><joint name="ball"
    type="ball"/><geom size=".1"/></body><body><joint type="slide"/><geom size=".1"/></body>
    <body><joint name="turn"/><geom size=".1"/></body></body>"""
    actuators = """<actuator><motor name="plain" joint="turn"/><general name="lag" joint="turn"
    dyntype="filter" dynprm="1"/><general joint="turn" dyntype="integrator"/></actuator>"""
    other = '<body name="other"><freejoint name="loose"/><geom size=".1"/></body>'
    one, two = (
        mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody>{bodies}{more}</worldbody>{actuators}</mujoco>"
        )
        for more in ("", other)
    )
    assert [tuple(signal) for signal in coordinate_names(one)] == [
        *((f"position_{axis}", "m") for axis in "xyz"),
        *((f"attitude_{axis}", "rad") for axis in "xyz"),
        *((f"ball_{axis}", "rad") for axis in "xyz"),
        ("joint 2", "m"),
        ("turn", "rad"),
    ]
    found = [signal.name for signal in coordinate_names(two)]
    assert (found[:6:5], len(found)) == (["bus_position_x", "bus_attitude_z"], 17)
    assert found[11] == "other_position_x"
    assert activation_names(one) == ("lag", "actuator 2")


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
