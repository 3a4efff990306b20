"""Reading without surprises: bounded size, plain text, one sentence where a file is not what it should be."""

from collections.abc import Iterator
from pathlib import Path

from beamchain.errors import InputError
from beamchain.files import LARGEST_TOML

LARGEST_FILE = 500_000_000  # bytes of a print; a model with 1e5 nodes and 100 mode shapes stays below
LARGEST_JSON = 10_000_000
LONGEST_LINE = 10_000  # characters


def check_size(path: Path, largest: int = LARGEST_FILE) -> None:
    """Refuse files that are empty or too large."""
    try:
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"file {str(path)!r} cannot be read ({error.strerror}); check the path.") from None
    if size == 0:
        raise InputError(f"file {str(path)!r} is empty; export the modes again.")
    if size > largest:
        raise InputError(
            f"file {str(path)!r} has {size} bytes, more than the {largest} taken; print the modes without the mode "
            "shapes."
        )


def lines(path: Path) -> Iterator[str]:
    """Lines of a print without their ends."""
    check_size(path)
    try:
        with path.open("r", encoding="latin-1", newline=None) as stream:
            for number, line in enumerate(stream, 1):
                if "\0" in line or len(line) > LONGEST_LINE:
                    raise InputError(
                        f"file {str(path)!r} is no text (line {number}); give the printed file, not the binary one."
                    )
                yield line.rstrip("\n")
    except OSError as error:
        raise InputError(f"file {str(path)!r} cannot be read ({error.strerror}); check its permissions.") from None


def text(path: Path, largest: int = LARGEST_TOML) -> str:
    """A whole UTF-8 file."""
    check_size(path, largest)
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"file {str(path)!r} is not UTF-8 text (byte {error.start}); save it as UTF-8.") from None
    except OSError as error:
        raise InputError(f"file {str(path)!r} cannot be read ({error.strerror}); check its permissions.") from None
