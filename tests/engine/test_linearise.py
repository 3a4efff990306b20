"""MuJoCo's own linearisation gives every chain's port back: the whole path beam -> chain -> MJCF -> A, B -> port."""

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

import beamchain as bc
from appendages import close, dense_port, panels, seed_boom, stepped_boom, tip_loaded_boom, unit_beam
from beamchain.chain.chain import Chain, Hinge, Link, Tendon
from beamchain.chain.recursion import planar_chain, realise
from beamchain.chain.rivals import RECIPES, equal_links
from beamchain.chain.tendons import damped_modes, springs_as_modes
from beamchain.engine.bench import measure
from beamchain.engine.linearise import INTEGRATORS, compile_model, linearise
from beamchain.errors import EngineError, InputError
from beamchain.mjcf import write

FREQUENCY = 1e-9  # centred differences with eps = 1e-6: 2e-12 (n = 1) to 2e-10 (n = 7) measured
PARTICIPATION = 1e-8  # an eigenvector of the same matrices
RIGID = 1e-12  # body masses and positions are written with 17 digits; a sum over the links
DERIVATIVE = 1e-9  # finite differences of a smooth step, relative to the largest entry of each block
RATIO = 1e-8  # damping ratios of 0.2 .. 2 %: differences of the same kind, divided by h w
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


def bench_text(chain, h, integrator="implicitfast", ports=("xy",), ballast=None):
    root = write.bench(write.appendage(chain, "boom"), ports, h, ballast)
    write.find(root, "option").set("integrator", integrator)
    return write.text(root)


def on_bench(chain, h=0.01, integrator="implicitfast", **more):
    return linearise(bench_text(chain, h, integrator, **more))


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
    assert ratios == close(free * h / 2.0, rel=1e-4)  # to first order; the next term is (w h)^2
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
    assert linear.damping[:, :2] == close(np.zeros((5, 2)), abs=1e-9)  # the root's own rates are not damped
    # modal: 2 zeta w = sum of c psi^2 over the hinges, psi the hinge angles of the mass-normalised held mode
    _, frequencies, _ = dense_port(
        [(link.mass, link.com, link.inertia[2]) for link in bare.links],
        [(hinge.x, hinge.stiffness["xy"]) for hinge in bare.hinges],
    )
    psi = bare.shapes("xy", bare.port())
    assert linear.port().damping == close((psi**2 @ values) / (2.0 * frequencies), rel=1e-7)


@pytest.mark.parametrize("made", [damped_modes, springs_as_modes])
@pytest.mark.parametrize("integrator", ["implicit", "implicitfast", "Euler"])
@pytest.mark.parametrize("h", STEPS)
def test_tendons_damp_each_mode_by_its_own_ratio(h, integrator, made):
    chain = exact_chain(seed_boom(), 4)
    ratios = np.array([0.005, 0.002, 0.01, 0.02])
    linear = on_bench(made(chain, {"xy": ratios}), h, integrator)
    port = linear.port()
    assert port.frequencies == close(chain.port().frequencies, rel=10 * FREQUENCY)
    assert port.damping == close(ratios, rel=max(RATIO, 1e-9 / h))


def test_an_undamped_mode_gets_no_tendon():
    chain = exact_chain(seed_boom(), 3)
    damped = damped_modes(chain, {"xy": np.array([0.01, 0.0, 0.02])})
    assert [tendon.label for tendon in damped.tendons] == ["mode1_xy", "mode3_xy"]
    assert on_bench(damped).port().damping == close([0.01, 0.0, 0.02], abs=1e-9)


@pytest.mark.parametrize("made", [damped_modes, springs_as_modes])
def test_the_tendons_are_internal(made):
    # damping puts no wrench on the root: its rows and columns of D = M (M^-1 D) vanish
    chain = exact_chain(seed_boom(), 3)
    text = bench_text(made(chain, {"xy": np.array([0.01, 0.01, 0.02])}), 0.01)
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
    h, c = 0.05, 3.0
    tendon = Tendon("mode1_xy", ((0, "xy"),), np.ones(1), damping=c)
    chain = Chain(links, (Hinge(1.0, {"xy": 100.0}),), 2.0, (tendon,))
    inertia = 2.0  # link 2 about the hinge: its mass sits on it
    found = {}
    for name in SEMI_IMPLICIT:
        root = write.appendage(chain, "boom")
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


def test_an_actuator_of_another_kind_is_no_error():
    """A wrench on a site is linearised like any input; only a port needs plain joint motors."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="j" axis="0 0 1"/><geom size=".1" pos="1 0 0"/><site name="s" pos="1 0 0"/>
        </body></worldbody><actuator><motor joint="j"/><motor site="s" gear="0 1 0 0 0 0"/><motor joint="j" gear="2"/>
        </actuator></mujoco>"""
    )
    found = linearise(model)
    assert found.driven == (0, -1, -1)
    np.testing.assert_allclose(found.inputs[0] / found.inputs[0, 0], [1.0, 1.0, 2.0], rtol=1e-6)


def test_numbers_too_far_apart_are_said():
    """A thread of 64 um and four light-hours: what linearisation returns has no digit of it."""
    soft = bc.Material(youngs_modulus=0.16380296123360136, density=8614.33701723042)
    stiff = bc.Material(youngs_modulus=422935925043.1481, density=13955.563549129554)
    thread = bc.Segment(length=4839833348736.828, section=bc.Round(diameter=6.420740210310238e-05), material=soft)
    wire = bc.Segment(length=2.639015583134226, section=bc.Round(diameter=3.743015106952008e-06), material=stiff)
    with pytest.raises(bc.BeamchainError, match="too (far apart for double precision|nearly dependent)"):
        bc.fit(bc.Beam(segments=[thread, wire]), modes={"xy": 1, "xz": 1, "torsion": 3})
