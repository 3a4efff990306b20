"""What is wrong with a spec, in a sentence: where, what was given, what is allowed, what to do."""

import re
from collections.abc import Mapping
from typing import Any, cast, get_args, get_origin, get_type_hints

import msgspec

from beamchain.checks import descriptions, literals, meant

_KINDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "a text in quotes",
    "object": "a table { ... }",
    "date": "a date",
    "time": "a time",
    "datetime": "a date",
    "array": "a list [ ... ]",
    "bool": "true or false",
    "null": "nothing",
}
#: keys that are looked for in vain, "Struct(key)", and what there is instead
SOUGHT = {
    "Loop(dt)": "a file of loops is continuous. Give bc.margins in Python a sampled controller of "
    "python-control, or add half a period to delay.",
}


def sentence(message: str, data: Mapping[str, Any], root: type) -> str:
    """msgspec's `message` on `data` as a sentence: where, what was given,
    what is allowed, what to do."""
    match = re.fullmatch(r"(.*?)(?: - at `(?:key in )?\$\.?(.*)`)?", message, re.DOTALL)
    assert match is not None
    what, path = match[1], match[2] or ""
    place = _named(path, data, root)
    unknown = re.fullmatch(r"Object contains unknown field `(.*)`", what)
    if unknown:
        struct = _struct_at(root, path, data)
        sought = None if struct is None else SOUGHT.get(f"{struct.__name__}({unknown[1]})")
        instead = sought or _keys_instead(unknown[1], place, struct, root)
        return f"{place + ': ' if place else ''}unknown key {unknown[1]!r}; {instead}"
    missing = re.fullmatch(r"Object missing required field `(.*)`", what)
    if missing:
        add = _to_add(missing[1], _struct_at(root, path, data))
        return f"{place + ': ' if place else ''}{missing[1]} is missing; add {add}."
    wrong = re.fullmatch(r"Expected `(.*)`, got `(.*)`", what)
    if wrong:
        wanted = " or ".join(
            _KINDS.get(kind.strip(), kind.strip())
            for kind in wrong[1].split("|")
            if kind.strip() != "null"
        )
        value = _value(data, place)
        shown = (
            ""
            if value is None
            else f" = {str(value)[:60]!r}"
            if isinstance(value, str)
            else f" = {str(value)[:60]}"
        )
        if (wrong[1], wrong[2]) == ("array", "object") and place in ("segment", "joint", "lump"):
            return (
                f"[{place}] is one table, but there may be several; write [[{place}]] with "
                "double brackets."
            )
        return (
            f"{place or 'the file'}{shown} is {_KINDS.get(wrong[2], wrong[2])}, but {wanted}"
            f"{_in_unit(place, data, root)} is needed; write it so."
        )
    short = re.fullmatch(r"Expected `array` of length (\d+), got (\d+)", what)
    if short:
        return f"{place} holds {short[2]} numbers, but {short[1]} are needed; give all {short[1]}."
    invalid = re.fullmatch(r"Invalid (?:enum )?value '?(.*?)'?", what)
    if invalid:
        key = place.rpartition(".")[2].partition("[")[0]
        return f"{place} = {invalid[1]!r} is not allowed; {_choose(invalid[1], key, root)}"
    return f"{place + ': ' if place else ''}{what}"


def _in_unit(place: str, data: Any, root: type) -> str:
    """The unit of the number at a place; empty where it has none."""
    table, _, name = place.rpartition(".")
    struct = _struct_at(root, table, data)
    text = "" if struct is None else descriptions(struct).get(name, "")
    unit = re.search(r" \[([^\]]+)\]$", text)
    return f" in {unit[1]}" if unit else ""


def _named(path: str, data: Any, root: type) -> str:
    """msgspec's path with the first name that does not fit where it writes `[...]` for any."""
    table, dots, rest = path.partition("[...]")
    struct, tables = _struct_at(root, table, data), _at(data, table)
    if not dots or struct is None or not isinstance(tables, Mapping):
        return path
    for name, one in cast("Mapping[str, Any]", tables).items():
        try:
            msgspec.convert(one, struct)
        except msgspec.ValidationError:
            return f"{table}.{name}{rest}"
    return path


