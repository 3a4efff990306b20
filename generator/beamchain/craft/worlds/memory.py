"""Whether so many worlds fit in memory, before they are made."""

import os
from pathlib import Path

from beamchain.errors import InputError

LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")  # of a container


def available() -> float:
    """Memory that is free for new arrays [bytes]; infinity where the system does not say."""
    out = float("inf")
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        out = 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration, ValueError):
        if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
            out = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    for path in LIMITS:
        try:
            out = min(out, float(Path(path).read_text(encoding="ascii")))
        except (OSError, ValueError):  # no limit is written as "max"
            continue
    return out


def check(count: int, each: float, free: float) -> None:
    """Refuse worlds that need more than there is.

    Args:
        count: number of worlds.
        each: bytes of one.
        free: bytes there are.
    """
    if count * each > free:
        raise InputError(
            f"{count} worlds need {_said(count * each)} ({_said(each)} each), and {_said(free)} are free; at most "
            f"{int(free / each)} fit: give count a smaller value."
        )


def _said(size: float) -> str:
    for unit in ("B", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.4g} GB"
