"""A mesh's chord error is a bound: surfaces sampled densely by scipy are nowhere further from the mesh (by trimesh)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from surface import DCPSurface, Mesh
from surface.mesh import chords, quadtree
from tests.surface import shapes

trimesh = pytest.importorskip("trimesh", reason="trimesh measures distances from the mesh: pip install omote[fit]")
FURTHEST = 60  # samples that are compared with all triangles
Net = tuple[tuple[int, int], list[np.ndarray], np.ndarray, np.ndarray]


def net(seed: int, bend: float, degrees: tuple[int, int] | None = None) -> Net:
    """Degrees, knot vectors, control points and weights of a bent sheet that no two directions of agree in."""
    rng, counts = np.random.default_rng(seed), (9, 7)
    degrees = degrees or ((2, 3), (3, 3), (4, 2), (3, 5))[seed % 4]
    knots = [
        np.concatenate([[0.0] * (p + 1), np.sort(rng.uniform(0.1, 0.9, n - p - 1)), [1.0] * (p + 1)])
        for p, n in zip(degrees, counts, strict=True)
    ]
    x, y = np.meshgrid(np.linspace(0, 2, counts[0]), np.linspace(0, 1, counts[1]), indexing="ij")
    z = bend * rng.normal(size=counts) + 0.4 * x * y
    return degrees, knots, np.stack([x, y, z], axis=-1), np.exp(rng.normal(0, 0.4, counts))


def oracle(given: Net, at: np.ndarray) -> np.ndarray:
    """The surface at ``at (m, 2)`` by scipy."""
    degrees, knots, points, weights = given
    rows = [BSpline.design_matrix(x, t, p).toarray() for x, t, p in zip(at.T, knots, degrees, strict=True)]
    sums = np.einsum("mi,mj,ijc->mc", *rows, np.dstack([points * weights[..., None], weights]), optimize=True)
    return sums[:, :3] / sums[:, 3:]


def distances(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Distances of points from the nearest of the twelve triangles around, and, where those are furthest, of all."""
    corners = mesh.vertices[mesh.triangles]
    _, near = cKDTree(corners.mean(axis=1)).query(points, k=12)
    feet = trimesh.triangles.closest_point(corners[near.ravel()], np.repeat(points, 12, axis=0))
    found = np.linalg.norm(feet.reshape(len(points), 12, 3) - points[:, None], axis=2).min(axis=1)
    for k in np.argsort(found)[-FURTHEST:]:
        feet = trimesh.triangles.closest_point(corners, np.repeat(points[k : k + 1], len(corners), axis=0))
        found[k] = np.linalg.norm(feet - points[k], axis=1).min()
    return found


@pytest.mark.parametrize("seed", range(4))
def test_no_sample_of_a_surface_is_further_away_than_the_chord_error(seed: int) -> None:
    given = net(seed, 0.15)
    surface = DCPSurface.from_nurbs(*given[0], *given[1], *given[2:])
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 61)] * 2), axis=-1).reshape(-1, 2)
    dense = oracle(given, np.clip(grid + np.random.default_rng(seed).uniform(-0.008, 0.008, grid.shape), 0, 1))
    mesh, estimated = (surface.tessellate(chord_error=0.01, measured=on) for on in (True, False))
    worst = distances(mesh, dense).max()
    assert 0.003 < worst <= 0.01
    assert len(mesh.vertices) > len(estimated.vertices)
    assert worst < distances(estimated, dense).max() < 0.025


@pytest.mark.parametrize(("seed", "degrees"), [(1, (1, 3)), (7, (2, 1)), (5, (3, 1))])
def test_the_chord_error_holds_between_the_samples_at_creases(seed: int, degrees: tuple[int, int]) -> None:
    given = net(seed, 0.15, degrees)
    surface = DCPSurface.from_nurbs(*given[0], *given[1], *given[2:])
    line = np.linspace(0, 1, 61)
    lines = [np.unique(np.concatenate([line, t])) if p == 1 else line for p, t in zip(degrees, given[1], strict=True)]
    dense = oracle(given, np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2))
    assert 0.003 < distances(surface.tessellate(chord_error=0.01, max_depth=12), dense).max() <= 0.01


