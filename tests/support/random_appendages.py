"""Specifications as plain dicts (a parsed SPEC.toml) for tests: random ones with fixed seeds,
and named ones."""

import json

import numpy as np

ALU = {"youngs_modulus": 7e10, "density": 2700.0, "poissons_ratio": 0.33}
CARBON = {"youngs_modulus": 1.2e11, "density": 1600.0, "shear_modulus": 5e9}


def toml(spec):
    """The text of a spec that is a dict."""

    def inline(value):
        if isinstance(value, dict):
            return "{ " + ", ".join(f"{k} = {inline(v)}" for k, v in value.items()) + " }"
        if isinstance(value, list | tuple):
            return "[" + ", ".join(inline(v) for v in value) + "]"
        if isinstance(value, np.generic):
            value = value.item()
        return repr(value) if isinstance(value, float) else json.dumps(value)

    out = [
        f"{key} = {inline(v)}" for key, v in spec.items() if not isinstance(v, dict | list | tuple)
    ]
    for key, value in spec.items():
        for table in (
            value if isinstance(value, list | tuple) else [value] if isinstance(value, dict) else []
        ):
            out += ["", f"[{key}]" if isinstance(value, dict) else f"[[{key}]]"]
            out += [f"{k} = {inline(v)}" for k, v in table.items()]
    return "\n".join(out) + "\n"


def tube_and_strip(joint_at, modes, **more):
    """A tube of 2 m and a strip of 4 m with a hinge that is soft in one plane only,
    1 kg at the end.

    Args:
        joint_at: 0: the hinge stands at the root; 1: at 2 m.
        modes: {"xy": ..., "xz": ...}.
        more: further tables.
    """
    return {
        "name": "array",
        "segment": [
            {
                "length": 2.0,
                "section": {"shape": "tube", "outer_diameter": 0.05, "wall": 0.002},
                "material": {"youngs_modulus": 7e10, "density": 2700.0},
            },
            {
                "length": 4.0,
                "section": {"shape": "rectangle", "width_y": 0.02, "width_z": 0.05},
                "material": {"youngs_modulus": 7e10, "density": 2700.0},
            },
        ],
        "joint": [{"after_segment": joint_at, "stiffness_xz": 1000.0}],
        "lump": [{"x": 6.0, "mass": 1.0}],
        "root": {"hub": {"mass": 100.0, "inertia": [20.0, 20.0, 20.0], "offset": [0.5, 0.0, 0.0]}},
        "modes": dict(modes),
        **more,
    }


def uniform(modes, **more):
    """A plain round boom."""
    return {
        "name": "boom",
        "segment": [
            {"length": 6.0, "section": {"shape": "round", "diameter": 0.03}, "material": ALU}
        ],
        "modes": dict(modes),
        **more,
    }


def _section(rng, shape, slim):
    if shape == "round":
        return {"shape": shape, "diameter": float(slim * rng.uniform(0.6, 1.2))}
    if shape == "tube":
        d = float(slim * rng.uniform(0.8, 1.6))
        return {"shape": shape, "outer_diameter": d, "wall": float(d * rng.uniform(0.03, 0.15))}
    if shape == "rectangle":
        y, z = (float(slim * rng.uniform(0.4, 1.5)) for _ in range(2))
        return {"shape": shape, "width_y": y, "width_z": z}
    if shape == "box":
        y, z = (float(slim * rng.uniform(0.7, 1.6)) for _ in range(2))
        return {
            "shape": shape,
            "width_y": y,
            "width_z": z,
            "wall": float(min(y, z) * rng.uniform(0.04, 0.15)),
        }
    if shape == "custom":
        a = float(slim**2 * rng.uniform(0.3, 1.0))
        y, z = (float(a * slim**2 * rng.uniform(0.05, 0.2)) for _ in range(2))
        return {
            "shape": shape,
            "area": a,
            "second_moment_z": z,
            "second_moment_y": y,
            "torsion_constant": float(min(y, z) * rng.uniform(0.5, 1.5)),
        }
    bend = float(7e10 * slim**4 / 12.0 * rng.uniform(0.3, 3.0))
    mass = float(2700.0 * slim**2 * rng.uniform(0.5, 2.0))
    return {
        "shape": "equivalent",
        "bending_stiffness_xy": bend,
        "bending_stiffness_xz": float(bend * rng.uniform(0.2, 5.0)),
        "torsion_stiffness": float(bend * rng.uniform(0.1, 1.0)),
        "axial_stiffness": float(bend / slim**2 * 10.0),
        "linear_mass": mass,
        "polar_inertia": float(mass * slim**2 * rng.uniform(0.1, 0.5)),
    }


