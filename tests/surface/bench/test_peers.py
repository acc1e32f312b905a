"""Peers compute the same vertices, so that comparing times is fair."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surface.bench import bench, peers

SURFACE, MESH = bench.sheet(1_500)


def test_stencils_and_sparse_matrix() -> None:
    assert np.abs(peers.stencils(SURFACE, MESH)() - MESH.vertices).max() < 1e-4
    assert np.abs(peers.sparse_matrix(SURFACE, MESH)() - MESH.vertices).max() < 1e-4
    assert np.shape(peers.blendshapes(SURFACE, MESH)()) == (3 * len(MESH.vertices),)


@pytest.mark.parametrize("name", ["splinepy", "geomdl"])
def test_libraries_where_they_are_installed(name: str) -> None:
    pytest.importorskip(name)
    prepare = {peer.name: peer.prepare for peer in peers.libraries(MESH)}[name]
    points = np.asarray(prepare(SURFACE, MESH)())
    assert np.abs(points - MESH.vertices[: len(points)]).max() < 1e-9


def test_the_net_of_a_sheet() -> None:
    side, points, knots = peers.net_of(SURFACE)
    assert (len(points), len(knots)) == (side * side, side + 4)
    assert (np.diff(knots) >= 0).all()


def test_blendshapes_are_named_with_what_they_read() -> None:
    """52 shapes of three float32 numbers a vertex."""
    mesh: Any = SimpleNamespace(vertices=np.zeros((100_000, 3)))
    assert [p.name for p in peers.vertex_sums(mesh) if "blendshapes" in p.name] == ["numpy 52 blendshapes, 62.4 MB"]
