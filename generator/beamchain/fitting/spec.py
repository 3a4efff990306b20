"""SPEC.toml: the appendage, the modes to keep and the needs of the scene; read once,
checked on construction."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import msgspec

from beamchain.checks import Struct, field, of_type, path_of
from beamchain.errors import InputError
from beamchain.fitting.hub import Hub
from beamchain.fitting.options import (
    DEFAULT_MODES,
    Damping,
    FitOptions,
    Modes,
    Payload,
    Port,
    Root,
    Scene,
    Sensors,
    as_modes,
)
from beamchain.fitting.toml_files import convert, read_tables
from beamchain.fitting.uncertain import Uncertain
from beamchain.ports.compare import DEFAULT_RATIO, LEAST_RATIO
from beamchain.ports.model import PortModel
from beamchain.ports.motions import UPRIGHT, Quaternion
from beamchain.structure.beam import Beam
from beamchain.structure.readers.imported import Imported
from beamchain.structure.section import SOFT, soft_modulus
from beamchain.structure.segment import Joint, Lump, Segment, check_carried_body, expand_repeats
from beamchain.structure.slosh import Slosh

#: Shorthands that `replace` and `fit` accept beside the fields.
SHORT = ("hub", "target")
#: Tables that are one object each: its class, and how it is made.
TABLES: dict[str, tuple[type, str]] = {
    "imported": (Imported, 'Imported(file="wing.op4")'),
    "payload": (Payload, "Payload(mass=3.0)"),
    "sensors": (Sensors, "Sensors(modes=True)"),
    "root": (Root, 'Root(target="hub", hub=Hub(...))'),
    "fit": (FitOptions, 'FitOptions(springs="modes")'),
    "scene": (Scene, "Scene(bandwidth=5.0)"),
    "uncertain": (Uncertain, "Uncertain(frequency=...)"),
}


class Spec(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The content of a SPEC.toml.

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> spec.kept
        {'xy': 2, 'xz': 2}
    """

    name: Annotated[str, field("prefix of every body, joint, site and geom: a-z, 0-9 and _")] = (
        "appendage"
    )
    segment: Annotated[
        tuple[Segment, ...], field("parts of the appendage, from the root to the tip")
    ] = ()
    joint: Annotated[tuple[Joint, ...], field("compliant hinge lines between segments")] = ()
    lump: Annotated[tuple[Lump, ...], field("rigid bodies carried along the appendage")] = ()
    imported: Annotated[
        Imported | None, field("modes from a finite-element program, in place of segments")
    ] = None
    slosh: Annotated[Slosh | None, field("the liquid in a tank, in place of segments")] = None
    payload: Annotated[Payload | None, field("body that the scene attaches at the tip")] = None
    port: Annotated[tuple[Port, ...], field("further points at which the chain is exact")] = ()
    sensors: Annotated[Sensors, field("sensors written with the appendage")] = Sensors()
    damping: Annotated[Damping | None, field("damping of the cantilever modes")] = None
    modes: Annotated[
        Modes | None,
        field("modes kept per port; left out, a beam without a bandwidth keeps two in both planes"),
    ] = None
    root: Annotated[
        Root, field("the spacecraft, and the boundary condition at which the modes are exact")
    ] = Root()
    fit: Annotated[FitOptions, field("how the chain is found")] = FitOptions()
    scene: Annotated[
        Scene | None, field("needs of the scene, from which the modes can be chosen")
    ] = None
    uncertain: Annotated[Uncertain | None, field("properties that a sweep varies")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.modes is not None:
            msgspec.structs.force_setattr(self, "modes", as_modes(self.modes))
        if self.damping is not None and not isinstance(self.damping, Damping):
            msgspec.structs.force_setattr(self, "damping", Damping(ratio=self.damping))
        for key, (kind, example) in TABLES.items():
            _check_kind(key, getattr(self, key), kind, example)
        msgspec.structs.force_setattr(self, "segment", expand_repeats(self.segment))
        if not isinstance(self.name, str) or not re.fullmatch(r"[a-z][a-z0-9_]{0,62}", self.name):
            raise InputError(
                f"name = {self.name!r} must start with a small letter and hold only a-z, 0-9 and _ "
                "(at most 63), "
                'because every body is named after it; for example name = "boom".'
            )
        listed = self.damping is not None and isinstance(self.damping.ratio, tuple)
        if self.slosh is not None:
            self._check_slosh()
        elif self.imported is not None:
            self._check_imported()
        elif listed:
            raise InputError(
                "damping.ratio is a list, which is per mode of an imported file; the modes of a "
                "beam are counted by port: ratio = { xy = [0.005, 0.004] }."
            )
        elif not self.segment:
            raise InputError(
                "the spec has no [[segment]]; add at least one with length, section and material, "
                "or an [imported] or [slosh] table."
            )
        if self.root.target == "auto" and not self.chooses:
            raise InputError(
                'root.target = "auto" chooses for a scene; give scene.bandwidth, or target = '
                '"clamped".'
            )
        if self.modes is not None and not self.modes.counts() and not self.chooses:
            raise InputError(
                "[modes] keeps no mode at all; set xy, xz, torsion or axial to 1 or more, or "
                "remove [modes]."
            )
        self._check_points()
        self._check_stiff()

    def replace(self, **changes: Any) -> "Spec":
        """A copy of the specification with some values replaced.

        Args:
            changes: fields by name. `modes` may be a number (for both bending planes) or a mapping
                by port, `damping` a ratio or lists by port. `hub` and `target` replace those of
                `root`. A value of None leaves the field unchanged.

        Raises:
            InputError: a field does not exist, or a value is not allowed.

        Example:
            >>> import beamchain as bc
            >>> panel = bc.Segment(
            ...     length=8.0, section=bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
            ... )
            >>> bc.Spec(segment=(panel,)).replace(modes=3, damping=0.005, name="array").kept
            {'xy': 3, 'xz': 3}
        """
        given = {key: value for key, value in changes.items() if value is not None}
        known = (*self.__struct_fields__, *SHORT)
        for key in given:
            if key not in known:
                raise InputError(
                    f"a specification has no field {key!r}; it has {', '.join(known)}."
                )
        hub = (Hub, "Hub(mass=500.0, inertia=(400.0, 400.0, 500.0))")
        for key, (kind, example) in {**TABLES, "hub": hub}.items():
            _check_kind(key, given.get(key), kind, example)
        if "modes" in given:
            given["modes"] = as_modes(given["modes"])
        if "damping" in given and not isinstance(given["damping"], Damping):
            given["damping"] = Damping(ratio=given["damping"])
        at = {key: given.pop(key) for key in ("hub", "target") if key in given}
        if at:
            given["root"] = msgspec.structs.replace(given.get("root", self.root), **at)
        return msgspec.structs.replace(self, **given) if given else self

    def _check_stiff(self) -> None:
        """A modulus that is a slip of units puts hundreds of modes into a band."""
        for i, segment in enumerate(self.segment):
            material = segment.material
            chosen = self.chooses and self.modes is None
            if chosen and material is not None and material.youngs_modulus < SOFT:
                raise InputError(
                    f"segment[{i}].material: {soft_modulus(material.youngs_modulus)}. For a "
                    "material as soft as that, type the number of modes ([modes] xy = 2) in place "
                    "of scene.bandwidth."
                )

    def _check_points(self) -> None:
        """Check that cuts, ports and sensors are on the appendage."""
        names = [port.name for port in self.port]
        if len(set(names)) != len(names):
            raise InputError(
                f"two ports have the same name ({', '.join(names)}); give each its own."
            )
        if self.is_beam:
            # built once so that what the parts say of each other is checked
            length = self.beam.length
            if self.payload is not None:
                check_carried_body(
                    "payload",
                    self.payload.mass,
                    self.payload.inertia,
                    segments_mass=self.beam.own_mass,
                    length=length,
                )
            for key, x in [
                *((f"fit.cuts[{i}]", x) for i, x in enumerate(self.fit.cuts)),
                *((f"port.{port.name}.x", port.x) for port in self.port),
            ]:
                if x > length * (1.0 - 1e-9) and not (
                    key.startswith("port") and x <= length * (1.0 + 1e-9)
                ):
                    raise InputError(
                        f"{key} = {x!r} m lies beyond the appendage, which is {length!r} m long."
                    )
        if (self.port or self.payload is not None) and self.root.target in ("free", "hub"):
            raise InputError(
                f'root.target = "{self.root.target}" and a further port do not go together: a '
                'second port is exact with the clamped modes; use target = "clamped", or leave '
                "it out."
            )
        if self.sensors.modes and self.fit.springs == "hinges":
            raise InputError(
                'sensors.modes = true reads the tendon of each mode, and fit.springs = "hinges" '
                'leaves none; use fit.springs = "auto", or sensors.modes = false.'
            )
        if self.uncertain is not None:
            self._check_uncertain(self.uncertain)
        for point in self.sensors.points:
            if point not in ("tip", *names):
                raise InputError(
                    f"sensors.points names {point!r}, which is no point of this appendage; choose "
                    f"from {', '.join(['tip', *names])}, or add a [[port]]."
                )

    def _check_uncertain(self, given: Uncertain) -> None:
        """Check that what is uncertain can be varied: modes on tendons, the structure of a beam."""
        if self.imported is not None and given.structural:
            raise InputError(
                f"[uncertain] varies a beam by its {given.structural[0]}, but the appendage "
                f"{self.name!r} is imported modes ({self.imported.file}); give frequency, damping "
                "and participation instead, or the appendage as [[segment]]."
            )
        form = None if self.damping is None else self.damping.form
        for key, value, wanted in (
            ("fit.springs", self.fit.springs, "auto"),
            ("damping.form", form, "modal"),
        ):
            if given.modal and value not in (None, wanted, "modes"):
                raise InputError(
                    f'uncertain modes need a tendon each, which {key} = "{value}" leaves out; use '
                    f'{key} = "{wanted}".'
                )

    @property
    def exact_step(self) -> float:
        """Step for which the written files are exact in time [s]; 0 if they are not."""
        return (None if self.scene is None else self.scene.timestep) or 0.0

    @property
    def integrator(self) -> str:
        """Integrator of scene.xml."""
        return (self.scene or Scene()).integrator

    @property
    def further(self) -> dict[str, float]:
        """x of the further points that must be exact [m]: the ports, and "tip" if it has a payload
        or the scene needs it, and no port stands there."""
        if not self.is_beam:
            return {}
        ports = {port.name: port.x for port in self.port}
        tip = self.payload is not None or (self.scene is not None and self.scene.tip)
        if tip and self.beam.length not in ports.values():
            return {"tip": self.beam.length} | ports
        return ports

    def sites(self, length: float) -> dict[str, float]:
        """x of the sites other than the root's [m]; without a scene there is one at the tip,
        at `length`."""
        if self.slosh is not None:
            return {}
        tip = (
            self.scene is None
            or self.scene.tip
            or self.payload is not None
            or "tip" in self.sensors.points
        )
        return ({"tip": length} if tip else {}) | {port.name: port.x for port in self.port}

    @property
    def is_beam(self) -> bool:
        """Whether the appendage is described as a beam, not by modes or as a liquid."""
        return self.imported is None and self.slosh is None

    @property
    def turn(self) -> Quaternion:
        """Attitude of the appendage's root on its place."""
        return UPRIGHT if self.slosh is None else self.slosh.turn

    def _check_slosh(self) -> None:
        """Check that nothing is given with [slosh] that a liquid does not have."""
        no_beam = "a liquid is no beam"
        reasons = {
            "segment": f"{no_beam}: give the tank a specification of its own",
            "joint": no_beam,
            "lump": no_beam,
            "imported": "one specification is one appendage: give the tank its own",
            "payload": "a liquid carries nothing: put the body on the spacecraft",
            "port": "a liquid carries nothing: put the body on the spacecraft",
            "modes": "the number of pendulums is slosh.modes",
            "damping": "its damping is slosh.ratio",
            "uncertain": "a liquid is not varied: give a tank per value",
        }
        for key, reason in reasons.items():
            if getattr(self, key):
                raise InputError(f"[slosh] and {key} are both given; {reason}, and remove {key}.")
        if self.root.target not in (None, "clamped"):
            raise InputError(
                f'root.target = "{self.root.target}" and [slosh] do not go together: pendulums are '
                'exact on any spacecraft; use target = "clamped", or leave it out.'
            )
        if self.fit != FitOptions():
            raise InputError(
                "[fit] and [slosh] do not go together: pendulums have neither springs nor cuts; "
                "remove [fit]."
            )
        if self.sensors.modes or self.sensors.points:
            raise InputError(
                "[sensors] of a liquid may hold root_load alone: its pendulums have no tendons and "
                "no points; remove modes and points."
            )
        if self.scene is not None and (self.scene.tip or self.scene.contacts):
            raise InputError(
                "scene.tip and scene.contacts need an appendage with a tip, which a liquid is not; "
                "remove them."
            )

    def _check_imported(self) -> None:
        """Check that the fields given with [imported] need no beam."""
        for key in ("segment", "joint", "lump", "payload", "port"):
            if getattr(self, key):
                raise InputError(
                    f"[imported] and {key} are both given; modes from a file replace the beam: "
                    f"remove {key}"
                    + (
                        ", or put the payload into the finite-element model."
                        if key == "payload"
                        else "."
                    )
                )

    @property
    def beam(self) -> Beam:
        """The elastic appendage; refused where the modes are imported, so that there is no beam."""
        if self.slosh is not None:
            raise InputError(
                f"the appendage {self.name!r} is the liquid in a tank, but this needs a beam; give "
                "an appendage with [[segment]]."
            )
        if self.imported is not None:
            raise InputError(
                f"the appendage {self.name!r} is imported modes ({self.imported.file}), but this "
                "needs a beam; give it as [[segment]] instead."
            )
        return Beam(segments=self.segment, joints=self.joint, lumps=self.lump)

    def with_ratios(self, port: str, model: PortModel) -> PortModel:
        """A port's model with the specified damping ratios in its cantilever modes;
        unchanged if there are none."""
        return (
            model
            if self.damping is None or isinstance(self.damping.ratio, tuple)
            else model.replaced(damping=self.damping.ratios(port, model.modes))
        )

    @property
    def undamped_ratio(self) -> float:
        """Damping ratio at which errors compare a mode without damping: 0.5 % where none is stated,
        the least ratio where damping is stated and is zero there."""
        return DEFAULT_RATIO if self.damping is None and self.slosh is None else LEAST_RATIO

    @property
    def chooses(self) -> bool:
        """Whether the modes are chosen for the scene."""
        return self.scene is not None and self.scene.bandwidth is not None

    @property
    def kept(self) -> dict[str, int]:
        """Modes kept per port, if they are not chosen for the scene;
        empty means all imported modes."""
        if self.slosh is not None or (self.imported is not None and self.modes is None):
            return {}
        default = Modes(xy=DEFAULT_MODES, xz=DEFAULT_MODES)
        return (self.modes or default).counts()

    @property
    def unsaid(self) -> tuple[str, ...]:
        """The bending plane that is rigid only because [modes] does not mention it;
        `xz = 0` states that this is intended."""
        if self.modes is None or self.chooses or not self.is_beam:
            return ()
        given = self.modes.given()
        planes = [port for port in ("xy", "xz") if given.get(port)]
        return tuple(port for port in ("xy", "xz") if port not in given) if planes else ()


def _check_kind(key: str, value: object, kind: type, example: str) -> None:
    """What is given for a table is an object of its class."""
    if value is not None:
        of_type(key, value, kind, f"a {kind.__name__}: {example}")


def read_spec(path: str | Path) -> Spec:
    """Read and check a SPEC.toml.

    Args:
        path: path of the file.

    Raises:
        InputError: the file cannot be read or is not TOML, or a value is not allowed;
            the message names the field.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> bc.read_spec(files("beamchain") / "examples" / "seed_boom.toml").name
        'boom'
    """
    path = path_of("spec", path, "a Spec, or the path of a SPEC.toml file")
    spec = spec_from_dict(read_tables(path, "spec", "a SPEC.toml file"), str(path))
    if spec.imported is None:
        return spec
    return msgspec.structs.replace(spec, imported=spec.imported.beside(path.parent))


def spec_from_dict(data: Mapping[str, Any], source: str = "spec") -> Spec:
    """A checked `Spec` from parsed TOML, given as `data`; errors name the `source`."""
    return convert(data, Spec, source)


def schema() -> dict[str, Any]:
    """JSON schema of SPEC.toml, with text, unit, bounds and default of every field."""
    out = msgspec.json.schema(Spec)
    for table in out["$defs"].values():
        table["description"] = table.get("description", "").split("\n\n")[0]
    return out
