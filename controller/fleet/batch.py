"""Encodes the faces of many heads in one message, so that the cost of a message is paid once and not for each head.

Little-endian: version u16, count of faces u16, length of the names u32; the names as UTF-8, joined by line ends; for
each face its sequence u64, its stamp i64 (ns of the sender's clock) and the length of its payload u32; the payloads,
each as :class:`controller.fleet.payload.Payloads` makes it. The attached header states the sender and the time; its
sequence and stamp are 0.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from controller.base.errors import LinkError
from controller.base.parameters import Floats
from controller.fleet.payload import ENCODINGS, MAX_NUMBER, VERSION, Payloads

_HEAD = struct.Struct("<HHI")
_ROW = np.dtype([("sequence", "<u8"), ("stamp", "<i8"), ("length", "<u4")])
_FACE_ENCODINGS = {f"omote/faces-{kind};1": encoding for kind, encoding in ENCODINGS.items()}
"""Encoding of each face by the encoding of its batch."""
_MAX_FACES, _MAX_BYTES = 4096, 1 << 22
_MAX_WAIT_NS = 2_000_000


class Face(NamedTuple):
    """A face of one head; ``sequence`` and ``stamp_ns`` as in :class:`controller.fleet.payload.Header`."""

    head: str
    sequence: int
    stamp_ns: int
    values: Floats


class Batches:
    """Encodes and decodes batches, with the faces in them encoded by ``payloads``."""

    def __init__(self, payloads: Payloads) -> None:
        self._payloads, self.encoding = payloads, f"omote/faces-{payloads.kind};1"

    def encode(self, faces: list[tuple[str, int, int, bytes]]) -> bytes:
        """Return a batch. ``faces`` : name of the head, sequence, stamp and payload of each."""
        names = "\n".join(name for name, *_ in faces).encode()
        rows = np.array([(sequence, stamp, len(data)) for _, sequence, stamp, data in faces], _ROW)
        head = _HEAD.pack(VERSION, len(faces), len(names))
        return b"".join([head, names, rows.tobytes(), *(data for *_, data in faces)])

    def decode(self, data: bytes, encoding: str) -> Iterator[Face]:
        """Return the faces in the order of ``data``, after all of them were checked.

        Raises LinkError: damaged, not finite, or of an unknown encoding.
        """
        face_encoding = _FACE_ENCODINGS.get(encoding)
        if face_encoding is None:
            raise LinkError(f"faces encoded as {encoding[:40]!r} are not understood")
        names, rows, first = _table(data)
        ends = first + np.cumsum(rows["length"], dtype=np.int64)
        if len(data) != (ends[-1] if len(ends) else first):
            raise LinkError("a batch of faces whose lengths do not add up")
        if ((rows["stamp"] < -MAX_NUMBER) | (rows["stamp"] > MAX_NUMBER)).any():
            raise LinkError("a batch of faces with a time out of range")
        values = self._values(data, face_encoding, first, rows["length"], ends)
        return map(Face, names, rows["sequence"].tolist(), rows["stamp"].tolist(), values)

    def _values(self, data: bytes, encoding: str, first: int, lengths: np.ndarray, ends: np.ndarray) -> list[Floats]:
        """Return the values of all faces; exact ones are decoded together, which is as fast as decoding one."""
        if encoding == ENCODINGS["exact"] and len(lengths) and (lengths == lengths[0]).all():
            return list(self._payloads.decode_exact(data[first:], int(lengths[0])))
        starts = ends - lengths
        return [self._payloads.decode(data[a:b], encoding) for a, b in zip(starts, ends, strict=True)]


def _table(data: bytes) -> tuple[list[str], np.ndarray, int]:
    """Return names, rows, and the offset of the payloads. Raises LinkError: damaged, or of another version."""
    if not _HEAD.size <= len(data) <= _MAX_BYTES:
        raise LinkError(f"a batch of {len(data)} bytes")
    version, count, length = _HEAD.unpack_from(data)
    if version != VERSION:
        raise LinkError(f"version {version} of a batch is not understood", hint="pip install --upgrade omote")
    first = _HEAD.size + length + count * _ROW.itemsize
    if count > _MAX_FACES or first > len(data):
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

    A batch is complete when it has as many faces as the tick before had, or when its first face has waited for 2 ms, so
    that no face waits for heads that are mixed much later, or not at all.

    heads : number of faces expected at the first tick.
    """

    def __init__(self, heads: int) -> None:
        self._expected, self._count = heads, 0
        self._now_ns = self._first_ns = 0
        self._faces: list[tuple[str, int, int, bytes]] = []

    def begin(self, now_ns: int) -> tuple[int, list[tuple[str, int, int, bytes]]]:
        """Begin a tick, before its faces are added; return the time and the remaining faces of the tick before."""
        if now_ns == self._now_ns:
            return now_ns, []
        left = self._now_ns, self.take()
        if self._count:
            self._expected = self._count
        self._now_ns, self._count = now_ns, 0
        return left

    def add(self, head: str, sequence: int, stamp_ns: int, data: bytes) -> bool:
        """Add a face of the present tick; return whether the batch is complete."""
        if not self._faces:
            self._first_ns = time.monotonic_ns()
        self._faces.append((head, sequence, stamp_ns, data))
        self._count += 1
        return self._count == self._expected or time.monotonic_ns() - self._first_ns > _MAX_WAIT_NS

    def take(self) -> list[tuple[str, int, int, bytes]]:
        """Remove and return the gathered faces."""
        faces, self._faces = self._faces, []
        return faces
