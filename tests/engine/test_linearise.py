"""MuJoCo's own linearisation gives every chain's port back:
the whole path beam -> chain -> MJCF -> A, B -> port.

Exported files stand on benches of the tests' own; what `linearise` reads from A and B is held
against the beam's own port, against the file read by plain MuJoCo, and against what is
written out by hand.
"""

from functools import cache

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

import beamchain as bc
import finite_elements as fe
import readback as rb
from appendages import close, panels, seed_boom, stepped_boom, tip_loaded_boom
from arrays import deployed_array, space_beam
from beamchain import linearise
from beamchain.errors import EngineError
from benches import bench, with_dampers
from mechanics import INTEGRATORS, mass_matrix
from planar_truth import hub_of, kept_for
from rival_files import equal_file
from spec_tables import table_of
from written_chain import read_chain

FREQUENCY = 1e-9  # centred differences with eps = 1e-6: 2e-12 (n = 1) to 2e-10 (n = 7) measured
PARTICIPATION = 1e-8  # an eigenvector of the same matrices
RIGID = 1e-12  # body masses and positions are written with 17 digits; a sum over the links
# finite differences of a smooth step, relative to the largest entry of each block
DERIVATIVE = 1e-9
RATIO = 1e-8  # damping ratios of 0.2 .. 2 %: differences of the same kind, divided by h w
STEPS = [1e-4, 1e-2, 1.0]
SEMI_IMPLICIT = ["Euler", "implicit", "implicitfast"]
TARGETS = ["clamped", "free", "hub"]


@cache
def exported(make, n, target="clamped", port="xy", ratios=None, springs="auto"):
    """The text of a planar chain."""
    beam = make()
    root = bc.spec.Root(target=target, hub=hub_of(beam) if target == "hub" else None)
    damping = None if ratios is None else bc.Damping(ratio={port: ratios})
    kept = {port: n, "xz" if port == "xy" else "xy": 0}
    options = bc.spec.FitOptions(springs=springs)
    return bc.fit(
        beam, name="boom", modes=kept, root=root, damping=damping, options=options
    ).to_mjcf()


def on_bench(text, timestep=0.01, integrator="implicitfast", **more):
    return linearise(bench(text, timestep, integrator, **more))


# -- the port --------------------------------------------------------------------------------------
@pytest.mark.parametrize(("target", "n"), [(TARGETS[n % 3], n) for n in range(1, 8)])
def test_seed_boom_comes_back_through_mujoco(target, n):
    wanted = kept_for(seed_boom(), target, n)
    port = on_bench(exported(seed_boom, n, target)).port()
    assert port.modes == n
    assert port.frequencies == close(wanted.frequencies, rel=FREQUENCY)
    assert port.participation == close(wanted.participation, rel=PARTICIPATION)
    assert port.rigid_mass == close(wanted.rigid, rel=FREQUENCY)
    assert port.free_frequencies == close(wanted.free_frequencies(), rel=10 * FREQUENCY)
    assert np.array_equal(port.damping, np.zeros(n))


@pytest.mark.parametrize(
    ("make", "n", "ballast"),
    [
        (stepped_boom, 1, None),
        (stepped_boom, 5, None),
        (tip_loaded_boom, 3, None),
        (panels, 3, 20.0),
    ],
)
def test_other_booms_come_back_too(make, n, ballast):
    wanted = kept_for(make(), "clamped", n)
    if ballast is None:
        port = on_bench(exported(make, n)).port()
    else:  # a hinge stands at the root, which something must carry
        text = bench(exported(make, n), ballast=(ballast,) * 4)
        port = linearise(text).port(ballast=np.diag([ballast] * 2))
    assert port.frequencies[:n] == close(wanted.frequencies, rel=FREQUENCY)
    assert port.participation[:n] == close(wanted.participation, rel=PARTICIPATION)


def test_plane_xz_comes_back_with_its_own_signs():
    wanted = kept_for(panels(), "clamped", 3, "xz")
    port = on_bench(exported(panels, 3, port="xz"), ports=("xz",)).port()
    assert port.frequencies[:3] == close(wanted.frequencies, rel=FREQUENCY)
    assert port.participation[:3] == close(wanted.participation, rel=PARTICIPATION)
    # its first moment is positive, as in xy
    assert port.rigid_mass == close(wanted.rigid, rel=FREQUENCY)


