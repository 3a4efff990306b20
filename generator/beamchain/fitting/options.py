"""The tables of a specification beside the structure itself: damping, modes, root, fit, scene,
points, sensors."""

import re
from collections.abc import Mapping
from numbers import Integral
from typing import Annotated, Literal

import msgspec
import numpy as np

from beamchain.checks import Struct, field, kind_of, not_negative, one_of
from beamchain.errors import InputError
from beamchain.fitting.hub import Hub
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.segment import check_body_inertia

DEFAULT_MODES = 2  # of each bending plane, where a specification says nothing
DEFAULT_STEP = 0.01  # of scene.xml and of the bench, where none is stated [s]

Target = Literal["clamped", "free", "hub", "auto"]
Integrator = Literal["Euler", "RK4", "implicit", "implicitfast", "discrete"]
VISUALS = ("skin", "boxes")
Triple = tuple[float, float, float]


class Payload(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The body that the user's scene will attach at the tip: the fit allows for it,
    but it is not in the files.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.Payload(mass=12.0, inertia=(0.3, 0.2, 0.2)).mass
        12.0
    """

    mass: Annotated[float, field("mass", "kg", above=0.0)]
    inertia: Annotated[
        Triple,
        field(
            "principal moments of inertia about its own centre, which is at the tip",
            "kg m^2",
            least=0.0,
        ),
    ] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_body_inertia("inertia", self.inertia)


class Damping(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Damping of the cantilever modes.

    Example:
        >>> import beamchain as bc
        >>> bc.Damping(ratio={"xy": (0.005, 0.004)}).ratios("xy", 3)
        array([0.005, 0.004, 0.004])
    """

    ratio: Annotated[
        float | tuple[float, ...] | dict[str, tuple[float, ...]],
        field(
            "damping ratio: a number for all modes, { xy = [0.005, 0.004] } by port, or of an "
            "imported file [0.005, 0.004] by mode; the last value applies to all further modes"
        ),
    ] = 0.0
    form: Annotated[
        Literal["modal", "hinge"],
        field('"modal": a tendon per mode, exact; "hinge": plain joint damping, approximate'),
    ] = "modal"

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.ratio, list):
            msgspec.structs.force_setattr(self, "ratio", tuple(self.ratio))
        if isinstance(self.ratio, tuple):
            if not self.ratio:
                raise InputError("ratio = [] holds no value; give one per mode of the file.")
            for i, value in enumerate(self.ratio):
                _ratio(f"ratio[{i}]", value)
        elif isinstance(self.ratio, dict):
            for port, values in self.ratio.items():
                one_of("ratio", port, PORTS)
                if not isinstance(values, tuple):
                    raise InputError(
                        f"ratio.{port} = {values!r} must be a list, one per mode; write "
                        f"[{values!r}]."
                    )
                for i, value in enumerate(values):
                    _ratio(f"ratio.{port}[{i}]", value)
        else:
            _ratio("ratio", self.ratio)

    def ratios(self, port: str, modes: int) -> Array:
        """`(modes,)` ratios of a port, or of all modes of a file where they are listed by mode; the
        last value of a short list applies to all further modes."""
        if isinstance(self.ratio, float | int):
            return np.full(modes, float(self.ratio))
        given = self.ratio.get(port, ()) if isinstance(self.ratio, dict) else self.ratio
        return np.array([given[min(k, len(given) - 1)] if given else 0.0 for k in range(modes)])


def _ratio(name: str, value: object) -> None:
    if not_negative(name, value, "") >= 1.0:
        raise InputError(
            f"{name} = {value!r} is not an oscillation; damping ratios lie between 0 and 1 (0.005 "
            "is usual)."
        )


