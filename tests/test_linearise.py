"""MuJoCo's own linearisation gives every chain's port back: the whole path beam -> chain -> MJCF -> A, B -> port.

A and B themselves are held against closed forms (as MuJoCo's test/engine/engine_derivative_test.cc, LinearSystem, does
for hinge-spring chains), the largest stable steps against the published stability limits of each integrator.
"""

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

from appendages import close, dense_port, panels, seed_boom, stepped_boom, tip_loaded_boom, unit_beam
from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.chain.damping import Damper, tendons
from beamchain.chain.realise import planar_chain, realise
from beamchain.chain.rivals import RECIPES, equal_links
from beamchain.engine.bench import measure
from beamchain.engine.linearise import INTEGRATORS, compile_model, linearise
from beamchain.errors import EngineError, InputError
from beamchain.mjcf import write

FREQUENCY = 1e-9  # centred differences with eps = 1e-6: 2e-12 (n = 1) to 2e-10 (n = 7) measured
PARTICIPATION = 1e-8  # an eigenvector of the same matrices
RIGID = 1e-12  # body masses and positions are written with 17 digits; a sum over the links
DERIVATIVE = 1e-9  # finite differences of a smooth step, relative to the largest entry of each block
RATIO = 1e-8  # damping ratios of 0.2 .. 2 %: differences of the same kind, divided by h w
STABLE = 2e-3  # the bisection's own resolution (1e-3) and the slow growth just beyond the limit
STEPS = [1e-4, 1e-2, 1.0]
SEMI_IMPLICIT = ["Euler", "implicit", "implicitfast"]
TARGETS = ["clamped", "free", "hub"]


def target(beam, kind, n):
    full = beam.port("xy", 8)
    mass, length = beam.rigid_mass()[0, 0], beam.length
    if kind == "clamped":
        return full.truncated(n)
    hub = 2.0 * mass * np.array([[1.0, -0.1 * length], [-0.1 * length, 0.2 * length**2]])
    return full.reduced(n, np.zeros((2, 2)) if kind == "free" else hub)


def exact_chain(beam, n, kind="clamped"):
    return planar_chain(realise(target(beam, kind, n)), beam)


def bench_text(chain, h, integrator="implicitfast", dampers=(), ports=("xy",), ballast=None):
    root = write.bench(write.appendage(chain, "boom", dampers=dampers), ports, h, ballast)
    write.find(root, "option").set("integrator", integrator)
    return write.text(root)


def on_bench(chain, h=0.01, integrator="implicitfast", **more):
    return linearise(bench_text(chain, h, integrator, **more))


def relative_to_block(ours, expected):
    """Largest difference over the largest entry."""
    return float(np.max(np.abs(ours - expected)) / np.max(np.abs(expected)))


# -- the port ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("n", range(1, 8))
@pytest.mark.parametrize("kind", TARGETS)
def test_seed_boom_comes_back_through_mujoco(kind, n):
    beam = seed_boom()
    wanted = target(beam, kind, n)
    port = on_bench(exact_chain(beam, n, kind)).port()
    assert port.modes == n
    assert port.frequencies == close(wanted.frequencies, rel=FREQUENCY)
    assert port.participation == close(wanted.participation, rel=PARTICIPATION)
    assert port.rigid_mass == close(wanted.rigid_mass, rel=FREQUENCY)
    assert port.free_frequencies == close(wanted.free_frequencies, rel=10 * FREQUENCY)
    assert np.array_equal(port.damping, np.zeros(n))


@pytest.mark.parametrize("make", [stepped_boom, tip_loaded_boom, panels])
def test_other_booms_come_back_too(make):
    for n in (1, 3, 5):
        wanted = target(make(), "clamped", n)
        port = on_bench(exact_chain(make(), n)).port()
        assert port.frequencies == close(wanted.frequencies, rel=FREQUENCY)
        assert port.participation == close(wanted.participation, rel=PARTICIPATION)


