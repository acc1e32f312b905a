"""Packets of many servos at once, for the cycle: goals put into a frame made before, all replies checked in one go.

What is not exactly as expected (a reply missing, late, damaged or stuffed) is not decoded here: ``None`` sends the
caller to the careful readers in ``packet`` and ``sdk``.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel.packet import (
    BROADCAST_ID,
    HEADER,
    Instruction,
    crc16,
    encode_fast_head,
    encode_instruction,
    fast_reply_size,
)

Octets = NDArray[np.uint8]

HEAD_SIZE = 8
"""Bytes of a status packet before its error byte."""
STATUS_SIZE = 11
"""Bytes of a status packet without data."""
_ROWS_AT = 12
"""Where the rows of a sync write begin: behind the header, INST, address and length."""


class GoalFrame:
    """A sync write of one register to the same servos every cycle: only the values change.

    Parameters
    ----------
    ids : k servo ids.
    address, size : the register; 2 or 4 bytes.
    """

    def __init__(self, ids: Sequence[int], address: int, size: int) -> None:
        from drivers.kernels import crc_span  # compiled: only who drives servos pays for it

        self._crc_span = crc_span
        self._rows = np.zeros(len(ids), dtype=[("id", "u1"), ("goal", f"<i{size}")])
        self._rows["id"] = ids
        self._head = bytes((address & 0xFF, address >> 8, size & 0xFF, size >> 8))
        frame = encode_instruction(BROADCAST_ID, Instruction.SYNC_WRITE, self._head + self._rows.tobytes())
        self._frame = bytearray(frame)
        self._state = crc16(frame[:_ROWS_AT])
        self._bytes = np.frombuffer(self._frame, np.uint8)
        self.encode(np.zeros(len(ids), np.int32))  # compiles, so that no cycle has to wait for that

    def encode(self, values: NDArray[np.integer]) -> bytes:
        """The packet for these values, ``(k,)``, stuffed where they need it."""
        self._rows["goal"] = values
        rows = self._rows.tobytes()
        if HEADER in rows:
            return encode_instruction(BROADCAST_ID, Instruction.SYNC_WRITE, self._head + rows)
        frame = self._frame
        frame[_ROWS_AT:-2] = rows
        crc = self._crc_span(self._bytes, _ROWS_AT, len(frame) - 2, self._state)
        frame[-2], frame[-1] = crc & 0xFF, crc >> 8
        return bytes(frame)


class Run(NamedTuple):
    """Servos of which the same bytes are read: `ids`, first `address` and `length`."""

    ids: tuple[int, ...]
    address: int
    length: int

    def among(self, ids: Collection[int]) -> Run:
        """The same of those of its servos that are among `ids`."""
        return self._replace(ids=tuple(servo for servo in self.ids if servo in ids))


class Rows(NamedTuple):
    """Replies of the servos of one run, in its order: `errors` (k,) and `data` (k, length), uint8."""

    errors: Octets
    data: Octets


class GroupRead:
    """A read of many servos that is asked again and again: one sync read, or a bulk read where addresses differ.

    Parameters
    ----------
    runs : who is asked for what.
    fast : all of them answer in one joint packet.

    Attributes
    ----------
    frame : the instruction.
    wanted : data bytes expected by id, in the order of the replies.
    size : bytes of all replies, not stuffed.
    """

    def __init__(self, runs: Sequence[Run], fast: bool = False) -> None:
        from drivers.kernels import check_joint, check_replies  # compiled: only who drives servos pays for it

        self._check_replies, self._check_joint = check_replies, check_joint
        self.runs, self.fast = tuple(runs), fast
        self.ids = tuple(servo for run in runs for servo in run.ids)
        self.wanted = {servo: run.length for run in runs for servo in run.ids}
        self.frame = self._sync() if len(runs) == 1 else self._bulk()
        sizes = [len(run.ids) * ((4 if fast else STATUS_SIZE) + run.length) for run in runs]
        self.size = fast_reply_size(self.wanted.values()) if fast else sum(sizes)
        self._spans = []  # where each run begins, and the bytes of each of its replies
        begin = HEAD_SIZE if fast else 0
        for run, size in zip(runs, sizes, strict=True):
            self._spans.append((begin, size // len(run.ids)))
            begin += size
        self._joint = encode_fast_head(list(self.wanted.values()))
        self._joint_state = crc16(self._joint)
        self._ids = [np.array(run.ids, np.uint8) for run in runs]
        self._heads = [] if fast else [_status_heads(run) for run in runs]

    def _sync(self) -> bytes:
        (run,) = self.runs
        kind = Instruction.FAST_SYNC_READ if self.fast else Instruction.SYNC_READ
        return encode_instruction(BROADCAST_ID, kind, _words(run.address, run.length) + bytes(run.ids))

    def _bulk(self) -> bytes:
        kind = Instruction.FAST_BULK_READ if self.fast else Instruction.BULK_READ
        entries = [bytes((servo,)) + _words(run.address, run.length) for run in self.runs for servo in run.ids]
        return encode_instruction(BROADCAST_ID, kind, b"".join(entries))

    def decode(self, data: bytes) -> list[Rows] | None:
        """What the servos of each run said, where `data` is exactly what was asked for; else None."""
        if len(data) != self.size:
            return None
        octets = np.frombuffer(data, np.uint8)
        if not (self._joint_is_right(data, octets) if self.fast else self._all_are_right(data, octets)):
            return None
        at = 2 if self.fast else HEAD_SIZE + 1
        replies = []
        for run, (begin, size) in zip(self.runs, self._spans, strict=True):
            rows = octets[begin : begin + size * len(run.ids)].reshape(-1, size)
            replies.append(Rows(rows[:, at - (2 if self.fast else 1)], rows[:, at:-2]))
        return replies

    def _all_are_right(self, data: bytes, octets: Octets) -> bool:
        if data.count(HEADER) != len(self.ids):  # some data is stuffed
            return False
        for (begin, size), (heads, states) in zip(self._spans, self._heads, strict=True):
            if not self._check_replies(octets, begin, heads, states, size):
                return False
        return True

    def _joint_is_right(self, data: bytes, octets: Octets) -> bool:
        """Each CRC covers all before it, those of the servos before included."""
        state = self._joint_state if data.startswith(self._joint) else -1
        for (begin, size), ids in zip(self._spans, self._ids, strict=True):
            if state < 0:
                return False
            state = self._check_joint(octets, begin, ids, size, state)
        return state >= 0


def _words(address: int, length: int) -> bytes:
    return bytes((address & 0xFF, address >> 8, length & 0xFF, length >> 8))


def _status_heads(run: Run) -> tuple[Octets, NDArray[np.int64]]:
    """Bytes before the error byte of each servo's reply, (k, 8), and their CRCs, (k,)."""
    size = run.length + 4
    heads = [HEADER + bytes((0, servo, size & 0xFF, size >> 8, Instruction.STATUS)) for servo in run.ids]
    matrix = np.frombuffer(b"".join(heads), np.uint8).reshape(len(heads), HEAD_SIZE)
    return matrix, np.array([crc16(head) for head in heads], np.int64)
