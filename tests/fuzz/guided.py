"""Damaged files that a coverage-guided fuzzer makes: what reaches new code is damaged further.

Run ``python -m tests.fuzz.guided --only glb obj --minutes 5``. It needs the package atheris (``pip install atheris``),
which has wheels for some versions of Python on Linux only; nothing else of omote does. Each kind has a process of its
own, which goes on after a finding; ``--keep`` is the folder for them, and ``--corpus`` one that keeps what reached new
code from one run to the next.
"""
# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import argparse
import contextlib
import random
import re
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from tests.fuzz.corpus import Kind, kinds
from tests.fuzz.files import warm_up
from tests.fuzz.mutators import MUTATORS, flip_bits, mutate
from tests.fuzz.outcome import MOST_TEXT, Outcome
from tests.fuzz.processes import time_used
from tests.fuzz.reading import quickened

ROOMS = (
    *("surface.readers", "surface.base.files", "surface.base.keys", "surface.head.model", "surface.fit.source"),
    *("surface.fit.identities", "surface.mesh.domain", "surface.spline", "surface.dcp", "controller.takes"),
    *("controller.base", "controller.vocabulary", "controller.stage", "controller.robot", "controller.layers"),
    *("controller.links", "controller.tools.check", "controller.tools.file_kinds", "drivers", "tomllib", "json"),
)
"""Packages whose coverage guides it."""
TIMEOUT_S = 30
MEMORY_MB = 2500
PLACE = re.compile(r"\d+|'[^']*'|/\S+")


class Target:
    """Reads what the fuzzer makes, and keeps the first finding of each sort."""

    def __init__(self, kind: Kind, folder: Path, keep: Path) -> None:
        self.runs, self.sorts = 0, set[str]()
        self._kind, self._folder, self._path, self._keep = kind, folder, kind.lay_out(folder), keep

    def __call__(self, data: bytes) -> None:
        """Read one file; never raises, so that the fuzzer goes on."""
        self.runs += 1
        self._path.write_bytes(data)
        before_s, said = time_used(), self._folder / "said.txt"
        with streams(said):
            try:
                code = self._kind.read(self._path)
            except Exception:  # noqa: BLE001  it is the finding
                code = 99
                traceback.print_exc()
        outcome = Outcome(code, time_used() - before_s, 0.0, said.read_text(errors="replace")[:MOST_TEXT])
        if outcome.fault:
            self._note(data, outcome)

    def _note(self, data: bytes, outcome: Outcome) -> None:
        last = (outcome.output.strip().splitlines() or [""])[-1 if outcome.code == 99 else 0]
        sort = PLACE.sub("#", f"{outcome.fault} {last}"[:300])
        if sort in self.sorts:
            return
        self.sorts.add(sort)
        self._keep.mkdir(parents=True, exist_ok=True)
        stem = f"{self._kind.name}-guided-{len(self.sorts)}"
        (self._keep / f"{stem}-{self._path.name}").write_bytes(data)
        (self._keep / f"{stem}.txt").write_text(f"{outcome.fault}\n{outcome.output}", encoding="utf-8")
        print(f"{self._kind.name}: {outcome.fault}: {last[:200]}", flush=True)


@contextlib.contextmanager
def streams(path: Path) -> Iterator[None]:
    """Turn the output of this process to a file, as that of a command may be."""
    kept = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = path.open("w", encoding="utf-8"), path.open("a", encoding="utf-8")
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):  # those that omote put in their place
            stream.close()
        sys.stdout, sys.stderr = kept


def instrument(fuzzer: Any) -> int:
    """Count coverage in every function of :data:`ROOMS`; compiled ones stay as they are. How many there are."""
    count = 0
    for name in sorted(sys.modules):
        if not name.startswith(ROOMS) or "jit" in vars(sys.modules[name]):
            continue
        for function in _functions(sys.modules[name]):
            with contextlib.suppress(Exception):  # code that it cannot rewrite
                fuzzer.instrument_func(function)
                count += 1
    return count


def _functions(module: ModuleType) -> list[FunctionType]:
    found: list[FunctionType] = []
    for value in list(vars(module).values()):
        members = list(vars(value).values()) if isinstance(value, type) else [value]
        for member in members:
            plain = getattr(member, "__func__", getattr(member, "fget", member))
            if isinstance(plain, FunctionType) and plain.__module__ == module.__name__:
                found.append(plain)
    return found


