"""What was identified: modes with their intervals, what is undetermined, and the file of modes made of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beamchain.caution import warnings_record
from beamchain.craft.identification.start import Order
from beamchain.craft.identification.structure import raised
from beamchain.craft.identification.update import Update
from beamchain.files import to_json, write_files
from beamchain.ports.motions import Array
from beamchain.structure.modal_data import ModalData

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LARGEST = 0.99  # relative half width that [uncertain] can take
WIDE = 0.3  # relative standard deviation beyond which a normal draw, cut at three of them, may be negative
LEAST = 1e-9
CORRELATED = 0.05  # smallest coefficient that is written
#: what the record says of a mode, in this order
RECORDED = ("number", "frequency", "frequency_std", "damping", "damping_std", "participation", "participation_std",
            "determined", "remark", "resolution")  # fmt: skip

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
        resolution: two modes closer than this [rad/s] would be found as one; nan with a prior, and of a mode that is not
            determined.
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
        rigid: `(6, 6)` rigid mass of the appendage about the port.
        order: numbers of modes that were tried.
        whiteness: by channel, the probability of residuals as correlated as these if the noise is white.
        warnings: sentences with codes.
        undetermined: sentences on what the log does not determine.
        update: factors on the prior beam, where it is one.
        held_out: by channel, error of the predicted last part relative to its own variation.
        noise: by channel, standard deviation of the residuals.
        spectra: by channel: frequencies [rad/s], and densities of what was measured, modelled and left.
        length: of the appendage [m], for sharing out its mass.
        source: of what.
        stated: rigid mass `(6, 6)` and participation `(n, 6)` of the file of modes, where no prior tells mass and force.
        advice: sentences on what a further test would need.

    Example:
        >>> import beamchain as bc
        >>> import numpy as np
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> omega = np.linspace(0.2, 8.0, 300)
        >>> s = 1j * omega
        >>> log = {"omega": omega, "rate_z/torque_z": 1.0 / (s * (130.0 - 36.0 * s**2 / (s**2 + 0.02 * s + 4.0)))}
        >>> found = bc.identify(log, craft, "mount")
        >>> [round(mode.frequency, 3) for mode in found.modes]
        [2.0]
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
    update: Update | None
    held_out: Mapping[str, float]
    noise: Mapping[str, float]
    spectra: Mapping[str, tuple[Array, Array, Array, Array]]
    length: float | None = None
    source: str = "log"
    stated: tuple[Array, Array] | None = None
    advice: tuple[str, ...] = ()

    def __repr__(self) -> str:
        rows = [
            f"{m.number}: {m.frequency:.6g} +- {m.frequency_std:.2g} rad/s, damping {m.damping:.3g} +- {m.damping_std:.2g}"
            + ("" if m.determined else ", undetermined")
            for m in self.modes
        ]
        return "\n  ".join([f"<Identification of {self.source}, {len(self.modes)} modes", *rows]) + ">"

    def _repr_html_(self) -> str:
        from beamchain import report

        return report.identification_html(self)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Measured, modelled and remaining spectrum of the first channel, drawn into `ax`. Returns the axes; shows nothing."""
        from beamchain import report

        return report.plot_identification(self, ax)

    @property
    def uncertain(self) -> dict[str, Any]:
        """The table [uncertain] of the modes file."""
        out: dict[str, Any] = {"mode": []}
        there, factors = list[str](), dict(zip(self.names, np.diag(self.covariance), strict=True))
        for mode in self.modes:
            one: dict[str, Any] = {"number": mode.number}
            for kind, value, std in (
                ("frequency", mode.frequency, mode.frequency_std),
                ("damping", mode.damping, mode.damping_std),
                ("participation", 1.0, np.sqrt(factors.get(f"mode{mode.number}.participation", np.nan))),
            ):
                relative = float(std / value) if value > 0.0 else np.nan
                if np.isfinite(relative) and relative > WIDE:  # a normal one would be drawn negative
                    one[kind] = {"relative": float(min(np.sqrt(3.0) * relative, LARGEST)), "distribution": "uniform"}
                elif np.isfinite(relative) and relative > LEAST:
                    one[kind] = {"relative": relative}
                    there.append(f"mode{mode.number}.{kind}")
            if len(one) > 1:
                out["mode"].append(one)
        at = [i for i, name in enumerate(self.names) if name in there]
        if not out["mode"]:
            return {}
        matrix = _over_its_diagonal(self.covariance[np.ix_(at, at)])
        if np.max(np.abs(matrix - np.eye(len(at))), initial=0.0) > CORRELATED:
            np.fill_diagonal(matrix, 1.0)
            sound = _over_its_diagonal(raised((matrix + matrix.T) / 2.0, 1e-9))
            out["correlation"] = [{"of": [self.names[i] for i in at], "matrix": sound.tolist()}]
        return out

    def data(self) -> ModalData:
        """The modes as `[imported]` of a specification reads them."""
        rigid, rows = self.stated or (self.rigid, np.array([m.participation for m in self.modes]))
        return ModalData(
            rigid_mass=rigid,
            frequencies=np.array([m.frequency for m in self.modes]),
            participation=rows,
            damping=np.array([m.damping for m in self.modes]),
            length=self.length,
            source=self.source,
            uncertain=self.uncertain,
        )

    def to_toml(self) -> str:
        """The text of modes.toml."""
        data = self.data()
        note = "identified by beamchain; " + (" ".join(self.undetermined) or "every value is determined by the log.")
        lines = [
            f"note = {_text(note)}",
            f"frequencies = {_row(data.frequencies)}  # rad/s",
            f"damping = {_row(data.damping)}",
            *_table("participation", data.participation.T),
            *_table("mass", data.rigid_mass),
            "digits = 15",
        ]
        if self.length is not None:
            lines.append(f"length = {self.length!r}")
        for one in data.uncertain.get("mode", ()):
            lines += ["", "[[uncertain.mode]]", f"number = {one['number']}"]
            lines += [
                f"{kind} = {{ {', '.join(f'{k} = {v!r}' for k, v in how.items())} }}".replace("'", '"')
                for kind, how in one.items()
                if kind != "number"
            ]
        for one in data.uncertain.get("correlation", ()):
            names = ", ".join(_text(name) for name in one["of"])
            lines += ["", "[[uncertain.correlation]]", f"of = [{names}]", *_table("matrix", one["matrix"])]
        return "\n".join(lines) + "\n"

    def write(self, path: str | Path, *, force: bool = False) -> list[Path]:
        """Write modes.toml, and beside it the report and the record as JSON.

        Args:
            path: of the .toml file.
            force: replace files that exist.

        Raises:
            OutputError: a file exists, or the folder cannot be written.
        """
        from beamchain import report

        place = Path(path)
        files: dict[Path, str | bytes] = {
            place.with_name(f"{place.stem}.json"): to_json(self.as_dict()),
            place.with_name(f"{place.stem}_report.html"): report.identification_page(self, place.name),
            place: self.to_toml(),
        }
        write_files(files, force=force)
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
            "undetermined": list(self.undetermined),
            "advice": list(self.advice),
            "update": None if self.update is None else self.update.as_dict(),
            **warnings_record(self.warnings),
        }


def _over_its_diagonal(matrix: Array) -> Array:
    return matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))


def _row(values: Sequence[float] | Array) -> str:
    return "[" + ", ".join(repr(float(v) + 0.0) for v in values) + "]"


def _table(name: str, rows: Sequence[Sequence[float]] | Array) -> list[str]:
    return [f"{name} = [", *(f"  {_row(row)}," for row in rows), "]"]


def _text(words: str) -> str:
    return '"' + words.replace("\\", "/").replace('"', "'").replace("\n", " ") + '"'
