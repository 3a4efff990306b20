"""`beamchain/FlexibleSatellite-v0` and its vector version: what Gymnasium asks for around a `Fleet`."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from beamchain.checks import one_of
from beamchain.craft.worlds.fleet import FASTEST, Fleet
from beamchain.engine.library import mujoco
from beamchain.errors import EngineError
from beamchain.ports.motions import Array

MODES = ["rgb_array"]
METADATA = {"render_modes": MODES, "render_fps": 4}
SIZE = (480, 640)  # of a picture


class Satellite(gymnasium.Env[Array, Array]):
    """One satellite, turned to a drawn attitude by its wheels and held there.

    An action is the torque of every wheel, from -1 to 1 of the largest. Observed are the rotation from the wanted attitude
    in body axes (star tracker) [rad], the mean rate over the last period (gyro) [rad/s], and the momentum of the wheels
    over the largest. The reward is `-(angle/slew)^2` less a hundredth of the mean square of the torques over their largest.
    An episode is terminated where the simulation diverges. `info` holds the amplitudes `modes` of the appendages' modes,
    and the true `angle` from the wanted attitude [rad]; `reset(options={"turn": (x, y, z)})` gives the turn [rad].

    Args:
        render_mode: None or "rgb_array".
        options: as of `Fleet`.
    """

    metadata: dict[str, Any] = METADATA

    fleet: Fleet
    render_mode: str | None
    observation_space: gymnasium.spaces.Space[Any]
    action_space: gymnasium.spaces.Space[Any]

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        self.fleet, self.render_mode = Fleet(1, **options), render_mode
        self.observation_space, self.action_space = _spaces(self.fleet)
        self._camera = Camera(self.fleet, render_mode)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        seen = self.fleet.start(np.zeros(1, dtype=np.intp), self.np_random, (options or {}).get("turn"))
        return seen[0], {}

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold torques over a period."""
        out = self.fleet.step(np.asarray(action)[None], self.np_random)
        info = {name: values[0] for name, values in out.info.items()}
        return out.observation[0], float(out.reward[0]), bool(out.terminated[0]), bool(out.truncated[0]), info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture `(480, 640, 3)`."""
        return self._camera.picture()

    def close(self) -> None:
        """Give the renderer back."""
        self._camera.close()


class Satellites(gymnasium.vector.VectorEnv[Array, Array, NDArray[Any]]):
    """Satellites that are stepped together, each as `Satellite`; one that is over starts again with the next step.

    Args:
        num_envs: number of satellites.
        render_mode: None or "rgb_array": the first satellite.
        options: as of `Fleet`.
    """

    metadata: dict[str, Any] = METADATA | {"autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}

    single_observation_space: gymnasium.spaces.Space[Any]
    single_action_space: gymnasium.spaces.Space[Any]
    observation_space: gymnasium.spaces.Space[Any]
    action_space: gymnasium.spaces.Space[Any]

    fleet: Fleet
    render_mode: str | None

    def __init__(self, num_envs: int = 1, render_mode: str | None = None, **options: Any) -> None:
        self.fleet, self.render_mode = Fleet(num_envs, **options), render_mode
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = _spaces(self.fleet)
        batch = gymnasium.vector.utils.batch_space
        self.observation_space = batch(self.single_observation_space, num_envs)
        self.action_space = batch(self.single_action_space, num_envs)
        self._over, self._camera = np.zeros(num_envs, dtype=np.bool_), Camera(self.fleet, render_mode)

    def reset(
        self, *, seed: int | list[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start all episodes."""
        if isinstance(seed, list):
            self._np_random, self._np_random_seed = np.random.default_rng(seed), -1
        else:
            super().reset(seed=seed)
        self._over[:] = False
        return self.fleet.start(np.arange(self.num_envs), self.np_random, (options or {}).get("turn")), {}

    def step(self, actions: Any) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Hold torques over a period; those that were over start again, without a reward."""
        out = self.fleet.step(actions, self.np_random)
        seen, reward, lost, late = out.observation, out.reward, out.terminated, out.truncated
        again = self._over
        if np.any(again):
            seen = self.fleet.start(np.flatnonzero(again), self.np_random)
            reward, lost, late = np.where(again, 0.0, reward), lost & ~again, late & ~again
        self._over = lost | late
        every = np.ones(self.num_envs, dtype=np.bool_)
        return seen, reward, lost, late, out.info | {f"_{name}": every for name in out.info}

    def render(self) -> Any:
        """A picture `(480, 640, 3)` of the first satellite."""
        return self._camera.picture()

    def close_extras(self, **_: Any) -> None:
        """Give the renderer back."""
        self._camera.close()


class Camera:
    """Pictures of the first satellite of a fleet, none where the mode is None; the renderer is made with the first."""

    def __init__(self, fleet: Fleet, render_mode: str | None) -> None:
        if render_mode is not None:
            one_of("render_mode", render_mode, MODES)
        self._worlds, self._mode, self._renderer = fleet.worlds, render_mode, None

    def picture(self) -> NDArray[np.uint8] | None:
        """`(480, 640, 3)`."""
        if self._mode is None:
            return None
        model = self._worlds.model
        if self._renderer is None:
            try:
                self._renderer = mujoco.Renderer(model, *SIZE)
            except Exception as error:  # each of MuJoCo's backends fails in its own way
                raise EngineError(
                    f"MuJoCo cannot draw here ({error}); set MUJOCO_GL to egl, osmesa or glfw, whichever this machine has, "
                    "before Python starts."
                ) from None
        data = mujoco.MjData(model)
        data.qpos[:] = self._worlds.qpos[0]
        mujoco.mj_forward(model, data)
        self._renderer.update_scene(data)
        return np.asarray(self._renderer.render(), dtype=np.uint8)

    def close(self) -> None:
        """Give it back."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer = None


def _spaces(fleet: Fleet) -> tuple[Any, Any]:
    """Of one satellite: observations and actions."""
    high = np.repeat([np.pi, FASTEST, 2.0], [3, 3, len(fleet.torque)])
    box = gymnasium.spaces.Box
    return box(-high, high, dtype=np.float64), box(-1.0, 1.0, (len(fleet.torque),), dtype=np.float32)
