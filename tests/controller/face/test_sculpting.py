"""Control points of a face: pulled with a falloff, on both sides, added, moved, taken out and drawn as wrinkles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.face.point_editing import PointEditor
from controller.face.sculpting import SculptDrag
from controller.face.skin_lines import even_line, knots_around, mirror_uv, uv_under
from controller.face.skin_model import Screen, SkinModel, SkinModels
from controller.panels.session.commands import Commands
from controller.panels.session.own_groups import place_of, save_corrective, save_own_group
from controller.panels.window.editing import MouseEditing
from controller.stage.inverse import load_group, save_group
from controller.stage.stage import load_stage
from controller.vocabulary.vocabulary import Vocabulary
from surface.head import Head
from surface.head.model.light import LightPoints
from surface.view.docks import PictureArea
from surface.view.scene.camera import Camera

SIZE, FRONT = (1280.0, 720.0), Screen(Camera.front(), (1280.0, 720.0))
CHEEK = np.array([42.0, -24.0, 84.0])
LINE = np.array([[30.0, -12.0, 100.0], [38.0, -24.0, 92.0], [40.0, -38.0, 88.0]])


@pytest.fixture(scope="module")
def folder() -> Path:
    return find_config("heads", "ict")


@pytest.fixture(scope="module")
def editor(folder: Path) -> PointEditor:
    return ready(Head.load(folder), folder)


def ready(head: Head, folder: Path, light: tuple[LightPoints, ...] = ()) -> PointEditor:
    """An editor that is ready."""
    found = PointEditor(head, SkinModels(lambda: Head.load(folder), P), light)
    found.prepare()
    found._thread.join(60.0)
    assert found.ready
    return found


def pixel(place: np.ndarray) -> tuple[float, float]:
    x, y, _ = FRONT.project(place[None])[0]
    return float(x), float(y)


def pulled(editor: PointEditor, place: np.ndarray, by: tuple[float, float], **how: object) -> np.ndarray:
    """(m, 3) how far the sampled points of the skin are pulled by a drag, which is taken back."""
    values, (x, y) = P.neutral(), pixel(place)
    model = editor._model
    assert model is not None and editor.take((x, y), FRONT, values, sculpt=True, **how)  # type: ignore[arg-type]
    editor.drag((x + by[0], y + by[1]), FRONT, values)
    moved: np.ndarray = model.basis @ editor._moves
    editor.release()
    editor.undo()
    return moved


def test_a_wider_falloff_pulls_more_of_the_skin(editor: PointEditor) -> None:
    model = editor._model
    assert model is not None
    place = model.skin.rest[np.argmin(np.linalg.norm(model.skin.rest - CHEEK, axis=1))]
    widths = []
    for falloff_mm in (8.0, 20.0, 45.0):
        far = np.linalg.norm(pulled(editor, place, (0.0, -14.0), falloff_mm=falloff_mm), axis=1)
        point = model.skin.rest[np.argmax(far)]
        away = np.linalg.norm(model.skin.rest - point, axis=1)
        assert np.linalg.norm(point - CHEEK) < 12.0 and far.max() > 3.0
        assert far[away > falloff_mm + 25.0].max() < 0.15 * far.max()  # functions reach beyond, and 8 mm are widened
        widths.append(float(away[far > far.max() / 2].max()))
    assert widths[0] <= widths[1] < widths[2] and widths[2] > 1.6 * widths[0]  # points of a cheek are far apart


def test_a_pull_that_is_undone_leaves_the_very_same_skin(editor: PointEditor) -> None:
    rest, (x, y), values = skin(editor), pixel(CHEEK), P.neutral()
    assert editor.take((x, y), FRONT, values, sculpt=True, falloff_mm=12.0)
    for k in range(1, 12):
        editor.drag((x + 0.7 * k, y - 0.9 * k), FRONT, values)
        moved = skin(editor)
    editor.release()
    assert np.linalg.norm(moved - rest, axis=1).max() > 2.0
    editor.undo()
    assert skin(editor).tobytes() == rest.tobytes()


def test_the_very_place_under_the_mouse_is_taken_also_on_skin_that_was_pulled(editor: PointEditor) -> None:
    values = P.neutral()
    values[P.index("headYaw")] = 0.1
    model = editor._model
    assert model is not None
    near = int(np.argmin(np.linalg.norm(model.skin.rest - [20.0, -15.0, 105.0], axis=1)))  # beside the nose
    x, y, _ = FRONT.project(model.places_of(model.skin.uv[near : near + 1], values, editor._moves))[0]
    for way in (14.0, -9.0):
        start = x + 5.0, y + 4.0
        assert editor.take(start, FRONT, values, sculpt=True, falloff_mm=20.0)
        held = editor._held
        assert isinstance(held, SculptDrag) and np.abs(held.offset).max() < 0.5  # mm: of flat triangles on round skin
        uv = model.under(np.array([start]), FRONT, values, editor._moves)
        editor.drag((start[0] + way, start[1]), FRONT, values)
        shown = FRONT.project(model.places_of(uv, values, editor._moves))[0]
        editor.release()
        np.testing.assert_allclose(shown[:2], [start[0] + way, start[1]], atol=0.3)
    editor.undo()


@pytest.mark.parametrize("falloff_mm", [20.0, None])
def test_both_sides_are_pulled_as_mirror_images(editor: PointEditor, falloff_mm: float | None) -> None:
    model = editor._model
    assert model is not None
    one = pulled(editor, CHEEK, (8.0, -12.0), falloff_mm=falloff_mm)
    both = pulled(editor, CHEEK, (8.0, -12.0), falloff_mm=falloff_mm, tied=True)
    rest = model.skin.rest
    there = np.linalg.norm(rest - CHEEK, axis=1) < 10.0
    across = np.linalg.norm(rest - CHEEK * [-1.0, 1.0, 1.0], axis=1) < 10.0
    near = np.argmax(np.where(there, np.linalg.norm(one, axis=1), 0.0))
    np.testing.assert_allclose(both[near], one[near], rtol=0.05, atol=0.05)  # the held point follows the mouse
    mean = both[across].mean(axis=0) * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(mean, both[there].mean(axis=0), rtol=0.35, atol=0.4)
    assert np.linalg.norm(mean) > 1.0 and np.linalg.norm(one[across], axis=1).max() < 0.2


def test_the_middle_of_the_face_follows_when_both_sides_are_pulled(editor: PointEditor) -> None:
    moved = pulled(editor, np.array([0.0, -62.0, 104.0]), (10.0, 12.0), falloff_mm=25.0, tied=True)
    lowest = moved[np.argmin(moved[:, 1])]
    alone = pulled(editor, np.array([0.0, -62.0, 104.0]), (0.0, 12.0), falloff_mm=25.0)
    assert lowest[1] == pytest.approx(alone[:, 1].min(), rel=0.1) and abs(lowest[0]) < 0.5 * abs(lowest[1])


def test_the_lips_are_pulled_apart(editor: PointEditor) -> None:
    model = editor._model
    assert model is not None
    moved = pulled(editor, np.array([0.0, -44.0, 113.0]), (0.0, 10.0), falloff_mm=20.0)
    assert moved[model.skin.jaw > 0.8][:, 1].min() < -2.0 and np.abs(moved[model.skin.jaw < 0.1]).max() < 0.5


def test_a_pixel_shows_the_place_under_it(editor: PointEditor) -> None:
    model = editor._model
    assert model is not None
    facing = np.flatnonzero((model.normals[:, 2] > 0.9) & (model.skin.rest[:, 2] > 80.0))[:12]
    pixels = FRONT.project(model.skin.rest[facing])[:, :2]
    found = model.surface.evaluate(model.under(pixels, FRONT, P.neutral(), np.zeros((1, 3))))
    np.testing.assert_allclose(found, model.skin.rest[facing], atol=0.3)
    assert np.isnan(model.under(np.array([[3.0, 3.0]]), FRONT, P.neutral(), np.zeros((1, 3)))).all()


def test_of_two_triangles_the_nearer_one_is_seen() -> None:
    shown = np.array([[0, 0, 9.0], [4, 0, 9], [0, 4, 9], [0, 0, 5.0], [4, 0, 5], [0, 4, 5]], float)
    uv = np.array([[0, 0], [1, 0], [0, 1], [5, 5], [6, 5], [5, 6]], float)
    found = uv_under(np.array([[1.0, 1.0], [9.0, 9.0]]), shown, np.array([[0, 1, 2], [3, 5, 4]]), uv)
    np.testing.assert_allclose(found[0], [5.25, 5.25])
    assert np.isnan(found[1]).all()


def test_points_along_a_line_are_even_and_mirrored(editor: PointEditor) -> None:
    model = editor._model
    assert model is not None
    picks = model.under(FRONT.project(dense(LINE))[:, :2], FRONT, P.neutral(), np.zeros((1, 3)))
    line = even_line(model.surface, picks, 3.0)
    places = model.surface.evaluate(line)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert len(line) > 12 and steps.max() < 2.0 and steps.min() > 0.4
    other = model.surface.evaluate(mirror_uv(model.surface, line, *model.mesh_rest))
    np.testing.assert_allclose(other, places * [-1.0, 1.0, 1.0], atol=1.5)
    assert not len(even_line(model.surface, picks[:1], 3.0)) and not len(even_line(model.surface, picks * np.nan, 3.0))


def dense(line: np.ndarray) -> np.ndarray:
    at = np.linspace(0.0, len(line) - 1.0, 40)
    return np.column_stack([np.interp(at, np.arange(len(line)), x) for x in line.T])


def test_a_line_over_the_lips_keeps_to_its_longer_piece(editor: PointEditor) -> None:
    model = editor._model
    assert model is not None
    values = P.neutral()
    values[P.index("jawOpen")] = 0.8
    x, y = pixel(np.array([6.0, -28.0, 112.0]))
    pixels = np.column_stack([np.full(60, x), np.linspace(y, y + 60, 60)])
    line = even_line(model.surface, model.under(pixels, FRONT, values, np.zeros((1, 3))), 3.0)
    assert np.linalg.norm(np.diff(model.surface.evaluate(line), axis=0), axis=1).max() < 6.0


def with_points(editor: PointEditor, folder: Path, *, tied: bool = False) -> PointEditor:
    """An editor of the head with one added point on the cheek, or one on each."""
    light = editor.point_at(pixel(CHEEK), FRONT, P.neutral(), 9.0, tied=tied)
    assert light is not None
    return ready(Head.load(folder, light=[light]), folder, (light,))


def test_an_added_point_pulls_the_skin_with_the_mouse_and_no_farther_than_it_reaches(
    editor: PointEditor, folder: Path
) -> None:
    found, values = with_points(editor, folder), P.neutral()
    assert found.moves.shape == (editor.own + 1, 3) and not found.sculpted
    (x, y), rest = found.light_pixels(FRONT, values)[0], skin(found)
    assert np.hypot(x - pixel(CHEEK)[0], y - pixel(CHEEK)[1]) < 3.0
    assert found.take_light((x + 5, y), FRONT, values) == 0
    found.drag((x + 5, y - 9), FRONT, values)
    found.release()
    moved = found.light_pixels(FRONT, values)[0]
    assert moved[0] == pytest.approx(x, abs=0.3) and moved[1] == pytest.approx(y - 9, abs=0.3)
    far = np.linalg.norm(skin(found) - rest, axis=1)
    away = np.linalg.norm(rest - rest[np.argmax(far)], axis=1)
    assert 2.0 < far.max() < 6.0 and far[away > 14.0].max() < 1e-4
    group = found.group()
    assert len(group.ids) == 0 and group.light is not None and len(group.light_moves) == 1
    assert found.light_at((5.0, 5.0), FRONT, values) is None and found.take_light((5.0, 5.0), FRONT, values) is None


def test_a_model_with_added_points_is_the_same_as_one_of_a_head_with_them(
    editor: PointEditor, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loads: list[int] = []
    models = SkinModels(lambda: loads.append(1) or Head.load(folder), P)  # type: ignore[func-returns-value]
    light = editor.point_at(pixel(CHEEK), FRONT, P.neutral(), 9.0)
    assert light is not None
    plain, found, full = models.make(()), models.make((light,)), SkinModel(Head.load(folder, light=[light]), P)
    assert loads == [1] and plain.with_light(()) is plain and found.skin is plain.skin
    assert plain.surface.n == editor.own and found.surface.n == full.surface.n == editor.own + 1
    values, moves = P.neutral(), np.zeros((editor.own + 1, 3))
    values[[P.index("jawOpen"), P.index("mouthSmileLeft"), P.index("headYaw")]] = 0.7, 0.5, 0.2
    moves[100:300, 1], moves[-1] = 2.0, [0.0, 3e4, 9e4]
    uv = np.concatenate([light.centres, plain.skin.uv[::50]])
    places = [model.places_of(uv, values, moves) for model in (found, full)]
    assert np.abs(places[0] - places[1]).max() < 1e-3  # mm
    assert np.abs(places[0] - plain.places_of(uv, values, moves[:-1])).max() > 1.0
    np.testing.assert_allclose(found.basis @ moves, full.surface.basis_matrix(plain.skin.uv) @ moves, atol=1e-9)


def test_added_points_on_both_sides_move_as_mirror_images(editor: PointEditor, folder: Path) -> None:
    found, values = with_points(editor, folder, tied=True), P.neutral()
    (x, y), (other_x, other_y) = found.light_pixels(FRONT, values)
    assert x + other_x == pytest.approx(SIZE[0], abs=3.0)
    assert found.take_light((x, y), FRONT, values, tied=True) == 0
    found.drag((x + 7, y - 5), FRONT, values)
    found.release()
    moved = np.array(found.light_pixels(FRONT, values)) - [(x, y), (other_x, other_y)]
    np.testing.assert_allclose(moved, [[7.0, -5.0], [-7.0, -5.0]], atol=1.0)
    assert len(found.group().light_moves) == 2
    assert found.take_light((x, y), FRONT, values) == 0  # alone, where both sides are not asked for
    found.drag((x + 20, y), FRONT, values)
    found.release()
    alone = np.array(found.light_pixels(FRONT, values)) - [(x, y), (other_x, other_y)] - moved
    np.testing.assert_allclose(alone, [[20.0, 0.0], [0.0, 0.0]], atol=0.1)


def test_what_is_added_on_one_side_has_no_counterpart_unless_it_is_asked_for(editor: PointEditor) -> None:
    values, line = P.neutral(), [tuple(p) for p in FRONT.project(dense(LINE))[:, :2]]
    lengths = []
    for tied in (False, True):
        added = editor.point_at(pixel(CHEEK), FRONT, values, 9.0, tied=tied)
        made = editor.wrinkle(line, FRONT, values, 1.0, 3.0, tied=tied)
        assert added is not None and made is not None and len(made[0]) == len(made[1])
        lengths.append((len(added), len(made[0])))
    assert lengths[0][0] == 1 and lengths[0][1] > 3
    assert lengths[1] == (2, 2 * lengths[0][1])


def skin(editor: PointEditor) -> np.ndarray:
    editor.head.pose(np.zeros(len(editor.head.parameters)))
    vertices: np.ndarray = editor.head.part("face").vertices.astype(np.float64)
    return vertices


def test_what_cannot_be_added_is_none(editor: PointEditor) -> None:
    values = P.neutral()
    assert editor.point_at((4.0, 4.0), FRONT, values, 8.0) is None
    assert editor.wrinkle([(4.0, 4.0), (9.0, 9.0)], FRONT, values, 1.0, 3.0) is None
    x, y = pixel(CHEEK)
    assert editor.wrinkle([(x, y), (x + 0.5, y)], FRONT, values, 1.0, 3.0) is None
    at = editor.point_at(pixel(np.array([0.0, 20.0, 108.0])), FRONT, values, 5.0, tied=True)
    assert at is not None and len(at) == 1  # in the middle of the face there is no other side


def test_moves_of_another_head_are_not_worn(editor: PointEditor, folder: Path) -> None:
    found = with_points(editor, folder)
    (light,) = found.light
    moves = np.zeros((editor.own + 1, 3))
    moves[[3, -1]] = 1.0
    assert editor.convert_moves(moves[:50], (light,)) is None and editor.convert_moves(None, ()) is None
    before = editor.convert_moves(moves, (light,))  # while the head with the point is being loaded
    assert before is not None and before.shape == (editor.own, 3) and before[3, 0] == 1.0
    assert found.convert_moves(moves, (light,)) is moves
    after = found.convert_moves(moves[:-1], ())
    assert after is not None and after.shape == moves.shape and not after[-1].any()


def test_adding_and_removing_are_undone(editor: PointEditor) -> None:
    shown: list[object] = []
    commands = Commands(lambda request: None)
    commands.show_light = shown.append
    two, one = (LightPoints("face", np.zeros((k, 5)), np.zeros((k, 5))) for k in (2, 1))
    commands.add_points(two, np.ones((2, 3)), 10)
    commands.add_points(one, 2 * np.ones((1, 3)), 10)
    commands.remove_point(1)
    now = commands.now
    assert now.moves is not None and now.moves[10:, 0].tolist() == [1.0, 2.0] and [len(e) for e in now.light] == [1, 1]
    commands.undo()
    assert commands.now.light == (two, one) and commands.now.moves is not None and len(commands.now.moves) == 13
    commands.undo()
    commands.undo()
    assert commands.now.light == () and commands.now.moves is None
    commands.redo()
    assert commands.now.light == (two,) and shown[-1] == (two,)
    commands.remove_point(0)
    commands.remove_point(0)
    assert commands.now.light == ()
    commands.set_moves(None)
    assert commands.now.light == () and commands.now.moves is None


def test_a_group_with_added_points_is_worn_by_a_stage(editor: PointEditor, folder: Path, tmp_path: Path) -> None:
    made = editor.wrinkle([tuple(p) for p in FRONT.project(dense(LINE))[:, :2]], FRONT, P.neutral(), 1.0, 3.0)
    assert made is not None
    found = ready(Head.load(folder, light=[made[0]]), folder, (made[0],))
    found.set_moves(np.concatenate([np.zeros((editor.own, 3)), made[1]]))
    rest, sunk = skin(editor), skin(found)
    group, known = found.group(), Vocabulary.load(P)
    save_own_group(tmp_path / "mine.toml", "fold", group, place_of(found.head, group), known, P)
    values = P.neutral()
    values[P.index("mouthSmileLeft")] = 0.5
    save_corrective(tmp_path / "mine.toml", "crease", group, values, place_of(found.head, group), known, P)
    assert load_group(tmp_path / "fold.json", editor.head.data)[1].light is not None
    (tmp_path / "mine.toml").write_text(
        (tmp_path / "mine.toml").read_text(encoding="utf-8").replace("rest = 1.0", "rest = 0.0"), encoding="utf-8"
    )
    stage = load_stage("demo", P, [tmp_path / "mine.toml"])
    head = stage.load_head()
    n = len(rest)
    for value in (0.0, 1.0):
        head.pose(head.values({"fold": value}))
        wanted = sunk[:n] if value else rest
        assert np.abs(head.part("face").vertices[:n] - skin_of(stage, wanted, rest)).max() < 0.05
    head.pose(head.values({"crease": 1.0, "mouthSmileLeft": 0.5}))
    folded = head.part("face").vertices.copy()
    head.pose(head.values({"mouthSmileLeft": 0.5}))
    assert np.abs(folded - head.part("face").vertices).max() == pytest.approx(np.abs(sunk[:n] - rest).max(), rel=0.15)
    place = place_of(found.head, group)
    assert place.region in ("mouth", "cheeks", "nose")


def skin_of(stage: object, wanted: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """The stage's person, who may look otherwise than the head: moved as far as ``wanted`` is from ``rest``."""
    from dataclasses import replace

    plain = replace(stage, own_groups={}).load_head()  # type: ignore[type-var, attr-defined]
    plain.pose(np.zeros(len(plain.parameters)))
    found: np.ndarray = plain.part("face").vertices.astype(np.float64) + (wanted - rest)
    return found


