"""Fit lids of a mesh without a recipe to its eyeballs: out of them at rest, along them in shapes, shut in a blink."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.eyes.blink import shut_blinks
from surface.fit.eyes.following import follow_gaze
from surface.fit.eyes.search import Eyes
from surface.fit.points.eyeball import CORNEA
from surface.fit.points.lid_seating import AHEAD, LID_MM, Eyeball, seat_lids
from surface.fit.source.mesh import FitMesh, directed_edges, renumbered
from surface.fit.source.names import sources_of
from surface.head.model.parameters import NAMES, read_pose
from surface.head.posing.rig import optical_axis

LID_REACH = 1.9  # greatest distance of lids from the centre, in radii
MAX_DEPTH = 0.2  # of lids inside an eyeball, in radii; deeper skin is no lid
MIN_HEIGHT_MM, MAX_HEIGHT_MM = 0.2, 0.7  # of lids above an eyeball, for the finest and the coarsest faces
NOTE_MM = 1.0  # a lid that is moved further at rest is reported


def fit_lids(mesh: FitMesh, eyes: Eyes) -> tuple[FitMesh, list[str]]:
    """The mesh with its lids on the eyeballs and shut by blinks, and what was changed, in words.

    Shapes by which eyes look somewhere are added where they are missing: lids give way to the cornea, and follow it
    where a blink shows how they move.
    """
    if eyes.radius <= 0:
        return mesh, []
    mesh = with_looks(mesh)
    shut, notes = shut_blinks(mesh, eyes.openings, eyes.centres, eyes.radius)
    shut, followed = follow_gaze(shut, eyes.openings, eyes.centres, eyes.radius)
    left, right = ((float(x), float(y), float(z)) for x, y, z in eyes.centres)
    ball = Eyeball(left, eyes.radius, right)
    lids = _lids(mesh, eyes.centres, eyes.radius, eyes.faces)
    least = _least_height(mesh, lids, eyes.radius)
    seated = seat_lids(shut, ball, ball, lids, gazes_of(mesh), under_gaze=True, least=least, cling=False)
    most = float(np.linalg.norm(seated.vertices - mesh.vertices, axis=1).max(initial=0.0))
    notes += followed
    notes += [f"lids were moved by up to {most:.1f} mm, out of the eyeballs"] if most > NOTE_MM else []
    return seated, notes


def _least_height(mesh: FitMesh, lids: Ints, radius: float) -> float:
    """Height above the eyeball, mm, at which lids' faces clear its cornea with their middles, too: the sagitta of half
    their edges is within it."""
    a, b = directed_edges(mesh.faces)
    near = np.isin(a, lids) & np.isin(b, lids)
    if not near.any():
        return LID_MM[0]
    edge = float(np.median(np.linalg.norm(mesh.vertices[a[near]] - mesh.vertices[b[near]], axis=1)))
    return float(np.clip(MIN_HEIGHT_MM + edge**2 / (8.0 * CORNEA * radius), LID_MM[0], MAX_HEIGHT_MM))


def with_looks(mesh: FitMesh) -> FitMesh:
    """The mesh with all shapes by which eyes look somewhere; those that were missing move nothing."""
    known = sources_of(mesh.names)
    new = [n for n in NAMES if n.startswith("eyeLook") and n not in known]
    none = np.zeros((len(new), *mesh.vertices.shape))
    return replace(mesh, names=(*mesh.names, *new), deltas=np.concatenate([mesh.deltas, none]))


def _lids(mesh: FitMesh, eyes: Floats, radius: float, eye_faces: Bools) -> Ints:
    """Vertices near an eye that belong to no eye, but those deep inside an eyeball, which nobody sees."""
    used = renumbered(mesh.faces[~eye_faces])[0]
    away = np.linalg.norm(mesh.vertices[used][:, None] - eyes, axis=2).min(axis=1) / radius
    return np.asarray(used[(away < LID_REACH) & (away > 1.0 - MAX_DEPTH)])


def gazes_of(mesh: FitMesh) -> Floats:
    """(k, 2, 3) directions in which the left and the right eye look in every shape of a mesh."""
    out = np.tile(AHEAD, (len(mesh.names), 2, 1))
    for name, indices in sources_of(mesh.names).items():
        pose = read_pose(np.array([float(n == name) for n in NAMES]))
        out[indices] = [optical_axis(gaze) for gaze in pose.gaze]
    return out
