"""Chain -> MJCF: lxml fills the templates of `mjcf_templates/`."""

import re
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
from beamchain.mjcf.skin import Skin
from beamchain.mjcf.visuals import CARRIED, TRUSS, TUBE, Shape, link_shapes
from beamchain.ports.motions import UPRIGHT, Array, Quaternion
from beamchain.structure.beam import Beam

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

# turns the axis of a capsule or cylinder from z to x
ALONG_X = "0.7071067811865476 0.0 0.7071067811865475 0.0"
# MuJoCo's own; a tendon made exact in time carries its step there (steps.modal)
UNMARKED = "0.9 0.95 0.001 0.5 2"
SMALLEST = 1e-15  # mjMINVAL: mass and principal inertia of a moving body
UNITS = (
    "Write the spec in smaller units: in millimetres and grams the modulus keeps its number, "
    "density is divided by 1e6, masses multiplied by 1e3 and inertias by 1e9."
)
# relative deficit of the triangle inequality that turning to principal axes may leave
ROUNDED = 1e-13
# [m]: where nothing is turned, MuJoCo takes a mass centre this near to the body's origin for it
UNSEEN = 1.1e-6
DEEPEST = 496  # bodies nested in one MJCF file
HINGE = re.compile(r"(.+)_hinge\d+_(xy|xz|torsion|axial)$")  # name of a chain's joint


def number(values: float | ArrayLike) -> str:
    """17 digits, so that what MuJoCo reads is what was computed."""
    flat = np.atleast_1d(np.asarray(values, dtype=np.float64))
    return " ".join(repr(float(v)).removesuffix(".0") for v in flat)


def short_numbers(values: ArrayLike) -> str:
    """6 digits, of what is only drawn."""
    return " ".join(f"{value:.6g}" for value in np.ravel(np.asarray(values)))


def template(name: str) -> Element:
    """The root element of `mjcf_templates/NAME.xml`."""
    parser = etree.XMLParser(
        remove_blank_text=True, remove_comments=True, resolve_entities=False, no_network=True
    )
    return etree.parse(str(TEMPLATES / f"{name}.xml"), parser).getroot()


def document_text(root: Element) -> str:
    """The document as indented text."""
    etree.indent(root, space="  ")
    return etree.tostring(root, encoding="unicode", pretty_print=True)


def find(root: Element, path: str) -> Element:
    """The element at an XPath-like `path`; templates always hold it."""
    element = root.find(path)
    if element is None:
        raise EngineError(f"template element {path} is missing; reinstall beamchain.")
    return element


def set_attributes(element: Element, **attributes: "str | float | ArrayLike") -> Element:
    """The element itself, with attributes set: text as it is, numbers by `number`."""
    for name, value in attributes.items():
        element.set(name, value if isinstance(value, str) else number(value))
    return element


def joint_name(name: str, hinge: int, port: str) -> str:
    """Name of the joint of hinge 1, 2, ... in a port; `HINGE` matches it."""
    return f"{name}_hinge{hinge}_{port}"


def _check_links(chain: Chain) -> None:
    """Refuse links that MuJoCo would refuse."""
    if len(chain.links) >= DEEPEST:
        raise EngineError(
            f"{len(chain.links)} links and the body that carries them are more than the {DEEPEST} "
            f"nested bodies one MJCF file can hold; use at most {DEEPEST - 1} links: give fewer "
            "fit.cuts."
        )
    # the first is welded to its carrier, which has mass of its own
    for count, link in enumerate(chain.links[1:], start=2):
        turned = any(link.products)
        principal = list(link.inertia)
        if turned:
            principal = np.linalg.eigvalsh(link.inertia_matrix()).tolist()
        a, b, c = sorted(principal)
        if min(link.mass, a) < SMALLEST:
            raise EngineError(
                f"link {count} would have mass {link.mass:.3g} kg and smallest inertia {a:.3g} kg "
                f"m^2; MuJoCo takes nothing below {SMALLEST:g}. {UNITS}"
            )
        if a + b < c * (1.0 - (ROUNDED if turned else 0.0)):
            raise EngineError(
                f"link {count} would have inertias {a:.6g}, {b:.6g}, {c:.6g} kg m^2, which no body "
                "has (largest above the sum of the others); use fewer links."
            )


def check_hub(mass: float, inertia: ArrayLike) -> None:
    """Raise `EngineError` for a hub, mass [kg] and `(3, 3)` inertia about its centre [kg m^2],
    that MuJoCo refuses."""
    smallest = float(np.linalg.eigvalsh(np.asarray(inertia, dtype=np.float64))[0])
    if min(mass, smallest) < SMALLEST:
        raise EngineError(
            f"the hub has mass {mass:.3g} kg and smallest inertia {smallest:.3g} kg m^2; MuJoCo "
            f"takes nothing below {SMALLEST:g}. {UNITS}"
        )


