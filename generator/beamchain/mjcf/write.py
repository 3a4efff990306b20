"""Chain -> MJCF: lxml fills the templates of `mjcf_templates/`."""

from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.errors import EngineError
from beamchain.mjcf import visuals
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.mass_line import MassLine

_PACKAGED = Path(__file__).parent.parent / "mjcf_templates"
_CHECKOUT = Path(__file__).parents[3] / "mjcf_templates"
TEMPLATES = _PACKAGED if _PACKAGED.is_dir() else _CHECKOUT

JOINTS = {
    "xy": ("hinge", "0 0 1"),
    "xz": ("hinge", "0 -1 0"),
    "torsion": ("hinge", "1 0 0"),
    "axial": ("slide", "1 0 0"),
}

#: Motions of the root that belong to each port, as the bench names them.
ROOT_JOINTS = {
    "xy": ("root_xy_displacement", "root_xy_rotation"),
    "xz": ("root_xz_displacement", "root_xz_rotation"),
    "torsion": ("root_torsion",),
    "axial": ("root_axial",),
}

ALONG_X = "0.7071067811865476 0.0 0.7071067811865475 0.0"  # turns the axis of a capsule or cylinder from z to x
UNMARKED = "0.9 0.95 0.001 0.5 2"  # MuJoCo's own; a tendon made exact in time carries its step there (steps.modal)
SMALLEST = 1e-15  # mjMINVAL: mass and principal inertia of a moving body
UNITS = (
    "Write the spec in smaller units: in millimetres and grams the modulus keeps its number, density is divided by 1e6, "
    "masses multiplied by 1e3 and inertias by 1e9."
)
ROUNDED = 1e-13  # relative deficit of the triangle inequality that turning to principal axes may leave
UNSEEN = 1.1e-6  # [m]: where nothing is turned, MuJoCo takes a mass centre this near to the body's origin for it
DEEPEST = 496  # bodies nested in one MJCF file


def number(values: float | ArrayLike) -> str:
    """17 digits, so that what MuJoCo reads is what was computed."""
    return " ".join(repr(float(v)) for v in np.atleast_1d(np.asarray(values, dtype=np.float64)))


def template(name: str) -> Element:
    """The root element of `mjcf_templates/NAME.xml`."""
    parser = etree.XMLParser(remove_blank_text=True, remove_comments=True, resolve_entities=False, no_network=True)
    return etree.parse(str(TEMPLATES / f"{name}.xml"), parser).getroot()


def text(root: Element) -> str:
    """The document as indented text."""
    etree.indent(root, space="  ")
    return etree.tostring(root, encoding="unicode", pretty_print=True)


def find(root: Element, path: str) -> Element:
    """The element at an XPath-like `path`; templates always hold it."""
    element = root.find(path)
    if element is None:
        raise EngineError(f"template element {path} is missing; reinstall beamchain.")
    return element


def joint_name(name: str, hinge: int, port: str) -> str:
    """Name of the joint of hinge 1, 2, ... in a port."""
    return f"{name}_hinge{hinge}_{port}"


def _check(chain: Chain) -> None:
    if len(chain.links) >= DEEPEST:
        raise EngineError(
            f"{len(chain.links)} links and the body that carries them are more than the {DEEPEST} nested bodies one MJCF "
            f"file can hold; use at most {DEEPEST - 1} links (fit.links; a recipe's hinge at the root takes one more)."
        )
    for i, link in enumerate(chain.links):
        if i == 0:
            continue  # welded to its carrier, which has mass of its own
        a, b, c = sorted(np.linalg.eigvalsh(link.inertia_matrix()).tolist() if any(link.products) else link.inertia)
        least = min(link.mass, a)
        if least < SMALLEST:
            raise EngineError(
                f"link {i + 1} would have mass {link.mass:.3g} kg and smallest inertia {a:.3g} kg m^2; MuJoCo takes "
                f"nothing below {SMALLEST:g}. {UNITS}"
            )
        if a + b < c * (1.0 - (ROUNDED if any(link.products) else 0.0)):
            raise EngineError(
                f"link {i + 1} would have inertias {a:.6g}, {b:.6g}, {c:.6g} kg m^2, which no body has (largest above "
                "the sum of the others); use fewer links."
            )


