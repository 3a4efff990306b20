"""`beamchain/FlexibleSatellite-v0`: Gymnasium's own checks, seeds, limits of the wheels, episodes,
and what is refused.

ROUNDING: sums of a few hundred doubles.
"""

import importlib
import sys

import numpy as np
import pytest

import beamchain as bc
from docstrings import run_example

gymnasium = pytest.importorskip(
    "gymnasium", reason="Gymnasium is not installed: pip install 'beamchain[worlds]'"
)

ROUNDING = 1e-9
ID = "beamchain.worlds.gym:beamchain/FlexibleSatellite-v0"
JOBS = {"episode": 5.0}


@pytest.fixture(scope="module")
def env():
    made = gymnasium.make(ID, **JOBS)
    yield made
    made.close()


def flown(env, seed: int, count: int = 12) -> np.ndarray:
    seen, _ = env.reset(seed=seed)
    rng = np.random.default_rng(0)
    out = [seen]
    for _ in range(count):
        seen, reward, *_ = env.step(
            rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        )
        out.append(np.append(seen.ravel(), reward))
    return np.concatenate([values.ravel() for values in out])


@pytest.mark.slow
def test_gymnasium_finds_nothing_wrong(env):
    from gymnasium.utils.env_checker import check_env

    check_env(env.unwrapped, skip_render_check=True)


def test_seeds_reproduce(env):
    np.testing.assert_array_equal(flown(env, 7), flown(env, 7))
    assert not np.array_equal(flown(env, 7), flown(env, 8))


def test_episodes_end_and_each_draws_its_modes(env):
    still = np.zeros(3, np.float32)
    drawn = []
    for seed in (0, None):
        seen, _ = env.reset(seed=seed)
        assert seen.shape == (9,)
        assert np.linalg.norm(seen[:3]) > 0.09
        drawn.append(env.unwrapped.worlds.fields["tendon_stiffness"].copy())
        for k in range(20):
            _, _, lost, late, info = env.step(still)
            assert not lost
            assert late == (k == 19)
            assert set(info) >= {"angle", "modes"}
    assert not np.array_equal(*drawn)


def test_several_are_made_by_gymnasium_itself():
    many = gymnasium.make_vec(ID, num_envs=2, **JOBS)
    seen, _ = many.reset(seed=[1, 2])
    assert seen.shape == (2, 9)
    alone = gymnasium.make(ID, **JOBS)
    np.testing.assert_array_equal(seen[1], alone.reset(seed=2)[0])
    many.close()


def test_wheels_keep_to_their_limits():
    env = gymnasium.make(ID, momentum=1.0, noise=(0.0, 0.0), variants=None).unwrapped
    env.reset(seed=0, options={"turn": [0.0, 0.0, 0.1]})
    for k in range(16):
        seen, *_ = env.step(np.array([0.0, 0.0, 1.0], np.float32))
        # of 1 N m s, 0.5 N m; the wheel turns with the bus
        assert abs(seen[8] - min(0.5 * 0.25 * (k + 1), 1.0)) < 2e-3
    assert seen[5] < -1e-4  # the bus goes the other way


def test_a_torque_beyond_the_motor_is_the_motors_own():
    def flown(torque: float, action: float) -> np.ndarray:
        env = gymnasium.make(ID, torque=torque, noise=(0.0, 0.0), variants=None).unwrapped
        env.reset(seed=0, options={"turn": [0.0, 0.0, 0.1]})
        seen = [env.step(np.array([0.0, 0.0, a])) for a in (action, action, 0.0, 0.0)]
        return np.array([observed for observed, *_ in seen])

    np.testing.assert_allclose(flown(5.0, 1.0), flown(0.5, 1.0), rtol=0.0, atol=ROUNDING)


def test_a_diverged_satellite_ends_its_episode():
    env = gymnasium.make(ID, **JOBS)
    env.reset(seed=0)
    worlds = env.unwrapped.worlds
    worlds.reset([0], qvel=np.full(worlds.model.nv, 1e20))
    drawn = worlds.drawn["frequency"]
    seen, reward, lost, late, info = env.step(np.zeros(3, np.float32))
    assert lost
    assert not late
    # of the new start: at rest, turned by the whole angle, with the same modes
    assert np.abs(seen[3:]).max() < 1e-6
    assert abs(np.linalg.norm(seen[:3]) - info["angle"]) < 1e-5
    assert abs(reward + (info["angle"] / 0.2) ** 2) < ROUNDING
    np.testing.assert_array_equal(worlds.drawn["frequency"], drawn)
    env.reset()
    assert not env.step(np.zeros(3, np.float32))[2]


@pytest.fixture(scope="module")
def own():
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    spec = bc.Spec(segment=(bc.Segment(length=6.0, section=section),))
    return bc.embed(bc.__path__[0] + "/examples/satellite.xml", {"left": spec}, retime=True)


@pytest.mark.slow
def test_a_spacecraft_of_ones_own(own):
    env = gymnasium.make(ID, model=own, torque=0.1, slew=0.05, **JOBS)
    env.reset(seed=1)
    *_, info = env.step(np.ones(3, np.float32))
    assert info["modes"].shape == (4,)


def test_what_was_drawn_is_told():
    env = gymnasium.make(ID, variants={"frequency": 0.1}, **JOBS)
    factors = []
    for _ in range(2):
        _, info = env.reset()
        *_, after = env.step(np.zeros(3, np.float32))
        np.testing.assert_array_equal(after["drawn"]["frequency"], info["drawn"]["frequency"])
        assert set(info) == {"angle", "modes", "drawn"}
        factors.append(info["drawn"]["frequency"])
    assert factors[0].shape == info["modes"].shape
    assert not np.array_equal(*factors)


def test_an_episode_is_whole_periods():
    env = gymnasium.make(ID, episode=5.1).unwrapped
    assert env.episode == 5.0


@pytest.mark.slow
def test_warnings_of_a_model_are_told(own):
    """A step that is too long for modes of a spacecraft of one's own."""
    with pytest.warns(UserWarning, match="modes are too fast for"):
        gymnasium.make(ID, model=own, period=20.0, timestep=20.0, disable_env_checker=True)


@pytest.mark.slow
def test_rendering():
    import subprocess

    code = (
        f"import gymnasium; e = gymnasium.make({ID!r}, render_mode='rgb_array'); "
        "e.reset(seed=0); p = e.render(); print(p.shape, p.std())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    if "EngineError" in done.stderr:
        pytest.skip(f"MuJoCo cannot draw here: {done.stderr.strip().splitlines()[-1]}")
    shape, _, spread = done.stdout.rpartition(" ")
    assert shape == "(480, 640, 3)"
    assert float(spread) > 5.0  # something is seen


def test_the_example_of_the_environment_runs(tmp_path, monkeypatch):
    name = ID.partition(":")[0]
    run_example(importlib.import_module(name), name, tmp_path, monkeypatch)
