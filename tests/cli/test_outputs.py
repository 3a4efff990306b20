"""Outputs: never onto what is read nor onto each other, whole or not at all,
with the permissions that the user set."""

import errno
import json
import os
import shutil
import stat
import sys
from pathlib import Path

import pytest

import beamchain as bc
from beamchain.cli.shipped import examples
from command import COMMANDS as KNOWN
from command import run
from spacecraft import CRAFTS, spec

posix = pytest.mark.skipif(
    sys.platform == "win32", reason="permissions and links of a POSIX system"
)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with a spacecraft and appendages, in which commands run."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(CRAFTS / "planar.xml", "craft.xml")
    shutil.copy(spec("rod"), "rod.toml")
    shutil.copy(next(one.path for one in examples() if one.name == "boom"), "boom.toml")
    return tmp_path


def contents(folder):
    return {p.relative_to(folder): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def refused(arguments, place, capsys, monkeypatch):
    """The sentence of a call that changes nothing."""
    before = contents(place)
    code, said, sentence = run(arguments, capsys, monkeypatch)
    assert code == 2, (said, sentence)
    assert said == ""
    assert sentence.startswith("beamchain: ")
    assert sentence.count("\n") == 1
    assert contents(place) == before
    return sentence


EMBED = ["embed", "craft.xml", "--mount", "mount=rod.toml", "--force"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([*EMBED, "-o", "rod.toml"], "read for it"),
        ([*EMBED, "-o", "./x/../rod.toml"], "read for it"),
        ([*EMBED, "-o", "linked.xml"], "read for it"),
        ([*EMBED, "-o", "hard.xml"], "read for it"),
        (
            ["plant", "craft.xml", "--controller", "craft.json", "-o", "craft.json", "--force"],
            "read for it",
        ),
        # seen when the page is made
        pytest.param(
            ["fit", "modal.toml", "-o", ".", "--force"], "read for it", marks=pytest.mark.slow
        ),
        (["inspect", "boom.toml", "--steps", "-o", "boom.toml", "--force"], "Not a directory"),
    ],
)
@posix
def test_no_output_onto_an_input_or_another(arguments, words, place, capsys, monkeypatch):
    (place / "x").mkdir()
    (place / "linked.xml").symlink_to("rod.toml")
    (place / "hard.xml").hardlink_to("rod.toml")
    (place / "craft.json").write_text("[[loop]]")
    (place / "log.csv").write_text("time,torque_z,rate_z\n0,0,0\n")
    write_modes(place)
    assert words in refused(arguments, place, capsys, monkeypatch)


def write_modes(folder):
    """Modes in a file that has the name of the record that `fit` writes."""
    mass = [[30, 0, 0, 0, 0, 0], [0, 30, 0, 0, 0, 120], [0, 0, 30, 0, -120, 0]]
    mass += [[0, 0, 0, 20, 0, 0], [0, 0, -120, 0, 600, 0], [0, 120, 0, 0, 0, 600]]
    modes = json.dumps(
        {"mass": mass, "frequencies": [1.3], "participation": [[0], [4], [0], [0], [0], [23]]}
    )
    (folder / "fit.json").write_text(modes)
    (folder / "modal.toml").write_text('name = "array"\n[imported]\nfile = "fit.json"\n')


@pytest.mark.slow
def test_a_craft_is_updated_in_place(place, capsys, monkeypatch):
    """What the documentation shows: with --force the new version of a spacecraft takes
    its place, and back."""
    original = (place / "craft.xml").read_bytes()
    assert run([*EMBED, "-o", "craft.xml"], capsys, monkeypatch)[0] == 0
    assert b"rod_" in (place / "craft.xml").read_bytes()
    assert (
        run(
            ["embed", "craft.xml", "--remove", "-o", "craft.xml", "--force"],
            capsys,
            monkeypatch,
        )[0]
        == 0
    )
    assert (place / "craft.xml").read_bytes().split() == original.split()


