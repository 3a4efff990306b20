"""Tests an internal, `engine.model_rows`, too.

Closed forms beside the bench: what bodies weigh about a point, how far two readings are apart,
what stands behind a port."""

from copy import copy

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

import beamchain as bc
from beamchain import PortModel
from beamchain.engine import model_rows
from beamchain.errors import EngineError
from formulas import (
    Chain,
    Composite,
    Hinge,
    Link,
    Measured,
    apparent_hubs,
    ballast_for,
    carriers,
    composite,
    distance,
    freedoms_of_block,
    held_joints,
    in_planes,
    mass_of_bodies,
    mount,
    rigid_hubs,
    rigid_mass,
    root_body,
    root_frame,
)
from mechanics import mass_matrix

# -- readings --------------------------------------------------------------------------------------
RIGID = np.array([[4.0, 1.0], [1.0, 9.0]])
ROWS = np.array([[1.0, 0.6], [0.2, 1.8]])
W = np.array([2.0, 5.0])


def port(mass=RIGID, w=W, rows=ROWS):
    return PortModel(np.array(mass), np.array(w), np.array(rows))


@pytest.mark.parametrize(
    ("other", "wanted"),
    [
        (port(w=[2.0, 5.5]), 0.1),
        (port(w=[1.6, 5.0]), 0.2),
        # over the roots 2 and 3 of the masses: (0.5, 0.2) and (0.1, 0.6)
        (port(rows=[[1.1, 0.6], [0.2, 1.8]]), 0.05 / np.hypot(0.5, 0.2)),
        (port(rows=[[1.0, 0.6], [0.2, 1.5]]), 0.1 / np.hypot(0.1, 0.6)),
        (port(mass=[[4.0, 1.3], [1.3, 9.0]]), 0.3 / 6.0),
        (port(mass=[[4.0, 1.0], [1.0, 8.1]]), 0.1),
        (port(w=[2.0], rows=ROWS[:1]), 1.0),
        (port(), 0.0),
    ],
)
def test_two_readings_are_apart_by_their_largest_relative_difference(other, wanted):
    assert distance(other, port()) == pytest.approx(wanted, rel=1e-12)


def test_bodies_springs_and_dampers_are_read_one_by_one():
    """Their squares are MuJoCo's mass matrix and the sums of springs and dampers, small or large;
    modes and ratios with the root held are those of the matrices."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="x" type="slide"/><joint name="turn"/>
        <inertial pos="0 1 0" mass="5" diaginertia="1 2 3"/><body pos="2 0 1" euler="10 20 30">
        <joint name="a" axis="0 1 0" stiffness=".03" damping=".01"/><inertial pos="1 0 .2" mass="2"
        fullinertia=".3 .4 .5 .1 0 .05"/><body pos="1 0 0"><joint name="b" axis="1 0 1"
        stiffness="40" armature=".3"/><inertial pos="0 .3 0" mass="1"
        diaginertia=".1 .1 .1"/></body></body></body></worldbody><tendon>
        <fixed name="t" stiffness=".05" damping=".02" armature=".04">
        <joint joint="a" coef="2"/><joint joint="b" coef="-3"/></fixed></tendon></mujoco>"""
    )
    found = model_rows.readings(model)
    mass = mass_matrix(model)
    tendon = np.array([0.0, 0.0, 2.0, -3.0])
    stiffness = np.diag([0.0, 0.0, 0.03, 40.0]) + 0.05 * np.outer(tendon, tendon)
    damping = np.diag([0.0, 0.0, 0.01, 0.0]) + 0.02 * np.outer(tendon, tendon)
    assert found.rows.T @ found.rows == pytest.approx(mass, rel=1e-12, abs=1e-12)
    assert found.springs.T @ found.springs == pytest.approx(stiffness, rel=1e-12, abs=1e-15)
    assert found.damping == pytest.approx(damping, rel=1e-12, abs=1e-15)
    assert model_rows.sprung(model) == [2, 3]
    by_tendon = copy(model)
    by_tendon.jnt_stiffness[:] = 0.0
    assert model_rows.sprung(by_tendon) == [2, 3]
    squares, shapes = eigh(stiffness[2:, 2:], mass[2:, 2:])
    w = np.sqrt(squares)
    rows = shapes.T @ mass[2:, :2]
    rates = shapes.T @ damping[2:, 2:] @ shapes
    got = PortModel.from_rows(found.held_at([0, 1], [2, 3], np.eye(2)))
    assert got.frequencies == pytest.approx(w, rel=1e-9)
    assert got.rigid_mass == pytest.approx(mass[:2, :2])
    for own, true in zip(got.participation, rows, strict=True):
        assert np.outer(own, own) == pytest.approx(np.outer(true, true), rel=1e-7, abs=1e-9)
    # signs of modes are nobody's
    assert np.abs(got.damping_matrix) == pytest.approx(np.abs(rates))
    rigid = PortModel.from_rows(found.held_at([0, 1], [], np.eye(2)))
    assert rigid.modes == 0
    assert rigid.rigid_mass == pytest.approx(mass[:2, :2])


