"""Encodes faces as exact numbers, as omote's binary frame, or as JSON, and the header with sender and times.

The header travels as the attachment of a sample, little-endian: version u8, flags u8, reserved u16, fence u64, holder
u64, sequence u64, time i64 and stamp i64 (ns of the sender's monotonic clock).
"""

from __future__ import annotations

import json
import math
import struct
from dataclasses import dataclass

import numpy as np

from controller.base.errors import LinkError
from controller.base.parameters import Floats, Parameters
from controller.fleet.lease import Token
from controller.formats.frame import Frame
from controller.formats.kinds.binary_format import BinaryDecoder, BinaryEncoder

VERSION = 1
"""Version of header and payloads; another version is refused."""
ENCODINGS = {"exact": "omote/exact;1", "binary": "omote/binary;1", "json": "application/json"}
_KINDS = {encoded: kind for kind, encoded in ENCODINGS.items()}
_HEADER = struct.Struct("<BBHQQQqq")
_COUNT = struct.Struct("<H")
_STOPPED = 1
_MAX_BYTES = 65_536
MAX_NUMBER = 1 << 61
"""Greatest fence, and greatest absolute time (ns, 73 years), that is accepted, so that sums stay within 64 bits."""


@dataclass(frozen=True)
class Header:
    """Sender and times of a face.

    token : of the sender. sequence : grows by 1 with each face of a conductor. time_ns : when the tick that mixed the
    face was due. stamp_ns : when the newest command in it came; both by the sender's clock. stopped : whether STOP
    keeps the servos off.
    """

    token: Token
    sequence: int
    time_ns: int
    stamp_ns: int = 0
    stopped: bool = False

    def encode(self) -> bytes:
        """Encode the header as attachment of a message."""
        flags = _STOPPED if self.stopped else 0
        return _HEADER.pack(VERSION, flags, 0, *self.token, self.sequence, self.time_ns, self.stamp_ns)

    @classmethod
    def decode(cls, data: bytes) -> Header:
        """Decode a header. Raises LinkError: damaged, or of another version."""
        if len(data) != _HEADER.size:
            raise LinkError(f"a header has {_HEADER.size} bytes, not {len(data)}")
        version, flags, _, fence, holder, sequence, time_ns, stamp_ns = _HEADER.unpack(data)
        if version != VERSION:
            raise LinkError(f"version {version} of the header is not understood", hint="pip install --upgrade omote")
        if fence > MAX_NUMBER or not -MAX_NUMBER <= time_ns <= MAX_NUMBER or not -MAX_NUMBER <= stamp_ns <= MAX_NUMBER:
            raise LinkError("a header with a number out of range")
        return cls(Token(fence, holder), sequence, time_ns, stamp_ns, bool(flags & _STOPPED))


class Payloads:
    """Encodes and decodes faces of ``parameters``.

    kind : encoding to use, a key of :data:`ENCODINGS`; all of them are decoded.
    """

    def __init__(self, parameters: Parameters, kind: str = "exact") -> None:
        self.kind, self.encoding = kind, ENCODINGS[kind]
        self._parameters, self._encoder = parameters, BinaryEncoder(parameters)
        self._all = np.ones(len(parameters), dtype=bool)

    def encode(self, values: Floats) -> bytes:
        """Encode ``values`` : (P,). Exact and JSON keep every bit; the binary frame rounds to 1/16384."""
        if self.kind == "exact":
            return _COUNT.pack(len(values)) + values.astype("<f8").tobytes()
        if self.kind == "json":
            named = dict(zip(self._parameters.names, values.tolist(), strict=True))
            return json.dumps({"version": VERSION, "parameters": named}).encode()
        return self._encoder.encode(Frame(values, self._all))[0]

    def decode(self, data: bytes, encoding: str) -> Floats:
        """Return (P,) values clipped to their ranges. Raises LinkError: damaged, not finite, or an unknown encoding."""
        if len(data) > _MAX_BYTES:
            raise LinkError(f"a face of {len(data)} bytes")
        kind = _KINDS.get(encoding)
        if kind == "exact":
            values = self._exact(data)
        elif kind == "json":
            values = self._json(data)
        elif kind == "binary":
            values = self._binary(data)
        else:
            raise LinkError(f"a face encoded as {encoding[:40]!r} is not understood")
        if not np.isfinite(values).all():
            raise LinkError("a face with a value that is not a finite number")
        return np.clip(values, self._parameters.low, self._parameters.high)

    def decode_exact(self, data: bytes, length: int) -> Floats:
        """Return (k, P) values, clipped to their ranges, of k concatenated exact faces of ``length`` bytes each.

        Raises LinkError: damaged, or not finite.
        """
        wanted = len(self._parameters)
        row = np.dtype([("count", "<u2"), ("values", "<f8", (wanted,))])
        if length != row.itemsize or len(data) % length:
            raise LinkError(f"faces of other parameters than the {wanted} known here")
        rows = np.frombuffer(data, row)
        if (rows["count"] != wanted).any():
            raise LinkError(f"faces of other parameters than the {wanted} known here")
        if not np.isfinite(rows["values"]).all():
            raise LinkError("a face with a value that is not a finite number")
        values: Floats = np.clip(rows["values"], self._parameters.low, self._parameters.high)
        return values

    def _exact(self, data: bytes) -> Floats:
        wanted = len(self._parameters)
        if len(data) != _COUNT.size + 8 * wanted or _COUNT.unpack_from(data)[0] != wanted:
            raise LinkError(f"a face of other parameters than the {wanted} known here")
        return np.frombuffer(data, "<f8", offset=_COUNT.size).astype(np.float64)

    def _binary(self, data: bytes) -> Floats:
        frames = BinaryDecoder(self._parameters).feed(data)
        if not frames:
            raise LinkError("a damaged binary frame")
        return np.where(frames[-1].mask, frames[-1].values, 0.0)

    def _json(self, data: bytes) -> Floats:
        try:
            table = json.loads(data)
            version, given = table["version"], table["parameters"].items()
            pairs = [(self._parameters.find(name), float(value)) for name, value in given]
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise LinkError(f"a face that is malformed JSON: {type(error).__name__}") from error
        if version != VERSION:
            raise LinkError(f"version {version!r} of a face is not understood", hint="pip install --upgrade omote")
        values = self._parameters.neutral()
        for at, value in pairs:
            if at is not None:
                values[at] = value if math.isfinite(value) else math.nan
        return values
