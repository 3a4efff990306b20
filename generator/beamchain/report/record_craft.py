"""`embed --json`: what was embedded, the coupled modes, what would spoil them."""

from typing import TYPE_CHECKING, Any

from beamchain.caution import warnings_record

if TYPE_CHECKING:
    from beamchain.craft.embedded import Embedded


def embed_record(embedded: "Embedded") -> dict[str, Any]:
    """The record as plain numbers."""
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
                    "joints": [{"name": j.name, "type": j.kind, "sprung": j.sprung} for j in a.mount.joints],
                },
                "target": a.fit.kept_for,
                "ports": {port: {"frequencies": target.frequencies} for port, target in a.fit.target.items()},
                "large_motion": [limit.as_dict() for limit in a.large_motion.values()],
                "status": {"ok": a.fit.status.ok, "message": a.fit.status.message},
            }
            for a in embedded.appendages
        ],
        "form": embedded.form,
        "composite": embedded.composite.as_dict(),
        "modes": [
            {"exact": m.exact, "mujoco": m.mujoco, "error": m.error, "kept": m.kept, "moving": m.words}
            for m in assembly.modes
        ],
        "craft_error": embedded.craft_error,
        "band": embedded.band,
        "tolerance": embedded.tolerance,
        "met": embedded.met,
        "poses": embedded.promise.poses,
        "kept_band": assembly.band,
        "steps": list(embedded.steps),
        "worst": assembly.worst,
        "accelerance": {"hub": assembly.hub, "band": assembly.common, "error": assembly.in_band},
        **warnings_record(embedded.warnings),
    }
