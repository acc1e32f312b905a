"""Eyes and mouth out of shapes and balls, whatever the unit and the axes."""

from dataclasses import replace

import ball_head
import numpy as np
import pytest
from traps import EYE_X, good_head, on_body, transformed

from surface.fit.source.placing import anatomy
from surface.fit.source.placing.anatomy import find_eyes, find_landmarks, in_order, middle_of
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


def ball(centre=(3.0, -4.0, 5.0), radius: float = 12.0, reach: float = np.pi, count: int = 200) -> np.ndarray:
    """Points all over a ball, or over a cap that reaches so far from +z."""
    z = np.linspace(1.0, np.cos(reach), count)
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    r = np.sqrt(np.maximum(1.0 - z**2, 0.0))
    return np.array(centre) + radius * np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


@pytest.mark.parametrize("scale", [1e-3, 1.0, 300.0])
def test_a_ball_and_its_front_half_are_spheres_and_other_things_are_not(scale):
    for reach in (np.pi, np.pi / 2):
        centre, radius = anatomy._sphere(scale * ball(reach=reach))
        np.testing.assert_allclose(centre, scale * np.array([3.0, -4, 5]), atol=1e-6 * scale)
        assert radius == pytest.approx(12.0 * scale)
    rng = np.random.default_rng(0)
    assert anatomy._sphere(scale * ball(reach=1.0)) is None  # a shallow cap
    assert anatomy._sphere(scale * rng.uniform(-1, 1, (300, 3))) is None  # a box full of points
    assert (
        anatomy._sphere(scale * (ball() * [3.0, 1, 1])) is None and anatomy._sphere(scale * ball() * [1, 1, 0]) is None
    )
    assert anatomy._sphere(scale * (ball() * [1.15, 1, 1])) is not None


def test_a_cornea_is_left_out_of_a_sphere():
    points = ball(count=400)
    front = points[:, 2] > 5 + 10.8
    points[front] += [0, 0, 2.0]
    centre, radius = anatomy._sphere(points)
    np.testing.assert_allclose(centre, [3, -4, 5], atol=0.01)
    assert radius == pytest.approx(12, abs=0.01)


def pieces(*balls):
    """Balls as pieces of one mesh."""
    points, faces = [], []
    for k, (centre, radius, rows) in enumerate(balls):
        at, _, tri = ball_head.ball(radius, rows, 13)
        points.append(at + centre)
        faces.append(
            np.pad(tri, ((0, 0), (0, 1)), constant_values=-1) + np.array([1, 1, 1, 0]) * sum(map(len, points[:k]))
        )
    return np.vstack(points), np.vstack(faces)


@pytest.mark.parametrize(
    ("other", "found"),
    [((64, 0, 0, 12, 13), True), ((25, 0, 0, 12, 13), False), ((28, 0, 0, 12, 13), True), ((105, 0, 0, 12, 13), True),
     ((110, 0, 0, 12, 13), False), ((64, 0, 0, 11, 13), True), ((64, 0, 0, 10.5, 13), False),
     ((64, 0, 0, 13.5, 13), False),
     ((64, 0, 0, 12, 27), False)],
)  # fmt: skip
def test_pairs_of_balls_are_alike_and_as_far_apart_as_eyes_are(other, found):
    x, y, z, radius, rows = other
    pairs = anatomy._eyeballs(*pieces(((0, 0, 0), 12.0, 13), ((x, y, z), radius, rows)))
    assert len(pairs) == found
    if found:
        np.testing.assert_allclose(sorted(pairs[0][:, 0]), [0, x], atol=1e-6)


def test_the_pair_with_most_vertices_comes_first():
    points, faces = pieces(((0, 0, 0), 5.0, 9), ((30, 0, 0), 5.0, 9), ((0, 90, 0), 12.0, 17), ((60, 90, 0), 12.0, 17))
    first, *_ = anatomy._eyeballs(points, faces)
    assert first[:, 1].tolist() == pytest.approx([90, 90])