def test_samples_lie_in_steps_of_a_quarter() -> None:
    uv = chords.sample_places(np.array([[0.0, 4.0, 10.0, 14.0], [1.0, 2.0, 0.0, 8.0]]))
    lattice = {(a, b) for a in range(5) for b in range(5)}
    assert uv.shape == (2, 25, 2)
    assert {tuple(p) for p in uv[0]} == {(a, 10.0 + b) for a, b in lattice}
    assert {tuple(p) for p in uv[1]} == {(1 + a / 4, 2.0 * b) for a, b in lattice}


def test_creases_are_knots_as_many_as_the_degree_and_samples_lie_on_them() -> None:
    knots = [0, 0, 0, 0, 0.2, 0.45, 0.45, 0.45, 0.8, 0.8, 1, 1, 1, 1]
    surface = DCPSurface.from_nurbs(3, 1, knots, [0, 0, 0.3, 1, 1], np.random.default_rng(0).normal(size=(10, 3, 3)))
    creases = chords.crease_lines(surface)
    assert [lines.tolist() for lines in creases] == [[0.45], [0.3]]
    (uv,) = chords.sample_places(np.array([[0.0, 1.0, 0.0, 0.5]]), creases)
    assert len(uv) == 49 and set(uv[25:, 0]) == {0.0, 0.25, 0.45, 0.5, 0.75, 1.0}
    assert {tuple(p) for p in uv} >= {(0.45, 0.3), (0.45, 0.5), (0.25, 0.3)}
    assert np.array_equal(uv[:25], chords.sample_places(np.array([[0.0, 1.0, 0.0, 0.5]]))[0])


def test_distances_from_triangles_are_those_of_trimesh() -> None:
    rng = np.random.default_rng(0)
    corners, points = rng.normal(size=(400, 3, 3)), rng.normal(size=(400, 3))
    corners[:20, 2] = corners[:20, 0]  # no area
    corners[20:40, 1] = corners[20:40, 2] = corners[20:40, 0]
    feet = trimesh.triangles.closest_point(corners[40:], points[40:])
    found = [chords.triangle_square(p, *t) for p, t in zip(points, corners, strict=True)]
    assert np.allclose(found[40:], ((feet - points[40:]) ** 2).sum(axis=1), rtol=1e-9, atol=1e-12)
    assert np.allclose(found[20:40], ((corners[20:40, 0] - points[20:40]) ** 2).sum(axis=1), rtol=1e-9)
    t = np.linspace(0, 1, 2001)[:, None]
    for square, p, (a, b, _) in zip(found[:20], points[:20], corners[:20], strict=True):
        assert np.sqrt(square) == pytest.approx(np.linalg.norm(a + t * (b - a) - p, axis=1).min(), abs=2e-3)


@pytest.mark.parametrize("pattern", range(17))
def test_a_leaf_is_compared_with_the_triangles_it_is_drawn_with(pattern: int) -> None:
    """On a plane that is bent where the triangles of a pattern meet only other triangles are off."""
    saddle = DCPSurface.from_nurbs(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], [[[0, 0, 0], [0, 1, 1]], [[1, 0, 1], [1, 1, 0]]])
    uv = chords.sample_places(np.array([[0.0, 1.0, 0.0, 1.0]]))
    found = chords.measure_errors(saddle, uv, np.zeros((1, 25), np.int64), np.array([pattern]))[0]
    nodes = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]])
    corners = [saddle.evaluate(nodes[t]) for t in quadtree.TEMPLATES[pattern] if t[0] >= 0]
    each = [
        [np.linalg.norm(trimesh.triangles.closest_point(t[None], p[None]) - p) for t in corners]
        for p in saddle.evaluate(uv[0])
    ]
    assert found == pytest.approx(chords.MARGIN * np.min(each, axis=1).max(), rel=1e-9)


def test_a_tree_without_more_levels_ends() -> None:
    surface = shapes.hills(8)
    mesh = surface.tessellate(chord_error=1e-6, roots=(2, 2), max_depth=2)
    assert mesh.leaves == 64