def test_a_mode_that_moves_nothing_is_compared_with_rounding():
    rows = np.array([[0.0, 0.0], [0.2, 1.8]])
    off = rows + np.array([[4e-10, 0.0], [0.0, 0.0]])
    assert distance(port(rows=off), port(rows=rows)) == pytest.approx(0.2)


def test_a_reading_is_that_of_a_and_b_up_to_eleven_digits():
    def measured(**lost):
        return Measured((), np.eye(6), {"a": 2e-3, "b": 5e-3}, None, lost)

    found = measured(xy=0.9e-11, xz=1.1e-11)
    assert found.reading("xy") == "mjd_transitionFD"
    assert found.reading("xz") == "mass and stiffness"
    assert found.reading_sentence("xz").startswith("xz: read through mass and stiffness; ")
    assert "differ by 1.1e-11." in found.reading_sentence("xz")
    assert found.coupling == 5e-3


def test_blocks_make_a_model_in_six_motions():
    blocks = (
        (port(), [1, 5]),
        (PortModel(np.array([[7.0]]), np.array([3.0]), np.array([[2.0]])), [3]),
    )
    mass = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    made = Measured(blocks, mass, {}, None, {"torsion": 0.0}, live=(1, 3, 5))
    wanted = np.diag([1.0, 4.0, 3.0, 7.0, 5.0, 9.0])
    wanted[1, 5] = wanted[5, 1] = 1.0
    assert made.space.rigid_mass == pytest.approx(wanted)
    assert made.space.frequencies == pytest.approx([2.0, 3.0, 5.0])
    rows = np.zeros((3, 6))
    rows[0, [1, 5]], rows[1, 3], rows[2, [1, 5]] = ROWS[0], 2.0, ROWS[1]
    assert made.space.participation == pytest.approx(rows)
    assert made.motion.participation == pytest.approx(rows[:, [1, 3, 5]])
    assert made.damped_motion is made.motion
    assert made.ports["torsion"].frequencies == pytest.approx([3.0])
    assert made.coupling == 0.0
    assert Measured((), mass, {}, None).space.modes == 0


JOINTS = [
    "root_axial",
    "b_h1_xy",
    "root_xy_displacement",
    "root_xz_displacement",
    "b_h1_xz",
    "root_torsion",
    "root_xz_rotation",
    "b_h2_xy",
    "root_xy_rotation",
    "b_h1_torsion",
]


@pytest.mark.parametrize(
    ("block", "root", "inner", "motions", "signs"),
    [
        (["xy"], [2, 8], [1, 7], [1, 5], [1, 1]),
        (["xz"], [3, 6], [4], [2, 4], [1, -1]),
        (["torsion", "xz"], [3, 5, 6], [4, 9], [2, 3, 4], [1, 1, -1]),
        (["axial"], [0], [], [0], [1]),
    ],
)
def test_freedoms_of_a_block_on_the_bench(block, root, inner, motions, signs):
    found = freedoms_of_block(JOINTS, block)
    assert (found.root, found.inner, found.motions) == (root, inner, motions)
    assert np.array_equal(found.signs, np.diag(signs))


