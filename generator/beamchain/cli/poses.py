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
FORM = (
    "JOINT=POSITION,... or a keyframe; for example --pose north=45,south=-45, degrees of hinges "
    "and metres of slides, or --pose drive=0,45,90, a pose each"
)


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
    out: dict[str, list[float]] = {}
    for joint, words in _parts(text):
        if joint in out:
            raise InputError(f"--pose {text!r} gives {joint!r} twice; give each joint once.")
        out[joint] = _positions(model, text, joint, words)
    if len(out) == 1 and len(next(iter(out.values()))) > 1:
        return dict(out)
    if any(len(values) > 1 for values in out.values()):
        raise InputError(
            f"--pose {text!r} gives several positions of a joint, and another joint; give each "
            "pose as a --pose."
        )
    return {joint: value for joint, (value,) in out.items()}


def poses_given(model: "mujoco.MjModel", poses: list[str]) -> "Pose":
    """What `pose` of `bc.plant` takes for every --pose: one pose, or several.

    Raises:
        InputError: a pose that is given twice, or beside several positions of a joint.
    """
    each = [pose_of(model, text) for text in poses]
    for i, (text, one) in enumerate(zip(poses, each, strict=True)):
        if one in each[:i]:
            raise InputError(f"--pose {text!r} is given twice; give each pose once.")
        if len(each) > 1 and isinstance(one, dict) and isinstance(next(iter(one.values())), list):
            raise InputError(
                f"--pose {text!r} is several poses; leave the others out, or give each as a --pose."
            )
    return each if len(each) > 1 else each[0] if each else None


def doubtful(model: "mujoco.MjModel", poses: list[str]) -> list[str]:
    """Cautions of --pose on hinges whose degrees are a common angle in radians."""
    given = [
        (joint, word)
        for text in poses
        if text not in keyframe_names(model)
        for joint, words in _parts(text)
        for word in words
    ]
    out: list[str] = []
    for joint, word in given:
        value = float(word)
        near = [turn for turn in COMMON if abs(abs(value) - turn) <= NEAR]
        if near and not is_slide(model, single_joints(model)[joint]):
            turned = math.copysign(math.degrees(near[0]), value)
            out.append(
                Caution(
                    "pose-in-radians",
                    f"--pose {joint}={word}: poses are in degrees, and this is {turned:g} "
                    f"degrees in radians; for these give {joint}={turned:g}.",
                )
            )
    return list(dict.fromkeys(out))


def _parts(text: str) -> list[tuple[str, list[str]]]:
    """Joints of a --pose, and the words that stand for positions of each."""
    out: list[tuple[str, list[str]]] = []
    for part in text.split(","):
        joint, equal, word = part.partition("=")
        if equal or not out:
            out.append((joint, [word]))
        else:
            out[-1][1].append(part)
    return out


def _positions(model: "mujoco.MjModel", text: str, joint: str, words: list[str]) -> list[float]:
    """Positions of a joint [rad, m] from words in degrees or metres, within its range."""
    try:
        given = [float(word) for word in words]
    except ValueError:
        raise InputError(f"--pose {text!r} is not {FORM}.") from None
    singles = single_joints(model)
    if joint not in singles:
        raise unknown("joint of --pose", joint, singles)
    place = singles[joint]
    unit, scale = ("m", 1.0) if is_slide(model, place) else ("degrees", math.pi / 180.0)
    low, high = (float(end) / scale for end in model.jnt_range[place])
    for value in given:
        number(f"--pose {text!r}: {joint}", value, unit, cure="Give a position.")
        if model.jnt_limited[place] and not low <= value <= high:
            raise InputError(
                f"--pose {text!r}: joint {joint!r} = {value:g} is outside its range, {low:.6g} "
                f"to {high:.6g} {unit}; give a position within it."
            )
    return [value * scale for value in given]