def test_plane_xz_comes_back_with_its_own_signs():
    beam = panels()
    wanted = beam.port("xz", 4).truncated(3)
    chain = planar_chain(realise(wanted), beam, "xz")
    port = on_bench(chain, ports=("xz",)).port()
    assert port.frequencies == close(wanted.frequencies, rel=FREQUENCY)
    assert port.participation == close(wanted.participation, rel=PARTICIPATION)
    assert port.rigid_mass == close(wanted.rigid_mass, rel=FREQUENCY)  # its first moment is positive, as in xy


@pytest.mark.parametrize("port", ["torsion", "axial"])
def test_scalar_ports_come_back(port):
    links = tuple(Link(float(i), 1.0, 0.5 + i, i + 0.5, (0.1 + 0.1 * i, 0.4, 0.4)) for i in range(3))
    chain = Chain(links, (Hinge(1.0, {port: 4.0}), Hinge(2.0, {port: 2.5})), 3.0)
    wanted, found = chain.port(port), on_bench(chain, ports=(port,)).port()
    assert found.frequencies == close(wanted.frequencies, rel=FREQUENCY)
    assert found.participation == close(wanted.participation, rel=PARTICIPATION)
    assert found.rigid_mass == close(wanted.rigid_mass, rel=FREQUENCY)


def test_several_ports_on_one_bench_do_not_mix():
    links = tuple(Link(float(i), 1.0, 0.5 + i, i + 0.4, (0.1 + 0.1 * i, 0.4, 0.45)) for i in range(4))
    hinges = (
        Hinge(1.0, {"xy": 40.0, "torsion": 3.0}),
        Hinge(2.0, {"xz": 30.0}),
        Hinge(3.0, {"xy": 20.0, "xz": 25.0, "axial": 900.0}),
    )
    chain = Chain(links, hinges, 4.0)
    result = measure(write.appendage(chain, "boom"), ["xy", "xz", "torsion", "axial"], timestep=0.01)
    assert result.coupling < 1e-9
    for name, port in result.ports.items():
        wanted = chain.port(name)
        assert port.modes == wanted.modes
        assert port.frequencies == close(wanted.frequencies, rel=FREQUENCY)
        assert port.participation == close(wanted.participation, rel=PARTICIPATION)
    assert result.rigid_mass == close(chain.rigid_mass(), abs=RIGID * chain.rigid_mass()[5, 5])


@pytest.mark.parametrize("recipe", RECIPES)
def test_ballast_carries_a_chain_that_is_hinged_at_its_root(recipe):
    # the recipes' massless root body cannot stand alone in MuJoCo; what is added is taken off again
    chain = equal_links(unit_beam(), 6, recipe)
    ballast = np.array([0.5, 0.03, 0.04, 0.05])
    port = on_bench(chain, ballast=ballast).port(ballast=np.diag([0.5, 0.05]))
    wanted = chain.port()
    assert port.frequencies == close(wanted.frequencies, rel=FREQUENCY)
    assert port.participation == close(wanted.participation, rel=PARTICIPATION)
    assert port.rigid_mass == close(wanted.rigid_mass, rel=FREQUENCY)
    measured = measure(write.appendage(chain, "boom"), ["xy"], timestep=0.01, ballast=ballast)
    assert measured.ports["xy"].frequencies == close(wanted.frequencies, rel=FREQUENCY)
    assert measured.rigid_mass == close(chain.rigid_mass(), abs=RIGID)


