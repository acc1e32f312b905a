"""Samples evaluated in runs equal those evaluated one by one, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.interpolate import BSpline

from surface import DCPSurface
from surface.spline import kernels
from surface.spline.kernels import RUN


@pytest.mark.parametrize("order", ["rows", "random"])
@pytest.mark.parametrize("seed", range(3))
def test_runs_equal_single_samples(seed: int, order: str) -> None:
    surface = shapes.scattered(60, seed)
    u, v = np.meshgrid(np.linspace(-0.6, 1.7, 23), np.linspace(-0.6, 1.7, 29), indexing="ij")
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    if order == "random":
        uv = np.random.default_rng(seed).permutation(uv)
    assert len(uv) > 2 * RUN
    side = np.random.default_rng(seed).integers(0, 4, len(uv))
    taken, out = surface.sample_derivatives(uv, side, second=True)
    points = surface.sample(uv, side)[2]
    for k in range(0, len(uv), 7):
        alone, single = surface.sample_derivatives(uv[k : k + 1], side[k : k + 1], second=True)
        assert alone[0] == taken[k]
        assert np.array_equal(single[0], out[k], equal_nan=True)
        assert np.array_equal(surface.sample(uv[k : k + 1], side[k : k + 1])[2][0], points[k], equal_nan=True)
    assert (taken < 0).any()
    assert (taken >= 0).any()


def test_a_fine_run_on_a_net_is_the_same_as_single_samples() -> None:
    surface = shapes.hills(12)
    u, v = np.meshgrid(np.linspace(0, 1, 33), np.linspace(0, 1, 33), indexing="ij")
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    together = surface.evaluate(uv)
    alone = np.concatenate([surface.evaluate(row[None]) for row in uv])
    assert np.array_equal(together, alone)


def test_slopes_of_rational_surfaces_are_those_of_differences() -> None:
    """Third-degree net with uneven weights, against central differences of evaluated places."""
    n, random = 7, np.random.default_rng(4)
    knots = np.concatenate([[0] * 4, np.linspace(0, 1, n - 2)[1:-1], [1] * 4])
    surface = DCPSurface.from_nurbs(
        3, 3, knots, knots, random.uniform(-10, 10, (n, n, 3)), random.uniform(0.3, 3.0, (n, n))
    )
    uv, h = random.uniform(0.05, 0.95, (40, 2)), 1e-5
    uv = uv[np.abs(uv[:, :, None] - knots).min(axis=(1, 2)) > 3 * h]
    _, su, sv = surface.derivatives(uv)
    suu, suv, svv = surface.second_derivatives(uv)
    for step, first, seconds in (([h, 0.0], su, (suu, suv)), ([0.0, h], sv, (suv, svv))):
        difference = (surface.evaluate(uv + step) - surface.evaluate(uv - step)) / (2 * h)
        np.testing.assert_allclose(difference, first, rtol=1e-4, atol=1e-3)
        ahead, behind = surface.derivatives(uv + step)[1:], surface.derivatives(uv - step)[1:]
        for second, a, b in zip(seconds, ahead, behind, strict=True):
            np.testing.assert_allclose((a - b) / (2 * h), second, rtol=1e-3, atol=5e-2)


def uneven(seed: int, n: int = 40, degrees: tuple[int, int] = (0, 6)) -> DCPSurface:
    """Random points over u in 0..1 and v in 500..540, so that nothing of one direction fits the other; some places
    are covered by nothing."""
    rng = np.random.default_rng(seed)
    knots: list[list[np.ndarray]] = [[], []]
    for side, (low, size) in zip(knots, ((0.0, 1.0), (500.0, 40.0)), strict=True):
        for _ in range(n):
            count = int(rng.integers(degrees[0], degrees[1] + 1)) + 2
            ends = np.sort(rng.choice(np.linspace(0, 1, 11), 2, replace=False))
            inner = rng.choice(np.linspace(*ends, 5), count - 2)
            side.append(low + size * np.sort(np.concatenate([ends, inner])))
    return DCPSurface(rng.normal(size=(n, 3)), rng.uniform(0.3, 3, n), *knots)


def blending(knots: np.ndarray, x: float, left: bool) -> np.ndarray:
    """Value, slope and second derivative of scipy's basis function, the limit from the right or from the left."""
    if left:  # a mirrored function has the same values from the other side
        return blending(-knots[::-1], -x, False) * [1.0, -1.0, 1.0]
    if not knots[0] <= x < knots[-1]:
        return np.zeros(3)
    element = BSpline.basis_element(knots, extrapolate=True)
    return np.array([element(x, k) if k <= len(knots) - 2 else 0.0 for k in range(3)])


