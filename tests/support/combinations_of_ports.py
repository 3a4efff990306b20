"""Appendages (hypothesis) of every combination of ports with no, one or two modes: a beam with
rigid and flexible ports, or a table whose modes carry all, some or none of a motion's mass."""

import numpy as np
from hypothesis import strategies as st

PORTS = ("xy", "xz", "torsion", "axial")
MAYBE = st.booleans()


@st.composite
def beams(draw):
    """A SPEC.toml as a dict: one segment, flexible or rigid in each port, and what it carries."""
    length = draw(st.sampled_from((1.2, 8.0)))
    section = {
        "shape": "equivalent",
        "bending_stiffness_xy": 300.0,
        "linear_mass": draw(st.sampled_from((1.3, 1e-3))),
        "polar_inertia": draw(st.sampled_from((0.0, 2e-3))),
    }
    for key, value in (
        ("bending_stiffness_xz", 3e5),
        ("torsion_stiffness", 200.0),
        ("axial_stiffness", 1e6),
    ):
        if draw(MAYBE):
            section[key] = value
    spec = {"name": "odd", "segment": [{"length": length, "section": section}]}
    inertias = st.sampled_from(([0.0, 0.0, 0.0], [0.0, 0.02, 0.02], [0.02, 0.02, 0.02]))
    bodies = [
        {"x": x * length, "mass": draw(st.sampled_from((0.2, 20.0))), "inertia": draw(inertias)}
        for x in draw(st.sets(st.sampled_from((0.0, 0.5, 1.0)), max_size=2))
    ]
    if bodies:
        spec["lump"] = bodies
    if draw(MAYBE):
        spec["payload"] = {"mass": draw(st.sampled_from((0.5, 50.0))), "inertia": draw(inertias)}
    if draw(st.sampled_from((False, False, True))):
        spec["joint"] = [{"after_segment": 0, draw(st.sampled_from(HINGES)): 50.0}]
    flexible = [port for port in PORTS if port == "xy" or f"{KEYS[port]}" in section]
    counts = draw(st.fixed_dictionaries({port: st.integers(0, 2) for port in flexible}))
    spec |= draw(wishes({"modes": counts} if any(counts.values()) else {}))
    if spec.get("root", {}).get("target") in (None, "clamped") and draw(MAYBE):
        spec["port"] = [{"name": "camera", "x": length * draw(st.sampled_from((0.5, 1.0)))}]
    return spec


KEYS = {
    "xy": "bending_stiffness_xy",
    "xz": "bending_stiffness_xz",
    "torsion": "torsion_stiffness",
    "axial": "axial_stiffness",
}
HINGES = ("stiffness_xy", "stiffness_xz", "stiffness_torsion")


@st.composite
def wishes(draw, counts):
    """What is asked of an appendage: modes by number or for a scene, a target, damping."""
    out = {}
    if draw(MAYBE):
        out["scene"] = {
            "bandwidth": draw(st.sampled_from((0.5, 20.0, 300.0))),
            "tolerance": 1e-2,
            "axes": draw(
                st.sampled_from((["z"], ["x"], ["y", "tz"], ["x", "y", "z"], ["tx", "ty", "tz"]))
            ),
        }
    else:
        out |= counts
    target = draw(st.sampled_from((None, "clamped", "free", "hub")))
    if target == "hub" or draw(MAYBE):
        out["root"] = {"hub": {"mass": 200.0, "inertia": [40.0, 40.0, 50.0]}}
    if target is not None:
        out.setdefault("root", {})["target"] = target
    if draw(MAYBE):
        out["damping"] = {"ratio": 0.01, "form": draw(st.sampled_from(("modal", "hinge")))}
    return out


@st.composite
def tables(draw):
    """Modes as a file holds them, and the specification that names it: bodies on springs, on the x
    axis or beside it, that move along y, z and x, and turn about x."""
    count = draw(st.integers(1, 3))
    beside = draw(MAYBE)
    at = np.array([[1.0 + 2.0 * i, 0.3 * beside * (i - 1), 0.2 * beside] for i in range(count)])
    mass = np.array([3.0, 4.5, 0.7])[:count]
    polar = draw(st.sampled_from((0.0, 0.4)))
    # motion of each body's mass per unit motion of the root, times the root of its mass
    columns = np.zeros((6, 4 * count))
    for i, (x, y, z) in enumerate(at):
        root = np.sqrt(mass[i])
        columns[:, 4 * i] = root * np.array([1.0, 0.0, 0.0, 0.0, z, -y])
        columns[:, 4 * i + 1] = root * np.array([0.0, 1.0, 0.0, -z, 0.0, x])
        columns[:, 4 * i + 2] = root * np.array([0.0, 0.0, 1.0, y, -x, 0.0])
        columns[3, 4 * i + 3] = np.sqrt(polar)
    rigid = columns @ columns.T
    if draw(MAYBE):  # a body at the root that no mode moves
        rigid += np.diag([2.0, 2.0, 2.0, 0.1, 0.1, 0.1])
    if draw(MAYBE):  # stubby: every body turns with the root
        rigid += np.diag([0.0, 0.0, 0.0, 0.3, 0.3, 0.3])
    shapes = []
    for direction in draw(st.sets(st.integers(0, 3), min_size=1)):
        own = columns[:, direction::4]
        kind = draw(st.sampled_from(("all", "one", "none")))
        turn = draw(st.sampled_from((np.eye(3), TURN)))[:count, :count]
        turn = np.linalg.qr(turn)[0]
        if kind == "all":
            shapes += list((own @ turn).T)
        elif kind == "one":
            shapes.append((own @ turn)[:, 0])
        else:
            shapes.append(np.zeros(6))
    frequencies = np.cumsum(draw(st.sampled_from(((0.4,), (2.0,), (0.0,)))) * len(shapes)) + 1.5
    document = {
        "frequencies": frequencies.tolist(),
        "participation": np.array(shapes).T.tolist(),
        "mass": rigid.tolist(),
    }
    spec = {"name": "odd", "imported": {"file": "odd_modes.json"}}
    return document, spec | draw(wishes({}))


TURN = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
