"""controller.panels.window.saving: what is saved, under which name, what is said of it, and the widgets of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.body.messages import Learn
from controller.panels.session.commands import Commands
from controller.panels.session.next_run import NextRun, carried_to
from controller.panels.window.editing import MouseEditing
from controller.panels.window.panel import Panel, PanelOptions
from controller.panels.window.saving import ABOUT, KINDS, STEMS, Saving, Words
from controller.robot.robot import load_robot
from controller.stage.stage import Stage, load_stage
from controller.vocabulary.vocabulary import Vocabulary
from surface.view.docks import PictureArea
from tests.controller.panels.window.screen import Places, Screen


@pytest.fixture(scope="module")
def stage() -> Stage:
    return load_stage("demo", PARAMETERS)


def sculpted(stage: Stage, panel: Panel) -> MouseEditing:
    """Points of the face with three control points of the left cheek moved."""
    head = stage.load_head()
    mouse = MouseEditing(head, stage.load_head, PARAMETERS.neutral, panel.commands, PictureArea())
    near = np.argsort(np.linalg.norm(mouse.editor._rest - [45.0, -30.0, 85.0], axis=1))[:3]
    moves = np.zeros_like(mouse.editor._rest)
    moves[near] = [0.0, 0.0, 4.0]
    panel.commands.set_moves(moves)
    panel.saving.editor = mouse.find_editor
    return mouse


def panel_of(values: np.ndarray, folder: Path, sent: list[Any]) -> Panel:
    return Panel(lambda: values, sent.append, options=PanelOptions(folder=folder))


def test_a_file_in_the_present_folder_is_named_from_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    values = PARAMETERS.neutral()
    values[PARAMETERS.index("jawOpen")] = 0.5
    panel = panel_of(values, tmp_path, [])
    monkeypatch.chdir(tmp_path)
    panel.saving.save("gape")
    assert panel.saving.message == "wrote gape to mine.toml"


def test_moved_skin_is_saved_as_a_group_that_is_a_slider_a_button_and_a_word(stage: Stage, tmp_path: Path) -> None:
    panel = panel_of(PARAMETERS.neutral(), tmp_path, [])
    mouse, asked = sculpted(stage, panel), []
    panel.saving.reopen = lambda history, held: asked.append((history, held))
    panel.saving.save("dimple", "group")
    assert panel.saving.message == f"wrote dimple to {tmp_path / 'mine.toml'}"
    history, held = asked[0]
    assert history.now.moves is None and history.past[-1].moves is not None and held == {"dimple": 1.0}
    again = load_stage("demo", PARAMETERS, [tmp_path / "mine.toml"])
    dimple = again.parameters.index("dimple")
    assert again.parameters.regions[dimple] == "mouth" and again.vocabulary["dimple"].weights[dimple] == 1.0
    later = carried_to(NextRun(stage.path, (), history, PARAMETERS.names, held), again.parameters)
    assert later is not None and later.now.held == {dimple: 1.0}
    head, shown = again.load_head(), mouse.editor.head
    shown.pose(shown.values({}))
    head.pose(head.values({"dimple": 1.0}))
    assert np.abs(head.part("face").vertices - shown.part("face").vertices).max() < 1e-3
    head.pose(head.values({}))
    assert np.abs(head.part("face").vertices - shown.part("face").vertices).max() > 0.2


def test_moved_skin_is_saved_as_a_corrective_of_the_present_face(stage: Stage, tmp_path: Path) -> None:
    values = PARAMETERS.neutral()
    panel = panel_of(values, tmp_path, [])
    mouse = sculpted(stage, panel)
    panel.saving.save("fold", "corrective")
    assert "none of its shapes is strong" in panel.saving.message and not (tmp_path / "fold.json").exists()
    values[PARAMETERS.indices(["mouthSmileLeft", "jawOpen"])] = 0.8, 0.5
    panel.saving.save("fold", "corrective")
    again = load_stage("demo", PARAMETERS, [tmp_path / "mine.toml"])
    assert again.parameters.point_groups["fold"].times == ("jawOpen", "mouthSmileLeft")
    head, shown, face = again.load_head(), mouse.editor.head, {"mouthSmileLeft": 0.8, "jawOpen": 0.5}
    shown.pose(shown.values(face))
    head.pose(head.values({**face, "fold": float(again.parameters.rest[again.parameters.index("fold")])}))
    assert (
        np.abs(head.part("face").vertices - shown.part("face").vertices).max() < 0.2
    )  # the jaw turns skin moved at rest


def test_a_gesture_and_an_anchor_are_saved(stage: Stage, tmp_path: Path) -> None:
    values, sent = PARAMETERS.neutral(), []
    values[PARAMETERS.index("mouthSmileLeft")] = 0.7
    panel = panel_of(values, tmp_path, sent)
    mouse = sculpted(stage, panel)
    panel.saving.save("wry", "gesture")
    assert sent[-1] == Learn("wry", tuple(np.round(values, 3)), "gesture")
    assert Vocabulary.load(PARAMETERS, more=[tmp_path / "mine.toml"])["wry"].kind == "gesture"
    panel.saving.save("corner", "anchor")
    assert "no point was pulled" in panel.saving.message
    mouse.editor.prepare()
    mouse.editor._thread.join(60.0)
    model = mouse.editor._model
    assert model is not None
    mouse.editor._last = int(np.argmin(np.linalg.norm(model.skin.rest - [28.6, -34.0, 102.0], axis=1)))
    panel.saving.save("corner", "anchor")
    robot = load_robot(tmp_path / "corner-anchor.toml", PARAMETERS)
    anchor = robot.channels[0].anchor
    assert anchor is not None and anchor.unit_direction[1] > 0.5 and robot.channels[0].map.at[1] > 3.0


@pytest.mark.parametrize("kind", ["group", "corrective", "anchor"])
def test_what_cannot_be_saved_is_told_with_the_next_step(kind: Any, stage: Stage, tmp_path: Path) -> None:
    panel = panel_of(PARAMETERS.neutral(), tmp_path, [])
    panel.saving.save("x", kind)
    assert panel.saving.message == "nothing can be dragged here; omote edit"
    head = stage.load_head()
    mouse = MouseEditing(head, stage.load_head, PARAMETERS.neutral, panel.commands, PictureArea())
    panel.saving.editor = mouse.find_editor
    panel.saving.save("x", kind)
    assert "Ctrl" in panel.saving.message or "show the face" in panel.saving.message
    assert not list(tmp_path.iterdir())


class Desk:
    """A :class:`Saving` of a face that a test gives."""

    def __init__(self, folder: Path, **values: float) -> None:
        self.values, self.sent = PARAMETERS.neutral(), list[Any]()
        for name, value in values.items():
            self.values[PARAMETERS.index(name)] = value
        self.words = Words(Vocabulary.load(PARAMETERS), folder / "mine.toml")
        self.saving = Saving(self.words, Commands(self.sent.append), lambda: self.values, self.sent.append)


def test_every_kind_has_a_beginning_of_names_and_a_sentence() -> None:
    assert KINDS == ("expression", "gesture", "group", "corrective", "anchor")
    assert STEMS.keys() == ABOUT.keys() == set(KINDS)
    assert len(set(STEMS.values())) == len(set(ABOUT.values())) == len(KINDS)


def test_a_name_that_omote_chooses_is_one_that_nothing_has(tmp_path: Path) -> None:
    desk = Desk(tmp_path, jawOpen=0.5)
    for kind in KINDS:
        assert desk.saving.suggested(kind) == f"{STEMS[kind]}_1"
    desk.saving.save("FACE_1")
    desk.saving.save("face_2")
    assert desk.saving.suggested("expression") == "face_3"  # also in other letters
    (tmp_path / "fold_1.json").write_text("{}")
    (tmp_path / "anchor_1-anchor.toml").write_text("")
    assert (desk.saving.suggested("group"), desk.saving.suggested("anchor")) == ("fold_2", "anchor_2")


def test_an_expression_is_written_known_and_reported(tmp_path: Path) -> None:
    desk = Desk(tmp_path, jawOpen=0.5, mouthSmileLeft=0.2504)
    desk.saving.save("  soft_smile ")
    weights = desk.words.vocabulary["soft_smile"].weights
    assert weights[PARAMETERS.index("mouthSmileLeft")] == pytest.approx(0.25)
    assert desk.sent == [Learn("soft_smile", tuple(weights.tolist()), "user")]
    assert desk.saving.message == f"wrote soft_smile to {tmp_path / 'mine.toml'}"
    assert "[soft_smile.weights]" in (tmp_path / "mine.toml").read_text()
    desk.values[:] = PARAMETERS.neutral()  # the face goes on; what was saved stays
    assert desk.words.vocabulary["soft_smile"].weights[PARAMETERS.index("jawOpen")] == pytest.approx(0.5)


def test_a_kind_that_is_named_leaves_the_chosen_one(tmp_path: Path) -> None:
    desk = Desk(tmp_path, jawOpen=0.5)
    desk.saving.kind = "gesture"
    desk.saving.save("", "expression")
    desk.saving.save("")
    assert [(each.name, each.kind) for each in desk.sent] == [("face_1", "user"), ("gesture_1", "gesture")]
    assert desk.saving.kind == "gesture"
    assert [desk.words.vocabulary[name].kind for name in ("face_1", "gesture_1")] == ["user", "gesture"]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("happiness", "there is an expression 'happiness' already; choose another name"),
        ("a b", "'a b' cannot be a name; use letters, digits and _, as soft_smile"),
    ],
)
def test_a_refused_name_is_said_with_the_next_step_and_nothing_is_written(tmp_path: Path, name: str, said: str) -> None:
    desk = Desk(tmp_path, jawOpen=0.5)
    desk.saving.save(name)
    assert desk.saving.message == said and desk.sent == [] and not list(tmp_path.iterdir())
    desk.values[:] = PARAMETERS.neutral()
    desk.saving.save("calm_face")
    assert desk.saving.message == "the face is neutral: there is nothing to save; move sliders first"


def test_an_anchor_whose_name_is_taken_writes_no_file(stage: Stage, tmp_path: Path) -> None:
    panel = panel_of(PARAMETERS.neutral(), tmp_path, [])
    mouse = sculpted(stage, panel)
    mouse.editor.last_pull = lambda values: (np.zeros(3), np.ones(3))  # type: ignore[assignment,method-assign]
    panel.saving.save("anger", "anchor")
    assert "there is an expression 'anger' already" in panel.saving.message and not list(tmp_path.iterdir())


def test_the_widgets_choose_a_kind_and_save_under_a_chosen_name(
    tmp_path: Path, screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    places, desk = Places(screen.imgui, monkeypatch), Desk(tmp_path, jawOpen=0.5)

    def draw() -> None:
        screen.imgui.set_next_window_size(screen.imgui.ImVec2(400, 300))
        screen.imgui.begin("saving")
        desk.saving()
        screen.imgui.end()

    for _ in range(2):
        screen.frame(draw)
    assert places.texts[-1] == ABOUT["expression"]
    screen.click(draw, *places.at["save##word"])
    assert [each.name for each in desk.sent] == ["face_1"]
    screen.frame(draw)
    assert places.texts[-1].startswith("wrote face_1 to")
    monkeypatch.setattr(screen.imgui, "begin_combo", lambda label, shown: True)
    monkeypatch.setattr(screen.imgui, "end_combo", lambda: None)
    monkeypatch.setattr(
        screen.imgui, "selectable", lambda label, chosen: (label == "gesture##kind", label == "expression##kind")
    )
    screen.frame(draw)
    assert desk.saving.kind == "gesture" and places.texts[-1] == ABOUT["gesture"]
    screen.click(draw, *places.at["save##word"])
    assert [(each.name, each.kind) for each in desk.sent] == [("face_1", "user"), ("gesture_1", "gesture")]
