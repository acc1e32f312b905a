"""Points of the face in a picture: taken, dragged, reshaped, kept."""

from __future__ import annotations

import threading
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.face.point_editing import PointEditor
from controller.face.skin_model import Screen, SkinModels
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
    found = PointEditor(head, SkinModels(lambda: Head.load(folder), P))
    assert not found.ready and not found.dragging
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


@pytest.mark.slow
def test_a_grab_counts_that_was_made_while_points_got_ready(
    handles: PointEditor, head: Head, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen, values, ready = Screen(Camera.front(), SIZE), P.neutral(), threading.Event()

    def model(*_: object) -> object:
        assert ready.wait(60.0)
        return handles._model

    monkeypatch.setattr("controller.face.skin_model.SkinModel", model)
    editor = PointEditor(head, SkinModels(lambda: head, P))
    x, y = pixel(screen, CORNER)
    assert editor.take((x, y), screen, values) and editor.dragging
    assert editor.drag((x, y - 12), screen, values) == {} and not editor.settled
    ready.set()
    editor._thread.join(60.0)
    moved = editor.drag((x, y - 12), screen, values)
    left, right = (moved.get(P.index(name), 0.0) for name in ("mouthSmileLeft", "mouthSmileRight"))
    assert left > 0.005 and left > 4 * abs(right) and editor.settled
    editor.release()
    assert not editor.dragging


@pytest.mark.slow
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


def test_a_pinned_point_is_shown_where_it_was_and_turns_with_the_head(handles: PointEditor) -> None:
    screen, values = Screen(Camera.front(), SIZE), P.neutral()
    assert handles.pin_pixels(screen, values) == []
    place = pixel(screen, CORNER)
    assert handles.take(place, screen, values)
    handles.pin(values)
    handles.release()
    ((x, y),) = handles.pin_pixels(screen, values)
    assert handles.pinned == 1 and np.hypot(x - place[0], y - place[1]) < 16.0
    values[P.index("headYaw")] = 0.5  # to the subject's left, which is the picture's right
    assert handles.pin_pixels(screen, values)[0][0] > x + 5.0
    handles.unpin()
    assert handles.pinned == 0 and handles.pin_pixels(screen, values) == []


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


@pytest.mark.slow
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
    np.testing.assert_allclose(part.control_points, rest, atol=0.4)  # mm; contacts close the lips at rest
    np.testing.assert_array_equal(part.rig.rest, rest)
    (tmp_path / "stage.toml").write_text('name = "mine"\n[groups]\n"dimple.json" = 0.5\n')
    stage = load_stage(str(tmp_path / "stage.toml"), P)
    worn = stage.load_head().part("face").rig.rest - rest
    np.testing.assert_allclose(worn[shape.ids], 0.5 * shape.moves, atol=1e-9)
    assert check_anything(str(tmp_path / "dimple.json"))[0].startswith("group dimple: ")
    assert "good" in check_anything(str(tmp_path / "stage.toml"))[0]


def test_a_picture_is_projected_to_pixels_from_its_upper_left_corner() -> None:
    camera = Camera.front()
    screen, towards = Screen(camera, SIZE), np.array(camera.target) - np.array(camera.eye)
    away = np.linalg.norm(towards)
    right, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    places = np.array(camera.target) + np.array([0 * up, 10 * up, 10 * right, 0.5 * towards])
    middle, above, beside, behind = screen.project(places)
    np.testing.assert_allclose(middle, [640.0, 360.0, away], rtol=1e-5)
    assert above[1] < 360.0 and above[0] == pytest.approx(640.0, abs=1e-2)
    assert beside[0] > 640.0 and beside[1] == pytest.approx(360.0, abs=1e-2)
    assert beside[0] - 640.0 == pytest.approx(360.0 - above[1], rel=1e-4)  # pixels are square
    assert behind[2] == pytest.approx(1.5 * away, rel=1e-5)


def test_a_point_is_taken_within_sixteen_pixels(handles: PointEditor) -> None:
    screen, values, model = Screen(Camera.front(), SIZE), P.neutral(), handles._model
    assert model is not None
    shown = screen.project(model.skin.rest)[:, :2]
    lowest = shown[np.argmax(np.where(model.normals[:, 2] > 0.7, shown[:, 1], 0.0))]
    others = shown[np.linalg.norm(shown - lowest, axis=1) > 0.0]
    for dx, dy in ((15.0, 0.0), (-15.0, 0.0), (0.0, 15.0)):
        assert handles.take((lowest[0] + dx, lowest[1] + dy), screen, values)
        handles.release()
    down = lowest + np.array([0.0, 17.0])
    alone = np.linalg.norm(others - down, axis=1).min() > 17.0
    assert alone and not handles.take((down[0], down[1]), screen, values)


def test_points_on_the_other_side_of_the_head_are_not_taken(handles: PointEditor) -> None:
    screen, values, model = Screen(Camera.front(), SIZE), P.neutral(), handles._model
    assert model is not None
    for place in model.skin.rest[::30]:
        x, y = pixel(screen, place)
        if handles.take((x, y), screen, values):
            held = handles._held
            assert held is not None
            depths = screen.project(model.skin.rest)
            near = np.hypot(*(depths[:, :2] - [x, y]).T) < 16.0
            facing = model.normals @ np.array([0.0, 0.0, 1.0]) > 0.3
            assert screen.project(held.place[None])[0, 2] <= depths[near & facing, 2].min(initial=np.inf) + 40.0
            handles.release()


def test_points_lie_where_the_moved_control_points_show_them(handles: PointEditor) -> None:
    model, values = handles._model, P.neutral()
    assert model is not None
    before = handles._places(model, values)[0]
    handles._set_moves(np.tile([1.0, 3.0, -2.0], (len(handles._rest), 1)))
    np.testing.assert_allclose(handles._places(model, values)[0] - before, [[1.0, 3.0, -2.0]] * len(before), atol=1e-6)
    handles.undo()
    np.testing.assert_allclose(handles._places(model, values)[0], before)


def test_only_control_points_that_moved_are_kept(handles: PointEditor, head: Head, tmp_path: Path) -> None:
    moves = np.zeros_like(handles._rest)
    moves[[3, 5, 7], [0, 1, 2]] = 0.01, -0.0099, -2.0
    handles._set_moves(moves)
    handles.save(tmp_path / "a.json", "a")
    assert load_group(tmp_path / "a.json", head.data)[1].ids.tolist() == [3, 7]
    handles.undo()
    assert not handles.sculpted


def test_a_stage_names_groups_that_are_missing(tmp_path: Path) -> None:
    (tmp_path / "stage.toml").write_text('name = "mine"\n[groups]\n"none.json" = 1\n')
    with pytest.raises(ConfigError, match=r"groups\[0\]: no group 'none.json'"):
        load_stage(str(tmp_path / "stage.toml"), P)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Screen).anything = 1


def test_the_last_pull_is_that_of_the_point_that_was_held_last(head: Head, handles: PointEditor) -> None:
    fresh = PointEditor(head, handles._models)
    values = P.neutral()
    assert not np.any(fresh.last_pull(values)), "its points are not ready"
    fresh._model = handles._model
    assert not np.any(fresh.last_pull(values)), "none was held"
    assert handles._model is not None
    fresh._last = 7
    place, moved = fresh.last_pull(values)
    assert place.tolist() == handles._model.skin.rest[7].tolist()
    assert np.linalg.norm(moved) < 1.0
    jaw = values.copy()
    jaw[P.index("jawOpen")] = 1.0
    shown = handles._model.local(jaw, fresh._moves) - handles._model.local(values, fresh._moves)
    fresh._last = int(np.argmax(np.linalg.norm(shown, axis=1)))
    moved = fresh.last_pull(jaw)[1]
    assert moved[1] < -20.0, "the chin goes down with the jaw"