def check_hub(mass: float, inertia: ArrayLike) -> None:
    """A hub that MuJoCo takes.

    Args:
        mass: [kg].
        inertia: `(3, 3)` about its centre [kg m^2].

    Raises:
        EngineError: it is below mjMINVAL.
    """
    smallest = float(np.linalg.eigvalsh(np.asarray(inertia, dtype=np.float64))[0])
    if min(mass, smallest) < SMALLEST:
        raise EngineError(
            f"the hub has mass {mass:.3g} kg and smallest inertia {smallest:.3g} kg m^2; MuJoCo takes nothing below "
            f"{SMALLEST:g}. {UNITS}"
        )


def appendage(
    chain: Chain,
    name: str,
    *,
    beam: MassLine | None = None,
    visuals: bool = True,
    sites: Mapping[str, float] | None = None,
    contacts: bool = False,
    readings: "Readings | None" = None,
) -> Element:
    """The drop-in file: nested link bodies from the root outwards, frame of the root: x along the appendage.

    Args:
        chain: what to write.
        name: prefix of every body, joint, site and geom.
        beam: gives the links' look and depth; none: a thin bar.
        visuals: write massless, collision-free geoms.
        sites: x of points that get a site, by name; the tip where left out.
        contacts: write massless capsules that touch other things, never each other or what carries the appendage.
        readings: sensors to write.

    Raises:
        EngineError: MuJoCo would refuse the chain (too deep, masses below mjMINVAL).
    """
    _check(chain)
    places = {"tip": chain.length} if sites is None else sites
    root = template("appendage")
    root.set("model", name)
    world = find(root, "worldbody")
    prototype = find(world, "body")
    world.remove(prototype)
    parent, origin = world, 0.0
    for i, link in enumerate(chain.links):
        body = deepcopy(prototype)
        hinge = chain.hinges[i - 1] if i else None
        x = hinge.x if hinge else 0.0
        body.set("name", f"{name}_link{i + 1}")
        body.set("pos", number([x - origin, 0.0, 0.0]))
        _joints(body, name, i, hinge)
        _inertial(find(body, "inertial"), link, x)
        _shapes(body, name, i, link, x, beam, chain.length, "capsule" if contacts else "drawn" if visuals else None)
        end = np.inf if i == len(chain.links) - 1 else chain.hinges[i].x
        prototype_site = find(body, "site")
        body.remove(prototype_site)
        here = {"root": 0.0} if i == 0 else {}
        for site, at in (here | {n: at for n, at in places.items() if x < at <= end}).items():
            element = deepcopy(prototype_site)
            element.set("name", f"{name}_{site}")
            element.set("pos", number([at - x, 0.0, 0.0]))
            body.append(element)
        parent.append(body)
        parent, origin = body, x
    _tendons(root, name, chain)
    if readings is not None:
        _sensors(root, name, chain, readings)
    return root


def _joints(body: Element, name: str, index: int, hinge: Hinge | None) -> None:
    prototype = find(body, "joint")
    place = body.index(prototype)
    body.remove(prototype)
    if hinge is None:
        return
    for port in PORTS:
        if port not in hinge.stiffness:
            continue
        joint = deepcopy(prototype)
        kind, axis = JOINTS[port]
        joint.set("name", joint_name(name, index, port))
        joint.set("type", kind)
        joint.set("axis", axis)
        joint.set("stiffness", number(hinge.stiffness[port]))
        joint.set("damping", number(hinge.damping.get(port, 0.0)))
        body.insert(place, joint)
        place += 1


