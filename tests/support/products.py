"""The packages beside the core that are there: each may be taken out together with its tests."""

from pathlib import Path

import beamchain

#: each, and the command that it adds
COMMANDS = {
    "robust": "worst-case",
    "pointing": "pointing",
    "identification": "identify",
    "worlds": None,
}
PRODUCTS = tuple(
    name for name in COMMANDS if (Path(beamchain.__file__).parent / name / "__init__.py").is_file()
)
GONE = tuple(name for name in COMMANDS if name not in PRODUCTS)


def is_gone(word: str) -> bool:
    """Whether a command, or a name typed after `beamchain`, is of a package that was taken out."""
    return any(word == COMMANDS[name] or f"{word}.".startswith(f"{name}.") for name in GONE)
