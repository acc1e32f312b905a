"""Sliders drawn with a library that only notes what is drawn: values, holders, marks of servos, and what is held."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.body.messages import Hold
from controller.panels.session.commands import Commands
from controller.panels.window.sliders import Sliders, _label, same_sense
from tests.controller.panels.window.drawn import LETTER, Drawn, at

JAW = PARAMETERS.index("jawOpen")
SMILE = tuple(map(int, PARAMETERS.indices(["mouthSmileLeft", "mouthSmileRight"])))
YAW = PARAMETERS.index("headYaw")


class Widgets(Drawn):
    """clicked : the checkbox that is clicked. dragged : where sliders are dragged to. hovered : whether the mouse is
    over everything."""

    def __init__(self, *, clicked: str = "", dragged: float | None = None, hovered: bool = False) -> None:
        super().__init__()
        self.clicked, self.dragged, self.hovered = clicked, dragged, hovered

    def checkbox(self, label: str, on: bool) -> tuple[bool, bool]:
        self.calls.append(("checkbox", label, on))
        pressed = label.startswith(f"{self.clicked}##") if self.clicked else False
        return pressed, on != pressed

    def slider_float(self, label: str, value: float, low: float, high: float, words: str) -> tuple[bool, float]:
        self.calls.append(("slider", label, value, low, high, words))
        return (False, value) if self.dragged is None else (True, self.dragged)

    def collapsing_header(self, title: str) -> bool:
        self.calls.append(("header", title))
        return True

    def is_item_hovered(self) -> bool:
        return self.hovered

    def get_item_rect_min(self) -> Any:
        return at(100.0, 50.0)

    def get_item_rect_max(self) -> Any:
        return at(300.0, 70.0)


class Servos:
    """Stands for the body's state: the jaw is held by speech, and its servo shows 0.25. ``by_hand`` : what is held."""

    def __init__(self, shown: dict[int, float]) -> None:
        self.shown = shown
        self.by_hand: dict[int, float] | None = None

    def held(self) -> dict[int, float] | None:
        return self.by_hand

    def holder(self, index: int) -> str:
        return "speech 50%" if index == JAW else ""

    def measured(self, index: int) -> float | None:
        return self.shown.get(index)

    def away_deg(self, region: str) -> float | None:
        return 1.26 if region == "jaw" else None


def made(shown: dict[int, float] | None = None) -> tuple[Sliders, Commands, list[Any]]:
    sent: list[Any] = []
    commands, values = Commands(sent.append), PARAMETERS.neutral()
    values[JAW], values[SMILE[0]], values[SMILE[1]] = 0.4, 0.2, 0.6
    state: Any = None if shown is None else Servos(shown)
    return Sliders(lambda: values, commands, state), commands, sent


def test_a_slider_shows_the_mean_of_both_sides_in_the_parameters_range() -> None:
    sliders, commands, sent = made()
    drawn: Any = Widgets()
    sliders._row(drawn, "mouthSmile", SMILE)
    assert drawn.named("slider") == [("##mouthSmile", pytest.approx(0.4), 0.0, 1.0, "%.2f")]
    commands.hold({SMILE[0]: 1.0})
    sliders._row(drawn, "mouthSmile", SMILE)
    assert drawn.named("slider")[1][1] == pytest.approx(0.8)  # what is held by hand, before it is reached
    sliders._row(drawn, "headYaw", (YAW,))
    low, high = float(PARAMETERS.low[YAW]), float(PARAMETERS.high[YAW])
    assert drawn.named("slider")[2][2:4] == (low, high) and low < 0.0 < high
    assert sent == [Hold(SMILE[0], 1.0)]


@pytest.mark.parametrize(("to", "held"), [(0.7, 0.7), (1.4, 1.0), (-0.2, 0.0)])
def test_dragging_holds_both_sides_within_their_range_and_is_one_step(to: float, held: float) -> None:
    sliders, commands, sent = made()
    drawn: Any = Widgets(dragged=to)
    sliders._row(drawn, "mouthSmile", SMILE)
    assert sent == [Hold(SMILE[0], held), Hold(SMILE[1], held)]
    drawn.dragged = 0.5
    sliders._row(drawn, "mouthSmile", SMILE)
    commands.undo()
    assert not commands.undoable and commands.now.held == {}


