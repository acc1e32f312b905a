"""Joins a line session and an outbox, in which answers and streamed lines wait for room; does no I/O itself."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

from controller.links.line.outbox import Outbox
from controller.links.line.session import LineSession
from controller.links.net.meter import Meter

Put = Callable[[bytes], int]
"""Sends as many bytes as there is room for, without waiting, and returns how many."""


class Talk:
    """The exchange of lines with one far end.

    Attributes
    ----------
    session : its state. meter : measures its lines. counts : bytes in and out, lines streamed and dropped.
    busy : whether received lines wait to be acted on; new bytes may be passed only while it is False.
    """

    def __init__(self, session: LineSession) -> None:
        self.session, self.meter = session, Meter()
        self.counts = {"bytes_in": 0, "bytes_out": 0, "streamed": 0, "dropped": 0}
        self.busy = False
        self._answers: Iterator[bytes] = iter(())
        self._out = Outbox()

    def serve(self, data: bytes, put: Put, longest_s: float = math.inf) -> None:
        """Act on received bytes (perhaps none), and send answers and the streamed line that is due.

        longest_s : lines that have not been acted on after this time wait for the next call; a STOP among them acts
        first.
        """
        now_ns = time.monotonic_ns()
        if data:
            self.counts["bytes_in"] += len(data)
            self._answers = self.session.answers(data, now_ns)
        if data or self.busy:
            self._act(put, now_ns * 1e-9, longest_s)
        self._flush(put)
        line = self.session.stream(now_ns)
        if line:
            self.counts["streamed" if self._out.add(line, answer=False) else "dropped"] += 1
        self._flush(put)

    def lose(self) -> None:
        """Discard incomplete and unsent lines after the connection was lost; a subscription continues."""
        self._answers, self.busy = iter(()), False
        self.session.drop()
        self.session.unanswered += self._out.clear()

    def wait_s(self, longest_s: float) -> float:
        """Return how long to wait for bytes until the next streamed line is due, at most ``longest_s``."""
        if self.busy:
            return 0.0
        due_ns = self.session.due_ns()
        return longest_s if due_ns is None else min(longest_s, max(0.0, (due_ns - time.monotonic_ns()) * 1e-9))

    def _act(self, put: Put, now_s: float, longest_s: float) -> None:
        before, self.busy = self.session.accepted, False
        for answer in self._answers:
            self._reply(answer, put)
            if time.monotonic() - now_s > longest_s:
                self.busy = True
                break
        taken = self.session.accepted - before
        if taken:
            self.meter.note(now_s, skipped=taken - 1)

    def _reply(self, line: bytes, put: Put) -> None:
        if self._out.add(line, answer=True):
            return
        self._flush(put)
        if not self._out.add(line, answer=True):
            self.counts["dropped"] += 1
            self.session.unanswered += 1

    def _flush(self, put: Put) -> None:
        self.counts["bytes_out"] += self._out.flush(put)
