"""The distance from the mesh over the face: what the panel says, and when the face is drawn anew."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from controller.panels.overlay.fit_error import NONE, FitErrorView
from surface.head import Head, save_data
from surface.head.posing.fit_error import write_fit_error
from surface.view.docks import PictureArea
from surface.view.scene.theme import THEMES
from tests.controller.panels.window.screen import Places, Screen
from tests.surface.small_head import part, small_head

SKIN = THEMES["skin"]


@pytest.fixture
def screen() -> Iterator[Screen]:
    found = Screen()
    yield found
    found.imgui.destroy_context(found.context)


@pytest.fixture
def measured(tmp_path: Path) -> Head:
    save_data(tmp_path, small_head(parts=[part("face", -40)], seams=[]))
    head = Head.load(tmp_path)
    write_fit_error(tmp_path, {"face": np.full(len(head.part("face").vertices), 0.5)}, head.parts)
    return Head.load(tmp_path)


def made(head: Head) -> tuple[FitErrorView, list[str]]:
    redrawn: list[str] = []
    return FitErrorView(head, PictureArea(300.0, 0.0, 600.0, 480.0), lambda: redrawn.append("again")), redrawn


def test_the_face_is_painted_while_it_is_on_and_another_head_too(
    screen: Screen, measured: Head, monkeypatch: pytest.MonkeyPatch
) -> None:
    view, redrawn = made(measured)
    places, own = Places(screen.imgui, monkeypatch), measured.part("face").attributes
    assert view.dress(measured, SKIN) is SKIN
    for _ in range(2):
        screen.frame(view.draw_checkboxes)
    assert not redrawn
    screen.click(view.draw_checkboxes, *places.at["fit error##overlay"])
    assert view.on and redrawn == ["again"]
    assert view.dress(measured, SKIN) is not SKIN and measured.part("face").attributes is not own
    screen.frame(view.draw_checkboxes)
    assert places.texts[-1] == "face: RMS 0.50 mm, 99 % within 0.50 mm, most 0.50 mm"
    other = Head(small_head())
    assert view.dress(other, SKIN) is SKIN and measured.part("face").attributes is own
    screen.frame(view.draw_checkboxes)
    assert places.texts[-1] == NONE
    view.switch(on=False)
    assert redrawn == ["again"]  # nothing changes on a head that was not measured


def test_the_scale_is_in_the_picture_with_its_ends(screen: Screen, measured: Head) -> None:
    view, _ = made(measured)
    drawn: list[tuple[str, float, float]] = []

    def draw() -> None:
        background = screen.imgui.get_background_draw_list()
        view()
        drawn.append(("vertices", float(len(background.vtx_buffer)), 0.0))

    screen.frame(draw)
    assert drawn[-1][1] == 0.0
    view.switch(on=True)
    view.dress(measured, SKIN)
    screen.frame(draw)
    assert drawn[-1][1] > 100.0
