"""Versions of written files."""

from __future__ import annotations

import pytest

from controller.base.formats import format_fault


@pytest.mark.parametrize("found", [1, 2, 3])
def test_versions_up_to_the_newest_are_read(found: int) -> None:
    assert format_fault(found, 3) is None


@pytest.mark.parametrize(
    ("found", "says"), [(4, "newer omote"), (0, "from 1"), (None, "from 1"), ("1", "from 1"), (True, "from 1")]
)
def test_others_are_refused_with_what_they_are(found: object, says: str) -> None:
    fault = format_fault(found, 3)
    assert fault is not None and says in fault and repr(found) in fault
