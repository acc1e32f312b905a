"""surface.fit.source.junctions: borders that lie on each other get shared edges, lips that only touch do not."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from surface.fit.source.junctions import NEAR_MM, joined_borders
from surface.fit.source.mesh import FitMesh, check_manifold, directed_edges, face_areas


def strip(x: np.ndarray, y: tuple[float, float], *, triangles: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Vertices of two rows over the columns ``x`` and quads, or triangles, between them, seen from +z."""
    n = len(x)
    rows = np.concatenate([np.column_stack([x, np.full(n, h), np.zeros(n)]) for h in y])
    k = np.arange(n - 1)
    quads = np.column_stack([k, k + 1, n + k + 1, n + k])
    if not triangles:
        return rows, quads
    cut = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return rows, np.column_stack([cut, np.full(len(cut), -1)])


def sheets(
    low: np.ndarray, high: np.ndarray, pieces: tuple[str, ...] = ("face/skin", "back/skin"), *,
    shape: float = 0.0, apart: float = 0.0, triangles: bool = False,
) -> FitMesh:  # fmt: skip
    """Two strips that touch along y = 0: below with columns ``low``, above with ``high``.

    One shape bends both alike by a parabola, held straight between the columns of the lower one, and moves the upper by
    ``shape``; ``apart`` : how far the upper one is away at rest.
    """
    a, f = strip(low, (-10.0, 0.0), triangles=triangles)
    b, g = strip(high, (0.0, 10.0), triangles=triangles)
    at = np.concatenate([a, b + np.array([0.0, 0.0, apart])])
    g = np.where(g < 0, -1, g + len(a))
    faces = np.concatenate([f, g])
    bend = np.interp(at[:, 0], low, low**2 / 100.0)
    move = np.zeros((1, len(at), 3))
    move[0, :, 2] = bend
    move[0, len(a) :, 1] += shape
    piece = np.repeat(np.arange(2), [len(f), len(g)]) % len(pieces)
    return FitMesh(at, faces, at[:, :2] / 40.0, faces.copy(), ("jawOpen",), move, piece, pieces)


def open_edges(mesh: FitMesh) -> float:
    """Length of the border of a mesh, mm."""
    a, b = directed_edges(mesh.faces)
    n = len(mesh.vertices)
    alone = ~np.isin(a * n + b, b * n + a)
    return float(np.linalg.norm(mesh.vertices[a[alone]] - mesh.vertices[b[alone]], axis=1).sum())


COARSE, FINE = np.array([0.0, 10.0, 20.0, 40.0]), np.array([0.0, 2.0, 10.0, 13.0, 20.0, 25.0, 31.0, 40.0])
OTHER = np.array([0.0, 7.0, 20.0, 33.0, 40.0])


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize(("low", "high"), [(COARSE, FINE), (FINE, COARSE), (COARSE, OTHER), (COARSE, COARSE)])
def test_pieces_that_touch_share_their_edges(low, high, triangles):
    mesh = sheets(low, high, triangles=triangles)
    if len(high) > len(low):
        mesh.deltas[0, :, 2] = mesh.vertices[:, 0]  # straight, so that the finer border stays on the coarser one
    if high is OTHER or low is FINE:
        mesh.deltas[0, :, 2] = mesh.vertices[:, 0]
    assert open_edges(mesh) == pytest.approx(2 * (80.0 + 20.0))
    joined, notes = joined_borders(mesh)
    assert open_edges(joined) == pytest.approx(80.0 + 40.0)
    check_manifold(joined, "sheets")
    assert len(notes) == 1 and notes[0].startswith("borders of pieces that touch were joined: ")
    for one, two in ((mesh, joined),):
        assert face_areas(two.vertices, two.faces).sum() == pytest.approx(face_areas(one.vertices, one.faces).sum())
        assert face_areas(np.pad(two.uv, ((0, 0), (0, 1))), two.face_uv).sum() == pytest.approx(0.5)
    own = np.bincount(joined.piece, face_areas(joined.vertices, joined.faces))
    np.testing.assert_allclose(own, [400.0, 400.0])


def test_a_border_that_bends_with_the_other_in_a_shape_is_joined():
    joined, _ = joined_borders(sheets(COARSE, FINE))
    assert open_edges(joined) == pytest.approx(120.0)