def _inertial(element: Element, link: Link, x: float) -> None:
    element.set("pos", number([link.com - x, *link.beside]))
    if any(link.products) or any(link.beside):
        values, axes = np.linalg.eigh(link.inertia_matrix())
        values[2] = min(values[2], (1.0 - ROUNDED) * (values[0] + values[1]))
        turn = Rotation.from_matrix(axes * np.array([1.0, 1.0, np.sign(np.linalg.det(axes))]))
        element.set("quat", number(turn.as_quat(scalar_first=True)))
        element.set("mass", number(link.mass))
        element.set("diaginertia", number(values))
        return
    if 0.0 < abs(link.com - x) < UNSEEN:
        element.set("quat", "0 1 0 0")  # a half turn, which changes no inertia, has MuJoCo look at the offset
    element.set("mass", number(link.mass))
    element.set("diaginertia", number(link.inertia))


def _shapes(
    body: Element, name: str, index: int, link: Link, x: float, beam: MassLine | None, length: float, kind: str | None
) -> None:
    prototype = find(body, "geom")
    place = body.index(prototype)
    body.remove(prototype)
    drawn = [] if kind is None else visuals.shapes(link, beam, length)
    if kind == "capsule" and link.length > 0.0:
        half = max(max(shape.half[1:]) for shape in drawn)
        drawn = [visuals.Shape(kind, link.start + link.length / 2.0, (link.length / 2.0, half, half), visuals.TUBE)]
    for number_of, shape in enumerate(drawn, 1):
        geom = deepcopy(prototype)
        geom.set("name", f"{name}_shape{index + 1}" + ("" if number_of == 1 else f"_{number_of}"))
        geom.set("pos", number([shape.middle - x, 0.0, 0.0]))
        geom.set("type", shape.kind)
        geom.set("rgba", shape.rgba)
        along, *across = shape.half
        if shape.kind == "box":
            geom.set("size", number(shape.half))
        elif shape.kind == "cylinder":
            geom.set("size", number([max(across), along]))
            geom.set("quat", ALONG_X)
        else:
            radius = min(max(across), along)
            geom.set("size", number([radius, max(along - radius, 1e-6 * length)]))
            geom.set("quat", ALONG_X)
            geom.set("conaffinity", "1")  # meets what has contype 1, and with contype 0 never another link
        body.insert(place, geom)
        place += 1


class Readings(NamedTuple):
    """Sensors on an appendage.

    Args:
        modes: amplitude and rate of every modal tendon.
        points: sites whose place is read, seen from the root.
        root_load: force and moment that the appendage puts on what carries it.
    """

    modes: bool = False
    points: Sequence[str] = ()
    root_load: bool = False


def _tendons(root: Element, name: str, chain: Chain) -> None:
    if not chain.tendons:
        return
    tendon = etree.SubElement(root, "tendon")
    for item in chain.tendons:
        fixed = etree.SubElement(
            tendon, "fixed", name=f"{name}_{item.label}", stiffness=number(item.stiffness),
            damping=number(item.damping), armature=number(item.armature), limited="false",
            solimplimit=UNMARKED,
        )  # fmt: skip
        for (hinge, port), coefficient in zip(item.freedoms, item.coefficients, strict=True):
            etree.SubElement(fixed, "joint", joint=joint_name(name, hinge + 1, port), coef=number(coefficient))


def _sensors(root: Element, name: str, chain: Chain, readings: Readings) -> None:
    sensor = etree.SubElement(root, "sensor")
    for item in chain.tendons if readings.modes else ():
        if item.is_mode:
            tendon = f"{name}_{item.label}"
            etree.SubElement(sensor, "tendonpos", name=f"{tendon}_amplitude", tendon=tendon)
            etree.SubElement(sensor, "tendonvel", name=f"{tendon}_rate", tendon=tendon)
    for point in readings.points:
        seen = {"objtype": "site", "objname": f"{name}_{point}", "reftype": "site", "refname": f"{name}_root"}
        etree.SubElement(sensor, "framepos", seen, name=f"{name}_{point}_place")
        etree.SubElement(sensor, "framequat", seen, name=f"{name}_{point}_turn")
    if readings.root_load:
        etree.SubElement(sensor, "force", name=f"{name}_root_force", site=f"{name}_root")
        etree.SubElement(sensor, "torque", name=f"{name}_root_moment", site=f"{name}_root")
    if not len(sensor):
        root.remove(sensor)


