"""What the ports of appendages carry: bodies of the spacecraft, and other appendages.

In the rigid file a carried body stands where it is at rest, as a child of the body that holds the
appendage's place. Its motion is that of the rigid file, and on top of it what the modes of the
appendage move the port:

    u_port = X_p u_root + sum_k tau_k eta_k

Theory: docs/theory.md, section 9.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from beamchain.checks import list_of_names, of_type
from beamchain.engine.library import hangs_on, mujoco, rest
from beamchain.engine.linear import PortLoads
from beamchain.engine.mount import Mount
from beamchain.engine.operating_point import base_body
from beamchain.errors import InputError
from beamchain.fitting.spec import Spec
from beamchain.mjcf.craft import Craft
from beamchain.mjcf.place import Target
from beamchain.ports.motions import Array, offset_matrix
from beamchain.warning_codes import Caution

THERE = 1e-3  # of an appendage's length: so near stands a body that is meant to hang there
OUT = 0.25  # of it: so far out stands the mass of a link, not of its drive
APART = 0.02  # of it: so far stands one that hangs on a bracket

Carries = Mapping[str, tuple[str, ...]]  # names of bodies by port


class Load(NamedTuple):
    """What moves with a port of an appendage.

    Args:
        x: place of the port [m].
        bodies: of the bare spacecraft, those that they carry included.
        places: of appendages.
    """

    x: float
    bodies: tuple[int, ...]
    places: tuple[str, ...]


class Item(NamedTuple):
    """An appendage as its loads are looked for: the body of the bare craft that holds its place,
    its specification, and the bodies on its ports."""

    body: int
    spec: Spec
    carries: Carries


def split_port(at: str, places: Sequence[str] | Mapping[str, object]) -> tuple[str, str] | None:
    """Place and port of an appendage right on another's port, `shoulder:end`; None for one that
    stands on the spacecraft."""
    place, colon, port = at.rpartition(":")
    return (place, port) if colon and place in places else None


def base_place(at: str, places: Sequence[str] | Mapping[str, object]) -> str:
    """The place on the spacecraft of an appendage that may stand on another's port."""
    while (on_port := split_port(at, places)) is not None:
        at = on_port[0]
    return at


def port_x(at: str, spec: Spec, port: str) -> float:
    """x of a port [m]."""
    if spec.imported is not None and port in spec.imported.ports:
        raise InputError(
            f"the port {port!r} of the appendage at {at} is free in its modes, but its chain is "
            "exact at the root alone, so that it carries nothing; carry with a beam, or put what "
            "it carries into the finite-element model."
        )
    if spec.slosh is not None:
        raise InputError(
            f"the appendage at {at} is the liquid in a tank, which carries nothing; hang the body "
            "on the spacecraft."
        )
    if spec.imported is not None:
        raise InputError(
            f"the appendage at {at} is imported modes, which carry nothing; carry with a beam, "
            "or put what it carries into the finite-element model."
        )
    if port not in spec.further:
        known = ", ".join(spec.further) or "none"
        cure = (
            "set scene.tip = true or give it a [[port]] there"
            if port == "tip"
            else f'add [[port]] name = "{port}"'
        )
        raise InputError(
            f"the appendage {spec.name!r} at {at} has no port {port!r}; it has: {known}; {cure}."
        )
    return spec.further[port]


def carries_of(place: str, spec: Spec, carry: Mapping[str, tuple[str, ...]]) -> Carries:
    """Bodies by port of the appendage at a place: those of the specification, and those of
    `carry` (bodies by `PLACE:PORT`), which replace them."""
    own = {port.name: port.carries for port in spec.port if port.carries}
    given = {
        port: bodies
        for key, bodies in carry.items()
        for at, _, port in [key.rpartition(":")]
        if at == place
    }
    for port in given:
        port_x(place, spec, port)
    return {**own, **given}


def checked_carry(carry: object) -> dict[str, tuple[str, ...]]:
    """Bodies by `PLACE:PORT`, as `embed` takes them."""
    if carry is None:
        return {}
    wanted = 'bodies by port: {"shoulder:end": ["elbow"]}'
    of_type("carry", carry, Mapping, wanted)
    assert isinstance(carry, Mapping)
    out: dict[str, tuple[str, ...]] = {}
    for key, bodies in carry.items():
        of_type("a port in carry", key, str, 'PLACE:PORT, for example "shoulder:end"')
        if not key.rpartition(":")[0]:
            raise InputError(
                f"carry: {key!r} names no port; write PLACE:PORT, for example 'shoulder:end'."
            )
        names = [bodies] if isinstance(bodies, str) else list_of_names(f"carry[{key!r}]", bodies)
        out[str(key)] = tuple(names)
    return out


