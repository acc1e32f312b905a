"""Defines the frame (one face that decoders return and encoders take) and what decoders share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters

MAX_REASONS = 32
"""Greatest number of different reasons that a decoder counts; further ones are counted together as "other"."""
_TOO_LONG = "message too long"


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One face as a source sent it.

    values : (P,) float64, in the units of the parameters, not clipped; finite where ``mask`` is set.
    mask : (P,) bool, which parameters the source gives. Both arrays belong to the frame and do not change.
    time_s : when the face was seen, on the clock of the source (s); None if the format does not say.
    sequence : increasing number of the frame; None if the format has none.
    face : False if the source reports that it sees no face; ``values`` have no meaning then.
    subject : name of the person seen, or of the device; empty if the format has none.
    to : the head or group of heads that the frame is for; empty for the head that the link belongs to.
    measured : (P,) float64, the face that the servos show; None if that is not known or not wanted.
    """

    values: Floats
    mask: Flags
    time_s: float | None = None
    sequence: int | None = None
    face: bool = True
    subject: str = ""
    measured: Floats | None = None
    to: str = ""


class Decoder(Protocol):
    """Decodes the messages of one source.

    refused : number of messages, or parts of messages, that were left out, by reason.
    """

    refused: Refusals

    def feed(self, message: bytes) -> list[Frame]:
        """Return the frames that a message completes; an invalid message is counted in ``refused`` and never raises."""


class Encoder(Protocol):
    """Encodes frames as messages."""

    def encode(self, frame: Frame) -> list[bytes]:
        """Return the messages of a frame, each one datagram, or one message of a stream without its delimiter."""


class Refusals(Counter[str]):
    """Counts refusals by reason. It stays small whatever a sender sends: see :data:`MAX_REASONS`."""

    def add(self, reason: str) -> None:
        """Count one refusal."""
        self[reason if reason in self or len(self) < MAX_REASONS else "other"] += 1


class Held:
    """The latest values of a source that sends only changes: parameters that a message does not name keep theirs."""

    def __init__(self, parameters: Parameters) -> None:
        self.values = parameters.neutral()
        self.mask = np.zeros(len(parameters), dtype=bool)

    def frame(self, **more: object) -> Frame:
        """Return a frame of all values received so far; ``more`` : further fields of the frame."""
        return Frame(self.values.copy(), self.mask.copy(), **more)  # type: ignore[arg-type]

    def update(self, given: Mapping[int, float]) -> None:
        """Store new values by parameter index."""
        for index, value in given.items():
            self.values[index] = value
            self.mask[index] = True


class Splitter:
    """Splits a stream of bytes into messages at a delimiter, so that damage ends at the next delimiter.

    delimiter : ends each message; one byte or more. max_bytes : longer messages are left out and counted in
    ``refused``.
    """

    def __init__(self, delimiter: bytes, max_bytes: int, refused: Refusals) -> None:
        self._delimiter, self._max_bytes, self._refused = delimiter, max_bytes, refused
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """Return the messages that ``data`` completes, without delimiters; empty ones are left out."""
        *whole, self._rest = (self._rest + data).split(self._delimiter)
        if self._skipping and whole:
            self._skipping = False
            del whole[0]
        if len(self._rest) > self._max_bytes + len(self._delimiter):
            if not self._skipping:
                self._refused.add(_TOO_LONG)
            self._skipping = True
            self._rest = self._rest[-len(self._delimiter) :]  # may hold the beginning of a delimiter
        kept = [message for message in whole if len(message) <= self._max_bytes]
        for _ in range(len(whole) - len(kept)):
            self._refused.add(_TOO_LONG)
        return [message for message in kept if message]
