"""What parameters move, on sheets of which every motion is given."""

from __future__ import annotations

import numpy as np
import pytest

from surface.check import motions
from surface.check.subject import Subject
from tests.surface.check import plain

POINTS, TRIANGLES = plain.sheet((-60, 60), (-60, 60), 1.0)


def at_x(x: float, move: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """The moves of the column of points at x."""
    return np.outer(np.abs(POINTS[:, 0] - x) < 0.01, move)


def face(**moves: np.ndarray) -> Subject:
    return plain.subject(plain.part("face", POINTS, TRIANGLES, moves=moves))


def turning(head: Subject) -> Subject:
    """Less the neck, of which these heads have none: its angles move nothing."""
    head.__dict__["claimed"] = tuple(n for n in head.claimed if not n.startswith("head"))
    return head


@pytest.mark.parametrize(("mm", "scale", "empty"), [(0.09, 1, 1), (0.11, 1, 0), (0.19, 2, 1), (0.21, 2, 0)])
def test_a_shape_that_moves_nothing_is_named(mm: float, scale: int, empty: int) -> None:
    part = plain.part("face", POINTS, TRIANGLES, moves={"cheekPuff": at_x(10.0, (0.0, -mm, 0.0))})
    found = [f.text for f in motions.empty_shapes(turning(plain.subject(part, eyes=scale * plain.EYES)))]
    assert found == ["cheekPuff = 1 moves nothing, though the head has something of that name"] * empty


def test_a_head_of_no_vertices_moves_nothing() -> None:
    nothing = plain.part("face", np.zeros((0, 3)), np.zeros((0, 3)), moves={"cheekPuff": np.zeros((0, 3))})
    assert len(list(motions.empty_shapes(turning(plain.subject(nothing))))) == 1


def test_a_shape_that_moves_by_its_wrinkles_only_is_empty_and_a_jaw_that_turns_is_not() -> None:
    head = turning(face(cheekPuff=at_x(0.0, (0, 0, 5)), jawOpen=at_x(0.0, (0, -5, 0))))
    assert list(motions.empty_shapes(head)) == []
    for part in head.head.data.parts:
        for group in part.groups:
            group.moves[:] = 0.0
    wrinkles = {"cheekPuff": at_x(0.0, (0, 0, 5)), "jawOpen": at_x(0.0, (0, -5, 0))}
    head.head.parts[0].moves.update(wrinkles)  # type: ignore[attr-defined]
    assert [f.text.split()[0] for f in motions.empty_shapes(head)] == ["jawOpen", "cheekPuff"]
    head.head.data.jaw.angle_rad = 0.4  # type: ignore[misc]
    assert [f.text.split()[0] for f in motions.empty_shapes(head)] == ["cheekPuff"]


@pytest.mark.parametrize(("x", "wrong"), [(-3.0, False), (-5.0, True), (5.0, False)])
def test_a_side_begins_off_the_middle(x: float, wrong: bool) -> None:
    """0.06 of 63.6 mm are 3.8 mm."""
    found = [f.text.partition(":")[0] for f in motions.swapped_sides(turning(face(cheekSquintLeft=at_x(x))))]
    assert found == ["cheekSquintLeft"] * wrong
    mirrored = motions.swapped_sides(turning(face(cheekSquintRight=at_x(-x), cheekPuff=at_x(-x))))
    assert [f.text.partition(":")[0] for f in mirrored] == ["cheekSquintRight"] * wrong


def test_shapes_that_go_across_are_asked_where_they_go() -> None:
    right, left = (at_x(x, (move, 0.0, 0.0)) for x, move in ((40.0, -2.0), (-40.0, 2.0)))
    good = face(mouthLeft=left, jawLeft=left, mouthRight=right, jawRight=right)
    assert list(motions.swapped_sides(turning(good))) == []
    (found,) = motions.swapped_sides(turning(face(mouthLeft=right, jawRight=left, mouthSmileLeft=right)))
    assert found.text.startswith("jawRight, mouthLeft: ")
    assert motions._direction(face(jawLeft=at_x(9.0, (3.0, 0.0, -4.0))), "jawLeft") == pytest.approx(0.6)
    assert motions._direction(face(jawLeft=at_x(9.0, (0.0, 0.0, 0.0))), "jawLeft") == 0.0


@pytest.mark.parametrize(("count", "named"), [(4, "{0}, {1}, {2}, {3}"), (5, "{0}, {1}, {2}, {3}, {4}"),
                                              (6, "{0}, {1}, {2}, {3} and 2 more")])  # fmt: skip
def test_five_swapped_shapes_are_listed_and_more_are_counted(count: int, named: str) -> None:
    names = ("eyeBlinkLeft", "eyeSquintLeft", "eyeWideLeft", "mouthSmileLeft", "browDownLeft", "noseSneerLeft")[:count]
    (found,) = motions.swapped_sides(turning(face(**{n: at_x(-30.0) for n in names})))
    assert found.text.partition(":")[0] == named.format(*names)


def test_eyes_that_are_exchanged_are_named() -> None:
    part = plain.part("face", POINTS, TRIANGLES)
    (found,) = motions.swapped_sides(turning(plain.subject(part, eyes=plain.EYES[::-1])))
    assert found.text == "the left eye lies to the right of the right one" and "pivots.eyes" in found.hint


def test_the_gaze_of_the_other_eye_is_swapped() -> None:
    assert [motions._side_of(n) for n in ("leftEyeYaw", "rightEyePitch", "jawLeft", "browDownRight", "headYaw")] == [
        1, -1, 1, -1, 0
    ]  # fmt: skip


def test_where_a_shape_moves_is_meant_over_all_parts_by_how_far_each_point_moves() -> None:
    other = plain.part("other", POINTS, TRIANGLES, moves={"cheekPuff": at_x(-10.0, (0.0, 3.0, 4.0))})
    head = plain.subject(plain.part("face", POINTS, TRIANGLES, moves={"cheekPuff": at_x(30.0)}), other)
    assert motions._mean_offset(head, "cheekPuff", 2.0) == pytest.approx((30.0 * 1.0 - 10.0 * 5.0) / 6.0 - 2.0)
    assert motions._mean_offset(head, "headYaw", 2.0) == 0.0


def test_the_middle_lies_between_the_eyes_or_in_the_middle_of_the_skin() -> None:
    part = plain.part("face", np.add(POINTS, [7.0, 0.0, 0.0]), TRIANGLES)
    assert motions._middle(plain.subject(part, eyes=np.add(plain.EYES, [3.0, 0.0, 0.0]))) == pytest.approx((3.0, 63.6))
    assert motions._middle(plain.subject(part, eyes=None)) == pytest.approx((7.0, 42.0))
    assert motions._middle(plain.subject(plain.eyeball(0), eyes=None)) == pytest.approx((0.0, 1e-6))
    assert motions._middle(plain.subject(part, eyes=0.0 * plain.EYES))[1] == pytest.approx(1e-6)


def blinking(opening: float, left: float | None, right: float | None, scale: float = 1.0) -> list:
    """Findings for lids that are open by so many mm, and that a blink of either side leaves open by so many."""
    lower = plain.sheet((-60, 60), (-40, -0.5 * opening), 0.5 * (80.0 - opening) / 4, 20.0)
    points, triangles = plain.sheet((-60, 60), (-20, 20), 10.0, 20.0)
    points[:, 1] += 20.0 + 0.5 * opening
    moves = {
        name: np.outer(points[:, 0] * sign > -1.0, [0.0, rest - opening, 0.0])
        for name, sign, rest in (("eyeBlinkLeft", 1, left), ("eyeBlinkRight", -1, right)) if rest is not None
    }  # fmt: skip
    lids = [plain.part("lower", *lower), plain.part("upper", points, triangles, moves=moves)]
    return list(motions.blind_lids(plain.subject(*lids, plain.eyeball(0), plain.eyeball(1), eyes=plain.EYES * scale)))


def test_a_blink_that_leaves_an_eye_open_is_named() -> None:
    assert blinking(8.0, 0.0, 0.0) == [] and blinking(8.0, 0.3, 0.3) == []
    (found,) = blinking(8.0, 2.0, 0.3)
    assert found.text.startswith("eyeBlinkLeft = 1 leaves the eye ") and not found.warning
    (found,) = blinking(8.0, 0.0, 0.8)
    assert found.text.startswith("eyeBlinkRight = 1 leaves the eye ")


def test_an_eye_that_nothing_closes_is_a_warning_where_the_other_one_has_no_blink_either() -> None:
    (found,) = blinking(8.0, None, 0.0)
    assert found.text.startswith("the head has no eyeBlinkLeft: the eye stays ") and not found.warning
    assert "--expressions-from ict" in found.hint
    assert [f.warning for f in blinking(8.0, None, None)] == [True, True]
    assert blinking(0.7, None, None) == []  # eyes that are shut at rest need none
    assert len(blinking(1.3, None, None)) == 2
