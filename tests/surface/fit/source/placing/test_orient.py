"""Which way a head looks: by eyes and a point below them, in any axes, tilted, and from behind."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.fit.source.placing.anatomy import Eyes, Landmarks
from surface.fit.source.placing.orient import (
    SQUARE,
    TILT,
    axis_names,
    in_front,
    orient,
    oriented_by,
    shapes_of_sides,
    snapped,
)

CENTRES = np.array([[32.0, 40.0, 70.0], [-32.0, 40.0, 70.0]])
DIRECTIONS = np.random.default_rng(0).normal(size=(2000, 3))
HEAD = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1, keepdims=True) * [75, 110, 95]  # the eyes lie before its middle


def low(tilt_deg: float) -> np.ndarray:
    """A point below the eyes, the line from which leans forward by so much."""
    lean = np.radians(tilt_deg)
    return CENTRES.mean(axis=0) - 70.0 * np.array([0.0, np.cos(lean), np.sin(lean)])


def eyes(balls: bool = True, sided: bool = True, flipped: bool = False) -> Eyes:
    return Eyes(CENTRES[::-1] if flipped else CENTRES, sided, balls, "")


@pytest.mark.parametrize("turn", [0, 5, 11, 23])
@pytest.mark.parametrize(("balls", "kind"), [(True, "mouth"), (False, "mouth"), (True, "jaw"), (False, "jaw")])
def test_an_upright_head_is_upright_in_any_axes(turn: int, balls: bool, kind: str) -> None:
    square = SQUARE[turn]
    tilt = TILT[kind][not balls]
    at = low(tilt)
    marks = Landmarks(Eyes(CENTRES @ square, True, balls, ""), **{kind: at @ square})
    found = orient(HEAD @ square, marks)
    assert found.upright and found.notes == ()
    np.testing.assert_array_equal(found.turn, square)


def test_a_mouth_is_better_known_than_a_jaw_and_without_either_nothing_is() -> None:
    both = orient(HEAD, Landmarks(eyes(), low(-13.9), low(80.0)))
    assert both.upright
    assert orient(HEAD, Landmarks(eyes())) is None and orient(HEAD, Landmarks(None, low(0))) is None


@pytest.mark.parametrize("angles", [(0, 0, 20), (0, 25, 8), (12, -33, 15), (0, 120, 10)])
def test_a_head_that_stands_askew_is_levelled(angles) -> None:
    turn = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    marks = Landmarks(Eyes(CENTRES @ turn, True, True, ""), low(-13.9) @ turn)
    found = orient(HEAD @ turn, marks)
    assert not found.upright
    np.testing.assert_allclose(found.turn, turn, atol=1e-3)


@pytest.mark.parametrize("tilt", [-40.0, 0.0, 15.0])
def test_the_line_to_the_eyes_leans_by_the_given_angle(tilt: float) -> None:
    found = oriented_by(HEAD, eyes(), low(tilt), tilt)
    assert found.upright and np.array_equal(found.turn, np.eye(3))
    other = oriented_by(HEAD, eyes(), low(tilt), tilt + 40.0)  # 40 degrees are more than faces differ by
    assert not other.upright
    np.testing.assert_allclose(other.turn, Rotation.from_euler("x", -40, degrees=True).as_matrix().T, atol=1e-9)


def test_shapes_named_as_the_viewer_sees_them_are_noticed() -> None:
    tiny = oriented_by(0.001 * HEAD, Eyes(0.001 * CENTRES[::-1], True, True, ""), 0.001 * low(0), 0.0)
    np.testing.assert_array_equal(tiny.turn, np.eye(3))
    found = oriented_by(HEAD, eyes(flipped=True), low(0), 0.0)
    np.testing.assert_array_equal(found.turn, np.eye(3))
    assert len(found.notes) == 1 and "viewer" in found.notes[0]
    assert oriented_by(HEAD, eyes(sided=False, flipped=True), low(0), 0.0).notes == ()
    assert oriented_by(HEAD, eyes(), low(0), 0.0).notes == ()


def test_eyes_beside_the_mouth_are_none() -> None:
    middle = CENTRES.mean(axis=0)
    for below, found in ((15.0, False), (25.0, True)):
        assert (oriented_by(HEAD, eyes(), middle - [30.0, below, 0], 0.0) is not None) == found


def test_how_far_eyes_are_in_front_of_what_is_around_them() -> None:
    forward = np.array([0.0, 0, 1])
    points = np.array([[0, 40, 50.0], [0, 40, 80.0], [0, 40, 900.0], [0, 140, -500.0], [0, 155, -500.0]])
    assert in_front(points, eyes(), forward) == pytest.approx(70 - 65)
    wide = np.array([[0, 40, 50.0], [0, 40 + 100, 60.0]])
    assert in_front(wide, eyes(), forward) == pytest.approx(70 - 55)  # within 1.6 distances
    assert in_front(points[2:3], eyes(), forward) == 0.0
    assert in_front(points, eyes(), -forward) == pytest.approx(-5)


def test_where_what_is_around_the_eyes_does_not_tell_the_whole_mesh_does() -> None:
    flat = np.vstack([CENTRES, CENTRES + np.array([0, 0, 4.0])])
    hair = np.array([[0, 400.0, -300.0]])
    for points, flipped in ((np.vstack([flat, hair]), False), (np.vstack([flat, hair * [1, 1, -2]]), True)):
        for scale in (0.001, 1.0, 30.0):
            found = oriented_by(scale * points, Eyes(scale * CENTRES, False, True, ""), scale * low(0), 0.0)
            assert (found.turn[2, 2] < 0) == flipped


@pytest.mark.parametrize(
    ("roll", "pitch", "upright"), [(3, 0, True), (5, 0, False), (0, 28, True), (0, 32, False), (3, 28, True)]
)
def test_a_head_is_upright_as_it_is_within_a_little_roll_and_some_pitch(roll, pitch, upright) -> None:
    turn = Rotation.from_euler("zx", [roll, pitch], degrees=True).as_matrix().T
    for square in (SQUARE[0], SQUARE[7]):
        found = snapped(turn @ square, ("a",))
        assert found.upright == upright and found.notes == ("a",)
        np.testing.assert_allclose(found.turn, square if upright else turn @ square)


def test_there_are_24_rotations_of_axes() -> None:
    assert SQUARE.shape == (24, 3, 3) and len({tuple(t.ravel()) for t in SQUARE}) == 24
    np.testing.assert_allclose(np.linalg.det(SQUARE), 1.0)
    assert (np.abs(SQUARE).sum(axis=1) == 1).all() and set(np.unique(SQUARE)) == {-1, 0, 1}


@pytest.mark.parametrize(("up", "forward"), [("y", "z"), ("z", "-y"), ("-x", "y"), ("x", "-z")])
def test_axes_are_named(up: str, forward: str) -> None:
    y, z = (np.eye(3)["xyz".index(n[-1])] * (-1 if n[0] == "-" else 1) for n in (up, forward))
    assert axis_names(np.stack([np.cross(y, z), y, z])) == (up, forward)


def test_shapes_are_given_whole_where_they_would_be_cut_into_sides() -> None:
    deltas = np.arange(4 * 2 * 3, dtype=float).reshape(4, 2, 3)
    sources = {"jawOpen": [(0, "")], "browInnerUp": [(1, ""), (2, "")], "eyeBlinkLeft": [(3, "Left")],
               "eyeBlinkRight": [(3, "Right")], "mouthSmileLeft": [(2, "")], "cheekPuff": [(9, "")],
               "noseSneerLeft": [(-1, "")]}  # fmt: skip
    found = shapes_of_sides(sources, deltas)
    assert set(found) == {"jawOpen", "browInnerUp", "eyeBlink", "mouthSmileLeft"}
    np.testing.assert_array_equal(found["browInnerUp"], deltas[1] + deltas[2])
    np.testing.assert_array_equal(found["eyeBlink"], deltas[3])
    np.testing.assert_array_equal(found["mouthSmileLeft"], deltas[2])


@pytest.mark.parametrize(
    ("kind", "balls", "tilt"),
    [("mouth", True, -13.9), ("mouth", False, -6.0), ("jaw", True, -3.2), ("jaw", False, 3.7)],
)
def test_a_head_is_levelled_by_the_lean_of_its_landmarks(kind: str, balls: bool, tilt: float) -> None:
    turn = Rotation.from_euler("z", 20, degrees=True).as_matrix()
    marks = Landmarks(Eyes(CENTRES @ turn, True, balls, ""), **{kind: low(tilt) @ turn})
    np.testing.assert_allclose(orient(HEAD @ turn, marks).turn, turn, atol=1e-9)
