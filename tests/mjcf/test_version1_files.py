"""Files that version 1 wrote, chains and oscillators: still inspected,
and their appendages still taken out.

What is taken out leaves the original file, byte for byte;
frequencies are those of version 1's own records.
"""

import json
from pathlib import Path

import mujoco
import pytest

import beamchain as bc
import terminal
from appendages import close

OLD = Path(__file__).parents[1] / "crafts" / "version1"
CRAFT = (OLD / "craft.xml").read_bytes()
EMBEDDED = ["flexible.xml", "flexible_osc.xml"]
#: Frequencies [rad/s] of the compiled file, lowest first, and mass [kg].
INSPECTED = {
    "array_appendage.xml": ((2.134813667, 9.230300466, 12.18283671), 17.431946819104333),
    "oscillators_appendage.xml": (
        (3.040820602, 3.040820602, 19.05649742, 19.05649742),
        8.143008158104745,
    ),
    "flexible.xml": ((3.738838187, 12.94884339, 17.44781220), 517.4319468191044),
    "flexible_osc.xml": ((6.144050497, 6.144050497, 20.28154789, 20.28154789), 508.14300815810475),
}


def run(*words):
    code, out, err = terminal.run(*words)
    assert code == 0, err
    return out


@pytest.mark.parametrize(
    "name", sorted(path.name for path in OLD.iterdir() if path.name != "craft.xml")
)
def test_they_are_inspected(name):
    said = run("inspect", OLD / name)
    assert "Modes about the rest pose" in said
    record = json.loads(run("inspect", OLD / name, "--json"))
    frequencies, mass = INSPECTED[name]
    assert [mode["frequency"] for mode in record["modes"]] == close(list(frequencies), rel=1e-8)
    assert record["mass"] == close(mass, rel=1e-12)
    assert len(record["springs"]) == len(frequencies)


@pytest.mark.parametrize("words", [(), ("--at", "mount")])
@pytest.mark.parametrize("name", EMBEDDED)
def test_they_are_taken_out_by_the_command(name, words, tmp_path):
    out = tmp_path / "craft.xml"
    run("embed", OLD / name, "--remove", *words, "-o", out)
    assert out.read_bytes() == CRAFT


ROD = (
    'name = "rod"\n[[segment]]\nlength = 2.0\nsection = { shape = "round", diameter = 0.02 }\n'
    "material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }\n"
)


@pytest.mark.parametrize("name", EMBEDDED)
def test_they_are_replaced(name, tmp_path):
    """Another appendage at the same place: as if it came into the bare spacecraft."""
    (tmp_path / "rod.toml").write_text(ROD)
    anew = bc.embed(OLD / "craft.xml", {"mount": tmp_path / "rod.toml"}).to_mjcf(OLD)
    assert bc.embed(OLD / name, {"mount": tmp_path / "rod.toml"}).to_mjcf(OLD) == anew


def bodies(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    return {model.body(i).name for i in range(model.nbody)}


@pytest.mark.slow
@pytest.mark.parametrize("name", EMBEDDED)
def test_another_appendage_comes_beside_them(name, tmp_path):
    """What stands in the file is fitted anew from the spec in its mark;
    oscillators become a chain."""
    (tmp_path / "rod.toml").write_text(ROD)
    done = bc.embed(OLD / name, {"side": tmp_path / "rod.toml"})
    assert [a.at for a in done.appendages] == ["mount", "side"]
    assert all(a.fit.status.ok for a in done.appendages)
    assert done.appendages[0].fit.chain.hinges
    assert "slider" not in done.to_mjcf()
    assert "oscillators" not in done.to_mjcf()
    both, bare, left = (tmp_path / name for name in ("both.xml", "bare.xml", "left.xml"))
    done.write(both)
    run("embed", both, "--remove", "-o", bare)
    assert bare.read_text() == (OLD / "craft.xml").read_text()
    run("embed", both, "--remove", "--at", "side", "-o", left)
    names = bodies(left)
    assert not any(name.startswith("rod_") for name in names)
    assert names - bodies(bare)  # the other one stands
    run("embed", left, "--remove", "--at", "mount", "-o", bare, "--force")
    assert bare.read_text() == (OLD / "craft.xml").read_text()