def fuzz(kind: Kind, keep: Path, corpus: Path, seconds: int, seed: int) -> None:
    """Fuzz one kind in this process, which ends with it."""
    fuzzer = import_module("atheris")
    warm_up([kind])
    for number, data in enumerate(kind.seeds):
        (corpus / f"seed-{number}").write_bytes(data)

    def damage(data: bytes, most: int, number: int) -> bytes:
        draw = random.Random(number)
        if not data or draw.random() < 0.2:
            return bytes(fuzzer.Mutate(data, most))
        change = mutate if draw.random() < 0.8 else draw.choice(MUTATORS)
        try:
            return change(data, draw)[:most]
        except Exception:  # noqa: BLE001  what is damaged already need not be as that expects
            return flip_bits(data, draw)

    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, quickened():
        target = Target(kind, Path(folder), keep)
        print(f"{kind.name}: coverage of {instrument(fuzzer)} functions", flush=True)
        options = [
            f"-max_total_time={seconds}", f"-timeout={TIMEOUT_S}", f"-rss_limit_mb={MEMORY_MB}", f"-seed={seed}",
            f"-max_len={4 * max(map(len, kind.seeds)) + 1000}", f"-artifact_prefix={keep}/{kind.name}-",
            "-print_final_stats=1", str(corpus),
        ]  # fmt: skip
        fuzzer.Setup(["guided", *options], target, custom_mutator=damage)
        fuzzer.Fuzz()


def run_kind(name: str, given: argparse.Namespace) -> bool:
    """Fuzz one kind in a process of its own and print what came of it; whether it was sound."""
    corpus = (given.corpus or Path(tempfile.mkdtemp(prefix="corpus-"))) / name
    corpus.mkdir(parents=True, exist_ok=True)
    words = ["--kind", name, "--keep", str(given.keep), "--corpus", str(corpus), "--seed", str(given.seed)]
    began = time.monotonic()
    command = [sys.executable, "-m", "tests.fuzz.guided", *words, "--minutes", str(given.minutes)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    said = done.stdout + done.stderr
    runs = re.findall(r"number_of_executed_units: (\d+)", said) or re.findall(r"^#(\d+)", said, re.MULTILINE) or ["0"]
    reached = re.findall(r"cov: (\d+)", said) or ["0"]
    found = [line for line in done.stdout.splitlines() if line.startswith(f"{name}: ") and " functions" not in line]
    print(
        f"{name:14} {runs[-1]:>8} files in {time.monotonic() - began:4.0f} s  coverage {reached[0]} to {reached[-1]}  "
        f"{len(found)} findings" + (f", ended by {done.returncode}" if done.returncode else ""),
        flush=True,
    )
    for line in [*found, *(said.splitlines()[-15:] if done.returncode else [])]:
        print(f"    {line}")
    return not found and not done.returncode


def main() -> int:
    """Run, print a line for each kind; exit code 1 where there was a finding."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.guided", description=str(__doc__).splitlines()[0])
    parser.add_argument("--only", nargs="*", help="kinds (default all)")
    parser.add_argument("--minutes", type=float, default=5.0, help="for each kind (default 5)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=Path("out/fuzz"), help="folder for findings (default out/fuzz)")
    parser.add_argument("--corpus", type=Path, help="folder that keeps what reached new code")
    parser.add_argument("--kind", help=argparse.SUPPRESS)
    given = parser.parse_args()
    try:
        import_module("atheris")
    except ImportError:
        print("error: this needs the package atheris: pip install atheris", file=sys.stderr)
        return 2
    given.keep.mkdir(parents=True, exist_ok=True)
    if given.kind:
        kind = next(kind for kind in kinds() if kind.name == given.kind)
        fuzz(kind, given.keep, given.corpus, max(1, round(60 * given.minutes)), given.seed)
        return 0
    names = [kind.name for kind in kinds() if not given.only or kind.name in given.only]
    sound = [run_kind(name, given) for name in names]
    return int(not all(sound))


if __name__ == "__main__":
    sys.exit(main())
