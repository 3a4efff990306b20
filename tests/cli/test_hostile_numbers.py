"""Numbers that are none, steps and spans far out: one sentence, status 2, nothing written."""

import os

import pytest

import beamchain as bc
from command import run
from hostile_numbers import NUMBERS, craft, random_numbers
from spacecraft import spec

EXAMPLES = int(os.environ.get("BEAMCHAIN_FUZZ", "25"))


def one_sentence(code: int, error: str, word: str) -> None:
    assert code == 2, error
    assert error.splitlines()[-1].startswith("beamchain: "), error
    assert "Traceback" not in error
    assert word in error, error


@pytest.mark.parametrize("command", ["inspect", "embed"])
@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_that_is_none(name, command, tmp_path, capsys, monkeypatch):
    text, word = NUMBERS[name]
    path = tmp_path / "craft.xml"
    out = tmp_path / "out" / "flexible.xml"
    path.write_text(text)
    more = ["--mount", f"mount={spec('rod')}", "-o", str(out)] if command == "embed" else []
    code, _, error = run([command, str(path), *more], capsys, monkeypatch)
    one_sentence(code, error, word)
    assert not out.parent.exists()


def test_ranges_may_be_endless(tmp_path):
    joint = (
        '<body name="arm"><joint name="j" axis="0 0 1" stiffness="9"/><inertial pos="0 0 0" '
        'mass="1" diaginertia="1 1 1"/></body>'
    )
    motor = '<actuator><motor name="m" joint="j" forcerange="-inf inf"/></actuator>'
    path = tmp_path / "craft.xml"
    path.write_text(craft(inside=joint, behind=motor))
    assert bc.linearise(path).frequencies().size == 1


@pytest.mark.parametrize("part", range(5))
def test_any_number_far_out(part, tmp_path):
    for seed in range(part, EXAMPLES, 5):
        path = tmp_path / f"{seed}.xml"
        path.write_text(random_numbers(seed))
        try:
            bc.linearise(path)
        except bc.BeamchainError as error:
            assert str(error).strip()


@pytest.fixture(scope="module")
def flexible(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flexible")
    (folder / "craft.xml").write_text(craft('gravity="0 0 0"'))
    bc.embed(folder / "craft.xml", {"mount": spec("array_left")}).write(folder / "flexible.xml")
    return folder / "flexible.xml"


@pytest.mark.parametrize("step", ["1e-300", "1e9", "nan", "-1"])
@pytest.mark.slow
def test_steps_that_cannot_be_taken(step, flexible, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out.xml"
    code, _, error = run(
        ["retime", str(flexible), f"--timestep={step}", "-o", str(out)], capsys, monkeypatch
    )
    one_sentence(code, error, "timestep")
    assert not out.exists()


@pytest.mark.parametrize("span", ["1e30", "1e-30", "nan", "inf", "-1"])
def test_durations_that_cannot_be_simulated(span):
    with pytest.raises(bc.InputError, match="duration"):
        bc.study(spec("rod"), duration=float(span))
