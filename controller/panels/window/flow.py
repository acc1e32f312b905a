"""Buttons as wide as their labels, in as many rows as needed."""

from __future__ import annotations

from typing import Any


class Flow:
    """Places buttons in rows; create it at the position of the first one."""

    def __init__(self, imgui: Any) -> None:
        self._imgui, self._first = imgui, True
        self._right = imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x

    def button(self, label: str) -> bool:
        """Draw the next button; return whether it was pressed."""
        imgui, style = self._imgui, self._imgui.get_style()
        width = imgui.calc_text_size(label).x + 2 * style.frame_padding.x
        if not self._first and imgui.get_item_rect_max().x + style.item_spacing.x + width <= self._right:
            imgui.same_line()
        self._first = False
        return bool(imgui.button(label))
