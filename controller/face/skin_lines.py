"""Converts lines that the mouse draws on the skin to (u, v) coordinates, and mirrors them to the other side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Floats
from surface.dcp import DCPSurface

SPACING = (
    0.6  # of control points along a furrow, in furrow widths; the sum of their blending functions ripples by 0.1 %
)
_MIN_POINTS = 4  # control points of a line
_SMOOTHING_WIDTH = 5  # picks over which a line is averaged, because hands tremble
_MAX_GAP_MM = 12.0  # between two picks; a line is cut at larger gaps
_NEWTON_STEPS = 8


def uv_under(pixels: Floats, shown: Floats, triangles: NDArray[np.integer], uv: Floats) -> Floats:
    """Return the (u, v) coordinates (k, 2) of a mesh under pixels (k, 2); NaN where there is no mesh.

    shown : (m, 3) pixel x, pixel y and depth of its vertices. triangles : (t, 3). uv : (m, 2) of its vertices.
    """
    corners = [shown[triangles[:, i]] for i in range(3)]
    a, b, c = (each[:, :2] for each in corners)
    area = _cross(b - a, c - a)
    out = np.full((len(pixels), 2), np.nan)
    for k, pixel in enumerate(np.asarray(pixels, np.float64)):
        weights = np.stack([_cross(b - pixel, c - pixel), _cross(c - pixel, a - pixel), _cross(a - pixel, b - pixel)])
        with np.errstate(divide="ignore", invalid="ignore"):
            weights = weights / area  # barycentric coordinates
            inside = np.flatnonzero((weights >= 0.0).all(axis=0))
        if len(inside):
            depth = (weights[:, inside] * np.stack([each[inside, 2] for each in corners])).sum(axis=0)
            first = inside[np.argmin(depth)]
            out[k] = weights[:, first] @ uv[triangles[first]]
    return out


def _cross(p: Floats, q: Floats) -> Floats:
    found: Floats = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    return found


def even_line(surface: DCPSurface, picks: Floats, width_mm: float) -> Floats:
    """Return (u, v) coordinates (k, 2) for control points along a line through ``picks`` : (n, 2), evenly spaced.

    Their spacing is that of a furrow of this width; a line shorter than the width gets none. Of a line with gaps, for
    instance across the lips, only the piece with most picks counts.
    """
    picks = picks[np.isfinite(picks).all(axis=1)]
    if len(picks) < 2:
        return np.zeros((0, 2))
    positions = surface.evaluate(picks)
    gaps = np.flatnonzero(np.linalg.norm(np.diff(positions, axis=0), axis=1) > _MAX_GAP_MM) + 1
    piece = max(np.split(np.arange(len(picks)), gaps), key=len)
    uv = _smooth(picks[piece])
    length = _arc_length(surface, uv)
    if length[-1] < width_mm:
        return np.zeros((0, 2))
    count = max(_MIN_POINTS, int(np.ceil(length[-1] / (SPACING * width_mm))) + 1)
    lengths = np.linspace(0.0, length[-1], count)
    return np.column_stack([np.interp(lengths, length, x) for x in uv.T])


def _arc_length(surface: DCPSurface, uv: Floats) -> Floats:
    """Return the (n,) mm from the first point of a line to each, computed from its steps along u and along v.

    Where the directions of u and v are not at right angles, this is longer than the true arc length, as it must be:
    blending functions are narrower there.
    """
    _, along_u, along_v = surface.derivatives(uv)
    slopes = np.column_stack([np.linalg.norm(along_u, axis=1), np.linalg.norm(along_v, axis=1)])
    steps = np.diff(uv, axis=0) * (slopes[1:] + slopes[:-1]) / 2
    return np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))


def _smooth(uv: Floats) -> Floats:
    """Return the moving mean of a line, with the ends unchanged."""
    half = min(_SMOOTHING_WIDTH // 2, (len(uv) - 1) // 2)
    reach = np.minimum(np.minimum(np.arange(len(uv)), np.arange(len(uv))[::-1]), half)
    sums = np.vstack([np.zeros(2), np.cumsum(uv, axis=0)])
    index = np.arange(len(uv))
    smooth: Floats = (sums[index + reach + 1] - sums[index - reach]) / (2 * reach + 1)[:, None]
    return smooth


def mirror_uv(surface: DCPSurface, uv: Floats, vertices: Floats, vertex_uv: Floats) -> Floats:
    """Return the (u, v) coordinates (k, 2) of the surface points nearest to the mirror images of ``uv`` : (k, 2).

    vertices : (m, 3) of a mesh of the surface at rest. vertex_uv : (m, 2).
    """
    wanted = surface.evaluate(uv) * [-1.0, 1.0, 1.0]
    found = np.array([vertex_uv[np.argmin(((vertices - goal) ** 2).sum(axis=1))] for goal in wanted], np.float64)
    for _ in range(_NEWTON_STEPS):
        position, along_u, along_v = surface.derivatives(found)
        step = np.linalg.pinv(np.stack([along_u, along_v], axis=2)) @ (wanted - position)[..., None]
        moved = found + step[..., 0]
        better = surface.covered(moved)
        better[better] = (np.linalg.norm(surface.evaluate(moved[better]) - wanted[better], axis=1)
                          < np.linalg.norm(position[better] - wanted[better], axis=1))  # fmt: skip
        found[better] = moved[better]
    return found


def knots_around(surface: DCPSurface, uv: Sequence[float] | Floats, reach_mm: float) -> tuple[Floats, Floats]:
    """Return knots (1, 5) in u and in v of a control point with the centre ``uv`` : (2,) and the reach ``reach_mm``."""
    centre = np.atleast_2d(np.asarray(uv, np.float64))
    _, along_u, along_v = surface.derivatives(centre)
    steps = np.arange(-2.0, 3.0) * reach_mm / 2.0
    u, v = (centre[:, k, None] + steps / np.linalg.norm(x, axis=1)[:, None] for k, x in enumerate((along_u, along_v)))
    return u, v
