"""The port model is one object seen two ways: held modes (D) and free modes (W),
and every derived form agrees."""

import control
import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
import finite_elements as fe
from appendages import REALISABLE, close, panels, seed_boom, unit_beam
from arrays import space_beam
from beamchain import PortModel
from beamchain.chain.baselines import equal_links
from spec_tables import table_of

ROUNDING = 1e-12  # one small eigenproblem or solve there and back
# products and inverses near resonance: the condition number of D there, up to 1e4, times rounding
INVERSE = 1e-9
DENSE = (
    # LAPACK's generalised eigenproblem, which loses w_max^2 / w_min^2 digits:
    # the reference is the weaker side
    1e-9
)
EXACT = 1e-11  # the elements' own promise for the modes asked for
CONTROL = 1e-9  # a state-space solve of 2n states

OMEGA = np.array([0.0, 0.3, 2.0, 7.0, 25.0, 90.0, 400.0])


def random_port(seed, modes=5, motions=2, damped=False):
    """A physical port: random participation, and a rigid mass that leaves a positive residual."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(modes, motions))
    square = rng.normal(size=(motions, motions))
    rigid = rows.T @ rows + square @ square.T + 0.3 * np.eye(motions)
    frequencies = np.cumsum(rng.uniform(0.5, 4.0, modes))
    damping = rng.uniform(0.001, 0.05, modes) if damped else np.zeros(modes)
    return PortModel(rigid, frequencies, rows, damping)


PORTS = {f"random {i}": (lambda i=i: random_port(i)) for i in range(3)} | {
    "six motions": lambda: random_port(9, modes=8, motions=6),
    "one motion": lambda: random_port(10, modes=4, motions=1),
    "cantilever, 3 modes": lambda: unit_beam().port("xy", 8).truncated(3),
    "free, 4 modes": lambda: unit_beam().port("xy", 8).reduced(4, np.zeros((2, 2))),
    "panels": lambda: panels().port("xy", 6).truncated(6),
}
ports = pytest.mark.parametrize("name", PORTS)


# -- held and free ---------------------------------------------------------------------------------
@ports
def test_free_modes_are_those_of_the_whole_mass_matrix(name):
    # coordinates: port motion and held modes; M = [[M_rigid, L^T], [L, 1]], K = diag(0, w^2)
    port = PORTS[name]()
    n, m = port.modes, port.motions
    mass = np.block([[port.rigid_mass, port.participation.T], [port.participation, np.eye(n)]])
    squares, shapes = eigh(np.diag(np.concatenate([np.zeros(m), port.frequencies**2])), mass)
    assert port.free_frequencies == close(np.sqrt(squares[m:]), rel=DENSE)
    expected = shapes[:m, m:].T
    signs = np.sign(np.sum(expected * port.free_port_values, axis=1))
    scale = np.max(np.abs(expected))
    assert port.free_port_values == close(expected * signs[:, None], rel=DENSE, abs=DENSE * scale)


def from_free_modes(mass, w, p):
    """The model with free modes: `W(s) = M^-1 + sum_i s^2 p_i p_i^T / (s^2 + w_i^2)`."""
    p0 = np.linalg.inv(np.linalg.cholesky(mass)).T  # p0 p0^T = M^-1
    # q_rigid = -p0^-1 p^T y / w, with y scaled by the strain energy
    held = -np.linalg.solve(p0, p.T) / w
    u, s, _ = np.linalg.svd(np.vstack([np.diag(1.0 / w), held]), full_matrices=False)
    return PortModel(
        mass, 1.0 / s, u.T @ np.vstack([np.zeros((w.size, mass.shape[0])), np.linalg.inv(p0)])
    )


@ports
def test_free_modes_and_back(name):
    port = PORTS[name]()
    back = from_free_modes(port.rigid_mass, port.free_frequencies, port.free_port_values)
    assert back.frequencies == close(port.frequencies, rel=ROUNDING * 100)
    scale = np.max(np.abs(port.participation))
    assert back.participation == close(port.participation, abs=1e-10 * scale)


@ports
def test_rigid_port_values_are_the_inverse_rigid_mass(name):
    port = PORTS[name]()
    p0 = port.rigid_port_values
    assert p0 @ p0.T @ port.rigid_mass == close(np.eye(port.motions), abs=ROUNDING * 100)


@ports
def test_residual_mass_is_the_inverse_of_the_gains(name):
    # the gains are the accelerance at infinite frequency: rigid part and all free modes
    port = PORTS[name]()
    p = port.free_port_values
    infinite = np.linalg.inv(port.rigid_mass) + p.T @ p
    assert port.gains == close(infinite, rel=1e-9, abs=1e-10 * np.max(np.abs(infinite)))
    assert port.gains @ port.residual_mass == close(np.eye(port.motions), abs=1e-10)


def test_free_frequencies_lie_above_held_ones_one_by_one():
    # one motion: strict interlacing; two motions:
    # the k-th held below the k-th free below the (k+2)-th held
    one = PORTS["one motion"]()
    assert np.all(one.frequencies < one.free_frequencies)
    assert np.all(one.free_frequencies[:-1] < one.frequencies[1:])
    two = random_port(1)
    assert np.all(two.frequencies < two.free_frequencies)
    assert np.all(two.free_frequencies[:-2] < two.frequencies[2:])


# -- responses -------------------------------------------------------------------------------------
@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("motions", [1, 2, 6])
def test_accelerance_is_the_inverse_of_the_dynamic_mass(motions, damped):
    port = random_port(motions, modes=6, motions=motions, damped=damped)
    product = np.einsum("ijf,jkf->fik", port.D(OMEGA), port.W(OMEGA))
    assert product == close(
        np.broadcast_to(np.eye(motions), product.shape).astype(complex), abs=INVERSE
    )


def test_accelerance_of_a_chain_hinged_at_its_root():
    # its root body has no inertia: the residual mass is singular and one free mode has
    # gone to infinity
    port = equal_links(space_beam(), 3, "classical").port("xy")
    w = np.array([0.5, 2.0, 5.0, 17.0])
    product = np.einsum("ijf,jkf->fik", port.D(w), port.W(w))
    assert product == close(np.broadcast_to(np.eye(2), product.shape).astype(complex), abs=INVERSE)


def test_dynamic_mass_is_the_definition():
    port = random_port(4, damped=True)
    for w in (0.7, 6.0):
        s = 1j * w
        expected = port.rigid_mass.astype(complex)
        for row, wk, zeta in zip(port.participation, port.frequencies, port.damping, strict=True):
            expected = expected - s**2 * np.outer(row, row) / (s**2 + 2 * zeta * wk * s + wk**2)
        assert port.D(w)[:, :, 0] == close(expected, rel=ROUNDING)


def test_a_rigid_port_has_no_modes():
    port = PortModel(np.array([[2.0, 1.0], [1.0, 3.0]]), np.zeros(0), np.zeros((0, 2)))
    assert port.modes == 0
    assert port.free_frequencies.size == 0
    assert port.zeros().size == 0
    for response in (
        port.W,
        lambda w: np.moveaxis(np.linalg.inv(np.moveaxis(port.D(w), -1, 0)), 0, -1),
    ):
        assert response(np.array([0.0, 3.0]))[:, :, 1] == close(
            np.linalg.inv(port.rigid_mass).astype(complex), rel=1e-14
        )


@ports
@pytest.mark.parametrize("entry", ["diagonal", "off-diagonal"])
def test_zeros_poles_and_gain_make_the_accelerance(name, entry):
    # Belonozhko (15): W = k prod(s^2 + n^2) / prod(s^2 + w^2)
    port = PORTS[name]()
    i, j = (0, 0) if entry == "diagonal" else (0, port.motions - 1)
    omega = np.array([0.0, 0.37, 0.81, 1.9]) * port.free_frequencies[1]
    squares = port.zeros(i, j) ** 2
    fraction = np.prod(
        (squares[:, None] - omega**2)
        / (port.free_frequencies[:, None] ** 2 - omega**2).astype(complex),
        axis=0,
    )
    scale = np.abs(port.gains[i, j]) * np.max(np.abs(fraction))
    assert port.W(omega)[i, j] == close(port.gains[i, j] * fraction, rel=1e-8, abs=1e-9 * scale)


@ports
def test_zeros_of_the_diagonal_are_where_it_changes_sign(name):
    port = PORTS[name]()
    for i in range(port.motions):
        zeros = port.zeros(i, i)
        assert zeros.imag == close(np.zeros(port.modes), abs=ROUNDING * 1e3)
        for zero in zeros.real:
            left, right = port.W(zero * np.array([1 - 1e-7, 1 + 1e-7]))[i, i].real
            assert left * right < 0.0
    # a driving point's zeros and poles alternate (rigid pole at zero first)
    for zero, pole in zip(port.zeros(0, 0).real, port.free_frequencies, strict=True):
        assert zero < pole * (1 + ROUNDING)


def test_zeros_of_the_rod_are_the_pinned_and_guided_beams():
    # y held, rotation free: tan z = tanh z; rotation held, y free: guided-free, tan z + tanh z = 0
    port = unit_beam().port("xy", 6)
    assert port.zeros(0, 0)[:2].real == close([15.418205728, 49.964862032], rel=1e-9)
    assert port.zeros(1, 1)[:2].real == close([5.593320, 30.225849], rel=1e-6)


# -- state space -----------------------------------------------------------------------------------
@pytest.mark.parametrize("damped", [False, True])
def test_state_space_has_the_accelerance(damped):
    port = random_port(7, damped=damped)
    a, b, c, d = port.state_space()
    n = port.modes
    assert (a.shape, b.shape, c.shape, d.shape) == ((2 * n, 2 * n), (2 * n, 2), (2, 2 * n), (2, 2))
    for w in OMEGA[1:]:
        response = c @ np.linalg.solve(1j * w * np.eye(2 * n) - a, b) + d
        expected = port.W(w)[:, :, 0]
        assert response == close(expected, abs=CONTROL * np.max(np.abs(expected)))


def test_state_space_poles_are_the_free_modes():
    port = random_port(8)
    poles = np.linalg.eigvals(port.state_space()[0])
    assert np.sort(poles.imag[poles.imag > 0.0]) == close(port.free_frequencies, rel=1e-10)
    assert poles.real == close(np.zeros(2 * port.modes), abs=1e-10 * port.frequencies[-1])


def test_to_control_is_the_state_space():
    port = random_port(7, damped=True)
    system = port.to_control()
    assert isinstance(system, control.StateSpace)
    for ours, theirs in zip(
        port.state_space(), (system.A, system.B, system.C, system.D), strict=True
    ):
        assert np.array_equal(ours, theirs)
    omega = OMEGA[1:]
    response = control.frequency_response(system, omega).complex
    assert response == close(port.W(omega), rel=CONTROL, abs=CONTROL)


# -- hubs ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("mass", [0.1, 1.0, 10.0, 1000.0])
@pytest.mark.parametrize("offset", [0.0, 0.2])
def test_hub_gives_the_coupled_frequencies_of_finite_elements(mass, offset):
    # a hub of radius of gyration 0.3 L whose centre lies `offset` behind the root
    hub = mass * np.array([[1.0, -offset], [-offset, 0.09 + offset**2]])
    exact = fe.port(table_of(unit_beam()), "xy", 8).coupled(hub, 6)
    assert unit_beam().port("xy", 6).with_hub(hub).free_frequencies[:6] == close(exact, rel=EXACT)


@pytest.mark.parametrize("hub", [(1.0, 0.0), (0.0, 1.0), (1e9, 0.0), (0.0, 1e9), (1e9, 1e9)])
def test_hubs_without_mass_or_without_inertia(hub):
    exact = fe.port(table_of(unit_beam()), "xy", 8).coupled(np.diag(hub), 6)
    assert unit_beam().port("xy", 6).with_hub(np.diag(hub)).free_frequencies[:6] == close(
        exact, rel=EXACT
    )


def test_hub_leaves_the_held_modes_alone():
    port = random_port(3)
    loaded = port.with_hub(np.diag([3.0, 2.0]))
    assert np.array_equal(loaded.frequencies, port.frequencies)
    assert np.array_equal(loaded.participation, port.participation)
    assert loaded.D(3.3)[:, :, 0] - port.D(3.3)[:, :, 0] == close(
        np.diag([3.0, 2.0]).astype(complex), abs=1e-13
    )


# -- reduction -------------------------------------------------------------------------------------
HUBS = {
    "free": np.zeros((2, 2)),
    "light": np.diag([0.1, 0.01]),
    "heavy": np.array([[50.0, -9.0], [-9.0, 20.0]]),
}


def relative_hub(beam, name):
    """The hub scaled to the beam's mass and length."""
    mass = beam.rigid_mass()[0, 0]
    length = beam.length
    return HUBS[name] * np.array([[mass, mass * length], [mass * length, mass * length**2]])


