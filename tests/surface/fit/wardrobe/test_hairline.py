"""surface.fit.wardrobe.hairline: where hair grows, by angles from the crown."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe.hairline import POINTS, Hairline, angles, directions
from surface.fit.wardrobe.skin import CENTRE, Skin, unit


@pytest.fixture(scope="module")
def line(skin: Skin) -> Hairline:
    return Hairline(skin)


def test_angles_and_directions_are_inverse() -> None:
    rng = np.random.default_rng(1)
    down, round_it = rng.uniform(0.01, 3.1, 50), rng.uniform(-3.1, 3.1, 50)
    toward = directions(down, round_it)
    np.testing.assert_allclose(np.linalg.norm(toward, axis=1), 1.0)
    for far in (1.0, 90.0):
        found = angles(CENTRE + far * toward)
        np.testing.assert_allclose(found[0], down)
        np.testing.assert_allclose(found[1], round_it)
    up, front, left = np.eye(3)[[1, 2, 0]]
    assert angles(CENTRE + up[None])[0] == 0.0
    np.testing.assert_allclose(np.array(angles(CENTRE + front[None]))[:, 0], [np.pi / 2, 0.0])
    np.testing.assert_allclose(np.array(angles(CENTRE + left[None]))[:, 0], [np.pi / 2, np.pi / 2])


def test_the_line_is_the_same_on_both_sides_and_lies_on_the_skin(line: Hairline, skin: Skin) -> None:
    round_it = np.linspace(0.0, np.pi, 90)
    np.testing.assert_array_equal(line.down(round_it), line.down(-round_it))
    toward = unit(line.line - CENTRE)
    np.testing.assert_allclose(np.linalg.norm(line.line - CENTRE, axis=1), skin.reach(toward))
    down, around = angles(line.line)
    np.testing.assert_allclose(down, line.down(around), atol=1e-9)


def test_it_goes_through_the_points_that_are_given(skin: Skin) -> None:
    given = np.array([(0, 120, 80), (60, 90, 60), (75, 30, 10), (50, 0, -50), (0, -20, -60)], float)
    line = Hairline(skin, given)
    down, round_it = angles(given)
    np.testing.assert_allclose(line.down(round_it), down, atol=2e-3)
    assert (line.down(np.linspace(0, np.pi, 200)) < down.max() + 1e-9).all()  # it does not overshoot
    down, round_it = angles(POINTS)
    np.testing.assert_allclose(Hairline(skin).down(round_it), down, atol=5e-3)


def test_how_far_inside_a_place_lies_is_its_distance_from_the_line(line: Hairline, skin: Skin) -> None:
    some = skin.points[::37]
    found = line.inside(some)
    away = np.linalg.norm(some[:, None] - line.line, axis=2).min(axis=1)
    np.testing.assert_allclose(np.abs(found), away)
    down, round_it = angles(some)
    assert ((found > 0.0) == (down < line.down(round_it))).all()
    crown, nose, chin, nape = np.array([[0, 140, -6], [0, 0, 110], [0, -60, 78], [0, -110, -70]], float)
    assert line.inside(crown[None]) > 30.0
    assert (line.inside(np.array([nose, chin, nape])) < 0.0).all()
