"""TOML files that users write, read into their structs; what is wrong with them in a sentence."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from beamchain.checks import kind_of
from beamchain.errors import InputError
from beamchain.files import LARGEST_TOML, no_file, note_input, tables
from beamchain.fitting.sentences import sentence

T = TypeVar("T")


def read_struct(path: "str | Path | T", kind: type[T], word: str, holds: str) -> T:
    """A struct from its TOML file, or as it was given;
    messages call the file `word` and say what it `holds`."""
    if isinstance(path, kind):
        return path
    if not isinstance(path, str | Path):
        raise InputError(
            f"{word} = {path!r:.60} is {kind_of(path)}; give the path of {holds}, or its "
            f"{kind.__name__}."
        )
    return convert(read_tables(Path(path), word, holds), kind, str(path))


def read_tables(path: Path, word: str, holds: str) -> dict[str, Any]:
    """The tables of a TOML file; arguments as of `read_struct`."""
    try:
        note_input(path)
        if kind := no_file(path):
            raise InputError(f"{word} {str(path)!r} {kind}; give the path of {holds}.")
        size = path.stat().st_size
        if size > LARGEST_TOML:
            raise InputError(
                f"{word} {str(path)!r} has {size} bytes, more than the {LARGEST_TOML} taken; it is "
                "a page of text."
            )
        content = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{word} {str(path)!r} is not UTF-8 text ({error.reason} at byte {error.start}); save "
            "it as UTF-8."
        ) from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{word} {str(path)!r} cannot be read ({error}); check the path and its permissions."
        ) from None
    try:
        return tables(content)
    except ValueError as error:
        raise InputError(
            f"{word} {str(path)!r} is not TOML: {error}. Strings need quotes, tables [brackets]."
        ) from None
    except RecursionError:
        raise InputError(
            f"{word} {str(path)!r} is nested too deeply; flatten its tables."
        ) from None


def convert(data: Mapping[str, Any], kind: type[T], source: str) -> T:
    """A checked struct from parsed TOML; errors name the `source`."""
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise InputError(f"{source}: {sentence(str(error), data, kind)}") from None
    except RecursionError:
        raise InputError(f"{source}: nested too deeply; flatten its tables.") from None
