"""Logs of a test or a flight: files and mappings of arrays, their columns by name, refused where
they contradict themselves."""

import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from beamchain.checks import kind_of, meant
from beamchain.errors import InputError
from beamchain.files import no_file, note_input
from beamchain.toolkit import Array, npz_arrays

LARGEST_FILE = 2_000_000_000  # bytes
MOST_ROWS = 20_000_000
FEWEST_ROWS = 20
# of a time log, in its units: beyond it squares and sums leave double precision
LARGEST_VALUE = 1e12
FEWEST_LINES = 8  # of a frequency response
ENDINGS = (".csv", ".txt", ".npz")
TORQUES = tuple(f"torque_{a}" for a in "xyz")
KINDS = ("rate", "attitude", "mean_rate")
SENSED = tuple(f"{kind}_{a}" for kind in KINDS for a in "xyz")
PAIR = re.compile(
    r"(acceleration|rate|attitude)_([xyz])\s*/\s*(\w+)\s+"
    r"(re|im|magnitude|phase|phase_deg|coherence)",
    re.IGNORECASE,
)
ORDERS = {"acceleration": 1, "rate": 0, "attitude": -1}

Given = Any  # a path, a mapping of arrays, or a list of those


class TimeLog(NamedTuple):
    """A time log: ascending times [s]; torques [N m] or controls of actuators,
    rates [rad/s], attitudes [rad] and mean rates since the sample before [rad/s] by column.

    `source` is how messages call it.
    """

    time: Array
    torques: dict[str, Array]
    sensed: dict[str, Array]
    source: str


class Response(NamedTuple):
    """One measured pair.

    Args:
        omega: `(N,)` ascending [rad/s].
        value: `(N,)` response per torque.
        sensed: such as rate_z.
        torque: such as torque_z.
        order: 1 acceleration, 0 rate, -1 attitude.
        accuracy: `(N,)` relative standard deviation up to a factor,
            from coherence where it is known.
    """

    omega: Array
    value: NDArray[np.complex128]
    sensed: str
    torque: str
    order: int
    accuracy: Array


def read_logs(
    logs: Given, names: Mapping[str, str] | None, actuators: Sequence[str]
) -> tuple[list[TimeLog], list[Response]]:
    """All logs that were given, by kind.

    Args:
        logs: a path, a mapping of columns, or a list of those.
        names: a file's own column names and what they mean.
        actuators: names of the craft's actuators, which may be columns.

    Raises:
        InputError: a file cannot be read, a column is missing, or its numbers cannot be a log.
    """
    given = [logs] if isinstance(logs, str | Path | Mapping) else logs
    if not isinstance(given, Sequence) or not given:
        raise InputError(
            f"logs = {logs!r:.60} is no log; give a path, a mapping of arrays with time, torque_z "
            "and rate_z, or a list of those."
        )
    times = list[TimeLog]()
    spectra = list[Response]()
    for i, one in enumerate(given):
        table, source = _table(one, f"log {i + 1}" if len(given) > 1 else "log", names)
        if "time" in table:
            times.append(_time_log(table, actuators, source))
        elif "frequency" in table or "omega" in table:
            omega = np.real(
                table["omega"] if "omega" in table else 2.0 * np.pi * table["frequency"]
            )
            pairs = _responses(table, omega, source)
            if not pairs:
                raise InputError(
                    f"{source} has frequencies and no responses; write frequencies with the "
                    "participation and the mass of the appendage as a file of modes, and give it "
                    "to [imported]."
                )
            spectra += pairs
        else:
            raise InputError(
                f"{source} has the columns {', '.join(map(str, list(table)[:12])) or 'none'}; a "
                "time log needs `time`, torque_x|y|z and rate_* or attitude_*, a frequency "
                "response `frequency` or `omega`; name them with map (--map OLD=NEW)."
            )
    return times, spectra


