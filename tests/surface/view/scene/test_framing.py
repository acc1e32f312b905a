"""Cameras show any head's face as they show the shipped one's."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ball_head import BallHead
from cards import card

from surface.head import Head
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.file import load_data
from surface.head.posing.dressing import WornMesh
from surface.view.scene import framing as framing_module
from surface.view.scene.camera import PRESETS, Camera
from surface.view.scene.framing import EYES, Framing, framed, framing_of

SHIPPED = Path(__file__).parents[4] / "configs" / "heads" / "ict"


@pytest.fixture(scope="module")
def shipped() -> HeadData:
    return load_data(SHIPPED)


def few(data: HeadData) -> HeadData:
    """The head's face, its back and its eyes only: enough to be framed."""
    wanted = ("face", "back", "eye_left")
    return replace(data, parts=[p for p in data.parts if p.name in wanted], seams=[], contacts=[], paint=[], rules=[])


def moved(data: HeadData, size: float, shift: tuple[float, float, float]) -> Head:
    """The head so much larger, and elsewhere."""

    def part(p: PartData) -> PartData:
        groups = [Group(g.name, g.ids, (size * g.moves).astype(np.float32)) for g in p.groups]
        return replace(p, points=size * p.points + shift, groups=groups)

    parts = [part(p) for p in data.parts]
    return Head(replace(data, parts=parts, eyes=size * data.eyes + shift, eye_radius=size * data.eye_radius))


def test_the_shipped_head_is_seen_from_exactly_the_presets(shipped):
    head = Head(few(shipped))
    assert framing_of(head) == Framing()
    for preset in PRESETS.values():
        assert framed(preset(), head) is not None and framed(preset(), head) == preset()


@pytest.mark.parametrize(("size", "shift"), [
    (1.0, (0, 1600, 0)), (0.2, (0, 0, 0)), (4.0, (300, 0, -500)), (1.0, (0, 0, -60)), (30.0, (0, 9000, 0)),
])  # fmt: skip
@pytest.mark.parametrize("known", ["eyes", "lids", "nothing"])
def test_any_other_head_is_seen_as_the_shipped_one(shipped, size, shift, known):
    data = few(shipped)
    if known != "eyes":
        data = replace(
            data, eye_radius=0.0, eyes=np.zeros((2, 3)), parts=[p for p in data.parts if p.name != "eye_left"]
        )
    if known == "nothing":
        data = replace(data, parts=[replace(p, groups=[]) for p in data.parts])
    head = moved(data, size, shift)
    for name, preset in PRESETS.items():
        camera = framed(preset(), head)
        for place in ((0.0, 36.1, 84.2), (30.0, -40.0, 100.0), (-60.0, 100.0, 20.0)):
            seen = _project(camera, size * np.array(place) + shift)
            np.testing.assert_allclose(seen[:2], _project(preset(), np.array(place))[:2], atol=0.07, err_msg=name)
            assert -1 < seen[2] < 1  # neither too near nor too far to be drawn


def test_the_pose_does_not_move_the_camera(shipped):
    head = moved(few(shipped), 1.0, (0, 1600, 0))
    before = framing_of(head)
    head.pose(head.values({"headYaw": 1.0, "jawOpen": 1.0}))
    assert framing_of(head) == before


def test_a_head_of_which_nothing_is_known_is_seen_from_the_presets():
    assert framing_of(BallHead()) == Framing()


def test_a_framing_scales_about_the_eyes_and_moves_with_them():
    framing = Framing((10.0, 1000.0, 50.0), 2.0)
    assert framing.point(tuple(EYES.tolist())) == (10.0, 1000.0, 50.0)
    camera = framing.camera(Camera.front())
    assert camera.distance == pytest.approx(2 * Camera.front().distance)
    assert camera.yaw_deg == pytest.approx(0.0) and camera.pitch_deg == pytest.approx(1.0)
    assert (camera.near, camera.far) == (2 * Camera.near, 2 * Camera.far)
    assert camera.zoom(1e9).distance == pytest.approx(240) and camera.zoom(1e-9).distance == pytest.approx(6000)


def _project(camera: Camera, point: np.ndarray) -> np.ndarray:
    clip = camera.matrix(1.0).astype(float) @ [*point, 1.0]
    return clip[:3] / clip[3]


