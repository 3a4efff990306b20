"""MJCF as text: places of elements and comments in the bytes of a file, and edits there.

What no edit replaces keeps its bytes: indentation, quotes, entities, line ends,
the byte order mark.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.parsers import expat
from xml.sax.saxutils import escape

#: A start tag; a `>` inside quotes does not end it.
_START_TAG = re.compile(rb"""<(?:[^>"']++|"[^"]*+"|'[^']*+')*+>""")
_ATTRIBUTE = re.compile(
    r"""(?P<space>\s+)(?P<name>[^\s=/>]+)(?P<equals>\s*=\s*)"""
    r"""(?P<quote>["'])(?P<value>.*?)(?P=quote)""",
    re.DOTALL,
)
_END_OF_TAG = re.compile(r"\s*/?>$")
_ENTITIES = {'"': "&quot;", "'": "&apos;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}


class Edit(NamedTuple):
    """The bytes from `start` to `stop` are replaced by `text`; `start == stop` inserts."""

    start: int
    stop: int
    text: str


@dataclass(eq=False)
class Node:
    """An element or a comment; positions in bytes, those of a comment's content are not used."""

    tag: str | None  # None: a comment
    start: int
    inner: int  # behind the start tag
    parent: "Node | None"
    close: int = 0  # of the end tag; where there is none (`<a/>`), behind the start tag
    end: int = 0
    children: "list[Node]" = field(default_factory=list)

    @property
    def self_closing(self) -> bool:
        """It is written `<a/>`."""
        return self.close == self.end


def outline(content: bytes) -> list[Node]:
    """All elements and comments of well-formed UTF-8 XML, in document order."""
    parser = expat.ParserCreate("utf-8")
    nodes: list[Node] = []
    opened: list[Node] = []

    def add(tag: str | None, stop: int) -> Node:
        parent = opened[-1] if opened else None
        node = Node(tag, parser.CurrentByteIndex, stop, parent, stop, stop)
        nodes.append(node)
        if parent is not None:
            parent.children.append(node)
        return node

    def begin(tag: str, _: Mapping[str, str]) -> None:
        match = _START_TAG.match(content, parser.CurrentByteIndex)
        assert match is not None
        opened.append(add(tag, match.end()))

    def finish(_: str) -> None:
        node = opened.pop()
        if not content.endswith(b"/>", node.start, node.inner):
            node.close = parser.CurrentByteIndex
            node.end = content.index(b">", node.close) + 1

    def comment(_: str) -> None:
        add(None, content.index(b"-->", parser.CurrentByteIndex) + 3)

    parser.StartElementHandler = begin
    parser.EndElementHandler = finish
    parser.CommentHandler = comment
    parser.Parse(content, True)
    return nodes


def edit_bytes(content: bytes, edits: Iterable[Edit]) -> bytes:
    """The content after all edits, which must not overlap;
    insertions at one place keep their order."""
    pieces: list[bytes] = []
    place = 0
    for edit in sorted(edits, key=lambda edit: (edit.start, edit.stop)):
        assert edit.start >= place, "edits overlap"
        pieces += [content[place : edit.start], edit.text.encode("utf-8")]
        place = edit.stop
    return b"".join([*pieces, content[place:]])


def split_start_tag(text: str) -> tuple[str, str]:
    """The start tag at the head of a text, and what follows it."""
    match = _START_TAG.match(text.encode("utf-8"))
    assert match is not None
    tag = match[0].decode("utf-8")
    return tag, text[len(tag) :]


def change_start_tag(tag: str, changes: Mapping[str, str | None]) -> str:
    """A start tag with other values of some attributes; None takes an attribute out,
    new ones come last."""
    new = dict(changes)

    def change(match: re.Match[str]) -> str:
        if match["name"] not in new:
            return match[0]
        value = new.pop(match["name"])
        if value is None:
            return ""
        quote = match["quote"]
        name = f"{match['space']}{match['name']}{match['equals']}"
        return f"{name}{quote}{escape(value, _ENTITIES)}{quote}"

    changed = _ATTRIBUTE.sub(change, tag)
    added = ""
    for name, value in new.items():
        if value is not None:
            added += f' {name}="{escape(value, _ENTITIES)}"'
    end = _END_OF_TAG.search(changed)
    assert end is not None
    return changed[: end.start()] + added + changed[end.start() :]