def _table(one: Any, called: str, names: Mapping[str, str] | None) -> tuple[dict[str, Array], str]:
    """Columns of numbers of a mapping or a file, and how messages call it;
    columns of words are left out."""
    if isinstance(one, Mapping):
        columns = cast("Mapping[str, Any]", one)
        source = called
    elif isinstance(one, str | Path):
        source = f"{called.split()[0]} {str(one)!r}"
        columns = _columns(Path(one), source)
    else:
        raise InputError(f"{called} is {kind_of(one)}; give a path or a mapping of arrays.")
    renamed = names or {}
    for name in renamed:
        if name not in columns:
            raise InputError(
                f"map names the column {name!r}, which {source} does not have; "
                f"{meant(name, map(str, columns))}it has {', '.join(map(str, list(columns)[:20]))}."
            )
    out = dict[str, Array]()
    for name, values in columns.items():
        try:
            own = np.asarray(values)
            out[renamed.get(str(name), str(name))] = np.ravel(
                own if np.iscomplexobj(own) else own.astype(np.float64)
            )
        except (TypeError, ValueError):
            continue
    return out, source


def _check_file(path: Path, source: str) -> None:
    note_input(path)
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{source} has an unknown ending; beamchain reads {', '.join(ENDINGS)}.")
    if kind := no_file(path):
        raise InputError(f"{source} {kind}; give the path of a log.")
    size = path.stat().st_size
    if size == 0:
        raise InputError(f"{source} is empty; export the log again.")
    if size > LARGEST_FILE:
        raise InputError(
            f"{source} has {size} bytes, more than the {LARGEST_FILE} taken; cut it into several "
            "logs."
        )


def _columns(path: Path, source: str) -> Mapping[str, Any]:
    _check_file(path, source)
    kind = path.suffix.lower()
    try:
        if kind in (".csv", ".txt"):
            return _csv(path, source)
        return npz_arrays(path, longest=None)
    except InputError:
        raise
    except Exception as error:  # readers of damaged files raise almost anything
        raise _unreadable(source, error) from None


def _unreadable(source: str, error: Exception) -> InputError:
    return InputError(
        f"{source} cannot be read ({type(error).__name__}: {error!s:.80}); export it again."
    )


def _csv(path: Path, source: str) -> dict[str, Array]:
    with path.open("rb") as stream:
        head = (
            stream.readline(100_000)
            .decode("utf-8-sig", errors="replace")
            .strip()
            .lstrip("#")
            .strip()
        )
        mark = next((m for m in (";", "\t", ",") if m in head), ",")
        names = [name.strip().strip('"') for name in head.split(mark)]
        body = stream.read()
    if not body.strip():
        raise InputError(f"{source} has no rows; export the log again.")
    if not any(
        any(c.isalpha() for c in name) and name.lower() not in ("nan", "inf") for name in names
    ):
        raise InputError(
            f"{source} has no line of column names; let its first line be for example "
            "time,torque_z,rate_z."
        )
    if mark == ";" and b"," in body[:2000]:
        body = body.replace(b",", b".")
    try:
        table = np.loadtxt(
            io.BytesIO(body), delimiter=mark, ndmin=2, comments="#", max_rows=MOST_ROWS + 1
        )
    except ValueError as error:
        raise InputError(
            f"{source} holds something that is no number ({error!s:.120}); export it again."
        ) from None
    if table.shape[1] != len(names):
        raise InputError(
            f"{source} names {len(names)} columns, but its rows have {table.shape[1]}; export it "
            "again."
        )
    return dict(zip(names, table.T, strict=True))


