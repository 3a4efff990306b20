"""What the pictures of a fit show: accelerances and errors over frequency. Draws nothing."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beamchain.ports.compare import (
    DEFAULT_RATIO,
    STANDARD_HUBS,
    Block,
    Reference,
    peaks_of,
    with_damping,
)
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array

if TYPE_CHECKING:
    from beamchain.fitting.result import Fit

PLANES = ("xy", "xz")
CHAIN = "our chain"
EDGE = 1.0 + 1e-12  # the end of a band belongs to it

Accelerance = Callable[[Array], Array]

ABOUT = 21  # points about the top of an error curve


def kept_count(fit: "Fit", port: str) -> int:
    """How many modes of a port were kept.

    A target may hold static shapes of further points beside its modes.
    """
    modes, error = fit.target[port].modes, fit.readback_error.get(port)
    return modes if error is None else min(modes, len(error.matches))


class Response(NamedTuple):
    """The first entry of an undamped accelerance."""

    omega: Array  # (k,) dense at every pole and zero [rad/s]
    values: Array  # (k,) real

    def crossings(self) -> tuple[Array, Array]:
        """Poles and zeros within the range [rad/s]: where its sign changes."""
        at = np.flatnonzero(np.diff(np.sign(self.values)) != 0.0)
        at = at[(at >= 2) & (at + 3 < self.values.size)]
        middle = (self.omega[at] + self.omega[at + 1]) / 2.0
        size = np.abs(self.values)
        pole = size[at] + size[at + 1] > size[at - 2] + size[at + 3]
        return middle[pole], middle[~pole]

    def even(self, points: int = 150) -> Array:
        """The values on a logarithmic grid, where no pole is denser than the rest."""
        even = np.geomspace(self.omega[0], self.omega[-1], points)
        return np.interp(even, self.omega, self.values)


class ErrorCurve(NamedTuple):
    """The in-band error before its maximum is taken: `error` `(k,)` at `omega` `(k,)` [rad/s]."""

    omega: Array
    error: Array

    def peak(self, bandwidth: float) -> int:
        """Where it is largest up to `bandwidth` [rad/s]."""
        return int(np.argmax(np.where(self.omega <= bandwidth * EDGE, self.error, -1.0)))

    def largest(self, bandwidth: float) -> float:
        """The error there."""
        return float(self.error[self.peak(bandwidth)])


def count(number: int, word: str) -> str:
    """`1 hinge`, `2 hinges`."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def undamped_accelerance(model: PortModel) -> Accelerance:
    """Accelerance of a port model without damping: the inverse of its dynamic mass,
    which a hinge at the root leaves."""
    bare = model.replaced(damping=np.zeros(model.modes))
    return lambda omega: np.linalg.inv(bare.D(omega).real.T).T.astype(np.float64)


def span(fit: "Fit", port: str) -> tuple[float, float]:
    """Frequencies shown [rad/s]: from well below the first cantilever mode to past the first
    free mode left out."""
    full = fit.full[port]
    held = np.concatenate([full.frequencies[:1], fit.achieved[port].frequencies[:1]])
    # modes that carry all mass at the root leave no free mode
    beyond = full.free_frequencies[: fit.target[port].modes + 1][-1:]
    last = np.concatenate([1.3 * beyond, [1.6 * fit.bandwidth[port]]])
    return 0.3 * float(np.min(held)), float(np.max(last))


def response(accelerance: Accelerance, limits: tuple[float, float], points: int = 280) -> Response:
    """Evaluate on a logarithmic grid, then three times closer wherever the sign changes."""
    omega = np.geomspace(*limits, points)
    with np.errstate(all="ignore"):
        values = accelerance(omega)[0, 0]
        for _ in range(3):
            turns = np.flatnonzero(np.diff(np.sign(values)) != 0.0)
            if turns.size == 0:
                break
            new = np.linspace(omega[turns], omega[turns + 1], 7, endpoint=False)[1:].ravel()
            order = np.argsort(np.concatenate([omega, new]))
            values = np.concatenate([values, accelerance(new)[0, 0]])[order]
            omega = np.concatenate([omega, new])[order]
    good = np.isfinite(values)
    return Response(omega[good], values[good])


def responses(fit: "Fit", port: str) -> tuple[Response, Response]:
    """Undamped accelerances of the beam, and of the chain through MuJoCo."""
    limits = span(fit, port)
    beam, chain = (undamped_accelerance(those[port]) for those in (fit.full, fit.achieved))
    return response(beam, limits), response(chain, limits)


def alike_ports(fit: "Fit") -> list[tuple[str, ...]]:
    """The kept ports, those with the same beam, chain, hub and band together: the planes of a
    round boom."""
    groups: dict[tuple[float, ...], list[str]] = {}
    for port in fit.target:
        hub = fit.body.port_hub(port)
        entries = [fit.bandwidth[port], *(() if hub is None else hub.ravel())]
        for model in (fit.full[port], fit.achieved[port]):
            entries += [*model.rigid_mass.ravel(), *model.frequencies, *model.damping]
        key = (len(entries), *(float(f"{entry:.9e}") for entry in entries))
        groups.setdefault(key, []).append(port)
    return [tuple(ports) for ports in groups.values()]


def worst_hub(fit: "Fit", port: str) -> tuple[Array, str]:
    """The hub `(m, m)` of the in-band error, in words too: the spec's,
    or the worst of the standard three."""
    if (hub := fit.body.port_hub(port)) is not None:
        return hub, "on the hub of the spec"
    rigid = fit.full[port].rigid_mass
    band = fit.bandwidth[port]
    limits = (min(span(fit, port)[0], 0.5 * band), band)
    worst = max(STANDARD_HUBS, key=lambda f: error_curve(fit, port, f * rigid, limits).error.max())
    return worst * rigid, f"on a hub of {worst:g} times the appendage's mass (the worst of three)"


def error_curve(fit: "Fit", port: str, hub: Array, limits: tuple[float, float]) -> ErrorCurve:
    """Error of the chain against the beam on the hub; its largest in the band is the in-band
    error."""
    beam = with_damping(fit.spec.with_ratios(port, fit.full[port]), fit.spec.undamped_ratio)
    chain = fit.measured.damped_port(port)
    band = fit.bandwidth[port]
    block = Block(hub, beam, tuple(range(beam.motions)))
    reference = Reference([block], band, fit.spec.undamped_ratio)
    peaks = np.concatenate([peaks_of(model, hub)[:, 0] for model in (beam, chain)])
    ratio = float(np.max(beam.damping, initial=DEFAULT_RATIO))
    steps = ratio * np.array([0.0, 0.5, 1.0, 2.0, 4.0, 8.0])
    beyond = (peaks[:, None] * (1.0 + np.concatenate([-steps[1:], steps]))).ravel()
    even, inside = np.geomspace(*limits, 280), reference.grid(0, [chain])
    omega = np.unique(np.concatenate([even, beyond[beyond > band], inside, [band]]))
    omega = omega[(omega >= limits[0]) & (omega <= limits[1])]
    k = ErrorCurve(omega, reference.curve(0, chain, omega)).peak(band)
    high = min(omega[min(k + 1, omega.size - 1)], max(band, omega[k]))
    top = np.linspace(omega[max(k - 1, 0)], high, ABOUT)
    omega = np.unique(np.concatenate([omega, top]))
    return ErrorCurve(omega, reference.curve(0, chain, omega))
