"""surface.mesh.splitedges"""

from __future__ import annotations

import numpy as np
import pytest

from surface.mesh.mesh import border_edges
from surface.mesh.splitedges import Middles, split_edges


def grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A square of n x n cells of two triangles: places (m, 2) and triangles."""
    uv = np.stack(np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij"), -1).reshape(-1, 2)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = corner, corner + n + 1, corner + n + 2, corner + 1
    return uv, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def areas(uv: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(t,) signed."""
    a, b, c = (uv[triangles[:, k]] for k in range(3))
    found: np.ndarray = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    return found


@pytest.mark.parametrize("seed", range(8))
def test_any_choice_of_edges_leaves_a_whole_mesh(seed: int) -> None:
    uv, triangles = grid(5)
    rng, middles = np.random.default_rng(seed), Middles(len(uv))
    finer = split_edges(triangles, lambda edges: rng.uniform(size=len(edges)) < 0.1 * (seed + 1), middles)
    at = np.concatenate([uv, *[uv[list(ends)].mean(axis=0)[None] for ends in middles.ends]])
    found = areas(at, finer)
    assert found.min() > 0.0 and found.sum() == pytest.approx(25.0)  # none is turned over, and nothing is lost
    assert len(border_edges(finer.astype(np.int32))) == len(border_edges(triangles.astype(np.int32)))  # no cracks
    assert len(np.unique(finer)) == len(at)


def test_borders_stay_whole_and_nothing_wanted_changes_nothing() -> None:
    uv, triangles = grid(3)
    middles = Middles(len(uv))
    finer = split_edges(triangles, lambda edges: np.ones(len(edges), bool), middles)
    border = {tuple(sorted(edge)) for edge in border_edges(triangles.astype(np.int32)).tolist()}
    assert border == {tuple(sorted(edge)) for edge in border_edges(finer.astype(np.int32)).tolist()}
    assert not border & set(middles.ends) and len(middles.ends) == 33 - 12
    same = split_edges(triangles, lambda edges: np.zeros(len(edges), bool), Middles(len(uv)))
    assert np.array_equal(same, triangles)


def test_two_sets_of_triangles_share_their_middles() -> None:
    uv, triangles = grid(2)
    middles = Middles(len(uv))
    split_edges(triangles, lambda edges: np.ones(len(edges), bool), middles)
    before = len(middles.ends)
    again = split_edges(triangles[[0, 4]], lambda edges: np.ones(len(edges), bool), middles)
    assert len(middles.ends) == before and again.max() >= len(uv)
