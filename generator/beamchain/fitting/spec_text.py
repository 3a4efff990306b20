"""The spec as its own TOML: what a report shows so that anybody can run it again."""

import json
from typing import Any

import msgspec

from beamchain.fitting.spec import Spec


def spec_toml(spec: Spec) -> str:
    """The spec as a SPEC.toml that reads back as the same spec; what stands at its default is left out."""
    top, tables = [f"name = {_toml(spec.name)}"], list[str]()
    for key, value in _given(spec):
        if isinstance(value, msgspec.Struct):
            tables += ["", f"[{key}]", *(f"{k} = {_toml(v)}" for k, v in _given(value))]
        elif isinstance(value, tuple):
            for item in value:
                tables += ["", f"[[{key}]]", *(f"{k} = {_toml(v)}" for k, v in _given(item))]
        elif key != "name":
            top.append(f"{key} = {_toml(value)}")
    return "\n".join(top + tables)


def _given(struct: msgspec.Struct) -> list[tuple[str, Any]]:
    """Fields that do not stand at their default; the tag of a union first."""
    config = struct.__struct_config__
    out: list[tuple[str, Any]] = [(config.tag_field, config.tag)] if config.tag_field is not None else []
    for field in msgspec.structs.fields(struct):
        value = getattr(struct, field.name)
        if value is not None and (field.default is msgspec.NODEFAULT or value != field.default):
            out.append((field.encode_name, value))
    return out


def _toml(value: Any) -> str:
    if isinstance(value, msgspec.Struct):
        return f"{{ {', '.join(f'{key} = {_toml(item)}' for key, item in _given(value))} }}"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_toml(item)}' for key, item in value.items())} }}"
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(_toml(item) for item in value)}]"
    return json.dumps(value, ensure_ascii=False)
