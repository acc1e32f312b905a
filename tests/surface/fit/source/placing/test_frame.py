"""Axes and units out of a mesh's own shapes."""

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.base.errors import FitError
from surface.fit.source.placing import frame
from surface.fit.source.placing.anatomy import Eyes, Landmarks, find_landmarks
from surface.fit.source.placing.conventions import Convention
from surface.fit.source.placing.frame import EYES_MM, eye_distance, find_frame, head_scale
from surface.fit.source.placing.orient import Orientation
from surface.head.model.parameters import rotation

TURNS = {  # how the file's axes stand: rows are the file's x, y, z seen from the head
    "blender": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "backwards": np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]]),
    "sideways": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
}

NONE = Convention()


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
    assert note.endswith("all of it is 200 mm high (say --unit otherwise)") and note.startswith("unit taken to be ")


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


GLTF = Convention("glTF", "m", "y", "z")


def scaled(measure, by_user=None, convention=NONE, *, eyes=True):
    """mm per unit, its name and the notes for eyes so far apart, or a mesh so high."""
    notes: list[str] = []
    found = Eyes(np.array([[measure / 2, 0, 0], [-measure / 2, 0, 0]]), True, True, "") if eyes else None
    return (*frame._scale(found, measure, by_user, convention, notes), notes)


@pytest.mark.parametrize(
    ("measure", "unit"),
    [(65.4, "mm"), (6.3, "cm"), (0.066, "m"), (2.6, "in"), (0.21, "ft"), (0.6, "dm"), (90.0, "mm"), (45.0, "mm")],
)  # fmt: skip
def test_a_unit_is_guessed_by_eyes_as_people_have_them(measure, unit):
    scale, name, (note,) = scaled(measure)
    assert name == unit and scale == frame.UNITS[unit]
    assert note == f"unit taken to be {unit}: its eyes are {scale * measure:.3g} mm apart (say --unit otherwise)"


def test_where_no_unit_fits_eyes_are_taken_for_usual_ones():
    scale, name, (note,) = scaled(14.0)
    assert name == "" and scale == pytest.approx(EYES_MM / 14.0)
    assert note == "no usual unit fits: its eyes are taken to be 65 mm apart (say --unit otherwise)"
    assert scaled(65.4 / 1.59)[1] == "mm" and scaled(65.4 / 1.61)[1] != "mm"
    assert scaled(14.0, eyes=False)[1] != ""  # without eyes any unit is as good


def test_a_unit_that_is_told_is_taken_and_a_far_size_noted():
    assert scaled(65.0, "mm") == (1.0, "mm", [])
    scale, name, (note,) = scaled(65.0, "cm")
    assert (scale, name) == (10.0, "cm") and note == "with --unit cm its eyes are 650 mm apart, a human's 65"
    assert scaled(65.0, "cm", eyes=False)[2] == []
    assert scaled(65.4 * 2.4, "mm")[2] == [] and scaled(65.4 * 2.6, "mm")[2] != []


def test_a_unit_that_the_format_defines_is_taken_unless_eyes_contradict():
    assert scaled(0.065, convention=GLTF) == (1000.0, "m", [])
    assert scaled(0.065 * 2.4, convention=GLTF)[:2] == (1000.0, "m")  # figures may be large
    scale, name, (note,) = scaled(6.5, convention=GLTF)
    assert (scale, name) == (10.0, "cm")
    assert note.startswith(
        "unit taken to be cm, although glTF defines m, since then its eyes are 6.5e+03 mm apart: its eyes are 65 mm"
    )
    _, name, (note,) = scaled(14.0, convention=GLTF)
    assert name == "" and note.startswith("no usual unit fits, although glTF defines m")
    assert scaled(2.0, convention=GLTF, eyes=False)[:2] == (1000.0, "m")
    assert scaled(300.0, convention=GLTF, eyes=False)[:2] == (1.0, "mm")
    assert scaled(0.065, "in", GLTF)[1] == "in"


def test_axes_that_are_told_are_taken_and_the_other_one_gives_way():
    def by_options(up, forward, found=None, usual=np.eye(3)):
        turn = frame._by_options(up, forward, found, usual)
        assert np.linalg.det(turn) == pytest.approx(1)
        return [f"{'-' if row.min() < 0 else ''}{'xyz'[int(np.abs(row).argmax())]}" for row in turn[1:]]

    assert by_options("z", "-y") == ["z", "-y"] and by_options("y", None) == ["y", "z"]
    assert by_options("z", None) == ["z", "-y"] and by_options("-x", None) == ["-x", "z"]
    assert by_options(None, "y") == ["z", "y"] and by_options(None, "x") == ["y", "x"]
    blender = TURNS["blender"].T
    found = Orientation(blender, True)
    assert by_options("z", None, found) == ["z", "-y"] and by_options(None, "-y", found) == ["z", "-y"]
    tilted = Orientation(blender @ rotation(0.2, 0.1), False)
    assert by_options(None, "-y", tilted) == ["z", "-y"]
    assert by_options(None, "z", found) == ["y", "z"]
    with pytest.raises(FitError, match="along one axis") as caught:
        by_options("y", "-y")
    assert "--up z --forward -y" in caught.value.hint


