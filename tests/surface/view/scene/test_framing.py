"""Cameras show any head's face as they show the shipped one's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ball_head import BallHead

from surface.head import Head
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.file import load_data
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
