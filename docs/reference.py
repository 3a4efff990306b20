"""The reference pages of the documentation, generated from the package when the site is built.

`pages()` maps a path below docs/ to its text: keys of TOML files (from their JSON schema), commands
and options (from typer), warning codes, and one page per public name, which autodoc fills.
"""

import inspect
import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import msgspec
import typer

import beamchain
from beamchain.cli import app
from beamchain.warning_codes import CODES

SOURCE = Path(beamchain.__file__).parent
#: packages beside the core, and those that are there
BESIDE = ("robust", "pointing", "identification", "worlds")
PRODUCTS = tuple(name for name in BESIDE if (SOURCE / name / "__init__.py").is_file())
#: modules whose public names stand beside those of `beamchain`
MODULES = ("spec", "results", *PRODUCTS)
#: TOML files that a user writes: page, title, what it is, and the struct that reads it
FILES = (
    (
        "specification",
        "Keys of a specification",
        "A `SPEC.toml` describes one appendage (`beamchain fit`).",
        "Spec",
    ),
    (
        "controller",
        "Keys of a controller",
        "A `LOOPS.toml` is given to `beamchain plant --controller`.",
        "spec.Controller",
    ),
    (
        "craft",
        "Keys of an uncertain spacecraft",
        "A `CRAFT.toml` is given to `beamchain sweep --uncertain` and `beamchain worst-case "
        "--uncertain`.",
        "spec.UncertainCraft",
    ),
    (
        "disturbances",
        "Keys of disturbances",
        "A `DISTURBANCES.toml` is given to `pointing.budget` and `beamchain pointing`.",
        "pointing.Disturbances",
    ),
)
#: classes that public functions return, and which call returns each
RESULTS = {
    "Comparison": "bc.compare(a, b)",
    "Embedded": "bc.embed(craft, mounts)",
    "Fit": "bc.fit(spec)",
    "Identification": "identification.identify(logs, craft, mount)",
    "Instability": "bc.margins(plant, controller).instabilities",
    "Latched": "bc.latch(model, data, joint)",
    "Linear": "bc.Linear.of(model)",
    "Linearisation": "bc.linearise(model)",
    "LoopMargins": "bc.margins(plant, controller).loops",
    "Margins": "bc.margins(plant, controller)",
    "Plant": "bc.plant(model, inputs, outputs)",
    "Recorder": "embedded.recorder()",
    "Recovery": "embedded.recover(data, place)",
    "Pointing": "pointing.budget(craft, disturbances)",
    "Retimed": "bc.retime(model, timestep)",
    "ScheduledPlant": 'bc.plant(model, inputs, outputs, pose={"drive": angles})',
    "StabilityStudy": "bc.stability(source)",
    "Study": "bc.study(spec)",
    "Sweep": "bc.sweep(source, samples)",
    "UncertainPlant": "robust.uncertain(plant, craft)",
    "Worlds": "worlds.make(model, variants)",
    "GainBound": "robust.uncertain(plant, craft).bound(controller)",
    "WorstCase": "robust.uncertain(plant, craft).worst_case(controller)",
    "WorstCases": "robust.worst_case(scheduled, craft, controller)",
    "WorstMargins": "robust.uncertain(plant, craft).worst_margins(controller)",
    "WorstMarginsOfPoses": "robust.worst_margins(scheduled, craft, controller)",
}
#: classes that these and public classes hold: shown on the same page
PARTS = {
    "Beam": ("structure.mass_line.Moments",),
    "Embedded": (
        "craft.appendage.Appendage",
        "craft.assembly.Assembly",
        "craft.coupled_modes.Mode",
        "craft.error.CraftError",
        "engine.bench.Composite",
        "steps.cures.Cure",
        "steps.step_map.TimeError",
        "steps.step_map.ShiftedPeak",
        "steps.sampled.SampledError",
    ),
    "Fit": (
        "fitting.result.Status",
        "fitting.look.Look",
        "fitting.result.ModeRow",
        "fitting.kept.Choice",
        "fitting.kept.LeftOut",
        "steps.limits.StepLimits",
        "steps.limits.StepChoice",
        "steps.poles.PoleRow",
        "fitting.result.InSpace",
        "chain.chain.Chain",
        "structure.mass_line.MassLine",
    ),
    "Identification": (
        "identification.result.IdentifiedMode",
        "identification.initial_model.Order",
    ),
    "Linear": (
        "engine.linear.Signal",
        "engine.linear.Inputs",
        "engine.linear.Outputs",
        "engine.linear.Activations",
        "engine.normal_modes.NormalModes",
    ),
    "Linearisation": ("engine.linearise.Held",),
    "Margins": ("ports.peaks.Extremum",),
    "Plant": ("engine.allocation.Allocated",),
    "Recorder": ("engine.root_motion.Run",),
    "Recovery": (
        "craft.histories.Extreme",
        "craft.histories.History",
        "structure.sections_at.Sections",
    ),
    "Pointing": (
        "pointing.error_indices.ErrorIndex",
        "pointing.pointing.WorstError",
        "pointing.source_errors.SourceError",
        "pointing.wheel_run.WheelRun",
        "pointing.wheel_sweep.SpeedCurve",
    ),
    "Retimed": ("steps.forms.ModeTime",),
    "Segment": (
        "structure.segment.Stations",
        "structure.section.Geometry",
        "structure.section.Outline",
    ),
    "Slosh": ("structure.slosh.Pendulums",),
    "StabilityStudy": (
        "craft.stability.StepRow",
        "craft.slews.SlewRow",
        "craft.slews.SlewBody",
        "steps.budget.Budget",
        "steps.large_motion.LargeMotion",
    ),
    "Study": ("studies.pareto.Reach", "studies.run_time.Point", "studies.field.Entry"),
    "Sweep": ("fitting.quantity.Quantity",),
    "UncertainPlant": (
        "robust.lft.Block",
        "robust.uncertain_loop.UncertainLoop",
        "robust.uncertain_loop.Reach",
        "robust.uncertain_loop.Sample",
        "control.closed_loop.ClosedLoop",
        "robust.least_margins.LeastMargin",
    ),
}
GYM, GYM_CLASSES = "worlds.gym", ("worlds.satellite.Satellite",)
#: type of error: the built-in one that it also is, meaning, cure
ERRORS = {
    "InputError": (
        "ValueError",
        "a value, a file or an option cannot be used",
        "change the field that is named",
    ),
    "RealisationError": (
        "ArithmeticError",
        "no physical chain has the wanted behaviour",
        "fewer modes, or another `root.target`",
    ),
    "EngineError": (
        "RuntimeError",
        "MuJoCo refuses a model",
        "correct the MJCF file where MuJoCo points",
    ),
    "OutputError": (
        "OSError",
        "a file exists or cannot be written",
        "`--force` (`force=True`), or another folder",
    ),
}
ABOUT_WARNINGS = """# Warnings and errors

Warnings appear on the console, in reports and in the JSON output. There each is
`{"code": "gravity", "message": "..."}`. In Python each item of `.warnings` has a `.code`. Sentences
may be reworded; codes do not change.

An error ends a command with exit status 2, and nothing is written. Its sentence names the field,
the value, what is allowed and the cure. With `--json` it is also printed as
`{"error": {"message": "...", "type": "InputError"}}`. In Python all types are `bc.BeamchainError`:

| type | also | meaning | cure |
|---|---|---|---|
"""
STATUS = """
Exit status 3 is no error: files were written, but a requirement was not met, which `status` or a
warning names.

"""
WORDS = {
    "number": "number",
    "integer": "whole number",
    "string": "text",
    "boolean": "true or false",
    "null": "",
}


