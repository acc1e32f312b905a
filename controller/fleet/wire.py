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


class Wire:
    """A session and what was declared at it. prefix : the beginning of all keys.

    refused : how many messages were refused, by reason.
    """

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self.session, self._prefix = session, prefix
        self.refused: Counter[str] = Counter()
        self._closers = ExitStack()
        self._closers.callback(session.close)

    def key(self, head: str, what: str) -> str:
        """The key of something of a head, or of :data:`ALL`."""
        return f"{self._prefix}/{head}/{what}"

    def hear(self, head: str, what: str, act: Callable[[zenoh.Sample], object], *, direct: bool = False) -> None:
        """Call ``act`` with every message; ``direct`` : in Zenoh's receiving thread, as waking another one costs more
        than a face."""
        from zenoh.handlers import Callback  # optional

        call = self._guarded(act)
        self._keep(self.session.declare_subscriber(self.key(head, what), Callback(call, indirect=not direct)))

    def answer(self, head: str, what: str, act: Callable[[zenoh.Query], object]) -> None:
        """Call ``act`` with every query."""
        self._keep(self.session.declare_queryable(self.key(head, what), act))

    def live(self, head: str, what: str) -> None:
        """A token that is there as long as this process."""
        self._keep(self.session.liveliness().declare_token(self.key(head, what)))

    def outlet(self, head: str, what: str) -> zenoh.Publisher:
        """What sends something, and knows whether anybody listens."""
        publisher = self.session.declare_publisher(self.key(head, what))
        self._keep(publisher)
        return publisher

    def outlets(self, heads: Iterable[str], what: str) -> dict[str, zenoh.Publisher]:
        """An outlet of each head."""
        return {name: self.outlet(name, what) for name in heads}

    def close(self) -> None:
        """Take back what was declared, and end the session."""
        self._closers.close()

    def _keep(self, declared: Any) -> None:
        self._closers.callback(declared.undeclare)

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
