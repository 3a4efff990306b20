"""Where an appendage goes: the element of the user's document that a name stands for."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from lxml.etree import _Element as Element

from beamchain.checks import meant
from beamchain.errors import InputError
from beamchain.mjcf import undo_marks as undo
from beamchain.mjcf.craft import Craft
from beamchain.mjcf.text import Edit

# a quaternion's norm may be off by its printed digits, an axis pair from the right angle likewise
UNIT = 1e-6
MADE_OF_OTHERS = ("replicate", "composite", "flexcomp", "attach")


@dataclass(frozen=True, eq=False)
class Target:
    """A named site or body."""

    at: str  # the name as the user gave it
    kind: str  # "site" or "body"
    name: str
    body: Element  # that the appendage's root is put into


def kinds_and_name(at: str) -> tuple[tuple[str, ...], str]:
    """Kinds that `NAME`, `site:NAME` or `body:NAME` may mean, and the bare name."""
    kind, colon, name = at.partition(":")
    if colon and kind in ("site", "body"):
        return (kind,), name
    return ("site", "body"), at


def place_includes_with_targets(craft: Craft, places: Iterable[str]) -> Craft:
    """The document with those included files put in place that hold one of the `places`."""
    names = [kinds_and_name(place) for place in places]
    edits: list[Edit] = []
    for include in craft.includes:
        root = include.content.root
        if any(_has_element(root, kinds, name) for kinds, name in names):
            edits.append(undo.replace_include(craft, include))
    return craft.edit(edits)


def _has_element(root: Element, kinds: Iterable[str], name: str) -> bool:
    return any(True for kind in kinds for _ in _elements_named(root, kind, name))


def is_written_out(craft: Craft, at: str) -> bool:
    """Whether a place has an element of its own in the document, or nothing else could make it."""
    kinds, name = kinds_and_name(at)
    own = [
        node
        for part in craft.parts()
        for kind in kinds
        for node in _elements_named(part, kind, name)
        if not any(above.tag in MADE_OF_OTHERS for above in node.iterancestors())
    ]
    made = [node for part in craft.parts() for node in part.iter(*MADE_OF_OTHERS)]
    return bool(own) or not made


def find_target(craft: Craft, at: str) -> Target:
    """The element of the document itself that `at` names; see `place_includes_with_targets`."""
    kinds, name = kinds_and_name(at)
    matches = [(kind, node) for kind in kinds for node in _elements_named(craft.root, kind, name)]
    if not matches:
        hint = _names_hint(craft, name)
        raise InputError(f"--mount {at}: {craft.label} has no site or body {name!r}; {hint}")
    if len(matches) > 1:
        several = " and ".join(sorted({kind for kind, _ in matches}))
        raise InputError(
            f"--mount {at}: {craft.label} has more than one {several} {name!r}; write site:{name} "
            f"or body:{name}, or give the one you mean a name of its own."
        )
    kind, node = matches[0]
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
                f"--mount {at}: {kind} {name!r} stands inside <{ancestor.tag}>, which makes "
                "several of it; name a site of a body that is written out."
            )
    if body.tag == "worldbody":
        raise InputError(
            f"--mount {at}: site {name!r} belongs to the world, which does not move; put it into "
            "the spacecraft's body."
        )
    for element in chain:
        _check_frame(element, at)
    return Target(at=at, kind=kind, name=name, body=body)


def _names_hint(craft: Craft, name: str) -> str:
    """Names that the user may have meant, as the end of a sentence."""
    known: set[str] = set()
    for part in craft.parts():
        known |= {node.get("name") or "" for node in part.iter("site", "body")}
    names = sorted(known - {""})
    hint = meant(name, names).strip()
    if not hint:
        hint = f"its sites and bodies are: {', '.join(names[:30]) or 'none'}."
    for tag in MADE_OF_OTHERS:
        if any(part.find(f".//{tag}") is not None for part in craft.parts()):
            return (
                f"{hint} Names made by <{tag}> cannot be used; put the site into a body of the "
                "file itself."
            )
    return hint


def _elements_named(root: Element, kind: str, name: str) -> Iterator[Element]:
    """Elements of a kind with this name, defaults and references in sensors left out."""
    for node in root.iter(kind):
        if node.get("name") != name:
            continue
        if not any(ancestor.tag in ("default", "sensor") for ancestor in node.iterancestors()):
            yield node


def _check_frame(element: Element, at: str) -> None:
    """Refuse what MuJoCo would silently put right: a quaternion that is not unit,
    axes that are not perpendicular."""
    for name, count in (("quat", 4), ("xyaxes", 6), ("zaxis", 3), ("axisangle", 4)):
        text = element.get(name)
        if text is None:
            continue
        try:
            v = [float(word) for word in text.split()]
        except ValueError:
            v = []
        where = f"--mount {at}: {element.tag} {element.get('name') or ''!r} has {name} = {text!r}"
        if len(v) != count or not all(math.isfinite(x) for x in v):
            raise InputError(
                f"{where}, which is not {count} finite numbers; correct it in the spacecraft's "
                "file."
            )
        if name == "quat" and abs(math.hypot(*v) - 1.0) > UNIT:
            raise InputError(
                f"{where} of norm {math.hypot(*v):.9g}, not 1: the frame is in doubt; give a unit "
                "quaternion."
            )
        if name in ("zaxis", "axisangle") and math.hypot(*v[:3]) < UNIT:
            raise InputError(f"{where}, an axis of no length; give a direction.")
        if name == "xyaxes":
            x = v[:3]
            y = v[3:]
            size_x = math.hypot(*x)
            size_y = math.hypot(*y)
            product = sum(a * b for a, b in zip(x, y, strict=True))
            cosine = product / max(size_x * size_y, 1e-300)
            if min(size_x, size_y) < UNIT or abs(cosine) > UNIT:
                raise InputError(
                    f"{where}, whose axes are not perpendicular (cosine {cosine:.3g}): they span "
                    "no right-handed frame; give two perpendicular directions."
                )
