"""Controllers with coefficients far out: margins that are right, or one sentence;
never another library's warning.

Tolerances: 1e-6 for margins of the same controller in other units,
which are equal but for rounding in the grid's search.
"""

import json
import random

import numpy as np
import pytest

import beamchain as bc
from command import run
from hostile_names import write_files

CRAFT = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/><site name="mount" pos="0.6 0 0"/>
</body></worldbody></mujoco>"""
SAME = 1e-6
VALUES = (
    "0.0",
    "1e-300",
    "1e-30",
    "1e-20",
    "1e-12",
    "1e-3",
    "1.0",
    "1e3",
    "1e12",
    "1e30",
    "-1.0",
    "5e-324",
    "-1e-18",
)
DELAYS = ("0.0", "1e-300", "1e-12", "0.1", "1e6", "1e30")


@pytest.fixture(scope="module")
def flexible(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flexible")
    write_files(folder, "bus")
    (folder / "craft.xml").write_text(CRAFT)
    (folder / "rod.toml").write_text(
        (folder / "rod.toml").read_text().replace("[modes]", "[damping]\nratio = 0.01\n[modes]")
    )
    bc.embed(folder / "craft.xml", {"mount": folder / "rod.toml"}).write(folder / "flexible.xml")
    return folder / "flexible.xml"


def loop(numerator, denominator, delay="0.0"):
    words = [f"[{', '.join(values)}]" for values in (numerator, denominator)]
    return (
        f'[[loop]]\ninput = "torque_z"\noutput = "attitude_z"\nnumerator = {words[0]}\ndenominator '
        f"= {words[1]}\n"
        f"delay = {delay}\n"
    )


def margins(flexible, text, folder, capsys, monkeypatch):
    """Exit status and sentence of `plant`, and its margins."""
    monkeypatch.chdir(folder)
    (folder / "loops.toml").write_text(text)
    call = [
        "plant",
        str(flexible),
        "--from",
        "torque:bus",
        "--controller",
        "loops.toml",
        "-o",
        "p.npz",
        "--force",
    ]
    code, told, sentence = run([*call, "--json"], capsys, monkeypatch)
    return code, sentence, json.loads(told).get("margins")


def test_a_small_gain_in_large_units(flexible, tmp_path, capsys, monkeypatch):
    """Numerator and denominator times one factor are the same controller;
    the smallest coefficient counts."""
    right = margins(
        flexible, loop(("60.0", "40.0"), ("0.05", "1.0")), tmp_path, capsys, monkeypatch
    )[2][0][0]
    words = [[repr(1e-20 * value) for value in values] for values in ((60.0, 40.0), (0.05, 1.0))]
    code, sentence, found = margins(flexible, loop(*words), tmp_path, capsys, monkeypatch)
    assert code in (0, 3)
    assert sentence == ""
    assert found[0][0]["stable"]
    for key in ("gain", "phase", "disk"):
        if right[key] is None:
            assert found[0][0][key] is None
        else:
            np.testing.assert_allclose(found[0][0][key], right[key], rtol=SAME)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (loop(("1e-300",), ("1.0",)), r"numerator[0] = 1e-300"),
        (loop(("1.0",), ("1.0", "5e-324")), r"denominator[1] = 5e-324"),
        (loop(("1.0",), ("1.0", "1.0"), "1e-300"), "delay = 1e-300 s"),
    ],
)
def test_coefficients_too_small_are_named(text, words, flexible, tmp_path, capsys, monkeypatch):
    code, sentence, _ = margins(flexible, text, tmp_path, capsys, monkeypatch)
    assert code == 2
    assert sentence.count("\n") == 1
    assert words in sentence
    assert "write 0.0" in sentence


@pytest.mark.slow
def test_coefficients_at_random(flexible, tmp_path, capsys, monkeypatch):
    rng = random.Random(2)
    taken = 0
    for _ in range(40):
        size = rng.randint(1, 4)
        top, bottom = ([rng.choice(VALUES) for _ in range(n)] for n in (rng.randint(1, size), size))
        text = loop(top, bottom, rng.choice(DELAYS))
        code, sentence, _ = margins(flexible, text, tmp_path, capsys, monkeypatch)
        taken += code != 2
        assert code in (0, 2, 3), text
        assert "Traceback" not in sentence
        assert "Warning" not in sentence
        assert (code == 2) == (sentence.count("\n") == 1), (text, sentence)
    assert taken > 3
