"""docs/links.md: its tables are those of the registry, its keys those of the links, and its stages can be read."""

from __future__ import annotations

import math
import re
import tomllib
from importlib import util
from pathlib import Path
from typing import Any

import pytest

from controller.formats.format import FORMATS
from controller.links.links import read_link
from controller.links.net.settings import NetSettings
from drivers.base.options import REQUIRED, entries

PAGE = Path(__file__).resolve().parent.parent / "docs" / "links.md"
TEXT = PAGE.read_text(encoding="utf-8")


def maker() -> Any:
    """The program that writes the tables."""
    spec = util.spec_from_file_location("make_links_matrix", PAGE.parent / "make_links_matrix.py")
    assert spec is not None and spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_tables_are_those_of_the_registry() -> None:
    assert maker().with_tables(TEXT) == TEXT, "python docs/make_links_matrix.py"


def test_every_format_has_a_section_of_its_own() -> None:
    for kind in FORMATS.kinds():
        assert FORMATS.package_of(kind) or f"`{kind}`" in TEXT


def rows() -> dict[str, str]:
    """Keys of the table with their defaults as they are written."""
    found: dict[str, str] = {}
    for line in TEXT.partition("## Keys")[2].partition("##")[0].splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        if line.startswith("| `"):
            keys = re.findall(r"`(\w+)`", cells[0])
            values = [value.strip() for value in cells[1].strip("|").split(",")]
            found |= dict(zip(keys, values + [""] * len(keys), strict=False))
    return found


def test_every_key_is_explained_with_its_default() -> None:
    written = rows()
    assert {*written} == {entry.name for entry in entries(NetSettings)}
    for entry in entries(NetSettings):
        default = entry.default
        if default in (None, REQUIRED, {}) or entry.name == "timeout_s":
            continue
        shown = f'"{default}"' if isinstance(default, str) else f"{default:g}" if type(default) is not bool else "false"
        assert written[entry.name].strip("`") == shown, entry.name


def test_the_formats_that_may_be_silent_for_ever_are_named() -> None:
    (row,) = [line for line in TEXT.splitlines() if line.startswith("| `timeout_s`")]
    silent = {kind for kind in FORMATS.kinds() if math.isinf(FORMATS.get(kind).timeout_s)}
    assert {*re.findall(r"`([\w-]+)`", row)} - {"timeout_s"} == silent


@pytest.mark.parametrize("block", re.findall(r"```toml\n(.*?)```", TEXT, re.S))
def test_every_example_can_be_read(block: str) -> None:
    for table in tomllib.loads(block).get("links", []):
        assert str(read_link(table))
