"""drivers.testing.load: the stretch of a record in which most bytes passed."""

from __future__ import annotations

import pytest

from drivers.testing.load import busiest
from drivers.testing.records import Traffic


def test_the_busiest_stretch_is_told_with_its_share_of_the_wire_and_its_directions() -> None:
    sizes = [(0.0, True, 10), (0.9, False, 20), (1.0, True, 30), (1.5, False, 25), (1.95, True, 5), (2.5, False, 9)]
    record = [Traffic(at, sent, size) for at, sent, size in sizes]
    found = busiest(record, 1_000, 1.0)
    assert found == (pytest.approx(0.75), 0.9, 30, 45)
    assert busiest(record[:1], 1_000, 1.0) == (pytest.approx(0.1), 0.0, 10, 0)
    assert busiest([], 1_000, 1.0) == (0.0, 0.0, 0, 0)
