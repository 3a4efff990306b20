"""What a load, or that there is none, does to the liquids of a spacecraft's tanks.

Without acceleration their pendulums are limp; where no load acts, they are compared as if they were
sprung by their stated acceleration.
"""

import copy
from collections.abc import Mapping, Sequence

import numpy as np

from beamchain.craft.error import PlacedBody
from beamchain.engine.library import mujoco
from beamchain.engine.loaded import Loading
from beamchain.engine.mount import root_frame
from beamchain.engine.operating_point import poses, rest_point
from beamchain.errors import InputError
from beamchain.fitting.slosh import weightless
from beamchain.ports.motions import Array
from beamchain.warning_codes import Caution

ACROSS = 1e-9  # of a field: less of it along the axis is rounding
TILTED = 10.0  # degrees between field and axis, beyond which a liquid is no pendulum


def liquid_cautions(
    craft: "mujoco.MjModel",
    carried: Sequence[PlacedBody],
    loadings: Mapping[tuple[str, int], Loading] | None,
) -> list[str]:
    """Where a liquid hangs limp, and where a load pushes it far aside.

    `loadings`: by pose and base body, as `loadings_of` gives them; None: the proof is without.

    Raises:
        InputError: a load lifts a liquid off its tank's bottom.
    """
    tanks = [item for item in carried if item.springs is not None]
    if not tanks:
        return []
    if loadings is None:
        names = ", ".join(item.mount.at for item in tanks)
        where = (
            f"{names}: the proof without --loaded takes the liquid as if sprung by its stated "
            "acceleration, and MuJoCo's pendulums feel what the scene accelerates them by"
        )
        return [weightless(where)]
    out: list[str] = []
    for name, qpos in poses(craft).items():
        here = [loading for (pose, _), loading in loadings.items() if pose == name]
        if not here:
            out.append(weightless(f"nothing accelerates the spacecraft at {name}"))
        data = rest_point(craft, qpos).data()
        for item in tanks:
            for loading in here:
                out += _tilt(item, root_frame(item.mount, data)[1], name, loading)
    return out


def _tilt(item: PlacedBody, axes: Array, pose: str, loading: Loading) -> list[str]:
    """What a load does to the liquid in a tank with these axes `(3, 3)`, in columns."""
    along = float(-loading.field @ axes[:, 0])
    size = float(np.linalg.norm(loading.field))
    at = f"{item.mount.at} at {pose}"
    if along <= ACROSS * size:
        raise InputError(
            f"{at}: the load ({loading.words}) does not press the liquid onto the tank's bottom, "
            f"{along:.4g} m/s^2 along its axis, where no pendulum hangs; turn the place, or "
            "give another slosh.axis, so that the tank's axis points along the thrust."
        )
    angle = float(np.degrees(np.arccos(min(along / size, 1.0))))
    if angle <= TILTED:
        return []
    text = (
        f"{at}: the load pulls the liquid {angle:.3g} degrees off the tank's axis; beyond about "
        f"{TILTED:g} degrees a liquid is no pendulum any more: turn the place, or take the numbers "
        "for an estimate."
    )
    return [Caution("slosh-tilt", text)]


def with_liquids_sprung(model: "mujoco.MjModel", carried: Sequence[PlacedBody]) -> "mujoco.MjModel":
    """A copy in which liquids stand on springs as at their stated acceleration, as the exact ones
    without a load do; the model itself where there are none."""
    tanks = [item for item in carried if item.springs is not None and item.dofs]
    if not tanks:
        return model
    out = copy.copy(model)
    for item in tanks:
        out.jnt_stiffness[out.dof_jntid[item.dofs]] += item.springs
    return out
