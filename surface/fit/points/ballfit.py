"""Fit eyeballs: a sphere through the larger part of weighted points, and the point that a moving eye turns about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats

MAX_ROUNDS = 40  # of reweighting; each about halves the influence of points off the sphere
MIN_SCALE = 0.005  # of the radius: no vertex of a mesh is nearer to a sphere than its facets are
FRONT_COSINE = np.cos(np.radians(60.0))  # of the angle from the axis of gaze, within which the front of an eye lies
MIN_TURN_RAD = np.radians(4.0)  # a shape that turns an eye by less does not determine the centre


@dataclass(frozen=True)
class Ball:
    """A sphere fitted to an eye.

    centre : (3,) mm; radius : mm.
    off : how far the points stray from it, in radii: the weighted median, so that a cornea or a hole in the back does
        not count.
    spread : sine of half the angle that the points span about the centre, 0..1: below 0.5 they hardly say how large
        the sphere is.
    """

    centre: Floats
    radius: float
    off: float
    spread: float


def fit_ball(points: Floats, weight: Floats) -> Ball | None:
    """The sphere through the larger part of points (m, 3) with weights (m,); None where all lie in one plane.

    Least squares, reweighted by 1 / (1 + (d / s)^2) with s the median distance (Cauchy's weights, Huber 1981), so that
    a cornea, an apex at the back or a rim that is bent inwards does not move the sphere.
    """
    trust = np.array(weight, float)
    if len(points) < 6 or not trust.sum() > 0:
        return None
    middle = np.average(points, axis=0, weights=trust)
    size = float(np.sqrt(np.average(((points - middle) ** 2).sum(axis=1), weights=trust)))
    if not size > 0:
        return None
    local, ball = (points - middle) / size, None
    for _ in range(MAX_ROUNDS):
        ball = _least_squares(local, trust)
        if ball is None:
            return None
        off = np.abs(np.linalg.norm(local - ball[0], axis=1) - ball[1])
        spread = max(weighted_median(off, weight), MIN_SCALE * ball[1])
        trust = weight / (1.0 + (off / spread) ** 2)
    centre, radius = ball if ball is not None else (np.zeros(3), 1.0)
    off = np.abs(np.linalg.norm(local - centre, axis=1) - radius)
    around = _spread(local - centre, weight)
    return Ball(middle + size * centre, size * radius, weighted_median(off, weight) / radius, around)


def _least_squares(points: Floats, weight: Floats) -> tuple[Floats, float] | None:
    """Centre and radius, by |p|^2 = 2 c.p + r^2 - |c|^2; None where that has no answer."""
    root = np.sqrt(weight)[:, None]
    system = np.column_stack([2.0 * points, np.ones(len(points))])
    x, _, rank, values = np.linalg.lstsq(root * system, root[:, 0] * (points**2).sum(axis=1), rcond=None)
    square = float(x[3] + x[:3] @ x[:3])
    flat = rank < 4 or values[-1] < 1e-4 * values[0]
    return None if flat or not square > 0 else (x[:3], float(np.sqrt(square)))


def _spread(offset: Floats, weight: Floats) -> float:
    """Sine of half the angle that points (m, 3) span about the origin, 1 from a half sphere on."""
    unit = offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-12)
    axis = np.average(unit, axis=0, weights=weight)
    length = float(np.linalg.norm(axis))
    if length < 0.5:  # spread over more than a half sphere, whose mean is just that long
        return 1.0
    cosine = float(np.quantile(unit @ (axis / length), 0.05))
    return float(np.sqrt(1.0 - cosine**2)) if cosine > 0 else 1.0


def weighted_median(values: Floats, weight: Floats) -> float:
    """The value (m,) below which half the weight (m,) lies."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return float(values[order[np.searchsorted(total, 0.5 * total[-1])]])


def front_ball(points: Floats, weight: Floats, ball: Ball) -> Ball:
    """The sphere of an eye's front, +z, where lids lie on it: for an eye that is flatter or longer than a sphere."""
    local = points - ball.centre
    length = np.maximum(np.linalg.norm(local, axis=1), 1e-12)
    front = local[:, 2] > FRONT_COSINE * length
    fitted = fit_ball(points[front], weight[front]) if front.sum() >= 12 else None
    if fitted is None or not 0.6 < fitted.radius / ball.radius < 2.2:
        return ball
    return fitted


def turning_centre(moves: list[tuple[Floats, Floats]]) -> Floats | None:
    """(3,) the point that an eye turns about; None where no two motions say so.

    moves : rotation (3, 3) and shift (3,) of each shape in which the eye looks somewhere. Every rotation leaves the
    points of its axis where they are: (1 - R) c = t; two axes that cross determine c, by least squares.
    """
    kept = [(r, t) for r, t in moves if turn_angle(r) > MIN_TURN_RAD]
    if not kept:
        return None
    system = np.concatenate([np.eye(3) - r for r, _ in kept])
    values = np.linalg.svd(system, compute_uv=False)
    if values[-1] < 0.2 * values[0]:  # one axis only
        return None
    return np.asarray(np.linalg.lstsq(system, np.concatenate([t for _, t in kept]), rcond=None)[0])


def turn_angle(rotation: Floats) -> float:
    """Angle of a rotation (3, 3), rad."""
    return float(np.arccos(np.clip(0.5 * (np.trace(rotation) - 1.0), -1.0, 1.0)))
