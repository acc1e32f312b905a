"""Shows the distance between the face and the mesh that it was fitted to as colours, with their scale in mm."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from controller.face.fit_colours import NOT_MEASURED, FitColours, figures_of, plain_theme, unmeasured
from controller.panels.overlay.colours import packed
from surface.base.error_colours import FULL_MM, SCALE
from surface.head import Head
from surface.view.docks import PictureArea
from surface.view.scene.theme import Theme

NONE = (
    "this head was not fitted to a mesh, or by an older omote, which did not keep how far off it was: "
    "omote fit MESH -o HEAD --keep measures it"
)
_TITLE = "mm between face and mesh"
_WIDE, _HIGH, _EDGE = 16.0, 0.7, 0.8  # width and height of the scale and its margin, in heights of a line of text
_SHADE, _TEXT = (0.05, 0.05, 0.06, 0.75), (0.92, 0.92, 0.92, 1.0)


class FitErrorView:
    """Paints the face while it is enabled.

    head : the one that is drawn. area : of the picture. redraw : draws the same head again.
    """

    def __init__(self, head: Head, area: PictureArea, redraw: Callable[[], None]) -> None:
        self.on = False
        self._area, self._redraw = area, redraw
        self._colours, self._painted = FitColours(), False
        self._read_error(head)

    def _read_error(self, head: Head) -> None:
        self._figures, self._gaps = figures_of(head), unmeasured(head)

    def dress(self, head: Head, theme: Theme) -> Theme:
        """Paint a head that is about to be drawn, or remove the paint; return the theme with which to show it."""
        self._read_error(head)
        self._painted = self.on and self._colours.paint(head)
        if not self._painted:
            self._colours.clear()
        return plain_theme(theme) if self._painted else theme

    def draw_checkboxes(self) -> None:
        """Draw the check box and, while it is on, the figures of the error or why there are none."""
        from imgui_bundle import imgui  # optional

        changed, on = imgui.checkbox("fit error##overlay", self.on)
        if changed:
            self.switch(on=on)
        if self.on:
            imgui.text_wrapped(str(self._figures) if self._figures is not None else NONE)

    def switch(self, *, on: bool) -> None:
        """Enable or disable it; the face is drawn again if that changes its colours."""
        self.on = on
        if self._figures is not None:
            self._redraw()

    def __call__(self) -> None:
        """Draw the scale in a corner of the picture; called once per frame."""
        if not self._painted:
            return
        from imgui_bundle import imgui  # optional

        line, area, vec = imgui.get_font_size(), self._area, imgui.ImVec2
        wide = min(_WIDE * line, area.width - 4.0 * _EDGE * line)
        left = area.left + area.width - wide - 2.0 * _EDGE * line
        high = (4.2 if self._gaps else 3.0) * line + 2.0 * _EDGE * line
        top = area.top + area.height - high - _EDGE * line
        draw = imgui.get_background_draw_list()
        corner = vec(left - _EDGE * line, top), vec(left + wide + _EDGE * line, top + high)
        draw.add_rect_filled(*corner, packed(imgui, _SHADE), 0.3 * line)
        top += _EDGE * line
        white = packed(imgui, _TEXT)
        draw.add_text(vec(left, top), white, _TITLE)
        self._draw_bar(imgui, draw, (left, top + 1.3 * line), wide)
        if self._gaps:
            at = top + 3.3 * line
            draw.add_rect_filled(vec(left, at), vec(left + line, at + _HIGH * line), _encoded(imgui, NOT_MEASURED))
            draw.add_text(vec(left + 1.5 * line, at - 0.15 * line), white, "not measured")

    @staticmethod
    def _draw_bar(imgui: Any, draw: Any, corner: tuple[float, float], wide: float) -> None:
        """Draw the colours from 0 to the end of the scale, with the distance under each."""
        (left, top), line, vec = corner, imgui.get_font_size(), imgui.ImVec2
        ends = np.linspace(left, left + wide, len(SCALE)).tolist()
        colours = [_encoded(imgui, each) for each in SCALE]
        for (x0, a), (x1, b) in pairwise(zip(ends, colours, strict=True)):
            draw.add_rect_filled_multi_color(vec(x0, top), vec(x1, top + _HIGH * line), a, b, b, a)
        for i, x in enumerate(ends):
            words = f"{FULL_MM * i / (len(SCALE) - 1):g}" + ("" if i < len(SCALE) - 1 else "+")
            width = imgui.calc_text_size(words).x
            x = min(max(x - width / 2, left), left + wide - width)
            draw.add_text(vec(x, top + (_HIGH + 0.15) * line), packed(imgui, _TEXT), words)


def _encoded(imgui: Any, linear: Any) -> int:
    """Return a linear RGB (3,) as ImGui draws it, as bright as it is on the lit face."""
    red, green, blue = (np.asarray(linear, np.float64) ** (1 / 2.2)).tolist()
    return packed(imgui, (red, green, blue, 1.0))
