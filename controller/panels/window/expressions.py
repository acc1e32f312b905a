"""Buttons of all expressions of the stage, the pad of moods, and saving the present face as an expression."""

from __future__ import annotations

from typing import Any

from controller.panels.overlay.colours import LAYERS, packed
from controller.panels.session.commands import Commands
from controller.panels.window.flow import Flow
from controller.panels.window.saving import Saving
from controller.vocabulary.affect import Affect
from controller.vocabulary.vocabulary import Vocabulary

_KINDS = {"emotion": "emotions", "gesture": "gestures", "user": "your own"}
_FINENESS = 50  # steps of the pad from the middle to its edge
_PAD_LINES = 16.0


class ExpressionButtons:
    """Draws them.

    vocabulary : of the stage. saving : saves the present face.
    """

    def __init__(self, vocabulary: Vocabulary, commands: Commands, saving: Saving) -> None:
        self._vocabulary, self._commands, self._saving = vocabulary, commands, saving
        self._affect = Affect.load(vocabulary)
        self._intensity = 1.0

    def __call__(self) -> None:
        """Draw; called once per frame."""
        from imgui_bundle import imgui  # optional

        imgui.set_next_item_width(-imgui.calc_text_size("intensity").x - imgui.get_font_size())
        moved, self._intensity = imgui.slider_float("intensity", self._intensity, 0.0, 1.0)
        shown = self._commands.now.expression
        if moved and shown.name != "neutral":
            self._commands.show(shown.name, self._intensity, "intensity")
        for kind, title in _KINDS.items():
            names = [name for name in self._vocabulary.names if self._vocabulary[name].kind == kind]
            if names:
                imgui.separator_text(title)
                self._buttons(imgui, names)
        imgui.separator_text("the present face")
        self._saving()
        imgui.separator_text("mood")
        self._pad(imgui)

    def _buttons(self, imgui: Any, names: list[str]) -> None:
        """Buttons of one kind, the shown one in the colour of its layer."""
        flow = Flow(imgui)
        for name in names:
            on = self._commands.now.expression.name == name
            if on:
                imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*LAYERS["expression"]))
            if flow.button(name):
                self._commands.show(name, self._intensity)
            if on:
                imgui.pop_style_color()

    def _pad(self, imgui: Any) -> None:
        """Valence to the right, arousal up; the emotions stand where their moods are."""
        side = min(imgui.get_content_region_avail().x, imgui.get_font_size() * _PAD_LINES)
        corner = imgui.get_cursor_screen_pos()
        imgui.invisible_button("pad", imgui.ImVec2(side, side))
        if imgui.is_item_active():
            at = imgui.get_io().mouse_pos
            valence, arousal = (2 * (at.x - corner.x) / side - 1, 1 - 2 * (at.y - corner.y) / side)
            self.choose_mood(valence, arousal)
        self._draw_pad(imgui, corner, side)

    def choose_mood(self, valence: float, arousal: float) -> None:
        """Show the face of a mood, each -1 to 1."""
        near = [round(max(-1.0, min(1.0, x)) * _FINENESS) / _FINENESS for x in (valence, arousal)]
        name = f"VA:{near[0]:g},{near[1]:g}"
        if name != self._commands.now.expression.name:
            self._commands.show(name, self._intensity, "mood")

    def _draw_pad(self, imgui: Any, corner: Any, side: float) -> None:
        draw, grey = imgui.get_window_draw_list(), packed(imgui, (0.6, 0.6, 0.6, 1.0))
        far, half = imgui.ImVec2(corner.x + side, corner.y + side), side / 2
        draw.add_rect(corner, far, grey)
        draw.add_line(imgui.ImVec2(corner.x + half, corner.y), imgui.ImVec2(corner.x + half, far.y), grey)
        draw.add_line(imgui.ImVec2(corner.x, corner.y + half), imgui.ImVec2(far.x, corner.y + half), grey)
        taken: list[tuple[float, float, float]] = []
        for name, point in zip(self._affect.names, self._affect.points, strict=True):
            wide = imgui.calc_text_size(name)
            x = corner.x + half * (1 + point[0]) - wide.x / 2
            x = min(max(x, corner.x + 2), far.x - wide.x - 2)
            y = _free_height(taken, x, corner.y + half * (1 - point[1]) - wide.y / 2, wide.x, wide.y)
            taken.append((x, y, wide.x))
            ground = imgui.get_color_u32(imgui.Col_.window_bg)  # the cross ends at a label
            draw.add_rect_filled(imgui.ImVec2(x, y), imgui.ImVec2(x + wide.x, y + wide.y), ground)
            draw.add_text(imgui.ImVec2(x, y), packed(imgui, (0.85, 0.85, 0.85, 1.0)), name)
        shown = self._commands.now.expression.name
        if shown.startswith("VA:"):
            valence, arousal = map(float, shown[3:].split(","))
            dot = imgui.ImVec2(corner.x + half * (1 + valence), corner.y + half * (1 - arousal))
            draw.add_circle_filled(dot, imgui.get_font_size() / 3, packed(imgui, LAYERS["expression"]))
        imgui.text_disabled("right: pleasant, up: excited")


def _free_height(taken: list[tuple[float, float, float]], x: float, y: float, width: float, height: float) -> float:
    """Return the first height from ``y`` down where a label covers none of those ``taken`` (left, top, width)."""
    while any(x < left + wide and left < x + width and abs(y - top) < height for left, top, wide in taken):
        y += 1.0
    return y
