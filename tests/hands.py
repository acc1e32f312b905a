"""Hands for the window of ``omote edit``: they move the mouse of a virtual display, press and let go, and look.

A script is a generator that is gone on with once a frame; it runs in the process of the window. The pointer is that of
the display, moved by Xlib; buttons and keys are ImGui's events.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Steps = Iterator[None]
PATCHED = ("radio_button", "button", "checkbox", "selectable", "begin_combo", "collapsing_header", "slider_float")


class Pointer:
    """The pointer of the display that ``DISPLAY`` names."""

    def __init__(self) -> None:
        self._x = ctypes.CDLL(ctypes.util.find_library("X11") or "libX11.so.6")
        self._x.XOpenDisplay.restype = ctypes.c_void_p
        self._x.XDefaultRootWindow.restype = ctypes.c_ulong
        self._x.XDefaultRootWindow.argtypes = [ctypes.c_void_p]
        self._x.XFlush.argtypes = [ctypes.c_void_p]
        self._x.XWarpPointer.argtypes = [ctypes.c_void_p, ctypes.c_ulong, ctypes.c_ulong, *[ctypes.c_int] * 6]
        self._display = self._x.XOpenDisplay(None)
        self._root = self._x.XDefaultRootWindow(self._display)

    def move(self, x: float, y: float) -> None:
        """Put it at a pixel of the display."""
        self._x.XWarpPointer(self._display, 0, self._root, 0, 0, 0, 0, round(x), round(y))
        self._x.XFlush(self._display)


class Hands:
    """See the module.

    folder : for pictures. report : results that a script returns to the program that started it.
    """

    def __init__(self, folder: Path) -> None:
        from imgui_bundle import imgui

        self.imgui, self.folder, self.pointer = imgui, folder, Pointer()
        self.report: dict[str, Any] = {"windows": 0}
        self.places: dict[str, tuple[float, float]] = {}
        self.face: Any = None
        self.began_s = time.monotonic()
        for name in PATCHED:
            setattr(imgui, name, self._noting(getattr(imgui, name)))

    def _noting(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def widget(label: str, *words: Any) -> Any:
            found = real(label, *words)
            low, high = self.imgui.get_item_rect_min(), self.imgui.get_item_rect_max()
            self.places[label] = (min(low.x + 14.0, (low.x + high.x) / 2), (low.y + high.y) / 2)
            return found

        return widget

    def run(self, script: Callable[[Hands], Steps], words: Sequence[str]) -> None:
        """Run a command of omote whose window the script operates; it is closed where the script ends."""
        from controller.cli.app import main
        from controller.panels.window.face import WindowFace

        real, steps = WindowFace._gui, script(self)

        def gui(face: Any) -> None:
            if face is not self.face:
                self.face, self.report["windows"] = face, self.report["windows"] + 1
            real(face)
            if next(steps, steps) is steps:
                face._ended = True

        WindowFace._gui = gui  # type: ignore[method-assign]
        sys.argv = ["omote", *words]
        main()

    @staticmethod
    def began() -> float:
        """Now, for :meth:`seconds`."""
        return time.monotonic()

    def seconds(self) -> float:
        """Since the hands began."""
        return time.monotonic() - self.began_s

    def frames(self, count: int) -> Steps:
        """Wait for some frames."""
        for _ in range(count):
            yield

    def until(self, true: Callable[[], bool], what: str, limit_s: float = 90.0) -> Steps:
        """Wait until something is so."""
        end_s = time.monotonic() + limit_s
        while not true():
            assert time.monotonic() < end_s, f"waited {limit_s:g} s in vain for {what}"
            yield

    def move(self, x: float, y: float) -> Steps:
        """Move the mouse to a pixel of the window, and let it be heard of."""
        self.pointer.move(x, y)
        yield from self.until(lambda: self._is_at(x, y), f"the pointer at {x:g}, {y:g}", 5.0)

    def _is_at(self, x: float, y: float) -> bool:
        at = self.imgui.get_io().mouse_pos
        return max(abs(at.x - x), abs(at.y - y)) < 1.5

    def press(self, *, down: bool) -> Steps:
        """The left button."""
        self.imgui.get_io().add_mouse_button_event(0, down)
        yield from self.frames(2)

    def key(self, key: Any, *, down: bool) -> Steps:
        """A key, as ``imgui.Key.n``."""
        self.imgui.get_io().add_key_event(key, down)
        yield from self.frames(2)

    def tap(self, key: Any) -> Steps:
        """A key, pressed and let go."""
        yield from self.key(key, down=True)
        yield from self.key(key, down=False)

    def click(self, label: str) -> Steps:
        """A widget, once it is there."""
        self.places.pop(label, None)
        yield from self.until(lambda: label in self.places, f"a widget {label!r}", 20.0)
        yield from self.move(*self.places[label])
        yield from self.press(down=True)
        yield from self.press(down=False)

    def tab(self, title: str) -> Steps:
        """Bring a tab to the front, as a click on it does."""
        from imgui_bundle import hello_imgui

        docking = hello_imgui.get_runner_params().docking_params
        docking.dockable_window_of_name(title).focus_window_at_next_frame = True
        yield from self.frames(4)

    def pixel(self, place: Sequence[float]) -> tuple[float, float]:
        """Where a place (3,) mm is in the window."""
        from controller.face.skin_model import Screen

        area = self.face._area
        screen = Screen(self.face._viewpoint.camera, (area.width, area.height))
        x, y, _ = screen.project(np.array([place], float))[0].tolist()
        return area.left + x, area.top + y

    def draw(self, line: Sequence[tuple[float, float]], steps: int = 24) -> Steps:
        """Ctrl, the button, and along a line of pixels; then let go."""
        points = np.array(line, float)
        at = np.linspace(0.0, len(points) - 1.0, steps)
        path = np.column_stack([np.interp(at, np.arange(len(points)), column) for column in points.T])
        yield from self.move(*path[0])
        yield from self.key(self.imgui.Key.mod_ctrl, down=True)
        yield from self.press(down=True)
        for x, y in path[1:]:
            yield from self.move(x, y)
        yield from self.frames(4)
        yield from self.press(down=False)
        yield from self.key(self.imgui.Key.mod_ctrl, down=False)

    def grab(self, name: str) -> Steps:
        """Keep a picture of the window."""
        from PIL import ImageGrab

        yield from self.frames(3)
        ImageGrab.grab(xdisplay=os.environ["DISPLAY"]).save(self.folder / f"{name}.png")


def run_script(script: Callable[[Hands], Steps], *words: str) -> None:
    """Run a script in the window of a command, in the process of that window, in the folder ``OMOTE_TEST_FOLDER``.

    What it reports goes to report.json there, also where it fails.
    """
    os.chdir(folder := Path(os.environ["OMOTE_TEST_FOLDER"]))
    hands = Hands(folder)
    try:
        hands.run(script, words)
    finally:
        Path("report.json").write_text(json.dumps(hands.report), encoding="utf-8")