def test_a_shape_of_two_places_is_taken_apart_and_one_of_one_place_is_not():
    rows = np.vstack([ball((30, 0, 0), 5.0), ball((-30, 5, 0), 5.0)])
    weight = np.ones((400, 1)) * [0.0, -1.0, 0.0]
    halves = anatomy._two(rows, weight)
    halves = halves[np.argsort(-halves[:, 0])]
    np.testing.assert_allclose(halves, [[30, 0, 0], [-30, 5, 0]], atol=0.1)
    heavy = weight * np.where(rows[:, 1:2] > 0, 3.0, 1.0)
    w = heavy[:200, 1] ** 2
    np.testing.assert_allclose(
        anatomy._two(rows, heavy)[0 if anatomy._two(rows, heavy)[0, 0] > 0 else 1], w @ rows[:200] / w.sum()
    )
    assert anatomy._two(rows, 0 * weight) is None
    wide = np.random.default_rng(0).uniform(-1, 1, (500, 3)) * [60, 60, 5]
    assert anatomy._two(wide, np.ones((500, 3))) is None  # all over the face
    assert anatomy._two(rows[:1], weight[:1]) is None


def test_the_kinds_of_lids_are_tried_in_order_and_eyes_beside_them_are_chosen():
    at = np.vstack([EYES, EYES + np.array([0, -10.0, 0])])

    def move(k):
        return np.eye(4)[k][:, None] * [0, 1.0, 0]

    both = {"eyeSquintLeft": move(2), "eyeSquintRight": move(3)}
    np.testing.assert_allclose(find_eyes(at, NONE, both).centres, at[2:])
    best = both | {"eyeBlinkLeft": move(0), "eyeBlinkRight": move(1)}
    np.testing.assert_allclose(find_eyes(at, NONE, best).centres, at[:2])
    assert find_eyes(at, NONE, {"eyeBlinkLeft": move(0), "eyeBlinkRight": move(0)}) is None
    assert find_eyes(at, NONE, {"eyeBlinkLeft": move(0)}) is None
    sided = find_eyes(HEAD.vertices, HEAD.faces, {}, left=np.array([-1.0, 0, 0]))
    assert sided.sided and sided.centres[0, 0] < sided.centres[1, 0]
    other = find_eyes(HEAD.vertices, HEAD.faces, {}, left=np.array([1.0, 0, 0]))
    assert other.centres[0, 0] > other.centres[1, 0]


@pytest.mark.parametrize(("up", "balls"), [(0.0, True), (12.0, True), (45.0, False)])
def test_balls_count_as_eyes_only_near_the_lids(up, balls):
    moved = HEAD.vertices.copy()
    moved[len(moved) - 2 * 13 * 17 :] += [0, up, 0]
    assert find_eyes(moved, HEAD.faces, shapes(HEAD)).balls == balls


def test_middles_weigh_vertices_by_the_squares_of_their_moves():
    at, move = np.array([[0.0, 0, 0], [10, 0, 0]]), np.array([[0.0, 1, 0], [0, 0, 3.0]])
    np.testing.assert_allclose(middle_of(at, move), [9.0, 0, 0])
    assert middle_of(at, None) is None and middle_of(at, 0 * move) is None


def test_sides_of_brows_and_cheeks_tell_the_left_and_those_of_the_jaw_do_not():
    at = np.array([[5.0, 1, 0], [-5.0, 1, 0]])
    one, two = np.array([[0, 1.0, 0], [0, 0, 0]]), np.array([[0, 0, 0], [0, 1.0, 0]])
    np.testing.assert_allclose(anatomy._left(at, {"browDownLeft": one, "browDownRight": two}), [1, 0, 0])
    np.testing.assert_allclose(anatomy._left(at, {"cheekSquintLeft": two, "cheekSquintRight": one}), [-1, 0, 0])
    for name in ("jaw", "mouth"):
        assert anatomy._left(at, {f"{name}Left": one, f"{name}Right": two}) is None
    assert anatomy._left(at, {"browDownLeft": one}) is None


def test_a_pair_is_put_in_the_order_of_another():
    pair = np.array([[1.0, 0, 0], [5.0, 0, 0]])
    np.testing.assert_array_equal(in_order(pair, pair + 0.3), pair)
    np.testing.assert_array_equal(in_order(pair, pair[::-1] + 0.3), pair[::-1])
    assert anatomy._distance(pair, pair[::-1] + np.array([[0, 3.0, 0], [0, 1.0, 0]])) == pytest.approx(3.0)