def hang(appendage_root: Element, host_root: Element, body: Element) -> None:
    """Put the appendage's bodies below `body` of `host_root`, its tendons and sensors beside the host's."""
    for child in find(appendage_root, "worldbody"):
        body.append(deepcopy(child))
    for tag in ("tendon", "sensor"):
        own = appendage_root.find(tag)
        if own is None:
            continue
        host = host_root.find(tag)
        if host is None:
            host = etree.SubElement(host_root, tag)
        for child in own:
            host.append(deepcopy(child))


def bench(appendage_root: Element, ports: Iterable[str], timestep: float, ballast: Array | None = None) -> Element:
    """The appendage with its root on slides and hinges, one motor each.

    Args:
        appendage_root: from `appendage`.
        ports: which ports are free; all other root motions are held.
        timestep: [s].
        ballast: `(4,)` mass [kg] and principal inertias [kg m^2] added at the root, where the chain itself leaves the
            root massless (a hinge at the root).
    """
    root = template("bench")
    find(root, "option").set("timestep", number(timestep))
    body = find(root, "worldbody/body")
    kept = {joint for port in ports for joint in ROOT_JOINTS[port]}
    for path in ("worldbody/body/joint", "actuator/motor", "sensor/jointpos"):
        for element in root.findall(path):
            if (element.get("joint") or element.get("name")) not in kept:
                parent = element.getparent()
                assert parent is not None
                parent.remove(element)
    inertial = find(body, "inertial")
    if ballast is None:
        body.remove(inertial)
    else:
        inertial.set("mass", number(ballast[0]))
        inertial.set("diaginertia", number(ballast[1:]))
    hang(appendage_root, root, body)
    return root


def scene(
    appendage_root: Element,
    name: str,
    *,
    mass: float,
    inertia: ArrayLike,
    offset: ArrayLike,
    timestep: float,
    integrator: str,
    contacts: bool = False,
) -> Element:
    """A free-flying hub with the appendage on its `mount`, ready to simulate.

    Args:
        appendage_root: from `appendage`.
        name: of the appendage.
        mass: of the hub [kg].
        inertia: `(3,)` or `(3, 3)` of the hub about its centre [kg m^2].
        offset: `(3,)` from the hub's centre to the root [m].
        timestep: [s].
        integrator: MuJoCo's name.
        contacts: leave contacts and constraints on.
    """
    root = template("scene")
    root.set("model", f"{name}_scene")
    option = find(root, "option")
    if contacts:
        option.remove(find(option, "flag"))
    option.set("timestep", number(timestep))
    option.set("integrator", integrator)
    hub = find(template("hub"), "worldbody/body")
    inertial = find(hub, "inertial")
    inertial.set("mass", number(mass))
    inertia = np.asarray(inertia, dtype=np.float64)
    inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
    if np.any(inertia != np.diag(np.diag(inertia))):
        del inertial.attrib["diaginertia"]
        inertial.set("fullinertia", number([*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]))
    else:
        inertial.set("diaginertia", number(np.diag(inertia)))
    offset = np.asarray(offset, dtype=np.float64)
    # a box of that mass and those inertias where one exists, else one that reaches the root
    ix, iy, iz = np.diag(inertia)
    squares = 6.0 / mass * np.array([iy + iz - ix, ix + iz - iy, ix + iy - iz])
    half = np.sqrt(np.clip(squares, 1e-6 * float(squares.max()), None)) / 2.0
    find(hub, "geom").set("size", number(half))
    mount = find(hub, "site")
    mount.set("pos", number(offset))
    find(root, "worldbody").append(hub)
    hang(appendage_root, root, hub)
    link = find(hub, "body")
    link.set("pos", number(offset))
    return root
