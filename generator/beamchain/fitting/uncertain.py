"""What is not known exactly: [uncertain] of SPEC.toml, the file of a craft's uncertainties,
and numbers drawn from them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal
from zlib import crc32

import msgspec
import numpy as np
from scipy.special import ndtr

from beamchain.checks import Struct, field
from beamchain.errors import InputError
from beamchain.fitting.toml_files import convert, read_struct
from beamchain.ports.motions import Array

CUT = 3.0  # normal draws end here, in standard deviations: a tail would ask for negative stiffness
ONLY_RELATIVE = ("stiffness", "density")
OF_MODES = ("frequency", "damping", "participation")
STRUCTURAL = (*ONLY_RELATIVE, "payload", "lump", "joint_stiffness")
ROUNDING = 1e-9  # by which a correlation matrix may fail to be positive semidefinite


class Uncertainty(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How a quantity varies: `relative` or `absolute`, one of the two.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.Uncertainty(relative=0.1).relative
        0.1
    """

    relative: Annotated[
        float | None,
        field(
            "standard deviation (normal, at most three of them) or half width (uniform) over the "
            "value",
            "",
            above=0.0,
        ),
    ] = None
    absolute: Annotated[
        float | None,
        field(
            "standard deviation (normal, at most three of them) or half width (uniform), in the "
            "unit of the quantity",
            "",
            above=0.0,
        ),
    ] = None
    distribution: Annotated[Literal["normal", "uniform"], field("distribution")] = "normal"
    each: Annotated[
        bool,
        field("every segment, joint, lump or mode draws for itself; else all of them together"),
    ] = False
    group: Annotated[
        str, field("quantities with the same group draw together, fully correlated")
    ] = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.relative is None) == (self.absolute is None):
            raise InputError(
                "an uncertain quantity takes either relative or absolute; write for example { "
                "relative = 0.05 }."
            )
        if self.relative is not None and self.relative >= 1.0:
            raise InputError(
                f"relative = {self.relative!r} would turn the quantity negative; give a fraction "
                "below 1: 10 % is 0.1."
            )
        if self.group and self.each:
            raise InputError(
                f'group = "{self.group}" and each = true contradict each other; leave one out.'
            )

    def value(self, nominal: float, score: Array | float) -> Array:
        """The quantity for draws.

        Args:
            nominal: its value without uncertainty.
            score: standard normal, of every draw.
        """
        normal = self.distribution == "normal"
        reach = np.clip(score, -CUT, CUT) if normal else 2.0 * np.asarray(ndtr(score)) - 1.0
        if self.relative is not None:
            return np.asarray(nominal * (1.0 + self.relative * reach))
        return np.asarray(nominal + reach * (self.absolute or 0.0))

    def reach(self, nominal: float) -> float:
        """How far from the nominal value the quantity may come, in its unit.

        Args:
            nominal: its value without uncertainty.
        """
        size = abs(nominal) * self.relative if self.relative is not None else self.absolute or 0.0
        return size * (CUT if self.distribution == "normal" else 1.0)


