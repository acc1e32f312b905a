"""Quad-tree meshes: watertight, cut at slits, true to trim loops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from surface import DCPSurface, Domain, Slit
from surface.mesh import tessellate as tessellation
from surface.mesh import trim
from tests.surface import shapes


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.6, 0.2, 0.08]))
@example(5562, 0.6)  # one border is a point but for some billionths
def test_a_scattered_surface_is_covered_without_cracks(seed: int, error: float) -> None:
    surface = shapes.scattered(20, seed, degrees=(2, 5))
    mesh = surface.tessellate(chord_error=error, max_depth=6, domain=Domain((0, 1, 0, 1)))
    shapes.check_manifold(mesh)
    areas = shapes.uv_areas(mesh)
    assert areas.min() > 0
    t, low, high = np.linspace(0, 1, 33), np.zeros(33), np.ones(33)
    sides = [np.stack(pair, axis=1) for pair in ((low, t), (high, t), (t, low), (t, high))]
    near = 1e-9 * np.linalg.norm(np.ptp(surface.points, axis=0))  # what is nearer than this is one point
    pole = any(np.ptp(surface.evaluate(uv), axis=0).max() < near for uv in sides)
    if pole:  # triangles without area are left out
        assert 0.8 < areas.sum() <= 1 + 1e-12
    else:
        assert np.isclose(areas.sum(), 1, rtol=1e-12)
    on_rim = ((mesh.uv == 0) | (mesh.uv == 1)).any(axis=1)
    rim = shapes.border(mesh)
    if not pole:
        assert on_rim[rim].all()
        assert len(rim) == np.count_nonzero(on_rim)  # one closed ring
    assert np.allclose(mesh.vertices, surface.evaluate(mesh.uv), rtol=0, atol=1e-12)


def test_normals_are_exact_and_agree_with_triangles() -> None:
    surface = shapes.hills()
    mesh = surface.tessellate(chord_error=0.1)
    _, su, sv = surface.derivatives(mesh.uv)
    exact = np.cross(su, sv)
    assert np.allclose(mesh.normals, exact / np.linalg.norm(exact, axis=1)[:, None], rtol=0, atol=1e-12)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert ((np.cross(b - a, c - a) * mesh.normals[mesh.triangles[:, 0]]).sum(axis=1) > 0).all()
    turned = surface.tessellate(chord_error=0.1, flip=True)
    assert np.array_equal(turned.normals, -mesh.normals)
    assert np.array_equal(turned.triangles, mesh.triangles[:, ::-1])


def test_chord_error_bounds_the_distance() -> None:
    surface = shapes.hills()
    coarse, fine = (surface.tessellate(chord_error=e) for e in (0.5, 0.05))
    assert len(fine.vertices) > 3 * len(coarse.vertices)
    for mesh, bound in ((coarse, 0.5), (fine, 0.05)):
        corner = mesh.uv[mesh.triangles]
        middle = surface.evaluate(corner.mean(axis=1))
        flat = mesh.vertices[mesh.triangles].mean(axis=1)
        normal = np.cross(*(mesh.vertices[mesh.triangles[:, k]] - mesh.vertices[mesh.triangles[:, 0]] for k in (1, 2)))
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        assert np.abs(((middle - flat) * normal).sum(axis=1)).max() < 1.5 * bound


def test_max_points_bounds_the_lists_of_leaves() -> None:
    surface = shapes.hills(35)  # 32 x 32 spans with 16 points each, 25 over two spans
    assert surface.tessellate(max_points=16, roots=(1, 1)).leaves == 32 * 32
    assert surface.tessellate(max_points=25, roots=(1, 1)).leaves == 16 * 16


def test_lists_hold_every_point_that_reaches_a_vertex() -> None:
    surface = shapes.scattered(60, 5)
    mesh = surface.tessellate(chord_error=0.05, max_depth=6, domain=Domain((0, 1, 0, 1)))
    assert np.array_equal(mesh.cell, np.repeat(np.arange(len(mesh.cell_start) - 1), np.diff(mesh.cell_start)))
    matrix = surface.basis_matrix(mesh.uv, side=mesh.side)
    for cell in range(len(mesh.cell_start) - 1):
        rows = matrix[mesh.cell_start[cell] : mesh.cell_start[cell + 1]]
        assert np.isin(np.unique(rows.indices), mesh.points_of(cell)).all()


def test_a_slit_cuts_and_nothing_straddles_it() -> None:
    surface = shapes.torn()
    slit = Slit("u", 0.5, 0.25, 0.75)
    mesh = surface.tessellate(chord_error=0.05, domain=Domain((0, 1, 0, 1), slits=[slit]), min_depth=2)
    shapes.check_manifold(mesh)
    v = mesh.uv[mesh.triangles][:, :, 1]
    assert not ((v.min(axis=1) < 0.5) & (v.max(axis=1) > 0.5)).any()
    on = slit.holds(mesh.uv)
    below, above = on & (mesh.side == 2), on & (mesh.side == 0)
    assert below.sum() == above.sum() > 0
    assert np.array_equal(np.unique(mesh.uv[below], axis=0), np.unique(mesh.uv[above], axis=0))
    assert np.allclose(mesh.vertices[below, 2], 0, atol=1e-12)
    assert np.allclose(mesh.vertices[above, 2], 10, atol=1e-12)
    for end in (0.25, 0.75):
        assert ((mesh.uv == [end, 0.5]).all(axis=1)).sum() == 1
    used_below = np.isin(mesh.triangles, np.flatnonzero(below)).any(axis=1)
    assert (v[used_below].max(axis=1) <= 0.5).all()


def test_beyond_its_ends_a_slit_is_one_surface() -> None:
    surface = shapes.hills(16)
    for _ in range(4):  # points within the slit's length end at it, the others reach across
        s = surface.supports
        within = (s[:, 0] > 0.25) & (s[:, 1] < 0.75) & (s[:, 2] < 0.5) & (s[:, 3] > 0.5)
        surface = surface.insert_knot("v", 0.5, np.flatnonzero(within)).surface
    lower = np.flatnonzero(surface.supports[:, 3] == 0.5)
    points = surface.points.copy()
    points[lower, 2] -= 5
    surface = surface.with_points(points)
    slit = Slit("u", 0.5, 0.25, 0.75)
    u = np.linspace(0, 1, 101)
    line = np.stack([u, np.full(101, 0.5)], axis=1)
    apart = np.linalg.norm(surface.evaluate(line) - surface.evaluate(line, side=np.full(101, 2)), axis=1)
    assert apart[slit.holds(line)].max() > 1
    assert apart[~slit.holds(line)].max() < 1e-12
    mesh = surface.tessellate(chord_error=0.2, domain=Domain((0, 1, 0, 1), slits=[slit]))
    beyond = (mesh.uv[:, 1] == 0.5) & ~slit.holds(mesh.uv)
    assert len(np.unique(mesh.uv[beyond], axis=0)) == beyond.sum() > 4


def test_loops_and_slits_may_reach_beyond_the_rectangle() -> None:
    surface = shapes.hills(12)
    diamond = [[0.5, -0.3], [1.3, 0.5], [0.5, 1.3], [-0.3, 0.5]]
    mesh = surface.tessellate(chord_error=0.5, domain=Domain((0, 1, 0, 1), [diamond]))
    assert shapes.uv_areas(mesh).sum() == pytest.approx(0.92, abs=1e-12)
    slit = Slit("u", 0.5, 0.25, 1.5)
    cut = surface.tessellate(chord_error=0.5, domain=Domain((0, 1, 0, 1), slits=[slit]))
    assert ((cut.uv == [1, 0.5]).all(axis=1)).sum() == 2  # the cut runs through the border


def test_loops_are_followed_within_the_error() -> None:
    surface, domain = shapes.hills(), shapes.face_like()
    for error in (0.2, 0.05):
        mesh = surface.tessellate(chord_error=error, domain=domain)
        shapes.check_manifold(mesh)
        length = np.linalg.norm(domain.segments[:, 2:] - domain.segments[:, :2], axis=1).sum()
        assert abs(shapes.uv_areas(mesh).sum() - domain.area) < length * error / 100
        rim = mesh.uv[shapes.border(mesh)]
        along = np.concatenate([rim[:, 0], rim.mean(axis=1), 0.7 * rim[:, 0] + 0.3 * rim[:, 1]])
        assert shapes.distance_to_loops(along, domain).max() * 100 < 2.5 * error


def test_trimmed_meshes_have_no_slivers() -> None:
    mesh = shapes.hills().tessellate(chord_error=0.1, domain=shapes.face_like())
    assert shapes.uv_areas(mesh).min() > 0
    angles = shapes.least_angles(mesh)
    assert angles.min() > 3
    assert np.percentile(angles, 1) > 14


def test_sharp_corners_of_loops_are_vertices() -> None:
    outline = np.array([[0.1, 0.1], [0.92, 0.1], [0.9, 0.5], [0.9, 0.9], [0.13, 0.88]])
    domain = Domain((0, 1, 0, 1), loops=[outline])
    mesh = shapes.hills().tessellate(chord_error=0.3, domain=domain)
    for tip in outline[[0, 1, 3, 4]]:  # corner 2 turns by a few degrees only
        assert (mesh.uv == tip).all(axis=1).sum() == 1
    assert np.isclose(shapes.uv_areas(mesh).sum(), domain.area, rtol=1e-3)


def test_islands_side_by_side() -> None:
    domain = Domain((0, 1, 0, 1), loops=[shapes.circle(0.25, 0.5, 0.2), shapes.circle(0.75, 0.5, 0.2)])
    mesh = shapes.hills().tessellate(chord_error=0.04, domain=domain)
    assert np.isclose(shapes.uv_areas(mesh).sum(), 2 * np.pi * 0.04, rtol=2e-3)
    u = mesh.uv[mesh.triangles][:, :, 0]
    assert not ((u.min(axis=1) < 0.5) & (u.max(axis=1) > 0.5)).any()


def test_uncovered_parts_are_left_out() -> None:
    knots = [[0, 0.2, 0.3, 0.4], [0.6, 0.7, 0.8, 1.0]]
    surface = DCPSurface([[0, 0, 0], [1, 0, 0]], [1, 1], knots, [[0, 0, 1, 1], [0, 0, 1, 1]])
    mesh = surface.tessellate(max_points=1, min_depth=5)
    assert np.isfinite(mesh.vertices).all()
    u = mesh.uv[:, 0]
    assert not ((u > 0.4) & (u < 0.6)).any()


def test_a_narrow_feature_in_a_large_flat_cell_is_found() -> None:
    surface = shapes.hills(36)
    points = surface.points * np.array([1, 1, 0])
    points[np.linalg.norm(points[:, :2] - [70, 30], axis=1).argmin(), 2] = 20
    bumped = surface.with_points(points)
    mesh = bumped.tessellate(chord_error=0.05, roots=(1, 1))
    top = bumped.evaluate(np.random.default_rng(0).uniform([0.6, 0.2], [0.8, 0.4], (4000, 2)))[:, 2].max()
    assert mesh.vertices[:, 2].max() > 0.98 * top > 5
    assert len(mesh.vertices) < 2000


def test_the_rim_of_what_is_covered_is_followed() -> None:
    surface = shapes.hills(12)
    mesh = surface.tessellate(chord_error=1.0, domain=Domain((-0.07, 1.3, -0.2, 1.11)))
    assert shapes.uv_areas(mesh).sum() > 0.9


@pytest.mark.parametrize(
    ("limits", "name"),
    [
        ({"max_points": 0}, "max_points"),
        ({"chord_error": -1.0}, "chord_error"),
        ({"max_depth": 21}, "max_depth"),
        ({"min_depth": 5, "max_depth": 3}, "min_depth"),
        ({"max_points": 1, "max_depth": 20}, "max_depth"),
        ({"loop_error": 0.0}, "loop_error"),
        ({"roots": (0, 1)}, "roots"),
        ({"roots": (1.5, 1)}, "roots"),
        ({"roots": (10**9, 1)}, "roots"),
    ],
)
def test_limits_out_of_range_are_named(limits: dict, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        shapes.hills(8).tessellate(**limits)


def test_without_limits_chords_are_within_a_thousandth_of_the_size() -> None:
    surface = shapes.hills()
    size = np.linalg.norm(np.ptp(surface.points, axis=0))
    mesh, same = surface.tessellate(), surface.tessellate(chord_error=1e-3 * size)
    assert np.array_equal(mesh.vertices, same.vertices)
    assert len(mesh.vertices) != len(surface.tessellate(chord_error=2e-3 * size).vertices)


def test_the_loop_error_counts_before_the_chord_error() -> None:
    surface, domain = shapes.hills(), Domain((0, 1, 0, 1), loops=[shapes.circle(0.5, 0.5, 0.3)])
    coarse = surface.tessellate(chord_error=5.0, domain=domain)
    fine = surface.tessellate(chord_error=5.0, loop_error=0.1, domain=domain)
    assert len(shapes.border(fine)) > 2 * len(shapes.border(coarse))
    by_points = [surface.tessellate(max_points=50, max_depth=7, domain=domain, loop_error=e) for e in (None, 0.001)]
    assert len(shapes.border(by_points[1])) > len(shapes.border(by_points[0]))


def test_roots_and_depths_give_a_regular_mesh() -> None:
    mesh = shapes.hills().tessellate(roots=(3, 5), min_depth=1, max_depth=1)
    assert mesh.leaves == 4 * 15
    assert len(mesh.vertices) == 7 * 11
    assert np.allclose(np.unique(mesh.uv[:, 0]), np.arange(7) / 6)
    assert np.allclose(np.unique(mesh.uv[:, 1]), np.arange(11) / 10)


def test_a_ring_has_three_cells_or_more() -> None:
    ring = shapes.torus()
    narrow = ring.with_points(ring.points * [1, 1, 0.01])
    mesh = narrow.tessellate(chord_error=1e9)
    for axis in range(2):
        assert len(np.unique(mesh.uv[:, axis])) >= 3
    shapes.check_manifold(mesh)
    assert (shapes.edge_uses(mesh.triangles)[1] == 2).all()


def test_a_flipped_mesh_is_reversed() -> None:
    surface = shapes.hills()
    mesh, flipped = surface.tessellate(chord_error=1.0), surface.tessellate(chord_error=1.0, flip=True)
    assert np.array_equal(flipped.vertices, mesh.vertices)
    assert np.array_equal(flipped.normals, -mesh.normals)
    assert np.array_equal(flipped.triangles, mesh.triangles[:, ::-1])
    assert (mesh.flip, flipped.flip) == (False, True)


def plane(slope_u: float = 3.0, slope_v: float = 5.0) -> DCPSurface:
    """A flat sheet over the unit square, stretched by two factors."""
    net = np.array([[[0.0, 0, 0], [0, slope_v, 0]], [[slope_u, 0, 0], [slope_u, slope_v, 0]]])
    return DCPSurface.from_nurbs(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], net)


def test_lengths_per_unit_are_means_over_what_is_drawn() -> None:
    """x = u^2 and y = 4 v^2: the mean slopes over an interval are the sum of its ends, and four times that."""
    net = np.array([[[x, y, 0.0] for y in (0.0, 0.0, 4.0)] for x in (0.0, 0.0, 1.0)])
    surface = DCPSurface.from_nurbs(2, 2, [0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1], net)
    assert tessellation._mean_scale(surface, Domain((0.2, 0.7, 0.5, 0.9))) == pytest.approx((0.9, 5.6))
    loop = [[0.0, 0.0], [0.5, 0.0], [0.5, 0.25], [0.0, 0.25]]
    assert tessellation._mean_scale(surface, Domain((0, 1, 0, 1), [loop])) == pytest.approx((0.5, 1.0))
    assert tessellation._mean_scale(surface, Domain((2, 3, 2, 3))) == (1.0, 1.0)  # nothing is covered
    flat = surface.with_points(surface.points * [1, 0, 0])
    assert tessellation._mean_scale(flat, Domain((0, 1, 0, 1))) == pytest.approx((1.0, 1e-6), rel=1e-9)
    flat = surface.with_points(surface.points * [0, 1, 0])
    assert tessellation._mean_scale(flat, Domain((0, 1, 0, 1))) == pytest.approx((4e-6, 4.0), rel=1e-9)


@pytest.mark.parametrize(
    ("rect", "scale", "joined", "shape"),
    [
        ((1, 3, 2, 3), (10.0, 5.0), (False, False), (4, 1)),  # squares as wide as the shorter side
        ((2, 3, 1, 3), (5.0, 10.0), (False, False), (1, 4)),
        ((1, 3, 2, 3), (100.0, 1.0), (False, False), (24, 1)),  # but 24 along the longer at most
        ((0, 1, 0, 1), (1.0, 10.0), (True, False), (3, 10)),  # a ring needs three
        ((0, 1, 0, 1), (10.0, 1.0), (False, True), (10, 3)),
        ((5, 6, 5, 6), (1.0, 1.0), (True, True), (3, 3)),
        ((5, 6, 5, 6), (1.0, 12.0), (False, True), (1, 12)),
    ],
)
def test_roots_are_roughly_square_on_the_surface(
    rect: tuple[float, float, float, float], scale: tuple[float, float], joined: tuple[bool, bool],
    shape: tuple[int, int],
) -> None:  # fmt: skip
    lattice = tessellation._lattice(Domain(rect), scale, 5, None, joined)
    assert lattice.shape == shape and lattice.joined == joined and lattice.depth == 5
    np.testing.assert_allclose(lattice.lines_u, np.linspace(*rect[:2], shape[0] + 1))
    np.testing.assert_allclose(lattice.lines_v, np.linspace(*rect[2:], shape[1] + 1))


def test_roots_are_bordered_by_slits_and_hardly_larger_than_the_narrowest_part_between_them() -> None:
    rect = (1.0, 3.0, 2.0, 3.0)
    across = tessellation._lattice(Domain(rect, slits=[Slit("u", 2.25, 1.5, 2.0)]), (10.0, 10.0), 3, None, (False,) * 2)
    # parts of 2.5 along v, so cells of about 3: 5, 5 and 10 wide, 2.5 and 7.5 high
    np.testing.assert_allclose(across.lines_u, [1, 1.25, 1.5, 1.75, 2, 7 / 3, 8 / 3, 3])
    np.testing.assert_allclose(across.lines_v, [2, 2.25, 2.625, 3])
    along = tessellation._lattice(Domain(rect, slits=[Slit("v", 1.25, 2.5, 9.0)]), (10.0, 10.0), 3, None, (False,) * 2)
    np.testing.assert_allclose(along.lines_u, [1, 1.25, *np.linspace(1.25, 3, 7)[1:]])
    np.testing.assert_allclose(along.lines_v, [2, 2.25, 2.5, 2.75, 3])
    given = tessellation._lattice(
        Domain(rect, slits=[Slit("v", 1.25, 2.5, 9.0)]), (10.0, 10.0), 3, (4, 2), (False,) * 2
    )
    np.testing.assert_allclose(given.lines_u, [1, 1.25, *np.linspace(1.25, 3, 5)[1:]])
    np.testing.assert_allclose(given.lines_v, [2, 2.5, 3])


def test_progress_rises_from_stage_to_stage_up_to_the_end() -> None:
    loops = [shapes.circle(0.5, 0.5, 0.3)]
    for domain, stages in (
        (Domain((0, 1, 0, 1)), ["quad tree", "triangles", "vertices", "cells"]),
        (Domain((0, 1, 0, 1), loops), ["quad tree", "triangles", "trimming", "vertices", "cells"]),
    ):
        said: list[tuple[str, float]] = []
        shapes.hills().tessellate(chord_error=1.0, domain=domain, progress=lambda *args, to=said: to.append(args))
        assert list(dict.fromkeys(stage for stage, _ in said)) == stages
        shares = [share for _, share in said]
        assert shares == sorted(shares) and 0 < shares[0] < 0.05 and shares[-1] == 1.0
        assert min(np.diff(sorted({max(s for stage, s in said if stage == name) for name in stages}))) > 0.02


def test_vertices_are_evaluated_in_parts_of_131072(monkeypatch: pytest.MonkeyPatch) -> None:
    assert tessellation.CHUNK_VERTICES == 131072
    whole = shapes.hills().tessellate(chord_error=0.3)
    monkeypatch.setattr(tessellation, "CHUNK_VERTICES", 100)
    said: list[tuple[str, float]] = []
    parts = shapes.hills().tessellate(chord_error=0.3, progress=lambda *args: said.append(args))
    np.testing.assert_array_equal(parts.vertices, whole.vertices)
    np.testing.assert_array_equal(parts.triangles, whole.triangles)
    shares = [share for stage, share in said if stage == "vertices"]
    assert len(shares) == -(-len(whole.vertices) // 100)
    np.testing.assert_allclose(np.diff(shares), shares[1] - shares[0], atol=1e-12)


def test_leaves_are_numbered_root_by_root_in_morton_order() -> None:
    surface = plane()
    domain, depth = Domain((0, 1, 0, 1)), 3
    lattice = tessellation._lattice(domain, (1.0, 1.0), depth, (3, 2), (False, False))
    leaves, inner = tessellation.quadtree.grow(lattice, lambda level, cells: np.full(len(cells), level < 2))
    corners, owner = tessellation.quadtree.triangulate(lattice, leaves, inner)
    nodes, _, triangles = tessellation.keys.unique(corners)
    flat = trim.Flat(lattice.uv(*lattice.point(nodes)), triangles, owner)
    code = tessellation._vertex_codes(flat, lattice, leaves)

    def number(u: float, v: float) -> int:
        i, j = int(u * 12 + 1e-9), int(v * 8 + 1e-9)  # leaves are quarters of roots; depth 3 is one level below
        inner_i, inner_j = i % 4, j % 4
        morton = sum((inner_i >> bit & 1) << (2 * bit) | (inner_j >> bit & 1) << (2 * bit + 1) for bit in range(2))
        return (((j // 4) * 3 + i // 4) << (2 * depth)) | (morton << 2)

    for place, found in zip(flat.uv, code, strict=True):
        around = [number(u, v) for u in place[0] + [-0.01, 0.01] for v in place[1] + [-0.01, 0.01]
                  if 0 < u < 1 and 0 < v < 1]  # fmt: skip
        assert found in around
    assert surface.tessellate(roots=(3, 2), min_depth=2, max_depth=2).leaves == 96
    unused = trim.Flat(np.vstack([flat.uv, [9.0, 9.0]]), flat.triangles, flat.owner)
    code = tessellation._vertex_codes(unused, lattice, leaves)
    assert code[-1] == np.iinfo(np.int64).max
    order = tessellation._sort_used(unused, code)
    assert len(order) == len(flat.uv) and (np.diff(code[order]) >= 0).all()


def test_normals_where_the_slopes_are_parallel_are_the_mean_of_the_triangles_by_area() -> None:
    points = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 1], [5.0, 5, 5]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    su, sv = np.tile([1.0, 0, 0], (5, 1)), np.tile([0.0, 1, 0], (5, 1))
    sv[[0, 4]] = su[[0, 4]]  # no direction of their own
    normals = tessellation.unit_normals(points, su, sv, triangles)
    np.testing.assert_allclose(normals[0], np.array([3.0, 0, 6]) / np.sqrt(45))
    np.testing.assert_allclose(normals[1:4], [[0, 0, 1]] * 3)
    np.testing.assert_array_equal(normals[4], 0.0)  # no triangle either


def test_a_point_without_size_and_an_empty_domain_are_drawn() -> None:
    surface = plane(0.0, 0.0)
    assert len(surface.tessellate().vertices) >= 4
    nothing = plane().tessellate(domain=Domain((0, 1, 0, 1), [shapes.circle(5.0, 5.0, 0.1)]))
    assert nothing.vertices.shape == (0, 3) and nothing.cell_start.tolist() == [0]


def test_a_surface_closed_both_ways_has_one_vertex_where_its_seams_meet() -> None:
    mesh = shapes.torus().tessellate(chord_error=1.0)
    assert (shapes.edge_uses(mesh.triangles)[1] == 2).all()
    assert len(mesh.vertices) - len(np.unique(np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1),
                                              axis=0)) + len(mesh.triangles) == 0  # Euler: a torus  # fmt: skip
    assert mesh.uv.min() == 0.0 and mesh.uv.max() < 1.0
    cut = shapes.torus().tessellate(chord_error=1.0, domain=Domain((0, 1, 0, 1), slits=[Slit("v", 0.5, 0.2, 0.6)]))
    used = shapes.edge_uses(cut.triangles)[1]
    assert np.count_nonzero(used == 1) > 2 and used.max() == 2
    rim = cut.uv[shapes.border(cut)].reshape(-1, 2)
    assert (rim[:, 0] == 0.5).all() and rim[:, 1].min() == 0.2 and rim[:, 1].max() == 0.6


def test_a_slit_through_a_seam_stays_open_there() -> None:
    """One that runs along u over the seam at u = 0 and 1: each of its sides is joined to itself."""
    torus = shapes.torus()
    slits = [Slit("u", 0.5, -0.5, 0.25), Slit("u", 0.5, 0.75, 1.5)]
    mesh = torus.tessellate(chord_error=1.0, domain=Domain((0, 1, 0, 1), slits=slits))
    shapes.check_manifold(mesh)
    at_seam = (mesh.uv == [0.0, 0.5]).all(axis=1)
    assert at_seam.sum() == 2 and sorted(mesh.side[at_seam].tolist()) == [0, 2]
    assert not (mesh.uv[:, 0] == 1.0).any()
    rim = mesh.uv[shapes.border(mesh)].reshape(-1, 2)
    assert (rim[:, 1] == 0.5).all()


@pytest.mark.parametrize(("off", "third", "kept"), [
    (0.0, 1.0, [1]), (0.0, 1.5e-9, [1]), (1.0, 1.0, [0, 1]), (0.0, 0.0, [0, 1]), (0.0, "near", [0, 1]),
    ("near", 1.0, [1]), ("farther", 1.0, [0, 1]),
])  # fmt: skip
@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_a_border_is_a_pole_where_its_points_lie_within_a_thousand_millionth_of_the_size(
    number: int, off: float | str, third: float | str, kept: list[int]
) -> None:
    """One triangle with two corners on the border, one with a single one; the first goes where only it lies beyond."""
    axis, at_end = divmod(number, 2)
    net = np.array([[[0.0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 0]]])
    ends = [slice(None), slice(None)]
    ends[axis] = slice(1 - at_end, 2 - at_end)  # type: ignore[call-overload]
    net[tuple(ends)] = [1.0, 0.0, 0.0]
    surface = DCPSurface.from_nurbs(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], net)
    near = 1e-9 * tessellation.diagonal_of(surface)
    distances = {"near": near, "farther": 1.5 * near}
    uv = np.array([[0.0, 0.0], [0.0, 0.5], [0.5, 0.5], [0.5, 0.7]])
    uv = uv if axis == 0 else uv[:, ::-1].copy()
    uv[:, axis] = 1.0 - uv[:, axis] if at_end else uv[:, axis]
    points = np.zeros((4, 3))
    points[1, 0] = distances.get(off, off)  # type: ignore[arg-type]
    points[2, 1] = points[3, 1] = distances.get(third, third)  # type: ignore[arg-type]
    flat = trim.Flat(uv, np.array([[0, 1, 2], [1, 2, 3]]), np.array([5, 6]))
    found = tessellation._drop_poles(surface, flat, points, Domain((0, 1, 0, 1)))
    assert found.triangles.tolist() == flat.triangles[kept].tolist() and found.owner.tolist() == [5 + k for k in kept]
