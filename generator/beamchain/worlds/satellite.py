"""`beamchain/FlexibleSatellite-v0`: a satellite that is turned by its wheels and held,
on one of `worlds.make`."""

from collections.abc import Sequence
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from beamchain import Embedded, embed
from beamchain.checks import finite_array, not_negative, one_of, positive
from beamchain.errors import EngineError, InputError
from beamchain.toolkit import Array, mass_matrix, mujoco
from beamchain.worlds.observation import mean_rate
from beamchain.worlds.worlds import Worlds, make

RANDOMISED = {"frequency": 0.1, "damping": 0.5}  # half widths relative to the nominal modes
TORQUE = 0.5  # [N m] of a wheel whose motor has no ctrlrange
FASTEST = 1.0  # [rad/s] end of the observed rates
EFFORT = 0.01  # weight of the torques in the reward
MODES = ["rgb_array"]
METADATA = {"render_modes": MODES, "render_fps": 4}
SIZE = (480, 640)  # of a picture


class Satellite(gymnasium.Env[Array, Array]):
    """One satellite, turned from rest to a drawn attitude by its wheels and held there.

    An action is the torque of every wheel, from -1 to 1 of the largest. Observed are the rotation
    from the wanted attitude in body axes (star tracker) [rad], the mean rate over the last period
    (gyro) [rad/s], and the momentum of the wheels over the largest. The reward is
    `-(angle/slew)^2` less a hundredth of the mean square of the torques over their largest. An
    episode is terminated where the simulation diverges. `info` holds the amplitudes `modes` of the
    appendages' modes, the true `angle` from the wanted attitude [rad], and what was `drawn` for the
    episode, as `Worlds.drawn` names it; `reset(options={"turn": (x, y, z)})` gives the turn [rad].
    Of a model of yours the `warnings` of its worlds are told through `gymnasium.logger`.

    Args:
        render_mode: None or "rgb_array".
        model: what `bc.embed` gave, a compiled model or the path of a `flexible.xml`; its wheels
            are leaf bodies on unlimited hinges with motors. None: the satellite of the package with
            an array on either side.
        variants: as in `worlds.make`, drawn anew for every episode; None: nothing differs.
        period: over which an action is held [s].
        timestep: of the simulation [s]; default: half the period.
        episode: [s], at least a period; rounded to whole periods.
        slew: largest angle of a turn [rad]; the smallest is half of it.
        torque: largest of each wheel [N m]; default: from the motors' `ctrlrange`, which cuts what
            lies beyond it.
        momentum: largest of each wheel [N m s].
        noise: standard deviations of the star tracker [rad] and of the mean rate [rad/s].
    """

    metadata: dict[str, Any] = METADATA

    worlds: Worlds
    render_mode: str | None
    observation_space: gymnasium.spaces.Space[Any]
    action_space: gymnasium.spaces.Space[Any]

    def __init__(
        self,
        render_mode: str | None = None,
        *,
        model: "Embedded | mujoco.MjModel | str | Path | None" = None,
        variants: Any = RANDOMISED,
        period: float = 0.25,
        timestep: float | None = None,
        episode: float = 120.0,
        slew: float = 0.2,
        torque: float | None = None,
        momentum: float = 12.0,
        noise: Sequence[float] = (1e-6, 1e-7),
    ) -> None:
        if render_mode is not None:
            one_of("render_mode", render_mode, MODES)
        self.render_mode = render_mode
        self._renderer: Any = None
        self.period: float = positive("period", period, "s")
        self.slew: float = positive("slew", slew, "rad")
        self.momentum: float = positive("momentum", momentum, "N m s")
        if self.slew > np.pi:
            raise InputError(f"slew = {self.slew:g} must be at most pi (rad).")
        step = self.period / 2.0 if timestep is None else positive("timestep", timestep, "s")
        self._substeps = max(round(self.period / step), 1)
        if abs(self._substeps * step - self.period) > 1e-9 * self.period:
            raise InputError(
                f"timestep = {step:g} s must divide the period, {self.period:g} s, into whole "
                "steps."
            )
        if positive("episode", episode, "s") < self.period:
            raise InputError(
                f"period = {self.period:g} s must be at most the episode, {episode:g} s: an action "
                "is held over it."
            )
        self._steps = round(episode / self.period)
        self.episode: float = self._steps * self.period
        self._noise = [
            not_negative("noise", float(value), "rad and rad/s")
            for value in finite_array("noise", noise, (2,))
        ]
        self.worlds = make(
            _shipped_satellite() if model is None else model, variants, 1, timestep=step
        )
        for warning in self.worlds.warnings if model is not None else ():
            gymnasium.logger.warn("%s", warning)  # a sentence may hold a percent sign
        self._add_wheels(torque)
        high = np.repeat([np.pi, FASTEST, 2.0], [3, 3, len(self.torque)])
        self.observation_space = gymnasium.spaces.Box(-high, high, dtype=np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (len(self.torque),), dtype=np.float32)

    def _add_wheels(self, torque: float | None) -> None:
        """Read the wheels' gears, inertias and largest torques from the model."""
        made = self.worlds.model
        wheels = self.worlds.wheels
        if not wheels:
            raise InputError(
                "the model has no reaction wheels; give it bodies without children on hinges "
                "without limits, each with a motor, as in satellite.xml among the package's "
                "examples."
            )
        self._gear = made.actuator_gear[wheels, 0]
        spin = made.jnt_dofadr[made.actuator_trnid[wheels, 0]]
        self._inertia = np.diag(mass_matrix(made))[spin]  # of each wheel about its axis [kg m^2]
        allowed = np.abs(made.actuator_ctrlrange[wheels] * self._gear[:, None]).min(axis=1)
        limited = made.actuator_ctrllimited[wheels]
        limits = np.where(limited, allowed, TORQUE)
        self.torque: Array = (
            limits if torque is None else np.full(len(spin), positive("torque", torque, "N m"))
        )
        #: what a motor lets through [N m], where `torque` asks for more
        self._passed = np.where(limited, np.minimum(allowed, self.torque), self.torque)
        self._torque = np.zeros(len(spin))  # held over the last period
        self._target = np.array([1.0, 0.0, 0.0, 0.0])
        self._age = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode, at rest."""
        super().reset(seed=seed)
        axis = self.np_random.normal(size=3)
        drawn = axis / np.linalg.norm(axis) * self.slew * self.np_random.uniform(0.5, 1.0)
        for name in options or {}:
            one_of("option of reset", name, ("turn",))
        turn = finite_array("turn", (options or {}).get("turn", drawn), (3,), unit="rad")
        half = float(np.linalg.norm(turn)) / 2.0
        self._target = np.append(np.cos(half), turn / 2.0 * np.sinc(half / np.pi))
        self._age, self._torque = 0, np.zeros_like(self._torque)
        self.worlds.rng = self.np_random
        observation, angle = self._seen(self.worlds.reset([0], draw=True))
        return observation, self._info(angle, self.worlds.observe())

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold torques over a period."""
        stored = self._stored(self.worlds.observe())
        wanted = np.clip(finite_array("action", action, self.torque.shape), -1.0, 1.0) * self.torque
        filled = np.clip(
            wanted, (-self.momentum - stored) / self.period, (self.momentum - stored) / self.period
        )
        self._torque = np.clip(filled, -self._passed, self._passed)
        ctrl = np.zeros((1, self.worlds.model.nu))
        ctrl[0, self.worlds.wheels] = self._torque / self._gear
        seen = self.worlds.step(ctrl, self._substeps)
        diverged = len(self.worlds.diverged) > 0
        if diverged:
            self._torque = np.zeros_like(self._torque)
        self._age += 1
        observation, angle = self._seen(seen)
        reward = -((angle / self.slew) ** 2) - EFFORT * float(
            np.mean((self._torque / self.torque) ** 2)
        )
        late = self._age >= self._steps and not diverged
        return observation, reward, diverged, late, self._info(angle, seen)

    def _info(self, angle: float, seen: dict[str, Array]) -> dict[str, Any]:
        modes = seen["modes"][0] if "modes" in seen else np.zeros(0)
        drawn = {name: values[0] for name, values in self.worlds.drawn.items()}
        return {"angle": angle, "modes": modes, "drawn": drawn}

    def _stored(self, seen: dict[str, Array]) -> Array:
        """`(wheels,)` momentum now [N m s]: the rate is the mean over the last step,
        half a step behind."""
        return seen["wheels"][0] * self._inertia + self._torque * self.worlds.timestep / 2.0

    def _seen(self, seen: dict[str, Array]) -> tuple[Array, float]:
        """What the sensors give, and the true angle from the wanted attitude [rad]."""
        error = mean_rate(self._target[None], seen["attitude"], 1.0)[0]
        noise = self.np_random.normal(size=(2, 3))
        star = error + self._noise[0] * noise[0]
        gyro = seen["rate"][0] + self._noise[1] * noise[1]
        wheels = self._stored(seen) / self.momentum
        parts = (
            np.clip(star, -np.pi, np.pi),
            np.clip(gyro, -FASTEST, FASTEST),
            np.clip(wheels, -2.0, 2.0),
        )
        return np.concatenate(parts), float(np.linalg.norm(error))

    def render(self) -> NDArray[np.uint8] | None:
        """A picture `(480, 640, 3)`, None without a render mode."""
        if self.render_mode is None:
            return None
        model = self.worlds.model
        if self._renderer is None:
            try:
                self._renderer = mujoco.Renderer(model, *SIZE)
            except Exception as error:  # each of MuJoCo's backends fails in its own way
                raise EngineError(
                    f"MuJoCo cannot draw here ({error}); set MUJOCO_GL to egl, osmesa or glfw, "
                    "whichever this machine has, before Python starts."
                ) from None
        data = mujoco.MjData(model)
        data.qpos[:] = self.worlds.qpos[0]
        mujoco.mj_forward(model, data)
        self._renderer.update_scene(data)
        return np.asarray(self._renderer.render(), dtype=np.uint8)

    def close(self) -> None:
        """Give the renderer back."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer = None


@lru_cache(maxsize=1)
def _shipped_satellite() -> "mujoco.MjModel":
    """The satellite of the package, exact in time."""
    folder = Path(str(files("beamchain").joinpath("examples")))
    array = folder / "array.toml"
    return embed(folder / "satellite.xml", {"left": array, "right": array}, retime=True).model
