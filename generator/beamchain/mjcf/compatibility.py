"""Settings of a spacecraft's file that would change an appendage: compiler switches, defaults."""

from collections.abc import Iterable, Mapping

from lxml.etree import _Element as Element

from beamchain.errors import InputError

_HELD = {
    "group": "0",
    "solreflimit": "0.02 1",
    "solimplimit": "0.9 0.95 0.001 0.5 2",
    "solreffriction": "0.02 1",
    "solimpfriction": "0.9 0.95 0.001 0.5 2",
    "range": "0 0",
    "margin": "0",
    "armature": "0",
    "frictionloss": "0",
    "limited": "false",
    "actuatorfrclimited": "false",
    "actuatorfrcrange": "0 0",
}
#: MuJoCo's own values of what a parent's default could set;
#: an attribute that is not here is judged after compiling
NEUTRAL: dict[str, dict[str, str]] = {
    "joint": _HELD
    | {
        "springdamper": "0 0",
        "ref": "0",
        "springref": "0",
        "actuatorgravcomp": "false",
        "align": "auto",
    },
    "geom": {
        "group": "0",
        "condim": "3",
        "priority": "0",
        "friction": "1 0.005 0.0001",
        "solmix": "1",
        "margin": "0",
        "gap": "0",
        "solref": "0.02 1",
        "solimp": "0.9 0.95 0.001 0.5 2",
        "fluidshape": "none",
        "conaffinity": "0",
        "contype": "0",
    },
    "site": {
        "group": "0",
        "type": "sphere",
        "size": "0.005",
        "rgba": "0.5 0.5 0.5 1",
        "pos": "0 0 0",
    },
    "fixed": _HELD
    | {"stiffness": "0", "springlength": "-1", "width": "0.003", "rgba": "0.5 0.5 0.5 1"},
}

TURNS = {"quat", "euler", "axisangle", "xyaxes", "zaxis"}
REPLACES = {"fromto", "hfield"}  # what else of shapes and sites no attribute of theirs overrules

#: attributes of which a longer default would leave its last numbers behind ours
PADDED = {
    "joint": {"stiffness", "damping"},
    "fixed": {"stiffness", "damping"},
    "geom": {"size"},
    "site": set[str](),
}

#: what a default of this tag reaches
REACHES = {"joint": "joint", "geom": "geom", "site": "site", "tendon": "fixed"}


def default_attributes(parts: Iterable[Element]) -> dict[str, dict[str, int]]:
    """Attributes that defaults set where an appendage may stand, per tag of ours,
    with the most numbers one of them holds.

    A class by name reaches what stands in a body or frame with that `childclass`,
    and so do the classes around it.
    """
    parts = list(parts)
    used: set[str | None] = set()
    for part in parts:
        used |= {node.get("childclass") for node in part.iter("body", "frame", "replicate")}
    attributes: dict[str, dict[str, int]] = {}
    for part in parts:
        for default in part.iter("default"):
            parent = default.getparent()
            inner = parent is not None and parent.tag == "default"
            if inner and not any(node.get("class") in used for node in default.iter("default")):
                continue
            for node in default:
                tag = REACHES.get(str(node.tag))
                if tag is None:
                    continue
                counts = attributes.setdefault(tag, {})
                for name, value in node.attrib.items():
                    count = len(str(value).split())
                    counts[str(name)] = max(counts.get(str(name), 0), count)
    return attributes


def shield_from_defaults(appendage: Element, defaults: Mapping[str, Mapping[str, int]]) -> None:
    """Set explicitly what a parent's default would otherwise set on the appendage's elements.

    A default that turns or replaces shapes or sites is refused:
    MuJoCo 3 and 4 differ in what overrules it.
    """
    for tag, names in defaults.items():
        refused = (TURNS | REPLACES) & set(names) if tag in ("geom", "site") else set()
        if refused:
            word = min(refused)
            raise InputError(
                f"a default class of the spacecraft sets {word} on every {tag}, which would "
                f"{'turn' if word in TURNS else 'replace'} the appendage's too; take {word} "
                "out of it, or give it a class that no childclass around the place names."
            )
        for node in appendage.iter(tag):
            if node.get("name") is None:
                continue  # a tendon's reference to a joint
            for name, count in names.items():
                value = node.get(name)
                if value is None and name in NEUTRAL[tag]:
                    node.set(name, NEUTRAL[tag][name])
                elif value is not None and name in PADDED[tag]:
                    missing = max(count - len(value.split()), 0)
                    node.set(name, " ".join([value, *["0"] * missing]))


def check_compiler(parts: Iterable[Element], least_mass: float, least_inertia: float) -> None:
    """Refuse compiler switches that would change the links' masses.

    `inertiafromgeom` is none of them, even if "true": MuJoCo keeps the `<inertial>` of a body whose
    shapes have no mass, and those of links have none. `embed` compares the compiled masses with
    those of the appendage alone.

    `least_mass` [kg] of the moving links, `least_inertia` their smallest
    principal inertia [kg m^2].
    """
    settings: dict[str, str] = {}
    for part in parts:
        for compiler in part.iter("compiler"):
            settings.update({str(k): str(v) for k, v in compiler.attrib.items()})
    cure = (
        "remove it from <compiler> and give the spacecraft's own bodies their numbers with "
        "<inertial>"
    )
    for name, least, unit in (
        ("boundmass", least_mass, "kg"),
        ("boundinertia", least_inertia, "kg m^2"),
    ):
        value = _number(settings.get(name))
        if value > least:
            raise InputError(
                f"compiler {name} = {value:g} {unit} would raise the lightest link's {least:.4g} "
                f"{unit} and shift its modes; {cure}, or write {name} below {least:.4g}."
            )
    if _number(settings.get("settotalmass")) > 0.0:
        raise InputError(
            f"compiler settotalmass = {settings['settotalmass']} would scale the links' masses "
            f"with the spacecraft's; {cure}."
        )
    if settings.get("fusestatic") == "true":
        raise InputError(
            'compiler fusestatic = "true" would melt the root link into the spacecraft and lose '
            'its name; write fusestatic="false".'
        )


def _number(text: str | None) -> float:
    try:
        return float(text or 0.0)
    except ValueError:
        return 0.0
