"""A specification with its structure drawn from [uncertain]."""

from typing import Any

from msgspec import structs

from beamchain.fitting.spec import Spec


def varied(spec: Spec, seed: int, index: int, owner: str = "") -> Spec:
    """The spec of one sample, its structure drawn; refused where a value is not allowed, such as a mass below zero.

    `owner`: prefix of the appendage, where a craft has several.
    """
    given = spec.uncertain
    assert given is not None
    counts = {"payload": 1, "lump": len(spec.lump), "joint_stiffness": len(spec.joint)}
    counts |= dict.fromkeys(("stiffness", "density"), len(spec.segment))
    scores = given.scores(seed, index, counts, owner)
    changes: dict[str, Any] = {}
    if given.stiffness is not None or given.density is not None:
        stiff, dense = (
            [each.value(1.0, z) for z in scores[name]] if each else [1.0] * len(spec.segment)
            for name, each in (("stiffness", given.stiffness), ("density", given.density))
        )
        changes["segment"] = tuple(map(scaled_segment, spec.segment, stiff, dense))
    if given.joint_stiffness is not None:
        names, value = ("stiffness_xy", "stiffness_xz", "stiffness_torsion"), given.joint_stiffness.value
        changes["joint"] = tuple(
            structs.replace(joint, **{n: value(c, z) for n in names if (c := getattr(joint, n)) is not None})
            for joint, z in zip(spec.joint, scores["joint_stiffness"], strict=True)
        )
    if given.lump is not None:
        changes["lump"] = tuple(
            _heavier(lump, given.lump.value(lump.mass, z)) for lump, z in zip(spec.lump, scores["lump"], strict=True)
        )
    if given.payload is not None and spec.payload is not None:
        changes["payload"] = _heavier(spec.payload, given.payload.value(spec.payload.mass, scores["payload"][0]))
    return structs.replace(spec, **changes)


def _heavier(body: Any, mass: float) -> Any:
    """A lump or payload with another mass, its inertia in proportion."""
    return structs.replace(body, mass=mass, inertia=tuple(v * mass / body.mass for v in body.inertia))


def scaled_segment(segment: Any, stiff: float, dense: float) -> Any:
    """A segment with its stiffness and mass per length multiplied."""
    changes: dict[str, Any] = {"nonstructural_mass": segment.nonstructural_mass * dense}
    factors = {**dict.fromkeys(_STIFF, stiff), **dict.fromkeys(_HEAVY, dense)}
    for name in ("section", "section_end", "material"):
        part = getattr(segment, name)
        if part is not None:
            held = {n: getattr(part, n) for n in factors if n in part.__struct_fields__}
            changes[name] = structs.replace(part, **{n: v * factors[n] for n, v in held.items() if v is not None})
    return structs.replace(segment, **changes)


_STIFF = (
    "bending_stiffness_xy", "bending_stiffness_xz", "torsion_stiffness", "axial_stiffness", "youngs_modulus",
    "shear_modulus",
)  # fmt: skip
_HEAVY = ("linear_mass", "polar_inertia", "density")
