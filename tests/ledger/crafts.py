"""The craft of the ledger, as small tables from which their files are written.

A craft is a dict: `hub` (mass, inertia), `step`, `integrator`, `places` (per place: offset and turn
about z in degrees, or the path `place:port` of a carried body), `specs` per place, `riders` (bodies
on ports), `keys` (angles of the joints by keyframe), `springs` on nothing. SI units and radians.
"""

import json
import math

import numpy as np
import truth
from numpy.polynomial import Legendre, Polynomial
from scipy.linalg import eigh

ALUMINIUM = {"youngs_modulus": 7e10, "density": 2700.0, "poissons_ratio": 0.3}
SHEET = {"youngs_modulus": 2e9, "density": 80.0, "poissons_ratio": 0.3}
HUB = (300.0, (100.0, 120.0, 150.0))
ALL = ["tx", "ty", "tz", "x", "y", "z"]


# -- appendages ------------------------------------------------------------------------------------
def appendage(segments, *, band=20.0, tolerance=1e-3, ratio=0.005, axes=None, modes=None, **more):
    """The dict of a SPEC.toml."""
    spec = {"segment": segments, **more}
    if ratio is not None:
        spec["damping"] = {"ratio": ratio}
    if modes:
        spec["modes"] = modes
    spec["scene"] = {"bandwidth": band, "tolerance": tolerance}
    if axes:
        spec["scene"]["axes"] = axes
    return spec


def tube(length, diameter, wall, **more):
    section = {"shape": "tube", "outer_diameter": diameter, "wall": wall}
    return {"length": length, "section": section, "material": ALUMINIUM, **more}


def bar(length, y, z, **more):
    section = {"shape": "rectangle", "width_y": y, "width_z": z}
    return {"length": length, "section": section, "material": ALUMINIUM, **more}


def mast(length, ei, mass, gj=None, ei_xz=None):
    section = {"shape": "equivalent", "bending_stiffness_xy": ei, "linear_mass": mass}
    section |= {"bending_stiffness_xz": ei_xz or ei, "torsion_stiffness": gj or ei / 4.0}
    section |= {"axial_stiffness": 1e3 * ei, "polar_inertia": 0.01 * mass}
    return {"length": length, "section": section}


def panel(length, y=0.02, z=1.2):
    section = {"shape": "rectangle", "width_y": y, "width_z": z}
    return {"length": length, "section": section, "material": SHEET, "nonstructural_mass": 2.0}


def array(panels, length=2.0, soft=500.0, **more):
    """A yoke and panels with hinge lines between."""
    joints = [{"after_segment": i + 1, "stiffness_xy": soft / (1 + i)} for i in range(panels)]
    segments = [tube(1.0, 0.06, 0.002), *(panel(length) for _ in range(panels))]
    return appendage(segments, joint=joints, **more)


def tip(x, mass, inertia=0.0):
    return [{"x": x, "mass": mass, "inertia": [inertia] * 3}]


# -- spacecraft ------------------------------------------------------------------------------------
CRAFTS = {}


def craft(
    name, specs, *, hub=HUB, step=0.01, integrator="Euler", riders=None, keys=None, places=None
):
    """A craft with its appendages by place; by default they stand around the hub."""
    free = [place for place in specs if ":" not in place and place not in (places or {})]
    turns = {p: ((0.5, 0.0, 0.0), 360.0 * i / len(free)) for i, p in enumerate(free)}
    assert name not in CRAFTS
    CRAFTS[name] = {
        "hub": hub,
        "step": step,
        "integrator": integrator,
        "specs": specs,
        "places": turns | (places or {}),
        "riders": riders or {},
        "keys": keys or {},
    }


