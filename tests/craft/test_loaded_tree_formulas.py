"""A spacecraft under its own load, whose appendages bend as chains of rigid links do: MuJoCo's own
tree of these links has the same mass matrix, potential and sag."""

from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from formulas import BentLine, LoadedTree, LoadOfPort, Root, carrying_of

FIELD = np.array([0.7, -1.9, -3.1])
TURNS = {name: Rotation.from_rotvec(v) for name, v in (
    ("a", [0.3, -0.5, 0.9]), ("hand", [0.2, 0.8, -0.1]), ("b", [-0.6, 0.1, 0.4]),
    ("tool", [0.5, 0.5, -0.7]),
)}  # fmt: skip
# the place of A on the bus, the hand beside the end of its first link; B and the tool on the hand
AT = {
    "a": np.array([0.4, 0.2, -0.1]),
    "hand": np.array([0.4, 0.2, -0.1]) + TURNS["a"].apply([1.1, 0.05, -0.02]),
    "b": np.array([0.3, -0.2, 0.1]),
    "tool": np.array([0.3, -0.2, 0.1]) + TURNS["b"].apply([0.75, 0.1, 0.03]),
}
INERTIAL = '<inertial pos="{}" quat="{}" mass="{}" diaginertia="{}"/>'
HAND = INERTIAL.format("0.1 0.2 -0.05", "0.9 0.1 -0.3 0.2", 3.0, "0.2 0.3 0.4")
TOOL = INERTIAL.format("0.02 -0.1 0.1", "0.8 -0.2 0.1 0.4", 2.0, "0.1 0.15 0.2")
BUS = INERTIAL.format("0.1 -0.1 0.3", "1 0 0 0", 9.0, "2 3 4")
JOINTS = {
    "bus": '<joint name="stand" axis="0.3 1 0.2" stiffness="40" armature="0.3"/>',
    "hand": '<joint name="wrist" axis="0 0.4 1" pos="0.05 0 0.1"/>',
    "tool": '<joint name="slide" type="slide" axis="1 0.2 0"/>',
}
QPOS = np.array([0.4, -0.7, 0.15])
SQUARES = np.array([90.0, 160.0, 60.0])  # of two modes of A and one of B
LENGTHS = {"a": [1.0, 0.8], "b": [0.7]}
CELLS = {"a": [(2.0, 0.45, (0.1, 0.3, 0.25)), (1.4, 0.3, (0.05, 0.1, 0.15))],
         "b": [(1.1, 0.4, (0.03, 0.06, 0.04))]}  # fmt: skip
AXES = {"a": ["z", "y"], "b": ["y"]}


def numbers(values):
    return " ".join(repr(float(v)) for v in values)


def placed(name, inside=""):
    """`pos` and `quat` of what stands there, in the axes of what `inside` names."""
    place, turn = AT[name], TURNS[name]
    if inside:
        place = TURNS[inside].inv().apply(place - AT[inside])
        turn = TURNS[inside].inv() * turn
    return f'pos="{numbers(place)}" quat="{numbers(turn.as_quat()[[3, 0, 1, 2]])}"'


def craft():
    """The rigid craft: the tool on the hand, the hand on the bus."""
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body name="bus" euler="10 -20 5">{JOINTS["bus"]}{BUS}
        <body name="hand" {placed("hand")}>{JOINTS["hand"]}{HAND}
        <body name="tool" {placed("tool")}>{JOINTS["tool"]}{TOOL}</body></body></body>
        </worldbody></mujoco>"""
    )


def link(which, i):
    """One link of an appendage, which the next and what it carries stand in."""
    mass, centre, inertia = CELLS[which][i]
    axis = {"y": "0 1 0", "z": "0 0 1"}[AXES[which][i]]
    inner = INERTIAL.format(f"{centre} 0 0", "1 0 0 0", mass, numbers(inertia))
    return f'<joint name="{which}{i}" axis="{axis}"/>{inner}'


def bending():
    """The same with links; the hand stands on A's first, the tool on B's."""
    tool = f"<body {placed('tool', 'b')}>{JOINTS['tool']}{TOOL}</body>"
    b = f"<body {placed('b')}>{link('b', 0)}{tool}</body>"
    hand = f"<body {placed('hand', 'a')}>{JOINTS['hand']}{HAND}{b}</body>"
    second = f'<body pos="{LENGTHS["a"][0]} 0 0">{link("a", 1)}</body>'
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="{numbers(FIELD)}"/><worldbody>
        <body euler="10 -20 5">{JOINTS["bus"]}{BUS}
        <body {placed("a")}>{link("a", 0)}{second}{hand}</body></body></worldbody></mujoco>"""
    )