# -- the specification -----------------------------------------------------------------------------
def options(prop: dict[str, Any]) -> list[dict[str, Any]]:
    """The alternatives of a property, those of nested unions included."""
    return [deep for one in prop["anyOf"] for deep in options(one)] if "anyOf" in prop else [prop]


def target(prop: dict[str, Any]) -> str | None:
    """The definition to which a property refers."""
    return prop["$ref"].rsplit("/", 1)[1] if "$ref" in prop else None


def tables(definitions: dict[str, Any], root: str) -> dict[str, str]:
    """Heading of every definition, in the order in which the file comes to it."""
    places: dict[str, list[str]] = {root: []}
    todo = [("", root)]
    for path, name in todo:
        for key, prop in definitions[name]["properties"].items():
            place = f"{path}.{key}" if path else key
            for one in options(prop):
                many = one.get("type") == "array"
                named = one.get("additionalProperties")
                inner = one["items"] if many else named
                for found in options(inner) if isinstance(inner, dict) else [one]:
                    if (deep := target(found)) is None:
                        continue
                    full = f"{place}.NAME" if isinstance(named, dict) else place
                    text = f"[[{full}]]" if many else full if path else f"[{full}]"
                    if deep not in places:
                        todo.append((full, deep))
                    places.setdefault(deep, []).append(f"`{text}`")
    return {name: _heading(definitions[name], where) for name, where in places.items()}


