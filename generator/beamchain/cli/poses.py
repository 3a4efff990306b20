"""Poses as the command line writes them: `north=45,south=-45` in degrees and metres, or a
keyframe's name."""

import math
from typing import TYPE_CHECKING

from beamchain.checks import number, unknown
from beamchain.engine.operating_point import is_slide, keyframe_names, single_joints
from beamchain.errors import InputError

if TYPE_CHECKING:
    import mujoco

    from beamchain.engine.operating_point import At

EXAMPLE = "--pose north=45,south=-45 (degrees of hinges, metres of slides)"


def pose_of(model: "mujoco.MjModel", text: str) -> "At":
    """What `at` of `bc.plant` takes for the text of one --pose."""
    keyframes = keyframe_names(model)
    if text in keyframes:
        return text
    if "=" not in text:
        if text in single_joints(model):
            raise InputError(
                f"--pose {text!r} is a joint and no keyframe; give its position, for example "
                f"--pose {text}=45."
            )
        raise unknown("keyframe of --pose", text, keyframes, f"Or give joints: {EXAMPLE}.")
    out: dict[str, float] = {}
    for part in text.split(","):
        joint, equals, word = part.partition("=")
        if not equals:
            raise InputError(
                f"--pose {text!r}: {part!r} is not JOINT=POSITION; write for example {EXAMPLE}."
            )
        if joint in out:
            raise InputError(f"--pose {text!r} gives {joint!r} twice; give each joint once.")
        out[joint] = _position(model, "--pose", text, joint, word)
    return out


def grid_of(model: "mujoco.MjModel", text: str) -> "At":
    """What `at` of `bc.plant` takes for the text of --angle: a joint and its positions."""
    joint, equals, words = text.partition("=")
    if not equals:
        raise InputError(
            f"--angle {text!r} is not JOINT=ANGLES; for example --angle drive=0,45,90 in degrees."
        )
    return {joint: [_position(model, "--angle", text, joint, word) for word in words.split(",")]}


def _position(model: "mujoco.MjModel", option: str, text: str, joint: str, word: str) -> float:
    """A joint's position [rad, m] from its word in degrees or metres, within its range."""
    singles = single_joints(model)
    if joint not in singles:
        raise unknown(f"joint of {option}", joint, singles)
    place = singles[joint]
    unit = "m" if is_slide(model, place) else "degrees"
    try:
        given = number(f"{option} {text!r}: {joint}", float(word), unit)
    except ValueError:
        raise InputError(
            f"{option} {text!r}: {word!r} is not a position of {joint!r} in {unit}; write for "
            f"example {EXAMPLE if option == '--pose' else '--angle drive=0,45,90'}."
        ) from None
    scale = 1.0 if unit == "m" else math.pi / 180.0
    low, high = (float(end) for end in model.jnt_range[place])
    if model.jnt_limited[place] and not low <= given * scale <= high:
        raise InputError(
            f"{option} {text!r}: joint {joint!r} = {given:g} is outside its range, "
            f"{low / scale:.6g} to {high / scale:.6g} {unit}; give a position within it."
        )
    return given * scale
