"""Time of 1,000 variants on two cores: of a craft with three appendages,
and of one appendage fitted again each time.

Run by hand or by `make bench`.
"""

import resource
import sys
import time
from importlib.resources import files
from pathlib import Path

from joblib.externals.loky import get_reusable_executor

import beamchain as bc
from beamchain.fitting.uncertain import UncertainBody, UncertainCraft, UncertainModes, Uncertainty

CRAFT = """<mujoco><option timestep="0.02" integrator="Euler" gravity="0 0 0"/><worldbody>
<body name="bus"><freejoint/>
<inertial pos="0.01 0 0.02" mass="300" diaginertia="90 80 70"/>
<site name="left" pos="0 0.5 0" euler="0 0 90"/>
<site name="right" pos="0 -0.5 0" euler="0 0 -90"/><site name="mast" pos="0 0 0.5" euler="0 -90 0"/>
</body></worldbody></mujoco>"""
MODES = UncertainModes(
    frequency=Uncertainty(relative=0.05, each=True),
    damping=Uncertainty(relative=0.2),
    participation=Uncertainty(relative=0.03),
)
GIVEN = UncertainCraft(
    appendage={"array_left_": MODES, "array_right_": MODES, "mast_": MODES},
    body={
        "bus": UncertainBody(mass=Uncertainty(relative=0.05), centre_x=Uncertainty(absolute=0.02))
    },
)


def appendage(name: str, length: float, stiffness: float, mass: float) -> bc.Spec:
    section = bc.Equivalent(
        bending_stiffness_xy=stiffness,
        bending_stiffness_xz=1.7 * stiffness,
        torsion_stiffness=0.6 * stiffness,
        polar_inertia=0.1 * mass,
        linear_mass=mass,
    )
    segment = bc.Segment(length=length, section=section)
    return bc.Spec(
        name=name,
        segment=(segment,),
        modes=bc.Modes(xy=2, xz=2, torsion=1),
        damping=bc.Damping(ratio=0.005),
    )


def timed(what: str, cores: int, made, samples: int) -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    result = made(cores)
    taken = time.perf_counter() - start
    get_reusable_executor().shutdown(wait=True)  # what they computed is known when they have ended
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / cores
    print(
        f"{result.indices.size} variants of {samples} samples of {what} on {cores} processes: "
        f"{taken:.1f} s, of which each process computed {busy:.1f} s"
    )


def main(samples: int = 1000, cores: int = 2) -> None:
    array = appendage("array", 6.0, 900.0, 3.0)
    craft = bc.embed(
        CRAFT, {"left": array, "right": array, "mast": appendage("mast", 4.0, 300.0, 1.0)}
    )
    timed(
        "a craft with three appendages, 15 modes, exact in time (modes and bus uncertain)",
        cores,
        lambda workers: bc.sweep(craft, samples, uncertain=GIVEN, workers=workers),
        samples,
    )
    spec = bc.read_spec(Path(str(files("beamchain"))) / "examples" / "array_uncertain.toml")
    timed(
        "a 3-D array (structure uncertain, fitted again)",
        cores,
        lambda workers: bc.sweep(spec, samples, workers=workers),
        samples,
    )


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
