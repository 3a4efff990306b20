"""What a fit, a craft and a retimed file came to, in sentences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from beamchain.craft.coupled_modes import SHARE, WORDS
from beamchain.engine.linearise import NUMBERS
from beamchain.fitting.needs import AXES
from beamchain.fitting.proof import needs_hub
from beamchain.ports.compare import keeps_tolerance, tolerance_statement
from beamchain.report.curves import count
from beamchain.steps.cures import RUINED
from beamchain.steps.sampled import judged_part, off_by

if TYPE_CHECKING:
    from beamchain.craft.embedded import Embedded
    from beamchain.craft.retiming import RetimedCraft
    from beamchain.fitting.result import Fit, InSpace

TIP_TOLD = 0.01  # error of the tip's motion that is told beside the model's
SAME_MASS = 1e-9  # relative, beyond which the file's rigid mass is said to differ from a body's


# -- what mends it, and what makes the error -------------------------------------------------------
def cure_sentence(result: "Fit | Embedded") -> str:
    """What mends a result that misses its tolerance, or that nothing does; empty where it does
    not."""
    if not result.missed:
        return ""
    if result.cure is None:
        return "No integrator, shorter step or further mode that was tried mends it."
    return result.cure.words


def cause_sentence(result: "Fit | Embedded") -> str:
    """The resonance whose shift by the step makes the error; empty where there is none."""
    peak = result.cause
    if peak is None:
        return ""
    mode = f" ({peak.mode})" if peak.mode else ""
    return (
        f"The error comes from the resonance at {peak.frequency:.4g} rad/s{mode}, whose "
        f"frequency the step shifts by {peak.shift:+.2g} of itself and whose damping ratio, "
        f"{peak.ratio:.3g}, by {peak.damped:+.2g} of itself: that changes its response there "
        f"by {peak.change:.2g}."
    )


# -- a fit -----------------------------------------------------------------------------------------
def fit_message(fit: "Fit") -> str:
    """What mends a fit, what was made, and whether that keeps what was asked for."""
    return " ".join(filter(None, (cure_sentence(fit), made_sentence(fit), *reached_sentences(fit))))


def made_sentence(fit: "Fit") -> str:
    """What a fit made: its chain, the modes of a file, and what step limits are taken on."""
    sentences = (_chain_sentence(fit), *_space_sentences(fit), _limits_sentence(fit))
    return " ".join(filter(None, sentences))


def reached_sentences(fit: "Fit") -> list[str]:
    """What a fit could not keep, and its errors against what was asked for."""
    at_step = (_step_sentence(fit), cause_sentence(fit)) if fit.at_step else ()
    return list(filter(None, (*fit.missing, _promise_sentence(fit), *at_step)))


def spring_sentence(fit: "Fit") -> str:
    """Where the springs of a chain stand, how stiff they are, and why there; empty where it has
    none, as a rigid body and a liquid."""
    chain = fit.chain
    tendons = [tendon for tendon in chain.tendons if tendon.is_mode]
    if not tendons:
        has_springs = any(any(hinge.stiffness.values()) for hinge in chain.hinges)
        why = "Each hinge has its own spring, since no mode is damped by itself."
        return why if has_springs else ""
    if any(tendon.damping for tendon in tendons):
        why = "so that every mode has its own damping ratio"
    else:
        why = "since springs at the hinges alone do not give these modes"
    listed = ", ".join(f"{tendon.label} {tendon.stiffness:.4g}" for tendon in tendons)
    return (
        f"The hinges are free and the springs are tendons, one per mode, {why}. Their stiffness, "
        f"the square of the mode's frequency in rad/s, is {listed}."
    )


def _chain_sentence(fit: "Fit") -> str:
    """What holds the modes, and how many are kept."""
    space = fit.space
    if fit.spec.slosh is not None and space is not None:
        return f"{fit.how}, {len(space.numbers)} modes kept."
    if space is not None and space.couples:
        return f"exact chain ({fit.how}), {len(space.numbers)} modes kept."
    if not fit.target:
        return f"{fit.how}."
    counts: list[str] = []
    for port, target in fit.target.items():
        own = len(fit.readback_error[port].matches)
        static = f" (and {target.modes - own} for further points)" if own < target.modes else ""
        counts.append(f"{own} in {port}{static}")
    return f"exact chain ({fit.how}), modes kept: {', '.join(counts)}."


def _space_sentences(fit: "Fit") -> list[str]:
    """Of imported modes: why they have one cut or several, which are kept, and whether their mass
    is a body's."""
    space = fit.space
    if space is None:
        return []
    out = [] if fit.spec.slosh is not None else [f"Ports: {space.why}."]
    if fit.kept_for == "clamped":  # another target has modes of its own
        out.append(f"Kept: {kept_words(space)}.")
    if (off := space.error.mass_error) > SAME_MASS:
        rigid = "The rigid mass matrix of the file departs from that of a rigid body"
        out.append(f"{rigid} by {off:.1e}.")
    return out


def kept_words(space: "InSpace") -> str:
    """The kept modes by their numbers in the file."""
    if not space.numbers:
        return f"none of the {space.data.modes} modes of the file"
    if len(space.numbers) == space.data.modes:
        return f"all {space.data.modes} modes of the file"
    listed = ", ".join(map(str, space.numbers))
    many = "modes" if len(space.numbers) > 1 else "mode"
    return f"{many} {listed} of the {space.data.modes} of the file"


