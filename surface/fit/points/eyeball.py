"""Make eyeballs as exact rational surfaces: sclera and cornea are spheres, revolved about the optical axis."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface

IRIS = 0.49  # radius of the iris (limbus), in eyeball radii: 11.8 mm across at 24 mm
CORNEA = 0.65  # radius of the cornea's sphere, in eyeball radii: 7.8 mm at 12 mm (Gullstrand)
LIMBUS, CORNEA_EDGE = np.arcsin(IRIS), np.arcsin(IRIS / CORNEA)  # the limbus's angle from the axis, on either sphere
CORNEA_AT = np.cos(LIMBUS) - CORNEA * np.cos(CORNEA_EDGE)  # of the cornea's centre along the axis, in eyeball radii
LIMBUS_V = 0.5  # v of the limbus; the pole is at v = 0
BACK = np.radians(140.0)  # how far round the sclera reaches from the optical axis


def eyeball_surface(centre: Floats, radius: float) -> DCPSurface:
    """Cornea and sclera with the pupil towards +z.

    u in 0..1 goes once around the optical axis, clockwise seen from the front so that normals point out; v goes from
    the cornea's apex (0) over the limbus (:data:`LIMBUS_V`) to the back (1). Both spheres are exact: degree 2 in
    both directions.
    """
    middle = 0.5 * (LIMBUS + BACK)
    arcs = [_arc(0.0, CORNEA_EDGE, CORNEA, CORNEA_AT), _arc(LIMBUS, middle, 1.0, 0.0), _arc(middle, BACK, 1.0, 0.0)]
    net, weight = (np.concatenate([arcs[0][k][:1], *(arc[k][1:] for arc in arcs)]) for k in (0, 1))
    knots_v = [0, 0, 0, LIMBUS_V, LIMBUS_V, 0.75, 0.75, 1, 1, 1]
    ring, ring_weight = _circle()
    points = np.empty((len(ring), len(net), 3))
    points[..., :2] = ring[:, None, :] * net[None, :, :1]
    points[..., 2] = net[None, :, 1]
    knots_u = [0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1]
    return DCPSurface.from_nurbs(
        2, 2, knots_u, knots_v, centre + radius * points, ring_weight[:, None] * weight[None, :]
    )


def surface_height(directions: Floats, gaze: Floats) -> Floats:
    """(m,) distance of an eyeball's surface from its centre, in radii, in unit directions (m, 3), while it looks along
    unit vectors ``gaze``, (3,) or (m, 3)."""
    along = (directions * gaze).sum(axis=1)
    root = np.maximum(CORNEA**2 - CORNEA_AT**2 * (1.0 - along**2), 0.0)
    return np.where(along > np.cos(LIMBUS), CORNEA_AT * along + np.sqrt(root), 1.0)


def _arc(start: float, end: float, radius: float, z: float) -> tuple[Floats, Floats]:
    """Control points (3, 2) as (distance from the axis, z), and weights, of a circular arc by polar angle."""
    half = 0.5 * (end - start)
    angles = np.array([start, start + half, end])
    reach = radius * np.array([1.0, 1.0 / np.cos(half), 1.0])
    points = np.column_stack([reach * np.sin(angles), z + reach * np.cos(angles)])
    return points, np.array([1.0, np.cos(half), 1.0])


def _circle() -> tuple[Floats, Floats]:
    """The unit circle in nine points of degree 2."""
    steps = np.arange(9) * (np.pi / 4)
    reach = np.where(np.arange(9) % 2, np.sqrt(2.0), 1.0)
    points = reach[:, None] * np.column_stack([np.cos(steps), -np.sin(steps)])
    return points, np.where(np.arange(9) % 2, np.sqrt(0.5), 1.0)
