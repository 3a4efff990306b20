"""The user's spacecraft: its MJCF as text and as an lxml tree, with the files it includes."""

import os
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from lxml import etree
from lxml.etree import _Element as Element

from beamchain.checks import path_of
from beamchain.errors import InputError
from beamchain.files import check_utf8, no_file, note_input
from beamchain.mjcf.text import Edit, Node, change_start_tag, edit_bytes, outline

LARGEST_FILE = 50_000_000  # bytes
# tag: which of the two folders
ASSETS = {"mesh": "mesh", "hfield": "mesh", "skin": "mesh", "texture": "texture"}
BLANK = b" \t\r\n"


def read_bytes(path: Path, what: str = "spacecraft") -> bytes:
    """The content of a file that is not too large."""
    label = f"{what} {str(path)!r}"
    note_input(path)
    try:
        kind = no_file(path)
        large = not kind and path.stat().st_size > LARGEST_FILE
        content = b"" if kind or large else path.read_bytes()
    except (OSError, ValueError) as error:
        raise InputError(
            f"{label} cannot be read ({error}); check the path and its permissions."
        ) from None
    if kind:
        raise InputError(f"{label} {kind}; give the path of an MJCF (.xml) file.")
    if large:
        raise InputError(f"{label} is larger than the {LARGEST_FILE} bytes taken; is it MJCF?")
    return content


def parse_text(content: bytes, what: str) -> Element:
    """The root of a document, comments and whitespace kept, nothing fetched or expanded."""
    check_utf8(content, what)
    parser = etree.XMLParser(
        strip_cdata=False,
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        encoding="utf-8",
    )
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise InputError(f"{what} is not XML: {error}; MuJoCo's own parser may say more.") from None
    if root.getroottree().docinfo.doctype:
        raise InputError(
            f"{what} declares a document type (<!DOCTYPE>), which MJCF does not need; remove it."
        )
    return root


@dataclass(frozen=True, eq=False)
class Include:
    """An `<include>` of the document itself."""

    element: Element  # where it stands
    path: Path
    # that file, its own includes put in place, asset paths as the main file would write them
    content: "Craft"
    nested: bool  # it includes further files


class _Included(NamedTuple):
    """A file as it is included, and the files that it includes."""

    element: Element
    path: Path
    file: "Craft"
    inner: "list[_Included]"


