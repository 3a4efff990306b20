"""What pictures and tables show of a fit: its rivals, accelerances and errors over frequency.
Draws nothing."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beamchain.chain import baselines
from beamchain.chain.chain import Chain
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
from beamchain.structure.exact import UniformBeam

if TYPE_CHECKING:
    from beamchain.fitting.result import Fit

PLANES = ("xy", "xz")
CHAIN = "our chain"
PAPER = "the 2008 paper's chain"
CLASSICAL = "classical chain"
EDGE = 1.0 + 1e-12  # the end of a band belongs to it

Accelerance = Callable[[Array], Array]

ABOUT = 21  # points about the top of an error curve


def kept_count(fit: "Fit", port: str) -> int:
    """How many modes of a port were kept.

    A target may hold static shapes of further points beside its modes.
    """
    modes = fit.target[port].modes
    return (
        min(modes, len(fit.readback_error[port].matches)) if port in fit.readback_error else modes
    )


class Response(NamedTuple):
    """An undamped accelerance."""

    omega: Array  # (k,) dense at every pole and zero [rad/s]
    values: Array  # (m, m, k) real

    def crossings(self, i: int, j: int) -> tuple[Array, Array]:
        """Poles and zeros of one entry within the range [rad/s]: where its sign changes."""
        values = self.values[i, j]
        at = np.flatnonzero(np.diff(np.sign(values)) != 0.0)
        at = at[(at >= 2) & (at + 3 < values.size)]
        middle = (self.omega[at] + self.omega[at + 1]) / 2.0
        size = np.abs(values)
        pole = size[at] + size[at + 1] > size[at - 2] + size[at + 3]
        return middle[pole], middle[~pole]

    def phase(self, i: int, j: int) -> tuple[Array, Array]:
        """Frequencies [rad/s] and phase [degrees] of one entry,
        at the ends and on both sides of each turn."""
        turned = np.where(self.values[i, j] < 0.0, 180.0, 0.0)
        at = np.flatnonzero(np.diff(turned))
        keep = np.unique(np.concatenate([[0], at, at + 1, [turned.size - 1]]))
        return self.omega[keep], turned[keep]


class ErrorCurve(NamedTuple):
    """The in-band error before its maximum is taken: `error` `(k,)` at `omega` `(k,)` [rad/s]."""

    omega: Array
    error: Array

    def peak(self, bandwidth: float) -> int:
        """Where it is largest up to `bandwidth` [rad/s]."""
        return int(np.argmax(np.where(self.omega <= bandwidth * EDGE, self.error, -1.0)))


def count(number: int, word: str) -> str:
    """`1 hinge`, `2 hinges`."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def moving(chain: Chain, port: str) -> int:
    """Number of hinges that move in a port."""
    return sum(port in hinge.stiffness for hinge in chain.hinges)


def rival_chains(fit: "Fit", port: str) -> dict[str, Chain]:
    """Recipes to hold the fitted chain against, by name; none but in bending.

    The classical chain with as many hinges and, for a uniform beam, the paper's three links.
    """
    beam = fit.beam
    hinges = moving(fit.chain, port)
    if port not in PLANES or beam is None:
        return {}
    out: dict[str, Chain] = {}
    if hinges:
        out[CLASSICAL] = baselines.equal_links(beam, hinges, "classical", port)
    if beam.uniform and fit.full[port].free_frequencies.size >= 2:
        first, second = (float(w) for w in fit.full[port].free_frequencies[:2])
        k, c = baselines.seed_parameters(float(beam.rigid_mass()[0, 0]), beam.length, first, second)
        out[PAPER] = baselines.seed_chain(beam, k, c, port)
    return out


def beam_model(fit: "Fit", port: str) -> PortModel:
    """The whole beam in a port with the damping that in-band errors are stated with:
    the spec's, else 0.5 %."""
    return with_damping(fit.spec.with_ratios(port, fit.full[port]), fit.spec.undamped_ratio)


def rival_model(fit: "Fit", port: str, chain: Chain) -> PortModel:
    """A rival's port model with the same damping ratios as the beam's."""
    return with_damping(fit.spec.with_ratios(port, chain.port(port)), fit.spec.undamped_ratio)


def undamped_accelerance(model: PortModel) -> Accelerance:
    """Accelerance of a port model without damping: the inverse of its dynamic mass,
    which a hinge at the root leaves."""
    bare = model.replaced(damping=np.zeros(model.modes))
    return lambda omega: np.linalg.inv(bare.D(omega).real.T).T.astype(np.float64)


