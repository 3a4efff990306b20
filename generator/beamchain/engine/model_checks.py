"""What every compiled model must be before it is worked with: all numbers finite,
its step one that can be taken."""

from typing import Any

import numpy as np

from beamchain.engine.library import mujoco, quiet
from beamchain.engine.model_diff import DERIVED, KINDS, NAMED
from beamchain.errors import InputError

SHORTEST_STEP = 1e-15  # s; beyond these two a step's products leave double precision
LONGEST_STEP = 1e3  # s
TRIAL = 200  # steps: what grows by a fifth in each passes MuJoCo's largest value from 1e-6
TRIAL_MOTION = 1e-6  # m or rad per step or per second of the trial's start, whichever is slower
ENDLESS = ("range", "margin")  # fields of which infinity may be meant
_FIELDS: dict[type, tuple[str, ...]] = {}  # of real numbers, by the kind of what holds them
#: MuJoCo's warnings that something is no number or beyond its largest
BAD = tuple(
    int(getattr(mujoco.mjtWarning, f"mjWARN_{word}"))
    for word in ("BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")
)


def check_model(model: "mujoco.MjModel", what: str) -> None:
    """Refuse a model with a number that is not finite, or a step that cannot be taken.

    Args:
        model: compiled.
        what: how messages call it.

    Raises:
        InputError: names the element and the number.
    """
    check_step(float(model.opt.timestep), f"{what}: <option timestep>")
    for holder, word in ((model, ""), (model.opt, "option "), (model.stat, "statistic ")):
        for field in _real_fields(holder):
            values = np.asarray(getattr(holder, field))
            finite = np.isfinite(values)
            if field.endswith(ENDLESS):
                finite |= np.isinf(values)
            if not np.all(finite):
                at = tuple(np.argwhere(~finite)[0].tolist())
                name = f"{word}{field}" if word else _element(model, field, at)
                raise InputError(
                    f"{what}: {name} is {float(values[at])!r}; every number of a model must be "
                    "finite: correct it in the file."
                )


def check_step(timestep: float, what: str) -> None:
    """Refuse a step [s] that no model can take; `what`: how the message calls it."""
    if not SHORTEST_STEP <= timestep <= LONGEST_STEP:
        raise InputError(
            f"{what} = {timestep!r} s must lie from {SHORTEST_STEP:g} to {LONGEST_STEP:g} s; 0.01 "
            "s is usual."
        )


def steps_well(model: "mujoco.MjModel") -> bool:
    """Whether a model takes some hundred steps from a slight motion without a
    warning that it diverges."""
    data = mujoco.MjData(model)
    data.qvel[:] = TRIAL_MOTION / max(float(model.opt.timestep), 1.0) * np.cos(np.arange(model.nv))
    with quiet():
        for _ in range(TRIAL):
            mujoco.mj_step(model, data)
            if any(data.warning[kind].number for kind in BAD):
                return False
    return bool(np.all(np.isfinite(data.qpos)) and np.all(np.isfinite(data.qvel)))


def _real_fields(holder: Any) -> tuple[str, ...]:
    """Names of the fields that hold real numbers from the file;
    which they are does not depend on the model."""
    kind = type(holder)
    if kind not in _FIELDS:
        _FIELDS[kind] = tuple(
            field
            for field in dir(holder)
            if not field.startswith("_")
            and not any(word in field for word in DERIVED)
            and _real(getattr(holder, field))
        )
    return _FIELDS[kind]


def _real(value: object) -> bool:
    """Whether it is a real number or an array of them."""
    return isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype.kind == "f")


def _element(model: "mujoco.MjModel", field: str, at: tuple[int, ...]) -> str:
    """The field of an element, with the element's name."""
    kind = next((word for word in (*KINDS, "key") if field.startswith(f"{word}_")), "")
    get = getattr(model, "key" if kind == "key" else NAMED.get(kind, ""), None)
    if get is None or not at:
        return f"{field} ({', '.join(str(i) for i in at)})"
    return f"{field} of {get(at[0]).name or f'{kind} {at[0]}'!r}"
