"""The user's spacecraft: its MJCF as an lxml tree, includes followed, paths moved, places found by name."""

import os
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lxml import etree
from lxml.etree import _Element as Element

from beamchain.errors import InputError
from beamchain.files import no_file
from beamchain.mjcf import marks

LARGEST_FILE = 50_000_000  # bytes
MOST_ATTRIBUTES = 1000  # of one tag: MuJoCo's parser takes the square of their number
MOST_TAGS = 500_000  # opened and closed: each takes some hundred bytes, and documents are copied
ASSETS = {"mesh": "mesh", "hfield": "mesh", "skin": "mesh", "texture": "texture"}  # tag: which of the two folders


def parse(path: Path, what: str = "spacecraft") -> Any:
    """The lxml tree of a file, comments and whitespace kept, nothing fetched or expanded."""
    label = f"{what} {str(path)!r}"
    try:
        kind = no_file(path)
        large = not kind and path.stat().st_size > LARGEST_FILE
        content = b"" if kind or large else path.read_bytes()
    except (OSError, ValueError) as error:
        raise InputError(f"{label} cannot be read ({error}); check the path and its permissions.") from None
    if kind:
        raise InputError(f"{label} {kind}; give the path of an MJCF (.xml) file.")
    if large:
        raise InputError(f"{label} is larger than the {LARGEST_FILE} bytes taken; is it MJCF?")
    return parse_text(content, label)


def parse_text(content: bytes, what: str) -> Any:
    """The lxml tree of a document; see `parse`."""
    parser = etree.XMLParser(
        strip_cdata=False, resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False
    )
    check_text(content, what)
    try:
        tree = etree.ElementTree(etree.fromstring(content, parser))
    except (etree.XMLSyntaxError, ValueError) as error:
        raise InputError(f"{what} is not XML: {error}; MuJoCo's own parser may say more.") from None
    if tree.docinfo.doctype:
        raise InputError(f"{what} declares a document type (<!DOCTYPE>), which MJCF does not need; remove it.")
    return tree


def check_text(content: bytes, what: str) -> None:
    """Refuse what would keep an XML parser, ours or MuJoCo's, busy for minutes or take all memory."""
    if len(content) > LARGEST_FILE:
        raise InputError(f"{what} is larger than the {LARGEST_FILE} bytes taken; is it MJCF?")
    if content.count(b"<") > MOST_TAGS:
        raise InputError(f"{what} holds more than the {MOST_TAGS} tags taken; is it MJCF?")
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise InputError(f"{what} declares a document type (<!DOCTYPE>), which MJCF does not need; remove it.")
    if any(piece.count(b'="') > MOST_ATTRIBUTES for piece in content.split(b"<")):
        raise InputError(f"{what} has a tag with more than {MOST_ATTRIBUTES} attributes; is it MJCF?")


@dataclass(frozen=True, eq=False)
class Include:
    """An `<include>` of the document itself."""

    element: Element  # where it stands
    path: Path
    content: Element  # root of that file, its own includes put in place, asset paths as the main file would write them
    nested: bool  # it includes further files


@dataclass(frozen=True, eq=False)
class Craft:
    """A spacecraft's MJCF document."""

    tree: Any  # lxml's; functions of this package change copies only
    folder: Path  # where its relative paths start
    label: str  # how messages call it
    declared: bool = False  # it begins with an XML declaration

    @property
    def root(self) -> Element:
        """The `<mujoco>` element."""
        return self.tree.getroot()

    def copy(self) -> "Craft":
        """A copy that may be changed."""
        return Craft(deepcopy(self.tree), self.folder, self.label, self.declared)

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.to_bytes(), self.folder, self.label, self.declared)

    def to_bytes(self) -> bytes:
        """The file's content, with an XML declaration where it had one."""
        encoding = self.tree.docinfo.encoding or "utf-8"
        before, node = [], self.root.getprevious()
        while node is not None:
            before.insert(0, etree.tostring(node, encoding=encoding, xml_declaration=False, with_tail=False))
            node = node.getprevious()
        after = [etree.tostring(n, encoding=encoding, xml_declaration=False) for n in self.root.itersiblings()]
        body = etree.tostring(self.root, encoding=encoding, xml_declaration=False)
        head = [f'<?xml version="1.0" encoding="{encoding}"?>'.encode()] if self.declared else []
        return b"\n".join([*head, *before, body, *after]) + b"\n"

    def parts(self) -> list[Element]:
        """The root of the document and the root of every file it includes, in order."""
        return [self.root, *(include.content for include in self.includes())]

    def asset_folders(self, parts: Iterable[Element]) -> dict[str, str]:
        """`meshdir` and `texturedir` as the compiler elements of the parts leave them."""
        out = {"mesh": "", "texture": ""}
        for part in parts:
            for compiler in part.iter("compiler"):
                both = compiler.get("assetdir")
                for kind in out:
                    out[kind] = compiler.get(f"{kind}dir", out[kind] if both is None else both)
        return out

    def includes(self) -> list[Include]:
        """The document's includes; a file that is included twice (a cycle) is refused, as MuJoCo does."""
        seen: list[Path] = []
        files: list[tuple[Element, Path]] = []
        out: list[Include] = []
        for element in self.root.iter("include"):
            path, content = self._read(element, self.folder, seen)
            nested = self._expand(content, path, seen, files)
            out.append(Include(element, path, content, nested))
        folders = self.asset_folders([self.root, *(include.content for include in out)])
        for element, beside in files:
            inner = folders.get(ASSETS.get(str(element.tag), ""), "")
            start = Path(os.path.normpath(self.folder.absolute() / inner))
            for name, value in file_attributes(element):
                places = [start / value, beside / value, beside / inner / value]
                found = next((place for place in places if place.is_file()), None)
                if found is not None and found != places[0]:
                    element.set(name, os.path.relpath(found.absolute(), start.absolute()).replace(os.sep, "/"))
        return out

    def _read(self, element: Element, beside: Path, seen: list[Path]) -> tuple[Path, Element]:
        file = element.get("file") or ""
        # MuJoCo looks beside the main file first; the main file's folder need not exist yet
        places = [Path(os.path.normpath(folder / file)) for folder in (self.folder.absolute(), beside.absolute())]
        path = next((place for place in places if place.is_file()), places[0])
        if path.resolve() in seen:
            raise InputError(
                f"{self.label} includes {path.name!r} twice or in a cycle "
                f"({' -> '.join(place.name for place in [*seen, path])}), which MuJoCo refuses; include every file "
                "once."
            )
        seen.append(path.resolve())
        return path, parse(path, f"{self.label}: included file").getroot()

    def _expand(self, content: Element, path: Path, seen: list[Path], files: list[tuple[Element, Path]]) -> bool:
        nested = list(content.iter("include"))
        for element in nested:
            inner_path, inner = self._read(element, path.parent, seen)
            self._expand(inner, inner_path, seen, files)
            parent = element.getparent()
            assert parent is not None
            place = parent.index(element)
            parent.remove(element)
            for i, child in enumerate(list(inner)):
                parent.insert(place + i, child)
        mine = {id(element) for element, _ in files}
        files += [(node, path.parent) for node in content.iter() if file_attributes(node) and id(node) not in mine]
        return bool(nested)