def test_modes_of_equal_frequency_are_turned_into_the_planes():
    """Scaled by their masses, in the bench's order of motions."""
    rows = np.array([[2.0, 0.3, 0.0, 0.0], [0.0, 0.0, 1.0, -0.2], [0.5, 0.1, 0.0, 0.0]])
    angle = Rotation.from_euler("z", 0.6).as_matrix()[:2, :2]
    mixed = np.array(rows)
    mixed[:2] = angle @ rows[:2]
    found = in_planes(mixed, np.diag([4.0, 2.0, 0.0, 1.0]), [1, 5, 2, 4], [[0, 1]])
    assert np.abs(found @ mixed) == pytest.approx(np.abs(rows), abs=1e-12)


# -- masses ----------------------------------------------------------------------------------------
BODIES = """<mujoco><worldbody><body name="bus" pos="1 2 3" euler="20 -30 50"><freejoint/>
<inertial pos=".1 .2 -.1" quat=".9 .1 -.3 .2" mass="5" diaginertia="2 3 4"/>
<site name="port" pos=".3 -.1 .2" euler="40 20 -70"/>
<body name="link" pos=".5 0 .3" euler="10 0 70"><joint name="hinge" axis="0 0 1"/>
<inertial pos="1 0 .2" mass="2" diaginertia=".3 .4 .5"/><site name="hand" pos="2 0 .1"
euler="0 30 0"/></body></body><body name="else"><freejoint/><geom size=".1"/></body></worldbody>
<actuator><position joint="hinge" kp="{kp}"/></actuator></mujoco>"""


def crafts(kp=0.0):
    model = mujoco.MjModel.from_xml_string(BODIES.format(kp=kp))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def about(parts, origin, frame):
    """`(6, 6)` of bodies `(mass, centre, inertia in the world)`, by the energy of unit motions."""
    out = np.zeros((6, 6))
    for mass, centre, inertia in parts:
        arm = centre - origin
        motion = np.zeros((6, 6))
        for k in range(3):
            motion[:3, k] = frame[:, k]
            motion[:3, 3 + k], motion[3:, 3 + k] = np.cross(frame[:, k], arm), frame[:, k]
        whole = np.zeros((6, 6))
        whole[:3, :3], whole[3:, 3:] = mass * np.eye(3), inertia
        out += motion.T @ whole @ motion
    return out


def parts(model, data, *names):
    for name in names:
        turn = data.body(name).ximat.reshape(3, 3)
        own = turn @ np.diag(model.body(name).inertia) @ turn.T
        yield float(model.body(name).mass[0]), data.body(name).xipos, own


def test_bodies_weigh_about_a_point_as_their_energy_says():
    model, data = crafts()
    frame, origin = data.site("port").xmat.reshape(3, 3), data.site("port").xpos
    both = [model.body(name).id for name in ("bus", "link")]
    wanted = about(parts(model, data, "bus", "link"), origin, frame)
    assert mass_of_bodies(model, data, both, origin, frame) == pytest.approx(wanted, abs=1e-12)
    assert mount(model, "port", "site", "port").hub == pytest.approx(wanted, abs=1e-12)
    own = data.body("link")
    wanted = about(parts(model, data, "link"), own.xpos, own.xmat.reshape(3, 3))
    assert rigid_mass(model, "link") == pytest.approx(wanted, abs=1e-12)


def test_mass_centre_and_inertia_of_a_body_with_all_that_hangs_on_it():
    model, data = crafts()
    found = composite(model, model.body("bus").id)
    frame, origin = data.body("bus").xmat.reshape(3, 3), data.body("bus").xpos
    centre = (5.0 * data.body("bus").xipos + 2.0 * data.body("link").xipos) / 7.0
    assert (found.body, found.mass) == ("bus", pytest.approx(7.0))
    assert found.centre == pytest.approx(frame.T @ (centre - origin), abs=1e-12)
    inertia = about(parts(model, data, "bus", "link"), centre, frame)[3:, 3:]
    assert found.inertia == pytest.approx(inertia, abs=1e-12)
    qpos = np.array(model.qpos0)
    qpos[7] = 0.8
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    centre = (5.0 * data.body("bus").xipos + 2.0 * data.body("link").xipos) / 7.0
    turned = composite(model, model.body("bus").id, qpos)
    assert turned.centre == pytest.approx(frame.T @ (centre - origin), abs=1e-12)


