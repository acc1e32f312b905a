"""Triangles that pass through each other, against libigl's test of two triangles and forms of known depth."""

import igl
import numpy as np
import pytest

from surface.check.crossings import Crossings

TWO = np.array([[False, True], [True, False]])


def ball(radius, centre, n=24):
    """Vertices and outward triangles of a sphere."""
    a, b = np.meshgrid(np.linspace(0, np.pi, n), np.linspace(0, 2 * np.pi, 2 * n, endpoint=False), indexing="ij")
    at = np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(2 * n), indexing="ij")
    p, q = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
    one, two = np.stack([p, p + 2 * n, q], axis=-1), np.stack([q, p + 2 * n, q + 2 * n], axis=-1)
    return radius * at + centre, np.concatenate([one.reshape(-1, 3), two.reshape(-1, 3)])


def sheet(height, up):
    """Vertices and triangles of a level sheet that faces up or down; the ball's pole lies inside a triangle."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-15.3, 14.9, 17), np.linspace(-14.7, 15.5, 17)))
    first = np.flatnonzero((x < 14.8) & (y < 15.4))
    faces = np.concatenate([first[:, None] + [0, 1, 18], first[:, None] + [0, 18, 17]])
    return np.column_stack([x, y, np.full(len(x), height)]), faces if up else faces[:, ::-1]


def joined(*meshes):
    """One mesh of several, with the kind of each triangle: 0 for the first mesh, 1 for the second."""
    starts = np.cumsum([0, *(len(v) for v, _ in meshes)])
    at = np.concatenate([v for v, _ in meshes])
    faces = np.concatenate([t + s for (_, t), s in zip(meshes, starts, strict=False)])
    same = np.unique(np.round(at, 6), axis=0, return_inverse=True)[1].reshape(-1)
    kind = np.concatenate([np.full(len(t), k) for k, (_, t) in enumerate(meshes)])
    return at, faces, same, kind


def test_the_same_pairs_cross_as_libigl_says():
    rng = np.random.default_rng(3)
    at = (rng.random((60, 1, 3)) + 0.35 * rng.standard_normal((60, 3, 3))).reshape(-1, 3)
    faces, kind = np.arange(180).reshape(-1, 3), np.zeros(60, int)
    found = Crossings(at, faces, np.arange(180), kind, np.ones((1, 1), bool))
    order = found.tree.order
    pairs = {tuple(sorted(order[p])) for p in found.pairs(at)}
    tri = at[faces][:, :, None]
    every = [(i, j) for i in range(60) for j in range(i + 1, 60)]
    wanted = {(i, j) for i, j in every if igl.tri_tri_overlap_test_3d(*tri[i], *tri[j])}
    assert pairs == wanted and 50 < len(wanted) < 1500


def test_neighbours_and_kinds_that_do_not_meet_are_left_out():
    at, faces, same, kind = joined(ball(10.0, [0, 0, 0]), ball(10.0, [0, 0, 15.0]))
    assert len(Crossings(at, faces, same, kind, TWO).pairs(at)) > 20
    assert not len(Crossings(at, faces, same, kind, np.eye(2, dtype=bool)).pairs(at))


def test_of_each_pair_one_is_asked_for():
    at, faces, same, kind = joined(ball(10.0, [0, 0, 0]), ball(10.0, [0, 0, 15.0]), ball(10.0, [15.0, 0, 0]))
    every = Crossings(at, faces, same, np.minimum(kind, 1), TWO)
    some = Crossings(at, faces, same, np.minimum(kind, 1), TWO, kind == 2)
    kinds = kind[every.tree.order]
    pairs = every.pairs(at)
    wanted = np.sort(pairs[(kinds[pairs] == 2).any(axis=1)], axis=1)
    assert 0 < len(wanted) < len(pairs)
    np.testing.assert_array_equal(np.unique(np.sort(some.pairs(at), axis=1), axis=0), np.unique(wanted, axis=0))


def test_only_what_moved_is_looked_at():
    at, faces, same, kind = joined(ball(10.0, [0, 0, 0]), ball(10.0, [0, 0, 15.0]))
    found = Crossings(at, faces, same, kind, TWO)
    assert not len(found.pairs(at, least=0.1))
    moved = at + np.where(np.arange(len(at)) < len(at) // 2, 0.0, 0.05)[:, None] * [0, 0, 1.0]
    assert not len(found.pairs(moved, least=0.1))
    some, every = (np.unique(np.sort(found.pairs(moved, least=x), axis=1), axis=0) for x in (0.01, -1.0))
    np.testing.assert_array_equal(some, every)


@pytest.mark.parametrize("overlap", [2.0, 5.0])
def test_the_depth_of_two_balls_is_known(overlap):
    at, faces, same, kind = joined(ball(10.0, [0, 0, 0]), ball(10.0, [0, 0, 20.0 - overlap]))
    found = Crossings(at, faces, same, kind, TWO)
    rows, depth = found.depths(found.pairs(at), 0, 1, 12.0, 0.1)
    assert depth.max() == pytest.approx(overlap, rel=0.15)
    inside = np.linalg.norm(at - [0, 0, 20.0 - overlap], axis=1) < 9.5
    assert inside[rows[depth > 1.0]].all() and len(rows)
    assert not len(found.depths(found.pairs(at), 0, 1, 12.0, 11.0)[0])


def test_two_lips_that_touch_do_not_cross():
    at, faces, same, kind = joined(ball(10.0, [0, 0, 0]), ball(10.0, [0, 0, 20.1]))
    found = Crossings(at, faces, same, kind, TWO)
    assert not len(found.depths(found.pairs(at), 0, 1, 12.0, 0.1)[0])


def test_normals_of_a_ball_point_away_from_its_middle():
    centre = np.array([3.0, -2.0, 5.0])
    vertices, faces, same, kind = joined(ball(7.0, centre))
    crossings = Crossings(vertices, faces, same, kind, np.ones((1, 1), bool))
    places = np.zeros((same.max() + 1, 3))
    places[same] = vertices
    away = (places - centre) / 7.0
    normals = crossings._normals(places)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-9)
    assert (normals * away).sum(axis=1).min() > 0.99


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_what_a_ball_dips_below_a_sheet_lies_as_deep_as_its_height_says(up):
    """The sheet's triangles are not those of a grid in line with the ball's, and face up or down."""
    at, faces, same, kind = joined(ball(10.0, [0, 0, up * 7.03], 33), sheet(0.0, up > 0.0))
    found = Crossings(at, faces, same, kind, TWO)
    rows, depth = found.depths(found.pairs(at), 0, 1, 20.0, 0.1)
    np.testing.assert_allclose(depth, -up * at[rows, 2], atol=1e-9)
    below = np.unique(same[np.unique(faces[kind == 0])[-up * at[np.unique(faces[kind == 0]), 2] > 0.1]])
    np.testing.assert_array_equal(np.sort(same[rows]), below)
    near, shallow = found.depths(found.pairs(at), 0, 1, 1.5, 0.1)
    assert 0 < len(near) < len(rows) and shallow.max() <= 1.5  # no further than so far along the ball
    kept = rows[depth > 1.0]
    np.testing.assert_array_equal(np.sort(found.depths(found.pairs(at), 0, 1, 20.0, 1.0)[0]), np.sort(kept))


@pytest.mark.parametrize(("share", "is_counted"), [(3.9, True), (4.1, False)])
def test_flesh_that_a_skin_passes_has_its_other_side_within_four_depths(share, is_counted):
    """A ball dips 1 mm into a slab, whose lower side is some times the searched depth below the ball."""
    reach, drop = 3.0, ball(2.0, [0, 0, 1.0])
    at, faces, same, kind = joined(drop, sheet(0.0, True), sheet(-1.0 - share * reach, False))
    found = Crossings(at, faces, same, np.zeros_like(kind), np.ones((1, 1), bool))
    rows, depth = found.depths(found.pairs(at), 0, 0, reach, 0.1)
    below = rows < len(drop[0])  # of the slab, some lies in the ball, too
    assert below.any() == is_counted
    np.testing.assert_allclose(depth[below], -at[rows[below], 2], atol=1e-9)
