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
    """Carries out keys; called once a frame.

    actions : what each key of ImGui does, by its name there: ``space``, ``r``. with_ctrl : the same, with Ctrl held.
    """

    actions: Mapping[str, Callable[[], None]]
    with_ctrl: Mapping[str, Callable[[], None]]
    help_shown: bool = False

    def __call__(self) -> None:
        """Carry out the keys of this frame, unless text is being typed."""
        from imgui_bundle import imgui  # optional

        io = imgui.get_io()
        if not io.want_text_input:
            for name, action in (self.with_ctrl if io.key_ctrl else self.actions).items():
                if imgui.is_key_pressed(getattr(imgui.Key, name), repeat=io.key_ctrl):
                    action()
            if not io.key_ctrl and imgui.is_key_pressed(imgui.Key.h, repeat=False):
                self.help_shown = not self.help_shown
        if self.help_shown:
            self._help(imgui)

    def _help(self, imgui: Any) -> None:
        middle = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(middle, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
        imgui.set_next_window_bg_alpha(1.0)  # else what is under it shows between the words
        flags = imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_docking
        shown, open_ = imgui.begin("keys", self.help_shown, flags)
        if shown and imgui.begin_table("##keys", 2):
            for key, what in HELP.items():
                imgui.table_next_row()
                for words in (key, what):
                    imgui.table_next_column()
                    imgui.text(words)
            imgui.end_table()
        imgui.end()
        self.help_shown = bool(open_)