TRUTH = bending()
ORDER = ["stand", "wrist", "slide", "a0", "a1", "b0"]
DOFS = [TRUTH.joint(name).dofadr[0] for name in ORDER]


DATA = mujoco.MjData(TRUTH)


def true_slope(at):
    """dV/dz, at coordinates about the pose."""
    DATA.qpos[DOFS] = at + np.append(QPOS, np.zeros(3))
    mujoco.mj_forward(TRUTH, DATA)
    return DATA.qfrc_bias[DOFS].copy()


def true_mass(at):
    true_slope(at)
    mass = np.zeros((TRUTH.nv, TRUTH.nv))
    mujoco.mj_fullM(TRUTH, DATA, mass)
    return mass[np.ix_(DOFS, DOFS)]


def true_curvature(at, size=1e-4):
    ways = size * np.eye(6)
    return np.array([(true_slope(at + w) - true_slope(at - w)) / (2.0 * size) for w in ways])


@cache
def true_sag():
    """`W^2 eta = -dV/d eta`, by Newton."""
    sag = np.zeros(6)
    for _ in range(8):
        force = true_slope(sag)[3:] + SQUARES * sag[3:]
        stiffness = np.diag(SQUARES) + true_curvature(sag)[3:, 3:]
        sag[3:] -= np.linalg.solve(stiffness, force)
    return sag


def line(which, rows, squares, size):
    """A line of rigid links."""
    count = len(LENGTHS[which])
    turns = np.zeros((count, count, 3))
    for i, axis in enumerate(AXES[which]):
        turns[i, i, "xyz".index(axis)] = 1.0
    frequencies = np.full(max(rows) + 1, np.nan)
    frequencies[rows] = np.sqrt(squares)
    masses, centres, inertias = (np.array(v) for v in zip(*CELLS[which], strict=True))
    inertias = np.einsum("ci,ij->cij", inertias, np.eye(3))
    none = np.zeros((count, count))
    return BentLine(
        SimpleNamespace(frequencies=frequencies), np.array(rows), np.array(LENGTHS[which]),
        masses, centres, inertias, turns, none, np.zeros((count, count, 3)),
        ((0, np.zeros((count, 3))),), np.array(size),
    )  # fmt: skip


@dataclass(frozen=True)
class Matrices:
    mass: np.ndarray
    stiffness: np.ndarray


@cache
def made(pushed=0.0, in_own_axes=lambda stiffness: stiffness):
    model = craft()
    loads = (
        (
            LoadOfPort(1.0, (2, 3), ("B",)),
            LoadOfPort(1.8, (), ()),
        ),
        (LoadOfPort(0.7, (3,), ()),),
    )
    roots = [SimpleNamespace(at=at, loads=own) for at, own in zip("AB", loads, strict=True)]
    mounts = [
        SimpleNamespace(body=body, position=AT[at], quaternion=TURNS[at].as_quat()[[3, 0, 1, 2]])
        for at, body in (("a", 1), ("b", 2))
    ]
    lines = (
        line("a", [1, 0], SQUARES[:2], [1.0, 2.0]),
        line("b", [0], SQUARES[2:], [0.7]),
    )
    loading = SimpleNamespace(
        field=FIELD,
        pushed=pushed * np.arange(9.0).reshape(3, 3),
        in_own_axes=in_own_axes,
    )
    return LoadedTree(model, QPOS, roots, mounts, lines, loading)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_tree_of_rigid_links_sags_as_mujoco_s(swapped):
    """One appendage on the other's port, in either order."""
    tree, wanted = made(), true_sag()
    if swapped:
        roots, mounts, lines = ([*part[::-1]] for part in (tree.roots, tree.mounts, tree.lines))
        tree = LoadedTree(tree.craft, QPOS, roots, mounts, lines, tree.loading)
        wanted = wanted[[0, 1, 2, 5, 3, 4]]
    assert np.max(np.abs(wanted)) > 0.1
    np.testing.assert_allclose(tree.sag, wanted, rtol=2e-5, atol=1e-7)
    assert np.all(tree.sag[:3] == 0.0)


