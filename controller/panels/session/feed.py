"""State of servos, links and faults for the panel: it is requested a few times a second and kept for half a minute.

Independent of the window library.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from controller.base.parameters import Floats
from controller.body.messages import AskDetails, Details, PanelRequest
from controller.panels.session.problems import Problems

PERIOD_S = 0.2
KEPT_S = 30.0
_PATIENCE_S = 2.0
"""Time after which an unanswered request is repeated."""
_ROWS = round(KEPT_S / PERIOD_S)


class History:
    """The newest rows of a few numbers with their times.

    names : of the columns.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names, self._next, self._count = names, 0, 0
        self._times, self._rows = np.full(_ROWS, np.nan), np.full((len(names), _ROWS), np.nan)

    def add(self, time_s: float, row: Mapping[str, Any]) -> None:
        """Add a row; unknown values are NaN."""
        found = (row.get(name) for name in self.names)
        self._rows[:, self._next] = [np.nan if value is None else float(value) for value in found]
        self._times[self._next] = time_s
        self._next, self._count = (self._next + 1) % _ROWS, min(self._count + 1, _ROWS)

    def series(self) -> tuple[Floats, Floats]:
        """Return (n,): times (s), and (k, n) values of the columns, oldest first."""
        order = (np.arange(_ROWS - self._count, _ROWS) + self._next) % _ROWS
        return self._times[order], self._rows[:, order]


class Feed:
    """Requests details from the control process (body) and keeps them; called once per frame.

    send : sends requests to the body. newest : the newest answer of the body; None before the first.
    problems : hears of what went wrong. clock : seconds.
    """

    COLUMNS = ("wanted_deg", "measured_deg", "temperature_c")

    def __init__(
        self, send: Callable[[PanelRequest], None], newest: Callable[[], Details | None], problems: Problems,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self._send, self._newest, self._problems, self._clock = send, newest, problems, clock
        self._asked_s = -np.inf
        self._waits = False
        self.details = Details()
        self.histories: dict[str, History] = {}

    def __call__(self) -> None:
        """Store a new answer, and request the next one."""
        now_s, newest = self._clock(), self._newest()
        if newest is not None and newest is not self.details:
            self.details, self._waits = newest, False
            self._record(now_s)
        since = now_s - self._asked_s
        if since >= (_PATIENCE_S if self._waits else PERIOD_S):
            self._asked_s, self._waits = now_s, True
            self._send(AskDetails())

    def _record(self, now_s: float) -> None:
        for servo in self.details.servos:
            self.history(servo).add(now_s, servo)
        for note in self.details.notes:
            self._problems.add(note)

    def history(self, servo: Mapping[str, Any]) -> History:
        """Return the wanted and the reported values of a servo: the columns of :attr:`COLUMNS`."""
        return self.histories.setdefault(servo_key(servo), History(self.COLUMNS))

    @property
    def waiting(self) -> bool:
        """Whether no answer has come yet."""
        return not (self.details.servos or self.details.links or self.details.buses)


def servo_key(servo: Mapping[str, Any]) -> str:
    """Return a name that no other servo of the stage has."""
    return f"{servo['bus']}/{servo['id']} {servo['name']}"