def wanted(surface: DCPSurface, uv: np.ndarray, side: int) -> tuple[int, np.ndarray]:
    """The limit that is taken and (6, 3): S, S_u, S_v, S_uu, S_uv, S_vv, from scipy's splines by A = W S."""
    for limit in (side, side | 1, side | 2, side | 3):
        a, w = np.zeros((3, 3, 3)), np.zeros((3, 3))
        for i in range(surface.n):
            bu = blending(surface.knots_u[i], uv[0], bool(limit & 1))
            bv = blending(surface.knots_v[i], uv[1], bool(limit & 2))
            w += surface.weights[i] * np.outer(bu, bv)
            a += surface.weights[i] * np.outer(bu, bv)[:, :, None] * surface.points[i]
        if w[0, 0] > 1e-12:
            break
    else:
        return -1, np.full((6, 3), np.nan)
    s = a[0, 0] / w[0, 0]
    su, sv = (a[1, 0] - w[1, 0] * s) / w[0, 0], (a[0, 1] - w[0, 1] * s) / w[0, 0]
    suu = (a[2, 0] - w[2, 0] * s - 2 * w[1, 0] * su) / w[0, 0]
    svv = (a[0, 2] - w[0, 2] * s - 2 * w[0, 1] * sv) / w[0, 0]
    suv = (a[1, 1] - w[1, 1] * s - w[1, 0] * sv - w[0, 1] * su) / w[0, 0]
    return limit, np.stack([s, su, sv, suu, suv, svv])


def places(seed: int, count: int) -> np.ndarray:
    """Samples in, on the borders of, and beyond the subdomains of :func:`uneven`, many with the same coordinates."""
    rng = np.random.default_rng(seed)
    steps = np.concatenate([np.linspace(0, 1, 11), rng.uniform(-0.05, 1.05, 9)])
    return np.column_stack([rng.choice(steps, count), 500 + 40 * rng.choice(steps, count)])


@pytest.mark.parametrize("seed", range(3))
def test_samples_are_quotients_of_sums_of_scipys_splines(seed: int) -> None:
    surface, uv = uneven(seed), places(seed, 60)
    side = np.random.default_rng(seed).integers(0, 4, len(uv))
    expected = [wanted(surface, place, int(limit)) for place, limit in zip(uv, side, strict=True)]
    values = np.stack([value for _, value in expected])
    scale = np.nanmax(np.abs(values), axis=(0, 2))
    for part in (range(60), *([k] for k in range(0, 60, 4))):  # together and alone
        at = list(part)
        limits, six = surface.sample_derivatives(uv[at], side[at], second=True)
        assert limits.tolist() == [expected[k][0] for k in at]
        three, one = surface.sample_derivatives(uv[at], side[at])[1], surface.sample(uv[at], side[at])[2]
        for k in range(6):
            np.testing.assert_allclose(six[:, k], values[at, k], rtol=1e-9, atol=1e-11 * scale[k])
        np.testing.assert_allclose(three, values[at, :3], rtol=1e-9, atol=1e-11 * scale[:3].max())
        np.testing.assert_allclose(one, values[at, 0], rtol=1e-9, atol=1e-11)
    assert {-1, 0, 1, 2, 3} == {limit for limit, _ in expected}


@pytest.mark.parametrize("seed", range(3))
def test_rows_hold_the_products_of_all_points_that_reach_a_sample_and_no_others(seed: int) -> None:
    surface, uv = uneven(seed, degrees=(1, 5)), places(seed + 10, 50)
    side = np.array([wanted(surface, place, 0)[0] for place in uv])
    arrays, bins = surface.arrays(), surface.bin_arrays()
    most = kernels.row_capacity(*bins[:3], uv)
    data, columns, start = np.full((most, 3), 9.0), np.full(most, -1, np.int32), np.zeros(len(uv) + 1, np.int64)
    used = kernels.fill_rows(*arrays[:4], arrays[5], *bins, uv, side, data, columns, start)
    assert used == start[-1] and most >= used
    s = surface.supports
    for k, place in enumerate(uv):
        inside = (s[:, 0].min() <= place[0] <= s[:, 1].max()) and (s[:, 2].min() <= place[1] <= s[:, 3].max())
        assert inside or start[k] == start[k + 1]
        dense, listed = np.zeros((surface.n, 3)), columns[start[k] : start[k + 1]]
        assert len(set(listed.tolist())) == len(listed)
        dense[listed] = data[start[k] : start[k + 1]]
        expected = np.zeros((surface.n, 3))
        for i in range(surface.n) if side[k] >= 0 else ():
            bu = blending(surface.knots_u[i], place[0], bool(side[k] & 1))
            bv = blending(surface.knots_v[i], place[1], bool(side[k] & 2))
            expected[i] = surface.weights[i] * np.array([bu[0] * bv[0], bu[1] * bv[0], bu[0] * bv[1]])
            met = (bu[0] != 0 or bu[1] != 0) and (bv[0] != 0 or bv[1] != 0)
            assert met or i not in listed
        np.testing.assert_allclose(dense, expected, rtol=1e-9, atol=1e-11)


