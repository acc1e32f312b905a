"""The pad of moods and the buttons of expressions, drawn with a library that only notes what is drawn."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.panels.session.commands import Commands
from controller.panels.window.expressions import ExpressionButtons, _free_height
from controller.vocabulary.affect import Affect
from controller.vocabulary.vocabulary import Vocabulary
from tests.controller.panels.window.drawn import LETTER, LINE, Drawn, at

VOCABULARY = Vocabulary.load(PARAMETERS)


@pytest.fixture
def buttons() -> ExpressionButtons:
    return ExpressionButtons(VOCABULARY, Commands(lambda request: None), lambda: None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mood", "name"),
    [((0.0, 0.0), "VA:0,0"), ((0.311, -0.489), "VA:0.32,-0.48"), ((7.0, -7.0), "VA:1,-1"), ((-1.01, 1.01), "VA:-1,1")],
)
def test_a_mood_is_the_nearest_of_the_pads_steps_and_stays_on_it(
    buttons: ExpressionButtons, mood: tuple[float, float], name: str
) -> None:
    buttons.choose_mood(*mood)
    assert buttons._commands.now.expression.name == name and buttons._commands.now.expression.intensity == 1.0


def test_one_drag_over_the_pad_is_one_step_and_the_same_mood_none(buttons: ExpressionButtons) -> None:
    commands, asked = buttons._commands, []
    for valence in (0.1, 0.2, 0.201, 0.3):
        buttons.choose_mood(valence, 0.0)
        asked.append(commands.now)
    assert asked[1] is asked[2] and commands.now.expression.name == "VA:0.3,0"
    commands.undo()
    assert commands.now.expression.name == "neutral" and not commands.undoable


def test_emotions_stand_where_their_moods_are_inside_the_pad_and_none_covers_another(
    buttons: ExpressionButtons,
) -> None:
    drawn, side = Drawn(), 400.0
    buttons._draw_pad(drawn, at(10.0, 20.0), side)
    labels = {text: place for place, _, text in drawn.named("add_text")}
    affect = Affect.load(VOCABULARY)
    assert list(labels) == list(affect.names) and len(labels) > 5
    boxes = [(p.x, p.y, p.x + LETTER * len(text), p.y + LINE) for text, p in labels.items()]
    grounds = [(low.x, low.y, high.x, high.y) for low, high, _ in drawn.named("add_rect_filled")]
    assert np.allclose(grounds, boxes), "no line of the cross goes through a label"
    for number, (left, top, right, bottom) in enumerate(boxes):
        assert left >= 12.0 - 1e-9 and right <= 408.0 + 1e-9
        for other in boxes[:number]:
            assert right <= other[0] or other[2] <= left or bottom <= other[1] + 1e-9 or other[3] <= top + 1e-9
    for name, (valence, arousal, *_) in zip(affect.names, affect.points, strict=True):
        middle = labels[name].x + 0.5 * LETTER * len(name)
        wanted = 10.0 + 0.5 * side * (1.0 + valence)
        inside = min(max(wanted, 12.0 + 0.5 * LETTER * len(name)), 408.0 - 0.5 * LETTER * len(name))
        assert middle == pytest.approx(inside)
        assert labels[name].y >= 20.0 + 0.5 * side * (1.0 - arousal) - 0.5 * LINE - 1e-9  # there, or lower
    first = affect.names[0]
    assert labels[first].y == pytest.approx(20.0 + 0.5 * side * (1.0 - affect.points[0][1]) - 0.5 * LINE)
    ((corner, far, _),) = drawn.named("add_rect")
    assert (corner.x, corner.y, far.x, far.y) == (10.0, 20.0, 410.0, 420.0)
    lines = [(a.x, a.y, b.x, b.y) for a, b, _ in drawn.named("add_line")]
    assert lines == [(210.0, 20.0, 210.0, 420.0), (10.0, 220.0, 410.0, 220.0)]
    assert drawn.named("add_circle_filled") == []


def test_the_shown_mood_is_a_dot(buttons: ExpressionButtons) -> None:
    drawn = Drawn()
    buttons.choose_mood(0.5, -0.26)
    buttons._draw_pad(drawn, at(10.0, 20.0), 400.0)
    ((dot, radius, _),) = drawn.named("add_circle_filled")
    assert (dot.x, dot.y) == (pytest.approx(310.0), pytest.approx(272.0)) and radius == pytest.approx(LINE / 3)


def test_labels_beside_or_below_each_other_stay_where_they_are() -> None:
    taken = [(100.0, 50.0, 40.0)]
    assert _free_height(taken, 140.0, 50.0, 30.0, LINE) == 50.0  # beside it
    assert _free_height(taken, 70.0, 50.0, 30.0, LINE) == 50.0
    assert _free_height(taken, 100.0, 64.0, 30.0, LINE) == 64.0  # below it
    assert _free_height(taken, 100.0, 36.0, 30.0, LINE) == 36.0  # above it
    for x in (139.0, 71.0, 100.0):
        assert _free_height(taken, x, 50.0, 30.0, LINE) == 64.0
    assert _free_height([*taken, (100.0, 64.0, 40.0)], 100.0, 45.0, 30.0, LINE) == 78.0


def test_the_shown_expression_has_the_colour_of_its_layer_and_a_pressed_one_is_shown() -> None:
    commands = Commands(lambda request: None)
    buttons = ExpressionButtons(VOCABULARY, commands, lambda: None)  # type: ignore[arg-type]
    commands.show("anger", 0.5)
    drawn = Drawn("joy")
    buttons._buttons(drawn, ["anger", "joy", "fear"])
    order = [call[0] if call[0] != "button" else call[1] for call in drawn.calls
             if call[0] in ("button", "push_style_color", "pop_style_color")]  # fmt: skip
    assert order == ["push_style_color", "anger", "pop_style_color", "joy", "fear"]
    assert commands.now.expression.name == "joy" and commands.now.expression.intensity == 1.0


class Pad(Drawn):
    """A window in which the mouse presses on the pad, whose corner is at (10, 20) and which is ``room`` wide."""

    def __init__(self, x: float, y: float, room: float, *, active: bool = True) -> None:
        super().__init__()
        self._mouse, self._room, self._active = at(x, y), room, active

    def get_cursor_screen_pos(self) -> SimpleNamespace:
        return at(10.0, 20.0)

    def get_content_region_avail(self) -> SimpleNamespace:
        return at(self._room, 1e4)

    def get_io(self) -> SimpleNamespace:
        return SimpleNamespace(mouse_pos=self._mouse)

    def is_item_active(self) -> bool:
        return self._active


@pytest.mark.parametrize(("room", "side"), [(1e4, 16 * LINE), (100.0, 100.0)])
@pytest.mark.parametrize(
    ("across", "down", "name"), [(0.5, 0.5, "VA:0,0"), (0.9, 0.2, "VA:0.8,0.6"), (0.3, 0.6, "VA:-0.4,-0.2")]
)
def test_the_mouse_on_the_pad_chooses_a_mood_pleasant_to_the_right_and_excited_upwards(
    buttons: ExpressionButtons, room: float, side: float, across: float, down: float, name: str
) -> None:
    pad = Pad(10.0 + across * side, 20.0 + down * side, room, active=False)
    buttons._pad(pad)
    assert buttons._commands.now.expression.name == "neutral"
    buttons._pad(Pad(10.0 + across * side, 20.0 + down * side, room))
    assert buttons._commands.now.expression.name == name
    (((label, size),),) = (pad.named("invisible_button"),)
    assert label == "pad" and (size.x, size.y) == (side, side)


@pytest.mark.parametrize(
    ("shown", "moved", "told"), [("anger", True, ["anger"]), ("neutral", True, []), ("anger", False, [])]
)
def test_the_slider_changes_how_strong_the_shown_expression_is(
    monkeypatch: pytest.MonkeyPatch, shown: str, moved: bool, told: list[str]
) -> None:
    commands, asked, saved = Commands(lambda request: None), list[tuple[str, float, str]](), list[bool]()
    made = ExpressionButtons(VOCABULARY, commands, lambda: saved.append(True))  # type: ignore[arg-type]
    commands.show(shown, 1.0)
    monkeypatch.setattr(commands, "show", lambda *given: asked.append(given))
    pad = Pad(0.0, 0.0, 1e4, active=False)
    sliders = list[tuple[object, ...]]()
    pad.slider_float = lambda *given: sliders.append(given) or (moved, 0.25)  # type: ignore[attr-defined, func-returns-value]
    monkeypatch.setitem(sys.modules, "imgui_bundle", SimpleNamespace(imgui=pad))
    made()
    assert sliders == [("intensity", 1.0, 0.0, 1.0)] and saved == [True]
    assert pad.named("set_next_item_width")[0] == (-9 * LETTER - LINE,)
    assert asked == [(name, 0.25, "intensity") for name in told]
    assert pad.named("separator_text") == [("emotions",), ("gestures",), ("the present face",), ("mood",)]
