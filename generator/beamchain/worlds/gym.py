"""The environment `beamchain/FlexibleSatellite-v0` of Gymnasium,
which imports this module when asked for it.

A satellite with two arrays, or your own, is turned to a drawn attitude by its wheels and held
there. Needs `pip install 'beamchain[worlds]'`.
`gymnasium.make("beamchain.worlds.gym:beamchain/FlexibleSatellite-v0")` makes one; the name starts
with the module that registers it. `gymnasium.make_vec` makes several, one after the other or in
processes;
for thousands at once step `worlds.make(...)` yourself.

* Action: a torque per wheel, from -1 to 1 of the largest, held over `period`; float32, `(wheels,)`.
* Observation, float64, `(6 + wheels,)`: the rotation from the wanted attitude in body axes [rad],
  the mean rate over the last
  period [rad/s], and each wheel's momentum over the largest.
* Reward: `-(angle/slew)^2` less a hundredth of the mean square of the torques over their largest.
* Termination: where the simulation diverges. Truncation: after `episode` seconds.
* `info`: the true `angle` [rad], the amplitudes `modes` of the appendages, and what was `drawn`
  for the episode.
* Randomisation: every episode draws frequencies within 10 % and damping within 50 %;
  `variants=None` switches that off,
  `variants={"frequency": 0.05}` or all else that `worlds.make` takes replaces it.
  `noise=(0.0, 0.0)` takes the noise of star tracker and gyro off.
* Further options, given to `make`: model=None (the satellite of the package), period=0.25 [s],
  timestep=None (half the period), episode=120.0 [s], slew=0.2 [rad], torque=None (of the motors'
  `ctrlrange`) [N m], momentum=12.0 [N m s], noise=(1e-6, 1e-7) [rad, rad/s], render_mode=None;
  `help(type(env.unwrapped))` says what each of them means.
* `reset(options={"turn": (x, y, z)})` gives the turn [rad] instead of drawing it.

Example:
    >>> import gymnasium
    >>> name = "beamchain.worlds.gym:beamchain/FlexibleSatellite-v0"
    >>> env = gymnasium.make(name, variants=None, episode=60.0)
    >>> seen, _ = env.reset(seed=0)
    >>> seen.shape, env.action_space.shape
    ((9,), (3,))
    >>> seen, reward, terminated, truncated, info = env.step(env.action_space.sample())
    >>> info["modes"].shape
    (6,)
"""

from importlib import import_module
from typing import Any

from beamchain.errors import InputError
from beamchain.toolkit import choose_renderer

NAME = "beamchain/FlexibleSatellite-v0"


def satellite(**options: Any) -> Any:
    """One satellite."""
    if options.get("render_mode") is not None:
        choose_renderer()  # before MuJoCo is imported
    return import_module("beamchain.worlds.satellite").Satellite(**options)


try:
    gymnasium: Any = import_module("gymnasium")
except ImportError as error:
    raise InputError(
        f"Gymnasium is not installed ({error}); install it with: pip install 'beamchain[worlds]'."
    ) from None
gymnasium.register(id=NAME, entry_point=f"{__name__}:satellite")
