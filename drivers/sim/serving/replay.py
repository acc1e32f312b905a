"""A recorded bus as the far end of a simulated one: each request gets the answers that it got when it was recorded."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import Any

from drivers.base.errors import DriverError
from drivers.core.trafficlog import Piece, TrafficRecord, Wire
from drivers.packets.framing import FrameReader
from drivers.packets.packet import Instruction, InstructionReader
from drivers.packets.packet1 import Reader1
from drivers.sim.wire.line import BufferingReader, Line, Reader
from drivers.sim.wire.timing import Reply
from drivers.tables.tables import load_table

Answers = list[tuple[float, bytes]]
"""Pieces of an answer, each with the seconds since the piece before it, or since the request."""
STATUS_AT = 7
"""Place of the instruction in a frame of Protocol 2.0."""


def frame_reader(wire: Wire) -> FrameReader[Any] | None:
    """What cuts requests on a wire into packets; None where none is known, or both are there."""
    protocols = {load_table(model).protocol for model in [*wire.servos.values(), wire.model] if model}
    if len(protocols) != 1:
        return None
    return InstructionReader() if protocols == {2} else Reader1()


class _Frames(BufferingReader):
    """Whole packets as bytes."""

    def __init__(self, reader: FrameReader[Any]) -> None:
        super().__init__()
        self._reader = reader

    @property
    def pending(self) -> int:
        return self._reader.pending

    def feed(self, data: bytes) -> list[bytes]:
        """Packets completed by these bytes."""
        return self._reader.feed_frames(data)

    def take_pending(self) -> bytes:
        return self._reader.take_pending()


class _Chunks(BufferingReader):
    """Requests that were recorded, wherever they begin; other bytes are passed over."""

    def __init__(self, known: Iterable[bytes]) -> None:
        super().__init__()
        self._known = sorted({chunk for chunk in known if chunk}, key=len, reverse=True)

    def feed(self, data: bytes) -> list[bytes]:
        """Requests completed by these bytes."""
        self._buffer += data
        found = []
        while self._buffer:
            chunk = next((chunk for chunk in self._known if self._buffer.startswith(chunk)), None)
            if chunk is not None:
                found.append(chunk)
            elif any(chunk.startswith(self._buffer) for chunk in self._known):
                break
            self._buffer = self._buffer[len(chunk) if chunk else 1 :]
        return found


class Replay(Line):
    """Answers as in a record: the first time a request comes its first answer, then the next; at the end the last.

    A request that was not recorded gets no answer.

    requests, unknown : requests so far, and those of them that are not in the record.

    Raises DriverError: the record does not say who sent what, or has no request.
    """

    def __init__(self, record: TrafficRecord, seed: int = 0) -> None:
        self.requests = self.unknown = 0
        self._wire = record.wire
        self._answers = _answers(record)
        self._used: Counter[bytes] = Counter()
        super().__init__(seed, kinds=("echo", "slow-reader", "unplug"))

    def make_reader(self) -> Reader:
        reader = frame_reader(self._wire)
        return _Chunks(self._answers) if reader is None else _Frames(reader)

    def carry_out(self, packet: bytes, now_s: float) -> list[Reply]:
        """The answers that this request got, as late as they came."""
        self.requests += 1
        known = self._answers.get(packet)
        if known is None:
            self.unknown += 1
            return []
        answers = known[min(self._used[packet], len(known) - 1)]
        self._used[packet] += 1
        return [Reply(data, None, late_s) for late_s, data in answers]

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """How many requests came, and how many of them are not in the record."""
        return [{"requests": self.requests, "not recorded": self.unknown}]


def _answers(record: TrafficRecord) -> dict[bytes, list[Answers]]:
    """The answers to each request, in the order of the record."""
    found: defaultdict[bytes, list[Answers]] = defaultdict(list)
    reader, last_s = frame_reader(record.wire), 0.0
    open_answer: Answers = []
    for piece in record.pieces:
        for sent, data in _requests_and_answers(piece, reader):
            if sent:
                open_answer = []
                found[data].append(open_answer)
            elif found:
                open_answer.append((piece.time_s - last_s, data))
            last_s = piece.time_s
    if not found:
        raise DriverError("the record has no request, so nothing could be answered", hint="record a bus in use")
    return dict(found)


def _requests_and_answers(piece: Piece, reader: FrameReader[Any] | None) -> list[tuple[bool, bytes]]:
    """(sent by the host, bytes) of each request in a piece of the record, or of the answer that the piece is."""
    if piece.sent is False:
        return [(False, piece.data)]
    if piece.sent is True:
        frames = [piece.data] if reader is None else reader.feed_frames(piece.data)
        return [(True, frame) for frame in frames]
    if not isinstance(reader, InstructionReader):
        raise DriverError(
            "the record does not say what the host sent", hint="record with `omote monitor PORT --record FILE`"
        )
    return [(frame[STATUS_AT] != Instruction.STATUS, frame) for frame in reader.feed_frames(piece.data)]
