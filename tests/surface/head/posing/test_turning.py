"""surface.head.posing.turning, against scipy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.head.posing.turning import turn_head


@pytest.mark.parametrize("rows", [(0, 29), (1, 6), (3, 11), (5, 28), (7, 7)])
@pytest.mark.parametrize("angle", [1e-6, 0.8, 1.6, 3.1])
def test_vertices_turn_by_their_share_of_the_angle_about_the_pivot(rows: tuple[int, int], angle: float) -> None:
    rng = np.random.default_rng(1)
    vertices, normals = (rng.normal(size=(29, 3)).astype(np.float32) for _ in range(2))
    share = rng.uniform(0, 1, 29).astype(np.float32)
    share[::3], share[1::7] = 1.0, 0.0
    vector, pivot = angle * np.array([0.48, -0.8, 0.36]), np.array([1.0, 2.0, -3.0])
    out, out_normals = np.full((31, 3), 9.0, np.float32), np.full((31, 3), 9.0, np.float32)
    turn_head(vertices, normals, share, vector, pivot, *rows, out, out_normals)
    turns, own = Rotation.from_rotvec(share[:, None] * vector), slice(*rows)
    np.testing.assert_allclose(out[own], (turns.apply(vertices - pivot) + pivot)[own], atol=2e-6)
    np.testing.assert_allclose(out_normals[own], turns.apply(normals)[own], atol=2e-6)
    for array in (out, out_normals):
        assert (np.delete(array, np.arange(31)[own], axis=0) == 9.0).all()
