"""What no worlds and no environment can be asked is refused by one sentence that names the
argument, its value and the cure. No tolerances: sentences only."""

import copy
import pickle
import sys
from functools import cache, partial

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain import worlds
from many_worlds import UNFOLDS, flexible
from refused import check_refused
from spacecraft import CRAFTS

NAN = float("nan")
ID = "beamchain.worlds.gym:beamchain/FlexibleSatellite-v0"
RANGES = {"frequency": 0.1, "damping": 0.5}
NEEDS = {"mjx": "mujoco.mjx", "warp": "mujoco_warp"}  # what a host imports
CONNECTED = ("body_dofadr", "jnt_type", "dof_bodyid")


@cache
def craft():
    return flexible(retime=True)


def of_two(variants=None, **given):
    return worlds.make(craft(), variants, **{"count": 2, **given})


def without(module, **given):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, module, None)
        of_two(**given)


def sizes():
    return {"_sizes": np.stack([craft().model._sizes] * 2)}


def connected(name):
    of_two({name: np.stack([getattr(craft().model, name)] * 2) + 1}, count=None)


@cache
def two():
    return of_two()


def step(*given):
    two().step(*given)


@cache
def unfolding():
    return worlds.make(mujoco.MjModel.from_xml_string(UNFOLDS.format("RK4")), count=2)


def compiled_stops(call):
    many = worlds.make(mujoco.MjModel.from_xml_string(UNFOLDS.format("RK4")), count=2)
    many._made = "mjx", 0
    getattr(many, call)("one")


WORLDS = {
    "host": (lambda: of_two(host="gpu"), ("host = 'gpu'", "choose one of mujoco, mjx, warp")),
    "no worlds": (lambda: of_two(count=0), ("count = 0", "whole number")),
    "range of 1": (lambda: of_two({"frequency": 1.0}), ("from 0 to below 1",)),
    "range nan": (lambda: of_two({"frequency": NAN}), ("finite number",)),
    "ranges and fields": (
        lambda: of_two({"frequency": 0.1, "body_mass": [1.0]}),
        ("give one or the other",),
    ),
    "unknown field": (lambda: of_two({"nothing": np.zeros((3, 2))}), ("nothing", "array")),
    "field of two": (
        lambda: of_two({"body_mass": np.zeros((3, 2))}),
        ("body_mass", "has the shape (3, 2)"),
    ),
    "variants a number": (lambda: of_two(3), ("variants = 3",)),
    "no count": (lambda: of_two(count=None), ("count is missing",)),
    "timestep": (lambda: of_two(timestep=-0.1), ("timestep = -0.1", "above zero")),
    "observe": (
        lambda: of_two(observe=["speed"]),
        ("observe names 'speed'", "choose from attitude, rate, wheels, modes, gyro, place"),
    ),
    "seed": (lambda: of_two(seed="3"), ("seed = '3'", "whole number")),
    "observe a number": (lambda: of_two(observe=5), ("observe = 5", "a list of names")),
    "field a number": (
        lambda: of_two({5: 1.0}),
        ("a field of variants = 5 is an int", "MuJoCo's model"),
    ),
    "state a number": (lambda: two().restore(5), ("state = 5 is an int", "state()")),
    "model of world 2": (lambda: two().model_of(2), ("world = 2", "whole number from 0 to 1")),
    "field with a slip": (
        lambda: of_two({"freq": 0.1}),
        ("'freq'", "'body_mass'", "'frequency' and 'damping'"),
    ),
    **{
        f"{name} of another model": (
            partial(connected, name),
            (f"'{name}'", "differs", "connected"),
        )
        for name in CONNECTED
    },
    "private field": (lambda: of_two(sizes(), count=None), ("'_sizes'", "does not have")),
    "draw of a plain file": (
        lambda: worlds.make(CRAFTS / "planar.xml", RANGES, count=2),
        ("a draw of modes", "variants=None"),
    ),
    "draw of a rigid craft": (
        lambda: worlds.make(flexible(rigid=True), RANGES, count=2),
        ("no modal tendons",),
    ),
    "no batch": (lambda: without("mujoco.batch"), ("MuJoCo 3.17",)),
    **{
        f"no {host}": (partial(without, module, host=host), (f"pip install 'beamchain[{host}]'",))
        for host, module in NEEDS.items()
    },
    "one command": (lambda: step([1.0]), ("ctrl = [1.0] has the shape (1,)",)),
    "command nan": (lambda: step([[0, 0, 0], [0, np.nan, 0]]), ("ctrl[1, 1] is nan",)),
    "command of 1e12": (
        lambda: step([[0, 0, 0], [0, 0, -1e12]]),
        ("ctrl[1, 2] is -1e+12", "at most 1e+10"),
    ),
    "command a word": (lambda: step("fast"), ("ctrl = 'fast' is a str", "finite numbers")),
    "no step": (lambda: step([0.0] * 3, 0), ("nstep = 0", "whole number")),
    "world 2": (lambda: two().reset([2]), ("names no worlds",)),
    "half a world": (lambda: two().reset([0.5]), ("names no worlds",)),
    "one position": (lambda: two().reset(qpos=[1.0]), ("qpos",)),
    "quaternion of zeros": (
        lambda: two().reset(qpos=np.zeros(two().model.nq)),
        ("quaternion", "qpos[3:7]", "1, 0, 0, 0"),
    ),
    "step of time": (lambda: two().retime(0.0), ("timestep = 0.0", "above zero")),
    "response": (lambda: two().response(), ("host='mjx'",)),
    "checkpoint": (lambda: two().restore({}), ("not a checkpoint",)),
    "hinge": (lambda: unfolding().latch("three"), ("hinge = 'three'", "choose from one, two")),
    "latched world": (lambda: unfolding().latch("one", [7]), ("names no worlds",)),
    "stop": (lambda: unfolding().latch("one", stiffness=-1.0), ("stiffness",)),
    "free hinge": (lambda: unfolding().unlatch("one"), ("hinge 'one' is not latched",)),
    **{
        f"compiled, {call}": (partial(compiled_stops, call), ("host = 'mjx'", "compiles the stops"))
        for call in ("latch", "unlatch")
    },
}


