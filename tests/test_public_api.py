"""What others rely on stays: the public API is compared with its snapshot, and docs/api.md names all of it."""

from __future__ import annotations

import difflib
from pathlib import Path

import pytest

from tests import public_api

SNAPSHOT = "tests/public_api.txt"


@pytest.mark.slow
def test_the_public_api_is_what_it_was(root: Path) -> None:
    before = (root / SNAPSHOT).read_text(encoding="utf-8").splitlines()
    now = "\n".join(public_api.lines()).splitlines()
    changed = "\n".join(difflib.unified_diff(before, now, "promised", "now", lineterm="", n=0))
    assert not changed, f"{changed}\nwhere this is meant: make api, and a line in CHANGELOG.md"


def test_the_page_names_every_public_module(root: Path) -> None:
    page = (root / "docs" / "api.md").read_text(encoding="utf-8")
    modules = [*public_api.WHOLE, *public_api.SINGLE, *public_api.ERRORS, *(name for name, _ in public_api.ALSO)]
    assert [name for name in modules if f"`{name}`" not in page] == []
    for names in public_api.SINGLE.values():
        assert [name for name in names if f"`{name}`" not in page] == []
