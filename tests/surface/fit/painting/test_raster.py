"""surface.fit.painting.raster, against the search of scipy's Delaunay triangulation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from surface.fit.painting.raster import covering


def test_every_texel_gets_the_triangle_that_a_search_finds() -> None:
    """Of a Delaunay triangulation, whose triangles do not overlap, found by scipy's walk."""
    points = np.random.default_rng(1).uniform(-5.0, 45.0, (60, 2))
    mesh = Delaunay(points)
    owner, share = covering(points[mesh.simplices], 30, 40)
    y, x = np.mgrid[:30, :40] + 0.5
    middle = np.stack([x, y], axis=-1)
    expected = mesh.find_simplex(middle)
    on_edge = np.abs(share).min(axis=-1) < 1e-6
    np.testing.assert_array_equal(owner[~on_edge], expected[~on_edge])
    seen = owner >= 0
    assert seen.mean() > 0.5
    found = np.einsum("mk,mkx->mx", share[seen], points[mesh.simplices][owner[seen]])
    np.testing.assert_allclose(found, middle[seen], atol=1e-9)


@pytest.mark.parametrize("turned", [False, True])
def test_triangles_may_run_either_way_and_the_last_one_covers_the_others(turned: bool) -> None:
    large = np.array([[0.0, 0], [8, 0], [0, 8]])
    small = np.array([[1.0, 1], [3, 1], [1, 3]])
    flat = np.array([[0.0, 0], [4, 4], [8, 8]])
    corners = np.stack([large, small, flat])[:, :: -1 if turned else 1]
    owner, _ = covering(np.ascontiguousarray(corners), 8, 8)
    assert owner[1, 1] == 1 and owner[0, 0] == 0 and owner[7, 7] == -1 and not (owner == 2).any()
