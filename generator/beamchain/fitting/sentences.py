"""What is wrong with a spec, in a sentence: where, what was given, what is allowed, what to do."""

import re
from collections.abc import Mapping
from typing import Any, Literal, get_args, get_origin, get_type_hints

import msgspec

from beamchain.checks import meant

_KINDS = {
    "float": "a number", "int": "a whole number", "str": "a text in quotes", "object": "a table { ... }",
    "date": "a date", "time": "a time", "datetime": "a date",
    "array": "a list [ ... ]", "bool": "true or false", "null": "nothing",
}  # fmt: skip


def sentence(message: str, data: Mapping[str, Any], root: type) -> str:
    """msgspec's words as a sentence: where, what was given, what is allowed, what to do.

    Args:
        message: msgspec's.
        data: what was parsed.
        root: the struct that the data should have become.
    """
    match = re.fullmatch(r"(.*?)(?: - at `(?:key in )?\$\.?(.*)`)?", message, re.DOTALL)
    assert match is not None
    what, place = match[1], match[2] or ""
    unknown = re.fullmatch(r"Object contains unknown field `(.*)`", what)
    if unknown:
        cure = meant(unknown[1], _keys(root)).strip() or "remove it; `beamchain schema` has the keys."
        if unknown[1] in _keys(root):
            here = _keys_at(root, place)
            cure = f"it belongs elsewhere; {'choose from ' + ', '.join(here) if here else '`beamchain schema` has the keys'}."
        return f"{place + ': ' if place else ''}unknown key {unknown[1]!r}; {cure}"
    missing = re.fullmatch(r"Object missing required field `(.*)`", what)
    if missing:
        return f"{place + ': ' if place else ''}{missing[1]} is missing; add {missing[1]} = ... there."
    wrong = re.fullmatch(r"Expected `(.*)`, got `(.*)`", what)
    if wrong:
        wanted = " or ".join(
            _KINDS.get(kind.strip(), kind.strip()) for kind in wrong[1].split("|") if kind.strip() != "null"
        )
        value = _value(data, match[2] or "")
        shown = (
            "" if value is None else f" = {str(value)[:60]!r}" if isinstance(value, str) else f" = {str(value)[:60]}"
        )
        if (wrong[1], wrong[2]) == ("array", "object") and place in ("segment", "joint", "lump"):
            return f"[{place}] is one table, but there may be several; write [[{place}]] with double brackets."
        return f"{place or 'the file'}{shown} is {_KINDS.get(wrong[2], wrong[2])}, but {wanted} is needed; write it so."
    short = re.fullmatch(r"Expected `array` of length (\d+), got (\d+)", what)
    if short:
        return f"{place} holds {short[2]} numbers, but {short[1]} are needed; give all {short[1]}."
    invalid = re.fullmatch(r"Invalid (?:enum )?value '?(.*?)'?", what)
    if invalid:
        key = place.rpartition(".")[2].partition("[")[0]
        return f"{place} = {invalid[1]!r} is not allowed; {_choose(invalid[1], key, root)}"
    return f"{place + ': ' if place else ''}{what}"


def _choose(word: str, key: str, root: type) -> str:
    """The nearest allowed word for a key, and all of them."""
    structs = structs_of(root)
    tags = [struct.__struct_config__ for struct in structs]
    allowed = [str(config.tag) for config in tags if config.tag is not None and config.tag_field == key]
    for struct in structs:
        hint = get_type_hints(struct).get(key)
        literals = [hint, *get_args(hint), *(a for h in get_args(hint) for a in get_args(h))]
        allowed += [str(w) for h in literals if get_origin(h) is Literal for w in get_args(h)]
    return (
        f"{meant(word, allowed)}choose one of {', '.join(dict.fromkeys(allowed))}."
        if allowed
        else "see `beamchain schema`."
    )


def structs_of(root: Any) -> list[Any]:
    """The structs in a type and all that their fields lead to, in the order of the fields."""
    found: list[Any] = []

    def walk(hint: Any) -> None:
        if isinstance(hint, type) and issubclass(hint, msgspec.Struct) and hint not in found:
            found.append(hint)
            for field in get_type_hints(hint).values():
                walk(field)
        for argument in get_args(hint):
            walk(argument)

    walk(root)
    return found


def _keys(root: type) -> list[str]:
    return sorted({field for struct in structs_of(root) for field in struct.__struct_fields__})


def _keys_at(root: Any, place: str) -> list[str]:
    """Keys of the table at a place; none where its shape decides on them."""
    for step in re.findall(r"[A-Za-z_]\w*", place):
        root = next(iter(structs_of(get_type_hints(root).get(step))), None)
        if root is None or root.__struct_config__.tag is not None:
            return []
    return list(root.__struct_fields__)


def _value(data: Any, place: str) -> Any:
    for step in re.findall(r"[^.\[\]]+", place):
        try:
            data = data[int(step)] if isinstance(data, list) else data[step]
        except (KeyError, IndexError, TypeError, ValueError):
            return None
    return None if isinstance(data, (dict, list)) else data