def _limits_sentence(fit: "Fit") -> str:
    """On what the step limits are taken, where that is not the specification's hub or none."""
    if fit.spec.root.hub is not None or not needs_hub(fit.line, fit.measured.motion):
        return ""
    return "Step limits: on ten times its mass, as its root has none of its own."


def _promise_sentence(fit: "Fit") -> str:
    """How the model keeps what the scene asks for; empty without a scene."""
    scene, error = fit.spec.scene, fit.promise
    if scene is None or error is None:
        return ""
    best = "" if keeps_tolerance(error, scene.tolerance) else ": the best model is written"
    return (
        f"in-band error of the hub up to {scene.bandwidth:g} rad/s: {error:.2e}, "
        f"{tolerance_statement(error, scene.tolerance)}{best}."
    )


def _step_sentence(fit: "Fit") -> str:
    """The error at the stated step; empty where none is stated, or where neither a tolerance nor
    0.1 is held against it."""
    scene, error, step = fit.spec.scene, fit.sampled_error, fit.spec.exact_step
    if error is None or (fit.met is None and not fit.ruined):
        return ""
    kept = f", above {RUINED:g}"
    if scene is not None and scene.bandwidth is not None:
        kept = _kept_words(error, scene.tolerance, judged_part(step, scene.bandwidth))
    return f"Stepped by {fit.spec.integrator} at {step:g} s: off {off_by(error)}{kept}."


def _kept_words(error: float, tolerance: float, part: str) -> str:
    """How an error stands to a tolerance, which is not met where a step is judged in `part` of the
    band."""
    if part:
        return f"{part}; the tolerance {tolerance:g} is not met"
    return f", {tolerance_statement(error, tolerance)}"


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
    """The tip's error and the remedy, if it is above 1 % and no scene leaves the tip out."""
    if fit.spec.scene is not None and not fit.spec.scene.tip:
        return None
    off = [
        (float(error), f"mode {k} of {port}")
        for port, errors in fit.tip_error.items()
        for k, error in enumerate(errors[: len(fit.readback_error[port].matches)], 1)
    ]
    error, mode = max(off, key=lambda each: abs(each[0]), default=(0.0, ""))
    if abs(error) <= TIP_TOLD:
        return None
    return (
        f"tip motion off by {error:+.1%} in {mode}: where the tip matters keep more modes, or "
        "give it a [[port]]"
    )


# -- a craft ---------------------------------------------------------------------------------------
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
        worst = max(found.poses, key=lambda name: found.poses[name])
        said += f" (worst of {len(found.poses)} poses: {worst})"
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
    if tolerance is None:
        above = f", above {RUINED:g}" if embedded.ruined else ""
        return f"{said}{part}{above}; no tolerance was requested.{_growth_words(embedded)}"
    if found.growth and not part:
        said += f"; the tolerance {tolerance:g} is not met."
    else:
        said += f"{_kept_words(embedded.decisive, tolerance, part)}."
    return f"{said} {cause_sentence(embedded)}".rstrip() + _growth_words(embedded)


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
        where = f"{name}, {' and '.join(embedded.loads[name])}"
        out += f" Unstable at {where}: the exact spacecraft {exact}, the file {file}; {cure}."
    return out


def modes_sentence(embedded: "Embedded") -> str:
    """How far the kept modes are off, and unless the tolerance is met how many are left out."""
    assembly = embedded.assembly
    band = f"up to {assembly.band:.4g} rad/s"
    said = f"no kept mode lies {band}"
    if assembly.judged:
        number = count(len(assembly.judged), "kept mode")
        said = f"{number} {band}, off by at most {assembly.worst:.1e}"
    missing = 0 if embedded.met else len(assembly.left_out)
    if not missing:
        return said
    those = "one mode in the band is" if missing == 1 else f"{missing} modes in the band are"
    return f"{said}; {those} left out"


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


def strain_words(shares: Mapping[tuple[str, str], float]) -> str:
    """What holds the strain energy of a mode, such as "upper 62 % and fore 38 %, bending xz"; its
    shares as of `strain_holders`."""
    large = sorted((item for item in shares.items() if item[1] > SHARE), key=lambda item: -item[1])
    names: dict[str, list[str]] = {}
    for (name, kind), share in large:
        names.setdefault(WORDS.get(kind, kind), []).append(f"{name} {100.0 * share:.0f} %")
    return "; ".join(f"{' and '.join(those)}, {kind}" for kind, those in names.items())


# -- a retimed file --------------------------------------------------------------------------------
def retimed_headline(craft: "RetimedCraft") -> str:
    """The errors of a file with timing, and what mends it where it misses its tolerance."""
    error = craft.time_error
    if error is None:
        return "the timing was taken out."
    exact = "exact in time" if error.exact else "not exact"
    said = f"{error.integrator} at {error.step:g} s: poles are {exact}, {error.words}"
    proof, sampled, tolerance = craft.proof, craft.sampled_error, craft.tolerance
    if proof is None or sampled is None:
        return f"{said}; the error of the response is not known, for {craft.unknown}."
    part = judged_part(craft.timestep, proof.band)
    said += f"; motion off {off_by(sampled)}{part}"
    if tolerance is None:
        return f"{said}; no tolerance was requested."
    if part:
        said += f"; the tolerance {tolerance:g} is not met"
    else:
        said += f", {'within' if craft.met else 'above'} the tolerance {tolerance:g}"
    return f"{cure_sentence(proof)} {said}. {cause_sentence(proof)}".strip()
