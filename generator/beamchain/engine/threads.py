"""Linear algebra on one thread: matrices of a hundred rows lose by more, and by a hundred times on a busy machine."""

import ctypes
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import cache, partial

import numpy as np
from scipy.linalg import cython_blas

STEMS = ("scipy_openblas_{}_num_threads64_", "scipy_openblas_{}_num_threads", "openblas_{}_num_threads64_",
         "openblas_{}_num_threads")  # fmt: skip


@contextmanager
def one_thread() -> Generator[None]:
    """Within it OpenBLAS, NumPy's and SciPy's, works on one thread."""
    before = [(put, int(get())) for get, put in _switches()]
    try:
        for put, _ in before:
            put(1)
        yield
    finally:
        for put, count in before:
            put(count)


@cache
def _switches() -> tuple[tuple[Callable[[], int], Callable[[int], object]], ...]:
    """Per OpenBLAS that is loaded: what reads its number of threads, and what sets it."""
    out: list[tuple[Callable[[], int], Callable[[int], object]]] = []
    for module in (getattr(np.linalg, "_umath_linalg", None), cython_blas):
        try:
            # a symbol is looked for in what the module itself loads
            library = ctypes.CDLL(str(getattr(module, "__file__", "none")))
        except (AttributeError, OSError):
            continue
        for stem in STEMS:
            get, put = (getattr(library, stem.format(verb), None) for verb in ("get", "set"))
            if get is not None and put is not None:
                out.append((partial(get), partial(put)))
                break
    return tuple(out)
