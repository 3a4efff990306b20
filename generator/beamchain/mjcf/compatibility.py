"""What in a spacecraft's file would spoil an appendage put into it: compiler switches, defaults that reach it."""

from collections.abc import Iterable, Mapping

from lxml.etree import _Element as Element

from beamchain.errors import InputError

_HELD = {
    "group": "0", "solreflimit": "0.02 1", "solimplimit": "0.9 0.95 0.001 0.5 2", "solreffriction": "0.02 1",
    "solimpfriction": "0.9 0.95 0.001 0.5 2", "range": "0 0", "margin": "0", "armature": "0", "frictionloss": "0",
    "limited": "false", "actuatorfrclimited": "false", "actuatorfrcrange": "0 0",
}  # fmt: skip
#: MuJoCo's own values of what a parent's default could set; an attribute that is not here is judged after compiling
NEUTRAL: dict[str, dict[str, str]] = {
    "joint": _HELD | {
        "springdamper": "0 0", "ref": "0", "springref": "0", "actuatorgravcomp": "false", "align": "auto",
    },
    "geom": {
        "group": "0", "condim": "3", "priority": "0", "friction": "1 0.005 0.0001", "solmix": "1", "margin": "0",
        "gap": "0", "solref": "0.02 1", "solimp": "0.9 0.95 0.001 0.5 2", "fluidshape": "none", "conaffinity": "0",
        "contype": "0",
    },
    "site": {"group": "0", "type": "sphere", "size": "0.005", "rgba": "0.5 0.5 0.5 1", "pos": "0 0 0"},
    "fixed": _HELD | {"stiffness": "0", "springlength": "-1", "width": "0.003", "rgba": "0.5 0.5 0.5 1"},
}  # fmt: skip

TURNS = {"quat", "euler", "axisangle", "xyaxes", "zaxis"}
REPLACES = {"fromto", "hfield"}  # what else of shapes and sites no attribute of theirs overrules

#: attributes of which a longer default would leave its last numbers behind ours
PADDED = {"joint": {"stiffness", "damping"}, "fixed": {"stiffness", "damping"}, "geom": {"size"}, "site": set[str]()}

#: what a default of this tag reaches
REACHES = {"joint": "joint", "geom": "geom", "site": "site", "tendon": "fixed"}


def hostile(parts: Iterable[Element]) -> dict[str, dict[str, int]]:
    """Attributes that defaults set where an appendage may stand, per tag of ours, with the most numbers one of them holds.

    A class by name reaches what stands in a body or frame with that `childclass`, and so do the classes around it.
    """
    parts = list(parts)
    used = {node.get("childclass") for part in parts for node in part.iter("body", "frame", "replicate")}
    out: dict[str, dict[str, int]] = {}
    for part in parts:
        for default in part.iter("default"):
            parent = default.getparent()
            inner = parent is not None and parent.tag == "default"
            if inner and not any(node.get("class") in used for node in default.iter("default")):
                continue
            for node in default:
                tag = REACHES.get(str(node.tag))
                if tag is not None:
                    for name, value in node.attrib.items():
                        found = out.setdefault(tag, {})
                        found[str(name)] = max(found.get(str(name), 0), len(str(value).split()))
    return out


def shield(appendage: Element, found: Mapping[str, Mapping[str, int]]) -> None:
    """Say explicitly what a parent's default would otherwise set on the appendage's elements.

    One that turns or replaces shapes or sites is refused: MuJoCo 3 and 4 differ in what overrules that.
    """
    for tag, names in found.items():
        turned = (TURNS | REPLACES) & set(names) if tag in ("geom", "site") else set()
        if turned:
            word = min(turned)
            raise InputError(
                f"a default class of the spacecraft sets {word} on every {tag}, which would "
                f'{"turn" if word in TURNS else "replace"} the appendage\'s too; use form "attach", which no default of '
                f"the spacecraft reaches, or take {word} out of it."
            )
        for node in appendage.iter(tag):
            if node.get("name") is None:
                continue  # a tendon's reference to a joint
            for name, count in names.items():
                own = node.get(name)
                if own is None and name in NEUTRAL[tag]:
                    node.set(name, NEUTRAL[tag][name])
                elif own is not None and name in PADDED[tag] and len(own.split()) < count:
                    node.set(name, " ".join([own, *["0"] * (count - len(own.split()))]))  # nothing left over behind it


def check_compiler(parts: Iterable[Element], least_mass: float, least_inertia: float) -> None:
    """Refuse compiler switches that would change the links' masses.

    `least_mass` [kg] of the moving links, `least_inertia` their smallest principal inertia [kg m^2].
    """
    settings: dict[str, str] = {}
    for part in parts:
        for compiler in part.iter("compiler"):
            settings.update({str(k): str(v) for k, v in compiler.attrib.items()})
    cure = "remove it from <compiler> and give the spacecraft's own bodies their numbers with <inertial>"
    if settings.get("inertiafromgeom") == "true":
        raise InputError(
            "compiler inertiafromgeom = \"true\" would replace the links' inertias by their (massless) geoms'; "
            'write inertiafromgeom="auto", which uses geoms only where a body has no <inertial>.'
        )
    for name, least, unit in (("boundmass", least_mass, "kg"), ("boundinertia", least_inertia, "kg m^2")):
        value = _number(settings.get(name))
        if value > least:
            raise InputError(
                f"compiler {name} = {value:g} {unit} would raise the lightest link's {least:.4g} {unit} and shift "
                f"its modes; {cure}, or write {name} below {least:.4g}."
            )
    if _number(settings.get("settotalmass")) > 0.0:
        raise InputError(
            f"compiler settotalmass = {settings['settotalmass']} would scale the links' masses with the "
            f"spacecraft's; {cure}."
        )
    if settings.get("fusestatic") == "true":
        raise InputError(
            'compiler fusestatic = "true" would melt the root link into the spacecraft and lose its name; '
            'write fusestatic="false".'
        )


def _number(text: str | None) -> float:
    try:
        return float(text or 0.0)
    except ValueError:
        return 0.0