def _to_add(field: str, struct: Any) -> str:
    """What a missing field asks for: of a list of tables one with the fields that it needs."""
    hint = None if struct is None else get_type_hints(struct).get(field)
    listed = None if get_origin(hint) is not tuple else _struct_of(hint, None)
    if listed is None:
        return f"{field} = ... there"
    required = [one.name for one in msgspec.structs.fields(listed) if one.required]
    # its own before those that it inherits
    needed = sorted(required, key=lambda name: name not in listed.__annotations__)
    return f"at least one [[{field}]] with {', '.join(needed)}"


def _choose(word: str, key: str, root: type) -> str:
    """The nearest allowed word for a key, and all of them."""
    structs = structs_of(root)
    tags = [struct.__struct_config__ for struct in structs]
    allowed = [
        str(config.tag) for config in tags if config.tag is not None and config.tag_field == key
    ]
    for struct in structs:
        allowed += literals(get_type_hints(struct).get(key))
    return (
        f"{meant(word, allowed)}choose one of {', '.join(dict.fromkeys(allowed))}."
        if allowed
        else "see `beamchain init schema`."
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


def _keys_instead(word: str, place: str, struct: Any, root: type) -> str:
    """The nearest key to a word, where it belongs if it is the key of another table,
    and the keys of its own table, which is read into `struct`."""
    if struct is None:
        return meant(word, _keys(root)).strip() or (
            "remove it; `beamchain init schema` has the keys."
        )
    here = [field for field in struct.__struct_fields__ if not field.startswith("_")]
    config = struct.__struct_config__
    table = "[" + re.sub(r"\[.*?\]", "", place) + "]" if place else "the file"
    if config.tag is not None:
        table = f'{config.tag_field} = "{config.tag}"'
        here = [str(config.tag_field), *here]
    elsewhere = "it belongs to another table; " if word in _keys(root) else ""
    return f"{meant(word, here) or elsewhere}the keys of {table} are {', '.join(here)}."


def _struct_at(root: Any, place: str, data: Any) -> Any:
    """The struct of the table at a place, where a tag decides between several by the one given;
    None where unclear."""
    struct: Any = root
    for step in re.findall(r"[A-Za-z_]\w*|\d+|\.\.\.", place):
        if step.isdigit():
            data = data[int(step)] if isinstance(data, list) and int(step) < len(data) else None
            continue
        if step == "...":
            data = None
            continue
        hint = None if struct is None else get_type_hints(struct).get(step)
        if hint is None:
            return None
        data = data.get(step) if isinstance(data, Mapping) else None
        struct = _struct_of(hint, data)
    return struct


def _struct_of(hint: Any, data: Any) -> Any:
    """The struct that a field's type names: the only one,
    or of several the one whose tag the data give."""
    arguments = [part for part in get_args(hint) if part is not type(None)]
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return hint
    several = [
        part for part in arguments if isinstance(part, type) and issubclass(part, msgspec.Struct)
    ]
    tagged = [part for part in several if part.__struct_config__.tag is not None]
    if len(tagged) > 1:
        given = (
            data.get(tagged[0].__struct_config__.tag_field) if isinstance(data, Mapping) else None
        )
        return next((part for part in tagged if part.__struct_config__.tag == given), None)
    if several:
        return several[0]
    return next(
        (found for part in arguments if (found := _struct_of(part, data)) is not None), None
    )


def _value(data: Any, place: str) -> Any:
    """What stands at a place, unless it is a table or a list."""
    found = _at(data, place)
    return None if isinstance(found, (dict, list)) else found


def _at(data: Any, place: str) -> Any:
    for step in re.findall(r"[^.\[\]]+", place):
        try:
            data = data[int(step)] if isinstance(data, list) else data[step]
        except (KeyError, IndexError, TypeError, ValueError):
            return None
    return data
