"""Users' names are shown as they are, wherever they come from: no traceback, no warning,
nothing a terminal acts upon."""

import json
import os
import subprocess
import sys
from pathlib import Path

import control
import numpy as np
import pytest
from lxml import html
from scipy.io import loadmat

import beamchain as bc
from command import run
from hostile_names import NAMES, commands, unseen, write_files

MIXED = "wheel.1 [/red] $x$ :bug: 帆 \u202e<b>\x85{0}%s"


def called(folder, name, calls, capsys, monkeypatch):
    """What the commands print, each of which is taken."""
    monkeypatch.chdir(folder)
    write_files(folder, name)
    texts = []
    for arguments in calls:
        code, told, sentence = run(arguments, capsys, monkeypatch)
        assert code in (0, 3), (arguments, sentence)
        assert "Traceback" not in sentence
        assert "Warning" not in sentence
        assert not unseen(told + sentence)
        texts.append(told)
    return texts


@pytest.mark.slow
def test_a_name_is_shown_as_it_is(tmp_path, capsys, monkeypatch):
    calls = [commands(MIXED)[k] for k in (0, 1, 2)]
    embedded, _, plant = called(tmp_path, MIXED, calls, capsys, monkeypatch)
    shown = "wheel.1 [/red] $x$ :bug: 帆 \\u202e<b>\\x85{0}%s"
    assert shown in " ".join(embedded.split())
    assert shown in " ".join(plant.split())
    for page in ("flexible_report.html", "plant_report.html"):
        text = (tmp_path / page).read_text(encoding="utf-8")
        assert not unseen(text)
        assert shown in " ".join(html.fromstring(text).itertext())
    record = loadmat(tmp_path / "plant.mat")
    assert str(record["InputName"][0, 0][0]) == MIXED


@pytest.mark.slow
def test_the_name_of_a_loop_is_the_plant_s(tmp_path, capsys, monkeypatch):
    """`plant --json`: what a controller of the same file calls its input is what
    the record calls it."""
    monkeypatch.chdir(tmp_path)
    write_files(tmp_path, "wheel.1")
    flexible = bc.embed("craft.xml", {"site:wheel.1": "rod.toml"})
    flexible.write("flexible.xml")
    call = [*commands("wheel.1")[2], "--json"]
    record = json.loads(run(call, capsys, monkeypatch)[1])
    assert record["inputs"][0]["name"] == "wheel.1"
    assert record["margins"][0][0]["input"] == "wheel.1"
    assert [one["name"] for one in record["outputs"]][:3] == ["wheel.1_x", "wheel.1_y", "wheel.1_z"]


POINTS = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/><site name="mount" pos="0.5 0 0"/>
<site name="left.side" pos="0 0.5 0" zaxis="1 0 0"/>
<body name="w"><inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.2"/>
<joint name="w" axis="0 0 1"/></body>
<body name="v"><inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.2"/>
<joint name="v" axis="1 0 0"/></body>
</body></worldbody><actuator><motor name="a.b" joint="w"/><motor name="a_b" joint="v"/></actuator>
</mujoco>"""


@pytest.mark.slow
def test_points_in_signals():
    """python-control takes no point; names stay different, and each still drives what it drove."""
    section = bc.Equivalent(bending_stiffness_xy=2e3, bending_stiffness_xz=3e3, linear_mass=4.0)
    spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),), name="rod")
    dotted = bc.plant(bc.embed(POINTS, {"mount": spec, "left.side": spec}))
    without = POINTS.replace("a.b", "motor").replace("left.side", "left")
    plain = bc.plant(bc.embed(without, {"mount": spec, "left": spec}))
    assert dotted.input_names == ("a.b", "a_b")
    assert len(set(dotted.input_labels)) == 2
    assert not [label for label in (*dotted.input_labels, *dotted.state_labels) if "." in label]
    assert dotted.input_labels[1] == "a_b"  # which it was before
    assert any(name.startswith("rod_left.side_") for name in dotted.state_names)
    at = 1j * np.array([0.1, 0.7, 5.0])
    np.testing.assert_allclose(dotted(at), plain(at), rtol=1e-9)
    first = dotted["attitude_z", dotted.input_labels[0]]
    assert isinstance(control.feedback(first, 1.0), control.StateSpace)
    np.testing.assert_allclose(dotted.frequency, plain.frequency, rtol=1e-12)


@pytest.mark.parametrize(
    "call",
    [["[/red]"], ["fit", "[/red]", "-o", "[bold]"], ["init", "[/]"], ["inspect", "\x1b[31m"]],
)
def test_words_of_the_command_line(call, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, told, sentence = run(call, capsys, monkeypatch)
    assert (code, told) == (2, "")
    assert not unseen(sentence)
    assert call[1 if len(call) > 1 else 0].replace("\x1b", "x1b") in sentence
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_terminal_without_the_letters(tmp_path):
    """Output in ASCII: letters that it lacks are spelled out."""
    write_files(tmp_path, "帆板")
    done = subprocess.run(
        [
            *(sys.executable, "-m", "beamchain", "embed", "craft.xml", "-o", "out.xml"),
            *("--mount", "site:帆板=rod.toml", "--no-report"),
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert done.returncode == 3, done.stderr  # the rod is rigid in the other plane
    assert "\\u5e06\\u677f" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("key", ["page", "half a formula"])
def test_names_of_every_kind(key, tmp_path, capsys, monkeypatch):
    called(tmp_path, NAMES[key], commands(NAMES[key])[:5], capsys, monkeypatch)
    for page in Path(tmp_path).glob("*_report.html"):
        assert not html.fromstring(page.read_text(encoding="utf-8")).xpath(
            "//script[contains(., 'alert')]"
        )
