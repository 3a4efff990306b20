"""Margins of a controller as `beamchain plant --controller` states them, and of a lone loop."""

import copy
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import control
import numpy as np

import beamchain as bc
from command import Answer, call
from random_appendages import toml


def written(loops: list[dict[str, Any]], folder: Path) -> Path:
    """A controller's file of loops."""
    path = folder / "loops.toml"
    path.write_text(toml({"loop": loops}))
    return path


def asked(model: Path, loops: list[dict[str, Any]], *words: object) -> Answer:
    """The command's answer for a spacecraft's file, in JSON."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        call_of = [
            "plant",
            model,
            "--controller",
            written(loops, place),
            "-o",
            place / "plant.npz",
            "--json",
        ]
        return call(*call_of, *words)


def margins(model: Path, loops: list[dict[str, Any]], *words: object) -> list[SimpleNamespace]:
    """One per input that a loop drives; where there is no limit infinity,
    of an unstable loop NaN."""
    answer = asked(model, loops, *words)
    assert answer.status in (0, 3), answer.err
    (found,) = answer.record["margins"]
    stated = []
    for one in found:
        nothing = np.inf if one["stable"] else np.nan
        stated.append(
            SimpleNamespace(
                **{key: nothing if value is None else value for key, value in one.items()}
            )
        )
    assert answer.status == (0 if all(one.stable for one in stated) else 3)
    return stated


def scaled(loops: list[dict[str, Any]], number: int, factor: float) -> list[dict[str, Any]]:
    """The loops with the gain of one times a factor."""
    out = copy.deepcopy(loops)
    out[number]["numerator"] = [factor * value for value in out[number]["numerator"]]
    return out


def loop_of(plant: Any, delay: float = 0.0) -> Any:
    """Margins of a plant under 1, the loop closed with minus."""
    system = control.ss(plant)
    controller = bc.spec.Controller(
        loop=(
            bc.spec.Loop(
                input=system.input_labels[0],
                output=system.output_labels[0],
                numerator=[1.0],
                denominator=[1.0],
                delay=delay,
            ),
        )
    )
    return bc.margins(system, controller)
