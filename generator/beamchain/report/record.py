"""fit.json: everything a script may want of a fit, as plain numbers."""

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from beamchain.port import Array, PortModel

if TYPE_CHECKING:
    from beamchain.workflow import Fit


def to_json(record: dict[str, Any]) -> str:
    """JSON text, strict: a number that is not finite becomes null (no limit)."""
    return json.dumps(_plain(record), indent=2, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value


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


def fit_record(fit: "Fit") -> dict[str, Any]:
    """What fit.json holds; see the contract in README."""
    import beamchain
    from beamchain.engine.library import mujoco

    limits = fit.limits
    return {
        "name": fit.spec.name,
        "beamchain": beamchain.__version__,
        "mujoco": mujoco.__version__,
        "method": fit.spec.fit.method,
        "target": fit.spec.root.target or "clamped",
        "mass": {**mass_record(fit.measured.rigid_mass), "target": mass_record(fit.spec.beam.rigid_mass())},
        "ports": {
            port: {
                "target": port_record(target),
                "achieved": port_record(fit.achieved[port]),
                "error": {
                    "frequency": fit.error[port].frequency,
                    "participation": fit.error[port].participation,
                    "accelerance_in_band": fit.error[port].accelerance_in_band,
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
        "prewarp": {
            port: {
                "integrator": plan.integrator,
                "timestep": plan.timestep,
                "on_hub": plan.hub_mass is not None,
                "shown": plan.wanted,
                "chain": plan.aimed,
            }
            for port, plan in fit.prewarps.items()
        },
        "left_out": [],
        "warnings": fit.warnings,
        "status": {"ok": fit.status.ok, "message": fit.status.message, "history": fit.status.history},
        "seconds": fit.seconds,
    }
