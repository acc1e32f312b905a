"""Drops files on a window as a file manager does, by the X drag-and-drop protocol (XDND):
``python -m tests.xdnd FILE …`` on the display that ``DISPLAY`` names; the window is the one that takes drops.

A client of its own: it knows Xlib, not the window library. Protocol: https://www.freedesktop.org/wiki/Specifications/XDND.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

VERSION, LONGEST_S = 5, 60.0
_CLIENT_MESSAGE, _SELECTION_REQUEST, _SELECTION_NOTIFY = 33, 30, 31
_REPLACE, _ANY_TYPE, _NO_EVENTS = 0, 0, 0
_Id = ctypes.c_ulong


class _Message(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("sent", ctypes.c_int), ("display", ctypes.c_void_p),
        ("window", _Id), ("message", _Id), ("format", ctypes.c_int), ("data", ctypes.c_long * 5),
    )  # fmt: skip


class _Request(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("sent", ctypes.c_int), ("display", ctypes.c_void_p),
        ("owner", _Id), ("requestor", _Id), ("selection", _Id), ("target", _Id), ("property", _Id), ("time", _Id),
    )  # fmt: skip


class _Notice(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("sent", ctypes.c_int), ("display", ctypes.c_void_p),
        ("requestor", _Id), ("selection", _Id), ("target", _Id), ("property", _Id), ("time", _Id),
    )  # fmt: skip


class _Event(ctypes.Union):
    _fields_ = (("type", ctypes.c_int), ("message", _Message), ("request", _Request), ("notice", _Notice),
                ("room", ctypes.c_long * 24))  # fmt: skip


class Source:
    """Where files are dragged from: a window of its own, never shown."""

    def __init__(self) -> None:
        x = self._x = ctypes.CDLL(ctypes.util.find_library("X11") or "libX11.so.6")
        for name in ("XOpenDisplay", "XDefaultRootWindow", "XInternAtom", "XCreateSimpleWindow"):
            getattr(x, name).restype = ctypes.c_void_p if name == "XOpenDisplay" else _Id
        self._display = ctypes.c_void_p(x.XOpenDisplay(None))
        if not self._display:
            raise SystemExit("no display: set DISPLAY")
        self._root = _Id(x.XDefaultRootWindow(self._display))
        self._own = _Id(x.XCreateSimpleWindow(self._display, self._root, 0, 0, 1, 1, 0, _Id(0), _Id(0)))

    def atom(self, name: str) -> int:
        """Number of a name."""
        return int(self._x.XInternAtom(self._display, name.encode(), 0))

    def target(self) -> int:
        """The first window that says it takes drops."""
        end_s = time.monotonic() + LONGEST_S
        while time.monotonic() < end_s:
            found = next((window for window in self._windows(self._root) if self._takes_drops(window)), None)
            if found is not None:
                return found
            time.sleep(0.1)
        raise SystemExit("no window here takes drops")

    def _windows(self, window: _Id) -> list[int]:
        """All windows below one, the inner ones first."""
        children, count, other = ctypes.POINTER(_Id)(), ctypes.c_uint(), _Id()
        ask = (ctypes.byref(other), ctypes.byref(other), ctypes.byref(children), ctypes.byref(count))
        if not self._x.XQueryTree(self._display, window, *ask):
            return []
        below = [children[i] for i in range(count.value)]
        return [*(each for child in below for each in self._windows(_Id(child))), *below]

    def _takes_drops(self, window: int) -> bool:
        kind, bits, count, rest, data = _Id(), ctypes.c_int(), _Id(), _Id(), ctypes.c_void_p()
        self._x.XGetWindowProperty(
            self._display, _Id(window), _Id(self.atom("XdndAware")), ctypes.c_long(0), ctypes.c_long(1), 0,
            _Id(_ANY_TYPE), ctypes.byref(kind), ctypes.byref(bits), ctypes.byref(count), ctypes.byref(rest),
            ctypes.byref(data),
        )  # fmt: skip
        return count.value > 0

    def drop(self, paths: Sequence[Path]) -> None:
        """Drag files over the middle of the window and let go; returns when it has taken them."""
        window, kinds = self.target(), (self.atom("text/uri-list"), 0, 0)
        lines = "".join(f"{path.resolve().as_uri()}\r\n" for path in paths).encode()
        self._x.XSetSelectionOwner(self._display, _Id(self.atom("XdndSelection")), self._own, _Id(0))
        self._send(window, "XdndEnter", VERSION << 24, *kinds)
        self._send(window, "XdndPosition", 0, (200 << 16) | 200, 0, self.atom("XdndActionCopy"))
        self._serve(lines, "XdndStatus")
        self._send(window, "XdndDrop", 0, 0)
        self._serve(lines, "XdndFinished")

    def _send(self, window: int, name: str, *data: int) -> None:
        event = _Event()
        event.message.type, event.message.window, event.message.format = _CLIENT_MESSAGE, window, 32
        event.message.message, event.message.display = self.atom(name), self._display
        event.message.data[:] = [self._own.value or 0, *data, *([0] * (4 - len(data)))]
        self._put(window, event)

    def _put(self, window: int, event: _Event) -> None:
        self._x.XSendEvent(self._display, _Id(window), 0, ctypes.c_long(_NO_EVENTS), ctypes.byref(event))
        self._x.XFlush(self._display)

    def _serve(self, lines: bytes, until: str) -> None:
        """Hand the names of the files out to who asks, until the window has sent a message."""
        wanted, end_s, event = self.atom(until), time.monotonic() + LONGEST_S, _Event()
        while time.monotonic() < end_s:
            if not self._x.XPending(self._display):
                time.sleep(0.01)
                continue
            self._x.XNextEvent(self._display, ctypes.byref(event))
            if event.type == _CLIENT_MESSAGE and event.message.message == wanted:
                return
            if event.type == _SELECTION_REQUEST:
                self._answer(event.request, lines)
        raise SystemExit(f"the window sent no {until}")

    def _answer(self, asked: Any, lines: bytes) -> None:
        to = _Id(asked.requestor)
        self._x.XChangeProperty(
            self._display, to, _Id(asked.property), _Id(asked.target), 8, _REPLACE, lines, len(lines)
        )  # fmt: skip
        event = _Event()
        event.notice.type, event.notice.requestor, event.notice.selection = (
            _SELECTION_NOTIFY, asked.requestor, asked.selection,
        )  # fmt: skip
        event.notice.target, event.notice.property, event.notice.time = asked.target, asked.property, asked.time
        self._put(asked.requestor, event)


def main() -> None:
    """Drop the files of the command line."""
    Source().drop([Path(each) for each in sys.argv[1:]])
    sys.stdout.write("taken\n")


if __name__ == "__main__":
    main()
