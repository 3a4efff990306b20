"""The specification of a model that leaves nothing out, beside which the chosen ones are held."""

import numpy as np
from msgspec import structs

from beamchain.errors import InputError
from beamchain.fitting.body import body_of
from beamchain.fitting.options import Modes
from beamchain.fitting.select import select
from beamchain.fitting.spec import Spec


def everything(spec: Spec) -> Spec:
    """The spec with every port kept.

    All cantilever modes up to three times the scene's bandwidth, one to five each and no fewer than
    the scene needs; of imported modes all.
    """
    if not spec.chooses or spec.scene is None or spec.scene.bandwidth is None:
        raise InputError(
            "nothing is left out without scene.bandwidth; give [scene] bandwidth, or state [modes]."
        )
    if spec.imported is not None:
        every = tuple(range(1, spec.imported.read().modes + 1))
        return structs.replace(
            spec, imported=structs.replace(spec.imported, modes=every), modes=None
        )
    body = body_of(spec)
    needed = select(body).counts
    counts = {
        port: max(
            needed.get(port, 0),
            int(np.clip(np.sum(model.frequencies <= 3.0 * spec.scene.bandwidth), 1, 5)),
        )
        for port, model in body.ports.items()
    }
    return structs.replace(spec, modes=Modes(**counts))
