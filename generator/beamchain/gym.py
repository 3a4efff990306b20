"""Registers `beamchain/FlexibleSatellite-v0` with Gymnasium, which imports this module when asked for it.

`gymnasium.make("beamchain.gym:beamchain/FlexibleSatellite-v0")`, or `make_vec` for many; needs `pip install 'beamchain[gym]'`.
"""

from importlib import import_module
from typing import Any

from beamchain.engine import backend
from beamchain.errors import InputError

NAME = "beamchain/FlexibleSatellite-v0"


def one(**options: Any) -> Any:
    """One satellite."""
    return _module(options).Satellite(**options)


def many(**options: Any) -> Any:
    """Satellites that are stepped together."""
    return _module(options).Satellites(**options)


def _module(options: dict[str, Any]) -> Any:
    if options.get("render_mode") is not None:
        backend.choose()  # before MuJoCo is imported
    return import_module("beamchain.craft.worlds.satellite")


try:
    gymnasium: Any = import_module("gymnasium")
except ImportError as error:
    raise InputError(f"Gymnasium is not installed ({error}); install it with: pip install 'beamchain[gym]'.") from None
gymnasium.register(id=NAME, entry_point=f"{__name__}:one", vector_entry_point=f"{__name__}:many")