def environment(**given):
    gymnasium = pytest.importorskip("gymnasium")
    return gymnasium.make(ID, disable_env_checker=True, **given)


def reset(**options):
    environment(variants=None).reset(options=options)


GYM = {
    "period": (lambda: environment(period=250.0), ("period = 250 s", "at most the episode, 120 s")),
    "no wheels": (
        lambda: environment(model=str(CRAFTS / "planar.xml"), variants=None),
        ("no reaction wheels",),
    ),
    "timestep": (lambda: environment(timestep=0.07), ("must divide the period",)),
    "slew": (lambda: environment(slew=4.0), ("at most pi",)),
    "noise": (lambda: environment(noise=(1e-6,)), ("noise = ", "has the shape (1,)")),
    "momentum": (lambda: environment(momentum=0.0), ("momentum = 0.0", "above zero")),
    "render mode": (lambda: environment(render_mode="human"), ("render_mode = 'human'",)),
    "option of reset": (
        lambda: reset(tun=(0.0, 0.0, 0.1)),
        ("option of reset = 'tun' is unknown",),
    ),
}


@pytest.mark.parametrize("case", WORLDS)
def test_what_no_worlds_can_be_asked_is_refused(case):
    check_refused(WORLDS[case][0], bc.InputError, WORLDS[case][1])


@pytest.mark.parametrize("case", GYM)
def test_what_no_environment_can_be_asked_is_refused(case):
    check_refused(GYM[case][0], bc.InputError, GYM[case][1])


def test_the_environment_takes_finite_numbers_only():
    env = environment(variants=None)
    turn = {"turn": (0.1, NAN, 0.0)}
    check_refused(lambda: env.reset(seed=0, options=turn), bc.InputError, ("turn[1] is nan",))
    env.reset(seed=0)
    check_refused(lambda: env.step(np.array([NAN, 0.0, 0.0])), bc.InputError, ("is nan",))
    check_refused(lambda: env.step(np.zeros(2)), bc.InputError, ("action = ", "shape (2,)"))
    env.close()


@pytest.mark.parametrize("attempt", [pickle.dumps, copy.deepcopy, copy.copy])
def test_worlds_are_neither_pickled_nor_copied(attempt):
    check_refused(lambda: attempt(two()), TypeError, ("inside each process", "state()"))
