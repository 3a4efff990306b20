"""Spacecraft with numbers that are none, or that no computer adds: by name,
MJCF and the word its answer must hold."""

import random

BODY = (
    '<body name="bus" pos="{pos}"><freejoint/><inertial pos="0 0 0" mass="{mass}" '
    'diaginertia="{inertia}"/>{inside}</body>'
)
GOOD = {
    "pos": "0 0 0",
    "mass": "300",
    "inertia": "90 90 90",
    "inside": '<site name="mount" pos="0.5 0 0"/>',
}
WORDS = ("nan", "inf", "-inf", "NaN", "1e999", "-1e400")


def craft(option: str = "", behind: str = "", before: str = "", **changed: str) -> str:
    """MJCF text of a free body with a place for an appendage."""
    body = BODY.format(**{**GOOD, **changed})
    return f"<mujoco>{before}<option {option}/><worldbody>{body}</worldbody>{behind}</mujoco>"


NUMBERS = {
    "NaN in a place": (craft(pos="0 nan 0"), "body_pos of 'bus'"),
    "infinity in a place": (craft(pos="inf 0 0"), "body_pos of 'bus'"),
    "NaN in a site": (craft(inside='<site name="mount" pos="nan 0 0"/>'), "mount"),
    "NaN in gravity": (craft('gravity="0 0 nan"'), "gravity"),
    "infinity in gravity": (craft('gravity="0 0 -inf"'), "gravity"),
    "NaN in a keyframe": (
        craft(behind='<keyframe><key name="far" qpos="nan 0 0 1 0 0 0"/></keyframe>'),
        "'far'",
    ),
    "a speed without end in a keyframe": (
        craft(behind='<keyframe><key name="far" qvel="inf 0 0 0 0 0"/></keyframe>'),
        "'far'",
    ),
    "no step": (craft('timestep="0"'), "timestep> = 0.0 s must lie from"),
    "a negative step": (craft('timestep="-0.01"'), "timestep> = -0.01 s must lie from"),
    "a step next to nothing": (craft('timestep="1e-300"'), "timestep> = 1e-300 s must lie from"),
    "a step without end": (craft('timestep="1e30"'), "timestep> = 1e+30 s must lie from"),
    "a wind of NaN": (craft('wind="nan 0 0"'), "wind"),
}


def random_numbers(seed: int) -> str:
    """A craft one of whose numbers is replaced."""
    rng = random.Random(seed)
    text = craft(
        'timestep="0.01" gravity="0 0 0"',
        '<keyframe><key name="far" qpos="0 0 0 1 0 0 0"/></keyframe>',
    )
    places = [
        i
        for i, word in enumerate(text.split('"'))
        if i % 2 and all(c in "0123456789. e-" for c in word)
    ]
    pieces = text.split('"')
    place = rng.choice(places)
    words = pieces[place].split()
    words[rng.randrange(len(words))] = rng.choice((*WORDS, "1e300", "1e-300", "-1", "0", "1e30"))
    pieces[place] = " ".join(words)
    return '"'.join(pieces)
