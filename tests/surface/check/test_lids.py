"""How much of an eyeball shows through a slit of known height."""

from __future__ import annotations

import pytest

from surface.check.lids import STEP_MM, eye_opening
from tests.surface.check import plain


def lids(height: float, **options: object) -> list:
    """A sheet before both eyes with a slit of that height at the height of the eyes."""
    halves = [plain.sheet((-60, 60), y, 10.0, 20.0) for y in ((0.5 * height, 40.0), (-40.0, -0.5 * height))]
    return [plain.part(f"lid_{k}", *half, **options) for k, half in enumerate(halves)]  # type: ignore[arg-type]


@pytest.mark.parametrize("height", [0.0, 2.0, 8.0])
def test_an_eye_shows_as_much_as_the_lids_leave_open(height: float) -> None:
    head = plain.subject(*lids(height), plain.eyeball(0), plain.eyeball(1))
    for side in (0, 1):
        assert eye_opening(head, side, head.rest) == pytest.approx(height, abs=1.5 * STEP_MM)


def test_an_eye_shows_whole_behind_lashes_and_not_at_all_where_there_is_none() -> None:
    head = plain.subject(*lids(0.0, material="lash"), plain.eyeball(1))
    assert eye_opening(head, 1, head.rest) == pytest.approx(2.0 * plain.RADIUS, abs=2.5 * STEP_MM)
    assert eye_opening(head, 0, head.rest) == 0.0
