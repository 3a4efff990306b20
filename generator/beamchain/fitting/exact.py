"""The exact appendage behind a fit, in six motions: every mode of the beam,
or of what was imported."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from beamchain.errors import InputError
from beamchain.fitting.body import reduced_port
from beamchain.fitting.hub import port_hub_mass
from beamchain.fitting.spec import Spec
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array

SHAPED = 4  # beyond twice the kept ones, that are converged where shapes of the kept are wanted
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
    def kept_for(self) -> str:
        """The target whose modes are kept: "clamped", "free" or "hub"."""
        ...

    @property
    def measured(self) -> Any:
        """Results of the test bench: `rigid_mass`."""
        ...

    @property
    def space(self) -> Any:
        """`full`, `target`, `live` and `numbers` of imported modes; None for a beam."""
        ...


class ExactAppendage(NamedTuple):
    """The exact appendage behind a fit.

    Args:
        model: every mode, in six motions of the root, damped as asked for.
        kept: `(n,)` which of the modes the chain was asked to keep.
        band: the last kept cantilever frequency of each kept port, or of all ports together where
            modes are imported [rad/s]; empty where the appendage is rigid.
        ports: the modes of a beam per port; empty where modes are imported.
    """

    model: PortModel
    kept: NDArray[np.bool_]
    band: dict[str, float]
    ports: Mapping[str, PortModel]


def exact_appendage(fit: Fitted, modes: int | None = None) -> ExactAppendage:
    """The exact appendage of a fit; `modes`: of each port of a beam, where left out some more than
    twice those that are kept."""
    if fit.space is not None:
        return _of_imported(fit)
    ports = _ports_of_beam(fit, modes)
    rigid_mass = _with_inertia(fit, fit.spec.beam.rigid_mass())
    counts = kept_counts(fit)
    numbers = [np.arange(model.modes) < counts.get(port, 0) for port, model in ports.items()]
    frequencies = [model.frequencies for model in ports.values()]
    ascending = np.argsort(np.concatenate([np.zeros(0), *frequencies]), kind="stable")
    return ExactAppendage(
        model=model_in_space(ports, rigid_mass),
        kept=np.concatenate([np.zeros(0, np.bool_), *numbers])[ascending],
        band={
            port: float(fit.target[port].frequencies[count - 1])
            for port, count in counts.items()
            if count
        },
        ports=ports,
    )


def kept_counts(fit: Fitted) -> dict[str, int]:
    """How many modes of the appendage are kept per port; static shapes of loads on further points
    stand behind them."""
    if not fit.spec.further:
        return {port: target.modes for port, target in fit.target.items()}
    return {port: _normal_modes(target, fit.full[port]) for port, target in fit.target.items()}


def reduced_to_kept(
    fit: Fitted, port: str, count: int, full: PortModel, points: Sequence[int]
) -> PortModel:
    """From all modes of a beam in a port to those that its file holds, of which `count` are modes.

    `points`: numbers of the appendage's further points in `tip`.
    """
    hub = fit.spec.root.hub
    mass = None if hub is None else port_hub_mass(hub.mass_matrix(), port)
    return reduced_port(full, fit.kept_for, count, hub=mass, points=points)


def _normal_modes(target: PortModel, exact: PortModel) -> int:
    k = min(target.modes, exact.modes)
    same = np.isclose(target.frequencies[:k], exact.frequencies[:k], rtol=1e-6)
    return int(np.argmin(same)) if not np.all(same) else k


def _of_imported(fit: Fitted) -> ExactAppendage:
    """Of imported modes, which have the motions `fit.space.live`."""
    space = fit.space
    live = list(space.live)
    rigid_mass = np.zeros((6, 6))
    rigid_mass[np.ix_(live, live)] = space.full.rigid_mass
    rows = np.zeros((space.full.modes, 6))
    rows[:, live] = space.full.participation
    model = PortModel(
        _with_inertia(fit, rigid_mass), space.full.frequencies, rows, space.full.damping
    )
    target = space.target.frequencies
    return ExactAppendage(
        model=model,
        kept=np.isin(np.arange(1, model.modes + 1), space.numbers),
        band={"space": float(target[-1])} if target.size else {},
        ports={},
    )


def _ports_of_beam(fit: Fitted, modes: int | None) -> dict[str, PortModel]:
    """Per port all modes of the beam that the reference has, damped;
    ports in which it is rigid are left out."""
    spec = fit.spec
    ports: dict[str, PortModel] = {}
    for port in PORTS:
        kept = fit.target[port].modes if port in fit.target else 0
        try:
            stations = list(spec.further.values())
            model = spec.beam.port(port, modes or 2 * kept + EXTRA_MODES, stations)
        except InputError:
            continue  # rigid there
        known = fit.full.get(port)
        if known is not None and known.modes > model.modes:
            model = known
        ports[port] = spec.with_ratios(port, model)
    return ports


def _with_inertia(fit: Fitted, rigid_mass: Array) -> Array:
    """A rod without polar inertia gets the little that MuJoCo needs."""
    missing = np.where(np.diag(rigid_mass) > 0.0, 0.0, np.diag(fit.measured.rigid_mass))
    return rigid_mass + np.diag(missing)
