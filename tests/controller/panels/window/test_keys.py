"""Keys of the window without a window: what each does, with Ctrl and without, and while text is typed."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from controller.panels.window.keys import HELP, Keys

BELOW = 90.0  # where STOP ends


class Imgui:
    """The part of ImGui that keys use. pressed : names of keys. words : what the help shows."""

    Cond_ = SimpleNamespace(appearing=1)
    WindowFlags_ = SimpleNamespace(always_auto_resize=64, no_docking=1 << 19)
    ImVec2 = staticmethod(lambda x, y: (x, y))

    def __init__(self) -> None:
        self.io = SimpleNamespace(want_text_input=False, key_ctrl=False, display_size=SimpleNamespace(x=640.0, y=480.0))
        self.font, self.place = 16.0, (0.0, 0.0)
        padding = SimpleNamespace(x=8.0, y=8.0)
        self.style = SimpleNamespace(
            window_padding=padding, cell_padding=padding, font_scale_main=1.0, font_scale_dpi=1.0
        )
        self.pressed, self.repeats, self.words, self.calls = set[str](), list[tuple[str, bool]](), list[str](), [""]
        self.Key = SimpleNamespace(space="space", r="r", z="z", h="h", escape="escape")
        self.stays_open = True

    def get_io(self) -> Any:
        return self.io

    def is_key_pressed(self, key: str, *, repeat: bool) -> bool:
        self.repeats.append((key, repeat))
        return key in self.pressed

    def get_style(self) -> Any:
        return self.style

    def get_font_size(self) -> float:
        return 16.0

    def get_text_line_height(self) -> float:
        return 16.0

    def get_frame_height(self) -> float:
        return 22.0

    def calc_text_size(self, words: str) -> Any:
        return SimpleNamespace(x=7.0 * len(words), y=16.0)

    def push_font(self, font: None, size: float) -> None:
        self.font = size

    def set_next_window_pos(self, at: tuple[float, float], condition: int, pivot: tuple[float, float]) -> None:
        self.place = at

    def begin(self, title: str, shown: bool, flags: int) -> tuple[bool, bool]:
        self.calls.append(f"begin {title} {flags}")
        return True, self.stays_open

    def begin_table(self, title: str, columns: int) -> bool:
        self.calls.append(f"table {columns}")
        return True

    def text(self, words: str) -> None:
        self.words.append(words)

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: self.calls.append(name)


@pytest.fixture
def imgui(monkeypatch: pytest.MonkeyPatch) -> Imgui:
    fake = Imgui()
    monkeypatch.setitem(sys.modules, "imgui_bundle", SimpleNamespace(imgui=fake))
    return fake


@pytest.fixture
def done() -> list[str]:
    return []


@pytest.fixture
def keys(done: list[str]) -> Keys:
    return Keys({"space": lambda: done.append("play"), "r": lambda: done.append("record")},
                {"z": lambda: done.append("undo")}, {"escape": lambda: done.append("stop")})  # fmt: skip


def test_each_key_does_its_own_once(imgui: Imgui, keys: Keys, done: list[str]) -> None:
    imgui.pressed = {"r", "z"}
    keys(BELOW)
    assert done == ["record"] and ("space", False) in imgui.repeats and not any(again for _, again in imgui.repeats)


def test_with_ctrl_others_are_done_and_repeat(imgui: Imgui, keys: Keys, done: list[str]) -> None:
    imgui.pressed, imgui.io.key_ctrl = {"r", "z", "h"}, True
    keys(BELOW)
    assert done == ["undo"] and imgui.repeats == [("escape", False), ("z", True)] and not keys.help_shown


def test_while_text_is_typed_no_key_counts(imgui: Imgui, keys: Keys, done: list[str]) -> None:
    imgui.pressed, imgui.io.want_text_input = {"r", "h"}, True
    keys(BELOW)
    assert not done and not keys.help_shown and not imgui.words


@pytest.mark.parametrize("typed", [False, True])
def test_the_stop_counts_always(imgui: Imgui, keys: Keys, done: list[str], typed: bool) -> None:
    imgui.pressed, imgui.io.want_text_input = {"escape"}, typed
    keys(BELOW)
    assert done == ["stop"]


def test_the_help_is_below_the_stop_and_as_small_as_it_must_be(imgui: Imgui, keys: Keys) -> None:
    keys.help_shown = True
    keys(BELOW)
    rows = len(HELP) * 32.0 + 22.0 + 16.0
    assert rows > 480.0 - BELOW - 16.0 and imgui.font == pytest.approx(16.0 * (480.0 - BELOW - 16.0) / rows)
    assert imgui.place == (632.0, BELOW + (480.0 - BELOW) / 2)
    keys(460.0)  # STOP is in the lower corner
    assert imgui.place[1] == 240.0
    imgui.io.display_size = SimpleNamespace(x=1920.0, y=1080.0)
    keys(BELOW)
    assert imgui.font == 16.0


def test_the_help_lists_every_key_until_it_is_closed(imgui: Imgui, keys: Keys) -> None:
    imgui.pressed = {"h"}
    keys(BELOW)
    assert keys.help_shown and imgui.words == [word for row in HELP.items() for word in row]
    assert "table 2" in imgui.calls and imgui.calls[-3:] == ["end_table", "end", "pop_font"]
    imgui.pressed, imgui.words = set(), []
    keys(BELOW)
    assert keys.help_shown and imgui.words
    imgui.stays_open = False  # closed by its cross
    keys(BELOW)
    assert not keys.help_shown
    imgui.pressed, imgui.stays_open = {"h"}, True
    keys(BELOW)
    keys(BELOW)
    assert not keys.help_shown  # the same key hides it
