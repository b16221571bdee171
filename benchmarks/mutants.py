"""Do the tests notice a mistake? `python benchmarks/mutants.py [--count 30] [--seed 1] [--only PACKAGE] [--jobs 2]`.

In each of six packages single places are changed: a comparison, an operator, a number, a condition, a sign. The places
are drawn with a seed, in turn from every module. Each change is made in a copy of the repository and put before the
tests that run its line, the quickest of each file first, until one fails: then it is killed. What survives them all
needs a test, or a reason in mutants_explained.json why nobody can tell it from the original.

Which test runs which line is measured once, by `--cover` (needs pytest-cov), and kept in outputs/. Results go to
mutants.json, which also says what need not be run again: a change whose place is still there. docs/mutation.md is
written from it (`--write` writes that alone).

mutmut and cosmic-ray were judged by what their documentation says, not tried. mutmut 3 replaces each function by a
trampoline, and here functions are looked into: arguments of plugins by name, sources by their hash. cosmic-ray runs one
command for all that it changes, which here would be the whole suite, minutes each.
"""

import argparse
import ast
import copy
import itertools
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Queue
from typing import Any
from xml.etree import ElementTree

from tractexp import files

ROOT = Path(__file__).parents[1]
RESULTS, PAGE = ROOT / "benchmarks" / "mutants.json", ROOT / "docs" / "mutation.md"
REASONS = ROOT / "benchmarks" / "mutants_explained.json"
PACKAGES = ("model", "identification", "record", "discrepancy", "comparison", "sweep")
COVERED, TIMES = ROOT / "outputs" / "covered", ROOT / "outputs" / "covered.xml"  # which test runs which line; how long
LIMIT = 240.0  # s for the tests of one change
MOST = 400  # of them
PASSED, FAILED, LATE = "passed", "failed", "late"
SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.And: ast.Or, ast.Or: ast.And, ast.USub: ast.UAdd,
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One change: the module, where, and the text of the changed expression before and after."""

    module: str
    line: int
    last: int  # line of the same expression
    before: str
    after: str
    nth: int  # of all places of the module

    @property
    def key(self) -> str:
        return key_of(asdict(self))


def places(tree: ast.AST) -> Iterator[tuple[ast.AST, str, Any]]:
    """(node, field, what it becomes) of each place that can be changed; messages and annotations cannot."""
    for node in _code(tree):
        if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in SWAPS:
            yield node, "ops", [SWAPS[type(node.ops[0])]()]
        elif isinstance(node, ast.BinOp | ast.BoolOp | ast.UnaryOp | ast.AugAssign) and type(node.op) in SWAPS:
            if not _text(node):
                yield node, "op", SWAPS[type(node.op)]()
        elif isinstance(node, ast.If | ast.IfExp | ast.While) and not isinstance(node.test, ast.Compare):
            yield node, "test", ast.UnaryOp(ast.Not(), node.test)
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
            yield node, "value", _other(node.value)


def _other(value: bool | int | float) -> bool | int | float:
    if isinstance(value, bool):
        return not value
    return value + 1 if isinstance(value, int) else 2 * value if value else 1.0


def _text(node: ast.AST) -> bool:
    """Whether an operation is one of strings or of types: `"a" + "b"`, `int | None`."""
    words = (n for n in ast.walk(node) if isinstance(n, ast.Constant | ast.JoinedStr))
    return any(isinstance(n, ast.JoinedStr) or n.value is None or isinstance(n.value, str) for n in words)


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes below one that are neither a message, an annotation nor a type."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert | ast.Import | ast.ImportFrom):
        return
    yield node
    skipped = {"annotation", "returns", "decorator_list", "bases", "keywords" if isinstance(node, ast.ClassDef) else ""}
    for field, value in ast.iter_fields(node):
        if field in skipped:
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _code(child)


def mutants_of(module: str, text: str) -> list[Mutant]:
    """All changes of a module."""
    tree = ast.parse(text)
    made = []
    for k, (node, field, other) in enumerate(places(tree)):
        shown = node.test if field == "test" and isinstance(node, ast.If | ast.IfExp | ast.While) else node
        before = ast.unparse(shown)
        changed = copy.copy(node)
        setattr(changed, field, other)
        after = ast.unparse(changed.test if shown is not node else changed)  # type: ignore[attr-defined]
        made.append(Mutant(module, node.lineno, node.end_lineno or node.lineno, before, after, k))
    return made


def mutated(text: str, mutant: Mutant) -> str:
    """The module's text with the change; comments go, which no test reads."""
    tree = ast.parse(text)
    for k, (node, field, other) in enumerate(places(tree)):
        if k == mutant.nth:
            setattr(node, field, other)
            break
    return ast.unparse(ast.fix_missing_locations(tree))


