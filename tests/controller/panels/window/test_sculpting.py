"""controller.panels.window.sculpting: what the tab of the tools shows for each, and what it changes."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.panels.session.commands import Commands
from controller.panels.window.editing import TOOLS, Brush
from controller.panels.window.sculpting import ABOUT, SculptPanel


class Imgui:
    """Notes what is drawn; ``answers`` : of radio buttons, boxes, buttons and sliders, by their label."""

    def __init__(self, **answers: Any) -> None:
        self.answers, self.drawn = {k.replace("_", " "): v for k, v in answers.items()}, list[tuple[Any, ...]]()

    def get_font_size(self) -> float:
        return 10.0

    def radio_button(self, label: str, on: bool) -> bool:
        self.drawn.append(("radio", label, on))
        return bool(self.answers.get(label, False))

    def checkbox(self, label: str, on: bool) -> tuple[bool, bool]:
        self.drawn.append(("box", label, on))
        return label in self.answers, self.answers.get(label, on)

    def button(self, label: str) -> bool:
        self.drawn.append(("button", label))
        return bool(self.answers.get(label, False))

    def slider_float(self, label: str, value: float, low: float, high: float, form: str) -> tuple[bool, float]:
        self.drawn.append(("slider", label, value, low, high, form))
        return label in self.answers, self.answers.get(label, value)

    def __getattr__(self, name: str) -> Any:
        return lambda *given: self.drawn.append((name, *given))

    def of(self, name: str) -> list[Any]:
        return [call[1] for call in self.drawn if call[0] == name]


class Rig:
    """The tab of a face with points of which two are pinned where ``pinned`` is 2."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, pinned: int = 0, sculpted: bool = False) -> None:
        self.asked, self._patch = list[str](), monkeypatch
        editor = SimpleNamespace(
            pinned=pinned, sculpted=sculpted, unpin=lambda: self.asked.append("unpin"),
            prepare=lambda: self.asked.append("prepare"),
        )  # fmt: skip
        self.mouse: Any = SimpleNamespace(brush=Brush(), editor=editor, message="")
        self.commands = Commands(lambda request: None)

    def draw(self, **answers: Any) -> Imgui:
        imgui = Imgui(**answers)
        self._patch.setitem(sys.modules, "imgui_bundle", SimpleNamespace(imgui=imgui))
        SculptPanel(self.mouse, self.commands)()
        return imgui


@pytest.mark.parametrize(
    ("tool", "sliders"),
    [
        ("pull the face", []),
        ("pull the skin", [("falloff, mm", 22.0, 5.0, 60.0)]),
        ("wrinkle", [("depth, mm", 1.2, 0.2, 3.0), ("width, mm", 3.0, 2.0, 8.0)]),
        ("add points", [("reach, mm", 8.0, 3.0, 30.0)]),
        ("remove points", []),
    ],
)
def test_each_tool_has_its_text_and_its_sliders(
    monkeypatch: pytest.MonkeyPatch, tool: Any, sliders: list[tuple[Any, ...]]
) -> None:
    rig = Rig(monkeypatch)
    rig.mouse.brush.tool = tool
    drawn = rig.draw()
    assert [call[1:3] for call in drawn.drawn if call[0] == "radio"] == [(each, each == tool) for each in TOOLS]
    assert drawn.of("text_wrapped") == [ABOUT[tool]] and not drawn.of("button") and not rig.asked
    assert [call[1:] for call in drawn.drawn if call[0] == "slider"] == [(*each, "%.1f") for each in sliders]
    assert drawn.of("set_next_item_width") == [80.0] * len(sliders)  # eight letters wide
    boxes = ["both sides of the face"] + ["pin points where they are let go"] * (tool == "pull the face")
    assert drawn.of("box") == boxes
    assert all(low <= value <= high for _, value, low, high in sliders)


def test_what_is_chosen_is_what_the_mouse_uses(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch)
    rig.mouse.message = "no skin there"
    drawn = rig.draw(both_sides_of_the_face=True, pin_points_where_they_are_let_go=True)
    assert "no skin there" in drawn.of("text_wrapped")
    assert rig.mouse.brush.symmetric and rig.mouse.brush.pinning and not rig.asked
    rig.draw(wrinkle=True, **{"depth,_mm": 2.5, "width,_mm": 4.0})
    brush = rig.mouse.brush
    assert (brush.tool, brush.depth_mm, brush.width_mm) == ("wrinkle", 2.5, 4.0)
    assert rig.asked == ["prepare"] and rig.mouse.message == ""


@pytest.mark.parametrize("pinned", [0, 1, 2])
def test_pinned_points_are_let_go_by_a_button(monkeypatch: pytest.MonkeyPatch, pinned: int) -> None:
    rig = Rig(monkeypatch, pinned=pinned)
    assert rig.draw().of("button") == [f"unpin all {pinned}"] * (pinned > 0) and not rig.asked
    rig.draw(**{f"unpin all {pinned}": True})
    assert rig.asked == ["unpin"] * (pinned > 0)


@pytest.mark.parametrize(("sculpted", "added"), [(False, False), (True, False), (False, True)])
def test_what_was_sculpted_is_smoothed_out_by_a_button(
    monkeypatch: pytest.MonkeyPatch, sculpted: bool, added: bool
) -> None:
    rig = Rig(monkeypatch, sculpted=sculpted)
    if added:
        rig.commands.now = SimpleNamespace(light=(object(),))  # type: ignore[assignment]
    else:
        rig.commands.set_moves(np.ones((4, 3)))
    smoothed = list[Any]()
    monkeypatch.setattr(rig.commands, "set_moves", smoothed.append)
    assert rig.draw().of("button") == ["smooth it out"] * (sculpted or added) and not smoothed
    rig.draw(smooth_it_out=True)
    assert smoothed == [None] * (sculpted or added)