@pytest.mark.parametrize(
    ("kind", "hub", "n"),
    [
        (kind, hub, (1, 2, 5)[(i + j) % 3])
        for i, kind in enumerate(REALISABLE)
        for j, hub in enumerate(HUBS)
    ],
)
def test_reduction_keeps_the_first_coupled_modes(kind, hub, n):
    beam = REALISABLE[kind]()
    full = beam.port("xy", 8)
    mass = relative_hub(beam, hub)
    small = full.reduced(n, mass)
    assert small.modes == n
    assert np.array_equal(small.rigid_mass, full.rigid_mass)
    ours = small.with_hub(mass)
    theirs = full.with_hub(mass)
    assert ours.free_frequencies == close(theirs.free_frequencies[:n], rel=EXACT)
    scale = np.max(np.abs(theirs.free_port_values[:n]), axis=0)
    signs = np.sign(np.sum(ours.free_port_values * theirs.free_port_values[:n], axis=1))
    difference = ours.free_port_values * signs[:, None] - theirs.free_port_values[:n]
    assert difference / scale == close(np.zeros((n, 2)), abs=1e-9)


def test_reduction_keeps_the_tip_in_the_coupled_modes():
    # at a coupled frequency the root moves as the port values say,
    # and the tip's elastic motion follows from D's modes
    full = unit_beam().port("xy", 8)
    hub = np.diag([2.0, 0.3])
    small = full.reduced(3, hub)
    for k in range(3):
        w = full.with_hub(hub).free_frequencies[k]
        root = full.with_hub(hub).free_port_values[k]
        tips = [
            port.tip.T @ (w**2 * (port.participation @ root) / (port.frequencies**2 - w**2))
            for port in (full, small)
        ]
        assert tips[1] == close(tips[0], rel=1e-8)