@pytest.mark.parametrize("order", ["ABC", "CBA", "BCA"])
def test_booms_on_booms_bend_by_the_moment_of_all_that_stands_beyond(order):
    """Three stiff ones in a row along x: `W^2 eta = g sum m (x - x_root)`."""
    start = {"A": 0.0, "B": 1.0, "C": 1.8}
    mass, centre = {"A": 2.0, "B": 1.4, "C": 0.9}, {"A": 0.45, "B": 0.3, "C": 0.5}
    square = {"A": 4e4, "B": 2.5e4, "C": 1e4}
    carried = {"A": ("B", "C"), "B": ("C",), "C": ()}
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint type="slide" axis="0 1 0"/><geom size="1"/></body>
        </worldbody></mujoco>"""
    )
    roots, mounts, lines = [], [], []
    for at in order:
        length = {"A": 1.0, "B": 0.8, "C": 0.7}[at]
        loads = (LoadOfPort(length, (), carried[at]),) if carried[at] else ()
        roots.append(SimpleNamespace(at=at, loads=loads))
        place = np.array([start[at], 0.0, 0.0])
        mounts.append(SimpleNamespace(body=1, position=place, quaternion=np.eye(4)[0]))
        frequencies = SimpleNamespace(frequencies=np.sqrt([square[at]]))
        lines.append(
            BentLine(
                frequencies, np.zeros(1, int), np.array([length]), np.array([mass[at]]),
                np.array([centre[at]]), np.zeros((1, 3, 3)), np.array([[[0.0, 1.0, 0.0]]]),
                np.zeros((1, 1)), np.zeros((1, 1, 3)), ((0, np.zeros((1, 3))),), np.ones(1),
            )
        )  # fmt: skip
    loading = SimpleNamespace(field=np.array([0.0, 0.0, -9.8]))
    sag = LoadedTree(model, np.zeros(1), roots, mounts, lines, loading).sag
    moments = [
        9.8 * sum(mass[one] * (start[one] + centre[one] - start[at]) for one in (at, *carried[at]))
        for at in order
    ]
    wanted = [moment / square[at] for moment, at in zip(moments, order, strict=True)]
    assert sag[1:] == pytest.approx(wanted, rel=1e-5)


BASES = [4, 7]  # coordinate 3, and 6, are of nothing here
TO = [0, 1, 2, 5, 4, 7]  # of A the modes 1 and 0
RESTS = [3, 6]


def linear():
    """A straight craft with coordinates that the load does not touch."""
    random = np.random.default_rng(2)
    half = random.standard_normal((8, 8))
    mass = 30.0 * np.eye(8) + half @ half.T
    half = random.standard_normal((8, 8))
    return Matrices(mass, 50.0 * np.eye(8) + half @ half.T)


def test_what_a_load_adds_to_the_matrices_is_mujoco_s():
    craft, sag = linear(), true_sag()
    found = made(1.0, lambda stiffness: 2.0 * stiffness).loaded(craft, BASES, 1e3)
    added = found.stiffness - craft.stiffness
    curvature = true_curvature(sag)
    curvature[:3, :3] += np.arange(9.0).reshape(3, 3)
    np.testing.assert_allclose(added[np.ix_(TO, TO)], 2.0 * curvature, rtol=1e-4, atol=2e-3)
    assert np.all(added[RESTS] == 0.0)
    assert np.all(added[:, RESTS] == 0.0)
    heavier = found.mass - craft.mass
    wanted = true_mass(sag) - true_mass(np.zeros(6))
    assert np.max(np.abs(wanted)) > 0.5
    np.testing.assert_allclose(heavier[np.ix_(TO, TO)], wanted, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(heavier[RESTS], 0.0, atol=1e-9)


def slow_part(craft, top):
    """What modes below a frequency feel of the change of mass: `P^T dM P`, `P = B B^T M`."""
    values, shapes = np.linalg.eig(np.linalg.solve(craft.mass, craft.stiffness))
    slow = shapes[:, values < top**2]
    slow = slow @ np.linalg.inv(slow.T @ craft.mass @ slow) @ slow.T @ craft.mass
    change = np.zeros_like(craft.mass)
    change[np.ix_(TO, TO)] = true_mass(true_sag()) - true_mass(np.zeros(6))
    return slow.T @ change @ slow


def test_only_slow_modes_feel_the_change_of_mass():
    craft = linear()
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(craft.mass, craft.stiffness)).real)
    top = np.sqrt((squares[3] + squares[4]) / 2.0)
    found = made().loaded(craft, BASES, top / 600.0)
    np.testing.assert_allclose(found.mass - craft.mass, slow_part(craft, top), rtol=1e-3, atol=1e-3)
    assert np.max(np.abs(found.mass - craft.mass)) > 0.1


@pytest.mark.parametrize(
    ("fast", "other", "felt"),
    [(50.0, 1.0, 30.0), (20.0, 1.0, 10.0), (4.0, 1.0, 10.0), (4.0, 20.0, 10.0)],
)
def test_a_mode_does_not_lose_all_its_mass(fast, other, felt):
    """A mode of little mass along what becomes lighter: fewer modes feel it, those below 600, 300,
    100, 30 or 10 times the band; all below 10 times it do."""
    change = true_mass(true_sag()) - true_mass(np.zeros(6))
    at, vectors = np.linalg.eigh(change)
    lost = -at[0]
    assert lost > 0.1
    mass, stiffness = 2.0 * lost * np.eye(8), np.eye(8)
    light = np.where(at == at[0], 0.9 * lost, 2.0 * lost)
    mass[np.ix_(TO, TO)] = vectors @ np.diag(light) @ vectors.T
    stiff = np.where(at == at[0], fast**2, np.where(at == at[-1], other**2, 0.5 / lost)) * light
    stiffness[np.ix_(TO, TO)] = vectors @ np.diag(stiff) @ vectors.T
    craft = Matrices(mass, stiffness)
    found = made().loaded(craft, BASES, 1.0)
    wanted = slow_part(craft, felt)
    np.testing.assert_allclose(found.mass - craft.mass, wanted, rtol=1e-3, atol=1e-3)


def test_mass_of_what_ports_carry():
    """Twice its kinetic energy less that of the rigid craft's own motion, body by body."""
    model = craft()
    data = mujoco.MjData(model)
    data.qpos[:] = QPOS
    mujoco.mj_forward(model, data)
    random = np.random.default_rng(4)
    frames = Rotation.from_rotvec([[0.3, 0.5, -0.2], [0.9, -0.4, 0.1]]).as_matrix()
    origins = np.array([[0.2, -0.3, 0.5], [1.1, 0.4, -0.2]])
    motions = random.standard_normal((2, 6, 3))
    loads = (LoadOfPort(1.5, (2, 3), ("B", "C")),), (LoadOfPort(0.8, (3,), ()),)
    roots = [Root(at, origins[i], frames[i], motions[i], loads[i]) for i, at in enumerate("AB")]
    found = carrying_of(model, data, roots)
    assert found.ports == ((0, 1.5), (1, 0.8))
    rates = random.standard_normal(3 + 12)
    own, ports = rates[:3], rates[3:].reshape(2, 6)
    points = [origins[i] + x * frames[i][:, 0] for i, x in ((0, 1.5), (1, 0.8))]
    twist = [(frames[i] @ ports[i, :3], frames[i] @ ports[i, 3:]) for i in range(2)]

    def moved(place, by):
        """Speed and spin of a place that some ports carry."""
        speed = sum(twist[i][0] + np.cross(twist[i][1], place - points[i]) for i in by)
        return speed, sum(twist[i][1] for i in by)

    energy = 0.0
    for body, by in ((2, (0,)), (3, (0, 1))):
        jacobian = np.zeros((2, 3, 3))
        mujoco.mj_jacBodyCom(model, data, jacobian[0], jacobian[1], body)
        speed, spin = moved(data.xipos[body], by)
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        for sign, v, w in ((1.0, speed, spin), (-1.0, 0.0, 0.0)):
            v, w = jacobian[0] @ own + v, jacobian[1] @ own + w
            energy += sign * (model.body_mass[body] * v @ v + w @ inertia @ w)
    assert rates @ found.mass @ rates == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(found.mass, found.mass.T, atol=1e-14)
    # the second root stands on the first's port
    assert found.roots[0] @ rates == pytest.approx(motions[0] @ own)
    speed, spin = moved(origins[1], (0,))
    wanted = motions[1] @ own + np.append(frames[1].T @ speed, frames[1].T @ spin)
    assert found.roots[1] @ rates == pytest.approx(wanted)
    bare = [root._replace(loads=()) for root in roots]
    assert carrying_of(model, data, bare) is None