@pytest.mark.parametrize(
    "mesh",
    [
        sheets(COARSE, FINE, shape=-4.0),  # lips: they touch at rest and come apart
        sheets(COARSE, FINE, apart=3.0 * NEAR_MM), sheets(COARSE, COARSE, apart=3.0 * NEAR_MM),
        sheets(COARSE, COARSE, shape=3.0 * NEAR_MM),
        sheets(COARSE, FINE, ("face/skin", "lash/lash")),  # stands on the skin
    ],
)  # fmt: skip
def test_what_comes_apart_or_only_stands_there_stays_as_it_is(mesh):
    joined, notes = joined_borders(mesh)
    assert notes == [] and joined is mesh


def test_without_shapes_only_pieces_of_two_names_are_joined():
    """Nothing tells the lips of a shapeless mesh, which touch, from a border that was cut."""
    mesh = sheets(COARSE, FINE)
    bare = replace(mesh, names=(), deltas=mesh.deltas[:0])
    assert open_edges(joined_borders(bare)[0]) == pytest.approx(120.0)
    lips = replace(bare, pieces=("face/skin",), piece=np.zeros_like(bare.piece))
    assert joined_borders(lips) == (lips, [])


def test_a_corner_that_touches_an_edge_does_not_split_it():
    mesh = sheets(np.array([0.0, 40.0]), np.array([15.0, 25.0]))
    mesh.vertices[6:, 1] = [0.0, 10.0]  # the upper strip hangs by one corner only
    mesh.vertices[4:6] = [[15.0, 4.0, 0.0], [25.0, 10.0, 0.0]]
    mesh.vertices[6] = [20.0, 0.0, 0.0]
    mesh.deltas[:] = 0.0
    assert joined_borders(mesh) == (mesh, [])


def test_bare_faces_stay_bare():
    mesh = sheets(COARSE, FINE)
    joined, _ = joined_borders(replace(mesh, face_uv=np.full_like(mesh.face_uv, -1)))
    assert (joined.face_uv == -1).all() and open_edges(joined) == pytest.approx(120.0)


def test_where_welding_would_crowd_an_edge_it_is_left_out():
    """Two sheets that lie on each other stay two."""
    mesh = sheets(COARSE, COARSE)
    mesh.vertices[8:] = mesh.vertices[:8]
    mesh.deltas[:] = 0.0
    joined, notes = joined_borders(mesh)
    assert notes == [] and len(joined.vertices) == 16


def loose(corners: np.ndarray) -> FitMesh:
    """A mesh of triangles (t, 3, 3) or quads (t, 4, 3) that share no vertex, of two pieces by turns."""
    count, size = corners.shape[:2]
    faces = np.full((count, 4), -1)
    faces[:, :size] = np.arange(count * size).reshape(count, size)
    bare = np.zeros((0, 2)), np.full((count, 4), -1), (), np.zeros((0, count * size, 3))
    return FitMesh(corners.reshape(-1, 3), faces, *bare, np.arange(count) % 2, ("face/skin", "back/skin"))


def strands(count: int) -> FitMesh:
    """Strips as long as a head and 0.5 mm wide, all over it, that do not touch."""
    y = np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 150.0], [0.0, 150.0]])
    k = np.arange(count)
    at = np.column_stack([np.zeros(count), np.zeros(count), k % 50]) + (k // 50)[:, None] * [2.0, 0.0, 0.0]
    return loose(at[:, None] + np.pad(y, ((0, 0), (0, 1))))


@pytest.mark.parametrize("mesh", [strands(3000), loose(np.zeros((3000, 3, 3)))])
def test_many_long_edges_and_many_vertices_in_one_place_take_little_memory(mesh):
    tracemalloc.start()
    try:
        joined, notes = joined_borders(mesh)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert joined is mesh and notes == []
    assert most < 200e6


@pytest.mark.parametrize("triangles", [0, 1, 2])
def test_meshes_of_hardly_anything_stay_as_they_are(triangles):
    corners = np.arange(triangles)[:, None, None] * 5.0 + np.eye(3)
    mesh = loose(corners)
    assert joined_borders(mesh) == (mesh, [])


def test_long_edges_are_split_at_every_vertex():
    """An edge that is longer than all balls along it together would be if they had their usual width."""
    many = np.append(np.arange(0.0, 2000.0, 7.3), 2000.0)
    mesh = sheets(np.array([0.0, 2000.0]), many)
    assert open_edges(joined_borders(mesh)[0]) == pytest.approx(4000.0 + 40.0)
