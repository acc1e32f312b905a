"""What tests of the window share: a context of imgui that ends with the test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.controller.panels.window.screen import Screen


@pytest.fixture
def screen() -> Iterator[Screen]:
    """A real imgui context without a window."""
    found = Screen()
    yield found
    found.imgui.destroy_context(found.context)
