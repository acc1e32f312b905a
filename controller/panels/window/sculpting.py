"""Draws the tools with which the mouse changes the face, and what they are set to."""

from __future__ import annotations

from typing import Any

from controller.panels.session.commands import Commands
from controller.panels.window.editing import TOOLS, Brush, MouseEditing, Tool

ABOUT: dict[Tool, str] = {
    "pull the face": "Ctrl and drag a point: sliders follow.",
    "pull the skin": "Ctrl and drag the skin itself. With Ctrl and Shift any tool does.",
    "wrinkle": "Ctrl and draw a line on the face: the skin sinks along it.",
    "add points": "Ctrl and click adds a control point, and leaves the skin as it is. Ctrl and drag moves it.",
    "remove points": "Ctrl and click takes an added point out, and what it did to the skin.",
}
_SETTINGS: dict[Tool, tuple[tuple[str, str, float, float], ...]] = {
    "pull the face": (),
    "pull the skin": (("falloff, mm", "falloff_mm", 5.0, 60.0),),
    "wrinkle": (("depth, mm", "depth_mm", 0.2, 3.0), ("width, mm", "width_mm", 2.0, 8.0)),
    "add points": (("reach, mm", "reach_mm", 3.0, 30.0),),
    "remove points": (),
}


class SculptPanel:
    """Draws the tab; called once per frame.

    mouse : uses the tools. commands : undo what was sculpted.
    """

    def __init__(self, mouse: MouseEditing, commands: Commands) -> None:
        self._mouse, self._commands = mouse, commands

    def __call__(self) -> None:
        """Draw."""
        from imgui_bundle import imgui  # optional

        brush, editor = self._mouse.brush, self._mouse.editor
        for tool in TOOLS:
            if imgui.radio_button(tool, brush.tool == tool):
                brush.tool, self._mouse.message = tool, ""
                editor.prepare()
        imgui.separator()
        imgui.text_wrapped(ABOUT[brush.tool])
        self._settings(imgui, brush)
        _, brush.symmetric = imgui.checkbox("both sides of the face", brush.symmetric)
        if brush.tool == "pull the face":
            _, brush.pinning = imgui.checkbox("pin points where they are let go", brush.pinning)
        if editor.pinned and imgui.button(f"unpin all {editor.pinned}"):
            editor.unpin()
        if self._mouse.message:
            imgui.text_wrapped(self._mouse.message)
        if editor.sculpted or self._commands.now.light:
            imgui.separator()
            if imgui.button("smooth it out"):
                self._commands.set_moves(None)
            imgui.text_wrapped("Save it as a group, a slider of your own, or as a corrective: tab Faces.")

    @staticmethod
    def _settings(imgui: Any, brush: Brush) -> None:
        for label, name, low, high in _SETTINGS[brush.tool]:
            imgui.set_next_item_width(imgui.get_font_size() * 8)
            _, value = imgui.slider_float(label, getattr(brush, name), low, high, "%.1f")
            setattr(brush, name, value)