def _time_log(table: Mapping[str, Array], actuators: Sequence[str], source: str) -> TimeLog:
    torques = {n: table[n] for n in (*TORQUES, *actuators) if n in table}
    sensed = {n: table[n] for n in SENSED if n in table}
    for what, found, known in (
        ("torque", torques, (*TORQUES, *actuators)),
        ("rate or attitude", sensed, SENSED),
    ):
        if not found:
            near = "".join(meant(name, known) for name in table if name != "time")
            raise InputError(
                f"{source} has no column of a {what} (columns: {', '.join(table)}); {near}give one "
                f"of {', '.join(known)}, or map a column."
            )
    time = table["time"]
    n = time.size
    if n < FEWEST_ROWS or n > MOST_ROWS:
        raise InputError(f"{source} has {n} samples; from {FEWEST_ROWS} to {MOST_ROWS} are taken.")
    for name, values in {"time": time, **torques, **sensed}.items():
        if values.size != n:
            raise InputError(
                f"{source}: time has {n} samples, {name} has {values.size}; every column needs as "
                "many."
            )
        if np.iscomplexobj(values):
            raise InputError(f"{source}: {name} is complex; the columns of a time log are real.")
        far = (
            np.flatnonzero(np.abs(values) > LARGEST_VALUE)
            if np.all(np.isfinite(values))
            else np.zeros(0)
        )
        if far.size:
            raise InputError(
                f"{source}: {name} = {values[far[0]]:.4g} in sample {far[0] + 1}; at most "
                f"{LARGEST_VALUE:g} is taken: count time from the start of the log, and check the "
                "units."
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise InputError(
                f"{source}: {name} = {values[bad[0]]} in sample {bad[0] + 1} ({bad.size} such "
                "samples); leave out the rows without a measurement, gaps are taken as such."
            )
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if back.size:
        i = int(back[0])
        raise InputError(
            f"{source}: time goes from {time[i]!s} to {time[i + 1]!s} s at sample {i + 2}; it must "
            "ascend: sort the rows, and give logs that start again as several files."
        )
    return TimeLog(time, torques, sensed, source)


def _responses(table: Mapping[str, Array], omega: Array, source: str) -> list[Response]:
    """The pairs of a table at its frequencies [rad/s], empty where it has none."""
    found = dict[tuple[str, str], dict[str, Array]]()
    for name, values in table.items():
        match = PAIR.fullmatch(name.strip())
        parts = {}
        if match:
            parts = {match[4].lower(): values}
        elif np.iscomplexobj(values) and (match := PAIR.fullmatch(f"{name.strip()} re")):
            parts = {"re": values.real, "im": values.imag}
        if match:
            found.setdefault((f"{match[1]}_{match[2]}".lower(), match[3]), {}).update(parts)
    out = list[Response]()
    for (sensed, torque), parts in found.items():
        if "re" in parts and "im" in parts:
            value = np.asarray(parts["re"] + 1j * parts["im"], dtype=np.complex128)
        elif "magnitude" in parts and ("phase" in parts or "phase_deg" in parts):
            angle = parts["phase"] if "phase" in parts else np.radians(parts["phase_deg"])
            value = np.asarray(parts["magnitude"] * np.exp(1j * angle), dtype=np.complex128)
        else:
            label = f"{sensed}/{torque}"
            raise InputError(
                f"{source}: {label} needs the columns `{label} re` and `{label} im`, or magnitude "
                "and phase [rad] (phase_deg)."
            )
        out.append(_checked_response(omega, value, sensed, torque, parts.get("coherence"), source))
    return out


def _checked_response(
    omega: Array,
    value: NDArray[np.complex128],
    sensed: str,
    torque: str,
    coherence: Array | None,
    source: str,
) -> Response:
    label = f"{sensed}/{torque}"
    if value.size != omega.size or omega.size < FEWEST_LINES:
        raise InputError(
            f"{source}: {label} has {value.size} lines and {omega.size} frequencies; at least "
            f"{FEWEST_LINES} of each are needed."
        )
    keep = omega > 0.0
    if not np.all(np.isfinite(omega)) or not np.all(np.isfinite(value[keep])):
        raise InputError(
            f"{source}: {label} holds a value that is not a finite number; leave those lines out."
        )
    if np.any(np.diff(omega) <= 0.0):
        raise InputError(f"{source}: the frequencies do not ascend; sort the lines.")
    if np.any(value[keep] == 0.0):
        raise InputError(
            f"{source}: {label} is zero at some frequency; leave out the lines without a "
            "measurement."
        )
    level = np.full(omega.size, 0.5) if coherence is None else np.clip(coherence, 1e-6, 1.0 - 1e-6)
    accuracy = np.sqrt((1.0 - level) / level)
    return Response(omega[keep], value[keep], sensed, torque, ORDERS[sensed[:-2]], accuracy[keep])
