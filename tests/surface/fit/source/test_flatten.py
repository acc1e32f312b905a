"""Flattening of discs: flat ones keep their lengths, curved ones lie one-to-one, what is no disc is refused."""

from itertools import combinations

import numpy as np
import pytest
from ball_head import grid

from surface.fit.source import flatten as module
from surface.fit.source.flatten import crosses_itself, flatten, is_disc, rims

UV, TRI = grid(9, 9)


def areas(at: np.ndarray, tri: np.ndarray) -> np.ndarray:
    """Signed areas of triangles in the plane."""
    a, b, c = at[tri].swapaxes(0, 1)
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def lifted(at: np.ndarray, z=0.0) -> np.ndarray:
    return np.column_stack([at, np.zeros(len(at)) + z])


def with_hole(wide: float = 0.3, tall: float = 0.3):
    uv, tri = grid(13, 13)
    half = len(tri) // 2  # both triangles of a square go together
    middle = np.tile(np.abs(0.5 * (uv[tri[:half, 0]] + uv[tri[:half, 2]]) - 0.5), (2, 1))
    kept = tri[~((middle[:, 0] < wide) & (middle[:, 1] < tall))]
    used, new = np.unique(kept, return_inverse=True)
    return uv[used], new.reshape(-1, 3)


@pytest.mark.parametrize("size", [0.01, 30.0])
def test_a_flat_disc_keeps_all_its_lengths_in_its_own_unit(size: float) -> None:
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    points = size * lifted(UV * [2.0, 1.0]) @ turn.T
    at = flatten(points, TRI)
    for k in range(3):
        a, b = TRI[:, k], TRI[:, (k + 1) % 3]
        np.testing.assert_allclose(
            np.linalg.norm(at[a] - at[b], axis=1), np.linalg.norm(points[a] - points[b], axis=1), rtol=0.02
        )
    assert (areas(at, TRI) > 0).all()


def test_a_deep_bowl_is_laid_out_one_to_one_with_nearly_its_own_area() -> None:
    x, y = (UV * 2 - 1).T
    points = np.column_stack([x, y, 1.2 * (x**2 + y**2)])
    at = flatten(points, TRI)
    a, b, c = points[TRI].swapaxes(0, 1)
    true = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    ratio = areas(at, TRI) / true
    assert ratio.min() > 0.4 and ratio.max() < 2.5 and areas(at, TRI).sum() == pytest.approx(true.sum(), rel=0.15)
    assert not crosses_itself(at[rims(points, TRI)[0]])


