"""The exact appendage behind a fit, in six motions: every mode of the beam,
or of what was imported."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from beamchain.errors import InputError
from beamchain.fitting.spec import Spec
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array

EXTRA_MODES = 6  # of each port beyond the kept ones that the reference is converged for


class Fitted(Protocol):
    """What of a fit the exact appendage follows from."""

    @property
    def spec(self) -> Spec:
        """The specification."""
        ...

    @property
    def target(self) -> Mapping[str, PortModel]:
        """Per port, the modes that were kept."""
        ...

    @property
    def full(self) -> Mapping[str, PortModel]:
        """Per port, all modes that were computed."""
        ...

    @property
    def measured(self) -> Any:
        """Results of the test bench: `rigid_mass`."""
        ...

    @property
    def space(self) -> Any:
        """`full` and `live` of imported modes; None for a beam."""
        ...


def exact_in_space(fit: Fitted) -> PortModel:
    """The exact appendage in six motions, damped as asked for."""
    if fit.space is not None:
        return spatial(fit, fit.space.full)
    return model_in_space(exact_ports(fit), with_inertia(fit, fit.spec.beam.rigid_mass()))


def exact_ports(fit: Fitted) -> dict[str, PortModel]:
    """Per port all modes of the beam that the reference has, damped;
    ports in which it is rigid are left out."""
    spec = fit.spec
    counts = {port: target.modes for port, target in fit.target.items()}
    ports: dict[str, PortModel] = {}
    for port in PORTS:
        try:
            own = spec.beam.port(port, 2 * counts.get(port, 0) + EXTRA_MODES)
        except InputError:
            continue  # rigid there
        known = fit.full.get(port)
        ports[port] = spec.with_ratios(
            port, known if known is not None and known.modes > own.modes else own
        )
    return ports


def spatial(fit: Fitted, model: PortModel) -> PortModel:
    """A model in the motions that imported modes have (`fit.space.live`), in all six."""
    assert fit.space is not None
    live = list(fit.space.live)
    rigid = np.zeros((6, 6))
    rows = np.zeros((model.modes, 6))
    rigid[np.ix_(live, live)], rows[:, live] = model.rigid_mass, model.participation
    return PortModel(with_inertia(fit, rigid), model.frequencies, rows, model.damping)


def with_inertia(fit: Fitted, rigid: Array) -> Array:
    """A rod without polar inertia gets the little that MuJoCo needs."""
    return rigid + np.diag(np.where(np.diag(rigid) > 0.0, 0.0, np.diag(fit.measured.rigid_mass)))