def test_what_a_user_would_not_expect_is_said():
    def said(turn, convention=NONE, found=None, by_user=False):
        notes: list[str] = []
        frame._say(np.asarray(turn, float), convention, found, by_user=by_user, notes=notes)
        return notes

    blender, upright = TURNS["blender"].T, Orientation(np.eye(3), True)
    assert said(np.eye(3)) == [] == said(np.eye(3), GLTF) and said(blender, Convention("X", "m", "z", "-y")) == []
    assert said(blender) == ["turned: up is z, forward is -y in the file"]
    assert said(blender, found=upright) == [
        "turned: up is z, forward is -y in the file by eyes and mouth (say --up and --forward otherwise)"
    ]
    assert said(blender, found=upright, by_user=True) == ["turned: up is z, forward is -y in the file"]
    assert said(blender, GLTF) == ["turned: up is z, forward is -y in the file, although glTF defines y and z"]
    assert said(rotation(np.radians(20), 0.0)) == ["levelled: the head stands askew in the file, by 20 degrees"]


def test_what_little_is_known_decides_between_rotations_of_axes():
    points = np.random.default_rng(0).normal(size=(300, 3)) * [75, 100, 90]
    jaw = {"jawOpen": np.tile([0, 0, -3.0], (300, 1))}

    def partly(marks=Landmarks(), shapes=jaw, sure=False, usual=np.eye(3)):
        return frame._partly(points, shapes, marks, usual, sure=sure)

    np.testing.assert_array_equal(partly()[1], [0, 0, 1])  # the jaw opens downwards
    np.testing.assert_array_equal(partly(sure=True), np.eye(3))
    np.testing.assert_array_equal(partly(shapes={}), np.eye(3))
    np.testing.assert_array_equal(partly(shapes={"jawOpen": np.tile([0, -3.0, 0], (300, 1))}), np.eye(3))
    np.testing.assert_array_equal(partly(Landmarks(left=np.array([0, 1.0, 0])))[0], [0, 1, 0])
    eyes = Eyes(np.array([[0, 32.0, 10], [0, -32.0, 10]]) + np.array([80.0, 0, 0]), True, True, "")
    turn = partly(Landmarks(eyes))
    np.testing.assert_array_equal(np.abs(turn[0]), [0, 1, 0])
    np.testing.assert_array_equal(turn[1:], [[0, 0, 1], [1, 0, 0]])  # eyes lie in front


def test_what_was_found_is_taken_where_it_differs_from_the_usual():
    for upright, turn, differ in ((True, np.eye(3), False), (False, np.eye(3), True), (True, TURNS["blender"], True)):
        assert frame._differ(Orientation(turn, upright), np.eye(3)) == differ


def test_a_rotation_agrees_with_the_sides_above_0_7_and_with_the_jaw_above_0_6():
    points = np.random.default_rng(0).normal(size=(300, 3)) * [75, 100, 90]

    def partly(marks=Landmarks(), **shapes):
        return frame._partly(points, shapes, marks, np.eye(3), sure=False)

    for share, first in ((0.7, [0, 1, 0]), (0.71, [1, 0, 0])):
        left = np.array([share, 0.705, 0.0])
        np.testing.assert_array_equal(partly(Landmarks(left=left))[0], first)
    away = np.array([0.5, 0.5, 0.7071])
    np.testing.assert_array_equal(partly(Landmarks(left=away))[0], [0, 0, 1])
    np.testing.assert_array_equal(partly(Landmarks(left=np.full(3, 0.577))), np.eye(3))  # along none: as usual
    for down, up in (([-0.8, -0.6, 0.0], [1, 0, 0]), ([-0.79, -0.61, 0.0], [0, 1, 0]), ([0.8, -0.6, 0.0], [-1, 0, 0])):
        moves = np.tile(np.array(down), (300, 1))
        np.testing.assert_array_equal(partly(jawOpen=moves)[1], up)


def test_a_rotation_agrees_with_eyes_that_lie_along_an_axis_up_to_a_tenth():
    points = np.array([[-1.0, -1, -1], [1, 1, 1]]) * 200
    for along, first in ((0.899, [1, 0, 0]), (0.901, [0, 1, 0])):
        across = np.sqrt(1 - along**2)
        half = 30.0 * np.array([0.0, along, across])
        eyes = Eyes(np.stack([half, -half]), True, True, "")
        turn = frame._partly(points, {}, Landmarks(eyes), np.eye(3), sure=False)
        np.testing.assert_array_equal(np.abs(turn[0]), first)


def test_eyes_by_the_form_replace_those_of_shapes_that_lie_half_their_distance_away(monkeypatch):
    class Face:
        def at(self, points):
            return 2.0 * points

    monkeypatch.setattr(frame, "match_face", lambda *_: Face())
    middle, half = 2.0 * frame.EYES_AT, 2.0 * frame.HALF_APART
    apart = 4 * 31.8
    for off, kept in ((0.49, True), (0.51, False), (None, False)):
        notes: list[str] = []
        found = None
        if off is not None:
            place = middle + np.array([0.0, off * apart, 0.0])
            found = Eyes(place - half, False, False, "lids")  # named the other way round
        marks = frame._by_form(np.zeros((3, 3)), np.zeros((0, 4), np.int64), Landmarks(found), notes)
        assert notes == ["the face was found by its form: no shapes of lids and lips show where it is"]
        np.testing.assert_allclose(marks.mouth, 2.0 * frame.MOUTH_AT)
        assert marks.eyes.sided and marks.eyes.balls != kept
        assert marks.eyes.by == ("lids" if kept else "the form of the face")
        np.testing.assert_allclose(marks.eyes.centres, (place if kept else middle) + half)
    monkeypatch.setattr(frame, "match_face", lambda *_: None)
    marks, notes = Landmarks(), []
    assert frame._by_form(np.zeros((3, 3)), np.zeros((0, 4), np.int64), marks, notes) is marks and notes == []
