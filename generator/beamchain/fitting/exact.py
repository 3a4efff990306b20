"""The exact appendage in six motions: every mode of the beam, or of what was imported."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.errors import InputError
from beamchain.fitting.body import Body, reduced_port, with_inertia
from beamchain.fitting.kept import Kept
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array

SHAPED = 4  # beyond twice the kept ones, that are converged where shapes of the kept are wanted
EXTRA_MODES = 6  # of each port beyond the kept ones that the reference is converged for


class ExactAppendage(NamedTuple):
    """The exact appendage.

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


def exact_appendage(
    body: Body, kept: Kept, rigid_mass: Array | None = None, modes: int | None = None
) -> ExactAppendage:
    """The exact appendage of which some modes are `kept`.

    `rigid_mass`: `(6, 6)` of its chain, for what the appendage states no inertia of; `modes`: of
    each port of a beam, where left out some more than twice those that are kept.
    """
    if body.data is not None:
        return _of_imported(body, kept, rigid_mass)
    asked = {port: body.reduced(kept.target, port, kept.counts[port]) for port in kept.counts}
    ports = {
        port: model
        for port in PORTS
        if (model := _port_of_beam(body, port, modes or _converged(asked.get(port)))) is not None
    }
    numbers = [np.arange(model.modes) < kept.counts.get(port, 0) for port, model in ports.items()]
    frequencies = [model.frequencies for model in ports.values()]
    ascending = np.argsort(np.concatenate([np.zeros(0), *frequencies]), kind="stable")
    return ExactAppendage(
        model=model_in_space(ports, with_inertia(body.rigid_mass, rigid_mass)),
        kept=np.concatenate([np.zeros(0, np.bool_), *numbers])[ascending],
        band={
            port: float(asked[port].frequencies[count - 1])
            for port, count in kept.counts.items()
            if count
        },
        ports=ports,
    )


def kept_model(body: Body, kept: Kept) -> PortModel:
    """The modes that are kept, in six motions of the root, damped as asked for."""
    if body.data is not None and kept.target == "clamped":
        return body.space.picked([k - 1 for k in kept.numbers])
    if kept.coupled_ports:
        return body.in_six_motions(kept.in_space(body))
    counts = {port: count for port, count in kept.counts.items() if count}
    ports = {port: body.reduced(kept.target, port, count) for port, count in counts.items()}
    return model_in_space(ports, with_inertia(body.rigid_mass))


def reduced_to_kept(
    body: Body, kept: Kept, port: str, count: int, full: PortModel, points: Sequence[float]
) -> PortModel:
    """From all modes of a beam in a port to those that its file holds, of which `count` are modes.

    `points`: x of the appendage's further points [m].
    """
    return reduced_port(full, kept.target, count, hub=body.port_hub(port), points=points)


def _of_imported(body: Body, kept: Kept, rigid_mass: Array | None) -> ExactAppendage:
    """Of imported modes, or those of a liquid."""
    frequencies = kept.in_space(body).frequencies
    return ExactAppendage(
        model=body.space.replaced(rigid_mass=with_inertia(body.rigid_mass, rigid_mass)),
        kept=np.isin(np.arange(1, body.space.modes + 1), kept.numbers),
        band={"space": float(frequencies[-1])} if frequencies.size else {},
        ports={},
    )


def _converged(asked: PortModel | None) -> int:
    """How many modes of a port the reference is converged for, of which some are asked for."""
    return 2 * (0 if asked is None else asked.modes) + EXTRA_MODES


def _port_of_beam(body: Body, port: str, modes: int) -> PortModel | None:
    """So many modes of a port, or more that are known, damped; None where the beam is rigid
    there."""
    spec, known = body.spec, body.ports.get(port)
    try:
        model = spec.beam.port(port, modes, list(spec.further.values()))
    except InputError:
        return None
    if known is not None and known.modes > model.modes:
        return known
    return spec.with_ratios(port, model)
