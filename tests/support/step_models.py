"""Models whose step limits are predicted and measured: planar and in space, damped and undamped, alone, on a hub, embedded."""

import warnings
from collections.abc import Callable

import mujoco

import beamchain as bc
from appendages import panels, seed_boom, soft_root_boom, tapered_boom, timoshenko_boom, tip_loaded_boom
from beamchain.engine.linearise import compile_model
from beamchain.fitting.hub import Hub
from beamchain.fitting.options import Damping, FitOptions, Root
from spacecraft import CRAFTS, STYLES

HUB = Hub(mass=50.0, inertia=(20.0, 30.0, 40.0), offset=(0.5, 0.0, 0.0))
SPACE = {"xy": 2, "xz": 2, "torsion": 1}


def fitted(beam, modes, *, damping=0.0, form="modal", target="clamped", hub=HUB, alone=False, links=0):
    """The compiled scene of a fit, or its bench."""
    result = bc.fit(
        beam,
        modes=modes,
        root=Root(target=target, hub=hub),
        damping=Damping(ratio=damping, form=form) if damping else None,
        options=FitOptions(method="classical", links=links) if links else None,
    )
    return compile_model(result.bench_mjcf() if alone else result.scene_mjcf())


def embedded(style: str) -> mujoco.MjModel:
    """A spacecraft of the tests with its appendages."""
    craft, at = STYLES[style]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # MuJoCo warns of the fixture's own switches
        return bc.embed(CRAFTS / craft, at).model


#: name: (what it is, how it is made)
MODELS: dict[str, tuple[str, Callable[[], mujoco.MjModel]]] = {
    "boom, 1 mode": ("plane", lambda: fitted(seed_boom(), {"xy": 1})),
    "boom, 3 modes": ("plane", lambda: fitted(seed_boom(), {"xy": 3})),
    "boom, 6 modes": ("plane", lambda: fitted(seed_boom(), {"xy": 6})),
    "boom alone, 2 modes": ("plane, no hub", lambda: fitted(seed_boom(), {"xy": 2}, alone=True)),
    "boom on its own free modes": ("plane, no hub", lambda: fitted(seed_boom(), {"xy": 3}, target="free", alone=True)),
    "boom, 1 %": ("plane, damped", lambda: fitted(seed_boom(), {"xy": 3}, damping=0.01)),
    "boom, 30 %": ("plane, damped", lambda: fitted(seed_boom(), {"xy": 3}, damping=0.3)),
    "boom, 2 % in its hinges": ("plane, damped", lambda: fitted(seed_boom(), {"xy": 3}, damping=0.02, form="hinge")),
    "boom, 20 % in its hinges": ("plane, damped", lambda: fitted(seed_boom(), {"xy": 2}, damping=0.2, form="hinge")),
    "cone, for its hub": ("plane", lambda: fitted(tapered_boom(), {"xy": 4}, target="hub")),
    "boom with a tip mass, 5 %": ("plane, damped", lambda: fitted(tip_loaded_boom(3.0), {"xy": 2}, damping=0.05)),
    "boom on a soft root": ("plane", lambda: fitted(soft_root_boom(), {"xy": 3})),
    "10 equal links": ("plane", lambda: fitted(seed_boom(), {"xy": 2}, links=10)),
    "25 equal links": ("plane", lambda: fitted(tapered_boom(), {"xy": 2}, links=25)),
    "bar with shear, in space": ("space", lambda: fitted(timoshenko_boom(), SPACE)),
    "panels in space": ("space", lambda: fitted(panels(), {"xy": 2, "xz": 2})),
    "bar in space, 1 %": ("space, damped", lambda: fitted(timoshenko_boom(), SPACE, damping=0.01)),
    "bar in space, 10 % in its hinges": (
        "space, damped",
        lambda: fitted(timoshenko_boom(), SPACE, damping=0.1, form="hinge"),
    ),
    **{style: ("embedded", lambda style=style: embedded(style)) for style in STYLES},
}
