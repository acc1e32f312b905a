"""Asks the conductor: what its clock says, and, for one that stands by, what was commanded before it came."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from controller.base.errors import LinkError
from controller.fleet import journal
from controller.fleet.lease import Lease, Token
from controller.fleet.offset import Clocks
from controller.fleet.payload import MOST
from controller.fleet.wire import ALL, Wire
from controller.layers.commands import CommandState

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh

_CLOCK_S, _OFTEN_S = 1.0, 0.1
"""Seconds between two questions for the time: of a clock that is known, and of one that is new."""
_KNOWN = 8
"""Answers after which a clock is known."""
_CROSSED = 3
"""Most answers in a row that are left out because a command came while they were under way, which they may lack."""


class Asking:
    """The questions of a process that follows a conductor.

    heads : layers by the name of the head, which take over what was commanded; empty for a process that never
    conducts. events : how many commands of each head were heard as they took effect.
    """

    def __init__(
        self, wire: Wire, clocks: Clocks, lease: Lease, heads: Mapping[str, CommandState], events: Mapping[str, int]
    ) -> None:
        self._wire, self._clocks, self._lease, self._heads, self._events = wire, clocks, lease, heads, events
        self._restored: dict[str, Token] = {}
        self._crossed: Counter[str] = Counter()
        self._asked_s = -_CLOCK_S

    def ask(self, *, silent: bool = False) -> None:
        """Called often: ask what is due; more where it is ``silent``, so that it is soon known who is there."""
        if self._lease.active:
            return
        known = self._clocks.answers(self._lease.highest.holder) >= _KNOWN
        pause_s = _CLOCK_S if known and not silent else _OFTEN_S
        if time.monotonic() - self._asked_s >= pause_s:
            self._asked_s = time.monotonic()
            self._ask_clock()
            self._catch_up()

    def _ask_clock(self) -> None:
        asked = time.monotonic_ns()

        def heard(reply: zenoh.Reply) -> None:
            arrived = time.monotonic_ns()
            if reply.ok is None:
                return
            try:
                received, answered, holder = map(int, json.loads(reply.ok.payload.to_bytes()))
                if not -MOST <= received <= answered <= MOST:
                    raise ValueError("no time of a clock")
            except (ValueError, TypeError, OverflowError):
                self._wire.refuse(LinkError("a time that is not the JSON it should be"))
            else:
                self._clocks.add(holder, asked, received, answered, arrived)

        self._wire.ask(ALL, "clock", heard, _CLOCK_S)

    def _catch_up(self) -> None:
        """Ask a conductor that was there before what was commanded, until it has answered once."""
        highest = self._lease.highest
        if not highest.fence:
            return
        for name in self._heads:
            if self._restored.get(name) != highest:
                act = self._restorer(name, highest, self._events.get(name, 0))
                self._wire.ask(name, "state", act, _CLOCK_S)

    def _restorer(self, name: str, conductor: Token, events: int) -> Callable[[zenoh.Reply], None]:
        def heard(reply: zenoh.Reply) -> None:
            if reply.ok is None or self._lease.active or self._restored.get(name) == conductor:
                return
            try:
                found = json.loads(reply.ok.payload.to_bytes())
            except ValueError:
                found = None
            if not isinstance(found, dict):
                self._wire.refuse(LinkError("a state that is not the JSON it should be"))
                return
            if not found.get("conducting"):
                return
            if self._events.get(name, 0) != events and self._crossed[name] < _CROSSED:
                self._crossed[name] += 1
                return
            self._restored[name], self._crossed[name] = conductor, 0
            try:
                journal.restore(found.get("commanded", {}), self._heads[name], time.monotonic_ns())
            except LinkError as error:
                self._wire.refuse(error)

        return heard
