"""Undo marks: a comment before every piece that embedding put into the user's file.

The comment holds what is needed to take the piece out. Every change that embedding makes goes
through this module, so that `remove_marked_changes` gives back the original bytes.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import msgspec
from lxml.etree import _Element as Element
from msgspec import UNSET, UnsetType

from beamchain.errors import InputError
from beamchain.mjcf.craft import BLANK, Craft, Include, inner_text
from beamchain.mjcf.text import Edit, Node, split_start_tag

SIGN = "beamchain embed"
STEP = re.compile(r"timed for \w+ at \S+ s")


class Put(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    tag_field="piece",
    forbid_unknown_fields=True,
    omit_defaults=True,
):
    """The element behind the mark was put in; `before`: the blanks that stood at its place,
    if they were changed."""

    before: str | UnsetType | None = UNSET


class AppendageMark(Put, frozen=True, tag="appendage"):
    """An appendage: its place, prefix and specification, and the bodies of the spacecraft
    that its ports carry."""

    at: str
    prefix: str
    spec: dict[str, Any]
    carries: dict[str, tuple[str, ...]] = {}


class SectionMark(Put, frozen=True, tag="tendon"):
    """Tendons of the appendage at a place."""

    at: str


class SensorMark(Put, frozen=True, tag="sensor"):
    """Sensors of the appendage at a place."""

    at: str


class LookMark(Put, frozen=True, tag="look"):
    """Surfaces of the appendage at a place, or the material that they are drawn with."""

    at: str


class CompilerMark(Put, frozen=True, tag="compiler"):
    """Folders of assets, seen from the written file; `folder`: the original's."""

    folder: str


class Changed(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    tag_field="piece",
    forbid_unknown_fields=True,
    omit_defaults=True,
):
    """The start tag behind the mark was changed; `was`: as it stood."""

    was: str


class KeyMark(Changed, frozen=True, tag="key"):
    """A keyframe."""


class PathMark(Changed, frozen=True, tag="path"):
    """A path, seen from the written file."""


class JointMark(Changed, frozen=True, tag="joint"):
    """A joint of the spacecraft that was given armature for its step."""


class OpenedMark(Changed, frozen=True, tag="opened"):
    """An element without content (`<body/>`) that was given one."""


class IncludeMark(
    msgspec.Struct,
    frozen=True,
    tag_field="piece",
    tag="include",
    forbid_unknown_fields=True,
    omit_defaults=True,
):
    """From here to the end mark stands what an `<include>` brings in; `was`: as it stood."""

    was: str


class MovedMark(
    msgspec.Struct, frozen=True, tag_field="piece", tag="moved", forbid_unknown_fields=True
):
    """Here stood a body that now hangs on a port, in a frame of its own behind a `LoadMark`."""

    body: str


class LoadMark(
    msgspec.Struct, frozen=True, tag_field="piece", tag="load", forbid_unknown_fields=True
):
    """The frame behind the mark holds a body that was moved, as it was written."""

    body: str


class StepMark(
    msgspec.Struct, frozen=True, tag_field="piece", tag="step", forbid_unknown_fields=True
):
    """The first line of a document that is timed for a step, which names it; it stands alone."""

    says: str


class EndMark(
    msgspec.Struct, frozen=True, tag_field="piece", tag="end", forbid_unknown_fields=True
):
    """The end of what an `<include>` brings in."""


Mark: TypeAlias = (
    AppendageMark
    | SectionMark
    | SensorMark
    | LookMark
    | CompilerMark
    | KeyMark
    | JointMark
    | PathMark
    | OpenedMark
    | IncludeMark
    | MovedMark
    | LoadMark
    | StepMark
    | EndMark
)


# -- write -----------------------------------------------------------------------------------------
def mark_comment(mark: msgspec.Struct) -> str:
    """The comment that stands before a piece."""
    # no "--" inside a comment, nothing that a parser would normalise
    text = json.dumps(msgspec.to_builtins(mark)).replace("--", "-\\u002d")
    return f"<!-- {SIGN} {text} -->"


