"""Regions of a face: shortest cuts against brute force, what is seen from outside, front and back of a head."""

from itertools import product

import numpy as np
import pytest
from bag_head import bag, mesh_of, sphere
from ball_head import grid

from surface.fit.source import regions as module
from surface.fit.source.mesh import FitMesh
from surface.fit.source.regions import (
    connected,
    directions,
    draw_depth,
    face_regions,
    in_two,
    neighbours,
    own_corners,
    shortest_cut,
)


@pytest.fixture(autouse=True)
def fewer_views(monkeypatch) -> None:
    monkeypatch.setattr(module, "VIEWS", 36)
    monkeypatch.setattr(module, "PIXELS", 160)


def every(mesh: FitMesh) -> np.ndarray:
    return np.arange(len(mesh.faces))


def sheet(rows: int = 4, columns: int = 4, jitter: float = 0.0) -> FitMesh:
    uv, tri = grid(rows, columns)
    uv = uv + np.random.default_rng(0).uniform(-jitter, jitter, uv.shape)
    return mesh_of(np.column_stack([uv * [10 * (columns - 1), 10 * (rows - 1)], 0 * uv[:, 0]]), tri)


def test_corners_that_hang_together_by_edges_are_one_point() -> None:
    mesh = sheet()
    island = own_corners(mesh, every(mesh))
    assert len(island.vertex) == 16 and (np.sort(island.vertex) == np.arange(16)).all()
    np.testing.assert_array_equal(island.vertex[island.faces[:, :3]], mesh.faces[:, :3])
    assert (island.faces[:, 3] == -1).all()


def test_a_surface_that_touches_itself_in_a_vertex_comes_apart_there() -> None:
    bow = mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0.0]], [[0, 1, 2], [0, 3, 4]])
    island = own_corners(bow, every(bow))
    assert (island.vertex == 0).sum() == 2 and len(island.vertex) == 6
    fan = mesh_of([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0.0]], [[0, 1, 2], [0, 1, 3], [1, 0, 4]])
    assert len(own_corners(fan, every(fan)).vertex) == 9  # three faces at one edge: none goes on in another
    turned = mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0.0]], [[0, 1, 2], [0, 1, 3]])
    assert len(own_corners(turned, every(turned)).vertex) == 6  # one of both looks the other way
    quads = mesh_of([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0.0]], [[0, 1, 2, 3], [1, 4, 2, -1]])
    assert len(own_corners(quads, every(quads)).vertex) == 5


@pytest.mark.parametrize("faces", [[[0, 1, 2], [1, 0, 3]], [[0, 2, 3], [1, 3, 2]]])
def test_two_faces_hang_together_by_any_edge_they_share(faces) -> None:
    """By the edge of the lowest and by that of the highest vertices, too."""
    mesh = mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5]], faces)
    island = own_corners(mesh, every(mesh))
    np.testing.assert_array_equal(island.vertex[island.faces[:, :3]], faces)
    assert len(island.vertex) == 4


def test_neighbours_share_an_edge_and_its_length_is_that_in_space() -> None:
    mesh = sheet(3, 4, 0.05)
    one, two, length = neighbours(mesh, every(mesh))
    found = {frozenset((a, b)): s for a, b, s in zip(one.tolist(), two.tolist(), length, strict=True)}
    wanted = {}
    for a, b in product(range(12), range(12)):
        common = set(mesh.faces[a, :3]) & set(mesh.faces[b, :3])
        if a < b and len(common) == 2:
            i, j = common
            wanted[frozenset((a, b))] = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j])
    assert found.keys() == wanted.keys() and all(found[k] == pytest.approx(wanted[k]) for k in wanted)


def test_groups_are_those_that_hang_together_the_largest_first() -> None:
    mesh = sheet(4, 6)
    middle = mesh.vertices[mesh.faces[:, :3]].mean(axis=1)[:, 0]
    groups = connected(mesh, np.flatnonzero((middle < 10) | (middle > 20)))
    assert [len(g) for g in groups] == [18, 6] and (middle[groups[0]] > 20).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_cut_is_the_shortest_of_all(seed: int) -> None:
    mesh = sheet(3, 4, 0.08)
    mesh = mesh_of(mesh.vertices * (0.001 if seed % 2 else 1.0), mesh.faces)  # in any unit
    rng = np.random.default_rng(seed)
    order = rng.permutation(12)
    inside, outside = np.isin(np.arange(12), order[:2]), np.isin(np.arange(12), order[2:4])
    one, two, length = neighbours(mesh, every(mesh))

    def cost(side):
        return length[side[one] != side[two]].sum()

    found = shortest_cut(mesh, every(mesh), inside, outside)
    assert found[inside].all() and not found[outside].any()
    free = np.flatnonzero(~inside & ~outside)
    best = np.inf
    for bits in product((False, True), repeat=len(free)):
        side = inside.copy()
        side[free] = bits
        best = min(best, cost(side))
    assert cost(found) == pytest.approx(best, rel=1e-3)


def test_without_one_side_all_belongs_to_the_other() -> None:
    mesh, none = sheet(), np.zeros(18, bool)
    some = np.arange(18) < 2
    assert shortest_cut(mesh, every(mesh), some, none).all()
    assert (
        not shortest_cut(mesh, every(mesh), none, some).any() and not shortest_cut(mesh, every(mesh), none, none).any()
    )


def test_a_long_region_is_cut_across_its_longest_axis_into_connected_parts() -> None:
    mesh = sheet(3, 12)
    parts = in_two(mesh, every(mesh))
    assert sorted(np.concatenate(parts).tolist()) == list(range(44)) and len(parts) == 2
    middles = sorted(mesh.vertices[mesh.faces[p, :3]].mean(axis=(0, 1))[0] for p in parts)
    assert middles[0] < 45 and middles[1] > 65 and min(map(len, parts)) >= 0.3 * 44 - 2
    two = in_two(mesh, every(mesh)[:2])
    assert [len(p) for p in two] == [1, 1]


