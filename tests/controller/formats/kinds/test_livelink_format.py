"""Live Link datagrams against the layout that is documented, and damaged ones."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.kinds.livelink_format import LiveLinkDecoder, LiveLinkEncoder
from tests.controller.formats.faces import face

DEVICE = b"A1B2C3D4-0000-1111-2222-333344445555"
NAMES = """
EyeBlinkLeft EyeLookDownLeft EyeLookInLeft EyeLookOutLeft EyeLookUpLeft EyeSquintLeft EyeWideLeft EyeBlinkRight
EyeLookDownRight EyeLookInRight EyeLookOutRight EyeLookUpRight EyeSquintRight EyeWideRight JawForward JawLeft
JawRight JawOpen MouthClose MouthFunnel MouthPucker MouthLeft MouthRight MouthSmileLeft MouthSmileRight
MouthFrownLeft MouthFrownRight MouthDimpleLeft MouthDimpleRight MouthStretchLeft MouthStretchRight MouthRollLower
MouthRollUpper MouthShrugLower MouthShrugUpper MouthPressLeft MouthPressRight MouthLowerDownLeft MouthLowerDownRight
MouthUpperUpLeft MouthUpperUpRight BrowDownLeft BrowDownRight BrowInnerUp BrowOuterUpLeft BrowOuterUpRight CheekPuff
CheekSquintLeft CheekSquintRight NoseSneerLeft NoseSneerRight TongueOut HeadYaw HeadPitch HeadRoll LeftEyeYaw
LeftEyePitch LeftEyeRoll RightEyeYaw RightEyePitch RightEyeRoll
"""
ORDER = NAMES.split()
"""EARFaceBlendShape of Unreal Engine."""


def datagram(values: list[float] | None, *, version: int = 6, name: bytes = b"phone", count: int | None = None,
             number: int = 1000, part: float = 0.25) -> bytes:  # fmt: skip
    """A datagram as the layout says, written without the encoder."""
    data = struct.pack(">B", version) + struct.pack(">i", len(DEVICE)) + DEVICE
    data += struct.pack(">i", len(name)) + name + struct.pack(">ifii", number, part, 60, 1)
    if values is not None:
        data += struct.pack(">B", len(values) if count is None else count) + struct.pack(f">{len(values)}f", *values)
    return data


def test_every_value_reaches_its_parameter() -> None:
    for i, name in enumerate(ORDER):
        values = [0.0] * 61
        values[i] = 0.25
        (frame,) = LiveLinkDecoder(P).feed(datagram(values))
        at = P.find(name)
        if at is None:  # rolls of the eyes
            assert not frame.values.any()
            continue
        full = P.full_scale_rad[at]
        sign = -1 if name.endswith("Yaw") else 1
        assert frame.values[at] == pytest.approx(0.25 if math.isnan(full) else sign * 0.25 / full)
        assert np.count_nonzero(frame.values) == 1


def test_a_datagram_has_the_length_that_is_documented() -> None:
    subject = len("omote")
    (long,) = LiveLinkEncoder(P).encode(face(1, 2.0))
    assert len(long) == 306 + subject
    nobody = face(1, 2.0)
    (short,) = LiveLinkEncoder(P).encode(type(nobody)(nobody.values, nobody.mask, 2.0, None, False))
    assert len(short) == 61 + subject
    assert long[0] == 6 and struct.unpack_from(">i", long, 1) == (36,)


def test_time_subject_and_number_are_read() -> None:
    (frame,) = LiveLinkDecoder(P).feed(datagram([0.5] * 61, name="Zoë".encode(), number=3600, part=0.5))
    assert (frame.subject, frame.sequence, frame.time_s) == ("Zoë", 3600, pytest.approx(60 + 0.5 / 60))
    (written,) = LiveLinkDecoder(P).feed(LiveLinkEncoder(P).encode(face(1, 90_000.0))[0])
    assert written.time_s == pytest.approx(3600.0, abs=1e-3)  # after midnight


def test_a_short_datagram_says_that_nobody_is_seen() -> None:
    decoder = LiveLinkDecoder(P)
    (frame,) = decoder.feed(datagram(None))
    assert not frame.face and not frame.mask.any() and frame.time_s is not None and not decoder.refused


def test_values_above_one_are_kept_and_no_numbers_are_left_out() -> None:
    decoder = LiveLinkDecoder(P)
    values = [1.3] * 61
    values[17] = math.nan
    (frame,) = decoder.feed(datagram(values))
    assert frame.values[0] == pytest.approx(1.3) and not frame.mask[17] and np.isfinite(frame.values).all()
    assert decoder.refused == {"values that are not numbers": 1}


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "too short"), (b"\6", "too short"), (datagram([0.5] * 61)[:40], "too short"),
        (datagram([0.5] * 61)[:-1], "the count does not fit the length"),
        (datagram([0.5] * 61) + b"?", "the count does not fit the length"),
        (datagram([0.5] * 60, count=61), "the count does not fit the length"),
        (datagram([]), "no values"),
        (datagram([0.5] * 61, version=5), "version 5, of an older app: update Live Link Face"),
        (datagram([0.5] * 61, version=7), "not a datagram of Live Link Face, version 6"),
        (b"\6" + struct.pack(">i", -1) + bytes(300), "the length of a name is wrong"),
        (b"\6" + struct.pack(">i", 1 << 30) + bytes(300), "the length of a name is wrong"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_with_a_reason(data: bytes, why: str) -> None:
    decoder = LiveLinkDecoder(P)
    assert decoder.feed(data) == [] and decoder.refused == {why: 1}


def test_other_counts_are_read_as_far_as_they_go() -> None:
    (few,) = LiveLinkDecoder(P).feed(datagram([0.5] * 52))
    assert few.mask[:52].all() and not few.mask[52:].any()
    (more,) = LiveLinkDecoder(P).feed(datagram([0.5] * 68))
    assert more.mask.all()


def test_a_rate_that_is_none_gives_no_time() -> None:
    data = bytearray(datagram([0.5] * 61))
    at = 1 + 4 + len(DEVICE) + 4 + len(b"phone") + 8
    data[at : at + 4] = bytes(4)
    (frame,) = LiveLinkDecoder(P).feed(bytes(data))
    assert frame.time_s is None and frame.mask.all()
