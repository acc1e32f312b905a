"""Frames of iFacialMocap and Facemotion3d in the form that is published, with everything that real streams have."""

from __future__ import annotations

import re

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.formats.kinds.ifacialmocap_format import IFacialMocapDecoder, IFacialMocapEncoder
from tests.controller.formats.faces import face

FRAME = (
    "mouthSmile_R-40|eyeLookOut_L-0|mouthUpperUp_L-11|jawOpen-12|trackingStatus-1|hapihapi-0|mouthRight-3|jawLeft-5|"
    "=head#-21.5,-6.0,-3.0,0.1,-0.2,-0.4|rightEye#6.0,2.4,0.1|leftEye#6.0,0.9,0.1|"
)


def read(text: str) -> dict[str, float]:
    (frame,) = IFacialMocapDecoder(P).feed(text.encode())
    return {name: round(float(frame.values[i]), 5) for i, name in enumerate(P.names) if frame.mask[i]}


def test_a_published_frame_is_read() -> None:
    assert read(FRAME) == {
        "mouthSmileRight": 0.4, "eyeLookOutLeft": 0.0, "mouthUpperUpLeft": 0.11, "jawOpen": 0.12, "mouthRight": 0.03,
        "jawLeft": 0.05, "headPitch": round(-21.5 / 40, 5), "headYaw": -0.1, "headRoll": -0.1,
        "rightEyePitch": 0.2, "rightEyeYaw": round(2.4 / 35, 5), "leftEyePitch": 0.2, "leftEyeYaw": round(0.9 / 35, 5),
    }  # fmt: skip


def test_facemotion3d_has_other_separators_and_keys() -> None:
    found = read("eyeBlinkLeft&30|FM_tongue_U&5|hapihapi&0|jawOpen&-2|=head#1,2,3,0,0,0|")
    assert found["eyeBlinkLeft"] == 0.3 and found["jawOpen"] == -0.02 and found["headPitch"] == 1 / 40
    (data,) = FORMATS.get("facemotion3d").encoder(P).encode(face(1))
    assert b"mouthSmileLeft&" in data and b"_L" not in data


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("jawOpen-1|jawOpen-7", 0.07),  # the last one counts
        ("mouthFunnel0|jawOpen-7", 0.07),  # a separator is missing
        ("jawOpen-7|leftEye#1,2,3|-0.67|||||3|", 0.07),
        ("jawOpen-7||0|.0|.0|||", 0.07),
        ("jawOpen--7", -0.07),  # the last separator, and a sign
        ("jawOpen-130", 1.3),
        ("jawOpen-7|cheekPuff-x|nose-5|head#|head#a,b,c|tail#1,2,3", 0.07),
        ("=jawOpen-7", 0.07),
    ],
)
def test_what_real_streams_have_does_not_spoil_a_frame(text: str, expected: float) -> None:
    assert read(text)["jawOpen"] == expected


def test_what_is_left_out_is_counted() -> None:
    decoder = IFacialMocapDecoder(P)
    decoder.feed(b"jawOpen-7|mouthFunnel0|nonsense-5|tail#1,2,3")
    assert decoder.refused == {
        "entries without a name and a number": 1, "unknown names": 1, "invalid rotations": 1,
    }  # fmt: skip


@pytest.mark.parametrize(
    "data", [b"", b"|", b"hello", b"\xff\xff", b"jawOpen-1e999", b"jawOpen-" + b"9" * 100, b"a-1|" * 5000]
)
def test_what_is_no_frame_is_refused(data: bytes) -> None:
    decoder = IFacialMocapDecoder(P)
    assert decoder.feed(data) == [] and decoder.refused["no frame of iFacialMocap or Facemotion3d"] == 1


def test_what_is_sent_has_the_published_form() -> None:
    (data,) = IFacialMocapEncoder(P).encode(face(3))
    shapes, _, turns = data.decode().partition("=")
    entries = shapes.strip("|").split("|")
    assert len(entries) == 52 and all(re.fullmatch(r"[a-zA-Z]+(_[LR])?-\d{1,3}", each) for each in entries)
    assert {"jawLeft", "mouthRight", "mouthSmile_L", "browInnerUp"} <= {each.partition("-")[0] for each in entries}
    number = r"-?\d+(\.\d+)?(e-\d+)?"
    assert re.fullmatch(rf"head#({number},){{5}}{number}\|(rightEye|leftEye)#.*\|(rightEye|leftEye)#.*\|", turns)


def test_values_are_sent_in_hundredths_of_a_whole_movement() -> None:
    values = P.neutral()
    values[[P.index("mouthSmileLeft"), P.index("jawOpen")]] = 0.5, 1.2
    (data,) = IFacialMocapEncoder(P).encode(Frame(values, np.ones(len(P), dtype=bool)))
    assert {"mouthSmile_L-50", "jawOpen-120", "browInnerUp-0"} <= set(data.decode().split("|"))


def test_nothing_is_sent_without_a_face() -> None:
    assert IFacialMocapEncoder(P).encode(Frame(P.neutral(), np.zeros(len(P), dtype=bool), face=False)) == []