def exact_accelerance(fit: "Fit", port: str) -> Accelerance:
    """Accelerance of the beam: the transcendental solution where there is one,
    else all modes of the discretisation."""
    beam = fit.beam
    if port in PLANES and beam is not None and beam.uniform:
        at = beam.segments[0].at(np.array([0.5]))
        stiffness = at.bending_xy if port == "xy" else at.bending_xz
        return UniformBeam(beam.length, float(stiffness[0]), float(at.mass[0])).W
    return undamped_accelerance(fit.full[port])


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
    """Evaluate on a logarithmic grid, then three times closer wherever an entry changes sign."""
    omega = np.geomspace(*limits, points)
    with np.errstate(all="ignore"):
        values = accelerance(omega)
        for _ in range(3):
            turns = np.flatnonzero(np.any(np.diff(np.sign(values)) != 0.0, axis=(0, 1)))
            if turns.size == 0:
                break
            new = (
                omega[turns, None]
                + (omega[turns + 1] - omega[turns])[:, None] * np.arange(1, 7) / 7.0
            ).ravel()
            order = np.argsort(np.concatenate([omega, new]))
            values = np.concatenate([values, accelerance(new)], axis=-1)[..., order]
            omega = np.concatenate([omega, new])[order]
    good = np.all(np.isfinite(values), axis=(0, 1))
    return Response(omega[good], values[..., good])


def responses(fit: "Fit", port: str, *, with_rivals: bool) -> dict[str, Response]:
    """Undamped accelerances by name: the beam, the chain through MuJoCo, then the rivals."""
    drawn = {
        "beam": exact_accelerance(fit, port),
        f"{CHAIN}, through MuJoCo": undamped_accelerance(fit.achieved[port]),
    }
    for label, chain in rival_chains(fit, port).items() if with_rivals else ():
        drawn[f"{label}, {count(moving(chain, port), 'hinge')}"] = undamped_accelerance(
            chain.port(port)
        )
    return {label: response(accelerance, span(fit, port)) for label, accelerance in drawn.items()}


def worst_hub(fit: "Fit", port: str) -> tuple[Array, str]:
    """The hub `(m, m)` of the in-band error, in words too: the spec's,
    or the worst of the standard three."""
    if (hub := fit.body.port_hub(port)) is not None:
        return hub, "on the hub of the spec"
    rigid = fit.full[port].rigid_mass
    band = fit.bandwidth[port]
    limits = (min(span(fit, port)[0], 0.5 * band), band)
    worst = max(
        STANDARD_HUBS,
        key=lambda f: error_curves(fit, port, [fit.measured.damped_port(port)], f * rigid, limits)[
            0
        ].error.max(),
    )
    return worst * rigid, f"on a hub of {worst:g} times the appendage's mass (the worst of three)"


def error_curves(
    fit: "Fit",
    port: str,
    models: Sequence[PortModel],
    hub: Array,
    limits: tuple[float, float],
) -> list[ErrorCurve]:
    """Errors of `models` against the beam, all on the hub;
    a curve's largest in the band is the in-band error."""
    beam = beam_model(fit, port)
    band = fit.bandwidth[port]
    block = Block(hub, beam, tuple(range(beam.motions)))
    reference = Reference([block], band, fit.spec.undamped_ratio)
    peaks = np.concatenate([peaks_of(model, hub)[:, 0] for model in (beam, *models)])
    steps = np.array([0.0, 0.5, 1.0, 2.0, 4.0, 8.0]) * float(
        np.max(beam.damping, initial=DEFAULT_RATIO)
    )
    beyond = (peaks[:, None] * (1.0 + np.concatenate([-steps[1:], steps]))).ravel()
    inside = reference.grid(0, models)
    omega = np.unique(
        np.concatenate([np.geomspace(*limits, 280), beyond[beyond > band], inside, [band]])
    )
    omega = omega[(omega >= limits[0]) & (omega <= limits[1])]
    tops = [_about_the_top(omega, reference.curve(0, model, omega), band) for model in models]
    omega = np.unique(np.concatenate([omega, *tops]))
    return [ErrorCurve(omega, reference.curve(0, model, omega)) for model in models]


def _about_the_top(omega: Array, values: Array, band: float) -> Array:
    """Points about the largest value of a curve in the band."""
    k = int(np.argmax(np.where(omega <= band, values, 0.0)))
    low = omega[max(k - 1, 0)]
    high = min(omega[min(k + 1, omega.size - 1)], max(band, omega[k]))
    return np.linspace(low, high, ABOUT)