class Port(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A further point at which the chain is exact, in the ports that are kept;
    its site is `NAME_<name>`.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.Port(name="elbow", x=4.0, carries=("forearm",)).carries
        ('forearm',)
    """

    name: Annotated[str, field("part of the name of its site: a-z, 0-9 and _")]
    x: Annotated[float, field("distance from the root", "m", above=0.0)]
    carries: Annotated[
        tuple[str, ...], field("bodies of the spacecraft that `embed` hangs on it, by name")
    ] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not re.fullmatch(r"[a-z][a-z0-9_]{0,62}", self.name) or self.name in (
            "root",
            "tip",
            "body",
        ):
            raise InputError(
                f"name = {self.name!r} must start with a small letter, hold only a-z, 0-9 and _, "
                "and be neither root, tip "
                'nor body; for example name = "camera".'
            )


class Sensors(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Sensors written with the appendage, for modes, deflections and loads.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.Sensors(modes=True, points=("tip",)).root_load
        False
    """

    modes: Annotated[
        bool, field("amplitude and rate of each mode: NAME_mode1_xy_amplitude, NAME_mode1_xy_rate")
    ] = False
    points: Annotated[
        tuple[str, ...],
        field(
            "sites whose position and rotation relative to the root are measured: NAME_tip_place, "
            "NAME_tip_turn"
        ),
    ] = ()
    root_load: Annotated[
        bool,
        field(
            "force and moment between appendage and spacecraft: NAME_root_force, NAME_root_moment"
        ),
    ] = False


class Modes(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Flexible modes kept per port. A port that is 0 or absent is rigid; with a scene's bandwidth,
    absent means chosen.

    Example:
        >>> import beamchain as bc
        >>> bc.Modes(xy=2, xz=0, torsion=1).counts()
        {'xy': 2, 'torsion': 1}
    """

    xy: Annotated[
        int | None, field("number of bending modes in the plane of x and y", "", least=0, most=20)
    ] = None
    xz: Annotated[
        int | None, field("number of bending modes in the plane of x and z", "", least=0, most=20)
    ] = None
    torsion: Annotated[
        int | None, field("number of torsional modes about x", "", least=0, most=20)
    ] = None
    axial: Annotated[int | None, field("number of modes along x", "", least=0, most=20)] = None

    def counts(self) -> dict[str, int]:
        """Modes per port, without the ports that keep none."""
        return {port: count for port in PORTS if (count := int(getattr(self, port) or 0)) > 0}

    def given(self) -> dict[str, int]:
        """Ports whose number was stated, 0 included."""
        return {port: int(count) for port in PORTS if (count := getattr(self, port)) is not None}


def as_modes(given: object) -> Modes:
    """Modes per port from a number (for both bending planes), a mapping by port, or `Modes`."""
    if isinstance(given, Modes):
        return given
    if isinstance(given, Mapping):
        unknown = sorted(set(map(str, given)) - set(PORTS))
        if unknown:
            raise InputError(f"modes: unknown port {unknown[0]!r}; choose from {', '.join(PORTS)}.")
        return Modes(**given)
    if isinstance(given, Integral) and not isinstance(given, bool):
        return Modes(xy=int(given), xz=int(given))
    raise InputError(
        f"modes = {given!r:.60} is {kind_of(given)}; give a number for both planes, or "
        'modes={"xy": 2, "xz": 0}.'
    )


class Root(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The spacecraft, and the boundary condition at which the kept modes are exact.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.Root(target="hub", hub=bc.Hub(mass=500.0, inertia=(400.0, 400.0, 500.0))).target
        'hub'
    """

    target: Annotated[
        Target | None,
        field(
            "boundary condition of the root at which the kept modes are exact; clamped where left "
            "out"
        ),
    ] = None
    hub: Annotated[Hub | None, field("the rigid spacecraft that carries the appendage")] = None


class FitOptions(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the chain is found.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.FitOptions(springs="modes").springs
        'modes'
    """

    springs: Annotated[
        Literal["auto", "hinges", "modes"],
        field(
            'springs on the hinges, or a tendon per mode; "auto" takes the hinges where that is '
            "exact"
        ),
    ] = "auto"
    cuts: Annotated[
        tuple[float, ...],
        field(
            "x of hinges at prescribed places; others are added if the modes need them",
            "m",
            least=0.0,
        ),
    ] = ()


class Scene(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Requirements of the scene; modes and sites that it does not need are left out.

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> found = bc.fit(spec, scene=bc.Scene(bandwidth=2.0, tolerance=1e-2, axes=("z",)))
        >>> found.promise < 1e-2
        True
    """

    bandwidth: Annotated[
        float | None,
        field(
            "highest frequency that matters; the modes are chosen for it where [modes] is left out",
            "rad/s",
            above=0.0,
        ),
    ] = None
    tolerance: Annotated[
        float, field("largest relative error of the hub motion within the bandwidth", "", above=0.0)
    ] = 1e-3
    axes: Annotated[
        tuple[Literal["x", "y", "z", "tx", "ty", "tz"], ...],
        field("hub motions that matter: rotations x, y, z, translations tx, ty, tz"),
    ] = ("x", "y", "z", "tx", "ty", "tz")
    tip: Annotated[
        bool, field("the motion of the tip matters too, and the tip site is written")
    ] = False
    visuals: Annotated[
        Literal["skin", "boxes"] | bool,
        field(
            'how the appendage is drawn, without mass: "skin", surfaces that bend with the kept '
            'modes (true means the same); "boxes", a rigid shape per link, for hosts that draw no '
            "skins; false, nothing"
        ),
    ] = "skin"
    contacts: Annotated[bool, field("write shapes that can touch other bodies")] = False
    integrator: Annotated[
        Integrator | Literal["auto"],
        field(
            "integrator of the files of `fit`; `embed` follows the spacecraft's own. "
            '"discrete" takes springs implicitly too; "auto" takes Euler if it turns the '
            "spacecraft at the rates within the tolerance, else RK4"
        ),
    ] = "implicitfast"
    rates: Annotated[
        tuple[float, float, float] | None,
        field("largest rates of the spacecraft about its own axes, occurring together", "rad/s"),
    ] = None
    timestep: Annotated[
        float | None,
        field(
            "step of scene.xml, where left out 0.01 or, where that is not well below the limit, "
            "less; if given, the written files are exact in time for it",
            "s",
            above=0.0,
        ),
    ] = None

    @property
    def look(self) -> Literal["skin", "boxes", "nothing"]:
        """How the appendage is drawn, true understood."""
        if isinstance(self.visuals, str):
            return self.visuals
        return "skin" if self.visuals else "nothing"

    @property
    def step(self) -> float:
        """Step of scene.xml and of the test bench [s]."""
        return DEFAULT_STEP if self.timestep is None else self.timestep

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.visuals is True:
            msgspec.structs.force_setattr(self, "visuals", "skin")
        if not isinstance(self.visuals, bool) and self.visuals not in VISUALS:
            raise InputError(
                f'visuals = {self.visuals!r:.60} must be "skin" (surfaces that bend), "boxes" (a '
                "rigid shape per link) or false (nothing is drawn)."
            )
        if self.integrator == "auto" and (self.rates is None or self.timestep is None):
            missing = "rates" if self.rates is None else "timestep"
            raise InputError(
                'integrator = "auto" chooses by what a step does to the turning spacecraft, and '
                f"{missing} is not given; "
                "add it, for example rates = [0.01, 0.0, 0.02] and timestep = 0.05, or name an "
                "integrator."
            )
        if not self.axes:
            raise InputError(
                "axes = [] leaves no hub motion that matters; name some of x y z tx ty tz, or "
                "leave axes out."
            )
