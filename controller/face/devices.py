"""Reads the gamepad and the keys of the window, once a frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from controller.body.messages import PanelRequest
from controller.face.controls import Controls
from controller.vocabulary.controls import AXES, BUTTONS

_LOOK_S = 1.0
"""How often a gamepad that is not there is looked for."""
_GAMEPADS = 16  # of GLFW


class Devices:
    """Called by the window once a frame; ``send`` gets what they ask for.

    gamepad : gives the state of a gamepad, or None; that of GLFW without.
    """

    def __init__(
        self,
        controls: Controls,
        send: Callable[[PanelRequest], None],
        gamepad: Callable[[], tuple[Mapping[str, float], list[str]] | None] | None = None,
    ) -> None:
        self._controls, self._send = controls, send
        self._gamepad = gamepad or Gamepad().read

    def __call__(self) -> None:
        """Send what changed since the last frame."""
        axes, buttons = self._gamepad() or ({}, [])
        for request in self._controls.update(axes, buttons, self._keys()):
            self._send(request)

    def _keys(self) -> list[str]:
        """Those that are down, unless a text is typed into the panel, or Ctrl, Alt or Super mean something else."""
        from imgui_bundle import imgui  # optional

        io = imgui.get_io()
        if io.want_text_input or io.key_ctrl or io.key_alt or io.key_super:
            return []
        known = ((name, getattr(imgui.Key, _spelt(name), None)) for name in self._controls.keys)
        return [name for name, key in known if key is not None and imgui.is_key_down(key)]


class Gamepad:
    """The first gamepad that GLFW knows; one that is plugged in later is found."""

    def __init__(self) -> None:
        self._glfw: Any = None
        self._number: int | None = None
        self._next_s = 0.0

    def read(self) -> tuple[Mapping[str, float], list[str]] | None:
        """Axes (triggers 0 to 1) and the buttons that are down; None without a gamepad."""
        if self._number is None and not self._find():
            return None
        state = self._glfw.get_gamepad_state(self._number)
        if state is None:
            self._number = None
            return None
        return gamepad_state(state.axes, state.buttons)

    def _find(self) -> bool:
        now_s = time.monotonic()
        if now_s < self._next_s:
            return False
        self._next_s = now_s + _LOOK_S
        if self._glfw is None:
            import glfw  # optional, and after imgui_bundle, whose library it then uses

            self._glfw = glfw
        found = (number for number in range(_GAMEPADS) if self._glfw.joystick_is_gamepad(number))
        self._number = next(found, None)
        return self._number is not None


def gamepad_state(axes: Any, buttons: Any) -> tuple[dict[str, float], list[str]]:
    """GLFW's arrays by name; its triggers run from -1 to 1."""
    found = {name: float(value) for name, value in zip(AXES, axes, strict=False)}
    for name in ("left_trigger", "right_trigger"):
        found[name] = (found.get(name, -1.0) + 1.0) / 2.0
    return found, [name for name, down in zip(BUTTONS, buttons, strict=False) if down]


def _spelt(name: str) -> str:
    """The name of a key as imgui spells it: digits begin with an underscore."""
    return f"_{name}" if name.isdigit() else name
