"""Who conducts: leases with fencing numbers, by the clock of whoever asks; no I/O here.

A conductor is known by its token: a fencing number that grows with each change of conductor, and its own number.
Tokens have a strict order, and whoever has seen one obeys no lower one ever after (M. Kleppmann, "How to do distributed
locking", 2016): a conductor that was stopped and continues cannot move a head that has heard of its successor.
"""

from __future__ import annotations

from typing import NamedTuple


class Token(NamedTuple):
    """fence : grows with each change of conductor. holder : number of the conductor, which orders equal fences."""

    fence: int
    holder: int


NOBODY = Token(0, 0)


class Lease:
    """One conductor's view of who conducts.

    Parameters
    ----------
    holder : its own number, different from every other's, below 2^63.
    lease_s : a conductor that is not heard for so long has lost its lease.
    wait_s : what this one waits longer before it takes over; different for each, so that rarely two do.
    now_s : the time, s, of any clock that does not jump. first_s : what it waits longer at first, so that one that has
        just started, and knows nothing of what was commanded, replaces nobody whom it has not heard yet.

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
        """Take note of a token: of a conductor that is ``alive``, or one that a head has obeyed."""
        if token.holder == self.holder:
            self.highest = max(self.highest, token)
            return
        if token > self.highest:
            self.highest = token
            self._step_down(now_s)
        if alive and token >= self.highest:
            self._heard_s = now_s

    def tick(self, now_s: float) -> bool:
        """Whether this one conducts now. After a pause longer than the lease it does not: it listens first."""
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
