"""What was identified: modes with their intervals, what is undetermined,
and the file of modes made of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import tomlkit

from beamchain import ModalData
from beamchain.errors import InputError
from beamchain.files import beside, to_json, write_files
from beamchain.identification.initial_model import Order
from beamchain.identification.structure import raise_eigenvalues
from beamchain.toolkit import Array
from beamchain.warning_codes import warnings_record

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LARGEST = 0.99  # relative half width that [uncertain] can take
# relative standard deviation beyond which a normal draw, cut at three of them, may be negative
WIDE = 0.3
LEAST = 1e-9
CORRELATED = 0.05  # smallest coefficient that is written
#: what the record says of a mode, in this order
RECORDED = (
    "number",
    "frequency",
    "frequency_std",
    "damping",
    "damping_std",
    "participation",
    "participation_std",
    "determined",
    "remark",
    "resolution",
)

#: where the file of modes has no mass
MASSLESS = (
    "mass = [...]: the log does not tell it; add the 6 x 6 rigid mass about the port, or "
    "identify with a prior"
)
INTERVAL = 1.959964  # standard deviations on either side, 95 % of a normal distribution


@dataclass(frozen=True, eq=False)
class IdentifiedMode:
    """One mode of the appendage with its root held.

    Args:
        number: from 1, by frequency.
        frequency: [rad/s].
        damping: ratio.
        participation: `(6,)` mass-normalised, about the port in the appendage's axes.
        frequency_std, damping_std: standard deviations.
        participation_std: `(6,)`; nan where neither log nor prior says anything.
        determined: the log determines frequency and damping.
        remark: what to know of it, empty where nothing is.
        resolution: two modes closer than this [rad/s] would be found as one; nan with a prior, and
            of a mode that is not determined.
    """

    number: int
    frequency: float
    damping: float
    participation: Array
    frequency_std: float
    damping_std: float
    participation_std: Array
    determined: bool
    remark: str = ""
    resolution: float = float("nan")


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """Modes of an appendage from a log.

    Args:
        modes: by frequency.
        names: of the quantities of `covariance`, such as mode1.frequency.
        covariance: of frequencies [rad/s], damping ratios and factors on participation.
        rigid: `(6, 6)` rigid mass of the appendage about the port;
            without a prior its inertia about the driven axes alone.
        order: numbers of modes that were tried.
        whiteness: by channel, the probability of residuals as correlated as these if
            the noise is white.
        warnings: sentences with codes.
        undetermined: sentences on what the log does not determine.
        held_out: by channel, error of the predicted last part relative to its own variation.
        noise: by channel, standard deviation of the residuals.
        spectra: by channel: frequencies [rad/s], and densities of what was measured,
            modelled and left.
        massive: whether a prior told the appendage's mass,
            of which a log of rotation shows the inertia only.
        source: of what.
        advice: sentences on what a further test would need.
        delay: [s] by which torques act later than the log says; negative: earlier.
        delay_std: its standard deviation.
        inputs: files that were read, which `write` does not replace.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import identification
        >>> import numpy as np
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> omega = np.linspace(0.2, 8.0, 300)
        >>> s = 1j * omega
        >>> log = {
        ...     "omega": omega,
        ...     "rate_z/torque_z": 1.0 / (s * (130.0 - 36.0 * s**2 / (s**2 + 0.02 * s + 4.0))),
        ... }
        >>> beam = bc.Equivalent(bending_stiffness_xy=750.0, linear_mass=0.25)
        >>> prior = bc.Spec(segment=(bc.Segment(length=8.0, section=beam),))
        >>> found = identification.identify(log, craft, "mount", prior=prior)
        >>> [mode.determined for mode in found.modes]
        [True]
        >>> found.data().participation.shape  # of the modes, as [imported] and bc.embed take them
        (1, 6)
    """

    modes: tuple[IdentifiedMode, ...]
    names: tuple[str, ...]
    covariance: Array
    rigid: Array
    order: tuple[Order, ...]
    whiteness: Mapping[str, float]
    warnings: tuple[str, ...]
    undetermined: tuple[str, ...]
    held_out: Mapping[str, float]
    noise: Mapping[str, float]
    spectra: Mapping[str, tuple[Array, Array, Array, Array]]
    massive: bool = True
    source: str = "log"
    advice: tuple[str, ...] = ()
    inputs: tuple[Path, ...] = ()
    delay: float = 0.0
    delay_std: float = float("nan")

    def __repr__(self) -> str:
        rows = [
            f"{m.number}: {m.frequency:.6g} +- {m.frequency_std:.2g} rad/s, damping "
            f"{m.damping:.3g} +- {m.damping_std:.2g}" + ("" if m.determined else ", undetermined")
            for m in self.modes
        ]
        return (
            "\n  ".join([f"<Identification of {self.source}, {len(self.modes)} modes", *rows]) + ">"
        )

    def _repr_html_(self) -> str:
        from beamchain import identification

        return identification.page.identification_html(self)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Measured, modelled and remaining spectrum of the first channel, drawn into `ax`.
        Returns the axes; shows nothing."""
        from beamchain import identification

        return identification.page.plot_identification(self, ax)

    @property
    def punctual(self) -> bool:
        """Whether the delay is zero within its interval of 95 %."""
        return abs(self.delay) <= INTERVAL * self.delay_std

    @property
    def refused(self) -> bool:
        """Whether `[imported]` refuses the modes; a warning says why."""
        return any(getattr(said, "code", "") == "modes-refused" for said in self.warnings)

    @property
    def timing(self) -> str:
        """A sentence on the delay."""
        interval = f"{self.delay:.4g} s ± {INTERVAL * self.delay_std:.2g} s (95 %)"
        if self.punctual:
            return f"delay between torque and motion: {interval}, zero within its interval."
        side = "later" if self.delay > 0.0 else "earlier"
        return (
            f"delay between torque and motion: {interval}, not zero within its interval: torques "
            f"act {side} than the log says."
        )

    @property
    def uncertain(self) -> dict[str, Any]:
        """The table [uncertain] of the modes file."""
        out: dict[str, Any] = {"mode": []}
        there = list[str]()
        factors = dict(zip(self.names, np.diag(self.covariance), strict=True))
        for mode in self.modes:
            one: dict[str, Any] = {"number": mode.number}
            for kind, value, std in (
                ("frequency", mode.frequency, mode.frequency_std),
                ("damping", mode.damping, mode.damping_std),
                (
                    "participation",
                    1.0,
                    np.sqrt(factors.get(f"mode{mode.number}.participation", np.nan)),
                ),
            ):
                relative = float(std / value) if value > 0.0 else np.nan
                # a normal one would be drawn negative
                if np.isfinite(relative) and relative > WIDE:
                    one[kind] = {
                        "relative": float(min(np.sqrt(3.0) * relative, LARGEST)),
                        "distribution": "uniform",
                    }
                elif np.isfinite(relative) and relative > LEAST:
                    one[kind] = {"relative": relative}
                    there.append(f"mode{mode.number}.{kind}")
            if len(one) > 1:
                out["mode"].append(one)
        at = [i for i, name in enumerate(self.names) if name in there]
        if not out["mode"]:
            return {}
        matrix = _correlation(self.covariance[np.ix_(at, at)])
        if np.max(np.abs(matrix - np.eye(len(at))), initial=0.0) > CORRELATED:
            np.fill_diagonal(matrix, 1.0)
            sound = _correlation(raise_eigenvalues((matrix + matrix.T) / 2.0, 1e-9))
            out["correlation"] = [{"of": [self.names[i] for i in at], "matrix": sound.tolist()}]
        return out

    def data(self) -> ModalData:
        """The modes as `[imported]` of a specification reads them.

        Raises:
            InputError: the appendage's mass is not known, for there was no prior.
        """
        if not self.massive:
            raise InputError(
                f"{self.source}: a log of rotation does not tell the appendage's mass, which a "
                "chain needs; identify with prior = SPEC.toml, or add mass to the file of modes."
            )
        return ModalData(
            rigid_mass=self.rigid,
            frequencies=np.array([m.frequency for m in self.modes]),
            participation=np.array([m.participation for m in self.modes]),
            damping=np.array([m.damping for m in self.modes]),
            source=self.source,
            uncertain=self.uncertain,
        )

    def to_toml(self) -> str:
        """The text of modes.toml."""
        document = tomlkit.document()
        facts = " ".join(self.undetermined) or "every value is determined by the log."
        document.add("note", tomlkit.string(f"identified by beamchain; {facts}"))
        document.add("frequencies", _row([m.frequency for m in self.modes]).comment("rad/s"))
        document.add("damping", _row([m.damping for m in self.modes]))
        participation = np.transpose([m.participation for m in self.modes])
        document.add("participation", _matrix(participation))
        if self.massive:
            document.add("mass", _matrix(self.rigid))
        else:
            document.add(tomlkit.comment(MASSLESS))
        document.add("digits", tomlkit.item(15))
        if self.uncertain:
            document.add("uncertain", _uncertain_table(self.uncertain))
        return tomlkit.dumps(document)

    def write(self, path: str | Path, *, force: bool = False) -> list[Path]:
        """Write modes.toml, and beside it the report and the record as JSON.

        Args:
            path: of the .toml file.
            force: replace files that exist.

        Raises:
            OutputError: a file exists, is one that was read, or the folder cannot be written.
        """
        from beamchain import identification

        place = Path(path)
        files: dict[Path, str | bytes] = {
            beside(place, ".json"): to_json(self.as_dict()),
            beside(place, "_report.html"): identification.page.identification_page(
                self, place.name
            ),
            place: self.to_toml(),
        }
        write_files(files, force=force, inputs=self.inputs)
        return list(files)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "modes": [{name: getattr(mode, name) for name in RECORDED} for mode in self.modes],
            "names": list(self.names),
            "covariance": self.covariance,
            "rigid": self.rigid,
            "order": [one._asdict() for one in self.order],
            "whiteness": dict(self.whiteness),
            "held_out": dict(self.held_out),
            "noise": dict(self.noise),
            "delay": self.delay,
            "delay_std": self.delay_std,
            "delay_zero_within_interval": self.punctual,
            "undetermined": list(self.undetermined),
            "advice": list(self.advice),
            "warnings": warnings_record(self.warnings),
        }


