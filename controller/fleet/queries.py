"""Queries the conductor (the process that mixes faces): its clock, and, for a standby, what was commanded before."""

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
from controller.fleet.payload import MAX_NUMBER
from controller.fleet.wire import ALL, Wire
from controller.layers.commands import CommandState

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh

_INTERVAL_S, _SHORT_INTERVAL_S = 1.0, 0.1
"""Interval of queries; the short one applies until the conductor's clock is synchronised."""
_SYNCHRONISED_ANSWERS = 8
"""Number of answers after which a clock counts as synchronised."""
_MAX_OVERTAKEN = 3
"""Greatest number of successive answers that are ignored because a command came while they were in flight, which they
may not contain."""


class ConductorQueries:
    """The queries of a process that follows a conductor.

    heads : layers by head, which take over what was commanded; empty for a process that never conducts.
    events : number of commands of each head that were received from the conductor so far.
    """

    def __init__(
        self, wire: Wire, clocks: Clocks, lease: Lease, heads: Mapping[str, CommandState], events: Mapping[str, int]
    ) -> None:
        self._wire, self._clocks, self._lease, self._heads, self._events = wire, clocks, lease, heads, events
        self._restored: dict[str, Token] = {}
        self._overtaken: Counter[str] = Counter()
        self._queried_s = -_INTERVAL_S

    def poll(self, *, silent: bool = False) -> None:
        """Send the queries that are due; call it often.

        silent : whether a head receives no faces; then queries are more frequent, to find a conductor soon.
        """
        if self._lease.active:
            return
        is_synchronised = self._clocks.answers(self._lease.highest.holder) >= _SYNCHRONISED_ANSWERS
        interval_s = _INTERVAL_S if is_synchronised and not silent else _SHORT_INTERVAL_S
        if time.monotonic() - self._queried_s >= interval_s:
            self._queried_s = time.monotonic()
            self._query_clock()
            self._catch_up()

    def _query_clock(self) -> None:
        sent = time.monotonic_ns()

        def handle_reply(reply: zenoh.Reply) -> None:
            arrived = time.monotonic_ns()
            if reply.ok is None:
                return
            try:
                received, answered, holder = map(int, json.loads(reply.ok.payload.to_bytes()))
                if not -MAX_NUMBER <= received <= answered <= MAX_NUMBER:
                    raise ValueError("a time that is out of range")
            except (ValueError, TypeError, OverflowError):
                self._wire.refuse(LinkError("a malformed clock reply"))
            else:
                self._clocks.add(holder, sent, received, answered, arrived)

        self._wire.ask(ALL, "clock", handle_reply, _INTERVAL_S)

    def _catch_up(self) -> None:
        """Query what was commanded, for each head until the present conductor has answered once."""
        highest = self._lease.highest
        if not highest.fence:
            return
        for name in self._heads:
            if self._restored.get(name) != highest:
                handle_reply = self._restorer(name, highest, self._events.get(name, 0))
                self._wire.ask(name, "state", handle_reply, _INTERVAL_S)

    def _restorer(self, name: str, conductor: Token, events: int) -> Callable[[zenoh.Reply], None]:
        """Return a handler of the reply with a head's state, which restores what ``conductor`` had commanded.

        events : number of commands of the head when the query was sent.
        """

        def handle_reply(reply: zenoh.Reply) -> None:
            if reply.ok is None or self._lease.active or self._restored.get(name) == conductor:
                return
            try:
                found = json.loads(reply.ok.payload.to_bytes())
            except ValueError:
                found = None
            if not isinstance(found, dict):
                self._wire.refuse(LinkError("a malformed state"))
                return
            if not found.get("conducting"):
                return
            if self._events.get(name, 0) != events and self._overtaken[name] < _MAX_OVERTAKEN:
                self._overtaken[name] += 1
                return
            self._restored[name], self._overtaken[name] = conductor, 0
            try:
                journal.restore(found.get("commanded", {}), self._heads[name], time.monotonic_ns())
            except LinkError as error:
                self._wire.refuse(error)

        return handle_reply
