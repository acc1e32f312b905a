"""Turns what receivers give into frames: a decoder for each sender, and the ends of messages in streams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from controller.base.parameters import Parameters
from controller.formats.format import Format
from controller.formats.frame import Decoder, Frame, Refusals, Splitter
from controller.links.net.receivers import Received

MOST_SENDERS = 16
"""Senders whose state is kept; the one that was silent longest is forgotten."""


@dataclass(frozen=True)
class Arrived:
    """A frame, who sent it, and how many older messages of that sender were not read."""

    sender: str
    frame: Frame
    skipped: int = 0


class Decoding:
    """Decodes what arrives at one receiver.

    newest : read only the newest message of each sender, where the format's messages are whole faces.
    streams : pieces of streams arrive, not datagrams.

    Attributes
    ----------
    refused : what was left out, by reason. messages : how many arrived.
    """

    def __init__(self, form: Format, parameters: Parameters, *, streams: bool, newest: bool = False) -> None:
        self._form, self._parameters, self._streams = form, parameters, streams
        self._newest = newest and form.whole
        self.refused = Refusals()
        self.messages = 0
        self._senders: dict[str, tuple[Decoder, Splitter]] = {}

    def feed(self, received: Received) -> list[Arrived]:
        """The frames that some datagrams or pieces of streams complete, in order."""
        arrived: list[Arrived] = []
        for sender, messages in self._by_sender(received).items():
            decoder, _ = self._senders[sender]
            if self._newest:
                arrived += self._newest_of(sender, decoder, messages)
            else:
                arrived += [Arrived(sender, frame) for each in messages for frame in decoder.feed(each)]
        return arrived

    def _by_sender(self, received: Received) -> dict[str, list[bytes]]:
        found: dict[str, list[bytes]] = {}
        for sender, data in received:
            if not data:  # its stream ended: the next one begins anew
                self._senders.pop(sender, None)
                found.pop(sender, None)
                continue
            if sender not in self._senders:
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

    @staticmethod
    def _newest_of(sender: str, decoder: Decoder, messages: list[bytes]) -> Iterator[Arrived]:
        for skipped, message in enumerate(reversed(messages)):
            frames = decoder.feed(message)
            if frames:
                yield Arrived(sender, frames[-1], len(messages) - 1 - skipped)
                return
