"""Reading a file back through MuJoCo, on models whose answer is known and on files that
the package writes."""

import tomllib

import numpy as np
import pytest

import beamchain as bc
import finite_elements as fe
import readback as rb
from mechanics import mass_matrix

HINGED = """<mujoco><worldbody><body name="arm_link1" pos="0.4 -1 2">
  <inertial pos="0.1 0 0" mass="0.5" diaginertia="0.001 0.004 0.004"/><site name="arm_root"/>
  <body name="arm_link2" pos="0.3 0 0">
    <joint name="arm_hinge1_xy" type="hinge" axis="0 0 1" stiffness="7" damping="0.2"/>
    <joint name="arm_hinge1_xz" type="hinge" axis="0 -1 0" stiffness="3" armature="0.02"/>
    <inertial pos="0.5 0 0" mass="2" diaginertia="0.01 0.2 0.2"/>
    <body name="arm_link3" pos="1.1 0 0">
    <joint name="arm_hinge2_xy" type="hinge" axis="0 0 1" damping="0.1"/>
      <inertial pos="0.25 0 0" mass="1" diaginertia="0.01 0.05 0.05"/>
      <site name="arm_tip" pos="0.6 0 0"/>
    </body></body></body></worldbody>
  <tendon><fixed name="arm_mode1_xy" stiffness="11" damping="0.3" armature="0.05">
    <joint joint="arm_hinge1_xy" coef="0.4"/>
    <joint joint="arm_hinge2_xy" coef="1.3"/></fixed></tendon></mujoco>"""

SPEC = """name = "array"
[[segment]]
length = 2.0
section = { shape = "tube", outer_diameter = 0.05, wall = 0.002 }
material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }
[[segment]]
length = 4.0
section = { shape = "rectangle", width_y = 0.02, width_z = 0.05 }
section_end = { shape = "rectangle", width_y = 0.015, width_z = 0.03 }
material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }
[damping]
ratio = { xy = [0.005, 0.01], xz = [0.02, 0.03], torsion = [0.04] }
[modes]
xy = 2
xz = 2
torsion = 1
"""


@pytest.fixture(scope="module")
def array(tmp_path_factory):
    path = tmp_path_factory.mktemp("spec") / "array.toml"
    path.write_text(SPEC)
    return bc.fit(bc.read_spec(path)).to_mjcf()


def by_hand():
    """M, K, D over (root motions, joints) of HINGED from its numbers,
    planar algebra only (plane xy)."""
    # y = y0 + phi0 x + q1 (x - 0.3) + q2 (x - 1.4)
    mass = np.zeros((4, 4))
    for m, i, x, moves in ((0.5, 0.004, 0.1, 0), (2.0, 0.2, 0.8, 1), (1.0, 0.05, 1.65, 2)):
        at = np.array([1.0, x, (x - 0.3) * (moves > 0), (x - 1.4) * (moves > 1)])
        turn = np.array([0.0, 1.0, moves > 0, moves > 1], dtype=float)
        mass += m * np.outer(at, at) + i * np.outer(turn, turn)
    c = np.array([0.0, 0.0, 0.4, 1.3])
    mass += 0.05 * np.outer(c, c)
    return (
        mass,
        np.diag([0.0, 0.0, 7.0, 0.0]) + 11.0 * np.outer(c, c),
        (np.diag([0.0, 0.0, 0.2, 0.1]) + 0.3 * np.outer(c, c)),
    )


def test_a_model_by_hand():
    reading = rb.read(HINGED)
    mass, stiffness, damping = by_hand()
    w2, shapes = np.linalg.eig(np.linalg.solve(mass[2:, 2:], stiffness[2:, 2:]))
    order = np.argsort(w2)
    w, shapes = np.sqrt(w2[order]), shapes[:, order]
    shapes = shapes / np.sqrt(np.einsum("ik,ij,jk->k", shapes, mass[2:, 2:], shapes))
    rows = (mass[:2, 2:] @ shapes).T
    rows *= np.sign(rows[:, :1])
    found, participation, ratios = reading.port("xy")
    np.testing.assert_allclose(found, w, rtol=1e-13)
    np.testing.assert_allclose(participation, rows, rtol=1e-12)
    modal = np.einsum("ik,ij,jk->k", shapes, damping[2:, 2:], shapes)
    np.testing.assert_allclose(ratios, modal / 2 / w, rtol=1e-12)
    turn = rb.into_space("xy")
    np.testing.assert_allclose(turn.T @ reading.rigid @ turn, mass[:2, :2], rtol=1e-14)
    # the armature of a joint, and the other plane's hinge
    about = 0.2 + 2 * 0.5**2 + 0.05 + 1.35**2 + 0.02
    np.testing.assert_allclose(reading.port("xz")[0], [np.sqrt(3.0 / about)], rtol=1e-13)
    assert reading.coupling() < 1e-15
    assert reading.port("torsion")[0].size == 0
    hub = np.diag([3.0, 3.0, 3.0, 1.0, 0.4, 0.4])
    whole = mass + np.diag([3.0, 0.4, 0.0, 0.0])
    free = np.sort(np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(whole, stiffness)))))[2:]
    ours = reading.coupled(hub)
    assert all(np.min(np.abs(ours / v - 1.0)) < 1e-12 for v in free)


