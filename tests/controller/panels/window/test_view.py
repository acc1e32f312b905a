"""controller.panels.window.view: what the keys of shows send. How it is drawn: test_face.py, with a real window."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.body.messages import ControlShow, PanelRequest, PlayShow
from controller.panels.session.capture import Capture
from controller.panels.session.commands import Commands
from controller.panels.window.view import View
from surface.view.docks import PictureArea
from surface.view.scene.viewpoint import Viewpoint


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
