"""A `control.StateSpace` that can be pickled and copied."""

from typing import Any

import control
import numpy as np

from beamchain.ports.motions import locked

FUNCTIONS = ("updfcn", "outfcn")  # control's, which close over the system and so cannot be pickled


class StateSpace(control.StateSpace):
    """A `control.StateSpace` that can be pickled and copied;
    its arrays stay read-only where they are so."""

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in FUNCTIONS}

    def __setstate__(self, state: dict[str, Any]) -> None:
        arrays = {
            name: locked(value) for name, value in state.items() if isinstance(value, np.ndarray)
        }
        self.__dict__.update({**state, **arrays})
        same: Any = control.StateSpace(
            self.A, self.B, self.C, self.D, self.dt, remove_useless_states=False
        )
        for name in FUNCTIONS:
            setattr(self, name, getattr(same, name))