def appendage_document(
    chain: Chain,
    name: str,
    *,
    beam: Beam | None = None,
    visuals: bool = True,
    skins: Sequence[Skin] = (),
    sites: Mapping[str, float] | None = None,
    contacts: bool = False,
    readings: "Readings | None" = None,
    shapes: Sequence[list[Shape]] | None = None,
) -> Element:
    """The drop-in file: link bodies, nested from the root outwards; x points along the appendage.

    Geoms have no mass: `visuals` looks like the `beam`, a thin bar without it, or is what `skins`
    leave to be drawn; `contacts` in place of them are capsules that touch other things, never each
    other or what carries the appendage.
    `sites`: x by name; the tip where left out. `shapes`: what is drawn of each link, in place of
    what follows from the `beam`.
    """
    _check_links(chain)
    places = {"tip": chain.length} if sites is None else sites
    root = template("appendage")
    root.set("model", name)
    world = find(root, "worldbody")
    prototype = find(world, "body")
    world.remove(prototype)
    bodies: list[Element] = []
    origins: list[float] = []
    for i, link in enumerate(chain.links):
        body = deepcopy(prototype)
        hinge = chain.hinges[i - 1] if i else None
        x = hinge.x if hinge else 0.0
        carrier = chain.carrier(i) if i else -1
        origin = origins[carrier] if i else 0.0
        set_attributes(body, name=f"{name}_link{i + 1}", pos=[x - origin, 0.0, 0.0])
        _add_joints(body, name, index=i, hinge=hinge)
        _set_inertial(find(body, "inertial"), link, x)
        drawn = (
            _drawn_shapes(link, beam, chain.length, contacts=contacts, visuals=visuals)
            if shapes is None
            else shapes[i] * visuals
        )
        if skins:
            drawn = [shape for shape in drawn if shape.rgba == CARRIED]
        _add_geoms(body, f"{name}_shape{i + 1}", drawn, x=x, length=chain.length)
        end = np.inf if i == len(chain.links) - 1 else chain.hinges[i].x
        points = {"root": 0.0} if i == 0 else {}
        points |= {point: place for point, place in places.items() if x < place <= end}
        site_prototype = find(body, "site")
        body.remove(site_prototype)
        for point, place in points.items():
            site = deepcopy(site_prototype)
            set_attributes(site, name=f"{name}_{point}", pos=[place - x, 0.0, 0.0])
            body.append(site)
        (bodies[carrier] if i else world).append(body)
        bodies.append(body)
        origins.append(x)
    _add_tendons(root, name, chain)
    if readings is not None:
        _add_sensors(root, name, chain=chain, readings=readings)
    _add_skins(root, name, skins)
    return root


def _add_joints(body: Element, name: str, *, index: int, hinge: Hinge | None) -> None:
    """Replace the template's joint by those of the hinge before a link."""
    prototype = find(body, "joint")
    for port, (kind, axis) in JOINTS.items():
        if hinge is not None and port in hinge.stiffness:
            joint = deepcopy(prototype)
            set_attributes(joint, name=joint_name(name, index, port), type=kind, axis=axis)
            damping = hinge.damping.get(port, 0.0)
            set_attributes(joint, stiffness=hinge.stiffness[port], damping=damping)
            prototype.addprevious(joint)
    body.remove(prototype)


def _set_inertial(element: Element, link: Link, x: float) -> None:
    """Mass, centre and principal inertia of a link whose body starts at `x` [m]."""
    inertia: ArrayLike = link.inertia
    set_attributes(element, pos=[link.com - x, *link.beside])
    if any(link.products) or any(link.beside):
        inertia, axes = np.linalg.eigh(link.inertia_matrix())
        inertia[2] = min(inertia[2], (1.0 - ROUNDED) * (inertia[0] + inertia[1]))
        right_handed = axes * np.array([1.0, 1.0, np.sign(np.linalg.det(axes))])
        turn = Rotation.from_matrix(right_handed)
        set_attributes(element, quat=turn.as_quat(scalar_first=True))
    elif 0.0 < abs(link.com - x) < UNSEEN:
        # a half turn, which changes no inertia, has MuJoCo look at the offset
        element.set("quat", "0 1 0 0")
    set_attributes(element, mass=link.mass, diaginertia=inertia)


