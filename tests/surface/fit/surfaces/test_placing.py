"""surface.fit.surfaces.placing: where surfaces of a file stand, by what their frame says."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.source.placing.anatomy import Eyes, Landmarks
from surface.fit.source.placing.frame import EYES_AT, EYES_MM, Frame
from surface.fit.surfaces import placing

POINTS = np.array([[0.0, 0, 0], [4, 0, 0], [0, 6, 0], [0, 0, 8]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


def framed(monkeypatch: pytest.MonkeyPatch, frame: Frame) -> None:
    monkeypatch.setattr(placing, "find_frame", lambda points, shapes, **given: frame)


@pytest.mark.parametrize(("middle", "stays"), [(0.9, True), (1.0, True), (1.1, False)])
def test_without_a_face_surfaces_stay_where_their_middle_is_within_a_millimetre(
    monkeypatch: pytest.MonkeyPatch, middle: float, stays: bool
) -> None:
    framed(monkeypatch, Frame(np.eye(3), 2.0, ("a note",), "mm"))
    points = POINTS - [2.0, 3.0, 4.0] + [0.0, 0.5 * middle, 0.0]
    found = placing.place(points, TRIANGLES, None, None, None)
    np.testing.assert_allclose(found.placement.shift, [0.0, 0.0 if stays else -middle, 0.0])
    assert found.notes == ("a note",) and found.placement.scale == 2.0 and found.marks == Landmarks()
    low, high = -6.0 + found.placement.shift[1] + middle, 6.0 + found.placement.shift[1] + middle
    assert found.neck.pivot[1] == pytest.approx(low + 0.3 * (high - low))


@pytest.mark.parametrize("named", [1, -1])
def test_eyes_stand_where_cameras_expect_them_the_left_one_first(monkeypatch: pytest.MonkeyPatch, named: int) -> None:
    turn = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    centres = np.array([[3.0, EYES_MM / 4, 5.0], [3.0, -EYES_MM / 4, 5.0]])[::named]
    marks = Landmarks(Eyes(centres, False, True, "balls"), np.array([39.0, 0.0, 5.0]))
    frame = Frame(turn, 2.0, (), "", marks)
    framed(monkeypatch, frame)
    found = placing.place(POINTS, TRIANGLES, None, None, None)
    half = np.array([EYES_MM / 2, 0.0, 0.0])
    assert found.marks.eyes is not None and found.marks.eyes.sided and found.marks.eyes.balls
    np.testing.assert_allclose(found.marks.eyes.centres, [EYES_AT + half, EYES_AT - half])
    np.testing.assert_allclose(found.marks.mouth, EYES_AT - [0.0, 72.0, 0.0])
    np.testing.assert_allclose(found.placement.points(centres[::named]), [EYES_AT + half, EYES_AT - half])


def test_faces_of_three_corners_are_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = {}

    def find(points: np.ndarray, shapes: dict, **given: object) -> Frame:
        asked.update(given, shapes=shapes)
        return Frame(np.eye(3), 1.0)

    monkeypatch.setattr(placing, "find_frame", find)
    placing.place(POINTS, TRIANGLES, "cm", "y", "-z")
    assert (asked["unit"], asked["up"], asked["forward"], asked["shapes"]) == ("cm", "y", "-z", {})
    assert asked["faces"].tolist() == [[0, 1, 2, -1], [0, 2, 3, -1]]