@pytest.mark.parametrize("port", ["torsion", "axial"])
def test_scalar_ports_come_back(port):
    wanted = fe.port(table_of(stepped_boom()), port, 2)
    text = bc.fit(stepped_boom(), name="boom", modes={"xy": 0, "xz": 0, port: 2}).to_mjcf()
    found = on_bench(text, ports=(port,)).port()
    assert found.frequencies[:2] == close(wanted.frequencies, rel=FREQUENCY)
    assert found.participation[:2] == close(wanted.participation, rel=PARTICIPATION)
    assert found.rigid_mass == close(wanted.rigid, rel=FREQUENCY)


@pytest.mark.slow
def test_several_ports_on_one_bench_do_not_mix():
    result = bc.fit(deployed_array(), modes={"xy": 2, "xz": 3, "torsion": 1, "axial": 1})
    file = rb.read(result.to_mjcf())
    assert result.measured.coupling < 1e-9
    for name, port in result.achieved.items():
        frequencies, participation, _ = file.port(name)
        assert port.modes == frequencies.size
        assert port.frequencies == close(frequencies, rel=FREQUENCY)
        assert port.participation == close(participation, rel=PARTICIPATION)
    assert result.measured.rigid_mass == close(file.rigid, abs=RIGID * file.rigid[5, 5])


@pytest.mark.parametrize("recipe", ["classical", "midpoint"])
def test_ballast_carries_a_chain_that_is_hinged_at_its_root(recipe):
    # the recipes' massless root body cannot stand alone in MuJoCo; what is added is taken off again
    text = equal_file(space_beam(), 6, recipe)
    file = rb.read(text)
    turn = rb.into_space("xy")
    frequencies, participation, _ = file.port("xy")
    linear = linearise(bench(text, ballast=(0.5, 0.03, 0.04, 0.05)))
    port = linear.port(ballast=np.diag([0.5, 0.05]))
    assert port.frequencies == close(frequencies, rel=FREQUENCY)
    assert port.participation == close(participation, rel=PARTICIPATION)
    assert port.rigid_mass == close(turn.T @ file.rigid @ turn, rel=FREQUENCY)


# -- the rigid body, from the compiled model -------------------------------------------------------
@pytest.mark.parametrize(("target", "n"), [("clamped", 1), ("free", 4), ("hub", 7)])
def test_mass_centre_and_inertia_of_the_compiled_bodies(target, n):
    model = mujoco.MjModel.from_xml_string(exported(seed_boom, n, target))
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


# -- the step and the integrator do not matter -----------------------------------------------------
@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("h", STEPS)
def test_the_continuous_system_is_free_of_step_and_integrator(h, integrator):
    # at h = 1 s every integrator but `discrete` would explode: h w reaches 25
    wanted = kept_for(seed_boom(), "clamped", 4)
    linear = on_bench(exported(seed_boom, 4), h, integrator)
    assert linear.timestep == h
    assert linear.integrator == integrator
    assert linear.port().frequencies == close(wanted.frequencies, rel=FREQUENCY)
    assert linear.port().participation == close(wanted.participation, rel=PARTICIPATION)
    assert linear.frequencies() == close(wanted.free_frequencies(), rel=10 * FREQUENCY)


def test_linearising_leaves_model_and_data_alone():
    model = mujoco.MjModel.from_xml_string(bench(exported(seed_boom, 2), 0.01, "RK4"))
    data = mujoco.MjData(model)
    data.qpos[:] = 1e-3
    before = data.qpos.copy(), int(model.opt.integrator)
    linearise(model, data)
    assert np.array_equal(data.qpos, before[0])
    assert int(model.opt.integrator) == before[1]
    assert data.time == 0.0


