"""The spec as its own TOML: what a report shows so that anybody can run it again."""

from typing import Any

import msgspec
import tomlkit

from beamchain.fitting.spec import Spec


def spec_toml(spec: Spec) -> str:
    """The spec as a SPEC.toml that reads back as the same spec;
    what stands at its default is left out."""
    document = tomlkit.document()
    document.add("name", tomlkit.item(spec.name))
    tables: dict[str, Any] = {}
    for key, value in _given(spec).items():
        if isinstance(value, msgspec.Struct):
            tables[key] = _table(value)
        elif isinstance(value, tuple):
            tables[key] = tomlkit.aot()
            tables[key].extend(_table(entry) for entry in value)
        elif key != "name":
            document.add(key, _value(value))
    for key, table in tables.items():  # values of the document itself stand before its tables
        document.add(key, table)
    return tomlkit.dumps(document).strip()


def _given(struct: msgspec.Struct) -> dict[str, Any]:
    """Fields that do not stand at their default; the tag of a union first."""
    config = struct.__struct_config__
    out: dict[str, Any] = {} if config.tag_field is None else {config.tag_field: config.tag}
    for field in msgspec.structs.fields(struct):
        value = getattr(struct, field.name)
        if value is not None and (field.default is msgspec.NODEFAULT or value != field.default):
            out[field.encode_name] = value
    return out


def _table(struct: msgspec.Struct) -> Any:
    table = tomlkit.table()
    for key, value in _given(struct).items():
        table.add(key, _value(value))
    return table


def _value(value: Any) -> Any:
    """A number, text or array, or an inline table of a struct or mapping."""
    if isinstance(value, msgspec.Struct):
        value = _given(value)
    if isinstance(value, dict):
        inline = tomlkit.inline_table()
        for key, entry in value.items():
            inline.add(key, _value(entry))
        return inline
    if isinstance(value, (tuple, list)):
        array = tomlkit.array()
        array.extend(_value(entry) for entry in value)
        return array
    return tomlkit.item(value)
