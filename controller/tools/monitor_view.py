"""A live view of a bus: a table of its servos and the last packets, decoded; plain lines without a terminal."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from drivers.core.traffic import Decoder

Rows = Callable[[], Iterable[Mapping[str, Any]]]

REFRESH_S = 0.1
KEPT = 4096
"""Pieces of traffic kept between two refreshes; older ones of a busy bus are dropped, and the view shows how many."""


class BusView:
    """Shows the traffic of a bus and the state of its servos.

    ``tap`` may be called from any thread and only stores the bytes; decoding and drawing happen in :meth:`run`.

    Parameters
    ----------
    title : of the view. rows : returns one mapping for each servo, values by column. decoder : of the bus's protocol.
    console : to print to; where it is no terminal, lines are printed as they come. lines : lines of traffic shown.
    """

    def __init__(self, title: str, rows: Rows, decoder: Decoder, console: Console, lines: int = 16) -> None:
        self.title, self.rows, self._decoder, self._console = title, rows, decoder, console
        self._pieces: deque[tuple[float, bool | None, bytes]] = deque(maxlen=KEPT)
        self._log: deque[str] = deque(maxlen=lines)
        self._begun_s = time.monotonic()
        self._taken = self._passed = 0

    def tap(self, sent: bool | None, data: bytes) -> None:
        """Store bytes that passed; ``sent`` None where the direction is not known."""
        self._passed += 1
        self._pieces.append((time.monotonic(), sent, bytes(data)))

    def lines(self) -> list[str]:
        """Lines decoded since the last call, with the time since the beginning."""
        new = []
        while self._pieces:
            time_s, sent, data = self._pieces.popleft()
            self._taken += 1
            new += [f"{time_s - self._begun_s:9.3f}  {line}" for line in self._decoder.feed(sent, data)]
        return new

    def run(self, keep_going: Callable[[], bool], step: Callable[[], None] = lambda: time.sleep(REFRESH_S)) -> None:
        """Show until ``keep_going()`` is false; calls ``step`` in a loop, which waits a moment each time."""
        if self._console.is_terminal:
            with Live(self._picture(), console=self._console, auto_refresh=False, screen=True) as live:
                self._loop(keep_going, step, lambda: live.update(self._picture(), refresh=True))
        else:
            self._loop(keep_going, step, self._print)
            self._print()

    def _loop(self, keep_going: Callable[[], bool], step: Callable[[], None], show: Callable[[], None]) -> None:
        next_s = 0.0
        while keep_going():
            step()
            if time.monotonic() >= next_s:
                show()
                next_s = time.monotonic() + REFRESH_S

    def _print(self) -> None:
        for line in self.lines():
            self._console.print(Text(line), soft_wrap=True)

    def _picture(self) -> Group:
        self._log.extend(self.lines())
        left_out = self._passed - self._taken - len(self._pieces)
        note = f"  ({left_out} pieces left out)" if left_out > 0 else ""
        traffic = Text("\n".join(self._log), no_wrap=True, overflow="ellipsis")
        return Group(Text(f"{self.title}   Ctrl-C ends{note}", style="bold"), table_of(self.rows()), traffic)


def table_of(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Mappings as a table; unknown values stay empty."""
    listed = list(rows)
    names = list(dict.fromkeys(name for row in listed for name in row))
    table = Table(*names)
    for row in listed:
        table.add_row(*(_cell(row.get(name)) for name in names))
    return table


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:.1f}" if isinstance(value, float) else str(value)
