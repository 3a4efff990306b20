"""The user's file is text: `embed` adds to it, and `--remove` gives back its bytes,
however it is formatted.

Files of one spacecraft, each with an oddity of its own, and spacecraft formatted at random
(48 in `make fuzz`). Appendages are taken out by the command; the written file is stepped by plain
MuJoCo.
"""

import difflib
import os
import random

import mujoco
import numpy as np
import pytest

import beamchain as bc
from command import run

# tabs, keyframes and a comment at the end; no indent, no declaration, no last line end; line ends
# of Windows, a byte order mark
RANDOM = range(48) if "BEAMCHAIN_FUZZ" in os.environ else (1, 4, 11)
ROD = """name = "rod"
[[segment]]
length = 4.0
section = { shape = "round", diameter = 0.02 }
material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }
[modes]
xy = 1
xz = 1
"""
PLAIN = """<?xml version="1.0"?>
<!-- a spacecraft -->
<mujoco model="craft">
  <option gravity="0 0 0" timestep="0.001"/>
  <worldbody>
    <body name="bus">
      <freejoint/>
      <inertial pos="0 0 0" mass="300" diaginertia="60 90 120"/>
      <site name="mount" pos="0.5 0 0"/>
      <site name="other" pos="0 0.5 0" quat="0.7071067811865476 0 0 0.7071067811865476"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="wheel" site="mount" gear="0 0 0 0 0 1"/>
  </actuator>
</mujoco>
"""
KEYS = '<keyframe>\n    <key name="one" qpos="0 0 0 1 0 0 0" />\n  </keyframe>\n  <actuator>'
ODD = {
    "as people write it": PLAIN,
    "single quotes and a name with >": PLAIN.replace('"', "'").replace(
        "'bus'", "'bus &amp; > all'"
    ),
    "line ends of Windows": PLAIN.replace("\n", "\r\n"),
    "one line, another encoding declared, ASCII used": "".join(
        line.strip() for line in PLAIN.splitlines()
    ).replace('"1.0"', '"1.0" encoding="ISO-8859-1"'),
    "a place without content, letters beyond ASCII": PLAIN.replace(
        "</body>",
        '  <body name="arm" pos="1 0 0"   />\n      <body name="leg"></body>\n    </body>',
    )
    .replace('<site name="other"', "<!-- -> --><site name='other'")
    .replace("a spacecraft", "Raumfahrzeug für — 卫星")
    .replace('"wheel"', '"Rad_ü"'),
    "keyframes, entities and a comment behind the root": PLAIN.replace("<actuator>", KEYS)
    .replace('model="craft"', 'model="&lt;craft&#62; &quot;1&quot;"')
    .rstrip("\n")
    + " <!-- end --> \n\n",
}
#: those whose file is also compared with what `embed` makes of it, line by line
COMPARED = (
    "as people write it",
    "line ends of Windows",
    "single quotes and a name with >",
)
#: the one whose keyframe changes
KEYED = "keyframes, entities and a comment behind the root"


@pytest.fixture
def command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rod.toml").write_text(ROD)

    def beamchain(*words):
        code, _, error = run([*words], capsys, monkeypatch)
        assert (code, error) == (0, "")

    return beamchain


