"""Keys of the window, and the help that lists them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

HELP = {
    "Space": "play a show, pause it, let it go on",
    "R": "begin or end a recording",
    "P": "write a picture of the face",
    "C": "begin or end a clip of the face",
    "N": "neutral: give everything back",
    "Esc": "stop: servos off until START",
    "F": "the face alone on the whole screen, and back",
    "Ctrl-Z, Ctrl-Y": "undo, redo",
    "1 to 5, 0": "camera, and back to the first",
    "Ctrl and drag": "move a point of the face",
    "Ctrl, Shift and drag": "move the skin itself",
    "Alt and click": "look there",
    "drag, right drag, wheel": "turn, move, zoom",
    "H": "this help",
}


@dataclass
class Keys:
    """Carries out keys; called once per frame.

    actions : what each key of ImGui does, by its name there: ``space``, ``r``. with_ctrl : the same, with Ctrl held.
    always : what keys do also while text is typed.
    """

    actions: Mapping[str, Callable[[], None]]
    with_ctrl: Mapping[str, Callable[[], None]]
    always: Mapping[str, Callable[[], None]]
    help_shown: bool = False

    def __call__(self, below: float) -> None:
        """Carry out the keys of this frame, most of them unless text is being typed; ``below`` : where the help may
        begin, points from the top."""
        from imgui_bundle import imgui  # optional

        io = imgui.get_io()
        for name, action in self.always.items():
            if imgui.is_key_pressed(getattr(imgui.Key, name), repeat=False):
                action()
        if not io.want_text_input:
            for name, action in (self.with_ctrl if io.key_ctrl else self.actions).items():
                if imgui.is_key_pressed(getattr(imgui.Key, name), repeat=io.key_ctrl):
                    action()
            if not io.key_ctrl and imgui.is_key_pressed(imgui.Key.h, repeat=False):
                self.help_shown = not self.help_shown
        if self.help_shown:
            self._help(imgui, below)

    def _help(self, imgui: Any, below: float) -> None:
        """Draw the help at the right of the window below ``below``, in text small enough to show all of it."""
        size, line, style = imgui.get_io().display_size, imgui.get_font_size(), imgui.get_style()
        below = below if below < size.y / 2 else 0.0  # STOP is in the lower corner
        room = size.x - 2 * style.window_padding.x, size.y - below - 2 * style.window_padding.y
        wide, high = _help_size(imgui)
        share = min(1.0, room[0] / wide, room[1] / high)
        at = imgui.ImVec2(size.x - style.window_padding.x, below + (size.y - below) / 2)
        imgui.set_next_window_pos(at, imgui.Cond_.appearing, imgui.ImVec2(1.0, 0.5))
        imgui.set_next_window_bg_alpha(1.0)  # else what is under it shows between the words
        flags = imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_docking
        imgui.push_font(None, share * line / style.font_scale_main / style.font_scale_dpi)
        shown, open_ = imgui.begin("keys", self.help_shown, flags)
        if shown and imgui.begin_table("##keys", 2):
            for key, what in HELP.items():
                imgui.table_next_row()
                for words in (key, what):
                    imgui.table_next_column()
                    imgui.text(words)
            imgui.end_table()
        imgui.end()
        imgui.pop_font()
        self.help_shown = bool(open_)


def _help_size(imgui: Any) -> tuple[float, float]:
    """Return the width and height of the help in text of the usual size."""
    style = imgui.get_style()
    columns = (HELP.keys(), HELP.values())
    wide = sum(max(imgui.calc_text_size(words).x for words in column) + 2 * style.cell_padding.x for column in columns)
    row = imgui.get_text_line_height() + 2 * style.cell_padding.y
    high = len(HELP) * row + imgui.get_frame_height()
    return wide + 2 * style.window_padding.x, high + 2 * style.window_padding.y
