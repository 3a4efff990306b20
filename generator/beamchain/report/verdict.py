"""The sentence at the head of a report: how good the model is, beside the chains one would have written by hand."""

from typing import TYPE_CHECKING, NamedTuple

from beamchain.fitting.hub import port_hub_mass
from beamchain.ports.compare import in_band_error
from beamchain.report.curves import METHODS, beam_model, count, rival_chains, rival_model
from beamchain.report.plots import percent, short
from beamchain.report.shapes import kept_modes

if TYPE_CHECKING:
    from beamchain.fitting.result import Fit


RivalErrors = dict[str, dict[str, float]]


def _kept(fit: "Fit") -> str:
    """`first 2 modes in xy and 1 in torsion`."""
    (port, modes), *more = [(port, kept_modes(fit, port)) for port in fit.target]
    first = f"first {'mode' if modes == 1 else f'{modes} modes'} in {port}"
    parts = [first, *(f"{n} in {other}" for other, n in more)]
    return first if not more else f"{', '.join(parts[:-1])} and {parts[-1]}"


def rival_errors(fit: "Fit") -> RivalErrors:
    """Per port and rival its in-band error, computed as the chain's own."""
    out: RivalErrors = {}
    for port in fit.target:
        beam, hub = beam_model(fit, port), None if fit.hub_mass is None else port_hub_mass(fit.hub_mass, port)
        out[port] = {
            label: in_band_error(rival_model(fit, port, chain), beam, hub, fit.bandwidth[port])
            for label, chain in rival_chains(fit, port).items()
        }
    return out


class Verdict(NamedTuple):
    """The report in one sentence, and whether all that was asked for was reached."""

    good: bool
    sentence: str


def verdict(fit: "Fit", rivals: RivalErrors) -> Verdict:
    """What to tell somebody who reads one sentence."""
    if not fit.error:
        return _rigid_verdict(fit)
    frequency = max(error.frequency for error in fit.error.values())
    errors = {port: error.accelerance_in_band or 0.0 for port, error in fit.error.items()}
    worst = max(errors, key=lambda port: errors[port])
    links = sum(link.mass > 0.0 for link in fit.chain.links)
    what = f"{count(links, 'rigid link')} on {count(len(fit.chain.hinges), 'hinge')} stand for the beam's {_kept(fit)}"
    if fit.space is not None:
        what = what.replace("the beam's", "the imported modes:")
    hub = "the hub of the spec" if fit.hub_mass is not None else "a hub of 0.1, 1 or 10 times the appendage's mass"
    scene = fit.spec.scene
    promised = fit.promise is not None and scene is not None and scene.bandwidth is not None
    error = fit.promise if promised and fit.promise is not None else errors[worst]
    band = scene.bandwidth if promised and scene is not None and scene.bandwidth else fit.bandwidth[worst]
    text = f"{what}: the motion of {hub} is off by at most {percent(error)} up to {short(band)} rad/s"
    classical = None if promised else rivals[worst].get(METHODS["classical"])
    if classical is not None:
        text += f" (classical chain with as many hinges: {percent(classical)})"
    missed = scene is not None and error > scene.tolerance
    if scene is not None and missed:
        text += f", more than the tolerance of {percent(scene.tolerance)}"
    if (tip := fit.tip_told) is not None:
        text += f"; {tip}"
    text += f". Read back through MuJoCo the kept frequencies are within {percent(frequency)} of what was asked for"
    if not fit.status.ok:
        return Verdict(False, f"Less than was asked for: {fit.status.message.rstrip('.')}. {text}.")
    return Verdict(not missed, f"{text}.")


def _rigid_verdict(fit: "Fit") -> Verdict:
    """The sentence of an appendage that the scene needs no mode of."""
    scene = fit.spec.scene
    text = "One rigid body stands for the appendage"
    if scene is not None and scene.bandwidth is not None and fit.promise is not None:
        text += f": the motion of the hub is off by at most {percent(fit.promise)} up to {short(scene.bandwidth)} rad/s"
    less = "" if fit.status.ok else f"Less than was asked for: {fit.status.message.rstrip('.')}. "
    return Verdict(fit.status.ok, f"{less}{text}.")
