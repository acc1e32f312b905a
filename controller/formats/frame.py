"""Frames, the one thing that all decoders give and all encoders take, and what decoders have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters

MOST_REASONS = 32
"""Different reasons that a decoder counts; all others are counted together."""
_TOO_LONG = "message too long"


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One face as a source sent it.

    values : (P,) float64, in the units of the parameters, not clipped; finite where ``mask`` is set.
    mask : (P,) bool, which parameters the source gives. Both arrays belong to the frame and do not change.
    time_s : when the face was seen, on the clock of the source (s); None where the format does not say.
    sequence : number of the frame, which rises; None where the format has none.
    face : False where the source says that it sees no face; ``values`` mean nothing then.
    subject : name of who is seen, or of the device; empty where the format has none.
    to : the head or the group of heads that shall show it; empty for whom the link belongs to.
    measured : (P,) float64, what the servos show of the face; None where that is not known, or nobody asked for it.
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
    """Reads messages of one source.

    refused : how many messages, or parts of one, were left out, by reason.
    """

    refused: Refusals

    def feed(self, message: bytes) -> list[Frame]:
        """Frames that a message completes, none for most that are wrong; never raises for what a message contains."""


class Encoder(Protocol):
    """Writes messages."""

    def encode(self, frame: Frame) -> list[bytes]:
        """The messages of a frame, each one datagram, or one message of a stream without its delimiter."""


class Refusals(Counter[str]):
    """Counts of what was refused by reason; a stranger cannot make it grow without limit."""

    def add(self, reason: str) -> None:
        """Count one refusal."""
        self[reason if reason in self or len(self) < MOST_REASONS else "other"] += 1


class Held:
    """The values of a source that sends only what changes: what it does not name stays as it was."""

    def __init__(self, parameters: Parameters) -> None:
        self.values = parameters.neutral()
        self.mask = np.zeros(len(parameters), dtype=bool)

    def frame(self, **more: object) -> Frame:
        """All that was given so far."""
        return Frame(self.values.copy(), self.mask.copy(), **more)  # type: ignore[arg-type]

    def update(self, given: Mapping[int, float]) -> None:
        """Take new values by position."""
        for index, value in given.items():
            self.values[index] = value
            self.mask[index] = True


class Splitter:
    """Cuts a stream of bytes into messages at a delimiter; what is damaged ends at the next delimiter.

    delimiter : what ends a message; one byte or more. most : bytes of a message; longer ones are left out and counted.
    """

    def __init__(self, delimiter: bytes, most: int, refused: Refusals) -> None:
        self._delimiter, self._most, self._refused = delimiter, most, refused
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """The messages that ``data`` completes, without delimiters; empty ones are left out."""
        *whole, self._rest = (self._rest + data).split(self._delimiter)
        if self._skipping and whole:
            self._skipping = False
            del whole[0]
        if len(self._rest) > self._most + len(self._delimiter):
            if not self._skipping:
                self._refused.add(_TOO_LONG)
            self._skipping = True
            self._rest = self._rest[-len(self._delimiter) :]  # may hold the beginning of one
        kept = [message for message in whole if len(message) <= self._most]
        for _ in range(len(whole) - len(kept)):
            self._refused.add(_TOO_LONG)
        return [message for message in kept if message]
