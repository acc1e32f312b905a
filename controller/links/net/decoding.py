"""Turns received bytes into frames (faces), with a decoder for each sender and a splitter for each stream."""

from __future__ import annotations

from dataclasses import dataclass

from controller.base.parameters import Parameters
from controller.formats.format import Format
from controller.formats.frame import Decoder, Frame, Refusals, Splitter
from controller.links.net.receivers import Received

MAX_SENDERS = 16
"""Number of senders whose state is kept; a further one replaces the one that has been silent longest."""

MAX_WAITING, MAX_WAITING_BYTES = 64, 65_536
"""Of one sender's waiting messages, older ones are skipped only when both the count and the size are exceeded."""


@dataclass(frozen=True)
class Arrived:
    """A frame, its sender, and how many older messages of that sender were skipped."""

    sender: str
    frame: Frame
    skipped: int = 0


class Decoding:
    """Decodes what arrives at one receiver.

    streams : whether pieces of streams arrive, not datagrams. newest : whether to skip old messages of a sender that
    sends more than can be decoded.

    Attributes
    ----------
    refused : number of messages or parts that were left out, by reason. messages : number of messages that arrived.
    """

    def __init__(self, form: Format, parameters: Parameters, *, streams: bool, newest: bool = False) -> None:
        self._form, self._parameters, self._streams = form, parameters, streams and not form.pieces
        self._newest = newest
        self.refused = Refusals()
        self.messages = 0
        self._senders: dict[str, tuple[Decoder, Splitter]] = {}

    def feed(self, received: Received) -> list[Arrived]:
        """Return the frames that datagrams or pieces of streams complete; those of each sender are in order."""
        arrived: list[Arrived] = []
        for sender, messages in self._by_sender(received).items():
            decoder, _ = self._senders[sender]
            skipped = _count_stale(messages) if self._newest else 0
            frames = [frame for message in messages[skipped:] for frame in decoder.feed(message)]
            arrived += [Arrived(sender, frame, 0 if n else skipped) for n, frame in enumerate(frames)]
        return arrived

    def _by_sender(self, received: Received) -> dict[str, list[bytes]]:
        found: dict[str, list[bytes]] = {}
        for sender, data in received:
            if not data:  # the stream has ended: the next one of this sender needs a new decoder
                self._senders.pop(sender, None)
                found.pop(sender, None)
                continue
            if sender in self._senders:
                self._senders[sender] = self._senders.pop(sender)  # keeps them sorted by their last message
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
        if len(self._senders) >= MAX_SENDERS:
            del self._senders[next(iter(self._senders))]
        decoder = self._form.decoder(self._parameters)
        decoder.refused = self.refused
        self._senders[sender] = decoder, Splitter(self._form.delimiter or b"\n", self._form.most, self.refused)


def _count_stale(messages: list[bytes]) -> int:
    """Return how many of the oldest messages to skip, so that decoding a flood takes bounded time."""
    size = 0
    for back, message in enumerate(reversed(messages)):
        size += len(message)
        if back >= MAX_WAITING and size > MAX_WAITING_BYTES:
            return len(messages) - back
    return 0
