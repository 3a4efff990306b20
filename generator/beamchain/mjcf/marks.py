"""Marks: a comment before every piece that embedding put into the user's file, holding what takes it out again.

Every change to the tree goes through this module, so that `take_out` undoes all of them, whitespace included.
"""

import json
import os
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

from lxml import etree
from lxml.etree import _Element as Element

from beamchain.errors import InputError

SIGN = "beamchain embed"

#: what the comment's JSON says of the piece behind it
PIECES = ("appendage", "tendon", "sensor", "model", "compiler", "key", "path", "include", "end")


def mark(piece: str, **facts: Any) -> Element:
    """The comment that stands before a piece."""
    # no "--" inside a comment, nothing that a parser would normalise
    text = json.dumps({"piece": piece, **facts}).replace("--", "-\\u002d")
    return etree.Comment(f" {SIGN} {text} ")


def read_mark(node: Element) -> dict[str, Any] | None:
    """What a comment says, or None where it is not one of ours; a damaged one is refused."""
    text = (node.text or "").strip()
    if node.tag is not etree.Comment or not text.startswith(SIGN):
        return None
    try:
        facts = json.loads(text[len(SIGN) :])
        if facts["piece"] not in PIECES:
            raise ValueError(f"piece {facts['piece']!r} is unknown")
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(
            f"line {node.sourceline}: a `{SIGN}` comment was changed by hand ({error}); restore the file from before, "
            "or remove the appendage's elements and their comments by hand."
        ) from None
    return facts


def marks(root: Element) -> Iterator[tuple[Element, dict[str, Any]]]:
    """All marks of a document, in order."""
    for node in root.iter(etree.Comment):
        facts = read_mark(node)
        if facts is not None:
            yield node, facts


def _gap(parent: Element) -> str | None:
    """The whitespace before the closing tag."""
    return parent[-1].tail if len(parent) else parent.text


def _set_gap(parent: Element, before: Element | None, text: str | None) -> None:
    """Set the text behind `before`, or at the start of `parent`."""
    if before is None:
        parent.text = text
    else:
        before.tail = text


def _indent(parent: Element) -> str:
    """Indentation of the children of an element: two spaces more than its own line has."""
    return "\n" + "  " * (1 + sum(1 for _ in parent.iterancestors()))


def put_last(parent: Element, element: Element, piece: str, **facts: Any) -> None:
    """Put a marked piece at the end of `parent`."""
    before, indent = _gap(parent), _indent(parent)
    etree.indent(element, space="  ", level=indent.count("  "))
    comment = mark(piece, **facts, before=before)
    _set_gap(parent, parent[-1] if len(parent) else None, indent)
    comment.tail = indent
    element.tail = before if before is not None and before.strip() == "" and before else indent[:-2]
    parent.append(comment)
    parent.append(element)


def change(element: Element, piece: str, changes: dict[str, str]) -> None:
    """Change attributes of the user's element, the old values kept in a mark before it."""
    old = {name: element.get(name) for name in changes}
    comment = mark(piece, old=old)
    element.addprevious(comment)
    comment.tail = _indent(element.getparent())  # pyright: ignore[reportArgumentType]  (an attribute's bearer has a parent)
    for name, value in changes.items():
        element.set(name, value)


def inline(include: Element, content: Element) -> None:
    """Put the children of an included file's root where its `<include>` stands, between two marks."""
    parent = include.getparent()
    assert parent is not None
    first, last = mark("include", attributes=dict(include.attrib)), mark("end")
    first.tail, last.tail = content.text or "\n", include.tail
    place = parent.index(include)
    include.tail = None
    parent.remove(include)
    for i, node in enumerate([first, *deepcopy(content), last]):
        parent.insert(place + i, node)


def take_out(root: Element) -> None:
    """Undo every change of a document; refused where a mark was damaged, or what it stands before is gone."""
    for node, facts in reversed(list(marks(root))):
        parent = node.getparent()
        if parent is None:
            continue  # inside an include that was put back already
        following = node.getnext()
        if facts["piece"] == "end":
            continue
        if following is None:
            raise InputError(
                f"line {node.sourceline}: nothing stands behind the `{SIGN}` comment of a {facts['piece']}; restore "
                "the file from before, or remove the comment by hand."
            )
        if facts["piece"] == "include":
            _put_include_back(parent, node, facts["attributes"])
        elif facts["piece"] in ("key", "path"):
            for name, value in facts["old"].items():
                if value is None:
                    following.attrib.pop(name, None)
                else:
                    following.set(name, value)
            parent.remove(node)
        else:
            _set_gap(parent, node.getprevious(), facts["before"])
            parent.remove(following)
            parent.remove(node)


def _put_include_back(parent: Element, first: Element, attributes: dict[str, str]) -> None:
    depth, between = 0, [first]
    for node in first.itersiblings():
        between.append(node)
        piece = (read_mark(node) or {}).get("piece")
        depth += {"include": 1, "end": -1}.get(str(piece), 0)
        if depth < 0:
            break
    else:
        raise InputError(
            f"line {first.sourceline}: the `{SIGN}` comment that ends an include is gone; restore the file."
        )
    include = etree.Element("include", attributes)
    include.tail = between[-1].tail
    place = parent.index(first)
    for node in between:
        parent.remove(node)
    parent.insert(place, include)


def moved(path: str, start: str | os.PathLike[str], new: str | os.PathLike[str] | None) -> str:
    """A relative path seen from another folder; absolute where `new` is None. Absolute ones stay."""
    if os.path.isabs(path):
        return path
    full = os.path.normpath(os.path.join(os.path.abspath(start), path))
    return full if new is None else os.path.relpath(full, os.path.abspath(new)).replace(os.sep, "/")


def embedded(root: Element) -> list[dict[str, Any]]:
    """What the marks say of each appendage in the document."""
    return [facts for _, facts in marks(root) if facts["piece"] == "appendage"]
