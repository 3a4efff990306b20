"""What the package uses of python-control, which hands out values without types."""

from typing import Any

class LTI:
    A: Any
    B: Any
    C: Any
    D: Any
    dt: Any
    ninputs: int
    noutputs: int
    nstates: int
    input_labels: list[str]
    output_labels: list[str]
    state_labels: list[str]
    name: str
    def __init__(self, *args: Any, **kwargs: Any) -> None: ...
    def __call__(self, s: Any, squeeze: bool | None = ..., warn_infinite: bool = ...) -> Any: ...
    def __getitem__(self, key: Any) -> Any: ...
    def poles(self) -> Any: ...
    def zeros(self) -> Any: ...

class StateSpace(LTI): ...
class TransferFunction(LTI): ...

def __getattr__(name: str) -> Any: ...
