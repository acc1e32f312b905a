"""What a process declares at a Zenoh session: subscribers, publishers and queryables, by key, until it is closed.

Zenoh calls callbacks in its own threads. No message ends them: messages that are refused are counted by reason.
"""

from __future__ import annotations

import json
import logging
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from controller.base.errors import OMOTE_ERRORS, LinkError
from controller.fleet.payload import Header

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh

log = logging.getLogger(__name__)

_MAX_REASONS = 200
"""Greatest number of different reasons of refusal that are counted."""
ALL = "_"
"""Stands in keys instead of a head's name for what is common to all heads."""


class Declared:
    """An entity that is declared at a session, and can be declared again at another one."""

    def __init__(self, session: zenoh.Session, make: Callable[[zenoh.Session], Any]) -> None:
        self._make = make
        self._held: Any = make(session)

    def made_at(self, session: zenoh.Session) -> Any:
        """Declare and return the same at another session; it is used after :meth:`hold`."""
        return self._make(session)

    def hold(self, made: Any) -> None:
        """Use what :meth:`made_at` returned; the entity before ends with its own session."""
        self._held = made

    def undeclare(self) -> None:
        """Undeclare it at Zenoh."""
        self._held.undeclare()


class Outlet(Declared):
    """A publisher, which knows whether anybody subscribes to it."""

    def put(self, data: bytes | str, **more: Any) -> None:
        """Publish data; ``more`` : options of Zenoh's publisher."""
        self._held.put(data, **more)

    @property
    def matching_status(self) -> Any:
        """Zenoh's status of whether anybody subscribes."""
        return self._held.matching_status


class Wire:
    """A session and what was declared at it.

    prefix : the beginning of all keys. refused : number of refused messages by reason.
    """

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self.session, self._prefix = session, prefix
        self.refused: Counter[str] = Counter()
        self._declared: list[Declared] = []

    def key(self, head: str, what: str) -> str:
        """Return the key of something of a head, or of :data:`ALL`."""
        return f"{self._prefix}/{head}/{what}"

    def hear(self, head: str, what: str, act: Callable[[zenoh.Sample], object], *, direct: bool = False) -> None:
        """Subscribe: call ``act`` with every message.

        direct : call it in Zenoh's receiving thread, because waking another thread takes longer than handling a face.
        """
        from zenoh.handlers import Callback  # optional

        call, key = self._guarded(act), self.key(head, what)
        self._keep(lambda session: session.declare_subscriber(key, Callback(call, indirect=not direct)))

    def answer(self, head: str, what: str, act: Callable[[zenoh.Query], object]) -> None:
        """Declare a queryable: call ``act`` with every query."""
        key = self.key(head, what)
        self._keep(lambda session: session.declare_queryable(key, act))

    def ask(self, head: str, what: str, act: Callable[[zenoh.Reply], object], timeout_s: float) -> None:
        """Send a query, and call ``act`` with every reply.

        It is called in Zenoh's own threads. By default Zenoh would start a Python thread for each query, and a thread
        that still waits for its reply when Python exits aborts the process.
        """
        from zenoh.handlers import Callback  # optional

        self.session.get(self.key(head, what), Callback(act, indirect=False), timeout=timeout_s)

    def live(self, head: str, what: str) -> None:
        """Declare a liveliness token for the lifetime of this session; its key ends with the session's id."""
        self._keep(lambda session: session.liveliness().declare_token(f"{self.key(head, what)}/{session.zid()}"))

    def outlet(self, head: str, what: str) -> Outlet:
        """Declare and return a publisher."""
        key = self.key(head, what)
        outlet = Outlet(self.session, lambda session: session.declare_publisher(key))
        self._declared.append(outlet)
        return outlet

    def outlets(self, heads: Iterable[str], what: str) -> dict[str, Outlet]:
        """Declare a publisher for each head; return them by head."""
        return {name: self.outlet(name, what) for name in heads}

    def move(self, session: zenoh.Session) -> None:
        """Declare everything at another session, use it from now on, and close the one before.

        Not for a process that sends faces meanwhile.
        """
        try:
            made = [declared.made_at(session) for declared in self._declared]
        except BaseException:
            session.close()  # type: ignore[no-untyped-call]
            raise
        for declared, held in zip(self._declared, made, strict=True):
            declared.hold(held)
        before, self.session = self.session, session
        before.close()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Undeclare everything, and close the session."""
        with ExitStack() as closers:
            closers.callback(self.session.close)
            for declared in self._declared:
                closers.callback(declared.undeclare)

    def _keep(self, make: Callable[[zenoh.Session], Any]) -> None:
        self._declared.append(Declared(self.session, make))

    def _guarded(self, act: Callable[[zenoh.Sample], object]) -> Callable[[zenoh.Sample], None]:
        def call(sample: zenoh.Sample) -> None:
            try:
                act(sample)
            except OMOTE_ERRORS as error:
                self.refuse(error)
            except Exception as error:  # noqa: BLE001  a message must not end Zenoh's thread
                log.error("zenoh %s: %s: %s", sample.key_expr, type(error).__name__, error)

        return call

    def refuse(self, error: Exception) -> None:
        """Count a refused message by the text of its error."""
        reason = str(error)
        self.refused[reason if reason in self.refused or len(self.refused) < _MAX_REASONS else "other"] += 1


def header_of(sample: zenoh.Sample) -> Header:
    """Decode the header of a message. Raises LinkError: it is missing, damaged, or of another version."""
    if sample.attachment is None:
        raise LinkError("a message without a header, which no conductor sends")
    return Header.decode(sample.attachment.to_bytes())


def reply_json(query: zenoh.Query, found: object) -> None:
    """Answer a query with JSON."""
    query.reply(query.key_expr, json.dumps(found), encoding="application/json")
