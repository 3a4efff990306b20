"""What beamchain uses of MuJoCo's rollouts."""

from collections.abc import Sequence
from typing import Any

from mujoco import MjData, MjModel
from numpy import float64
from numpy.typing import NDArray

class Rollout:
    def __init__(self, *, nthread: int | None = ...) -> None: ...
    def __enter__(self) -> Rollout: ...
    def __exit__(self, exc_type: Any, exc_val: Any, exc_tb: Any) -> None: ...
    def rollout(
        self,
        model: Sequence[MjModel],
        data: Sequence[MjData],
        initial_state: NDArray[float64],
        control: NDArray[float64],
        *,
        control_spec: int = ...,
        skip_checks: bool = ...,
        nstep: int | None = ...,
        state: NDArray[float64] | None = ...,
        sensordata: NDArray[float64] | None = ...,
    ) -> Any: ...
