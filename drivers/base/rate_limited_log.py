"""Logging of warnings with a rate limit: a new text immediately, a repeated one at intervals, with its count.

A loose cable makes a servo fail many times a minute; logging each failure would hide everything else.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

INTERVAL_S = 10.0
"""A text is not logged again before this time has passed; then its number of repetitions is added."""
BURST = 20
"""Repeated texts that may be logged in a row; later ones follow at one a second (a token bucket)."""
MAX_TEXTS = 1000
"""Number of texts remembered, which bounds the memory where a board sends a different text each time."""


class RateLimitedLogger:
    """Logs the warnings of one bus to `log`; `clock` gives monotonic seconds."""

    def __init__(self, log: logging.Logger, clock: Callable[[], float]) -> None:
        self._log, self._clock = log, clock
        self._logged: dict[str, tuple[float, int]] = {}  # text: when it was logged last, repetitions since
        self._tokens, self._tokens_s = float(BURST), -math.inf

    def __call__(self, text: str, *values: object) -> None:
        """Log a text, formatted as ``logging`` does, unless it was logged a short while ago."""
        text = text % values if values else text
        now_s = self._clock()
        if text not in self._logged:
            if len(self._logged) >= MAX_TEXTS:
                del self._logged[next(iter(self._logged))]
            self._logged[text] = now_s, 0
            self._log.warning("%s", text)
            return
        last_s, held = self._logged[text]
        if now_s - last_s < INTERVAL_S or not self._take_token(now_s):
            self._logged[text] = last_s, held + 1
            return
        self._logged[text] = now_s, 0
        count = f" ({held + 1} times in {now_s - last_s:.0f} s)" if held else ""
        self._log.warning("%s%s", text, count)

    def _take_token(self, now_s: float) -> bool:
        """Take a token of the bucket; return whether there was one, so that a repeated text may be logged."""
        self._tokens = min(self._tokens + (now_s - self._tokens_s), float(BURST))
        self._tokens_s = now_s
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
