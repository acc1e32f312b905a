"""Lines that the mouse draws on the skin: where in (u, v) they lie, and on the other side of the face."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Floats
from surface.dcp import DCPSurface

SPACING = 0.6  # of control points along a furrow, in its widths: sums of their blending functions then ripple by 0.1 %
_LEAST = 4  # control points of a line
_SMOOTH = 5  # picks of which each place is the mean: hands tremble
_JUMP_MM = 12.0  # between two picks: one line does not go on there
_ROUNDS = 8


def uv_under(pixels: Floats, shown: Floats, triangles: NDArray[np.integer], uv: Floats) -> Floats:
    """(k, 2) what lies under pixels (k, 2) of a mesh; NaN where nothing does.

    shown : (m, 3) pixels and depth of its vertices. triangles : (t, 3). uv : (m, 2) of its vertices.
    """
    corners = [shown[triangles[:, i]] for i in range(3)]
    a, b, c = (each[:, :2] for each in corners)
    area = _cross(b - a, c - a)
    out = np.full((len(pixels), 2), np.nan)
    for k, pixel in enumerate(np.asarray(pixels, np.float64)):
        shares = np.stack([_cross(b - pixel, c - pixel), _cross(c - pixel, a - pixel), _cross(a - pixel, b - pixel)])
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = shares / area
            inside = np.flatnonzero((shares >= 0.0).all(axis=0))
        if len(inside):
            depth = (shares[:, inside] * np.stack([each[inside, 2] for each in corners])).sum(axis=0)
            first = inside[np.argmin(depth)]
            out[k] = shares[:, first] @ uv[triangles[first]]
    return out


def _cross(p: Floats, q: Floats) -> Floats:
    found: Floats = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    return found


def even_line(surface: DCPSurface, picks: Floats, width_mm: float) -> Floats:
    """(k, 2) places for control points along a line through ``picks`` (n, 2), as far apart as a furrow of that width
    needs; none where the line is shorter than one.

    Of a line that jumps, as over the lips, only the longest piece counts.
    """
    picks = picks[np.isfinite(picks).all(axis=1)]
    if len(picks) < 2:
        return np.zeros((0, 2))
    places = surface.evaluate(picks)
    jumps = np.flatnonzero(np.linalg.norm(np.diff(places, axis=0), axis=1) > _JUMP_MM) + 1
    piece = max(np.split(np.arange(len(picks)), jumps), key=len)
    uv = _smoothed(picks[piece])
    length = _steps_along(surface, uv)
    if length[-1] < width_mm:
        return np.zeros((0, 2))
    count = max(_LEAST, int(np.ceil(length[-1] / (SPACING * width_mm))) + 1)
    at = np.linspace(0.0, length[-1], count)
    return np.column_stack([np.interp(at, length, x) for x in uv.T])


def _steps_along(surface: DCPSurface, uv: Floats) -> Floats:
    """(n,) mm from the first place of a line to each, by its ways along u and along v.

    Where these do not stand at right angles it is longer than the line, as blending functions are narrower there.
    """
    _, along_u, along_v = surface.derivatives(uv)
    slopes = np.column_stack([np.linalg.norm(along_u, axis=1), np.linalg.norm(along_v, axis=1)])
    steps = np.diff(uv, axis=0) * (slopes[1:] + slopes[:-1]) / 2
    return np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))


def _smoothed(uv: Floats) -> Floats:
    """Means of neighbours, the ends kept."""
    half = min(_SMOOTH // 2, (len(uv) - 1) // 2)
    reach = np.minimum(np.minimum(np.arange(len(uv)), np.arange(len(uv))[::-1]), half)
    sums = np.vstack([np.zeros(2), np.cumsum(uv, axis=0)])
    at = np.arange(len(uv))
    smooth: Floats = (sums[at + reach + 1] - sums[at - reach]) / (2 * reach + 1)[:, None]
    return smooth


def mirrored(surface: DCPSurface, uv: Floats, vertices: Floats, vertex_uv: Floats) -> Floats:
    """(k, 2) the places on the other side of the face, nearest to the mirror images of ``uv`` (k, 2).

    vertices : (m, 3) a mesh of the surface at rest. vertex_uv : (m, 2).
    """
    wanted = surface.evaluate(uv) * [-1.0, 1.0, 1.0]
    found = np.array([vertex_uv[np.argmin(((vertices - place) ** 2).sum(axis=1))] for place in wanted], np.float64)
    for _ in range(_ROUNDS):
        at, along_u, along_v = surface.derivatives(found)
        step = np.linalg.pinv(np.stack([along_u, along_v], axis=2)) @ (wanted - at)[..., None]
        moved = found + step[..., 0]
        better = surface.covered(moved)
        better[better] = (np.linalg.norm(surface.evaluate(moved[better]) - wanted[better], axis=1)
                          < np.linalg.norm(at[better] - wanted[better], axis=1))  # fmt: skip
        found[better] = moved[better]
    return found


def knots_round(surface: DCPSurface, uv: Sequence[float] | Floats, reach_mm: float) -> tuple[Floats, Floats]:
    """Knots (1, 5) in u and v of a control point in the middle ``uv`` (2,) that reaches ``reach_mm`` along both."""
    at = np.atleast_2d(np.asarray(uv, np.float64))
    _, along_u, along_v = surface.derivatives(at)
    steps = np.arange(-2.0, 3.0) * reach_mm / 2.0
    u, v = (at[:, k, None] + steps / np.linalg.norm(x, axis=1)[:, None] for k, x in enumerate((along_u, along_v)))
    return u, v
