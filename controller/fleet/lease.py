"""Decides which process conducts, by leases with fencing tokens; times are the caller's, and there is no I/O here.

A conductor is identified by its token: a fencing number that grows with each change of conductor, and its own number.
Tokens are strictly ordered, and a process that has seen one obeys no lower one afterwards (M. Kleppmann, "How to do
distributed locking", 2016). So a conductor that was suspended and resumes cannot move a head that knows its successor.
"""

from __future__ import annotations

from typing import NamedTuple


class Token(NamedTuple):
    """Fencing token. fence : grows with each change of conductor. holder : conductor's number, orders equal fences."""

    fence: int
    holder: int


NOBODY = Token(0, 0)


class Lease:
    """One conductor's view of who conducts.

    Parameters
    ----------
    holder : its own number, unique, below 2^63.
    lease_s : a conductor that is silent for this time has lost its lease.
    wait_s : additional time before this one takes over; random, so that two rarely do at once.
    now_s : the time (s) of any clock that does not jump. first_s : additional wait after the start, so that a new
        process, which does not know what was commanded, does not replace a conductor that it has not heard yet.

    Attributes
    ----------
    active : whether this one conducts, as of the last :meth:`tick`. token : its token while it does.
    highest : the highest token seen. terms : how often it began to conduct. lost : how often it stopped.
    """

    def __init__(self, holder: int, lease_s: float, wait_s: float, now_s: float, first_s: float = 0.0) -> None:
        self.holder, self._lease_s, self._wait_s = holder, lease_s, wait_s
        self.active, self.token, self.highest = False, NOBODY, NOBODY
        self.terms = self.lost = 0
        self._heard_s, self._ticked_s = now_s + first_s, now_s

    def hear(self, token: Token, now_s: float, *, alive: bool = True) -> None:
        """Note a token; ``alive`` : whether its conductor sent it, and not a head that has obeyed it."""
        if token.holder == self.holder:
            self.highest = max(self.highest, token)
            return
        if token > self.highest:
            self.highest = token
            self._step_down(now_s)
        if alive and token >= self.highest:
            self._heard_s = now_s

    def tick(self, now_s: float) -> bool:
        """Update and return whether this one conducts. After a pause longer than the lease it steps down first."""
        if now_s - self._ticked_s > self._lease_s:
            self._step_down(now_s)
            self._heard_s = max(self._heard_s, now_s)
        self._ticked_s = now_s
        if not self.active and now_s - self._heard_s > self._lease_s + self._wait_s:
            self.token = self.highest = Token(self.highest.fence + 1, self.holder)
            self.active, self.terms = True, self.terms + 1
        return self.active

    def _step_down(self, now_s: float) -> None:
        if self.active:
            self.active, self.lost, self._heard_s = False, self.lost + 1, now_s