def test_heavier_and_heavier_hubs_lead_to_the_truncated_port():
    full = unit_beam().port("xy", 8)
    small = full.reduced(3, 1e9 * np.diag([1.0, 1.0]))
    assert small.frequencies == close(full.truncated(3).frequencies, rel=1e-8)
    assert small.participation == close(full.truncated(3).participation, rel=1e-7)


def test_reduction_to_no_modes_is_rigid():
    port = unit_beam().port("xy", 4).reduced(0, np.zeros((2, 2)))
    assert port.modes == 0
    assert port.rigid_mass == close(np.array([[1.0, 0.5], [0.5, 1 / 3]]), rel=ROUNDING)


def test_reduced_modes_are_above_the_beams():
    # Galerkin: a constrained system's held frequencies lie above the beam's own
    full = unit_beam().port("xy", 8)
    small = full.reduced(3, np.zeros((2, 2)))
    assert np.all(small.frequencies > full.frequencies[:3])


def test_truncation_keeps_the_rigid_mass_damping_and_tip():
    full = unit_beam().port("xy", 8)
    port = full.replaced(damping=np.linspace(0.001, 0.02, full.modes)).truncated(3)
    assert port.frequencies == close(full.frequencies[:3], rel=0.0)
    assert port.damping == close(np.linspace(0.001, 0.02, full.modes)[:3], rel=0.0)
    assert port.tip == close(full.tip[:3], rel=0.0)
    assert np.array_equal(port.rigid_mass, full.rigid_mass)