def _heading(definition: dict[str, Any], places: list[str]) -> str:
    """What a table is called that may stand at these places."""
    if not places:
        return "Top level"
    shape = definition["properties"].get("shape")
    where = ", ".join(places) if len(places) < 3 else f"{places[0]} and others"
    return where + (f', shape "{shape["enum"][0]}"' if shape else "")


def kind(prop: dict[str, Any], root: str) -> str:
    """The type of a key in words, tables with a link on the page of `root`."""
    said = []
    for one in options(prop):
        if deep := target(one):
            said.append(f"[{deep.lower() if len(options(prop)) > 2 else 'table'}](#{root}-{deep})")
        elif "enum" in one:
            said.append(", ".join(f'`"{word}"`' for word in one["enum"]))
        elif one.get("type") == "array":
            inner = one["items"] or one["prefixItems"][0]
            many = (
                f" of {one['minItems']}"
                if "minItems" in one and one["minItems"] == one.get("maxItems")
                else ""
            )
            said.append(f"list{many}: {kind(inner, root)}")
        elif one.get("type") == "object":
            said.append(f"table: {kind(one['additionalProperties'], root)} per key")
        else:
            said.append(WORDS[one["type"]])
    return " or ".join(dict.fromkeys(word for word in said if word))


def bounds(prop: dict[str, Any]) -> str:
    """The bounds of a number."""
    signs = {"exclusiveMinimum": "> ", "minimum": "≥ ", "maximum": "≤ "}
    return ", ".join(f"{sign}{prop[key]:g}" for key, sign in signs.items() if key in prop)


def default(prop: dict[str, Any], required: bool) -> str:
    """The default of a key, as it would be typed."""
    given = prop.get("default")
    if required or given is None or isinstance(given, dict) or given in ([], ()):
        return "required" if required else ""
    return f"`{json.dumps(given)}`"


def keys(title: str, about: str, struct: type) -> str:
    """Every key of a TOML file."""
    definitions = msgspec.json.schema(struct)["$defs"]
    out = [
        f"# {title}\n",
        f"{about} Units are SI and radians. A key that is not required may be left out; where "
        "it has no default, its description says what then holds.\n",
    ]
    for name, heading in tables(definitions, struct.__name__).items():
        table = definitions[name]
        rows = []
        for key, prop in table["properties"].items():
            text = prop.get("description", "")
            unit = re.search(r"\s\[([^\]]+)\]$", text)
            cells = (
                f"`{key}`",
                text[: unit.start()] if unit else text,
                kind(prop, struct.__name__),
                unit[1] if unit else "",
                default(prop, key in table.get("required", [])),
                bounds(prop),
            )
            rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        head = "| key | meaning | type | unit | default | bounds |\n|---|---|---|---|---|---|"
        about = table.get("description", "").split("\n\n")[0]
        out += [
            f"({struct.__name__}-{name})=\n## {heading}\n",
            f"{about}\n",
            "\n".join([head, *rows]) + "\n",
        ]
    return "\n".join(out)


