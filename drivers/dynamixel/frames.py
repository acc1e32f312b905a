"""Precomputed packets of a control cycle: a sync write of goals, and group reads whose replies are checked at once.

Replies that are not exactly as expected (one missing, late, damaged or stuffed) are not decoded here: the caller uses
the general readers of ``packet`` and ``sdk`` then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.packets.packet import (
    BROADCAST_ID,
    HEADER,
    Instruction,
    StatusPacket,
    crc16,
    encode_fast_head,
    encode_instruction,
)

HEAD_SIZE = 8
"""Bytes of a status packet before its error byte."""
STATUS_SIZE = 11
"""Bytes of a status packet without data."""
PART_SIZE = 4
"""Bytes of a servo's part of a joint reply without data: error, id and CRC."""
_ROWS_AT = 12
"""Where the rows of a sync write begin: behind the header, INST, address and length."""


class GoalFrame:
    """A sync write of one register to the same servos every cycle: only the values change.

    ids : k servo ids.
    address, size : the register; 2 or 4 bytes.
    places : (k,) int64, which of the values given to `encode` are theirs.
    """

    def __init__(self, ids: Sequence[int], address: int, size: int, places: NDArray[np.int64]) -> None:
        from drivers.core.kernels import put_goals  # imported lazily: loads numba

        self._put_goals = put_goals
        self._size, self._places = size, places
        rows = b"".join(bytes((servo,)) + bytes(size) for servo in ids)
        frame = encode_instruction(BROADCAST_ID, Instruction.SYNC_WRITE, _words(address, size) + rows)
        self._frame = bytearray(frame)
        self._state = crc16(frame[:_ROWS_AT])
        self._octets = np.frombuffer(self._frame, np.uint8)

    def encode(self, values: NDArray[np.int32]) -> bytes:
        """The packet for the values of the whole bus, ``(n,)``, stuffed where they need it."""
        if self._put_goals(self._octets, _ROWS_AT, values, self._places, self._size, self._state):
            return bytes(self._frame)
        return encode_instruction(BROADCAST_ID, Instruction.SYNC_WRITE, bytes(self._frame[8:-2]))


class Run(NamedTuple):
    """Part of a group read: servos of which the same registers are read, first `address` and `length`."""

    ids: tuple[int, ...]
    address: int
    length: int


class GroupRead:
    """A read of many servos that is sent repeatedly: one sync read, or a bulk read where addresses differ.

    Where it is `fast`, all of them answer in one joint packet.

    frame : the instruction.
    wanted : data bytes expected by id, in the order of the replies.
    size : bytes of all replies, not stuffed.
    spans, heads, states : where each reply lies and how it begins, see ``drivers.core.kernels``.
    """

    def __init__(self, runs: Sequence[Run], fast: bool = False) -> None:
        from drivers.core.kernels import check_joint, check_replies  # imported lazily: loads numba

        self._check = check_joint if fast else check_replies
        self.runs, self.fast = tuple(runs), fast
        self.wanted = {servo: run.length for run in runs for servo in run.ids}
        self.frame = encode_instruction(BROADCAST_ID, *self._instruction())
        self.spans = _spans(self.wanted, fast)
        self.size = int(self.spans[-1, 2])
        heads = (
            [encode_fast_head(list(self.wanted.values()))] if fast else [_status_head(*w) for w in self.wanted.items()]
        )
        self.heads = np.frombuffer(b"".join(heads), np.uint8).reshape(-1, HEAD_SIZE)
        self.states = np.array([crc16(head) for head in heads], np.int64)

    def _instruction(self) -> tuple[Instruction, bytes]:
        spans = [_words(run.address, run.length) for run in self.runs]
        if len(spans) == 1:
            code = Instruction.FAST_SYNC_READ if self.fast else Instruction.SYNC_READ
            return code, spans[0] + bytes(self.runs[0].ids)
        entries = [bytes((i,)) + span for run, span in zip(self.runs, spans, strict=True) for i in run.ids]
        return Instruction.FAST_BULK_READ if self.fast else Instruction.BULK_READ, b"".join(entries)

    def decode(self, data: bytes) -> dict[int, StatusPacket] | None:
        """Replies by servo id, where `data` is exactly what was requested; else None."""
        octets = np.frombuffer(data, np.uint8)
        if len(data) != self.size or not self._check(octets, self.spans, self.heads, self.states):
            return None
        skip = 2 if self.fast else 1  # error byte, and in a joint reply the id
        spans = self.spans.tolist()
        return {i: StatusPacket(i, data[error], data[error + skip : end - 2]) for i, error, end in spans}


def _spans(wanted: Mapping[int, int], fast: bool) -> NDArray[np.int64]:
    """Each servo's id, where its error byte lies and where its reply ends; see ``core.kernels.check_replies``."""
    error, extra, begin = (0, PART_SIZE, HEAD_SIZE) if fast else (HEAD_SIZE, STATUS_SIZE, 0)
    spans = np.empty((len(wanted), 3), np.int64)
    for k, (servo, length) in enumerate(wanted.items()):
        spans[k] = servo, begin + error, begin + extra + length
        begin += extra + length
    return spans


def _words(address: int, length: int) -> bytes:
    return bytes((address & 0xFF, address >> 8, length & 0xFF, length >> 8))


def _status_head(servo: int, length: int) -> bytes:
    """Bytes before the error byte of a servo's reply."""
    size = length + 4
    return HEADER + bytes((0, servo, size & 0xFF, size >> 8, Instruction.STATUS))
