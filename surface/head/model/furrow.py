"""Furrows of the skin: control points with small spans along a line, and how they move to sink it.

Points far apart are moved by least squares for a furrow of the wanted depth and width with a ridge along either side.
Points so near that their sum hardly ripples are moved for the wanted depth alone, evenly along the line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.dcp import DCPSurface
from surface.head.model.parameters import smoothstep

SPAN = 0.62  # of knots across a line, in widths of the furrow; along it spans are the distances of the points
TAPER = 0.45  # fraction of a line's length over which the depth fades at each end, of points far apart
NEAR_TAPER = 0.3  # and of points near each other
REGULARISATION = 0.03  # weight of zero moves, relative to that of an average point's samples
EVENNESS = 1.0  # weight of second differences along a line of near points, relative to an average one's sample
RIDGE = 0.35  # height of the ridges along both sides of a furrow, in its depths


@dataclass(frozen=True)
class Furrow:
    """A line in the skin: a control point at each of its places ``uv (k, 2)``; depth and width in mm."""

    uv: Floats
    depth: float
    width: float


def furrow_knots(f: Furrow, surface: DCPSurface) -> tuple[Floats, Floats]:
    """Return knots (k, 5) in u and in v: spans as wide as the furrow across it, as long as the points are apart along
    it."""
    _, su, sv = surface.derivatives(f.uv)
    along = np.abs(np.gradient(f.uv, axis=0))
    out = []
    for axis, slope in enumerate((su, sv)):
        span = np.maximum(SPAN * f.width / np.linalg.norm(slope, axis=1), along[:, axis])
        out.append(f.uv[:, axis, None] + span[:, None] * np.arange(-2.0, 3.0))
    return out[0], out[1]


def furrow_moves(f: Furrow, surface: DCPSurface, ids: Ints) -> Floats:
    """Return (k, 3): how the furrow's points ``ids`` move when it is whole: along the skin's normals, in least squares.

    surface : with the points.
    """
    normal, su, sv = _normals(f, surface)
    ends = _taper(f, TAPER)
    x = np.linspace(-2.5, 2.5, 11)[:, None]  # across, in widths
    profile = np.exp(-0.5 * (x / 0.5) ** 2) - RIDGE * np.exp(-0.5 * ((np.abs(x) - 1.3) / 0.5) ** 2)
    samples = f.uv + (x * f.width)[..., None] * _sideways_step(f, su, sv)
    matrix = surface.basis_matrix(samples.reshape(-1, 2)).tocsc()[:, ids].toarray()
    normal_matrix = matrix.T @ matrix
    normal_matrix += REGULARISATION * np.trace(normal_matrix) / len(ids) * np.eye(len(ids))
    amount = np.linalg.solve(normal_matrix, matrix.T @ (-f.depth * profile * ends).ravel())
    moves: Floats = amount[:, None] * normal
    return moves


def even_moves(f: Furrow, surface: DCPSurface, ids: Ints) -> Floats:
    """Return the moves (k, 3) of points near each other: the line sinks evenly by the depth, without ripples."""
    normal, _, _ = _normals(f, surface)
    matrix = surface.basis_matrix(f.uv).tocsc()[:, ids].toarray()
    bends = np.diff(np.eye(len(ids)), 2, axis=0)
    normal_matrix = matrix.T @ matrix
    normal_matrix += EVENNESS * np.trace(normal_matrix) / len(ids) * bends.T @ bends
    amount = np.linalg.solve(normal_matrix, matrix.T @ (-f.depth * _taper(f, NEAR_TAPER)))
    moves: Floats = amount[:, None] * normal
    return moves


def _normals(f: Furrow, surface: DCPSurface) -> tuple[Floats, Floats, Floats]:
    """Return the unit normals (k, 3) along the line, and the derivatives in u and in v."""
    _, su, sv = surface.derivatives(f.uv)
    normal = np.cross(su, sv)
    return normal / np.linalg.norm(normal, axis=1)[:, None], su, sv


def _taper(f: Furrow, taper: float) -> Floats:
    """Return (k,): share of the depth along the line, whose ends run out over ``taper`` of its length."""
    t = np.linspace(0.0, 1.0, len(f.uv))
    return np.asarray(smoothstep(np.minimum(t, 1.0 - t) / taper))


def _sideways_step(f: Furrow, su: Floats, sv: Floats) -> Floats:
    """Return (k, 2): step in (u, v) that is 1 mm of skin to the side of the line."""
    tangent = np.gradient(f.uv, axis=0)
    forward = tangent[:, :1] * su + tangent[:, 1:] * sv
    normal = np.cross(su, sv)
    left = np.cross(normal, forward)
    left /= np.linalg.norm(left, axis=1)[:, None]
    step: Floats = (np.linalg.pinv(np.stack([su, sv], axis=2)) @ left[..., None])[..., 0]
    return step