def test_a_composite_in_a_line_has_no_rounding():
    inertia = np.array([[2.0, 1e-9, -0.25], [1e-9, 3.0, 5e-9], [-0.25, 5e-9, 4.0]])
    found = Composite("bus", 16.0, np.array([0.4e-9, 0.6e-9, 0.75]), inertia).sentence
    # of the largest 4: above 4e-9; of the size sqrt(4 / 16): above 0.5e-9
    assert "16 kg, centre of mass at (0, 6e-10, 0.75) m" in found
    assert "Ixx 2, Iyy 3, Izz 4, Ixy 0, Ixz -0.25, Iyz 5e-09 kg m^2" in found


def chain(mass=2.0, inertia=(0.01, 0.2, 0.3), first=0.0):
    links = (Link(0.0, 0.0, first, 0.0, (first,) * 3), Link(0.0, 4.0, mass, 1.5, inertia))
    return Chain(links, (Hinge(0.0, {"xy": 1.0}),), 4.0)


def test_a_root_body_is_as_heavy_as_the_chain():
    across = 0.3 + 2.0 * 1.5**2  # the larger of both
    assert root_body(chain()) == pytest.approx([2.0, 0.01, across, across])
    # MuJoCo takes nothing below 1e-15
    assert root_body(chain(inertia=(0.0, 0.2, 0.3)))[1] == pytest.approx(1e-15, rel=1e-6)
    assert ballast_for(chain()) == pytest.approx(root_body(chain()))
    assert ballast_for(chain(first=1e-3)) is None
    with pytest.raises(EngineError, match="1e-16 kg"):
        root_body(chain(mass=1e-16, inertia=(1e-17,) * 3))


# -- behind a port ---------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("kp", "stiffness", "held"),
    [(0.0, 0.0, {}), (3.0, 0.0, {1: "servo"}), (3.0, 0.05, {1: "spring"})],
)
def test_joints_that_hold(kp, stiffness, held):
    model, _ = crafts(kp)
    model.jnt_stiffness[1] = stiffness
    assert held_joints(model) == held
    found = carriers(model, model.body("link").id)
    assert [(one.name, one.kind, one.own, one.holder) for one in found] == [
        ("hinge", "hinge", False, held.get(1, "")),
        ("joint 0", "free", True, ""),
    ]
    assert [one.words for one in found] == ["hinge joint hinge", "free joint 0"]
    assert [one.sprung for one in found] == [bool(held), False]


def test_a_place_farther_out_and_turned():
    model, data = crafts()
    quaternion = (0.5, 0.5, 0.5, 0.5)
    found = mount(model, "hand", "site", "hand", reach=0.7, turn=quaternion)
    site, body = data.site("hand"), data.body("link")
    axes = site.xmat.reshape(3, 3)
    assert found.origin == pytest.approx(site.xpos + 0.7 * axes[:, 0])
    turn = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    assert found.axes == pytest.approx(axes @ turn, abs=1e-12)
    frame = body.xmat.reshape(3, 3)
    assert found.position == pytest.approx(frame.T @ (found.origin - body.xpos), abs=1e-12)
    inside = Rotation.from_quat(found.quaternion, scalar_first=True).as_matrix()
    assert inside == pytest.approx(frame.T @ found.axes, abs=1e-12)
    data.qpos[7] = 0.8
    mujoco.mj_forward(model, data)
    origin, axes = root_frame(found, data)
    frame = data.body("link").xmat.reshape(3, 3)
    assert origin == pytest.approx(data.body("link").xpos + frame @ found.position)
    assert axes == pytest.approx(frame @ inside)
    on_body = mount(model, "link", "body", "link", reach=0.7)
    assert on_body.position == pytest.approx([0.7, 0.0, 0.0])
    assert on_body.quaternion == pytest.approx([1.0, 0.0, 0.0, 0.0])
    for kind, name in (("site", "none"), ("body", "world")):
        with pytest.raises(bc.InputError, match="--mount x"):
            mount(model, "x", kind, name)


def test_the_motion_of_a_port_is_that_of_its_body():
    model, data = crafts()
    found = mount(model, "hand", "site", "hand")
    data.qvel[:] = np.random.default_rng(2).normal(size=model.nv)
    mujoco.mj_forward(model, data)
    speed = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, data.site("hand").id, speed, 1)
    assert found.jacobian @ data.qvel == pytest.approx([*speed[3:], *speed[:3]], abs=1e-12)


