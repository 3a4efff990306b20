"""The checks every input goes through on construction, and the sentences they answer with."""

import math
from collections.abc import Iterable
from numbers import Integral, Real

from beamchain.errors import InputError

LARGEST = 1e30  # beyond this a product of three inputs leaves double precision


def number(field: str, value: object, unit: str, *, cure: str = "") -> float:
    """A finite number, or an `InputError` that names the field.

    Args:
        field: name of the field, as the user wrote it.
        value: what the user gave.
        unit: unit shown in the message, `""` for a pure number.
        cure: what to do, appended to the message.
    """
    wanted = f"a finite number{f' in {unit}' if unit else ''} is needed"
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(f"{field} = {value!r} is not a number; {wanted}. {cure or f'Write {field} = 1.0.'}".strip())
    result = float(value)
    if not math.isfinite(result) or abs(result) > LARGEST:
        raise InputError(f"{field} = {result!r} cannot be used; {wanted}, at most {LARGEST:g}. {cure}".strip())
    return result


def positive(field: str, value: object, unit: str, *, cure: str = "") -> float:
    """A finite number above zero."""
    result = number(field, value, unit, cure=cure)
    if not result > 1e-30:
        raise InputError(
            f"{field} = {result!r} must be above {'zero' if result <= 0.0 else '1e-30'}{f' ({unit})' if unit else ''}. "
            + (cure or f"Give {field} a positive value.")
        )
    return result


def not_negative(field: str, value: object, unit: str, *, cure: str = "") -> float:
    """A finite number, zero or above."""
    result = number(field, value, unit, cure=cure)
    if result < 0.0:
        raise InputError(
            f"{field} = {result!r} must not be negative{f' ({unit})' if unit else ''}. "
            + (cure or f"Give {field} a value of zero or more.")
        )
    return result


def one_of(field: str, value: object, choices: Iterable[str]) -> None:
    """`value` is one of the words in `choices`."""
    words = list(choices)
    if value not in words:
        raise InputError(f"{field} = {value!r} is unknown; choose one of {', '.join(words)}.")


def whole(field: str, value: object, least: int, most: int) -> int:
    """A whole number from `least` to `most`."""
    if isinstance(value, bool) or not isinstance(value, Integral) or not least <= int(value) <= most:
        raise InputError(f"{field} = {value!r} must be a whole number from {least} to {most}.")
    return int(value)