def test_a_flat_slit_opens_and_a_wide_hole_stays_as_wide() -> None:
    uv, tri = with_hole(0.3, 0.01 + 1 / 24)
    points = lifted(uv)
    slit = np.abs(uv[:, 1] - 0.5) < 0.09
    inner = slit & (np.abs(uv[:, 0] - 0.5) < 0.3)
    points[inner, 1] = 0.5 + 0.01 * (points[inner, 1] - 0.5)  # lips that touch
    loop = rims(points, tri)[1]
    at = flatten(points, tri)
    before, after = (np.ptp(p[loop][:, :2], axis=0) for p in (points, at))
    assert after.max() > 0.75 * before.max()
    a, b = at[loop], np.roll(at[loop], -1, axis=0)
    opened = 0.5 * abs((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    p, q = points[loop], np.roll(points[loop], -1, axis=0)
    closed = 0.5 * abs((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum())
    assert opened > 5 * closed and (areas(at, tri) > 0).all()


def test_cones_fill_flat_holes_deeply_and_round_ones_not_at_all() -> None:
    for wide, tall, deep in ((0.3, 0.3, False), (0.35, 0.05, True)):
        uv, tri = with_hole(wide, tall)
        points = lifted(uv)
        holes = rims(points, tri)[1:]
        every, faces = module._filled(points, tri, holes)
        assert len(holes) == 1 and len(every) == len(points) + 1 and len(faces) == len(tri) + len(holes[0])
        width, height = np.ptp(uv[holes[0]], axis=0)
        np.testing.assert_allclose(every[-1], [0.5, 0.5, -max(0.22 * width - 0.5 * height, 0.0)], atol=1e-9)
        assert (every[-1, 2] < -0.05) == deep
        joined = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        count = np.unique(joined, axis=0, return_counts=True)[1]
        assert count.max() == 2 and (count == 1).sum() == 48  # only the outline is open
        directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        assert len(np.unique(directed, axis=0)) == len(directed)


def test_mean_value_weights_reproduce_every_flat_place() -> None:
    """Floater (2003): an inner point of a plane is the weighted mean of its neighbours."""
    rng = np.random.default_rng(1)
    at = UV + np.where(((UV > 0) & (UV < 1)).all(axis=1)[:, None], rng.uniform(-0.04, 0.04, UV.shape), 0)
    weights = module.mean_value(lifted(at), TRI)
    inner = ((UV > 0) & (UV < 1)).all(axis=1)
    np.testing.assert_allclose(np.asarray(weights.sum(axis=1)).ravel(), 1.0)
    np.testing.assert_allclose((weights @ at)[inner], at[inner], atol=1e-9)
    assert weights.data.min() > 0
    sliver = lifted(at)
    sliver[TRI[60, 0]] = sliver[TRI[60, 1]]
    assert np.isfinite(module.mean_value(sliver, TRI).data).all()


def test_the_start_is_on_a_circle_of_the_surfaces_area() -> None:
    points = 7.0 * lifted(UV)
    (rim,) = rims(points, TRI)
    start = module._on_circle(points, TRI, rim)
    radius = np.linalg.norm(start[rim], axis=1)
    np.testing.assert_allclose(radius, np.sqrt(49.0 / np.pi))
    steps = np.linalg.norm(points[rim] - points[np.roll(rim, -1)], axis=1)
    turned = np.unwrap(np.arctan2(*start[np.append(rim, rim[0])].T[::-1]))
    np.testing.assert_allclose(np.diff(turned), 2 * np.pi * steps / steps.sum(), atol=1e-9)
    assert (areas(start, TRI) > 0).all()
    corner = np.array([[0, 1, 2]])
    assert np.isfinite(module._on_circle(np.eye(3), corner, np.array([0, 1, 2]))).all()  # nothing inside


def test_slivers_get_a_form_and_all_else_stays() -> None:
    points = lifted(UV)
    points[TRI[40, 1]] = 0.5 * (points[TRI[40, 0]] + points[TRI[40, 2]])
    made = module._with_form(points, TRI)

    def height(p):
        a, b, c = p[TRI[40]]
        return np.linalg.norm(np.cross(b - a, c - a)) / np.linalg.norm(c - a)

    assert height(points) < 1e-9 and height(made) > 1e-3
    moved = np.abs(made - points).max(axis=1) > 0
    assert set(np.flatnonzero(moved)) >= set(TRI[40]) and moved.sum() < 12
    assert np.abs(made - points).max() < 0.2 * 0.125 * np.sqrt(2)
    np.testing.assert_array_equal(module._with_form(lifted(UV), TRI), lifted(UV))


@pytest.mark.parametrize("kind", ["ball", "tube", "two", "handle"])
def test_what_is_no_disc_is_refused(kind: str) -> None:
    a = np.arange(8) * np.pi / 4
    ring = np.column_stack([np.cos(a), np.sin(a), 0 * a])
    near = np.arange(8)
    if kind == "ball":
        points = np.vstack([np.eye(3), -np.eye(3)])
        tri = np.array([t for t in combinations(range(6), 3) if len({k % 3 for k in t}) == 3])
        tri = np.array([t if np.linalg.det(points[t]) > 0 else t[::-1] for t in tri])
    elif kind == "two":
        points, tri = np.vstack([lifted(UV), lifted(UV) + 5.0]), np.vstack([TRI, TRI + len(UV)])
    elif kind == "tube":
        points = np.vstack([ring, ring + np.array([0, 0, 2.0])])
        tri = np.vstack([np.column_stack([near, np.roll(near, -1), near + 8]),
                         np.column_stack([np.roll(near, -1), np.roll(near, -1) + 8, near + 8])])  # fmt: skip
        assert is_disc(16, tri, 2)  # a disc with one hole, topologically
        assert flatten(points, tri) is not None
        return
    else:
        tri = grid(7, 7)[1]
        wrapped = np.arange(49).reshape(7, 7)
        wrapped[-1], wrapped[:, -1] = wrapped[0], wrapped[:, 0]
        tri = wrapped.ravel()[tri[:-1]]  # a torus without a triangle
        used, tri = np.unique(tri, return_inverse=True)
        tri, points = tri.reshape(-1, 3), np.random.default_rng(0).normal(size=(len(used), 3))
        assert not is_disc(len(points), tri, 1)
    assert flatten(points, tri) is None


def test_rims_are_sorted_by_their_length_on_the_surface() -> None:
    uv, tri = with_hole(0.2, 0.1)
    outline, hole = rims(lifted(uv), tri)
    assert len(outline) == 48 and len(hole) < 48 and (np.abs(uv[hole] - 0.5) < 0.3).all()


def brute(line: np.ndarray) -> bool:
    """Does any edge of a closed line meet another that is not beside it?"""
    n = len(line)

    def side(p, q, r):
        return (q - p)[0] * (r - p)[1] - (q - p)[1] * (r - p)[0]

    for i, j in combinations(range(n), 2):
        if j - i in (1, n - 1):
            continue
        a, b, c, d = line[i], line[(i + 1) % n], line[j], line[(j + 1) % n]
        if side(a, b, c) * side(a, b, d) <= 0 and side(c, d, a) * side(c, d, b) <= 0:
            return True
    return False


def test_lines_that_cross_themselves_are_told_from_those_that_do_not() -> None:
    rng, told = np.random.default_rng(2), []
    for _ in range(150):
        line = rng.normal(size=(rng.integers(4, 8), 2))
        told.append(crosses_itself(line))
        assert told[-1] == brute(line)
    assert 20 < sum(told) < 140
    a = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    circle = np.column_stack([np.cos(a), np.sin(a)])
    assert not crosses_itself(circle)
    touching = np.array([[0.0, 0], [2, 0], [2, 2], [1, 0], [0, 2]])
    assert crosses_itself(touching)
    assert not crosses_itself(np.array([[0.0, 0], [1, 0], [0, 1]]))


def test_one_to_one_maps_run_anticlockwise_throughout() -> None:
    (rim,) = rims(lifted(UV), TRI)
    assert module._one_to_one(UV, TRI, rim) and not module._one_to_one(UV * [-1, 1], TRI, rim)
    folded = UV.copy()
    folded[40] += 0.3
    assert not module._one_to_one(folded, TRI, rim)
    flat = UV.copy()
    flat[:, 1] = 0.0
    assert not module._one_to_one(flat, TRI, rim)


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_weights_are_the_same_in_any_unit_and_a_thousand_times_the_usual_at_most(
    size: float,
) -> None:
    at = lifted(UV)
    np.testing.assert_allclose(module.mean_value(size * at, TRI).toarray(), module.mean_value(at, TRI).toarray())
    # a fan about the first point, one of whose neighbours is far too near: its weight is a thousand times the usual
    fan = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    for near, least in ((1e-2, 30.0), (1e-7, 300.0)):
        fan[1, 0] = near
        tri = np.array([[0, k, k % 4 + 1] for k in (1, 2, 3, 4)])
        row = module.mean_value(size * fan, tri).toarray()[0]
        assert least < row[1] / row[3] <= 1010.0
