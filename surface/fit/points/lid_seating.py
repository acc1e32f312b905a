"""Warp a mesh before it is fitted: move lids from one eyeball onto another, close parted lips.

A warp is applied to the neutral vertices and to every shape's moved vertices, so that lids which slid over the
old eyeball slide over the new one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.points.eyeball import surface_height
from surface.fit.source.mesh import FitMesh
from surface.head.model.parameters import smoothstep

LID_MM = (0.1, 1.2)  # a lid that lies on the eyeball is this far above it: its inner edge, its skin
MAX_HELD_MM = 1.6  # points further above it at rest may come off it; nearer ones stay as near in every shape
AHEAD = np.array([0.0, 0.0, 1.0])
FRONT_MM = (0.0, 5.0)  # in front of an eyeball's centre: where lids begin to lie on it, and where they fully do
MAX_RADIUS = 0.93  # of the radius: further out a sphere's front is too steep to seat a lid on


@dataclass(frozen=True)
class Eyeball:
    """A sphere: centre (3,) of the left eye (x > 0), radius, mm; centre of the right eye, where it is not the left
    one's mirror image."""

    centre: tuple[float, float, float]
    radius: float
    right: tuple[float, float, float] | None = None

    @property
    def centres(self) -> Floats:
        """(2, 3) of both, left first."""
        x, y, z = self.centre
        return np.array([self.centre, self.right or (-x, y, z)])


def fit_sphere(points: Floats) -> tuple[Floats, float]:
    """Centre (3,) and radius of the sphere nearest to points (m, 3), by linear least squares."""
    system = np.column_stack([2.0 * points, np.ones(len(points))])
    x = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0]
    return x[:3], float(np.sqrt(x[3] + x[:3] @ x[:3]))


def seat_lids(
    mesh: FitMesh, old: Eyeball, new: Eyeball, vertices: Ints, gazes: Floats | None = None, *,
    under_gaze: bool = False, least: float = LID_MM[0], cling: bool = True,
) -> FitMesh:  # fmt: skip
    """Move the chosen vertices so that what touched the old eyeballs touches the new ones, their corneas included.

    gazes : (k, 2, 3) where the left and the right eye look in every shape; straight ahead if not given.
    least : height above an eyeball, mm, that nothing falls short of: more for large faces, whose middles lie deeper.
    under_gaze : whether lids that a shape leaves alone are moved, too, where the cornea comes under them.
    cling : whether lids that a shape lifts higher above the eyeball than they are at rest are brought back.
    """
    ahead = np.tile(AHEAD, (2, 1))
    rest, deltas = mesh.vertices.copy(), mesh.deltas.copy()
    warped = _warp(mesh.vertices[vertices], old, new)
    thick = np.clip(_above(warped, new, ahead), least, LID_MM[1])
    rest[vertices] = _lay(warped, new, ahead, thick, np.full(len(vertices), np.inf))
    most = _above(rest[vertices], new, ahead)
    most[(most > MAX_HELD_MM) | (not cling)] = np.inf
    for k, delta in enumerate(mesh.deltas):
        gaze = ahead if gazes is None else gazes[k]
        whole = under_gaze and not np.array_equal(gaze, ahead)
        moved = np.flatnonzero((np.abs(delta[vertices]).max(axis=1) > 1e-4) | whole)
        at = vertices[moved]
        warped = _warp(mesh.vertices[at] + delta[at], old, new)
        deltas[k, at] = _lay(warped, new, gaze, thick[moved], most[moved]) - rest[at]
    return replace(mesh, vertices=rest, deltas=deltas)


def _mirror(points: Floats) -> Floats:
    """(m, 3) factors of coordinates that mirror those on the right side, x < 0."""
    return np.where(points[:, :1] >= 0, 1.0, [[-1.0, 1.0, 1.0]])


def _from_eye(points: Floats, ball: Eyeball) -> tuple[Floats, Floats]:
    """Offsets (m, 3) of points from the eye on their side, and that eye's centre (m, 3)."""
    centre = ball.centres[_side(points, ball)]
    return points - centre, centre


def _side(points: Floats, ball: Eyeball) -> Ints:
    """(m,) 0 for points on the left eye's side, 1 on the right one's."""
    side: Ints = (points[:, 0] < ball.centres[:, 0].mean()).astype(np.int64)
    return side


def _above(points: Floats, ball: Eyeball, gaze: Floats) -> Floats:
    """(m,) height of points above the eyeball on their side, which looks along ``gaze (2, 3)``."""
    offset, _ = _from_eye(points, ball)
    length = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
    own = gaze[_side(points, ball)]
    height: Floats = length - ball.radius * surface_height(offset / length[:, None], own)
    return height


def _lay(points: Floats, ball: Eyeball, gaze: Floats, least: Floats, most: Floats) -> Floats:
    """Points in front of an eyeball moved to or from its centre until they are at least ``least (m,)`` and at most
    ``most (m,)`` above it."""
    offset, centre = _from_eye(points, ball)
    above = _above(points, ball, gaze)
    move = (np.clip(above, least, most) - above) * smoothstep(offset[:, 2], *FRONT_MM)
    laid: Floats = centre + offset * (1.0 + move / np.maximum(np.linalg.norm(offset, axis=1), 1e-9))[:, None]
    return laid


def _warp(points: Floats, old: Eyeball, new: Eyeball) -> Floats:
    """Shift along z by the distance between the two spheres' fronts, fading with the distance from the old one; both
    mirror each other at x = 0 unless they are one."""
    if old == new:
        return points
    local = points * _mirror(points)
    across_old, across_new = (np.linalg.norm(local[:, :2] - ball.centre[:2], axis=1) for ball in (old, new))
    front_old = old.centre[2] + _bulge(across_old, old.radius)
    front_new = new.centre[2] + _bulge(across_new, new.radius)
    above = local[:, 2] - front_old
    fade = 1.0 - smoothstep(above, 1.5, 9.0)
    fade *= 1.0 - smoothstep(across_new, 1.05 * new.radius, 1.9 * new.radius)
    out = points.copy()
    out[:, 2] += fade * (front_new - front_old)
    return out


def _bulge(across: Floats, radius: float) -> Floats:
    """Height of a sphere above its equator, held where it becomes steep."""
    held = MAX_RADIUS * radius
    over = 0.5 * (np.sqrt((across - held) ** 2 + 0.4) + across - held)  # max(0, across - held), rounded
    return np.sqrt(radius**2 - np.minimum(across - over, held) ** 2)


def close_lips(mesh: FitMesh, share: float, shape: str = "mouthClose") -> FitMesh:
    """Bring parted lips together: the share of the closing shape becomes part of the neutral face."""
    if shape not in mesh.names or share == 0:
        return mesh
    k = mesh.names.index(shape)
    deltas = mesh.deltas.copy()
    deltas[k] *= 1.0 - share
    return replace(mesh, vertices=mesh.vertices + share * mesh.deltas[k], deltas=deltas)
