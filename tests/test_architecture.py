"""docs/architecture.md and the other pages: every room, file, module and function that they name is there.

Names are looked up in the syntax trees of the files, so nothing is imported here.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ORDER: dict[str, list[str]] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["omote"][
    "rooms"
]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
FOLDERS = (*ORDER, "configs", "tests", "docs", "benchmarks", ".ci")
"""What begins with one of these and a slash is a path in the repository."""
PLACEHOLDER = "KIND"
"""Stands for any name in a path."""
WALKS = {
    "From a line to a vertex": 15,
    "From the same line to a goal on the wire": 10,
    "From a mesh to control points": 12,
}
"""Headings of the walks, and how many steps each has at least."""

FENCED = re.compile(r"^```.*?^```", re.M | re.S)
QUOTED = re.compile(r"`([^`\n]+)`")
PATH = re.compile(rf"(?<![\w./~-])(?:{'|'.join(map(re.escape, FOLDERS))})/[\w./*-]*(?:::\w+)?")
DOTTED = re.compile(rf"(?<![\w./-])(?:{'|'.join(ORDER)})(?:\.\w+)+(?![\w/]*/)")
FILE_IN_NO_FOLDER = re.compile(r"(?<![\w./*-])\w+\.py\b")
LINK = re.compile(r"\]\(([^)#:\s]*)(?:#([\w-]+))?\)")
IMPORT = re.compile(rf"^\s*from ((?:{'|'.join(ORDER)})[\w.]*) import ([\w, ]+)", re.M)
REFERENCE = re.compile(rf'"((?:{"|".join(ORDER)})[\w.]+):([\w.]+)"')


@cache
def tree(path: Path) -> ast.Module:
    """A file's syntax tree, its imports with the whole names of modules."""
    found = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(found):
        if isinstance(node, ast.ImportFrom) and node.level:
            package = path.relative_to(ROOT).parts[: -node.level]
            node.module, node.level = ".".join([*package, *([node.module] if node.module else [])]), 0
    return found


