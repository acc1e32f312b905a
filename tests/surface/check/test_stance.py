"""How a head stands: its size, its place before the camera, its eyes, and which way its parts face."""

from __future__ import annotations

import numpy as np
import pytest

from surface.check import stance
from surface.check.raster import View, view_rotation
from tests.surface.check import plain

TURNED = {"triangles": lambda p: setattr(p, "triangles", np.ascontiguousarray(p.triangles[:, ::-1])),
          "normals": lambda p: setattr(p, "normals", -p.normals)}  # fmt: skip


def face(y: tuple[float, float] = (-100.0, 100.0), **options: object):
    return plain.part("face", *plain.sheet((-60, 60), y, 10.0, -20.0), **options)  # type: ignore[arg-type]


def ball(name: str, radius: float, material: str, follows: str = "skin"):
    points, triangles, normals = plain.ball((0, 0, 0), radius)
    return plain.part(name, points, triangles, material=material, follows=follows, normals=normals)


@pytest.mark.parametrize(("apart", "wrong"), [(29.9, True), (30.0, False), (140.0, False), (140.1, True)])
def test_a_head_has_the_size_of_one_by_its_eyes(apart: float, wrong: bool) -> None:
    eyes = np.array([[0.6, 0.8, 0.0], [0.0, 0.0, 0.0]]) * apart
    found = [f.text for f in stance.wrong_unit(plain.subject(face(), eyes=eyes))]
    assert found == [f"the eyes are {apart:.3g} mm apart; a head has 30 to 140 mm"] * wrong


@pytest.mark.parametrize(("high", "wrong"), [(89.0, True), (90.0, False), (900.0, False), (901.0, True)])
def test_a_head_without_eyes_has_the_size_of_one_by_its_skin(high: float, wrong: bool) -> None:
    found = [f.text for f in stance.wrong_unit(plain.subject(face((0.0, high)), eyes=None))]
    assert found == [f"the skin is {high:.3g} mm high; a head has 90 to 900 mm"] * wrong


# at the face's distance of 950 mm a field of view of 20.5 degrees shows 171.8 mm to each side, 95 % of it 163.2 mm
@pytest.mark.parametrize(("shift", "seen"), [
    ((130.0, 0, 0), True), ((133.0, 0, 0), False), ((-130.0, 0, 0), True), ((-133.0, 0, 0), False),
    ((0, 155.0, 0), True), ((0, 159.5, 0), False), ((0, -167.0, 0), True), ((0, -171.0, 0), False),
    ((0, 0, 2000.0), False), ((0, 0, -2000.0), True),
])  # fmt: skip
def test_the_eyes_lie_in_the_front_cameras_picture(shift: tuple[float, float, float], seen: bool) -> None:
    eyes = plain.EYES + np.array([0.0, 0.0, 40.0]) + shift
    found = list(stance.off_camera(plain.subject(face(), eyes=eyes), None))
    assert [f.kind for f in found] == ["off camera"] * (not seen)
    if not seen:
        middle = ", ".join(f"{v:.0f}" for v in eyes.mean(axis=0))
        assert f"({middle}) mm" in found[0].text


def test_the_mouth_lies_in_the_picture_too_and_without_either_the_front_of_the_skin() -> None:
    eyes = plain.EYES + np.array([0.0, 0.0, 40.0])
    head = plain.subject(face(), eyes=eyes)
    assert len(stance._face_landmarks(head, plain.line_of_lips())) == 3
    assert list(stance.off_camera(head, plain.line_of_lips(-66.0))) == []
    assert list(stance.off_camera(head, plain.line_of_lips(-300.0)))
    z = np.arange(21.0)
    line = plain.part("face", np.column_stack([2.0 * z, 3.0 * z, z]), [[0, 1, 2]])
    np.testing.assert_allclose(
        stance._face_landmarks(plain.subject(line, eyes=None), None), [[38.0, 57.0, 19.0]]
    )  # 18 to 20