def _drawn_shapes(
    link: Link, beam: Beam | None, length: float, *, contacts: bool, visuals: bool
) -> list[Shape]:
    """Shapes of a link: one capsule that touches, else what it looks like, else none."""
    if not contacts and not visuals:
        return []
    drawn = link_shapes(link, beam, length)
    if not contacts or link.length <= 0.0:
        return drawn
    radius = max(max(shape.half[1:]) for shape in drawn)
    half = link.length / 2.0
    return [Shape("capsule", middle=link.start + half, half=(half, radius, radius), rgba=TUBE)]


def _add_geoms(
    body: Element, name: str, drawn: Sequence[Shape], *, x: float, length: float
) -> None:
    """Replace the template's geom by those of a link whose body starts at `x` [m]."""
    prototype = find(body, "geom")
    for count, shape in enumerate(drawn, 1):
        geom = deepcopy(prototype)
        set_attributes(
            geom,
            name=name if count == 1 else f"{name}_{count}",
            pos=[shape.middle - x, 0.0, 0.0],
            type=shape.kind,
            rgba=shape.rgba,
        )
        along, *across = shape.half
        if shape.kind == "box":
            set_attributes(geom, size=shape.half)
        elif shape.kind == "sphere":
            set_attributes(geom, size=along)
        elif shape.kind == "cylinder":
            set_attributes(geom, size=[max(across), along], quat=ALONG_X)
        else:
            radius = min(max(across), along)
            half_length = max(along - radius, 1e-6 * length)
            # meets what has contype 1, and with contype 0 never another link
            set_attributes(geom, size=[radius, half_length], quat=ALONG_X, conaffinity="1")
        prototype.addprevious(geom)
    body.remove(prototype)


class Readings(NamedTuple):
    """Sensors on an appendage."""

    modes: bool = False  # amplitude and rate of every modal tendon
    points: Sequence[str] = ()  # sites whose place is read, seen from the root
    root_load: bool = False  # force and moment that the appendage puts on what carries it


def _add_tendons(root: Element, name: str, chain: Chain) -> None:
    if not chain.tendons:
        return
    tendon = etree.SubElement(root, "tendon")
    for item in chain.tendons:
        fixed = etree.SubElement(tendon, "fixed", name=f"{name}_{item.label}")
        set_attributes(
            fixed, stiffness=item.stiffness, damping=item.damping, armature=item.armature
        )
        set_attributes(fixed, limited="false", solimplimit=UNMARKED)
        for (hinge, port), coefficient in zip(item.freedoms, item.coefficients, strict=True):
            etree.SubElement(
                fixed, "joint", joint=joint_name(name, hinge + 1, port), coef=number(coefficient)
            )


def _add_sensors(root: Element, name: str, *, chain: Chain, readings: Readings) -> None:
    sensor = etree.SubElement(root, "sensor")
    for item in chain.tendons if readings.modes else ():
        if item.is_mode:
            tendon = f"{name}_{item.label}"
            etree.SubElement(sensor, "tendonpos", name=f"{tendon}_amplitude", tendon=tendon)
            etree.SubElement(sensor, "tendonvel", name=f"{tendon}_rate", tendon=tendon)
    for point in readings.points:
        frames = {
            "objtype": "site",
            "objname": f"{name}_{point}",
            "reftype": "site",
            "refname": f"{name}_root",
        }
        etree.SubElement(sensor, "framepos", frames, name=f"{name}_{point}_place")
        etree.SubElement(sensor, "framequat", frames, name=f"{name}_{point}_turn")
    if readings.root_load:
        etree.SubElement(sensor, "force", name=f"{name}_root_force", site=f"{name}_root")
        etree.SubElement(sensor, "torque", name=f"{name}_root_moment", site=f"{name}_root")
    if not len(sensor):
        root.remove(sensor)


def _add_skins(root: Element, name: str, skins: Sequence[Skin]) -> None:
    """The surfaces, at the end of the file; the template's material goes where none is a panel."""
    asset = find(root, "asset")
    material = find(asset, "material")
    if not any(skin.surface.look == "panel" for skin in skins):
        root.remove(asset)
    for tag, key in (("texture", "name"), ("material", "name"), ("material", "texture")):
        element = find(asset, tag)
        element.set(key, f"{name}_{element.get(key)}")
    if not skins:
        return
    root.append(etree.Comment(" how it is drawn: may be deleted "))
    deformable = etree.SubElement(root, "deformable")
    for skin in skins:
        look, points, faces, cells = skin.surface
        element = etree.SubElement(deformable, "skin", name=f"{name}_{look}")
        if look == "panel":
            element.set("material", material.get("name") or "")
            element.set("texcoord", short_numbers(cells))
        else:
            element.set("rgba", TRUSS if look == "truss" else TUBE)
        element.set("vertex", short_numbers(points))
        element.set("face", " ".join(map(str, faces.ravel().tolist())))
        for bone, weights in zip(skin.bones, skin.weights.T, strict=True):
            carried = np.flatnonzero(weights)
            if carried.size:
                etree.SubElement(
                    element,
                    "bone",
                    body=f"{name}_link{bone.link + 1}",
                    bindpos=number(bone.bound),
                    bindquat="1 0 0 0",
                    vertid=" ".join(map(str, carried.tolist())),
                    vertweight=short_numbers(weights[carried]),
                )