def step(path):
    """The file is one that MuJoCo compiles and steps."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qvel[-1] = 0.1
    for _ in range(20):
        mujoco.mj_step(model, data)
    assert np.all(np.isfinite(data.qpos))
    assert np.any(data.qpos != model.qpos0)
    return model


def embed_and_remove(command, folder, content, places=("mount", "other")):
    """Embedded, stepped, one taken out, all taken out: the original bytes.
    Returns the file in between as text."""
    (folder / "craft.xml").write_bytes(content)
    bare = mujoco.MjModel.from_xml_path(str(folder / "craft.xml"))
    rods = dict.fromkeys(places, folder / "rod.toml")
    bc.embed(folder / "craft.xml", rods, retime=False).write(folder / "flexible.xml")
    model = step(folder / "flexible.xml")
    assert model.nv > bare.nv
    assert model.nkey == bare.nkey
    command(
        "embed", "flexible.xml", "--remove", "--mount", places[0], "-o", "fewer.xml", "--no-report"
    )
    assert bare.nv < step(folder / "fewer.xml").nv < model.nv
    for file in ("flexible.xml", "fewer.xml"):
        command("embed", file, "--remove", "-o", f"back_{file}")
        assert (folder / f"back_{file}").read_bytes() == content
    return (folder / "flexible.xml").read_bytes().decode("utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in ODD if name not in (*COMPARED, KEYED)])
def test_oddities(name, command, tmp_path):
    places = ("arm", "leg") if "content" in name else ("mount", "other")
    embed_and_remove(command, tmp_path, ODD[name].encode("utf-8"), places)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPARED)
def test_a_difference_has_added_lines_only(name, command, tmp_path):
    before = ODD[name]
    after = embed_and_remove(command, tmp_path, before.encode("utf-8"))
    lines = list(difflib.unified_diff(before.splitlines(True), after.splitlines(True), n=0))[2:]
    assert len(lines) > 20
    assert not [line for line in lines if line.startswith("-")]
    assert ("\r\n" in after) == ("\r\n" in before)
    assert all(line.endswith("\r\n") == ("\r\n" in before) for line in after.splitlines(True))


@pytest.mark.slow
def test_a_keyframe_that_changes_stays_in_its_comment(command, tmp_path):
    after = embed_and_remove(command, tmp_path, ODD[KEYED].encode())
    assert r"<key name=\"one\" qpos=\"0 0 0 1 0 0 0\" />" in after
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "flexible.xml")).nkey == 1


@pytest.mark.slow
def test_what_the_user_adds_beside_an_appendage_stays(command, tmp_path):
    """A body that had no content, opened for an appendage;
    he writes a site into it before he takes the appendage out."""
    content = ODD["a place without content, letters beyond ASCII"]
    (tmp_path / "craft.xml").write_bytes(content.encode())
    command("embed", "craft.xml", "--mount", "arm=rod.toml", "-o", "flexible.xml", "--no-report")
    flexible = (tmp_path / "flexible.xml").read_bytes().decode()
    place = flexible.index(">", flexible.index('"arm" pos')) + 1
    (tmp_path / "flexible.xml").write_bytes(
        (flexible[:place] + '<site name="mine"/>' + flexible[place:]).encode()
    )
    command("embed", "flexible.xml", "--remove", "-o", "back.xml")
    back = (tmp_path / "back.xml").read_bytes().decode()
    assert '<body name="arm" pos="1 0 0"><site name="mine"/>' in back
    assert "beamchain" not in back
    mujoco.MjModel.from_xml_path(str(tmp_path / "back.xml"))


@pytest.mark.parametrize("declared", ["UTF-16", "ISO-8859-1", "cp1252", "KOI8-R", "Shift-JIS"])
def test_other_encodings_are_refused_with_their_cure(declared, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    letters = {"KOI8-R": "спутник", "Shift-JIS": "衛星"}.get(declared, "für")
    text = PLAIN.replace('"1.0"', f'"1.0" encoding="{declared}"').replace("a spacecraft", letters)
    (tmp_path / "craft.xml").write_bytes(text.encode(declared))
    (tmp_path / "rod.toml").write_text(ROD)
    code, _, error = run(
        ["embed", "craft.xml", "--mount", "mount=rod.toml", "-o", "out.xml"], capsys, monkeypatch
    )
    assert code == 2
    assert "is not UTF-8" in error
    assert "iconv" in error
    assert not (tmp_path / "out.xml").exists()


def formatted(seed):
    """A spacecraft of two bodies on drives, formatted at random."""
    rng = random.Random(seed)
    newline = rng.choice(["\n", "\r\n"])
    unit = rng.choice(["\t", "  ", "    ", " "])
    flat = rng.random() < 0.15

    def tag(name, attributes, empty):
        words = []
        for key, value in attributes.items():
            quote = rng.choice("\"'")
            equals = rng.choice(["=", "=", "=", " = "])
            gap = rng.choice([" ", " ", "  ", newline + 3 * unit])
            words.append(f"{gap}{key}{equals}{quote}{value}{quote}")
        return f"<{name}{''.join(words)}{rng.choice(['', ' '])}{'/' if empty else ''}>"

    def lines(name, attributes, children, depth):
        indent = "" if flat else newline + unit * depth
        remark = f"{indent}<!-- {rng.randrange(10**6)} - > -->" if rng.random() < 0.3 else ""
        if not children:
            end = rng.random() < 0.8
            return remark + indent + tag(name, attributes, end) + ("" if end else f"</{name}>")
        inner = "".join(lines(*child, depth + 1) for child in children)
        close = rng.choice([indent, indent, newline + indent, " "])
        return (
            remark
            + indent
            + tag(name, attributes, False)
            + inner
            + f"{close}</{name}{rng.choice(['', ' '])}>"
        )

    wings = []
    for i in range(2):
        inside = [
            ("joint", {"name": f"drive{i}", "type": "hinge", "axis": "0 1 0"}, []),
            ("inertial", {"pos": "0 0 0", "mass": "5", "diaginertia": "1 1 1"}, []),
            ("site", {"name": f"place{i}", "pos": "0.1 0 0"}, []),
        ]
        wings.append(("body", {"name": f"yoke{i}", "pos": f"0 {2 * i - 1} 0"}, inside))
    hub = [
        ("freejoint", {}, []),
        ("inertial", {"pos": "0 0 0", "mass": "200", "diaginertia": "50 60 70"}, []),
        *wings,
    ]
    parts = [
        ("option", {"gravity": "0 0 0", "timestep": "0.002"}, []),
        ("worldbody", {}, [("body", {"name": "bus"}, hub)]),
        (
            "actuator",
            {},
            [("motor", {"name": f"torque{i}", "joint": f"drive{i}"}, []) for i in range(2)],
        ),
    ]
    if rng.random() < 0.6:
        qpos = rng.choice(["0 0 0 1 0 0 0 0.5 -0.5", "0 0 0  1 0 0 0" + newline + "0 0"])
        parts.append(
            ("keyframe", {}, [("key", {"name": "k", "qpos": qpos}, []), ("key", {"time": "1"}, [])])
        )
    head = rng.choice(["", '<?xml version="1.0"?>', "<?xml version='1.0' encoding='utf-8' ?>"])
    tail = rng.choice(["", newline, newline * 2, " <!-- end -->" + newline])
    body = lines("mujoco", {"model": "a &amp; b"}, parts, 0).lstrip()
    mark = "\ufeff" if rng.random() < 0.2 else ""
    return (mark + head + newline * bool(head) + body + tail).encode("utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("seed", RANDOM)
def test_formatted_at_random(seed, command, tmp_path):
    embed_and_remove(command, tmp_path, formatted(seed), ("place0", "place1"))


ALONE = '<site name="inside"/>'
BESIDE = '<site name="inside" pos="0 0 0.1"/><body name="leg"/>'


@pytest.mark.slow
@pytest.mark.parametrize(("content", "end"), [(ALONE, "/>"), (BESIDE, "></include>")])
def test_a_place_in_an_included_file(end, content, command, tmp_path):
    """The include is put in place; written into another folder, its path is changed before."""
    (tmp_path / "part.xml").write_text(f"<mujoco>{content}</mujoco>")
    (tmp_path / "keys.xml").write_text(
        '<mujoco><keyframe><key name="k" qpos="0 0 0 1 0 0 0"/></keyframe></mujoco>'
    )
    original = PLAIN.replace("</body>", f'<include file="part.xml"{end}</body>').replace(
        "</worldbody>", f'</worldbody><include file="keys.xml"{end}'
    )
    (tmp_path / "craft.xml").write_text(original)
    (tmp_path / "sub").mkdir()
    for out in ("flexible.xml", "sub/flexible.xml"):
        command("embed", "craft.xml", "--mount", "inside=rod.toml", "-o", out, "--no-report")
        assert step(tmp_path / out).nkey == 1
        command("embed", out, "--remove", "-o", "back.xml", "--force")
        assert (tmp_path / "back.xml").read_text() == original
