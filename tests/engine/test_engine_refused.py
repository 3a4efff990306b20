"""Models, ports, allocations and signals that cannot be are refused by one sentence that names the
argument, its value and the cure. No tolerances: sentences only."""

from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

import beamchain as bc
from appendages import unit_beam
from beamchain.engine.slew import simulate
from beamchain.errors import EngineError
from benches import bench
from refused import check_refused
from wheels_and_jets import CRAFT
from written_chain import read_chain

WHEELS = ["w1", "w2", "w3", "w4"]

# -- combinations of signals -----------------------------------------------------------------------


@cache
def craft():
    return mujoco.MjModel.from_xml_string(CRAFT)


def allocated(*actuators, **more):
    bc.plant(craft(), {"t": bc.allocate(list(actuators), **more)})


def inputs(**named):
    bc.plant(craft(), inputs=named)


def outputs(**named):
    bc.plant(craft(), outputs=named)


ALLOCATIONS = {
    "two directions": (
        lambda: allocated("w1", "w2"),
        ("in 2 of 3 directions", "not about y", 'about = "xz"'),
    ),
    "one direction": (
        lambda: allocated("w4", about="x"),
        ("in 1 of 3 directions", "not about x alone", "add an"),
    ),
    "servo": (
        lambda: allocated(*WHEELS, "servo"),
        ("'servo' takes no torque or force", "a set point"),
    ),
    "speed": (lambda: allocated(*WHEELS, "speed"), ("'speed' takes no torque",)),
    "held": (lambda: allocated(*WHEELS, "held"), ("'held' takes no torque",)),
    "slide": (lambda: allocated(*WHEELS, "pusher"), ("'pusher'", "not the only hinge")),
    "two hinges": (lambda: allocated(*WHEELS, "turner"), ("'turner'", "not the only hinge")),
    "site of another body": (
        lambda: allocated(*WHEELS, "outboard"),
        ("site 'far'", "not on 'bus'"),
    ),
    "between two sites": (
        lambda: allocated(*WHEELS, "between"),
        ("'between'", "neither on a hinge nor at a site"),
    ),
    "axes of another body": (
        lambda: allocated(*WHEELS, axes="yoke"),
        ("'r1'", "does not hang on 'yoke'"),
    ),
    "axes with a slip": (
        lambda: allocated(*WHEELS, axes="buss"),
        ("axes of allocation 't' = 'buss'", "mean 'bus'"),
    ),
    "actuator": (lambda: allocated("w9"), ("actuator of allocation 't' = 'w9'", "choose from w1")),
    "a name for names": (lambda: bc.allocate("w1"), ("actuators = 'w1'", "a list of names")),
    "no actuator": (lambda: bc.allocate([]), ("actuators of an allocation", "empty")),
    "an actuator twice": (lambda: bc.allocate(["w1", "w1"]), ("name 'w1' twice",)),
    "matrix of two": (lambda: bc.allocate(["w1"], matrix=[[1.0, 2.0]]), ("(1, 3)",)),
    "matrix inf": (lambda: bc.allocate(["w1"], matrix=[[1.0, 2.0, np.inf]]), ("matrix", "is inf")),
    "about zx": (lambda: bc.allocate(["w1"], about="zx"), ("about = 'zx'", "must be axes")),
    "about nothing": (lambda: bc.allocate(["w1"], about=""), ("about = ''", "must be axes")),
    "axes a number": (
        lambda: bc.allocate(["w1"], axes=3),
        ("axes of an allocation = 3 is an int",),
    ),
}