# -- the rigid body, from the compiled model ---------------------------------------------------------------------------
@pytest.mark.parametrize("n", range(1, 8))
@pytest.mark.parametrize("kind", TARGETS)
def test_mass_centre_and_inertia_of_the_compiled_bodies(kind, n):
    beam = seed_boom()
    model = compile_model(bench_text(exact_chain(beam, n, kind), 0.01))
    mass = first = transverse = polar = x = 0.0
    for i in range(1, model.nbody):  # one nested line of bodies along x
        assert model.body_parentid[i] == i - 1
        x += model.body_pos[i][0]
        assert model.body_quat[i].tolist() == model.body_iquat[i].tolist() == [1.0, 0.0, 0.0, 0.0]
        assert [*model.body_pos[i][1:], *model.body_ipos[i][1:]] == [0.0] * 4
        centre = x + model.body_ipos[i][0]
        mass += model.body_mass[i]
        first += model.body_mass[i] * centre
        transverse += model.body_inertia[i][2] + model.body_mass[i] * centre**2
        polar += model.body_inertia[i][0]
        a, b, c = np.sort(model.body_inertia[i])
        assert a + b >= c
    area = np.pi * 0.006**2  # of the rod itself, in closed form
    real = 7800.0 * area * 15.0
    assert mass == close(real, rel=RIGID)
    assert first / mass == close(7.5, rel=RIGID)
    assert transverse == close(real * 75.0, rel=RIGID)
    assert polar == close(real * 0.006**2 / 2, rel=RIGID)


# -- the step and the integrator do not matter -------------------------------------------------------------------------
@pytest.mark.parametrize("integrator", list(INTEGRATORS))
@pytest.mark.parametrize("h", STEPS)
def test_the_continuous_system_is_free_of_step_and_integrator(h, integrator):
    # at h = 1 s every integrator but `discrete` would explode: h w reaches 25
    chain = exact_chain(seed_boom(), 4)
    wanted = target(seed_boom(), "clamped", 4)
    linear = on_bench(chain, h, integrator)
    assert linear.timestep == h
    assert linear.integrator == integrator
    assert linear.port().frequencies == close(wanted.frequencies, rel=FREQUENCY)
    assert linear.port().participation == close(wanted.participation, rel=PARTICIPATION)
    free = wanted.free_frequencies
    assert linear.frequencies() == close(free, rel=10 * FREQUENCY)


def test_linearising_leaves_model_and_data_alone():
    model = compile_model(bench_text(exact_chain(seed_boom(), 2), 0.01, "RK4"))
    data = mujoco.MjData(model)
    data.qpos[:] = 1e-3
    before = data.qpos.copy(), int(model.opt.integrator)
    linearise(model, data)
    assert np.array_equal(data.qpos, before[0])
    assert int(model.opt.integrator) == before[1]
    assert data.time == 0.0


def test_about_a_bent_rest_shape():
    # one sprung rod along x under gravity along -y: k t + m g l cos t = 0 at rest, K = k - m g l sin t there
    k, m, length, g = 30.0, 2.0, 0.7, 9.81
    text = (
        f'<mujoco><option timestep="0.01" integrator="implicitfast" gravity="0 {-g} 0"/><worldbody><body>'
        f'<joint name="j" type="hinge" axis="0 0 1" stiffness="{k}"/>'
        f'<inertial pos="{length} 0 0" mass="{m}" diaginertia="0.1 0.1 0.1"/>'
        "</body></worldbody></mujoco>"
    )
    model = compile_model(text)
    data = mujoco.MjData(model)
    angle = brentq(lambda t: k * t + m * g * length * np.cos(t), -1.5, 0.0, xtol=1e-15)
    data.qpos[0] = angle
    expected = (k - m * g * length * np.sin(angle)) / (0.1 + m * length**2)
    assert linearise(model, data).stiffness[0, 0] == close(expected, rel=FREQUENCY)