# booms: length, diameter, wall, hub mass, ratio, integrator, step, band
for name, length, d, wall, mass, ratio, integrator, step, band in (
    ("plain", 8.0, 0.05, 0.002, 300.0, 0.005, "Euler", 0.01, 20.0),
    ("rk4", 8.0, 0.05, 0.002, 300.0, 0.005, "RK4", 0.02, 20.0),
    ("implicitfast", 8.0, 0.05, 0.002, 300.0, 0.005, "implicitfast", 0.002, 20.0),
    ("implicit", 8.0, 0.05, 0.002, 300.0, 0.005, "implicit", 0.002, 20.0),
    ("discrete", 8.0, 0.05, 0.002, 300.0, 0.005, "discrete", 0.002, 20.0),
    ("long", 25.0, 0.08, 0.001, 500.0, 0.002, "RK4", 0.05, 6.0),
    ("short", 3.0, 0.03, 0.001, 100.0, 0.01, "Euler", 0.002, 100.0),
    ("light_damping", 8.0, 0.05, 0.002, 300.0, 1e-4, "RK4", 0.005, 20.0),
    ("heavy_damping", 8.0, 0.05, 0.002, 300.0, 0.1, "Euler", 0.01, 20.0),
    ("undamped", 8.0, 0.05, 0.002, 300.0, 0.0, "RK4", 0.005, 20.0),
    ("unstated", 8.0, 0.05, 0.002, 300.0, None, "RK4", 0.005, 20.0),
    ("hub_1", 8.0, 0.05, 0.002, 6.5, 0.005, "Euler", 0.01, 20.0),
    ("hub_0.3", 8.0, 0.05, 0.002, 2.0, 0.005, "RK4", 0.01, 20.0),
    ("hub_0.1", 8.0, 0.05, 0.002, 0.65, 0.005, "Euler", 0.005, 20.0),
    ("hub_0.03", 8.0, 0.05, 0.002, 0.2, 0.005, "RK4", 0.005, 20.0),
):
    inertia = tuple(mass / 3.0 * k for k in (1.0, 1.2, 1.5))
    craft(
        f"boom_{name}",
        {"mount": appendage([tube(length, d, wall)], ratio=ratio, band=band)},
        hub=(mass, inertia),
        step=step,
        integrator=integrator,
    )

# trees of straight links: bodies on ports, with hinges
LINK = {"modes": {"xy": 2, "xz": 2, "torsion": 1}, "tolerance": 0.02}


def link(length, y, z, body, **more):
    port = [{"name": "end", "x": length, "carries": [body]}] if body else []
    spec = appendage([bar(length, y, z)], **{**LINK, **more})
    return spec | ({"port": port} if port else {"lump": tip(length, 5.0, 0.2)})


def rider(mass, inertia, axis=None, kp=0.0, kv=0.0):
    return {"mass": mass, "inertia": (inertia,) * 3, "axis": axis, "kp": kp, "kv": kv}


def arm(
    name, links, bodies, axes, *, step=0.0005, integrator="Euler", keys=None, kp=0.0, kv=0.0, **more
):
    """Links in a row, body i at the end of link i, on a hinge where it has an axis."""
    specs, riders, places = {}, {}, {"link0": ((0.5, 0.0, 0.0), 0.0)}
    for i, (length, y, z) in enumerate(links):
        body = f"body{i}" if i < len(bodies) else None
        specs[f"link{i}"] = link(length, y, z, body, **more)
        if body:
            riders[body] = rider(*bodies[i], axes[i], kp, kv) | {"on": f"link{i}"}
            places[f"link{i + 1}"] = body
    craft(
        name,
        specs,
        hub=(400.0, (80.0, 100.0, 120.0)),
        step=step,
        integrator=integrator,
        riders=riders,
        keys=keys,
        places=places,
    )


Z, Y = (0, 0, 1), (0, 1, 0)
UPPER, FORE = (6.0, 0.05, 0.08), (5.0, 0.04, 0.05)
BENT = {"bent": [0.8], "square": [1.5708]}
arm("arm_weld", [UPPER, FORE], [(4.0, 0.02)], [None])
arm("arm_free", [UPPER, FORE], [(4.0, 0.02)], [Z], keys=BENT)
arm("arm_servo", [UPPER, FORE], [(4.0, 0.02)], [Z], keys=BENT, kp=9000.0, kv=400.0)
arm("arm_heavy", [UPPER, FORE], [(60.0, 2.0)], [Z], keys=BENT)
arm(
    "arm_three",
    [UPPER, FORE, (3.0, 0.03, 0.04)],
    [(4.0, 0.02), (3.0, 0.02)],
    [Z, Y],
    keys={"bent": [0.7, -0.5]},
)

