"""A tank on an uncertain spacecraft: its liquid is as certain as the thrust that presses it."""

import pytest

import beamchain as bc
from barge import embedded
from beamchain import robust
from refused import check_refused


@pytest.mark.slow
def test_a_liquid_is_not_varied(tmp_path):
    craft = embedded(tmp_path, 0.05, arrays=("left",))
    plant = bc.plant(craft, ["torque:bus"], ["attitude"], pose="burn")
    (tmp_path / "u.toml").write_text("[appendage.tank_]\nfrequency = { relative = 0.1 }\n")
    check_refused(
        lambda: robust.uncertain(plant, tmp_path / "u.toml"),
        bc.InputError,
        ("'tank_'", "liquid", "not varied", "vary the thrust (+-20 % is +-10 %"),
    )
