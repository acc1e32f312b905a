"""The distance from the mesh over the face: what the panel says, and when the face is drawn anew."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from controller.face.fit_colours import NOT_MEASURED
from controller.panels.overlay.colours import packed
from controller.panels.overlay.fit_error import NONE, FitErrorView, _encoded
from surface.base.error_colours import FULL_MM, SCALE
from surface.head import Head, save_data
from surface.head.posing.fit_error import write_fit_error
from surface.view.docks import PictureArea
from surface.view.scene.theme import THEMES
from tests.controller.panels.window import drawn
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
    vertices: list[float] = []

    def draw() -> None:
        background = screen.imgui.get_background_draw_list()
        view()
        vertices.append(float(len(background.vtx_buffer)))

    screen.frame(draw)
    assert vertices[-1] == 0.0
    view.switch(on=True)
    view.dress(measured, SKIN)
    screen.frame(draw)
    assert vertices[-1] > 100.0


class Sheet(drawn.Drawn):
    """Notes what is drawn; a colour is the list of its shares."""

    def get_background_draw_list(self) -> Sheet:
        return self

    def color_convert_float4_to_u32(self, rgba: tuple[float, ...]) -> int:
        return sum(round(100 * part) << 8 * i for i, part in enumerate(rgba))


@pytest.mark.parametrize(("gaps", "lines"), [(False, 3.0), (True, 4.2)])
@pytest.mark.parametrize(("width", "wide"), [(600.0, 16.0), (160.0, 160.0 / drawn.LINE - 3.2)])
def test_the_scale_stands_in_the_lower_right_corner(
    measured: Head, monkeypatch: pytest.MonkeyPatch, gaps: bool, lines: float, width: float, wide: float
) -> None:
    """In heights of a line of text: a margin of 0.8 about it, a title, a bar of 0.7, and what was not measured."""
    view, sheet, line = (
        FitErrorView(measured, PictureArea(300.0, 10.0, width, 480.0), lambda: None),
        Sheet(),
        drawn.LINE,
    )
    monkeypatch.setitem(sys.modules, "imgui_bundle", SimpleNamespace(imgui=sheet))
    view()
    assert not sheet.calls
    view._painted, view._gaps = True, gaps
    view()
    right, bottom = 300.0 + width - 0.8 * line, 490.0 - 0.8 * line
    left, top = right - (wide + 1.6) * line, bottom - (lines + 1.6) * line
    ground, *missing = sheet.named("add_rect_filled")
    assert (ground[0].x, ground[0].y, ground[1].x, ground[1].y) == pytest.approx((left, top, right, bottom))
    assert ground[2:] == (packed(sheet, (0.05, 0.05, 0.06, 0.75)), 0.3 * line)
    left, top, right = left + 0.8 * line, top + 0.8 * line, right - 0.8 * line
    texts = [(place.x, place.y, text) for place, _, text in sheet.named("add_text")]
    white = packed(sheet, (0.92, 0.92, 0.92, 1.0))
    assert {colour for _, colour, _ in sheet.named("add_text")} == {white}
    assert texts[0] == (pytest.approx(left), pytest.approx(top), "mm between face and mesh")
    bars = sheet.named("add_rect_filled_multi_color")
    step, colours = (right - left) / (len(SCALE) - 1), [_encoded(sheet, each) for each in SCALE]
    assert len(bars) == len(SCALE) - 1
    for i, (low, high, *shades) in enumerate(bars):
        assert (low.x, low.y) == pytest.approx((left + i * step, top + 1.3 * line))
        assert (high.x, high.y) == pytest.approx((left + (i + 1) * step, top + 2.0 * line))
        assert shades == [colours[i], colours[i + 1], colours[i + 1], colours[i]]
    numbers = texts[1 : len(SCALE) + 1]
    wanted = [f"{FULL_MM * i / (len(SCALE) - 1):g}" for i in range(len(SCALE))]
    assert [text for *_, text in numbers] == [*wanted[:-1], wanted[-1] + "+"]
    for i, (x, y, text) in enumerate(numbers):
        own = drawn.LETTER * len(text)
        assert x == pytest.approx(min(max(left + i * step - own / 2, left), right - own))
        assert y == pytest.approx(top + 2.15 * line)
    if not gaps:
        assert not missing and len(texts) == len(SCALE) + 1
        return
    ((low, high, colour),) = missing
    assert (low.x, low.y, high.x, high.y) == pytest.approx((left, top + 3.3 * line, left + line, top + 4.0 * line))
    assert colour == _encoded(sheet, NOT_MEASURED)
    assert texts[-1] == (pytest.approx(left + 1.5 * line), pytest.approx(top + 3.15 * line), "not measured")


def test_colours_of_the_scale_are_as_bright_as_on_the_face() -> None:
    seen = list[tuple[float, ...]]()
    imgui = SimpleNamespace(ImVec4=lambda *rgba: rgba, color_convert_float4_to_u32=lambda rgba: seen.append(rgba) or 3)
    assert _encoded(imgui, (0.0, 0.5, 1.0)) == 3
    assert seen == [(0.0, pytest.approx(0.5 ** (1 / 2.2)), 1.0, 1.0)]
