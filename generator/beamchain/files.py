"""Files: TOML read in bounded time; outputs written whole or not at all, by a temporary file and a rename; JSON."""

import json
import math
import os
import re
import stat
import tempfile
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from beamchain.errors import OutputError

LARGEST_TOML = 2_000_000  # bytes: tomllib reads about a megabyte in a second

#: A dotted key of 50 parts or more: tomllib takes minutes for 100,000 of them.
_DEEP_KEY = re.compile(r"""(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){50}""")

NOT_FILES = {
    stat.S_ISDIR: "a folder",
    stat.S_ISCHR: "a device",
    stat.S_ISBLK: "a device",
    stat.S_ISFIFO: "a fifo",
    stat.S_ISSOCK: "a socket",
}


def write_files(files: Mapping[Path, str | bytes], *, force: bool) -> None:
    """Write all files, or none, in the order given: the last one's presence means that all are there.

    An `OutputError` says that a file exists and `force` is False, or that a folder cannot be written; nothing is left
    behind.
    """
    for path in files:
        check_free(path, force=force)
    made: list[Path] = []
    waiting: list[tuple[Path, Path]] = []
    try:
        for path, content in files.items():
            _make_folder(path.parent, made)
            handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
            waiting.append((Path(name), path))
            with os.fdopen(handle, "wb") as stream:
                stream.write(content.encode("utf-8") if isinstance(content, str) else content)
                stream.flush()
                os.fsync(stream.fileno())
        if len(waiting) > 1:  # the last one says that all are there: an old one must not say it of new files
            waiting[-1][1].unlink(missing_ok=True)
        for temporary, path in waiting:
            temporary.chmod(0o644)
            temporary.replace(path)
    except OSError as error:
        for temporary, _ in waiting:
            temporary.unlink(missing_ok=True)
        for folder in reversed(made):
            if not any(folder.iterdir()):
                folder.rmdir()
        place = next(iter(files)).parent
        raise OutputError(
            f"cannot write to {str(place)!r}: {error.strerror}; choose a folder you may write to."
        ) from None


def check_free(path: Path, *, force: bool) -> None:
    """Refuse a place where something stands that may not be replaced, before long work is done for it."""
    check_regular(path)
    if os.path.lexists(path) and not force:
        raise OutputError(f"output {str(path)!r} exists; use --force to replace it, or give another place.")


def check_regular(path: Path) -> None:
    """Refuse a place where something stands that is no file: a rename would put a file in a device's place.

    Also a link that leads to or stands among devices, and a place below something that is no folder.
    """
    try:
        mode = path.stat().st_mode
    except NotADirectoryError:
        raise OutputError(
            f"cannot write to {str(path.parent)!r}: Not a directory; choose a folder you may write to."
        ) from None
    except OSError:  # nothing there, or a link to nothing, which --force may replace
        return
    among = path.is_symlink() and path.absolute().parts[1:2] in (("dev",), ("proc",), ("sys",))
    if stat.S_ISREG(mode) and not among:
        return
    kind = next((word for test, word in NOT_FILES.items() if test(mode)), "no regular file")
    raise OutputError(f"output {str(path)!r} is {kind}; give another name.")


def _make_folder(folder: Path, made: list[Path]) -> None:
    missing = [folder, *folder.parents]
    missing = [place for place in missing if not place.exists()]
    for place in reversed(missing):
        place.mkdir()
        made.append(place)


def no_file(path: Path) -> str | None:
    """What a path is, in words, that names no regular file; None where it does."""
    if path.is_file():
        return None
    return "is a folder" if path.is_dir() else "does not exist" if not path.exists() else "is no regular file"


def tables(content: str) -> dict[str, Any]:
    """The tables of TOML text; a `ValueError` says that it is none, a `RecursionError` that it is nested too deeply."""
    if _DEEP_KEY.search(content):
        raise RecursionError("a dotted key of 50 parts or more")
    return tomllib.loads(content)


def to_json(record: dict[str, Any]) -> str:
    """JSON text, strict: a number that is not finite becomes null (no limit)."""
    return json.dumps(_plain(record), indent=2, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy's arrays and scalars
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
