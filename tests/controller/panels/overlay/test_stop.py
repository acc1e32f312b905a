"""The button that stops the servos is above everything, at every size, whatever the mouse did before."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.panels.overlay.colours import RED, packed
from controller.panels.overlay.stop import LABEL, Box, StopButton, _corner, _min_width
from tests.controller.panels.window import drawn as drawn_by_hand
from tests.controller.panels.window.screen import Screen
from tests.controller.panels.window.test_face import on_a_display, scaled
from tests.hands import Hands, Steps, run_script

STAGE = """
name = "small"
robots = ["head24"]
[face]
size = [{width}, {height}]
quality = "fast"
"""
PROGRAM = "from tests.controller.panels.overlay.test_stop import main; main()"


@pytest.fixture
def screen() -> Iterator[Screen]:
    found = Screen()
    found.io.display_size = found.imgui.ImVec2(640, 480)
    yield found
    found.imgui.destroy_context(found.context)


class Drawn:
    """A panel with the button and a menu, and a window that floats over both."""

    def __init__(self, imgui: Any, width: float = 300.0) -> None:
        self.imgui, self.width, self.over = imgui, width, False
        self.stops, self.clicks, self.label_width = 0, 0, 0.0
        self.stop = StopButton(self._count)

    def _count(self) -> None:
        self.stops += 1

    def __call__(self) -> None:
        imgui = self.imgui
        self.label_width = imgui.calc_text_size(LABEL).x
        self.stop(imgui)
        imgui.set_next_window_pos(imgui.ImVec2(0, 0))
        imgui.set_next_window_size(imgui.ImVec2(self.width, 400))
        imgui.begin("panel")
        self.stop.leave_room(imgui)
        if imgui.begin_combo("menu", "now"):
            for i in range(40):
                self.clicks += imgui.selectable(f"{i}", False)[0]
            imgui.end_combo()
        self.menu = imgui.get_item_rect_min()
        imgui.end()
        if self.over:
            imgui.set_next_window_pos(imgui.ImVec2(0, 0))
            imgui.set_next_window_size(imgui.ImVec2(640, 480))
            imgui.set_next_window_focus()
            imgui.begin("over")
            self.clicks += imgui.button("wide", imgui.ImVec2(-1, -1))
            imgui.end()


def middle(box: Box) -> tuple[float, float]:
    return (box.left + box.right) / 2, (box.top + box.bottom) / 2


def test_one_click_stops_once(screen: Screen) -> None:
    drawn = Drawn(screen.imgui)
    for _ in range(3):
        screen.frame(drawn)
    screen.click(drawn, *middle(drawn.stop.box))
    assert drawn.stops == 1
    screen.click(drawn, 600.0, 400.0)
    assert drawn.stops == 1


def test_it_stops_under_a_window_that_floats_over_it_which_does_not_hear_the_click(screen: Screen) -> None:
    drawn = Drawn(screen.imgui)
    drawn.over = True
    for _ in range(3):
        screen.frame(drawn)
    x, y = middle(drawn.stop.box)
    assert x < 300.0  # in the panel
    screen.click(drawn, x, y)
    assert (drawn.stops, drawn.clicks) == (1, 0)
    screen.click(drawn, x, y + 100.0)
    assert (drawn.stops, drawn.clicks) == (1, 1)


def test_the_first_click_stops_while_a_menu_is_open(screen: Screen) -> None:
    drawn = Drawn(screen.imgui)
    for _ in range(3):
        screen.frame(drawn)
    screen.click(drawn, drawn.menu.x + 10.0, drawn.menu.y + 8.0)
    screen.frame(drawn)
    assert screen.imgui.is_popup_open("", screen.imgui.PopupFlags_.any_popup)
    screen.click(drawn, *middle(drawn.stop.box))
    assert (drawn.stops, drawn.clicks) == (1, 0)


def test_without_room_in_the_panel_it_is_in_the_corner_of_the_window(screen: Screen) -> None:
    drawn = Drawn(screen.imgui, width=60.0)
    for _ in range(3):
        screen.frame(drawn)
    box = drawn.stop.box
    assert box.within(Box(0, 0, 640, 480)) and box.left > 320.0 and box.top > 240.0
    assert box.right - box.left > drawn.label_width
    screen.click(drawn, *middle(box))
    assert drawn.stops == 1


def script(hands: Hands) -> Steps:
    """Cover the button with the help, with a menu and with a tab that floats; click it each time, START after it."""
    told = hands.report
    yield from hands.frames(8)
    yield from clicked(hands, "alone")
    yield from hands.tap(hands.imgui.Key.h)
    yield from clicked(hands, "help")
    yield from hands.grab("help")
    yield from hands.tap(hands.imgui.Key.h)
    yield from hands.tab("Faces")
    yield from hands.click("##kind")
    told["menu open"] = hands.imgui.is_popup_open("", hands.imgui.PopupFlags_.any_popup)
    yield from clicked(hands, "menu")
    yield from hands.tap(hands.imgui.Key.f)
    yield from clicked(hands, "bare")
    yield from hands.grab("bare")
    box, size = hands.face._panel.stop.box, hands.imgui.get_io().display_size
    told["in view"] = box.within(Box(0.0, 0.0, size.x, size.y))


def clicked(hands: Hands, name: str) -> Steps:
    """Click the button; tell whether the servos were stopped by that one click, and whether it is drawn red."""
    panel = hands.face._panel
    yield from hands.frames(4)
    x, y = middle(panel.stop.box)
    yield from hands.move(x, y)
    yield from hands.press(down=True)
    yield from hands.until(lambda: bool(panel._stopped_by), f"the stop, {name}", 20.0)
    yield from hands.press(down=False)
    hands.report[name] = red_at(hands, panel.stop.box)
    area = hands.face._area
    yield from hands.move(area.left + 0.9 * area.width, area.top + 0.1 * area.height)  # closes a menu that lies over it
    yield from hands.press(down=True)
    yield from hands.press(down=False)
    yield from hands.click("START servos")
    yield from hands.until(lambda: not panel._stopped_by, f"the start, {name}", 20.0)


def red_at(hands: Hands, box: Box) -> bool:
    """Whether the display shows the button at its corners, within its rounding."""
    from PIL import ImageGrab

    picture = np.asarray(ImageGrab.grab(xdisplay=os.environ["DISPLAY"]).convert("RGB"))
    inset = 0.2 * (box.bottom - box.top)
    corners = [(x, y) for x in (box.left + inset, box.right - inset) for y in (box.top + inset, box.bottom - inset)]
    colours = [picture[round(y), round(x)] for x, y in corners]
    return all(red > 110 and green < 60 and blue < 60 for red, green, blue in colours)


def main() -> None:
    """Run in the process of the window."""
    run_script(script, "edit", "stage.toml", "--seconds", "200")


@pytest.mark.slow
@on_a_display
@pytest.mark.parametrize(
    ("width", "height", "dpi"),
    [(640, 480, 96), (640, 480, 192), (1280, 720, 192), (3840, 2160, 192)],
)
def test_one_click_stops_whatever_lies_over_the_button(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, width: int, height: int, dpi: int
) -> None:
    (tmp_path / "stage.toml").write_text(STAGE.format(width=width, height=height))
    monkeypatch.setenv("OMOTE_TEST_FOLDER", str(tmp_path))
    monkeypatch.setenv("OMOTE_STATE", str(tmp_path / "state"))
    scaled(PROGRAM, dpi, (width, height))
    told = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert told["menu open"] and told["in view"]
    assert all(told[name] for name in ("alone", "help", "menu", "bare"))


class Pictured(drawn_by_hand.Drawn):
    """A window of 640 x 480 with the mouse somewhere, whose button is down or not."""

    def __init__(self, x: float, y: float, *, down: bool) -> None:
        super().__init__()
        at = drawn_by_hand.at
        self._io = SimpleNamespace(mouse_pos=at(x, y), mouse_down=[down], display_size=at(640.0, 480.0))

    def get_io(self) -> Any:
        return self._io

    def get_style(self) -> Any:
        return SimpleNamespace(frame_rounding=5.0)

    def get_foreground_draw_list(self) -> Pictured:
        return self

    def color_convert_float4_to_u32(self, rgba: tuple[float, ...]) -> int:
        return sum(round(100 * part) << 8 * i for i, part in enumerate(rgba))


@pytest.mark.parametrize(
    ("over", "down", "light"), [(False, False, 1.0), (True, False, 1.2), (True, True, 0.75), (False, True, 1.0)]
)
def test_it_is_brighter_under_the_mouse_and_darker_while_it_is_pressed(over: bool, down: bool, light: float) -> None:
    window, button = Pictured(0.0, 0.0, down=down), StopButton(lambda: None)
    button.box = Box(10.0, 20.0, 210.0, 60.0)
    button._draw(window, over=over)
    ((low, high, colour, rounding),) = window.named("add_rect_filled")
    assert (low.x, low.y, high.x, high.y, rounding) == (*button.box, 5.0)
    assert colour == packed(window, (light * RED[0], light * RED[1], light * RED[2], 1.0))
    ((_, _, rim, around),) = window.named("add_rect")
    assert (rim, around) == (packed(window, (1.0, 1.0, 1.0, 0.35)), 5.0)
    ((place, white, words),) = window.named("add_text")
    wide, line = drawn_by_hand.LETTER * len(LABEL), drawn_by_hand.LINE
    assert (place.x, place.y) == (110.0 - wide / 2, 40.0 - line / 2)
    assert (white, words) == (packed(window, (1.0, 1.0, 1.0, 1.0)), LABEL)


def test_the_corner_is_a_line_from_the_edges_of_the_window() -> None:
    line = drawn_by_hand.LINE
    assert _corner(Pictured(0.0, 0.0, down=False)) == (640 - 10 * line, 480 - 3 * line, 640 - line, 480 - line)
    assert _min_width(Pictured(0.0, 0.0, down=False)) == drawn_by_hand.LETTER * len(LABEL) + line


@pytest.mark.parametrize(
    ("x", "y", "inside"),
    [(1, 2, True), (3, 4, True), (2, 3, True), (0.9, 3, False), (3.1, 3, False), (2, 1.9, False), (2, 4.1, False)],
)
def test_a_box_holds_its_edges(x: float, y: float, inside: bool) -> None:
    assert Box(1, 2, 3, 4).holds(drawn_by_hand.at(x, y)) == inside


@pytest.mark.parametrize(
    ("outer", "within"),
    [
        ((1, 2, 3, 4), True),
        ((1.1, 2, 3, 4), False),
        ((1, 2.1, 3, 4), False),
        ((1, 2, 2.9, 4), False),
        ((1, 2, 3, 3.9), False),
    ],
)
def test_a_box_lies_within_one_of_its_size_and_no_smaller_one(outer: tuple[float, ...], within: bool) -> None:
    assert Box(1, 2, 3, 4).within(Box(*outer)) == within