def hanging_notes(model: "mujoco.MjModel", mount: Mount, item: Item) -> Iterator[str]:
    """Warnings about bodies of the bare spacecraft that stand where an appendage ends and do not
    hang there, and about those that hang across a gap."""
    at, spec = mount.at, item.spec
    if not spec.is_beam:
        return
    data = rest(model)
    length = spec.beam.length
    yield from _link_notes(model, mount, length, np.array(data.xipos[mount.body]))
    points = {**spec.further, **({} if length in spec.further.values() else {"": length})}
    carried = {name: port for port, names in item.carries.items() for name in names}
    beside = [
        (name, np.array(data.xpos[body]))
        for body in np.flatnonzero(np.array(model.body_parentid) == mount.body)
        for name in [str(model.body(body).name)]
        if name and np.any(mount.origin != data.xpos[body])
    ]
    for port, x in points.items():
        end = mount.origin + x * mount.axes[:, 0]
        for name, place in beside:
            gap = float(np.linalg.norm(place - end))
            if name not in carried and gap < THERE * length:
                where = f"port {port!r}" if port else "the end"
                cure = (
                    f'carries = ["{name}"]'
                    if port
                    else (f'[[port]] name = "end", x = {x:g}, carries = ["{name}"]')
                )
                yield Caution(
                    "not-carried",
                    f"{at}: body {name!r} stands at {where} of the appendage and does not hang on "
                    f"it, so that it stays rigidly where it is: write {cure}, if the appendage is "
                    "meant to carry it.",
                )
            elif carried.get(name) == port and _is_aside(mount, place):
                yield Caution("points-inward", _aside_words(at, name, mount, place))
            elif carried.get(name) == port and gap > APART * length:
                along = float((place - mount.origin) @ mount.axes[:, 0])
                cure = (
                    f" If none is meant, give the port the x of the body ({along:.6g} m), and the "
                    "appendage that length."
                )
                yield Caution(
                    "carried-apart",
                    f"{at}: body {name!r} stands {gap:.3g} m from port {port!r}, which carries it; "
                    f"the gap is rigid.{cure if abs(along - x) > THERE * length else ''}",
                )


def _link_notes(
    model: "mujoco.MjModel", mount: Mount, length: float, centre: Array
) -> Iterator[str]:
    """A warning where the body that holds the place, which turns on a joint of its own, has its
    centre of mass well out along the appendage: it is the link that the appendage replaces."""
    body = mount.body
    x, *across = (centre - mount.origin) @ mount.axes
    is_drive = model.body_dofnum[body] > 0 and base_body(model, body) != body
    if is_drive and OUT * length < x < length and np.hypot(*across) < OUT * length:
        yield Caution(
            "counted-twice",
            f"{mount.at}: body {model.body(body).name!r} has {float(model.body_mass[body]):.4g} kg "
            f"whose centre stands at x = {x:.3g} m of the appendage: if that is the link itself, "
            "it counts twice; take its geoms or their mass out.",
        )


def _is_aside(mount: Mount, place: Array) -> bool:
    """Whether a carried body stands behind the root, or more beside the appendage than along it."""
    x, *across = (place - mount.origin) @ mount.axes
    return bool(x < np.hypot(*across))


def _aside_words(at: str, name: str, mount: Mount, place: Array) -> str:
    """Where a carried body stands that is not on the way of its appendage, and the cure."""
    x, y, z = np.round((place - mount.origin) @ mount.axes, 6) + 0.0
    where = "behind" if x < 0.0 else "beside"
    return (
        f"{at}: body {name!r}, which the appendage carries, stands {where} it, at ({x:.3g}, "
        f"{y:.3g}, {z:.3g}) m in its axes, and the appendage runs along x: put it on a site whose "
        "x axis points to the body."
    )


def check_carries(
    craft: Craft, targets: Mapping[str, Target], carries: Mapping[str, Carries]
) -> None:
    """Every carried body is in the document, hangs on the body that holds the place, and is
    carried once."""
    carrier: dict[str, str] = {}
    for at, ports in carries.items():
        for port, names in ports.items():
            for name in names:
                where = f"{at}:{port}={name}"
                _check_body(craft, where, name, targets[at])
                if name in carrier:
                    raise InputError(
                        f"carry {where}: {carrier[name]} carries body {name!r} already; a body "
                        "hangs on one port."
                    )
                carrier[name] = f"{at}:{port}"


