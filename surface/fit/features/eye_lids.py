"""Fit lids of a mesh without a recipe to its eyeballs: out of them at rest, along them in shapes, shut in a blink."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.features.eye_blink import shut_blinks
from surface.fit.features.eyes import Eyes
from surface.fit.points.lid_seating import AHEAD, Eyeball, seat_lids
from surface.fit.source.mesh import FitMesh, renumbered
from surface.fit.source.names import sources_of
from surface.head.model.parameters import NAMES, read_pose
from surface.head.posing.rig import optical_axis

REACH = 1.9  # in radii: lids lie no further from the centre
DEEP = 0.2  # in radii: skin further inside an eyeball is no lid
TELL_MM = 1.0  # a lid that is moved further at rest is worth a note


def fit_lids(mesh: FitMesh, eyes: Eyes, gazes: Floats) -> tuple[FitMesh, list[str]]:
    """The mesh with its lids on the eyeballs and shut by blinks, and what was changed, in words.

    gazes : (k, 2, 3) where the eyes look in every shape.
    """
    if eyes.radius <= 0:
        return mesh, []
    shut, notes = shut_blinks(mesh, eyes.openings, eyes.centres, eyes.radius)
    left, right = ((float(x), float(y), float(z)) for x, y, z in eyes.centres)
    ball = Eyeball(left, eyes.radius, right)
    seated = seat_lids(shut, ball, ball, _lids(mesh, eyes.centres, eyes.radius, eyes.faces), gazes)
    most = float(np.linalg.norm(seated.vertices - mesh.vertices, axis=1).max(initial=0.0))
    notes += [f"lids were moved by up to {most:.1f} mm, out of the eyeballs"] if most > TELL_MM else []
    return seated, notes


def _lids(mesh: FitMesh, eyes: Floats, radius: float, eye_faces: Bools) -> Ints:
    """Vertices near an eye that belong to no eye, but those deep inside an eyeball, which nobody sees."""
    used = renumbered(mesh.faces[~eye_faces])[0]
    away = np.linalg.norm(mesh.vertices[used][:, None] - eyes, axis=2).min(axis=1) / radius
    return np.asarray(used[(away < REACH) & (away > 1.0 - DEEP)])


def gazes_of(mesh: FitMesh) -> Floats:
    """(k, 2, 3) directions in which the left and the right eye look in every shape of a mesh."""
    out = np.tile(AHEAD, (len(mesh.names), 2, 1))
    for name, indices in sources_of(mesh.names).items():
        pose = read_pose(np.array([float(n == name) for n in NAMES]))
        out[indices] = [optical_axis(gaze) for gaze in pose.gaze]
    return out