def drawn(package: str, count: int, seed: int) -> list[Mutant]:
    """So many changes of a package, from its modules in turn."""
    rng = random.Random(f"{seed} {package}")
    files = sorted((ROOT / "tractexp" / package).rglob("*.py"))
    each = {f: mutants_of(f.relative_to(ROOT).as_posix(), f.read_text(encoding="utf-8")) for f in files}
    stacks = [rng.sample(found, len(found)) for found in each.values() if found]
    rng.shuffle(stacks)
    chosen: list[Mutant] = []
    while len(chosen) < count and any(stacks):
        chosen += [stack.pop() for stack in stacks if stack][: count - len(chosen)]
    return sorted(chosen, key=lambda m: (m.module, m.line, m.nth))


class Covered:
    """Which tests run a line, and how long each takes."""

    def __init__(self) -> None:
        from coverage import CoverageData

        self.data = CoverageData(COVERED.as_posix())
        self.data.read()
        self.seconds: dict[str, float] = {}
        for case in ElementTree.parse(TIMES).iter("testcase"):
            where, name = case.get("classname", ""), case.get("name", "")
            parts = where.split(".")
            k = next(k for k, part in enumerate(parts, start=1) if part.startswith("test_"))
            file, inner = "/".join(parts[:k]) + ".py", parts[k:]
            self.seconds["::".join([file, *inner, name])] = float(case.get("time", "0"))

    def tests(self, mutant: Mutant) -> list[str]:
        """Those that run the changed expression; of what runs at import all that run its module, or else its package.

        What a fixture runs is run for every test of its file. The quickest of each file come first, then its next; last
        the file named after the package, whose commands may run the line in processes of their own.
        """
        lines = self.data.contexts_by_lineno((ROOT / mutant.module).as_posix())
        there = {context for k in range(mutant.line, mutant.last + 1) for context in lines.get(k, ()) if context}
        there = there or _all(lines)
        if not there:
            beside = (ROOT / mutant.module).parent.glob("*.py")
            there = {c for file in beside for c in _all(self.data.contexts_by_lineno(file.as_posix()))}
        found: set[str] = set()
        for test, _, part in (context.rpartition("|") for context in there):
            file = test.partition("::")[0]
            found |= {test} if part == "run" else {t for t in self.seconds if t.partition("::")[0] == file}
        ranked = sorted(found & self.seconds.keys(), key=lambda test: (self.seconds[test], test))
        by_file: dict[str, list[str]] = {}
        for test in ranked:
            by_file.setdefault(test.partition("::")[0], []).append(test)
        in_turn = [test for turn in itertools.zip_longest(*by_file.values()) for test in turn if test]
        named = f"test_{Path(mutant.module).parts[1]}.py"
        alike = (t for t in self.seconds if Path(t.partition("::")[0]).name == named)
        further = sorted(alike, key=self.seconds.__getitem__)
        return list(dict.fromkeys([*in_turn, *further]))[:MOST]


def _all(lines: dict[int, list[str]]) -> set[str]:
    return {context for contexts in lines.values() for context in contexts if context}


