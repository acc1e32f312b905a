"""The line of the lips and the gap between them, on two sheets that meet at a known height."""

from __future__ import annotations

import numpy as np
import pytest

from surface.check import mouth as mouth_module
from surface.check.mouth import Mouth, find_mouth, lips_gap
from surface.check.subject import Subject
from tests.surface.check import plain

LIPS_Y, HALF, DROP = -66.0, 25.0, 15.0


def jaw(gap: float = 0.0, drop: float = DROP, half: float = HALF, at: tuple[float, float] = (-60, 60)) -> list:
    """Skin above the lips, which stays, and below them, which the jaw takes down, 0.3 of the way at ``half`` from x =
    0; the lips are ``gap`` mm apart at the x between ``at``."""
    upper = plain.sheet((-60, 60), (LIPS_Y, LIPS_Y + 40.0), 2.5, 5.0)
    points, triangles = plain.sheet((-60, 60), (LIPS_Y - 40.0, LIPS_Y), 2.5, 5.0)
    moves = {"jawOpen": np.outer(np.clip((half + 6.0 - np.abs(points[:, 0])) / 20.0, 0, 1), [0.0, -drop, 0.0])}
    points[(points[:, 0] > at[0]) & (points[:, 0] < at[1]), 1] -= gap
    return [plain.part("upper", *upper), plain.part("lower", points, triangles, moves=moves)]


def at_rest(*parts) -> tuple[float, float]:
    head = plain.subject(*parts)
    return lips_gap(head, plain.line_of_lips(LIPS_Y, 2 * HALF, DROP, 5.0), head.rest)


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_the_line_of_the_lips_is_where_the_jaw_tears_the_skin(scale: float) -> None:
    found = find_mouth(plain.subject(*jaw(), eyes=plain.EYES * scale))
    assert found is not None
    np.testing.assert_allclose(found.y, LIPS_Y, atol=0.3 * scale)  # between two rows of pixels
    np.testing.assert_allclose(found.z, 5.0, atol=1e-5)
    assert found.width == pytest.approx(2 * HALF, abs=2.5) and found.drop == pytest.approx(DROP)
    np.testing.assert_allclose(found.middle, [0.0, LIPS_Y, 5.0], atol=0.8 * scale)


def test_pixels_grow_with_the_head() -> None:
    assert mouth_module._draw_front(plain.subject(*jaw(), eyes=1.5 * plain.EYES)).view.step == pytest.approx(0.75)


def test_the_middle_of_a_mouth_lies_between_its_corners_at_its_foremost_depth() -> None:
    line = Mouth(np.array([-10.0, 0.0, 30.0]), np.array([1.0, 2.0, 9.0]), np.array([3.0, 8.0, 4.0]), 9.0)
    np.testing.assert_allclose(line.middle, [10.0, 2.0, 8.0])
    assert line.width == 40.0


@pytest.mark.parametrize(("gap", "parted"), [(3.0, True), (9.0, True), (14.0, False)])
def test_lips_that_are_parted_at_rest_have_a_line_in_their_middle(gap: float, parted: bool) -> None:
    found = find_mouth(plain.subject(*jaw(gap, at=(-20.0, 20.0))))
    assert (found is not None and found.width == pytest.approx(2 * HALF, abs=2.5)) == parted
    if parted:
        assert found is not None
        assert np.interp(0.0, found.x, found.y) == pytest.approx(LIPS_Y - 0.5 * gap, abs=0.5)


def test_a_jaw_that_does_not_open_has_no_line_of_lips() -> None:
    assert find_mouth(plain.subject(*jaw(drop=2.9))) is None
    assert find_mouth(plain.subject(*jaw(drop=3.1))) is not None
    assert find_mouth(plain.subject(*jaw(drop=5.9), eyes=2 * plain.EYES)) is None
    assert find_mouth(plain.subject(plain.part("face", *plain.sheet((-9, 9), (-9, 9), 3.0)))) is None
    assert find_mouth(plain.subject(plain.eyeball(0), jaw=0.4)) is None


@pytest.mark.parametrize(("pixels", "found"), [(4, False), (5, True)])
def test_a_mouth_is_five_pixels_wide_at_least(pixels: int, found: bool) -> None:
    points, triangles = plain.sheet((-0.1, 0.5 * pixels - 0.4), (-1, 0), 0.1, 9.0)
    bite = plain.part("bite", points, triangles, moves={"jawOpen": np.tile([0.0, -9.0, 0.0], (len(points), 1))})
    still = plain.part("face", *plain.sheet((-60, 60), (-60, 60), 10.0))
    assert (find_mouth(plain.subject(still, bite)) is not None) == found