def one_part(groups: list[Group], points: np.ndarray, eyes: float = 0.0) -> SimpleNamespace:
    """As much of a head's data as its framing reads; ``eyes``: half their distance, mm."""
    part = SimpleNamespace(material="skin", points=points, groups=groups)
    at = np.array([[eyes, 36.1, 84.2], [-eyes, 36.1, 84.2]])
    return SimpleNamespace(parts=[part], eyes=at, eye_radius=12.0 if eyes else 0.0)


AT = np.array([0.0, 36.1, 84.2])
CROWN, LIPS, EAR = (AT + np.array(shift) for shift in ((0, 108.7, -70), (0, -68.0, 20), (92.1, 0, -90)))


@pytest.mark.parametrize(("places", "eyes", "size"), [
    ([CROWN], 31.8, 1.0),
    ([2 * (CROWN - AT) + AT], 31.8, 2.0),  # by its crown
    ([CROWN, 2 * (EAR - AT) + AT], 31.8, 2.0),  # by its width at the ears, at either side
    ([CROWN, 2 * (EAR - AT) * [-1, 1, 1] + AT], 31.8, 2.0),
    ([CROWN, 2 * (EAR - AT) + AT + [0, 67.0, 0]], 31.8, 2.0),
    ([CROWN, 2 * (EAR - AT) + AT - [0, 69.0, 0]], 31.8, 1.0),  # shoulders do not count
    ([0.3 * (CROWN - AT) + AT], 31.8, 0.7),  # a face that has no more
    ([9 * (CROWN - AT) + AT], 31.8, 2.5),  # a hat
    ([9 * (CROWN - AT) + AT], 63.6, 5.0),
    ([2 * (CROWN - AT) + AT], 0.0, 2.0),
])  # fmt: skip
def test_a_head_is_as_large_as_its_crown_and_its_ears_show_it(places: list, eyes: float, size: float) -> None:
    data = one_part([], np.zeros((1, 3)), eyes)
    assert framing_module._size(data, np.array(places), AT) == pytest.approx(size, rel=1e-3)


def test_a_head_without_eyes_is_measured_by_its_lips() -> None:
    lips = Group("mouthFunnel", np.array([0], np.int32), np.ones((1, 3), np.float32))
    data = one_part([lips], (3 * (LIPS - AT) + AT)[None])
    assert framing_module._size(data, np.array([9 * (CROWN - AT) + AT]), AT) == pytest.approx(7.5, rel=1e-3)
    assert framing_module._size(data, np.array([0.1 * (CROWN - AT) + AT]), AT) == pytest.approx(2.1, rel=1e-3)


def test_eyes_are_where_the_lids_blink_or_below_the_crown() -> None:
    """Lids lie 0.5 mm above the eyes' middle and 9.4 mm before it, 63 mm apart, on a head of usual size."""
    places = 2.0 * np.array([[31.5, 36.6, 93.6], [-31.5, 36.6, 93.6]]) + [5.0, 6.0, 7.0]
    blinks = [Group(f"eyeBlink{s}", np.array([k], np.int32), np.ones((1, 3), np.float32))
              for k, s in enumerate(("Left", "Right"))]  # fmt: skip
    at, known = framing_module._eyes(one_part(blinks, places), places)
    np.testing.assert_allclose(at, 2.0 * AT + [5.0, 6.0, 7.0], atol=1e-6)
    assert known
    box = np.array([[-175.2, -338.0, -50.0], [193.2, 338.0, 250.0]])
    at, known = framing_module._eyes(one_part(blinks[:1], places), box)
    np.testing.assert_allclose(at, [9.0, 338.0 - 2 * 108.7, 250.0 - 2 * 46.0])
    assert not known
    assert framing_module._height(box) == pytest.approx(2.0)
    assert framing_module._height(box * [3, 1, 1]) == pytest.approx(2.0)
    assert framing_module._height(box * [0.5, 1, 1]) == pytest.approx(1.0)
    assert framing_module._height(0 * box) == 1e-3


