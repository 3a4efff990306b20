"""A spacecraft's document seen from another folder: its paths, and the way back."""

import os
from pathlib import Path

from lxml import etree
from lxml.etree import _Element as Element

from beamchain.mjcf import undo_marks as undo
from beamchain.mjcf.craft import Craft, asset_folders, file_attributes
from beamchain.mjcf.text import Edit


def spacecraft_before(craft: Craft) -> Craft:
    """The spacecraft as it was before embedding, seen from the folder it came from:
    its own document again."""
    home = craft.folder
    for _, mark in undo.marks(craft):
        if isinstance(mark, undo.CompilerMark):
            home = craft.folder / mark.folder
    return Craft(undo.remove_marked_changes(craft).content, home, craft.label)


def relocate(craft: Craft, folder: Path | None) -> Craft:
    """The document with its relative paths right in another folder;
    absolute where `folder` is None (to compile as text).

    Included files that name files themselves are put in place,
    because MuJoCo would look for those elsewhere.
    """
    home = craft.folder
    if folder is not None and os.path.realpath(folder) == os.path.realpath(home):
        return craft
    naming = [
        include
        for include in craft.includes
        if include.nested or _names_files(include.content.root)
    ]
    out = craft.edit(undo.replace_include(craft, include) for include in naming)
    parts = out.parts()
    edits: list[Edit] = []
    for node in out.root.iter("include", "model"):
        path = node.get("file") or ""
        if path and not os.path.isabs(path):
            change = {"file": relative_path(path, home, folder)}
            edits.append(undo.change_marked(out, node, undo.PathMark, change))
    if edits or any(_names_files(part) for part in parts):
        compiler = etree.Element("compiler")
        for kind, value in asset_folders(parts).items():
            if not os.path.isabs(value):
                compiler.set(f"{kind}dir", relative_path(value, home, folder))
        mark = undo.CompilerMark(folder="." if folder is None else relative_path(".", home, folder))
        edits.append(undo.append_marked(out, out.root, [(mark, compiler)]))
    return Craft(out.edit(edits).content, home if folder is None else folder, craft.label)


def _names_files(root: Element) -> bool:
    return any(file_attributes(node) for node in root.iter())


def relative_path(
    path: str, start: "str | os.PathLike[str]", new: "str | os.PathLike[str] | None"
) -> str:
    """A relative path seen from another folder; absolute where `new` is None.
    Absolute ones stay."""
    if os.path.isabs(path):
        return path
    full = os.path.normpath(os.path.join(os.path.abspath(start), path))
    if new is None:
        return full
    return os.path.relpath(full, os.path.abspath(new)).replace(os.sep, "/")