def _correlation(matrix: Array) -> Array:
    return matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))


def _row(values: Sequence[float] | Array) -> Any:
    """An array in one line; a negative zero is written as zero."""
    array = tomlkit.array()
    array.extend(float(value) + 0.0 for value in values)
    return array


def _matrix(rows: Sequence[Sequence[float]] | Array) -> Any:
    """An array of rows, one per line."""
    array = tomlkit.array()
    for row in rows:
        array.add_line(_row(row))
    array.add_line(indent="")
    return array


def _uncertain_table(uncertain: Mapping[str, Any]) -> Any:
    """The table [uncertain]: [[uncertain.mode]], [[uncertain.correlation]]."""
    modes = tomlkit.aot()
    for mode in uncertain.get("mode", ()):
        table = tomlkit.table()
        for key, value in mode.items():
            if isinstance(value, Mapping):
                inline = tomlkit.inline_table()
                inline.update(cast("Mapping[str, Any]", value))
                value = inline
            table.add(key, value)
        modes.append(table)
    correlations = tomlkit.aot()
    for correlation in uncertain.get("correlation", ()):
        table = tomlkit.table()
        table.add("of", list(correlation["of"]))
        table.add("matrix", _matrix(correlation["matrix"]))
        correlations.append(table)
    out = tomlkit.table(is_super_table=True)
    for name, tables in (("mode", modes), ("correlation", correlations)):
        if len(tables):
            out.add(name, tables)
    return out
