"""Change formulas of the package one at a time, and say which changes the quick tests notice.

`python tests/mutants.py --seed n` draws 200 changes of constants, signs, operators, indices and
comparisons inside functions of FOLDERS. Each goes into a temporary copy of the package, on which
the quick tests of the same folder run, those of `make quick` first; tests that fail unchanged are
left out.
"""

import argparse
import ast
import multiprocessing
import os
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

# imported once for all the processes
import mujoco  # noqa: F401  # isort: skip
import scipy.optimize  # noqa: F401  # isort: skip

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "generator" / "beamchain"
FOLDERS = (
    *("ports", "structure", "chain", "engine", "steps"),
    *("fitting", "craft", "plants", "variants"),
)
ROUNDING = 1e-6  # constants up to here are thresholds of rounding, and stay
OPERATORS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.Pow: ("**", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Lt: ("<", ">="),
    ast.LtE: ("<=", ">"),
    ast.Gt: (">", "<="),
    ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
}


@dataclass(frozen=True)
class Change:
    """`old` becomes `new` at byte `column` of `line` (from 1) of `file`, relative to PACKAGE."""

    file: str
    line: int
    column: int
    old: str
    new: str

    @property
    def folder(self) -> str:
        """Folder of the package, and of its tests."""
        return self.file.split("/")[0]

    def within(self, source: bytes) -> bytes:
        """The source with the change."""
        lines = source.splitlines(keepends=True)
        text, old = lines[self.line - 1], self.old.encode()
        if text[self.column : self.column + len(old)] != old:
            raise ValueError(f"{self.file}:{self.line} has no {self.old!r} at {self.column}")
        rest = text[self.column + len(old) :]
        lines[self.line - 1] = text[: self.column] + self.new.encode() + rest
        return b"".join(lines)


def changes(file: str, source: bytes) -> list[Change]:
    """Every change of the functions of one file, in its order; messages and types stay."""
    lines = source.splitlines()
    found = set[Change]()

    def between(left: ast.expr, right: ast.expr, kind: ast.AST) -> None:
        """Change the operator that stands between two operands, on a line of its own or theirs."""
        old, new = OPERATORS.get(type(kind), ("", ""))
        first, last = left.end_lineno or 0, right.lineno
        for number in range(first, last + 1):
            start = (left.end_col_offset or 0) if number == first else 0
            end = right.col_offset if number == last else None
            at = lines[number - 1][start:end].split(b"#")[0].find(old.encode()) if old else -1
            if at >= 0:
                found.add(Change(file, number, start + at, old, new))
                return

    def constant(node: ast.Constant, *, index: bool) -> None:
        value, old = node.value, lines[node.lineno - 1][node.col_offset : node.end_col_offset]
        if type(value) is int:
            new = str(value + 1)
        elif type(value) is float and not 0.0 < value <= ROUNDING and not index:
            new = repr(value * 1.1 if value else 0.1)
        else:
            return
        found.add(Change(file, node.lineno, node.col_offset, old.decode(), new))

    def walk(node: ast.AST, *, inside: bool, index: bool = False) -> None:
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert):
            return
        inside = inside or isinstance(node, ast.FunctionDef)
        if inside and isinstance(node, ast.BinOp):
            between(node.left, node.right, node.op)
        elif inside and isinstance(node, ast.Compare):
            operands = [node.left, *node.comparators]
            for left, right, kind in zip(operands, operands[1:], node.ops, strict=False):
                between(left, right, kind)
        elif inside and isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            found.add(Change(file, node.lineno, node.col_offset, "-", ""))
        elif inside and isinstance(node, ast.Constant):
            constant(node, index=index)
        for name, child in ast.iter_fields(node):
            if name in (
                "annotation",
                "returns",
                "args" if isinstance(node, ast.FunctionDef) else "",
            ):
                continue
            within = index or (isinstance(node, ast.Subscript) and name == "slice")
            for part in child if isinstance(child, list) else [child]:
                if isinstance(part, ast.AST):
                    walk(part, inside=inside, index=within)

    walk(ast.parse(source), inside=False)
    return sorted(found, key=lambda change: (change.line, change.column))


