"""The house has one direction: every import goes from a room to one before it, wherever in a file it stands.

The order is the table ``[tool.omote.rooms]`` of pyproject.toml. Imports inside functions and those that only a type
checker follows count as any other.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ORDER: dict[str, list[str]] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["omote"][
    "rooms"
]
BELOW = {"surface": set(), "drivers": set(), "controller": {"surface", "drivers"}}
"""Which of the three a module of each may import besides its own."""
FOREIGN = {
    "surface": {"serial", "dynamixel_sdk", "pydantic", "typer"},
    "drivers": {"moderngl", "numba", "scipy", "pydantic", "typer"},
    "controller": set(),
}
"""Packages that a room does without."""
COMPILED = {"drivers.core.kernels": {"numba"}}
"""Loaded by whoever drives a bus and by nobody else, so that looking for ports stays quick."""
MOST_MODULES = 20
REGISTRIES = {"drivers.base.plugins", "surface.export"}
"""Where modules are found by their folder: of the surface, which knows no drivers, and of all others."""


def modules() -> dict[str, Path]:
    """Every module of the three rooms by its dotted name."""
    found = {}
    for room in ORDER:
        for path in sorted((ROOT / room).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            found[name.removesuffix(".__init__")] = path
    return found


MODULES = modules()


@pytest.fixture(scope="module", autouse=True)
def forget() -> Iterator[None]:
    """Keep the files' trees no longer than these tests need them."""
    yield
    nodes.cache_clear()


@cache
def nodes(name: str) -> tuple[ast.AST, ...]:
    """Everything in the file of a module; parsed once for all tests."""
    return tuple(ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))))


@cache
def imports(name: str) -> tuple[str, ...]:
    """What a module imports, at any depth of its file: modules, or names of packages that are not its own."""
    found = []
    package = name.split(".") if MODULES[name].name == "__init__.py" else name.split(".")[:-1]
    for node in nodes(name):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            full = [f"{module}.{alias.name}" for alias in node.names]
            found += [each if each in MODULES else module for each in full]
    return tuple(found)


def place(name: str) -> tuple[str, int]:
    """Room of a module and where its sub-room stands in the order; the room's own ``__init__`` stands last."""
    room, _, inside = name.partition(".")
    fitting = [k for k, sub in enumerate(ORDER[room]) if inside == sub or inside.startswith(f"{sub}.")]
    if not inside:
        return room, len(ORDER[room])
    assert fitting, f"{name} is in no room of pyproject.toml's [tool.omote.rooms]"
    return room, max(fitting, key=lambda k: len(ORDER[room][k]))


def is_against(name: str, other: str) -> bool:
    """Whether the import of ``other`` by ``name`` goes against the order."""
    room, at = place(name)
    there, position = place(other)
    return there not in BELOW[room] if there != room else position > at


@pytest.mark.slow
@pytest.mark.parametrize("room", ORDER)
def test_every_import_goes_with_the_order(room: str) -> None:
    names = [name for name in MODULES if name.split(".")[0] == room]
    assert names
    wrong = [(a, b) for a in names for b in imports(a) if b.split(".")[0] in ORDER and is_against(a, b)]
    assert wrong == []


def test_no_import_goes_in_a_circle() -> None:
    edges = {a: {b for b in imports(a) if b in MODULES and b != a} for a in MODULES}
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        pytest.fail(" imports ".join(reversed(error.args[1])))


def has_reason(node: ast.stmt, lines: list[str]) -> bool:
    """Whether a comment stands with an import, or above the run of lines of imports and comments it belongs to."""
    if any("#" in line for line in lines[node.lineno - 1 : node.end_lineno]):
        return True
    at = node.lineno - 2
    while lines[at].strip().startswith(("import ", "from ", "#")):
        if "#" in lines[at]:
            return True
        at -= 1
    return False


def imported_packages(node: ast.Import | ast.ImportFrom) -> set[str]:
    """What is imported, as far as one reason goes: a foreign package, or a module of our own."""
    if isinstance(node, ast.Import):
        return {alias.name.split(".")[0] for alias in node.names}
    own = node.level or (node.module or "").split(".")[0] in ORDER
    return {node.module or node.names[0].name} if own else {(node.module or "").split(".")[0]}


