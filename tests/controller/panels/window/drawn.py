"""Stands for a window library: it notes what is drawn, and answers as a test wants it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

LETTER, LINE = 7.0, 14.0  # of a letter that is drawn: its width, its height


def at(x: float, y: float) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y)


class Drawn:
    """Notes every call by its name; no button is pressed but the one that is called ``pressed``."""

    Col_ = SimpleNamespace(button=1, slider_grab=2, text=3, window_bg=4)
    TableFlags_ = SimpleNamespace(sizing_stretch_prop=1)
    TableColumnFlags_ = SimpleNamespace(width_fixed=1, width_stretch=2)

    def __init__(self, pressed: str = "") -> None:
        self.pressed = pressed
        self.calls = list[tuple[Any, ...]]()
        self.ImVec2, self.ImVec4 = at, lambda *rgba: rgba

    def calc_text_size(self, text: str) -> SimpleNamespace:
        return at(LETTER * len(text), LINE)

    def get_font_size(self) -> float:
        return LINE

    def get_frame_height(self) -> float:
        return LINE + 6.0

    def get_window_draw_list(self) -> Drawn:
        return self

    def get_content_region_avail(self) -> SimpleNamespace:
        return at(1e4, 1e4)

    def get_style(self) -> SimpleNamespace:
        return SimpleNamespace(frame_padding=at(4.0, 3.0), item_spacing=at(8.0, 4.0))

    def color_convert_float4_to_u32(self, rgba: tuple[float, ...]) -> int:
        return 0

    def __getattr__(self, name: str) -> Any:
        def note(*given: Any) -> Any:
            self.calls.append((name, *given))
            return at(0.0, 0.0)

        return note

    def button(self, label: str, *_: Any) -> bool:
        self.calls.append(("button", label))
        return label == self.pressed

    def named(self, *names: str) -> list[tuple[Any, ...]]:
        """What calls of these names were given, in their order."""
        return [call[1:] for call in self.calls if call[0] in names]
