"""Format of Live Link Face, version 6: datagrams that an iPhone sends to Unreal Engine.

The layout and order of the values are from EARFaceBlendShape of Unreal Engine and from public captures. Angles are in
radians and yaw is positive to the subject's right; both are inferred from those captures.
"""

from __future__ import annotations

import struct

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.formats.format import API, Format
from controller.formats.frame import Frame, Refusals

ANGLES = (
    "headYaw", "headPitch", "headRoll",
    "leftEyeYaw", "leftEyePitch", "leftEyeRoll", "rightEyeYaw", "rightEyePitch", "rightEyeRoll",
)  # fmt: skip
"""Names of the values after the 52 shapes, which are in the order of the base vocabulary."""
SHAPES = 52
COUNT = SHAPES + len(ANGLES)
YAWS = ("headYaw", "leftEyeYaw", "rightEyeYaw")
"""Angles whose sign is the opposite of omote's."""

_VERSION = 6
_RATE_HZ = 60
_DAY_S = 86_400.0
_MAX_NAME_BYTES = 1024
_LENGTH = struct.Struct(">i")
_TIME = struct.Struct(">ifii")
_DEVICE = b"6F6D6F74-6500-4000-8000-000000000001"
_SUBJECT = b"omote"
_HEAD = struct.pack(">Bi", _VERSION, len(_DEVICE)) + _DEVICE + _LENGTH.pack(len(_SUBJECT)) + _SUBJECT


class _Table:
    """Maps the 61 values of a datagram to parameters.

    source : (n,) indices of values that have a parameter. target : (n,) indices of those parameters. scale : (n,)
    value in the datagram for a parameter of 1.
    """

    def __init__(self, parameters: Parameters) -> None:
        names = (*parameters.names[:SHAPES], *ANGLES)
        self.source = np.array([i for i, name in enumerate(names) if parameters.find(name) is not None])
        self.target = parameters.indices(names[i] for i in self.source)
        full = parameters.full_scale_rad[self.target]
        sign = np.array([-1.0 if names[i] in YAWS else 1.0 for i in self.source])
        self.scale: Floats = np.where(np.isnan(full), 1.0, sign * full)


class LiveLinkDecoder:
    """Decodes datagrams of version 6; one that ends after the frame rate reports that no face is seen."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._neutral = parameters.neutral()
        self._nothing = np.zeros(len(self._neutral), dtype=bool)
        self._table = _Table(parameters)

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame, or none for an invalid datagram."""
        try:
            return [self._frame(message)]
        except (struct.error, IndexError):
            self.refused.add("too short")
        except ValueError as error:
            self.refused.add(str(error))
        return []

    def _frame(self, message: bytes) -> Frame:
        if message[0] != _VERSION:
            raise ValueError(_version_fault(message[0]))
        _, offset = _read_text(message, 1)
        subject, offset = _read_text(message, offset)
        number, part, numerator, denominator = _TIME.unpack_from(message, offset)
        offset += _TIME.size
        time_s = (number + part) * denominator / numerator if numerator > 0 and 0.0 <= part <= 1.0 else None
        if offset == len(message):
            return Frame(self._neutral, self._nothing, time_s, number, False, subject)
        values, mask = self._values(message, offset)
        return Frame(values, mask, time_s, number, True, subject)

    def _values(self, message: bytes, offset: int) -> tuple[Floats, Flags]:
        count = message[offset]
        if len(message) - offset - 1 != 4 * count:
            raise ValueError("the count does not fit the length")
        if not count:
            raise ValueError("no values")
        given = np.frombuffer(message, ">f4", count, offset + 1)
        table, values, mask = self._table, self._neutral.copy(), self._nothing.copy()
        known = slice(None) if count >= COUNT else table.source < count
        with np.errstate(invalid="ignore"):  # values that are not finite are left out below
            found = given[table.source[known]] / table.scale[known]
        finite = np.isfinite(found)
        target = table.target[known]
        if not finite.all():
            self.refused.add("values that are not numbers")
            found, target = found[finite], target[finite]
        values[target] = found
        mask[target] = True
        return values, mask


class LiveLinkEncoder:
    """Encodes datagrams of version 6; without a time of their own, frames are timed at 60 Hz."""

    def __init__(self, parameters: Parameters) -> None:
        self._table = _Table(parameters)
        self._sent = 0

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one datagram; parameters that the frame does not give are 0."""
        seconds = self._sent / _RATE_HZ if frame.time_s is None else frame.time_s % _DAY_S
        self._sent += 1
        number, part = divmod(seconds * _RATE_HZ, 1.0)
        head = _HEAD + _TIME.pack(int(number), part, _RATE_HZ, 1)
        if not frame.face:
            return [head]
        values = np.zeros(COUNT, dtype=">f4")
        table = self._table
        values[table.source] = np.where(frame.mask, frame.values, 0.0)[table.target] * table.scale
        return [head + bytes((COUNT,)) + values.tobytes()]


def _read_text(message: bytes, offset: int) -> tuple[str, int]:
    """Read a string that follows its length; return it with the offset behind it."""
    (length,) = _LENGTH.unpack_from(message, offset)
    offset += _LENGTH.size
    if not 0 <= length <= _MAX_NAME_BYTES:
        raise ValueError("the length of a name is wrong")
    if offset + length > len(message):
        raise ValueError("too short")
    return message[offset : offset + length].decode("utf-8", "replace"), offset + length


def _version_fault(version: int) -> str:
    if version == 5:
        return "version 5, of an older app: update Live Link Face"
    return "not a datagram of Live Link Face, version 6"


def _carries(parameters: Parameters) -> Flags:
    mask = np.zeros(len(parameters), dtype=bool)
    mask[_Table(parameters).target] = True
    return mask


FORMAT = Format(
    api=API,
    kind="livelink",
    title="Live Link Face, version 6",
    transports=("udp",),
    port=11111,
    decoder=LiveLinkDecoder,
    encoder=LiveLinkEncoder,
    carries=_carries,
    most=2048 + 2 * _MAX_NAME_BYTES,
)