def _restored(content: bytes, folder: Path, label: str, declared: bool) -> Craft:
    """A document out of a pickle, which cannot hold an lxml tree."""
    return Craft(parse_text(content, label), folder, label, declared)


def file_attributes(element: Element) -> list[tuple[str, str]]:
    """Attributes of an asset or an attached model that name a file relative to some folder."""
    if element.tag not in ASSETS and element.tag != "model":
        return []
    pairs = [(str(name), str(value)) for name, value in element.attrib.items()]
    return [(name, value) for name, value in pairs if name.startswith("file") and not os.path.isabs(value)]


def read_craft(path: str | Path) -> Craft:
    """Read a spacecraft's MJCF file; what earlier embedding put in stays."""
    path = Path(path)
    tree = parse(path)
    declared = path.read_bytes().lstrip().startswith(b"<?xml")
    return _whole(Craft(tree, path.parent, f"spacecraft {str(path)!r}", declared), "an MJCF file")


def craft_from_text(content: str) -> Craft:
    """A spacecraft from MJCF text; relative paths in it start at the working folder."""
    return _whole(Craft(parse_text(content.encode("utf-8"), "spacecraft text"), Path(), "spacecraft text"), "MJCF")


def _whole(craft: Craft, wanted: str) -> Craft:
    """The document itself, if it is MJCF and its includes can be followed."""
    if craft.root.tag != "mujoco":
        raise InputError(f"{craft.label} has root element <{craft.root.tag}>, not <mujoco>; give {wanted}.")
    craft.includes()
    return craft


def bare(craft: Craft) -> Craft:
    """The spacecraft as it was before embedding, seen from the folder it came from: its own document again."""
    home = craft.folder
    for _, facts in marks.marks(craft.root):
        if facts["piece"] == "compiler":
            home = craft.folder / facts["folder"]
    out = Craft(deepcopy(craft.tree), home, craft.label, craft.declared)
    marks.take_out(out.root)
    return out


def relocate(craft: Craft, folder: Path | None) -> Craft:
    """A copy whose relative paths are right in another folder; absolute where `folder` is None (to compile as text).

    Included files that name files themselves are put in place, because MuJoCo would look for those elsewhere.
    """
    out = craft.copy()
    if folder is not None and folder.resolve() == craft.folder.resolve():
        return out
    for include in out.includes():
        if include.nested or any(file_attributes(node) for node in include.content.iter()):
            marks.inline(include.element, include.content)
    parts = out.parts()
    relative = any(file_attributes(node) for part in parts for node in part.iter())
    for element in list(out.root.iter("include", "model")):
        file = element.get("file")
        if file and not os.path.isabs(file):
            marks.change(element, "path", {"file": marks.moved(file, craft.folder, folder)})
            relative = True
    if relative:
        folders = out.asset_folders(parts)
        compiler = etree.Element("compiler")
        for kind, value in folders.items():
            if not os.path.isabs(value):
                compiler.set(f"{kind}dir", marks.moved(value, craft.folder, folder))
        home = "." if folder is None else marks.moved(".", craft.folder, folder)
        marks.put_last(out.root, compiler, "compiler", folder=home)
    return Craft(out.tree, craft.folder if folder is None else folder, craft.label, craft.declared)