class _Tests:
    """Plugin of pytest: leaves out the tests `without`, and keeps which failed."""

    def __init__(self, without: frozenset[str]) -> None:
        self.without, self.failed = without, list[str]()

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = [item for item in items if item.nodeid not in self.without]

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.append(report.nodeid)


def _run(generator: str, folder: str, without: frozenset[str], options: list[str], pipe) -> None:
    """In a process of its own: send status and failures of a folder's tests to `pipe`."""
    sys.path.insert(0, generator)
    os.environ["PYTHONPATH"] = generator  # for the commands that tests start
    os.chdir(ROOT)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    tests = _Tests(without)
    words = [f"tests/{folder}", "-m", "not slow and not host", *options]
    status = pytest.main([*words, "-p", "no:cacheprovider"], plugins=[tests])
    pipe.send((int(status), frozenset(tests.failed)))


def _tests(
    generator: Path, folder: str, without: frozenset[str], limit: float, *options: str
) -> tuple[int, frozenset[str]]:
    """Exit status of pytest (-1: a crash, or past `limit` seconds) and the tests that failed."""
    processes = multiprocessing.get_context("fork")  # with the libraries already imported
    here, there = processes.Pipe(duplex=False)
    words = (str(generator), folder, without, list(options), there)
    process = processes.Process(target=_run, args=words)
    process.start()
    there.close()
    try:
        return here.recv() if here.poll(limit) else (-1, frozenset())
    except EOFError:
        return -1, frozenset()
    finally:
        process.kill()
        process.join()


def noticed(change: Change, failing: frozenset[str], limit: float) -> str:
    """Which quick tests of the change's folder fail with it: "quick" or "longer" ones, or none, "".

    Those of `make quick` may take `limit` seconds, all of them ten times as long.
    """
    with tempfile.TemporaryDirectory() as place:
        copy = Path(place, "generator")
        shutil.copytree(PACKAGE, copy / "beamchain", ignore=shutil.ignore_patterns("__pycache__"))
        Path(place, "mjcf_templates").symlink_to(ROOT / "mjcf_templates")
        file = copy / "beamchain" / change.file
        file.write_bytes(change.within(file.read_bytes()))
        if _tests(copy, change.folder, failing, limit, "-x", "--brief")[0]:
            return "quick"
        return "longer" if _tests(copy, change.folder, failing, 10.0 * limit, "-x")[0] else ""


def _every(folders: tuple[str, ...]) -> Iterator[Change]:
    for folder in folders:
        for file in sorted((PACKAGE / folder).rglob("*.py")):
            yield from changes(str(file.relative_to(PACKAGE)), file.read_bytes())


def _named(words: str) -> Change:
    file, line, column, old, new = words.split("|")
    return Change(file, int(line), int(column) - 1, old, new)


def main() -> None:
    """Draw, run, print; the exit status says nothing about the share."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--folders", nargs="+", choices=FOLDERS, default=FOLDERS)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds for each change")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--changes", nargs="+", type=_named, help="FILE|LINE|COLUMN|OLD|NEW")
    given = parser.parse_args()
    # drawn from all folders, so that a seed means the same changes whichever folders run
    drawn = random.Random(given.seed).sample(list(_every(FOLDERS)), given.count)
    drawn = given.changes or [change for change in drawn if change.folder in given.folders]
    drawn.sort(key=lambda change: (change.file, change.line, change.column))
    failing = {c.folder: frozenset[str]() for c in drawn}
    for folder in failing:
        failing[folder] = _tests(PACKAGE.parent, folder, frozenset(), 1800.0)[1]
        for test in sorted(failing[folder]):
            print(f"fails unchanged, and is left out: {test}")
    seen, total = Counter[str](), Counter(change.folder for change in drawn)
    with ThreadPoolExecutor(given.workers) as pool:
        results = pool.map(lambda c: noticed(c, failing[c.folder], given.limit), drawn)
        for change, result in zip(drawn, results, strict=True):
            seen[change.folder] += bool(result)
            says = f"noticed ({result})" if result else "survived"
            place = f"{change.file}:{change.line}:{change.column + 1}"
            print(f"{says:16} {place}  {change.old} -> {change.new or 'nothing'}", flush=True)
    for folder, count in total.items():
        print(f"{folder}: {seen[folder]} of {count} noticed")
    print(f"together: {seen.total()} of {total.total()} noticed")


if __name__ == "__main__":
    main()