SIGNALS = {
    "no input": (inputs, ("inputs is empty",)),
    "a number": (lambda: inputs(a=3), ("inputs['a'] = 3 is an int", "a name, bc.allocate")),
    "alignment for input": (
        lambda: inputs(a=bc.align("star")),
        ("inputs['a'] = ", "a name, bc.allocate"),
    ),
    "allocation for output": (
        lambda: outputs(a=bc.allocate(WHEELS)),
        ("outputs['a'] = ", "a name, bc.align"),
    ),
    "a number for name": (lambda: bc.plant(craft(), inputs={3: "w1"}), ("inputs: 3 is no name",)),
    "one and three": (
        lambda: inputs(a={"w1": 1.0, "torque:bus": 1.0}),
        ("'w1' has 1", "'torque:bus' has 3"),
    ),
    "the world": (lambda: inputs(a="torque:world"), ("torque:world", "does not move")),
    "weight 0": (lambda: inputs(a={"w1": 0.0}), ("has no weight",)),
    "weight a word": (lambda: inputs(a={"w1": "x"}), ("inputs['a']['w1'] = 'x'", "not a number")),
    "no weight": (lambda: inputs(a={}), ("has no weight",)),
    "sensor of a sum": (lambda: outputs(a={"giro": 1.0}), ("'giro'", "did you mean 'gyro'")),
    "two of a name": (
        lambda: inputs(a_x="w1", a=bc.allocate(WHEELS)),
        ("two signals", "'a_x'", "another name"),
    ),
    "alignment of an angle": (
        lambda: outputs(a=bc.align("drive_angle")),
        ("'drive_angle' has no three axes",),
    ),
    "alignment to a slip": (
        lambda: outputs(a=bc.align("star", "buss")),
        ("'buss'", "did you mean 'bus'"),
    ),
    "alignment of a slip": (
        lambda: outputs(a=bc.align("stars")),
        ("sensor of alignment 'a' = 'stars' is unknown",),
    ),
}

# -- models ----------------------------------------------------------------------------------------
STILL = """<mujoco><worldbody><body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
</worldbody></mujoco>"""


def chain(hinges):
    fit = bc.fit(unit_beam(), name="boom", modes={"xy": hinges, "xz": 0})
    return fit.to_mjcf()


def without_springs():
    text = chain(1)
    [hinge] = read_chain(text).hinges
    stiffness = f'stiffness="{hinge.stiffness["xy"]!r}"'
    bc.linearise(bench(text).replace(stiffness, 'stiffness="0"')).port()


def turned(body):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    simulate(model, angle=0.5, frames=10)


MODELS = {
    "no MJCF": (
        lambda: bc.linearise("<mujco/>"),
        EngineError,
        ("MuJoCo refuses the model", "mujco"),
    ),
    "no file": (
        lambda: bc.linearise(Path("nowhere.xml")),
        bc.InputError,
        ("nowhere.xml' does not exist",),
    ),
    "model that cannot move": (
        lambda: bc.linearise(STILL),
        EngineError,
        ("no degree of freedom", "put it on a joint"),
    ),
    "nothing but the world": (
        lambda: bc.Linear.of("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"),
        EngineError,
        ("no degree of freedom",),
    ),
    "port without motors": (
        lambda: bc.linearise(chain(2)).port(),
        EngineError,
        ("no joint of the port is driven",),
    ),
    "port without springs": (without_springs, EngineError, ("no positive stiffness",)),
    "turn of what is fixed": (
        lambda: turned("<body><joint type='hinge' stiffness='1'/><geom size='.1'/></body>"),
        bc.BeamchainError,
        ("freejoint",),
    ),
    "turn of what is rigid": (
        lambda: turned("<body name='hub'><freejoint/><geom size='.1'/></body>"),
        bc.BeamchainError,
        ("spring",),
    ),
}
REFUSED = {
    **{
        f"allocation: {name}": (call, bc.InputError, said)
        for name, (call, said) in ALLOCATIONS.items()
    },
    **{f"signal: {name}": (call, bc.InputError, said) for name, (call, said) in SIGNALS.items()},
    **{f"model: {name}": row for name, row in MODELS.items()},
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_linearised_or_combined_is_refused(case):
    check_refused(*REFUSED[case])
