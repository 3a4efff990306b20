"""Random craft whose drives are free, nearly locked by a damper, sprung, or both,
with heavy and with light hubs.

A craft is the dict that `plant_truth` writes as MJCF and assembles in numpy;
every appendage has a scene.
"""

import numpy as np

import beamchain as bc
import finite_elements as fe
from plant_truth import spec, text, tube, turned
from random_appendages import random_appendage, toml

AXES = (["z"], ["x", "y", "z"], ["y", "z"], ["x", "y", "z", "tx", "ty", "tz"], ["tx", "ty"])
KINDS = ("locked", "locked", "free", "sprung", "both")  # nearly locked drives twice as often


def _appendage(rng, name):
    if rng.random() < 0.3:
        whole = random_appendage(int(rng.integers(10**6)))
        parts = {key: whole[key] for key in ("joint", "lump") if key in whole}
        return spec(name, whole["segment"], {}, **parts)
    long = float(rng.uniform(1.5, 8.0))
    wide = float(long * rng.uniform(0.004, 0.012))
    lump = {"x": long, "mass": float(10.0 ** rng.uniform(-1.5, 0.5))}
    return spec(
        name,
        [tube(long, wide, wide / 20.0)],
        {},
        **({"lump": [lump]} if rng.random() < 0.4 else {}),
    )


def random_craft(seed):
    """The craft, the band [rad/s], the tolerance, the axes,
    and the drives' angles at the keyframe [rad]."""
    rng = np.random.default_rng([20_261, seed])
    count = int(rng.integers(1, 4))
    mass = 4.0 if rng.random() < 0.4 else float(4.0 * 10.0 ** rng.uniform(0.0, 3.0))
    size = float(rng.uniform(0.05, 0.6))
    axes = AXES[int(rng.integers(len(AXES)))]
    specs = {f"place{k}": _appendage(rng, f"part{k}") for k in range(count)}
    slowest = {place: fe.port(one, "xy").frequencies[0] for place, one in specs.items()}
    band = float(min(slowest.values()) * 10.0 ** rng.uniform(-0.5, 0.5))
    tolerance = float(10.0 ** rng.uniform(-4.0, -1.5))
    drives, appendages, angles = {}, {}, {}
    for k, (place, one) in enumerate(specs.items()):
        del one["root"], one["modes"]
        one["damping"] = {"ratio": float(10.0 ** rng.uniform(-4.0, np.log10(0.05)))}
        one["scene"] = {"bandwidth": band, "tolerance": tolerance, "axes": axes}
        at = rng.uniform(-0.5, 0.5, 3)
        turn = turned(*rng.uniform(-2.0, 2.0, 3))
        if rng.random() < 0.2:
            appendages[place] = {"spec": one, "at": at, "turn": turn}
            continue
        name = f"drive{k}"
        rotor = max(0.02 * mass, 0.05)
        along = turned(
            *(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.57], [0.0, 1.57, 0.0]])[int(rng.integers(3))])
        )
        carried = fe.rigid_mass(one)[3:, 3:]
        about = float(carried[2, 2] + 0.01 * rotor)
        kind = KINDS[int(rng.integers(len(KINDS)))]
        w = band * float(10.0 ** rng.uniform(-0.7, 0.3))
        drive = {
            "at": at,
            "turn": turn,
            "mass": rotor,
            "inertia": [0.01 * rotor] * 3,
            "damping": 0.0,
            "stiffness": 0.0,
        }
        if kind in ("sprung", "both"):
            drive["stiffness"] = about * w**2
            drive["damping"] = 2e-3 * about * w
        if kind == "free":
            drive["damping"] = about * band * float(10.0 ** rng.uniform(-3.0, -1.0))
        if kind in ("locked", "both"):
            drive["damping"] = about * band * float(10.0 ** rng.uniform(-0.5, 2.0))
        drives[name] = drive
        appendages[place] = {
            "spec": one,
            "on": name,
            "at": rng.uniform(-0.2, 0.2, 3),
            "turn": along,
        }
        angles[name] = float(rng.uniform(-1.5, 1.5))
    inertia = np.diag(mass * size**2 * rng.uniform(0.5, 0.8, 3))
    hub = {"mass": mass, "com": rng.uniform(-0.05, 0.05, 3), "inertia": inertia}
    craft = {
        "hub": hub,
        "unit": (np.zeros(3), np.eye(3)),
        "drives": drives,
        "appendages": appendages,
    }
    return craft, band, tolerance, axes, angles


def embedded(craft, angles, folder):
    """The craft with its appendages as the package embeds them, and the file it writes."""
    at = {}
    for place, a in craft["appendages"].items():
        at[place] = folder / f"{place}.toml"
        at[place].write_text(toml(a["spec"]))
    done = bc.embed(text(craft, angles=angles), at, retime=False)
    return done, done.write(folder / "flexible.xml")[-1]