def turn_root(body: Element, turn: Quaternion) -> None:
    """Set the attitude on its place of an appendage's first body."""
    if turn == UPRIGHT:
        body.attrib.pop("quat", None)
    else:
        set_attributes(body, quat=turn)


def attach_appendage(appendage_root: Element, host_root: Element, body: Element) -> None:
    """Put the appendage's bodies below `body` of `host_root`,
    its tendons, sensors and surfaces beside the host's."""
    body.extend(list(deepcopy(find(appendage_root, "worldbody"))))
    for tag in ("asset", "tendon", "sensor", "deformable"):
        section = appendage_root.find(tag)
        if section is None:
            continue
        host_section = host_root.find(tag)
        if host_section is None:
            host_section = etree.SubElement(host_root, tag)
        host_section.extend(list(deepcopy(section)))


def bench_document(
    appendage_root: Element,
    ports: Iterable[str],
    timestep: float,
    ballast: Array | None = None,
    integrator: str = "implicitfast",
) -> Element:
    """The appendage with its root on slides and hinges, one motor each;
    motions of other ports are held.

    `ballast` `(4,)`: mass [kg] and principal inertias [kg m^2] added at a root that the
    chain leaves massless.
    """
    root = template("bench")
    set_attributes(find(root, "option"), timestep=timestep, integrator=integrator)
    body = find(root, "worldbody/body")
    kept: set[str] = set()
    for port in ports:
        kept |= set(ROOT_JOINTS[port])
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
        set_attributes(inertial, mass=ballast[0], diaginertia=ballast[1:])
    attach_appendage(appendage_root, root, body)
    turn_root(find(body, "body"), UPRIGHT)  # its motions are told in its own axes
    return root


def scene_document(
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

    `inertia` `(3,)` or `(3, 3)` of the hub about its centre [kg m^2]; `offset` `(3,)` from there to
    the root [m], both in the hub's axes; `contacts` leaves contacts and constraints on.
    """
    root = template("scene")
    root.set("model", f"{name}_scene")
    option = find(root, "option")
    if contacts:
        option.remove(find(option, "flag"))
    set_attributes(option, timestep=timestep, integrator=integrator)
    hub = find(template("hub"), "worldbody/body")
    inertial = set_attributes(find(hub, "inertial"), mass=mass)
    inertia = np.asarray(inertia, dtype=np.float64)
    inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
    if np.any(inertia != np.diag(np.diag(inertia))):
        del inertial.attrib["diaginertia"]
        products = [inertia[0, 1], inertia[0, 2], inertia[1, 2]]
        set_attributes(inertial, fullinertia=[*np.diag(inertia), *products])
    else:
        set_attributes(inertial, diaginertia=np.diag(inertia))
    offset = np.asarray(offset, dtype=np.float64)
    # a box of that mass and those inertias where one exists: a^2 = 6 (Iyy + Izz - Ixx) / m
    ix, iy, iz = np.diag(inertia)
    squares = 6.0 / mass * np.array([iy + iz - ix, ix + iz - iy, ix + iy - iz])
    sides = np.sqrt(np.clip(squares, 1e-6 * float(squares.max()), None))
    set_attributes(find(hub, "geom"), size=sides / 2.0)
    set_attributes(find(hub, "site"), pos=offset)
    find(root, "worldbody").append(hub)
    attach_appendage(appendage_root, root, hub)
    set_attributes(find(hub, "body"), pos=offset)
    return root


def add_burn(scene: Element, force: float, along: Array) -> None:
    """Give a scene's hub a thrust [N] along a direction `(3,)` in the axes of its `mount`, which
    the keyframe `burn` switches on."""
    actuator = scene.find("actuator")
    if actuator is None:
        actuator = etree.SubElement(scene, "actuator")
    gear = short_numbers([*along, 0.0, 0.0, 0.0])
    etree.SubElement(actuator, "motor", name="thrust", site="mount", gear=gear)
    keyframe = etree.SubElement(scene, "keyframe")
    set_attributes(etree.SubElement(keyframe, "key", name="burn"), ctrl=force)
