"""Defects of texture coordinates that are built in: overlaps, flips, squeezes, seams, and what is none of them."""

from dataclasses import replace

import numpy as np
import pytest
from ball_head import grid

from surface.fit.source.islands import find_islands
from surface.fit.source.mesh import FitMesh
from surface.fit.source.uvcheck import (
    UVDefects,
    _measure_island,
    _stretch,
    front_seams,
    mark_overlaps,
    measure_uv,
    squeezed_share,
    unevenness,
    vertex_normals,
)


def mesh_of(points, faces, uv, face_uv=None, moves=None) -> FitMesh:
    faces = np.asarray(faces)
    faces = faces if faces.shape[1] == 4 else np.pad(faces, ((0, 0), (0, 1)), constant_values=-1)
    deltas = np.zeros((0, len(points), 3)) if moves is None else moves[None]
    names = () if moves is None else ("jawOpen",)
    return FitMesh(
        np.asarray(points, float), faces, np.asarray(uv, float), faces if face_uv is None else face_uv, names, deltas
    )


def sheet(count: int = 13, size: float = 60.0) -> FitMesh:
    """A flat square of ``size`` mm whose texture coordinates are its places."""
    uv, tri = grid(count, count)
    return mesh_of(np.column_stack([size * uv, 0 * uv[:, 0]]), tri, uv)


def one(mesh: FitMesh, scale: float = 1.0) -> tuple[float, ...]:
    """What is measured of the only island of a mesh."""
    (island,) = find_islands(mesh)
    return _measure_island(mesh, island, scale)


def every(mesh: FitMesh) -> np.ndarray:
    return np.arange(len(mesh.faces))


@pytest.mark.parametrize("change", ["none", "mirrored", "turned", "stretched", "large", "shifted"])
def test_coordinates_that_serve_have_no_faults(change: str) -> None:
    mesh = sheet()
    uv = {"none": mesh.uv, "mirrored": mesh.uv * [-1, 1], "turned": mesh.uv[:, ::-1], "stretched": mesh.uv * [12, 1],
          "large": mesh.uv * 900, "shifted": mesh.uv + 77}[change]  # fmt: skip
    found = measure_uv(replace(mesh, uv=uv), every(mesh), face=True)
    assert found == UVDefects(len(mesh.faces)) and found.faults() == []


def test_faces_without_coordinates_are_counted() -> None:
    mesh = sheet()
    bare = mesh.face_uv.copy()
    bare[:5] = -1
    found = measure_uv(replace(mesh, face_uv=bare), every(mesh))
    assert (found.missing, found.faces) == (5, 288) and found.faults() == ["5 faces have none"]
    assert measure_uv(replace(mesh, face_uv=0 * bare - 1), every(mesh)).faults() == ["none at all"]
    assert measure_uv(replace(mesh, face_uv=bare), np.arange(5, 60)).missing == 0


def folded(share: float, apart: float, count: int = 21) -> FitMesh:
    """A strip whose last ``share`` lies on the (u, v) of what comes before it, ``apart`` mm away on the surface."""
    uv, tri = grid(count, count)
    points = np.column_stack([60 * uv[:, 0], apart * np.clip((uv[:, 0] - 0.5) * 1e3, 0, 1), 60 * uv[:, 1]])
    where = uv.copy()
    where[:, 0] = np.where(uv[:, 0] > 1 - share, 2 * (1 - share) - uv[:, 0], uv[:, 0])
    return mesh_of(points, tri, where)


def test_a_fold_in_uv_overlaps_and_runs_the_other_way_round() -> None:
    mesh = folded(0.25, 0.0)
    for own in (mesh, replace(mesh, uv=mesh.uv * [-1, 1])):
        flipped, overlapping, flat, overlap, _, most = one(own)
        assert flipped == 200 and flat == 0 and overlap / 3600 == pytest.approx(0.5, abs=0.06)
        assert overlapping == pytest.approx(400, abs=45) and most == pytest.approx(30.0, abs=3)  # the ends of the fold


def test_what_overlaps_within_some_millimetres_of_a_heads_size_is_a_crease() -> None:
    mesh = folded(0.1, 0.0, 81)
    small = replace(mesh, vertices=mesh.vertices * 0.1)  # the fold's ends are now 1.2 mm apart
    assert one(small)[1] == 0 < one(small)[0] and one(small)[3] == 0
    assert one(small, 0.1)[1] == one(mesh)[1] > 0


