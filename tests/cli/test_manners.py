"""How the command line behaves before it computes anything: help, completion, colours,
files to start from."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer

import beamchain as bc
from command import COMMANDS, app, run
from examples import EXAMPLES, example

# of what comes with the package, those that are fitted and drawn here: modes stated, chosen, and
# of a liquid; tests/studies and tests/craft take others
WHOLE = ("seed_boom", "array_scene", "tank")
#: commands that print their numbers as JSON; others write them into a file, or Python has them
FOR_SCRIPTS = ("fit", "embed", "inspect", "plant", "retime")
STARTS = sorted(path.stem for path in EXAMPLES.glob("*.toml"))
#: what the script that pip installs does, by its entry point
AS_INSTALLED = """
import sys
from importlib.metadata import entry_points

sys.argv = ["beamchain"]
(script,) = entry_points(group="console_scripts", name="beamchain")
script.load()()
"""
COLOUR = re.compile(r"\x1b\[[0-9;]*(3[0-7]|9[0-7]|38;5)[0-9;]*m")


def outside(arguments, **environment):
    """The same as a process of its own, piped."""
    return subprocess.run(
        [sys.executable, "-m", "beamchain", *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONIOENCODING": "utf-8", **environment},
    )


def options_of(command):
    """The options and arguments of a command."""
    return typer.main.get_command(app).commands[command].params


# -- help ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_shows_an_example_of_itself(command, capsys, monkeypatch):
    code, text, _ = run([command, "--help"], capsys, monkeypatch)
    assert code == 0
    assert re.search(rf"Example: beamchain {command}\b", text)
    assert ("--json" in text) == (command in FOR_SCRIPTS)


@pytest.mark.parametrize("command", COMMANDS)
def test_names_of_tables_in_helps_are_shown(command, capsys, monkeypatch):
    """Brackets are markup unless they are escaped."""
    monkeypatch.setenv("COLUMNS", "200")
    _, text, _ = run([command, "--help"], capsys, monkeypatch)
    helps = " ".join(getattr(option, "help", None) or "" for option in options_of(command))
    for table in re.findall(r"\[+[\w.]+\]+", helps.replace("\\[", "[")):
        assert table in text, table


@pytest.mark.parametrize("word", ["fti", "inspct", "retme", "skweep"])
def test_a_mistyped_command_gets_a_guess(word, capsys, monkeypatch):
    code, _, error = run([word], capsys, monkeypatch)
    assert code == 2
    guess = re.search(r"Did you mean '(\w+)'", error)
    assert guess
    assert guess[1] in COMMANDS


@pytest.mark.parametrize(
    ("words", "cure"),
    [
        (["inspect", "boom.toml"], "give --steps"),
        (["inspect", "craft.xml", "-o", "out"], "give --steps too"),
        (["inspect", "craft.xml", "--steps", "--prove"], "leave one out"),
        (["inspect", "craft.xml", "--loaded"], "give --prove with it"),
        (["init", "-o", "boom.toml"], "the kind is missing"),
    ],
)
def test_options_that_do_not_go_together_are_named(words, cure, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, error = run(words, capsys, monkeypatch)
    assert (code, out) == (2, "")
    assert cure in error
    assert list(tmp_path.iterdir()) == []


def test_a_mistyped_option_gets_a_guess(capsys, monkeypatch):
    code, _, error = run(["fit", "a.toml", "--ouput", "b"], capsys, monkeypatch)
    assert code == 2
    assert "--output" in error


@pytest.mark.slow
def test_completion():
    words = {
        "COMP_WORDS": "beamchain init ",
        "COMP_CWORD": "2",
        "_TYPER_COMPLETE_ARGS": "beamchain init ",
    }
    words |= {"_BEAMCHAIN_COMPLETE": "complete_bash", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    done = subprocess.run(
        [sys.executable, "-c", AS_INSTALLED],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **words},
    )
    for start in STARTS:
        assert start in done.stdout


# -- colours ---------------------------------------------------------------------------------------
@pytest.mark.slow
@pytest.mark.parametrize("arguments", [["fit", "--help"], ["nonsense"]])
def test_no_escape_codes_when_piped(arguments):
    done = outside(arguments)
    assert "\x1b" not in done.stdout + done.stderr
    assert done.stdout + done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="a pseudo terminal needs a POSIX system")
@pytest.mark.parametrize("no_color", [False, True])
@pytest.mark.slow
def test_no_color_on_a_terminal(no_color):
    import pty

    keep = {
        k: v
        for k, v in os.environ.items()
        if k not in ("NO_COLOR", "FORCE_COLOR", "CI", "GITHUB_ACTIONS")
    }
    environment = {**keep, "TERM": "xterm-256color", **({"NO_COLOR": "1"} if no_color else {})}
    master, slave = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-m", "beamchain", "--help"], stdout=slave, stderr=slave, env=environment
    ) as running:
        os.close(slave)
        text = b""
        try:
            while part := os.read(master, 65536):
                text += part
        except OSError:  # how Linux ends a terminal
            pass
        assert running.wait() == 0
    os.close(master)
    assert bool(COLOUR.search(text.decode())) is not no_color


# -- errors for scripts ----------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        (["fit", "no.toml", "-o", "out"], "InputError", "spec 'no.toml' does not exist"),
        (["fit", "good.toml", "-o", "taken"], "OutputError", "--force"),
        (["embed", "no.xml", "--mount", "a=good.toml", "-o", "o.xml"], "InputError", "no.xml"),
        (["inspect", "broken.xml"], "EngineError", "MuJoCo refuses"),
        (["fit", "good.toml"], "MissingParameter", "-o"),
        (["fit", "good.toml", "-o", "out", "--forse"], "NoSuchOption", "--force"),
    ],
)
def test_errors_under_json_are_json(arguments, kind, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(example("array"), "good.toml")
    Path("broken.xml").write_text("<mujoco>")
    Path("taken").mkdir()
    Path("taken/fit.json").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    code, told, error = run([*arguments, "--json"], capsys, monkeypatch)
    assert code == 2
    record = json.loads(told)["error"]
    assert record["type"] == kind
    assert words in record["message"]
    assert error.strip()
    if kind.endswith("Error"):
        assert error == f"beamchain: {record['message']}\n"
    assert sorted(tmp_path.rglob("*")) == before
    code, told, _ = run(arguments, capsys, monkeypatch)
    assert (code, told.strip()) == (2, "")


# -- init ------------------------------------------------------------------------------------------
def test_the_promised_starts_are_there():
    assert set(STARTS) >= {"boom", "array", "mast"}


@pytest.mark.parametrize("kind", ["boom", "array", "mast"])
@pytest.mark.slow
def test_init_writes_a_spec_that_fits(kind, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, told, _ = run(["init", kind], capsys, monkeypatch)
    assert code == 0
    spec = bc.read_spec(tmp_path / f"{kind}.toml")
    assert spec.name == kind
    fit = bc.fit(spec)
    assert fit.status.ok
    assert spec.scene is None or fit.warnings == ()  # what we ship needs no mending
    following = shlex.split(re.search(r"next: beamchain (.*)", told)[1])
    assert following[:2] == ["fit", f"{kind}.toml"]


@pytest.mark.slow
def test_init_writes_a_spacecraft_to_embed_into(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, told, _ = run(["init", "craft"], capsys, monkeypatch)
    assert code == 0
    assert shlex.split(re.search(r"next: beamchain (.*)", told)[1])[:2] == ["embed", "craft.xml"]
    assert run(["init", "array"], capsys, monkeypatch)[0] == 0
    words = ["embed", "craft.xml", "--mount", "mount=array.toml", "-o", "flexible.xml"]
    words += ["--no-report", "--json"]
    code, told, _ = run(words, capsys, monkeypatch)
    assert code == 0
    assert [one["code"] for one in json.loads(told)["warnings"]] == ["exact-in-time"]


@pytest.mark.parametrize("kind", ["boom", "array", "mast"])
def test_what_is_commented_out_is_right_too(kind, tmp_path):
    """Each `# key = value` line of a start, taken alone into the file,
    is known to the spec or clashes for a reason."""
    lines = example(kind).read_text(encoding="utf-8").split("\n")
    hidden = [i for i, line in enumerate(lines) if re.match(r"# (\[|\w+ = )", line)]
    assert len(hidden) >= 3
    blocks: list[list[int]] = []
    for i in hidden:  # a commented table and the lines below it stand or fall together
        if blocks and blocks[-1][-1] == i - 1 and lines[blocks[-1][0]].startswith("# ["):
            blocks[-1].append(i)
        else:
            blocks.append([i])
    for block in blocks:
        text = [line[2:] if i in block else line for i, line in enumerate(lines)]
        keys = (
            {re.match(r"# (\w+) =", lines[block[0]])[1]}
            if not lines[block[0]].startswith("# [")
            else set()
        )
        text = [
            line for i, line in enumerate(text) if i in block or line.split(" = ")[0] not in keys
        ]
        whole = "\n".join(text)
        if "payload" in tomllib.loads(whole):  # stands for the lump
            whole = re.sub(r"(?ms)^\[\[lump\]\].*?(?=^\[|\Z)", "", whole)
            assert "lump" not in tomllib.loads(whole)
        (tmp_path / "start.toml").write_text(whole, encoding="utf-8")
        bc.read_spec(tmp_path / "start.toml")


def test_init_never_replaces_without_force(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "boom.toml").write_text("mine")
    code, _, error = run(["init", "boom"], capsys, monkeypatch)
    assert code == 2
    assert "--force" in error
    assert (tmp_path / "boom.toml").read_text() == "mine"
    assert run(["init", "boom", "--force"], capsys, monkeypatch)[0] == 0
    assert (tmp_path / "boom.toml").read_text() != "mine"
    code, told, _ = run(["init", "mast", "-o", "deeper/own.toml"], capsys, monkeypatch)
    assert told.splitlines() == [
        "wrote own.toml in deeper",
        "next: beamchain fit deeper/own.toml -o own",
    ]
    assert (tmp_path / "deeper" / "own.toml").is_file()


def test_init_knows_its_kinds(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, error = run(["init", "booom"], capsys, monkeypatch)
    assert code == 2
    assert "did you mean 'boom'" in error
    assert list(tmp_path.iterdir()) == []


def test_init_lists_what_it_writes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, told, _ = run(["init"], capsys, monkeypatch)
    assert code == 0
    listed = dict(re.findall(r"^\W*(\w+)\W+([^│┃\n]+)", told, re.MULTILINE))
    for name in ("boom", "craft", "seed_boom", "array_scene", "instrument_mast", "schema"):
        assert len(listed[name]) > 20
    assert list(tmp_path.iterdir()) == []


def test_init_prints_the_schema_or_writes_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, told, _ = run(["init", "schema"], capsys, monkeypatch)
    assert code == 0
    assert "Segment" in json.loads(told)["$defs"]
    assert list(tmp_path.iterdir()) == []
    words = ["init", "schema", "-o", "spec.schema.json"]
    assert run(words, capsys, monkeypatch)[0] == 0
    assert (tmp_path / "spec.schema.json").read_text() == told
    assert run(words, capsys, monkeypatch)[0] == 2


@pytest.mark.slow
@pytest.mark.parametrize("name", WHOLE)
def test_examples_run(name, tmp_path, capsys, monkeypatch):
    folder = tmp_path / "out"
    spec = tmp_path / "spec.toml"
    assert run(["init", name, "-o", str(spec)], capsys, monkeypatch)[0] == 0
    code, told, _ = run(["fit", str(spec), "-o", str(folder), "--json"], capsys, monkeypatch)
    assert code == 0
    assert json.loads(told)["ok"]
    assert (folder / "appendage.xml").is_file()
    assert (folder / "report.html").is_file()


def test_examples_know_their_names(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, error = run(["init", "seedboom"], capsys, monkeypatch)
    assert code == 2
    assert "did you mean 'seed_boom'" in error
    assert not list(tmp_path.iterdir())