# -- O12: A and B in closed form ---------------------------------------------------------------------------------------
def pendulum(lengths, masses, springs, dampers, h, integrator):
    """A chain of hinges hung on the world, point mass and small sphere at the end of every rod; no gravity."""
    body, close_tags = "", ""
    x = 0.0
    for i, (length, m, k, d) in enumerate(zip(lengths, masses, springs, dampers, strict=True)):
        body += (
            f'<body name="b{i}" pos="{x!r} 0 0"><joint name="j{i}" type="hinge" axis="0 0 1" stiffness="{k!r}" '
            f'damping="{d!r}"/><inertial pos="{length!r} 0 0" mass="{m!r}" diaginertia="0.01 0.01 0.01"/>'
        )
        close_tags += "</body>"
        x = length
    motors = "".join(f'<motor joint="j{i}"/>' for i in range(len(lengths)))
    sensors = "".join(f'<jointpos joint="j{i}"/>' for i in range(len(lengths)))
    return (
        f'<mujoco><option timestep="{h!r}" integrator="{integrator}" gravity="0 0 0"/><worldbody>{body}{close_tags}'
        f"</worldbody><actuator>{motors}</actuator><sensor>{sensors}</sensor></mujoco>"
    )


def pendulum_mass(lengths, masses):
    """Mass matrix in joint angles at rest, written out: mass i moves by (x_i - x_j) per unit of joint j <= i."""
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
    m, k, d = pendulum_mass(lengths, masses), np.diag(springs), np.diag(dampers)
    linear = linearise(pendulum(lengths, masses, springs, dampers, h, integrator))
    # v+ = v + h (M + h D)^-1 (-K q - D v + u), q+ = q + h v+
    solve = np.linalg.inv(m + h * d)
    vq, vv, vu = -h * solve @ k, solve @ m, h * solve
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
    assert np.max(np.abs(linear.damping - np.linalg.solve(m, d))) < 1e-8 / h  # (X - 1) / h: rounding over h
    assert linear.c == close(np.hstack([eye, 0 * eye]), abs=DERIVATIVE)
    assert linear.d == close(0 * eye, abs=DERIVATIVE)


@pytest.mark.parametrize("h", [1e-3, 0.1])
def test_the_discrete_integrator_is_implicit_in_stiffness(h):
    if "discrete" not in INTEGRATORS:
        pytest.skip("this MuJoCo has no `discrete` integrator")
    lengths, masses, springs, _ = PENDULUMS[2]
    m, k = pendulum_mass(lengths, masses), np.diag(springs)
    linear = linearise(pendulum(lengths, masses, springs, (0.0, 0.0), h, "discrete"))
    # v+ = v - h M^-1 K (q + h v+): THEORY section 9
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
        [[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(m, np.diag(springs)), -np.linalg.solve(m, np.diag(dampers))]]
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
            for target_, at in ((data.qpos, column), (data.qvel, column - 3), (data.ctrl, column - 6)):
                if 0 <= at < 3:
                    target_[at] = sign * eps
            mujoco.mj_step(model, data)
            ends.append(np.concatenate([data.qpos, data.qvel]))
        slope = (ends[0] - ends[1]) / (2 * eps)
        expected = np.hstack([linear.a, linear.b])[:, column]
        assert slope == close(expected, abs=1e-6 * np.max(np.abs(expected)))  # third derivatives times eps^2


def test_python_control_gets_both_systems():
    linear = on_bench(exact_chain(seed_boom(), 2), 0.05)
    discrete, continuous = linear.discrete, linear.continuous
    assert discrete.dt == 0.05
    assert continuous.dt == 0
    assert (discrete.ninputs, discrete.noutputs, discrete.nstates) == (2, 2, 8)
    poles = np.sort(np.abs(np.linalg.eigvals(continuous.A).imag))[-4::2]
    assert poles == close(target(seed_boom(), "clamped", 2).free_frequencies, rel=10 * FREQUENCY)


# -- discrete frequencies ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("integrator", SEMI_IMPLICIT)
@pytest.mark.parametrize("h", [1e-3, 0.01, 0.1])
def test_discrete_frequencies_are_warped_as_the_semi_implicit_step_does(h, integrator):
    chain = exact_chain(seed_boom(), 3)
    free = target(seed_boom(), "clamped", 3).free_frequencies
    assert h * free[-1] < 2.0
    found, ratios = on_bench(chain, h, integrator).discrete_frequencies()
    assert found == close(2.0 / h * np.arcsin(free * h / 2.0), rel=1e-7)
    assert np.max(np.abs(ratios)) < 1e-6