@pytest.mark.parametrize(("low", "high", "forward"), [(80, 100, True), (0, 20, False), (34, 40, True), (30, 35, False)])
def test_the_skin_that_moves_lies_in_front(low: float, high: float, forward: bool) -> None:
    z = np.linspace(-50.0, 50.0, 101)
    points = np.column_stack([z, 0.0 * z, z])
    share = np.linspace(0, 100, 101)
    moves = np.outer((share >= low) & (share <= high), [0.0, 3.0, 4.0])
    head = plain.subject(
        plain.part("face", points, [[0, 1, 2]], moves={"cheekPuff": moves, "headYaw": moves[::-1]}), eyes=None
    )
    assert stance._faces_forward(head) == forward
    found = [f.text for f in stance.off_camera(head, plain.line_of_lips())]
    assert found == ["the front camera sees the back of the head"] * (not forward)


def test_a_face_that_nothing_moves_is_taken_to_look_forward() -> None:
    assert stance._faces_forward(plain.subject(face(), plain.eyeball(0)))


def test_eyes_that_are_missing_are_named() -> None:
    assert list(stance.missing_eyes(plain.subject(face(), plain.eyeball(0), plain.eyeball(1)))) == []
    (none,) = stance.missing_eyes(plain.subject(face(), eyes=None))
    assert none.warning and "no eyes" in none.text
    both = [f.text for f in stance.missing_eyes(plain.subject(face()))]
    assert both == [f"no part follows {s}_eye: the {s} eye is a hole" for s in ("left", "right")]
    (one,) = stance.missing_eyes(plain.subject(face(), plain.eyeball(0)))
    assert "right eye is a hole" in one.text and not one.warning


@pytest.mark.parametrize(("away", "wrong"), [((5.0, 5.0, 90.0), False), ((5.2, -5.2, 0.0), True)])
def test_an_eyeball_lies_where_it_turns(away: tuple[float, float, float], wrong: bool) -> None:
    head = plain.subject(face(), plain.eyeball(0), plain.eyeball(1, plain.EYES[1] + away))  # 0.6 of 12 mm: 7.2 mm
    found = [f.text for f in stance.missing_eyes(head)]
    assert found == ["the right eyeball lies 7.4 mm from the point about which it turns"] * wrong


def test_an_eyeball_behind_the_skin_is_named() -> None:
    before = plain.part("lid", *plain.sheet((0, 60), (-30, 30), 10.0, 30.0))
    (found,) = stance.missing_eyes(plain.subject(before, plain.eyeball(0), plain.eyeball(1)))
    assert found.text == "nothing of the left eyeball can be seen from the front"


@pytest.mark.parametrize("way", TURNED)
@pytest.mark.parametrize(("material", "radius", "named"), [
    ("skin", 60.0, True), ("skin", 40.0, False), ("teeth", 40.0, True), ("gums", 40.0, True), ("tongue", 40.0, True),
    ("eye", 40.0, True), ("hair", 60.0, False), ("skin", 0.9, False),
])  # fmt: skip
def test_a_part_that_shows_its_back_is_named(way: str, material: str, radius: float, named: bool) -> None:
    """A skin of 50 mm hides what lies inside; what is solid is looked at alone then, as its outside shows always."""
    bad = ball("bad", radius, material)
    TURNED[way](bad)
    shown = {"triangles": "triangles run", "normals": "normals point"}[way]
    hiding = ball("face", 50.0, "skin") if radius > 1 else ball("face", 0.5, "eye")
    found = [f.text for f in stance.inside_out(plain.subject(hiding, bad))]
    assert found == [f"part 'bad': its {shown} inwards, 100 % of what shows"] * named


