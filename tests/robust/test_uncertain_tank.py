"""A tank on an uncertain spacecraft: its liquid is as certain as the thrust that presses it."""

import pytest

from barge import BOTH, embedded
from command import call


@pytest.mark.slow
def test_a_liquid_is_not_varied(tmp_path):
    embedded(tmp_path, 0.05, arrays=BOTH).write(tmp_path / "flexible.xml")
    (tmp_path / "u.toml").write_text("[appendage.tank_]\nfrequency = { relative = 0.1 }\n")
    (tmp_path / "loops.toml").write_text(
        '[[loop]]\ninput = "torque_x"\noutput = "attitude_x"\nnumerator = [400.0, 60.0]\n'
        "denominator = [0.05, 1.0]\n"
    )
    told = call(
        *("worst-case", tmp_path / "flexible.xml", "--input", "torque:bus"),
        *("--output", "attitude", "--controller", tmp_path / "loops.toml"),
        *("--uncertain", tmp_path / "u.toml", "--pose", "burn", "-o", tmp_path / "worst.html"),
    )
    assert told.status == 2
    said = " ".join(told.err.split())
    for words in ("'tank_'", "liquid", "not varied", "vary the thrust (+-20 % is +-10 %"):
        assert words in said
    assert not (tmp_path / "worst.html").exists()