def test_triangles_are_drawn_once_and_what_shares_a_pixel_is_measured() -> None:
    """The oracle is a loop over pixels with barycentric coordinates by a linear system."""
    rng = np.random.default_rng(3)
    uv, points = rng.uniform(1, 14, (8, 3, 2)), rng.normal(size=(8, 3, 3)).astype(float)
    apart = np.zeros(8)
    mark_overlaps(uv, points, np.full((16, 16, 3), np.nan, np.float32), np.full((16, 16), -1, np.int32), apart)
    wanted = np.zeros(8)
    for y in range(16):
        for x in range(16):
            first = None
            for t in range(8):
                system = np.vstack([uv[t].T, np.ones(3)])
                share = np.linalg.solve(system, [x, y, 1.0])
                if share.min() < 1e-6:
                    continue
                at = share @ points[t]
                if first is None:
                    first = t, at
                else:
                    off = np.linalg.norm(at - first[1])
                    wanted[[t, first[0]]] = np.maximum(wanted[[t, first[0]]], off)
    np.testing.assert_allclose(apart, wanted, atol=1e-5)
    assert (wanted > 0).sum() > 4
    none = np.zeros(1)
    flat = np.array([[[1.0, 1], [5, 5], [9, 9]]])
    mark_overlaps(flat, points[:1], np.full((16, 16, 3), np.nan, np.float32), np.zeros((16, 16), np.int32), none)
    assert none[0] == 0


def test_quads_are_measured_with_both_halves() -> None:
    uv, _ = grid(3, 3)
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    mesh = mesh_of(np.column_stack([60 * uv, 0 * uv[:, 0]]), quads, uv)
    assert measure_uv(mesh, np.arange(4)) == UVDefects(4)
    bent = uv.copy()
    bent[8] = [0.1, 0.1]  # a corner of the last quad lies over the first
    _, overlapping, _, _, _, most = one(replace(mesh, uv=bent))
    assert overlapping >= 2 and most > 20


def squeezed(factor: float, share: float = 0.25) -> FitMesh:
    mesh = sheet(21)
    u = mesh.uv[:, 0]
    inner = np.where(u > 1 - share, 1 - share + (u - 1 + share) / factor, u)
    return replace(mesh, uv=np.column_stack([inner, mesh.uv[:, 1]]))


def test_what_is_squeezed_much_more_than_usual_is_counted_by_area() -> None:
    for factor, share in ((4.0, 0.0), (14.0, 0.25), (60.0, 0.25)):
        mesh = squeezed(factor)
        found = measure_uv(mesh, every(mesh))
        assert found.squeezed == pytest.approx(share, abs=1e-9), factor
        assert found.faults() == (["25 % of the surface squeezed"] if share else [])
        (island,) = find_islands(mesh)
        assert squeezed_share(mesh, island) == pytest.approx(share)
    few = squeezed(60.0, 0.05)
    assert measure_uv(few, every(few)).squeezed == pytest.approx(0.05) and not measure_uv(few, every(few)).faults()


def test_stretch_is_the_longest_way_relative_to_the_usual_one() -> None:
    mesh = squeezed(3.0)
    (island,) = find_islands(mesh)
    middle = mesh.vertices[island.vertex][island.faces[:, :3]].mean(axis=1)[:, 0] / 60
    found = _stretch(mesh, island)
    assert found[middle < 0.75] == pytest.approx(1.0) and (found[middle > 0.76] > 1.5).all()
    assert found[middle > 0.76].std() < 1e-9
    assert unevenness(mesh, [island]) == pytest.approx(found.max()) and unevenness(
        sheet(), find_islands(sheet())
    ) == pytest.approx(1)
    skewed = replace(mesh, uv=mesh.uv @ np.array([[3.0, 1.0], [0.5, 0.4]]))
    np.testing.assert_allclose(_stretch(skewed, find_islands(skewed)[0]), found, rtol=1e-6)  # laying out undoes that
    hardly = replace(mesh, uv=squeezed(3.0, 0.05).uv)
    grid_line = sheet(121)
    rare = replace(grid_line, uv=grid_line.uv * np.where(grid_line.uv[:, :1] > 119.5 / 120, [[1.0, 1]], [[0.995, 1]]))
    assert unevenness(rare, find_islands(rare)) < 1.2  # a hundredth does not count
    assert unevenness(hardly, find_islands(hardly)) > 1.5