def test_bins_are_found_from_the_low_corner_to_the_high_one_and_not_beyond() -> None:
    grid, shape = np.array([1.0, 10.0, 2.0, 0.5, 3.0, 16.0]), np.array([4, 3])
    for u, v, expected in (
        (1.0, 10.0, 0), (1.6, 10.0, 3), (1.0, 12.1, 1), (2.9, 15.9, 11), (3.0, 16.0, 11), (3.0, 10.0, 9),
        (1.0, 16.0, 2),         (0.99, 12.0, -1), (3.01, 12.0, -1), (2.0, 9.9, -1), (2.0, 16.1, -1), (np.nan, 12.0, -1),
    ):  # fmt: skip
        assert kernels.bin_of(u, v, grid, shape) == expected, (u, v)
    for x, expected in ((-5.0, 0), (1.0, 0), (1.4, 0), (1.6, 1), (2.9, 3), (3.0, 3), (99.0, 3)):
        assert kernels.bin_along(x, 1.0, 2.0, 4) == expected


def test_each_bin_lists_the_points_whose_support_reaches_it() -> None:
    surface = uneven(5)
    grid, shape, start, ids = surface.bin_arrays()
    s = surface.supports
    reached = []  # bins along u and along v, per point
    for k in range(2):
        low = np.floor((s[:, 2 * k] - grid[k]) * grid[2 + k] + 1e-12)
        high = np.minimum(np.floor((s[:, 2 * k + 1] - grid[k]) * grid[2 + k] + 1e-12), shape[k] - 1)
        reached.append((low, high))
    for a in range(shape[0]):
        for b in range(shape[1]):
            cell = a * shape[1] + b
            meets = (reached[0][0] <= a) & (a <= reached[0][1]) & (reached[1][0] <= b) & (b <= reached[1][1])
            assert ids[start[cell] : start[cell + 1]].tolist() == np.flatnonzero(meets).tolist()


def near(surface: DCPSurface, uv: np.ndarray, room: int = 256) -> list[int] | None:
    out = np.full(room, -7, dtype=np.int32)
    arrays, bins = surface.arrays(), surface.bin_arrays()
    count = kernels.points_near(uv, *arrays[:2], *bins, out)
    assert count == -1 or (out[count:] == -7).all()
    return None if count < 0 else out[:count].tolist()


def test_points_near_samples_are_those_that_meet_their_rectangle() -> None:
    surface, rng = uneven(6), np.random.default_rng(7)
    low, high = np.array(surface.rect)[[0, 2]], np.array(surface.rect)[[1, 3]]
    s = surface.supports
    for _ in range(60):
        uv = rng.uniform(low, high, (3, 2)) if rng.random() < 0.5 else places(rng.integers(99), 1).clip(low, high)
        a, b = uv.min(axis=0), uv.max(axis=0)
        meets = (s[:, 0] <= b[0]) & (s[:, 1] >= a[0]) & (s[:, 2] <= b[1]) & (s[:, 3] >= a[1])
        expected = np.flatnonzero(meets).tolist()
        assert near(surface, uv) in (expected, None)
        if near(surface, uv) is not None:
            assert near(surface, uv, len(expected)) == expected
            assert not expected or near(surface, uv, len(expected) - 1) is None  # no room for all
    middle = (low + high) / 2
    assert near(surface, np.array([low, low])) is not None and near(surface, np.array([high, high])) is not None
    for axis in range(2):
        for end in (low[axis] - 1e-6, high[axis] + 1e-6):
            outside = middle.copy()
            outside[axis] = end
            assert near(surface, np.array([middle, outside, middle])) is None
            assert near(surface, np.array([outside, middle])) is None


