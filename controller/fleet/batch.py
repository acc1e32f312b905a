"""Faces of many heads in one message: what every message costs is paid once for all of them, not once a head.

Little-endian: version u16, count of faces u16, length of the names u32; the names as UTF-8, joined by line ends; for
each face its sequence u64, its stamp i64 (ns of the sender's clock) and the length of its payload u32; the payloads,
each as :class:`controller.fleet.payload.Payloads` makes it. Who sent it and when it was mixed say the header that is
attached, whose own sequence and stamp are 0.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from controller.base.errors import LinkError
from controller.base.parameters import Floats
from controller.fleet.payload import ENCODINGS, MOST, VERSION, Payloads

_HEAD = struct.Struct("<HHI")
_ROW = np.dtype([("sequence", "<u8"), ("stamp", "<i8"), ("length", "<u4")])
_OF = {f"omote/faces-{kind};1": encoding for kind, encoding in ENCODINGS.items()}
_MOST_FACES, _MOST_BYTES = 4096, 1 << 22
_WAIT_NS = 2_000_000


class Face(NamedTuple):
    """A face of one head; ``sequence`` and ``stamp_ns`` are those of a header."""

    head: str
    sequence: int
    stamp_ns: int
    values: Floats


class Batches:
    """Encodes and decodes batches; each face in them as ``payloads`` does."""

    def __init__(self, payloads: Payloads) -> None:
        self._payloads, self.encoding = payloads, f"omote/faces-{payloads.kind};1"

    def encode(self, faces: list[tuple[str, int, int, bytes]]) -> bytes:
        """``faces`` : of each the head's name, sequence, stamp and payload."""
        names = "\n".join(name for name, *_ in faces).encode()
        rows = np.array([(sequence, stamp, len(data)) for _, sequence, stamp, data in faces], _ROW)
        head = _HEAD.pack(VERSION, len(faces), len(names))
        return b"".join([head, names, rows.tobytes(), *(data for *_, data in faces)])

    def decode(self, data: bytes, encoding: str) -> Iterator[Face]:
        """Faces in the order in which they are in ``data``, all of them checked before the first is given.

        Raises LinkError: damaged, not finite, or of an encoding that is not known.
        """
        of = _OF.get(encoding)
        if of is None:
            raise LinkError(f"faces encoded as {encoding[:40]!r} are not understood")
        names, rows, first = _table(data)
        ends = first + np.cumsum(rows["length"], dtype=np.int64)
        if len(data) != (ends[-1] if len(ends) else first):
            raise LinkError("a batch of faces whose lengths do not add up")
        if ((rows["stamp"] < -MOST) | (rows["stamp"] > MOST)).any():
            raise LinkError("a batch of faces with a time that no clock has")
        values = self._values(data, of, first, rows["length"], ends)
        return map(Face, names, rows["sequence"].tolist(), rows["stamp"].tolist(), values)

    def _values(self, data: bytes, encoding: str, first: int, lengths: np.ndarray, ends: np.ndarray) -> list[Floats]:
        """The values of all faces; exact ones at once, which takes as long as one of them alone."""
        if encoding == ENCODINGS["exact"] and len(lengths) and (lengths == lengths[0]).all():
            return list(self._payloads.decode_exact(data[first:], int(lengths[0])))
        starts = ends - lengths
        return [self._payloads.decode(data[a:b], encoding) for a, b in zip(starts, ends, strict=True)]


def _table(data: bytes) -> tuple[list[str], np.ndarray, int]:
    """Names, rows, and where payloads begin. Raises LinkError: damaged, or of another version."""
    if not _HEAD.size <= len(data) <= _MOST_BYTES:
        raise LinkError(f"a batch of {len(data)} bytes")
    version, count, length = _HEAD.unpack_from(data)
    if version != VERSION:
        raise LinkError(f"version {version} of a batch is not understood", hint="pip install --upgrade omote")
    first = _HEAD.size + length + count * _ROW.itemsize
    if count > _MOST_FACES or first > len(data):
        raise LinkError("a batch of faces that is cut short")
    try:
        text = data[_HEAD.size : _HEAD.size + length].decode()
    except UnicodeDecodeError as error:
        raise LinkError("a batch with names that are not UTF-8") from error
    names = text.split("\n") if count else []
    if len(names) != count:
        raise LinkError(f"a batch of {count} faces with {len(names)} names")
    return names, np.frombuffer(data, _ROW, count, _HEAD.size + length), first


class Gathering:
    """Gathers the faces of a tick until they are sent together.

    A batch is full when as many faces of the tick were gathered as of the one before, or when its first face has waited
    for 2 ms: so no face waits for heads that are mixed much later, or not at all.

    heads : how many there are at first.
    """

    def __init__(self, heads: int) -> None:
        self._expected, self._count = heads, 0
        self._now_ns = self._first_ns = 0
        self._faces: list[tuple[str, int, int, bytes]] = []

    def begin(self, now_ns: int) -> tuple[int, list[tuple[str, int, int, bytes]]]:
        """Called before a face of the tick at ``now_ns`` is added: what another tick has left, and when that was."""
        if now_ns == self._now_ns:
            return now_ns, []
        left = self._now_ns, self.take()
        if self._count:
            self._expected = self._count
        self._now_ns, self._count = now_ns, 0
        return left

    def add(self, head: str, sequence: int, stamp_ns: int, data: bytes) -> bool:
        """Add a face of the present tick; returns whether the batch is full."""
        if not self._faces:
            self._first_ns = time.monotonic_ns()
        self._faces.append((head, sequence, stamp_ns, data))
        self._count += 1
        return self._count == self._expected or time.monotonic_ns() - self._first_ns > _WAIT_NS

    def take(self) -> list[tuple[str, int, int, bytes]]:
        """What was gathered, which is gone from here."""
        faces, self._faces = self._faces, []
        return faces