@dataclass(frozen=True, eq=False)
class Craft:
    """A spacecraft's MJCF document; what changes it returns another one."""

    content: bytes
    folder: Path  # where its relative paths start
    label: str  # how messages call it

    def __reduce__(self) -> tuple[Any, ...]:
        return Craft, (self.content, self.folder, self.label)  # an lxml tree cannot be pickled

    @property
    def text(self) -> str:
        """The content, without a byte order mark."""
        return self.content.decode("utf-8-sig")

    @cached_property
    def root(self) -> Element:
        """The `<mujoco>` element; to be read only."""
        return parse_text(self.content, self.label)

    @cached_property
    def outline(self) -> list[Node]:
        """Elements and comments with their places in the content."""
        return outline(self.content)

    @cached_property
    def _places(self) -> dict[Element, Node]:
        elements = [element for element in self.root.iter() if isinstance(element.tag, str)]
        nodes = [node for node in self.outline if node.tag is not None]
        return dict(zip(elements, nodes, strict=True))

    def node(self, element: Element) -> Node:
        """Where an element of the tree stands in the content."""
        return self._places[element]

    def source(self, start: int, stop: int) -> str:
        """The text between two places."""
        return self.content[start:stop].decode("utf-8")

    def start_tag(self, element: Element) -> str:
        """The start tag of an element as it is written."""
        node = self.node(element)
        return self.source(node.start, node.inner)

    def edit(self, edits: Iterable[Edit]) -> "Craft":
        """The document after some edits."""
        edits = list(edits)
        return Craft(edit_bytes(self.content, edits), self.folder, self.label) if edits else self

    # -- how it is written -------------------------------------------------------------------------
    @cached_property
    def newline(self) -> str:
        """The line end of most of its lines."""
        return "\r\n" if 2 * self.content.count(b"\r\n") > self.content.count(b"\n") else "\n"

    @cached_property
    def step(self) -> str:
        """By how much it indents a level."""
        return "\t" if b"\n\t" in self.content else "  "

    def indent(self, node: Node) -> str:
        """The blanks at the start of the line on which a node begins."""
        line = self.content[self.content.rfind(b"\n", 0, node.start) + 1 : node.start]
        return line[: len(line) - len(line.lstrip(BLANK))].decode("utf-8")

    def begins_line(self, node: Node) -> bool:
        """Whether nothing but blanks stands before a node on its line."""
        line = self.content[self.content.rfind(b"\n", 0, node.start) + 1 : node.start]
        return not line.strip(BLANK)

    def indent_inside(self, node: Node) -> str:
        """The blanks before a child of a node."""
        lines = [child for child in node.children if self.begins_line(child)]
        return self.indent(lines[-1]) if lines else self.indent(node) + self.step

    def gap(self, node: Node) -> str:
        """The blanks before the end tag of a node."""
        start = max(len(self.content[: node.close].rstrip(BLANK)), node.inner)
        return self.source(start, node.close)

    def block(self, element: Element, indent: str) -> str:
        """An element as lines that are indented as the document is;
        the first begins where it is put."""
        element = deepcopy(element)
        element.tail = None
        etree.indent(element, space=self.step)
        lines = etree.tostring(element, encoding="unicode").split("\n")
        return (self.newline + indent).join(lines)

    # -- edits -------------------------------------------------------------------------------------
    def append(self, parent: Element, blocks: Sequence[str]) -> Edit:
        """Put lines of text at the end of an element, each block on a line of its own."""
        node = self.node(parent)
        lines = "".join(self.newline + self.indent_inside(node) + block for block in blocks)
        outdent = self.newline + self.indent(node)
        if node.self_closing:
            tag = self.source(node.start, node.inner).removesuffix("/>").rstrip() + ">"
            return Edit(node.start, node.end, f"{tag}{lines}{outdent}</{node.tag}>")
        gap = self.gap(node)
        if "\n" in gap:
            end = node.close - len(gap)
            return Edit(end, end, lines)
        return Edit(node.close - len(gap), node.close, lines + outdent)

    def prepend(self, parent: Element, block: str) -> Edit:
        """Put lines of text at the start of an element that has content."""
        node = self.node(parent)
        return Edit(node.inner, node.inner, self.newline + self.indent_inside(node) + block)

    def change(self, element: Element, changes: Mapping[str, str | None]) -> Edit:
        """Give attributes of an element other values; None takes one out."""
        node = self.node(element)
        return Edit(node.start, node.inner, change_start_tag(self.start_tag(element), changes))

    # -- included files ----------------------------------------------------------------------------
    def parts(self) -> list[Element]:
        """The root of the document and the root of every file it includes, in order."""
        return [self.root, *(include.content.root for include in self.includes)]

    @cached_property
    def includes(self) -> list[Include]:
        """The document's includes; a file that is included twice (a cycle) is refused,
        as MuJoCo does."""
        read_paths: list[Path] = []
        files = [
            self._read(element, self.folder, read_paths) for element in self.root.iter("include")
        ]
        folders = asset_folders([self.root, *(_expand(file).root for file in files)])
        home = self.folder.absolute()
        start = {kind: Path(os.path.normpath(home / name)) for kind, name in folders.items()}
        start[""] = home
        return [
            Include(
                element=file.element,
                path=file.path,
                content=_expand(file, start, folders),
                nested=bool(file.inner),
            )
            for file in files
        ]

    def _read(self, element: Element, beside: Path, read_paths: list[Path]) -> _Included:
        name = element.get("file") or ""
        # MuJoCo looks beside the main file first; the main file's folder need not exist yet
        folders = (self.folder.absolute(), beside.absolute())
        places = [Path(os.path.normpath(folder / name)) for folder in folders]
        path = next((place for place in places if place.is_file()), places[0])
        if path.resolve() in read_paths:
            cycle = " -> ".join(place.name for place in [*read_paths, path])
            raise InputError(
                f"{self.label} includes {path.name!r} twice or in a cycle ({cycle}), which MuJoCo "
                "refuses; include every file once."
            )
        read_paths.append(path.resolve())
        what = f"{self.label}: included file"
        file = Craft(read_bytes(path, what), path.parent, f"{what} {str(path)!r}")
        nested = file.root.iter("include")
        inner = [self._read(include, path.parent, read_paths) for include in nested]
        return _Included(element, path, file, inner)


