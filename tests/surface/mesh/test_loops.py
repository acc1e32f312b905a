"""Trim loops as segments: crossings, corners, wanted sizes."""

from __future__ import annotations

import numpy as np

from surface import Domain
from surface.mesh import loops
from tests.surface import shapes

CIRCLE = shapes.circle(0.0, 0.0, 1.0, n=400)


def test_crossings_lie_on_the_loop() -> None:
    segments = Domain((-2, 2, -2, 2), loops=[CIRCLE]).segments
    rng = np.random.default_rng(0)
    inner = rng.uniform(-0.6, 0.6, (200, 2))
    angle = rng.uniform(0, 2 * np.pi, 200)
    outer = 1.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    t = loops.crossings(segments, inner, outer)
    assert np.allclose(np.linalg.norm(inner + t[:, None] * (outer - inner), axis=1), 1, atol=1e-4)
    assert np.allclose(loops.crossings(segments, outer, inner), 1 - t, atol=1e-9)


def test_corners_are_found_and_kept_by_resampling() -> None:
    lens = shapes.eye(0.5, 0.5, 0.3, 0.15)
    sharp = loops.corners(lens, (1.0, 1.0))
    assert sharp.sum() == 2
    ring, kept = loops.resample(lens, (1.0, 1.0), 0.005)
    assert np.array_equal(ring[kept], lens[sharp])
    assert np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).max() <= 0.005 + 1e-12
    assert not loops.corners(CIRCLE, (1.0, 1.0)).any()


def test_wanted_sizes_follow_curvature_and_gaps() -> None:
    for error in (0.01, 0.001):
        size = np.zeros(len(CIRCLE))
        loops.wanted_size(CIRCLE, np.zeros(len(CIRCLE), dtype=bool), error, 0.0, size)
        assert np.allclose(size, np.sqrt(8 * error), rtol=0.2)  # sagitta = chord^2 / 8 for radius 1
    ring, sharp = loops.resample(np.array([[0.0, 0], [1, 0], [1, 0.02], [0, 0.02]]), (1.0, 1.0), 0.01)
    size = np.zeros(len(ring))
    loops.wanted_size(ring, sharp, 0.001, 0.003, size)
    middle = np.abs(ring[:, 0] - 0.5) < 0.3
    assert size[middle].max() < 0.025
    assert size.min() >= 0.003
