"""surface.base.extras: what is missing is named at once, with the command that installs it."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import pytest

from surface.base.errors import MissingPackage
from surface.base.extras import EXTRAS, importing, require


def test_every_package_that_is_missing_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    require("nothing")
    require("a picture", "moderngl")
    for name in ("moderngl", "PIL", "scipy"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(
        MissingPackage, match=r"^a picture needs the packages moderngl and Pillow: not installed$"
    ) as one:
        require("a picture", "moderngl", "PIL")
    assert one.value.hint == "pip install 'omote[view]'"
    with pytest.raises(MissingPackage, match="the package scipy: ") as two:
        require("a fit", "scipy")
    assert two.value.hint == "pip install 'omote[fit]'"


def test_a_package_that_cannot_be_loaded_is_an_error_for_people() -> None:
    with (
        pytest.raises(MissingPackage, match=r"libGL\.so\.1: cannot open") as caught,
        importing("the window", "moderngl"),
    ):
        raise ImportError("libGL.so.1: cannot open shared object file")
    assert caught.value.hint.startswith("pip install 'omote[view]', and ")


def test_the_extras_are_those_of_the_package(root: Path) -> None:
    extras = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for package, extra in EXTRAS.values():
        assert any(needed.startswith(package.lower()) for needed in extras[extra]), (package, extra)
    assert "omote[fit]" in extras["view"]