def test_two_points_on_a_spring():
    # m1 at the port, m2 behind a spring k: held sqrt(k / m2), free sqrt(k (m1 + m2) / (m1 m2))
    m1, m2, k = 3.0, 2.0, 50.0
    port = PortModel(np.array([[m1 + m2]]), np.array([np.sqrt(k / m2)]), np.array([[np.sqrt(m2)]]))
    assert port.residual_mass == close(np.array([[m1]]), rel=ROUNDING)
    assert port.free_frequencies == close([np.sqrt(k * (m1 + m2) / (m1 * m2))], rel=ROUNDING)


# -- conventions -----------------------------------------------------------------------------------
def test_a_mode_s_sign_makes_its_force_participation_positive():
    rows = np.array([[-0.5, 0.2], [0.0, -0.4], [1e-17, -0.3], [0.1, -0.1]])
    port = PortModel(4.0 * np.eye(2), np.arange(1.0, 5.0), rows, tip=np.ones((4, 2)))
    assert port.participation == close(
        np.array([[0.5, -0.2], [0.0, 0.4], [-1e-17, 0.3], [0.1, -0.1]]), rel=1e-15
    )
    assert port.tip[:, 0].tolist() == [-1.0, -1.0, -1.0, 1.0]


def test_the_round_boom_has_positive_participation_everywhere():
    for port in ("xy", "xz", "torsion", "axial"):
        assert np.all(seed_boom().port(port, 6).participation[:6, 0] > 0.0)


