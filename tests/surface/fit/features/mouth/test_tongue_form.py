"""A tongue with a flat, furrowed back is rounded."""

from __future__ import annotations

import numpy as np

from surface.dcp import DCPSurface
from surface.fit.features.mouth.tongue_form import GROOVE_MM, rounded_tongue

LENGTH_MM, HALF_MM, FURROW_MM = 60.0, 18.0, 3.0
RECT = (0.0, 1.0, 0.0, 1.0)


def clamped(count: int) -> np.ndarray:
    return np.pad(np.linspace(0.0, 1.0, count - 2), 3, mode="edge")


def furrowed(along: int = 12, around: int = 41) -> DCPSurface:
    """A tube along z, from below over the right, the top and the left, whose back is flat but for a furrow."""
    turn = np.linspace(-np.pi, np.pi, around)
    x, y = HALF_MM * np.sin(turn), np.clip(9.0 * np.cos(turn), -9.0, 5.0)
    y = y - FURROW_MM * np.exp(-((x / 4.0) ** 2)) * (y > 0.0)
    ring = np.column_stack([x, y - 40.0, np.zeros(around)])
    points = ring + np.linspace(0.0, LENGTH_MM, along)[:, None, None] * [0.0, 0.0, 1.0]
    return DCPSurface.from_nurbs(3, 3, clamped(along), clamped(around), points, np.ones((along, around)))


def back_at(surface: DCPSurface, points: np.ndarray, x: float) -> float:
    """y of the back at x, in the middle of the length."""
    uv = np.column_stack([np.full(801, 0.5), np.linspace(0.0, 1.0, 801)])
    at = surface.basis_matrix(uv) @ points
    upper = at[:, 1] > -40.0
    return float(at[upper][np.abs(at[upper, 0] - x).argmin(), 1])


def test_the_back_is_round_across_with_a_shallow_groove() -> None:
    surface = furrowed()
    before, after = surface.points, rounded_tongue(surface.points, surface, RECT)
    middle, hump, edge = (back_at(surface, after, x) for x in (0.0, 6.0, 15.0))
    furrow = back_at(surface, before, 6.0) - back_at(surface, before, 0.0)
    assert furrow > 2.0 * GROOVE_MM
    assert 0.5 * GROOVE_MM < hump - middle < furrow - 0.5, "the furrow is shallower"
    assert hump - edge > 1.5, "the edges lie lower"
    assert abs(back_at(surface, before, 15.0) - back_at(surface, before, 6.0)) < 0.5, "which they did not"


def test_length_width_and_underside_stay() -> None:
    surface = furrowed()
    moved = rounded_tongue(surface.points, surface, RECT) - surface.points
    assert np.abs(moved[:, [0, 2]]).max() < 1e-9
    below = surface.points[:, 1] < -42.0
    assert np.abs(moved[below, 1]).max() < 0.3
