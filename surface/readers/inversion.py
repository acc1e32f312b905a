"""Find the (u, v) of points near a surface: starts on a grid that knows the knots, then Gauss-Newton steps."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.dcp import DCPSurface

STARTS = 48  # even samples along u and v where a search may begin; three in each knot span are added
MAX_STARTS = 360  # samples along u and v
ITERATIONS = 40
BATCH_DISTANCES = 4_000_000  # distances compared in one step: 32 MB
GOOD = 1e-9  # of the surface's size: nearer points need no second search


def invert(surface: DCPSurface, points: Floats) -> tuple[Floats, Floats]:
    """Return the nearest (u, v) of points near the surface.

    Gauss-Newton steps from the nearest of a grid of samples; points that are not met exactly are searched for again
    from the nearest sample in each quarter of the rectangle, since the nearest of all may lie on another fold.

    points : (k, 3) float64

    Returns uv (k, 2), and distances (k,).
    """
    grid = _grid(surface)
    samples = surface.evaluate(grid)
    covered = ~np.isnan(samples).any(axis=1)
    grid, samples = grid[covered], samples[covered]
    uv, distance = _gauss_newton(surface, points, grid[_nearest(samples, points)])
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    far = np.flatnonzero(~(distance < GOOD * size))
    for quarter in _quarters(surface, grid) if len(far) else []:
        starts = grid[quarter][_nearest(samples[quarter], points[far])]
        again, off = _gauss_newton(surface, points[far], starts)
        better = ~(distance[far] <= off)
        uv[far[better]], distance[far[better]] = again[better], off[better]
    return uv, distance


def search_between(surface: DCPSurface, points: Floats, uv: Floats, distance: Floats, near: float) -> None:
    """Search again for points along a curve that are further than ``near`` from the surface: from beside and between
    where their neighbours lie, since the nearest sample may lead to another fold or end at a crease.

    points, uv, distance : (k, 3), (k, 2) and (k,) along the curve; the last two are changed where that leads nearer.
    """
    far = np.flatnonzero(~(distance <= near))
    before, after = uv[np.maximum(far - 1, 0)], uv[np.minimum(far + 1, len(uv) - 1)]
    for starts in ((before + after) / 2, before, after) if len(far) else ():
        again, off = _gauss_newton(surface, points[far], starts)
        better = ~(distance[far] <= off)
        uv[far[better]], distance[far[better]] = again[better], off[better]


def _grid(surface: DCPSurface) -> Floats:
    """Return (s, 2): even samples of the rectangle, and three in each knot span."""
    u0, u1, v0, v1 = surface.rect
    axes = [_stations(k, a, b) for k, a, b in zip(surface.padded, (u0, v0), (u1, v1), strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _stations(knots: Floats, start: float, end: float) -> Floats:
    lines = np.unique(np.append(knots, [start, end]))
    lines = lines[(lines >= start) & (lines <= end)]
    within = (lines[:-1, None] + np.diff(lines)[:, None] * np.array([1, 3, 5]) / 6).ravel()
    if len(within) > MAX_STARTS:
        within = within[np.linspace(0, len(within) - 1, MAX_STARTS).astype(int)]
    return np.unique(np.concatenate([np.linspace(start, end, STARTS), within]))


def _quarters(surface: DCPSurface, grid: Floats) -> list[Ints]:
    """Return samples of each quarter of the rectangle that has any."""
    u0, u1, v0, v1 = surface.rect
    high = grid > [(u0 + u1) / 2, (v0 + v1) / 2]
    label = high[:, 0] + 2 * high[:, 1]
    return [np.flatnonzero(label == k) for k in range(4) if (label == k).any()]


def _nearest(samples: Floats, points: Floats) -> Ints:
    """Return (k,): which sample (s, 3) is nearest to each point (k, 3)."""
    middle = samples.mean(axis=0)
    s, p = samples - middle, points - middle
    length = (s * s).sum(axis=1)
    step = max(1, BATCH_DISTANCES // max(len(s), 1))
    parts = [np.argmin(length - 2 * p[k : k + step] @ s.T, axis=1) for k in range(0, len(p), step)]
    return np.concatenate(parts) if parts else np.zeros(0, np.int64)


def _gauss_newton(surface: DCPSurface, points: Floats, starts: Floats) -> tuple[Floats, Floats]:
    """Return Gauss-Newton steps that stay in the rectangle, shortened where they lead away; (u, v) and distances."""
    u0, u1, v0, v1 = surface.rect
    low, high = np.array([u0, v0]), np.array([u1, v1])
    uv, moving = starts.copy(), np.arange(len(starts))
    distance, length = np.linalg.norm(surface.evaluate(uv) - points, axis=1), np.ones(len(starts))
    for _ in range(ITERATIONS):
        now, step = uv[moving], length[moving, None] * _step(surface, points[moving], uv[moving])
        tried = np.clip(now + step, low, high)
        off = np.linalg.norm(surface.evaluate(tried) - points[moving], axis=1)
        nearer = off <= distance[moving]
        length[moving] = np.where(nearer, np.minimum(1.0, 2.0 * length[moving]), 0.25 * length[moving])
        uv[moving[nearer]], distance[moving[nearer]] = tried[nearer], off[nearer]
        still: Bools = np.abs(tried - now).max(axis=1) > 1e-14 * (high - low).max()
        moving = moving[still]
        if not len(moving):
            break
    return uv, distance


def _step(surface: DCPSurface, points: Floats, uv: Floats) -> Floats:
    """Return (k, 2): the Gauss-Newton step of each point."""
    s, su, sv = surface.derivatives(uv)
    r = points - s
    a, b, c = (su * su).sum(1), (su * sv).sum(1), (sv * sv).sum(1)
    determinant = a * c - b * b
    flat = determinant <= 1e-14 * a * c  # at a pole: one direction alone
    determinant[flat] = 1.0
    ru, rv = (r * su).sum(1), (r * sv).sum(1)
    step = np.stack([(c * ru - b * rv) / determinant, (a * rv - b * ru) / determinant], axis=1)
    step[flat] = np.stack([ru / np.where(a > 0, a, 1), rv / np.where(c > 0, c, 1)], axis=1)[flat] / 2
    return step
