"""A real imgui context without a window, for tests of what the panel draws and hears."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from controller.panels.window.panel import Panel


class Screen:
    """A real imgui context without a window: frames are laid out, and the mouse clicks where labels stand."""

    def __init__(self) -> None:
        self.imgui = pytest.importorskip("imgui_bundle").imgui
        self.context = self.imgui.create_context()
        self.io = self.imgui.get_io()
        self.io.display_size = self.imgui.ImVec2(900, 3000)
        self.io.backend_flags |= self.imgui.BackendFlags_.renderer_has_textures
        self.io.delta_time = 1 / 60
        self.io.set_ini_filename("")

    def frame(self, draw: Callable[[], None]) -> None:
        self.imgui.new_frame()
        draw()
        self.imgui.render()

    def click(self, draw: Callable[[], None], x: float, y: float) -> None:
        """Move there, press and release, a frame each."""
        self.io.add_mouse_pos_event(x, y)
        self.frame(draw)
        for down in (True, False):
            self.io.add_mouse_button_event(0, down)
            self.frame(draw)


class Places:
    """Where the panel's widgets stand: imgui's own functions, each noting the place of what it drew."""

    def __init__(self, imgui: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
        self.at: dict[str, tuple[float, float]] = {}
        self.boxes: dict[str, tuple[float, float]] = {}
        self.formats: dict[str, object] = {}
        self.texts: list[str] = []
        for name in ("checkbox", "button", "slider_float", "collapsing_header", "selectable", "invisible_button"):
            monkeypatch.setattr(imgui, name, self._noting(imgui, getattr(imgui, name)))
        for name in ("text", "text_disabled", "text_wrapped", "text_colored"):
            monkeypatch.setattr(imgui, name, self._telling(getattr(imgui, name)))

    def _noting(self, imgui: ModuleType, real: Callable[..., Any]) -> Callable[..., Any]:
        def widget(label: str, *words: Any) -> Any:
            found = real(label, *words)
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            self.boxes[label], self.formats[label] = (low.x, high.x), words[-1] if words else None
            self.at[label] = (low.x + 0.25 * (high.x - low.x), (low.y + high.y) / 2)
            return found

        return widget

    def _telling(self, real: Callable[..., None]) -> Callable[..., None]:
        def text(*words: Any) -> None:
            self.texts.append(words[-1])
            real(*words)

        return text


def drawn(panel: Panel, *titles: str) -> Callable[[], None]:
    """Draws some tabs of a panel, all or those of ``titles``, each in a window beside the others."""

    def draw() -> None:
        from imgui_bundle import imgui

        panel()
        for i, dock in enumerate(each for each in panel.docks() if not titles or each.title in titles):
            imgui.set_next_window_pos(imgui.ImVec2(340.0 * i, 0.0))
            imgui.set_next_window_size(imgui.ImVec2(336, 2900))
            imgui.begin(dock.title)
            dock.draw()
            imgui.end()

    return draw
