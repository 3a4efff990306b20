"""Beams that hang from a craft at a pose: what gravity adds to their first modes, by Rayleigh's
quotient, exact to first order; what acts on a craft, and the worst of its poses."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from formulas import (
    Loading,
    PlacedBody,
    Pose,
    PoseUnderLoad,
    acting,
    bent_line,
    check_standing,
    craft_error,
    liquid_prefixes,
    loadings_of,
    mount,
    slow_modes,
)

BENDING, LINE = 900.0, 1.5
LENGTHS = {"one": 5.0, "other": 4.0}
MODEL = mujoco.MjModel.from_xml_string(
    """<mujoco><worldbody><body name="bus"><joint axis="0 0 1"/>
    <inertial pos="0 0 0" mass="1e9" diaginertia="1e9 1e9 1e9"/>
    <site name="one" pos="1 0 0" quat="1 0 1 0"/><site name="other" pos="0 2 0" quat="1 0 1 0"/>
    </body></worldbody></mujoco>"""
)
FIRST = 1.8751040687


def carried(place):
    section = bc.Equivalent(bending_stiffness_xy=BENDING, linear_mass=LINE, polar_inertia=1e-3)
    beam = bc.Beam(segments=[bc.Segment(length=LENGTHS[place], section=section)])
    ports, rigid = {"xy": beam.port("xy", 8)}, beam.rigid_mass()

    def line(band):
        return bent_line(beam, ports, rigid, [], band)

    whole = line(1.0).model
    kept = np.arange(whole.modes) == 0
    at = list(LENGTHS).index(place)
    return PlacedBody(
        mount(MODEL, place, "site", place), whole, kept, [1 + at], {"xy": 2.0}, line=line
    )


@pytest.fixture(scope="module")
def items():
    return [carried(place) for place in LENGTHS]


def pose(items, field):
    if not any(field):
        return Pose(MODEL, np.zeros(1), items, 2.0, (5,))
    nothing = np.zeros(0)
    load = Loading(np.zeros(3), nothing, nothing, np.array(field), None, np.zeros((1, 1)))
    return PoseUnderLoad(load, MODEL, np.zeros(1), items, 2.0, (5,))


@pytest.mark.parametrize("gravity", [0.0, 0.2])
def test_gravity_along_hanging_beams_adds_to_the_squares_of_their_frequencies(items, gravity):
    """w^2 + 1.5709 g / L of each."""
    made = pose(items, (0.0, 0.0, -gravity))
    found, _ = slow_modes(made.with_exact, 2.0)
    still = np.array([FIRST**4 * BENDING / (LINE * long**4) for long in LENGTHS.values()])
    added = np.array([1.5709 * gravity / long for long in LENGTHS.values()])
    assert found[:2] ** 2 - still == pytest.approx(added, rel=3e-3, abs=1e-5)
    assert [flags.tolist() for flags in made.kept] == [
        [True, False, False, False, False, False]
    ] * 2
    assert made.peaks[:, 0].min() == pytest.approx(found[0], rel=1e-4)
    assert [part.tolist() for part in made.modal_coordinates] == [
        list(range(1, 7)),
        list(range(7, 13)),
    ]


THRUST = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="20" diaginertia="1 1 1"/><site name="one"/><site name="other"/>
<body pos="0 0 1"><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/></body></body></worldbody>
<actuator><motor site="one" gear="0 3 0 0 0 0"/></actuator>
<keyframe><key name="idle"/><key name="burn" ctrl="7"/></keyframe></mujoco>"""


