"""Eyeballs come to lie as deep as a scan's eyes and lids do, both alike, and stay where the scan shows none."""

from dataclasses import replace

import made_face
import numpy as np
import pytest

from surface.fit.transfer.eye_depth import FURTHEST_MM, at_scan_depth
from surface.fit.transfer.skin import Ball
from surface.fit.transfer.template import Template

LID_MM, ROUND = 1.0, 60


def caps(radius: float, low: float, high: float) -> np.ndarray:
    """Places (2, k, 3) on spheres around both eyes, in rings from one distance from their axes to another."""
    away = np.arange(low, high + 0.1, 0.25)
    angle = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    x, y = (np.outer(away, f(angle)).ravel() for f in (np.cos, np.sin))
    return made_face.EYES[:, None] + np.column_stack([x, y, np.sqrt(radius**2 - x**2 - y**2)])


def rings(count: int) -> np.ndarray:
    """Triangles (t, 3) of :func:`caps` with so many points on one side."""
    at = np.arange(count).reshape(-1, ROUND)
    a, b, c, d = (k.ravel() for k in (at[:-1], at[1:], np.roll(at, -1, 1)[1:], np.roll(at, -1, 1)[:-1]))
    return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def template() -> Template:
    """The fronts of both eyeballs."""
    layers = caps(made_face.RADIUS, 0.0, 8.0)
    triangles = np.concatenate([rings(len(k)) + n * len(layers[0]) for n, k in enumerate(layers)])
    points, eye = layers.reshape(-1, 3), np.repeat([0, 1], len(layers[0]))
    return replace(made_face.template(8.0), points=points, normals=points, eye=eye, face=eye < 0, triangles=triangles)


def lids() -> tuple[np.ndarray, np.ndarray]:
    """Round lids on both balls, which hide the rims of these: points (n, 3) and triangles (t, 3)."""
    both = caps(made_face.RADIUS + LID_MM, 6.0, 11.0)
    return both.reshape(-1, 3), np.concatenate([rings(len(k)) + n * len(both[0]) for n, k in enumerate(both)])


def scan(*deeper: float) -> np.ndarray:
    """What a scan shows of both eyes: balls between lids, each so far behind those of the template."""
    seen = np.concatenate([caps(made_face.RADIUS, 0.0, 5.8), caps(made_face.RADIUS + LID_MM, 6.0, 11.0)], axis=1)
    return (seen - np.array([[0.0, 0.0, d] for d in deeper])[:, None]).reshape(-1, 3)


def moved_by(front: np.ndarray, scale: float = 1.0) -> np.ndarray:
    """(2, 3) how far the eyeballs are moved where the map enlarges the head by ``scale``."""
    rest, triangles = lids()
    new = Ball(scale * made_face.EYES, scale * made_face.RADIUS)
    found = at_scan_depth(template(), scale * rest, rest, triangles, new, front)
    assert found.radius == new.radius
    return found.centres - new.centres


@pytest.mark.parametrize(("deeper", "wanted"), [((0.0, 0.0), 0.0), ((1.4, 1.4), -1.4), ((-1.0, -1.0), 1.0)])
def test_eyeballs_move_to_where_the_eyes_of_the_scan_are(deeper, wanted) -> None:
    found = moved_by(scan(*deeper))  # lids slide on the ball a little, so that it goes a little further
    np.testing.assert_allclose(found, np.tile([0.0, 0.0, wanted], (2, 1)), atol=0.25)


def test_both_eyes_move_by_the_same_way() -> None:
    both = moved_by(scan(0.6, 1.8))[:, 2]
    assert both[0] == both[1] and -1.9 < both[0] < -0.5
    left = scan(0.6, 1.8).reshape(2, -1, 3)[0]
    np.testing.assert_allclose(moved_by(left)[:, 2], [-0.6, -0.6], atol=0.1)  # the scan has a hole for the other


def test_eyeballs_lie_where_the_greatest_distances_are_least() -> None:
    front = scan(0.0, 0.0)
    beside = np.hypot(np.abs(front[:, 0]) - made_face.EYES[0, 0], front[:, 1] - made_face.EYES[0, 1])
    deep = beside < 4.0  # a seventh of the samples: in the mean eyeballs would hardly move
    assert 0.05 < deep.mean() < 0.45
    way = moved_by(front - np.outer(deep, [0, 0, 2.0]))[0, 2]
    assert -1.2 < way < -0.8


def test_a_pupil_carved_as_a_hole_hardly_moves_an_eyeball() -> None:
    front = scan(0.0, 0.0)
    beside = np.hypot(np.abs(front[:, 0]) - made_face.EYES[0, 0], front[:, 1] - made_face.EYES[0, 1])
    away = np.outer(beside < 1.0, [0.0, 0.0, 1.0])
    ways = [moved_by(front - mm * away)[0, 2] for mm in (5.0, 50.0)]
    assert -1.5 < ways[0] < 0.0 and ways[1] == pytest.approx(ways[0], abs=0.15)


def test_a_scan_that_shows_no_eyes_moves_none() -> None:
    for front in (np.zeros((0, 3)), scan(1.0, 1.0)[::200], scan(1.0, 1.0) + np.array([100.0, 0.0, 0.0])):
        np.testing.assert_array_equal(moved_by(front), np.zeros((2, 3)))


def test_no_eye_is_moved_far() -> None:
    np.testing.assert_allclose(moved_by(scan(4.5, 4.5))[:, 2], -FURTHEST_MM, atol=0.03)


def test_lengths_grow_with_the_head() -> None:
    found = moved_by(2.0 * scan(1.0, 1.0), 2.0)
    np.testing.assert_allclose(found, 2.0 * moved_by(scan(1.0, 1.0)), atol=0.02)
    np.testing.assert_allclose(moved_by(2.0 * scan(4.0, 4.0), 2.0)[:, 2], -2 * FURTHEST_MM, atol=0.06)
