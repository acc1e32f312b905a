"""Everything read is bounded: only surface.base.files opens files that users give, and it reads within limits."""

from __future__ import annotations

import ast
import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from controller.base.errors import OMOTE_ERRORS
from controller.tools.check import check_anything

ROOT = Path(__file__).resolve().parents[1]
ALLOWED = {
    "surface/base/files.py": "is the place",
    "surface/base/jit.py": "omote's own modules",
    "surface/view/draw/programs.py": "omote's own shaders",
    "controller/base/steal_time.py": "the kernel's counters",
    "controller/body/sources.py": "a voice may come from a named pipe or a device",
    "controller/face/face.py": "the kernel's counters",
    "controller/tools/bench_bus.py": "shipped stages, and reports that it wrote itself",
    "drivers/boards/hobby.py": "omote's own tables",
    "drivers/port/serialport.py": "the kernel's settings of a port",
    "drivers/sim/serving/simulated.py": "the kernel's counters",
    "drivers/tables/manual.py": "omote's own tables",
    "drivers/tables/tables.py": "omote's own tables, and those of dynamixel-sdk",
}
"""Modules that read files by other means, and what these are."""
READERS = {"read_text", "read_bytes", "load", "loadtxt", "genfromtxt", "fromfile", "memmap", "ZipFile"}
OWNERS = {"files", "np", "numpy", "tomllib", "json", "zipfile"}


def reads(tree: ast.AST) -> Iterator[int]:
    """Lines on which a module opens a file for reading, or reads one whole."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name, owner = _called(node.func)
        modes = [a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
        writes = any(set(mode) <= set("wxabt+") and set(mode) & set("wxa") for mode in modes)
        opens = name == "open" and (_is_file(node, modes) if owner else not writes)
        whole = name in ("read_text", "read_bytes") and owner not in ("files", "")
        if opens or whole or (name in READERS and owner in OWNERS - {"files"}):
            yield node.lineno


def _called(function: ast.expr) -> tuple[str, str]:
    """A function's name and what it is taken from: a module, ``?`` for a value, nothing for a plain name."""
    if isinstance(function, ast.Attribute):
        owner = function.value
        return function.attr, owner.id if isinstance(owner, ast.Name) and owner.id in OWNERS else "?"
    return (function.id, "") if isinstance(function, ast.Name) else ("", "")


def _is_file(node: ast.Call, modes: list[str]) -> bool:
    """Whether ``value.open(...)`` opens a path: ports, links and pictures take no mode."""
    return "r" in "".join(modes) or any(k.arg in ("encoding", "newline") for k in node.keywords if not modes)


@pytest.mark.parametrize("room", ["surface", "controller", "drivers"])
def test_files_are_read_in_one_place(room: str) -> None:
    found = {}
    for path in sorted((ROOT / room).rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        if lines := list(reads(ast.parse(path.read_text(encoding="utf-8")))):
            found[name] = lines
    assert {name: lines for name, lines in found.items() if name not in ALLOWED} == {}
    assert {name for name in ALLOWED if name.startswith(room)} <= set(found), "modules that no longer read files"


@pytest.mark.parametrize(
    "code",
    ["open(p)", "open(p, 'rb')", "p.open('rb')", "p.open(encoding='utf-8')", "p.read_text()", "p.read_bytes()",
     "np.load(p)", "tomllib.load(f)", "json.load(f)", "zipfile.ZipFile(p)"],
)  # fmt: skip
def test_every_way_to_read_is_seen(code: str) -> None:
    assert list(reads(ast.parse(code))) == [1]


@pytest.mark.parametrize("code", ["open(p, 'w')", "p.open('wb')", "link.open()", "files.read_text(p)", "json.loads(t)"])
def test_what_reads_no_file_is_not(code: str) -> None:
    assert list(reads(ast.parse(code))) == []


NAMES = ("a.toml", "a.json", "a.csv", "a.tsv", "a.wav", "a.rec", "a.xml", "a.tsm", "head/head.toml", "head/head.npz")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("name", NAMES)
def test_a_named_pipe_is_refused_at_once_whatever_its_name(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    if name.endswith("head.npz"):
        (path.parent / "head.toml").write_text("format = 1")
    os.mkfifo(path)
    with pytest.raises(OMOTE_ERRORS, match="is a named pipe"):
        check_anything(str(path.parent if "head" in name else path))


BRACKETS = "[" * 5000
DEEP = {"a.toml": "a = " + BRACKETS, "a.json": '{"moves_mm": ' + BRACKETS, "b.json": BRACKETS, "a.rec": BRACKETS}


@pytest.mark.parametrize("name", DEEP)
def test_brackets_in_brackets_are_one_message(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(DEEP[name])
    with pytest.raises(OMOTE_ERRORS):
        check_anything(str(tmp_path / name))


@pytest.mark.parametrize("name", ["a.toml", "a.json", "a.csv", "a.tsv", "a.xml"])
def test_other_encodings_are_named(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes('name = "Zoë"'.encode("latin-1"))
    with pytest.raises(OMOTE_ERRORS, match="probably Latin-1"):
        check_anything(str(tmp_path / name))


def test_a_byte_order_mark_is_read_over(tmp_path: Path) -> None:
    texts = {
        "s.toml": 'name = "s"\nsteps = ["0 NEUTRAL"]',
        "v.tsv": "0.0\taa\n0.5\tsil\n",
        "v.json": json.dumps({"mouthCues": [{"start": 0, "end": 1, "value": "A"}]}),
    }
    for name, text in texts.items():
        (tmp_path / name).write_bytes(b"\xef\xbb\xbf" + text.encode())
        assert check_anything(str(tmp_path / name))


def test_long_lists_are_refused_by_their_number(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(f'name = "s"\nrobots = {json.dumps(["head24"] * 20_000)}')
    with pytest.raises(OMOTE_ERRORS, match="robots: list should have at most 32"):
        check_anything(str(path))
    path.write_text("steps = [" + '"0 NEUTRAL", ' * 200_000 + "]")
    with pytest.raises(OMOTE_ERRORS, match="larger than 1 MB"):
        check_anything(str(path))


def test_only_the_first_faults_of_a_file_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text('name = "s"\nsteps = [' + '"x", ' * 1000 + "]")
    with pytest.raises(OMOTE_ERRORS, match=r"1000 faults[\s\S]*and 950 more") as raised:
        check_anything(str(path))
    assert len(str(raised.value).splitlines()) == 52
