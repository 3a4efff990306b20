"""TOML that a user wrote, as tables, in bounded time."""

import re
import tomllib
from typing import Any

LARGEST_TOML = 2_000_000  # bytes: tomllib reads about a megabyte in a second

#: A dotted key of 50 parts or more: tomllib takes minutes for 100,000 of them.
_DEEP_KEY = re.compile(r"""(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){50}""")


def tables(content: str) -> dict[str, Any]:
    """The tables of TOML text.

    Raises:
        ValueError: it is no TOML, or a number has thousands of digits.
        RecursionError: it is nested too deeply.
    """
    if _DEEP_KEY.search(content):
        raise RecursionError("a dotted key of 50 parts or more")
    return tomllib.loads(content)
