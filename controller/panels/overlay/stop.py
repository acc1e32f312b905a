"""The button that stops the servos; it is above everything else in the window."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from controller.panels.overlay.colours import RED, packed

LABEL = "STOP servos"
_LINES, _CORNER_LINES = 2.0, 9.0  # height, and width in a corner of the window, in heights of a line of text
_OWNER = 0x53544F50  # id that owns the mouse button while the pointer is on it, so that nothing below is clicked
_BRIGHTER, _DARKER = 1.2, 0.75


class Box(NamedTuple):
    """Left, top, right and bottom, in ImGui's points."""

    left: float
    top: float
    right: float
    bottom: float

    def holds(self, at: Any) -> bool:
        """Whether a place is inside."""
        return bool(self.left <= at.x <= self.right and self.top <= at.y <= self.bottom)

    def within(self, other: Box) -> bool:
        """Whether all of it is inside another."""
        low = self.left >= other.left and self.top >= other.top
        return low and self.right <= other.right and self.bottom <= other.bottom


class StopButton:
    """Draws the button once per frame, and stops the servos as soon as the mouse button is pressed on it.

    stop : stops the servos.

    It has a place in the panel; if that is not fully visible, it is drawn in a corner of the window. It is drawn over
    floating windows and menus and handles the mouse before them, so none of them can hide it or take its click.

    Attributes
    ----------
    box : where it was drawn last.
    """

    def __init__(self, stop: Callable[[], None]) -> None:
        self._stop = stop
        self._slot: Box | None = None
        self.box = Box(0.0, 0.0, 0.0, 0.0)

    def leave_room(self, imgui: Any) -> None:
        """Reserve its place at the position of the next widget."""
        imgui.invisible_button(
            LABEL, imgui.ImVec2(-1.0, _LINES * imgui.get_font_size())
        )  # no place to drag a window by
        low, high, draw = imgui.get_item_rect_min(), imgui.get_item_rect_max(), imgui.get_window_draw_list()
        seen = draw.get_clip_rect_min(), draw.get_clip_rect_max()
        box = Box(low.x, low.y, high.x, high.y)
        if box.within(Box(seen[0].x, seen[0].y, seen[1].x, seen[1].y)) and box.right - box.left >= _min_width(imgui):
            self._slot = box

    def __call__(self, imgui: Any) -> None:
        """Draw it and handle the mouse."""
        self.box, self._slot = self._slot or _corner(imgui), None
        over = self.box.holds(imgui.get_io().mouse_pos)
        if over:
            internal = imgui.internal
            locked = internal.InputFlagsPrivate_.lock_this_frame.value
            internal.set_key_owner(imgui.Key.mouse_left, _OWNER, locked)
            imgui.set_next_frame_want_capture_mouse(True)
            if internal.is_mouse_clicked(0, 0, _OWNER):
                self._stop()
        self._draw(imgui, over=over)

    def _draw(self, imgui: Any, *, over: bool) -> None:
        down = over and imgui.get_io().mouse_down[0]
        light = _DARKER if down else _BRIGHTER if over else 1.0
        red, green, blue = (min(light * each, 1.0) for each in RED[:3])
        draw, box, text = imgui.get_foreground_draw_list(), self.box, imgui.calc_text_size(LABEL)
        corners = imgui.ImVec2(box.left, box.top), imgui.ImVec2(box.right, box.bottom)
        draw.add_rect_filled(*corners, packed(imgui, (red, green, blue, 1.0)), imgui.get_style().frame_rounding)
        draw.add_rect(*corners, packed(imgui, (1.0, 1.0, 1.0, 0.35)), imgui.get_style().frame_rounding)
        at = (box.left + box.right - text.x) / 2, (box.top + box.bottom - text.y) / 2
        draw.add_text(imgui.ImVec2(*at), packed(imgui, (1.0, 1.0, 1.0, 1.0)), LABEL)


def _min_width(imgui: Any) -> float:
    """Return the width that shows the label whole."""
    return float(imgui.calc_text_size(LABEL).x + imgui.get_font_size())


def _corner(imgui: Any) -> Box:
    """Return the lower right corner of the window."""
    size, line = imgui.get_io().display_size, imgui.get_font_size()
    right, bottom = size.x - line, size.y - line
    return Box(right - _CORNER_LINES * line, bottom - _LINES * line, right, bottom)
