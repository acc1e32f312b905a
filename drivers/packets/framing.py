"""A byte stream cut into frames, whatever the protocol: what is kept, what is thrown away, and when one gives up.

What begins a frame, how long it is and whether it is whole, says the protocol (``dynamixel/packet`` and ``packet1``).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar


class FrameReader(ABC):
    """Cuts a byte stream into frames whose length and checksum are right, whatever lies between them.

    Attributes
    ----------
    MARK : what every frame begins with.
    noise_bytes : bytes thrown away because they belong to no valid frame.
    broken_frames : frames begun whose length or checksum was wrong.
    """

    MARK: ClassVar[bytes]

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.noise_bytes = 0
        self.broken_frames = 0

    @abstractmethod
    def _next(self) -> bytes | None:
        """Take the next whole frame out of the buffer, and drop what cannot begin one; None when there is none yet."""

    @property
    def pending(self) -> int:
        """Bytes held back because the frame they begin is not complete."""
        return len(self._buffer)

    def feed_frames(self, data: bytes) -> list[bytes]:
        """Add received bytes; return the frames completed by them as they came."""
        self._buffer += data
        frames = []
        while (frame := self._next()) is not None:
            frames.append(frame)
        return frames

    def flush_frames(self) -> list[bytes]:
        """Give up on the incomplete frame (the sender paused); return valid frames found behind its beginning."""
        frames = []
        while self._buffer:
            self.broken_frames += self._buffer.startswith(self.MARK)
            self._drop(1)
            frames += self.feed_frames(b"")
        return frames

    def take_pending(self) -> bytes:
        """Remove and return the incomplete bytes, for instance of a joint reply cut short."""
        data = bytes(self._buffer)
        self._buffer.clear()
        return data

    def _drop(self, count: int) -> None:
        self.noise_bytes += count
        del self._buffer[:count]
