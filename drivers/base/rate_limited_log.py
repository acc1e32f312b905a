"""What a driver says of its servos: every fault at once, and the same one again only now and then.

A loose cable makes a servo come and go many times a minute; a log that says so each time hides what else happens.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

AGAIN_S = 10.0
"""The same is not said again before this time has passed; then with how often it was."""
BURST = 20
"""So many lines that have been said before may follow each other at once, later ones one a second."""
KEPT = 1000
"""Texts remembered; more come only from a board that words every refusal anew."""


class RateLimitedLogger:
    """Says warnings of one bus.

    Parameters
    ----------
    log : where to.
    clock : monotonic seconds.
    """

    def __init__(self, log: logging.Logger, clock: Callable[[], float]) -> None:
        self._log, self._clock = log, clock
        self._told: dict[str, tuple[float, int]] = {}  # text: when it was said last, how often it was not since
        self._room, self._room_s = float(BURST), -math.inf

    def __call__(self, text: str, *values: object) -> None:
        """Say it, filled in as ``logging`` does, unless it was said a short while ago."""
        text = text % values if values else text
        now_s = self._clock()
        if text not in self._told:
            self._remember(text, now_s)
            self._log.warning("%s", text)
            return
        last_s, held = self._told[text]
        if now_s - last_s < AGAIN_S or not self._has_room(now_s):
            self._told[text] = last_s, held + 1
            return
        self._told[text] = now_s, 0
        again = f" ({held + 1} times in {now_s - last_s:.0f} s)" if held else ""
        self._log.warning("%s%s", text, again)

    def _remember(self, text: str, now_s: float) -> None:
        if len(self._told) >= KEPT:
            del self._told[next(iter(self._told))]
        self._told[text] = now_s, 0

    def _has_room(self, now_s: float) -> bool:
        """Take one of the lines that may be said again now, where there is one."""
        self._room = min(self._room + (now_s - self._room_s), float(BURST))
        self._room_s = now_s
        if self._room < 1.0:
            return False
        self._room -= 1.0
        return True
