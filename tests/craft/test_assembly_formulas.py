"""A whole spacecraft at rest beside matrices written out here: a bus with a mass that slides across
at its root, which is a port model of two modes, and the same in MuJoCo with other springs."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from formulas import (
    Assembly,
    CraftError,
    ModeOfCraft,
    PlacedBody,
    assembly_at_rest,
    modes_at_pose,
    modes_sentence,
    mount,
)

BUS, SLIDING, TURNS = 60.0, 5.0, 0.3  # kg, kg, kg m^2 of what slides
INERTIA = np.array([20.0, 25.0, 30.0])
ROOT = np.array([0.5, 0.3, -0.2])
FREQUENCY, RATIO = np.array([2.0, 3.0]), np.array([0.01, 0.02])
OFF = np.array([1.02, 0.97])  # of MuJoCo's frequencies
BAND = 2.6
CRAFT = f"""<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody><body name="{{name}}">
<freejoint/><inertial pos="0 0 0" mass="{BUS}" diaginertia="{" ".join(map(str, INERTIA))}"/>
<site name="root" pos="{" ".join(map(str, ROOT))}"/>{{more}}</body></worldbody>
<keyframe><key name="far" qpos="3 0 0 1 0 0 0{{zeros}}"/></keyframe></mujoco>"""


def sliding(count):
    """What slides along y, or y and z, as a body of MuJoCo."""
    springs = SLIDING * (OFF * FREQUENCY) ** 2
    dampers = 2.0 * RATIO * OFF * FREQUENCY * SLIDING
    joints = "".join(
        f'<joint type="slide" axis="{axis}" stiffness="{k}" damping="{d}"/>'
        for axis, k, d in list(zip(("0 1 0", "0 0 1"), springs, dampers, strict=True))[:count]
    )
    return f"""<body pos="{" ".join(map(str, ROOT))}">{joints}<inertial pos="0 0 0"
    mass="{SLIDING}" diaginertia="{TURNS} {TURNS} {TURNS}"/></body>"""


def models(name="bus", count=2):
    texts = [CRAFT.format(name=name, more="", zeros="")]
    texts.append(CRAFT.format(name=name, more=sliding(count), zeros=" 0" * count))
    return [mujoco.MjModel.from_xml_string(text) for text in texts]


def carried(craft, count=2, kept=(True, False)):
    rigid = np.diag([SLIDING] * 3 + [TURNS] * 3)
    rows = np.sqrt(SLIDING) * np.eye(6)[[1, 2]]
    model = bc.PortModel(rigid, FREQUENCY, rows, damping=RATIO)
    dofs = [6, 7][:count]
    return [
        PlacedBody(mount(craft, "root", "site", "root"), model, np.array(kept), dofs, {"xy": 2.4})
    ]


def matrices(factor=(1.0, 1.0)):
    """Of the bus and both slides, in kg and m: the bus does not turn."""
    x, y, z = ROOT
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    root = np.block([[np.eye(3), -cross], [np.zeros((3, 3)), np.eye(3)]])
    mass = np.diag([BUS] * 3 + list(INERTIA) + [SLIDING] * 2)
    mass[:6, :6] += root.T @ np.diag([SLIDING] * 3 + [TURNS] * 3) @ root
    mass[6:, :6] = SLIDING * root[1:3]
    mass[:6, 6:] = mass[6:, :6].T
    w = np.array(factor) * FREQUENCY
    damping = np.diag([0.0] * 6 + list(2.0 * RATIO * w * SLIDING))
    return mass, damping, np.diag([0.0] * 6 + list(SLIDING * w**2))


def accelerance(omega, factor=(1.0, 1.0)):
    """`(6, 6, k)` of the bus [m/s^2 per N, ...]."""
    mass, damping, stiffness = matrices(factor)
    found = [
        -(w**2) * np.linalg.inv(stiffness - w**2 * mass + 1j * w * damping)[:6, :6] for w in omega
    ]
    return np.moveaxis(np.array(found), 0, -1)


def frequencies(factor=(1.0, 1.0)):
    mass, _, stiffness = matrices(factor)
    return np.sqrt(eigh(stiffness, mass, eigvals_only=True)[6:])


PROMISE = CraftError(0.2, BAND, {"far": 0.2, "rest": 0.0123}, tuple(range(6)), "bus", {})


@pytest.mark.parametrize(("band", "end"), [(None, BAND), (3.3, 3.3)])
def test_a_spacecraft_at_rest_beside_its_matrices(band, end):
    craft, model = models()
    found = assembly_at_rest(craft, model, carried(craft), PROMISE, band)
    exact, ours = frequencies(), frequencies(OFF)
    assert [mode.exact for mode in found.modes] == pytest.approx(exact)
    assert [mode.mujoco for mode in found.modes] == pytest.approx(ours, rel=1e-6)
    assert [mode.kept for mode in found.modes] == [True, False]
    assert (found.band, found.common) == (band or 2.4, BAND)
    assert found.worst == pytest.approx(ours[0] / exact[0] - 1.0, rel=1e-4)
    assert found.omega[-1] == pytest.approx(1.3 * end)
    np.testing.assert_allclose(found.exact, accelerance(found.omega), rtol=1e-8, atol=1e-12)
    achieved = accelerance(found.omega, OFF)
    np.testing.assert_allclose(found.achieved, achieved, rtol=1e-5, atol=1e-8)
    # each motion by the root of the inertia that it feels with all slides locked
    whole = np.linalg.inv(matrices()[0][:6, :6])
    size = 1.0 / np.sqrt(np.diag(np.linalg.inv(whole)))
    away, there = (
        np.linalg.norm(np.moveaxis(part, -1, 0) / np.outer(size, size), 2, axis=(1, 2))
        for part in (found.achieved - found.exact, found.exact)
    )
    locked = np.linalg.norm(whole / np.outer(size, size), 2)
    np.testing.assert_allclose(found.error, away / np.maximum(there, locked), rtol=1e-6)
    assert (found.in_band, found.hub, found.motions) == (0.0123, "bus", tuple(range(6)))


def test_some_motions_of_a_body_without_a_name():
    craft, model = models(name="")
    promise = CraftError(0.2, BAND, {"rest": 0.1}, (5, 1), "body 1", {})
    found = assembly_at_rest(craft, model, carried(craft), promise, None)
    assert (found.hub, found.motions) == ("body 1", (5, 1))
    wanted = accelerance(found.omega)[np.ix_([5, 1], [5, 1])]
    np.testing.assert_allclose(found.exact, wanted, rtol=1e-8, atol=1e-12)


def test_modes_at_a_keyframe_up_to_the_band_or_to_the_highest_kept():
    craft, model = models()
    low, high = frequencies()
    for kept, band, beyond, count in (
        ((True, False), 1.01 * low, False, 1),
        ((True, False), 0.99 * low, False, 0),
        ((True, False), 0.99 * low, True, 1),
        ((True, True), 1.01 * low, True, 2),
        ((True, True), 1.01 * low, False, 1),
        ((True, False), 1.01 * low, True, 1),
        ((True, False), 1.01 * high, False, 2),
    ):
        found = modes_at_pose(craft, model, carried(craft, kept=kept), band, "far", beyond=beyond)
        assert [mode.exact for mode in found] == pytest.approx([low, high][:count])
    with pytest.raises(bc.InputError, match="'near'"):
        modes_at_pose(craft, model, carried(craft), BAND, "near")


@pytest.mark.parametrize("share", [0.52, 0.48])
def test_a_mode_is_kept_where_half_of_its_energy_is(share):
    """Of two modes of one frequency, told in coordinates that mix them."""
    mass, _, _ = matrices()
    springs = np.diag([0.0] * 6 + [4.0 * SLIDING] * 2)
    _, shapes = eigh(springs, mass)
    moved = shapes[6:, 6:]  # of both slides, of equal mass
    turn = np.arctan2(moved[1, 0], moved[0, 0]) - np.arccos(np.sqrt(share))
    mixed = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    energy = (mixed[0] @ moved) ** 2 / np.sum(moved**2, axis=0)
    assert energy[0] == pytest.approx(share)
    craft, model = models()
    rigid = np.diag([SLIDING] * 3 + [TURNS] * 3)
    rows = mixed @ (np.sqrt(SLIDING) * np.eye(6)[[1, 2]])
    whole = bc.PortModel(rigid, np.array([2.0, 2.0]), rows, damping=RATIO[[0, 0]])
    place = mount(craft, "root", "site", "root")
    item = PlacedBody(place, whole, np.array([True, False]), [6, 7], {"xy": 2.0})
    found = modes_at_pose(craft, model, [item], 9.0, "far")
    assert [mode.kept for mode in found] == (energy > 0.5).tolist()


def told(*modes):
    nothing = np.zeros(0)
    rows = tuple(ModeOfCraft(*mode) for mode in modes)
    return Assembly(rows, BAND, BAND, nothing, nothing, nothing, (0,), nothing, 0.0, "bus")


def sentence(assembly, met=False):
    return modes_sentence(SimpleNamespace(assembly=assembly, met=met))


def test_what_is_worst_and_what_is_left_out():
    made = told(
        (1.0, 1.01, True), (2.0, 1.9, True), (BAND, None, False), (2.7, 2.0, True),
        (2.5, 2.0, False), (None, 1.0, False), (2.1, None, True),
    )  # fmt: skip
    assert [mode.exact for mode in made.judged] == [1.0, 2.0, 2.1]
    assert made.worst == pytest.approx(0.05)
    assert "5.0e-02; 2 modes" in sentence(made)
    assert "; one mode" in sentence(told((BAND, None, False)))
    assert ";" not in sentence(told((2.7, None, False), (1.0, None, True)))
    assert ";" not in sentence(made, met=True)
    assert told((BAND, 2.0 * BAND, True)).worst == pytest.approx(1.0)
    above = told((2.7, None, True), (2.8, 3.08, True), (2.9, 8.0, True))
    assert (above.judged, above.worst) == ((), 0.0)
    assert sentence(above) == f"no kept mode lies up to {BAND:.4g} rad/s"
    assert "rad/s; one mode" in sentence(told((1.0, 1.0, False)))
