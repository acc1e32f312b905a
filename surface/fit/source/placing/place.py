"""Put a head where cameras, gaze and light expect it, and cut it from its body."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.load import Loaded
from surface.fit.source.mesh import FitMesh
from surface.fit.source.placing.anatomy import Eyes, Landmarks
from surface.fit.source.placing.bust import cut_bust
from surface.fit.source.placing.frame import EYES_AT, EYES_MM
from surface.head.model.data import Neck

#: From the middle of what blinks to the eyeball's centre, mm, on that head.
INTO_EYE = np.array([0.0, -4.6, -10.4])
#: The shipped head's neck from there: pivot, and y + slope * z of what stays still and of what turns as a whole.
PIVOT, SLOPE, STILL, WHOLE = np.array([0.0, -91.1, -89.2]), 0.35, -217.6, -143.6
NECK_AT = -155.0  # height of the neck below the eyes, mm, on that head
NECK_WIDE = 70.0  # further out than that from the middle nothing is neck
LIPS_BELOW = 72.0  # height of the eyes above the lips, mm, on that head
STAYS = 1.0  # in distances of the eyes: further from its place than that an exported head is moved, as any other
CLOSE_MM = 0.05  # a head that stands as near to its place stays where it is


@dataclass(frozen=True)
class HeadSize:
    """Size of a head relative to the shipped one: across, by the eyes' distance; and along, by the face's height."""

    across: float = 1.0
    along: float = 1.0


def place(loaded: Loaded) -> Loaded:
    """The mesh with its head in its place and without a body; unchanged where no eyes were found.

    A head that omote exported stays where it lay: its eyeballs are others than those of its mesh, such as flat eyes
    that fill their openings.

    loaded : in mm and head axes, as :func:`surface.fit.source.load.load_mesh` returns it.
    """
    eyes = loaded.marks.eyes
    if eyes is None:
        return loaded
    size = head_size(loaded.marks)
    shift = EYES_AT - eye_middle(eyes, size)
    if loaded.home is not None and np.linalg.norm(shift - loaded.home) < STAYS * eyes.apart:
        shift = loaded.home
    if np.abs(shift).max() > CLOSE_MM:
        loaded = moved(loaded, shift)
    mesh, notes = cut_bust(loaded.mesh, EYES_AT, max(size.across, size.along))
    return replace(loaded, mesh=mesh, notes=(*loaded.notes, *notes))


def moved(loaded: Loaded, shift: Floats) -> Loaded:
    """The mesh and all that is known of it, moved by ``shift`` (3,), mm."""

    def at(point: Floats | None) -> Floats | None:
        return None if point is None else point + shift

    marks = loaded.marks
    eyes = None if marks.eyes is None else replace(marks.eyes, centres=marks.eyes.centres + shift)
    mesh = replace(loaded.mesh, vertices=loaded.mesh.vertices + shift)
    marks = Landmarks(eyes, at(marks.mouth), at(marks.jaw), marks.left)
    return replace(loaded, mesh=mesh, placement=loaded.placement.moved(shift), marks=marks)


def head_size(marks: Landmarks) -> HeadSize:
    """Size by the landmarks in head space, mm; what is not known is as on the shipped head."""
    if marks.eyes is None:
        return HeadSize()
    across = marks.eyes.apart / EYES_MM
    if marks.mouth is None:
        return HeadSize(across, across)
    return HeadSize(across, float(np.clip((marks.eyes.middle[1] - marks.mouth[1]) / LIPS_BELOW, 0.5, 2.0 * across)))


def eye_middle(eyes: Eyes, size: HeadSize) -> Floats:
    """(3,) middle between the centres of both eyeballs, mm, in head axes."""
    return eyes.middle if eyes.balls else eyes.middle + size.across * INTO_EYE


def neck_of(mesh: FitMesh, marks: Landmarks) -> Neck:
    """The neck of a head in its place, below its eyes; in the lower quarter of one whose eyes are not known."""
    if marks.eyes is not None:
        return find_neck(mesh, EYES_AT, head_size(marks))
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    height = float(high[1] - low[1])
    pivot = (0.0, float(low[1]) + 0.3 * height, float(0.5 * (low[2] + high[2])))
    return Neck(pivot, 0.0, float(low[1]) + 0.02 * height, float(low[1]) + 0.2 * height)


def find_neck(mesh: FitMesh, eyes_at: Floats, size: HeadSize) -> Neck:
    """The neck of a head whose eyes have their middle at ``eyes_at`` (3,): as on the shipped head, over the middle of
    what there is of it."""
    whole, along = eyes_at + size.along * PIVOT, size.along
    near = np.abs(mesh.vertices - (eyes_at + np.array([0.0, along * NECK_AT, 0.0])))
    ring = mesh.vertices[(near[:, 1] < 15.0 * along) & (near[:, 0] < NECK_WIDE * size.across), 2]
    depth = 0.5 * float(ring.min() + ring.max()) if len(ring) > 3 else float(whole[2])
    depth = float(np.clip(depth, whole[2] - 60.0 * along, whole[2] + 60.0 * along))
    base = float(eyes_at[1] + SLOPE * eyes_at[2])
    return Neck((float(eyes_at[0]), float(whole[1]), depth), SLOPE, base + along * STILL, base + along * WHOLE)
