"""The checks every input goes through on construction, and the sentences they answer with."""

import difflib
import math
from collections.abc import Iterable
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import msgspec

from beamchain.errors import InputError

LARGEST = 1e30  # beyond this a product of three inputs leaves double precision


class _Answering(msgspec.StructMeta):
    """Answers a call that does not fit the fields with the fields, instead of with the library's words."""

    if not TYPE_CHECKING:  # a type checker that sees it no longer sees the fields

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:  # noqa: N805
            fields = cls.__struct_fields__
            takes = f"it takes {', '.join(fields)}, each by its name."
            for name in kwargs:
                if name not in fields:
                    near = difflib.get_close_matches(name, fields, n=1)
                    raise InputError(
                        f"{cls.__name__} has no field {name!r}; {f'did you mean {near[0]}? ' if near else ''}{takes}"
                    )
            if args:
                raise InputError(f"{cls.__name__}: {args[0]!r:.60} is given without a name; {takes}")
            try:
                return super().__call__(*args, **kwargs)
            except TypeError:
                missing = [f.name for f in msgspec.structs.fields(cls) if f.required and f.name not in kwargs]
                if not missing:
                    raise
                raise InputError(f"{cls.__name__}: {missing[0]} is missing; {takes}") from None


class Struct(msgspec.Struct, frozen=True, kw_only=True, metaclass=_Answering):
    """Base of everything that a user fills in, in Python or in TOML."""


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


def own_numbers(struct: msgspec.Struct) -> None:
    """Turn what stands in a struct's fields into Python's own numbers and tuples, in place.

    NumPy's scalars and arrays, fractions and lists are taken as what they mean, so that every struct can be hashed,
    compared and written. What is no number stays, for the checks to name.
    """
    for name in struct.__struct_fields__:
        given = getattr(struct, name)
        plain = _own(given)
        if plain is not given:
            msgspec.structs.force_setattr(struct, name, plain)


def _own(value: Any) -> Any:
    if value is None or isinstance(value, bool | msgspec.Struct) or type(value) in (int, float, str):
        return value
    if isinstance(value, dict):
        return {key: _own(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        items = tuple(_own(item) for item in value)
        same = isinstance(value, tuple) and all(a is b for a, b in zip(items, value, strict=True))
        return value if same else items
    if hasattr(value, "tolist"):  # NumPy's, without importing it
        return _own(value.tolist()) if type(value.tolist()) is not type(value) else value
    if isinstance(value, Integral):
        return int(value)
    try:
        return float(value) if isinstance(value, Real) else value
    except OverflowError:
        return value
