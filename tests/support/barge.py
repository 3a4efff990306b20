"""A spacecraft with a tank of liquid over its thruster, and arrays where they are asked for."""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np

import beamchain as bc
from examples import EXAMPLES

RADIUS, HEIGHT, DENSITY, RATIO = 0.5, 0.8, 1010.0, 0.01
LIQUID = np.pi * RADIUS**2 * HEIGHT * DENSITY
BUS, ABOUT = 600.0, 300.0  # kg, kg m^2
PLACE = 0.4  # m, of the tank's bottom below the bus's centre
CRAFT = """<mujoco model="barge"><option gravity="{gravity}" timestep="0.02"/><worldbody>
<body name="bus">{joint}<inertial pos="0 0 0" mass="600" diaginertia="300 300 250"/>
<site name="left" pos="0 0.5 0" xyaxes="0 1 0 -1 0 0"/>
<site name="right" pos="0 -0.5 0" xyaxes="0 -1 0 1 0 0"/>
<site name="tank" pos="0 0 -0.4" xyaxes="{axes}"/><site name="nozzle" pos="0 0 -0.8"/>
</body></worldbody>
<actuator><motor name="thrust" site="nozzle" gear="0 0 1 0 0 0"/></actuator>
<keyframe><key name="burn" ctrl="{thrust!r}"/></keyframe></mujoco>"""
UP = "0 0 1 0 1 0"
BURN = 0.05 * (BUS + LIQUID)  # N
BOTH = ("left", "right")


def craft(thrust=0.0, gravity="0 0 0", joint="<freejoint/>", axes=UP):
    return CRAFT.format(thrust=float(thrust), gravity=gravity, joint=joint, axes=axes)


def tank(acceleration, modes=None, scene="", axis=None):
    along = "" if axis is None else f"axis = {axis!r}\n"
    many = "" if modes is None else f"modes = {modes}\n"
    return (
        f'name = "tank"\n[slosh]\nshape = "cylinder"\nradius = {RADIUS}\nheight = {HEIGHT}\n'
        f"density = {DENSITY}\nratio = {RATIO}\nacceleration = {acceleration}\n{along}{many}{scene}"
    )


def embedded(folder, acceleration, *, scene="", **more):
    """A spacecraft with the tank, whose specification is written into the folder as well."""
    (folder / "tank.toml").write_text(tank(acceleration, scene=scene))
    return made_once(acceleration, scene, **more)


@cache
def made_once(acceleration, scene, *, arrays=(), loaded=True, **more):
    """Of `embedded`: what is asked for again is the same one, which tests only read."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "tank.toml"
        file.write_text(tank(acceleration, scene=scene))
        at = {"tank": file}
        mass = BUS + LIQUID
        for place in arrays:
            at[place] = EXAMPLES / "array.toml"
            mass += bc.read_spec(at[place]).beam.rigid_mass()[0, 0]
        text = craft(mass * acceleration, **more)
        return bc.embed(text, at, loaded=loaded, retime=False)
