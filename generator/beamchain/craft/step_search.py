"""The largest step at which a spacecraft with timing keeps the tolerance of its scenes."""

import copy
from collections.abc import Mapping

from beamchain.craft.error import Pose, craft_error
from beamchain.craft.sampled import craft_sampled_error
from beamchain.craft.timing import with_timing
from beamchain.engine.library import mujoco
from beamchain.ports.compare import keeps_tolerance
from beamchain.steps.modal import modal_tendons
from beamchain.steps.sampled import represents

HALVINGS = 14  # of the step, before the search is given up
BISECTIONS = 3  # of the last halving: the step is then known to 9 %


def largest_step(
    craft: "mujoco.MjModel",
    plain: "mujoco.MjModel",
    exact: Mapping[str, list[Pose]],
    tolerance: float,
    band: float | None,
) -> float | None:
    """The largest step below that of the model at which it keeps the tolerance with timing [s];
    None where none was found, or where not the step but the modes kept miss it.

    `plain`: the model without timing, whose step does not keep it; `exact`: the answers of
    `craft_poses` for the bare `craft`.
    """

    def keeps(timestep: float) -> bool:
        if not represents(timestep, next(iter(exact.values()))[0].band):
            return False
        model = copy.copy(plain)
        model.opt.timestep = timestep
        timed = with_timing(model, band)[0]
        errors = craft_sampled_error(craft, timed, exact)
        return keeps_tolerance(max(error.error for error in errors.values()), tolerance)

    if not modal_tendons(plain).names:
        return None  # which timing would need
    if not keeps_tolerance(craft_error(craft, plain, exact).error, tolerance):
        return None  # it is not the step
    high = float(plain.opt.timestep)
    for _ in range(HALVINGS):
        low = high / 2.0
        if keeps(low):
            break
        high = low
    else:
        return None
    for _ in range(BISECTIONS):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if keeps(middle) else (low, middle)
    return low
