"""Stores the lines that a link has to send until there is room for them, and which of them are answers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

MAX_BYTES = 65_536
"""Room for the answers to all lines of one read. A peer that does not read loses whole lines."""


class Outbox:
    """Lines that wait to be sent, in order. Streamed lines never wait behind others, because they would be outdated."""

    def __init__(self) -> None:
        self._lines: deque[tuple[bytes, bool]] = deque()
        self._size = 0

    def __bool__(self) -> bool:
        return bool(self._lines)

    def add(self, line: bytes, *, answer: bool) -> bool:
        """Append a line with its line end; return False if there is no room for it, or, for a
        streamed line, if anything waits."""
        if self._size + len(line) > MAX_BYTES or (self._lines and not answer):
            return False
        self._lines.append((line, answer))
        self._size += len(line)
        return True

    def flush(self, put: Callable[[bytes], int]) -> int:
        """Send what ``put`` accepts without waiting; return the number of bytes."""
        if not self._lines:
            return 0
        sent = left = put(b"".join(line for line, _ in self._lines))
        while left:
            line, answer = self._lines.popleft()
            if left < len(line):
                self._lines.appendleft((line[left:], answer))
                break
            left -= len(line)
        self._size -= sent
        return sent

    def clear(self) -> int:
        """Discard everything; return how many answers were not sent completely."""
        lost = sum(answer for _, answer in self._lines)
        self._lines.clear()
        self._size = 0
        return lost
