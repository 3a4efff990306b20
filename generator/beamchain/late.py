"""Names that are imported when they are first asked for.

Python lets a thread see a half imported module where two threads import modules that import each
other, as modules of Matplotlib, SciPy and MuJoCo do. So one thread at a time imports.
"""

from collections.abc import Callable
from threading import RLock
from typing import Any

import lazy_loader

importing = RLock()


def attach(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a module whose names stand in its `.pyi`.

    Args:
        package: that the imports in the `.pyi` are relative to.
        file: of the module.
    """
    find, names, every = lazy_loader.attach_stub(package, file)

    def under_the_lock(name: str) -> Any:
        with importing:
            return find(name)

    return under_the_lock, names, every
