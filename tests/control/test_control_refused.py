"""What no plant and no margin can be is refused by one sentence that names the argument,
its value and the cure. No tolerances: sentences only."""

from functools import cache
from pathlib import Path

import control
import mujoco
import numpy as np
import pytest

import beamchain as bc
from mechanics import compiled
from plant_truth import CRAFTS, text
from posed import CRAFT
from refused import check_refused

SPRUNG = "a sprung drive and worn bearings"
TORQUE = ["torque:bus"]

# -- signals, poses --------------------------------------------------------------------------------
SENSOR = (
    "<jointpos",
    '<touch name="feeler" site="unit"/><user name="mine" dim="1"/><rangefinder name="beam" '
    'site="unit"/><jointpos',
)
CUT = (
    '<gyro name="gyro"',
    '<framepos name="far" objtype="site" objname="unit" cutoff="0.1"/><gyro name="gyro"',
)
LIMITED = ('<joint name="drive" ', '<joint name="drive" limited="true" range="-1 1" ')
MUSCLE = (
    '<motor name="drive_motor" joint="drive"/>',
    '<muscle name="drive_motor" joint="drive" lengthrange="0 1"/>',
)
RIGID = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="9" diaginertia="1 2 2.5"/><geom name="box" size=".5"/></body>
<body name="other" pos="0.6 0 0">{}</body></worldbody></mujoco>"""


@cache
def bare(*changes):
    """The bare craft with a sprung drive, its text changed."""
    out = text(CRAFTS[SPRUNG])
    for old, new in changes:
        assert old in out
        out = out.replace(old, new)
    return compiled(out)


def asked(**arguments):
    bc.plant(bare(SENSOR, CUT, LIMITED), **arguments)


def posed(pose):
    bc.plant(mujoco.MjModel.from_xml_string(CRAFT), [*TORQUE, "spin"], pose=pose)


SIGNALS = {
    "actuator": (
        lambda: asked(inputs=["drive_motr"]),
        ("actuator of inputs = 'drive_motr'", "did you mean 'drive_motor'"),
    ),
    "body": (lambda: asked(inputs=["torque:hubb"]), ("'hubb'", "did you mean 'hub'")),
    "a name for names": (lambda: asked(inputs="drive_motor"), ("a list of names",)),
    "a name twice": (
        lambda: asked(inputs=["drive_motor", "drive_motor"]),
        ("names 'drive_motor' twice",),
    ),
    "sensor": (
        lambda: asked(outputs=["giro"]),
        ("sensor of outputs = 'giro'", "did you mean 'gyro'"),
    ),
    "site": (lambda: asked(outputs=["motion:unix"]), ("'unix'", "did you mean 'unit'")),
    "touch": (lambda: asked(outputs=["feeler"]), ("'feeler'", "no linear part", "a touch sensor")),
    "user": (lambda: asked(outputs=["mine"]), ("a user sensor has none",)),
    "rangefinder": (lambda: asked(outputs=["beam"]), ("a rangefinder sensor has none",)),
    "cutoff": (lambda: asked(outputs=["far"]), ("at its cutoff, 0.1",)),
    "discrete": (lambda: asked(discrete=0.0), ("discrete = 0.0", "above zero")),
    "muscle": (lambda: bc.plant(bare(MUSCLE)), ("activation", "not linear")),
    "contact": (
        lambda: bc.plant(RIGID.format('<geom name="wall" size=".2"/>')),
        ("'box' touches 'wall'", "a contact has no linear part"),
    ),
    "rigid": (lambda: bc.plant(RIGID.format("")), ("no flexible mode", "bc.embed")),
    "no model": (lambda: bc.plant(3), ("model = 3 is an int", "give the path")),
}

POSES = {
    "keyframe": (lambda: asked(pose="ran"), ("pose = 'ran'", "did you mean 'run'")),
    "keyframe 7": (lambda: asked(pose=7), ("pose = 7 is no keyframe", "has 1")),
    "two numbers": (lambda: asked(pose=[0.0, 1.0]), ("pose has the shape (2,)", "shape (9,)")),
    "joint": (lambda: asked(pose={"driv": 0.1}), ("'driv'", "did you mean 'drive'")),
    "degrees": (
        lambda: asked(pose={"drive": 45.0}),
        ("'drive' = 45", "range [-1, 1]", "angles are in rad"),
    ),
    "angles of two joints": (
        lambda: asked(pose={"drive": [0.1], "spin": [0.2]}),
        ("only one joint", "list of angles"),
    ),
    "joint of the second": (
        lambda: posed([{"drive": 0.1}, {"driv": 0.1}]),
        ("joint of pose[1] = 'driv'", "did you mean"),
    ),
    "keyframe of the second": (
        lambda: posed([{"drive": 0.1}, "drives"]),
        ("pose[1] = 'drives'", "did you mean 'drive'"),
    ),
    "angle of the second": (
        lambda: posed([{"drive": 0.1}, {"drive": 2.5}]),
        ("pose[1]: joint 'drive' = 2.5", "outside", "in rad"),
    ),
    "way of the second": (
        lambda: posed([{}, {"reach": 2.5}]),
        ("pose[1]: joint 'reach' = 2.5", "range [-1, 1]"),
    ),
    "angles of the second": (
        lambda: posed([{"drive": 0.1}, {"drive": [0.1, 0.2]}]),
        ("pose[1]['drive'] = ", "not a number"),
    ),
    "way that is text": (
        lambda: posed([{}, {"reach": "x"}]),
        ("pose[1]['reach'] = 'x'", "not a number", "in m"),
    ),
    "number of the second": (
        lambda: posed([{"drive": 0.1}, 7]),
        ("pose[1] = 7", "the model has 3"),
    ),
    "two numbers of the second": (
        lambda: posed([{"drive": 0.1}, [0.0, 1.0]]),
        ("pose[1] has the shape (2,)", "give qpos"),
    ),
    "a joint's name": (lambda: posed("turn"), ("pose = 'turn'", "by joint, {'turn': 0.5}")),
    "lists of two joints": (
        lambda: posed({"drive": [0.1], "turn": [0.2]}),
        ("several joints", "a list of poses"),
    ),
    "no pose": (lambda: posed([]), ("pose is an empty list", "at least one pose")),
}

# -- loops -----------------------------------------------------------------------------------------
OSCILLATOR = """<mujoco><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="10" diaginertia="5 6 7"/><body name="rotor">
<joint name="drive" axis="0 0 1" stiffness="12" damping="0.04"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 2"/></body></body></worldbody></mujoco>"""
Z, Y = ("torque_z", "attitude_z"), ("torque_y", "attitude_y")
LAG = control.tf([900.0, 80.0], np.polymul([0.05, 1.0], [0.03, 1.0]))
TWICE = control.append(control.ss(LAG), control.ss(LAG))
LOOP = """[[loop]]
input = "torque_z"
output = "attitude_z"
numerator = [80.0]
denominator = [0.05, 1.0]
"""