def test_discrete_integrator_damps_by_half_w_h():
    if "discrete" not in INTEGRATORS:
        pytest.skip("this MuJoCo has no `discrete` integrator")
    chain = exact_chain(seed_boom(), 3)
    free = target(seed_boom(), "clamped", 3).free_frequencies
    h = 1e-3
    found, ratios = on_bench(chain, h, "discrete").discrete_frequencies()
    assert ratios == close(free * h / 2.0, rel=1e-4)  # THEORY section 9; the next term is (w h)^2
    # z of v+ = (v - h w^2 q) / (1 + h^2 w^2), q+ = q + h v+: |z|^2 = 1 / (1 + h^2 w^2)
    assert np.exp(-2 * ratios * found * h) == close(1.0 / (1.0 + (h * free) ** 2), rel=1e-9)


# -- damping -----------------------------------------------------------------------------------------------------------
def with_joint_damping(chain, values):
    hinges = tuple(Hinge(hinge.x, hinge.stiffness, {"xy": c}) for hinge, c in zip(chain.hinges, values, strict=True))
    return Chain(chain.links, hinges, chain.length)


@pytest.mark.parametrize("h", STEPS)
def test_stiffness_proportional_joint_damping_comes_back(h):
    # c = beta k: zeta_k = beta w_k / 2, exactly
    bare = exact_chain(seed_boom(), 4)
    beta = 2e-3
    chain = with_joint_damping(bare, [beta * hinge.stiffness["xy"] for hinge in bare.hinges])
    port = on_bench(chain, h).port()
    assert port.frequencies == close(bare.port().frequencies, rel=10 * FREQUENCY)
    assert port.damping == close(beta * port.frequencies / 2.0, rel=1e-6)


def test_any_joint_damping_is_the_modes_share_of_it():
    bare = exact_chain(seed_boom(), 3)
    values = np.array([0.7, 0.1, 0.4])
    linear = on_bench(with_joint_damping(bare, values))
    stiffness = np.array([hinge.stiffness["xy"] for hinge in bare.hinges])
    assert linear.damping[:, :2] == close(np.zeros((5, 2)), abs=1e-9)  # the root's own rates are not damped
    # modal: 2 zeta w = sum of c psi^2 over the hinges, psi the hinge angles of the mass-normalised held mode
    _, frequencies, _ = dense_port(
        [(link.mass, link.com, link.inertia[2]) for link in bare.links],
        [(hinge.x, hinge.stiffness["xy"]) for hinge in bare.hinges],
    )
    psi = bare.moments("xy", bare.port()) / stiffness
    assert linear.port().damping == close((psi**2 @ values) / (2.0 * frequencies), rel=1e-7)


@pytest.mark.parametrize("integrator", ["implicit", "implicitfast", "Euler"])
@pytest.mark.parametrize("h", STEPS)
def test_tendons_damp_each_mode_by_its_own_ratio(h, integrator):
    chain = exact_chain(seed_boom(), 4)
    ratios = np.array([0.005, 0.002, 0.01, 0.02])
    linear = on_bench(chain, h, integrator, dampers=tendons(chain, "xy", ratios))
    port = linear.port()
    assert port.frequencies == close(chain.port().frequencies, rel=10 * FREQUENCY)
    assert port.damping == close(ratios, rel=max(RATIO, 1e-9 / h))


def test_an_undamped_mode_gets_no_tendon():
    chain = exact_chain(seed_boom(), 3)
    dampers = tendons(chain, "xy", np.array([0.01, 0.0, 0.02]))
    assert [damper.mode for damper in dampers] == [1, 3]
    assert on_bench(chain, dampers=dampers).port().damping == close([0.01, 0.0, 0.02], abs=1e-9)


