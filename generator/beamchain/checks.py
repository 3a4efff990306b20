"""The checks every input goes through on construction, and the sentences they answer with."""

import difflib
import inspect
import math
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeGuard, get_args, get_origin, get_type_hints

import msgspec

from beamchain.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LARGEST = 1e30  # beyond this a product of three inputs leaves double precision


def field(
    text: str,
    unit: str | None = None,
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
    cure: str = "",
) -> msgspec.Meta:
    """What a field of a `Struct` means, for `Annotated`: checks, docstring,
    JSON schema and templates take it from here.

    `unit`: of each number, "" for a pure one, None where there is none; `above` is exclusive,
    `least` and `most` are inclusive; `cure`: what to do about a number that is out of bounds.
    """

    def check(name: str, value: Any, *, whole: bool = False) -> None:
        if isinstance(value, tuple):
            for i, item in enumerate(value):
                check(f"{name}[{i}]", item, whole=whole)
        elif whole:
            whole_number(name, value, int(least or 0), int(most or LARGEST))
        elif most is not None:
            given = number(name, value, unit or "", cure=cure)
            low = -math.inf if above is None else above
            if not low < given <= most:
                raise InputError(
                    f"{name} = {given!r} must lie above {low:g} and "
                    f"be at most {most:g}. {cure}".strip()
                )
        else:
            plain = positive if above == 0.0 else not_negative if least == 0.0 else number
            plain(name, value, unit or "", cure=cure)

    limits = {"exclusiveMinimum": above, "minimum": least, "maximum": most}
    return msgspec.Meta(
        description=f"{text} [{unit}]" if unit else text,
        extra_json_schema={key: value for key, value in limits.items() if value is not None},
        extra={"check": None if unit is None else check},
    )


def descriptions(struct: type) -> dict[str, str]:
    """Text of each field of a struct, with its unit, by the field's name."""
    return {name: meta.description or "" for name, meta in _metas(struct).items()}


def _metas(struct: type) -> dict[str, msgspec.Meta]:
    """The annotation of each field that has one."""
    hints = get_type_hints(struct, include_extras=True)
    found = {
        name: [a for a in getattr(hints[name], "__metadata__", ()) if isinstance(a, msgspec.Meta)]
        for name in struct.__struct_fields__
    }
    return {name: metas[0] for name, metas in found.items() if metas}


class _Answering(msgspec.StructMeta):
    """Lists the fields in the docstring, and answers a call that does not fit them
    with what they are."""

    def __init__(cls, *args: Any, **kwargs: Any) -> None:  # noqa: N805
        super().__init__(*args, **kwargs)
        if texts := descriptions(cls):
            listed = "\n".join(f"    {name}: {text}." for name, text in texts.items())
            cls.__doc__ = f"{inspect.cleandoc(cls.__doc__ or '')}\n\nArgs:\n{listed}\n"

    if not TYPE_CHECKING:  # a type checker that sees it no longer sees the fields

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:  # noqa: N805
            fields = cls.__struct_fields__
            takes = f"it takes {', '.join(fields)}, each by its name."
            for name in kwargs:
                if name not in fields:
                    raise InputError(
                        f"{cls.__name__} has no field {name!r}; {meant(name, fields)}{takes}"
                    )
            if args:
                raise InputError(
                    f"{cls.__name__}: {args[0]!r:.60} is given without a name; {takes}"
                )
            try:
                return super().__call__(*args, **kwargs)
            except TypeError:
                missing = [
                    f.name
                    for f in msgspec.structs.fields(cls)
                    if f.required and f.name not in kwargs
                ]
                if not missing:
                    raise
                raise InputError(f"{cls.__name__}: {missing[0]} is missing; {takes}") from None


class Struct(msgspec.Struct, frozen=True, kw_only=True, metaclass=_Answering):
    """Base of everything that a user fills in, in Python or in TOML;
    a field's bounds stand in its annotation."""

    def __post_init__(self) -> None:
        own_numbers(self)
        for name, optional, check in _checks(type(self)):
            value = getattr(self, name)
            if not (optional and value is None):
                check(name, value)


