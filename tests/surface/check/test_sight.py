"""What of a head is seen from outside."""

from __future__ import annotations

import numpy as np
import pytest

from surface.check import sight
from surface.check.sight import are_visible, seen_vertices
from tests.surface.check import plain


def test_what_lies_in_a_closed_ball_is_not_seen_and_the_ball_is() -> None:
    points, triangles, normals = plain.ball((0.0, 0.0, 0.0), 60.0)
    inner, faces, ways = plain.ball((0.0, 0.0, 0.0), 20.0)
    ball = plain.part("ball", points, triangles, normals=normals)
    core = plain.part("core", inner, faces, normals=ways, material="teeth")
    for parts, shown in (((ball, core), [True, False]), ((core,), [True])):
        seen = seen_vertices(plain.subject(*parts))
        assert [len(s) for s in seen] == [len(p.rest) for p in parts]
        assert [bool(s.mean() > 0.9) for s in seen] == shown
        assert [bool(s.mean() > 0.1) for s in seen] == shown


def test_hair_hides_nothing_and_a_head_without_triangles_shows_nothing() -> None:
    points, triangles, normals = plain.ball((0.0, 0.0, 0.0), 60.0)
    inner, faces, ways = plain.ball((0.0, 0.0, 0.0), 20.0)
    hair = plain.part("hair", points, triangles, normals=normals, material="hair")
    seen = seen_vertices(plain.subject(hair, plain.part("core", inner, faces, normals=ways)))
    assert not seen[0].any() and seen[1].mean() > 0.9
    empty = plain.part("none", points, triangles[:0], normals=normals)
    assert not seen_vertices(plain.subject(empty))[0].any()


def test_a_triangle_beside_one_that_is_seen_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A floor that is seen through a hole: triangles beside those below the hole have a corner in sight."""
    monkeypatch.setattr(sight, "VIEWS", ((0.0, 0.0),))
    roof, faces = plain.sheet((-100, 100), (-100, 100), 10.0, 20.0)
    floor, rows = plain.sheet((-60, 60), (-60, 60), 10.0, 0.0)
    open_roof = plain.without(roof, faces, (-10, 10), (-10, 10))
    found = are_visible(np.vstack([roof, floor]), np.vstack([open_roof, rows + len(roof)]), 1.0)[len(open_roof) :]
    middle = np.abs(floor[rows].mean(axis=1)[:, :2]).max(axis=1)
    assert found[middle < 10].all() and (middle < 10).sum() == 8
    assert found[(middle > 10) & (middle < 20)].sum() > 8 and not found[middle > 25].any()
