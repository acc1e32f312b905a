"""Axes and units out of a mesh's own shapes."""

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.base.errors import FitError
from surface.fit.source.placing.anatomy import find_landmarks
from surface.fit.source.placing.frame import EYES_MM, eye_distance, find_frame, head_scale

TURNS = {  # how the file's axes stand: rows are the file's x, y, z seen from the head
    "blender": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "backwards": np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]]),
    "sideways": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
}


def face() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A sheet with shapes on both sides, y up, z forward."""
    vertices = slit_sheet().vertices
    shapes = {"jawOpen": slit_sheet().deltas[0]}
    for name, x in (("eyeBlinkLeft", EYES_MM / 2), ("eyeBlinkRight", -EYES_MM / 2)):
        near = np.exp(-(((vertices[:, :2] - [x, 50]) / 8) ** 2).sum(axis=1))
        shapes[name] = np.column_stack([0 * near, -near, 0.2 * near])
    return vertices, shapes


@pytest.mark.parametrize("name", TURNS)
def test_shapes_tell_the_axes(name):
    vertices, shapes = face()
    turn = TURNS[name]
    frame = find_frame(vertices @ turn.T, {n: s @ turn.T for n, s in shapes.items()})
    np.testing.assert_allclose(frame.turn, turn.T)
    assert any("turned" in note for note in frame.notes)
    np.testing.assert_allclose(frame.points(vertices @ turn.T), vertices)


def test_without_shapes_y_is_up_and_what_is_told_is_taken():
    vertices, _ = face()
    np.testing.assert_array_equal(find_frame(vertices, {}).turn, np.eye(3))
    blender = TURNS["blender"]
    np.testing.assert_allclose(find_frame(vertices @ blender.T, {}, up="z").turn, blender.T)
    told = find_frame(vertices, {}, up="-x", forward="z", unit="in")
    np.testing.assert_allclose(told.turn, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert told.scale == 25.4 and np.linalg.det(told.turn) == pytest.approx(1.0)


def test_sides_named_by_the_viewer_are_noticed():
    vertices, shapes = face()
    head = np.vstack([vertices, [[0, 0, -300.0]]])
    padded = {n: np.vstack([s, np.zeros(3)]) for n, s in shapes.items()}
    swapped = padded | {"eyeBlinkLeft": padded["eyeBlinkRight"], "eyeBlinkRight": padded["eyeBlinkLeft"]}
    frame = find_frame(head, swapped)
    np.testing.assert_array_equal(frame.turn, np.eye(3))
    assert any("as the viewer sees them" in note for note in frame.notes)


@pytest.mark.parametrize("unit", [0.001, 1 / 25.4, 0.1, 1.0])
def test_the_eyes_tell_the_unit_even_of_a_whole_body(unit):
    vertices, shapes = face()
    body = unit * np.vstack([vertices, [[0, -1600.0, 0]]])
    moves = {n: unit * np.vstack([s, np.zeros(3)]) for n, s in shapes.items()}
    assert find_frame(body, moves).scale == pytest.approx(1 / unit)


def test_how_large_a_head_is():
    vertices, shapes = face()
    assert eye_distance(vertices, shapes) == pytest.approx(EYES_MM, rel=0.01)
    assert head_scale(0.5 * vertices, {n: 0.5 * s for n, s in shapes.items()}) == pytest.approx(0.5, rel=0.01)
    assert eye_distance(vertices, {"eyeBlinkLeft": shapes["eyeBlinkLeft"]}) == 0


@pytest.mark.parametrize(("options", "message"), [
    ({"unit": "ell"}, "--unit ell"), ({"up": "w"}, "--up w"), ({"forward": "+z"}, r"--forward \+z"),
    ({"up": "z", "forward": "-z"}, "along one axis"),
])  # fmt: skip
def test_wrong_words_are_refused(options, message):
    with pytest.raises(FitError, match=message):
        find_frame(face()[0], {}, **options)


def test_without_eyes_the_height_tells_the_size():
    vertices, shapes = face()
    height = np.ptp(vertices[:, 1])
    assert head_scale(vertices, {}) == pytest.approx(height / 338.0)
    blinks = {n: s for n, s in shapes.items() if "Blink" in n}
    one_still = {"eyeBlinkLeft": blinks["eyeBlinkLeft"], "eyeBlinkRight": 0 * blinks["eyeBlinkRight"]}
    assert eye_distance(vertices, one_still) == 0.0
    assert head_scale(vertices, one_still) == pytest.approx(height / 338.0)
    assert find_frame(vertices, one_still).scale == 1.0


@pytest.mark.parametrize("unit", [0.001, 0.1, 1.0])
def test_a_height_near_a_heads_tells_the_unit_and_is_noted(unit):
    vertices, _ = face()
    frame = find_frame(unit * vertices, {})
    assert frame.scale == pytest.approx(1 / unit)
    (note,) = frame.notes
    assert note.endswith("all of it is 200 mm high (say --unit otherwise)") and note.startswith("unit taken for ")


@pytest.mark.parametrize("unit", [0.001, 1.0])
def test_a_shape_without_its_other_side_says_nothing_of_left_and_right(unit):
    vertices, shapes = face()
    none = np.zeros((0, 4), np.int64)
    lone = dict.fromkeys(("cheekSquintLeft", "noseSneerLeft"), shapes["eyeBlinkLeft"]) | {"jawOpen": shapes["jawOpen"]}
    assert find_landmarks(unit * vertices, none, lone).left is None
    both = {n: unit * s for n, s in {**shapes, **lone}.items()}
    np.testing.assert_allclose(find_landmarks(unit * vertices, none, both).left, [1, 0, 0], atol=0.02)
    turn = TURNS["sideways"]
    turned = {n: s @ turn.T for n, s in both.items()}
    np.testing.assert_allclose(find_landmarks(unit * vertices @ turn.T, none, turned).left, [0, 1, 0], atol=0.02)
