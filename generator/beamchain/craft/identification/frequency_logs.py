"""Measured frequency responses: columns of a table, and universal files of type 58."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.errors import InputError
from beamchain.ports.motions import Array

PAIR = re.compile(
    r"(acceleration|rate|attitude)_([xyz])\s*/\s*(\w+)\s+(re|im|magnitude|phase|phase_deg|coherence)", re.IGNORECASE
)
ORDERS = {"acceleration": 1, "rate": 0, "attitude": -1}
FEWEST = 8
BY_TYPE = {8: "attitude", 11: "rate", 12: "acceleration"}


class Response(NamedTuple):
    """One measured pair.

    Args:
        omega: `(N,)` ascending [rad/s].
        value: `(N,)` response per torque.
        sensed: such as rate_z.
        torque: such as torque_z.
        order: 1 acceleration, 0 rate, -1 attitude.
        accuracy: `(N,)` relative standard deviation up to a factor, from coherence where it is known.
        source: how messages call it.
    """

    omega: Array
    value: NDArray[np.complex128]
    sensed: str
    torque: str
    order: int
    accuracy: Array
    source: str


def responses(table: Mapping[str, Array], source: str) -> list[Response]:
    """The pairs of a table with `frequency` [Hz] or `omega` [rad/s], empty where it has none.

    Raises:
        InputError: a half of a pair is missing, or a number cannot be.
    """
    omega = np.real(table["omega"] if "omega" in table else 2.0 * np.pi * table["frequency"])
    found = dict[tuple[str, str, str], dict[str, Array]]()
    for name, values in table.items():
        if match := PAIR.fullmatch(name.strip()):
            kind, axis, torque, part = (str(word) for word in match.groups())
            found.setdefault((kind.lower(), axis.lower(), torque), {})[part.lower()] = values
        elif np.iscomplexobj(values) and (match := PAIR.fullmatch(f"{name.strip()} re")):
            kind, axis, torque, _ = (str(word) for word in match.groups())
            found[(kind.lower(), axis.lower(), torque)] = {"re": values.real, "im": values.imag}
    out = list[Response]()
    for (kind, axis, torque), parts in found.items():
        label = f"{kind}_{axis}/{torque}"
        if "re" in parts and "im" in parts:
            value = np.asarray(parts["re"] + 1j * parts["im"], dtype=np.complex128)
        elif "magnitude" in parts and ("phase" in parts or "phase_deg" in parts):
            angle = parts["phase"] if "phase" in parts else np.radians(parts["phase_deg"])
            value = np.asarray(parts["magnitude"] * np.exp(1j * angle), dtype=np.complex128)
        else:
            raise InputError(
                f"{source}: {label} needs the columns `{label} re` and `{label} im`, or magnitude and phase "
                "[rad] (phase_deg)."
            )
        out.append(_checked(omega, value, kind, axis, torque, parts.get("coherence"), source))
    return out


def _checked(
    omega: Array, value: NDArray[np.complex128], kind: str, axis: str, torque: str, coherence: Array | None, source: str
) -> Response:
    label = f"{kind}_{axis}/{torque}"
    if value.size != omega.size or omega.size < FEWEST:
        raise InputError(
            f"{source}: {label} has {value.size} lines and {omega.size} frequencies; at least {FEWEST} of each "
            "are needed."
        )
    keep = omega > 0.0
    if not np.all(np.isfinite(omega)) or not np.all(np.isfinite(value[keep])):
        raise InputError(f"{source}: {label} holds a value that is not a finite number; leave those lines out.")
    if np.any(np.diff(omega) <= 0.0):
        raise InputError(f"{source}: the frequencies do not ascend; sort the lines.")
    if np.any(value[keep] == 0.0):
        raise InputError(f"{source}: {label} is zero at some frequency; leave out the lines without a measurement.")
    accuracy = np.ones(omega.size)
    if coherence is not None:
        level = np.clip(coherence, 1e-6, 1.0 - 1e-6)
        accuracy = np.sqrt((1.0 - level) / level)
    return Response(omega[keep], value[keep], f"{kind}_{axis}", torque, ORDERS[kind], accuracy[keep], source)


def read_uff(path: Path, source: str) -> list[Response]:
    """Frequency responses to torques of a universal file: type 58, rotations 4, 5, 6 as response and reference.

    Raises:
        InputError: pyuff is missing, or the file has no such function.
    """
    try:
        import pyuff  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            f"{source}: universal files need pyuff; pip install 'beamchain[identification]', or give CSV."
        ) from None
    try:
        file: Any = pyuff.UFF(str(path))
        sets: list[Any] = [file.read_sets(i) for i, kind in enumerate(file.get_set_types()) if int(kind) == 58]
    except Exception as error:  # readers of damaged files raise almost anything
        raise InputError(f"{source} cannot be read ({type(error).__name__}: {error!s:.80}); export it again.") from None
    out = list[Response]()
    for one in sets:
        at, by = int(one.get("rsp_dir", 0)), int(one.get("ref_dir", 0))
        if int(one.get("func_type", 0)) != 4 or abs(at) not in (4, 5, 6) or abs(by) not in (4, 5, 6):
            continue
        kind = BY_TYPE.get(int(one.get("ordinate_spec_data_type", 11)), "rate")
        value = np.asarray(one["data"], dtype=np.complex128) * np.sign(at) * np.sign(by)
        omega = 2.0 * np.pi * np.asarray(one["x"], dtype=np.float64)
        out.append(_checked(omega, value, kind, "xyz"[abs(at) - 4], f"torque_{'xyz'[abs(by) - 4]}", None, source))
    if not out:
        raise InputError(
            f"{source} holds no frequency response (type 58, function 4) between rotations (directions 4, 5, 6) "
            "of the hub."
        )
    return out
