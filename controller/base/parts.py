"""Isolates failures: layers, shows, voices, takes, links and recordings are parts of a run that fail separately.

A failure ends its part and nothing else. It is reported once: what failed, why, and how the part restarts, which is
automatic after a growing pause, or by an action of the user. A part that fails again and again is switched off.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable

from controller.base.errors import OMOTE_ERRORS

log = logging.getLogger(__name__)

PAUSES_S = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Pauses before a part restarts after 1, 2, 3, ... failures in a row; after one more failure it is switched off."""
RESET_AFTER_S = 60.0
"""After this time without a failure, the next failure counts as the first of a row."""


class Part:
    """A part of a run.

    Parameters
    ----------
    name : for messages. remedy : for messages, what the user does to restart a part that does not restart itself.
    effect : for messages, what the failure does to the face.
    ended : called at each failure, for example to release the part's layer. keep_trying : never switch it off.

    Attributes
    ----------
    failed : whether it has failed and not recovered. off : whether it is switched off. failures : number of failures.
    why : text of the last error.
    """

    def __init__(
        self,
        name: str,
        *,
        remedy: str = "",
        effect: str = "",
        ended: Callable[[], object] = lambda: None,
        keep_trying: bool = False,
    ) -> None:
        self.name = name
        self.failed = self.off = False
        self.failures = 0
        self.why = ""
        self._remedy, self._effect, self._ended, self._keep_trying = remedy, effect, ended, keep_trying
        self._in_a_row, self._reported = 0, ""
        self._failed_s = self._due_s = 0.0

    def run(self, do: Callable[[], object], now_s: float) -> None:
        """Call ``do``, unless the part failed and its pause is not over at ``now_s`` (monotonic clock, s)."""
        if self.failed and not self.due(now_s):
            return
        try:
            do()
        except Exception as error:  # noqa: BLE001  a failure of one part must not end the run
            self.fail(error, now_s)
        else:
            self.recover()

    def due(self, now_s: float) -> bool:
        """Whether a part that failed may restart."""
        return not self.off and now_s >= self._due_s

    def fail(self, error: BaseException, now_s: float) -> float | None:
        """End the part and report why; return the pause (s) before it may restart, or None if it is switched off."""
        self._in_a_row = 1 if now_s - self._failed_s > RESET_AFTER_S else self._in_a_row + 1
        self.off = self._in_a_row > len(PAUSES_S) and not self._keep_trying
        self._failed_s, self._due_s = now_s, now_s if self._remedy else now_s + self.pause_s
        self.failed, self.failures, self.why = True, self.failures + 1, describe(error)
        if self.off or self.why != self._reported:
            self._reported = self.why
            log.error("%s", self._message(), exc_info=error if os.environ.get("OMOTE_DEBUG") else None)
        try:
            self._ended()
        except Exception as second:  # noqa: BLE001  the part counts as failed in any case
            log.error("%s could not be ended in order: %s", self.name, describe(second))
        return None if self.off else self.pause_s

    @property
    def pause_s(self) -> float:
        """Pause after the failures in a row so far, s."""
        return PAUSES_S[min(self._in_a_row, len(PAUSES_S)) - 1]

    def note(self, message: str) -> None:
        """Log a problem that does not end the part."""
        log.warning("%s: %s", self.name, message)

    def recover(self) -> None:
        """Mark a failed part as working again, and log it; has no effect on a part that has not failed."""
        if self.failed:
            self.failed, self._reported = False, ""
            log.warning("%s works again", self.name)

    def report(self) -> dict[str, object]:
        """Return name, number of failures, last error, and the state: at work, failed or switched off."""
        state = "switched off" if self.off else "failed" if self.failed else "at work"
        return {"part": self.name, "failures": self.failures, "why": self.why, "state": state}

    def _message(self) -> str:
        if self.off:
            restart = self._remedy or "it comes back with the next start"
            return f"{self.name} failed {self._in_a_row} times in a row and is switched off: {self.why}; {restart}"
        restart = self._remedy or f"it starts again in {self.pause_s:g} s"
        return "; ".join(filter(None, (f"{self.name} failed: {self.why}", self._effect, restart)))


class Parts:
    """The parts of one run, by name; any thread may use it."""

    def __init__(self) -> None:
        self._parts: dict[str, Part] = {}

    def add(self, part: Part) -> Part:
        """Return the existing part with the name of ``part``; if there is none, add and return ``part``."""
        return self._parts.setdefault(part.name, part)

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the parts that have failed and not recovered."""
        return tuple(part.name for part in list(self._parts.values()) if part.failed)

    def report(self) -> list[dict[str, object]]:
        """Return the report of every part that has failed at least once."""
        return [part.report() for part in list(self._parts.values()) if part.failures]


def describe(error: BaseException) -> str:
    """Return the text of an error: omote's own with its hint, the system's with the file, any other with its type."""
    if isinstance(error, OMOTE_ERRORS) or hasattr(error, "hint"):
        hint = getattr(error, "hint", "")
        return f"{error} ({hint})" if hint else str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return f"{type(error).__name__}: {error}"
