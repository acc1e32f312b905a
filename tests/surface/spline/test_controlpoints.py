"""Tables of control points: what they publish, how they are copied, and Eq. (1) at samples."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.interpolate import BSpline

from surface.spline.controlpoints import ControlPoints


def small(**closed: tuple[float, float]) -> ControlPoints:
    """Three points of degrees 1 to 3 in u and 1 in v."""
    knots_u = [[0.0, 0.4, 1], [0.0, 0.1, 0.5, 0.9], [0.2, 0.4, 0.6, 0.8, 1.1]]
    return ControlPoints(np.arange(9.0).reshape(3, 3), [1, 2, 3], knots_u, [[0.0, 0.5, 1]] * 3, **closed)  # type: ignore[arg-type]


def test_what_a_table_publishes() -> None:
    table = small()
    assert table.n == 3
    assert table.closed == (None, None)
    assert table.shifts.tolist() == [[0, 0]]
    assert table.points.tolist() == np.arange(9.0).reshape(3, 3).tolist()
    assert table.weights.tolist() == [1, 2, 3]
    assert [k.tolist() for k in table.knots_u] == [[0, 0.4, 1], [0, 0.1, 0.5, 0.9], [0.2, 0.4, 0.6, 0.8, 1.1]]
    assert [k.tolist() for k in table.knots_v] == [[0, 0.5, 1]] * 3
    assert [p.tolist() for p in table.degrees] == [[1, 2, 3], [1, 1, 1]]
    assert table.padded[0][0].tolist() == [0, 0.4, 1, 1, 1]
    assert table.supports.tolist() == [[0, 1, 0, 1], [0, 0.9, 0, 1], [0.2, 1.1, 0, 1]]
    assert table.rect == (0, 1.1, 0, 1)


def test_eq_1_with_scipys_splines() -> None:
    table = small()
    uv = np.random.default_rng(0).uniform([0.02, 0.02], [0.98, 0.98], (50, 2))
    total = np.zeros((50, 4))
    for i in range(3):
        b = table.weights[i] * np.ones(50)
        for k, knots in ((0, table.knots_u[i]), (1, table.knots_v[i])):
            inside = (uv[:, k] >= knots[0]) & (uv[:, k] < knots[-1])
            b = b * np.where(inside, BSpline.basis_element(knots)(uv[:, k]), 0.0)
        total += b[:, None] * np.append(table.points[i], 1.0)
    samples, sides, out = table.sample(uv, None)
    assert np.array_equal(samples, uv)
    assert (sides == 0).all()
    assert np.allclose(out, total[:, :3] / total[:, 3:], rtol=1e-12)
    assert np.allclose(table.sample_derivatives(uv)[1][:, 0], out, rtol=1e-12)


def test_the_side_that_was_really_taken() -> None:
    clamped = ControlPoints([[1.0, 2, 3]], [1], [[0.0, 0, 1, 1]], [[0.0, 0, 1, 1]])
    places = [[0.5, 0.5], [1.0, 0.5], [0.5, 1.0], [1.0, 1.0], [1.5, 0.5]]
    sides = clamped.sample([*places[1:4], [2.0, 2.0]], None)[1]
    assert sides.tolist() == [-1, -1, -1, -1]  # the function vanishes at its end
    constant = ControlPoints([[1.0, 2, 3]], [1], [[0.0, 1]], [[0.0, 1]])
    assert constant.sample(places, None)[1].tolist() == [0, 1, 2, 3, -1]
    assert constant.sample([[0.0, 0.0]], [3])[1].tolist() == [-1]
    side, out = constant.sample_derivatives(places, second=True)
    assert side.tolist() == [0, 1, 2, 3, -1]
    assert out.shape == (5, 6, 3)
    assert np.isnan(out[4]).all() and (out[:4, 0] == [1, 2, 3]).all() and (out[:4, 1:] == 0).all()


def test_other_positions_share_knots_and_bins() -> None:
    table = small()
    moved = table.with_points(table.points + 1)
    assert moved.bins is table.bins
    assert np.array_equal(moved.points, table.points + 1)
    assert moved.padded[0].base is table.padded[0].base
    with pytest.raises(ValueError, match="read-only"):
        moved.points[0] = 0
    with pytest.raises(ValueError, match=r"points: shape \(2, 3\), expected \(3, 3\)"):
        table.with_points(table.points[:2])


def test_a_closed_table_holds_shifted_copies_block_after_block() -> None:
    table = small(closed_u=(0.0, 1.0))
    ku, _, pu, _, points, weights = table.arrays()
    assert table.closed == ((0, 1), None)
    assert table.rect == (0, 1, 0, 1)
    assert table.shifts[0].tolist() == [0, 0]
    assert sorted(table.shifts[:, 0].tolist()) == [-2, -1, 0, 1]
    blocks = len(table.shifts)
    assert len(ku) == len(pu) == len(points) == len(weights) == 3 * blocks
    for b, (shift, _) in enumerate(table.shifts):
        own = slice(3 * b, 3 * b + 3)
        assert np.array_equal(ku[own], table.padded[0] + shift)
        assert np.array_equal(points[own], table.points)
        assert weights[own].tolist() == [1, 2, 3]
    assert table.all_supports.shape == (3 * blocks, 4)
    assert np.array_equal(table.with_points(table.points * 2).arrays()[4], points * 2)
    uv = [[0.05, 0.5], [1.05, 0.5], [-3.95, 0.5]]
    assert np.allclose(table.sample(uv, None)[2], table.sample(uv[:1], None)[2], rtol=1e-12)
    left = 3 * BSpline.basis_element(table.knots_u[2])(1.05)  # point 2 reaches over the end
    one, two = BSpline.basis_element(table.knots_u[0])(0.05), 2 * BSpline.basis_element(table.knots_u[1])(0.05)
    expected = (one * table.points[0] + two * table.points[1] + left * table.points[2]) / (one + two + left)
    assert np.allclose(table.sample(uv, None)[2][0], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"degrees_u": [1, 2]}, "degrees_u: 2 rows for 3 points"),
        ({"knots_v": [[0.0, 0.5, 1]] * 2}, "knots_v: 2 rows for 3 points"),
        ({"degrees_u": [1, 2, 4]}, r"degrees_u\[2\]: 4 needs more knots than the 5 per row"),
        ({"degrees_v": [1, -1, 1]}, r"knots_v\[1\]: 1 knots; a point has degree \+ 2 knots"),
        ({"weights": [1, 2]}, "weights: 2 weights for 3 points"),
    ],
)
def test_bad_padded_arrays_are_named(change: dict, message: str) -> None:
    table = small()
    arrays = {"points": table.points, "weights": table.weights}
    arrays |= dict(zip(("knots_u", "knots_v"), table.padded, strict=True))
    arrays |= dict(zip(("degrees_u", "degrees_v"), table.degrees, strict=True))
    with pytest.raises(ValueError, match=message):
        ControlPoints.from_padded(**(arrays | change))


def test_padding_is_repaired() -> None:
    table = small()
    knots = table.padded[0].copy()
    knots[0, 3:] = np.nan
    with pytest.raises(ValueError, match=r"knots_u\[0\]: knots must be finite"):
        ControlPoints.from_padded(table.points, table.weights, knots, table.padded[1], *table.degrees)
    knots[0, 3:] = 7.0
    again = ControlPoints.from_padded(table.points, table.weights, knots, table.padded[1], *table.degrees)
    assert np.array_equal(again.padded[0], table.padded[0])


def test_published_tables_of_shapes_agree() -> None:
    torus = shapes.torus()
    assert torus.supports.shape == (torus.n, 4)
    assert np.array_equal(torus.all_supports[: torus.n], torus.supports)
