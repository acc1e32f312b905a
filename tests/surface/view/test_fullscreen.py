"""A window that covers the screen it is on, and goes back to where it was."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from surface.view import fullscreen
from surface.view.fullscreen import FullScreen, glfw_window

SCREENS = {"left": (0, 0, 1920, 1080, 60), "right": (1920, 100, 2560, 1440, 144)}


class Glfw:
    """Two screens side by side, and a window."""

    def __init__(self, place: tuple[int, int, int, int]) -> None:
        self.place, self.calls = place, list[tuple[Any, ...]]()

    def get_window_pos(self, window: str) -> tuple[int, int]:
        return self.place[:2]

    def get_window_size(self, window: str) -> tuple[int, int]:
        return self.place[2:]

    def get_monitors(self) -> list[str]:
        return list(SCREENS)

    def get_monitor_pos(self, monitor: str) -> tuple[int, int]:
        return SCREENS[monitor][:2]

    def get_video_mode(self, monitor: str) -> Any:
        *_, width, height, rate = SCREENS[monitor]
        return SimpleNamespace(size=SimpleNamespace(width=width, height=height), refresh_rate=rate)

    def set_window_monitor(self, *arguments: Any) -> None:
        self.calls.append(arguments)


@pytest.mark.parametrize(
    ("place", "screen"),
    [
        ((100, 100, 800, 600), "left"), ((2000, 200, 800, 600), "right"), ((1700, 200, 800, 600), "right"),
        ((1400, 200, 800, 600), "left"), ((1500, -500, 800, 560), "left"),
    ],
)  # fmt: skip
def test_it_covers_the_screen_that_holds_most_of_it_and_goes_back(
    monkeypatch: pytest.MonkeyPatch, place: tuple[int, int, int, int], screen: str
) -> None:
    glfw, full = Glfw(place), FullScreen()
    monkeypatch.setattr(fullscreen, "glfw_window", lambda: ("window", glfw))
    full.toggle()
    *_, width, height, rate = SCREENS[screen]
    assert full.on and glfw.calls == [("window", screen, 0, 0, width, height, rate)]
    glfw.place = (0, 0, width, height)
    full.toggle()
    assert not full.on and glfw.calls[1:] == [("window", None, *place, 0)]
    glfw.place = place
    full.toggle()
    assert full.on and len(glfw.calls) == 3


def test_without_a_window_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    full = FullScreen()
    monkeypatch.setattr(fullscreen, "glfw_window", lambda: (None, None))
    full.toggle()
    assert not full.on
    monkeypatch.setitem(__import__("sys").modules, "glfw", None)
    assert glfw_window() == (None, None)
