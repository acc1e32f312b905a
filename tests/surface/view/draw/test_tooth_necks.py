"""Where the gum covers a tooth."""

from __future__ import annotations

import numpy as np
import pytest

from surface.view.draw.tooth_necks import tooth_necks

AROUND, UP = 24, 17


def crown(*, open_end: bool, at: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A tooth as half an egg with its tip at height 8 mm: vertices (m, 3), triangles (t, 3)."""
    rows = np.linspace(0.0, 1.0, UP)
    angles = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    radius = 3.5 * np.sqrt(np.maximum(1.0 - rows**2, 0.0))
    ring = np.stack([np.cos(angles), np.zeros(AROUND), np.sin(angles)], axis=1)
    vertices = (radius[:, None, None] * ring + 8.0 * rows[:, None, None] * [0.0, 1.0, 0.0]).reshape(-1, 3)
    i, j = (each.ravel() for each in np.meshgrid(np.arange(UP - 1), np.arange(AROUND), indexing="ij"))
    corners = [a * AROUND + b % AROUND for a, b in ((i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j))]
    triangles = np.concatenate([np.stack(corners[:3], axis=1), np.stack([corners[0], *corners[2:]], axis=1)])
    if not open_end:
        fan = np.arange(1, AROUND - 1)
        triangles = np.concatenate([triangles, np.stack([0 * fan, fan + 1, fan], axis=1)])
    return vertices + np.array([at, 0.0, 0.0]), triangles.astype(np.int32)


def test_gum_fades_in_towards_the_free_border_of_a_crown_and_nowhere_else() -> None:
    vertices, triangles = crown(open_end=True)
    necks = tooth_necks(vertices, triangles)
    assert necks.dtype == np.float32 and necks.shape == (len(vertices),)
    assert (necks[:AROUND] == 1.0).all()
    assert not necks[vertices[:, 1] > 2.5].any()
    assert ((necks > 0.0) & (necks < 1.0)).any()


def test_closed_teeth_and_empty_parts_have_no_gum() -> None:
    assert not tooth_necks(*crown(open_end=False)).any()
    assert tooth_necks(np.zeros((4, 3)), np.zeros((0, 3), np.int32)) == pytest.approx(np.zeros(4))


def test_every_tooth_has_its_own_neck_whichever_way_it_points() -> None:
    below, triangles = crown(open_end=True)
    above = below * [1.0, -1.0, 1.0] + np.array([20.0, 0.0, 0.0])
    both = tooth_necks(np.concatenate([below, above]), np.concatenate([triangles, triangles + len(below)]))
    assert both[: len(below)] == pytest.approx(both[len(below) :])


def test_vertices_that_are_split_along_a_seam_make_no_border() -> None:
    vertices, triangles = crown(open_end=False)
    split = tooth_necks(vertices[triangles].reshape(-1, 3), np.arange(triangles.size, dtype=np.int32).reshape(-1, 3))
    assert not split.any()
