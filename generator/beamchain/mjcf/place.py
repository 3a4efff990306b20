"""Where an appendage goes: the element of the user's document that a name means, and what its frame must be."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from lxml.etree import _Element as Element

from beamchain.checks import meant
from beamchain.errors import InputError
from beamchain.mjcf import marks
from beamchain.mjcf.craft import Craft

UNIT = 1e-6  # a quaternion's norm may be off by its printed digits, an axis pair from the right angle likewise
MADE_OF_OTHERS = ("replicate", "composite", "flexcomp", "attach")


@dataclass(frozen=True, eq=False)
class Target:
    """A named site or body."""

    at: str  # the name as the user gave it
    kind: str  # "site" or "body"
    name: str
    body: Element  # that the appendage's root is put into


def split(at: str) -> tuple[tuple[str, ...], str]:
    """Kinds that `NAME`, `site:NAME` or `body:NAME` may mean, and the bare name."""
    kind, colon, name = at.partition(":")
    return ((kind,), name) if colon and kind in ("site", "body") else (("site", "body"), at)


def find_target(craft: Craft, at: str) -> Target:
    """The element that `at` names; an included file that holds it is put in place first, so `craft` must be a copy."""
    kinds, name = split(at)
    for include in craft.includes():
        if any(_named(include.content, kind, name) for kind in kinds):
            marks.inline(include.element, include.content)
    found = [(kind, node) for kind in kinds for node in _named(craft.root, kind, name)]
    if not found:
        known = sorted({n for part in craft.parts() for node in part.iter("site", "body") if (n := node.get("name"))})
        made = [tag for tag in MADE_OF_OTHERS if any(part.find(f".//{tag}") is not None for part in craft.parts())]
        hint = meant(name, known).strip() or f"its sites and bodies are: {', '.join(known[:30]) or 'none'}."
        if made:
            hint += f" Names made by <{made[0]}> cannot be used; put the site into a body of the file itself."
        raise InputError(f"--at {at}: {craft.label} has no site or body {name!r}; {hint}")
    if len(found) > 1:
        raise InputError(
            f"--at {at}: {craft.label} has more than one {' and '.join(sorted({k for k, _ in found}))} {name!r}; "
            f"write site:{name} or body:{name}, or give the one you mean a name of its own."
        )
    kind, node = found[0]
    body = node
    chain = [node] if kind == "site" else []
    while kind == "site" and body.tag not in ("body", "worldbody"):
        parent = body.getparent()
        assert parent is not None
        body = parent
        if body.tag == "frame":
            chain.append(body)
    for ancestor in [node, *node.iterancestors()]:
        if ancestor.tag in MADE_OF_OTHERS:
            raise InputError(
                f"--at {at}: {kind} {name!r} stands inside <{ancestor.tag}>, which makes several of it; "
                "name a site of a body that is written out."
            )
    if body.tag == "worldbody":
        raise InputError(
            f"--at {at}: site {name!r} belongs to the world, which does not move; put it into the spacecraft's body."
        )
    for element in chain:
        _check_frame(element, at)
    return Target(at, kind, name, body)


def _named(root: Element, kind: str, name: str) -> Iterator[Element]:
    for node in root.iter(kind):
        if node.get("name") == name and not any(up.tag in ("default", "sensor") for up in node.iterancestors()):
            yield node


def _check_frame(element: Element, at: str) -> None:
    """Refuse what MuJoCo would silently put right: a quaternion that is not unit, axes that are not perpendicular."""
    for name, count in (("quat", 4), ("xyaxes", 6), ("zaxis", 3), ("axisangle", 4)):
        text = element.get(name)
        if text is None:
            continue
        try:
            v = [float(word) for word in text.split()]
        except ValueError:
            v = []
        where = f"--at {at}: {element.tag} {element.get('name') or ''!r} has {name} = {text!r}"
        if len(v) != count or not all(math.isfinite(x) for x in v):
            raise InputError(f"{where}, which is not {count} finite numbers; correct it in the spacecraft's file.")
        if name == "quat" and abs(math.hypot(*v) - 1.0) > UNIT:
            raise InputError(
                f"{where} of norm {math.hypot(*v):.9g}, not 1: the frame is in doubt; give a unit quaternion."
            )
        if name in ("zaxis", "axisangle") and math.hypot(*v[:3]) < UNIT:
            raise InputError(f"{where}, an axis of no length; give a direction.")
        if name == "xyaxes":
            x, y = v[:3], v[3:]
            sine = sum(a * b for a, b in zip(x, y, strict=True)) / max(math.hypot(*x) * math.hypot(*y), 1e-300)
            if min(math.hypot(*x), math.hypot(*y)) < UNIT or abs(sine) > UNIT:
                raise InputError(
                    f"{where}, whose axes are not perpendicular (cosine {sine:.3g}): they span no right-handed frame; "
                    "give two perpendicular directions."
                )
