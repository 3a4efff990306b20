"""SPEC.toml: the appendage, what to keep of it, and what the scene needs; read once, checked on construction."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from beamchain.checks import not_negative, number, one_of, own_numbers, positive, whole
from beamchain.errors import InputError
from beamchain.files import LARGEST_TOML, tables
from beamchain.fitting.hub import Hub
from beamchain.fitting.hub import port_hub_mass as port_hub_mass
from beamchain.fitting.sentences import sentence
from beamchain.fitting.uncertain import Uncertain
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.beam import Beam
from beamchain.structure.imported import Imported
from beamchain.structure.joint import Joint
from beamchain.structure.lump import Lump, body_inertia, check_carried
from beamchain.structure.segment import Segment

MOST_MODES = 20
RECIPES = ("classical", "midpoint", "naive", "seed")  # of one bending plane
DEFAULT_STEP = 0.01  # of scene.xml and of the bench, where none is stated [s]

Target = Literal["clamped", "free", "hub", "auto"]
Method = Literal["exact", "least_squares", "classical", "midpoint", "naive", "seed"]
Integrator = Literal["Euler", "RK4", "implicit", "implicitfast", "discrete"]
Triple = tuple[float, float, float]


class Payload(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the user's scene will attach at the tip: fitted for, not written.

    Args:
        mass: [kg].
        inertia: principal, about its own centre, which stands at the tip [kg m^2].
    """

    mass: float
    inertia: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        own_numbers(self)
        positive("mass", self.mass, "kg")
        body_inertia("inertia", self.inertia)


class Damping(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Damping ratios of the cantilever modes.

    Args:
        ratio: one for all modes, or a list per port; a list that is too short repeats its last.
        form: "modal": a tendon per mode, exact; "hinge": plain joint damping.
    """

    ratio: float | dict[str, tuple[float, ...]] = 0.0
    form: Literal["modal", "hinge"] = "modal"

    def __post_init__(self) -> None:
        own_numbers(self)
        one_of("form", self.form, ("modal", "hinge"))
        if isinstance(self.ratio, dict):
            for port, values in self.ratio.items():
                one_of("ratio", port, PORTS)
                if not isinstance(values, tuple):
                    raise InputError(f"ratio.{port} = {values!r} must be a list, one per mode; write [{values!r}].")
                for i, value in enumerate(values):
                    _ratio(f"ratio.{port}[{i}]", value)
        else:
            _ratio("ratio", self.ratio)

    def ratios(self, port: str, modes: int) -> Array:
        """`(modes,)` ratios of a port; a list that is too short repeats its last."""
        if not isinstance(self.ratio, dict):
            return np.full(modes, float(self.ratio))
        given = self.ratio.get(port, ())
        return np.array([given[min(k, len(given) - 1)] if given else 0.0 for k in range(modes)])


def _ratio(name: str, value: object) -> None:
    if not_negative(name, value, "") >= 1.0:
        raise InputError(
            f"{name} = {value!r} is not an oscillation; damping ratios lie between 0 and 1 (0.005 is usual)."
        )


class Port(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A further point of the appendage that is exact beside the root, in the ports kept; site `NAME_<name>`.

    Args:
        name: of its site: a-z, 0-9 and _.
        x: from the root [m].
    """

    name: str
    x: float

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z][a-z0-9_]{0,62}", self.name) or self.name in ("root", "tip", "body"):
            raise InputError(
                f"name = {self.name!r} must start with a small letter, hold only a-z, 0-9 and _, and be neither root, tip "
                'nor body; for example name = "camera".'
            )
        positive("x", self.x, "m")