# arrays: panels, length, soft, band, axes, integrator, step
for name, panels, length, soft, band, axes, integrator, step in (
    ("two", 2, 2.0, 600.0, 5.0, ["z"], "RK4", 0.05),
    ("three", 3, 2.0, 500.0, 5.0, ["z"], "RK4", 0.05),
    ("wide_band", 2, 2.0, 600.0, 25.0, None, "Euler", 0.005),
    ("soft", 2, 2.5, 50.0, 5.0, None, "implicitfast", 0.002),
):
    craft(
        f"array_{name}",
        {"mount": array(panels, length, soft, band=band, axes=axes)},
        integrator=integrator,
        step=step,
    )
PAIR = array(2, band=5.0, axes=["z"])
craft("array_pair", {"left": PAIR, "right": PAIR}, integrator="RK4", step=0.02)

# masts: with bodies
for name, length, ei, lumps, band in (
    ("bare", 20.0, 8e5, [], 20.0),
    ("instrument", 20.0, 8e5, tip(20.0, 20.0, 0.8), 20.0),
    ("half_way", 20.0, 8e5, tip(10.0, 6.0, 0.05) + tip(20.0, 45.0, 2.0), 20.0),
):
    craft(
        f"mast_{name}",
        {"mount": appendage([mast(length, ei, 2.0)], band=band, lump=lumps)},
        step=0.002,
    )


def plate(length, width, thickness, young=7e10, density=1500.0, poisson=0.3, modes=12):
    """Modes of a plate in the plane xy, held along x = 0, as a finite-element program delivers
    them: Ritz, with products of Legendre polynomials and x^2."""
    xi, weight = np.polynomial.legendre.leggauss(14)
    x, y = length * (1.0 + xi) / 2.0, width * xi / 2.0
    weight = np.outer(length * weight / 2.0, width * weight / 2.0).ravel()
    along = [
        Polynomial([0, 0, 1]) * Legendre.basis(i, [0, length]).convert(kind=Polynomial)
        for i in range(8)
    ]
    across = [Legendre.basis(j, [-width / 2, width / 2]).convert(kind=Polynomial) for j in range(6)]

    def rows(a, b):
        f = [p.deriv(a)(x) if a else p(x) for p in along]
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
    mass = truth.body_mass(m, [m * w2, m * l2, m * (l2 + w2)])
    mass[1, 5] = mass[5, 1] = m * length / 2.0
    mass[2, 4] = mass[4, 2] = -m * length / 2.0
    return {
        "frequencies_hz": (np.sqrt(squares) / (2.0 * np.pi)).tolist(),
        "participation": (per * (rigid * weight) @ (w.T @ shapes)).tolist(),
        "mass": mass.tolist(),
    }


def imported(table, **more):
    """Imported modes: the table stands beside the specification."""
    spec = appendage([], **more)
    del spec["segment"]
    return spec | {"imported": {"file": "table"}, "table": table}


craft("plate_plain", {"mount": imported(plate(3.0, 1.0, 0.004), band=10.0)}, step=0.005)


def slosh(radius, height, ratio=0.01, acceleration=0.05):
    spec = {"slosh": {"shape": "cylinder", "radius": radius, "height": height, "density": 1010.0}}
    spec["slosh"] |= {"ratio": ratio, "acceleration": acceleration}
    return spec | {"scene": {"bandwidth": 1.0, "tolerance": 1e-2}}


craft("tank", {"mount": slosh(0.4, 0.5)}, hub=(1500.0, (900.0, 900.0, 900.0)), step=0.02)


# -- files -----------------------------------------------------------------------------------------
def _value(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value)


