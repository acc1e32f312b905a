"""Reads the gamepad and the window's keys once per frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from controller.body.messages import PanelRequest
from controller.face.controls import Controls
from controller.vocabulary.controls import AXES, BUTTONS

_SEARCH_INTERVAL_S = 1.0
"""How often a missing gamepad is searched for."""
_MAX_GAMEPADS = 16  # of GLFW


class Devices:
    """Sends the requests of gamepad and keys; called by the window once per frame.

    send : called with each request. gamepad : returns the state of a gamepad, or None. Default: the first one of GLFW.
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
        """Return the keys that are down; none while text is typed into the panel or Ctrl, Alt or Super is down."""
        from imgui_bundle import imgui  # optional

        io = imgui.get_io()
        if io.want_text_input or io.key_ctrl or io.key_alt or io.key_super:
            return []
        known = ((name, getattr(imgui.Key, _imgui_name(name), None)) for name in self._controls.keys)
        return [name for name, key in known if key is not None and imgui.is_key_down(key)]


class Gamepad:
    """The first gamepad that GLFW has, even if it is plugged in later."""

    def __init__(self) -> None:
        self._glfw: Any = None
        self._number: int | None = None
        self._next_s = 0.0

    def read(self) -> tuple[Mapping[str, float], list[str]] | None:
        """Return the axes (triggers 0 to 1) and the buttons that are down; None without a gamepad."""
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
        self._next_s = now_s + _SEARCH_INTERVAL_S
        if self._glfw is None:
            import glfw  # optional; imported after imgui_bundle, so that it uses the same library

            self._glfw = glfw
        found = (number for number in range(_MAX_GAMEPADS) if self._glfw.joystick_is_gamepad(number))
        self._number = next(found, None)
        return self._number is not None


def gamepad_state(axes: Any, buttons: Any) -> tuple[dict[str, float], list[str]]:
    """Return GLFW's arrays by name, with triggers converted from -1..1 to 0..1."""
    found = {name: float(value) for name, value in zip(AXES, axes, strict=False)}
    for name in ("left_trigger", "right_trigger"):
        found[name] = (found.get(name, -1.0) + 1.0) / 2.0
    return found, [name for name, down in zip(BUTTONS, buttons, strict=False) if down]


def _imgui_name(name: str) -> str:
    """Return imgui's name of a key, in which digits have an underscore before them."""
    return f"_{name}" if name.isdigit() else name
