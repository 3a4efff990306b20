"""The tables of a specification beside the structure itself: damping, modes, root, method, scene, points, sensors."""

import re
from collections.abc import Mapping
from numbers import Integral
from typing import Literal

import numpy as np

from beamchain.checks import Struct, not_negative, number, one_of, own_numbers, positive, whole
from beamchain.errors import InputError
from beamchain.fitting.hub import Hub
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.segment import body_inertia

MOST_MODES = 20
RECIPES = ("classical", "midpoint", "naive", "seed")  # of one bending plane
DEFAULT_STEP = 0.01  # of scene.xml and of the bench, where none is stated [s]

Target = Literal["clamped", "free", "hub", "auto"]
Method = Literal["exact", "least_squares", "classical", "midpoint", "naive", "seed"]
Integrator = Literal["Euler", "RK4", "implicit", "implicitfast", "discrete"]
Triple = tuple[float, float, float]


class Payload(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The body that the user's scene will attach at the tip: the fit allows for it, but it is not in the files.

    Args:
        mass: [kg].
        inertia: principal moments about its own centre, which is at the tip [kg m^2].
    """

    mass: float
    inertia: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        own_numbers(self)
        positive("mass", self.mass, "kg")
        body_inertia("inertia", self.inertia)


class Damping(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Damping ratios of the cantilever modes.

    Args:
        ratio: one number for all modes, or a list per port; the last value of a short list applies to all further modes.
        form: "modal": a tendon per mode, exact; "hinge": plain joint damping, approximate.
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
        """`(modes,)` ratios of a port; the last value of a short list applies to all further modes."""
        if not isinstance(self.ratio, dict):
            return np.full(modes, float(self.ratio))
        given = self.ratio.get(port, ())
        return np.array([given[min(k, len(given) - 1)] if given else 0.0 for k in range(modes)])


def _ratio(name: str, value: object) -> None:
    if not_negative(name, value, "") >= 1.0:
        raise InputError(
            f"{name} = {value!r} is not an oscillation; damping ratios lie between 0 and 1 (0.005 is usual)."
        )


class Port(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A further point at which the chain is exact, in the ports that are kept; its site is `NAME_<name>`.

    Args:
        name: part of the name of its site: a-z, 0-9 and _.
        x: distance from the root [m].
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


class Sensors(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Sensors written with the appendage, for modes, deflections and loads.

    Args:
        modes: amplitude and rate of each mode that has a tendon: `NAME_mode1_xy_amplitude`, `NAME_mode1_xy_rate`.
        points: sites whose position and rotation relative to the root are measured: `NAME_tip_place`, `NAME_tip_turn`.
        root_load: force and moment between the appendage and the spacecraft: `NAME_root_force`, `NAME_root_moment`.
    """

    modes: bool = False
    points: tuple[str, ...] = ()
    root_load: bool = False


class Modes(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Flexible modes kept per port. A port that is 0 or absent is rigid; with a scene's bandwidth, absent means chosen.

    Args:
        xy: bending modes in the plane of x and y.
        xz: bending modes in the plane of x and z.
        torsion: modes about x.
        axial: modes along x.
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
        f'modes = {given!r:.60} is a {type(given).__name__}; give a number for both planes, or modes={{"xy": 2, "xz": 0}}.'
    )


class Root(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The spacecraft (`hub`), and in which state the kept modes are exact (`target`)."""

    target: Target | None = None
    hub: Hub | None = None

    def __post_init__(self) -> None:
        own_numbers(self)
        if self.target is not None:
            one_of("target", self.target, ("clamped", "free", "hub", "auto"))


class FitOptions(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the chain is found.

    Args:
        method: "exact", "least_squares", or a recipe to compare with: "classical" (EI N/L, 2 EI N/L at the root),
            "midpoint" (hinges at segment middles), "naive" (EI N/L everywhere), "seed" (the 2008 paper's three links).
        links: number of links, or their lengths [m]; only for methods that do not fix the links themselves.
        free: quantities varied by least squares.
        springs: "auto": on the hinges if that is exact in all ports, otherwise one tendon per mode; "hinges": on the
            hinges; "modes": a tendon per mode, whose frequency and damping are two numbers of the compiled model.
        cuts: x of hinges at prescribed places; others are added if the modes need them [m].
        form: "chain", the only form.
        timestep: if above 0, the written files are exact in time at this step of the scene's integrator [s].
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


class Scene(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the scene needs; modes and sites it does not need are left out.

    Args:
        bandwidth: highest frequency that matters [rad/s]; if it is given and [modes] is not, the modes are chosen.
        tolerance: largest relative error of the hub's motion within the bandwidth.
        axes: hub motions that matter: rotations "x" "y" "z", translations "tx" "ty" "tz".
        tip: the tip's motion matters too, and the tip site is written.
        visuals: write massless shapes.
        contacts: write shapes that can touch other bodies.
        integrator: MuJoCo's name, or "auto": Euler if it turns the spacecraft at `rates` within the tolerance, else RK4.
        rates: largest rates of the spacecraft about its own axes, occurring together [rad/s].
        timestep: [s]; if it is given, the written files are exact in time for it. Default: 0.01.
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
