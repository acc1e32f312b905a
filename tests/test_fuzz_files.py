"""The fuzzer of files: a short run finds nothing, and it would find what it looks for."""

from __future__ import annotations

import io
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.fuzz import structures
from tests.fuzz.corpus import Kind
from tests.fuzz.files import Fuzzer, Turn, turns_of
from tests.fuzz.guided import Target
from tests.fuzz.mutators import mutate
from tests.fuzz.structures import change_tree, damage_arrays, damage_tree

ROOT = Path(__file__).resolve().parent.parent
MOST_S = 0.4

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of processes as on Linux")


@pytest.mark.slow
def test_damaged_files_of_some_kinds_are_each_one_message() -> None:
    """The short form of ``make fuzz``."""
    kinds = ["stage", "wav", "head.npz", "accessories.npz", "glb", "rhubarb"]
    command = [sys.executable, "-m", "tests.fuzz.files", "--count", "12", "--jobs", "1", "--only", *kinds]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(" 12 files") == len(kinds)


def refuse(path: Path) -> int:
    os.write(2, f"error: {path.name} is damaged\n".encode())
    return 1


def trace(path: Path) -> int:
    raise KeyError(path.name)


def say_twice(path: Path) -> int:
    return refuse(path) and refuse(path)


def leave(path: Path) -> int:
    return 70 * refuse(path)


def work(path: Path) -> int:
    end = time.process_time() + 1.2 * MOST_S
    while time.process_time() < end:
        pass
    return refuse(path)


def fill(path: Path) -> int:
    data = bytearray(900 << 20)
    data[::4096] = b"x" * len(data[::4096])
    return refuse(path)


def die(path: Path) -> int:
    os.kill(os.getpid(), signal.SIGKILL)


def babble(path: Path) -> int:
    os.write(2, f"error: {path.name}: 'NoneType' object is not subscriptable\n".encode())
    return 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("act", "fault"),
    [
        (trace, "exit code 99"), (say_twice, "2 messages"), (leave, "exit code 70"), (work, "s of processor time"),
        (fill, " MB"), (die, "ended by SIGKILL"), (babble, "in Python's words"),
    ],
)  # fmt: skip
def test_each_fault_is_found_kept_and_does_not_end_the_run(
    tmp_path: Path, act: Callable[[Path], int], fault: str
) -> None:
    def read(path: Path) -> int:
        return act(path) if path.read_bytes().startswith(b"B") else refuse(path)

    kind = Kind("invented", "invented.dat", [b"A" * 99, b"B" * 99, b"A" * 99], read)
    fuzzer = Fuzzer(2, tmp_path / "kept", most_s=MOST_S if act is work else 60.0)  # filling takes a second under load
    fuzzer.run(iter([Turn(kind, 0, 4), Turn(kind, 4, 4)]), jobs=2, end_s=float("inf"))
    tally = fuzzer.tallies["invented"]
    assert tally.files == 8
    assert sorted(number for number, _, _ in tally.faults) == [2, 3, 5]
    assert all(fault in each for _, each, _ in tally.faults), tally.faults
    assert len(list((tmp_path / "kept").glob("*.txt"))) == len(tally.faults) == fuzzer.faults


def test_what_a_file_leaves_behind_for_the_next_one_is_told_apart(tmp_path: Path) -> None:
    seen: list[int] = []

    def read(path: Path) -> int:
        seen.append(1)
        return 70 if len(seen) > 2 else refuse(path)

    fuzzer = Fuzzer(1)
    fuzzer.run(iter([Turn(Kind("k", "k.txt", [b"A"], read), 0, 3)]), jobs=1, end_s=float("inf"))
    ((number, fault, text),) = fuzzer.tallies["k"].faults
    assert number == 2 and fault == "exit code 70" and text.startswith("only after other files")


def test_kinds_take_turns() -> None:
    every = [Kind(name, "x", [b""]) for name in "ab"]
    turns = [(turn.kind.name, turn.first, turn.count) for turn in turns_of(every, 300)]
    assert turns == [("a", 0, 250), ("b", 0, 250), ("a", 250, 50), ("b", 250, 50)]


def test_structures_stay_sound_and_the_same_seed_gives_the_same_damage() -> None:
    data = json.dumps({"a": [1, {"b": "text"}], "c": 2.5}).encode()
    first = [mutate(data, random.Random(k)) for k in range(200)]
    assert first == [mutate(data, random.Random(k)) for k in range(200)]
    sound = 0
    for each in first:
        try:
            sound += json.loads(each) != json.loads(data)
        except ValueError:
            continue
    assert sound > 100
    tree = json.loads(data)
    assert change_tree(tree, random.Random(1)) != tree == json.loads(data)


def test_copies_of_copies_do_not_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    data = json.dumps({"a": [["x" * 3000]]}).encode()

    def longest() -> int:
        return max(len(damage_tree(data, random.Random(k)) or b"") for k in range(500))

    assert longest() > 1_000_000  # a list with a thousand copies
    monkeypatch.setattr(structures, "LARGEST", 100_000)
    assert longest() < 200_000


def test_arrays_of_every_shape_can_be_damaged() -> None:
    stored = io.BytesIO()
    np.savez(stored, none=np.zeros(0), one=np.array(7), many=np.ones((3, 4)), names=np.array(["a", "bc"]))
    changed = [damage_arrays(stored.getvalue(), random.Random(k)) for k in range(500)]
    assert None not in changed and len(set(changed)) > 100


def test_the_guided_fuzzer_keeps_the_first_finding_of_each_sort(tmp_path: Path) -> None:
    target = Target(
        Kind("k", "k.dat", [b""], lambda path: int(path.read_bytes())), tmp_path / "work", tmp_path / "kept"
    )
    for data in (b"0", b"x1", b"70", b"x2", b"70"):
        target(data)
    assert target.runs == 5 and len(target.sorts) == 2
    assert [path.read_bytes() for path in sorted((tmp_path / "kept").glob("*.dat"))] == [b"x1", b"70"]
