"""surface.view.scene.bounds"""

from __future__ import annotations

import numpy as np
import pytest

from surface.view.scene.bounds import ROWS, Bands, Silhouette, corners

SIZE = (100, 4 * ROWS)
FLAT = np.diag([2.0 / SIZE[0], 2.0 / SIZE[1], 1.0, 0.0])
FLAT[3] = [0.0, 0.0, 0.0, 1.0]  # pixels counted from the middle


def found(points: list[list[float]]) -> Bands:
    silhouette = Silhouette(SIZE, FLAT, 0.5)
    assert silhouette.add(np.array(points), np.array([[0, 1, 2]], np.int32))
    return silhouette.bands()


def test_a_triangle_fills_every_band_it_crosses() -> None:
    bands = found([[-20.0, -30.0, 0.0], [-10.0, -30.0, 0.0], [30.0, 10.0, 0.0]])
    assert bands.boxes()[:, 1].tolist() == [0, ROWS, 2 * ROWS]
    assert (bands.low[:3] <= 30).all() and (bands.high[:3] >= 80).all() and bands.low[3] >= bands.high[3]
    x, y, width, height = bands.box()
    assert (y, height) == (0, 3 * ROWS) and x > 20 and width < 70


@pytest.mark.parametrize("depth", [-1.0, 0.0, 0.4])
def test_what_is_too_near_is_not_told(depth: float) -> None:
    near = FLAT.copy()
    near[3] = [0.0, 0.0, depth, 0.0]
    assert not Silhouette(SIZE, near, 0.5).add(np.ones((3, 3)), np.array([[0, 1, 2]], np.int32))


def test_bands_of_two_places_are_joined_and_empty_ones_add_nothing() -> None:
    low, high = (
        found([[-20.0, -30.0, 0], [-10, -30, 0], [-20, -26, 0]]),
        found([[30.0, 30, 0], [40, 30, 0], [30, 28, 0]]),
    )
    both = low.joined(high)
    assert both.boxes().tolist() == [*low.boxes().tolist(), *high.boxes().tolist()]
    assert both.joined(Bands.whole(SIZE)).box() == (0, 0, *SIZE)
    away = found([[900.0, 0, 0], [910, 0, 0], [900, 5, 0]])
    assert away.box() == (0, 0, 0, 0) and not len(away.boxes())


def test_corners_are_two_triangles_in_clip_space() -> None:
    at = corners(np.array([[0, 0, 50, 64]]), SIZE)
    assert at.shape == (6, 2) and at.dtype == np.float32
    area = 0.5 * sum(abs(float(np.linalg.det((at[k + 1 : k + 3] - at[k]).astype(float)))) for k in (0, 3))
    assert area == pytest.approx(1.0 * 2.0)
    assert (at.min(axis=0).tolist(), at.max(axis=0).tolist()) == ([-1, -1], [0, 1])
