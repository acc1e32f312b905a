"""surface.view.scene.bounds"""

from __future__ import annotations

import numpy as np
import pytest

from surface.view.scene.bounds import ROWS, Bands, Silhouette, corners
from surface.view.scene.camera import Camera

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


def test_bands_keep_three_pixels_around_a_triangle() -> None:
    # in pixels from the lower left corner: (30, 2) (40, 2) (30, 12); rows 0 to 15 are one band
    bands = found([[-20.0, -30.0, 0], [-10, -30, 0], [-20, -20, 0]])
    assert (bands.low[0], bands.high[0]) == (27, 43)
    assert bands.boxes().tolist() == [[27, 0, 43, ROWS]]
    # 2.5 pixels below the second band reach into it by the margin, 3.5 do not
    for top, count in ((ROWS - 2.5, 2), (ROWS - 3.5, 1)):
        touched = found([[-20.0, -30.0, 0], [-10, -30, 0], [-20, top - 32.0, 0]])
        assert len(touched.boxes()) == count


def test_bands_end_at_the_picture() -> None:
    bands = found([[-80.0, -80.0, 0], [80, -80, 0], [0, 80, 0]])
    assert (bands.low == 0).all() and (bands.high == SIZE[0]).all()
    assert Bands.whole((10, ROWS + 1)).boxes().tolist() == [[0, 0, 10, ROWS], [0, ROWS, 10, ROWS + 1]]
    assert Bands.whole((10, ROWS)).boxes().tolist() == [[0, 0, 10, ROWS]]


def test_pixels_of_a_camera_are_those_of_its_matrix() -> None:
    camera, size = Camera.around(25.0, 12.0), (90, 60)
    points = np.random.default_rng(1).uniform(-80, 80, (200, 3))
    clip = np.column_stack([points, np.ones(200)]) @ camera.matrix(size[0] / size[1]).astype(float).T
    at = (clip[:, :2] / clip[:, 3:] * 0.5 + 0.5) * size
    for k in range(200):
        silhouette = Silhouette(size, camera.matrix(size[0] / size[1]), camera.near)
        assert silhouette.add(points[[k]], np.zeros((1, 3), np.int32))
        bands = silhouette.bands()
        left, _, right, _ = np.array(bands.boxes()[0])
        assert (left, right) == (max(np.floor(at[k, 0] - 3), 0), min(np.ceil(at[k, 0] + 3), size[0]))
        rows = np.flatnonzero(bands.low < bands.high)
        assert rows[0] == max((at[k, 1] - 3) // ROWS, 0) and rows[-1] == min((at[k, 1] + 3) // ROWS, 3)


def test_the_nearest_depth_itself_is_drawn() -> None:
    for depth, drawn in ((0.5, True), (0.499, False)):
        near = FLAT.copy()
        near[3] = [0.0, 0.0, depth, 0.0]
        assert Silhouette(SIZE, near, 0.5).add(np.ones((3, 3)), np.array([[0, 1, 2]], np.int32)) == drawn


def test_corners_of_a_box_are_where_its_pixels_are() -> None:
    at = corners(np.array([[25, 16, 50, 48], [0, 0, 1, 1]]), SIZE)
    assert at[:6].tolist() == [[-0.5, -0.5], [0, -0.5], [0, 0.5], [-0.5, -0.5], [0, 0.5], [-0.5, 0.5]]
    assert at.shape == (12, 2) and at[6].tolist() == [-1, -1]


@pytest.mark.parametrize(("shift", "at"), [(-500.0, 0), (500.0, SIZE[0])])
def test_what_lies_beside_the_picture_ends_at_its_border(shift: float, at: int) -> None:
    bands = found([[shift, -30.0, 0], [shift + 10, 20, 0], [shift, 28, 0]])
    assert (bands.low == at).all() and (bands.high == at).all()


def test_a_triangle_is_as_wide_as_its_corners_in_any_order() -> None:
    points = [[-20.0, -30.0, 0.0], [30.0, 10.0, 0.0], [-10.0, -5.0, 0.0]]
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        bands = found([points[k] for k in order])
        assert bands.boxes().tolist() == [[27, k * ROWS, 83, (k + 1) * ROWS] for k in range(3)]


@pytest.mark.parametrize(
    ("bottom", "top", "count"),
    [
        (19.0, 25.0, 1),
        (19.01, 25.0, 1),
        (-60.0, -35.0, 1),
        (-60.0, -35.01, 0),
        (60.0, 70.0, 0),
    ],
)
def test_the_margin_itself_reaches_the_picture(bottom: float, top: float, count: int) -> None:
    """Margins of 3 pixels: one from row 48, the last band's first, one to row 0, one to just below it."""
    assert len(found([[-20.0, bottom, 0], [-10, bottom, 0], [-20, top, 0]]).boxes()) == count
