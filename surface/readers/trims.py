"""Inversion of trim curves: the (u, v) on a surface of points in space near it, by Gauss-Newton steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface

STARTS = 24  # samples along u and v, in every quarter, where the search may begin
ITERATIONS = 40
MOST_POINTS = 1024  # points along one edge


def polyline(point: Callable[[float], Floats], start: float, end: float, error: float) -> Floats:
    """(k, 3): points of a curve whose chords deviate from it by less than ``error``, or :data:`MOST_POINTS` points."""
    count = 8
    while True:
        fine = np.array([point(t) for t in np.linspace(start, end, 2 * count + 1)])
        deviation = np.linalg.norm(fine[1::2] - (fine[:-2:2] + fine[2::2]) / 2, axis=1).max()
        if deviation < error or count >= MOST_POINTS:
            return fine[::2] if deviation < error else fine
        count *= 2


def invert(surface: DCPSurface, points: Floats) -> tuple[Floats, Floats]:
    """The nearest (u, v) of points near the surface.

    Gauss-Newton steps from the nearest of a grid of samples, in each quarter of the rectangle: where a surface
    closes, the nearest sample may lie at the wrong end.

    Parameters
    ----------
    points : (k, 3) float64

    Returns
    -------
    uv (k, 2), and distances (k,)
    """
    u0, u1, v0, v1 = surface.rect
    found = []
    for a, b in ((u0, (u0 + u1) / 2), ((u0 + u1) / 2, u1)):
        for c, d in ((v0, (v0 + v1) / 2), ((v0 + v1) / 2, v1)):
            grid = np.stack(np.meshgrid(np.linspace(a, b, STARTS), np.linspace(c, d, STARTS)), axis=-1).reshape(-1, 2)
            samples = surface.evaluate(grid)
            starts = np.array([grid[np.nanargmin(((samples - xyz) ** 2).sum(axis=1))] for xyz in points])
            found.append(_gauss_newton(surface, points, starts))
    uv, distance = (np.array(each) for each in zip(*found, strict=True))
    best = np.argmin(distance, axis=0), np.arange(len(points))
    return uv[best], distance[best]


def _gauss_newton(surface: DCPSurface, points: Floats, uv: Floats) -> tuple[Floats, Floats]:
    """Gauss-Newton steps that stay in the rectangle; (u, v) and distances."""
    u0, u1, v0, v1 = surface.rect
    low, high = np.array([u0, v0]), np.array([u1, v1])
    for _ in range(ITERATIONS):
        s, su, sv = surface.derivatives(uv)
        r = points - s
        a, b, c = (su * su).sum(1), (su * sv).sum(1), (sv * sv).sum(1)
        determinant = a * c - b * b
        flat = determinant <= 1e-14 * a * c  # at a pole: one direction alone
        determinant[flat] = 1.0
        ru, rv = (r * su).sum(1), (r * sv).sum(1)
        step = np.stack([(c * ru - b * rv) / determinant, (a * rv - b * ru) / determinant], axis=1)
        step[flat] = np.stack([ru / np.where(a > 0, a, 1), rv / np.where(c > 0, c, 1)], axis=1)[flat] / 2
        moved = np.clip(uv + step, low, high)
        done = np.abs(moved - uv).max() <= 1e-14 * (high - low).max()
        uv = moved
        if done:
            break
    return uv, np.linalg.norm(surface.evaluate(uv) - points, axis=1)