def test_directions_are_unit_and_even() -> None:
    found = directions(96)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    assert np.abs(found.mean(axis=0)).max() < 0.02
    cosine = found @ found.T - 2 * np.eye(96)
    assert np.degrees(np.arccos(cosine.max())) > 12
    np.testing.assert_allclose(found.T @ found / 96, np.eye(3) / 3, atol=0.02)


def test_depth_is_the_largest_z_at_each_pixel() -> None:
    rng = np.random.default_rng(1)
    tri = rng.uniform(0.5, 18.5, (7, 3, 3))
    depth = np.full((20, 20), -np.inf)
    draw_depth(tri, depth)
    wanted = np.full((20, 20), -np.inf)
    for t, y, x in product(range(7), range(20), range(20)):
        share = np.linalg.solve(np.vstack([tri[t, :, :2].T, np.ones(3)]), [x, y, 1.0])
        if share.min() >= 0:
            wanted[y, x] = max(wanted[y, x], share @ tri[t, :, 2])
    np.testing.assert_allclose(depth, wanted)
    flat = np.full((4, 4), -np.inf)
    draw_depth(np.array([[[0.0, 0, 1], [1, 1, 1], [2, 2, 1]]]), flat)
    assert (flat == -np.inf).all()


def test_a_ball_hides_what_lies_in_it_and_hides_half_of_itself() -> None:
    outer, inner = sphere(), sphere(40.0, 9, 13)
    both = mesh_of(
        np.vstack([outer.vertices, inner.vertices]),
        np.vstack([outer.faces, np.where(inner.faces < 0, -1, inner.faces + len(outer.vertices))]),
    )
    own = np.arange(len(outer.faces))
    sight = module.sight(both, every(both), np.zeros(0, int))
    assert sight[own].min() > 0.95 and sight[len(own) :].max() == 0
    alone = module.sight(both, np.arange(len(own), len(both.faces)), own)
    assert alone.max() == 0  # others hide, too


def test_half_a_bowl_is_seen_from_the_directions_before_it() -> None:
    """A floor with a wall on one side is seen from a part of the directions above it only."""
    floor = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    wall = np.array([[-1.0, -60, -2], [-1, 60, -2], [-1, 0, 90.0]])
    mesh = mesh_of(np.vstack([floor, wall]), [[0, 1, 2], [3, 4, 5]])
    sight = module.sight(mesh, np.array([0]), np.array([1]))
    assert 0.4 < sight[0] < 0.9


def test_the_front_comes_first_then_the_back_then_what_lines_the_mouth() -> None:
    mesh = bag()
    outer = len(sphere().vertices)
    regions = face_regions(mesh, every(mesh), np.zeros(0, int), 1.0)
    assert sorted(np.concatenate(regions).tolist()) == list(range(len(mesh.faces)))
    front, back, lining = regions
    z = mesh.vertices[mesh.faces[:, :3]].mean(axis=1)[:, 2]
    assert z[front].mean() > 5 and z[back].max() < 15 and z[back].mean() < -35
    deep = (mesh.faces[:, :3] >= outer).all(axis=1)
    assert deep[lining].mean() > 0.75 and not deep[back].any()
    small = face_regions(mesh, every(mesh), np.zeros(0, int), 12.0)  # of a head so large, this is a nostril
    assert len(small) == 2


def test_a_mask_has_no_back_and_a_ball_has_one() -> None:
    mesh = sphere()
    z = mesh.vertices[mesh.faces[:, :3]].mean(axis=1)[:, 2]
    mask = np.flatnonzero(z > 5)
    assert not module._back(mesh, mask).any()
    back = module._back(mesh, every(mesh))
    angle = np.degrees(np.arccos(z / np.linalg.norm(mesh.vertices[mesh.faces[:, :3]].mean(axis=1), axis=1)))
    assert back[angle > 136].all()
    above = mesh.vertices[mesh.faces[:, :3]].mean(axis=1)[:, 1] > 5
    assert not back[(angle < 99) & above].any()


def test_the_middle_of_a_head_is_as_high_as_what_moves() -> None:
    mesh = sphere()
    np.testing.assert_allclose(module._middle(mesh, every(mesh)), [0, 0, 0], atol=1.0)
    moves = np.zeros_like(mesh.vertices)
    moves[np.abs(mesh.vertices[:, 1] - 30) < 8] = [0, 1, 0]
    moving = mesh_of(mesh.vertices + np.array([5, 0, 9]), mesh.faces, moves)
    np.testing.assert_allclose(module._middle(moving, every(mesh)), [5, 30, 9], atol=1.5)
    nose = np.vstack(
        [mesh.vertices, [[0, 0, 140.0], [1, 0, 140], [0, 1, 140], [0, -300, 400], [1, -300, 400], [0, -301, 400]]]
    )
    n = len(mesh.vertices)
    longer = mesh_of(nose, np.vstack([mesh.faces, [[n, n + 1, n + 2, -1], [n + 3, n + 4, n + 5, -1]]]))
    y = module._middle(longer, every(longer))
    assert y[1] == pytest.approx(0.5 * (80 - 301))
    moves = np.zeros_like(nose)
    moves[: len(mesh.vertices)][np.abs(mesh.vertices[:, 1] - 30) < 8] = [0, 1, 0]
    blinking = mesh_of(nose, longer.faces, moves)  # its depth is that of the face, not of what hangs below
    assert module._middle(blinking, every(longer))[2] == pytest.approx(0.5 * (140 - 80), abs=3)
