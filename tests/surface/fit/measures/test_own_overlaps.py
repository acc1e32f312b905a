"""A mesh's own overlaps: a ball of skin that a shape pushes through a sheet of skin."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.sparse import identity

from surface.check.overlaps import Overlap
from surface.fit.measures.own_overlaps import MeshOverlaps
from surface.fit.source.mesh import FitMesh
from tests.surface.check import plain

PLACE = (0.0, -60.0, 4.0)


def measured(material: str = "skin", overlap: str = "skin", shape: str = "cheekPuff", at: Any = PLACE) -> float:
    """The depth in a mesh whose ball lies 2 mm below its sheet, and 4 mm through it in cheekPuff."""
    sheet, below = plain.sheet((-30, 30), (-100, 60), 2.0)
    ball, around, _ = plain.ball((0.0, -60.0, -14.0), 12.0)
    triangles = np.vstack([below, around + len(sheet)])
    faces = np.column_stack([triangles, np.full(len(triangles), -1)]).astype(np.int64)
    moved = np.vstack([np.zeros_like(sheet), np.tile([0.0, 0.0, 6.0], (len(ball), 1))])[None]
    points = np.vstack([sheet, ball])
    mesh = FitMesh(points, faces, points[:, :2].copy(), faces.copy(), ("cheekPuff",), moved)
    first, second = (identity(len(points)).tocsr()[rows] for rows in (slice(len(sheet)), slice(len(sheet), None)))
    parts: Any = [SimpleNamespace(name=n, chart=SimpleNamespace(mix=m)) for n, m in (("face", first), ("ball", second))]
    head: Any = SimpleNamespace(
        parts=[SimpleNamespace(name="face", material="skin"), SimpleNamespace(name="ball", material=material)], jaw=None
    )
    own = MeshOverlaps(head, mesh, {"cheekPuff": [0]}, parts, 1.0)
    return own.depth(Overlap(3.0, overlap, shape, "chin", 4.0, at))


def test_the_depth_is_that_of_the_mesh_in_the_shape_at_the_place() -> None:
    assert 3.5 < measured() < 6.0, "the way out of a ball is oblique at its vertices"
    assert measured(shape="") == 0.0, "at rest it does not"
    assert measured(at=(0.0, 40.0, 0.0)) == 0.0, "nor does it elsewhere"


def test_only_skin_in_skin_is_measured() -> None:
    assert measured("hair") == 0.0 and measured(overlap="teeth") == 0.0
