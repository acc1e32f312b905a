"""Points of the face in a picture: taken, dragged, reshaped, kept."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.face.point_editing import PointEditor, Screen
from controller.stage.inverse import load_group
from controller.stage.stage import load_stage
from controller.tools.check import check_anything
from surface.head import Head
from surface.view.scene.camera import Camera

SIZE = (1280.0, 720.0)
CORNER, BROW = np.array([28.6, -34.0, 102.0]), np.array([18.0, 56.0, 106.0])


@pytest.fixture(scope="module")
def folder() -> Path:
    return find_config("heads", "ict")


@pytest.fixture(scope="module")
def head(folder: Path) -> Head:
    return Head.load(folder)


@pytest.fixture(scope="module")
def handles(head: Head, folder: Path) -> PointEditor:
    found = PointEditor(head, lambda: Head.load(folder), P)
    assert not found.ready and not found.take((0.0, 0.0), Screen(Camera.front(), SIZE), P.neutral())
    found.prepare()
    found._thread.join(60.0)
    assert found.ready
    return found


def pixel(screen: Screen, place: np.ndarray) -> tuple[float, float]:
    x, y, _ = screen.project(place[None])[0]
    return float(x), float(y)


def test_a_pixel_and_a_place_are_each_others_inverse() -> None:
    screen = Screen(Camera.three_quarter(), SIZE)
    rng = np.random.default_rng(0)
    for place in rng.uniform(-80, 80, (20, 3)):
        np.testing.assert_allclose(screen.place(pixel(screen, place), place), place, atol=1e-3)


@pytest.mark.parametrize("camera", [Camera.front(), Camera.three_quarter()])
def test_a_corner_of_the_mouth_dragged_up_smiles_on_its_side(handles: PointEditor, camera: Camera) -> None:
    screen, values = Screen(camera, SIZE), P.neutral()
    x, y = pixel(screen, CORNER)
    assert handles.take((x, y), screen, values) and handles.dragging
    assert handles.drag((x, y), screen, values) == {}  # a click moves nothing
    assert handles.drag((x, y - 6), screen, values) and handles.drag((x, y - 6), screen, values) == {}  # told once
    for step in range(1, 11):
        for index, value in handles.drag((x + step, y - 3 * step), screen, values).items():
            values[index] = value
    handles.release()
    assert values[P.index("mouthSmileLeft")] > 0.25
    assert values[P.index("mouthSmileLeft")] > 4 * abs(values[P.index("mouthSmileRight")])
    assert np.all((values >= P.low) & (values <= P.high)) and not values[P.index("headYaw")]
    assert handles.drag((x, y), screen, values) == {}  # nothing is held any more


def test_the_point_follows_the_mouse_on_a_turned_head_with_an_open_jaw(handles: PointEditor, head: Head) -> None:
    screen, values = Screen(Camera.front(), SIZE), P.neutral()
    values[P.index("headYaw")], values[P.index("jawOpen")] = 0.3, 0.4
    model = handles._model
    assert model is not None
    at = pixel(screen, handles._places(model, values)[0][np.argmin(np.linalg.norm(model.skin.rest - BROW, axis=1))])
    assert handles.take(at, screen, values)
    held = handles._held
    assert held is not None
    for step in range(1, 9):
        for index, value in handles.drag((at[0], at[1] - step), screen, values).items():
            values[index] = value
    handles.release()
    moved = pixel(screen, handles._places(model, values)[0][np.argmin(np.linalg.norm(model.skin.rest - BROW, axis=1))])
    assert moved[1] == pytest.approx(at[1] - 8, abs=4.0) and moved[0] == pytest.approx(at[0], abs=4.0)
    assert values[P.index("jawOpen")] == pytest.approx(0.4, abs=0.1)


def test_beside_the_face_there_is_nothing_to_take(handles: PointEditor) -> None:
    screen = Screen(Camera.front(), SIZE)
    assert not handles.take((5.0, 5.0), screen, P.neutral()) and not handles.dragging


def test_control_points_go_with_the_mouse_and_are_worn_by_a_stage(
    handles: PointEditor, head: Head, tmp_path: Path
) -> None:
    screen, part = Screen(Camera.front(), SIZE), head.part("face")
    rest, values = part.rig.rest.copy(), P.neutral()
    at = pixel(screen, BROW)
    assert handles.take(at, screen, values, sculpt=True)
    assert handles.drag((at[0], at[1] - 12), screen, values) == {} and handles.sculpted
    handles.release()
    moved = part.rig.rest - rest
    assert moved[:, 1].max() > 3.0 and np.linalg.norm(moved, axis=1)[rest[:, 1] < -40].max() < 1.0
    head.pose(np.zeros(len(head.parameters)))
    assert part.vertices[:, 1].max() > 0
    handles.save(tmp_path / "dimple.json", "dimple")
    name, shape = load_group(tmp_path / "dimple.json", head.data)
    assert name == "dimple"
    assert len(shape.ids) == np.count_nonzero(np.linalg.norm(moved, axis=1) >= 0.01)
    handles.undo()
    head.pose(np.zeros(len(head.parameters)))
    np.testing.assert_allclose(part.control_points, rest, atol=0.1)  # mm; contacts move some at rest
    np.testing.assert_array_equal(part.rig.rest, rest)
    (tmp_path / "stage.toml").write_text('name = "mine"\n[groups]\n"dimple.json" = 0.5\n')
    stage = load_stage(str(tmp_path / "stage.toml"), P)
    worn = stage.load_head().part("face").rig.rest - rest
    np.testing.assert_allclose(worn[shape.ids], 0.5 * shape.moves, atol=1e-9)
    assert check_anything(str(tmp_path / "dimple.json"))[0].startswith("group dimple: ")
    assert "good" in check_anything(str(tmp_path / "stage.toml"))[0]


def test_a_stage_names_groups_that_are_missing(tmp_path: Path) -> None:
    (tmp_path / "stage.toml").write_text('name = "mine"\n[groups]\n"none.json" = 1\n')
    with pytest.raises(ConfigError, match=r"groups\[0\]: no group 'none.json'"):
        load_stage(str(tmp_path / "stage.toml"), P)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Screen).anything = 1