def file_of(module: str) -> Path | None:
    """The file of a module or package; None where there is none."""
    path = ROOT.joinpath(*module.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


def named(body: list[ast.stmt]) -> Iterator[tuple[str, ast.AST]]:
    """What a module or class defines or imports under its own roof, conditions included."""
    for node in body:
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                yield node.name, node
            case ast.Assign():
                yield from ((each.id, node) for each in node.targets if isinstance(each, ast.Name))
            case ast.AnnAssign(target=ast.Name(id=name)):
                yield name, node
            case ast.Import() | ast.ImportFrom():
                yield from (((alias.asname or alias.name).split(".")[0], node) for alias in node.names)
            case ast.If() | ast.Try():
                yield from named([*node.body, *node.orelse])


def is_there(dotted: str) -> bool:
    """Whether a dotted name is a package, a module, or something that one defines or imports."""
    parts = dotted.split(".")
    for at in range(len(parts), 0, -1):
        file = file_of(".".join(parts[:at]))
        if file is not None:
            return holds(tree(file).body, parts[at:])
    return False


def holds(module: list[ast.stmt], names: list[str]) -> bool:
    """Whether a module has something, as ``["Class", "method"]``; what it imports is looked up where it comes from."""
    if not names:
        return True
    for name, node in named(module):
        if name == names[0]:
            if isinstance(node, ast.ImportFrom):
                (first,) = [each.name for each in node.names if (each.asname or each.name) == name]
                return is_there(".".join([node.module or "", first, *names[1:]]))
            return len(names) == 1 or (isinstance(node, ast.ClassDef) and has(node, names[1:], module))
    return False


def has(owner: ast.ClassDef, names: list[str], module: list[ast.stmt]) -> bool:
    """Whether a class of a module, or one that it is made from, has something."""
    bases = [ast.unparse(base).split(".") for base in owner.bases]
    return holds(owner.body, names) or any(holds(module, [*base, *names]) for base in bases)


def is_path(text: str) -> bool:
    """Whether a path leads to a file or folder; ``::name`` behind it is something that the file defines."""
    path, _, name = text.partition("::")
    found = list(ROOT.glob(path.replace(PLACEHOLDER, "*").rstrip("/.")))
    return bool(found) and (not name or holds(tree(found[0]).body, [name]))


def leads(target: Path, place: str) -> bool:
    """Whether a file is there and, where a place in it is named, has such a heading."""
    if not target.exists() or not place:
        return target.exists()
    headings = re.findall(r"^#+ (.+)$", FENCED.sub("", target.read_text(encoding="utf-8")), re.M)
    return place in {re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-") for heading in headings}


def quoted(page: Path) -> list[str]:
    return QUOTED.findall(FENCED.sub("", page.read_text(encoding="utf-8")))


def page() -> str:
    return (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    """What stands below a heading of the third level."""
    return page().partition(f"### {title}\n")[2].partition("\n#")[0]


def steps(title: str) -> list[str]:
    """The numbered lines of a walk."""
    return re.findall(r"^\d+\. (.*)$", section(title), re.M)


@pytest.mark.parametrize("room", ORDER)
def test_the_page_has_every_sub_room_in_its_order(room: str) -> None:
    assert re.findall(r"^\| `([\w.]+)` \|", section(f"`{room}`"), re.M) == ORDER[room]


@pytest.mark.parametrize("room", ORDER)
def test_the_page_says_what_goes_out_of_every_sub_room(room: str) -> None:
    rows = re.findall(r"^\| `[\w.]+` \|.*$", section(f"`{room}`"), re.M)
    assert [row for row in rows if len(row.split(" | ")) != 3 or not row.strip(" |").split(" | ")[-1].strip()] == []


@pytest.mark.parametrize("title", WALKS)
def test_every_step_of_a_walk_is_a_function_that_is_there(title: str) -> None:
    walk = steps(title)
    assert len(walk) >= WALKS[title]
    names = [QUOTED.match(step) for step in walk]
    assert [step for step, name in zip(walk, names, strict=True) if name is None] == []
    assert [name[1] for name in names if name and not (DOTTED.fullmatch(name[1]) and is_there(name[1]))] == []


@pytest.mark.parametrize("title", WALKS)
def test_the_steps_of_a_walk_are_counted(title: str) -> None:
    numbers = [int(number) for number in re.findall(r"^(\d+)\. ", section(title), re.M)]
    assert numbers == list(range(1, len(numbers) + 1))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_path_of_a_page_is_there(page: Path) -> None:
    paths = [path for text in quoted(page) for path in PATH.findall(text)]
    assert [path for path in paths if not is_path(path)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_are_named_with_their_folder(page: Path) -> None:
    assert [text for text in quoted(page) if FILE_IN_NO_FOLDER.search(text)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_module_and_name_of_a_page_is_there(page: Path) -> None:
    names = [name for text in quoted(page) for name in DOTTED.findall(text)]
    assert [name for name in names if not is_there(name)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_the_examples_of_a_page_import_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    found = [f"{module}.{name.strip()}" for module, names in IMPORT.findall(text) for name in names.split(",")]
    found += [f"{module}.{name}" for module, name in REFERENCE.findall(text)]
    assert [name for name in found if not is_there(name)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_of_a_page_leads_somewhere(page: Path) -> None:
    broken = []
    for path, place in LINK.findall(FENCED.sub("", page.read_text(encoding="utf-8"))):
        target = page.parent / path if path else page
        if not leads(target, place):
            broken.append(f"{path}#{place}")
    assert broken == []


@pytest.mark.parametrize(
    ("name", "there"),
    [
        ("drivers.boards.bus.BoardBus", True),
        ("drivers.boards.bus.BoardBus.write_everything", False),
        ("controller.body.body.Body._control_loop", True),
        ("controller.body.bodies", False),
        ("surface.DCPSurface.evaluate", True),
        ("surface.DCPSurface.guess", False),
        ("drivers.KINDS", False),
    ],
)
def test_names_are_found_only_where_they_are(name: str, there: bool) -> None:
    assert is_there(name) is there


@pytest.mark.parametrize(
    ("path", "there"),
    [
        ("drivers/KIND/family.py", True),
        ("drivers/sim/serving/families.py", False),
        ("tests/drivers/contract.py::BusContract", True),
        ("tests/drivers/contract.py::BusTreaty", False),
        ("configs/scripts/*.toml", True),
    ],
)
def test_paths_are_found_only_where_they_are(path: str, there: bool) -> None:
    assert is_path(path) is there
