"""Lines of equal value: closed, where the value is reached, holes apart, few corners."""

import numpy as np
import pytest

from surface.fit.features.contours import SIMPLE, _away, _crossings, contours, simplified
from surface.mesh.loops import inside


def distance(size: int, *middles: tuple[float, float]) -> np.ndarray:
    i, j = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    return np.min([np.hypot(i - x, j - y) for x, y in middles], axis=0)


def test_a_disc_is_traced_where_its_value_is_reached() -> None:
    (line,) = contours(20.0 - distance(41, (20.0, 20.0)), 5.3)
    away = np.hypot(*(line - 20.0).T)
    assert np.abs(away - 14.7).max() < 0.1
    assert len(line) < 40  # of 84 crossings


def test_a_hole_has_a_line_of_its_own() -> None:
    away = distance(41, (20.0, 20.0))
    lines = contours(np.where(away < 6.0, 0.0, 20.0 - away), 5.3)
    assert len(lines) == 2
    assert drawn(lines, np.array([[20.0, 20.0], [20.0, 30.0], [20.0, 38.0]])).tolist() == [False, True, False]


def test_places_that_touch_at_a_corner_are_apart() -> None:
    picture = np.zeros((12, 12))
    picture[2:6, 2:6] = picture[6:10, 6:10] = 1.0
    assert len(contours(picture, 0.5)) == 2


@pytest.mark.parametrize("seed", range(4))
def test_any_picture_is_cut_as_its_places_say(seed: int) -> None:
    picture = np.pad(np.random.default_rng(seed).random((14, 17)), 1)
    lines = contours(picture, 0.5)
    i, j = np.meshgrid(np.arange(16), np.arange(19), indexing="ij")
    wrong = drawn(lines, np.column_stack([i.ravel(), j.ravel()]).astype(float)) != (picture >= 0.5).ravel()
    assert wrong.mean() < 0.12  # single places may be simplified away


def test_a_simplified_line_stays_near(seed: int = 3) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    line = 30.0 * np.column_stack([np.cos(turn), 0.5 * np.sin(turn)])
    few = simplified(line)
    ring = np.vstack([few, few[:1]])
    share = np.linspace(0.0, 1.0, 40)[:, None, None]
    dense = (ring[:-1] + share * (ring[1:] - ring[:-1])).reshape(-1, 2)
    assert len(few) < 50
    assert np.linalg.norm(line[:, None] - dense, axis=2).min(axis=1).max() < SIMPLE + 0.1


def drawn(lines: list[np.ndarray], at: np.ndarray) -> np.ndarray:
    segments = np.concatenate([np.hstack([line, np.roll(line, -1, axis=0)]) for line in lines])
    return inside(segments, at)


def test_lines_cross_edges_where_the_level_lies_between_their_ends() -> None:
    picture = np.array([[0.0, 0, 0], [0, 1.0, 0], [0, 0, 0]])
    edges = np.array([[0, 1, 0], [1, 1, 0], [1, 0, 1], [1, 1, 1]])
    for level, share in ((0.25, 0.25), (0.75, 0.75), (0.01, 0.05), (0.99, 0.95)):
        found = _crossings(picture, level, edges)
        wanted = [[share, 1], [2 - share, 1], [1, share], [1, 2 - share]]
        np.testing.assert_allclose(found, wanted)
    assert _crossings(np.zeros((2, 2)), 0.0, np.array([[0, 0, 1]])).tolist() == [[0.0, 0.05]]


def test_a_single_place_is_a_diamond_with_the_inside_on_its_left() -> None:
    picture = np.zeros((5, 5))
    picture[2, 2] = 1.0
    (line,) = contours(picture, 0.5)
    assert sorted(line.tolist()) == [[1.5, 2], [2, 1.5], [2, 2.5], [2.5, 2]]
    x, y = line.T
    assert 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() == pytest.approx(0.5)
    assert contours(np.zeros((5, 5)), 0.5) == []


@pytest.mark.parametrize(("bulge", "corners"), [(0.34, 4), (0.36, 5)])
def test_a_corner_further_than_0_35_off_the_line_is_kept(bulge: float, corners: int) -> None:
    square = np.array([[0.0, 0], [5, -bulge], [10, 0], [10, 10], [0, 10]])
    assert len(simplified(square)) == corners
    ends = _away(np.array([[-3.0, 4.0], [13.0, 4.0], [5.0, -2.0]]), np.zeros(2), np.array([10.0, 0.0]))
    np.testing.assert_allclose(ends, [5.0, 5.0, 2.0])