def test_the_tendons_are_internal():
    # damping puts no wrench on the root: its rows and columns of D = M (M^-1 D) vanish
    chain = exact_chain(seed_boom(), 3)
    dampers = tendons(chain, "xy", np.array([0.01, 0.01, 0.02]))
    text = bench_text(chain, 0.01, dampers=dampers)
    linear, model = linearise(text), compile_model(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    for i in range(model.nv):
        mujoco.mj_mulM(model, data, mass[i], np.eye(model.nv)[i])
    d = mass @ linear.damping
    assert d[:2] == close(np.zeros_like(d[:2]), abs=1e-7 * np.max(np.abs(d)))
    assert d[:, :2] == close(np.zeros_like(d[:, :2]), abs=1e-7 * np.max(np.abs(d)))
    assert d == close(d.T, abs=1e-7 * np.max(np.abs(d)))


def test_euler_damps_tendons_explicitly_and_the_others_implicitly():
    # one hinge, one tendon over it: A_vv = 1 - h c / J against 1 / (1 + h c / J)
    links = (Link(0.0, 1.0, 1.0, 0.5, (0.1, 0.1, 0.1)), Link(1.0, 1.0, 1.0, 1.0, (2.0, 2.0, 2.0)))
    chain = Chain(links, (Hinge(1.0, {"xy": 100.0}),), 2.0)
    h, c = 0.05, 3.0
    damper = Damper("xy", 1, ((1, 1.0),), c)
    inertia = 2.0  # link 2 about the hinge: its mass sits on it
    found = {}
    for name in SEMI_IMPLICIT:
        root = write.appendage(chain, "boom", dampers=[damper])
        text = write.text(root).replace("<worldbody>", f'<option timestep="{h}" integrator="{name}"/><worldbody>', 1)
        found[name] = linearise(text).a[1, 1]
    assert found["Euler"] == close(1.0 - h * c / inertia, rel=DERIVATIVE)
    assert found["implicit"] == close(1.0 / (1.0 + h * c / inertia), rel=DERIVATIVE)
    assert found["implicitfast"] == close(1.0 / (1.0 + h * c / inertia), rel=DERIVATIVE)


# -- on a free hub -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("ratio", [0.1, 1.0, 1000.0])
def test_scene_has_the_coupled_frequencies_of_hub_and_port(ratio):
    beam = seed_boom()
    n = 3
    wanted = target(beam, "clamped", n)
    mass = ratio * beam.rigid_mass()[0, 0]
    inertia, x = 20.0 * mass, 1.0
    scene = write.scene(
        write.appendage(exact_chain(beam, n), "boom"),
        "boom",
        mass=mass,
        inertia=[inertia] * 3,
        offset=[x, 0.0, 0.0],
        timestep=0.01,
        integrator="implicitfast",
    )
    hub = np.array([[mass, -mass * x], [-mass * x, inertia + mass * x**2]])  # its centre lies behind the root
    coupled = wanted.with_hub(hub).free_frequencies
    assert linearise(write.text(scene)).frequencies() == close(coupled, rel=1e-8)


# -- O9: the largest stable step ---------------------------------------------------------------------------------------
OSCILLATOR = (
    '<mujoco><option gravity="0 0 0" integrator="{integrator}"><flag contact="disable" autoreset="disable"/></option>'
    '<worldbody><body><joint type="hinge" axis="0 0 1" stiffness="1" damping="{damping!r}"/>'
    '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
)


def is_stable(model, data, h, steps=3000):
    model.opt.timestep = h
    mujoco.mj_resetData(model, data)
    data.qpos[0] = 1e-3
    for _ in range(steps):
        mujoco.mj_step(model, data)
        if abs(data.qpos[0]) > 1e3:
            return False
    return True


def largest_step(integrator, zeta, low, high):
    model = mujoco.MjModel.from_xml_string(OSCILLATOR.format(integrator=integrator, damping=2.0 * zeta))
    data = mujoco.MjData(model)
    assert is_stable(model, data, low)
    assert not is_stable(model, data, high)
    while high - low > 1e-3:
        middle = (low + high) / 2.0
        low, high = (middle, high) if is_stable(model, data, middle) else (low, middle)
    return (low + high) / 2.0


@pytest.mark.parametrize(
    ("integrators", "zeta", "published"),
    [
        (SEMI_IMPLICIT, 0.0, 2.0000),
        (SEMI_IMPLICIT, 0.005, 2.0100),
        (SEMI_IMPLICIT, 0.1, 2.2101),
        (["RK4"], 0.0, 2.829),
        (["RK4"], 0.005, 2.839),
        (["RK4"], 0.1, 2.951),
    ],
)
def test_stability_cap_of_one_hinge(integrators, zeta, published):
    for integrator in integrators:
        assert largest_step(integrator, zeta, published - 0.1, published + 0.1) == close(published, abs=STABLE)
    if integrators is SEMI_IMPLICIT:  # THEORY section 9, in closed form
        assert 2 * zeta + 2 * np.sqrt(zeta**2 + 1) == close(published, abs=2e-4)  # O9 was measured, 2.2101 for 2.20998


def test_the_discrete_integrator_has_no_cap():
    if "discrete" not in INTEGRATORS:
        pytest.skip("this MuJoCo has no `discrete` integrator")
    model = mujoco.MjModel.from_xml_string(OSCILLATOR.format(integrator="discrete", damping=0.0))
    assert is_stable(model, mujoco.MjData(model), 100.0, steps=200)


# -- what is refused ---------------------------------------------------------------------------------------------------
def test_text_that_mujoco_refuses_comes_with_its_sentence():
    with pytest.raises(EngineError, match=r"MuJoCo refuses the model: .*mujco"):
        compile_model("<mujco/>")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"model .*nowhere\.xml' is not a file"):
        compile_model(tmp_path / "nowhere.xml")