def test_the_lock_holds_a_face_as_it_is_and_gives_it_back() -> None:
    sliders, commands, _ = made()
    drawn: Any = Widgets(clicked="mouthSmile", hovered=True)
    sliders._row(drawn, "mouthSmile", SMILE)
    assert commands.now.held == {SMILE[0]: 0.2, SMILE[1]: 0.6}
    assert [on for _, on in drawn.named("checkbox")] == [False]
    assert drawn.named("set_tooltip")[0][0].startswith("held by hand, or by a command\nuntick: release it")
    sliders._row(drawn, "mouthSmile", SMILE)
    assert commands.now.held == {} and drawn.named("set_tooltip")[1][0].startswith("tick: hold it by hand")
    commands.hold({SMILE[0]: 0.1})
    sliders._row(Widgets(clicked="mouthSmile"), "mouthSmile", SMILE)  # type: ignore[arg-type]
    assert set(commands.now.held) == set(SMILE)  # one side alone is not locked


class Desk:
    """Sliders beside a body: ``told`` stands for its state, and ``now_s`` is the time."""

    def __init__(self) -> None:
        self.sent: list[Any] = []
        self.commands, self.told, self.now_s = Commands(self.sent.append), Servos({}), 10.0
        state: Any = self.told
        self.sliders = Sliders(PARAMETERS.neutral, self.commands, state, clock=lambda: self.now_s)

    def drawn(self, *, pressed: str = "", clicked: str = "") -> Any:
        """What one frame of the line above the sliders and the row of the jaw draws."""
        library: Any = Widgets(clicked=clicked)
        library.pressed = pressed
        self.sliders.listen()
        self.sliders._all_held(library)
        self.sliders._row(library, "jawOpen", (JAW,))
        return library


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_what_a_link_holds_is_ticked_and_can_be_released_here(desk: Desk) -> None:
    assert [on for _, on in desk.drawn().named("checkbox")] == [False]  # nothing is known yet
    desk.told.by_hand = {JAW: 0.6}
    drawn = desk.drawn()
    assert [on for _, on in drawn.named("checkbox")] == [True] and drawn.named("slider")[0][1] == 0.6
    assert drawn.named("text_disabled") == [("1 held",)]
    assert desk.sliders._held_in("jaw") == "   1 held" and desk.sliders._held_in("mouth") == ""
    desk.drawn(clicked="jawOpen")
    assert desk.sent == [Hold(JAW, None)] and not desk.commands.undoable


def test_what_another_panel_has_released_is_forgotten_here_but_not_what_was_just_set(desk: Desk) -> None:
    desk.told.by_hand = {}
    desk.commands.hold({JAW: 0.7})
    assert [on for _, on in desk.drawn().named("checkbox")] == [True]
    desk.now_s += 0.9  # the body may not have told yet
    assert [on for _, on in desk.drawn().named("checkbox")] == [True]
    desk.told.by_hand = {JAW: 0.7}
    desk.now_s += 5.0
    assert [on for _, on in desk.drawn().named("checkbox")] == [True]
    desk.told.by_hand = {}
    assert [on for _, on in desk.drawn().named("checkbox")] == [False] and desk.commands.now.held == {}
    desk.commands.hold({JAW: 0.7})
    assert desk.sent == [Hold(JAW, 0.7), Hold(JAW, 0.7)]  # it is not taken for what is held already


def test_all_are_released_together_whoever_holds_them(desk: Desk) -> None:
    assert desk.drawn().named("text_disabled") == [("a tick holds a value by hand",)]
    desk.commands.hold({YAW: 0.2})
    desk.drawn()
    desk.told.by_hand, desk.now_s = {YAW: 0.2, JAW: 0.6}, 20.0
    desk.drawn(pressed="release all")
    assert {*desk.sent[1:]} == {Hold(YAW, None), Hold(JAW, None)}
    assert desk.commands.now.held == {}
    desk.commands.undo()
    assert desk.commands.now.held == {YAW: 0.2}


def test_a_slider_says_who_holds_it() -> None:
    sliders, *_ = made({})
    drawn: Any = Widgets()
    sliders._row(drawn, "jawOpen", (JAW,))
    assert drawn.named("slider")[0][4] == "%.2f  speech 50%%"
    assert drawn.named("add_line") == []
    assert (sliders._away("jaw"), sliders._away("mouth")) == ("   servos 1.3 deg away", "")
    assert made()[0]._away("jaw") == ""


@pytest.mark.parametrize(("shown", "x"), [(0.25, 150.0), (0.0, 100.0), (1.0, 300.0), (1.3, 300.0), (-0.3, 100.0)])
def test_a_mark_shows_where_the_servo_is(shown: float, x: float) -> None:
    sliders, *_ = made({JAW: shown})
    drawn: Any = Widgets(hovered=True)
    sliders._row(drawn, "jawOpen", (JAW,))
    ((above, below, _, _),) = drawn.named("add_line")
    assert (above.x, above.y, below.x, below.y) == (pytest.approx(x), 50.0, pytest.approx(x), 70.0)
    assert drawn.named("set_tooltip")[-1] == (f"servos show {shown:.2f}",)