@cache
def _checks(struct: type) -> list[tuple[str, bool, Callable[[str, Any], object]]]:
    """Per field that has a bound or a choice of words: name, whether it may be None,
    and its check."""
    out: list[tuple[str, bool, Callable[[str, Any], object]]] = []
    metas = _metas(struct)
    for name, hint in get_type_hints(struct).items():
        kinds = get_args(hint) if get_origin(hint) not in (None, Literal, tuple) else (hint,)
        optional = type(None) in kinds
        # a word or a truth value is left to the struct itself
        words = () if bool in kinds else tuple(literals(hint))
        check = ((metas[name].extra or {}).get("check") if name in metas else None) or (
            partial(_each_word, words) if words else None
        )
        if check is not None:
            out.append((name, optional, partial(check, whole=True) if int in kinds else check))
    return out


def literals(hint: Any) -> Iterator[str]:
    """The words that a type allows."""
    for part in get_args(hint):
        yield from (part,) if get_origin(hint) is Literal else literals(part)


def _each_word(words: tuple[str, ...], name: str, value: object) -> None:
    for word in value if isinstance(value, tuple) else (value,):
        one_of(name, word, words)


def preview(value: object) -> str:
    """The beginning of how Python writes a value, on one line."""
    return " ".join(f"{value!r:.60}".split())


def number(field: str, value: object, unit: str, *, cure: str = "") -> float:
    """A finite number, or an `InputError` that names the `field` and ends with the `cure`;
    `unit` "": a pure number."""
    wanted = f"a finite number{f' in {unit}' if unit else ''} is needed"
    if isinstance(value, bool) or not isinstance(value, Real):
        given = preview(value)
        raise InputError(
            f"{field} = {given} is not a number; {wanted}. "
            f"{cure or f'Write {field} = 1.0.'}".strip()
        )
    result = float(value)
    if not math.isfinite(result) or abs(result) > LARGEST:
        raise InputError(
            f"{field} = {result!r} cannot be used; {wanted}, at most {LARGEST:g}. {cure}".strip()
        )
    return result


