"""Asks the conductor: what its clock says, and, for one that stands by, what was commanded before it came."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from controller.base.errors import LinkError
from controller.fleet import journal
from controller.fleet.lease import Lease, Token
from controller.fleet.offset import Clocks
from controller.fleet.wire import ALL, Wire
from controller.layers.commands import CommandState

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh

_CLOCK_S, _OFTEN_S = 1.0, 0.1
"""Between two questions for the time: of a clock that is known, and of one that is new."""
_KNOWN = 8
"""After so many answers a clock is known."""


class Asking:
    """Of a process that follows. restore : whether what was commanded is taken over, into ``heads``."""

    def __init__(
        self, wire: Wire, clocks: Clocks, lease: Lease, heads: Mapping[str, CommandState], *, restore: bool
    ) -> None:
        self._wire, self._clocks, self._lease, self._heads, self._restore = wire, clocks, lease, heads, restore
        self._restored: Token | None = None
        self._asked_s = -_CLOCK_S

    def ask(self) -> None:
        """Called often: ask what is due."""
        if self._lease.active:
            return
        pause_s = _CLOCK_S if self._clocks.answers(self._lease.highest.holder) >= _KNOWN else _OFTEN_S
        if time.monotonic() - self._asked_s >= pause_s:
            self._asked_s = time.monotonic()
            self._ask_clock()
            self._catch_up()

    def _ask_clock(self) -> None:
        asked = time.monotonic_ns()

        def heard(reply: zenoh.Reply) -> None:
            arrived = time.monotonic_ns()
            if reply.ok is not None:
                received, answered, holder = map(int, json.loads(reply.ok.payload.to_bytes()))
                self._clocks.add(holder, asked, received, answered, arrived)

        self._wire.session.get(self._wire.key(ALL, "clock"), heard, timeout=_CLOCK_S)

    def _catch_up(self) -> None:
        """Ask a conductor that was there before what was commanded, once."""
        highest = self._lease.highest
        if not self._restore or self._restored == highest or not highest.fence:
            return
        self._restored = highest
        for name, state in self._heads.items():
            self._wire.session.get(self._wire.key(name, "state"), self._restorer(state), timeout=_CLOCK_S)

    def _restorer(self, state: CommandState) -> Callable[[zenoh.Reply], None]:
        def heard(reply: zenoh.Reply) -> None:
            if reply.ok is None or self._lease.active:
                return
            found = json.loads(reply.ok.payload.to_bytes())
            if found.get("conducting"):
                try:
                    journal.restore(found["commanded"], state, time.monotonic_ns())
                except LinkError as error:
                    self._wire.refuse(error)

        return heard