# -- the command line ------------------------------------------------------------------------------
def commands() -> str:
    """Every command with its options."""
    group: Any = typer.main.get_command(app)
    out = [
        "# Commands\n",
        "Generated from the command line itself; `beamchain COMMAND --help` prints the same. Exit "
        "status: 0 success; 2 wrong input, nothing written; 3 files written, but a requirement was "
        "not met.\n",
    ]
    for name, command in group.commands.items():
        if command.hidden:
            continue
        paragraphs = inspect.cleandoc(command.help).split("\n\n")
        examples = [
            text.removeprefix("Example: ") for text in paragraphs if text.startswith("Example: ")
        ]
        rows = []
        for parameter in command.params:
            words = [*parameter.opts, *parameter.secondary_opts]
            option = any(word.startswith("-") for word in words)
            metavar = parameter.metavar or ("" if option else parameter.name.upper())
            flag = getattr(parameter, "is_flag", False)
            called = ", ".join(f"`{word}`" for word in words) if option else ""
            value = "" if flag or not metavar else f"`{metavar}`"
            given = parameter.default
            plain = given is not None and not callable(given) and not (flag and given is False)
            text = f"`{given}`" if plain and type(given) in (bool, int, float, str) else ""
            cells = (
                f"{called} {value}",
                "required" if parameter.required else text,
                _plain(parameter.help or ""),
            )
            rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        out += [
            f"## beamchain {name}\n",
            *(f"{text}\n" for text in paragraphs if not text.startswith("Example: ")),
            "```sh\n" + "\n".join(examples) + "\n```\n",
            "| argument or option | default | meaning |\n|---|---|---|\n" + "\n".join(rows) + "\n",
        ]
    return "\n".join(out)


def _plain(text: str) -> str:
    """A help text without typer's escapes; what is typed is code."""
    return re.sub(r"(?<![`\w-])(--[a-z][a-z-]*)", r"`\1`", text.replace("\\[", "["))


# -- the Python interface --------------------------------------------------------------------------
def names() -> dict[str, str]:
    """The public names, and the module that each is typed after."""
    out = dict[str, str]()
    for module in ("beamchain", *(f"beamchain.{name}" for name in MODULES)):
        place = import_module(module)
        things = {name: getattr(place, name) for name in place.__all__}
        shown = [name for name, thing in things.items() if not inspect.ismodule(thing)]
        out |= {name: module for name in sorted(shown) if name not in out}
    return out


def python() -> dict[str, str]:
    """A page per public name, and the list of all."""
    pages, rows = {}, {}
    for name, module in names().items():
        thing = getattr(import_module(module), name)
        typed = f"{module.replace('beamchain', 'bc')}.{name}"
        call = RESULTS.get(name)
        group = (
            "Functions"
            if not inspect.isclass(thing)
            else "Errors"
            if issubclass(thing, Exception)
            else "Classes"
            if call is None
            else "Results"
        )
        inherited = _inherited(thing) if group == "Results" else []
        what = "autofunction" if group == "Functions" else "autoclass"
        options = {
            "Classes": [":members:"],
            "Errors": [":show-inheritance:"],
            "Results": [":members:", *inherited],
        }.get(group, [])
        about = "" if call is None else _returned_by(call)
        pages[f"reference/python/{name}.md"] = _page(
            typed, about, _shown(what, f"{module}.{name}", *options), name
        )
        cells = [f"[{typed}]({name}.md)", *([] if call is None else [f"`{call}`"]), _first(thing)]
        rows.setdefault(group, []).append(f"| {' | '.join(cells)} |")
    if "worlds" in PRODUCTS:
        shown = _shown("automodule", f"beamchain.{GYM}", ":no-index:") + "".join(
            _shown("autoclass", f"beamchain.{name}", ":members:", ":no-inherited-members:")
            for name in GYM_CLASSES
        )
        pages["reference/results/gym.md"] = _page(f"beamchain.{GYM}", "", shown, "")
        gym = f'gymnasium.make("beamchain.{GYM}:beamchain/FlexibleSatellite-v0")'
        rows["Results"].append(
            f"| [beamchain.{GYM}](../results/gym.md) | `{gym}` | the Gymnasium environment |"
        )
    text = ["# Python\n\n`import beamchain as bc`. Every example is run by the tests.\n"]
    for group in ("Functions", "Results", "Classes", "Errors"):
        head = "| name | what it is |\n|---|---|"
        if group == "Results":
            text.append("## What the functions return\n")
            head = "| class | returned by | what it is |\n|---|---|---|"
        else:
            text.append(f"## {group}\n")
        text.append(f"{head}\n" + "\n".join(rows[group]) + "\n")
    every = [*names(), *(["../results/gym"] if "worlds" in PRODUCTS else [])]
    text.append("```{toctree}\n:hidden:\n\n" + "\n".join(every) + "\n```\n")
    return {**pages, "reference/python/index.md": "\n".join(text)}


