"""Decides when a silence has lasted long enough to act on it; no I/O here."""

from __future__ import annotations


class Silence:
    """A timer of silence: an action is due after ``first_s``, and again after pauses that double.

    longest_s : longest pause between two actions. now_s : the time (s) of any clock that does not jump.
    """

    def __init__(self, first_s: float, longest_s: float, now_s: float) -> None:
        self._first_s, self._longest_s = first_s, longest_s
        self._heard_s, self._since_s = now_s, now_s
        self._pause_s = self._next_s = 0.0
        self.acts = 0
        """Number of actions that were due since a message came last."""

    def hear(self, now_s: float) -> None:
        """Note that a message came; any thread may call it."""
        self._heard_s = now_s

    def due(self, now_s: float) -> bool:
        """Return whether an action is due now, and count it; a single thread calls it often."""
        if not self.acts or self._heard_s != self._since_s:
            self._since_s, self._pause_s, self.acts = self._heard_s, self._first_s, 0
            self._next_s = self._heard_s + self._first_s
        if now_s < self._next_s:
            return False
        self.acts += 1
        self._next_s = now_s + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, self._longest_s)
        return True
