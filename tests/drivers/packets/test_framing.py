"""drivers.packets.framing: frames are cut out of noise, and every byte that belongs to none is counted."""

from __future__ import annotations

import pytest

from drivers.packets.framing import FrameReader


class Lines(FrameReader[str]):
    """Frames of one format made up for this test: ``<`` text ``>``, at most six bytes."""

    MARK = b"<"

    def _next(self) -> bytes | None:
        begin = self._buffer.find(b"<")
        self._drop(len(self._buffer) if begin < 0 else begin)
        end = self._buffer.find(b">")
        if end < 0:
            return None
        frame = bytes(self._buffer[: end + 1])
        del self._buffer[: end + 1]
        return frame

    def _decode(self, frames: list[bytes]) -> list[str]:
        return [frame[1:-1].decode() for frame in frames]


@pytest.fixture
def reader() -> Lines:
    return Lines()


def test_frames_come_out_however_the_bytes_arrive(reader: Lines) -> None:
    assert reader.feed(b"<a><b") == ["a"]
    assert reader.pending == 2
    assert reader.feed(b"c>") == ["bc"]
    assert (reader.pending, reader.noise_bytes, reader.broken_frames) == (0, 0, 0)


def test_raw_frames_are_those_that_decode(reader: Lines) -> None:
    assert reader.feed_frames(b"xy<a>z<b>") == [b"<a>", b"<b>"]
    assert reader.noise_bytes == 3


def test_giving_up_counts_the_broken_frame_and_finds_those_behind_it(reader: Lines) -> None:
    reader.feed(b"<ab")
    reader._buffer += b"<c>"  # a whole frame inside one that never ended
    assert reader.flush() == ["c"]
    assert (reader.broken_frames, reader.noise_bytes, reader.pending) == (1, 3, 0)
    assert reader.flush() == []
    assert reader.broken_frames == 1


def test_pending_bytes_can_be_taken_out(reader: Lines) -> None:
    reader.feed(b"<a><bc")
    assert reader.take_pending() == b"<bc"
    assert (reader.pending, reader.noise_bytes) == (0, 0)
    assert reader.feed(b"d>") == []
    assert reader.noise_bytes == 2