def _inherited(thing: type) -> list[str]:
    """The option that shows members of a base class of ours; those of control.StateSpace stand in
    its docs."""
    ours = thing.__base__ is not None and thing.__base__.__module__.startswith("beamchain.")
    return [":inherited-members: StateSpace"] if ours else []


def _returned_by(call: str) -> str:
    """The call that returns a class, with a link to its page."""
    function = re.match(r"bc\.([a-z]\w*)", call)
    see = f", see [bc.{function[1]}]({function[1]}.md)." if function else "."
    return f"Returned by `{call}`{see}\n\n"


def _shown(what: str, name: str, *options: str) -> str:
    """An autodoc directive."""
    return f".. {what}:: {name}\n" + "".join(f"   {option}\n" for option in options) + "\n"


def _page(title: str, about: str, shown: str, name: str) -> str:
    """A page of what autodoc shows, with the parts of a class below it."""
    parts = "".join(
        _shown("autoclass", f"beamchain.{part}", ":members:", *_told(part))
        for part in PARTS.get(name, ())
    )
    text = f"# {title}\n\n{about}```{{eval-rst}}\n{shown}```\n"
    return text + (f"\n## Its parts\n\n```{{eval-rst}}\n{parts}```\n" if parts else "")


def _told(part: str) -> list[str]:
    """The option that leaves out fields of a tuple that its docstring tells,
    or which have a comment of their own."""
    thing = _thing(part)
    source = inspect.getsource(thing)
    fields = [
        field
        for field in getattr(thing, "_fields", ())
        if not re.search(rf"^    {field}: .*#:", source, re.M)
    ]
    return [f":exclude-members: {', '.join(fields)}"] if fields else []


def is_there(name: str) -> bool:
    """Whether the package that a name below `beamchain` stands in has not been taken out."""
    first = name.partition(".")[0]
    return first in PRODUCTS or first not in BESIDE


def _thing(name: str) -> Any:
    """What a name below `beamchain` is of."""
    module, _, last = f"beamchain.{name}".rpartition(".")
    return getattr(import_module(module), last)


def _first(thing: Any) -> str:
    """The first paragraph of a docstring, for a table."""
    return (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ").replace("|", "\\|")


def warnings() -> str:
    """Every type of error, and every warning code, with its meaning and cure."""
    sections = [
        f"## {code}\n\n{meaning[0].upper()}{meaning[1:]}.\n\n**Cure:** {cure}\n"
        for code, (meaning, cure) in CODES.items()
    ]
    rows = [
        f"| `{name}` | `{also}` | {meaning} | {cure} |\n"
        for name, (also, meaning, cure) in ERRORS.items()
    ]
    return ABOUT_WARNINGS + "".join(rows) + STATUS + "\n".join(sections)


def pages() -> dict[str, str]:
    """Path below docs/ and text of every generated page."""
    files = {
        f"reference/{name}.md": keys(title, about, _thing(struct))
        for name, title, about, struct in FILES
        if is_there(struct)
    }
    listed = {"reference/commands.md": commands(), "reference/warnings.md": warnings()}
    return {**files, **listed, **python()}