def test_a_mark_of_both_sides_is_in_their_middle_and_names_both() -> None:
    sliders, *_ = made({SMILE[0]: 0.2, SMILE[1]: 0.6})
    drawn: Any = Widgets(hovered=True)
    sliders._row(drawn, "mouthSmile", SMILE)
    ((above, *_),) = drawn.named("add_line")
    assert above.x == pytest.approx(180.0)
    assert drawn.named("set_tooltip")[-1] == ("servos show 0.20 and 0.60",)
    one, *_ = made({SMILE[1]: 0.6})
    drawn = Widgets()
    one._row(drawn, "mouthSmile", SMILE)
    assert drawn.named("add_line")[0][0].x == pytest.approx(220.0) and drawn.named("set_tooltip") == []


def test_a_value_fits_both_sides_unless_it_moves_all_aside_or_turns_eyes() -> None:
    def of(*names: str) -> bool:
        return same_sense([PARAMETERS.index(name) for name in names], PARAMETERS)

    assert of("mouthSmileLeft", "mouthSmileRight") and of("eyeBlinkLeft", "eyeBlinkRight")
    for pair in (("mouthLeft", "mouthRight"), ("jawLeft", "jawRight"), ("leftEyeYaw", "rightEyeYaw"),
                 ("eyeLookInLeft", "eyeLookOutRight"), ("jawOpen", "jawOpen")):  # fmt: skip
        assert not of(*pair)


def test_rows_are_found_by_any_part_of_a_name_and_each_parameter_is_in_one() -> None:
    sliders, *_ = made()
    every = [i for region in PARAMETERS.region_names for row in sliders.rows(region) for i in row]
    assert sorted(set(every)) == list(range(len(PARAMETERS)))
    pairs = [row for row in sliders.rows("mouth") if len(row) == 2]
    assert pairs == sliders.rows("mouth")[: len(pairs)] and SMILE in pairs  # pairs come first
    sliders._search = "OPEN"
    assert [row for region in PARAMETERS.region_names for row in sliders.rows(region)] == [(JAW,)]
    assert np.isclose(PARAMETERS.neutral()[JAW], 0.0)


def test_an_open_region_has_a_row_for_each_and_a_search_opens_it() -> None:
    sliders, *_ = made({})
    drawn: Any = Widgets()
    sliders._region(drawn, "jaw")
    assert drawn.named("header") == [("jaw   servos 1.3 deg away###jaw",)]
    names = [label.removeprefix("##") for label, *_ in drawn.named("slider")]
    assert len(names) == len(sliders.rows("jaw")) and "jawOpen" in names
    assert drawn.named("table_setup_column")[0] == ("name", 1, LETTER * max(map(len, names)) + 1.4 * 20.0)
    assert drawn.named("set_next_item_open") == []
    sliders._search = "jawopen"
    sliders._region(drawn, "jaw")
    assert drawn.named("set_next_item_open") == [(True,)]
    sliders._search = "nothing has this name"
    before = len(drawn.calls)
    sliders._region(drawn, "jaw")
    assert len(drawn.calls) == before


@pytest.mark.parametrize(("shown", "x"), [(-0.5, 150.0), (0.0, 200.0), (0.5, 250.0), (-1.0, 100.0), (1.2, 300.0)])
def test_a_mark_of_what_goes_both_ways_is_in_the_middle_at_rest(shown: float, x: float) -> None:
    sliders, *_ = made({YAW: shown})
    drawn: Any = Widgets()
    sliders._measured(drawn, (YAW,), -1.0, 1.0)
    ((top, bottom, _, width),) = drawn.named("add_line")
    assert (top.x, top.y, bottom.x, bottom.y) == (pytest.approx(x), 50.0, pytest.approx(x), 70.0) and width == 1.5
    assert not drawn.named("set_tooltip")


def test_a_row_of_both_sides_is_named_without_one() -> None:
    left, right, jaw = (PARAMETERS.index(name) for name in ("mouthSmileLeft", "mouthSmileRight", "jawOpen"))
    assert _label([left, right], PARAMETERS) == "mouthSmile"
    assert _label([left], PARAMETERS) == "mouthSmileLeft" and _label([jaw], PARAMETERS) == "jawOpen"