def append_marked(craft: Craft, parent: Element, pieces: Sequence[tuple[Put, Element]]) -> Edit:
    """Put marked elements at the end of `parent`."""
    node = craft.node(parent)
    indent = craft.indent_inside(node)
    gap = craft.gap(node)
    if not node.self_closing and "\n" not in gap:
        first = msgspec.structs.replace(pieces[0][0], before=gap)
        pieces = [(first, pieces[0][1]), *pieces[1:]]
    blocks: list[str] = []
    for mark, element in pieces:
        blocks += [mark_comment(mark), craft.block(element, indent)]
    edit = craft.append(parent, blocks)
    if not node.self_closing:
        return edit
    opened = mark_comment(OpenedMark(was=craft.start_tag(parent)))
    return edit._replace(text=opened + craft.newline + craft.indent(node) + edit.text)


def change_marked(
    craft: Craft, element: Element, mark: type[Changed], changes: dict[str, str]
) -> Edit:
    """Change attributes of the user's element; a mark before it keeps the start tag as it was."""
    edit = craft.change(element, changes)
    node = craft.node(element)
    comment = mark_comment(mark(was=craft.start_tag(element)))
    return edit._replace(text=comment + craft.newline + craft.indent(node) + edit.text)


def change_once_marked(
    craft: Craft, element: Element, mark: type[Changed], changes: dict[str, str]
) -> Edit:
    """The same, where such a mark may stand before the element already."""
    node = craft.node(element)
    if any(
        isinstance(known, mark) and _node_behind(craft, comment, known) is node
        for comment, known in marks(craft)
    ):
        return craft.change(element, changes)
    return change_marked(craft, element, mark, changes)


def replace_include(craft: Craft, include: Include) -> Edit:
    """Put what an included file holds where its `<include>` stands, between two marks."""
    node = craft.node(include.element)
    first = mark_comment(IncludeMark(was=craft.source(node.start, node.end)))
    last = mark_comment(EndMark())
    return Edit(node.start, node.end, first + inner_text(include.content) + last)


# -- read ------------------------------------------------------------------------------------------
def _read_mark(craft: Craft, node: Node) -> Mark | None:
    """What a comment says, or None where it is not one of ours; a damaged one is refused."""
    if node.tag is not None:
        return None
    text = craft.source(node.start + 4, node.end - 3).strip()
    if not text.startswith(SIGN):
        return None
    try:
        return msgspec.json.decode(text[len(SIGN) :], type=Mark)
    except (msgspec.DecodeError, RecursionError) as error:
        raise InputError(
            f"{_line_number(craft, node)}: a `{SIGN}` comment was changed by hand ({error}); "
            "restore the file from before, or remove the appendage's elements and their comments "
            "by hand."
        ) from None


def _line_number(craft: Craft, node: Node) -> str:
    lines = craft.content.count(b"\n", 0, node.start)
    return f"line {lines + 1}"


def marks(craft: Craft) -> Iterator[tuple[Node, Mark]]:
    """All marks of a document, in order."""
    for node in craft.outline:
        mark = _read_mark(craft, node)
        if mark is not None:
            yield node, mark


def appendage_marks(craft: Craft) -> list[AppendageMark]:
    """What the marks say of each appendage in the document."""
    return [mark for _, mark in marks(craft) if isinstance(mark, AppendageMark)]


# -- the step that a document is timed for ---------------------------------------------------------
def mark_step(craft: Craft, says: str) -> Craft:
    """The spacecraft with a first line of ours that names its step."""
    return craft.edit([craft.prepend(craft.root, mark_comment(StepMark(says)))])