def test_up_to_256_bins_are_searched_for_a_run() -> None:
    grid, shape, start = np.array([5.0, 10.0, 1.0, 2.0, 25.0, 20.0]), np.array([20, 20]), np.zeros(401, np.int64)
    none, out = np.zeros((0, 3)), np.zeros(RUN, np.int32)
    none.flags.writeable = False  # as those of a surface
    for wide, high, expected in ((16, 16, 0), (16, 17, -1), (17, 16, -1), (1, 20, 0), (20, 1, 0), (20, 13, -1)):
        uv = np.array([[5.5, 10.25], [4.5 + wide, 10.25 + (high - 1) / 2]])
        for aside in ([0, 0], [20 - wide, 0], [0, (20 - high) / 2]):
            found = kernels.points_near(uv + aside, none, none, grid, shape, start, np.zeros(0, np.int32), out)
            assert found == expected, aside
    assert RUN == 256


def test_the_rectangle_around_samples() -> None:
    uv = np.random.default_rng(8).normal((0.0, 50.0), size=(9, 2))
    for low, high in ((0, 9), (3, 7), (4, 5)):
        box = np.full(4, np.nan)
        kernels.bounding_box(uv, low, high, box)
        part = uv[low:high]
        assert box.tolist() == [part[:, 0].min(), part[:, 0].max(), part[:, 1].min(), part[:, 1].max()]


def test_coordinates_are_computed_once_for_each_limit() -> None:
    rng = np.random.default_rng(9)
    uv, side = rng.integers(0, 4, (40, 2)) / 3.0, rng.integers(0, 4, 40)
    for axis in range(2):
        values, index = np.full((40, 2), np.nan), np.full(40, -1)
        count = kernels.distinct(uv, side, axis, values, index)
        pairs = np.column_stack([uv[:, axis], side >> axis & 1])
        assert count == len(np.unique(pairs, axis=0)) == 8
        np.testing.assert_array_equal(values[index], pairs)
        assert np.isnan(values[count:]).all()


def test_a_blending_function_counts_where_its_value_or_slope_is_not_zero() -> None:
    knots, work = np.array([[9.0, 9, 9, 9], [0.0, 1.0, 2.0, 2.0]]), np.zeros(12)
    values = np.array([[0.5, 0.0], [1.5, 0.0], [2.0, 1.0], [2.0, 0.0], [7.0, 0.0]])
    out = np.zeros((5, 2))
    assert kernels.blend_along(knots, 1, 1, values, 5, True, work, out)
    np.testing.assert_allclose(out, [[0.5, 1], [0.5, -1], [0, -1], [0, 0], [0, 0]])
    for k, expected in ((2, True), (3, False), (4, False)):
        out[:] = 0.0
        assert kernels.blend_along(knots, 1, 1, values[k : k + 1], 1, True, work, out) == expected
        assert not kernels.blend_along(knots, 1, 1, values[k : k + 1], 1, False, work, np.zeros((1, 2)))
    out[:] = 0.0
    assert kernels.blend_along(knots, 1, 1, values, 2, False, work, out)
    np.testing.assert_allclose(out, [[0.5, 0], [0.5, 0], [0, 0], [0, 0], [0, 0]])
    assert not kernels.blend_along(knots, 1, 1, values, 0, True, work, out)


@pytest.mark.parametrize("slopes", [False, True])
def test_sums_of_a_run_are_those_of_its_samples(slopes: bool) -> None:
    """A run that sums nothing would only be slow: its samples are then summed one by one."""
    surface, rng = shapes.scattered(60, 2), np.random.default_rng(2)
    u, v = np.meshgrid(rng.random(5), rng.random(6))
    uv, side = np.column_stack([u.ravel(), v.ravel()]), rng.integers(0, 4, 30)
    ids, work = np.arange(surface.n, dtype=np.int32), np.zeros(12)
    run, one = np.full((32, 12), 7.0), np.zeros(12)
    kernels.sum_run(*surface.arrays(), ids, uv, side, slopes, work, run)
    for s in range(30):
        kernels.sum_one(*surface.arrays(), ids, *uv[s], side[s], slopes, work, one)
        assert np.array_equal(run[s], one) and one[3] > 0.0
        assert one[4:].any() == slopes
    assert (run[30:] == 7.0).all()
