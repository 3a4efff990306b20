"""Poses as the command line writes them: `north=45,south=-45` in degrees and metres, or a
keyframe's name."""

import math
from typing import TYPE_CHECKING

from beamchain.checks import number, unknown
from beamchain.engine.library import mujoco
from beamchain.engine.operating_point import is_slide, keyframe_names, single_joints
from beamchain.errors import InputError
from beamchain.warning_codes import Caution

if TYPE_CHECKING:
    from beamchain.engine.operating_point import Pose

# 30, 45, 90 and 180 degrees [rad], and how near to them a pose in degrees is doubtful
COMMON = (math.pi / 6.0, math.pi / 4.0, math.pi / 2.0, math.pi)
NEAR = 1e-3
FORMS = {
    "--pose": "JOINT=POSITION,... or a keyframe; for example --pose north=45,south=-45, degrees of "
    "hinges and metres of slides",
    "--angle": "JOINT=ANGLES; for example --angle drive=0,45,90 in degrees",
}


def pose_of(model: "mujoco.MjModel", text: str) -> "Pose":
    """What `pose` of `bc.plant` takes for the text of one --pose."""
    keyframes = keyframe_names(model)
    if text in keyframes:
        return text
    if "=" not in text:
        if text in single_joints(model):
            raise InputError(
                f"--pose {text!r} is a joint and no keyframe; give its position, for example "
                f"--pose {text}=45."
            )
        cure = "Or give joints, --pose north=45,south=-45."
        raise unknown("keyframe of --pose", text, keyframes, cure)
    out: dict[str, float] = {}
    for part in text.split(","):
        joint, _, word = part.partition("=")
        if joint in out:
            raise InputError(f"--pose {text!r} gives {joint!r} twice; give each joint once.")
        (out[joint],) = _positions(model, "--pose", text, joint, [word])
    return out


def grid_of(model: "mujoco.MjModel", text: str) -> "Pose":
    """What `pose` of `bc.plant` takes for the text of --angle: a joint and its positions."""
    joint, _, words = text.partition("=")
    return {joint: _positions(model, "--angle", text, joint, words.split(","))}


def poses_given(model: "mujoco.MjModel", poses: list[str], angle: str | None) -> "Pose":
    """What `pose` of `bc.plant` takes for the options: one pose, or several.

    Raises:
        InputError: options that do not go together, or a pose that is given twice.
    """
    if poses and angle is not None:
        raise InputError(
            "--pose and --angle are given together; leave one out, or give every pose as a --pose."
        )
    if angle is not None:
        return grid_of(model, angle)
    each = [pose_of(model, text) for text in poses]
    for i, (text, one) in enumerate(zip(poses, each, strict=True)):
        if one in each[:i]:
            raise InputError(f"--pose {text!r} is given twice; give each pose once.")
    return each if len(each) > 1 else each[0] if each else None


def doubtful(model: "mujoco.MjModel", poses: list[str], angle: str | None) -> list[str]:
    """Cautions of --pose and --angle on hinges whose degrees are a common angle in radians."""
    given = [
        ("--pose", part.partition("="))
        for text in poses
        if text not in keyframe_names(model)
        for part in text.split(",")
    ]
    if angle is not None:
        joint, _, words = angle.partition("=")
        given += [("--angle", (joint, "=", word)) for word in words.split(",")]
    out: list[str] = []
    for option, (joint, _, word) in given:
        value = float(word)
        near = [turn for turn in COMMON if abs(abs(value) - turn) <= NEAR]
        if near and not is_slide(model, single_joints(model)[joint]):
            turned = math.copysign(math.degrees(near[0]), value)
            out.append(
                Caution(
                    "pose-in-radians",
                    f"{option} {joint}={word}: poses are in degrees, and this is {turned:g} "
                    f"degrees in radians; for these give {joint}={turned:g}.",
                )
            )
    return list(dict.fromkeys(out))


def _positions(
    model: "mujoco.MjModel", option: str, text: str, joint: str, words: list[str]
) -> list[float]:
    """Positions of a joint [rad, m] from words in degrees or metres, within its range."""
    try:
        given = [float(word) for word in words]
    except ValueError:
        raise InputError(f"{option} {text!r} is not {FORMS[option]}.") from None
    singles = single_joints(model)
    if joint not in singles:
        raise unknown(f"joint of {option}", joint, singles)
    place = singles[joint]
    unit, scale = ("m", 1.0) if is_slide(model, place) else ("degrees", math.pi / 180.0)
    low, high = (float(end) / scale for end in model.jnt_range[place])
    for value in given:
        number(f"{option} {text!r}: {joint}", value, unit, cure="Give a position.")
        if model.jnt_limited[place] and not low <= value <= high:
            raise InputError(
                f"{option} {text!r}: joint {joint!r} = {value:g} is outside its range, {low:.6g} "
                f"to {high:.6g} {unit}; give a position within it."
            )
    return [value * scale for value in given]
