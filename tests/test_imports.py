"""The public list, what is imported when, and which folder may know which.

No tolerances: names only.
"""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import msgspec
import pytest

import beamchain
from beamchain import spec
from products import GONE, PRODUCTS

SOURCE = Path(beamchain.__file__).parent
SENTENCE = (
    "ports",
    "structure",
    "chain",
    "mjcf",
    "engine",
    "steps",
    "fitting",
    "craft",
    "control",
    "variants",
    "studies",
    "report",
    "cli",
)
SIDE_BY_SIDE = ("control", "variants", "studies")
#: modules that a product may import of the core, and of which it imports what they list
DOORS = ("", "spec", "results", "toolkit", "commands", "report")
BASE = ("checks", "errors", "files", "import_lock", "warning_codes")  # whatever stands in these
HEAVY = ("mujoco", "lxml", "matplotlib", "control")


def modules() -> list[str]:
    """Dotted names of all modules of the package, `beamchain.` left off."""
    out = []
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        out.append(".".join(parts[:-1] if parts[-1] == "__init__" else parts))
    return [name for name in out if name and name != "__main__"]


MODULES = set(modules())


PUBLIC = {
    "Beam",
    "BeamchainError",
    "Box",
    "Custom",
    "Damping",
    "Embedded",
    "Equivalent",
    "Fit",
    "HeldInput",
    "Hub",
    "InputError",
    "Joint",
    "Linear",
    "Lump",
    "Material",
    "ModalData",
    "Modes",
    "Plant",
    "PortModel",
    "Rectangle",
    "Round",
    "Scene",
    "Segment",
    "Spec",
    "Tube",
    "align",
    "allocate",
    "compare",
    "embed",
    "fit",
    "latch",
    "linearise",
    "margins",
    "plant",
    "prove",
    "read_modes",
    "read_spec",
    "results",
    "retime",
    "spec",
    "stability",
    "start_velocity",
    "study",
    "sweep",
    "unlatch",
}


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@cache
def statements(path: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """All imports of a file, wherever they stand."""
    tree = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return tuple(node for node in tree if isinstance(node, ast.Import | ast.ImportFrom))


@cache
def imported(path: Path) -> tuple[str, ...]:
    """Modules of the package that a file imports, `beamchain.` left off;
    lazy and type-only imports too.

    Left out is the one door: results may import `beamchain.report` itself, and nothing within it.
    """
    return tuple(_imported(path))


def _imported(path: Path) -> Iterator[str]:
    for node in statements(path):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            if node.module == "beamchain":
                yield from (alias.name for alias in node.names if alias.name != "report")
            elif node.module and node.module.startswith("beamchain."):
                folder = node.module.removeprefix("beamchain.")
                inner = (f"{folder}.{alias.name}" for alias in node.names)
                yield from (name if name in MODULES else folder for name in inner)
        else:
            yield from (
                a.name.removeprefix("beamchain.")
                for a in node.names
                if a.name.startswith("beamchain.")
            )


def units() -> dict[str, set[str]]:
    """Per folder (or lone module) the others that it imports."""
    out: dict[str, set[str]] = {}
    for path in SOURCE.rglob("*.py"):
        unit = path.relative_to(SOURCE).with_suffix("").parts[0]
        if unit not in ("__init__", "__main__"):
            known = {name.partition(".")[0] for name in imported(path)} - {unit, "__version__"}
            out.setdefault(unit, set()).update(known)
    return out


# -- public ----------------------------------------------------------------------------------------
def test_the_public_list_is_pinned():
    assert set(beamchain.__all__) == PUBLIC
    assert set(dir(beamchain)) == PUBLIC


@pytest.mark.parametrize("module", [*DOORS, *PRODUCTS])
def test_every_public_name_is_there_and_documented(module):
    place = importlib.import_module(f"beamchain.{module}" if module else "beamchain")
    for name in place.__all__:
        value = getattr(place, name)
        assert value is not None
        if inspect.isfunction(value) or inspect.isclass(value):
            assert value.__doc__, name


def test_every_table_of_a_specification_is_in_spec():
    def tables(struct):
        for one in msgspec.inspect.multi_type_info([struct])[0].fields:
            yield from of_type(one.type)

    def of_type(info):
        if isinstance(info, msgspec.inspect.StructType):
            yield info.cls
            yield from (inner for field in info.fields for inner in of_type(field.type))
        for part in (*getattr(info, "types", ()), *getattr(info, "item_types", ())):
            yield from of_type(part)
        if isinstance(getattr(info, "item_type", None), msgspec.inspect.Type):
            yield from of_type(info.item_type)

    for struct in (beamchain.Spec, spec.UncertainCraft, spec.Controller):
        for table in {struct, *tables(struct)}:
            assert getattr(spec, table.__name__, None) is table, table


def test_help_names_every_public_thing():
    words = set(re.findall(r"\w+", beamchain.__doc__ or ""))
    assert words >= PUBLIC


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(
        AttributeError,
        match=r"module 'beamchain' has no attribute 'fitt'; it has .*Beam, BeamchainError",
    ):
        _ = beamchain.fitt
    with pytest.raises(AttributeError, match=r"module 'beamchain.spec' has no .*'Rot'; .*Root"):
        _ = spec.Rot


# -- what is loaded when ---------------------------------------------------------------------------
def test_importing_beamchain_loads_nothing_heavy():
    code = (
        f"import sys, beamchain; print([m for m in {(*HEAVY, 'numpy', 'scipy')!r} if m in "
        "sys.modules])"
    )
    assert run(code) == "[]"


@pytest.mark.slow
def test_port_structure_and_chain_load_nothing_heavy():
    names = [m for m in modules() if m.partition(".")[0] in ("ports", "structure", "chain")]
    assert len(names) > 10
    lines = "; ".join(f"import beamchain.{name}" for name in names)
    assert run(f"import sys; {lines}; print([m for m in {HEAVY!r} if m in sys.modules])") == "[]"


def test_the_command_line_starts_without_the_heavy_ones():
    code = f"import sys, beamchain.cli; print([m for m in {HEAVY!r} if m in sys.modules])"
    assert run(code) == "[]"


@pytest.mark.slow
def test_a_fit_needs_no_pictures():
    code = (
        "import sys, beamchain as b; e = b.Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0); "
        "f = b.fit(b.Beam(segments=(b.Segment(length=1.0, section=e),))); "
        "print(f.status.ok, [m for m in ('matplotlib', 'control', 'jinja2') if m in sys.modules])"
    )
    assert run(code) == "True []"


# -- who knows whom --------------------------------------------------------------------------------
@pytest.mark.slow
def test_each_folder_imports_only_what_stands_before_it():
    graph = units()
    for unit in SENTENCE:
        assert unit in graph
        later = graph[unit] & {*SENTENCE[SENTENCE.index(unit) + 1 :], *PRODUCTS}
        assert not later, f"{unit} imports {sorted(later)}"


def test_folders_side_by_side_do_not_know_each_other():
    graph = units()
    for unit in SIDE_BY_SIDE:
        assert not graph[unit] & (set(SIDE_BY_SIDE) - {unit}), unit


def test_no_product_knows_another():
    graph = units()
    for unit in PRODUCTS:
        assert not graph[unit] & (set(PRODUCTS) - {unit}), unit


def listed(door: str) -> set[str]:
    """The names of a door, and the modules that `from beamchain import` may name."""
    stub = SOURCE / door / "__init__.pyi"
    stub = stub if stub.exists() else SOURCE / f"{door}.pyi"
    nodes = ast.parse(stub.read_text(encoding="utf-8")).body
    names = {a.name for node in nodes if isinstance(node, ast.ImportFrom) for a in node.names}
    return names if door else {*names, *DOORS, "__version__"}


def test_a_product_knows_only_public_names_of_the_core():
    doors = {f"beamchain.{door}".rstrip("."): listed(door) for door in DOORS}
    base = {f"beamchain.{name}" for name in BASE}
    used: dict[str, set[str]] = {door: set() for door in doors}
    for unit in PRODUCTS:
        for path in (SOURCE / unit).rglob("*.py"):
            for node in statements(path):
                names = {alias.name for alias in node.names}
                if isinstance(node, ast.Import):
                    assert not any(name.startswith("beamchain") for name in names), path
                    continue
                place = str(node.module)
                own = place == f"beamchain.{unit}" or place.startswith(f"beamchain.{unit}.")
                if not place.startswith("beamchain") or own or place in base:
                    continue
                names -= {unit} if place == "beamchain" else set()
                assert place in doors, f"{path}: {place}"
                assert names <= doors[place], f"{path}: {sorted(names - doors[place])}"
                used[place] |= names
    for door in ("beamchain.toolkit", "beamchain.commands"):
        # they hold nothing for show, though maybe for a product that was taken out
        assert used[door] == doors[door] or GONE, sorted(doors[door] - used[door])


def test_studies_are_of_appendages_alone():
    assert "craft" not in units()["studies"]


def folders() -> dict[str, set[str]]:
    """Per folder of modules, at every depth, the folders of the modules that it imports."""
    out: dict[str, set[str]] = {}
    for path in SOURCE.rglob("*.py"):
        place = path.relative_to(SOURCE).with_suffix("")
        if place.parts[0] not in {*SENTENCE, *PRODUCTS} or place.name == "__init__":
            continue
        known = {
            name.rpartition(".")[0]
            for name in imported(path)
            if name in MODULES and not SOURCE.joinpath(*name.split(".")).is_dir()
        }
        here = ".".join(place.parts[:-1])
        out.setdefault(here, set()).update(known - {here, ""})
    return out


def test_no_two_folders_import_each_other_at_any_depth():
    graph = folders()
    assert {"report.tables", "structure.readers"} <= set(graph)
    while graph:
        free = [name for name, known in graph.items() if not known & graph.keys()]
        assert free, f"these import each other: {sorted(graph)}"
        for name in free:
            del graph[name]


def test_every_folder_has_its_place():
    assert set(units()) == {
        *SENTENCE,
        *PRODUCTS,
        *BASE,
        "commands",
        "examples",
        "results",
        "spec",
        "toolkit",
    }


def test_no_module_is_imported_in_a_circle():
    places = {name: SOURCE.joinpath(*name.split(".")) for name in MODULES}
    files = {
        name: place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
        for name, place in places.items()
    }
    graph = {name: set(imported(file)) & MODULES for name, file in files.items()}
    while graph:
        free = [name for name, known in graph.items() if not known & graph.keys()]
        assert free, f"these import each other: {sorted(graph)}"
        for name in free:
            del graph[name]


def test_errors_know_nobody():
    assert units()["errors"] == set()


def test_only_one_place_imports_mujoco():
    for path in SOURCE.rglob("*.py"):
        nodes = statements(path)
        names = {a.name for node in nodes if isinstance(node, ast.Import) for a in node.names}
        names |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
        # a user's script is none of the package
        if path.name != "library.py" and path.parent.name != "examples":
            assert "mujoco" not in names, path


def test_the_door_leads_to_no_module():
    """Also after the modules behind it are loaded, which Python makes attributes of the package."""
    from beamchain import report

    homes = ast.parse((SOURCE / "report" / "__init__.pyi").read_text(encoding="utf-8")).body
    for node in homes:
        importlib.import_module(f"beamchain.report.{node.module}")
        for name in (alias.name for alias in node.names):
            assert not inspect.ismodule(getattr(report, name)), name
