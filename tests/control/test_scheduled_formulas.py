"""Closed forms beside plants in several poses: modes that are followed, states in one order,
figures by mode."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from beamchain.control.scheduled import ScheduledPlant, follow, in_one_order, reduced_alike
from beamchain.craft.modal_form import ModalForm
from beamchain.engine.normal_modes import NormalModes
from formulas import follow_modes

MASS = np.diag([4.0, 1.0])


def modes_at(angle, order=(0, 1), signs=(1.0, 1.0), mass=MASS):
    """Two modes that turn by an angle, of unit mass, at 1 and 2 rad/s in their own order."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shapes = np.diag(1.0 / np.sqrt(np.diag(mass))) @ turn
    pick = list(order)
    frequency = np.array([1.0, 2.0])[pick]
    return NormalModes(np.zeros((2, 0)), (), shapes[:, pick] * signs, frequency, mass)


def way(length):
    return SimpleNamespace(length=length, at=lambda share: np.array([share]))


def test_modes_take_the_order_and_the_signs_of_those_before():
    found = follow_modes(
        way(0.01), None, modes_at(0.0), modes_at(0.1, (1, 0), (-1.0, 1.0)), (0.0, 1.0)
    )
    assert found.frequency.tolist() == [1.0, 2.0]
    np.testing.assert_allclose(found.shapes, modes_at(0.1).shapes)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_mode_that_is_hardly_alike_keeps_its_sign_too(sign):
    """A mirror (1 - 2 v v^T) of nine modes leaves 0.05 of the first in its place, and more than
    0.8 of all others, of which none takes more than 0.4 of it."""
    v = np.append(np.sqrt(0.475), np.full(8, np.sqrt(0.525 / 8.0)))
    mirror = np.eye(9) - 2.0 * np.outer(v, v)
    mirror[:, 0] *= sign
    frequency, none = np.arange(1.0, 10.0), np.zeros((9, 0))
    before = NormalModes(none, (), np.eye(9), frequency, np.eye(9))
    after = NormalModes(none, (), mirror, frequency, np.eye(9))
    found = follow_modes(way(0.01), None, before, after, (0.0, 1.0))
    assert found.frequency.tolist() == frequency.tolist()
    assert found.shapes[0, 0] == pytest.approx(0.05)
    assert (np.diag(found.shapes)[1:] > 0.8).all()


def test_modes_are_compared_by_the_mean_of_both_masses():
    """v^T (M + N)/2 w: of masses 1 and 3 of one coordinate, and 3 and 1 of the other,
    (1 + 3)/2 / sqrt(3) = 1.155 of each; the modes in the first one's order."""
    before = modes_at(0.0, mass=np.diag([1.0, 3.0]))
    after = modes_at(0.0, (1, 0), mass=np.diag([3.0, 1.0]))
    found = follow_modes(way(0.09), None, before, after, (0.0, 1.0))
    assert found.frequency.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("length", "turned", "asked"),
    [
        (0.099, 0.0, []),
        (0.101, 0.0, [0.5]),
        (0.199, 0.0, [0.5]),
        (0.201, 0.0, [0.5, 0.25, 0.75]),
        # unlike by cos^2 below 0.9, from 0.3217 rad on: half of it is alike
        (0.05, 0.32, []),
        (0.05, 0.324, [0.5]),
        (0.019, 0.324, []),
        (0.021, 0.324, [0.5]),
    ],
)
def test_poses_between_are_looked_at_where_it_is_far_or_unlike(length, turned, asked):
    seen = []

    def between(place):
        seen.append(float(place[0]))
        return modes_at(turned * place[0])

    follow_modes(way(length), between, modes_at(0.0), modes_at(turned), (0.0, 1.0))
    assert seen == asked


def test_modes_that_pass_each_other_between_poses_are_followed_by_those_between():
    """They turn by 90 degrees: compared at the ends alone they would change places."""
    found = follow_modes(
        way(2.0),
        lambda place: modes_at(np.pi / 2.0 * place[0]),
        modes_at(0.0),
        modes_at(np.pi / 2.0),
        (0.0, 1.0),
    )
    assert found.frequency.tolist() == [1.0, 2.0]
    np.testing.assert_allclose(found.shapes, modes_at(np.pi / 2.0).shapes, atol=1e-15)


