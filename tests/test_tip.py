"""Tip motion: exact with one and two modes, as near as it comes with more; and the static answer to a slow base.

The tip is asked of MuJoCo: the Jacobian of the written file's tip site times its own modes. Static deflections come
from closed forms of the uniform beam.
"""

import mujoco
import numpy as np
import pytest

from appendages import close, seed_boom, stepped_boom, tapered_boom, tip_loaded_boom, unit_beam
from arrays import space_beam, tube
from beamchain.chain.realise import planar_chain, realise, realise_scalar
from beamchain.chain.rods import nodes_to_rods, rod_modes
from beamchain.chain.tip import tip_exact
from beamchain.engine.linearise import compile_model, linearise
from beamchain.errors import RealisationError
from beamchain.port import PortModel
from beamchain.spec import Scene
from beamchain.workflow import fit

TIP = 1e-8  # the issue's own bound; 1e-12 of the chain, 3e-9 through MuJoCo's differences
ROOT = 1e-8  # the same; 1e-11 measured
STATIC = 1e-9  # closed forms against sums over the beam's modes


def tip_through_mujoco(text, site, axis):
    """Frequencies and tip displacement of the mass-normalised modes of the file standing on the world."""
    model = compile_model(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    jacobian, mass = np.zeros((3, model.nv)), np.zeros((model.nv, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, model.site(site).id)
    for i, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, mass[i], unit)
    squares, shapes = np.linalg.eig(linearise(model).stiffness)
    order = np.argsort(squares.real)
    squares, shapes = squares.real[order], shapes.real[:, order]
    shapes = shapes / np.sqrt(np.einsum("ik,ij,jk->k", shapes, mass, shapes))
    return np.sqrt(squares), np.abs(jacobian[axis] @ shapes)


# -- exact tip ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("make", [seed_boom, unit_beam, tube, tapered_boom, stepped_boom, tip_loaded_boom])
def test_root_and_tip_are_exact_for_one_and_two_modes(make, n):
    beam = make()
    wanted = beam.port("xy", 8).truncated(n)
    result = fit(beam, name="boom", modes={"xy": n}, scene=Scene(tip=True))
    assert result.status.ok
    achieved = result.achieved["xy"]
    assert achieved.frequencies == close(wanted.frequencies, rel=ROOT)
    assert achieved.participation == close(wanted.participation, rel=ROOT)
    assert achieved.rigid_mass == close(wanted.rigid_mass, rel=ROOT)
    assert np.max(np.abs(result.tip_error["xy"])) < TIP
    frequencies, tip = tip_through_mujoco(result.to_mjcf(), "boom_tip", 1)
    assert frequencies == close(wanted.frequencies, rel=ROOT)
    assert tip == close(np.abs(wanted.tip[:, 0]), rel=TIP)


def test_both_planes_of_a_tube():
    result = fit(tube(), name="boom", modes={"xy": 2, "xz": 2}, scene=Scene(tip=True))
    assert result.status.ok
    for port in ("xy", "xz"):
        assert np.max(np.abs(result.tip_error[port])) < TIP
        assert result.error[port].frequency < ROOT
        assert result.error[port].participation < ROOT


def test_tip_of_the_uniform_beam_in_closed_form():
    # |phi_k(L)| = 2 / sqrt(m) for every clamped-free mode of a uniform beam (Blevins, table 8-1)
    result = fit(space_beam(), name="boom", modes={"xy": 2}, scene=Scene(tip=True))
    _, tip = tip_through_mujoco(result.to_mjcf(), "boom_tip", 1)
    assert tip == close([2.0, 2.0], rel=TIP)


@pytest.mark.parametrize("n", [3, 4])
@pytest.mark.parametrize("make", [tapered_boom])
def test_with_more_modes_the_root_stays_exact_and_the_tip_comes_nearer(make, n):
    beam = make()
    wanted = beam.port("xy", 8).truncated(n)
    nodes = realise(wanted)
    better = tip_exact(nodes, wanted, beam.length)
    errors = []
    for some in (nodes, better):
        excess = np.zeros(n + 1) if some.excess is None else some.excess
        modes = rod_modes(nodes_to_rods(some.masses, some.lengths, excess, some.stiffness), beam.length)
        assert modes.frequencies == close(wanted.frequencies, rel=1e-9)
        assert modes.participation == close(wanted.participation, rel=1e-8)
        errors.append(np.linalg.norm(modes.tip / wanted.tip[:, 0] - 1.0))
    assert errors[1] < errors[0]


def test_without_care_the_tip_of_mode_one_is_as_theory_says():
    # THEORY section 4: 4.2, 2.4, 0.7, 0.3 % for n = 1, 2, 3, 5
    for n, percent in ((1, 4.2), (2, 2.4), (3, 0.7), (5, 0.3)):
        error = abs(fit(tube(), modes={"xy": n}).tip_error["xy"][0])
        assert error * 100.0 == close(percent, abs=0.06)


def test_a_target_without_tip_is_refused():
    port = unit_beam().port("xy", 4).truncated(1)
    bare = PortModel(port.rigid_mass, port.frequencies, port.participation)
    with pytest.raises(RealisationError, match="states no tip motion"):
        tip_exact(realise(bare), bare, 1.0)


def test_tip_angle_in_torsion():
    result = fit(tube(), modes={"torsion": 3})
    assert result.tip_error["torsion"].size == 3
    assert np.all(np.isfinite(result.tip_error["torsion"]))
    assert realise_scalar(tube().port("torsion", 6).truncated(3))[1].size == 3


# -- static check ------------------------------------------------------------------------------------------------------
def static_tip(port):
    """Tip displacement and rotation per unit root acceleration, slow: sum of tip x participation / w^2."""
    return port.tip.T @ (port.participation[:, 0] / port.frequencies**2)


def test_the_beam_s_static_answer_is_the_textbook_s():
    # a uniform cantilever under its own inertia: q L^4 / (8 EI) and q L^3 / (6 EI), L = EI = m = 1
    assert static_tip(unit_beam().port("xy", 8)) == close([1.0 / 8.0, 1.0 / 6.0], rel=STATIC)


@pytest.mark.parametrize(("n", "bounds"), [(1, 0.12), (2, 0.05), (3, 0.02), (5, 0.01)])
def test_slow_base_acceleration_bends_the_chain_as_the_beam(n, bounds):
    chain = planar_chain(realise(unit_beam().port("xy", 8).truncated(n)), unit_beam())
    deflection = static_tip(chain.port("xy"))[0]
    assert deflection == close(1.0 / 8.0, rel=bounds)


@pytest.mark.parametrize("n", [1, 2])
def test_with_the_tip_matched_only_the_modes_left_out_are_missing(n):
    # the kept modes' static share is then the beam's own: 97 % and 99.9 % of q L^4 / 8 EI
    full = unit_beam().port("xy", 8)
    result = fit(unit_beam(), modes={"xy": n}, scene=Scene(tip=True))
    wanted = static_tip(full.truncated(n))[0]
    assert static_tip(result.chain.port("xy"))[0] == close(wanted, rel=1e-9)
    assert wanted == close(1.0 / 8.0, rel={1: 0.04, 2: 1e-3}[n])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_static_sag_through_mujoco_is_the_chain_s(n):
    # slow base acceleration = gravity on the file standing on the world: K q = load, tip by its Jacobian
    result = fit(space_beam(), name="boom", modes={"xy": n})
    model = compile_model(result.to_mjcf())
    model.opt.gravity[:] = [0.0, -1.0, 0.0]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    angles = (
        -data.qfrc_bias / model.jnt_stiffness[:, 0]
        if model.jnt_stiffness.ndim > 1
        else -data.qfrc_bias / model.jnt_stiffness
    )
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, model.site("boom_tip").id)
    assert -(jacobian[1] @ angles) == close(static_tip(result.chain.port("xy"))[0], rel=1e-9)


