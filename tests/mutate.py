"""Break lines of a room on purpose and count how many of the breaks its tests notice: ``make mutate ROOM=drivers``.

Mutants come from cosmic-ray. A sample of places is drawn with a fixed seed, each place once, and each mutant runs in a
copy of the checkout against the tests mapped to its module: the test file of its name, the test files that import it,
and those of its folder, the quick tests first. A mutant is killed when a test fails that passes without it, or by
time-out: when the tests take several times as long as without it. Outside of CI, because 50 mutants take ten minutes
and more.
"""
# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import argparse
import ast
import builtins
import contextlib
import itertools
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator
from scipy.stats import binomtest

ROOT = Path(__file__).resolve().parent.parent
EQUIVALENT = ROOT / "tests/equivalent_mutants.txt"
"""Mutants that behave as the original does: one a line, as this program prints them; ``#`` starts a reason."""
OPERATORS = (
    *("AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd"),
    *("ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "NumberReplacer"),
    *("ZeroIterationForLoop", "ReplaceUnaryOperator_Delete_USub", "ReplaceUnaryOperator_Delete_Not"),
    *(f"ReplaceBinaryOperator_{change}" for change in ("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul")),
    *(f"ReplaceBinaryOperator_{change}" for change in ("FloorDiv_Mul", "Mod_Div", "Pow_Mul", "LShift_RShift")),
    *(f"ReplaceBinaryOperator_{change}" for change in ("RShift_LShift", "BitAnd_BitOr", "BitOr_BitAnd")),
    *(f"ReplaceComparisonOperator_{change}" for change in ("Lt_LtE", "LtE_Lt", "Gt_GtE", "GtE_Gt")),
    *(f"ReplaceComparisonOperator_{change}" for change in ("Lt_Gt", "Gt_Lt", "LtE_GtE", "GtE_LtE")),
    *(f"ReplaceComparisonOperator_{change}" for change in ("Eq_NotEq", "NotEq_Eq", "Is_IsNot", "IsNot_Is")),
)
"""Changes that leave a program which still runs. cosmic-ray has more, such as ``*`` to ``>>``, which any test notices
by a TypeError, and the removal of decorators that compile or cache, which no test should notice."""
TIMES = 4
"""So many times as long as without the mutant may the tests take before they are ended."""
FLOOR_S = 120.0
"""So long they may take in any case; how long they take without the mutant is only measured where that is not enough,
which is then, so that a busy machine delays both."""
LONGEST_S = 1200.0
"""Tests that take longer without any mutant are refused."""
TIMED_OUT = "time-out"


@dataclass(frozen=True)
class Mutant:
    """One change: the `occurrence`-th place in `module` (a path from the root) where `operator` applies."""

    module: str
    operator: str
    occurrence: int

    def code(self) -> str:
        """The whole module with the change."""
        operator = get_operator(f"core/{self.operator}")()
        return str(mutate_code((ROOT / self.module).read_text(), operator, self.occurrence))

    def title(self) -> str:
        """Path, the line before and the line after."""
        before, after = (ROOT / self.module).read_text().splitlines(), self.code().splitlines()
        # a change may join two lines; then all lines after it differ, too
        old, new = next((a, b) for a, b in zip(before, after, strict=False) if a != b)
        return f"{self.module}: {old.strip()}  ->  {new.strip()}"


def main() -> int:
    """Sample, run, report; exit code 1 where fewer than ``--least`` percent were killed."""
    given = _arguments()
    mutants, equivalent = sample(given.room, given.count, given.seed, given.under)
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies: SimpleQueue[Path] = SimpleQueue()
        for job in range(given.jobs):
            copies.put(_copy(Path(folder) / str(job) / "omote"))
        original = Original(_copy(Path(folder) / "original" / "omote"))
        with ThreadPoolExecutor(given.jobs) as pool:
            noticed = list(pool.map(lambda mutant: _killed_by(mutant, copies, original), mutants))
        original.seconds(sorted({test for test in noticed if test and test.startswith("tests/")}))
    killed = sum(test is not None for test in noticed)
    print(f"\n{' '.join([given.room, *given.under])}, seed {given.seed}: {_share(killed, len(mutants))}")
    print(f"{noticed.count(TIMED_OUT)} of them were killed by time-out")
    if equivalent:
        print(f"with {equivalent} listed as equivalent: {_share(killed, len(mutants) + equivalent)}")
    for mutant, test in zip(mutants, noticed, strict=True):
        if test is None:
            print(f"  survived  {mutant.title()}")
    return int(100 * killed < given.least * len(mutants))


def _share(killed: int, of: int) -> str:
    """How many mutants were killed, in percent, and how sure that is."""
    interval = binomtest(killed, of).proportion_ci(method="wilson")
    share = f"{killed / of:.0%} (95 % interval {interval.low:.0%} to {interval.high:.0%})"
    return f"{killed} of {of} mutants killed, {share}"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutate", description=str(__doc__).splitlines()[0])
    parser.add_argument("room", help="surface, controller, drivers, or a folder or module of one of them")
    parser.add_argument("--under", nargs="+", default=[], help="only these folders or modules of the room")
    parser.add_argument("--count", type=int, default=50, help="how many mutants (default 50)")
    parser.add_argument("--seed", type=int, default=1, help="which sample (default 1)")
    parser.add_argument("--jobs", type=int, default=max(1, min(4, os.cpu_count() or 1)), help="how many run at once")
    parser.add_argument("--least", type=float, default=85.0, help="exit code 1 below this percentage (default 85)")
    return parser.parse_args()


def sample(room: str, count: int, seed: int, under: Sequence[str] = ()) -> tuple[list[Mutant], int]:
    """`count` mutants of `room`, no two at the same place, and how many were left out as listed equivalent ones.

    `under`: the folders or modules of the room that are meant, all where there are none.
    """
    lines = EQUIVALENT.read_text().splitlines() if EQUIVALENT.is_file() else []
    equivalent = {line.rpartition("  #")[0] for line in lines}  # the last one: the line of code may have a comment
    places = [place for module in modules_in(room, under) for place in _places(module)]
    draw, chosen, left_out = random.Random(seed), list[Mutant](), 0
    draw.shuffle(places)
    for place in places:
        mutant = draw.choice(place)
        if not _compiles(mutant.code()):
            continue
        if mutant.title() in equivalent:
            left_out += 1
        else:
            chosen.append(mutant)
        if len(chosen) == count:
            break
    return chosen, left_out


def _compiles(code: str) -> bool:
    """Whether the change left Python."""
    try:
        compile(code, "mutant", "exec")
    except SyntaxError:
        return False
    return True


def modules_in(room: str, under: Sequence[str] = ()) -> list[str]:
    """Paths of the modules of a room, or of a part of one, from the root; where `under` has paths, only those there."""
    for part in (room, *under):
        if not _modules_of(part):
            raise SystemExit(f"no modules in {part}; give a room (surface, controller, drivers), a folder or a module")
    meant = {module for part in under for module in _modules_of(part)}
    return [module for module in _modules_of(room) if not under or module in meant]


def _modules_of(part: str) -> list[str]:
    path = ROOT / part
    found = [path] if path.is_file() else sorted(path.rglob("*.py"))
    return [p.relative_to(ROOT).as_posix() for p in found]


def _places(module: str) -> list[list[Mutant]]:
    """The mutants of a module, grouped by the place in the text that they change."""
    text = (ROOT / module).read_text()
    nodes, left_out = list(ast_nodes(get_ast(text))), _left_out(text)
    by_place: dict[tuple[tuple[int, int], str], list[Mutant]] = defaultdict(list)
    for name in OPERATORS:
        operator = get_operator(f"core/{name}")()
        found = ((node, start) for node in nodes for start, _ in operator.mutation_positions(node))
        for occurrence, (node, start) in enumerate(found):
            # the mark of keyword-only parameters is no product
            is_mark = node.parent is not None and node.parent.type in ("parameters", "param")
            if not is_mark and not any(first <= start < last for first, last in left_out):
                by_place[start, name.partition("_")[0]].append(Mutant(module, name, occurrence))
    return [by_place[key] for key in sorted(by_place)]


def _left_out(text: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Spans ((line, column) from, to) of what no test should notice.

    That is annotations and unions of types, and options that guard against mistakes of the program or make it faster.
    """
    found: list[ast.expr | None] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            found.append(node.returns)
        elif isinstance(node, ast.arg | ast.AnnAssign):
            found.append(node.annotation)
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            found.append(node.test)
        elif isinstance(node, ast.keyword) and node.arg in ("strict", "nogil", "cache", "frozen", "kw_only"):
            found.append(node.value)
        elif isinstance(node, ast.BinOp) and _is_type(node):
            found.append(node)
    return [((n.lineno, n.col_offset), (n.end_lineno or 0, n.end_col_offset or 0)) for n in found if n is not None]


def _is_type(value: ast.expr) -> bool:
    """Whether an expression is a type or a union of types, as ``int | Path`` in ``isinstance(value, int | Path)``."""
    match value:
        case ast.BinOp(left, ast.BitOr(), right):
            return _is_type(left) and _is_type(right)
        case ast.Name(name) | ast.Attribute(_, name):
            return not name.isupper() and (name[0].isupper() or isinstance(getattr(builtins, name, None), type))
        case ast.Subscript(of, _):
            return _is_type(of)
        case ast.Constant(None):
            return True
    return False


def tests_of(module: str) -> list[str]:
    """Paths of the tests mapped to a module: the file of its name, those that import it, and those of its folder, or
    of the next one above that has tests (a registry finds plug-ins by their folder, and its tests are theirs)."""
    path = Path(module)
    folders = (ROOT / "tests" / above for above in path.parents)
    folder = next(each for each in folders if any(each.glob("test_*.py")))
    dotted = ".".join(path.with_suffix("").parts).removesuffix(".__init__")
    importing = (test for test, names in _imports().items() if dotted in names)
    found = dict.fromkeys((folder / f"test_{path.stem}.py", *importing, *sorted(folder.glob("test_*.py"))))
    return [test.relative_to(ROOT).as_posix() for test in found if test.is_file()]


_times = itertools.count(1)
_names_by_test: dict[Path, set[str]] = {}


def _imports() -> dict[Path, set[str]]:
    """Names of the modules that each test file imports."""
    if not _names_by_test:
        for path in sorted((ROOT / "tests").glob("*/**/test_*.py")):
            names = _names_by_test.setdefault(path, set())
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.ImportFrom) and node.module:
                    names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
                elif isinstance(node, ast.Import):
                    names |= {alias.name for alias in node.names}
    return _names_by_test


def _copy(target: Path) -> Path:
    """The checkout as it is now, with its compiled kernels, and ``shared`` beside it where there is one."""
    names = subprocess.check_output(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, text=True).splitlines()
    rooms = (ROOT / name for name in ("surface", "controller", "drivers"))
    kernels = (str(path.relative_to(ROOT)) for room in rooms for path in room.rglob("*.nb[ic]"))
    for name in (*names, *kernels):
        if (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)
    if (ROOT.parent / "shared").is_dir():
        (target.parent / "shared").symlink_to(ROOT.parent / "shared")
    return target


class Original:
    """The checkout without a mutant, in which tests must pass before a mutant says anything about them."""

    def __init__(self, copy: Path) -> None:
        self._copy, self._one_at_a_time = copy, threading.Lock()
        self._seconds: dict[tuple[str, ...], float] = {}

    def seconds(self, words: list[str]) -> float:
        """How long pytest takes with these words; ends the program where a test fails twice."""
        with self._one_at_a_time:
            if words and tuple(words) not in self._seconds:
                self._seconds[tuple(words)] = self._measure(words)
            return self._seconds.get(tuple(words), 0.0)

    def _measure(self, words: list[str]) -> float:
        for _ in range(2):
            started_s = time.monotonic()
            ended, output = _pytest(self._copy, words, lambda: LONGEST_S)
            if ended in (0, 5):  # 5: pytest found no test
                return time.monotonic() - started_s
        raise SystemExit(f"these tests must be green before a mutant says anything about them:\n{output}")


def _killed_by(mutant: Mutant, copies: SimpleQueue[Path], original: Original) -> str | None:
    """The test that failed first, or what else ended the tests; None where they passed."""
    copy = copies.get()
    noticed = None
    try:
        (copy / mutant.module).write_text(mutant.code())
        # a time that no other file or mutant of it has: Python keeps bytecode by time and size
        os.utime(copy / mutant.module, (0, next(_times)))
        for some in _rounds(tests_of(mutant.module)):
            ended, output = _pytest(copy, some, lambda some=some: TIMES * original.seconds(some))
            if ended not in (0, 5):  # 5: pytest found no test
                noticed = _noticed_by(ended, output)
                break
    finally:
        shutil.copy2(ROOT / mutant.module, copy / mutant.module)
        copies.put(copy)
    print(f"{'SURVIVED' if noticed is None else 'killed  '}  {mutant.title()}", flush=True)
    if noticed is not None:
        print(f"          by {noticed}", flush=True)
    return noticed


def _rounds(tests: list[str]) -> Iterator[list[str]]:
    """Words for pytest, run by run: most mutants are noticed by the quick tests of the first file alone."""
    for marked in ("not slow", "slow"):
        for some in filter(None, (tests[:1], tests[1:])):
            yield ["-m", marked, *some]


def _noticed_by(ended: int | None, output: str) -> str:
    """The test that failed first, without its parameters, or what else ended the tests."""
    found = re.search(r"^(?:FAILED|ERROR) ([^\s\[]+)", output, re.MULTILINE)
    if found:  # also where pytest waits after it for a process that the mutant left
        return found[1]
    return TIMED_OUT if ended is None else f"exit code {ended}"


def _pytest(copy: Path, words: list[str], longest_s: Callable[[], float]) -> tuple[int | None, str]:
    """Exit code of pytest, None where it had to be ended, and the end of what it printed.

    `longest_s`: how long it may take; only asked where it takes longer than :data:`FLOOR_S`.
    """
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": ""}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--tb=line", *words]
    started_s = time.monotonic()
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(
            command, cwd=copy, env=environment, stdout=output, stderr=output, start_new_session=True
        )
        ended = _wait(process, FLOOR_S)
        if ended is None:
            ended = _wait(process, started_s + longest_s() - time.monotonic())
        _end(process, copy)
        output.seek(0)
        return ended, output.read()[-2000:]


def _wait(process: subprocess.Popen[bytes], seconds: float) -> int | None:
    """The exit code, None where the process did not end in time."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        return process.wait(max(0.0, seconds))
    return None


def _end(process: subprocess.Popen[bytes], copy: Path) -> None:
    """End the group of pytest, and what its tests started in groups of their own (they know the copy): a mutant may
    leave processes behind, which hold their ports."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    for environment in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if f"PYTHONPATH={copy}\0".encode() in environment.read_bytes():
                os.kill(int(environment.parent.name), signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main())