def positive(field: str, value: object, unit: str, *, cure: str = "") -> float:
    """A finite number above zero."""
    result = number(field, value, unit, cure=cure)
    if not result > 1e-30:
        raise InputError(
            f"{field} = {result!r} must be above "
            f"{'zero' if result <= 0.0 else '1e-30'}{f' ({unit})' if unit else ''}. "
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
    if not isinstance(value, str) or value not in words:
        raise InputError(f"{field} = {value!r} is unknown; choose one of {', '.join(words)}.")


def meant(word: object, words: Iterable[str]) -> str:
    """The question whether the nearest of `words` was meant, with a space behind it;
    empty where none is near."""
    words = list(words)
    near = difflib.get_close_matches(str(word), words, n=len(words) or 1)
    if not near:
        return ""
    best = max(near, key=lambda each: _likeness(str(word), each))
    return f"did you mean {best!r}? "


def _likeness(word: str, other: str) -> tuple[float, int]:
    """How much two words have in common; of equal shares, the one in the longest piece counts."""
    matcher = difflib.SequenceMatcher(None, other, word)
    return round(matcher.ratio(), 9), matcher.find_longest_match().size


def unknown(field: str, value: object, names: Iterable[str], cure: str = "") -> InputError:
    """The answer to a name that is none of those there are."""
    known = [name for name in names if name]
    choice = f"choose from {', '.join(known)}" if known else "there is none to choose"
    more = f" {cure}" if cure else ""
    return InputError(f"{field} = {value!r} is unknown; {meant(value, known)}{choice}.{more}")


def whole_number(field: str, value: object, least: int, most: int) -> int:
    """A whole number from `least` to `most`."""
    if (
        isinstance(value, bool)
        or not isinstance(value, Integral)
        or not least <= int(value) <= most
    ):
        raise InputError(f"{field} = {value!r} must be a whole number from {least} to {most}.")
    return int(value)


def finite_array(
    field: str,
    value: object,
    *shapes: tuple[int | None, ...],
    unit: str = "",
    most: float = math.inf,
) -> "NDArray[np.float64]":
    """An array of finite numbers, none larger than `most`, of one of the shapes;
    None in a shape: any length."""
    wanted = f"finite numbers{f' ({unit})' if unit else ''}"
    if shapes:
        sizes = [
            str(tuple("any" if n is None else n for n in shape)).replace("'", "")
            for shape in shapes
        ]
        wanted += f" of the shape {' or '.join(sizes)}"
    given = as_array(field, value, wanted)
    if shapes and not any(_has_shape(given.shape, shape) for shape in shapes):
        raise InputError(
            f"{field} = {value!r:.60} has the shape {given.shape}; {wanted} are needed."
        )
    sound = (abs(given) <= most) & (abs(given) < math.inf)
    if not sound.all():
        place = [int(i[0]) for i in (~sound).nonzero()] if given.ndim else []
        limit = f", at most {most:g} in size" if math.isfinite(most) else ""
        number_at = f"{field}{place if place else ''} is {given[tuple(place)]:g}"
        raise InputError(f"{number_at}; {wanted}{limit} are needed.")
    return given


def as_array(field: str, value: object, wanted: str = "numbers") -> "NDArray[np.float64]":
    """An array of numbers of any size and shape, a copy."""
    import numpy as np

    try:
        given = np.asarray(value)
        if given.dtype.kind not in "UScV":
            return given.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InputError(f"{field} = {value!r:.60} is {kind_of(value)}; {wanted} are needed.")


def _has_shape(shape: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(shape) == len(wanted) and all(
        n in (None, size) for n, size in zip(wanted, shape, strict=True)
    )


def kind_of(value: object) -> str:
    """The type of a value with its article: "an int"."""
    name = type(value).__name__
    return f"{'an' if name[0] in 'aeiouAEIOU' else 'a'} {name}"


def of_type(field: str, value: object, kinds: type | tuple[type, ...], wanted: str) -> None:
    """`value` is of a type; `wanted` says in words what to give."""
    if not isinstance(value, kinds):
        raise InputError(f"{field} = {value!r:.60} is {kind_of(value)}; give {wanted}.")


def path_of(field: str, value: object, wanted: str = "the path of a file") -> Path:
    """A path, given as text or as one."""
    of_type(field, value, (str, PathLike), wanted)
    assert isinstance(value, str | PathLike)
    try:
        return Path(value)
    except TypeError:  # a path of bytes
        raise InputError(f"{field} = {value!r:.60} is no text; give {wanted}.") from None


def is_mjcf_text(source: object) -> TypeGuard[str]:
    """Whether a source is the text of an MJCF file and not its path."""
    return isinstance(source, str) and source.lstrip().startswith("<")


def list_of_names(field: str, value: object) -> list[str]:
    """A list of names; a single word is none."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise InputError(f'{field} = {value!r:.60} must be a list of names; write {field}=["..."].')
    out = list(value)
    for name in out:
        of_type(f"an entry of {field}", name, str, "a name")
    return [str(name) for name in out]


def true_or_false(field: str, value: object) -> bool:
    """A switch of an argument; NumPy's booleans are taken."""
    if not isinstance(value, bool) and type(value).__name__ not in ("bool", "bool_"):
        raise InputError(f"{field} = {preview(value)} is {kind_of(value)}; give True or False.")
    return bool(value)


def own_numbers(struct: msgspec.Struct) -> None:
    """Turn NumPy's scalars and arrays, fractions and lists in a struct into Python's numbers
    and tuples, in place.

    So every struct can be hashed, compared and written. What is no number stays,
    for the checks to name.
    """
    for name in struct.__struct_fields__:
        given = getattr(struct, name)
        plain = _own(given)
        if plain is not given:
            msgspec.structs.force_setattr(struct, name, plain)


def _own(value: Any) -> Any:
    if (
        value is None
        or isinstance(value, bool | msgspec.Struct)
        or type(value) in (int, float, str)
    ):
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


#: kinds of characters that show nothing, or change how others are shown: control, direction,
#: half a pair, separators
_UNSEEN = ("Cc", "Cf", "Cs", "Zl", "Zp")


def printable(text: str) -> str:
    """A text that holds users' names, as it is shown:
    what a terminal or page would act upon is spelled out."""
    if text.isprintable():
        return text
    kept = (
        c if c in "\n\t" or unicodedata.category(c) not in _UNSEEN else ascii(c)[1:-1] for c in text
    )
    return "".join(kept)
