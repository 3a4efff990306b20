"""The craft of the ledger, as tables from which their files and their exact trees are made.

A craft is a dict of `hub` (mass, inertia), `step`, `integrator`, `keys` (angles of the joints by
keyframe) and `parts`: appendages with their place and, where a port carries a body, that body and
what stands on it; `specs`, `axes` and `hinges` follow from them. SI units and radians.
"""

import json
import math

import numpy as np
import truth
from numpy.polynomial import Legendre, Polynomial
from scipy.linalg import eigh

from solver import body_mass, rotation

HUB = (300.0, (100.0, 120.0, 150.0))
Y, Z = (0, 1, 0), (0, 0, 1)
CRAFTS = {}


# -- appendages: dicts of SPEC.toml ----------------------------------------------------------------
def scene(band=20.0, tolerance=1e-3, axes=None, ratio=0.005, modes=None):
    out = {"scene": {"bandwidth": band, "tolerance": tolerance}}
    out["scene"] |= {"axes": axes} if axes else {}
    out |= {"modes": modes} if modes else {}
    return out | ({} if ratio is None else {"damping": {"ratio": ratio}})


def metal(length, young=7e10, density=2700.0, end=None, **section):
    material = {"youngs_modulus": young, "density": density, "poissons_ratio": 0.3}
    out = {"length": length, "section": section, "material": material}
    return out | ({"section_end": section | end} if end else {})


def tube(length, diameter, wall, **more):
    return metal(length, shape="tube", outer_diameter=diameter, wall=wall, **more)


def bar(length, y, z, **more):
    return metal(length, shape="rectangle", width_y=y, width_z=z, **more)


def mast(length, ei, mass, gj=None, ei_xz=None):
    section = {"shape": "equivalent", "bending_stiffness_xy": ei, "linear_mass": mass}
    section |= {"bending_stiffness_xz": ei_xz or ei, "torsion_stiffness": gj or ei / 4.0}
    section |= {"axial_stiffness": 1e3 * ei, "polar_inertia": 0.01 * mass}
    return {"length": length, "section": section}


def tip(x, mass, inertia=0.0):
    return {"x": x, "mass": mass, "inertia": [inertia] * 3}


def boom(*segments, lump=(), joint=(), **more):
    more = scene(**more)
    more |= {"lump": list(lump)} if lump else {}
    return {"segment": list(segments), **more} | ({"joint": list(joint)} if joint else {})


def array(panels, length=2.0, soft=500.0, **more):
    """A yoke and panels with hinge lines between."""
    joints = [{"after_segment": i + 1, "stiffness_xy": soft / (1 + i)} for i in range(panels)]
    panel = bar(length, 0.02, 1.2, young=2e9, density=80.0) | {"nonstructural_mass": 2.0}
    return boom(tube(1.0, 0.06, 0.002), *[panel] * panels, joint=joints, **more)


def plate(length, width, thickness, modes=12, **more):
    """Modes of a plate in the plane xy, held along x = 0, as a finite-element program delivers
    them: Ritz, with products of Legendre polynomials and x^2."""
    young, density, poisson = 7e10, 1500.0, 0.3
    xi, weight = np.polynomial.legendre.leggauss(14)
    x, y = length * (1.0 + xi) / 2.0, width * xi / 2.0
    weight = np.outer(length * weight / 2.0, width * weight / 2.0).ravel()
    along = [Legendre.basis(i, [0, length]).convert(kind=Polynomial) for i in range(8)]
    along = [Polynomial([0, 0, 1]) * p for p in along]
    across = [Legendre.basis(j, [-width / 2, width / 2]).convert(kind=Polynomial) for j in range(6)]

    def rows(a, b):
        f = [(p.deriv(a) if a else p)(x) for p in along]
        g = [(p.deriv(b) if b else p)(y) + 0.0 * y for p in across]
        return np.array([np.outer(u, v).ravel() for u in f for v in g])

    w, xx, yy, xy = rows(0, 0), rows(2, 0), rows(0, 2), rows(1, 1)
    mixed = poisson * (xx * weight @ yy.T)
    k = xx * weight @ xx.T + yy * weight @ yy.T + mixed + mixed.T
    k += 2.0 * (1.0 - poisson) * (xy * weight @ xy.T)
    k *= young * thickness**3 / (12.0 * (1.0 - poisson**2))
    per = density * thickness
    squares, shapes = eigh(k, per * (w * weight @ w.T), subset_by_index=[0, modes - 1])
    rigid = np.zeros((6, weight.size))
    rigid[2], rigid[3], rigid[4] = 1.0, np.tile(y, x.size), -np.repeat(x, y.size)
    m, l2, w2 = per * length * width, length**2 / 3.0, width**2 / 12.0
    mass = body_mass(m, inertia=[m * w2, m * l2, m * (l2 + w2)])
    mass[1, 5] = mass[5, 1] = m * length / 2.0
    mass[2, 4] = mass[4, 2] = -m * length / 2.0
    table = {
        "frequencies_hz": (np.sqrt(squares) / (2.0 * np.pi)).tolist(),
        "participation": (per * (rigid * weight) @ (w.T @ shapes)).tolist(),
        "mass": mass.tolist(),
    }
    return scene(**more) | {"imported": {}, "table": table}