def name_step(craft: Craft, says: str) -> Craft:
    """The document with a first line that names its step in place of the one before; empty:
    without one."""
    craft = craft.edit(_take_out_line(craft, node) for node in _step_lines(craft))
    if not says:
        return craft
    if appendage_marks(craft):
        return mark_step(craft, says)
    return craft.edit([craft.prepend(craft.root, f"<!-- {says} -->")])


def _step_lines(craft: Craft) -> Iterator[Node]:
    """Comments that name the step of the document, ours and those of its own."""
    for node in craft.outline:
        text = "" if node.tag else craft.source(node.start + 4, node.end - 3).strip()
        if STEP.fullmatch(text) or isinstance(_read_mark(craft, node), StepMark):
            yield node


def _take_out_line(craft: Craft, node: Node) -> Edit:
    return Edit(len(craft.content[: node.start].rstrip(BLANK)), node.end, "")


# -- bodies that hang on ports ---------------------------------------------------------------------
def move_body(craft: Craft, body: Element, link: Element, frame: Mapping[str, str]) -> Craft:
    """The document with a body of the user, as it is written, at the end of a link, inside a
    `<frame>` with attributes that put it where it was."""
    name = body.get("name") or ""
    node = craft.node(body)
    holder = craft.node(link)
    text = craft.source(node.start, node.end)
    attributes = "".join(f' {key}="{value}"' for key, value in frame.items())
    indent = craft.newline + craft.indent_inside(holder)
    lines = [mark_comment(LoadMark(name)), f"<frame{attributes}>", text, "</frame>"]
    return craft.edit(
        [
            Edit(node.start, node.end, mark_comment(MovedMark(name))),
            craft.append(link, [indent.join(lines)]),
        ]
    )


def move_bodies_back(craft: Craft) -> Craft:
    """The document with every body that hangs on a port where it stood; refused where it is
    gone."""
    while True:
        found = list(marks(craft))
        moved = [(node, mark) for node, mark in found if isinstance(mark, MovedMark)]
        if not moved:
            return craft
        # the first of a pair may stand inside a body that was moved itself: one at a time
        place, wanted = moved[0]
        loads = [
            node for node, mark in found if isinstance(mark, LoadMark) and mark.body == wanted.body
        ]
        if len(loads) != 1:
            raise InputError(
                f"{_line_number(craft, place)}: body {wanted.body!r}, which embed moved onto a "
                "port, is not found there; restore the file from before."
            )
        load = loads[0]
        frame = _node_behind(craft, load, LoadMark(wanted.body))
        text = craft.source(frame.inner, frame.close).strip()
        start = len(craft.content[: load.start].rstrip(BLANK))
        craft = craft.edit([Edit(place.start, place.end, text), Edit(start, frame.end, "")])


# -- take out --------------------------------------------------------------------------------------
class _Piece(NamedTuple):
    """What was put in, from the blanks before its mark to the end of its element."""

    start: int
    end: int
    before: str | UnsetType | None  # as in `Put`


def remove_marked_changes(craft: Craft) -> Craft:
    """The document before every marked change; refused where a mark was damaged,
    or what it stands before is gone."""
    craft = move_bodies_back(craft)
    edits: list[Edit] = []
    pieces: list[_Piece] = []
    done = 0  # what stands before this place is dealt with
    for node, mark in marks(craft):
        if node.start < done or isinstance(mark, EndMark | MovedMark | LoadMark):
            continue
        if isinstance(mark, Put):
            piece = _marked_piece(craft, node, mark)
            pieces.append(piece)
            edit = Edit(piece.start, piece.end, "")
        elif isinstance(mark, StepMark):
            edit = _take_out_line(craft, node)
        elif isinstance(mark, IncludeMark):
            edit = Edit(node.start, _end_of_include(craft, node), mark.was)
        else:
            edit = _edit_of_change(craft, node, mark)
        edits.append(edit)
        done = edit.stop
    gaps = [
        _restore_gap(craft, run.end, run.before)
        for run in _side_by_side(pieces)
        if not isinstance(run.before, UnsetType)
    ]
    return craft.edit([*edits, *gaps])


