"""omote without its extras: what needs none works, what needs one says so at once; and hints fit an installed omote."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from surface.head import save_data
from tests.surface.small_head import small_head

ROOMS = ("controller", "surface", "drivers")
OMOTE = """
import contextlib, io, json, sys
for name in json.loads(sys.argv[1]):
    sys.modules[name] = None  # as if it were not installed
from controller.cli.app import main
for words in json.loads(sys.argv[2]):
    sys.argv = ["omote", *words]
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
    print(json.dumps([words, code, out.getvalue(), err.getvalue()]), flush=True)
"""
ROBOT = """
name = "smooth"
[[buses]]
name = "head"
kind = "simulated"
[[channels]]
name = "jaw"
bus = "head"
id = 1
model = "xl330-m288"
mix = { jawOpen = 1 }
map = { at = [0, 0.5, 1], deg = [0, 5, 20], curve = "smooth" }
limit_deg = [0, 20]
max_speed_deg_s = 100
max_accel_deg_s2 = 1000
"""


def without(missing: list[str], *commands: tuple[str, ...], cwd: Path) -> Iterator[tuple[list[str], int, str, str]]:
    """Words, exit code, output and errors of commands, run by one process that lacks some packages."""

    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", OMOTE, json.dumps(missing), json.dumps(commands)]
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == 0, done.stderr
    yield from map(json.loads, done.stdout.splitlines())


@pytest.mark.slow
def test_what_drives_a_head_needs_no_scipy(tmp_path: Path) -> None:
    (tmp_path / "smooth.toml").write_text(ROBOT)
    (tmp_path / "stage.toml").write_text('name = "mine"\nrobots = ["smooth.toml"]\n')
    (tmp_path / "anchors.toml").write_text('name = "anchors"\nrobots = ["head24-anchors"]\n')
    save_data(tmp_path / "small", small_head())
    (tmp_path / "a.tsv").write_text("0.0\taa\n0.4\tsil\n")
    commands = (
        ("check", "smooth.toml"), ("check", "head24-anchors"), ("plugins",),
        ("run", "stage.toml", "--dry-run", "--seconds", "0.2"),
        ("play", "a.tsv", "--stage", "stage.toml", "--dry-run"),
        ("run", "anchors.toml", "--no-face", "--seconds", "0.2"),
        ("simulate", "robot", "--help"), ("render", "-o", "face.png", "--size", "64x64"),
        ("export", "head.obj", "--head", "small"), ("check", "small"),
    )  # fmt: skip
    *results, checked = without(["scipy"], *commands, cwd=tmp_path)
    assert [(words, code) for words, code, *_ in results if code] == [], results
    assert len(results) == len(commands) - 1
    assert checked[1] == 1 and "small: missing eye: " in checked[3] and "scipy" not in checked[3]


def test_pictures_are_imported_before_what_writes_them(tmp_path: Path) -> None:
    code = "import sys, surface.view; print(*{'PIL', 'moderngl', 'imgui_bundle', 'scipy.sparse'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=240, check=True)
    assert done.stdout.strip() == ""


def test_what_needs_scipy_names_the_extra(tmp_path: Path) -> None:
    commands = ("fit", "me.glb", "-o", "me"), ("bench", "surface")
    for words, code, _, said in without(["scipy"], *commands, cwd=tmp_path):
        assert code == 1 and "needs the package scipy: not installed" in said, (words, said)
        assert "try: pip install 'omote[fit]'" in said


@pytest.mark.slow
def test_what_draws_names_the_extra_before_anything_starts(tmp_path: Path) -> None:
    commands = (
        ("run", "demo", "--headless", "--seconds", "1"), ("play", "nothing.tsv"), ("demo", "--headless"),
        ("render", "-o", "x.png"), ("bench", "quadtree", "-o", "x.png"), ("bench", "bus", "--face"),
    )  # fmt: skip
    for words, code, out, said in without(["moderngl", "PIL", "imgui_bundle"], *commands, cwd=tmp_path):
        assert (code, out) == (1, ""), words
        assert "try: pip install 'omote[view]'" in said, (words, said)
    assert list(tmp_path.iterdir()) == []


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Every text of a module that is no docstring: those that a user may come to read."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docs = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in docs:
            yield node.lineno, node.value


@pytest.mark.slow
@pytest.mark.parametrize("room", ROOMS)
def test_no_message_names_what_only_a_checkout_has(root: Path, room: str) -> None:
    found = [
        (str(path.relative_to(root)), line, text)
        for path in (root / room).rglob("*.py")
        for line, text in texts(path)
        if any(word in text for word in ("docs/", "make setup", "make demo", "the checkout", "README"))
    ]
    assert found == []
