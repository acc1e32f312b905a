"""controller.panels.window.view: what the keys of shows send. How it is drawn: test_face.py, with a real window."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.body.messages import ControlShow, PanelRequest, PlayShow
from controller.panels.session.capture import Capture
from controller.panels.session.commands import Commands
from controller.panels.window.view import RED_DOT, View
from surface.view.docks import PictureArea
from surface.view.scene.viewpoint import Viewpoint
from tests.controller.panels.window.drawn import Drawn


def make(sent: list[PanelRequest], shows: list[str]) -> View:
    capture = Capture(PictureArea(), lambda: np.zeros(len(PARAMETERS.names)), Path())
    return View(Commands(sent.append), Viewpoint(), capture, shows, sent.append)


@pytest.fixture
def sent() -> list[PanelRequest]:
    return []


def test_the_first_show_begins_pauses_and_goes_on(sent: list[PanelRequest]) -> None:
    view = make(sent, ["greeting", "farewell"])
    for _ in range(3):
        view.toggle_show()
    assert sent == [PlayShow("greeting"), ControlShow("PAUSE"), ControlShow("PLAY")]


def test_a_show_that_was_stopped_begins_again_and_is_not_paused(sent: list[PanelRequest]) -> None:
    view = make(sent, ["greeting"])
    view.toggle_show()
    view.toggle_show()
    view.stop_show()
    view.stop_show()  # nothing plays: nothing is sent
    view.toggle_show()
    view.toggle_show()
    assert sent[2:] == [ControlShow("STOP"), PlayShow("greeting"), ControlShow("PAUSE")]


def test_without_shows_nothing_is_sent(sent: list[PanelRequest]) -> None:
    view = make(sent, [])
    view.toggle_show()
    view.stop_show()
    assert sent == []


class Capturing:
    """Notes what it is told to take."""

    def __init__(self, *, recording: bool = False, filming: bool = False, message: str = "") -> None:
        self.recording, self.filming, self.message, self.seconds = recording, filming, message, 61.6
        self.asked = list[str]()
        self.take_picture, self.toggle, self.toggle_clip = (
            lambda what=what: self.asked.append(what) for what in ("picture", "recording", "clip")
        )


@pytest.mark.parametrize(
    ("pressed", "asked"),
    [("", []), ("screenshot", ["picture"]), ("record", ["recording"]), ("clip", ["clip"]), ("end clip", [])],
)
def test_each_button_takes_what_it_says(sent: list[PanelRequest], pressed: str, asked: list[str]) -> None:
    view, drawn = make(sent, []), Drawn(pressed)
    view._capture = capturing = Capturing()  # type: ignore[assignment]
    view._captures(drawn)
    assert drawn.named("button") == [("screenshot",), ("record",), ("clip",)] and capturing.asked == asked
    assert not drawn.named("text_colored", "text_wrapped")


@pytest.mark.parametrize(
    ("recording", "filming", "labels", "doing"),
    [(True, False, ("end recording", "clip"), "recording 62 s"), (False, True, ("record", "end clip"), "filming")],
)
def test_what_is_being_taken_is_said_in_red(
    sent: list[PanelRequest], recording: bool, filming: bool, labels: tuple[str, str], doing: str
) -> None:
    view, drawn = make(sent, []), Drawn(labels[0] if recording else labels[1])
    view._capture = capturing = Capturing(  # type: ignore[assignment]
        recording=recording, filming=filming, message="wrote face1.png"
    )
    view._captures(drawn)
    assert drawn.named("button") == [("screenshot",), *((label,) for label in labels)]
    assert drawn.named("text_colored") == [(RED_DOT, doing)]
    assert drawn.named("text_wrapped") == [("wrote face1.png",)]
    assert capturing.asked == ["recording" if recording else "clip"]


def test_shows_are_buttons_and_one_that_plays_is_paused_and_stopped(sent: list[PanelRequest]) -> None:
    view = make(sent, ["greeting", "farewell"])
    view._draw_shows(drawn := Drawn())
    assert drawn.named("button") == [("greeting",), ("farewell",)] and sent == []
    view._draw_shows(Drawn("farewell"))
    view._draw_shows(Drawn("pause"))
    view._draw_shows(drawn := Drawn("go on"))
    assert drawn.named("button")[2:] == [("go on",), ("stop the show",)]
    view._draw_shows(Drawn("stop the show"))
    assert sent == [PlayShow("farewell"), ControlShow("PAUSE"), ControlShow("PLAY"), ControlShow("STOP")]
