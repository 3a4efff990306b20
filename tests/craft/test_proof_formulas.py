"""What a file that was edited by hand holds of its appendages, beside what its marks say."""

from dataclasses import dataclass
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from formulas import (
    assemble_document,
    bare_at_poses_of,
    check_ports_of_file,
    elements_of_file,
    marked_appendages,
)

# an arm of two links, between them a strap; a hand and a leg stand on its end
FILE = """<mujoco><asset><material name="arm_skin"/><material name="paint"/></asset><worldbody>
<body name="bus"><freejoint/><geom name="hull" size="1"/>
<body name="arm_link1"><geom name="arm_geom1" size="1"/><site name="arm_root"/>
<body name="arm_link2"><joint name="arm_hinge1_xy"/><geom size="1"/><site name="arm_end"/>
<body name="hand"><joint name="wrist"/><geom name="palm" size="1"/></body>
<body name="leg_link1"><geom name="leg_geom1" size="1"/>
<body name="arm_toy"><geom size="1"/></body></body></body></body>
<body name="arm_holder"><joint name="gimbal" axis="0 1 0"/><geom size="1"/></body></body>
</worldbody><tendon><fixed name="arm_mode1_xy"><joint joint="arm_hinge1_xy" coef="1"/></fixed>
<fixed name="brake"><joint joint="wrist" coef="1"/></fixed></tendon>
<sensor><framepos name="arm_tip" objtype="site" objname="arm_end"/><jointpos joint="wrist"/>
</sensor></mujoco>"""
ON_PORTS = {"hand", "leg_link1"}


def model(changes=()):
    text = FILE
    for old, new in dict(changes).items():
        text = text.replace(old, new)
    return mujoco.MjModel.from_xml_string(text)


def made(at="mount", prefix="arm_", carries=("hand",)):
    return SimpleNamespace(at=at, prefix=prefix, carries={"end": tuple(carries)})


def test_an_appendage_is_what_hangs_on_its_first_body():
    """Without what stands on its ports, whatever its name; no more than its prefix says of what
    stands in no body."""
    assert elements_of_file(model(), made(), ON_PORTS) == {
        "body": {"arm_link1", "arm_link2"},
        "jnt": {"arm_hinge1_xy"},
        "geom": {"arm_geom1"},
        "site": {"arm_root", "arm_end"},
        "tendon": {"arm_mode1_xy"},
        "sensor": {"arm_tip"},
        "mat": {"arm_skin"},
        "tex": set(),
        "skin": set(),
    }
    single = elements_of_file(model(), made(prefix="leg_"), {"arm_toy"})
    assert single["body"] == {"leg_link1"}
    assert single["tendon"] == single["jnt"] == set()


@pytest.mark.parametrize(
    ("prefix", "on_ports", "changes", "said"),
    [
        ("foot_", ON_PORTS, {}, "names its first body 'foot_link1', which is gone"),
        ("arm_", {"leg_link1"}, {}, "body 'hand' was put on body 'arm_link2' .* by hand"),
        ("arm_", ON_PORTS, {"arm_hinge1_xy": "knee"}, "joint 'knee' was put into the appendage"),
        ("arm_", ON_PORTS, {"arm_link2": "strut"}, "body 'strut' was put on body 'arm_link1'"),
    ],
)
def test_what_was_put_into_an_appendage_is_refused(prefix, on_ports, changes, said):
    with pytest.raises(bc.InputError, match=said):
        elements_of_file(model(changes), made(prefix=prefix), on_ports)


@pytest.mark.parametrize(
    ("changes", "carries", "lost"),
    [
        ({}, ["hand"], ""),
        ({"arm_end": "arm_stop"}, ["hand"], "hand"),  # no port of that name
        ({}, ["foot"], "foot"),  # no body of that name
        ({}, ["arm_holder"], "arm_holder"),  # on the bus
        ({'"leg_link1"': '"shin"'}, ["hand"], "leg_link1"),
        ({'"leg_link1"': '"shin"', "arm_holder": "leg_link1"}, ["hand"], "leg_link1"),
    ],
)
def test_what_a_port_carries_hangs_on_the_link_of_its_site(changes, carries, lost):
    arm, leg = made(carries=carries), made("mount:end", "leg_", ())
    elsewhere = made("other:end", "toe_", ())  # of another arm, that is no place of the file
    file = model(changes)
    if not lost:
        check_ports_of_file(file, arm, [arm, leg, elsewhere])
        return
    with pytest.raises(bc.InputError, match=f"carries body '{lost}' on its port 'end'"):
        check_ports_of_file(file, arm, [arm, leg, elsewhere])