def tank(radius, height, ratio=0.01, acceleration=0.05, band=1.0):
    spec = {"shape": "cylinder", "radius": radius, "height": height, "density": 1010.0}
    spec |= {"ratio": ratio, "acceleration": acceleration}
    return scene(band, 1e-2, ratio=None) | {"slosh": spec}


# -- spacecraft ------------------------------------------------------------------------------------
def part(place, spec, turn=0.0, offset=(0.5, 0.0, 0.0), rider=None):
    """An appendage at a place, which stands at `offset` in axes turned by degrees about z."""
    if rider:
        length = sum(segment["length"] for segment in spec["segment"])
        spec = spec | {"port": [{"name": "end", "x": length, "carries": [rider["name"]]}]}
    axes = rotation(Z, math.radians(turn))
    return {"place": place, "spec": spec, "turn": turn, "axes": axes, "offset": axes @ offset} | {
        "rider": rider
    }


def rider(name, mass, inertia, *parts, axis=None, kp=0.0, kv=0.0):
    """A body on a port: on a hinge where it has an axis, on a position servo where it has `kp`."""
    body = {"name": name, "mass": mass, "inertia": (inertia,) * 3, "axis": axis}
    return body | {"kp": kp, "kv": kv, "parts": parts}


def parts_of(parts):
    """All parts of a tree, root first."""
    for p in parts:
        yield p
        yield from parts_of(p["rider"]["parts"] if p["rider"] else ())


def craft(name, *parts, hub=HUB, step=0.01, integrator="Euler", keys=None):
    """A craft of parts; specifications alone stand around the hub."""
    assert name not in CRAFTS
    if "place" not in parts[0]:
        turns = np.linspace(0.0, 360.0, len(parts), endpoint=False)
        parts = [part(f"p{i}", spec, turns[i]) for i, spec in enumerate(parts)]
    riders = [p["rider"] for p in parts_of(parts) if p["rider"]]
    CRAFTS[name] = {
        "parts": parts,
        "hub": hub,
        "step": step,
        "integrator": integrator,
        "keys": keys or {},
        "specs": {p["place"]: p["spec"] for p in parts_of(parts)},
        "axes": next(parts_of(parts))["spec"]["scene"].get("axes", truth.AXES),
        "hinges": [body["name"] for body in riders if body["axis"]],
    }


def hub_of(mass):
    return mass, (mass / 3.0, mass / 2.5, mass / 2.0)


PLAIN = tube(8.0, 0.05, 0.002)  # 6.5 kg, 3.5 rad/s
for integrator, steps in {
    "Euler": (0.002, 0.01, 0.05),
    "implicit": (0.002, 0.02),
    "implicitfast": (0.002, 0.02),
    "discrete": (0.002, 0.02),
    "RK4": (0.005, 0.02),
}.items():
    for step in steps:
        craft(f"boom_{integrator}_{step}", boom(PLAIN), step=step, integrator=integrator)
for ratio in (None, 0.0, 1e-6, 1e-4, 0.02, 0.1):
    craft(f"boom_ratio_{ratio}", boom(PLAIN, ratio=ratio), step=0.005, integrator="RK4")
for share in (1.0, 0.3, 0.1, 0.03):
    for integrator in ("Euler", "RK4"):
        craft(
            f"light_{share}_{integrator}",
            boom(PLAIN),
            hub=hub_of(6.5 * share),
            step=0.004,
            integrator=integrator,
        )
