"""What `plant` is given: a model from any source, and what its linear part leaves out."""

from pathlib import Path

import numpy as np

from beamchain.checks import of_type
from beamchain.craft.disturbances import left_out
from beamchain.craft.embedded import Embedded
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model
from beamchain.engine.model_checks import check_model
from beamchain.errors import EngineError
from beamchain.warning_codes import Caution


def compiled_model(
    source: "Embedded | mujoco.MjSpec | mujoco.MjModel | str | Path",
) -> "mujoco.MjModel":
    """A compiled model from any of the things that `plant` takes; none of them is changed."""
    if isinstance(source, Embedded):
        return source.model
    if isinstance(source, mujoco.MjSpec):
        try:
            model = source.copy().compile()
        except ValueError as error:
            raise EngineError(f"MuJoCo refuses the model: {error}") from None
        check_model(model, "the model")
        return model
    wanted = "the path of an MJCF file, an MjSpec, an MjModel or what bc.embed returns"
    of_type("model", source, (mujoco.MjModel, str, Path), wanted)
    return compile_model(source)


def linear_omissions(model: "mujoco.MjModel") -> list[str]:
    """Sentences on what the linear plant leaves out of a model."""
    gravity = bool(np.any(np.asarray(model.opt.gravity) != 0.0))
    medium = float(model.opt.density) > 0.0 or float(model.opt.viscosity) > 0.0
    found = (
        (gravity, "gravity", "the plant is one in free fall: the model's gravity is left out."),
        (medium, "medium", "the medium's density and viscosity are left out of the plant."),
    )
    said = [Caution(code, text) for there, code, text in found if there]
    return [*said, *left_out(model, "the plant")]
