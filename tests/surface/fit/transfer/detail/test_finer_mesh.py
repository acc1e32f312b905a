"""Edges of a mesh are halved where a map takes their ends far apart."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_head import sheet

from surface.fit.transfer.detail.finer_mesh import finer_mesh

SURFACE = sheet(0.0)
U, V = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(0, 1, 9)], indexing="ij"))
AT = np.arange(81).reshape(9, 9)
A, B, C, D = (k.ravel() for k in (AT[:-1, :-1], AT[1:, :-1], AT[1:, 1:], AT[:-1, 1:]))
TRIANGLES = np.vstack([np.column_stack([A, B, C]), np.column_stack([A, C, D])])
MESH = SimpleNamespace(uv=np.column_stack([U, V]), side=np.arange(81) % 2, triangles=TRIANGLES)
REST = SURFACE.evaluate(MESH.uv)


def inner_edges(mesh) -> np.ndarray:
    """Those that have no triangle at the border."""
    edges = np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    edges = unique[count == 2]
    return edges[(np.abs(mesh.uv[edges] - 0.5) < 0.36).all(axis=(1, 2))]  # edges of the border stay whole


@pytest.mark.parametrize("longest", [np.inf, 4.0, 2.5])
def test_inner_edges_are_no_longer_than_asked_for(longest: float) -> None:
    made = finer_mesh(MESH, REST, SURFACE, lambda p: p, longest)
    ends = made.rest[inner_edges(made)]
    assert (
        np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max() <= min(longest, 8.0) * 1.15
    )  # half-edges of neighbours may be a little longer
    assert (len(made.uv) == 81) == (longest == np.inf)
    np.testing.assert_array_equal(made.uv[:81], MESH.uv)
    np.testing.assert_array_equal(made.side, [*MESH.side, *[0] * (len(made.uv) - 81)])
    np.testing.assert_allclose(made.rest, SURFACE.evaluate(made.uv), atol=1e-9)


def test_lengths_are_those_on_the_scan() -> None:
    assert len(finer_mesh(MESH, REST, SURFACE, lambda p: 0.1 * p, 4.0).uv) == 81


def test_edges_are_halved_no_more_than_twice() -> None:
    assert len(finer_mesh(MESH, REST, SURFACE, lambda p: p, 0.01).triangles) <= 16 * len(TRIANGLES)