def test_about_a_bent_rest_shape():
    # one sprung rod along x under gravity along -y: k t + m g l cos t = 0 at rest,
    # K = k - m g l sin t there
    k, m, length, g = 30.0, 2.0, 0.7, 9.81
    text = (
        f'<mujoco><option timestep="0.01" integrator="implicitfast" gravity="0 {-g} '
        '0"/><worldbody><body>'
        f'<joint name="j" type="hinge" axis="0 0 1" stiffness="{k}"/>'
        f'<inertial pos="{length} 0 0" mass="{m}" diaginertia="0.1 0.1 0.1"/>'
        "</body></worldbody></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    angle = brentq(lambda t: k * t + m * g * length * np.cos(t), -1.5, 0.0, xtol=1e-15)
    data.qpos[0] = angle
    expected = (k - m * g * length * np.sin(angle)) / (0.1 + m * length**2)
    assert linearise(model, data).stiffness[0, 0] == close(expected, rel=FREQUENCY)


def test_python_control_gets_both_systems():
    linear = on_bench(exported(seed_boom, 2), 0.05)
    discrete = linear.discrete
    continuous = linear.continuous
    assert discrete.dt == 0.05
    assert continuous.dt == 0
    assert (discrete.ninputs, discrete.noutputs, discrete.nstates) == (2, 2, 8)
    poles = np.sort(np.abs(np.linalg.eigvals(continuous.A).imag))[-4::2]
    assert poles == close(
        kept_for(seed_boom(), "clamped", 2).free_frequencies(), rel=10 * FREQUENCY
    )


# -- discrete frequencies --------------------------------------------------------------------------
@pytest.mark.parametrize("integrator", SEMI_IMPLICIT)
@pytest.mark.parametrize("h", [1e-3, 0.01, 0.1])
def test_discrete_frequencies_are_warped_as_the_semi_implicit_step_does(h, integrator):
    free = kept_for(seed_boom(), "clamped", 3).free_frequencies()
    assert h * free[-1] < 2.0
    found, ratios = on_bench(exported(seed_boom, 3), h, integrator).discrete_frequencies()
    assert found == close(2.0 / h * np.arcsin(free * h / 2.0), rel=1e-7)
    assert np.max(np.abs(ratios)) < 1e-6


def test_discrete_integrator_damps_by_half_w_h():
    if "discrete" not in INTEGRATORS:
        pytest.skip("this MuJoCo has no `discrete` integrator")
    free = kept_for(seed_boom(), "clamped", 3).free_frequencies()
    h = 1e-3
    found, ratios = on_bench(exported(seed_boom, 3), h, "discrete").discrete_frequencies()
    assert ratios == close(free * h / 2.0, rel=1e-4)  # to first order; the next term is (w h)^2
    # z of v+ = (v - h w^2 q) / (1 + h^2 w^2), q+ = q + h v+: |z|^2 = 1 / (1 + h^2 w^2)
    assert np.exp(-2 * ratios * found * h) == close(1.0 / (1.0 + (h * free) ** 2), rel=1e-9)


# -- damping ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("h", STEPS)
def test_stiffness_proportional_joint_damping_comes_back(h):
    # c = beta k: zeta_k = beta w_k / 2, exactly
    bare = exported(seed_boom, 4)
    beta = 2e-3
    springs = [hinge.stiffness["xy"] for hinge in read_chain(bare).hinges]
    port = on_bench(with_dampers(bare, beta * np.array(springs)), h).port()
    assert port.frequencies == close(rb.read(bare).frequencies, rel=10 * FREQUENCY)
    assert port.damping == close(beta * port.frequencies / 2.0, rel=1e-6)


def test_any_joint_damping_is_the_modes_share_of_it():
    bare = exported(seed_boom, 3)
    values = np.array([0.7, 0.1, 0.4])
    linear = on_bench(with_dampers(bare, values))
    # the root's own rates are not damped
    assert linear.damping[:, :2] == close(np.zeros((5, 2)), abs=1e-9)
    # modal: 2 zeta w = sum of c psi^2 over the hinges,
    # psi the hinge angles of the mass-normalised held mode
    reading = rb.read(bare)
    psi = reading.shapes.T
    assert linear.port().damping == close((psi**2 @ values) / (2.0 * reading.frequencies), rel=1e-7)


@pytest.mark.parametrize("integrator", ["implicit", "implicitfast", "Euler"])
@pytest.mark.parametrize("h", STEPS)
def test_tendons_damp_each_mode_by_its_own_ratio(h, integrator):
    ratios = (0.005, 0.002, 0.01, 0.02)
    port = on_bench(exported(seed_boom, 4, ratios=ratios), h, integrator).port()
    assert port.frequencies == close(
        rb.read(exported(seed_boom, 4)).frequencies, rel=10 * FREQUENCY
    )
    assert port.damping == close(ratios, rel=max(RATIO, 1e-9 / h))


def test_an_undamped_mode_among_damped_ones():
    text = exported(seed_boom, 3, ratios=(0.01, 0.0, 0.02))
    assert on_bench(text).port().damping == close([0.01, 0.0, 0.02], abs=1e-9)


def test_the_tendons_are_internal():
    # damping puts no wrench on the root: its rows and columns of D = M (M^-1 D) vanish
    text = bench(exported(seed_boom, 3, ratios=(0.01, 0.01, 0.02)))
    linear = linearise(text)
    model = mujoco.MjModel.from_xml_string(text)
    assert model.ntendon == 3
    d = mass_matrix(model) @ linear.damping
    assert d[:2] == close(np.zeros_like(d[:2]), abs=1e-7 * np.max(np.abs(d)))
    assert d[:, :2] == close(np.zeros_like(d[:, :2]), abs=1e-7 * np.max(np.abs(d)))
    assert d == close(d.T, abs=1e-7 * np.max(np.abs(d)))


def test_euler_damps_tendons_explicitly_and_the_others_implicitly():
    # one hinge, one tendon over it: A_vv = 1 - h c / J against 1 / (1 + h c / J)
    h, c, inertia = 0.05, 3.0, 2.0
    text = (
        '<mujoco><option timestep="{}" integrator="{}" gravity="0 0 0"/><worldbody><body><joint '
        'name="j" axis="0 0 1" stiffness="100"/><inertial pos="0 0 0" mass="1" diaginertia="2 2 '
        '2"/></body></worldbody><tendon><fixed damping="{}"><joint joint="j" '
        'coef="1"/></fixed></tendon></mujoco>'
    )
    found = {name: linearise(text.format(h, name, c)).a[1, 1] for name in SEMI_IMPLICIT}
    assert found["Euler"] == close(1.0 - h * c / inertia, rel=DERIVATIVE)
    assert found["implicit"] == close(1.0 / (1.0 + h * c / inertia), rel=DERIVATIVE)
    assert found["implicitfast"] == close(1.0 / (1.0 + h * c / inertia), rel=DERIVATIVE)


# -- on a free hub ---------------------------------------------------------------------------------
@pytest.mark.parametrize("ratio", [0.1, 1.0, 1000.0])
def test_scene_has_the_coupled_frequencies_of_hub_and_port(ratio):
    beam = seed_boom()
    n = 3
    x = 1.0
    mass = ratio * float(beam.rigid_mass()[0, 0])
    inertia = 20.0 * mass
    hub = bc.Hub(mass=mass, inertia=(inertia,) * 3, offset=(x, 0.0, 0.0))
    scene = bc.fit(
        beam, modes={"xy": n, "xz": 0}, root=bc.spec.Root(target="clamped", hub=hub)
    ).scene_mjcf()
    # its centre lies behind the root
    matrix = np.array([[mass, -mass * x], [-mass * x, inertia + mass * x**2]])
    coupled = kept_for(seed_boom(), "clamped", n).free_frequencies(matrix)
    assert linearise(scene).frequencies() == close(coupled, rel=1e-8)


# -- what is refused -------------------------------------------------------------------------------
def test_a_file_is_taken_by_path(tmp_path):
    place = tmp_path / "bench.xml"
    place.write_text(bench(exported(seed_boom, 2)))
    for source in (place, str(place)):
        assert linearise(source).port().frequencies == close(
            kept_for(seed_boom(), "clamped", 2).frequencies, rel=FREQUENCY
        )


def test_a_broken_file_is_refused(tmp_path):
    place = tmp_path / "broken.xml"
    place.write_text("<mujoco><worldbody><body/></mujoco>")
    with pytest.raises(EngineError, match=r"broken\.xml"):
        linearise(place)


def test_names_of_joints_and_motors():
    linear = on_bench(exported(seed_boom, 2))
    assert linear.joints == (
        "root_xy_displacement",
        "root_xy_rotation",
        "boom_hinge1_xy",
        "boom_hinge2_xy",
    )
    assert linear.driven == (0, 1)


def test_results_are_locked():
    linear = on_bench(exported(seed_boom, 1))
    for values in (
        linear.stiffness,
        linear.damping,
        linear.inputs,
        linear.a,
        linear.b,
        linear.c,
        linear.d,
    ):
        with pytest.raises(ValueError, match="read-only"):
            values[...] = 0.0


def test_an_actuator_of_another_kind_is_no_error():
    """A wrench on a site is linearised like any input; only a port needs plain joint motors."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="j" axis="0 0 1"/><geom size=".1" pos="1 0 0"/>
        <site name="s" pos="1 0 0"/>
        </body></worldbody><actuator><motor joint="j"/><motor site="s" gear="0 1 0 0 0 0"/>
        <motor joint="j" gear="2"/>
        </actuator></mujoco>"""
    )
    found = linearise(model)
    assert found.driven == (0, -1, -1)
    np.testing.assert_allclose(found.inputs[0] / found.inputs[0, 0], [1.0, 1.0, 2.0], rtol=1e-6)


