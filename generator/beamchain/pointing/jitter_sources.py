"""What disturbs a spacecraft's pointing, as a file states it: wheels, stepping drives, random
inputs, thermal snap."""

from itertools import pairwise
from pathlib import Path
from types import UnionType
from typing import Annotated, Literal

from beamchain.checks import Struct, field, of_type
from beamchain.errors import InputError
from beamchain.toolkit import read_struct

MOST_ORDERS = 40  # of a wheel's disturbance
MOST_SPEEDS = 10_000
MOST_FREQUENCIES = 10_000  # of a tabulated density


def _check_list(field_name: str, value: object, kind: type | UnionType, holds: str) -> None:
    """Refuse what is no list of the kind; Python's callers are checked by nobody else."""
    if not isinstance(value, tuple) or not all(isinstance(item, kind) for item in value):
        raise InputError(f"{field_name} = {value!r:.60} is no list of {holds}; give {holds} in [].")


class WheelHarmonic(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One order of a wheel's disturbance, whose amplitudes grow with the square of its speed.

    The empirical model of Masterson, Miller and Grogan, J. Sound Vib. 249(3) (2002) 575, doi
    10.1006/jsvi.2001.3868: at the speed Omega a force and a torque of `amplitude Omega^2` turn
    about the wheel's axis at `order Omega`, and a force pulses along it.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import pointing
        >>> cage = pointing.WheelHarmonic(order=2.82, radial_force=3e-8, radial_torque=1e-9)
        >>> cage.axial_force
        0.0
    """

    order: Annotated[
        float,
        field("frequency of the disturbance over that of the wheel's rotation", "", above=0.0),
    ]
    radial_force: Annotated[
        float, field("force normal to the axis over the square of the speed", "kg m", least=0.0)
    ] = 0.0
    radial_torque: Annotated[
        float, field("torque normal to the axis over the square of the speed", "kg m^2", least=0.0)
    ] = 0.0
    axial_force: Annotated[
        float, field("force along the axis over the square of the speed", "kg m", least=0.0)
    ] = 0.0


class WheelDisturbance(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A wheel that turns at any speed of a range, unbalanced.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import pointing
        >>> wheel = pointing.WheelDisturbance(
        ...     joint="rw1", speeds=(10.0, 400.0), static=7e-7, dynamic=2e-8
        ... )
        >>> wheel.orders
        (WheelHarmonic(order=1.0, radial_force=7e-07, radial_torque=2e-08, axial_force=0.0),)
    """

    joint: Annotated[str, field("hinge about which the wheel turns")]
    speeds: Annotated[
        tuple[float, float],
        field("lowest and highest speed; negative: against the axis of the hinge", "rad/s"),
    ]
    static: Annotated[
        float, field("static imbalance, mass times distance from the axis", "kg m", least=0.0)
    ] = 0.0
    dynamic: Annotated[
        float, field("dynamic imbalance, product of inertia with the axis", "kg m^2", least=0.0)
    ] = 0.0
    harmonic: Annotated[
        tuple[WheelHarmonic, ...], field("further orders, one [[wheel.harmonic]] each")
    ] = ()
    count: Annotated[
        int,
        field(
            "number of speeds from lowest to highest; those of resonances are added by themselves",
            "",
            least=2,
            most=MOST_SPEEDS,
        ),
    ] = 200

    def __post_init__(self) -> None:
        super().__post_init__()
        of_type("wheel.joint", self.joint, str, "the name of a hinge")
        _check_list(
            f"harmonic of wheel {self.joint!r}",
            self.harmonic,
            WheelHarmonic,
            "pointing.WheelHarmonic(...)",
        )
        given: object = self.speeds
        if not isinstance(given, tuple) or len(self.speeds) != 2:
            raise InputError(
                f"speeds = {given!r:.60} of wheel {self.joint!r} is no range; give the lowest and "
                "the highest speed in rad/s, speeds = [10.0, 400.0]."
            )
        low, high = self.speeds
        if not low <= high or low == high == 0.0:
            raise InputError(
                f"speeds = [{low:g}, {high:g}] of wheel {self.joint!r} is no range; give the "
                "lowest and the highest speed in rad/s, speeds = [10.0, 400.0]."
            )
        if len(self.harmonic) > MOST_ORDERS:
            raise InputError(
                f"wheel {self.joint!r} has {len(self.harmonic)} harmonics; at most {MOST_ORDERS} "
                "are taken, leave out the smallest."
            )
        if not self.orders:
            raise InputError(
                f"wheel {self.joint!r} disturbs nothing; give static [kg m], dynamic [kg m^2] or "
                "[[wheel.harmonic]]."
            )

    @property
    def orders(self) -> tuple[WheelHarmonic, ...]:
        """What disturbs, each order once: imbalance is of order 1; equal orders add up."""
        imbalance = WheelHarmonic(order=1.0, radial_force=self.static, radial_torque=self.dynamic)
        by_order: dict[float, list[float]] = {}
        for harmonic in (imbalance, *self.harmonic):
            total = by_order.setdefault(harmonic.order, [0.0, 0.0, 0.0])
            total[0] += harmonic.radial_force
            total[1] += harmonic.radial_torque
            total[2] += harmonic.axial_force
        return tuple(
            WheelHarmonic(order=order, radial_force=force, radial_torque=torque, axial_force=axial)
            for order, (force, torque, axial) in by_order.items()
            if force or torque or axial
        )


class StepperDisturbance(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A drive that moves in steps.

    Without `torque` its set point is a staircase: what disturbs is the staircase less the steady
    motion, through the position servo of the joint or, without one, through its spring. With
    `torque` each step is a rectangular pulse of torque between the drive's two bodies, its mean
    left out.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import pointing
        >>> drive = pointing.StepperDisturbance(joint="sada", step=4.4e-4, rate=2.4)
        >>> drive.torque is None
        True
    """

    joint: Annotated[str, field("joint that the drive turns")]
    rate: Annotated[float, field("steps per second", "1/s", above=0.0)]
    step: Annotated[
        float | None, field("step of the set point: rad of a hinge, m of a slide", "", above=0.0)
    ] = None
    torque: Annotated[
        float | None, field("size of a pulse: N m of a hinge, N of a slide", "", above=0.0)
    ] = None
    width: Annotated[float | None, field("length of a pulse of torque", "s", above=0.0)] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        of_type("stepper.joint", self.joint, str, "the name of a joint")
        if (self.step is None) == (self.torque is None) or (self.torque is None) != (
            self.width is None
        ):
            raise InputError(
                f"stepper {self.joint!r} takes either step [rad], or torque [N m] with width [s]; "
                "write for example step = 4.4e-4."
            )
        if self.width is not None and self.width * self.rate >= 1.0:
            raise InputError(
                f"width = {self.width:g} s of stepper {self.joint!r} is not shorter than the time "
                f"between its steps, {1.0 / self.rate:g} s; give a shorter pulse."
            )


class NoiseDisturbance(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A random input, Gaussian and stationary, by its one-sided power spectral density.

    Between its frequencies the density is a straight line in logarithms of both, outside them it is
    zero. Several signals are uncorrelated, each with this density.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import pointing
        >>> friction = pointing.NoiseDisturbance(
        ...     input="torque:bus", frequency=(0.01, 100.0), density=(1e-8, 1e-10)
        ... )
        >>> friction.signals
        ()
    """

    input: Annotated[
        str, field("actuator, `torque:BODY`, `force:BODY` or `wrench:SITE`, as in `bc.plant`")
    ]
    frequency: Annotated[tuple[float, ...], field("frequencies, ascending", "Hz", above=0.0)]
    density: Annotated[
        tuple[float, ...], field("density at each frequency, square of the input's unit per Hz", "")
    ]
    signals: Annotated[
        tuple[str, ...],
        field("labels of those signals of the input that act, such as `torque_z`; all if left out"),
    ] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        of_type("psd.input", self.input, str, "the name of an input")
        _check_list(f"frequency of psd {self.input!r}", self.frequency, float | int, "numbers")
        _check_list(f"density of psd {self.input!r}", self.density, float | int, "numbers")
        _check_list(f"signals of psd {self.input!r}", self.signals, str, "labels")
        count = len(self.frequency)
        if count != len(self.density) or not 2 <= count <= MOST_FREQUENCIES:
            raise InputError(
                f"psd of {self.input!r} has {count} frequencies and {len(self.density)} densities; "
                f"give as many of each, from 2 to {MOST_FREQUENCIES}."
            )
        for before, after in pairwise(self.frequency):
            if not before < after:
                raise InputError(
                    f"frequency of psd {self.input!r} goes from {before:g} to {after:g} Hz; list "
                    "frequencies in ascending order, each once."
                )
        if low := [value for value in self.density if not value > 0.0]:
            raise InputError(
                f"density = {low[0]:g} of psd {self.input!r} is not above zero, and has no "
                "logarithm to interpolate; leave out the frequencies where nothing acts."
            )


class ThermalSnap(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An appendage that bends as it passes from shadow into sunlight, or back.

    Its load is `1 - exp(-t / time_constant)` times that which holds the stated quasi-static
    deformation: `displacement` of the tip in the shape of one of its modes with its root held, or
    a thermal `moment`, uniform along it.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import pointing
        >>> snap = pointing.ThermalSnap(appendage="array_", displacement=0.01, time_constant=20.0)
        >>> snap.port, snap.mode
        ('xy', 1)
    """

    appendage: Annotated[str, field("prefix of the appendage, such as `array_`")]
    time_constant: Annotated[float, field("of the load", "s", above=0.0)]
    port: Annotated[
        Literal["xy", "xz", "torsion"], field("plane in which the appendage bends, or its twist")
    ] = "xy"
    mode: Annotated[
        int, field("number of the mode in its port whose shape it takes", "", least=1, most=1000)
    ] = 1
    displacement: Annotated[
        float | None, field("final displacement of the tip against the root", "m", above=0.0)
    ] = None
    moment: Annotated[
        float | None,
        field("final thermal moment, bending stiffness times thermal curvature", "N m", above=0.0),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        of_type("snap.appendage", self.appendage, str, "the prefix of an appendage")
        if (self.displacement is None) == (self.moment is None):
            raise InputError(
                f"snap of {self.appendage!r} takes either displacement [m] or moment [N m]; write "
                "for example displacement = 0.01."
            )
        if self.displacement is not None and self.port == "torsion":
            raise InputError(
                f"snap of {self.appendage!r}: twist displaces no tip; give moment [N m] with port "
                '= "torsion".'
            )


class Disturbances(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What disturbs a spacecraft's pointing, as a file states it.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import pointing
        >>> wheel = pointing.WheelDisturbance(joint="rw1", speeds=(10.0, 400.0), static=7e-7)
        >>> [name for name, _ in pointing.Disturbances(wheel=(wheel,)).named]
        ['wheel rw1']
    """

    wheel: Annotated[tuple[WheelDisturbance, ...], field("turning wheels, one [[wheel]] each")] = ()
    stepper: Annotated[
        tuple[StepperDisturbance, ...], field("stepping drives, one [[stepper]] each")
    ] = ()
    psd: Annotated[tuple[NoiseDisturbance, ...], field("random inputs, one [[psd]] each")] = ()
    snap: Annotated[tuple[ThermalSnap, ...], field("thermal snaps, one [[snap]] each")] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_list("wheel", self.wheel, WheelDisturbance, "pointing.WheelDisturbance(...)")
        _check_list("stepper", self.stepper, StepperDisturbance, "pointing.StepperDisturbance(...)")
        _check_list("psd", self.psd, NoiseDisturbance, "pointing.NoiseDisturbance(...)")
        _check_list("snap", self.snap, ThermalSnap, "pointing.ThermalSnap(...)")
        if not self.named:
            raise InputError(
                "the disturbances are empty; give at least one [[wheel]], [[stepper]], [[psd]] or "
                "[[snap]]."
            )
        joints = [wheel.joint for wheel in self.wheel]
        for joint in joints:
            if joints.count(joint) > 1:
                raise InputError(
                    f"two [[wheel]] tables are of {joint!r}; write one with all that disturbs."
                )

    @property
    def named(
        self,
    ) -> "tuple[tuple[str, Source], ...]":
        """The sources, each with a name of its own."""
        sources = [
            *((f"wheel {wheel.joint}", wheel) for wheel in self.wheel),
            *((f"stepper {stepper.joint}", stepper) for stepper in self.stepper),
            *((f"psd {psd.input}", psd) for psd in self.psd),
            *((f"snap {snap.appendage}", snap) for snap in self.snap),
        ]
        words = [word for word, _ in sources]
        return tuple(
            (f"{word} {words[: i + 1].count(word)}" if words.count(word) > 1 else word, source)
            for i, (word, source) in enumerate(sources)
        )


Source = WheelDisturbance | StepperDisturbance | NoiseDisturbance | ThermalSnap


def read_disturbances(path: "str | Path | Disturbances") -> Disturbances:
    """The disturbances from TOML; those that were read already are returned."""
    holds = "a TOML file with [[wheel]], [[stepper]], [[psd]] or [[snap]]"
    return read_struct(path, Disturbances, "disturbances", holds)
