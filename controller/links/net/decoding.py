"""Turns what receivers give into frames: a decoder for each sender, and the ends of messages in streams."""

from __future__ import annotations

from dataclasses import dataclass

from controller.base.parameters import Parameters
from controller.formats.format import Format
from controller.formats.frame import Decoder, Frame, Refusals, Splitter
from controller.links.net.receivers import Received

MOST_SENDERS = 16
"""Senders whose state is kept; the one that was silent longest is forgotten."""

MOST_WAITING, MOST_WAITING_BYTES = 64, 65_536
"""Messages of one sender that are read at once; more where they are small."""


@dataclass(frozen=True)
class Arrived:
    """A frame, who sent it, and how many older messages of that sender were not read."""

    sender: str
    frame: Frame
    skipped: int = 0


class Decoding:
    """Decodes what arrives at one receiver.

    newest : decode only the newest of the messages that waited for each sender; without it, all of them.
    streams : pieces of streams arrive, not datagrams.

    Attributes
    ----------
    refused : what was left out, by reason. messages : how many arrived.
    """

    def __init__(self, form: Format, parameters: Parameters, *, streams: bool, newest: bool = False) -> None:
        self._form, self._parameters, self._streams = form, parameters, streams and not form.pieces
        self._newest = newest
        self.refused = Refusals()
        self.messages = 0
        self._senders: dict[str, tuple[Decoder, Splitter]] = {}

    def feed(self, received: Received) -> list[Arrived]:
        """The frames that some datagrams or pieces of streams complete, in order."""
        arrived: list[Arrived] = []
        for sender, messages in self._by_sender(received).items():
            decoder, _ = self._senders[sender]
            skipped = _too_old(messages) if self._newest else 0
            frames = [frame for message in messages[skipped:] for frame in decoder.feed(message)]
            arrived += [Arrived(sender, frame, 0 if n else skipped) for n, frame in enumerate(frames)]
        return arrived

    def _by_sender(self, received: Received) -> dict[str, list[bytes]]:
        found: dict[str, list[bytes]] = {}
        for sender, data in received:
            if not data:  # its stream ended: the next one starts from its beginning
                self._senders.pop(sender, None)
                found.pop(sender, None)
                continue
            if sender in self._senders:
                self._senders[sender] = self._senders.pop(sender)  # the last of them is the one that sent last
            else:
                self._add(sender)
            messages = self._messages(sender, data)
            self.messages += len(messages)
            found.setdefault(sender, []).extend(messages)
        return {sender: messages for sender, messages in found.items() if sender in self._senders}

    def _messages(self, sender: str, data: bytes) -> list[bytes]:
        if self._streams:
            return self._senders[sender][1].feed(data)
        if len(data) > self._form.most:
            self.refused.add("message too long")
            return []
        return [data]

    def _add(self, sender: str) -> None:
        if len(self._senders) >= MOST_SENDERS:
            del self._senders[next(iter(self._senders))]
        decoder = self._form.decoder(self._parameters)
        decoder.refused = self.refused
        self._senders[sender] = decoder, Splitter(self._form.delimiter or b"\n", self._form.most, self.refused)


def _too_old(messages: list[bytes]) -> int:
    """How many messages are left out, so that a flood costs bounded time: what is newest is always read."""
    size = 0
    for back, message in enumerate(reversed(messages)):
        size += len(message)
        if back >= MOST_WAITING and size > MOST_WAITING_BYTES:
            return len(messages) - back
    return 0
