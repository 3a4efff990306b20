"""What a run puts an appendage through, and the warnings where a chain is not right for it."""

from functools import cache

import mujoco
import pytest

import beamchain as bc
from examples import example
from spacecraft import spec

SEED = example("seed_boom")
SAME = 1e-9  # two ways to hold one chain

CRAFT = """<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 0" integrator="implicitfast" timestep="0.01"/>
  <worldbody>
    <body name="bus">
      <freejoint/>
      <inertial pos="0 0 0" mass="500" diaginertia="500 500 500"/>
      <site name="mount" pos="1 0 0"/>
    </body>
  </worldbody>
  <actuator><motor name="wheel" site="mount" gear="0 0 0 0 0 1"/></actuator>
  <keyframe>{keys}</keyframe>
</mujoco>"""
KEY = "<key name='{name}' qpos='0 0 0 1 0 0 0' qvel='0 0 0 {qvel}' ctrl='{ctrl}'/>"


@cache
def seed_fit() -> bc.Fit:
    """The 2008 boom, fitted once: its limits take a second."""
    return bc.fit(SEED)


def craft(*keys: tuple[str, str, float]) -> str:
    return CRAFT.format(keys="".join(KEY.format(name=n, qvel=v, ctrl=c) for n, v, c in keys))


@pytest.mark.slow
def test_embed_warns_of_a_keyframe_beyond_the_chain():
    still = bc.embed(craft(("still", "0 0 0", 0.0), ("slow", "0 0 0.01", 0.0)), {"mount": SEED})
    assert not [w for w in still.warnings if "keyframe" in w]
    fast = bc.embed(craft(("spin up", "0 0 0.9", 0.0), ("slow", "0 0 0.01", 0.0)), {"mount": SEED})
    said = [w for w in fast.warnings if "keyframe" in w]
    assert len(said) == 1
    limit = fast.appendages[0].large_motion["xy"].spin
    assert said[0].startswith("mount, keyframe spin up: ")
    assert f"{limit:.4g}" in said[0]
    (record,) = fast.as_dict()["appendages"]
    assert record["large_motion"][0]["spin"] == limit
    assert said[0] in [one["message"] for one in fast.as_dict()["warnings"]]


@pytest.mark.slow
def test_embed_into_an_mjspec_warns_too():
    done = bc.embed(mujoco.MjSpec.from_string(craft(("spin", "0 0 0.9", 0.0))), {"mount": SEED})
    assert any("keyframe spin" in w for w in done.warnings)


@pytest.mark.slow
def test_embedded_chains_have_limits_wherever_their_springs_stand():
    done = bc.embed(craft(("spin", "0 0 0.9", 0.0)), {"mount": bc.read_spec(spec("rod"))})
    assert done.appendages[0].large_motion
    plain = seed_fit()
    tied = bc.fit(bc.read_spec(SEED), options=bc.spec.FitOptions(springs="modes"))
    assert tied.chain.tendons
    for name, value in plain.large_motion[0]["xy"].as_dict().items():
        assert tied.large_motion[0]["xy"].as_dict()[name] == (
            value if name == "port" else pytest.approx(value, rel=SAME)
        )
