"""Classes of the package that public functions return, found by their annotations."""

import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any, get_args

from products import PRODUCTS

#: modules with public names
PLACES = ("", ".spec", ".results", *(f".{name}" for name in PRODUCTS))


def public() -> dict[str, Any]:
    """Every public function and class, by its name as it is typed after `beamchain`."""
    out = dict[str, Any]()
    for place in PLACES:
        module = importlib.import_module(f"beamchain{place}")
        for name in module.__all__:
            thing = getattr(module, name)
            if not inspect.ismodule(thing) and thing not in out.values():
                out[f"{place}.{name}".lstrip(".")] = thing
    return out


def named(annotation: Any, space: dict[str, Any]) -> Iterator[type]:
    """The package's classes in an annotation, which may be a text."""
    if isinstance(annotation, str):
        for word in re.findall(r"\w+", annotation):
            yield from named(space[word], space) if inspect.isclass(space.get(word)) else ()
    elif inspect.isclass(annotation) and not get_args(annotation):
        if annotation.__module__.startswith("beamchain."):
            yield annotation
    else:
        for argument in get_args(annotation):
            yield from named(argument, space)


def of_call(function: Callable[..., Any]) -> list[type]:
    """What a function returns."""
    function = inspect.unwrap(function)
    return list(named(function.__annotations__.get("return"), function.__globals__))


def calls(thing: type) -> dict[str, Callable[..., Any]]:
    """Functions behind the public methods and properties of a class."""
    found: dict[str, Callable[..., Any]] = {}
    for name, value in vars(thing).items():
        inner = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
        inner = value.func if isinstance(value, cached_property) else inner
        if not name.startswith("_") and inspect.isfunction(inner):
            found[name] = inner
    return found


def by_functions() -> dict[str, type]:
    """Classes that public functions return, the public ones left out."""
    known = list(public().values())
    found = [one for function in known if inspect.isfunction(function) for one in of_call(function)]
    return {one.__name__: one for one in found if one not in known}


def by_all() -> dict[str, type]:
    """The same, with what methods and properties of those and of public classes
    return, and so on."""
    known = list(public().values())
    todo = [
        *by_functions().values(),
        *(one for one in known if inspect.isclass(one) and not issubclass(one, Exception)),
    ]
    for one in todo:
        todo += [more for call in calls(one).values() for more in of_call(call) if more not in todo]
    return {one.__name__: one for one in todo if one not in known}