@pytest.mark.slow
def test_python_does_not_either(place):
    craft = bc.embed("craft.xml", {"mount": "rod.toml"})
    before = contents(place)
    for path, also in (
        ("rod.toml", {}),
        ("out.xml", {Path("rod.toml"): "x"}),
        ("out.xml", {Path("x/../out.xml"): "x"}),
    ):
        with pytest.raises(bc.BeamchainError, match="read for it|one file"):
            craft.write(path, force=True, also=also)
    for path in ("", "/", "..", "a\0b", "\udcff.xml"):
        with pytest.raises(bc.BeamchainError, match="no file name|not UTF-8|folder"):
            craft.write(path, force=True)
    assert contents(place) == before
    assert Path("craft.xml") in [path.relative_to(place) for path in craft.inputs]


NO_NAMES = ["", "/", ".", "..", "\udcff.xml"]
EVERY = (
    EMBED,
    ["retime", "craft.xml", "--timestep", "0.1", "--force"],
    ["plant", "craft.xml", "--force"],
    ["identify", "log.csv", "--craft", "craft.xml", "--mount", "mount", "--force"],
    ["init", "boom", "--force"],
)
COMMANDS = [words for words in EVERY if words[0] in KNOWN]


@pytest.mark.parametrize("name", NO_NAMES)
@pytest.mark.parametrize("command", COMMANDS, ids=lambda arguments: arguments[0])
def test_names_that_are_none(command, name, place, capsys, monkeypatch):
    refused([*command, "-o", name], place, capsys, monkeypatch)


@pytest.mark.parametrize("command", ["fit", "study", "inspect --steps", "sweep", "render"])
@pytest.mark.parametrize("name", ["\udcff", "boom.toml", "boom.toml/x"])
def test_folders_that_are_none(command, name, place, capsys, monkeypatch):
    refused([*command.split(), "boom.toml", "-o", name, "--force"], place, capsys, monkeypatch)


@pytest.mark.parametrize(
    "arguments", [["fit", "\udcff.toml", "-o", "x"], ["inspect", "a\udc80"], ["init", "\udcff"]]
)
def test_inputs_that_are_no_text(arguments, place, capsys, monkeypatch):
    assert "not UTF-8" in refused(arguments, place, capsys, monkeypatch)


@posix
@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_permissions(mask, place, capsys, monkeypatch):
    before = os.umask(mask)
    try:
        assert run(["init", "mast"], capsys, monkeypatch)[0] == 0
        assert stat.S_IMODE((place / "mast.toml").stat().st_mode) == 0o666 & ~mask
        for mode in (0o600, 0o640, 0o664):
            (place / "mast.toml").chmod(mode)
            assert run(["init", "mast", "--force"], capsys, monkeypatch)[0] == 0
            assert stat.S_IMODE((place / "mast.toml").stat().st_mode) == mode
    finally:
        os.umask(before)


@pytest.mark.slow
def test_nothing_is_left_of_a_full_disk(place, capsys, monkeypatch):
    """Whichever file the disk has no more room for: none is there, old ones are as they were,
    nor a temporary one."""
    assert run([*EMBED, "-o", "flexible.xml"], capsys, monkeypatch)[0] == 0
    call = ["plant", "flexible.xml", "-o", "new/p.npz"]
    flush = os.fsync
    for room in range(3):
        left = [room]

        def full(handle, left=left):
            if left[0] == 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            left[0] -= 1
            return flush(handle)

        before = contents(place)
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", full)
            code, _, sentence = run(call, capsys, patch)
        if room < 2:
            assert code == 2
            assert "No space left" in sentence
            assert contents(place) == before
            assert not (place / "new").exists()
        else:
            assert code == 0
    assert sorted(p.name for p in (place / "new").iterdir()) == ["p.npz", "p_report.html"]


def test_nothing_is_left_of_an_interruption(place, capsys, monkeypatch):
    def interrupted(handle):
        raise KeyboardInterrupt

    before = contents(place)
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", interrupted)
        code, said, sentence = run(["init", "mast", "-o", "a/b/mast.toml"], capsys, patch)
    assert (code, said) == (130, "")
    assert sentence.count("\n") == 1
    assert "stopped" in sentence
    assert contents(place) == before
    assert not (place / "a").exists()
