"""Put the surfaces of a file where heads stand: unit and axes as for meshes, eyes where cameras expect them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.source.mesh import FitMesh
from surface.fit.source.placing.anatomy import Eyes, Landmarks
from surface.fit.source.placing.frame import EYES_AT, Frame, find_frame
from surface.fit.source.placing.place import eye_middle, head_size, neck_of
from surface.head.model.data import Neck
from surface.head.model.placement import Placement

MIN_SHIFT_MM = 1.0  # surfaces without a face whose middle is nearer to the origin than this stay where they are


@dataclass(frozen=True)
class Placed:
    """Where surfaces stand: ``placement`` from the file's coordinates, landmarks in head space, what was guessed."""

    placement: Placement
    marks: Landmarks
    neck: Neck
    notes: tuple[str, ...]


def place(points: Floats, triangles: Ints, unit: str | None, up: str | None, forward: str | None) -> Placed:
    """Find unit, axes and place of samples (n, 3) with triangles (t, 3).

    Raises FitError: see :func:`surface.fit.source.placing.frame.find_frame`.
    """
    faces = np.column_stack([triangles, np.full(len(triangles), -1)])
    frame = find_frame(points, {}, unit=unit, up=up, forward=forward, faces=faces)
    at = frame.points(points)
    marks = _turned(frame)
    if marks.eyes is None:
        middle = 0.5 * (at.min(axis=0) + at.max(axis=0))
        shift = -middle if np.abs(middle).max() > MIN_SHIFT_MM else np.zeros(3)
    else:
        shift = EYES_AT - eye_middle(marks.eyes, head_size(marks))
        marks = _moved(marks, shift)
    return Placed(frame.placement.moved(shift), marks, neck_of(_mesh(at + shift, faces), marks), frame.notes)


def _turned(frame: Frame) -> Landmarks:
    """Eyes and mouth in head axes, the left eye first."""
    eyes, mouth = frame.marks.eyes, frame.marks.mouth
    if eyes is not None:
        centres = frame.points(eyes.centres)
        eyes = Eyes(centres if centres[0, 0] > centres[1, 0] else centres[::-1].copy(), True, eyes.balls, eyes.by)
    return Landmarks(eyes, None if mouth is None else frame.points(mouth))


def _moved(marks: Landmarks, shift: Floats) -> Landmarks:
    eyes = None if marks.eyes is None else replace(marks.eyes, centres=marks.eyes.centres + shift)
    return Landmarks(eyes, None if marks.mouth is None else marks.mouth + shift)


def _mesh(points: Floats, faces: Ints) -> FitMesh:
    return FitMesh(points, faces, np.zeros((0, 2)), np.full_like(faces, -1), (), np.zeros((0, len(points), 3)))