@pytest.mark.parametrize(
    ("light", "why"),
    [
        ([{"u": [0, 1, 2, 3], "v": [0, 1, 2, 3, 4], "move_mm": [0, 0, 1]}], r"light\[0\].u"),
        ([{"u": [0, 1, 2, 3, 3], "v": [0, 1, 2, 3, 4], "move_mm": [0, 0, 1]}], "knots must ascend"),
        ([{"u": [0, 1, 2, 3, 4], "v": [0, 1, 2, 3, 4]}], "move_mm"),
    ],
)
def test_a_damaged_added_point_is_named(editor: PointEditor, tmp_path: Path, light: object, why: str) -> None:
    import json

    table = {"format": 1, "name": "x", "part": "face", "ids": [], "moves_mm": [], "light": light}
    (tmp_path / "x.json").write_text(json.dumps(table), encoding="utf-8")
    with pytest.raises(ConfigError, match=why):
        load_group(tmp_path / "x.json", editor.head.data)


def test_points_beside_the_surface_are_a_fault_of_the_stage(editor: PointEditor, tmp_path: Path) -> None:
    u, v = knots_around(editor.head.part("face").surface, editor._model.skin.uv[0], 5.0)  # type: ignore[union-attr]
    light = LightPoints("face", u + 50.0, v)
    group = editor.group()
    save_group(tmp_path / "g.json", "g", type(group)("face", group.ids, group.moves, light, np.ones((1, 3))))
    (tmp_path / "s.toml").write_text('name = "s"\n[groups]\n"g.json" = 1.0\n', encoding="utf-8")
    with pytest.raises(ConfigError, match="do not fit this head: a control point lies where the part has no surface"):
        load_stage(str(tmp_path / "s.toml"), P).load_head()