craft("light_pair", *[boom(PLAIN)] * 2, hub=hub_of(3.0), step=0.004)
craft("boom_long", boom(tube(25.0, 0.08, 0.001), band=6.0), step=0.05, integrator="RK4")
craft("boom_short", boom(tube(3.0, 0.03, 0.001), band=100.0), hub=hub_of(100.0), step=0.002)
craft("boom_taper", boom(tube(8.0, 0.06, 0.002, end={"outer_diameter": 0.03})))
craft("boom_taper_wall", boom(tube(8.0, 0.05, 0.003, end={"wall": 0.001})), integrator="RK4")
craft("boom_flat", boom(bar(6.0, 0.01, 0.06)))
craft("boom_flat_taper", boom(bar(6.0, 0.02, 0.06, end={"width_y": 0.01})))
craft("boom_two_pieces", boom(tube(4.0, 0.06, 0.002), tube(4.0, 0.04, 0.001)))
craft("boom_typed", boom(PLAIN, modes={"xy": 3, "xz": 1}, tolerance=0.1))
craft("boom_typed_all", boom(PLAIN, modes={"xy": 2, "xz": 2, "torsion": 1, "axial": 1}))
craft("boom_tight", boom(PLAIN, tolerance=1e-5), step=0.001)
craft("boom_loose", boom(PLAIN, tolerance=0.1), step=0.02)
craft("boom_wide_band", boom(PLAIN, band=200.0, tolerance=1e-2), step=0.001)
craft("boom_narrow_band", boom(PLAIN, band=2.0), step=0.05)
craft("boom_about_y", boom(PLAIN, axes=["y"]))
craft("boom_along_z", boom(PLAIN, axes=["tz"]), integrator="RK4")
craft("boom_about_x", boom(PLAIN, band=800.0, axes=["x"]), step=0.0005)
craft("boom_stiff_about_x", boom(PLAIN, band=300.0, axes=["x"]), step=0.001)  # keeps no mode
for soft in (50.0, 1e3, 1e5):
    root = [{"after_segment": 0, "stiffness_xy": soft, "stiffness_xz": 2.0 * soft}]
    craft(f"boom_root_{soft:g}", boom(PLAIN, joint=root))

MAST = mast(20.0, 8e5, 2.0)
craft("mast", boom(MAST), step=0.002)
craft("mast_instrument", boom(MAST, lump=[tip(20.0, 20.0, 0.8)]), step=0.002)
craft("mast_half_way", boom(MAST, lump=[tip(10.0, 6.0, 0.05), tip(20.0, 45.0, 2.0)]), step=0.002)
craft("mast_twists", boom(mast(20.0, 8e5, 2.0, gj=5e2), lump=[tip(20.0, 10.0, 5.0)]), step=0.002)
craft("mast_two_planes", boom(mast(20.0, 8e5, 2.0, ei_xz=1e5), axes=["y", "z"]), step=0.002)
craft("mast_heavy", boom(MAST, lump=[tip(20.0, 200.0, 20.0)]), hub=hub_of(900.0), step=0.005)
craft(
    "mast_canister",
    boom(MAST, joint=[{"after_segment": 0, "stiffness_xy": 4e5, "stiffness_xz": 4e5}]),
    step=0.002,
)

# panels, length, soft, band, axes, integrator, step
for panels, length, soft, band, axes, integrator, step in (
    (1, 2.0, 600.0, 5.0, ["z"], "RK4", 0.05),
    (2, 2.0, 600.0, 5.0, ["z"], "RK4", 0.05),
    (3, 2.0, 500.0, 5.0, ["z"], "RK4", 0.05),
    (4, 1.5, 500.0, 5.0, None, "RK4", 0.02),
    (2, 2.0, 600.0, 25.0, None, "Euler", 0.005),
    (2, 2.5, 50.0, 5.0, None, "implicitfast", 0.002),
    (2, 2.0, 5000.0, 5.0, ["x", "y", "z"], "implicit", 0.01),
):
    craft(
        f"array_{panels}_{soft:g}_{integrator}",
        array(panels, length, soft, band=band, axes=axes),
        integrator=integrator,
        step=step,
    )
PAIR = array(2, band=5.0, axes=["z"])
craft("array_pair", PAIR, PAIR, integrator="RK4", step=0.02)
craft("array_pair_timed", PAIR, PAIR, step=0.05)
craft("array_and_boom", array(2, band=5.0), boom(PLAIN, band=5.0), integrator="RK4")
craft("two_booms", boom(PLAIN), boom(tube(5.0, 0.05, 0.002)))
craft("three_booms", *[boom(PLAIN)] * 3)
craft("four_booms", *[boom(tube(n, 0.05, 0.002)) for n in (5.0, 6.0, 7.0, 8.0)], integrator="RK4")
craft("mast_and_pair", boom(MAST, band=5.0), array(2, band=5.0), array(2, band=5.0), step=0.005)
craft("skew_pair", part("a", boom(PLAIN), 40.0), part("b", boom(PLAIN), 200.0, (0.5, 0.3, 0.2)))

