"""Names that are imported when they are first asked for.

Python lets a thread see a half imported module where two threads import modules that import each
other, as modules of Matplotlib, SciPy and MuJoCo do. So one thread at a time imports.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from threading import RLock
from typing import Any

import lazy_loader

importing = RLock()


def attach(
    module: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a module whose names stand in its `.pyi`.

    Args:
        module: its name.
        file: its path.
    """
    package = module if Path(file).stem == "__init__" else module.rpartition(".")[0]
    find, names, every = lazy_loader.attach_stub(package, file)

    def of_module(name: str) -> Any:
        if name not in every:
            raise AttributeError(
                f"module {module!r} has no attribute {name!r}; it has {', '.join(sorted(every))}"
            )
        with importing:
            value = find(name)
        setattr(sys.modules[module], name, value)  # not asked for again
        return value

    return of_module, names, every
