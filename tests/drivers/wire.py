"""A hand-made far end of a pseudo-terminal: it answers what the test tells it to, byte for byte."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from collections.abc import Callable, Iterable
from typing import Self

from drivers.packets.packet import InstructionPacket, InstructionReader

Answer = Callable[[InstructionPacket], Iterable["bytes | tuple[float, bytes]"]]


def silence(packet: InstructionPacket) -> list[bytes]:
    """Nobody answers."""
    return []


class Wire:
    """A pseudo-terminal that answers every instruction packet with what ``answer`` returns.

    Parameters
    ----------
    answer : instruction -> pieces to send; ``(delay_s, bytes)`` waits before the piece. May be replaced any time.

    Attributes
    ----------
    path : where a client opens it.
    heard : all bytes that clients sent.
    packets : the instruction packets among them.
    """

    def __init__(self, answer: Answer = silence) -> None:
        self.answer = answer
        self.heard = bytearray()
        self.packets: list[InstructionPacket] = []
        self._master, self._slave = os.openpty()
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self._reader = InstructionReader()
        self._stop_r, self._stop_w = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Close both ends: the device node disappears."""
        if self._master >= 0:
            os.write(self._stop_w, b"x")
            self._thread.join()
            for fd in (self._master, self._slave, self._stop_r, self._stop_w):
                os.close(fd)
            self._master = -1

    def send(self, data: bytes) -> None:
        """Bytes nobody asked for."""
        os.write(self._master, data)

    def wait_heard(self, count: int, timeout_s: float = 60.0) -> bytes:
        """All bytes heard once there are at least ``count``."""
        end = time.monotonic() + timeout_s
        while len(self.heard) < count and time.monotonic() < end:
            time.sleep(0.001)
        return bytes(self.heard)

    def _serve(self) -> None:
        while True:
            ready, _, _ = select.select([self._master, self._stop_r], [], [])
            if self._stop_r in ready:
                return
            with contextlib.suppress(OSError):
                self._answer(os.read(self._master, 4096))

    def _answer(self, data: bytes) -> None:
        self.heard += data
        for packet in self._reader.feed(data):
            self.packets.append(packet)
            for piece in self.answer(packet):
                delay, piece = piece if isinstance(piece, tuple) else (0.0, piece)
                if delay:
                    time.sleep(delay)
                os.write(self._master, piece)
