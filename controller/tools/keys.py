"""Single keys from a terminal, without waiting for any."""

from __future__ import annotations

import os
import select
import sys
import time
from types import TracebackType
from typing import Any, Self

from controller.base.errors import ControllerError

ESCAPES = {"[A": "up", "[B": "down", "[C": "right", "[D": "left", "OA": "up", "OB": "down", "OC": "right", "OD": "left"}


class Keyboard:
    """The keyboard of a terminal as a context manager; the terminal is left as it was found.

    Parameters
    ----------
    descriptor : of the terminal; None takes standard input.

    Raises
    ------
    ControllerError : on entering, where it is no terminal.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        self._fd = sys.stdin.fileno() if descriptor is None else descriptor
        self._before: list[Any] | None = None

    def __enter__(self) -> Self:
        if not os.isatty(self._fd):
            raise ControllerError("keys can only be read from a terminal", hint="start omote in a terminal window")
        if sys.platform != "win32":
            import termios  # not on Windows
            import tty  # not on Windows

            self._before = termios.tcgetattr(self._fd)
            tty.setcbreak(self._fd)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            import termios  # not on Windows

            termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)

    def keys(self, wait_s: float) -> list[str]:
        """Keys pressed until ``wait_s`` from now: characters, and ``up``, ``down``, ``left``, ``right``."""
        if sys.platform == "win32":
            return _windows_keys(wait_s)
        end, data = time.monotonic() + wait_s, b""
        while select.select([self._fd], [], [], max(0.0, end - time.monotonic()))[0]:
            piece = os.read(self._fd, 64)
            if not piece:
                break
            data += piece
        return split(data.decode("utf-8", "ignore"))


def split(text: str) -> list[str]:
    """What a terminal sent, key by key; sequences of keys that have no name here are left out."""
    keys = []
    while text:
        if text[0] != "\x1b":
            keys.append(text[0])
            text = text[1:]
            continue
        name = ESCAPES.get(text[1:3])
        keys += [name] if name else []
        text = text[3:]
    return keys


def _windows_keys(wait_s: float) -> list[str]:  # pragma: no cover
    import msvcrt  # Windows only

    names = {"H": "up", "P": "down", "M": "right", "K": "left"}
    end, keys = time.monotonic() + wait_s, []
    while time.monotonic() < end:
        if not msvcrt.kbhit():  # type: ignore[attr-defined]
            time.sleep(0.01)
            continue
        key = msvcrt.getwch()  # type: ignore[attr-defined]
        keys.append(names.get(msvcrt.getwch(), "") if key in ("\x00", "\xe0") else key)  # type: ignore[attr-defined]
    return [key for key in keys if key]
