"""Hostile and extreme specifications: physical ones far out, wrong types, nonsense, many pieces,
imported modes."""

import copy
import datetime
import json
import random

import numpy as np

from random_appendages import ALU, random_appendage

JUNK = (
    float("nan"),
    float("inf"),
    -float("inf"),
    1.7e308,
    -1.7e308,
    5e-324,
    1e-300,
    0.0,
    -0.0,
    -1,
    0,
    1,
    2**63,
    -(2**63),
    2**70,
    10**400,
    True,
    False,
    "",
    "x",
    "1.0",
    "ünï\u202e\U0001f4a5",
    "../../x",
    "/etc/passwd",
    "a" * 5000,
    [],
    {},
    [[]],
    [1.0],
    [1.0] * 4,
    {"a": {"b": {}}},
    datetime.date(1979, 5, 27),
    [1, "x", {}],
    [{}],
    [float("nan")] * 3,
)
NUMBERS = (0.0, 1.0, -1.0, 1e-300, 1e-30, 1e-9, 1e9, 1e30, 1e150, 1e308)
KEYS = (
    "x",
    "mass",
    "length",
    "",
    "a.b",
    "ü",
    "__class__",
    "segment",
    "section",
    "file",
    "fit",
    "modes",
    "timestep",
)


def written(value):
    """TOML text of a value, whatever it is."""
    if isinstance(value, dict):
        return (
            "{ "
            + ", ".join(
                f"{json.dumps(k, ensure_ascii=False)} = {written(v)}" for k, v in value.items()
            )
            + " }"
        )
    if isinstance(value, list):
        return "[" + ", ".join(written(v) for v in value) + "]"
    if isinstance(value, datetime.date):
        return value.isoformat()
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def places(value, at=()):
    """Every place in nested tables and lists, the tables and lists themselves too."""
    inner = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    for key, child in inner:
        yield value, key
        yield from places(child, (*at, key))


def options(rng, length):
    """Tables beside the appendage, many of them far out."""
    out = {}
    step = 10.0 ** rng.uniform(-5.0, 1.0)
    if rng.random() < 0.5:
        out["scene"] = {
            "bandwidth": 10.0 ** rng.uniform(-3.0, 5.0),
            "tolerance": 10.0 ** rng.uniform(-9.0, 0.5),
        }
        if rng.random() < 0.5:
            out["scene"]["axes"] = rng.sample(("x", "y", "z", "tx", "ty", "tz"), rng.randint(1, 6))
        if rng.random() < 0.5:
            kinds = ("Euler", "RK4", "implicit", "implicitfast", "discrete", "auto")
            rates = [10.0 ** rng.uniform(-6.0, 3.0) for _ in range(3)]
            out["scene"] |= {"integrator": rng.choice(kinds), "timestep": step, "rates": rates}
        out["scene"]["tip"] = rng.random() < 0.2
    if rng.random() < 0.6:
        if rng.random() < 0.6:
            ratio = 10.0 ** rng.uniform(-5.0, -0.01)
        else:
            ratio = {port: [10.0 ** rng.uniform(-5.0, -0.01)] for port in ("xy", "torsion")}
        out["damping"] = {"ratio": ratio, "form": rng.choice(("modal", "modal", "hinge"))}
    if rng.random() < 0.5:
        mass = 10.0 ** rng.uniform(-3.0, 5.0)
        hub = {
            "mass": mass,
            "inertia": [mass * 10.0 ** rng.uniform(-2.0, 1.0)] * 3,
            "offset": [rng.uniform(-2.0, 2.0), 0.0, 0.0],
        }
        out["root"] = {"hub": hub, "target": rng.choice(("clamped", "free", "hub", "auto"))}
    if rng.random() < 0.4 and "scene" not in out:
        count = rng.randint(1, 20)
        out["modes"] = {port: rng.randint(0, count) for port in ("xy", "xz", "torsion", "axial")}
    if rng.random() < 0.1:
        out["payload"] = {"mass": 10.0 ** rng.uniform(-6.0, 6.0)}
    if rng.random() < 0.1:
        out["port"] = [
            {"name": f"p{i}", "x": length * rng.choice((0.5, 1.0, 1e-6, rng.random()))}
            for i in range(rng.randint(1, 3))
        ]
    if rng.random() < 0.2:
        out["fit"] = {
            "springs": rng.choice(("auto", "hinges", "modes")),
            "cuts": [length * rng.random() for _ in range(rng.randint(0, 4))],
            "timestep": step,
        }
    if rng.random() < 0.1:
        out["sensors"] = {"modes": True, "root_load": True, "points": ["tip"]}
    return out


def far_out(rng, spec):
    """A few numbers of a spec made much larger or smaller, negative or nothing."""
    found = [(o, k) for o, k in places(spec) if isinstance(o[k], float)]
    for o, k in rng.sample(found, min(len(found), rng.randint(1, 3))):
        r = rng.random()
        o[k] = (
            o[k] * 10.0 ** rng.uniform(-9.0, 9.0)
            if r < 0.8
            else rng.choice(NUMBERS)
            if r < 0.9
            else -o[k]
        )