def _marked_piece(craft: Craft, node: Node, mark: Put) -> _Piece:
    """What was put in behind a mark."""
    start = len(craft.content[: node.start].rstrip(BLANK))
    return _Piece(start, _node_behind(craft, node, mark).end, mark.before)


def _edit_of_change(craft: Craft, node: Node, mark: Changed) -> Edit:
    """The edit that gives the element behind a mark its start tag from before."""
    following = _node_behind(craft, node, mark)
    include = _read_mark(craft, following)
    if isinstance(include, IncludeMark):
        # its path was changed, then it was put in place
        _, rest = split_start_tag(include.was)
        return Edit(node.start, _end_of_include(craft, following), mark.was + rest)
    if isinstance(mark, OpenedMark):
        if _only_pieces(craft, following):
            return Edit(node.start, following.end, mark.was)
        # the user has put something of his own beside the appendage
        return Edit(node.start, following.start, "")
    return Edit(node.start, following.inner, mark.was)


def _side_by_side(pieces: Sequence[_Piece]) -> list[_Piece]:
    """Pieces that touch, joined; the first with blanks before it knows what stood there."""
    runs: list[_Piece] = []
    for piece in pieces:
        if not runs or runs[-1].end != piece.start:
            runs.append(piece)
            continue
        start, _, before = runs.pop()
        if isinstance(before, UnsetType):
            before = piece.before
        runs.append(_Piece(start, piece.end, before))
    return runs


def _restore_gap(craft: Craft, end: int, before: str | None) -> Edit:
    """Put back the blanks from `end` on as they were before anything was put in."""
    rest = craft.content[end:]
    blanks = len(rest) - len(rest.lstrip(BLANK))
    return Edit(end, end + blanks, before or "")


def _node_behind(craft: Craft, node: Node, mark: msgspec.Struct) -> Node:
    """The element that a mark stands before, or the mark of an include that was put in place."""
    if node.parent is not None:
        siblings = node.parent.children
    else:
        siblings = [other for other in craft.outline if other.parent is None]
    place = siblings.index(node) + 1
    if place < len(siblings):
        following = siblings[place]
        is_next = not craft.content[node.end : following.start].strip(BLANK)
        is_piece = following.tag or isinstance(_read_mark(craft, following), IncludeMark)
        if is_next and is_piece:
            return following
    kind = msgspec.to_builtins(mark)["piece"]
    raise InputError(
        f"{_line_number(craft, node)}: nothing stands behind the `{SIGN}` comment of a {kind}; "
        "restore the file from before, or remove the comment by hand."
    )


def _only_pieces(craft: Craft, node: Node) -> bool:
    """Whether a node holds nothing but elements that were put in, and their marks."""
    comments = node.children[::2]
    elements = node.children[1::2]
    if len(comments) != len(elements) or not all(element.tag for element in elements):
        # a damaged mark is refused nevertheless
        for comment in comments:
            _read_mark(craft, comment)
        return False
    are_marks = all(isinstance(_read_mark(craft, comment), Put) for comment in comments)
    starts = [node.inner, *(child.end for child in node.children)]
    stops = [*(child.start for child in node.children), node.close]
    gaps = [craft.content[start:stop] for start, stop in zip(starts, stops, strict=True)]
    return are_marks and not any(gap.strip(BLANK) for gap in gaps)


def _end_of_include(craft: Craft, first: Node) -> int:
    """Where the end mark ends that belongs to the mark of an include."""
    depth = 0
    for node, mark in marks(craft):
        if node.start < first.start or node.parent is not first.parent:
            continue
        if isinstance(mark, IncludeMark):
            depth += 1
        elif isinstance(mark, EndMark):
            depth -= 1
        if depth == 0:
            return node.end
    raise InputError(
        f"{_line_number(craft, first)}: the `{SIGN}` comment that ends an include is gone; restore "
        "the file."
    )
