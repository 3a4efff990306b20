"""Step limits of a model as the command `inspect` states them."""

import tempfile
from pathlib import Path
from typing import Any

from command import call


def inspected(source: str | Path) -> dict[str, Any]:
    """The record of `beamchain inspect MODEL.xml --json` for a path or for MJCF text;
    timing is taken out of its limits."""
    with tempfile.TemporaryDirectory() as folder:
        path = source
        if isinstance(source, str):
            path = Path(folder) / "model.xml"
            path.write_text(source)
        answer = call("inspect", path, "--json")
    assert answer.status == 0, answer.err
    return answer.record


def largest_steps(source: str | Path) -> dict[str, float]:
    """Largest stable step per integrator [s]; infinity: no limit."""
    stated = inspected(source)["stability"]["largest_step"]
    return {name: float("inf") if step is None else step for name, step in stated.items()}
