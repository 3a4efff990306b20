"""Tip motion: with scene.tip every kept mode moves the tip as the beam does;
and the static answer to a slow base.

The tip is asked of MuJoCo: the Jacobian of the written file's tip site times its own modes. Static
deflections come from closed forms of the uniform beam.
"""

import mujoco
import numpy as np
import pytest

import beamchain as bc
import readback as rb
from appendages import close, seed_boom, stepped_boom, tapered_boom, tip_loaded_boom, unit_beam
from arrays import deployed_array, space_beam, tube
from beamchain import Scene, fit, linearise
from formulas import tip_sentence
from mechanics import mass_matrix

TIP = 1e-9  # tip motion of every kept mode; 2e-13 of the chain, some 1e-11 through MuJoCo
ROOT = 1e-9  # frequencies and participation at the root; 5e-12 measured
DIFFERENCES = 1e-8  # through mjd_transitionFD; 3e-9 measured
STATIC = 1e-9  # closed forms against sums over the beam's modes
FLEXIBILITY = 1e-6  # of the tip, against a sum over 40 modes, whose tail is left out
SAG = 1e-6


def tip_through_differences(text, site, axis):
    """Frequencies and tip displacement of the mass-normalised modes, springs from
    `mjd_transitionFD`, root held."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, model.site(site).id)
    mass = mass_matrix(model)
    squares, shapes = np.linalg.eig(linearise(model).stiffness)
    order = np.argsort(squares.real)
    squares, shapes = squares.real[order], shapes.real[:, order]
    shapes = shapes / np.sqrt(np.einsum("ik,ij,jk->k", shapes, mass, shapes))
    return np.sqrt(squares), np.abs(jacobian[axis] @ shapes)


# -- exact tip -------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("make", "n"), [(seed_boom, 5), (unit_beam, 2), (tapered_boom, 2), (tip_loaded_boom, 5)]
)
def test_root_and_tip_are_exact_for_every_mode(make, n):
    beam = make()
    wanted = beam.port("xy", 2 * n + 4).truncated(n)
    result = fit(beam, name="boom", modes={"xy": n}, scene=Scene(tip=True))
    assert result.status.ok
    achieved = result.achieved["xy"].truncated(n)
    assert achieved.frequencies == close(wanted.frequencies, rel=ROOT)
    assert achieved.participation == close(wanted.participation, rel=ROOT)
    assert achieved.rigid_mass == close(wanted.rigid_mass, rel=ROOT)
    # two attachment modes follow, which are no modes of the beam
    assert result.tip_error["xy"].size == n + 2
    assert np.max(np.abs(result.tip_error["xy"][:n])) < TIP
    assert tip_sentence(result) is None
    reading = rb.read(result.to_mjcf())
    assert reading.frequencies[:n] == close(wanted.frequencies, rel=ROOT)
    motion = reading.site("boom_tip")[:n]
    assert np.abs(motion[:, 1]) == close(np.abs(wanted.tip[:, 0]), rel=TIP)  # displacement
    assert np.abs(motion[:, 5]) == close(np.abs(wanted.tip[:, 1]), rel=TIP)  # and rotation
    # of one sign
    assert motion[:, 1] * motion[:, 5] == close(wanted.tip[:, 0] * wanted.tip[:, 1], rel=2 * TIP)


@pytest.mark.slow
def test_the_tip_is_exact_through_mujoco_s_differences():
    wanted = tapered_boom().port("xy", 8).truncated(2)
    result = fit(tapered_boom(), name="boom", modes={"xy": 2}, scene=Scene(tip=True))
    frequencies, tip = tip_through_differences(result.to_mjcf(), "boom_tip", 1)
    assert frequencies[:2] == close(wanted.frequencies, rel=DIFFERENCES)
    assert tip[:2] == close(np.abs(wanted.tip[:, 0]), rel=DIFFERENCES)


@pytest.mark.parametrize(
    ("make", "kept"),
    [
        (tube, {"xy": 2, "xz": 2}),
        pytest.param(deployed_array, {"xy": 2, "xz": 2}, marks=pytest.mark.slow),
    ],
)
def test_both_planes(make, kept):
    result = fit(make(), name="boom", modes=kept, scene=Scene(tip=True))
    assert result.status.ok
    for port, n in kept.items():
        assert np.max(np.abs(result.tip_error[port][:n])) < TIP
        assert result.readback_error[port].frequency < ROOT
        assert result.readback_error[port].participation < ROOT


@pytest.mark.slow
def test_the_tip_s_static_flexibility_is_exact():
    """A force or a moment at the tip: the kept modes and the attachment modes carry it as
    the whole beam does."""
    result = fit(stepped_boom(), name="boom", modes={"xy": 3}, scene=Scene(tip=True))
    got = rb.read(result.to_mjcf()).flexibility("boom_tip")[np.ix_((1, 5), (1, 5))]
    full = stepped_boom().port("xy", 40)
    wanted = (full.tip[:, :2] / full.frequencies[:, None] ** 2).T @ full.tip[:, :2]
    size = np.sqrt(np.diag(wanted))
    assert got / np.outer(size, size) == close(wanted / np.outer(size, size), abs=FLEXIBILITY)


def test_without_care_the_tip_of_mode_one_is_off():
    # 4.2, 2.4, 0.7, 0.3 % for n = 1, 2, 3, 5
    for n, percent in ((1, 4.2), (2, 2.4), (3, 0.7), (5, 0.3)):
        error = abs(fit(tube(), modes={"xy": n}).tip_error["xy"][0])
        assert error * 100.0 == close(percent, abs=0.06)


@pytest.mark.slow
def test_tip_angle_in_torsion():
    result = fit(tube(), modes={"torsion": 3})
    assert result.tip_error["torsion"].size == 3
    assert np.all(np.isfinite(result.tip_error["torsion"]))
    assert mujoco.MjModel.from_xml_string(result.to_mjcf()).njnt == 3
    careful = fit(tube(), modes={"torsion": 3}, scene=Scene(tip=True))
    assert np.max(np.abs(careful.tip_error["torsion"][:3])) < TIP
    assert careful.readback_error["torsion"].frequency < ROOT


# -- static check ----------------------------------------------------------------------------------
def static_tip(port):
    """Tip displacement and rotation per unit root acceleration, slow:
    sum of tip x participation / w^2."""
    return port.tip.T @ (port.participation[:, 0] / port.frequencies**2)


def test_the_beam_s_static_answer_is_the_textbook_s():
    # a uniform cantilever under its own inertia: q L^4 / (8 EI) and q L^3 / (6 EI), L = EI = m = 1
    assert static_tip(unit_beam().port("xy", 8)) == close([1.0 / 8.0, 1.0 / 6.0], rel=STATIC)


@pytest.mark.parametrize(("n", "bounds"), [(1, 0.12), (2, 0.05), (3, 0.02), (5, 0.01)])
def test_slow_base_acceleration_bends_the_chain_as_the_beam(n, bounds):
    reading = rb.read(fit(unit_beam(), name="boom", modes={"xy": n, "xz": 0}).to_mjcf())
    deflection = reading.site("boom_tip")[:, 1] @ (
        reading.participation[:, 1] / reading.frequencies**2
    )
    assert deflection == close(1.0 / 8.0, rel=bounds)


@pytest.mark.slow
def test_with_the_attachment_modes_nothing_is_missing():
    # a slow base acceleration bends the tip by what the static shapes of a tip load see
    # of it: all of it
    result = fit(unit_beam(), modes={"xy": 2}, scene=Scene(tip=True))
    deflection, rotation = static_tip(
        result.target["xy"].replaced(tip=result.target["xy"].tip[:, :2])
    )
    assert deflection == close(1.0 / 8.0, rel=SAG)
    assert rotation == close(1.0 / 6.0, rel=SAG)


@pytest.mark.parametrize("n", [1, 3])
def test_static_sag_through_mujoco_is_the_chain_s(n):
    # slow base acceleration = gravity on the file standing on the world: K q = load,
    # tip by its Jacobian
    result = fit(space_beam(), name="boom", modes={"xy": n})
    model = mujoco.MjModel.from_xml_string(result.to_mjcf())
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
    # W(s) = M^-1 + s^2 M^-1 C M^-1 + ..., C = sum L L^T / w^2; uniform beam: C = int r G r with
    # the cantilever's static shapes: C11 = 1/20, C12 = 13/360 (load 1 against the rotation's
    # x), C22 = 11/420
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


@pytest.mark.slow
def test_static_shapes_for_the_tip_are_not_counted_as_modes_kept():
    result = fit(
        tube(), modes={"xy": 2, "xz": 0}, scene=Scene(bandwidth=6.0, axes=("z",), tip=True)
    )
    assert result.target["xy"].modes == 4
    assert "modes kept: 2 in xy (and 2 for further points)" in result.status.message


def test_the_file_says_how_far_the_site_at_the_tip_is_off():
    """The tip of a uniform beam moves by 2 / sqrt(mass) in every mass-normalised mode."""
    text = fit(unit_beam(), name="boom", modes={"xy": 2}).to_mjcf()
    _, moved = tip_through_differences(text, "boom_tip", 1)
    mass = mujoco.MjModel.from_xml_string(text).body_mass.sum()
    off = moved / (2.0 / np.sqrt(mass)) - 1.0
    worst = int(np.argmax(np.abs(off)))
    before = text[: text.index('<site name="boom_tip"')].rpartition("<!--")[2]
    assert f"tip motion off by {off[worst]:+.1%} in mode {worst + 1} of xy" in before


def test_a_port_at_the_tip_makes_the_tip_exact():
    """Modes of a clamped uniform beam of unit mass move their end by 2."""
    section = bc.Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0)
    spec = bc.Spec(
        name="boom",
        segment=(bc.Segment(length=1.0, section=section),),
        port=(bc.spec.Port(name="end", x=1.0),),
        modes=bc.Modes(xy=2, xz=0),
        scene=Scene(tip=True),
    )
    frequencies, moved = tip_through_differences(fit(spec).to_mjcf(), "boom_end", 1)
    assert frequencies[:2] == pytest.approx([1.8751040687**2, 4.6940911330**2], rel=DIFFERENCES)
    assert moved[:2] == pytest.approx(2.0, rel=DIFFERENCES)
