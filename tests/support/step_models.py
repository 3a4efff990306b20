"""Models whose step limits are predicted and measured: planar and in space, damped and undamped,
alone, on a hub, embedded."""

import warnings
from collections.abc import Callable
from pathlib import Path

import beamchain as bc
from appendages import (
    panels,
    seed_boom,
    soft_root_boom,
    tapered_boom,
    timoshenko_boom,
    tip_loaded_boom,
)
from beamchain.chain.baselines import equal_links
from rival_files import rival_scene
from spacecraft import CRAFTS, STYLES

HUB = bc.Hub(mass=50.0, inertia=(20.0, 30.0, 40.0), offset=(0.5, 0.0, 0.0))
SPACE = {"xy": 2, "xz": 2, "torsion": 1}


def fitted(beam, modes, *, damping=0.0, form="modal", target="clamped", hub=HUB, alone=False):
    """MJCF of the scene of a fit, or of its bench."""
    result = bc.fit(
        beam,
        modes=modes,
        root=bc.spec.Root(target=target, hub=hub),
        damping=bc.Damping(ratio=damping, form=form) if damping else None,
    )
    return result.bench_mjcf() if alone else result.scene_mjcf()


def equal(beam, links):
    """MJCF of the classical chain on the hub."""
    return rival_scene(equal_links(beam, links, "classical"), HUB)


def embedded(style: str) -> bc.Embedded:
    """A spacecraft of the tests with its appendages."""
    craft, at = STYLES[style]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # MuJoCo warns of the fixture's own switches
        return bc.embed(CRAFTS / craft, at)


def written(name: str, folder: Path) -> Path:
    """The file of one of the models."""
    made = MODELS[name][1]()
    path = folder / "model.xml"
    if isinstance(made, str):
        path.write_text(made)
        return path
    return made.write(path)[-1]


#: name: (what it is, how it is made)
MODELS: dict[str, tuple[str, Callable[[], str | bc.Embedded]]] = {
    "boom, 1 mode": ("plane", lambda: fitted(seed_boom(), {"xy": 1})),
    "boom, 3 modes": ("plane", lambda: fitted(seed_boom(), {"xy": 3})),
    "boom, 6 modes": ("plane", lambda: fitted(seed_boom(), {"xy": 6})),
    "boom alone, 2 modes": ("plane, no hub", lambda: fitted(seed_boom(), {"xy": 2}, alone=True)),
    "boom on its own free modes": (
        "plane, no hub",
        lambda: fitted(seed_boom(), {"xy": 3}, target="free", alone=True),
    ),
    "boom, 1 %": ("plane, damped", lambda: fitted(seed_boom(), {"xy": 3}, damping=0.01)),
    "boom, 30 %": ("plane, damped", lambda: fitted(seed_boom(), {"xy": 3}, damping=0.3)),
    "boom, 2 % in its hinges": (
        "plane, damped",
        lambda: fitted(seed_boom(), {"xy": 3}, damping=0.02, form="hinge"),
    ),
    "boom, 20 % in its hinges": (
        "plane, damped",
        lambda: fitted(seed_boom(), {"xy": 2}, damping=0.2, form="hinge"),
    ),
    "cone, for its hub": ("plane", lambda: fitted(tapered_boom(), {"xy": 4}, target="hub")),
    "boom with a tip mass, 5 %": (
        "plane, damped",
        lambda: fitted(tip_loaded_boom(3.0), {"xy": 2}, damping=0.05),
    ),
    "boom on a soft root": ("plane", lambda: fitted(soft_root_boom(), {"xy": 3})),
    "10 equal links": ("plane", lambda: equal(seed_boom(), 10)),
    "25 equal links": ("plane", lambda: equal(tapered_boom(), 25)),
    "bar with shear, in space": ("space", lambda: fitted(timoshenko_boom(), SPACE)),
    "panels in space": ("space", lambda: fitted(panels(), {"xy": 2, "xz": 2})),
    "bar in space, 1 %": ("space, damped", lambda: fitted(timoshenko_boom(), SPACE, damping=0.01)),
    "bar in space, 10 % in its hinges": (
        "space, damped",
        lambda: fitted(timoshenko_boom(), SPACE, damping=0.1, form="hinge"),
    ),
    **{style: ("embedded", lambda style=style: embedded(style)) for style in STYLES},
}
