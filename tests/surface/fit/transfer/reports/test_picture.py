"""Pictures of a scan: where a place lies in them, what they show, and in which colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from surface.base.arrays import Floats
from surface.base.error_colours import FULL_MM, SCALE
from surface.fit.transfer.align import Similarity
from surface.fit.transfer.reports import picture as module
from surface.fit.transfer.reports.picture import (
    ASPECT,
    COLOURS,
    FAR_MM,
    HEIGHT,
    PAPER,
    Frontal,
    draw_distances,
    draw_landmarks,
    frontal,
)  # fmt: skip
from surface.fit.transfer.scan import make_scan
from surface.fit.transfer.template import NAMES

WIDTH = round(ASPECT * HEIGHT)
TURN = Rotation.from_euler("xyz", [70, -20, 35], degrees=True).as_matrix()
PLAIN = Frontal(np.eye(3), 1.0, np.zeros(3))
"""A scan whose places are pixels: x to the right, y upwards from the upper left one, z towards the viewer."""


def square(x: tuple[float, float], y: tuple[float, float], z: float = 0.0, slope: float = 0.0) -> list[list[float]]:
    """Corners in pixels, row y downwards, which rises by ``slope`` to the right."""
    return [[a, -b, z + slope * (a - x[0])] for a, b in ((x[0], y[1]), (x[1], y[1]), (x[1], y[0]), (x[0], y[0]))]


def squares(*corners: list[list[float]]):
    """A scan of squares, two triangles each."""
    faces = [[4 * k + i for i in three] for k in range(len(corners)) for three in ((0, 1, 2), (0, 2, 3))]
    return make_scan(np.array([p for four in corners for p in four]), np.array(faces), "squares")


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"))


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_a_front_view_shows_the_box_in_its_middle_with_room_above_and_below(scale: float) -> None:
    low, high = np.array([-50.0, -80.0, 10.0]), np.array([70.0, 120.0, 60.0])
    found = Similarity(TURN, scale, np.array([4.0, 5.0, 6.0]))
    view = frontal(found, low, high)

    def seen(place: Floats) -> Floats:
        """Pixels of a place that lies there in the head's frame."""
        return view.pixels((place - found.shift) @ TURN / scale)

    middle = 0.5 * (low + high)
    np.testing.assert_allclose(seen(middle), [0.5 * WIDTH, 0.5 * HEIGHT, 0.0], atol=1e-9)
    per_mm = HEIGHT / (1.25 * 200.0)
    found_steps = [seen(middle + step) - seen(middle) for step in 10.0 * np.eye(3)]
    np.testing.assert_allclose(found_steps, 10.0 * per_mm * np.diag([1.0, -1.0, 1.0]), atol=1e-9)


def test_a_pixel_is_the_foremost_place_of_the_scan_there() -> None:
    scan = squares(square((10, 30), (10, 30), z=5.0, slope=0.5), square((20, 60), (20, 60), z=2.0))
    view = Frontal(TURN, 2.0, np.array([3.0, -7.0, 1.0]))
    placed = make_scan((scan.vertices - view.shift) @ TURN / view.scale, scan.triangles, "turned")
    for column, row, depth in ((12, 12, 6.0), (25, 28, 12.5), (29.5, 21, 14.75), (40, 50, 2.0), (59, 58, 2.0)):
        place = view.place(placed, column, row)
        assert place is not None
        np.testing.assert_allclose(view.pixels(place), [column, row, depth], atol=1e-6)
    for column, row in ((9, 12), (12, 9), (31, 12), (12, 31), (61, 50), (19, 40)):
        assert view.place(placed, column, row) is None


def test_a_triangle_seen_from_its_edge_has_no_place_at_a_pixel() -> None:
    edge = make_scan(np.array([[10.0, -10, 0], [20, -10, 5], [30, -10, 0]]), np.array([[0, 1, 2]]), "edge")
    assert PLAIN.place(edge, 15, 10) is None


def relief(scan, colour=(1.0, 1.0, 1.0)) -> np.ndarray:
    return module._relief(PLAIN.pixels(scan.vertices), scan.triangles, WIDTH, np.tile(colour, (len(scan.triangles), 1)))


def test_a_scan_is_drawn_at_its_pixels_on_paper_of_the_pictures_size() -> None:
    drawn = relief(squares(square((10, 30), (50, 90)), square((WIDTH - 5, WIDTH + 40), (HEIGHT - 4, HEIGHT + 9))))
    assert drawn.shape == (HEIGHT, WIDTH, 3) and drawn.dtype == np.uint8
    shown = (drawn != PAPER).any(axis=2)
    wanted = np.zeros_like(shown)
    wanted[50:91, 10:31] = wanted[HEIGHT - 4 :, WIDTH - 5 :] = True
    np.testing.assert_array_equal(shown, wanted)


def test_light_comes_from_above_and_the_left_and_makes_surfaces_between_dark_and_bright() -> None:
    def tilted(x: float, y: float) -> int:
        """Grey of a square whose normal leans by so much to the right and upwards."""
        places = [(a, b) for a, b, _ in square((10.0, 40.0), (10.0, 40.0))]
        scan = squares([[a, b, -x * a - y * b] for a, b in places])
        red, green, blue = relief(scan)[25, 25].tolist()
        assert red == green == blue
        return int(red)

    light = np.array([-0.3, 0.5, 0.8])
    for x, y in ((0.0, 0.0), (-0.375, 0.625), (0.8, 0.0), (0.0, -0.8), (3.0, 0.375)):
        normal = np.array([x, y, 1.0])
        cosine = abs(normal @ light) / np.linalg.norm(normal) / np.linalg.norm(light)
        assert tilted(x, y) == pytest.approx(40 + 185 * cosine, abs=1.01)
    assert tilted(-0.375, 0.625) >= 224  # straight towards the light


