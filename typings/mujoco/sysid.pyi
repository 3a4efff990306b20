"""What beamchain uses of MuJoCo's system identification."""

from collections.abc import Callable

import numpy as np
from mujoco import MjSpec
from numpy.typing import NDArray

class Parameter:
    name: str
    value: NDArray[np.float64]
    def __init__(
        self,
        name: str,
        nominal: float,
        min_value: float,
        max_value: float,
        frozen: bool = False,
        modifier: Callable[[MjSpec, Parameter], object] | None = None,
    ) -> None: ...

class ParameterDict:
    def add(self, param: Parameter) -> None: ...
    def keys(self) -> list[str]: ...
