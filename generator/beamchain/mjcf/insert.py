"""Insertion of appendages into a spacecraft's document.

Keyframes are extended by the rest values of the new joints.
"""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lxml.etree import _Element as Element

from beamchain.errors import InputError
from beamchain.mjcf import compatibility, write
from beamchain.mjcf import undo_marks as undo
from beamchain.mjcf.craft import Craft
from beamchain.mjcf.place import Target
from beamchain.mjcf.text import Edit
from beamchain.ports.motions import Array

#: Sections of an appendage's file beside its bodies, in the order in which they are put in.
SECTIONS: Mapping[str, type[undo.SectionMark | undo.SensorMark | undo.LookMark]] = {
    "tendon": undo.SectionMark,
    "sensor": undo.SensorMark,
    "asset": undo.LookMark,
    "deformable": undo.LookMark,
}


@dataclass(frozen=True, eq=False)
class Insertion:
    """One appendage to put in."""

    target: Target
    position: Array  # (3,) of the root in the target's body [m]
    quaternion: Array  # (4,) its attitude there; x of that frame points outwards
    appendage: Element  # from mjcf.write.appendage_document_document
    name: str  # its own, prefix of its elements
    prefix: str  # what replaces `name_` in the spacecraft
    spec: dict[str, Any]  # plain data, kept in the mark
    carries: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # bodies by port


def with_prefix(appendage: Element, name: str, prefix: str) -> Element:
    """A copy whose elements carry `prefix` instead of `name_`."""
    out = deepcopy(appendage)
    for node in out.iter():
        for key, value in node.attrib.items():
            if str(value).startswith(f"{name}_"):
                node.set(key, prefix + str(value)[len(name) + 1 :])
    return out


def insert_appendages(craft: Craft, insertions: Sequence[Insertion]) -> Craft:
    """The document with appendages in it; keyframes are left to `extend_keys`."""
    defaults = compatibility.default_attributes(craft.parts())
    pieces: dict[Element, list[tuple[undo.Put, Element]]] = {}
    at_end: list[tuple[undo.Put, Element]] = []
    for item in insertions:
        at = item.target.at
        mark = undo.AppendageMark(
            at=at, prefix=item.prefix, spec=item.spec, carries=dict(item.carries)
        )
        frame = {"pos": write.number(item.position), "quat": write.number(item.quaternion)}
        tree = with_prefix(item.appendage, item.name, item.prefix)
        compatibility.shield_from_defaults(tree, defaults)
        body = write.find(tree, "worldbody/body")
        _set_frame(body, frame)
        pieces.setdefault(item.target.body, []).append((mark, body))
        for tag, of_section in SECTIONS.items():
            section = tree.find(tag)
            if section is not None:
                at_end.append((of_section(at=at), section))
    if at_end:
        pieces[craft.root] = at_end
    return craft.edit(undo.append_marked(craft, parent, group) for parent, group in pieces.items())


def hang_on_port(craft: Craft, prefix: str, port: str, body: str) -> Craft:
    """The document with a body on a port of the appendage with a prefix, where it was at rest."""
    site = next(node for node in craft.root.iter("site") if node.get("name") == f"{prefix}{port}")
    link = site.getparent()
    assert link is not None
    links = [link, *link.iterancestors("body")]
    root = next(node for node in links if node.get("name") == f"{prefix}link1")
    found = next(node for node in craft.root.iter("body") if node.get("name") == body)
    # from the parent of the root, in which the body stands, to the link: along x of the root
    turn = _numbers(root.get("quat") or "1 0 0 0")
    outer = links[: links.index(root)]
    along = sum((_numbers(node.get("pos") or "0 0 0") for node in outer), np.zeros(3))
    place = _numbers(root.get("pos") or "0 0 0") + _rotated(turn, along)
    back = turn * np.array([1.0, -1.0, -1.0, -1.0])
    frame = {"pos": write.number(-_rotated(back, place)), "quat": write.number(back)}
    styles = [style for node in found.iterancestors() if (style := node.get("childclass"))]
    if styles:
        frame["childclass"] = styles[0]
    return undo.move_body(craft, found, link, frame)


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


def _rotated(quaternion: Array, vector: Array) -> Array:
    w, axis = quaternion[0], quaternion[1:]
    cross = np.cross(axis, vector)
    return np.asarray(vector + 2.0 * (w * cross + np.cross(axis, cross)), dtype=np.float64)


def _set_frame(body: Element, frame: dict[str, str]) -> None:
    """Set position and attitude right behind the name, as people write them."""
    attributes = {str(key): str(value) for key, value in body.attrib.items()}
    name = attributes.pop("name", "")
    others = {key: value for key, value in attributes.items() if key not in frame}
    body.attrib.clear()
    body.attrib.update({"name": name, **frame, **others})


def _has_numbers(key: Element) -> bool:
    return bool(key.get("qpos") or key.get("qvel"))


def place_includes_with_keys(craft: Craft) -> Craft:
    """The document with those included files put in place in which a keyframe states
    positions or velocities."""
    edits: list[Edit] = []
    for include in craft.includes:
        if any(_has_numbers(key) for key in include.content.root.iter("key")):
            edits.append(undo.replace_include(craft, include))
    return craft.edit(edits)


def extend_keys(
    craft: Craft, qpos: Sequence[int | None], qvel: Sequence[int | None], rest: Sequence[float]
) -> Craft:
    """The document with the new joints' rest values in its keyframes.

    `qpos`, `qvel`: per new value, which old one it is; None: an appendage's. Its position, and that
    of old ones that a short keyframe leaves out, is that in `rest`, as MuJoCo pads it; velocities
    are zero.
    """
    new_values = {"qpos": [write.number(value) for value in rest], "qvel": ["0"] * len(qvel)}
    edits: list[Edit] = []
    for key in craft.root.iter("key"):
        changes: dict[str, str] = {}
        for name, places in (("qpos", qpos), ("qvel", qvel)):
            text = key.get(name)
            if text is None:
                continue
            words = text.split()
            count = sum(place is not None for place in places)
            if len(words) > count:
                raise InputError(
                    f"keyframe {key.get('name') or ''!r}: {name} holds {len(words)} numbers, the "
                    f"spacecraft has {count}; correct the spacecraft's file."
                )
            new_words = [
                words[place] if place is not None and place < len(words) else new_values[name][i]
                for i, place in enumerate(places)
            ]
            changes[name] = " ".join(new_words)
        if changes:
            edits.append(undo.change_marked(craft, key, undo.KeyMark, changes))
    return craft.edit(edits)