def test_a_file_is_taken_by_path(tmp_path):
    place = tmp_path / "bench.xml"
    place.write_text(bench_text(exact_chain(seed_boom(), 2), 0.01))
    for source in (place, str(place)):
        assert linearise(source).port().frequencies == close(
            target(seed_boom(), "clamped", 2).frequencies, rel=FREQUENCY
        )


def test_a_broken_file_is_refused(tmp_path):
    place = tmp_path / "broken.xml"
    place.write_text("<mujoco><worldbody><body/></mujoco>")
    with pytest.raises(EngineError, match=r"MuJoCo refuses .*broken\.xml"):
        compile_model(place)


def test_a_model_that_cannot_move_is_refused():
    with pytest.raises(EngineError, match="no degree of freedom to linearise; put it on a joint"):
        linearise(write.text(write.appendage(exact_chain(unit_beam(), 0), "boom")))


def test_a_port_needs_motors():
    chain = exact_chain(unit_beam(), 2)
    with pytest.raises(EngineError, match="no joint of the port is driven"):
        linearise(write.text(write.appendage(chain, "boom"))).port()


def test_a_port_needs_springs():
    text = bench_text(exact_chain(unit_beam(), 1), 0.01)
    loose = text.replace(f'stiffness="{exact_chain(unit_beam(), 1).hinges[0].stiffness["xy"]!r}"', 'stiffness="0"')
    assert loose != text
    with pytest.raises(EngineError, match="no positive stiffness"):
        linearise(loose).port()


def test_names_of_joints_and_motors():
    linear = on_bench(exact_chain(seed_boom(), 2))
    assert linear.joints == ("root_xy_displacement", "root_xy_rotation", "boom_hinge1_xy", "boom_hinge2_xy")
    assert linear.driven == (0, 1)


def test_results_are_locked():
    linear = on_bench(exact_chain(seed_boom(), 1))
    for values in (linear.stiffness, linear.damping, linear.inputs, linear.a, linear.b, linear.c, linear.d):
        with pytest.raises(ValueError, match="read-only"):
            values[...] = 0.0
