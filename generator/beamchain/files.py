"""Files: TOML read in bounded time; outputs written whole or not at all,
by a temporary file and a rename; JSON."""

import json
import math
import os
import re
import secrets
import stat
import tomllib
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from beamchain.errors import InputError, OutputError

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


Files = Mapping[Path, str | bytes] | Sequence[tuple[Path, str | bytes]]  # contents by path

#: files that the call in progress has read; None where nobody asks
_INPUTS: ContextVar[list[Path] | None] = ContextVar("inputs", default=None)


@contextmanager
def noted_inputs() -> Generator[list[Path]]:
    """Files read within it, as they are read; `write_files` within it replaces none of them."""
    paths: list[Path] = []
    token = _INPUTS.set(paths)
    try:
        yield paths
    finally:
        _INPUTS.reset(token)
        outer = _INPUTS.get()
        if outer is not None:
            outer.extend(paths)


def note_input(path: Path) -> None:
    """Every reader of a user's file calls this, see `noted_inputs`."""
    paths = _INPUTS.get()
    if paths is not None:
        paths.append(Path(path).absolute())


def write_files(
    files: Files,
    *,
    force: bool,
    inputs: Iterable[Path] = (),
    update: tuple[Path, Path] | None = None,
) -> None:
    """Write all files, or none, in the order given:
    the last one's presence means that all are there.

    New files get the permissions that the umask leaves, others keep theirs. `inputs`: files that
    the contents were made from; `update`: one of them, and the output that is its new version and
    so may take its place.

    An `OutputError` says that a file exists and `force` is False, that an output is an input or
    another output, or that a folder cannot be written; nothing is left behind.
    """
    pairs = list(files.items()) if isinstance(files, Mapping) else list(files)
    check_outputs([path for path, _ in pairs], force=force, inputs=inputs, update=update)
    contents = [
        text.encode("utf-8", "backslashreplace") if isinstance(text, str) else text
        for _, text in pairs
    ]
    made: list[Path] = []
    waiting: list[tuple[Path, Path]] = []
    fresh: list[Path] = []  # in place, and new there
    try:
        for (path, _), content in zip(pairs, contents, strict=True):
            _make_folder(path.parent, made)
            temporary = path.with_name(f".{secrets.token_hex(8)}.part")
            waiting.append((temporary, path))
            _write_whole(temporary, content, like=path)
        # the last one says that all are there: an old one must not say it of new files
        if len(waiting) > 1:
            waiting[-1][1].unlink(missing_ok=True)
        for temporary, path in waiting:
            if not os.path.lexists(path):
                fresh.append(path)
            temporary.replace(path)
    except BaseException as error:
        for leftover in (*(temporary for temporary, _ in waiting), *fresh):
            leftover.unlink(missing_ok=True)
        for folder in reversed(made):
            if not any(folder.iterdir()):
                folder.rmdir()
        if not isinstance(error, OSError):
            raise
        place = pairs[0][0].parent
        raise OutputError(
            f"cannot write to {str(place)!r}: {error.strerror}; choose a folder you may write to."
        ) from None


def _write_whole(path: Path, content: bytes, like: Path) -> None:
    """Write a new file to the disk, with the permissions of `like` if that exists."""
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    with os.fdopen(handle, "wb") as stream:
        if like.is_file():
            path.chmod(like.stat().st_mode & 0o777)
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


def check_free(path: Path, *, force: bool) -> None:
    """Refuse a place where something stands that may not be replaced,
    before long work is done for it."""
    check_outputs([path], force=force)


def check_outputs(
    paths: Iterable[Path],
    *,
    force: bool,
    inputs: Iterable[Path] = (),
    update: tuple[Path, Path] | None = None,
) -> None:
    """Refuse outputs that cannot be written, before long work is done for them;
    arguments as of `write_files`."""
    outputs = list(paths)
    for path in outputs:
        check_name(path)
        check_regular(path)
    read = [*inputs, *(_INPUTS.get() or ())]
    for i, path in enumerate(outputs):
        for other in outputs[:i]:
            if _same(path, other):
                raise OutputError(
                    f"outputs {str(other)!r} and {str(path)!r} are one file; give each a name of "
                    "its own."
                )
        for source in read:
            is_update = update is not None and _same(update[0], source) and _same(update[1], path)
            if not is_update and _same(path, source):
                raise OutputError(
                    f"output {str(path)!r} is the file {str(source)!r} that is read for it; give "
                    "another name: --force replaces no input."
                )
    for path in outputs:
        if os.path.lexists(path) and not force:
            raise OutputError(
                f"output {str(path)!r} exists; use --force to replace it, or give another place."
            )


def _same(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file, whether it exists or not."""
    if os.path.realpath(one) == os.path.realpath(other):
        return True
    try:
        return one.samefile(other)
    except OSError:  # one of them does not exist
        return False


def check_name(path: Path) -> None:
    """Refuse a path that ends in no file's name, or that is no text."""
    if path.name in ("", "..") or "\0" in str(path):
        raise OutputError(f"output {str(path)!r} has no file name; give one.")
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        raise OutputError(f"output {str(path)!r} is not UTF-8 text; give another name.") from None


def beside(path: Path, ending: str) -> Path:
    """The file that a command writes beside its output, with the same stem."""
    check_name(path)
    return path.with_name(f"{path.stem}{ending}")


def check_regular(path: Path) -> None:
    """Refuse a place where something stands that is no file:
    a rename would put a file in a device's place.

    Also a link that leads to or stands among devices,
    and a place below something that is no folder.
    """
    try:
        mode = path.stat().st_mode
    except NotADirectoryError:
        raise OutputError(
            f"cannot write to {str(path.parent)!r}: Not a directory; choose a folder you may write "
            "to."
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


def check_utf8(content: bytes, what: str) -> None:
    """Refuse an XML file in another encoding."""
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{what} is not UTF-8 (byte {error.start}), as which MuJoCo takes every file, whatever "
            "it declares; convert it, for example: iconv -f LATIN1 -t UTF-8 craft.xml > utf8.xml."
        ) from None


def no_file(path: Path) -> str | None:
    """What a path is, in words, that names no regular file; None where it does."""
    try:
        if path.is_file():
            return None
        return (
            "is a folder"
            if path.is_dir()
            else "does not exist"
            if not path.exists()
            else "is no regular file"
        )
    except (OSError, ValueError) as error:  # a name that is too long, or holds a zero
        return f"cannot be read ({getattr(error, 'strerror', None) or error})"


def tables(content: str) -> dict[str, Any]:
    """The tables of TOML text; a `ValueError` says that it is none,
    a `RecursionError` that it is nested too deeply."""
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