ARM = """<mujoco><worldbody><body><joint axis="0 0 1"/><geom size="0.1" mass="1"/>
<body pos="1 0 0"><joint axis="0 0 1"/><geom size="0.1" pos="0.5 0 0" mass="1"/></body></body>
</worldbody></mujoco>"""


def test_modes_are_followed_from_pose_to_pose_along_their_joints():
    """Two modes that turn with the elbow, in any order and with any sign of each pose."""
    model = mujoco.MjModel.from_xml_string(ARM)
    poses = {0.0: (0, 1), 0.9: (1, 0), -0.4: (0, 1), 2.0: (1, 0)}
    crafts = [
        SimpleNamespace(
            modes=modes_at(angle, order, (1.0, -1.0) if angle else (1.0, 1.0)),
            point=SimpleNamespace(model=model, qpos=np.array([0.3, angle])),
        )
        for angle, order in poses.items()
    ]
    found = follow(crafts, lambda qpos: modes_at(float(qpos[1])))
    assert len(found) == len(poses)
    for angle, one in zip(poses, found, strict=True):
        assert one.frequency.tolist() == [1.0, 2.0]
        np.testing.assert_allclose(one.shapes, modes_at(angle).shapes, atol=1e-12)


def form(names, driven, seen):
    n = len(names)
    return ModalForm(
        -np.diag(np.arange(1.0, n + 1.0)),
        np.array(driven, dtype=float)[:, None],
        np.array(seen, dtype=float)[None],
        np.zeros((1, 1)),
        tuple(names),
        ("",) * n,
        np.ones(n),
        (0, 0),
    )


def test_states_of_all_poses_stand_in_the_order_of_the_first():
    first, second = form("abc", [1, 2, 0], [1, 0, 3]), form("cab", [5, 0, 6], [0, 7, 8])
    one, other = in_one_order([first, second])
    assert one.names == other.names == ("a", "b", "c")
    assert np.diag(other.a).tolist() == [-2.0, -3.0, -1.0]
    assert other.b[:, 0].tolist() == [0.0, 6.0, 5.0]
    assert other.c[0].tolist() == [7.0, 8.0, 0.0]
    assert in_one_order([first, form("abd", [1, 1, 1], [1, 1, 1])]) is None
    # of the first `a` is driven and seen, of the second `b`
    assert [each.names for each in reduced_alike([one, other])] == [("a", "b")] * 2


def test_figures_of_poses_by_mode():
    def plant(modes, values):
        values = np.array(values)
        gain = values[:, None, None] * np.array([[1.0, 10.0]])
        return SimpleNamespace(
            modes=modes, frequency=values, damping_ratio=values / 100.0, gain=gain
        )

    plants = plant(("a", "b"), [1.0, 2.0]), plant(("c", "b"), [3.0, 4.0])
    values = np.array([[0.5, 0.2], [1.5, 0.3]])
    made = ScheduledPlant(plants, ("p", "q"), ("hinge", "slide"), ("rad", "m"), values, "hinge")
    nan = np.nan
    assert made.modes == ("a", "b", "c")
    assert len(made) == 2
    assert made[1] is plants[1]
    np.testing.assert_array_equal(made.frequency, [[1.0, 2.0, nan], [nan, 4.0, 3.0]])
    np.testing.assert_array_equal(made.damping_ratio, [[0.01, 0.02, nan], [nan, 0.04, 0.03]])
    assert made.gain[:, :, 0].tolist() == [
        [[1.0, 10.0], [2.0, 20.0], [0.0, 0.0]],
        [[0.0, 0.0], [4.0, 40.0], [3.0, 30.0]],
    ]
    assert made.angles.tolist() == [0.5, 1.5]
    assert made.grid[0] == pytest.approx([90.0 / np.pi, 270.0 / np.pi])
    assert made.grid[1] == "degrees"
    slides = ScheduledPlant(plants, ("p", "q"), ("hinge", "slide"), ("rad", "m"), values, "slide")
    assert (slides.grid[0].tolist(), slides.grid[1]) == ([0.2, 0.3], "m")
    listed = ScheduledPlant(plants, ("p", "q"), ("hinge", "slide"), ("rad", "m"), values)
    assert (listed.angles, listed.grid) == (None, None)
