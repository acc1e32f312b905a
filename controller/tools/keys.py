"""Reads single key presses from a terminal, without waiting for a line."""

from __future__ import annotations

import os
import re
import select
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from controller.base.errors import ControllerError

ARROWS = {"[A": "up", "[B": "down", "[C": "right", "[D": "left", "OA": "up", "OB": "down", "OC": "right", "OD": "left"}


@contextmanager
def keyboard(descriptor: int | None = None) -> Iterator[Callable[[float], list[str]]]:
    """A function that returns the keys pressed within a time (s): characters, ``up``, ``down``, ``left``, ``right``.

    ``descriptor`` : of a terminal, standard input without; its settings are restored at the end. Raises ControllerError
    where it is no terminal.
    """
    fd = sys.stdin.fileno() if descriptor is None else descriptor
    if not os.isatty(fd):
        raise ControllerError("keys can only be read from a terminal", hint="start omote in a terminal window")
    if sys.platform == "win32":
        yield _windows_keys
        return
    import termios  # not on Windows
    import tty  # not on Windows

    before = termios.tcgetattr(fd)
    tty.setcbreak(fd)
    try:
        yield partial(_terminal_keys, fd)
    finally:
        termios.tcsetattr(fd, termios.TCSADRAIN, before)


def _terminal_keys(fd: int, wait_s: float) -> list[str]:
    end, data = time.monotonic() + wait_s, b""
    while select.select([fd], [], [], max(0.0, end - time.monotonic()))[0]:
        piece = os.read(fd, 64)
        if not piece:
            break
        data += piece
    return split_keys(data.decode("utf-8", "ignore"))


def split_keys(text: str) -> list[str]:
    """The input of a terminal, key by key; escape sequences of other keys are left out."""
    keys = [ARROWS.get(key[1:], "") if key[0] == "\x1b" else key for key in re.findall("\x1b.{0,2}|.", text, re.DOTALL)]
    return [key for key in keys if key]


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