def _taper(rng, section):
    """The other end of a taper: every dimension scaled by its own factor, walls by the smallest."""
    factors = {k: float(rng.uniform(0.5, 1.3)) for k in section if k != "shape"}
    if "wall" in factors:
        factors["wall"] = min(factors.values())
    return {k: v if k == "shape" else v * factors[k] for k, v in section.items()}


def _bending(segment):
    """A size of EI of the segment's root end, for choosing a joint's stiffness."""
    s = segment["section"]
    if s["shape"] == "equivalent":
        return s["bending_stiffness_xy"]
    wide = [v for k, v in s.items() if k in ("diameter", "outer_diameter", "width_y", "width_z")]
    i = s["second_moment_z"] if s["shape"] == "custom" else min(wide) ** 4 / 20.0
    return segment["material"]["youngs_modulus"] * i


def random_appendage(seed):
    """A random specification: 1 to 4 segments, tapers, joints (a third of them at the root, some
    soft in one plane only), lumps, a hub, 1 to 6 modes per plane and up to 3 in torsion.
    """
    rng = np.random.default_rng(130000 + seed)
    shapes = ("round", "tube", "rectangle", "box", "custom", "equivalent")
    total = float(rng.uniform(1.0, 15.0))
    slim = float(rng.uniform(0.004, 0.012))
    count = int(rng.integers(1, 5))
    shares = rng.uniform(0.3, 1.0, count)
    segments = []
    for share in shares / shares.sum():
        shape = shapes[int(rng.integers(len(shapes)))]
        segment = {"length": float(share * total), "section": _section(rng, shape, slim * total)}
        if rng.random() < 0.4:
            segment["section_end"] = _taper(rng, segment["section"])
        if shape != "equivalent":
            segment["material"] = dict(ALU if rng.random() < 0.7 else CARBON)
            if rng.random() < 0.2:
                segment["theory"] = "timoshenko"
        if rng.random() < 0.2:
            segment["nonstructural_mass"] = float(rng.uniform(0.05, 0.5))
        segments.append(segment)
    spec = {"name": f"random{seed}", "segment": segments}
    joints = []
    for place in range(count):
        if rng.random() < (0.33 if place == 0 else 0.4):
            c = _bending(segments[max(place - 1, 0)]) / total * 10.0 ** rng.uniform(-0.3, 1.5)
            kinds = (("stiffness_xy",), ("stiffness_xz",), ("stiffness_xy", "stiffness_xz"))[
                int(rng.integers(3))
            ]
            joint = {
                "after_segment": place,
                **{kind: float(c * rng.uniform(0.5, 2.0)) for kind in kinds},
            }
            if rng.random() < 0.4:
                joint["stiffness_torsion"] = float(c * rng.uniform(0.5, 2.0))
            joints.append(joint)
    if joints:
        spec["joint"] = joints
    lumps = []
    length = sum(s["length"] for s in segments)
    for _ in range(int(rng.integers(0, 4))):
        ends = [sum(s["length"] for s in segments[: i + 1]) for i in range(count)]
        x = float(
            ends[int(rng.integers(count))] if rng.random() < 0.5 else rng.uniform(0.1, 1.0) * length
        )
        mass = float(10.0 ** rng.uniform(-1.5, 0.5))
        size = mass * (0.03 * length) ** 2
        lump = {"x": x, "mass": mass}
        if rng.random() < 0.6:
            lump["inertia"] = [float(size * rng.uniform(0.7, 1.3)) for _ in range(3)]
        lumps.append(lump)
    if lumps:
        spec["lump"] = lumps
    xy = int(rng.integers(1, 7))
    xz = int((xy + rng.integers(0, 6) - 1) % 6 + 1) if rng.random() < 0.85 else xy
    spec["modes"] = {"xy": xy, "xz": xz, "torsion": int(rng.integers(0, 4))}
    if rng.random() < 0.5:
        spec["root"] = {
            "hub": {
                "mass": float(10.0 ** rng.uniform(1.0, 3.0)),
                "inertia": [
                    float(v) for v in 10.0 ** rng.uniform(1.0, 2.0) * rng.uniform(0.8, 1.2, 3)
                ],
                "offset": [float(rng.uniform(0.0, 1.0)), 0.0, 0.0],
            }
        }
    if rng.random() < 0.5:
        spec["damping"] = {"ratio": float(rng.uniform(0.001, 0.02))}
    return spec
