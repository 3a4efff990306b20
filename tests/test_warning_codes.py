"""Tests an internal as well, `warning_codes`, where codes are made: every warning has a code that
scripts can rely on, in every command's JSON."""

import json
import pickle
import re
from pathlib import Path

import pytest

import beamchain as bc
from beamchain.warning_codes import CODES, Caution, at
from command import call
from products import GONE
from spacecraft import spec

BUS = (
    '<mujoco><option gravity="0 0 -9.81" density="1" timestep="0.5" '
    'integrator="implicitfast"/><worldbody><body name="hub">'
    '<freejoint/><inertial pos="0 0 0" mass="50" diaginertia="5 5 5"/><body name="yoke"><joint '
    'name="drive" stiffness="1000" '
    'springref="30"/><inertial pos=".3 .1 0" mass="5" diaginertia="1 1 1"/><site '
    'name="mount"/></body></body></worldbody>'
    "</mujoco>"
)
DOUBTFUL = """name = "rod"
[[segment]]
length = 2.0
section = { shape = "round", diameter = 0.3 }
material = { youngs_modulus = 70.0, density = 2.7, poissons_ratio = 0.33 }
[modes]
xy = 1
[damping]
ratio = 0.5
"""


def codes(record) -> set[str]:
    """Codes of a record, each with its sentence."""
    assert all(item["message"] for item in record["warnings"])
    return {item["code"] for item in record["warnings"]}


def test_every_code_has_a_meaning_and_a_cure():
    assert list(CODES) == sorted(CODES)
    assert all(re.fullmatch(r"[a-z]+(-[a-z]+)*", code) for code in CODES)
    for code, (meaning, cure) in CODES.items():
        assert not meaning.endswith("."), code
        assert cure.endswith("."), code


def test_every_code_is_used():
    """No code stands for nothing, and none is misspelt where a warning is made."""
    source = "".join(
        p.read_text()
        for p in Path(bc.__file__).parent.rglob("*.py")
        if p.name != "warning_codes.py"
    )
    unused = {code for code in CODES if f'"{code}"' not in source} - {"other"}
    assert GONE or not unused  # where a product was taken out, its codes stand for nothing
    assert set(re.findall(r'Caution\(\s*"([^"]+)"', source)) <= set(CODES)


def test_a_warning_is_its_sentence():
    said = Caution("gravity", "it falls")
    assert said == "it falls"
    assert (at("mount", said), at("mount", said).code) == ("mount: it falls", "gravity")
    assert pickle.loads(pickle.dumps(said)).code == "gravity"
    assert json.dumps([said]) == '["it falls"]'
    with pytest.raises(KeyError):
        Caution("gravitation", "")


@pytest.mark.slow
def test_embed():
    done = bc.embed(BUS, {"mount": spec("rod")}, retime=False)
    found = codes(done.as_dict())
    assert found >= {
        "gravity",
        "medium",
        "joints-behind",
        "preloaded-spring",
        "unstable-step",
        "rigid-plane",
    }
    assert "other" not in found
    text = BUS.replace("implicitfast", "Euler")
    sprung = bc.embed(text, {"mount": spec("rod")}, retime=True)
    of_step = codes(sprung.as_dict()) & {"unstable-step", "time-error", "exact-in-time"}
    assert of_step == {"unstable-step"}  # its own sprung drive is too fast for the step
    free = (
        BUS.replace("implicitfast", "Euler")
        .replace(' stiffness="1000" springref="30"', "")
        .replace("0.5", "0.02")
    )
    assert "exact-in-time" in codes(bc.embed(free, {"mount": spec("rod")}, retime=True).as_dict())
    assert {w.code for w in done.warnings} == found


def test_fit(tmp_path):
    (tmp_path / "rod.toml").write_text(DOUBTFUL)
    done = bc.fit(bc.read_spec(tmp_path / "rod.toml"))
    found = codes(done.as_dict())
    assert found >= {
        "soft-material",
        "light-material",
        "stocky-beam",
        "high-damping",
        "rigid-plane",
        "tendon-damping",
    }
    assert "other" not in found


@pytest.mark.slow
def test_stability_and_inspect(tmp_path):
    bare = BUS.replace(' springref="30"', "").replace("0.5", "0.01")
    made = bc.embed(bare, {"mount": spec("rod")}, retime=False)
    made.write(tmp_path / "slow.xml")
    slow = (tmp_path / "slow.xml").read_text().replace('timestep="0.01"', 'timestep="5"')
    (tmp_path / "slow.xml").write_text(slow)
    assert codes(bc.stability(tmp_path / "slow.xml").as_dict()) == {"unstable-step"}
    model = bc.embed(bare.replace("implicitfast", "Euler"), {"mount": spec("rod")}, retime=True)
    model.write(tmp_path / "craft.xml")
    other = (tmp_path / "craft.xml").read_text().replace('timestep="0.01"', 'timestep="0.02"')
    (tmp_path / "other.xml").write_text(other)
    assert codes(call("inspect", tmp_path / "other.xml", "--json").record) == {"other-step"}