def test_distances_have_the_colours_of_the_legend(tmp_path: Path) -> None:
    off = [0.0, 0.25, 0.5, 0.75, 1.0, 5.0, FAR_MM, FAR_MM + 0.1]
    scan = squares(*(square((20 + 40 * k, 50 + 40 * k), (20, 50)) for k in range(len(off))))
    path = tmp_path / "error.png"
    draw_distances(scan, PLAIN, FULL_MM * np.repeat(off, 2), path)
    drawn = pixels(path)
    seen = [drawn[35, 35 + 40 * k].tolist() for k in range(len(off))]
    hue = [max(range(3), key=lambda k, rgb=rgb: rgb[k]) for rgb in seen]
    assert hue[0] == 2 and hue[1] == 1 and hue[3] == hue[4] == 0  # blue, green, ..., orange, red
    red, green, blue = seen[2]
    assert red > 100 and green > 100 and blue < 0.6 * green  # yellow
    assert seen[3][1] > 1.5 * seen[4][1]  # orange is not yet red
    assert seen[4] == seen[5] == seen[6]  # 1 mm and more
    assert len(set(seen[7])) == 1  # grey
    shade = 40 + 185 * 0.8 / np.linalg.norm([0.3, 0.5, 0.8])
    np.testing.assert_allclose(seen[0], shade * np.array([0.16, 0.28, 0.55]) ** (1 / 2.2), atol=1.01)
    half = SCALE[:2].mean(axis=0)
    draw_distances(scan, PLAIN, np.full(2 * len(off), 0.125), path)
    np.testing.assert_allclose(pixels(path)[35, 35], shade * half ** (1 / 2.2), atol=1.01)


def test_landmarks_are_numbered_rings_in_both_views_and_named_beside_them(tmp_path: Path) -> None:
    scan = squares(square((300, 500), (300, 700), z=50.0, slope=0.5))
    marks = {
        "nose_tip": (np.array([400.0, -450.0, 100.0]), "found"),
        "chin": (np.array([420.0, -650.0, 40.0]), "given"),
        "left_eye_outer": (np.array([480.0, -350.0, -900.0]), "carried"),  # too far behind for the view from the left
    }
    path = tmp_path / "landmarks.png"
    draw_landmarks(scan, PLAIN, marks, path)
    drawn = pixels(path)
    assert drawn.shape == (HEIGHT, 2 * WIDTH, 3)

    def ring(column: float, row: float, how: str) -> bool:
        """Whether there is a ring of that colour about a pixel, and a point in its middle."""
        i, j = round(row), round(column)
        own = (drawn[i - 5 : i + 6, j - 5 : j + 6] == COLOURS[how]).all(axis=2)
        return bool(own[5, 5] and own[5, 0] and own[5, 10] and own[0, 5] and own[10, 5] and not own[3, 5])

    assert ring(400, 450, "found") and ring(420, 650, "given") and ring(480, 350, "carried")
    beside = WIDTH + 0.2 * WIDTH  # the nose; what lies 60 further back lies 60 further to the right
    assert ring(beside, 450, "found") and ring(beside + 60, 650, "given")
    assert not (drawn[:, WIDTH + 200 :] == COLOURS["carried"]).all(axis=2).any()
    skin = (drawn[:, WIDTH:] != PAPER).any(axis=2)[500]
    assert np.flatnonzero(skin).tolist() == list(range(162 - 50, 162 + 51))  # from 50 before the nose to 50 behind it
    for row, how in enumerate(COLOURS[marks[n][1]] for n in NAMES if n in marks):
        line = (drawn[6 + 18 * row : 6 + 18 * (row + 1), 8:240] == how).all(axis=2)
        assert line.sum() > 60, NAMES[row]  # its number, name and how it was found


def test_without_a_nose_the_view_from_the_left_begins_at_the_foremost_place_of_the_picture(tmp_path: Path) -> None:
    outside = square((WIDTH + 50, WIDTH + 90), (300, 400), z=900.0)
    scan = squares(square((300, 500), (300, 700), z=50.0, slope=0.2), outside)
    path = tmp_path / "landmarks.png"
    draw_landmarks(scan, PLAIN, {}, path)
    skin = (pixels(path)[:, WIDTH:] != PAPER).any(axis=2)
    assert np.flatnonzero(skin[405]).tolist() == list(range(162, 162 + 41))


def test_where_the_picture_shows_nothing_the_nearest_of_all_counts() -> None:
    away = np.array([[-5.0, 10, 1], [WIDTH + 3.0, 10, 7], [10, HEIGHT + 1.0, 3]])
    assert module._foremost(away, WIDTH).tolist() == away[1].tolist()
    shown = np.vstack([away, [[1.0, 1.0, 2.0], [WIDTH - 1.0, HEIGHT - 1.0, 0.0]]])
    assert module._foremost(shown, WIDTH).tolist() == [1.0, 1.0, 2.0]
