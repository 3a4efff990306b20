"""What a fit and a craft came to, in sentences."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from beamchain.engine.linearise import NUMBERS
from beamchain.fitting.needs import AXES
from beamchain.ports.compare import tolerance_statement
from beamchain.steps.cures import RUINED
from beamchain.steps.sampled import judged_part, off_by

if TYPE_CHECKING:
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit

TIP_TOLD = 0.01  # error of the tip's motion that is told beside the model's


def fit_headline(fit: "Fit") -> str:
    """The model's error in a sentence, and the tip's if that is above 1 %."""
    port = fit.worst_port
    error = fit.in_band_error
    if error is None:
        return "rigid: no in-band error is known without scene.bandwidth"
    if port is None or fit.promise is not None:
        band = fit.spec.scene.bandwidth if fit.spec.scene else None
        said = f"in-band error {error:.2e}" + ("" if band is None else f" up to {band:.4g} rad/s")
        said += ", rigid" if port is None else ", in the motions the scene asks for"
    else:
        said = f"in-band error {error:.2e} up to {fit.bandwidth[port]:.4g} rad/s ({port}"
        ports = len(fit.readback_error)
        said += f", worst of {ports} ports)" if ports > 1 else ")"
    tip = tip_sentence(fit)
    return said if tip is None else f"{said}; {tip}"


def tip_sentence(fit: "Fit") -> str | None:
    """The tip's error and the remedy, if it is above 1 %."""
    off = {
        (p, k + 1): float(e)
        for p, errors in fit.tip_error.items()
        for k, e in enumerate(errors[: len(fit.readback_error[p].matches)])
    }
    worst = max(off, key=lambda k: abs(off[k]), default=None)
    if worst is None or abs(off[worst]) <= TIP_TOLD:
        return None
    return (
        f"tip motion off by {off[worst]:+.1%} in mode {worst[1]} of {worst[0]}: where the tip "
        "matters keep more modes, or give it a [[port]]"
    )


def embedded_headline(embedded: "Embedded") -> str:
    """The craft's error in a sentence, and the resonance that makes it, if the step does."""
    found = embedded.promise
    tolerance = embedded.tolerance
    names = [name for name, i in AXES.items() if i in found.motions]
    pushed = "" if len(names) == len(AXES) else f" under {_pushes(names)}"
    twin = "rigid twin: " if embedded.appendages[0].rigid else ""
    said = (
        f"{twin}motion of {found.body} ({', '.join(names)}{pushed}) up to {found.band:.4g} "
        f"rad/s, all appendages together: off by at most {found.error:.2e}"
    )
    if len(found.poses) > 1:
        said += (
            f" (worst of {len(found.poses)} poses: "
            f"{max(found.poses, key=lambda k: found.poses[k])})"
        )
    if embedded.loaded:
        said += f" {_load_words(embedded)}"
    part = ""
    if embedded.by_step:
        option = embedded.model.opt
        step = f"{NUMBERS[int(option.integrator)]} at {float(option.timestep):g} s"
        moved = off_by(embedded.sampled_error)
        said += f" in continuous time, and {moved} when stepped by {step}"
        sampled = embedded.sampled_poses
        if len(sampled) > 1:
            said += f" (worst: {max(sampled, key=lambda k: sampled[k].error)})"
        said += " without the load" if embedded.loaded else ""
        part = judged_part(float(option.timestep), found.band)
    said += part
    if tolerance is None:
        above = f", above {RUINED:g}" if embedded.ruined else ""
        return f"{said}{above}; no tolerance was requested.{_growth_words(embedded)}"
    if part or embedded.promise.growth:
        said += f"; the tolerance {tolerance:g} is not met. {embedded.blamed}"
    else:
        said += f", {tolerance_statement(embedded.decisive, tolerance)}. {embedded.blamed}"
    return said.rstrip() + _growth_words(embedded)


def _growth_words(embedded: "Embedded") -> str:
    """Where a load lets the spacecraft grow, in sentences; empty where it does not."""
    out = ""
    for name, rates in embedded.promise.growth.items():
        exact, file = (
            f"grows by a factor of e in {1.0 / rate:.3g} s" if rate else "does not grow"
            for rate in rates
        )
        cure = (
            "it needs more stiffness, or less load"
            if rates[0]
            else "chains of four to six modes in a plane buckle most nearly as their beams do; "
            "if they grow as well, take less load"
        )
        load = " and ".join(embedded.loads[name])
        out += (
            f" Unstable at {name}, {load}: the exact spacecraft {exact}, the file {file}; {cure}."
        )
    return out


def modes_sentence(embedded: "Embedded") -> str:
    """How far the kept modes are off, and unless the tolerance is met how many are left out."""
    told = [embedded.assembly.worst_told, "" if embedded.met else embedded.assembly.left_out_told]
    return "; ".join(filter(None, told))


def _load_words(embedded: "Embedded") -> str:
    """What acts at the worst pose, or that nothing does."""
    worst = max(embedded.promise.poses, key=lambda name: embedded.promise.poses[name])
    return " and ".join(dict.fromkeys(embedded.loads[worst])) or f"at {worst}, where no load acts"


def _pushes(names: Sequence[str]) -> str:
    """What pushes in the motions of these names, in words."""
    along = ", ".join(name[1:] for name in names if len(name) > 1)
    about = ", ".join(name for name in names if len(name) == 1)
    words = (f"a force along {along}" if along else "", f"a torque about {about}" if about else "")
    return " and ".join(filter(None, words))
