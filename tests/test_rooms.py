"""The house has one direction: surface and drivers know nothing of each other or of controller."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FORBIDDEN = {
    "surface": {"drivers", "controller", "serial", "dynamixel_sdk", "pydantic", "typer"},
    "drivers": {"surface", "controller", "moderngl", "numba", "scipy", "pydantic", "typer"},
}
COMPILED = {"drivers/core/kernels.py": {"numba"}}
"""Loaded by whoever drives a bus and by nobody else, so that looking for ports stays quick."""


def imported(path: Path) -> set[str]:
    """Top-level names of every module ``path`` imports, at any depth of the file."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("room", FORBIDDEN)
def test_room_imports_nothing_from_above(room: str) -> None:
    files = sorted((ROOT / room).rglob("*.py"))
    assert files
    wrong = {name: imported(ROOT / name) & FORBIDDEN[room] for name in (str(f.relative_to(ROOT)) for f in files)}
    wrong = {name: found - COMPILED.get(name, set()) for name, found in wrong.items()}
    assert {name: found for name, found in wrong.items() if found} == {}


def test_only_the_view_draws() -> None:
    files = [f for f in (ROOT / "surface").rglob("*.py") if "view" not in f.relative_to(ROOT).parts]
    assert [f.name for f in files if imported(f) & {"moderngl", "imgui_bundle", "glfw"}] == []
