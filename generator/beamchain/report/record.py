"""fit.json: everything a script may want of a fit, as plain numbers."""

from typing import TYPE_CHECKING, Any

from beamchain.caution import warnings_record
from beamchain.mjcf.write import joint_name
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array

if TYPE_CHECKING:
    from beamchain.fitting.result import Fit


def mass_record(rigid: Array) -> dict[str, Any]:
    """Mass, centre and inertia about the port from a `(6, 6)` mass matrix."""
    m = float(rigid[0, 0])
    com = [(rigid[1, 5] - rigid[2, 4]) / 2.0 / m, -rigid[0, 5] / m, rigid[0, 4] / m]
    return {"mass": m, "com": com, "inertia": rigid[3:, 3:]}


def port_record(model: PortModel) -> dict[str, Any]:
    """Cantilever frequencies, participation, free frequencies [rad/s], damping ratios."""
    return {
        "frequencies": model.frequencies,
        "participation": model.participation,
        "free_frequencies": model.free_frequencies,
        "damping": model.damping,
    }


def space_record(fit: "Fit") -> dict[str, Any]:
    """What is known of all six motions at once, for imported modes."""
    if fit.space is None:
        return {}
    space = fit.space
    names = ("x", "y", "z", "rotation x", "rotation y", "rotation z")
    out: dict[str, Any] = {
        "form": space.form,
        "space": {
            "why": space.why,
            "motions": [names[i] for i in space.live],
            "target": port_record(space.target),
            "achieved": port_record(space.achieved),
            "error": {
                "frequency": space.error.frequency,
                "participation": space.error.participation,
                "accelerance_in_band": space.error.accelerance_in_band,
            },
            "modes": [
                {"belongs": port, "leak": leak} for port, leak in zip(space.data.belongs, space.data.leaks, strict=True)
            ],
            "steps": space.data.steps,
        },
    }
    return out


def fit_record(fit: "Fit") -> dict[str, Any]:
    """What fit.json holds; see the contract in README."""
    import beamchain
    from beamchain.engine.library import mujoco

    limits = fit.limits
    return {
        **space_record(fit),
        "name": fit.spec.name,
        "beamchain": beamchain.__version__,
        "mujoco": mujoco.__version__,
        "method": fit.spec.fit.method,
        "target": fit.kept_for,
        "in_band_error": fit.in_band_error,
        "mass": {**mass_record(fit.measured.rigid_mass), "target": mass_record(fit.mass_line.rigid_mass())},
        "ports": {
            port: {
                "target": port_record(target),
                "achieved": port_record(fit.achieved[port]),
                "error": {
                    "frequency": fit.error[port].frequency,
                    "participation": fit.error[port].participation,
                    "accelerance_in_band": fit.error[port].accelerance_in_band,
                    "in_band": fit.error[port].accelerance_in_band,
                    "band": fit.bandwidth[port],
                },
                "readback": {
                    "frequency": fit.error[port].frequency,
                    "participation": fit.error[port].participation,
                },
                "bandwidth": fit.bandwidth[port],
            }
            for port, target in fit.target.items()
        },
        "coupling": fit.measured.coupling,
        "chain": {
            "links": [
                {
                    "length": link.length,
                    "mass": link.mass,
                    "com": link.com,
                    "inertia": link.inertia,
                    "start": link.start,
                    "beside": link.beside,
                    "products": link.products,
                }
                for link in fit.chain.links
            ],
            "hinges": [
                {"x": hinge.x, "stiffness": dict(hinge.stiffness), "damping": dict(hinge.damping)}
                for hinge in fit.chain.hinges
            ],
        },
        "tip": fit.tip_error,
        "stability": {
            "hub": mass_record(fit.hub_mass) if fit.hub_mass is not None else None,
            "omega_max": limits.omega_max,
            "largest_step": limits.largest_step,
        },
        "accuracy": {name: {"1%": steps[0], "0.1%": steps[1]} for name, steps in limits.accuracy.items()},
        "tendons": [
            {
                "name": f"{fit.spec.name}_{tendon.label}",
                "stiffness": tendon.stiffness,
                "damping": tendon.damping,
                "armature": tendon.armature,
                "coefficients": {
                    joint_name(fit.spec.name, hinge + 1, port): value
                    for (hinge, port), value in zip(tendon.freedoms, tendon.coefficients.tolist(), strict=True)
                },
            }
            for tendon in fit.chain.tendons
        ],
        "time": {
            "timestep": fit.spec.exact_step or None,
            "integrator": fit.spec.integrator,
            "turn_error": fit.turn_error,
            "modes": [
                {
                    "frequency": row.frequency,
                    "ratio": row.ratio,
                    "achieved_frequency": row.achieved_frequency,
                    "achieved_ratio": row.achieved_ratio,
                    "slowed": row.slowed,
                }
                for row in (fit.time if fit.spec.exact_step else ())
            ],
        },
        "left_out": [{"what": item.what, "why": item.why, "cost": item.cost} for item in fit.left_out],
        "scene": _scene_record(fit),
        **warnings_record(fit.warnings),
        "status": {"ok": fit.status.ok, "message": fit.status.message, "history": fit.status.history},
        "seconds": fit.seconds,
    }


def _scene_record(fit: "Fit") -> dict[str, Any] | None:
    """What the scene was promised, what came of it, and what the model cannot answer."""
    scene = fit.spec.scene
    if scene is None or scene.bandwidth is None:
        return None
    return {
        "bandwidth": scene.bandwidth,
        "tolerance": scene.tolerance,
        "axes": scene.axes,
        "error": fit.promise,
        "modes": None if fit.choice is None else fit.choice.modes,
        "cannot_answer": () if fit.choice is None else fit.choice.cannot,
        "reasoning": () if fit.choice is None else fit.choice.reasoning,
        "steps": [
            {"integrator": step.integrator, "step": step.step, "bound": step.bound, "cost": step.cost}
            for step in fit.steps
        ],
    }