class UncertainMode(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is uncertain of one mode; it replaces what is stated for all modes.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.UncertainMode(
        ...     number=2, port="xy", damping=bc.spec.Uncertainty(relative=0.5)
        ... ).name
        'mode2_xy'
    """

    number: Annotated[int, field("number of the mode in its port, from 1", "", least=1, most=1000)]
    port: Annotated[
        Literal["xy", "xz", "torsion", "axial", ""],
        field("its port; left out: number among all kept modes"),
    ] = ""
    frequency: Annotated[Uncertainty | None, field("frequency with the root held [rad/s]")] = None
    damping: Annotated[Uncertainty | None, field("damping ratio")] = None
    participation: Annotated[
        Uncertainty | None, field("participation, by a factor; relative only")
    ] = None

    @property
    def name(self) -> str:
        """That of the mode's tendon, without the prefix."""
        return f"mode{self.number}{f'_{self.port}' if self.port else ''}"


class Correlation(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Correlation of some quantities, which are normal.

    Example:
        >>> import beamchain as bc
        >>> names = ("mode1_xy.frequency", "mode1_xz.frequency")
        >>> bc.spec.Correlation(of=names, matrix=((1.0, 0.8), (0.8, 1.0))).matrix[0][1]
        0.8
    """

    of: Annotated[tuple[str, ...], field("names of the quantities, such as mode1_xy.frequency")]
    matrix: Annotated[
        tuple[tuple[float, ...], ...],
        field("their coefficients of correlation, 1 on the diagonal", ""),
    ]

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.of)
        if (
            n == 0
            or len(self.matrix) != n
            or any(len(row) != n for row in self.matrix)
            or len(set(self.of)) < n
        ):
            raise InputError(
                f"correlation: {n} names in `of` need a {n} x {n} matrix, each name once; it has "
                f"{len(self.matrix)} rows."
            )
        r = np.array(self.matrix)
        low = float(np.linalg.eigvalsh((r + r.T) / 2.0)[0])
        if (
            np.any(np.abs(np.diag(r) - 1.0) > ROUNDING)
            or np.any(np.abs(r - r.T) > ROUNDING)
            or low < -ROUNDING
        ):
            raise InputError(
                f"correlation of {', '.join(self.of)}: the matrix must be symmetric with 1 on its "
                f"diagonal and positive semidefinite; its lowest eigenvalue is {low:.3g}. Divide "
                "the covariance by the standard deviations."
            )


class UncertainModes(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is uncertain of the modes of an appendage in a craft.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.UncertainModes(damping=bc.spec.Uncertainty(relative=0.5)).damping.relative
        0.5
    """

    frequency: Annotated[
        Uncertainty | None, field("frequencies of the modes with the root held [rad/s]")
    ] = None
    damping: Annotated[Uncertainty | None, field("damping ratios of the modes")] = None
    participation: Annotated[
        Uncertainty | None, field("participation of the modes, by a factor; relative only")
    ] = None
    mode: Annotated[tuple[UncertainMode, ...], field("single modes, one [[mode]] each")] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        names = [one.name for one in self.mode]
        for name in names:
            if names.count(name) > 1:
                raise InputError(
                    f"two [[mode]] tables are of {name}; write one with all that is uncertain of "
                    "it."
                )
        for given in (self.participation, *(one.participation for one in self.mode)):
            if given is not None and given.relative is None:
                raise InputError(
                    "participation takes relative only, for it has six elements; write relative = "
                    "0.05."
                )

    @property
    def modal(self) -> bool:
        """Whether anything of a mode is uncertain, so that each needs a tendon."""
        return bool(self.mode) or any(getattr(self, name) is not None for name in OF_MODES)


class UncertainBody(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is uncertain of the mass properties of a body of the craft, in the body's axes.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.UncertainBody(mass=bc.spec.Uncertainty(absolute=5.0)).mass.absolute
        5.0
    """

    mass: Annotated[Uncertainty | None, field("mass [kg]")] = None
    centre_x: Annotated[
        Uncertainty | None, field("place of the mass centre along x [m]; absolute only")
    ] = None
    centre_y: Annotated[Uncertainty | None, field("the same along y [m]; absolute only")] = None
    centre_z: Annotated[Uncertainty | None, field("the same along z [m]; absolute only")] = None
    inertia_xx: Annotated[
        Uncertainty | None, field("moment of inertia about the mass centre [kg m^2]")
    ] = None
    inertia_yy: Annotated[Uncertainty | None, field("the same about y [kg m^2]")] = None
    inertia_zz: Annotated[Uncertainty | None, field("the same about z [kg m^2]")] = None
    inertia_xy: Annotated[
        Uncertainty | None, field("element xy of the inertia matrix [kg m^2]; absolute only")
    ] = None
    inertia_xz: Annotated[Uncertainty | None, field("the same, xz [kg m^2]; absolute only")] = None
    inertia_yz: Annotated[Uncertainty | None, field("the same, yz [kg m^2]; absolute only")] = None


class UncertainJoint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is uncertain of a sprung joint of the craft, such as a drive.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.UncertainJoint(stiffness=bc.spec.Uncertainty(relative=0.2)).stiffness.relative
        0.2
    """

    stiffness: Annotated[Uncertainty | None, field("stiffness [N m/rad]")] = None
    damping: Annotated[Uncertainty | None, field("damping [N m s/rad]")] = None


class UncertainCraft(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The file of a craft's uncertainties; what is left out is certain.

    Example:
        >>> import beamchain as bc
        >>> from beamchain.fitting.uncertain import Uncertainty, UncertainBody, UncertainCraft
        >>> UncertainCraft(body={"bus": UncertainBody(mass=Uncertainty(relative=0.05))}).body[
        ...     "bus"
        ... ].mass.relative
        0.05
    """

    appendage: Annotated[
        dict[str, UncertainModes], field("modes by the prefix of the appendage, such as `array_`")
    ] = msgspec.field(default_factory=dict[str, UncertainModes])
    body: Annotated[dict[str, UncertainBody], field("mass properties by the name of the body")] = (
        msgspec.field(default_factory=dict[str, UncertainBody])
    )
    joint: Annotated[dict[str, UncertainJoint], field("sprung joints by name")] = msgspec.field(
        default_factory=dict[str, UncertainJoint]
    )
    correlation: Annotated[
        tuple[Correlation, ...], field("correlated quantities, one [[correlation]] each")
    ] = ()


def read_uncertain(path: "str | Path | UncertainCraft") -> UncertainCraft:
    """The uncertainties of a craft from TOML; those that were read already are returned."""
    holds = "a TOML file with [body.NAME], [joint.NAME] or [appendage.PREFIX]"
    return read_struct(path, UncertainCraft, "uncertain", holds)


def uncertain_from(data: Mapping[str, Any], source: str) -> "Uncertain":
    """The table [uncertain] of a modes file."""
    return convert(data, Uncertain, f"{source}, [uncertain]")


def correlate(
    scores: Array, places: Mapping[str, int], correlations: tuple[Correlation, ...]
) -> Array:
    """`(k, n)` scores with the correlations asked for, from independent ones `(k, n)`."""
    out = np.array(scores)
    for correlation in correlations:
        at = [places[name] for name in correlation.of]
        values, vectors = np.linalg.eigh(np.array(correlation.matrix))
        out[:, at] = scores[:, at] @ (vectors * np.sqrt(values.clip(0.0)) @ vectors.T)
    return out


class Uncertain(UncertainModes, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The table [uncertain]; what is left out is certain.
    What is said of the modes holds for those that are kept.

    Example:
        >>> import beamchain as bc
        >>> tenth = bc.spec.Uncertainty(relative=0.1, distribution="uniform")
        >>> bc.spec.Uncertain(frequency=tenth, density=tenth).structural
        ('density',)
    """

    stiffness: Annotated[
        Uncertainty | None, field("elastic stiffness of all segments (EI, GJ, EA); relative only")
    ] = None
    density: Annotated[
        Uncertainty | None,
        field("mass per length of all segments, nonstructural mass included; relative only"),
    ] = None
    payload: Annotated[
        Uncertainty | None, field("mass of the payload at the tip [kg]; its inertia in proportion")
    ] = None
    lump: Annotated[
        Uncertainty | None, field("masses of the lumps [kg]; their inertia in proportion")
    ] = None
    joint_stiffness: Annotated[
        Uncertainty | None, field("stiffness of the compliant hinge lines [N m/rad]")
    ] = None
    correlation: Annotated[
        tuple[Correlation, ...],
        field("correlated quantities of modes, one [[uncertain.correlation]] each"),
    ] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ONLY_RELATIVE:
            given = getattr(self, name)
            if given is not None and given.relative is None:
                raise InputError(
                    f"{name} takes relative only, because segments differ; write relative = 0.05."
                )

    @property
    def structural(self) -> tuple[str, ...]:
        """The properties of the structure that vary, for which samples must be fitted again."""
        return tuple(name for name in STRUCTURAL if getattr(self, name) is not None)


def score(seed: int, index: int, key: str) -> float:
    """Standard normal score of a quantity or a group in a sample."""
    return float(np.random.default_rng([seed, index, crc32(key.encode())]).standard_normal())