def test_a_thrust_accelerates_all_mass():
    """F over the mass of bus and appendages, where a keyframe has it; bodies are pushed back."""
    model = mujoco.MjModel.from_xml_string(THRUST)
    masses = {"one": 4.0, "other": 6.0}
    items = [
        SimpleNamespace(
            mount=mount(model, place, "site", place),
            whole=SimpleNamespace(rigid_mass=np.diag([mass, 0.1, 0.1, 0.1, 0.1, 0.1])),
            line=None,
            loads=(),
        )
        for place, mass in masses.items()
    ]
    found = acting(model, items)
    assert list(found) == [("burn", 1)]
    assert found["burn", 1].field == pytest.approx([0.0, -21.0 / 35.0, 0.0])
    with pytest.raises(bc.InputError, match="at one is imported modes"):
        loadings_of(model, items)
    for item in items:
        item.line = "known"
    assert list(loadings_of(model, items)) == [("burn", 1)]
    items[1].loads = (SimpleNamespace(bodies=(1,)),)  # the thruster stands on what hangs on a port
    with pytest.raises(bc.InputError, match="keyframe 'burn': .* pushes with ctrl = 7 on what"):
        loadings_of(model, items)
    with pytest.raises(bc.InputError, match="no load acts"):
        loadings_of(mujoco.MjModel.from_xml_string(THRUST.replace('"7"', '"0"')), items)


def grows_at(rate):
    """A motion that grows at a rate, or one that does not."""
    return SimpleNamespace(
        mass=np.eye(1),
        damping=np.zeros((1, 1)),
        stiffness=np.array([[4.0 if not rate else -(rate**2)]]),
    )


def judged(error, rates=None, body=1, motions=(0,)):
    """A pose at which the file is off by so much; under a load that makes something grow."""
    exact, ours = (0.0, 0.0) if rates is None else rates
    return SimpleNamespace(
        body=body,
        band=5.0,
        motions=motions,
        loading=None if rates is None else "load",
        with_exact=grows_at(exact),
        compiled=lambda model, qpos, of: grows_at(ours),
        of_compiled=lambda compiled: error,
    )


def test_the_worst_pose_counts_and_what_grows_anywhere():
    model = mujoco.MjModel.from_xml_string(THRUST)
    exact = {
        "rest": [judged(0.02), judged(0.05, motions=(1,)), judged(0.01)],
        "idle": [judged(0.03, (0.0, 0.0))],
        "burn": [judged(0.04, (0.7, 0.0)), judged(0.02, (0.6, 0.3))],
    }
    found = craft_error(model, model, exact)
    assert (found.error, found.band, found.motions, found.body) == (0.05, 5.0, (1,), "bus")
    assert found.poses == {"rest": 0.05, "idle": 0.03, "burn": 0.04}
    assert found.growth == {"burn": (pytest.approx(0.7), pytest.approx(0.3))}
    unnamed = craft_error(model, model, {"rest": [judged(0.0, body=2)]})
    assert (unnamed.error, unnamed.body, unnamed.poses) == (0.0, "body 2", {"rest": 0.0})


# -- what a load makes topple ----------------------------------------------------------------------
@pytest.mark.parametrize(
    ("stiffness", "topples"),
    [
        ([[2.0, 1.3], [1.3, 1.0]], False),
        ([[2.0, 1.5], [1.5, 1.0]], True),  # 2 - 2.25 < 0
        ([[1e-8, 1.1e-8], [1.1e-8, 1e-8]], True),  # however soft
        ([[3.0, 0.0], [0.0, -1e-6]], True),
        ([[1.0, 1.0 + 1e-10], [1.0 + 1e-10, 1.0]], False),  # rounding
        ([[1.0, 1.0 + 1e-8], [1.0 + 1e-8, 1.0]], True),
    ],
)
def test_what_has_no_stiffness_left_topples(stiffness, topples):
    load = SimpleNamespace(words="under 3 m/s^2 of gravity")
    if topples:
        with pytest.raises(bc.InputError, match="loaded: under 3 m/s.2 of gravity something"):
            check_standing(np.array(stiffness), load)
    else:
        check_standing(np.array(stiffness), load)


def test_liquids_are_told_by_hinges_that_no_spring_holds():
    chain = "".join(
        f'<body><joint name="{name}" stiffness="{stiffness}"/><geom size="1"/>'
        for name, stiffness in (
            ("drive", 0), ("b_hinge1_xy", 0), ("b_hinge2_xz", 0), ("boom_hinge1_xy", 7),
            ("a_hinge1_xy", 0),
        )
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{chain}{'</body>' * 5}</worldbody></mujoco>"
    )
    assert liquid_prefixes(model) == ["a_", "b_"]
