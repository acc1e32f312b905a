"""Furrows on flat sheets: where their control points reach, and how the skin sinks along the line."""

from __future__ import annotations

import numpy as np
import pytest

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.head.model.furrow import (
    NEAR_TAPER,
    REGULARISATION,
    RIDGE,
    SPAN,
    TAPER,
    Furrow,
    even_moves,
    furrow_knots,
    furrow_moves,
)
from surface.head.model.light import WEIGHT

WIDE, HIGH = 100.0, 80.0


def sheet() -> DCPSurface:
    """A flat sheet of 100 by 80 mm that faces +z; its control points are those of its plane."""
    knots = np.array([0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0])
    own = np.array([knots[k + 1 : k + 3].mean() for k in range(4)])
    u, v = np.meshgrid(own, own, indexing="ij")
    points = np.stack([WIDE * u, HIGH * v, 0.0 * u], axis=-1)
    return DCPSurface.from_nurbs(2, 2, knots, knots, points, np.ones((4, 4)))


def line(count: int, *, depth: float = 1.5, width: float = 6.0) -> Furrow:
    """Level, from 0.3 to 0.7 of the sheet's width: 40 mm."""
    return Furrow(np.column_stack([np.linspace(0.3, 0.7, count), np.full(count, 0.5)]), depth, width)


def with_furrow(f: Furrow, weight: float = 1.0) -> tuple[DCPSurface, np.ndarray]:
    """The sheet with the furrow's points, which lie on it, and their numbers."""
    plain = sheet()
    knots_u, knots_v = furrow_knots(f, plain)
    points = np.vstack([plain.points, plain.evaluate(f.uv)])
    weights = np.append(plain.weights, np.full(len(f.uv), weight))
    rows = [[*own[:, :4], *new] for own, new in zip(plain.padded, (knots_u, knots_v), strict=True)]  # of degree 2, 3
    return DCPSurface(points, weights, *rows), plain.n + np.arange(len(f.uv))


def sunk(surface: DCPSurface, ids: np.ndarray, moves: Floats, uv: Floats) -> Floats:
    """(n,) how far places rise, mm, where the furrow is whole."""
    basis = surface.basis_matrix(uv).tocsc()[:, ids]
    return np.asarray((basis @ moves)[:, 2])


def test_points_reach_as_far_as_the_furrow_is_wide_across_it_and_to_the_next_along_it() -> None:
    f = line(5)
    u, v = furrow_knots(f, sheet())
    assert u.shape == v.shape == (5, 5)
    np.testing.assert_allclose(u[:, 2], f.uv[:, 0])
    np.testing.assert_allclose(v[:, 2], 0.5)
    np.testing.assert_allclose(np.diff(v, axis=1) * HIGH, SPAN * 6.0)
    np.testing.assert_allclose(np.diff(u, axis=1) * WIDE, 10.0)  # so far apart they are
    near = furrow_knots(line(41), sheet())[0]
    np.testing.assert_allclose(np.diff(near, axis=1) * WIDE, SPAN * 6.0)  # and no less than across


def test_a_slanting_furrow_reaches_as_far_both_ways() -> None:
    f = Furrow(np.column_stack([np.linspace(0.3, 0.6, 4), np.linspace(0.2, 0.8, 4)]), 1.0, 3.0)
    u, v = furrow_knots(f, sheet())
    np.testing.assert_allclose(np.diff(u, axis=1), 0.1)
    np.testing.assert_allclose(np.diff(v, axis=1), 0.2)


@pytest.mark.parametrize("depth", [1.5, -1.0])
def test_the_skin_sinks_along_the_line_as_far_as_its_points_reach(depth: float) -> None:
    f = line(9, depth=depth)
    surface, ids = with_furrow(f)
    moves = furrow_moves(f, surface, ids)
    np.testing.assert_allclose(moves[:, :2], 0.0, atol=1e-9)  # straight into the skin

    def at(across_mm: float, u: float = 0.5) -> float:
        return float(sunk(surface, ids, moves, np.array([[u, 0.5 + across_mm / HIGH]]))[0] / -depth)

    assert at(0.0) == pytest.approx(1.0, abs=0.25)
    assert at(3.0) == pytest.approx(at(-3.0), abs=1e-6) and 0.0 < at(3.0) < at(0.0)
    assert at(2 * SPAN * 6.0 - 0.2) > 0.0 and at(2 * SPAN * 6.0 + 0.2) == 0.0
    assert 0.0 < at(0.0, 0.31) < 0.5 * at(0.0)  # its ends run out


def test_moves_are_the_least_squares_ones_for_a_trough_with_a_ridge_on_either_side() -> None:
    f = line(9)
    surface, ids = with_furrow(f, WEIGHT)  # they leave (u, v) as even as it was
    x = np.linspace(-2.5, 2.5, 11)  # in widths
    trough = np.exp(-2.0 * x**2) - RIDGE * np.exp(-2.0 * (np.abs(x) - 1.3) ** 2)
    t = np.minimum(np.linspace(0, 1, 9), np.linspace(1, 0, 9)) / TAPER
    ends = np.where(t < 1, t**2 * (3 - 2 * t), 1.0)
    places = np.stack(
        [np.broadcast_to(f.uv[:, 0], (11, 9)), 0.5 + np.broadcast_to(x[:, None], (11, 9)) * 6.0 / HIGH], -1
    )
    basis = surface.basis_matrix(places.reshape(-1, 2)).toarray()[:, ids]
    ridge = np.sqrt(REGULARISATION * (basis**2).sum() / 9) * np.eye(9)  # of an average point
    wanted = np.append(-1.5 * np.outer(trough, ends), np.zeros(9))
    found = np.linalg.lstsq(np.vstack([basis, ridge]), wanted, rcond=None)[0]
    np.testing.assert_allclose(furrow_moves(f, surface, ids)[:, 2], found, rtol=1e-3)


def test_twice_the_depth_moves_twice_as_far() -> None:
    surface, ids = with_furrow(line(9))
    once, twice = (furrow_moves(line(9, depth=d), surface, ids) for d in (1.0, 2.0))
    np.testing.assert_allclose(twice, 2.0 * once)
    once, twice = (even_moves(line(9, depth=d), surface, ids) for d in (1.0, 2.0))
    np.testing.assert_allclose(twice, 2.0 * once)


def test_points_near_each_other_sink_the_line_evenly_by_the_depth() -> None:
    f = line(13, width=5.0)
    surface, ids = with_furrow(f, WEIGHT)
    moves = even_moves(f, surface, ids)
    u = np.linspace(0.3, 0.7, 201)
    found = sunk(surface, ids, moves, np.column_stack([u, np.full(201, 0.5)]))
    middle = np.abs(u - 0.5) < 0.2 - NEAR_TAPER * 0.4
    np.testing.assert_allclose(found[middle], -1.5, atol=0.12)
    assert np.abs(np.diff(found[middle], 2)).max() < 0.01  # nothing ripples
    assert found[0] == pytest.approx(0.0, abs=0.15) and found[-1] == pytest.approx(found[0], abs=1e-6)
    share = (u[:60] - 0.3) / 0.4 / NEAR_TAPER
    wanted = -1.5 * np.clip(share, 0, 1) ** 2 * (3 - 2 * np.clip(share, 0, 1))
    np.testing.assert_allclose(found[:60], wanted, atol=0.2)