@cache
def plant(**more):
    model = mujoco.MjModel.from_xml_string(OSCILLATOR)
    return bc.plant(model, TORQUE, ["attitude"], **more)


def closed_by(controller):
    bc.margins(plant(), controller)


def stepped_by(controller):
    bc.margins(plant(discrete=0.01), controller)


def lag(step):
    return control.tf([1.0], [1.0, 0.5], step)


def named(*inputs):
    eye, zero = np.eye(2), np.zeros((2, 2))
    return control.ss(-eye, eye, eye, zero, inputs=inputs, outputs=["torque_z", "torque_y"])


def algebraic():
    bc.margins(control.ss(-1.0, 1.0, 1.0, 1.0), control.ss([], [], [], -1.0))


def file_of(content, close=closed_by):
    Path("loops.toml").write_text(content)
    close("loops.toml")


LOOPS = {
    "no names": (lambda: closed_by(LAG), ("takes 1 signals and gives 1", "3 outputs and 3 inputs")),
    "a number": (lambda: closed_by(7.0), ("is a float", "give a TOML file")),
    "no loop": (lambda: closed_by({}), ("holds no loop",)),
    "input": (
        lambda: closed_by({("torque_q", "attitude_z"): LAG}),
        ("input = 'torque_q'", "no input of the plant"),
    ),
    "output": (
        lambda: closed_by({("torque_z", "rate_z"): LAG}),
        ("output = 'rate_z'", "no output of the plant"),
    ),
    "one name": (lambda: closed_by({"torque_z": LAG}), ("no pair of names",)),
    "text": (lambda: closed_by({Z: "K"}), ("is a str", "give a TransferFunction")),
    "two signals": (lambda: closed_by({Z: TWICE}), ("has 2 inputs and 2 outputs",)),
    "improper": (lambda: closed_by({Z: control.tf([1.0, 0.0], [1.0])}), ("is improper",)),
    "nan": (lambda: closed_by({Z: control.ss([], [], [], np.nan)}), ("not finite",)),
    "inf": (lambda: closed_by({Z: float("inf")}), ("not finite",)),
    "any step": (lambda: closed_by({Z: lag(True)}), ("dt = True",)),
    "no step": (lambda: closed_by({Z: control.ss(-1.0, 1.0, 1.0, 0.0, None)}), ("dt = None",)),
    "two steps": (lambda: closed_by({Z: lag(0.25), Y: lag(0.5)}), ("give all loops one step",)),
    "a step and none": (lambda: closed_by({Z: lag(0.25), Y: LAG}), ("continuously",)),
    "signal": (
        lambda: closed_by(named("attitude_z", "speed")),
        ("'speed' is no output of the plant", "'attitude_z' is"),
    ),
    "zero": (lambda: closed_by(control.ss([], [], [], np.zeros((3, 3)))), ("nothing but zero",)),
    "algebraic": (algebraic, ("algebraic loop", "no solution")),
    "step and a half": (lambda: stepped_by({Z: lag(0.015)}), ("no multiple of the plant's",)),
    "half a step": (lambda: stepped_by({Z: lag(0.005)}), ("no multiple of the plant's",)),
    "continuous on a sampled plant": (lambda: stepped_by({Z: LAG}), ("control.c2d(system, 0.01)",)),
    "file on a sampled plant": (
        lambda: file_of(LOOP, stepped_by),
        ("loops of a file are continuous",),
    ),
    "empty file": (lambda: file_of(""), ("loop is missing", "[[loop]] with input, output")),
    "allocation alone": (
        lambda: file_of("[allocation.t]\nactuators = ['a']\n"),
        ("[[loop]] with input, output",),
    ),
    "allocation over nothing": (
        lambda: file_of(
            "[allocation.t]\nactuators = ['a']\n[allocation.q]\nactuators = []\n" + LOOP
        ),
        ("allocation.q: actuators", "empty"),
    ),
    "alignment of no sensor": (
        lambda: file_of("[alignment.star]\nbody = 'bus'\n" + LOOP),
        ("alignment.star: sensor is missing",),
    ),
    "alignment of a number": (
        lambda: file_of("[alignment.a]\nsensor = 3\n" + LOOP),
        ("alignment.a.sensor = 3", "whole number"),
    ),
    "key of an allocation": (
        lambda: file_of("[allocation.a]\nwheels = ['b']\n" + LOOP),
        ("keys of [allocation.a] are actuators",),
    ),
    "name of two words": (
        lambda: file_of("[allocation.'t q']\nactuators = ['a']\n" + LOOP),
        ("'t q'", "no blanks"),
    ),
}

REFUSED = {
    f"{kind}: {name}": row
    for kind, group in (("signal", SIGNALS), ("pose", POSES), ("loop", LOOPS))
    for name, row in group.items()
}


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_plant_can_be_is_refused(case):
    check_refused(REFUSED[case][0], bc.InputError, REFUSED[case][1])
