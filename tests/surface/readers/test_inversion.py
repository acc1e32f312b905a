"""Points of surfaces find their (u, v): folds, seams, many narrow spans."""

from __future__ import annotations

import numpy as np

from surface import DCPSurface
from surface.readers.inversion import invert, search_between
from tests.surface import shapes


def cylinder() -> DCPSurface:
    """Radius 2, height 3, clamped at its seam at u = 0 and 4."""
    angle = np.arange(9) * np.pi / 4
    far = np.where(np.arange(9) % 2, 2 * 2**0.5, 2.0)
    ring = np.stack([far * np.cos(angle), far * np.sin(angle)], axis=1)
    net = np.stack([np.column_stack([ring, np.full(9, z)]) for z in (0.0, 3.0)], axis=1)
    weights = np.repeat(np.where(np.arange(9) % 2, 0.5**0.5, 1.0)[:, None], 2, axis=1)
    return DCPSurface.from_nurbs(2, 1, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], [0, 0, 1, 1], net, weights)


def test_points_of_a_sheet_find_their_parameters() -> None:
    surface = shapes.hills(12)
    uv = np.random.default_rng(1).uniform(0, 1, (300, 2))
    found, distance = invert(surface, surface.evaluate(uv))
    assert np.abs(found - uv).max() < 1e-9
    assert distance.max() < 1e-9


def test_points_near_a_seam_are_found_on_both_sides_of_it() -> None:
    surface = cylinder()
    u = np.concatenate([np.linspace(1e-3, 0.2, 60), np.linspace(3.8, 3.999, 60)])
    uv = np.stack([u, np.linspace(0.1, 0.9, 120)], axis=1)
    found, distance = invert(surface, surface.evaluate(uv))
    assert np.abs(found - uv).max() < 1e-9
    assert distance.max() < 1e-9


def test_points_between_many_narrow_knot_spans_are_found() -> None:
    """A row of ripples, each within a span that even samples would miss."""
    rng, count = np.random.default_rng(5), 120
    net = np.stack(np.meshgrid(np.arange(float(count)), np.arange(4.0), indexing="ij"), axis=-1)
    heights = rng.normal(scale=2.0, size=(count, 4, 1))
    ends = np.cumsum(rng.uniform(0.01, 3.0, count - 2))
    knots = np.concatenate([[0.0, 0.0, 0.0], ends, [ends[-1]] * 2]) / ends[-1]
    surface = DCPSurface.from_nurbs(
        2, 3, knots, [0, 0, 0, 0, 1, 1, 1, 1], np.concatenate([net, heights], 2), np.ones((count, 4))
    )
    uv = rng.uniform(0.001, 0.999, (400, 2))
    found, distance = invert(surface, surface.evaluate(uv))
    assert distance.max() < 1e-8
    assert np.abs(surface.evaluate(found) - surface.evaluate(uv)).max() < 1e-8


def test_of_two_folds_that_touch_the_nearest_sample_does_not_decide() -> None:
    """A strip bent back on itself, 0.01 apart: samples of the wrong fold lie nearer to half of the points."""
    x = np.concatenate([np.linspace(0, 4, 9), np.linspace(4, 0, 9)])
    z = np.concatenate([np.zeros(9), np.full(9, 0.01)])
    net = np.stack([np.column_stack([x, np.full(18, y), z]) for y in (0.0, 1.0)], axis=1)
    knots = np.concatenate([[0.0], np.arange(18.0), [17.0]]) / 17.0
    surface = DCPSurface.from_nurbs(1, 1, knots, [0, 0, 1, 1], net, np.ones((18, 2)))
    uv = np.random.default_rng(6).uniform(0.01, 0.99, (300, 2))
    found, distance = invert(surface, surface.evaluate(uv))
    assert distance.max() < 1e-9
    assert np.abs(found - uv).max() < 1e-6


def test_a_point_that_ended_on_another_fold_is_found_between_its_neighbours() -> None:
    surface = shapes.hills(12)
    uv = np.column_stack([np.linspace(0.2, 0.6, 9), np.linspace(0.3, 0.4, 9)])
    points = surface.evaluate(uv)
    found, distance = uv.copy(), np.zeros(9)
    for k in (0, 4, 8):  # the first and the last have one neighbour
        found[k], distance[k] = [0.9, 0.95], np.nan if k == 4 else 50.0
    search_between(surface, points, found, distance, 1e-6)
    assert np.abs(found - uv).max() < 1e-9 and distance.max() < 1e-9
    kept, off = uv + 0.01, np.full(9, 1e-7)
    search_between(surface, points, kept, off, 1e-6)  # near enough
    assert np.array_equal(kept, uv + 0.01) and (off == 1e-7).all()
    away = points + np.array([0.0, 0.0, 1.0])
    found, distance = uv.copy(), np.full(9, 1e-3)
    search_between(surface, away, found, distance, 1e-6)  # nothing nearer
    assert np.array_equal(found, uv) and (distance == 1e-3).all()
