"""Meshes that are no surface become one: traps made of a sheet and of a box."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.fit.source.mesh import FitMesh, check_manifold, components, directed_edges
from surface.fit.source.repair import repaired


def sheet(**other) -> FitMesh:
    mesh = slit_sheet()
    return replace(mesh, piece=np.zeros(len(mesh.faces), int), pieces=("face", "hair"), **other)


def more(mesh: FitMesh, rows: list[list[int]], piece: int = 0) -> FitMesh:
    """The mesh with further faces."""
    new = np.array(rows)
    return replace(
        mesh, faces=np.vstack([mesh.faces, new]), face_uv=np.vstack([mesh.face_uv, new]),
        piece=np.concatenate([mesh.piece, np.full(len(rows), piece)]),
    )  # fmt: skip


def patches(mesh: FitMesh) -> int:
    """How many pieces hang together by vertices."""
    a, b = directed_edges(mesh.faces)
    return len(np.unique(components(a, b, len(mesh.vertices))))


def box(outwards: bool = True) -> FitMesh:
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    faces = faces if outwards else faces[:, ::-1]
    return FitMesh(corner, faces, corner[:, :2], faces.copy(), (), np.zeros((0, 8, 3)))


def volume(mesh: FitMesh) -> float:
    a, b, c, d = (mesh.vertices[mesh.faces[:, k]] for k in range(4))
    return float((np.cross(a, b) * c).sum() + (np.cross(a, c) * d).sum()) / 6.0


def test_a_good_mesh_comes_back_as_it_is():
    mesh = sheet()
    got, notes = repaired(mesh)
    assert got is mesh and notes == []


def test_doubled_and_collapsed_faces_are_dropped():
    mesh = sheet()
    quad = mesh.faces[30].tolist()
    got, notes = repaired(more(mesh, [quad, quad[::-1], [5, 5, 6, -1], [7, 8, 9, 7]], piece=1))
    np.testing.assert_array_equal(got.faces, mesh.faces)
    np.testing.assert_array_equal(got.vertices, mesh.vertices)
    assert notes == ["2 collapsed faces dropped (hair)", "2 doubled faces dropped (hair)"]


def test_a_fin_is_cut_off_and_the_surface_stays_whole():
    mesh = sheet()
    a, b = mesh.faces[100, :2]  # an edge inside the sheet: its two faces lie in one plane, the fin stands on them
    tip = len(mesh.vertices)
    finned = replace(
        mesh, vertices=np.vstack([mesh.vertices, mesh.vertices[a] + [4.0, 0.0, 50.0]]),
        deltas=np.pad(mesh.deltas, ((0, 0), (0, 1), (0, 0))), uv=np.vstack([mesh.uv, [0.5, 0.5]]),
    )  # fmt: skip
    finned = more(finned, [[int(a), int(b), tip, -1]], piece=1)
    got, notes = repaired(finned)
    check_manifold(got, "m")
    np.testing.assert_allclose(got.vertices[got.faces[:-1]], mesh.vertices[mesh.faces])
    assert patches(got) == 2 and len(got.vertices) == len(mesh.vertices) + 3
    assert "1 edges of more than two faces cut" in notes[0]
    # what a vertex does in a shape goes with it
    moved = got.deltas[:, got.faces[-1, :2]]
    np.testing.assert_allclose(moved, finned.deltas[:, [a, b]])


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
def test_of_three_strips_along_a_line_the_two_in_one_plane_stay_together(order):
    line = np.array([[0.0, y, 0] for y in range(5)])
    ends = [line + np.array(by) for by in ([-1.0, 0, 0], [1.0, 0, 0.1], [0.0, 0, 1])]  # left, right, up
    vertices = np.concatenate([line, *ends])
    strips = [[[k, k + 1, s + k + 1, s + k] for k in range(4)] for s in (5, 10, 15)]
    faces = np.array([quad for k in order for quad in strips[k]])
    mesh = FitMesh(vertices, faces, vertices[:, :2], faces.copy(), (), np.zeros((0, len(vertices), 3)))
    got, notes = repaired(mesh)
    check_manifold(got, "m")
    assert patches(got) == 2 and len(got.vertices) == 25 and "4 edges" in notes[0]
    a, b = directed_edges(got.faces)
    label = components(a, b, len(got.vertices))[got.faces[:, 0]]
    by_strip = [set(label[4 * order.index(k) : 4 * order.index(k) + 4]) for k in range(3)]
    assert by_strip[0] == by_strip[1] != by_strip[2]


def test_faces_wound_the_other_way_are_turned_by_the_majority():
    mesh = sheet()
    faces = mesh.faces.copy()
    face_uv = mesh.face_uv.copy()
    wrong = np.arange(len(faces)) % 7 == 3
    faces[wrong], face_uv[wrong] = faces[wrong][:, ::-1], face_uv[wrong][:, ::-1]
    got, notes = repaired(replace(mesh, faces=faces, face_uv=face_uv))
    check_manifold(got, "m")
    assert sorted(map(sorted, got.faces.tolist())) == sorted(map(sorted, mesh.faces.tolist()))
    rolled = [np.roll(g, -int(np.argmin(g))).tolist() for g in got.faces]
    assert rolled == [np.roll(g, -int(np.argmin(g))).tolist() for g in mesh.faces]
    np.testing.assert_allclose(got.uv[got.face_uv], mesh.uv[got.faces])  # texture coordinates go with their corners
    assert f"{int(wrong.sum())} faces turned round (face)" in notes


def test_a_strip_with_one_side_is_cut_open():
    # a band of 24 quads whose ends are joined after half a turn (Moebius): no winding fits it
    count = 24
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    centre = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    out = np.cos(angle / 2)[:, None] * centre + np.sin(angle / 2)[:, None] * [0, 0, 1]
    vertices = np.concatenate([centre + 0.2 * out, centre - 0.2 * out])
    here, there = np.arange(count), (np.arange(count) + 1) % count
    faces = np.stack([here, there, there + count, here + count], axis=1)
    faces[-1, 1], faces[-1, 2] = count, 0
    mesh = FitMesh(vertices, faces, vertices[:, :2], faces.copy(), (), np.zeros((0, 2 * count, 3)))
    got, _ = repaired(mesh)
    check_manifold(got, "m")
    assert len(got.faces) == count and len(got.vertices) == 2 * count + 2


@pytest.mark.parametrize("outwards", [True, False])
def test_what_is_closed_looks_outwards(outwards):
    got, notes = repaired(box(outwards))
    assert volume(got) == pytest.approx(1.0) and bool(notes) is not outwards


def test_an_open_skin_that_looks_inwards_is_turned_and_a_flat_sheet_is_left():
    mesh = box(outwards=False)
    bag = replace(mesh, faces=mesh.faces[:5], face_uv=mesh.face_uv[:5])
    got, notes = repaired(bag)
    np.testing.assert_array_equal(got.faces, box().faces[:5])
    assert notes == ["5 faces looked inwards and were turned round"]
    flat = slit_sheet()
    back = replace(flat, faces=flat.faces[:, ::-1], face_uv=flat.face_uv[:, ::-1], vertices=flat.vertices * [1, 1, 0])
    np.testing.assert_array_equal(repaired(back)[0].faces, back.faces)


@pytest.mark.parametrize(("closed", "turned"), [(True, True), (False, False)])
def test_beside_a_larger_surface_only_what_is_closed_is_turned(closed, turned):
    large, small = box(), box(outwards=False)
    faces = small.faces if closed else small.faces[:5]
    both = FitMesh(
        np.vstack([10.0 * large.vertices, small.vertices + 3.0]), np.vstack([large.faces, faces + 8]),
        np.vstack([large.uv, small.uv]), np.vstack([large.faces, faces + 8]), (), np.zeros((0, 16, 3)),
    )  # fmt: skip
    got, notes = repaired(both)
    np.testing.assert_array_equal(got.faces, np.vstack([large.faces, (faces[:, ::-1] if turned else faces) + 8]))
    assert notes == [f"{len(faces)} faces looked inwards and were turned round"] * turned


def test_triangles_and_quads_may_share_edges():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0], [1.5, 0.5, 1]])
    faces = np.array([[0, 1, 2, 3], [1, 2, 4, -1], [1, 5, 2, -1]])  # the second is wound the wrong way
    mesh = FitMesh(vertices, faces, vertices[:, :2], faces.copy(), (), np.zeros((0, 6, 3)))
    got, _ = repaired(mesh)
    check_manifold(got, "m")
    assert len(got.vertices) == 8 and (got.faces[1:, 3] == -1).all()
    np.testing.assert_allclose(np.sort(got.vertices[got.faces[0]], axis=0), np.sort(vertices[:4], axis=0))


def cap(half_deg: float, size: float) -> FitMesh:
    """A round cap of a sphere of this radius that reaches so far from its pole, looking inwards."""
    rings, around = 24, 48
    polar, angle = np.radians(half_deg) * np.arange(1, rings + 1) / rings, 2 * np.pi * np.arange(around) / around
    ring = np.stack(
        [
            np.outer(np.sin(polar), np.cos(angle)),
            np.outer(np.sin(polar), np.sin(angle)),
            np.outer(np.cos(polar), np.ones(around)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = size * np.concatenate([[[0.0, 0.0, 1.0]], ring])
    here = np.arange(around)
    there = (here + 1) % around
    faces = [[0, 1 + b, 1 + a, -1] for a, b in zip(here, there, strict=True)]
    for k in range(rings - 1):
        low, high = 1 + k * around, 1 + (k + 1) * around
        faces += [[low + a, low + b, high + b, high + a] for a, b in zip(here, there, strict=True)]
    rows = np.array(faces)
    return FitMesh(vertices, rows, vertices[:, :2], rows.copy(), (), np.zeros((0, len(vertices), 3)))


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize(("half_deg", "turned"), [(8.0, False), (14.0, False), (17.0, True), (80.0, True)])
def test_a_skin_is_inside_out_where_a_fifth_of_its_area_looks_to_its_middle_whatever_its_size(
    half_deg: float, turned: bool, size: float
) -> None:
    """Mean of the cosine between normals and directions from the middle, weighted by area and distance: of a cap of
    half-angle a, (1 - h^2) / m, with h = (1 + cos a) / 2 the height of its middle and m the mean distance from it, in
    radii; below 0.2 it is too flat to say."""
    mesh = cap(half_deg, size)
    h = (1.0 + np.cos(np.radians(half_deg))) / 2.0
    heights = np.linspace(np.cos(np.radians(half_deg)), 1.0, 20_001)  # of equal areas (Archimedes)
    distance = np.sqrt(1.0 - heights**2 + (heights - h) ** 2).mean()
    assert bool((1.0 - h**2) / distance > 0.2) is turned
    got, notes = repaired(mesh)
    assert bool(notes) is turned
    a, b, c = (got.vertices[got.faces[0, k]] for k in range(3))
    assert bool(np.cross(b - a, c - a)[2] > 0.0) is turned
