"""Base class of stream readers that cut received bytes into frames and resynchronise after noise or damage."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Generic, TypeVar

P = TypeVar("P")


class FrameReader(ABC, Generic[P]):
    """Finds frames whose length and checksum are right in a byte stream, and decodes them to packets.

    MARK : what every frame begins with.
    noise_bytes : bytes thrown away because they belong to no valid frame.
    broken_frames : frames whose length or checksum was wrong.
    """

    MARK: ClassVar[bytes]

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.noise_bytes = 0
        self.broken_frames = 0

    @abstractmethod
    def _next(self) -> bytes | None:
        """Remove and return the next whole frame of the buffer, and drop what cannot begin one; None: none yet."""

    @abstractmethod
    def _decode(self, frames: list[bytes]) -> list[P]:
        """The packets in whole frames."""

    @property
    def pending(self) -> int:
        """Bytes held back because the frame they begin is not complete."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[P]:
        """Add received bytes; return the packets completed by them."""
        return self._decode(self.feed_frames(data))

    def flush(self) -> list[P]:
        """Give up on the incomplete frame (the sender paused); return valid packets found behind its beginning."""
        frames = []
        while self._buffer:
            self.broken_frames += self._buffer.startswith(self.MARK)
            self._drop(1)
            frames += self.feed_frames(b"")
        return self._decode(frames)

    def feed_frames(self, data: bytes) -> list[bytes]:
        """Add received bytes; return the raw frames completed by them."""
        self._buffer += data
        frames = []
        while (frame := self._next()) is not None:
            frames.append(frame)
        return frames

    def take_pending(self) -> bytes:
        """Remove and return the incomplete bytes, for instance of a joint reply cut short."""
        data = bytes(self._buffer)
        self._buffer.clear()
        return data

    def _drop(self, count: int) -> None:
        self.noise_bytes += count
        del self._buffer[:count]
