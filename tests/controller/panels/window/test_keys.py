"""Keys of the window without a window: what each does, with Ctrl and without, and while text is typed."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from controller.panels.window.keys import HELP, Keys


class Imgui:
    """The part of ImGui that keys use. pressed : names of keys. words : what the help shows."""

    Cond_ = SimpleNamespace(appearing=1)
    WindowFlags_ = SimpleNamespace(always_auto_resize=64, no_docking=1 << 19)
    ImVec2 = staticmethod(lambda x, y: (x, y))

    def __init__(self) -> None:
        self.io = SimpleNamespace(want_text_input=False, key_ctrl=False)
        self.pressed, self.repeats, self.words, self.calls = set[str](), list[tuple[str, bool]](), list[str](), [""]
        self.Key, self.stays_open = SimpleNamespace(space="space", r="r", z="z", h="h"), True

    def get_io(self) -> Any:
        return self.io

    def is_key_pressed(self, key: str, *, repeat: bool) -> bool:
        self.repeats.append((key, repeat))
        return key in self.pressed

    def get_main_viewport(self) -> Any:
        return SimpleNamespace(get_center=lambda: (320, 240))

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
                {"z": lambda: done.append("undo")})  # fmt: skip


def test_each_key_does_its_own_once(imgui: Imgui, keys: Keys, done: list[str]) -> None:
    imgui.pressed = {"r", "z"}
    keys()
    assert done == ["record"] and ("space", False) in imgui.repeats and not any(again for _, again in imgui.repeats)


def test_with_ctrl_others_are_done_and_repeat(imgui: Imgui, keys: Keys, done: list[str]) -> None:
    imgui.pressed, imgui.io.key_ctrl = {"r", "z", "h"}, True
    keys()
    assert done == ["undo"] and imgui.repeats == [("z", True)] and not keys.help_shown


def test_while_text_is_typed_no_key_counts(imgui: Imgui, keys: Keys, done: list[str]) -> None:
    imgui.pressed, imgui.io.want_text_input = {"r", "h"}, True
    keys()
    assert not done and not keys.help_shown and not imgui.words


def test_the_help_lists_every_key_until_it_is_closed(imgui: Imgui, keys: Keys) -> None:
    imgui.pressed = {"h"}
    keys()
    assert keys.help_shown and imgui.words == [word for row in HELP.items() for word in row]
    assert "table 2" in imgui.calls and imgui.calls[-2:] == ["end_table", "end"]
    imgui.pressed, imgui.words = set(), []
    keys()
    assert keys.help_shown and imgui.words
    imgui.stays_open = False  # closed by its cross
    keys()
    assert not keys.help_shown
    imgui.pressed, imgui.stays_open = {"h"}, True
    keys()
    keys()
    assert not keys.help_shown  # the same key hides it
