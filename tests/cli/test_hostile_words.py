"""Names and places at random: no traceback, nothing shown that a terminal acts upon,
nothing replaced that was read.

`make fuzz` runs the stated number of them (BEAMCHAIN_FUZZ); the seed is printed,
BEAMCHAIN_SEED sets another.
"""

import os
import random
import shutil
import sys
import traceback

import pytest

import beamchain as bc
from beamchain.cli import main
from hostile_names import NAMES, commands, craft_text, random_name, unseen, write_files
from hostile_outputs import prepare, random_call, state
from spacecraft import CRAFTS, spec

EXAMPLES = int(os.environ.get("BEAMCHAIN_FUZZ", "20"))
SEED = int(os.environ.get("BEAMCHAIN_SEED", "1"))
WHOLE = 20  # of so many names one goes through the commands that fit and draw


def outcome(arguments, capsys, monkeypatch):
    """Exit status of a call, what it printed, and a traceback if there was one."""
    monkeypatch.setattr("sys.argv", ["beamchain", *arguments])
    wrong, code = "", 0
    try:
        main()
    except SystemExit as stopped:
        code = int(stopped.code or 0)
    except BaseException:
        wrong = traceback.format_exc()
    told, sentence = capsys.readouterr()
    if (
        "Traceback" in sentence
        or "Warning" in sentence
        or code not in (0, 2, 3)
        or (code == 2 and not sentence.strip())
    ):
        wrong += f"exit {code}: {sentence[-2000:]}"
    if unseen(told + sentence):
        wrong += f"shows {unseen(told + sentence)[:5]}"
    return code, wrong


@pytest.mark.slow
def test_names_at_random(tmp_path, capsys, monkeypatch):
    """Every kind of name and random ones, in bodies, sites, joints, actuators, sensors,
    keyframes and models."""
    monkeypatch.chdir(tmp_path)
    rng = random.Random(SEED)
    names = [*NAMES.values(), *(random_name(rng) for _ in range(EXAMPLES))]
    failed = []
    for number, name in enumerate(names[:EXAMPLES]):
        folder = tmp_path / str(number)
        folder.mkdir()
        monkeypatch.chdir(folder)
        calls = [
            ["inspect", "craft.xml"],
            ["inspect", name],
            ["plant", "craft.xml", "--pose", name, "-o", f"{name[:40]}.npz"],
        ]
        write_files(folder, name)
        for arguments in commands(name) if number % WHOLE == WHOLE // 2 else calls:
            _, wrong = outcome(arguments, capsys, monkeypatch)
            failed += (
                [f"\nname {name[:80]!r} ({number}) in {arguments[0]}: {wrong}"] if wrong else []
            )
        assert (folder / "craft.xml").read_text(encoding="utf-8") == craft_text(name).replace(
            "\r\n", "\n"
        )
        shutil.rmtree(folder)
    sys.stdout.write(f"BEAMCHAIN_SEED={SEED}: {EXAMPLES} names, {len(failed)} failed\n")
    assert not failed, f"{len(failed)} of {EXAMPLES} names:" + "".join(failed[:10])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="links and fifos of a POSIX system")
def test_outputs_at_random(tmp_path, capsys, monkeypatch):
    """Outputs onto inputs, onto each other, onto links, devices and folders,
    with --force and without."""
    flexible = bc.embed(CRAFTS / "planar.xml", {"mount": spec("rod")}).to_mjcf().encode()
    rng = random.Random(SEED)
    failed = []
    taken = 0
    for number in range(EXAMPLES):
        folder = tmp_path / str(number) / "inner"
        folder.mkdir(parents=True)
        monkeypatch.chdir(folder)
        prepare(folder, flexible)
        call, kept, force = random_call(rng)
        before = state(folder.parent)
        code, wrong = outcome(call, capsys, monkeypatch)
        after = state(folder.parent)
        taken += code != 2
        changed = [name for name, content in before.items() if after.get(name) != content]
        if code == 2 and after != before:
            wrong += f"refused, and changed {changed or sorted(set(after) - set(before))}"
        if not force and changed:
            wrong += f"replaced {changed} without --force"
        if lost := [name for name in kept if f"inner/{name}" in changed]:
            wrong += f"replaced its input {lost}"
        if left := [name for name in after if name.endswith(".part")]:
            wrong += f"left {left}"
        failed += [f"\n{call} ({number}): {wrong}"] if wrong else []
        monkeypatch.chdir(tmp_path)
        shutil.rmtree(folder.parent)
    sys.stdout.write(
        f"BEAMCHAIN_SEED={SEED}: {EXAMPLES} calls, {taken} taken, {len(failed)} failed\n"
    )
    assert not failed, f"{len(failed)} of {EXAMPLES} calls:" + "".join(failed[:10])
