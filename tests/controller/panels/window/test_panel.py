"""controller.panels.window.panel: the parts of a panel, what stops servos, and what keys and buttons do."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from controller.base.errors import ParameterError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS
from controller.body.messages import ControlShow, Details, Neutral, PlayShow, Show, StartServos, StopServos
from controller.body.panel_state import PanelState
from controller.layers.commands import CommandState
from controller.panels.session.look import Look
from controller.panels.window.panel import Panel, PanelOptions
from surface.view.docks import PictureArea
from tests.controller.panels.window.screen import Places, Screen, drawn


def test_the_panel_stops_and_starts_the_servos_and_says_who_stopped_them(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    places, sent, state = Places(screen.imgui, monkeypatch), [], CommandState(PARAMETERS)
    with Mailbox.create(PanelState.size(PARAMETERS)) as mailbox:
        body = PanelState(mailbox, state.layer_names(), PARAMETERS)
        panel = Panel(PARAMETERS.neutral, sent.append, PanelState(mailbox, state.layer_names(), PARAMETERS))
        draw = drawn(panel, "View")
        body.publish(state, None)
        for _ in range(3):
            screen.frame(draw)
        assert "START servos" not in places.at and not any("stopped" in text for text in places.texts)
        screen.click(draw, *places.at["STOP servos"])
        assert sent == [StopServos()]
        state.stop_latch.stop("line /dev/ttyUSB0", 5)
        body.publish(state, None)
        for _ in range(2):
            screen.frame(draw)
        assert "servos stopped by line /dev/ttyUSB0" in places.texts
        screen.click(draw, *places.at["START servos"])
        assert sent == [StopServos(), StartServos()]


def test_keys_do_what_the_help_says(screen: Screen) -> None:
    sent: list[Any] = []
    panel = Panel(PARAMETERS.neutral, sent.append, options=PanelOptions(shows=("tour",)))
    imgui, draw = screen.imgui, drawn(panel, "View")

    def press(*keys: Any) -> None:
        for down in (True, False):
            for key in keys:
                screen.io.add_key_event(key, down)
            screen.frame(draw)

    key = imgui.Key
    screen.frame(draw)
    press(key.space)
    press(key.space)
    press(key.space)
    assert sent == [PlayShow("tour"), ControlShow("PAUSE"), ControlShow("PLAY")]
    press(key.escape)
    assert sent[-1] == StopServos()
    press(key.n)
    assert isinstance(sent[-1], Neutral)
    press(key.f)
    assert panel.area.bare
    panel.commands.show("anger", 1.0)
    press(key.mod_ctrl, key.z)
    assert sent[-1] == Show("neutral", 1.0)
    press(key.mod_ctrl, key.y)
    assert sent[-1] == Show("anger", 1.0)
    press(key.h)
    assert panel.keys.help_shown
    press(key.r)
    assert panel.capture.recording


def test_what_is_saved_goes_to_the_last_vocabulary_or_to_one_of_the_folder(tmp_path: Path) -> None:
    assert PanelOptions(folder=tmp_path).own_file == tmp_path / "mine.toml"
    files = [tmp_path / "a.toml", tmp_path / "b.toml"]
    assert PanelOptions(files=files, folder=tmp_path).own_file == files[1]
    panel = Panel(PARAMETERS.neutral, lambda request: None, options=PanelOptions(files=files, folder=tmp_path))
    assert panel.saving._words.own == files[1] and panel.saving._words.earlier == (files[0],)


def test_servos_and_links_are_parts_where_the_body_reports_them_and_sculpting_where_a_face_is_drawn() -> None:
    plain = Panel(PARAMETERS.neutral, lambda request: None)
    assert [dock.title for dock in plain.docks()] == ["Faces", "Sliders", "View", "Time"]
    assert plain.feed is None and not hasattr(plain, "servos")
    whole = Panel(PARAMETERS.neutral, lambda request: None, details=lambda: None)
    whole.sculpt = lambda: None
    titles = [dock.title for dock in whole.docks()]
    assert titles == ["Faces", "Sliders", "Sculpt", "View", "Time", "Servos", "Links"]
    assert {dock.side for dock in whole.docks()} == {"left"}


def test_the_amount_of_idle_motion_of_the_stage_is_the_first_one() -> None:
    panel = Panel(PARAMETERS.neutral, lambda request: None, options=PanelOptions(life=0.25))
    assert panel.commands.now.life == 0.25 and not panel.commands.undoable


def test_neutral_gives_back_parameters_and_servos_that_were_turned_by_hand() -> None:
    sent, details = list[Any](), Details(servos=[], links=[])
    panel = Panel(PARAMETERS.neutral, sent.append, details=lambda: details)
    forgotten = list[int]()
    panel.calibrating.forget = lambda: forgotten.append(1)  # type: ignore[method-assign]
    panel._neutral()
    assert isinstance(sent[-1], Neutral) and forgotten == [1]
    Panel(PARAMETERS.neutral, sent.append)._neutral()  # where there are no servos


def test_the_face_alone_takes_the_whole_screen_and_gives_it_back() -> None:
    panel, toggled = Panel(PARAMETERS.neutral, lambda request: None), list[bool]()
    full: Any = SimpleNamespace(on=False)

    def toggle() -> None:
        full.on = not full.on
        toggled.append(full.on)

    full.toggle, panel.full_screen = toggle, full
    for bare in (True, False):
        panel._toggle_bare()
        assert panel.area.bare is bare
    assert toggled == [True, False]
    full.on = True  # by the window's own key
    panel._toggle_bare()
    assert panel.area.bare and toggled == [True, False]


def test_a_step_of_undo_ends_when_the_mouse_is_let_go(screen: Screen) -> None:
    sent: list[Any] = []
    panel = Panel(PARAMETERS.neutral, sent.append)
    for down, value in ((True, 0.1), (True, 0.2), (False, 0.3)):
        screen.io.add_mouse_button_event(0, down)
        screen.frame(panel)
        panel.commands.hold({0: value}, "drag")
    panel.commands.undo()
    assert panel.commands.now.held == {0: 0.2}
    panel.commands.undo()
    assert panel.commands.now.held == {}


def test_a_picture_that_is_alone_keeps_a_stop_in_its_corner(screen: Screen) -> None:
    sent, area = list[Any](), PictureArea()
    panel = Panel(PARAMETERS.neutral, sent.append, area=area)
    area.bare = True
    for _ in range(3):
        screen.frame(panel)
    box = panel.stop.box
    assert box.left > 900 - 10 * 14 - 20 and box.top > 3000 - 100  # of a display of 900 x 3000
    screen.click(panel, (box.left + box.right) / 2, (box.top + box.bottom) / 2)
    assert sent == [StopServos()]


def test_buttons_that_can_do_nothing_are_off(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    places, sent = Places(screen.imgui, monkeypatch), list[Any]()
    panel = Panel(PARAMETERS.neutral, sent.append)
    draw = drawn(panel, "View")
    for _ in range(2):
        screen.frame(draw)
    for label in ("undo##top", "redo##top"):
        screen.click(draw, *places.at[label])
    assert sent == []
    panel.commands.show("anger", 1.0)
    screen.click(draw, *places.at["undo##top"])
    screen.click(draw, *places.at["redo##top"])
    assert sent == [Show("anger", 1.0), Show("neutral", 1.0), Show("anger", 1.0)]
    off, real = list[bool](), screen.imgui.begin_disabled
    monkeypatch.setattr(screen.imgui, "begin_disabled", lambda disabled: (off.append(disabled), real(disabled)))
    screen.frame(draw)
    assert off[:3] == [False, True, False]  # undo, redo, neutral


def test_a_look_that_cannot_be_shown_is_a_problem_and_files_can_be_dropped() -> None:
    panel, shown = Panel(PARAMETERS.neutral, lambda request: None), list[Any]()

    class Looks:
        """Refuses a look without a person."""

        def show(self, look: Look | None) -> None:
            """Show it."""
            if look is None:
                raise ParameterError("no such look")
            shown.append(look)

    assert panel.area.dropped is None and panel.view.look is None
    panel.add_looks(Looks(), lambda path: None)  # type: ignore[arg-type]
    look = Look("studio", "fast", "")
    panel.commands.show_look(look)
    panel.commands.show_look(None)
    assert shown == [look] and ["no such look" in each.text for each in panel.problems.unread] == [True]
    assert panel.area.dropped is not None and panel.view.look is not None