def test_mass_is_mujocos(array):
    """Rows of the square root against the engine's own joint-space inertia,
    tendon armature in it."""
    for text in (HINGED, array):
        reading = rb.read(text)
        full = mass_matrix(reading.model)
        np.testing.assert_allclose(
            reading.moving.T @ reading.moving, full, rtol=1e-12, atol=1e-14 * np.max(full)
        )


def test_transition_agrees(array):
    for text in (HINGED, array):
        ours = rb.read(text)
        theirs = rb.transition(text)
        assert rb.mass_error(theirs.rigid, ours.rigid) < 1e-9
        frequency, participation = rb.mode_error(
            (theirs.frequencies, theirs.participation),
            (ours.frequencies, ours.participation),
            ours.rigid,
        )
        assert frequency < 1e-8
        assert participation < 1e-7
        np.testing.assert_allclose(theirs.ratios, ours.ratios, rtol=1e-6, atol=1e-12)


def test_a_written_chain_is_the_beam(array):
    spec = tomllib.loads(SPEC)
    reading = rb.read(array)
    assert rb.mass_error(reading.rigid, fe.rigid_mass(spec)) < 1e-13
    for port, count in (("xy", 2), ("xz", 2), ("torsion", 1)):
        truth = fe.port(spec, port, count)
        w, rows, ratios = reading.port(port)
        np.testing.assert_allclose(w, truth.frequencies, rtol=1e-12)
        np.testing.assert_allclose(rows, truth.participation, rtol=1e-10)
        np.testing.assert_allclose(ratios, spec["damping"]["ratio"][port], rtol=1e-9)
    assert reading.coupling() < 1e-12
    assert reading.name == "array"


def test_coupled_and_payload_through_mujoco(array):
    """Payload rows at a site are the same as a body welded there, and a hub's as a free base."""
    mass, inertia = 2.5, (0.1, 0.2, 0.15)
    rows = rb.read(array).coupled("held", site="array_tip", payload=(mass, inertia))
    welded = rb.read(rb.with_payload(array, "array_tip", mass, inertia))
    np.testing.assert_allclose(rows, welded.frequencies, rtol=1e-12)
    ballast = (30.0, (4.0, 5.0, 6.0))
    m, k, _ = rb.matrices(rb.with_payload(array, "array_tip", mass, inertia), ballast)
    m[:6, :6] += np.diag([ballast[0]] * 3 + list(ballast[1]))
    w2 = np.sort(np.linalg.eigvals(np.linalg.solve(m, k)).real)[6:]
    hub = np.diag([30.0] * 3 + [4.0, 5.0, 6.0])
    np.testing.assert_allclose(
        rb.read(array).coupled(hub, site="array_tip", payload=(mass, inertia)),
        np.sqrt(w2),
        rtol=1e-8,
    )


def test_site_motion_is_static_flexibility(array):
    reading = rb.read(array)
    motion = reading.site("array_tip")
    sum_ = (motion.T / reading.frequencies**2) @ motion
    np.testing.assert_allclose(
        reading.flexibility("array_tip"), sum_, rtol=1e-9, atol=1e-12 * np.max(sum_)
    )


def test_comparison_sees_what_it_should():
    w = np.array([1.0, 2.0, 2.0000001])
    rows = np.array([[1.0, 0.5], [0.3, 0.2], [0.1, -0.4]])
    c = np.cos(0.7)
    s = np.sin(0.7)
    mixed = np.vstack([-rows[:1], np.array([[c, s], [-s, c]]) @ rows[1:]])
    assert max(rb.mode_error((w, mixed), (w, rows), np.eye(2))) < 1e-15
    off = rows.copy()
    off[0, 1] *= 1.0 + 1e-5
    assert 1e-6 < rb.mode_error((w, off), (w, rows), np.eye(2))[1] < 1e-5
    off = rows.copy()
    off[2] *= 1.001
    assert rb.mode_error((w, off), (w, rows), np.eye(2))[1] > 1e-4
    assert rb.mode_error((w * [1, 1, 1.001], rows), (w, rows), np.eye(2))[0] == pytest.approx(
        1e-3, rel=1e-9
    )
