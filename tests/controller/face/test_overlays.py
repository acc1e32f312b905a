"""controller.face.overlays"""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.face.overlays import KINDS, MAX_MARKS, Overlays
from controller.face.skin_model import Screen
from controller.panels.overlay.overlay_view import nearest
from controller.robot.anchors import anchor_places
from controller.robot.robot import load_robot
from surface.head import Head
from surface.view.scene.camera import Camera


@pytest.fixture(scope="module")
def overlays() -> Overlays:
    head = Head.load(find_config("heads", "ict"))
    robot = load_robot(find_config("robots", "head24-anchors"), PARAMETERS)
    return Overlays(head, anchor_places(robot, head, "face"))


def values(overlays: Overlays, **set_: float) -> np.ndarray:
    return np.asarray(overlays._head.values(set_))


def test_every_kind_is_of_the_posed_face_and_bounded(overlays: Overlays) -> None:
    overlays.pose(values(overlays, jawOpen=0.5), values(overlays, jawOpen=0.2))
    for kind in KINDS:
        marks = overlays.marks(kind)
        assert len(marks.points) + len(marks.lines) > 0, kind
        assert len(marks.points) <= MAX_MARKS and len(marks.lines) <= 4 * MAX_MARKS
        assert np.isfinite(marks.points).all() and np.isfinite(marks.lines).all()
    closed = overlays.marks("control points").points
    overlays.pose(values(overlays))
    assert np.abs(overlays.marks("control points").points - closed).max() > 5.0


def test_the_tree_is_drawn_by_whole_sides_of_triangles(overlays: Overlays) -> None:
    overlays.pose(values(overlays))
    part = overlays._part
    sides = part.vertices[part.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)].astype(np.float64)
    known = {tuple(sorted(map(tuple, side.tolist()))) for side in sides}
    drawn = {tuple(sorted(map(tuple, line.tolist()))) for line in overlays.marks("quad tree").lines}
    assert drawn <= known and all(one != two for one, two in drawn)
    assert len(overlays._edges) == len(known)


def test_only_what_moved_is_touched(overlays: Overlays) -> None:
    overlays.pose(values(overlays))
    overlays.pose(values(overlays, eyeBlinkLeft=0.5))
    touched = overlays.marks("touched").points
    assert len(touched) and touched[:, 0].min() > -5.0  # the left half alone
    overlays.pose(values(overlays, eyeBlinkLeft=0.5))
    assert len(overlays.marks("touched").points) == 0


def test_the_influence_of_a_control_point_is_local_and_falls_off(overlays: Overlays) -> None:
    overlays.pose(values(overlays))
    points = overlays.marks("control points").points
    screen = Screen(Camera.front(), (1280.0, 720.0))
    x, y, _ = screen.project(np.array([[28.6, -34.0, 102.0]]))[0]
    overlays.choose(nearest(points, (float(x), float(y)), screen))
    marks = overlays.marks("influence")
    assert np.all(np.diff(marks.shades[1:]) <= 0.0) and marks.shades[1] <= 1.0
    away = np.linalg.norm(marks.points - [28.6, -34.0, 102.0], axis=1)
    assert away.max() < 60.0


def test_measured_and_wanted_differ_where_the_servos_lag(overlays: Overlays) -> None:
    overlays.pose(values(overlays, jawOpen=0.5), values(overlays, jawOpen=0.5))
    assert len(overlays.marks("measured").lines) == 0
    overlays.pose(values(overlays, jawOpen=0.5), values(overlays, jawOpen=0.0))
    marks = overlays.marks("measured")
    apart_mm = np.linalg.norm(marks.lines[:, 1] - marks.lines[:, 0], axis=1)
    assert apart_mm.max() > 5.0 > 1.0 > apart_mm.min()
    np.testing.assert_allclose(marks.shades, np.interp(apart_mm, (1.0, 5.0), (0.2, 1.0)), err_msg="full from 5 mm on")
    overlays.pose(values(overlays, jawOpen=0.5))
    assert len(overlays.marks("measured").lines) == 0


def test_anchors_are_named_on_the_skin(overlays: Overlays) -> None:
    overlays.pose(values(overlays))
    marks = overlays.marks("anchors")
    assert len(marks.labels) == len(marks.points) > 10
    skin = overlays._part.vertices
    assert max(np.linalg.norm(skin - point, axis=1).min() for point in marks.points) < 6.0
