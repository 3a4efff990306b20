"""What cannot be asked of an uncertain plant is refused by one sentence that names what is
wrong, its value and the cure. No tolerances: sentences only."""

import sys
from functools import cache
from pathlib import Path

import mujoco
import pytest

import beamchain as bc
from beamchain import robust
from refused import check_refused

NAN = float("nan")
TORQUE = ["torque:bus"]
OSCILLATOR = """<mujoco><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="10" diaginertia="5 6 7"/><body name="rotor">
<joint name="drive" axis="0 0 1" stiffness="12" damping="0.04"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 2"/></body></body></worldbody></mujoco>"""
LOOP = """[[loop]]
input = "torque_z"
output = "attitude_z"
numerator = [80.0]
denominator = [0.05, 1.0]
"""
HELD = LOOP.replace("[80.0]", "[8.0, 3.0]").replace("0.05", "0.1")  # stable about z


@cache
def plant(**more):
    model = mujoco.MjModel.from_xml_string(OSCILLATOR)
    return bc.plant(model, TORQUE, ["attitude"], **more)


def file_of(content, close):
    Path("loops.toml").write_text(content)
    close("loops.toml")


RANGES = bc.spec.UncertainCraft(
    joint={"drive": bc.spec.UncertainJoint(stiffness=bc.spec.Uncertainty(relative=0.3))},
    body={"bus": bc.spec.UncertainBody(inertia_zz=bc.spec.Uncertainty(relative=0.1))},
)


@cache
def uncertain():
    return robust.uncertain(plant(), RANGES)


def worst(**options):
    Path("loops.toml").write_text(LOOP)
    uncertain().worst_case("loops.toml", **options)


def bound_without_the_extra():
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "cvxpy", None)
        file_of(HELD, uncertain().bound)


REFUSED = {
    "nothing uncertain": (lambda: robust.uncertain(plant()), ("nothing is",)),
    "uncertain and discrete": (
        lambda: robust.uncertain(plant(discrete=0.0005), RANGES),
        ("discrete",),
    ),
    "sample nan": (lambda: uncertain().sample({"bus.inertia_zz": NAN}), ("finite number",)),
    "sample beyond": (
        lambda: uncertain().sample([2.0] * len(uncertain().blocks)),
        ("between -1 and 1",),
    ),
    "model outside": (
        lambda: uncertain().model({"drive.stiffness": -5.0}),
        ("drive.stiffness", "outside its range"),
    ),
    "kind": (lambda: uncertain().sample({"bus.weight": 1.0}), ("bus.weight", "unknown")),
    "kind with a slip": (lambda: uncertain().sample({"bus.mas": 1.0}), ("choose from",)),
    "count": (lambda: uncertain().draw(-1), ("count = -1",)),
    "samples": (lambda: worst(samples=-3), ("samples = -3",)),
    "omega": (lambda: worst(omega=[0.0]), ("omega = 0.0",)),
    "no controller": (lambda: uncertain().worst_case(None), ("controller = None",)),
    "no plant": (lambda: robust.uncertain("craft.xml"), ("plant: 'craft.xml'", "bc.plant")),
    "one pose": (
        lambda: robust.worst_case(plant(), RANGES, "loops.toml"),
        ("a list of poses",),
    ),
    "one pose's margins": (
        lambda: robust.worst_margins(plant(), RANGES, "loops.toml"),
        ("a list of poses",),
    ),
    "without the extra": (bound_without_the_extra, ("pip install beamchain[robust]",)),
}


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_asked_of_an_uncertain_plant_is_refused(case):
    check_refused(REFUSED[case][0], bc.InputError, REFUSED[case][1])