def mouse_of(editor: PointEditor, commands: Commands) -> MouseEditing:
    """The tools of a window on a head that is ready."""
    found = MouseEditing(editor.head, lambda: editor.head, P.neutral, commands, PictureArea())
    found.editor, found.can_add = editor, True
    return found


def test_the_tools_add_draw_and_take_out_points_and_say_why_not(editor: PointEditor, folder: Path) -> None:
    commands = Commands(lambda request: None)
    mouse, at = mouse_of(editor, commands), pixel(CHEEK)
    mouse._remove(at, FRONT)
    assert "no added point there" in mouse.message
    mouse._add((4.0, 4.0), FRONT)
    assert "click on the face" in mouse.message and not commands.undoable
    mouse._wrinkle([at, at], FRONT)
    assert "draw a longer line" in mouse.message and not commands.undoable
    mouse._wrinkle([tuple(p) for p in FRONT.project(dense(LINE))[:, :2]], FRONT)
    (line,) = commands.now.light
    assert len(line) > 12 and commands.now.moves is not None and len(commands.now.moves) == editor.own + len(line)
    mouse._add(at, FRONT)
    assert "on its way" in mouse.message and len(commands.now.light) == 1
    mouse.keep_points()  # cancelled while it was loaded: as the shown head is
    assert commands.now.light == () and not np.any(commands.now.moves)
    mouse._add(at, FRONT)
    assert "added" in mouse.message and len(commands.now.light[0]) == 1
    mouse.editor = ready(Head.load(folder, light=commands.now.light), folder, commands.now.light)
    mouse._remove(at, FRONT)
    assert commands.now.light == () and mouse.message == ""
    mouse.can_add = False
    mouse._add((at[0] + 60, at[1]), FRONT)
    assert "omote edit" in mouse.message