def _check_body(craft: Craft, where: str, name: str, target: Target) -> None:
    found = [node for node in craft.root.iter("body") if node.get("name") == name]
    if not found:
        known = ", ".join(str(node.get("name")) for node in target.body.findall("body"))
        raise InputError(
            f"carry {where}: {craft.label} has no body {name!r} that is written out; on the body "
            f"of {target.at!r} hang: {known or 'none'}."
        )
    body = found[0]
    is_free = body.find("freejoint") is not None or any(
        joint.get("type") == "free" for joint in body.findall("joint")
    )
    if is_free:
        raise InputError(
            f"carry {where}: body {name!r} has a free joint, so nothing carries it; take the joint "
            "out and write the body inside the one that holds the place."
        )
    if body is target.body or body in list(target.body.iterancestors()):
        raise InputError(
            f"carry {where}: body {name!r} holds the place {target.at!r} itself, which would close "
            "a loop; name a body that hangs on it."
        )
    if body.getparent() is not target.body:
        raise InputError(
            f"carry {where}: body {name!r} does not hang directly on body "
            f"{target.body.get('name') or 'without a name'!r}, which holds the place; write it "
            "there, where it is at rest."
        )


def loads_of(craft: "mujoco.MjModel", items: Mapping[str, Item]) -> dict[str, tuple[Load, ...]]:
    """What every port of every appendage carries, by place; `craft`: the bare spacecraft."""
    out: dict[str, tuple[Load, ...]] = {}
    for at, item in items.items():
        out[at] = tuple(
            load
            for port in item.spec.further
            for load in [_load(craft, items, at, port)]
            if load.bodies or load.places
        )
    return out


def _load(craft: "mujoco.MjModel", items: Mapping[str, Item], at: str, port: str) -> Load:
    bodies = set(_bodies_on(craft, items, at, port))
    places = [name for name, item in items.items() if item.body in bodies]
    on_port = [name for name in items if split_port(name, items) == (at, port)]
    while on_port:
        name = on_port.pop()
        places.append(name)
        for further in items[name].spec.further:
            more = set(_bodies_on(craft, items, name, further))
            bodies |= more
            places += [p for p, item in items.items() if item.body in more]
            on_port += [p for p in items if split_port(p, items) == (name, further)]
    known = tuple(dict.fromkeys(places))
    return Load(items[at].spec.further[port], tuple(sorted(bodies)), known)


def _bodies_on(
    craft: "mujoco.MjModel", items: Mapping[str, Item], at: str, port: str
) -> Iterator[int]:
    """Bodies of the spacecraft that a port carries directly, and what hangs on them."""
    for name in items[at].carries.get(port, ()):
        top = int(craft.body(name).id)
        yield from (i for i in range(craft.nbody) if hangs_on(craft, i, top))


class Root(NamedTuple):
    """The root of an appendage at a pose, in the world: `origin` `(3,)`, `axes` `(3, 3)` in
    columns, `motion` `(6, nv)` in those axes; and what its ports carry."""

    at: str
    origin: Array
    axes: Array
    motion: Array
    loads: tuple[Load, ...]


def carrying_of(
    craft: "mujoco.MjModel", data: "mujoco.MjData", roots: Sequence[Root]
) -> PortLoads | None:
    """What the ports of appendages carry at a pose; None where they carry nothing."""
    ports = [(i, load) for i, root in enumerate(roots) for load in root.loads]
    if not ports:
        return None
    size = craft.nv + 6 * len(ports)
    number = {root.at: i for i, root in enumerate(roots)}
    motions = [np.hstack([root.motion, np.zeros((6, 6 * len(ports)))]) for root in roots]
    bodies: dict[int, Array] = {}
    for row, (i, load) in enumerate(ports):
        columns = slice(craft.nv + 6 * row, craft.nv + 6 * row + 6)
        point = roots[i].origin + roots[i].axes[:, 0] * load.x
        turn = np.kron(np.eye(2), roots[i].axes)
        for place in load.places:
            if place in number:
                there = roots[number[place]]
                back = np.kron(np.eye(2), there.axes.T)
                motion = back @ offset_matrix(there.origin - point) @ turn
                motions[number[place]][:, columns] += motion
        for body in load.bodies:
            motion = bodies.setdefault(body, np.zeros((6, size)))
            motion[:, columns] += offset_matrix(data.xipos[body] - point) @ turn
    mass = np.zeros((size, size))
    for body, by_ports in bodies.items():
        translation = np.zeros((3, craft.nv))
        rotation = np.zeros((3, craft.nv))
        mujoco.mj_jacBodyCom(craft, data, translation, rotation, body)
        own = np.vstack([translation, rotation])
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(craft.body_inertia[body]) @ axes.T
        weight = block_diag(float(craft.body_mass[body]) * np.eye(3), inertia)
        mass[: craft.nv] += own.T @ weight @ by_ports
        mass[:, : craft.nv] += by_ports.T @ weight @ own
        mass += by_ports.T @ weight @ by_ports
    points = tuple((i, load.x) for i, load in ports)
    return PortLoads(tuple(motions), mass, points)
