"""The tables of the pages know the registries: every kind of bus, link and take that omote brings, and its options."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

import drivers
from controller.links.kind import LINKS
from controller.robot.buses import BusSettings, families_by_option
from controller.robot.linkages.kind import LINKAGES, LinkageSettings
from controller.takes.reader import TAKES, suffixes
from drivers.base.options import entries
from drivers.base.plugins import Registry
from drivers.core.registry import FAMILIES, SIMULATED
from drivers.sim.wire.simulator import simulator_of
from surface.export import SUFFIXES

Page = Callable[[str], str]

WORD = re.compile(r"`(--)?([a-z]\w*(?:-\w+)*)`")
"""A key, a kind or an option in backticks; a value such as `"adopt"` is none."""


def own(registry: Registry[Any]) -> list[str]:
    """Kinds that omote brings; the pages cannot know those of other packages."""
    return [kind for kind in registry.kinds() if not registry.package_of(kind)]


def options_of(settings: type) -> set[str]:
    return {entry.name for entry in entries(settings)}


def words(text: str) -> list[str]:
    return [name for _, name in WORD.findall(text)]


def rows(text: str, head: str) -> Iterator[list[str]]:
    """Cells of the table whose first line begins with ``head``."""
    _, found, below = text.partition(f"\n| {head} |")
    assert found, f"there is no table that begins with | {head} |"
    for line in below.splitlines()[2:]:
        if not line.startswith("|"):
            return
        yield [cell.strip() for cell in line.strip("|").split(" | ")]


def options_in(table: Iterable[list[str]]) -> dict[str, set[str]]:
    """Options in the last cell by the kinds in the first one; what stands in brackets is a default or a value."""
    found: dict[str, set[str]] = {}
    for first, *_, last in table:
        for kind in words(first):
            found.setdefault(kind, set()).update(words(re.sub(r"\([^()]*\)", "", last)))
    return found


@pytest.fixture(scope="module")
def page(root: Path) -> Page:
    return lambda name: (root / name).read_text(encoding="utf-8")


def test_robots_names_every_kind_of_bus(page: Page) -> None:
    (kinds,) = [row[-1] for row in rows(page("docs/robots.md"), "key | unit | default") if row[0] == "`kind`"]
    assert sorted(words(kinds)) == sorted([*own(FAMILIES), SIMULATED])


def test_robots_has_every_key_of_a_bus(page: Page) -> None:
    keys = [key for row in rows(page("docs/robots.md"), "key | unit | default") for key in words(row[0])]
    assert sorted(keys) == sorted(BusSettings.model_fields)


def test_robots_has_every_option_of_every_family(page: Page) -> None:
    written = options_in(rows(page("docs/robots.md"), "family"))
    assert written == {kind: {key for key, by in families_by_option().items() if kind in by} for kind in own(FAMILIES)}


@pytest.mark.parametrize("kind", drivers.kinds())
def test_the_page_of_a_family_explains_its_options(kind: str, page: Page) -> None:
    if kind not in own(FAMILIES):
        pytest.skip("another package brought it")
    family = FAMILIES.get(kind)
    text = page("docs/boards.md" if family.hobby else "docs/drivers.md")
    in_examples = re.findall(r"(?:^|`)(\w+) = ", text, re.M)
    assert options_of(family.settings) - {*words(text), *in_examples} == set()


def test_boards_lists_the_boards(page: Page) -> None:
    listed = [kind for row in rows(page("docs/boards.md"), "kind") for kind in words(row[0])]
    assert sorted(listed) == sorted(kind for kind in own(FAMILIES) if FAMILIES.get(kind).hobby)


def test_every_simulator_is_listed_with_its_options(page: Page) -> None:
    written = options_in(rows(page("docs/simulated-buses.md"), "`omote simulate`"))
    simulated = [kind for kind in own(FAMILIES) if FAMILIES.get(kind).simulator]
    assert written == {kind: options_of(simulator_of(kind).options) for kind in simulated}


def test_every_default_of_a_simulator_matches_the_page(page: Page) -> None:
    for first, last in rows(page("docs/simulated-buses.md"), "`omote simulate`"):
        (kind,) = words(first)
        given = dict(re.findall(r"`--(\w+)` \(([\w-]+)", last))
        defaults = {entry.name: str(entry.default) for entry in entries(simulator_of(kind).options) if entry.default}
        assert {name: written for name, written in given.items() if written != defaults.get(name, written)} == {}, kind


def test_the_readme_names_every_simulator(page: Page) -> None:
    (listed,) = re.findall(r"`omote simulate ([a-z]\w*`(?:(?:, | and )`\w+`)+) simulate", page("README.md"))
    assert sorted(words(f"`{listed}")) == sorted(kind for kind in own(FAMILIES) if FAMILIES.get(kind).simulator)


def test_every_link_is_listed_with_its_options(page: Page) -> None:
    written = options_in(rows(page("docs/expression.md"), "kind | what it is"))
    assert written == {kind: options_of(LINKS.get(kind).settings) for kind in own(LINKS)}


def test_every_kind_of_take_is_listed_with_its_layer(page: Page) -> None:
    written = {
        (suffix, row[-1])
        for row in rows(page("docs/expression.md"), "file")
        for suffix in re.findall(r"`(\.\w+)`", row[0])
    }
    takes = [TAKES.get(kind) for kind in own(TAKES)]
    assert written == {(suffix, take.layer) for take in takes for suffix in take.suffixes}
    assert {suffix for suffix, _ in written} <= set(suffixes())


def test_every_kind_of_exported_file_is_listed(page: Page) -> None:
    section = page("docs/heads.md").partition("## For other programs\n")[2].partition("\n## ")[0]
    assert sorted(re.findall(r"`omote export head(\.\w+)`", section)) == sorted(SUFFIXES)


def test_the_table_of_linkages_has_every_kind_and_its_keys(page: Page) -> None:
    table = list(rows(page("docs/robots.md"), "kind | what it is | keys"))
    assert sorted(words(row[0])[0] for row in table) == sorted(own(LINKAGES))
    for row in table:
        settings = LINKAGES.get(words(row[0])[0]).settings
        keys = set(settings.model_fields) - set(LinkageSettings.model_fields)
        assert keys <= set(words(row[2])) or row[2].startswith("the same"), row[0]