def spoil(rng, spec):
    """Values replaced by junk, taken out, doubled, and keys that nobody knows."""
    for _ in range(rng.randint(1, 3)):
        o, k = rng.choice(list(places(spec)) or [(spec, "name")])
        kind = rng.random()
        if kind < 0.5:
            o[k] = copy.deepcopy(rng.choice(JUNK))
        elif kind < 0.65:
            del o[k]
        elif kind < 0.8 and isinstance(o, list):
            o.append(copy.deepcopy(o[k]))
        elif kind < 0.9 and isinstance(o, dict):
            o[rng.choice(KEYS)] = copy.deepcopy(rng.choice(JUNK))
        else:
            for _ in range(rng.choice((1, 5, 100))):
                o[k] = [o.get(k) if isinstance(o, dict) else o[k]]


def crowded(rng, spec):
    """Joints at every end, bodies at the same place, at root and tip,
    and segments that are next to nothing."""
    segments = spec["segment"]
    if rng.random() < 0.5:
        segments.insert(
            rng.randrange(len(segments) + 1),
            {**segments[0], "length": segments[0]["length"] * 10.0 ** rng.uniform(-12.0, 3.0)},
        )
    length = sum(s["length"] for s in segments)
    if rng.random() < 0.6:
        stiff = 10.0 ** rng.uniform(-9.0, 12.0)
        spec["joint"] = [
            {
                "after_segment": i,
                rng.choice(("stiffness_xy", "stiffness_xz", "stiffness_torsion")): stiff
                * rng.random(),
            }
            for i in range(len(segments) + (rng.random() < 0.1))
        ]
    x = rng.choice((0.0, length, length / 2.0, rng.random() * length))
    spec["lump"] = [
        {"x": x * (1.0 + rng.choice((0.0, 1e-16, 1e-9))), "mass": 10.0 ** rng.uniform(-6.0, 6.0)}
        for _ in range(rng.randint(0, 4))
    ]


def many(rng):
    """Up to 1,100 segments or bodies: more than is taken."""
    count = rng.choice((13, 60, 400, 1100))
    piece = {
        "length": 20.0 / count,
        "section": {"shape": "round", "diameter": 0.05},
        "material": dict(ALU),
    }
    spec = {"segment": [{**piece, "length": 20.0}]}
    if rng.random() < 0.5:
        spec["lump"] = [
            {"x": 20.0 * rng.random(), "mass": 10.0 ** rng.uniform(-3.0, 0.0)} for _ in range(count)
        ]
    else:
        spec["segment"] = [
            {**piece, "section": {"shape": "round", "diameter": rng.uniform(0.04, 0.06)}}
            for _ in range(count)
        ]
    return spec | {
        "modes": {
            "xy": rng.randint(1, 6),
            "xz": rng.randint(0, 6),
            "torsion": rng.randint(0, 3),
            "axial": rng.randint(0, 3),
        }
    }


def imported(rng):
    """A modes file of points that move at random, and the table that names it."""
    source = np.random.default_rng(rng.randrange(2**32))
    points = int(source.integers(3, 12))
    count = int(source.integers(1, 9))
    x = source.uniform(-0.1, 1.0, (points, 3)) * [10.0 ** source.uniform(-1.0, 1.5), 1.0, 1.0]
    rigid = np.concatenate(
        [[[1, 0, 0, 0, z, -y], [0, 1, 0, -z, 0, a], [0, 0, 1, y, -a, 0]] for a, y, z in x]
    )
    rows = np.repeat(np.sqrt(10.0 ** source.uniform(-2.0, 1.0, points)), 3)[:, None] * rigid
    modes = np.linalg.qr(source.standard_normal((3 * points, min(count, 3 * points - 1))))[0]
    document = {
        "frequencies": np.cumsum(10.0 ** source.uniform(-1.0, 2.0, modes.shape[1])).tolist(),
        "participation": (rows.T @ modes).tolist(),
        "mass": (rows.T @ rows).tolist(),
    }
    if rng.random() < 0.5:
        document["damping"] = [10.0 ** rng.uniform(-5.0, -0.1)] * modes.shape[1]
    table = {"file": "modes.json"}
    if rng.random() < 0.3:
        table["length"] = 10.0 ** rng.uniform(-3.0, 3.0)
    if rng.random() < 0.2:
        table["reference"] = [rng.uniform(-1.0, 1.0), 0.0, 0.0]
    return document, {"imported": table, **options(rng, 1.0)}


def hostile_spec(seed):
    """Text of a SPEC.toml by its number, and of the modes.json that it may name."""
    rng = random.Random(seed)
    kind = rng.random()
    document = None
    if kind < 0.01:
        spec = many(rng)
    elif kind < 0.15:
        document, spec = imported(rng)
    else:
        spec = json.loads(json.dumps(random_appendage(rng.randrange(10**6))))
        if rng.random() < 0.2:
            crowded(rng, spec)
        more = options(rng, sum(s["length"] for s in spec["segment"]))
        if "scene" in more:
            del spec["modes"]
        spec |= more
    spec["name"] = "hostile"
    kind = rng.random()
    if kind < 0.2:
        far_out(rng, spec if document is None or rng.random() < 0.5 else document)
    elif kind < 0.97:
        spoil(rng, spec if document is None or rng.random() < 0.5 else document)
    text = (
        "\n".join(f"{json.dumps(k, ensure_ascii=False)} = {written(v)}" for k, v in spec.items())
        + "\n"
    )
    return text, None if document is None else json.dumps(document, default=str)
