"""Appendages put into a spacecraft's document: inline, or as files that `<attach>` brings in; keyframes extended."""

import re
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from lxml import etree
from lxml.etree import _Element as Element

from beamchain.errors import InputError
from beamchain.mjcf import compatibility, marks, write
from beamchain.mjcf.craft import Craft
from beamchain.mjcf.place import Target
from beamchain.ports.motions import Array

FORMS = ("inline", "attach")


@dataclass(frozen=True, eq=False)
class Insertion:
    """One appendage to put in."""

    target: Target
    position: Array  # (3,) of the root in the target's body [m]
    quaternion: Array  # (4,) its attitude there; x of that frame points outwards
    appendage: Element  # from mjcf.write.appendage
    name: str  # its own, prefix of its elements
    prefix: str  # what replaces `name_` in the spacecraft
    spec: dict[str, Any]  # plain data, kept in the mark


def renamed(appendage: Element, name: str, prefix: str) -> Element:
    """A copy whose elements carry `prefix` instead of `name_`."""
    out = deepcopy(appendage)
    for node in out.iter():
        for key in ("name", "joint"):
            value = node.get(key)
            if value is not None and value.startswith(f"{name}_"):
                node.set(key, prefix + value[len(name) + 1 :])
    return out


def check_prefix(prefix: str) -> None:
    """A prefix makes valid, findable names."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_.-]{0,62}", prefix):
        raise InputError(
            f"prefix = {prefix!r} must start with a letter and hold only letters, digits, _ . - (at most 63); "
            'for example "left_".'
        )


def put_in(craft: Craft, insertions: Sequence[Insertion], form: str, files: Mapping[str, str] | None = None) -> None:
    """Put appendages into a document; `craft` is changed and must be a copy. Keyframes are left to `extend_keys`.

    `files`: for the form "attach", name of each appendage's file by prefix.
    """
    found = compatibility.hostile(craft.parts())
    for item in insertions:
        facts = {"at": item.target.at, "form": form, "prefix": item.prefix, "spec": item.spec}
        frame = {"pos": write.number(item.position), "quat": write.number(item.quaternion)}
        if form == "inline":
            own = renamed(item.appendage, item.name, item.prefix)
            compatibility.shield(own, found)
            body = write.find(own, "worldbody/body")
            _place(body, frame)
            marks.put_last(item.target.body, body, "appendage", **facts)
            for tag in ("tendon", "sensor"):
                section = own.find(tag)
                if section is not None:
                    marks.put_last(craft.root, section, tag, at=item.target.at)
        else:
            assert files is not None
            label = item.prefix + "appendage"
            holder = etree.Element("frame", frame)
            etree.SubElement(holder, "attach", model=label, body="link1", prefix=item.prefix)
            marks.put_last(item.target.body, holder, "appendage", **facts)
            asset = etree.Element("asset")
            etree.SubElement(asset, "model", name=label, file=files[item.prefix])
            marks.put_last(craft.root, asset, "model", at=item.target.at)


def _place(body: Element, frame: dict[str, str]) -> None:
    """Position and attitude right behind the name, as people write them."""
    given = {str(key): str(value) for key, value in body.attrib.items()}
    body.attrib.clear()
    body.attrib.update(
        {"name": given.get("name", "")} | frame | {k: v for k, v in given.items() if k not in ("name", *frame)}
    )


def child_text(item: Insertion) -> str:
    """The file that `<attach>` brings in; its names have no prefix, the `<attach>` gives it."""
    root = renamed(item.appendage, item.name, "")
    root.set("model", item.name)
    return write.text(root)


def keys_to_extend(craft: Craft) -> bool:
    """Whether a keyframe states positions or velocities; an included file that does is put in place."""
    for include in craft.includes():
        if any(key.get("qpos") or key.get("qvel") for key in include.content.iter("key")):
            marks.inline(include.element, include.content)
    return any(key.get("qpos") or key.get("qvel") for key in craft.root.iter("key"))


def extend_keys(craft: Craft, qpos: Sequence[int | None], qvel: Sequence[int | None], rest: Sequence[float]) -> None:
    """Give the keyframes the new joints' rest values; `craft` is changed and must be a copy.

    `qpos`, `qvel`: per new value, which old one it is; None: an appendage's, whose position is that in `rest`.
    """
    for key in list(craft.root.iter("key")):
        changes: dict[str, str] = {}
        for name, places in (("qpos", qpos), ("qvel", qvel)):
            text = key.get(name)
            if text is None:
                continue
            words, wanted = text.split(), sum(place is not None for place in places)
            if len(words) != wanted:
                raise InputError(
                    f"keyframe {key.get('name') or ''!r}: {name} holds {len(words)} numbers, the spacecraft has "
                    f"{wanted}; correct the spacecraft's file."
                )
            changes[name] = " ".join(
                words[place] if place is not None else write.number(rest[i]) if name == "qpos" else "0"
                for i, place in enumerate(places)
            )
        if changes:
            marks.change(key, "key", changes)
