"""A specification with its structure drawn from [uncertain], and the numbers that are drawn."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec import structs

from beamchain.fitting.spec import Spec
from beamchain.fitting.uncertain import Uncertainty
from beamchain.ports.motions import Array

JOINT_LINES = ("stiffness_xy", "stiffness_xz", "stiffness_torsion")


@dataclass(frozen=True)
class StructuralQuantity:
    """One number of a structure that is drawn.

    Args:
        name: `segment1.stiffness`, `joint2.stiffness_xz`, `lump1.mass`, `payload.mass`.
        unit: of its value; stiffness and density of a segment are factors.
        nominal: its value in the specification.
        uncertainty: how it varies.
        key: what [uncertain] calls it, `joint_stiffness`.
        number: of its element among those of its kind, from 0.
    """

    name: str
    unit: str
    nominal: float
    uncertainty: Uncertainty
    key: str
    number: int


def structural_quantities(spec: Spec) -> tuple[StructuralQuantity, ...]:
    """The numbers of a structure that its [uncertain] draws, in the order of `structural_draw`."""
    given = spec.uncertain
    if given is None:
        return ()
    out: list[StructuralQuantity] = []
    for key, uncertainty in (("stiffness", given.stiffness), ("density", given.density)):
        if uncertainty is not None:
            out += [
                StructuralQuantity(f"segment{i + 1}.{key}", "", 1.0, uncertainty, key, i)
                for i in range(len(spec.segment))
            ]
    if given.joint_stiffness is not None:
        out += [
            StructuralQuantity(
                f"joint{i + 1}.{line}",
                "N m/rad",
                getattr(joint, line),
                given.joint_stiffness,
                "joint_stiffness",
                i,
            )
            for i, joint in enumerate(spec.joint)
            for line in JOINT_LINES
            if getattr(joint, line) is not None
        ]
    if given.lump is not None:
        out += [
            StructuralQuantity(f"lump{i + 1}.mass", "kg", lump.mass, given.lump, "lump", i)
            for i, lump in enumerate(spec.lump)
        ]
    if given.payload is not None and spec.payload is not None:
        mass = spec.payload.mass
        out.append(StructuralQuantity("payload.mass", "kg", mass, given.payload, "payload", 0))
    return tuple(out)


def structural_draw(spec: Spec, seed: int, index: int, owner: str = "") -> Array:
    """`(n,)` values of the structural quantities in sample `index`; arguments as of `varied`."""
    given = spec.uncertain
    if given is None:
        return np.zeros(0)
    segments = len(spec.segment)
    counts = {"stiffness": segments, "density": segments, "payload": 1}
    counts |= {"lump": len(spec.lump), "joint_stiffness": len(spec.joint)}
    scores = given.scores(seed, index, counts, owner)
    return np.array(
        [
            q.uncertainty.value(q.nominal, scores[q.key][q.number])
            for q in structural_quantities(spec)
        ]
    )


def vary_spec(spec: Spec, seed: int, index: int, owner: str = "") -> Spec:
    """The spec of one sample, its structure drawn; refused where a value is not allowed,
    such as a mass below zero.

    `owner`: prefix of the appendage, where a craft has several.
    """
    names = [q.name for q in structural_quantities(spec)]
    draw = structural_draw(spec, seed, index, owner)
    values = dict(zip(names, draw.tolist(), strict=True))
    segments = [
        scaled_segment(
            segment,
            values.get(f"segment{i}.stiffness", 1.0),
            values.get(f"segment{i}.density", 1.0),
        )
        for i, segment in enumerate(spec.segment, 1)
    ]
    joints = [
        structs.replace(
            joint,
            **{
                line: values[f"joint{i}.{line}"]
                for line in JOINT_LINES
                if f"joint{i}.{line}" in values
            },
        )
        for i, joint in enumerate(spec.joint, 1)
    ]
    lumps = [
        _heavier(lump, values.get(f"lump{i}.mass", lump.mass))
        for i, lump in enumerate(spec.lump, 1)
    ]
    changes: dict[str, Any] = {
        "segment": tuple(segments),
        "joint": tuple(joints),
        "lump": tuple(lumps),
    }
    if spec.payload is not None:
        changes["payload"] = _heavier(spec.payload, values.get("payload.mass", spec.payload.mass))
    return structs.replace(spec, **changes)


def _heavier(body: Any, mass: float) -> Any:
    """A lump or payload with another mass, its inertia in proportion."""
    if mass == body.mass:
        return body
    return structs.replace(
        body, mass=mass, inertia=tuple(v * mass / body.mass for v in body.inertia)
    )


def scaled_segment(segment: Any, stiff: float, dense: float) -> Any:
    """A segment with its stiffness and mass per length multiplied."""
    if stiff == 1.0 and dense == 1.0:
        return segment
    changes: dict[str, Any] = {"nonstructural_mass": segment.nonstructural_mass * dense}
    factors = {**dict.fromkeys(_STIFF, stiff), **dict.fromkeys(_HEAVY, dense)}
    for name in ("section", "section_end", "material"):
        part = getattr(segment, name)
        if part is not None:
            held = {n: getattr(part, n) for n in factors if n in part.__struct_fields__}
            changes[name] = structs.replace(
                part, **{n: v * factors[n] for n, v in held.items() if v is not None}
            )
    return structs.replace(segment, **changes)


_STIFF = (
    "bending_stiffness_xy",
    "bending_stiffness_xz",
    "torsion_stiffness",
    "axial_stiffness",
    "youngs_modulus",
    "shear_modulus",
)
_HEAVY = ("linear_mass", "polar_inertia", "density")