def cover() -> None:
    """Run the whole suite once and note which test runs which line."""
    COVERED.parent.mkdir(exist_ok=True)
    subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "2", "--cov=tractexp", "--cov-context=test", "--cov-report=",
         f"--junitxml={TIMES}"], cwd=ROOT, env={**os.environ, "COVERAGE_FILE": str(COVERED)}, check=False,
    )  # fmt: skip


def copied(to: Path) -> None:
    """The repository as a wheel lays it out, with its tests."""
    for part in ("tractexp", "plugins", "conf", "tests", "benchmarks", "docs"):
        shutil.copytree(ROOT / part, to / part, ignore=shutil.ignore_patterns("__pycache__", "*.ipynb_checkpoints"))
    for name in ("pyproject.toml", "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "LICENSE"):
        shutil.copy(ROOT / name, to / name)
    (to / "tractexp_plugins").symlink_to("plugins")
    (to / "tractexp" / "conf").symlink_to("../conf")


def run(folder: Path, tests: Sequence[str], limit: float) -> tuple[str, str]:
    """Whether tests pass in a copy, one fails, or they are late; and the one that failed first."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider", "--no-header", "--tb=no"]
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", "COLUMNS": "400"}
    with tempfile.TemporaryDirectory() as scratch:
        process = subprocess.Popen(
            [*command, f"--basetemp={scratch}/t", *tests], cwd=folder, env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
        try:
            told = process.communicate(timeout=limit)[0]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return LATE, ""
    failed = re.search(r"^(?:FAILED|ERROR) (tests/.+?)(?: - .*)?$", told, re.MULTILINE)
    return (PASSED, "") if process.returncode in (0, 5) else (FAILED, failed[1] if failed else "")


class Clean:
    """A copy with nothing changed: a test that fails there as well is no evidence."""

    def __init__(self, folder: Path):
        self.folder, self.lock = folder, threading.Lock()
        self.known: dict[str, bool] = {}

    def passes(self, test: str) -> bool:
        with self.lock:
            if test not in self.known:
                self.known[test] = run(self.folder, [test], 10 * LIMIT)[0] == PASSED
                if not self.known[test]:
                    print(f"  {test} fails with nothing changed", flush=True)
            return self.known[test]


def judged(mutant: Mutant, tests: list[str], folder: Path, clean: Clean) -> dict[str, Any]:
    """What becomes of one change; tests that fail with nothing changed are left out."""
    path = folder / mutant.module
    original = path.read_text(encoding="utf-8")
    told: dict[str, Any] = {**asdict(mutant), "killed_by": None, "tests": len(tests), "late": False}
    if not tests:
        return told
    try:
        path.write_text(mutated(original, mutant), encoding="utf-8")
        while tests:
            outcome, what = run(folder, tests, LIMIT)
            if outcome == FAILED and (not what or clean.passes(what)):
                return told | {"killed_by": (what or "no test can be collected").removeprefix("tests/")}
            if outcome != FAILED:
                return told | {"tests": len(tests), "late": outcome == LATE}
            tests = [test for test in tests if test != what]
    finally:
        path.write_text(original, encoding="utf-8")
    return told | {"tests": 0}


def keep(found: list[dict[str, Any]]) -> None:
    files.write(RESULTS, json.dumps(found, indent=1, ensure_ascii=False) + "\n")


HEAD = """# Do the tests notice a mistake?

Written by `python benchmarks/mutants.py` from `benchmarks/mutants.json`. Single places of six packages, drawn with a
seed from every module in turn, are changed and put before the tests that run the changed line, the quickest of each
file first, for four minutes at most. A change is killed by the first test that fails, if that test passes with nothing
changed. What survives has a reason: nobody can tell it from the original, or it says what is not tested. Undecided is
what that time was not enough for, and what no test runs.

| package | changes | killed | explained | survive | undecided |
|---|---:|---:|---:|---:|---:|
"""


def page(found: list[dict[str, Any]], told: dict[str, str]) -> str:
    """docs/mutation.md."""
    lines = []
    ends = [_end(f, told) for f in found]
    for package in PACKAGES:
        own = [end for f, (end, _) in zip(found, ends, strict=True) if f["module"].split("/")[1] == package]
        counts = [own.count(word) for word in ("killed", "explained", "survives", "undecided")]
        lines.append(f"| {package} | {len(own)} | {' | '.join(map(str, counts))} |")
    lines += ["", "| module | line | change | what became of it |", "|---|---:|---|---|"]
    for f, (end, why) in zip(found, ends, strict=True):
        change = f"`{_cell(f['before'])}` to `{_cell(f['after'])}`"
        lines.append(f"| {f['module'].removeprefix('tractexp/')} | {f['line']} | {change} | {end}: {_cell(why)} |")
    return HEAD + "\n".join(lines) + "\n"


def _end(found: dict[str, Any], told: dict[str, str]) -> tuple[str, str]:
    """What became of a change, in a word, and by what or why."""
    if found["killed_by"]:
        return "killed", found["killed_by"]
    if reason := told.get(key_of(found)):
        return "explained", reason
    if found["late"] or not found["tests"]:
        return "undecided", f"{found['tests']} tests run it"
    return "survives", f"passed by {found['tests']} tests"


def key_of(found: dict[str, Any]) -> str:
    """What a change is called, here and in mutants_explained.json."""
    return f"{found['module']} {found['nth']}: {found['before']} -> {found['after']}"


def _cell(text: str) -> str:
    text = " ".join(text.split()).replace("|", "\\|")
    return text if len(text) < 140 else text[:137] + "..."


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    ask.add_argument("--count", type=int, default=30, help="changes in each package")
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--jobs", type=int, default=2)
    ask.add_argument("--only", nargs="*", default=list(PACKAGES), choices=PACKAGES)
    ask.add_argument("--survivors", action="store_true", help="run those again that were neither killed nor explained")
    ask.add_argument("--write", action="store_true", help="write docs/mutation.md alone")
    ask.add_argument("--cover", action="store_true", help="measure first which test runs which line")
    chosen = ask.parse_args()
    if chosen.cover:
        cover()
    known = {key_of(f): f for f in json.loads(RESULTS.read_text())} if RESULTS.exists() else {}
    told = json.loads(REASONS.read_text(encoding="utf-8")) if REASONS.exists() else {}
    if not chosen.write:
        wanted = [m for package in chosen.only for m in drawn(package, chosen.count, chosen.seed)]
        survived = {m.key for m in wanted if m.key in known and not (known[m.key]["killed_by"] or m.key in told)}
        again = [m for m in wanted if m.key not in known or (chosen.survivors and m.key in survived)]
        investigate(again, known, chosen.jobs)
    there = {m.key for module in {f["module"] for f in known.values()} for m in mutants_of(module, text_of(module))}
    found = sorted(
        (f for key, f in known.items() if key in there),
        key=lambda f: (PACKAGES.index(f["module"].split("/")[1]), f["module"], f["line"], f["nth"]),
    )
    keep(found)
    files.write(PAGE, page(found, told))


def investigate(mutants: Sequence[Mutant], known: dict[str, dict[str, Any]], jobs: int) -> None:
    """Put changes before their tests, so many side by side, and keep what becomes of each as it is known."""
    covered = Covered()
    tests = [covered.tests(m) for m in mutants]
    with tempfile.TemporaryDirectory() as scratch:
        folders: Queue[Path] = Queue()
        for k in range(jobs + 1):
            copied(Path(scratch) / str(k))
            folders.put(Path(scratch) / str(k))
        clean = Clean(folders.get())

        def one(mutant: Mutant, tests: list[str]) -> None:
            folder = folders.get()
            try:
                known[mutant.key] = judged(mutant, tests, folder, clean)
            finally:
                folders.put(folder)
            print(f"{mutant.line} {mutant.key}: {' '.join(_end(known[mutant.key], {}))}", flush=True)
            keep(list(known.values()))

        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(one, mutants, tests))


def text_of(module: str) -> str:
    path = ROOT / module
    return path.read_text(encoding="utf-8") if path.exists() else ""


if __name__ == "__main__":
    main()
