"""An option that takes one value is given once: a second is refused by one sentence,
in every command."""

import json
import shutil
from pathlib import Path

import pytest
import typer.main

from beamchain.cli import app
from command import run
from spacecraft import CRAFTS

COMMANDS = typer.main.get_command(app).commands
OPTIONS = [
    (name, option)
    for name, command in COMMANDS.items()
    for option in command.params
    if option.param_type_name == "option"
]
SINGLE = [(name, one) for name, one in OPTIONS if not one.is_flag and not one.multiple]
SWITCHES = [(name, one) for name, one in OPTIONS if one.is_flag and one.secondary_opts]
REPEATABLE = {(name, one.opts[-1]) for name, one in OPTIONS if one.multiple}


def label(value):
    return value if isinstance(value, str) else value.opts[-1]


def refused(arguments, capsys, monkeypatch, folder):
    """The one sentence that a command refuses its arguments with."""
    monkeypatch.chdir(folder)
    code, said, sentence = run(arguments, capsys, monkeypatch)
    assert code == 2
    assert said == ""
    assert sentence.startswith("beamchain: ")
    assert sentence.count("\n") == 1
    assert list(folder.iterdir()) == []
    return sentence


def test_there_are_such_options():
    """The tables above are of the real commands: what was seen to be taken twice is among them."""
    names = {(name, opt) for name, one in SINGLE for opt in one.opts}
    wanted = {
        ("plant", "--angle"),
        ("plant", "--worst"),
        ("plant", "--controller"),
        ("retime", "--timestep"),
    }
    assert wanted | {("fit", "-o"), ("identify", "--at"), ("render", "--angle")} <= names
    assert {
        ("plant", "--input"),
        ("plant", "--output"),
        ("embed", "--at"),
        ("sweep", "--at"),
    } <= REPEATABLE
    assert len(SINGLE) > 40


@pytest.mark.parametrize(("command", "option"), SINGLE, ids=label)
def test_a_second_value_is_refused(command, option, capsys, monkeypatch, tmp_path):
    for name in option.opts:
        for arguments in (
            [name, "first", name, "second"],
            [name, "first", option.opts[0], "second", "x"],
        ):
            sentence = refused([command, *arguments], capsys, monkeypatch, tmp_path)
            assert name in sentence
            assert "'first'" in sentence
            assert "'second'" in sentence
            assert "leave all but one out" in sentence


def test_the_spelling_does_not_matter(capsys, monkeypatch, tmp_path):
    for arguments in (
        ["-oa", "--output=b"],
        ["--output", "a", "-o", "b"],
        ["-qoa", "x.toml", "-ob"],
    ):
        sentence = refused(["fit", *arguments], capsys, monkeypatch, tmp_path)
        assert "'a' and 'b'" in sentence
    assert "3 times" in refused(["fit", "-oa", "-ob", "-oc"], capsys, monkeypatch, tmp_path)


@pytest.mark.parametrize(("command", "option"), SWITCHES, ids=label)
def test_a_switch_is_not_both(command, option, capsys, monkeypatch, tmp_path):
    on = option.opts[0]
    off = option.secondary_opts[0]
    sentence = refused([command, "x", on, off], capsys, monkeypatch, tmp_path)
    assert on in sentence
    assert off in sentence
    assert "leave one out" in sentence


def test_as_json(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, said, _ = run(["fit", "x.toml", "-o", "a", "-o", "b", "--json"], capsys, monkeypatch)
    assert code == 2
    assert json.loads(said)["error"]["type"] == "InputError"


def test_flags_and_repeatable_options_are_taken_again(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    shutil.copy(CRAFTS / "planar.xml", "craft.xml")
    for name in ("one", "two"):
        assert (
            run(
                ["init", "boom", "-o", f"{name}.toml", "-q", "-q", "--force", "--force"],
                capsys,
                monkeypatch,
            )[0]
            == 0
        )
    assert Path("one.toml").is_file()
    at = ["--at", "mount=one.toml", "--at", "nowhere=two.toml"]
    code, _, sentence = run(["embed", "craft.xml", *at, "-o", "out.xml"], capsys, monkeypatch)
    assert code == 2
    assert "nowhere" in sentence  # both were read