def tube(yaw: float, *, deep: float = 60.0, radius: float = 20.0):
    """A tube that is open towards a viewer at ``yaw`` only, and a disc in it that shows him its back."""
    angle = np.radians(yaw)
    out, aside = np.array([np.sin(angle), 0, np.cos(angle)]), np.array([np.cos(angle), 0, -np.sin(angle)])
    uv, triangles = plain.sheet((0.0, 1.0), (0.0, 1.0), 0.025)
    turn = 2.0 * np.pi * uv[:, 0]
    ring = np.cos(turn)[:, None] * aside + np.outer(np.sin(turn), [0, 1, 0])
    wall = ring * (radius * np.minimum(1.0, 4.0 * (1.0 - uv[:, 1])))[:, None] - np.outer(uv[:, 1], (deep + 20.0) * out)
    disc = ring * (0.9 * radius * uv[:, 1])[:, None] - deep * out
    normals = np.tile(out, (len(uv), 1))
    hull = plain.part("hull", wall, triangles, normals=ring)
    back = triangles if yaw_faces(disc, triangles, out) < 0 else triangles[:, ::-1]
    return hull, plain.part("disc", disc, back, normals=normals)


def yaw_faces(points: np.ndarray, triangles: np.ndarray, way: np.ndarray) -> float:
    """Whether triangles face a direction: more than 0."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return float((np.cross(b - a, c - a) @ way).sum())


@pytest.mark.parametrize(("yaw", "named"), [*((v, True) for v in (0, 38, -38, 90, -90, 180)), (135, False)])
def test_a_head_is_looked_at_from_the_front_both_sides_and_behind(yaw: float, named: bool) -> None:
    found = [f.text for f in stance.inside_out(plain.subject(*tube(yaw)))]
    assert ["part 'disc': its triangles run inwards, 100 % of what shows"] * named == [t for t in found if "disc" in t]


@pytest.mark.parametrize(("share", "named"), [(0.5, False), (0.7, True)])
def test_a_part_may_show_some_of_its_back(share: float, named: bool) -> None:
    part = ball("face", 50.0, "skin")
    back = part.rest[part.triangles].mean(axis=1)[:, 1] > 50.0 * (1.0 - 2.0 * share)  # as much of the ball's area
    part.triangles[back] = part.triangles[back][:, ::-1]
    found = [f.text for f in stance.inside_out(plain.subject(part))]
    assert len(found) == named


def test_both_sides_of_a_sheet_are_counted_by_triangles_and_by_normals() -> None:
    head = plain.subject(face())
    front = stance._picture(head, head.rest, 0.0)
    shown = front.depth.size
    assert shown == 101 * 167  # 120 x 200 mm at 1.2 mm a pixel
    normals = [p.normals for p in head.parts]
    assert stance._sides_shown(head, front, head.rest, normals) == {0: (shown, 0, 0)}
    assert stance._sides_shown(head, front, head.rest, [-normals[0]]) == {0: (shown, 0, shown)}
    back = View((-50.0, 50.0), (-50.0, 50.0), 1.0, view_rotation(180.0))
    seen = stance._sides_shown(head, back.draw(head.shapes(head.rest)), head.rest, normals)
    assert seen == {0: (101 * 101, 101 * 101, 101 * 101)}


def test_a_picture_of_a_head_in_any_unit_has_a_size_that_can_be_drawn() -> None:
    huge = plain.part("face", *plain.sheet((-6000, 6000), (-9000, 9000), 6000.0))
    assert stance._picture(plain.subject(huge), plain.subject(huge).rest, 0.0).depth.shape == (601, 601)


def test_only_what_is_looked_at_alone_is_drawn() -> None:
    head = plain.subject(ball("face", 50.0, "skin"), ball("tongue", 12.0, "tongue"))
    shown, by_way, by_normal = stance._sides_shown_alone(head, 1)
    assert shown == pytest.approx(np.pi * 10.0**2, rel=0.05)  # in pixels of 1.2 mm
    assert by_way <= 2 and by_normal <= 2  # at its rim