def test_root_rotation_under_a_slow_force_on_the_free_root():
    # W(s) = M^-1 + s^2 M^-1 C M^-1 + ..., C = sum L L^T / w^2; uniform beam: C = int r G r with the cantilever's static
    # shapes: C11 = 1/20, C12 = 13/360 (load 1 against the rotation's x), C22 = 11/420
    c = np.array([[1.0 / 20.0, 13.0 / 360.0], [13.0 / 360.0, 11.0 / 420.0]])
    m = np.array([[1.0, 0.5], [0.5, 1.0 / 3.0]])
    wanted = np.linalg.inv(m) @ c @ np.linalg.inv(m)
    full = unit_beam().port("xy", 8)
    shares = []
    for port in (full, *(fit(space_beam(), modes={"xy": n}).achieved["xy"] for n in (1, 2, 3, 5))):
        own = port.participation.T @ (port.participation / port.frequencies[:, None] ** 2)
        free = np.linalg.inv(port.rigid_mass) @ own @ np.linalg.inv(port.rigid_mass)
        shares.append(free[1, 0] / wanted[1, 0])
    assert shares[0] == close(1.0, rel=1e-6)
    for share, bound in zip(shares[1:], (0.1, 0.02, 0.005, 1e-3), strict=True):
        assert abs(share - 1.0) < bound
    assert np.all(np.diff(np.abs(np.array(shares[1:]) - 1.0)) < 0.0)