def spread(seed):
    rows = np.random.default_rng(seed).normal(size=(6, 6))
    return rows @ rows.T / 6.0 + np.eye(6)


def test_what_is_rigidly_behind_a_port():
    """All of the craft but what rides on the appendage, and the other appendages that do not."""
    model, data = crafts()
    ports = [mount(model, name, "site", name) for name in ("port", "hand")]
    rigid = {"port": spread(1), "hand": spread(2)}
    nothing = {"port": ((), ()), "hand": ((), ())}
    found = rigid_hubs(model, ports, rigid, nothing)
    origin, frame = ports[0].origin, ports[0].axes
    own = about(parts(model, data, "bus", "link"), origin, frame)
    turn, arm = ports[1].axes.T @ frame, frame.T @ (ports[1].origin - origin)
    x, y, z = arm
    motion = np.block(
        [[turn, -turn @ np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])], [np.zeros((3, 3)), turn]]
    )
    wanted = own + motion.T @ rigid["hand"] @ motion
    assert found["port"] == pytest.approx(wanted, abs=1e-11)
    # behind the hand is the link alone, with nothing on it
    hand = about(parts(model, data, "link"), ports[1].origin, ports[1].axes)
    assert found["hand"] == pytest.approx(hand, abs=1e-12)
    link = model.body("link").id
    less = rigid_hubs(model, ports, rigid, {**nothing, "port": ((link,), ("hand",))})
    wanted = about(parts(model, data, "bus"), origin, frame)
    assert less["port"] == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("kp", [0.0, 3.0])
def test_the_apparent_hub_gives_way_where_joints_are_loose(kp):
    """(J M^-1 J^T)^-1, by MuJoCo's mass matrix; a servo holds its joint."""
    model, data = crafts(kp)
    ports = [mount(model, name, "site", name) for name in ("port", "hand")]
    rigid = {"port": spread(1), "hand": spread(2)}
    found = apparent_hubs(model, ports, rigid)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    mass += ports[1].jacobian.T @ rigid["hand"] @ ports[1].jacobian
    free = np.delete(np.arange(model.nv), [6] if kp else [])
    jacobian = ports[0].jacobian[:, free]
    wanted = np.linalg.inv(jacobian @ np.linalg.inv(mass[np.ix_(free, free)]) @ jacobian.T)
    assert found["port"] == pytest.approx(wanted, rel=1e-8, abs=1e-8)


def test_a_motion_that_is_held_is_a_billion_times_as_heavy():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="bus"><joint type="slide" axis="1 0 0"/><joint
        type="slide" axis="0 1 0" stiffness="0"/><joint axis="0 0 1"/><inertial pos="0 0 0"
        mass="20" diaginertia="4 5 6"/><site name="port"/><site name="other"/></body>
        <body><joint/><geom size=".1"/></body>
        </worldbody></mujoco>"""
    )
    here = mount(model, "port", "site", "port")
    found = apparent_hubs(model, [here], {"port": np.zeros((6, 6))})["port"]
    # in units of the hub's own 20 kg and 4, 5, 6 kg m^2 each loose motion has a mass of 1
    assert np.diag(found) == pytest.approx([20.0, 20.0, 20e9, 4e9, 5e9, 6.0], rel=1e-9)
    # what another port carries is felt too, and what is held is as much heavier
    beside = mount(model, "other", "site", "other")
    carried = {"port": np.zeros((6, 6)), "other": np.diag([60.0, 60.0, 60.0, 8.0, 10.0, 18.0])}
    both = apparent_hubs(model, [here, beside], carried)["port"]
    assert np.diag(both) == pytest.approx([80.0, 80.0, 80e9, 16e9, 20e9, 24.0], rel=1e-9)
    # where springs hold all that moves the port, they give way
    model.jnt_stiffness[:3] = 3.0
    same = apparent_hubs(model, [here], {"port": np.zeros((6, 6))})["port"]
    assert same == pytest.approx(found)
    model.jnt_stiffness[1] = 0.0
    one = apparent_hubs(model, [here], {"port": np.zeros((6, 6))})["port"]
    assert np.diag(one) == pytest.approx([20e9, 20.0, 20e9, 4e9, 5e9, 6e9], rel=1e-9)
    assert here.held(["xy", "axial"]) == []
    assert here.held(["xz", "torsion"]) == ["xz", "torsion"]
