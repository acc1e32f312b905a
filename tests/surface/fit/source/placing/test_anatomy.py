"""Eyes and mouth out of shapes and balls, whatever the unit and the axes."""

from dataclasses import replace

import numpy as np
import pytest
from traps import EYE_X, good_head, on_body, transformed

from surface.fit.source.placing.anatomy import find_eyes, find_landmarks
from surface.fit.source.placing.frame import EYES_AT
from surface.fit.source.placing.orient import SQUARE

HEAD = good_head()
EYES = EYES_AT + np.outer([EYE_X, -EYE_X], [1.0, 0.0, 0.0])
NONE = np.zeros((0, 4), np.int64)


def shapes(mesh):
    return dict(zip(mesh.names, mesh.deltas, strict=True))


def test_eyeballs_near_the_lids_are_the_eyes():
    eyes = find_eyes(HEAD.vertices, HEAD.faces, shapes(HEAD))
    assert eyes.balls and eyes.sided
    np.testing.assert_allclose(eyes.centres, EYES, atol=1e-6)


def test_lids_alone_tell_the_eyes():
    eyes = find_eyes(HEAD.vertices, NONE, shapes(HEAD))
    assert not eyes.balls and eyes.sided and np.abs(eyes.centres - EYES).max() < 16


def test_balls_alone_tell_the_eyes_but_not_which_is_left():
    eyes = find_eyes(HEAD.vertices, HEAD.faces, {})
    assert eyes.balls and not eyes.sided and eyes.apart == pytest.approx(2 * EYE_X)


def test_a_blink_of_both_eyes_is_taken_apart():
    both = shapes(HEAD)["eyeBlinkLeft"] + shapes(HEAD)["eyeBlinkRight"]
    eyes = find_eyes(HEAD.vertices, NONE, {"eyeBlink": both})
    assert not eyes.sided
    ordered = eyes.centres if eyes.centres[0, 0] > 0 else eyes.centres[::-1]
    np.testing.assert_allclose(ordered, find_eyes(HEAD.vertices, NONE, shapes(HEAD)).centres, atol=1.0)


def test_a_cornea_does_not_move_the_centre():
    ball = np.flatnonzero(HEAD.vertices[:, 2] > 0)[-1]
    vertices = HEAD.vertices.copy()
    for centre in EYES:
        off = vertices - centre
        on = np.abs(np.linalg.norm(off, axis=1) - 12.1) < 1e-6
        front = on & (off[:, 2] > 11.0)
        vertices[front] += [0, 0, 1.2]
    assert ball >= 0
    eyes = find_eyes(vertices, HEAD.faces, shapes(HEAD))
    np.testing.assert_allclose(eyes.centres, EYES, atol=1e-6)


def test_balls_elsewhere_on_a_body_are_no_eyes_where_lids_tell_them():
    knobs = replace(HEAD, vertices=HEAD.vertices.copy())
    start = len(HEAD.vertices) - 2 * 13 * 17
    knobs.vertices[start:] += [0, -400, 0]  # both balls hang 400 mm below
    eyes = find_eyes(knobs.vertices, knobs.faces, shapes(HEAD))
    assert not eyes.balls and np.abs(eyes.centres - EYES).max() < 16


@pytest.mark.parametrize("k", [0, 5, 17])
def test_landmarks_turn_with_the_mesh(k):
    before = find_landmarks(HEAD.vertices, HEAD.faces, shapes(HEAD))
    mesh = transformed(on_body(HEAD), SQUARE[k], 0.01)
    marks = find_landmarks(mesh.vertices, mesh.faces, shapes(mesh))
    for name in ("mouth", "jaw"):
        below = 0.01 * (getattr(before, name) - before.eyes.middle) @ SQUARE[k]
        np.testing.assert_allclose(getattr(marks, name) - marks.eyes.middle, below, atol=1e-6)
    np.testing.assert_allclose(marks.left, before.left @ SQUARE[k], atol=1e-9)


def test_a_mesh_without_a_face_has_no_landmarks():
    marks = find_landmarks(HEAD.vertices[:400], NONE, {})
    assert marks.eyes is None and marks.mouth is None and marks.jaw is None and marks.left is None
    still = {"eyeBlinkLeft": 0 * HEAD.vertices, "eyeBlinkRight": 0 * HEAD.vertices}
    assert find_landmarks(HEAD.vertices, NONE, still).eyes is None
