"""What a process declares at Zenoh: subscribers, publishers and answers, by keys, until it is closed.

Callbacks of Zenoh run in its own threads; nothing that arrives ends them: what is refused is counted by its reason.
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

_REFUSED = 200
"""Kinds of refusals that are counted, at most."""
ALL = "_"
"""In a key in place of a head: what belongs to all of them."""


class Declared:
    """Something that is declared at a session, and can be declared at another one."""

    def __init__(self, session: zenoh.Session, make: Callable[[zenoh.Session], Any]) -> None:
        self._make = make
        self._held: Any = make(session)

    def made_at(self, session: zenoh.Session) -> Any:
        """The same at another session; it counts from :meth:`hold` on."""
        return self._make(session)

    def hold(self, made: Any) -> None:
        """Use what was made at another session; what was held ends with its own session."""
        self._held = made

    def undeclare(self) -> None:
        """Take it back."""
        self._held.undeclare()


class Outlet(Declared):
    """What sends something, and knows whether anybody listens."""

    def put(self, data: bytes | str, **more: Any) -> None:
        """Send something; ``more`` as Zenoh's own publisher takes it."""
        self._held.put(data, **more)

    @property
    def matching_status(self) -> Any:
        """Whether anybody listens, as Zenoh says it."""
        return self._held.matching_status


class Wire:
    """A session and what was declared at it. prefix : the beginning of all keys.

    refused : how many messages were refused, by reason.
    """

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self.session, self._prefix = session, prefix
        self.refused: Counter[str] = Counter()
        self._declared: list[Declared] = []

    def key(self, head: str, what: str) -> str:
        """The key of something of a head, or of :data:`ALL`."""
        return f"{self._prefix}/{head}/{what}"

    def hear(self, head: str, what: str, act: Callable[[zenoh.Sample], object], *, direct: bool = False) -> None:
        """Call ``act`` with every message; ``direct`` : in Zenoh's receiving thread, as waking another one costs more
        than a face."""
        from zenoh.handlers import Callback  # optional

        call, key = self._guarded(act), self.key(head, what)
        self._keep(lambda session: session.declare_subscriber(key, Callback(call, indirect=not direct)))

    def answer(self, head: str, what: str, act: Callable[[zenoh.Query], object]) -> None:
        """Call ``act`` with every query."""
        key = self.key(head, what)
        self._keep(lambda session: session.declare_queryable(key, act))

    def ask(self, head: str, what: str, act: Callable[[zenoh.Reply], object], timeout_s: float) -> None:
        """Ask whoever answers, and call ``act`` with every reply.

        It is called in Zenoh's own threads. With a thread of Python's for each question, which Zenoh would start, one
        that waits for its reply when Python ends aborts the process.
        """
        from zenoh.handlers import Callback  # optional

        self.session.get(self.key(head, what), Callback(act, indirect=False), timeout=timeout_s)

    def live(self, head: str, what: str) -> None:
        """A token that is there as long as this process; its key ends with the number of the session."""
        self._keep(lambda session: session.liveliness().declare_token(f"{self.key(head, what)}/{session.zid()}"))

    def outlet(self, head: str, what: str) -> Outlet:
        """What sends something, and knows whether anybody listens."""
        key = self.key(head, what)
        outlet = Outlet(self.session, lambda session: session.declare_publisher(key))
        self._declared.append(outlet)
        return outlet

    def outlets(self, heads: Iterable[str], what: str) -> dict[str, Outlet]:
        """An outlet of each head."""
        return {name: self.outlet(name, what) for name in heads}

    def move(self, session: zenoh.Session) -> None:
        """Declare everything at another session, use that from now on, and end the one before. Not for a process that
        sends faces meanwhile."""
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
        """Take back what was declared, and end the session."""
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
            except Exception as error:  # noqa: BLE001  as above
                log.error("zenoh %s: %s: %s", sample.key_expr, type(error).__name__, error)

        return call

    def refuse(self, error: Exception) -> None:
        """Count what was refused."""
        reason = str(error)
        self.refused[reason if reason in self.refused or len(self.refused) < _REFUSED else "other"] += 1


def header_of(sample: zenoh.Sample) -> Header:
    """Raises LinkError: none, damaged, or of another version."""
    if sample.attachment is None:
        raise LinkError("a message without a header, which is of no conductor")
    return Header.decode(sample.attachment.to_bytes())


def reply_json(query: zenoh.Query, found: object) -> None:
    """Answer a query."""
    query.reply(query.key_expr, json.dumps(found), encoding="application/json")
