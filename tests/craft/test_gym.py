"""`beamchain/FlexibleSatellite-v0`: Gymnasium's own checks, seeds, limits of the wheels, episodes, and what is refused.

ROUNDING: sums of a few hundred doubles.
"""

import sys

import numpy as np
import pytest

import beamchain as bc
from spacecraft import CRAFTS

gymnasium = pytest.importorskip("gymnasium", reason="Gymnasium is not installed: pip install 'beamchain[gym]'")

ROUNDING = 1e-9
ID = "beamchain.gym:beamchain/FlexibleSatellite-v0"
JOBS = {"episode": 5.0}


@pytest.fixture(scope="module")
def env():
    made = gymnasium.make(ID, **JOBS)
    yield made
    made.close()


def flown(env, seed: int, count: int = 12) -> np.ndarray:
    seen, _ = env.reset(seed=seed)
    rng, out = np.random.default_rng(0), [seen]
    for _ in range(count):
        seen, reward, *_ = env.step(rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32))
        out.append(np.append(seen.ravel(), reward))
    return np.concatenate([values.ravel() for values in out])


def test_gymnasium_finds_nothing_wrong(env):
    from gymnasium.utils.env_checker import check_env

    check_env(env.unwrapped, skip_render_check=True)


def test_seeds_reproduce(env):
    np.testing.assert_array_equal(flown(env, 7), flown(env, 7))
    assert not np.array_equal(flown(env, 7), flown(env, 8))
    many = gymnasium.make_vec(ID, num_envs=3, **JOBS)
    np.testing.assert_array_equal(flown(many, 7), flown(many, 7))
    many.reset(seed=[1, 2, 3])


def test_episodes_end_and_start_again():
    many = gymnasium.make_vec(ID, num_envs=4, **JOBS)
    assert many.reset(seed=0)[0].shape == (4, 9)
    still, ends = np.zeros((4, 3), np.float32), []
    for k in range(45):
        seen, reward, lost, late, info = many.step(still)
        assert not lost.any()
        assert set(info) >= {"angle", "modes"}
        if late.any():
            ends.append(k)
            before = many.unwrapped.fleet.worlds.fields["tendon_stiffness"].copy()
        elif ends and k == ends[-1] + 1:
            np.testing.assert_array_equal(reward, 0.0)
            assert not np.array_equal(before, many.unwrapped.fleet.worlds.fields["tendon_stiffness"])  # drawn anew
            assert np.all(np.linalg.norm(seen[:, :3], axis=1) > 0.09)
    assert ends == [19, 40]


def test_wheels_keep_to_their_limits():
    env = gymnasium.make(ID, momentum=1.0, noise=(0.0, 0.0), variants=None).unwrapped
    env.reset(seed=0, options={"turn": [0.0, 0.0, 0.1]})
    for k in range(16):
        seen, *_ = env.step(np.array([0.0, 0.0, 1.0], np.float32))
        assert abs(seen[8] - min(0.5 * 0.25 * (k + 1), 1.0)) < 2e-3  # of 1 N m s, 0.5 N m; the wheel turns with the bus
    assert seen[5] < -1e-4  # the bus goes the other way


def test_a_diverged_satellite_ends_its_episode():
    many = gymnasium.make_vec(ID, num_envs=3, **JOBS)
    many.reset(seed=0)
    worlds = many.unwrapped.fleet.worlds
    worlds.reset([1], qvel=np.full(worlds.model.nv, 1e20))
    _, _, lost, late, _ = many.step(np.zeros((3, 3), np.float32))
    assert list(lost) == [False, True, False]
    assert not late.any()
    _, reward, lost, _, _ = many.step(np.zeros((3, 3), np.float32))
    assert not lost.any()
    assert reward[1] == 0.0


def test_a_spacecraft_of_ones_own():
    spec = bc.Spec(segment=(bc.Segment(length=6.0, section=bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)),))
    satellite = bc.__path__[0] + "/examples/satellite.xml"
    env = gymnasium.make(ID, model=bc.embed(satellite, {"left": spec}, retime=True), torque=0.1, slew=0.05, **JOBS)
    env.reset(seed=1)
    *_, info = env.step(np.ones(3, np.float32))
    assert info["modes"].shape == (4,)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"model": str(CRAFTS / "planar.xml"), "variants": None}, "no reaction wheels"),
        ({"timestep": 0.07}, "must divide the period"),
        ({"slew": 4.0}, "at most pi"),
        ({"momentum": 0.0}, "momentum = 0.0 must be above zero"),
        ({"render_mode": "human"}, "render_mode = 'human' is unknown"),
    ],
)
def test_bad_input_is_answered(given, said):
    with pytest.raises(bc.InputError, match=said):
        gymnasium.make(ID, disable_env_checker=True, **given)


def test_rendering():
    import subprocess

    code = f"import gymnasium; e = gymnasium.make({ID!r}, render_mode='rgb_array'); e.reset(seed=0); p = e.render(); print(p.shape, p.std())"  # fmt: skip
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    if "EngineError" in done.stderr:
        pytest.skip(f"MuJoCo cannot draw here: {done.stderr.strip().splitlines()[-1]}")
    shape, _, spread = done.stdout.rpartition(" ")
    assert shape == "(480, 640, 3)"
    assert float(spread) > 5.0  # something is seen
