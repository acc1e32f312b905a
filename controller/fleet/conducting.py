"""The network side of a conductor: it holds the lease, sends faces, receives commands and publishes their effects."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from controller.base.errors import LinkError
from controller.base.parameters import Floats
from controller.fleet import journal
from controller.fleet.lease import Lease, Token
from controller.fleet.payload import MAX_NUMBER, Header, Payloads
from controller.fleet.sending import FaceSender
from controller.fleet.wire import ALL, Wire, header_of
from controller.layers.commands import CommandState
from controller.links.line.protocol import is_stop
from controller.links.line.session import LineSession

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh

_HEARTBEATS_PER_LEASE = 5


class Conducting:
    """The lease, faces and commands of a process that conducts, or is a standby.

    heads : the command state of each head, by its name. events : how many commands of another conductor were
    received, by head.
    """

    def __init__(
        self, wire: Wire, heads: Mapping[str, CommandState], payloads: Payloads, lease: Lease, lease_s: float,
        events: Counter[str],
    ) -> None:  # fmt: skip
        self._events = events
        self._wire, self._heads, self._lease = wire, heads, lease
        self._heartbeat_interval_s = lease_s / _HEARTBEATS_PER_LEASE
        self._heartbeat_s, self._term = -1.0, 0
        self.sender = FaceSender(wire.outlets(heads, "parameters"), wire.outlet(ALL, "faces"), payloads, self._header)
        wire.hear(ALL, "lease", self._hear_lease)
        wire.hear(ALL, "state", self._hear_state)
        wire.answer(ALL, "clock", self._tell_time)
        for name, state in heads.items():
            wire.hear(name, "commands", self._command_of(name))
            wire.answer(name, "commands", self._question_of(name))
            wire.hear(name, "events", self._event_of(name))
            state.on_event = self._tell(name)

    def tick(self, now_ns: int) -> bool:
        """Return whether this process conducts, and if so, send a heartbeat when due. Call it before each mixing."""
        if not self._lease.tick(now_ns * 1e-9):
            return False
        if self._term != self._lease.terms:
            self._term = self._lease.terms
            self.sender.begin(now_ns)
        if now_ns * 1e-9 - self._heartbeat_s > self._heartbeat_interval_s:
            self._heartbeat_s = now_ns * 1e-9
            header = self._header(now_ns=now_ns).encode()
            self._wire.session.put(self._wire.key(ALL, "lease"), b"", attachment=header, express=True)
        return True

    def send(self, head: str, now_ns: int, values: Floats, stamp_ns: int) -> None:
        """Send the face ``values`` : (P,) of a head, of the tick that was due at ``now_ns``."""
        self.sender.send(head, now_ns, values, stamp_ns)

    def close(self) -> None:
        """Stop publishing commands."""
        for state in self._heads.values():
            state.on_event = None

    def _header(self, sequence: int = 0, now_ns: int = 0, stamp_ns: int = 0) -> Header:
        stopped = any(state.stop_latch.stopped is not None for state in self._heads.values())
        return Header(self._lease.token, sequence, now_ns or time.monotonic_ns(), stamp_ns, stopped)

    def _hear_lease(self, sample: zenoh.Sample) -> None:
        self._lease.hear(header_of(sample).token, time.monotonic())

    def _hear_state(self, sample: zenoh.Sample) -> None:
        try:
            fence, holder = json.loads(sample.payload.to_bytes())["token"]
            token = Token(int(fence), int(holder))
        except (ValueError, TypeError, KeyError, OverflowError) as error:
            raise LinkError("a malformed state") from error
        if token.fence > MAX_NUMBER:
            raise LinkError("a state with a fencing token out of range")
        self._lease.hear(token, time.monotonic(), alive=False)

    def _tell_time(self, query: zenoh.Query) -> None:
        received = time.monotonic_ns()
        if self._lease.active:
            query.reply(query.key_expr, json.dumps([received, time.monotonic_ns(), self._lease.holder]))

    def _lines_of(self, head: str) -> LineSession:
        """Return a new line session for a head. Each thread of Zenoh needs its own, or lines would be interleaved."""
        return LineSession(self._heads[head], 0, name=f"zenoh {head}")

    def _command_of(self, head: str) -> Callable[[zenoh.Sample], None]:
        lines = self._lines_of(head)

        def act(sample: zenoh.Sample) -> None:
            self._do(lines, sample.payload.to_bytes())

        return act

    def _do(self, lines: LineSession, data: bytes) -> bytes:
        """Carry out command lines for a head and return the answers. Unless this process conducts, only STOP works."""
        text = data[:4096].rstrip(b"\r\n") + b"\n"
        if not self._lease.active:
            text = b"".join(line for line in text.splitlines(keepends=True) if is_stop(line))
        return lines.feed(text, time.monotonic_ns()) if text else b""

    def _question_of(self, head: str) -> Callable[[zenoh.Query], None]:
        lines = self._lines_of(head)

        def call(query: zenoh.Query) -> None:
            if query.payload is not None and self._lease.active:
                query.reply(query.key_expr, self._do(lines, query.payload.to_bytes()))

        return call

    def _event_of(self, head: str) -> Callable[[zenoh.Sample], None]:
        def act(sample: zenoh.Sample) -> None:
            header = header_of(sample)
            if header.token.holder != self._lease.holder and header.token >= self._lease.highest:
                state, on_event = self._heads[head], self._heads[head].on_event
                self._events[head] += 1
                state.on_event = None  # a command of another conductor must not be published again
                try:
                    journal.apply(sample.payload.to_bytes(), state, time.monotonic_ns())
                finally:
                    state.on_event = on_event

        return act

    def _tell(self, head: str) -> Callable[..., None]:
        key = self._wire.key(head, "events")

        def tell(method: str, *arguments: Any) -> None:
            data = journal.encode(method, arguments) if self._lease.active else None
            if data is not None:
                header = self._header().encode()
                self._wire.session.put(key, data, encoding="application/json", attachment=header)

        return tell
