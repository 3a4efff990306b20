"""What scripts may want of results, as plain numbers: fit.json, study.json,
and what `--json` prints."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from beamchain.mjcf.write import joint_name
from beamchain.ports.model import PortModel
from beamchain.report.tables import inspect as inspect_tables
from beamchain.report.tables import plant as plant_tables
from beamchain.report.tables.embed import coupled_table
from beamchain.report.tables.fit import mass_record
from beamchain.structure.settle_modes import MOTIONS
from beamchain.studies.pareto import TARGETS, Metric, power
from beamchain.warning_codes import warnings_record

if TYPE_CHECKING:
    from beamchain.control.margins import Margins
    from beamchain.control.realisation import Plant
    from beamchain.control.scheduled import ScheduledPlant
    from beamchain.craft.embedded import Embedded
    from beamchain.craft.inspect import Inspection
    from beamchain.craft.retiming import RetimedCraft
    from beamchain.fitting.result import Fit
    from beamchain.steps.limits import StepLimits
    from beamchain.studies.study import Study


def _fields(thing: Any, *names: str) -> dict[str, Any]:
    return {name: getattr(thing, name) for name in names}


def _each(things: Iterable[Any], *names: str) -> list[dict[str, Any]]:
    return [_fields(thing, *names) for thing in things]


def port_record(model: PortModel) -> dict[str, Any]:
    """Cantilever frequencies, participation, free frequencies [rad/s], damping ratios."""
    return _fields(model, "frequencies", "participation", "free_frequencies", "damping")


def space_record(fit: "Fit") -> dict[str, Any]:
    """What is known of all six motions at once, for imported modes."""
    if (space := fit.space) is None:
        return {}
    modes = zip(space.data.belongs, space.data.leaks, strict=True)
    return {
        "space": {
            "motions": [MOTIONS[i] for i in space.live],
            "target": port_record(space.target),
            "achieved": port_record(space.achieved),
            "error": _fields(space.error, "frequency", "participation"),
            "modes": [{"belongs": port, "leak": leak} for port, leak in modes],
            "effective_mass_fractions": space.data.effective_mass_fractions,
            "kept": space.numbers,
        }
    }


def fit_record(fit: "Fit") -> dict[str, Any]:
    """What fit.json holds."""
    import beamchain
    from beamchain.engine.library import mujoco

    limits = fit.written_limits
    return {
        **space_record(fit),
        "name": fit.spec.name,
        "beamchain": beamchain.__version__,
        "mujoco": mujoco.__version__,
        "target": fit.kept_for,
        "in_band_error": fit.in_band_error,
        "time_error": None if fit.time_error is None else fit.time_error.as_dict(),
        "sampled_error": fit.sampled_error,
        "met": fit.met,
        "cure": None if fit.cure is None else fit.cure.as_dict(),
        "mass": {
            **mass_record(fit.measured.rigid_mass),
            "target": mass_record(fit.line.rigid_mass()),
        },
        "ports": {port: _port(fit, port) for port in fit.target},
        "coupling": fit.measured.coupling,
        "chain": {
            "links": _each(
                fit.chain.links, "length", "mass", "com", "inertia", "start", "beside", "products"
            ),
            "hinges": [
                {"x": h.x, "stiffness": dict(h.stiffness), "damping": dict(h.damping)}
                for h in fit.chain.hinges
            ],
        },
        "tip": fit.tip_error,
        "stability": {
            "hub": mass_record(fit.hub_mass) if fit.hub_mass is not None else None,
            **_fields(limits, "omega_max", "largest_step"),
        },
        "accuracy": _accuracy(limits),
        "tendons": [
            {
                "name": f"{fit.spec.name}_{tendon.label}",
                **_fields(tendon, "stiffness", "damping", "armature"),
                "coefficients": {
                    joint_name(fit.spec.name, hinge + 1, port): value
                    for (hinge, port), value in zip(
                        tendon.freedoms, tendon.coefficients.tolist(), strict=True
                    )
                },
            }
            for tendon in fit.chain.tendons
        ],
        "time": {
            "timestep": fit.spec.exact_step or None,
            "integrator": fit.spec.integrator,
            "turn_error": fit.turn_error,
            "modes": [asdict(row) for row in (fit.time if fit.spec.exact_step else ())],
        },
        "look": _fields(fit.look, "drawn", "vertices", "residual"),
        "left_out": _each(fit.left_out, "what", "why", "cost"),
        "scene": _scene_record(fit),
        "warnings": warnings_record(fit.warnings),
        "ok": fit.status.ok,
        "seconds": fit.seconds,
    }


def _port(fit: "Fit", port: str) -> dict[str, Any]:
    error = fit.readback_error[port]
    return {
        "target": port_record(fit.target[port]),
        "achieved": port_record(fit.achieved[port]),
        "error": {
            **_fields(error, "frequency", "participation"),
            "in_band": error.accelerance_in_band,
            "band": fit.bandwidth[port],
        },
        "readback": {"reading": fit.measured.reading(port), "distance": fit.measured.lost[port]},
    }


def _scene_record(fit: "Fit") -> dict[str, Any] | None:
    """What the scene was promised, and what came of it."""
    scene = fit.spec.scene
    if scene is None or scene.bandwidth is None:
        return None
    choice = fit.choice
    return {
        **_fields(scene, "bandwidth", "tolerance", "axes"),
        "error": fit.promise,
        "modes": None if choice is None else choice.modes,
        "steps": _each(fit.steps, "integrator", "step", "bound", "cost"),
    }


def embed_record(embedded: "Embedded") -> dict[str, Any]:
    """What was embedded, the coupled modes, what would spoil them."""
    assembly = embedded.assembly
    return {
        "appendages": [
            {
                "at": a.at,
                "prefix": a.prefix,
                "hub": {
                    "mass": a.hub.mass,
                    "inertia": a.hub.inertia_matrix(),
                    "com": [-v for v in a.hub.offset],
                    "apparent": a.hub.apparent,
                    "joints": [
                        {"name": j.name, "type": j.kind, "sprung": j.sprung} for j in a.mount.joints
                    ],
                },
                "target": a.fit.kept_for,
                "mass_centre": embedded.mass_centres[a.at],
                **({} if a.fit.space is None else {"modes_of_the_file": a.fit.space.numbers}),
                "ports": {
                    port: {"frequencies": target.frequencies}
                    for port, target in a.fit.target.items()
                },
                "large_motion": [limit.as_dict() for limit in a.large_motion.values()],
                "ok": a.fit.status.ok,
            }
            for a in embedded.appendages
        ],
        **_fields(embedded, "craft_error", "sampled_error", "band", "tolerance", "met"),
        "time_error": embedded.time_error.as_dict(),
        "cure": None if embedded.cure is None else embedded.cure.as_dict(),
        "composite": embedded.composite.as_dict(),
        "modes": coupled_table(assembly).records(),
        "poses": embedded.promise.poses,
        **(_fields(embedded, "loads", "growth") if embedded.loaded else {}),
        "sampled_poses": {name: found.error for name, found in embedded.sampled_poses.items()},
        "kept_band": assembly.band,
        "worst": assembly.worst,
        "accelerance": {"hub": assembly.hub, "band": assembly.common, "error": assembly.in_band},
        "warnings": warnings_record(embedded.warnings),
    }


def retime_record(craft: "RetimedCraft") -> dict[str, Any]:
    """What `retime --json` prints."""
    error = craft.time_error
    return {
        "modes": [asdict(row) for row in craft.file.rows],
        "time_error": None if error is None else error.as_dict(),
        **_fields(craft, "sampled_error", "tolerance", "met"),
        "cure": None if craft.cure is None else craft.cure.as_dict(),
        "warnings": warnings_record(craft.warnings),
    }


def inspection_record(inspection: "Inspection") -> dict[str, Any]:
    """What `inspect --json` prints."""
    limits = inspection.limits
    return {
        **_fields(inspection, "name", "bodies", "joints", "dofs", "mass"),
        "composite": [body.as_dict() for body in inspection.composite],
        "modes": inspect_tables.mode_table(inspection).records(),
        "springs": inspect_tables.spring_table(inspection).records(),
        "tendons": inspect_tables.tendon_table(inspection).records(),
        "made_for": _each(inspection.made_for, "timestep", "integrator"),
        "warnings": warnings_record(inspection.warnings),
        **_fields(inspection, "integrator", "timestep"),
        "stability": _fields(limits, "omega_max", "largest_step"),
        "accuracy": _accuracy(limits),
    }


def _accuracy(limits: "StepLimits") -> dict[str, dict[str, float]]:
    return {
        name: {"1%": one_percent, "0.1%": tenth}
        for name, (one_percent, tenth) in limits.accuracy.items()
    }


def plant_record(
    result: "Plant | ScheduledPlant",
    margins_by_plant: "Sequence[Margins]",
    warnings: Sequence[str],
) -> dict[str, Any]:
    """What `plant --json` prints."""
    from beamchain.control.realisation import Plant

    first, scheduled = (result, None) if isinstance(result, Plant) else (result[0], result)
    grid = None if scheduled is None else scheduled.grid
    return {
        "inputs": plant_tables.input_table(first).records(),
        "outputs": plant_tables.output_table(first).records(),
        "states": list(first.state_names),
        "modes": plant_tables.mode_table(first).records(),
        "allocations": {name: each.as_dict() for name, each in first.allocations.items()},
        "angles": None if grid is None else grid[0],
        "poses": None if scheduled is None else list(scheduled.labels),
        "pose_modes": None if scheduled is None else list(scheduled.modes),
        "frequencies": None if scheduled is None else scheduled.frequency,
        "margins": [_loop_records(margins) for margins in margins_by_plant] or [[]],
        "closed_loops": [
            {key: value for key, value in margins.as_dict().items() if key != "loops"}
            for margins in margins_by_plant
        ],
        "warnings": warnings_record(warnings),
    }


def _loop_records(margins: "Margins") -> list[dict[str, Any]]:
    """The margins at every input, and the instabilities that its loop is to blame for."""
    records: list[dict[str, Any]] = []
    for loop in margins.loops:
        own = (one for one in margins.instabilities if loop.input in one.causes or not one.causes)
        records.append({**loop.as_dict(), "instabilities": [one.as_dict() for one in own]})
    return records


def study_record(study: "Study") -> dict[str, Any]:
    """What study.json holds; `points`, `rigid_hub` and `to_reach` are the contract,
    the rest is added."""
    import beamchain
    from beamchain.engine.library import machine

    scenario = study.scenario
    return {
        "name": study.spec.name,
        "beamchain": beamchain.__version__,
        "machine": machine(),
        "scenario": {
            **_fields(scenario, "duration", "watched"),
            **_fields(scenario.profile, "times", "wrench"),
            "largest_elastic_motion": scenario.largest,
        },
        # what the motions were compared with, and how much large motion would change of it
        "reference": {"kind": "linear", "nonlinear": scenario.nonlinear},
        "points": [point._asdict() for point in study.points],
        "notes": [
            {**_fields(ladder.entry, "model", "n", "integrator"), "note": ladder.note}
            for ladder in study.ladders
        ],
        "rigid_hub": study.rigid_hub,
        "to_reach": _to_reach(study, "error"),
        "to_reach_appendage": _to_reach(study, "error_appendage"),
        "warnings": warnings_record(study.warnings),
        "seconds": study.seconds,
    }


def _to_reach(study: "Study", metric: Metric) -> dict[str, Any]:
    out: dict[str, Any] = {power(target): None for target in TARGETS}
    for target in TARGETS:
        if (best := study.best(target, metric)) is None:
            continue
        rivals = study.rivals(target, metric)
        out[power(target)] = {
            **best.point._asdict(),
            "rivals": {model: reach.seconds / best.seconds for model, reach in rivals.items()},
            "rival_points": {
                model: _fields(reach.point, "n", "integrator", "timestep")
                | _fields(reach, "seconds")
                for model, reach in rivals.items()
            },
        }
    return out