CRAFT = """<mujoco><worldbody><body><joint name="x" type="slide"/><geom size="1"/>{}</body>
</worldbody><actuator><motor joint="x"/></actuator><keyframe>{}</keyframe></mujoco>"""
HINGE = '<body><joint name="bends"/><geom size="1"/></body>'


def test_a_pose_edited_in_the_file_is_the_one_that_is_proved():
    bare = mujoco.MjModel.from_xml_string(
        CRAFT.format("", '<key name="a" qpos="1"/><key name="b" qpos="2" ctrl="3"/>')
    )
    keys = '<key name="a" qpos="1.5 0"/><key name="b" qpos="-2 0" ctrl="7"/>'
    file = mujoco.MjModel.from_xml_string(CRAFT.format(HINGE, keys))
    result = SimpleNamespace(craft=bare, model=file, bare_qpos=lambda qpos: qpos[:1])
    found = bare_at_poses_of(result)
    np.testing.assert_array_equal(found.key_qpos, [[1.5], [-2.0]])
    np.testing.assert_array_equal(found.key_ctrl, [[0.0], [7.0]])
    np.testing.assert_array_equal(bare.key_qpos, [[1.0], [2.0]])
    result.model = mujoco.MjModel.from_xml_string(CRAFT.format(HINGE, keys.replace('"b"', '"c"')))
    with pytest.raises(bc.InputError, match="the poses rest, a, c, .* are rest, a, b"):
        bare_at_poses_of(result)


def test_appendages_by_their_marks_are_those_of_the_bare_spacecraft(monkeypatch):
    module = "beamchain.craft.embedding"
    marked = {}
    monkeypatch.setattr(f"{module}.read_bare", lambda _: ("original", marked))
    monkeypatch.setattr(f"{module}._fit_on_craft", lambda *_, **__: ("model", "those", "notes"))
    assert marked_appendages("file") is None
    marked["mount"] = "wish"
    assert marked_appendages("file") == ("model", "those")


@dataclass(frozen=True)
class Place:
    at: str


def test_a_document_hangs_on_ports_what_they_carry(monkeypatch):
    """A hand on the end of an arm, and a leg on its middle."""
    hung = []

    def hang(out, *what):
        hung.append(what)
        return out

    insert = SimpleNamespace(
        place_includes_with_keys=lambda out: out,
        Insertion=lambda place, *more: (place.at, *more[2:]),
        insert_appendages=lambda out, items: (out, items),
        hang_on_port=hang,
    )
    module = "beamchain.craft.documents"
    monkeypatch.setattr(f"{module}.insert", insert)
    monkeypatch.setattr(f"{module}.relocate", lambda *_: "out")
    monkeypatch.setattr(f"{module}.place_includes_with_targets", lambda out, names: (out, names))
    monkeypatch.setattr(f"{module}.find_target", lambda _, place: Place(place))
    appendages = [
        SimpleNamespace(
            at=at, prefix=prefix, carries=carries, spec=SimpleNamespace(name="spec"), timed=None,
            mount=SimpleNamespace(position=None, quaternion=None), element=lambda: "element",
        )
        for at, prefix, carries in (
            ("mount:mid", "leg_", {}), ("mount", "arm_", {"end": ("hand",)}),
        )
    ]  # fmt: skip
    monkeypatch.setattr(f"{module}.msgspec.to_builtins", lambda spec: spec.name)
    (out, names), items = assemble_document(None, appendages, None, None)
    assert (out, names) == ("out", ["mount", "mount", "body:hand"])
    assert [item[0] for item in items] == ["mount:mid", "mount"]
    assert hung == [("arm_", "mid", "leg_link1"), ("arm_", "end", "hand")]
