"""Parts of a run that fail alone: layers, shows, voices, takes, links, recordings, and what looks at the face.

A failure ends its part and nothing else. It is reported once: what failed, why, and how it comes back, which is by
itself after a growing pause, or by what a user does. A part that fails again and again is switched off.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable

from controller.base.errors import OMOTE_ERRORS

log = logging.getLogger(__name__)

PAUSES_S = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Pauses before a part starts again; after one more failure it is switched off."""
RESET_AFTER_S = 60.0
"""A part that has not failed for this time starts again with the first pause."""


class Part:
    """A part of a run.

    Parameters
    ----------
    name : for messages. remedy : what brings it back, for a part that does not start again by itself.
    effect : what happens to the face meanwhile, for messages.
    ended : called when it fails, as to release its layer. keep_trying : never switch it off.

    Attributes
    ----------
    failed : it is not at work. off : it is switched off. failures : how often it failed. why : the last error.
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
        """Call ``do``, unless the part failed and its pause is not over at ``now_s`` (monotonic clock)."""
        if self.failed and not self.due(now_s):
            return
        try:
            do()
        except Exception as error:  # noqa: BLE001  everything else goes on
            self.fail(error, now_s)
        else:
            self.recover()

    def due(self, now_s: float) -> bool:
        """Whether a part that failed may start again."""
        return not self.off and now_s >= self._due_s

    def fail(self, error: BaseException, now_s: float) -> float | None:
        """End the part and report why; returns after how long (s) it may start again, None where it is switched off."""
        self._in_a_row = 1 if now_s - self._failed_s > RESET_AFTER_S else self._in_a_row + 1
        self.off = self._in_a_row > len(PAUSES_S) and not self._keep_trying
        self._failed_s, self._due_s = now_s, now_s if self._remedy else now_s + self.pause_s
        self.failed, self.failures, self.why = True, self.failures + 1, describe(error)
        if self.off or self.why != self._reported:
            self._reported = self.why
            log.error("%s", self._message(), exc_info=error if os.environ.get("OMOTE_DEBUG") else None)
        try:
            self._ended()
        except Exception as also:  # noqa: BLE001  it has failed already
            log.error("%s could not be ended in order: %s", self.name, describe(also))
        return None if self.off else self.pause_s

    @property
    def pause_s(self) -> float:
        """How long it pauses after the failures so far."""
        return PAUSES_S[min(self._in_a_row, len(PAUSES_S)) - 1]

    def note(self, what: str) -> None:
        """Report something that went wrong and does not end the part."""
        log.warning("%s: %s", self.name, what)

    def recover(self) -> None:
        """Say that a part that failed is at work again; does nothing for one that is."""
        if self.failed:
            self.failed, self._reported = False, ""
            log.warning("%s works again", self.name)

    def report(self) -> dict[str, object]:
        """Name, how often it failed, why the last time, and whether it is at work, failed or switched off."""
        state = "switched off" if self.off else "failed" if self.failed else "at work"
        return {"part": self.name, "failures": self.failures, "why": self.why, "state": state}

    def _message(self) -> str:
        if self.off:
            back = self._remedy or "it comes back with the next start"
            return f"{self.name} failed {self._in_a_row} times in a row and is switched off: {self.why}; {back}"
        back = self._remedy or f"it starts again in {self.pause_s:g} s"
        return "; ".join(filter(None, (f"{self.name} failed: {self.why}", self._effect, back)))


class Parts:
    """The parts of one run, by their names; any thread may ask for one."""

    def __init__(self) -> None:
        self._parts: dict[str, Part] = {}

    def add(self, part: Part) -> Part:
        """The part of this name that is there already; otherwise ``part``, which is kept."""
        return self._parts.setdefault(part.name, part)

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the parts that are not at work because they failed."""
        return tuple(part.name for part in list(self._parts.values()) if part.failed)

    def report(self) -> list[dict[str, object]]:
        """The report of every part that failed at least once."""
        return [part.report() for part in list(self._parts.values()) if part.failures]


def describe(error: BaseException) -> str:
    """An error for a message: that of omote's own errors with its hint, the system's words with the file, any other
    with its kind.
    """
    if isinstance(error, OMOTE_ERRORS) or hasattr(error, "hint"):
        hint = getattr(error, "hint", "")
        return f"{error} ({hint})" if hint else str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return f"{type(error).__name__}: {error}"