def toml(name, spec):
    """The text of a SPEC.toml, and that of its table of modes, empty without one."""
    out, table = [f'name = "{name}"'], spec.get("table")
    for key, value in spec.items():
        if key == "table":
            continue
        many = isinstance(value, list)
        for each in value if many else [value]:
            each = {"file": f"{name}_modes.toml"} if key == "imported" else each
            out += ["", f"[[{key}]]" if many else f"[{key}]"]
            out += [f"{k} = {_value(v)}" for k, v in each.items()]
    text = "".join(f"{k} = {_value(v)}\n" for k, v in (table or {}).items())
    return "\n".join(out) + "\n", text


def mjcf(c):
    """The text of the bare spacecraft."""
    numbers = lambda values: " ".join(f"{v:.12g}" for v in values)  # noqa: E731

    def sites(owner):
        out = ""
        for place, at in c["places"].items():
            if isinstance(at, str):
                out += f'<site name="{place}"/>' if at == owner else ""
            elif owner == "hub":
                half = math.radians(at[1]) / 2.0
                x = [math.cos(2.0 * half) * at[0][0], math.sin(2.0 * half) * at[0][0], at[0][2]]
                turn = numbers([math.cos(half), 0.0, 0.0, math.sin(half)])
                out += f'<site name="{place}" pos="{numbers(x)}" quat="{turn}"/>'
        return out

    def riders(owner, x):
        out = ""
        for name, body in c["riders"].items():
            if c["places"][body["on"]] == owner or (owner == "hub" and body["on"] == "link0"):
                at = x + c["specs"][body["on"]]["segment"][0]["length"]
                out += f'<body name="{name}" pos="{at} 0 0">'
                if body["axis"]:
                    out += f'<joint name="{name}" type="hinge" axis="{numbers(body["axis"])}"/>'
                out += f'<inertial pos="0 0 0" mass="{body["mass"]}" '
                out += f'diaginertia="{numbers(body["inertia"])}"/>{sites(name)}'
                out += riders(name, 0.0) + "</body>"
        return out

    mass, inertia = c["hub"]
    turning = [n for n, b in c["riders"].items() if b["axis"]]
    keys = "".join(
        f'<key name="{k}" qpos="0 0 0 1 0 0 0 {numbers(v)}" ctrl="{numbers(v) if _driven(c) else ""}"/>'
        for k, v in c["keys"].items()
    )
    servos = "".join(
        f'<position joint="{n}" kp="{c["riders"][n]["kp"]}" kv="{c["riders"][n]["kv"]}"/>'
        for n in turning
        if c["riders"][n]["kp"]
    )
    return (
        f'<mujoco model="craft"><option gravity="0 0 0" timestep="{c["step"]}" '
        f'integrator="{c["integrator"]}"/><worldbody><body name="hub"><freejoint/>'
        f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{numbers(inertia)}"/>'
        f"{sites('hub')}{riders('hub', 0.5)}</body></worldbody>"
        f"<actuator>{servos}</actuator><keyframe>{keys}</keyframe></mujoco>"
    ).replace(' ctrl=""', "")


def _driven(c):
    return any(b["kp"] for b in c["riders"].values())


def exact(c):
    """The tree of `truth.assemble`: hub and parts."""

    def item(spec):
        if "slosh" in spec:
            return truth.tank(spec)
        return truth.delivered(spec, spec["table"]) if "table" in spec else truth.beam(spec)

    def parts(owner, offset):
        out = []
        for place, at in c["places"].items():
            if isinstance(at, str):
                if at != owner:
                    continue
                where, axes = (0.0, 0.0, 0.0), truth.about((0, 0, 1), 0.0)
            elif owner == "hub":
                axes = truth.about((0, 0, 1), math.radians(at[1]))
                where = axes @ at[0]
            else:
                continue
            riding = None
            for name, body in c["riders"].items():
                if body["on"] == place:
                    riding = body | {"parts": parts(name, 0.0)}
            out.append((where, axes, item(c["specs"][place]), riding))
        return out

    return c["hub"], parts("hub", 0.5)