def test_the_longest_run_closes_gaps_of_one_and_begins_again_after_wider_ones() -> None:
    hits = np.zeros(30, bool)
    hits[[1, 2, 3, 7, 8, 10, 12, 25]] = True
    assert mouth_module._longest_run(hits).tolist() == [7, 8, 9, 10, 11, 12]
    assert mouth_module._longest_run(hits, 4).tolist() == list(range(1, 13))
    assert len(mouth_module._longest_run(np.zeros(9, bool))) == 0
    assert mouth_module._longest_run(np.ones(1, bool)).tolist() == [0]


@pytest.mark.parametrize("gap", [0.0, 1.5, 4.0])
def test_lips_gape_as_far_as_they_are_apart(gap: float) -> None:
    assert at_rest(*jaw(gap))[0] == pytest.approx(gap, abs=0.25)
    head = plain.subject(*jaw(gap))
    moved = lips_gap(head, plain.line_of_lips(LIPS_Y, 2 * HALF, DROP, 5.0), head.at_one("jawOpen"))
    assert moved[0] == pytest.approx(gap + DROP, abs=0.25)


def test_lips_are_measured_in_the_middle_half_of_the_mouth_with_the_place_of_the_gap() -> None:
    height, x = at_rest(*jaw(3.0, at=(4.0, 6.0)))
    assert height == pytest.approx(3.0, abs=0.25) and x == pytest.approx(5.0, abs=0.3)
    assert at_rest(*jaw(3.0, at=(16.0, 60.0)))[0] < 0.25
    assert at_rest(*jaw(3.0, at=(-60.0, -16.0)))[0] < 0.25


@pytest.mark.parametrize(("z", "material", "open_"), [
    (-3.0, "skin", False), (-5.0, "skin", True), (-3.0, "teeth", True), (-3.0, "lash", True),
])  # fmt: skip
def test_what_lies_nine_millimetres_behind_the_lips_or_is_no_skin_does_not_close_them(
    z: float, material: str, open_: bool
) -> None:
    behind = plain.part("behind", *plain.sheet((-24, 24), (LIPS_Y - 12, LIPS_Y + 12), 4.0, z), material=material)
    assert at_rest(*jaw(4.0), behind)[0] == pytest.approx(4.0 * open_, abs=0.25)


def test_the_inside_of_the_mouth_lies_behind_the_lips_and_as_high_as_they_do() -> None:
    mouth = plain.line_of_lips(LIPS_Y, 50.0, 9.0, 5.0)
    points = np.array([[24, 0, -10], [26, 0, -10], [-24, 0, -10], [-26, 0, -10], [0, 14, -10], [0, 16, -10],
                       [0, -14, -10], [0, -16, -10], [0, 0, -8], [0, 0, 10]], np.float32)  # fmt: skip
    inside = mouth_module._mark_inside(points + np.float32([0.0, LIPS_Y, 5.0]), mouth, 1.0)
    assert inside.tolist() == [1, 0, 1, 0, 1, 0, 1, 0, 0, 0]
    twice = mouth_module._mark_inside(points + np.float32([0.0, LIPS_Y, 5.0]), mouth, 2.0)
    assert twice.tolist() == [0] * 10  # 18 mm deep
    twice = mouth_module._mark_inside(points * np.float32(2.0) + np.float32([0.0, LIPS_Y, 5.0]), mouth, 2.0)
    assert twice.tolist() == [0, 0, 0, 0, 1, 0, 1, 0, 0, 0]


def test_values_are_meant_over_the_triangle_at_each_pixel() -> None:
    head: Subject = plain.subject(*jaw())
    picture = mouth_module._draw_front(head)
    values = mouth_module._values(head, picture, [p.rest[:, 1].astype(float) for p in head.parts])  # type: ignore[attr-defined]
    rows = LIPS_Y - 40.0 + 0.5 * np.arange(len(values))
    assert np.isfinite(values).all() and picture.view.step == 0.5
    assert np.abs(values - rows[:, None]).max() <= 2.5 * 2 / 3 + 1e-4