# -- frozen ----------------------------------------------------------------------------------------
def test_fields_are_copies_and_locked():
    mass = np.diag([2.0, 1.0])
    rows = np.array([[-0.5, 0.2]])
    port = PortModel(mass, np.array([3.0]), rows, np.array([0.01]), np.array([[1.0, 2.0]]))
    mass[0, 0] = rows[0, 0] = 99.0
    assert port.rigid_mass[0, 0] == 2.0
    assert port.participation[0, 0] == 0.5
    for values in (port.rigid_mass, port.frequencies, port.participation, port.damping, port.tip):
        with pytest.raises(ValueError, match="read-only"):
            values[...] = 0.0
    with pytest.raises(AttributeError, match="cannot assign"):
        port.rigid_mass = mass  # type: ignore[misc]


def test_inputs_are_not_written_to():
    rows = np.array([[-0.5, 0.2]])
    tip = np.array([[1.0, 2.0]])
    PortModel(np.eye(2), np.array([3.0]), rows, tip=tip)
    assert rows[0, 0] == -0.5
    assert tip[0, 0] == 1.0


@pytest.mark.parametrize("name", ["free_frequencies", "free_port_values", "rigid_port_values"])
def test_what_is_kept_between_calls_is_locked(name):
    with pytest.raises(ValueError, match="read-only"):
        getattr(random_port(1), name)[...] = 0.0


def test_the_view_of_a_port_is_the_block_of_the_dynamic_mass():
    """The root's other motions are held, so that the view's D is a block of the whole D; a mode
    that moves two ports stands in both views."""
    rigid = np.diag([9.0, 9.0, 9.0, 1.0, 60.0, 60.0])
    rigid[1, 5] = rigid[5, 1] = 12.0
    rigid[2, 4] = rigid[4, 2] = -12.0
    rows = np.zeros((4, 6))
    rows[0, [1, 5]] = 1.0, 2.5
    rows[1, 3] = 0.5
    rows[2, [2, 4]] = 0.8, -2.0
    rows[3, [1, 5, 3]] = 0.6, 1.1, 0.3
    model = bc.PortModel(
        rigid, [1.0, 2.0, 3.0, 4.0], rows, [0.01] * 4, labels=("xy", "torsion", "xz", "")
    )
    omega = np.linspace(0.1, 6.0, 40)
    whole = model.D(omega)
    for port, motions, signs, frequencies in (
        ("xy", [1, 5], [1.0, 1.0], [1.0, 4.0]),
        ("xz", [2, 4], [1.0, -1.0], [3.0]),
        ("torsion", [3], [1.0], [2.0, 4.0]),
        ("axial", [0], [1.0], []),
    ):
        view = model.port(port)
        turn = np.outer(signs, signs)[:, :, None]
        assert view.frequencies.tolist() == frequencies
        assert np.allclose(view.D(omega), turn * whole[np.ix_(motions, motions)], rtol=1e-13)


def test_labels_are_checked():
    with pytest.raises(bc.InputError, match=r"labels = \('yx',\) must name a port"):
        bc.PortModel([[4.0]], [2.0], [[1.5]], labels=("yx",))
    with pytest.raises(bc.InputError, match="needs a model in six motions; this one has 1"):
        bc.PortModel([[4.0]], [2.0], [[1.5]]).port("axial")