def test_numbers_too_far_apart_are_said():
    """A thread of 64 um and four light-hours: what linearisation returns has no digit of it."""
    soft = bc.Material(youngs_modulus=0.16380296123360136, density=8614.33701723042)
    stiff = bc.Material(youngs_modulus=422935925043.1481, density=13955.563549129554)
    thread = bc.Segment(
        length=4839833348736.828, section=bc.Round(diameter=6.420740210310238e-05), material=soft
    )
    wire = bc.Segment(
        length=2.639015583134226, section=bc.Round(diameter=3.743015106952008e-06), material=stiff
    )
    with pytest.raises(bc.BeamchainError, match="too (far apart|nearly dependent)"):
        bc.fit(bc.Beam(segments=[thread, wire]), modes={"xy": 1, "xz": 1, "torsion": 3})


@pytest.mark.parametrize("gravity", [0.0, 9.81])
@pytest.mark.parametrize("base", ["<freejoint/>", '<joint type="slide" axis="1 0 0"/>'])
@pytest.mark.parametrize("stiff", [1e6, 2e12, 1e15])
def test_a_slow_mode_beside_a_fast_one_is_no_rigid_motion(stiff, base, gravity):
    """Two masses on springs along x, on a hub that is free: a mode of 1.4 rad/s keeps its digits
    beside one of up to 1e7 rad/s, and rounding of the fall is none."""
    soft, hub, masses = 20.0, 300.0, np.array([10.0, 10.0])
    bodies = "".join(
        f'<body pos="{x} 0 0"><joint type="slide" axis="1 0 0" stiffness="{k}"/>'
        f'<inertial pos="0 0 0" mass="{m}" diaginertia="1 1 1"/></body>'
        for x, k, m in zip((1.0, -1.0), (soft, stiff), masses, strict=True)
    )
    text = (
        f'<mujoco><option timestep="1e-3" gravity="0 0 {-gravity}"/><worldbody>'
        f'<body quat="0.8 0.2 0.3 0.4">{base}'
        f'<inertial pos="0 0 0" mass="{hub}" diaginertia="90 90 90"/>{bodies}</body>'
        "</worldbody></mujoco>"
    )
    # of the free craft K^(-1/2) (m - m m^T / sum) K^(-1/2) has the eigenvalues 1 / W^2
    inertia = np.diag(masses) - np.outer(masses, masses) / (hub + masses.sum())
    springs = np.sqrt([soft, stiff])
    truth = 1.0 / np.sqrt(np.linalg.eigvalsh(inertia / np.outer(springs, springs)))[::-1]
    assert linearise(text).frequencies() == close(truth, rel=1e-9)