for length, width, thickness, band, ratio in (
    (3.0, 1.0, 0.004, 10.0, 0.005),
    (2.0, 2.0, 0.004, 30.0, 0.005),
    (4.0, 0.5, 0.004, 10.0, 0.02),
    (1.0, 0.3, 0.002, 50.0, 0.001),
):
    craft(
        f"plate_{length:g}_{width:g}",
        plate(length, width, thickness, band=band, ratio=ratio),
        step=0.005,
    )
craft("plate_pair", *[plate(3.0, 1.0, 0.004, band=10.0)] * 2, integrator="RK4")
craft("plate_light_hub", plate(3.0, 1.0, 0.004, band=10.0), hub=hub_of(5.0), step=0.005)

FULL = (1500.0, (900.0, 900.0, 900.0))
for radius, height, ratio in ((0.4, 0.5, 0.01), (0.5, 0.2, 0.01), (0.3, 1.2, 0.05)):
    craft(f"tank_{radius}_{height}", tank(radius, height, ratio), hub=FULL, step=0.02)
craft("tank_pair", tank(0.4, 0.5), tank(0.4, 0.3), hub=FULL, step=0.02)
craft("tank_and_boom", tank(0.4, 0.5, band=5.0), boom(PLAIN, band=5.0), hub=FULL, step=0.005)

# trees: links in a row, a body at the end of each but the last
UPPER, FORE = bar(6.0, 0.05, 0.08), bar(5.0, 0.04, 0.05)
LINK = {"modes": {"xy": 2, "xz": 2, "torsion": 1}, "tolerance": 0.02}


def arm(name, links, bodies, **more):
    """`bodies`: mass and inertia of each, and the keywords of its hinge."""
    last = boom(links[-1], lump=[tip(links[-1]["length"], 5.0, 0.2)], **LINK)
    chain = part(f"link{len(bodies)}", last, offset=(0.0, 0.0, 0.0))
    for i in reversed(range(len(bodies))):
        mass, inertia, hinge = bodies[i]
        body = rider(f"body{i}", mass, inertia, chain, **hinge)
        where = (0.0 if i else 0.5, 0.0, 0.0)
        chain = part(f"link{i}", boom(links[i], **LINK), offset=where, rider=body)
    craft(name, chain, hub=(400.0, (80.0, 100.0, 120.0)), **{"step": 0.001, **more})


YAW, PITCH, WELD = {"axis": Z}, {"axis": Y}, {}
SERVO = YAW | {"kp": 9e3, "kv": 400.0}
SQUARE = {"square": [1.5708]}
arm("arm_weld", [UPPER, FORE], [(4.0, 0.02, WELD)])
arm("arm_free", [UPPER, FORE], [(4.0, 0.02, YAW)], keys={"bent": [0.8], "square": [1.5708]})
arm("arm_servo", [UPPER, FORE], [(4.0, 0.02, SERVO)], keys=SQUARE, step=0.0005)
arm("arm_heavy", [UPPER, FORE], [(60.0, 2.0, YAW)], keys=SQUARE)
arm("arm_pitch", [UPPER, FORE], [(4.0, 0.02, PITCH)], keys={"bent": [0.8]}, integrator="RK4")
THREE = [UPPER, FORE, bar(3.0, 0.03, 0.04)]
arm("arm_three", THREE, [(4.0, 0.02, YAW), (3.0, 0.02, WELD)], keys={"bent": [0.7]})
arm("arm_three_hinged", THREE, [(4.0, 0.02, YAW), (3.0, 0.02, PITCH)], keys={"bent": [0.7, -0.5]})
FOUR = [(4.0, 0.02, WELD), (4.0, 0.02, PITCH), (4.0, 0.02, WELD)]
arm("arm_four", [bar(3.0, 0.05, 0.08)] * 4, FOUR, keys={"bent": [0.7]})
YOKE = boom(tube(2.0, 0.1, 0.003), **LINK)
WING = boom(tube(5.0, 0.04, 0.002), **LINK)
craft(
    "yoke_two_wings",
    part(
        "yoke",
        YOKE,
        rider=rider("drive", 5.0, 0.1, part("left", WING, 90.0), part("right", WING, -90.0)),
    ),
    step=0.001,
)
craft(
    "payload_at_tip", part("yoke", boom(PLAIN, **LINK), rider=rider("load", 30.0, 3.0)), step=0.001
)


