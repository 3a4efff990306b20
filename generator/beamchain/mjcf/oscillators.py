"""Oscillators -> MJCF: a root body and one body per mode, named after it."""

from copy import deepcopy

import numpy as np
from lxml.etree import _Element as Element

from beamchain.chain.bodies import Body
from beamchain.chain.oscillators import Oscillator, Oscillators
from beamchain.errors import EngineError
from beamchain.mjcf.write import SMALLEST, find, number, template
from beamchain.motion import Array


def body_name(name: str, item: Oscillator) -> str:
    """`array_mode3_slider`."""
    return f"{name}_mode{item.mode}_{item.kind}"


def oscillators(made: Oscillators, name: str, *, visuals: bool = True) -> Element:
    """The drop-in file of the oscillator form.

    Args:
        made: what to write.
        name: prefix of every body, joint, site and geom; the root body is `NAME_link1`, as a chain's.
        visuals: write massless, collision-free geoms.

    Raises:
        EngineError: a moving body is too light for MuJoCo.
    """
    root = template("oscillators")
    root.set("model", name)
    world = find(root, "worldbody")
    carrier = find(world, "body")
    prototype = find(carrier, "body")
    carrier.remove(prototype)
    carrier.set("name", f"{name}_link1")
    _inertial(carrier, made.root, np.zeros(3))
    shape = find(carrier, "geom")
    if visuals:
        shape.set("name", f"{name}_shape1")
        shape.set("size", number([made.length / 2.0, made.length / 200.0, made.length / 200.0]))
        shape.set("pos", number([made.length / 2.0, 0.0, 0.0]))
    else:
        carrier.remove(shape)
    for site, x in (("root", 0.0), ("tip", made.length)):
        element = find(carrier, f"site[@name='{site}']")
        element.set("name", f"{name}_{site}")
        element.set("pos", number([x, 0.0, 0.0]))
    largest = max((i.body.mass for i in made.items if i.body is not None), default=1.0)
    places: dict[int, tuple[Element, Array]] = {}  # body and its origin that carry what rides in item i
    waiting: list[Oscillator] = []  # joints of items without a body of their own: they move the next body too
    for i, item in enumerate(made.items):
        parent, origin = places[item.inside] if item.inside is not None else (carrier, np.zeros(3))
        waiting.append(item)
        if item.body is None:
            places[i] = parent, origin
            continue
        if item.body.mass < SMALLEST or float(item.body.principal()[0].min()) < SMALLEST:
            raise EngineError(
                f"mode {item.mode} would be a body of {item.body.mass:.3g} kg, smallest inertia "
                f"{float(item.body.principal()[0].min()):.3g} kg m^2; MuJoCo takes nothing below {SMALLEST:g}. Leave "
                "the mode out (imported.modes), or use smaller units (millimetres, grams)."
            )
        at = np.asarray(item.point)
        element = deepcopy(prototype)
        element.set("name", body_name(name, item))
        element.set("pos", number(at - origin))
        joint = find(element, "joint")
        place = element.index(joint)
        element.remove(joint)
        for moved in waiting:
            own = deepcopy(joint)
            own.set("name", body_name(name, moved))
            own.set("type", "slide" if moved.kind == "slider" else "hinge")
            own.set("axis", number(moved.axis))
            own.set("stiffness", number(moved.stiffness))
            own.set("damping", number(moved.damping))
            element.insert(place, own)
            place += 1
        waiting = []
        _inertial(element, item.body, at)
        geom = find(element, "geom")
        if visuals:
            geom.set("name", f"{body_name(name, item)}_shape")
            geom.set(
                "size", number(max(0.04 * made.length * (item.body.mass / largest) ** (1 / 3), 0.002 * made.length))
            )
            geom.set("pos", number(np.asarray(item.body.centre) - at))
        else:
            element.remove(geom)
        parent.append(element)
        places[i] = element, at
    return root


def _inertial(element: Element, body: Body, origin: Array) -> None:
    inertial = find(element, "inertial")
    if body.mass <= 0.0:
        element.remove(inertial)
        return
    inertia, axes = body.principal()
    inertial.set("mass", number(body.mass))
    inertial.set("pos", number(np.asarray(body.centre) - origin))
    inertial.set("quat", number(_quaternion(axes)))
    inertial.set("diaginertia", number(inertia))


def _quaternion(axes: Array) -> Array:
    """`(4,)` w, x, y, z of a rotation matrix, by its largest component."""
    m = axes
    squares = np.array([np.trace(m), m[0, 0], m[1, 1], m[2, 2]])
    k = int(np.argmax(squares))
    if k == 0:
        q = np.array([1.0 + squares[0], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    else:
        a, b, c = k - 1, k % 3, (k + 1) % 3
        q = np.zeros(4)
        q[0] = m[c, b] - m[b, c]
        q[1 + a] = 1.0 + m[a, a] - m[b, b] - m[c, c]
        q[1 + b] = m[b, a] + m[a, b]
        q[1 + c] = m[c, a] + m[a, c]
    return q / np.linalg.norm(q)