def test_a_face_without_area_in_uv_is_flat_and_counts_as_squeezed() -> None:
    mesh = sheet()
    uv = mesh.uv.copy()
    corner = np.flatnonzero((mesh.uv == 0).all(axis=1))[0]
    own = mesh.faces[(mesh.faces == corner).any(axis=1)][0, :3]
    other = own[own != corner]
    uv[corner] = uv[other].mean(axis=0)
    found = measure_uv(replace(mesh, uv=uv), every(mesh))
    assert found.flat >= 1 and found.squeezed >= found.flat / 288 - 1e-9 and np.isfinite(found.apart_mm)
    point = measure_uv(replace(mesh, uv=0 * uv), every(mesh))
    assert point.flat == 288 and point.squeezed == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("defects", "scale", "faults"),
    [
        ({"overlap": 0.001, "apart_mm": 11.0, "overlapping": 3, "flipped": 2}, 1.0, []),
        ({"overlap": 0.001, "apart_mm": 11.0, "overlapping": 3}, 0.5, ["3 faces overlapping others up to 11 mm away"]),
        ({"overlap": 0.003, "apart_mm": 3.0, "overlapping": 3, "flipped": 2}, 1.0,
         ["2 faces flipped", "3 faces overlapping others up to 3 mm away"]),
        ({"seam_mm": 19.0}, 1.0, []), ({"seam_mm": 21.0}, 1.0, ["a seam of 21 mm through the face"]),
        ({"seam_mm": 21.0}, 1.5, []), ({"squeezed": 0.05}, 1.0, []),
    ],
)  # fmt: skip
def test_faults_are_what_is_beyond_the_bounds_of_a_heads_size(defects, scale, faults) -> None:
    assert UVDefects(9, **defects).faults(scale) == faults


def cut_sheet(moved: bool = True) -> FitMesh:
    """A sheet of 60 mm that faces front, cut in (u, v) along its middle; what is inside moves."""
    uv, tri = grid(21, 21)
    points = np.column_stack([60 * uv, 0 * uv[:, 0]])
    right = uv[tri].mean(axis=1)[:, 0] > 0.5
    both = np.vstack([uv, uv + np.array([2.0, 0.0])])
    faces = np.pad(tri, ((0, 0), (0, 1)), constant_values=-1)
    face_uv = faces + np.where(right[:, None] & (faces >= 0), len(uv), 0)
    moves = np.zeros((len(uv), 3))
    if moved:
        moves[(np.abs(uv - 0.5) < 0.4).all(axis=1)] = [0, -5.0, 0]
    return mesh_of(points, faces, both, face_uv, moves)


def test_a_seam_through_the_front_that_moves_is_measured() -> None:
    mesh = cut_sheet()
    islands = find_islands(mesh)
    assert len(islands) == 2
    assert front_seams(mesh, islands, every(mesh)) == pytest.approx(45.0, abs=4.0)  # without the rims that move less
    found = measure_uv(mesh, every(mesh), face=True)
    assert found.seam_mm == front_seams(mesh, islands, every(mesh)) and found.faults()
    assert measure_uv(mesh, every(mesh)).seam_mm == 0.0
    still = cut_sheet(moved=False)
    assert front_seams(still, find_islands(still), every(still)) == 0.0
    turned = replace(mesh, vertices=mesh.vertices[:, [2, 1, 0]])  # it faces aside
    assert front_seams(turned, find_islands(turned), every(turned)) == 0.0
    one = sheet()
    assert front_seams(one, find_islands(one), every(one)) == 0.0


def test_a_small_island_within_another_is_an_opening_and_no_seam() -> None:
    mesh = cut_sheet()
    middle = mesh.vertices[mesh.faces[:, :3]].mean(axis=1)
    inner = (np.abs(middle[:, :2] - 30) < 5).all(axis=1)
    uv, tri = grid(21, 21)
    both = np.vstack([uv, uv + np.array([2.0, 0.0])])
    face_uv = np.where(mesh.faces >= 0, mesh.faces + np.where(inner[:, None], len(uv), 0), -1)
    patch = replace(mesh, uv=both, face_uv=face_uv)
    islands = find_islands(patch)
    assert len(islands) == 2 and front_seams(patch, islands, every(patch)) == 0.0
    assert len(tri) == len(mesh.faces)


def test_normals_at_vertices_are_unit_means_of_faces() -> None:
    mesh = sheet()
    found = vertex_normals(mesh, np.arange(20))
    used = np.unique(mesh.faces[:20, :3])
    np.testing.assert_allclose(found[used], np.tile([0, 0, 1.0], (len(used), 1)))
    assert np.abs(found).sum() == pytest.approx(len(used))
    roof = mesh_of([[0, 0, 0], [0, 1, 0], [1, 0, 1], [-1, 0, 1.0]], [[0, 2, 1], [0, 1, 3]], np.zeros((4, 2)))
    up = vertex_normals(roof, np.arange(2))
    np.testing.assert_allclose(up[0], [0, 0, up[0, 2]], atol=1e-12)
    assert abs(up[0, 2]) == pytest.approx(1.0)