def drawn(k):
    """Six numbers in 0..1, spread evenly over all k."""
    return [(0.5 + k * step) % 1.0 for step in np.power(1.1673039782614187, -np.arange(1.0, 8.0))]


for k in range(12):
    d = drawn(k)
    length, band = round(3.0 + 12.0 * d[0], 2), round(3.0 * 10.0 ** d[1], 2)
    spec = boom(
        tube(length, round(0.02 + 0.06 * d[2], 3), 0.001),
        band=band,
        tolerance=5e-3,
        ratio=round(10.0 ** (-3.0 + 2.0 * d[3]), 5),
        lump=[tip(length, round(10.0 * d[4], 2), 0.05)],
    )
    craft(
        f"drawn_{k}",
        spec,
        hub=hub_of(round(10.0 ** (0.5 + 2.0 * d[5]), 2)),
        step=round(0.3 * d[6] / band + 1e-3, 4),
        integrator=("Euler", "RK4", "implicitfast")[k % 3],
    )


# -- files and trees -------------------------------------------------------------------------------
def _value(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value)


def files(place, spec):
    """The text of a SPEC.toml, and that of its table of modes; by name."""
    out = f'name = "{place}"\n'
    table = f"{place}_modes.toml"
    for key, value in spec.items():
        for each in value if isinstance(value, list) else [value] if key != "table" else []:
            rows = {"file": table} if key == "imported" else each
            out += f"\n[[{key}]]\n" if isinstance(value, list) else f"\n[{key}]\n"
            out += "".join(f"{k} = {_value(v)}\n" for k, v in rows.items())
    modes = "".join(f"{k} = {_value(v)}\n" for k, v in spec.get("table", {}).items())
    return {f"{place}.toml": out} | ({table: modes} if modes else {})


def _numbers(values):
    return " ".join(f"{v:.12g}" for v in values)


def _inside(parts):
    out = ""
    for p in parts:
        half = math.radians(p["turn"]) / 2.0
        turn = f'quat="{_numbers([math.cos(half), 0.0, 0.0, math.sin(half)])}"'
        out += f'<site name="{p["place"]}" pos="{_numbers(p["offset"])}" {turn}/>'
        if body := p["rider"]:
            end = p["offset"] + p["axes"][:, 0] * p["spec"]["port"][0]["x"]
            out += f'<body name="{body["name"]}" pos="{_numbers(end)}" {turn}>'
            if body["axis"]:
                out += f'<joint name="{body["name"]}" axis="{_numbers(body["axis"])}"/>'
            out += f'<inertial pos="0 0 0" mass="{body["mass"]}" '
            out += f'diaginertia="{_numbers(body["inertia"])}"/>{_inside(body["parts"])}</body>'
    return out


def mjcf(c):
    """The text of the bare spacecraft."""
    bodies = [p["rider"] for p in parts_of(c["parts"]) if p["rider"]]
    servos = [b for b in bodies if b["kp"]]
    drives = [f'<position joint="{b["name"]}" kp="{b["kp"]}" kv="{b["kv"]}"/>' for b in servos]
    keys = ""
    for key, angles in c["keys"].items():
        held = f'ctrl="{_numbers(angles)}"' if servos else ""
        keys += f'<key name="{key}" qpos="0 0 0 1 0 0 0 {_numbers(angles)}" {held}/>'
    mass, inertia = c["hub"]
    return (
        f'<mujoco model="craft"><option gravity="0 0 0" timestep="{c["step"]}" '
        f'integrator="{c["integrator"]}"/><worldbody><body name="hub"><freejoint/>'
        f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{_numbers(inertia)}"/>'
        f"{_inside(c['parts'])}</body></worldbody><actuator>{''.join(drives)}</actuator>"
        f"<keyframe>{keys}</keyframe></mujoco>"
    )


def exact(parts):
    """The same tree with exact appendages, for `truth.assemble`."""
    out = []
    for p in parts:
        spec, body = p["spec"], p["rider"]
        if "slosh" in spec:
            item = truth.tank(spec)
        else:
            item = truth.delivered(spec) if "table" in spec else truth.beam(spec)
        carried = body and body | {"parts": exact(body["parts"])}
        out.append((p["offset"], p["axes"], item, carried))
    return out
