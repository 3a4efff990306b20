"""A specification with numbers of its structure drawn, and its fit on the nominal cut."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from msgspec import structs

from beamchain.chain.links import raise_polar_inertia
from beamchain.errors import RealisationError
from beamchain.fitting.body import body_of
from beamchain.fitting.fit import LEAST_INERTIA
from beamchain.fitting.quantity import Quantity
from beamchain.fitting.realise import chain_of
from beamchain.fitting.result import Fit
from beamchain.fitting.select import select
from beamchain.fitting.spec import Spec
from beamchain.fitting.uncertain import Uncertainty

JOINT_LINES = ("stiffness_xy", "stiffness_xz", "stiffness_torsion")


def structural_quantities(spec: Spec, prefix: str = "", owner: str = "") -> tuple[Quantity, ...]:
    """The numbers of a structure that its [uncertain] draws: `segment1.stiffness`,
    `joint2.stiffness_xz`, `lump1.mass`, `payload.mass`; stiffness and density of a segment are
    factors.

    `prefix`: of the names; appendages with another `owner` draw apart but for what is in a group.
    """
    given = spec.uncertain
    if given is None:
        return ()
    out: list[Quantity] = []

    def add(name: str, unit: str, nominal: float, how: str, number: int) -> None:
        uncertainty: Uncertainty = getattr(given, how)
        key = f"{owner}{how}{number}" if uncertainty.each else uncertainty.group or owner + how
        out.append(Quantity(prefix + name, unit, nominal, uncertainty, index=-1, key=key))

    for how in ("stiffness", "density"):
        for i in range(len(spec.segment) if getattr(given, how) is not None else 0):
            add(f"segment{i + 1}.{how}", "", 1.0, how, i)
    for i, joint in enumerate(spec.joint if given.joint_stiffness is not None else ()):
        for line in JOINT_LINES:
            if getattr(joint, line) is not None:
                add(f"joint{i + 1}.{line}", "N m/rad", getattr(joint, line), "joint_stiffness", i)
    for i, lump in enumerate(spec.lump if given.lump is not None else ()):
        add(f"lump{i + 1}.mass", "kg", lump.mass, "lump", i)
    if given.payload is not None and spec.payload is not None:
        add("payload.mass", "kg", spec.payload.mass, "payload", 0)
    return tuple(out)


def varied_fit(fit: Fit, draw: Sequence[float]) -> Fit:
    """A fit whose specification states its modes, with the values of its structural quantities
    drawn, on the same cut."""
    spec = vary_spec(fit.spec, draw)
    body = body_of(spec)
    built, _ = chain_of(body, select(body), fit.cut)
    for port, target in built.targets.items():
        if target.modes < fit.target[port].modes:
            raise RealisationError(f"fewer modes in {port}: {' '.join(built.missing)}")
    return replace(fit, spec=spec, chain=raise_polar_inertia(built.chain, LEAST_INERTIA)[0])


def vary_spec(spec: Spec, draw: Sequence[float]) -> Spec:
    """A specification with the values of its structural quantities; refused where one is not
    allowed, such as a mass below zero."""
    names = [q.name for q in structural_quantities(spec)]
    values = dict(zip(names, map(float, draw), strict=True))
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
