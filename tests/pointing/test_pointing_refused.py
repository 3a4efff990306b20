"""What no pointing budget can be is refused by one sentence that names what is wrong, its value and
the cure. No tolerances: sentences only."""

from functools import partial

import pytest

import beamchain as bc
from beamchain import pointing
from jittered import DAMPED, UNDAMPED, UNSTABLE, WHEEL
from refused import check_refused

NAN = float("nan")
STEPPER = {"joint": "arm_hinge1_xy", "step": 1e-3, "rate": 2.0}
PSD = {"input": "torque:hub", "frequency": (0.1, 10.0), "density": (1e-8, 1e-8)}
SNAP = {"appendage": "arm_", "displacement": 0.001, "time_constant": 3.0}
KINDS = {
    "wheel": (pointing.WheelDisturbance, WHEEL),
    "stepper": (pointing.StepperDisturbance, STEPPER),
    "psd": (pointing.NoiseDisturbance, PSD),
    "snap": (pointing.ThermalSnap, SNAP),
}
ENDLESS = DAMPED.replace('name="arm_tip"', 'name="end"')
CHANGED = (
    ("wheel", {"joint": "sping"}, ("wheel.joint = 'sping'", "did you mean 'spin'")),
    ("wheel", {"joint": "lopsided"}, ("'lopsided' is no balanced wheel",)),
    ("wheel", {"speeds": (30.0, 2.0)}, ("speeds = [30, 2] of wheel 'spin'", "no range")),
    ("wheel", {"speeds": (0.0, 0.0)}, ("no range",)),
    ("wheel", {"speeds": (NAN, 1.0)}, ("speeds[0] = nan",)),
    ("wheel", {"speeds": (1.0,)}, ("speeds = (1.0,) of wheel 'spin'", "no range")),
    ("wheel", {"speeds": 5.0}, ("speeds = 5.0 of wheel 'spin'", "no range")),
    ("wheel", {"joint": 5}, ("wheel.joint = 5 is an int", "name of a hinge")),
    ("wheel", {"harmonic": ({"order": 2.0},)}, ("no list of pointing.WheelHarmonic(...)",)),
    ("wheel", {"static": 0.0}, ("disturbs nothing", "give static")),
    ("wheel", {"static": -1.0}, ("static = -1.0", "not be negative")),
    ("wheel", {"count": 1}, ("count = 1", "whole number from 2")),
    ("stepper", {"joint": "arm"}, ("stepper.joint = 'arm' is unknown",)),
    ("stepper", {"joint": "spin"}, ("neither a position servo nor a spring",)),
    ("stepper", {"torque": 1.0}, ("takes either step",)),
    ("stepper", {"step": None, "torque": 1.0}, ("takes either step",)),
    ("stepper", {"step": None, "torque": 1.0, "width": 0.5}, ("is not shorter than the time",)),
    ("stepper", {"rate": 0.0}, ("rate = 0.0", "above zero")),
    ("psd", {"frequency": 5.0}, ("frequency of psd 'torque:hub' = 5.0", "no list of numbers")),
    ("psd", {"signals": "torque_z"}, ("signals of psd 'torque:hub' = 'torque_z'", "no list")),
    ("psd", {"input": "torque:bus"}, ("'bus' is unknown",)),
    ("psd", {"signals": ("torque_q",)}, ("signals of psd 'torque:hub' = 'torque_q'", "unknown")),
    ("psd", {"frequency": (10.0, 0.1)}, ("ascending order",)),
    ("psd", {"frequency": (1.0,)}, ("1 frequencies and 2 densities",)),
    ("psd", {"density": (1e-8, 0.0)}, ("density = 0 of psd 'torque:hub'", "not above zero")),
    ("psd", {"input": "wrench:arm_tip"}, ("different units",)),
    ("snap", {"appendage": "boom_"}, ("snap.appendage = 'boom_' is unknown",)),
    ("snap", {"mode": 2}, ("mode of snap = 'arm_mode2_xy' is unknown",)),
    ("snap", {"port": "xz", "displacement": None, "moment": 1.0}, ("no hinge in port 'xz'",)),
    ("snap", {"port": "torsion"}, ("twist displaces no tip",)),
    ("snap", {"moment": 1.0}, ("takes either displacement",)),
    ("snap", {"time_constant": -1.0}, ("time_constant = -1.0", "above zero")),
)


def shaken(kind, craft=DAMPED, changed=None):
    struct, given = KINDS[kind]
    pointing.budget(
        craft, pointing.Disturbances(**{kind: (struct(**{**given, **(changed or {})}),)})
    )


def budget(**arguments):
    wheel = pointing.WheelDisturbance(**WHEEL)
    return pointing.budget(DAMPED, pointing.Disturbances(wheel=(wheel,)), **arguments)


def two_of_a_wheel():
    pointing.Disturbances(wheel=(pointing.WheelDisturbance(**WHEEL),) * 2)


POINTING = {
    **{
        f"{kind} {changed}": (partial(shaken, kind, changed=changed), words)
        for kind, changed, words in CHANGED
    },
    "wheel of an undamped craft": (
        lambda: shaken("wheel", UNDAMPED),
        ("at 11.", "order 1", "'arm_mode1_xy'", "undamped"),
    ),
    "noise of an undamped craft": (
        lambda: shaken("psd", UNDAMPED),
        ("'arm_mode1_xy'", "undamped", "variance"),
    ),
    "unstable craft": (lambda: shaken("psd", UNSTABLE), ("the craft is unstable", "motion at 1")),
    "no tip": (lambda: shaken("snap", ENDLESS), ("no site 'arm_tip'", "scene.tip")),
    "window": (lambda: budget(window=0.0), ("window = 0.0", "above zero")),
    "output": (lambda: budget(outputs=["gyro"]), ("'gyro' is unknown",)),
    "no output": (lambda: budget(outputs=[]), ("outputs is empty",)),
    "joint": (lambda: budget(pose={"drive": 1.0}), ("joint of pose = 'drive' is unknown",)),
    "rates": (lambda: budget(rates={"lopsided": 1.0}), ("only balanced wheels may turn",)),
    "no disturbance": (pointing.Disturbances, ("the disturbances are empty",)),
    "psd a word": (
        lambda: pointing.Disturbances(psd="x"),
        ("psd = 'x'", "no list of pointing.NoiseDisturbance"),
    ),
    "two of a wheel": (two_of_a_wheel, ("two [[wheel]] tables", "'spin'")),
    "disturbances a number": (lambda: pointing.budget(DAMPED, 5), ("path of a TOML file",)),
    "run of a source": (lambda: budget().simulate("wheel rw"), ("source = 'wheel rw' is unknown",)),
    "run of an output": (lambda: budget().simulate(output="rate"), ("output = 'rate' is unknown",)),
    "source": (lambda: budget()["rw"], ("source = 'rw' is unknown",)),
}


@pytest.mark.parametrize("case", POINTING)
def test_what_no_pointing_budget_can_be_is_refused(case):
    check_refused(POINTING[case][0], bc.InputError, POINTING[case][1])
