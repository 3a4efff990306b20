"""The comments that `embed` writes, damaged key by key: one sentence each, or a file without them.

Every key of every kind of mark is dropped and given values of other types; marks are cut, repeated
and taken out.
"""

import json
import random
import re

import pytest

import beamchain as bc
from command import call
from spacecraft import CRAFTS

MARK = re.compile(r"<!-- beamchain embed (\{.*?\}) -->")
WRONG = (3, "x", None, [1], {"a": 1}, True)
MANY = 6  # damaged contents of each kind of mark


def damaged(value):
    """A mark's content with one key dropped, added or wrongly typed, at any depth."""
    if isinstance(value, dict):
        yield {**value, "surplus": 1}
        for key, inner in value.items():
            yield {k: v for k, v in value.items() if k != key}
            yield from ({**value, key: v} for v in WRONG if type(v) is not type(inner))
            yield from ({**value, key: inside} for inside in damaged(inner))
    elif isinstance(value, list) and value:
        yield from ([inside, *value[1:]] for inside in damaged(value[0]))


def spoilt(text):
    """The text with one of its marks damaged."""
    known = {}
    for mark in MARK.finditer(text):
        known.setdefault(json.loads(mark[1])["piece"], mark)
    for mark in known.values():
        for start, stop, new in (
            (mark.start(1), mark.end(1), mark[1][: len(mark[1]) // 2]),
            (mark.start(), mark.start(), mark[0]),
            (mark.start(), mark.end(), ""),
            (mark.start(1), mark.end(1), mark[1].replace('"piece": "', '"piece": "un')),
        ):
            yield text[:start] + new + text[stop:]
        contents = list(damaged(json.loads(mark[1])))
        for content in random.Random(3).sample(contents, min(MANY, len(contents))):
            new = json.dumps(content).replace("--", "-\\u002d")
            yield text[: mark.start(1)] + new + text[mark.end(1) :]


@pytest.mark.slow
def test_every_damaged_mark_is_one_sentence(tmp_path):
    (tmp_path / "rod.toml").write_bytes((CRAFTS / "strangers" / "rod.toml").read_bytes())
    (tmp_path / "craft.xml").write_text(
        '<mujoco><include file="mount.xml"/><keyframe><key qpos="0 0 0 1 0 0 0"/></keyframe>'
        '<actuator><motor site="mount" gear="0 0 0 1 0 0"/></actuator></mujoco>'
    )
    (tmp_path / "mount.xml").write_text(
        '<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="9" '
        'diaginertia="1 1 1"/><site name="mount"/><body name="end" pos="0 0 1"/></body>'
        "</worldbody></mujoco>"
    )
    rod = tmp_path / "rod.toml"
    made = bc.embed(tmp_path / "craft.xml", {"mount": rod, "end": rod}, retime=False)
    made.write(tmp_path / "flexible.xml")
    attached = bc.embed(CRAFTS / "strangers" / "docking.xml", {"wing_root": rod}, retime=False)
    attached.write(tmp_path / "docking.xml")
    refused = 0
    for name in ("flexible.xml", "docking.xml"):
        for text in spoilt((tmp_path / name).read_text()):
            (tmp_path / "spoilt.xml").write_text(text)
            answer = call(
                "embed", tmp_path / "spoilt.xml", "--remove", "-o", tmp_path / "b.xml", "--force"
            )
            assert answer.status in (0, 2), answer.err
            refused += answer.status == 2
            if answer.status == 2:
                assert answer.err.startswith("beamchain: ")
                assert answer.err.count("\n") == 1
    assert refused > 8