class Sensors(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Sensors written with the appendage, to watch modes, deflection and loads.

    Args:
        modes: amplitude and rate of each mode that has a tendon: `NAME_mode1_xy_amplitude`, `NAME_mode1_xy_rate`.
        points: sites whose place and turn are read, seen from the root: `NAME_tip_place`, `NAME_tip_turn`.
        root_load: force and moment between the appendage and what carries it: `NAME_root_force`, `NAME_root_moment`.
    """

    modes: bool = False
    points: tuple[str, ...] = ()
    root_load: bool = False


class Modes(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Flexible modes kept per port; 0 or absent: left out, rigid (with a scene's bandwidth, absent: chosen).

    Args:
        xy: bending in the plane of x and y.
        xz: bending in the plane of x and z.
        torsion: about x.
        axial: along x.
    """

    xy: int | None = None
    xz: int | None = None
    torsion: int | None = None
    axial: int | None = None

    def __post_init__(self) -> None:
        own_numbers(self)
        for port in PORTS:
            if getattr(self, port) is not None:
                whole(port, getattr(self, port), 0, MOST_MODES)

    def counts(self) -> dict[str, int]:
        """Modes per port, ports that keep none left out."""
        return {port: count for port in PORTS if (count := int(getattr(self, port) or 0)) > 0}

    def given(self) -> dict[str, int]:
        """Ports whose number was stated, 0 included."""
        return {port: int(count) for port in PORTS if (count := getattr(self, port)) is not None}


class Root(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the kept modes are chosen (`target`), and the hub."""

    target: Target | None = None
    hub: Hub | None = None

    def __post_init__(self) -> None:
        own_numbers(self)
        if self.target is not None:
            one_of("target", self.target, ("clamped", "free", "hub", "auto"))


class FitOptions(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the chain is found.

    Args:
        method: "exact", "least_squares", or a recipe to compare with: "classical" (EI N/L, 2 EI N/L at the root),
            "midpoint" (hinges at segment middles), "naive" (EI N/L everywhere), "seed" (the 2008 paper's three links).
        links: how many, or their lengths [m]; only for the methods that leave it open.
        free: what least squares varies.
        springs: "auto": on the hinges where that is exact in all ports, else one tendon per mode; "hinges": on the hinges;
            "modes": a tendon per mode, whose frequency and damping are two numbers of the compiled model.
        cuts: x of hinges that must stand; others are added where the modes need them [m].
        form: "chain", the only one there is.
        timestep: above 0, the written files are exact in time at this step of the scene's integrator [s].
    """

    method: Method = "exact"
    links: int | tuple[float, ...] | None = None
    free: tuple[Literal["stiffness", "lengths", "masses"], ...] = ("stiffness", "lengths", "masses")
    springs: Literal["auto", "hinges", "modes"] = "auto"
    cuts: tuple[float, ...] = ()
    form: Literal["chain", "oscillators"] | None = None
    timestep: float = 0.0

    def __post_init__(self) -> None:
        own_numbers(self)
        one_of("method", self.method, ("exact", "least_squares", "classical", "midpoint", "naive", "seed"))
        one_of("springs", self.springs, ("auto", "hinges", "modes"))
        if self.form is not None:
            one_of("form", self.form, ("chain", "oscillators"))
        if self.form == "oscillators":
            raise InputError(
                'form = "oscillators" is no longer written: a chain with a tendon per mode is exact for any modes, '
                "coupled ones included; leave fit.form out."
            )
        for i, value in enumerate(self.cuts):
            not_negative(f"cuts[{i}]", value, "m")
        if self.method != "exact" and (self.cuts or self.springs != "auto"):
            word = "cuts" if self.cuts else "springs"
            raise InputError(
                f'{word} is for method = "exact", but method = "{self.method}" is asked for; leave fit.{word} out.'
            )
        not_negative("timestep", self.timestep, "s")
        for word in self.free:
            one_of("free", word, ("stiffness", "lengths", "masses"))
        if isinstance(self.links, tuple):
            for i, value in enumerate(self.links):
                positive(f"links[{i}]", value, "m")
        elif self.links is not None:
            whole("links", self.links, 1, 496)
        if self.links is not None and self.method in ("exact", "seed"):
            raise InputError(
                f'links = {self.links!r} is given but method = "{self.method}" fixes the links itself (modes + 1); '
                'remove links, or use method = "least_squares".'
            )


class Scene(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the scene needs; what it does not need is left out.

    Args:
        bandwidth: frequencies that matter end here [rad/s]; with it, and no modes stated, modes are chosen.
        tolerance: of the hub's in-band motion, relative.
        axes: hub motions that matter: rotations "x" "y" "z", translations "tx" "ty" "tz".
        tip: the tip's motion matters too, and the tip site is written.
        visuals: write massless shapes.
        contacts: write shapes that other things may touch.
        integrator: MuJoCo's name; "auto": Euler where it turns the spacecraft at `rates` within the tolerance, else RK4.
        rates: largest rates of the spacecraft about its own axes, at once [rad/s].
        timestep: [s]; where it is stated, the written files are exact in time for it. 0.01 where left out.
    """

    bandwidth: float | None = None
    tolerance: float = 1e-3
    axes: tuple[Literal["x", "y", "z", "tx", "ty", "tz"], ...] = ("x", "y", "z", "tx", "ty", "tz")
    tip: bool = False
    visuals: bool = True
    contacts: bool = False
    integrator: Integrator | Literal["auto"] = "implicitfast"
    rates: tuple[float, float, float] | None = None
    timestep: float | None = None

    @property
    def step(self) -> float:
        """Of scene.xml and of the bench [s]."""
        return DEFAULT_STEP if self.timestep is None else self.timestep

    def __post_init__(self) -> None:
        own_numbers(self)
        if self.bandwidth is not None:
            positive("bandwidth", self.bandwidth, "rad/s")
        positive("tolerance", self.tolerance, "")
        if self.timestep is not None:
            positive("timestep", self.timestep, "s")
        one_of("integrator", self.integrator, ("auto", "Euler", "RK4", "implicit", "implicitfast", "discrete"))
        for i, rate in enumerate(self.rates or ()):
            number(f"rates[{i}]", rate, "rad/s")
        if self.integrator == "auto" and (self.rates is None or self.timestep is None):
            missing = "rates" if self.rates is None else "timestep"
            raise InputError(
                f'integrator = "auto" chooses by what a step does to the turning spacecraft, and {missing} is not given; '
                "add it, for example rates = [0.01, 0.0, 0.02] and timestep = 0.05, or name an integrator."
            )
        if not self.axes:
            raise InputError(
                "axes = [] leaves no hub motion that matters; name some of x y z tx ty tz, or leave axes out."
            )
        for axis in self.axes:
            one_of("axes", axis, ("x", "y", "z", "tx", "ty", "tz"))


class Spec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A whole SPEC.toml. Lengths in m, masses in kg, frequencies in rad/s.

    Args:
        name: prefix of every body, joint, site and geom: a-z, 0-9 and _.
        segment: stretches of the appendage, root first.
        joint: compliant hinge lines between them.
        lump: rigid bodies carried along.
        imported: modes somebody else computed, instead of segments.
        payload: what the scene attaches at the tip.
        port: further points that are exact beside the root.
        sensors: that are written with the appendage.
        damping: of the cantilever modes.
        modes: kept per port.
        root: target and hub.
        fit: method and its settings.
        scene: what the scene needs.
        uncertain: what `beamchain sweep` varies.
    """

    name: str = "appendage"
    segment: tuple[Segment, ...] = ()
    joint: tuple[Joint, ...] = ()
    lump: tuple[Lump, ...] = ()
    imported: Imported | None = None
    payload: Payload | None = None
    port: tuple[Port, ...] = ()
    sensors: Sensors = Sensors()
    damping: Damping | None = None
    modes: Modes | None = None
    root: Root = Root()
    fit: FitOptions = FitOptions()
    scene: Scene | None = None
    uncertain: Uncertain | None = None

    def __post_init__(self) -> None:
        own_numbers(self)
        if not re.fullmatch(r"[a-z][a-z0-9_]{0,62}", self.name):
            raise InputError(
                f"name = {self.name!r} must start with a small letter and hold only a-z, 0-9 and _ (at most 63), "
                'because every body is named after it; for example name = "boom".'
            )
        if self.imported is not None:
            self._check_imported()
        elif not self.segment:
            raise InputError(
                "the spec has no [[segment]]; add at least one with length, section and material, or an [imported] "
                "table."
            )
        if self.root.target == "auto" and not self.chooses:
            raise InputError('root.target = "auto" chooses for a scene; give scene.bandwidth, or target = "clamped".')
        typed = None if self.scene is None else self.scene.timestep
        if self.scene is not None and self.fit.timestep > 0.0 and typed is not None and self.fit.timestep != typed:
            raise InputError(
                f"fit.timestep = {self.fit.timestep!r} and scene.timestep = {self.scene.timestep!r} differ; "
                "the chain is right at one step only: give the same, or leave fit.timestep out."
            )
        if self.modes is not None and not self.modes.counts() and not self.chooses:
            raise InputError(
                "[modes] keeps no mode at all; set xy, xz, torsion or axial to 1 or more, or remove [modes]."
            )
        self._check_points()

    def _check_points(self) -> None:
        """Cuts, ports and sensors stand on the appendage."""
        names = [port.name for port in self.port]
        if len(set(names)) != len(names):
            raise InputError(f"two ports have the same name ({', '.join(names)}); give each its own.")
        if self.imported is None:
            length = self.beam.length  # built once so that what the parts say of each other is checked
            if self.payload is not None:
                check_carried("payload", self.payload.mass, self.payload.inertia, self.beam.own_mass, length)
            for key, x in [*((f"fit.cuts[{i}]", x) for i, x in enumerate(self.fit.cuts)),
                           *((f"port.{port.name}.x", port.x) for port in self.port)]:  # fmt: skip
                if x > length * (1.0 - 1e-9) and not (key.startswith("port") and x <= length * (1.0 + 1e-9)):
                    raise InputError(f"{key} = {x!r} m lies beyond the appendage, which is {length!r} m long.")
        if self.port or self.payload is not None:
            if self.root.target in ("free", "hub"):
                raise InputError(
                    f'root.target = "{self.root.target}" and a further port do not go together: a second port is exact with '
                    'the clamped modes; use target = "clamped", or leave it out.'
                )
            if self.port and self.fit.method != "exact":
                raise InputError(f'[[port]] needs method = "exact", not "{self.fit.method}"; leave fit.method out.')
        if self.sensors.modes and self.fit.springs == "hinges":
            raise InputError(
                'sensors.modes = true reads the tendon of each mode, and fit.springs = "hinges" leaves none; use '
                'fit.springs = "auto", or sensors.modes = false.'
            )
        for point in self.sensors.points:
            if point not in ("tip", *names):
                raise InputError(
                    f"sensors.points names {point!r}, which is no point of this appendage; choose from "
                    f"{', '.join(['tip', *names])}, or add a [[port]]."
                )

    @property
    def exact_step(self) -> float:
        """Step for which the written files are exact in time [s]; 0: for none."""
        typed = None if self.scene is None else self.scene.timestep
        return self.fit.timestep or typed or 0.0

    @property
    def integrator(self) -> str:
        """Of scene.xml."""
        return (self.scene or Scene()).integrator

    @property
    def further(self) -> dict[str, float]:
        """x of the points beside the root that must be exact: "tip" where a payload hangs there or it matters [m]."""
        if self.imported is not None or self.fit.method != "exact":
            return {}
        tip = self.payload is not None or (self.scene is not None and self.scene.tip)
        return ({"tip": self.beam.length} if tip else {}) | {port.name: port.x for port in self.port}

    def sites(self, length: float) -> dict[str, float]:
        """x of the sites beside the root's [m]; without a scene the tip, at `length`, has one."""
        tip = self.scene is None or self.scene.tip or self.payload is not None or "tip" in self.sensors.points
        return ({"tip": length} if tip else {}) | {port.name: port.x for port in self.port}

    def _check_imported(self) -> None:
        """What stands beside [imported] must make sense without a beam."""
        for key in ("segment", "joint", "lump", "payload", "port"):
            if getattr(self, key):
                raise InputError(
                    f"[imported] and {key} are both given; modes from a file replace the beam: remove {key}"
                    + (", or put the payload into the finite-element model." if key == "payload" else ".")
                )
        if self.fit.method != "exact":
            raise InputError(
                f'method = "{self.fit.method}" needs a beam, but the modes are imported; leave fit.method out.'
            )

    @property
    def beam(self) -> Beam:
        """The elastic appendage.

        Raises:
            InputError: the modes are imported, so that there is no beam.
        """
        if self.imported is not None:
            raise InputError(
                f"the appendage {self.name!r} is imported modes ({self.imported.file}), but this needs a beam; give it "
                "as [[segment]] instead."
            )
        return Beam(segments=self.segment, joints=self.joint, lumps=self.lump)

    def with_ratios(self, port: str, model: PortModel) -> PortModel:
        """A port's model with the damping ratios wanted in its cantilever modes; as it is where none are stated."""
        return model if self.damping is None else model.replaced(damping=self.damping.ratios(port, model.modes))

    @property
    def chooses(self) -> bool:
        """Whether the scene decides which modes are kept."""
        return self.scene is not None and self.scene.bandwidth is not None and self.fit.method == "exact"

    @property
    def kept(self) -> dict[str, int]:
        """Modes kept per port, where the scene does not decide; empty: all that were imported."""
        if self.imported is not None and self.modes is None:
            return {}
        default = Modes(xy=2) if self.fit.method in RECIPES else Modes(xy=2, xz=2)
        return (self.modes or default).counts()

    @property
    def unsaid(self) -> tuple[str, ...]:
        """The plane that is rigid only because [modes] names the other one alone; `xz = 0` says that it shall be."""
        if self.modes is None or self.chooses or self.imported is not None or self.fit.method in RECIPES:
            return ()
        given = self.modes.given()
        planes = [port for port in ("xy", "xz") if given.get(port)]
        return tuple(port for port in ("xy", "xz") if port not in given) if planes else ()


def read_spec(path: str | Path) -> Spec:
    """Read and check a SPEC.toml.

    Args:
        path: of the file.

    Raises:
        InputError: the file cannot be read, is no TOML, or a value is not allowed; the message names the place.
    """
    spec = spec_from_dict(_read_toml(Path(path)), str(path))
    if spec.imported is None:
        return spec
    return msgspec.structs.replace(spec, imported=spec.imported.beside(Path(path).parent))


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        if not path.is_file():
            kind = "is a folder" if path.is_dir() else "does not exist" if not path.exists() else "is no regular file"
            raise InputError(f"spec {str(path)!r} {kind}; give the path of a SPEC.toml file.")
        size = path.stat().st_size
        if size > LARGEST_TOML:
            raise InputError(
                f"spec {str(path)!r} has {size} bytes, more than the {LARGEST_TOML} taken; a spec is a page of text."
            )
        content = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"spec {str(path)!r} is not UTF-8 text ({error.reason} at byte {error.start}); save it as UTF-8."
        ) from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"spec {str(path)!r} cannot be read ({error}); check the path and its permissions.") from None
    try:
        return tables(content)
    except ValueError as error:
        raise InputError(f"spec {str(path)!r} is not TOML: {error}. Strings need quotes, tables [brackets].") from None
    except RecursionError:
        raise InputError(f"spec {str(path)!r} is nested too deeply to be a spec; flatten its tables.") from None


def spec_from_dict(data: Mapping[str, Any], source: str = "spec") -> Spec:
    """A checked `Spec` from the parsed TOML."""
    try:
        return msgspec.convert(data, Spec)
    except msgspec.ValidationError as error:
        raise InputError(f"{source}: {sentence(str(error), data, Spec)}") from None
    except RecursionError:
        raise InputError(f"{source}: nested too deeply to be a spec; flatten its tables.") from None


def schema() -> dict[str, Any]:
    """JSON schema of SPEC.toml."""
    return msgspec.json.schema(Spec)


def finite_or_none(value: float) -> float | None:
    """A number as JSON can hold it: infinity becomes null (no limit)."""
    return float(value) if math.isfinite(value) else None