@pytest.mark.parametrize("room", ORDER)
def test_an_import_inside_a_function_says_why(room: str) -> None:
    """Only an optional package or start-up time asks for one; a module says it once for what it imports so."""
    bare = []
    for name, path in MODULES.items():
        if name.split(".")[0] != room:
            continue
        lines = path.read_text(encoding="utf-8").splitlines()
        functions = [n for n in nodes(name) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
        found = [n for each in functions for n in ast.walk(each) if isinstance(n, ast.Import | ast.ImportFrom)]
        told = {p for node in found if has_reason(node, lines) for p in imported_packages(node)}
        bare += [f"{name}:{node.lineno}" for node in found if not imported_packages(node) <= told]
    assert sorted(set(bare)) == []


@pytest.mark.parametrize("room", ORDER)
def test_own_modules_are_imported_by_name_only_in_the_registry(room: str) -> None:
    """``import_module`` elsewhere would hide an import from the tests above; it may name other people's packages."""
    hidden = []
    for name in MODULES:
        if name.split(".")[0] != room or name in REGISTRIES:
            continue
        for node in nodes(name):
            called = getattr(node, "func", None)
            word = getattr(called, "attr", getattr(called, "id", ""))
            if word in ("import_module", "__import__") and not is_foreign(node.args[0]):  # type: ignore[attr-defined]
                hidden.append(f"{name}:{node.lineno}")
    assert hidden == []


def is_foreign(argument: ast.expr) -> bool:
    """Whether a module's name plainly begins with that of a package that is not one of the rooms."""
    first = argument.values[0] if isinstance(argument, ast.JoinedStr) else argument
    text = first.value if isinstance(first, ast.Constant) else ""
    return isinstance(text, str) and text.partition(".")[0] not in ("", *ORDER)


@pytest.mark.parametrize("room", ORDER)
def test_a_room_does_without_packages_that_are_not_for_it(room: str) -> None:
    used = {
        name: {other.split(".")[0] for other in imports(name)} & FOREIGN[room] - COMPILED.get(name, set())
        for name in MODULES
        if name.split(".")[0] == room
    }
    assert {name: found for name, found in used.items() if found} == {}


def test_only_the_view_draws() -> None:
    drawing = {"moderngl", "imgui_bundle", "glfw"}
    names = [name for name in MODULES if name.startswith("surface.") and not name.startswith("surface.view.")]
    assert [name for name in names if {other.split(".")[0] for other in imports(name)} & drawing] == []


def test_no_folder_is_crowded() -> None:
    folders: dict[Path, int] = {}
    for path in MODULES.values():
        folders[path.parent] = folders.get(path.parent, 0) + (path.name != "__init__.py")
    assert {str(folder.relative_to(ROOT)): n for folder, n in folders.items() if n > MOST_MODULES} == {}


def test_every_folder_says_what_comes_in_what_goes_out_and_what_it_may_import() -> None:
    silent = []
    for name, path in MODULES.items():
        if path.name == "__init__.py":
            module = nodes(name)[0]
            assert isinstance(module, ast.Module)
            text = ast.get_docstring(module) or ""
            if not all(word in text for word in ("In: ", "Out: ", "Imports ")):
                silent.append(name)
    assert silent == []


def test_no_module_takes_a_name_of_the_standard_library() -> None:
    taken = {*sys.stdlib_module_names, "serial"}
    assert [name for name in MODULES if name.split(".")[-1] in taken] == []


ALONE = """
import gc, importlib, os, sys
gc.disable()  # going over all objects would copy their memory into every child
for package in sys.argv[1].split():
    try:
        importlib.import_module(package)  # once for all: here only the rooms' own imports are looked at
    except ImportError:
        pass
from surface.base import jit
jit.kernel = jit.inlined = lambda function: function  # looking for compiled kernels takes most of the time
jit.declared = lambda *signatures: lambda function: function
for names in sys.argv[2:]:
    child = os.fork()
    if not child:
        for name in names.split():
            try:
                importlib.import_module(name)
            except BaseException as error:
                print(f"{name}: {error!r}", flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""
HEAVY = (
    "numba numba.core.registry scipy.sparse scipy.optimize scipy.spatial scipy.ndimage pydantic rich.table typer "
    "moderngl serial dynamixel_sdk"
)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks, to import every module before all others")
def test_every_folder_can_be_imported_first_and_backwards() -> None:
    """That no import goes in a circle is tested above; this finds what only shows when modules run."""
    folders: dict[str, list[str]] = {}
    for name in sorted(MODULES, reverse=True):
        folders.setdefault(name.rpartition(".")[0], []).append(name)
    names = [" ".join(folder) for folder in folders.values()]
    done = subprocess.run([sys.executable, "-W", "ignore::DeprecationWarning", "-c", ALONE, HEAVY, *names],
        capture_output=True, text=True, cwd=ROOT,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},  # a process of one thread may fork
    )  # fmt: skip
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 0)