def _expand(
    included: _Included,
    start: Mapping[str, Path] | None = None,
    inner: Mapping[str, str] | None = None,
) -> Craft:
    """An included file with its own includes put in place.

    `start`, `inner`: folders of assets by kind ("" for what is no asset), absolute and as they are
    written; with them every path of a file is written as the main document has to.
    """
    file = included.file
    edits = list[Edit]()
    for nested in included.inner:
        node = file.node(nested.element)
        content = _expand(nested, start, inner)
        edits.append(Edit(node.start, node.end, inner_text(content)))
    if start is not None and inner is not None:
        for element in file.root.iter():
            changes = _paths_of_main_file(element, included.path.parent, start, inner)
            if changes:
                edits.append(file.change(element, changes))
    return file.edit(edits)


def _paths_of_main_file(
    element: Element, beside: Path, start: Mapping[str, Path], inner: Mapping[str, str]
) -> dict[str, str | None]:
    """New values of the attributes of an included file's element that name files."""
    kind = ASSETS.get(str(element.tag), "")
    changes: dict[str, str | None] = {}
    for name, value in file_attributes(element):
        places = [start[kind] / value, beside / value, beside / inner.get(kind, "") / value]
        path = next((place for place in places if place.is_file()), None)
        note_input(path or places[0])
        if path is not None and path != places[0]:
            changes[name] = os.path.relpath(path.absolute(), start[kind]).replace(os.sep, "/")
    return changes


def inner_text(craft: Craft) -> str:
    """What stands between the tags of a document's root."""
    node = craft.node(craft.root)
    return craft.source(node.inner, node.close)


def asset_folders(parts: Iterable[Element]) -> dict[str, str]:
    """`meshdir` and `texturedir` as the compiler elements of the parts leave them."""
    out = {"mesh": "", "texture": ""}
    for part in parts:
        for compiler in part.iter("compiler"):
            for kind in out:
                common = compiler.get("assetdir", out[kind])
                out[kind] = compiler.get(f"{kind}dir", common)
    return out


def file_attributes(element: Element) -> list[tuple[str, str]]:
    """Attributes of an asset or an attached model that name a file relative to some folder."""
    if element.tag not in ASSETS and element.tag != "model":
        return []
    pairs = [(str(name), str(value)) for name, value in element.attrib.items()]
    files = [(name, value) for name, value in pairs if name.startswith("file")]
    return [(name, value) for name, value in files if not os.path.isabs(value)]


def read_craft(path: str | Path) -> Craft:
    """Read a spacecraft's MJCF file; what earlier embedding put in stays."""
    path = path_of("craft", path, "the path or the text of an MJCF (.xml) file")
    if path.suffix.lower() == ".mjb":
        raise InputError(
            f"spacecraft {str(path)!r} is a compiled model, of which MuJoCo writes no file with "
            "names and frames to add to; give the MJCF (.xml) file that it was compiled from."
        )
    craft = Craft(read_bytes(path), path.parent, f"spacecraft {str(path)!r}")
    _check_craft(craft, "an MJCF file")
    return craft


def craft_from_text(content: str) -> Craft:
    """A spacecraft from MJCF text; relative paths in it start at the working folder."""
    craft = Craft(content.encode("utf-8"), Path(), "spacecraft text")
    _check_craft(craft, "MJCF")
    return craft


def _check_craft(craft: Craft, wanted: str) -> None:
    """Refuse a document that is no MJCF or whose includes cannot be followed."""
    if craft.root.tag != "mujoco":
        raise InputError(
            f"{craft.label} has root element <{craft.root.tag}>, not <mujoco>; give {wanted} "
            "(a URDF is known by the ending .urdf)."
        )
    folders = asset_folders(craft.parts())  # refuses what cannot be followed
    for element in craft.root.iter():
        kind = ASSETS.get(str(element.tag), "")
        for _, file in file_attributes(element):
            note_input(craft.folder / folders.get(kind, "") / file)