def test_a_few_points_that_move_far_do_not_move_the_middle() -> None:
    points = np.array([[0.0, 5, 0], [1, 4, 0], [2, 3, 0], [900, 900, 0]])
    middle = framing_module._weighted_median(points, np.array([1.0, 1.0, 1.0, 2.0]))
    np.testing.assert_array_equal(middle, [2, 5, 0])
    np.testing.assert_array_equal(framing_module._weighted_median(points, np.array([0.0, 1.0, 0.0, 0.5])), [1, 4, 0])


@pytest.mark.parametrize(("size", "shift", "same"), [
    (1.0, (11.9, 0, 0), True), (1.0, (0, -12.1, 0), False), (1.14, (0, 0, 0), True), (1.17, (0, 0, 0), False),
    (0.88, (0, 0, 0), True), (0.85, (0, 0, 0), False),
])  # fmt: skip
def test_a_head_that_hardly_differs_is_seen_from_the_same_places(size: float, shift: tuple, same: bool) -> None:
    crown = size * (CROWN - AT) + AT + shift
    surface = SimpleNamespace(rect=(0.0, 1.0, 0.0, 1.0), evaluate=lambda uv: np.tile(crown, (len(uv), 1)))
    data = one_part([], np.zeros((1, 3)), 31.8)
    data.eyes = data.eyes + shift
    part = SimpleNamespace(material="skin", surface=surface, uv=np.zeros((900, 2)))
    assert (framing_of(SimpleNamespace(parts=[part], data=data)) == Framing()) == same


def wearing(data: HeadData, *heights: float, wide: float = 60.0) -> Head:
    """The head with a card above it, of so much height over the middle of the eyes, mm, and so wide to each side."""
    head = Head(data)
    cards = [card((-wide, 0.0), (wide, EYES[1] + up), z=0.0) for up in heights]
    head.accessories = tuple(WornMesh(one, data.neck) for one in cards)
    return head


def test_hats_and_hair_are_in_the_picture_and_the_face_stays_large(shipped):
    data = few(shipped)
    assert framing_of(wearing(data, 110.0)) == Framing()
    for up, wide in ((180.0, 60.0), (120.0, 190.0), (240.0, 90.0)):
        camera = framed(Camera.front(), wearing(data, up, wide=wide))
        for x, y in ((0.0, EYES[1] + up), (wide, EYES[1] + min(up, 100.0))):
            place = camera.matrix(1.0) @ [x, y, 0.0, 1.0]
            assert np.abs(place[:2] / place[3]).max() < 1.0
        chin = camera.matrix(1.0) @ [0.0, EYES[1] - 115.0, 80.0, 1.0]
        assert chin[1] / chin[3] > -0.95
    huge = framing_of(wearing(data, 900.0, wide=900.0))
    assert huge.size == pytest.approx(1.4, rel=0.1)


def test_a_stray_card_or_one_far_behind_the_head_does_not_move_the_camera(shipped):
    head = wearing(few(shipped), 110.0, wide=100.0)
    for z in (-220.0, -900.0):  # as near as any hair, but less than a hundredth of it; and where no camera shows it
        stray = card((-2.5, 150.0), (2.5, 155.0), z=z)
        head.accessories = (*head.accessories[:1], WornMesh(stray, head.data.neck))
        assert framing_of(head) == Framing()
    head.accessories = head.accessories[1:]
    assert framing_of(head) == Framing()
    head.accessories = (WornMesh(card((-2.5, 150.0), (2.5, 155.0), z=-220.0), head.data.neck),)
    assert framing_of(head).size > 1.2


def test_pictures_that_draw_no_accessories_make_no_room_for_them(shipped):
    bare, hat = (moved(few(shipped), 2.0, (0.0, 900.0, 0.0)) for _ in range(2))
    hat.accessories = tuple(WornMesh(card((-60, 900), (60, 1500)), hat.data.neck) for _ in range(1))
    assert framing_of(hat) != framing_of(bare) == framing_of(hat, worn=False)
    assert framed(Camera.front(), hat, worn=False) == framed(Camera.front(), bare)


def test_a_framing_is_about_the_eyes_and_says_apart_how_far_up_cameras_look(shipped):
    data = few(shipped)
    framing = framing_of(wearing(data, 240.0))
    np.testing.assert_allclose(framing.at, data.eyes.mean(axis=0), atol=1e-4)
    assert framing.up > 10.0 and framing.point(tuple(EYES.tolist()))[1] == pytest.approx(framing.at[1] + framing.up)
