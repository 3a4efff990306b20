"""Change formulas of the package one at a time, and say which changes the quick tests notice.

`python tests/mutants.py --seed n` draws 200 changes of constants, signs, operators, indices and
comparisons inside functions of FOLDERS. Each goes into a temporary copy of the package, on which
those quick tests of the same folder run that call the function, the shortest first. Which these are
is found by running all of them once unchanged; tests that fail then are left out.
"""

import argparse
import ast
import multiprocessing
import os
import random
import shutil
import sys
import tempfile
import threading
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Self

import pytest

# imported once for all the processes
import mujoco  # noqa: F401  # isort: skip
import scipy.optimize  # noqa: F401  # isort: skip

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "generator" / "beamchain"
FOLDERS = (
    *("ports", "structure", "chain", "engine", "steps"),
    *("fitting", "craft", "control", "robust", "pointing", "variants"),
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


Place = tuple[str, int]  # file and first line of a function


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
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert) or _is_words(node):
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


def _is_words(node: ast.AST) -> bool:
    """Whether it chooses between two texts."""
    return isinstance(node, ast.IfExp) and all(
        isinstance(part, ast.JoinedStr)
        or (isinstance(part, ast.Constant) and isinstance(part.value, str))
        for part in (node.body, node.orelse)
    )


class _Tests:
    """Plugin of pytest: keeps what failed, how long each test took and which functions it called.

    Args:
        only: tests to run, in this order; None: all, with their calls recorded.
    """

    def __init__(self, generator: Path, only: list[str] | None) -> None:
        self.package, self.only = str(generator / "beamchain"), only
        self.failed, self.seconds = set[str](), defaultdict[str, float](float)
        self.calls, self.fixtures = dict[str, set[Place]](), defaultdict[str, set[Place]](set)
        self.now = set[Place]()  # called by the test or the fixture that runs

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        if self.only is not None:
            named = {item.nodeid: item for item in items}
            items[:] = [named[test] for test in self.only if test in named]

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid] += report.duration
        if report.failed:
            self.failed.add(report.nodeid)

    def _profile(self, frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(self.package):
            self.now.add((code.co_filename, code.co_firstlineno))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item):
        if self.only is not None:
            return (yield)
        self.now = set()
        threading.setprofile(self._profile)
        sys.setprofile(self._profile)
        try:
            return (yield)
        finally:
            sys.setprofile(None)
            names = getattr(item, "fixturenames", ())
            self.calls[item.nodeid] = self.now.union(*(self.fixtures[name] for name in names))

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef):
        """What a fixture calls is called by every test that asks for it, not by the first alone."""
        before, self.now = self.now, set()
        try:
            return (yield)
        finally:
            self.fixtures[fixturedef.argname] |= self.now
            self.now |= before


def _run(generator: Path, folder: str, only: list[str] | None, pipe) -> None:
    """In a process of its own: send status of a folder's tests, and what is kept of them."""
    sys.path.insert(0, str(generator))
    os.environ["PYTHONPATH"] = str(generator)  # for the commands that tests start
    os.chdir(ROOT)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    tests = _Tests(generator, only)
    files = [f"tests/{folder}"] if only is None else sorted({t.split("::")[0] for t in only})
    words = ["-x"] if only is not None else []
    words += ["-m", "not slow and not host", "-p", "no:cacheprovider"]
    status = pytest.main([*files, *words], plugins=[tests])
    passed = {test: kept for test, kept in tests.calls.items() if test not in tests.failed}
    pipe.send((int(status), sorted(tests.failed), passed, dict(tests.seconds)))


def _tests(generator: Path, folder: str, only: list[str] | None, limit: float):
    """What `_run` sends; status -1: a crash, or past `limit` seconds."""
    processes = multiprocessing.get_context("fork")  # with the libraries already imported
    here, there = processes.Pipe(duplex=False)
    process = processes.Process(target=_run, args=(generator, folder, only, there))
    process.start()
    there.close()
    try:
        return here.recv() if here.poll(limit) else (-1, [], {}, {})
    except EOFError:
        return -1, [], {}, {}
    finally:
        process.kill()
        process.join()


@dataclass(frozen=True)
class Reached:
    """Which quick tests of a folder call which functions of the package, and how long they take."""

    calls: dict[str, set[Place]]
    seconds: dict[str, float]

    @classmethod
    def of(cls, folder: str) -> Self:
        """Run them unchanged; those that fail are printed and left out."""
        status, failed, calls, seconds = _tests(PACKAGE.parent, folder, None, 1800.0)
        if status < 0:
            raise SystemExit(f"the quick tests of {folder} do not end")
        for test in failed:
            print(f"fails unchanged, and is left out: {test}")
        return cls(calls, seconds)

    def by(self, change: Change) -> list[str]:
        """Those that call the function of a change, the shortest first."""
        file = PACKAGE / change.file
        functions = [
            (min([node.lineno, *(name.lineno for name in node.decorator_list)]), node.end_lineno)
            for node in ast.walk(ast.parse(file.read_bytes()))
            if isinstance(node, ast.FunctionDef)
        ]
        # the innermost, with the comprehensions and lambdas in it
        first, last = max(span for span in functions if span[0] <= change.line <= (span[1] or 0))
        of = {(str(file), line) for line in range(first, (last or first) + 1)}
        found = [test for test, places in self.calls.items() if places & of]
        return sorted(found, key=lambda test: self.seconds[test])


def noticed(change: Change, reached: Reached, limit: float) -> str:
    """What the quick tests of its folder say of a change, given `limit` seconds."""
    tests = reached.by(change)
    if not tests:
        return "no test calls it"
    with tempfile.TemporaryDirectory() as place:
        copy = Path(place, "generator")
        shutil.copytree(PACKAGE, copy / "beamchain", ignore=shutil.ignore_patterns("__pycache__"))
        Path(place, "mjcf_templates").symlink_to(ROOT / "mjcf_templates")
        file = copy / "beamchain" / change.file
        file.write_bytes(change.within(file.read_bytes()))
        status = _tests(copy, change.folder, tests, limit)[0]
        if status > pytest.ExitCode.INTERRUPTED:
            raise SystemExit(f"pytest ends with {status} on {change}")
        return "noticed" if status else "survived"


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
    parser.add_argument("--limit", type=float, default=300.0, help="seconds for each change")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--changes", nargs="+", type=_named, help="FILE|LINE|COLUMN|OLD|NEW")
    given = parser.parse_args()
    # drawn from all folders, so that a seed means the same changes whichever folders run
    drawn = random.Random(given.seed).sample(list(_every(FOLDERS)), given.count)
    drawn = given.changes or [change for change in drawn if change.folder in given.folders]
    drawn.sort(key=lambda change: (change.file, change.line, change.column))
    seen, total = Counter[str](), Counter(change.folder for change in drawn)
    with ThreadPoolExecutor(given.workers) as pool:
        reached = dict(zip(total, pool.map(Reached.of, total), strict=True))
        results = pool.map(lambda c: noticed(c, reached[c.folder], given.limit), drawn)
        for change, result in zip(drawn, results, strict=True):
            seen[change.folder] += result == "noticed"
            place = f"{change.file}:{change.line}:{change.column + 1}"
            print(f"{result:16} {place}  {change.old} -> {change.new or 'nothing'}", flush=True)
    for folder, count in total.items():
        print(f"{folder}: {seen[folder]} of {count} noticed")
    print(f"together: {seen.total()} of {total.total()} noticed")


if __name__ == "__main__":
    main()
