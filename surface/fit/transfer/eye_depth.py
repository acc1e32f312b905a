"""Move eyeballs forwards or back until they and the lids on them lie as deep as the eyes of a scan.

The map of space puts an eyeball where lids and front are on the whole; but the eyes of sculptures, which are shut,
blank or flat, lie up to a millimetre and a half further back than a ball between the same lids.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from surface.base.arrays import Floats, Ints
from surface.fit.measures.closest import ClosestTree
from surface.fit.transfer.skin import Ball, seat_on_eyeballs
from surface.fit.transfer.template import Template

EYES = 1.6  # distance from an eyeball's axis, in radii, within which samples of the scan belong to eyes and lids
AROUND = 2.0  # the same for skin that may be nearest to such a sample
POWER = 6  # of distances whose sum is the least: the greatest ones count more than in least squares
MAX_MM = 4.0  # distances beyond count as so much: pupils carved as holes, or eyes that lie deep in a socket
LEAST_SAMPLES = 50  # on both eyes together, from which on the scan shows how deep they lie
FURTHEST_MM = 2.5  # that an eyeball is moved, on a head of the size of the expressions' own
EXACT_MM = 0.02


def at_scan_depth(
    template: Template, skin: Floats, rest: Floats, triangles: Ints, new: Ball, front: Floats
) -> Ball:  # fmt: skip
    """Return the eyeballs, both moved along z to where they and the lids on them are nearest to the scan.

    skin : (n, 3) the face's skin on the scan, not yet laid on the eyeballs; ``rest`` : the same on the template's head;
    triangles : (t, 3). new : where the map puts the eyeballs. front : (m, 3) samples of the scan on the face's front.
    """
    old, scale = Ball(template.eyes, template.radius), new.radius / template.radius
    own = front[_aside(front, new) < EYES * new.radius]
    fronts = template.triangles[(template.eye[template.triangles] >= 0).all(axis=1)]
    around = triangles[(_aside(skin, new) < AROUND * new.radius)[triangles].any(axis=1)]
    if len(own) < LEAST_SAMPLES or not len(fronts):
        return new

    def balls(way: float) -> Ball:
        return replace(new, centres=new.centres + np.array([0.0, 0.0, way]))

    def shown(way: float) -> Floats:
        return np.concatenate([_eyeballs(template, balls(way)), seat_on_eyeballs(skin, rest, old, balls(way))])

    tree = ClosestTree(shown(0.0), np.concatenate([fronts, around + len(template.points)]))
    near = np.zeros(len(own), np.int64)

    def distance(way: float) -> float:
        tree.move(shown(way))
        mm = np.minimum(tree.distances(own, near), MAX_MM * scale) / scale
        return float((mm**POWER).mean())

    limit = FURTHEST_MM * scale
    found = minimize_scalar(distance, bounds=(-limit, limit), method="bounded", options={"xatol": EXACT_MM * scale})
    return balls(float(found.x))


def _aside(points: Floats, balls: Ball) -> Floats:
    """(n,) mm from points (n, 3) to the nearer axis of both eyeballs, seen from the front."""
    aside: Floats = np.linalg.norm(points[:, None, :2] - balls.centres[:, :2], axis=2).min(axis=1)
    return aside


def _eyeballs(template: Template, new: Ball) -> Floats:
    """The template's points (n, 3), moved as its eyeballs; only those of eyeballs mean anything."""
    side = np.maximum(template.eye, 0)
    moved: Floats = new.centres[side] + new.radius / template.radius * (template.points - template.eyes[side])
    return moved
