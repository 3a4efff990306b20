"""The task of `beamchain/FlexibleSatellite-v0`, without Gymnasium: satellites that are turned by their wheels and held."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.checks import not_negative, positive
from beamchain.craft.embedded import Embedded
from beamchain.craft.embedding import embed
from beamchain.craft.worlds.observation import mean_rate
from beamchain.craft.worlds.worlds import Worlds, worlds
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import mass_matrix
from beamchain.errors import InputError
from beamchain.ports.motions import Array

RANDOMISED = {"frequency": 0.1, "damping": 0.5}  # half widths relative to the nominal modes
TORQUE = 0.5  # [N m] of a wheel whose motor has no ctrlrange
FASTEST = 1.0  # [rad/s] end of the observed rates
EFFORT = 0.01  # weight of the torques in the reward


class Step(NamedTuple):
    """What came of a period: observation `(k, 6 + wheels)`, reward `(k,)`, terminated, truncated, further arrays by name."""

    observation: Array
    reward: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    info: dict[str, Array]


class Fleet:
    """Satellites, each turned from rest to an attitude of its own by its wheels, and held there.

    Args:
        count: number of satellites.
        model: what `bc.embed` gave, a compiled model or the path of a `flexible.xml`; its wheels are leaf bodies on unlimited
            hinges with motors. None: the satellite of the package with an array on either side.
        variants: as in `bc.worlds`, drawn anew for every episode; None: nothing differs.
        period: over which an action is held [s].
        timestep: of the simulation [s]; default: half the period.
        episode: [s].
        slew: largest angle of a turn [rad]; the smallest is half of it.
        torque: largest of each wheel [N m]; default: from the motors' `ctrlrange`.
        momentum: largest of each wheel [N m s].
        noise: standard deviations of the star tracker [rad] and of the mean rate [rad/s].
        host, threads: as in `bc.worlds`.
    """

    def __init__(
        self,
        count: int,
        model: "Embedded | mujoco.MjModel | str | Path | None" = None,
        *,
        variants: Any = RANDOMISED,
        period: float = 0.25,
        timestep: float | None = None,
        episode: float = 120.0,
        slew: float = 0.2,
        torque: float | None = None,
        momentum: float = 12.0,
        noise: Sequence[float] = (1e-6, 1e-7),
        host: str = "mujoco",
        threads: int = 0,
    ) -> None:
        self.period: float = positive("period", period, "s")
        self.slew: float = positive("slew", slew, "rad")
        step = self.period / 2.0 if timestep is None else positive("timestep", timestep, "s")
        self._substeps = max(round(self.period / step), 1)
        if abs(self._substeps * step - self.period) > 1e-9 * self.period:
            raise InputError(f"timestep = {step:g} s must divide the period, {self.period:g} s, into whole steps.")
        if self.slew > np.pi:
            raise InputError(f"slew = {self.slew:g} must be at most pi (rad).")
        self._steps = max(round(positive("episode", episode, "s") / self.period), 1)
        self._noise = [not_negative("noise", value, "rad and rad/s") for value in noise]
        self.worlds: Worlds = worlds(
            _shipped() if model is None else model, variants, count, host, timestep=step, threads=threads
        )
        made, self._wheels = self.worlds.model, self.worlds.wheels
        if not self._wheels:
            raise InputError(
                "the model has no reaction wheels; give it bodies without children on hinges without limits, each with a motor, "
                "as in satellite.xml among the package's examples."
            )
        gear = made.actuator_gear[self._wheels, 0]
        spin = made.jnt_dofadr[made.actuator_trnid[self._wheels, 0]]
        self._inertia = np.diag(mass_matrix(made))[spin]  # of each wheel about its axis [kg m^2]
        most = np.abs(made.actuator_ctrlrange[self._wheels] * gear[:, None]).min(axis=1)
        own = np.where(made.actuator_ctrllimited[self._wheels], most, TORQUE)
        self.torque: Array = own if torque is None else np.full(len(spin), positive("torque", torque, "N m"))
        self.momentum: float = positive("momentum", momentum, "N m s")
        self._gear = gear
        self._target, self._age = np.zeros((count, 4)), np.zeros(count, dtype=np.int64)
        self._torque = np.zeros((count, len(spin)))

    def start(self, ids: NDArray[np.intp], rng: np.random.Generator, turn: Any = None) -> Array:
        """New episodes of some satellites, at rest. Returns the observation `(k, ...)` of all.

        `turn`: rotation vector `(3,)` of the wanted attitude [rad]; None: `rng` draws it, as it does properties and noise.
        """
        axis = rng.normal(size=(ids.size, 3))
        angle = self.slew * rng.uniform(0.5, 1.0, (ids.size, 1))
        drawn = axis / np.linalg.norm(axis, axis=1, keepdims=True) * angle
        vector = np.broadcast_to(drawn if turn is None else np.array(turn, dtype=float), (ids.size, 3))
        half = np.linalg.norm(vector, axis=1, keepdims=True) / 2.0
        self._target[ids] = np.hstack([np.cos(half), vector / 2.0 * np.sinc(half / np.pi)])
        self._age[ids], self._torque[ids] = 0, 0.0
        self.worlds.rng = rng
        return self._seen(self.worlds.reset(ids, draw=True), rng)[0]

    def step(self, action: Any, rng: np.random.Generator) -> Step:
        """Hold torques `(k, wheels)`, from -1 to 1 of the largest, over a period."""
        stored = self._stored(self.worlds.observe())
        wanted = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0) * self.torque
        room = self.momentum / self.period
        given = np.clip(wanted, -room - stored / self.period, room - stored / self.period)
        ctrl = np.zeros((self.worlds.count, self.worlds.model.nu))
        self._torque = np.clip(given, -self.torque, self.torque)
        ctrl[:, self._wheels] = self._torque / self._gear
        seen = self.worlds.step(ctrl, self._substeps)
        self._torque[self.worlds.diverged] = 0.0
        self._age += 1
        observation, angle = self._seen(seen, rng)
        reward = -((angle / self.slew) ** 2) - EFFORT * np.mean((self._torque / self.torque) ** 2, axis=1)
        lost = np.zeros(self.worlds.count, dtype=np.bool_)
        lost[self.worlds.diverged] = True
        info = {"angle": angle, "modes": seen.get("modes", np.zeros((len(angle), 0)))}
        return Step(observation, reward, lost, (self._age >= self._steps) & ~lost, info)

    def _stored(self, seen: Mapping[str, Array]) -> Array:
        """Momentum `(k, wheels)` now [N m s]: the rate is the mean over the last step, half a step behind."""
        return seen["wheels"] * self._inertia + self._torque * self.worlds.timestep / 2.0

    def _seen(self, seen: Mapping[str, Array], rng: np.random.Generator) -> tuple[Array, Array]:
        """What the sensors give, and the true angle from the wanted attitude `(k,)` [rad]."""
        error = mean_rate(self._target, seen["attitude"], 1.0)
        noise = rng.normal(size=(2, *error.shape))
        star, gyro = error + self._noise[0] * noise[0], seen["rate"] + self._noise[1] * noise[1]
        wheels = self._stored(seen) / self.momentum
        parts = (np.clip(star, -np.pi, np.pi), np.clip(gyro, -FASTEST, FASTEST), np.clip(wheels, -2.0, 2.0))
        return np.hstack(parts), np.linalg.norm(error, axis=1)


@lru_cache(maxsize=1)
def _shipped() -> "mujoco.MjModel":
    """The satellite of the package, exact in time."""
    folder = Path(str(files("beamchain").joinpath("examples")))
    array = folder / "array.toml"
    return embed(folder / "satellite.xml", {"left": array, "right": array}, retime=True).model
