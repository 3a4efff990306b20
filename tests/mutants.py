"""Change formulas of the package one at a time, and say which changes the quick tests notice.

`python tests/mutants.py --seed n ...` draws 200 changes of constants, signs, operators, indices and
comparisons inside functions of FOLDERS for each seed. The quick tests of a folder are collected
once and run once unchanged, to learn which of them call which function; those that fail then are
left out. For each change a fork of that process swaps the code of the changed function and runs the
tests that call it, the shortest first. What a module computes when it is imported stays as it was.
"""

import argparse
import ast
import gc
import os
import pickle
import random
import signal
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import CodeType, FrameType, FunctionType

import pytest
from _pytest.runner import runtestprotocol

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "generator" / "beamchain"
FOLDERS = tuple(
    name
    for name in (
        *("ports", "structure", "chain", "engine", "steps"),
        *("fitting", "craft", "control", "robust", "pointing", "variants"),
    )
    if (PACKAGE / name / "__init__.py").is_file()
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
            if name in ("annotation", "returns") or (
                # worked out when a module is imported
                isinstance(node, ast.FunctionDef) and name in ("args", "decorator_list")
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


class _Calls:
    """Plugin of pytest: which functions of the package each test calls, and how long it takes.

    What a fixture calls is called by every test that asks for it, not by the first alone.
    """

    def __init__(self) -> None:
        self.now = set[Place]()  # called by the test or the fixture that runs
        self.fixtures = defaultdict[str, set[Place]](set)

    def profile(self, frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(str(PACKAGE)):
            self.now.add((frame.f_code.co_filename, frame.f_code.co_firstlineno))

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef):
        before, self.now = self.now, set()
        try:
            return (yield)
        finally:
            self.fixtures[fixturedef.argname] |= self.now
            self.now |= before


def _fails(item: pytest.Item, following: pytest.Item | None) -> bool:
    reports = runtestprotocol(item, log=False, nextitem=following)
    return any(report.failed for report in reports)


def _in_a_fork(work) -> int:
    """Status of a function that runs in a fork; negative where it was killed."""
    if not (pid := os.fork()):
        os._exit(work())
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


class _Folder:
    """Plugin of pytest: instead of running a folder's tests once, run them for every change.

    Args:
        changes: of the folder.
        limit: seconds for each.
        send: takes what is said.
    """

    def __init__(self, changes: list[Change], limit: float, send) -> None:
        self.changes, self.limit, self.send = changes, limit, send
        self.known = _Calls()

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        items, following = session.items, [*session.items[1:], None]
        session.config.pluginmanager.register(self.known)
        reader, writer = os.pipe()

        def learn() -> int:
            found = list[tuple[bool, set[Place], float]]()
            for item, after in zip(items, following, strict=True):
                self.known.now, start = set(), time.process_time()
                sys.setprofile(self.known.profile)
                fails = _fails(item, after)
                sys.setprofile(None)
                found.append((fails, self.known.now, time.process_time() - start))
            for item, (_, places, _) in zip(items, found, strict=True):
                for name in getattr(item, "fixturenames", ()):
                    places |= self.known.fixtures[name]
            with os.fdopen(writer, "wb") as stream:
                pickle.dump(found, stream)
            return 0

        if not (pid := os.fork()):
            os._exit(learn())
        os.close(writer)
        with os.fdopen(reader, "rb") as stream:
            learnt: list[tuple[bool, set[Place], float]] = pickle.load(stream)
        os.waitpid(pid, 0)
        for item, (fails, *_) in zip(items, learnt, strict=True):
            if fails:
                self.send(f"fails unchanged, and is left out: {item.nodeid}")
        for change in self.changes:
            where = _places(change)
            calling = [
                (seconds, number)
                for number, (fails, places, seconds) in enumerate(learnt)
                if not fails and places & where
            ]
            tests = [items[number] for _, number in sorted(calling)]
            self.send((change, self._said_of(change, tests)))
        return True

    def _said_of(self, change: Change, tests: list[pytest.Item]) -> str:
        def run() -> int:
            signal.setitimer(signal.ITIMER_REAL, self.limit)
            if not _swap(change):
                return 2
            pairs = zip(tests, [*tests[1:], None], strict=True)
            return int(any(_fails(item, after) for item, after in pairs))

        if not tests:
            return "no test calls it"
        status = _in_a_fork(run)
        if status < 0:  # killed, as it does not end
            return "noticed"
        return ("survived", "noticed", "not changed")[status]


def _places(change: Change) -> set[Place]:
    """Where the function of a change may begin, with the comprehensions and lambdas in it."""
    file = PACKAGE / change.file
    functions = [
        (min([node.lineno, *(name.lineno for name in node.decorator_list)]), node.end_lineno or 0)
        for node in ast.walk(ast.parse(file.read_bytes()))
        if isinstance(node, ast.FunctionDef)
    ]
    first, last = max(span for span in functions if span[0] <= change.line <= span[1])
    return {(str(file), line) for line in range(first, last + 1)}


def _swap(change: Change) -> int:
    """Give the functions of a file the code that they have with a change; how many it is."""
    file = PACKAGE / change.file
    import_module(".".join(["beamchain", *Path(change.file).with_suffix("").parts]))
    table = defaultdict[tuple[str, int], list[CodeType]](list)

    def collect(code: CodeType) -> None:
        for inner in code.co_consts:
            if isinstance(inner, CodeType):
                table[inner.co_qualname, inner.co_firstlineno].append(inner)
                collect(inner)

    collect(compile(change.within(file.read_bytes()), str(file), "exec", dont_inherit=True))
    count = 0
    for function in gc.get_objects():
        if isinstance(function, FunctionType) and function.__code__.co_filename == str(file):
            old = function.__code__
            new = table[old.co_qualname, old.co_firstlineno]
            if len(new) == 1 and new[0] != old and new[0].co_freevars == old.co_freevars:
                function.__code__ = new[0]
                count += 1
    return count


def _of_folder(folder: str, changes: list[Change], limit: float) -> list[tuple[Change, str]]:
    """What the quick tests of a folder say of its changes, in a process of its own."""
    reader, writer = os.pipe()
    if not (pid := os.fork()):
        os.close(reader)
        stream = os.fdopen(writer, "wb")

        def send(said: object) -> None:
            pickle.dump(said, stream)
            stream.flush()

        os.chdir(ROOT)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        words = [f"tests/{folder}", "-s", "-m", "not slow and not host", "-p", "no:cacheprovider"]
        pytest.main(words, plugins=[_Folder(changes, limit, send)])
        os._exit(0)
    os.close(writer)
    out = list[tuple[Change, str]]()
    with os.fdopen(reader, "rb") as stream:
        while True:
            try:
                said = pickle.load(stream)
            except EOFError:
                break
            if isinstance(said, str):
                print(said, flush=True)
                continue
            change, word = said
            place = f"{change.file}:{change.line}:{change.column + 1}"
            print(f"{word:16} {place}  {change.old} -> {change.new or 'nothing'}", flush=True)
            out.append((change, word))
    os.waitpid(pid, 0)
    return out


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
    parser.add_argument("--seed", type=int, nargs="+", default=[1])
    parser.add_argument("--count", type=int, default=200, help="for each seed, over all folders")
    parser.add_argument("--folders", nargs="+", choices=FOLDERS, default=FOLDERS)
    parser.add_argument("--limit", type=float, default=300.0, help="seconds for each change")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--changes", nargs="+", type=_named, help="FILE|LINE|COLUMN|OLD|NEW")
    given = parser.parse_args()
    # drawn from all folders, so that a seed means the same changes whichever folders run
    every = list(_every(FOLDERS))
    drawn = {f"seed {seed}": random.Random(seed).sample(every, given.count) for seed in given.seed}
    if given.changes:
        drawn = {"these": given.changes}
    wanted = {one for each in drawn.values() for one in each if one.folder in given.folders}
    by_folder = defaultdict[str, list[Change]](list)
    for change in sorted(wanted, key=lambda one: (one.file, one.line, one.column)):
        change.within((PACKAGE / change.file).read_bytes())  # raises where it does not fit
        by_folder[change.folder].append(change)
    with ThreadPoolExecutor(given.workers) as pool:
        limits = [given.limit] * len(by_folder)
        results = pool.map(_of_folder, by_folder, by_folder.values(), limits)
        words = {change: word for each in results for change, word in each}
    for name, those in drawn.items():
        total = Counter(one.folder for one in those if one in wanted)
        seen = Counter(one.folder for one in those if words.get(one) == "noticed")
        for folder, count in sorted(total.items()):
            print(f"{name}, {folder}: {seen[folder]} of {count} noticed")
        print(f"{name}: {seen.total()} of {total.total()} noticed")


if __name__ == "__main__":
    main()
